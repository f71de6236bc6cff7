//! Any words anywhere in the memory of an oscilloscope before its rings: the cycle goes on, a reader is told or reads.
//!
//! Input: ten octets a write: number of the word, its value.

use hal_pins::scope::{Capture, Sampler, check};
use hal_pins::{Attached, Hal};
use std::cell::RefCell;
use std::fs::File;
use std::os::unix::fs::FileExt;

/// Words before the rings.
const WORDS: u64 = 8 + 4 * 64;

struct Rig {
    sampler: Sampler,
    pins: Attached,
    file: File,
    good: Vec<u8>,
    _hal: Hal,
    _folder: tempfile::TempDir,
}

fn rig() -> Rig {
    let folder = tempfile::tempdir().expect("a folder");
    let mut hal = Hal::create_in(&[folder.path().to_owned()], "m", 4).expect("pins");
    hal.input("a.in", 1.5).expect("a pin");
    let sampler = Sampler::new(&hal, 1_000_000).expect("an oscilloscope");
    let path = folder.path().join("isocnc-scope.m");
    let file = File::options().read(true).write(true).open(path).expect("its file");
    let mut good = vec![0; 8 * WORDS as usize];
    file.read_exact_at(&mut good, 0).expect("its words");
    Rig {
        sampler,
        pins: Attached::attach_in(&[folder.path().to_owned()], "m").expect("the pins"),
        file,
        good,
        _hal: hal,
        _folder: folder,
    }
}

thread_local! {
    static RIG: RefCell<Rig> = RefCell::new(rig());
}

/// One run of the fuzzer.
pub fn run(octets: &[u8]) {
    RIG.with_borrow_mut(|rig| {
        rig.file.write_all_at(&rig.good, 0).expect("its words");
        rig.sampler.sample(0);
        let mut capture = Capture::begin(&rig.pins, &["a.in"; 3]).expect("a capture");
        for (cycle, write) in (1_u64..).zip(octets.chunks_exact(10)) {
            let word = u64::from(u16::from_le_bytes([write[0], write[1]])) % WORDS;
            rig.file.write_all_at(&write[2..], 8 * word).expect("its words");
            let readable = check(&rig.file);
            rig.sampler.sample(cycle);
            let read = capture.read(usize::MAX, |record| assert_eq!(record.words.len(), 3));
            match read {
                Ok(count) => assert!(count <= (1 << 17) / 5),
                Err(error) => assert!(!error.to_string().is_empty()),
            }
            // What is refused stays told.
            if readable.is_err() && word == 0 {
                assert!(capture.read(1, |_| ()).is_err());
            }
            capture.lost();
            if let Ok(mut other) = Capture::begin(&rig.pins, &["a.in"]) {
                rig.sampler.sample(cycle);
                let _ = other.read(10, |_| ());
            }
        }
    });
}
