//! Files that are damaged, foreign or cut short are refused with a message; reading them never panics.

use hal_pins::{Attached, Hal, HalError};
use proptest::prelude::*;
use std::os::unix::fs::FileExt;
use std::path::PathBuf;

struct Rig {
    dirs: Vec<PathBuf>,
    hal: Hal,
    good: Vec<u8>,
    _dir: tempfile::TempDir,
}

/// A control with an output, two inputs and a net.
fn rig() -> Rig {
    let dir = tempfile::tempdir().unwrap();
    let dirs = vec![dir.path().to_owned()];
    let mut hal = Hal::create_in(&dirs, "m", 4).unwrap();
    hal.output::<f64>("a.out").unwrap().set(1.5);
    hal.input("b.in", 2.5).unwrap();
    hal.input("c.in", -3i32).unwrap();
    hal.link("n", "a.out", &["b.in"]).unwrap();
    let good = std::fs::read(hal.path()).unwrap();
    Rig {
        dirs,
        hal,
        good,
        _dir: dir,
    }
}

impl Rig {
    fn write(&self, offset: u64, octets: &[u8]) {
        std::fs::OpenOptions::new()
            .write(true)
            .open(self.hal.path())
            .unwrap()
            .write_all_at(octets, offset)
            .unwrap();
    }

    fn what(&self) -> String {
        let listed = Attached::attach_in(&self.dirs, "m").and_then(|far| far.list());
        match listed {
            Err(HalError::Corrupt { what, .. }) => what,
            other => panic!("expected a corrupt file, got {other:?}"),
        }
    }
}

#[test]
fn the_layout_is_as_documented() {
    let rig = rig();
    let word = |index: usize| u64::from_le_bytes(rig.good[8 * index..8 * index + 8].try_into().unwrap());
    assert_eq!(&rig.good[..8], b"isocHAL\n");
    assert_eq!([word(1), word(2), word(3), word(4)], [2, 8 * (8 + 4 * 14), 4, 4]);
    assert_eq!(word(5), u64::from(std::process::id()));
    assert_eq!(word(8), 1.5f64.to_bits());
    assert_eq!(word(10), 0xFFFF_FFFD);
    let first = 8 + 4;
    assert_eq!([word(first), word(first + 1), word(first + 2)], [0x05_01_06, 4, 0]);
    assert_eq!(&rig.good[8 * (first + 3)..8 * (first + 3) + 8], b"a.out\0\0\0");
    let second = first + 13;
    assert_eq!([word(second), word(second + 1), word(second + 2)], [0x04_02_06, 4, 1]);
    let net = first + 39;
    assert_eq!([word(net), word(net + 1), word(net + 2)], [0x01_03_06, 0, 1]);
}

#[test]
fn each_damage_is_named() {
    let entries = 8 * (8 + 4);
    for (offset, value, what) in [
        (0, 0x1111, "not the pins of a control"),
        (8, 1, "layout 1 of another version"),
        (16, 8, "damaged: 512 octets"),
        (24, 3, "damaged: 512 octets, expected 400 for 3 entries"),
        (24, u64::MAX, "damaged: capacity"),
        (24, 0, "damaged: capacity 0"),
        (32, 5, "damaged: 5 entries in use, but room for 4"),
        (entries, 0x05_01_07, "damaged: entry 0 has type 7"),
        (entries, 0x05_04_06, "damaged: entry 0 has kind 4"),
        (entries, 0x41_01_06, "damaged: entry 0 has a name of 65 octets"),
        (entries + 8, 5, "damaged: entry 0 has a link to entry 4 of 4"),
        (entries + 16, u64::MAX, "damaged: entry 0 has a link to entry"),
        (entries + 24, 0xFF, "damaged: entry 0 has a name that is no text"),
        (entries + 24, 0x41, "damaged: entry 0 has pin name"),
        (entries + 88, 5, "damaged: entry 0 has a link to entry 4 of 4"),
        (entries + 96, 0xFF, "damaged: entry 0 has a unit that is no text"),
        (entries + 96, 0x1B, "damaged: entry 0 has a unit that cannot be shown"),
    ] {
        let rig = rig();
        rig.write(offset, &u64::to_le_bytes(value));
        let found = rig.what();
        assert!(found.starts_with(what), "word at {offset} = {value:#x}: {found}");
    }
}

#[test]
fn every_other_length_is_refused() {
    let rig = rig();
    let file = std::fs::OpenOptions::new().write(true).open(rig.hal.path()).unwrap();
    for len in (0..rig.good.len() as u64)
        .step_by(7)
        .chain([rig.good.len() as u64 - 8, 4096, 1 << 40])
    {
        file.set_len(len).unwrap();
        assert!(
            matches!(Attached::attach_in(&rig.dirs, "m"), Err(HalError::Corrupt { .. })),
            "{len} octets"
        );
    }
    file.set_len(rig.good.len() as u64).unwrap();
}

#[test]
fn a_link_or_a_directory_in_place_of_the_file_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let dirs = [dir.path().to_owned()];
    std::os::unix::fs::symlink("/etc/passwd", dir.path().join("isocnc-hal.m")).unwrap();
    std::fs::create_dir(dir.path().join("isocnc-hal.d")).unwrap();
    for name in ["m", "d"] {
        assert!(matches!(
            Attached::attach_in(&dirs, name),
            Err(HalError::Corrupt { .. })
        ));
        assert!(matches!(Hal::create_in(&dirs, name, 4), Err(HalError::Corrupt { .. })));
    }
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 2, "no draft is left");
}

proptest! {
    #[test]
    fn any_words_anywhere_are_read_without_panic(changes in prop::collection::vec((0usize..60, any::<u64>()), 1..12)) {
        let rig = rig();
        for (word, value) in changes {
            rig.write(8 * word as u64, &value.to_le_bytes());
        }
        if let Ok(far) = Attached::attach_in(&rig.dirs, "m") {
            let _ = far.list();
            let _ = far.get("a.out");
            let _ = far.set("b.in", hal_pins::AnyValue::Float(1.0));
            let _ = far.set("c.in", hal_pins::AnyValue::S32(1));
        }
    }

    #[test]
    fn small_damage_is_read_without_panic(at in 0usize..480, octet in any::<u8>()) {
        let rig = rig();
        rig.write(at as u64, &[octet]);
        if let Ok(far) = Attached::attach_in(&rig.dirs, "m") {
            let _ = far.list();
        }
        // The owner believes nothing that others may have changed.
        prop_assert_eq!(rig.hal.list().len(), 4);
    }
}
