//! Any orders of three clients that send programs: a program is what was sent, or nothing.

use isocnc::api::uploads::Uploads;
use isocnc::program::text::Reader;
use sha2::{Digest, Sha256};
use std::io::Read;

/// One run of the fuzzer: four octets an order.
pub fn run(octets: &[u8]) {
    let mut uploads = Uploads::default();
    // What each client has begun last, its size, and what has come of it.
    let mut sent: [Option<(u64, u64, Vec<u8>)>; 3] = [None, None, None];
    let mut now_ns = 0;
    for order in octets.chunks_exact(4) {
        let client = usize::from(order[1] % 3);
        let (size, value) = (u64::from(order[2]), order[3]);
        let part = vec![value; usize::from(order[2])];
        let number = sent[client].as_ref().map_or(u64::from(value), |(number, ..)| *number);
        let received = sent[client].as_ref().map_or(0, |(.., octets)| octets.len() as u64);
        let id = client as u64;
        match order[0] % 7 {
            0 => {
                if let Ok(number) = uploads.begin(id, "part", size, now_ns) {
                    sent[client] = Some((number, size, Vec::new()));
                }
            }
            // In its place, or anywhere.
            way @ (1 | 2) => {
                let at = if way == 1 { received } else { u64::from(value) };
                let taken = uploads.append(id, number, at, &part, now_ns);
                match (&mut sent[client], taken) {
                    (Some((_, size, octets)), Ok(count)) => {
                        assert_eq!(at, octets.len() as u64);
                        octets.extend(&part);
                        assert_eq!(count, octets.len() as u64);
                        assert!(count <= *size);
                    }
                    (None, Ok(_)) => panic!("a part of nothing was taken"),
                    (_, Err(why)) => assert!(!why.message.text.is_empty()),
                }
            }
            3 => {
                let octets = sent[client]
                    .as_ref()
                    .map(|(.., octets)| octets.clone())
                    .unwrap_or_default();
                let right = Sha256::digest(&octets);
                let sum = if value & 1 == 0 { right.to_vec() } else { part };
                let committed = uploads.commit(id, number, &sum, now_ns);
                if committed.is_ok() {
                    let (_, size, octets) = sent[client].as_ref().expect("nothing can be whole that was not begun");
                    assert_eq!(*size, octets.len() as u64);
                }
            }
            4 => {
                if let Ok(whole) = uploads.whole(id, number, now_ns) {
                    let mut text = Vec::new();
                    Reader::from(&*whole.text).read_to_end(&mut text).expect("a text");
                    assert_eq!(Some(&text), sent[client].as_ref().map(|(.., octets)| octets));
                }
            }
            5 => {
                uploads.left(id);
                assert!(uploads.whole(id, number, now_ns).is_err());
                sent[client] = None;
            }
            _ => {
                now_ns += size * 1_000_000_000;
                uploads.forget_idle(now_ns);
            }
        }
    }
}
