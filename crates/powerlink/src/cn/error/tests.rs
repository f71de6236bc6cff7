//! Counters, history and the handshake of error signalling.

use super::*;
use crate::cn::objects::{COMMUNICATION_BYTES, COMMUNICATION_ENTRIES, COMMUNICATION_PROFILE};
use crate::wire::ErrorEntries;
use std::vec::Vec;

fn entry(code: u16) -> ErrorEntry {
    ErrorEntry {
        entry_type: TYPE_OCCURRED | PROFILE_COMMUNICATION,
        code,
        ..ErrorEntry::default()
    }
}

fn shown(signalling: &Signalling) -> Vec<u16> {
    ErrorEntries(signalling.entries())
        .iter()
        .map(|entry| entry.code)
        .collect()
}

#[test]
fn counters_weigh_errors_by_eight_and_start_again_at_the_threshold() {
    let mut dictionary =
        Dictionary::<COMMUNICATION_ENTRIES, COMMUNICATION_BYTES>::new(&[COMMUNICATION_PROFILE]).unwrap();
    let counter = Keys::find(&dictionary).unwrap().losses.soc;
    let read = |dictionary: &Dictionary<_, _>| (dictionary.get(counter.cumulative), dictionary.get(counter.count));
    // The default of 15: two errors close together.
    assert!(!counter.error(&mut dictionary));
    assert_eq!(read(&dictionary), (1, 8));
    counter.good(&mut dictionary);
    assert!(counter.error(&mut dictionary), "7 + 8 reaches 15");
    assert_eq!(read(&dictionary), (2, 0));
    assert!(!counter.error(&mut dictionary));
    for _ in 0..9 {
        counter.good(&mut dictionary);
    }
    assert_eq!(read(&dictionary), (3, 0));
    // 80: the tenth error in a row.
    dictionary.set(counter.threshold, 80);
    let reached: Vec<u32> = (1..=20).filter(|_| counter.error(&mut dictionary)).collect();
    assert_eq!(reached, [10, 20]);
    dictionary.set(counter.threshold, 0);
    assert!((0..100).all(|_| !counter.error(&mut dictionary)));
    assert_eq!(read(&dictionary), (123, 0));
}

#[test]
fn the_history_shows_the_newest_first() {
    let mut dictionary =
        Dictionary::<COMMUNICATION_ENTRIES, COMMUNICATION_BYTES>::new(&[COMMUNICATION_PROFILE]).unwrap();
    let keys = Keys::find(&dictionary).unwrap();
    for code in 1..=10 {
        record(&mut dictionary, &keys, &entry(code));
    }
    assert_eq!(dictionary.read(0x1003, 0).unwrap(), [8]);
    for sub in 1..=8 {
        assert_eq!(
            dictionary.read(0x1003, sub).unwrap(),
            entry(11 - u16::from(sub)).to_octets()
        );
    }
}

#[test]
fn entries_wait_until_the_handshake_is_over_and_each_batch_until_the_last_was_read() {
    let mut signalling = Signalling::new();
    for code in 1..=14 {
        assert!(signalling.push(entry(code)));
    }
    signalling.reset(true);
    assert_eq!(
        (
            signalling.exception_clear(),
            signalling.exception_new(),
            shown(&signalling).len()
        ),
        (true, false, 0)
    );
    signalling.reset(false);
    assert_eq!(
        (signalling.exception_clear(), signalling.exception_new()),
        (false, true)
    );
    let first: Vec<u16> = (1..=13).collect();
    assert_eq!((shown(&signalling), signalling.entries().len()), (first.clone(), 260));
    signalling.acknowledge(false);
    assert_eq!((signalling.exception_new(), shown(&signalling)), (true, first));
    signalling.acknowledge(true);
    assert_eq!((signalling.exception_new(), shown(&signalling)), (false, std::vec![14]));
    assert_eq!(signalling.entries().len(), 40, "never shorter than two entries");
    signalling.acknowledge(true);
    assert_eq!(shown(&signalling), [14]);
    signalling.acknowledge(false);
    assert_eq!((signalling.exception_new(), shown(&signalling).len()), (false, 0));
}

#[test]
fn a_full_queue_keeps_the_first_causes() {
    let mut signalling = Signalling::new();
    for code in 1..=20 {
        assert_eq!(signalling.push(entry(code)), code <= 16);
    }
    signalling.reset(false);
    let mut seen = Vec::new();
    while !shown(&signalling).is_empty() {
        seen.extend(shown(&signalling));
        signalling.acknowledge(signalling.exception_new());
    }
    assert_eq!(seen, (1..=16).collect::<Vec<_>>());
}
