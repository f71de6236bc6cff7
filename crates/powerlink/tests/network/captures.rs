//! What our own networks look like to another analyser: captures of whole networks, read by tshark where it is installed.
//!
//! The files stay in `captures` below the folder for temporary files of the build (`target/tmp`); `.ci/run` reads them again, and
//! fails without tshark.

use std::fs::{self, File};
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Arc, Mutex};

use powerlink::link::pcap::{PcapReader, PcapWriter};
use powerlink::mn::{MnEvent, SdoCommand};
use powerlink::wire::{Asnd, Frame, ServiceId, message};

use super::device::{BLOB_BYTES, PDO_BYTES, Polling};
use super::world::{Setup, World};

const BOOT_CYCLES: u64 = 1_000;

fn file(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("captures");
    fs::create_dir_all(&folder).unwrap();
    folder.join(name).with_extension("pcap")
}

/// Runs a network from the start with everything recorded, then has the capture read; `look` is told every frame.
fn capture(name: &str, setup: &Setup, run: impl FnOnce(&mut World), mut look: impl FnMut(&Frame<'_>, &[u8])) {
    let path = file(name);
    let mut world = World::new(setup);
    let writer = PcapWriter::new(BufWriter::new(File::create(&path).unwrap())).unwrap();
    let writer = Arc::new(Mutex::new(writer));
    let tapped = Arc::clone(&writer);
    world.hub.set_tap(Box::new(move |at_ns, frame| {
        tapped.lock().unwrap().write(at_ns, frame).unwrap()
    }));
    run(&mut world);
    drop(world);
    Arc::into_inner(writer).unwrap().into_inner().unwrap().finish().unwrap();
    let octets = fs::read(&path).unwrap();
    let mut frames = 0;
    let mut last_ns = 0;
    for captured in PcapReader::new(&octets).unwrap() {
        let captured = captured.unwrap();
        assert!(captured.stamp_ns >= last_ns, "frame {frames} of {name}");
        last_ns = captured.stamp_ns;
        frames += 1;
        look(&Frame::parse(captured.frame).unwrap(), captured.frame);
    }
    ask_tshark(&path, frames);
}

/// Every frame is POWERLINK, none is malformed, tshark has nothing to remark.
fn ask_tshark(path: &Path, frames: usize) {
    let tshark = |filter: &str| Command::new("tshark").arg("-r").arg(path).args(["-Y", filter]).output();
    let Ok(wrong) = tshark("_ws.malformed or _ws.expert or not epl") else {
        println!("tshark is not installed: nobody has read {}", path.display());
        return;
    };
    assert!(wrong.status.success(), "{}", String::from_utf8_lossy(&wrong.stderr));
    let text = String::from_utf8_lossy(&wrong.stdout);
    assert_eq!(
        text.lines().take(10).collect::<Vec<_>>(),
        Vec::<&str>::new(),
        "{}",
        path.display()
    );
    let all = tshark("epl").unwrap();
    assert_eq!(String::from_utf8_lossy(&all.stdout).lines().count(), frames);
}

fn service(frame: &Frame<'_>, octets: &[u8]) -> Option<ServiceId> {
    matches!(frame, Frame::Asnd(_)).then(|| ServiceId::from(octets[17]))
}

#[test]
fn a_boot_and_the_steady_state() {
    let mut services = [0; 4];
    capture(
        "boot",
        &Setup::new(1, 3),
        |world| {
            world.run_until_operational(BOOT_CYCLES);
            world.run(500);
        },
        |frame, octets| match service(frame, octets) {
            Some(ServiceId::IdentResponse) => services[0] += 1,
            Some(ServiceId::StatusResponse) => services[1] += 1,
            Some(ServiceId::NmtCommand) => services[2] += 1,
            Some(ServiceId::Sdo) => services[3] += 1,
            Some(_) | None => {}
        },
    );
    // Three nodes: identified twice; told four things, alone or together; 16 objects written and answered.
    assert!(
        services[0] >= 6 && services[1] >= 3 && services[2] >= 4 && services[3] >= 96,
        "{services:?}"
    );
}

#[test]
fn errors_losses_and_resets() {
    let (mut news, mut entries, mut resets) = (0, 0, 0);
    capture(
        "errors",
        &Setup::new(2, 3),
        |world| {
            world.run_until_operational(BOOT_CYCLES);
            for code in [0x8611, 0x4310, 0x8311] {
                let node = world.devices[1].node.as_mut().unwrap();
                node.report_error(402, code, [1, 2, 3, 4, 5, 6, 7, 8]);
                world.run(50);
            }
            // A node is switched off and on, another one's PRes are lost for a while, a cycle comes late.
            world.power(2, false);
            world.run(100);
            world.power(2, true);
            world.nap = Some((0, 2_500_000));
            world.run(5);
            let mut left = 6;
            world.vanish = Box::new(move |id, octets| {
                let hit = left > 0 && id == 1 && octets[14] == message::PRES;
                left -= u32::from(hit);
                hit
            });
            world.run(20);
            assert_eq!(world.mn.statistics(0).faults, 1);
            world.run_until_operational(BOOT_CYCLES);
            let told = |code| {
                let is_told =
                    |event: &MnEvent| matches!(event, MnEvent::ErrorEntry { node: 2, entry } if entry.code == code);
                world.events.iter().filter(|(_, event)| is_told(event)).count()
            };
            assert_eq!([0x8611, 0x4310, 0x8311].map(told), [1; 3]);
        },
        |frame, _| match frame {
            Frame::Pres(pres) => news += u32::from(pres.exception_new),
            Frame::Asnd(Asnd::StatusResponse(status)) => entries += status.entries.iter().count(),
            Frame::Asnd(Asnd::NmtCommand(command)) => resets += u32::from(u8::from(command.command) == 0x28),
            _ => {}
        },
    );
    assert!(news > 0 && entries >= 3 && resets >= 2, "{news} {entries} {resets}");
}

#[test]
fn multiplexed_nodes() {
    let mut setup = Setup::new(3, 4);
    setup.polling = vec![
        (2, Polling::Multiplexed { cycle: 1, of: 3 }),
        (3, Polling::Multiplexed { cycle: 2, of: 3 }),
        (4, Polling::Multiplexed { cycle: 2, of: 3 }),
    ];
    let mut multiplexed = [0; 5];
    capture(
        "multiplexing",
        &setup,
        |world| {
            world.run_until_operational(BOOT_CYCLES);
            let before: Vec<_> = (0..4).map(|index| world.mn.statistics(index).pres_received).collect();
            world.run(300);
            let polls: Vec<_> = (0..4)
                .map(|index| world.mn.statistics(index).pres_received - before[index])
                .collect();
            assert_eq!(polls, [300, 100, 100, 100]);
        },
        |frame, octets| {
            if let Frame::Pres(pres) = frame {
                multiplexed[usize::from(octets[16])] += u32::from(pres.multiplexed);
            }
        },
    );
    assert!(
        multiplexed[1] == 0 && multiplexed[2..].iter().all(|count| *count > 100),
        "{multiplexed:?}"
    );
}

#[test]
fn chained_nodes() {
    let mut setup = Setup::new(4, 3);
    setup.polling = vec![
        (1, Polling::Chained { offset: 0 }),
        (
            2,
            Polling::Chained {
                offset: PDO_BYTES as u16,
            },
        ),
    ];
    let (mut syncs, mut from_mn) = (0, 0);
    capture(
        "chaining",
        &setup,
        |world| {
            world.run_until_operational(BOOT_CYCLES);
            let before: Vec<_> = (0..3).map(|index| world.mn.statistics(index).pres_received).collect();
            world.run(300);
            let received: Vec<_> = (0..3)
                .map(|index| world.mn.statistics(index).pres_received - before[index])
                .collect();
            assert_eq!(received, [300; 3]);
        },
        |frame, octets| {
            syncs += u32::from(service(frame, octets) == Some(ServiceId::SyncResponse));
            from_mn += u32::from(matches!(frame, Frame::Pres(_)) && octets[16] == 240);
        },
    );
    assert!(syncs >= 4 && from_mn >= 300, "{syncs} {from_mn}");
}

#[test]
fn a_value_of_several_segments_is_written_and_read() {
    let value: Vec<u8> = (0..BLOB_BYTES).map(|at| (at * 7) as u8).collect();
    let mut segments = [0; 4];
    capture(
        "segments",
        &Setup::new(5, 2),
        |world| {
            world.run_until_operational(BOOT_CYCLES);
            let write = SdoCommand::Write {
                index: 0x2002,
                sub: 0,
                octets: BLOB_BYTES,
            };
            let read = SdoCommand::Read { index: 0x2002, sub: 0 };
            for (command, buffer) in [(write, value.clone()), (read, vec![0; BLOB_BYTES])] {
                world.mn.sdo_request(1, command, buffer.leak()).unwrap();
                let result = loop {
                    world.cycle();
                    assert!(world.cycle < 2 * BOOT_CYCLES);
                    if let Some(result) = world.mn.sdo_result(1) {
                        break result;
                    }
                };
                assert!(result.result.is_ok(), "{:?}", result.result);
                assert_eq!(result.buffer, value);
            }
        },
        |frame, _| {
            if let Frame::Asnd(Asnd::Sdo(data)) = frame {
                segments[usize::from(data[6] >> 4 & 3)] += 1;
            }
        },
    );
    // Both ways: initiate, segments, complete.
    assert!(segments[1] == 2 && segments[2] >= 4 && segments[3] == 2, "{segments:?}");
}
