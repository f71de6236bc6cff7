//! What our own network looks like to another analyser: every frame, as it leaves and as it comes back, read by tshark where it is
//! installed. The files stay in `captures` below the folder for temporary files of the build.

use super::world::World;
use ethercat::wire::coe::Object;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Arc, Mutex};

/// A capture of Ethernet with nanoseconds.
const PCAP_HEADER: [u32; 6] = [0xA1B2_3C4D, 0x0004_0002, 0, 0, 65_535, 1];

fn record(name: &str, run: impl FnOnce(&mut World)) -> (PathBuf, usize) {
    let mut world = World::drives(3, 11);
    let octets: Vec<u8> = PCAP_HEADER.iter().flat_map(|word| word.to_le_bytes()).collect();
    let file = Arc::new(Mutex::new((octets, 0)));
    let tapped = Arc::clone(&file);
    world.tap = Box::new(move |at_ns, frame| {
        let (octets, frames) = &mut *tapped.lock().unwrap();
        let length = frame.len() as u32;
        for word in [
            (at_ns / 1_000_000_000) as u32,
            (at_ns % 1_000_000_000) as u32,
            length,
            length,
        ] {
            octets.extend(word.to_le_bytes());
        }
        octets.extend(frame);
        *frames += 1;
    });
    run(&mut world);
    let (octets, frames) = &*file.lock().unwrap();
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("captures");
    fs::create_dir_all(&folder).unwrap();
    let path = folder.join(name).with_extension("pcap");
    fs::write(&path, octets).unwrap();
    (path, *frames)
}

/// Frames that a display filter of tshark finds; `None`: it is not installed.
fn found(path: &Path, filter: &str) -> Option<Vec<String>> {
    let found = Command::new("tshark").arg("-r").arg(path).args(["-Y", filter]).output();
    let Ok(found) = found else {
        println!("tshark is not installed: nobody has read {}", path.display());
        return None;
    };
    assert!(found.status.success(), "{}", String::from_utf8_lossy(&found.stderr));
    Some(
        String::from_utf8_lossy(&found.stdout)
            .lines()
            .map(str::to_owned)
            .collect(),
    )
}

#[test]
fn a_start_objects_and_a_broken_cable() {
    let (path, frames) = record("ethercat", |world| {
        world.run_to_op(3000);
        world.enable = true;
        world.run(300);
        let name = Object {
            index: 0x1008,
            sub: 0,
            complete: false,
        };
        world.main.sdo_read(0, name).unwrap();
        world.run(50);
        world.segment.cut(2);
        world.run(100);
    });
    let Some(wrong) = found(&path, "_ws.malformed or not ecat") else {
        return;
    };
    assert_eq!(wrong.iter().take(10).collect::<Vec<_>>(), Vec::<&String>::new());
    assert_eq!(found(&path, "ecat").unwrap().len(), frames);
    // It reads in them what was meant: states, mails, working counters of 3.
    for (filter, least) in [
        ("ecat.cmd == 0x0e", 400),
        ("ecat.cmd == 0x0c && ecat.cnt == 3", 300),
        ("ecat_mailbox.coe.sdoreq", 50),
        ("ecat_mailbox.coe.sdores", 25),
        ("ecat_mailbox.coe.sdoidx == 0x1008", 1),
    ] {
        let count = found(&path, filter).unwrap().len();
        assert!(count >= least, "{filter}: {count}");
    }
}
