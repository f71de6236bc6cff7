//! Models of the protocols of shared memory: the very code of `src/`, on words of the crate loom, which tries every order in which
//! threads may see what others write.

#[path = "../src/cell.rs"]
mod cell;
#[path = "../src/external/exchange.rs"]
#[allow(dead_code, unreachable_pub, reason = "models need not all of it")]
mod exchange;
#[path = "../src/scope/ring.rs"]
#[allow(dead_code, unreachable_pub, reason = "models need not all of it")]
mod ring;
mod mapped {
    pub(crate) use loom::sync::atomic::AtomicU64;
}

use exchange::{Change, Channel, Receiver, at, channel_words, mix};
use loom::sync::Arc;
use loom::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use loom::thread;
use mapped::AtomicU64;

fn words(count: usize) -> Arc<Vec<AtomicU64>> {
    Arc::new((0..count).map(|_| AtomicU64::new(0)).collect())
}

/// Models try each order of a few steps; more than so many preemptions find nothing that these do not.
fn model(check: impl Fn() + Sync + Send + 'static) {
    let mut builder = loom::model::Builder::new();
    builder.preemption_bound = Some(2);
    builder.check(check);
}

/// A pin is one word: what was written before it is seen with it, and it never goes back.
#[test]
fn a_pin_shows_what_was_written_before_it() {
    model(|| {
        let cells = words(2);
        let writer = {
            let cells = cells.clone();
            thread::spawn(move || {
                for value in 1..=2 {
                    crate::cell::set(&cells[0], value);
                    crate::cell::set(&cells[1], value);
                }
            })
        };
        let (mut late, mut before) = (0, 0);
        for _ in 0..2 {
            late = crate::cell::get(&cells[1]).max(late);
            let early = crate::cell::get(&cells[0]);
            assert!(early >= late && early >= before, "{early} {late} {before}");
            before = early;
        }
        writer.join().unwrap();
    });
}

const CHANNEL: usize = 16;

/// Values of record `number`: two words that belong together.
fn values(number: u64) -> [u64; 2] {
    [number * 10, number * 10 + 1]
}

/// A reader beside its writer takes whole records only.
#[test]
fn a_record_is_taken_whole_or_not_at_all() {
    model(|| {
        let words = words(CHANNEL + channel_words(2));
        let channel = Channel::new(at::LATEST_OUTPUTS, CHANNEL, 2);
        channel.put(&words, 1, 7, values(1));
        let writer = {
            let words = words.clone();
            thread::spawn(move || {
                for number in 2..=3 {
                    channel.put(&words, number, 7, values(number));
                }
            })
        };
        let (mut known, mut taken) = (0, [0; 2]);
        if let Some((number, tag)) = channel.take(&words, known, &mut taken) {
            assert_eq!((taken, tag), (values(number), 7));
            known = number;
        }
        writer.join().unwrap();
        if known != 3 {
            assert_eq!(channel.take(&words, known, &mut taken), Some((3, 7)));
        }
    });
}

/// A reader without the check takes a mixture, so the model above can fail.
#[test]
#[should_panic(expected = "a mixture")]
fn without_its_check_a_record_could_be_a_mixture() {
    model(|| {
        let words = words(CHANNEL + channel_words(2));
        let channel = Channel::new(at::LATEST_OUTPUTS, CHANNEL, 2);
        let writer = {
            let words = words.clone();
            thread::spawn(move || (1..=3).for_each(|number| channel.put(&words, number, 7, values(number))))
        };
        let latest = words[at::LATEST_OUTPUTS].load(Acquire);
        if latest == 1 {
            let place = CHANNEL + 5;
            let [number, _, a, b] = [0, 1, 2, 3].map(|word| words[place + word].load(Relaxed));
            assert!([a, b] == values(number), "a mixture");
        }
        writer.join().unwrap();
    });
}

/// One process dies in the middle of a record, another takes over: the control shows whole records of either, in their order.
#[test]
fn a_takeover_never_shows_half_a_record() {
    for dies_after in 0..=4 {
        model(move || {
            let words = words(CHANNEL + channel_words(2));
            let channel = Channel::new(at::LATEST_OUTPUTS, CHANNEL, 2);
            // The first one has written a record, which the control shows.
            words[at::SESSION].store(1, Relaxed);
            channel.put(&words, 1, 1, values(1));
            let mut receiver = Receiver::new(channel, 100);
            let mut shown = [0; 2];
            assert_eq!(receiver.look(&words, 0, &mut shown), (true, Some(Change::Attached)));
            let writers = {
                let words = words.clone();
                thread::spawn(move || {
                    // So many words of its next one.
                    let [a, b] = values(2);
                    let check = [2, 1, a, b].into_iter().fold(1, mix);
                    for (word, value) in [2, 1, a, b, check].into_iter().take(dies_after).enumerate() {
                        words[CHANNEL + word].store(value, Relaxed);
                    }
                    // The kernel lets the other one in, which has seen the last number.
                    words[at::SESSION].store(2, Release);
                    channel.put(&words, 2, 2, values(20));
                })
            };
            let mut scratch = [0; 2];
            let mut took_over = false;
            let mut look = |receiver: &mut Receiver| {
                let (fresh, change) = receiver.look(&words, 0, &mut scratch);
                if fresh {
                    assert_eq!(scratch, values(20));
                    assert_eq!(change, Some(Change::TakenOver));
                    took_over = true;
                } else {
                    assert_eq!(change, None);
                }
                assert!(receiver.is_alive());
            };
            look(&mut receiver);
            look(&mut receiver);
            writers.join().unwrap();
            look(&mut receiver);
            assert!(took_over);
        });
    }
}

/// The control ends a session while its process writes on: what comes later is not shown, and the process hears of it.
#[test]
fn a_session_that_was_ended_never_writes_again() {
    model(|| {
        let words = words(CHANNEL + channel_words(2));
        let channel = Channel::new(at::LATEST_OUTPUTS, CHANNEL, 2);
        words[at::SESSION].store(1, Relaxed);
        channel.put(&words, 1, 1, values(1));
        let mut receiver = Receiver::new(channel, 1);
        let mut scratch = [0; 2];
        assert!(receiver.look(&words, 1, &mut scratch).0);
        let writer = {
            let words = words.clone();
            thread::spawn(move || {
                let ended = words[at::ENDED].load(Acquire) == 1;
                if !ended {
                    channel.put(&words, 2, 1, values(2));
                }
                ended
            })
        };
        let mut was_lost = false;
        for _ in 0..3 {
            let (fresh, change) = receiver.look(&words, 1, &mut scratch);
            assert!(!(was_lost && fresh), "written by a session that was over");
            was_lost |= change == Some(Change::Lost);
            words[at::ENDED].store(receiver.ended(), Release);
        }
        let heard = writer.join().unwrap();
        assert!(!heard || was_lost);
        let (fresh, _) = receiver.look(&words, 1, &mut scratch);
        assert!(!(was_lost && fresh));
    });
}

/// The value of a cell of the oscilloscope in a cycle.
fn sampled(cell: usize, cycle: u64) -> u64 {
    100 * cell as u64 + cycle
}

/// Words of a capture, and of a ring with room for two records of a channel.
fn capture() -> (Arc<Vec<AtomicU64>>, Arc<Vec<AtomicU64>>) {
    (words(ring::CAPTURE_WORDS), words(2 * (ring::RECORD_HEAD + 1)))
}

fn cycles(
    server: &mut ring::Server,
    (capture, ring): &(Arc<Vec<AtomicU64>>, Arc<Vec<AtomicU64>>),
    cycles: std::ops::Range<u64>,
) {
    for cycle in cycles {
        server.serve(capture, ring, [cycle, 1000 * cycle], 8, |cell| sampled(cell, cycle));
    }
}

/// Each record is whole and comes once, in its order; what is not there was counted.
#[test]
fn an_oscilloscope_hands_out_whole_records_and_counts_the_others() {
    model(|| {
        let memory = capture();
        let mut reader = ring::Reader::ask(&memory.0, [3].into_iter(), 1);
        let mut server = ring::Server::IDLE;
        cycles(&mut server, &memory, 0..1);
        let control = {
            let memory = memory.clone();
            thread::spawn(move || cycles(&mut server, &memory, 1..4))
        };
        let (mut taken, mut next) = (0, 0);
        let mut take = |reader: &mut ring::Reader| {
            let mut record = [0; ring::RECORD_HEAD + 1];
            let count = reader.take(&memory.0, &memory.1, 8, &mut record, |record| {
                let cycle = record[0];
                assert!(cycle >= next, "{cycle} {next}");
                assert_eq!(record, [cycle, 1000 * cycle, sampled(3, cycle)]);
                next = cycle + 1;
            });
            taken += count.expect("nobody else writes") as u64;
        };
        take(&mut reader);
        take(&mut reader);
        control.join().unwrap();
        take(&mut reader);
        assert_eq!(taken + reader.lost(&memory.0), 4);
    });
}

/// A reader that was killed has left its request; the next one, which asks for another cell, sees nothing of the first.
#[test]
fn an_oscilloscope_of_a_killed_reader_shows_the_next_one_its_own() {
    model(|| {
        let memory = capture();
        let _killed = ring::Reader::ask(&memory.0, [3].into_iter(), 1);
        let mut server = ring::Server::IDLE;
        cycles(&mut server, &memory, 0..1);
        let control = {
            let memory = memory.clone();
            thread::spawn(move || {
                cycles(&mut server, &memory, 1..4);
                server
            })
        };
        let mut reader = ring::Reader::ask(&memory.0, [5].into_iter(), 2);
        let mut seen = 0;
        let mut take = |reader: &mut ring::Reader| {
            let mut record = [0; ring::RECORD_HEAD + 1];
            let taken = reader.take(&memory.0, &memory.1, 8, &mut record, |record| {
                assert_eq!(record[2], sampled(5, record[0]), "of the other reader");
            });
            seen += taken.expect("nobody else writes");
        };
        take(&mut reader);
        let mut server = control.join().unwrap();
        cycles(&mut server, &memory, 4..5);
        take(&mut reader);
        assert!(seen > 0, "it is served");
    });
}

/// A reader that does not look whether it is served sees records of the one before, so the model above can fail.
#[test]
#[should_panic(expected = "of the other reader")]
fn an_oscilloscope_without_a_number_of_the_request_would_mix_readers() {
    model(|| {
        let memory = capture();
        let _killed = ring::Reader::ask(&memory.0, [3].into_iter(), 1);
        let mut server = ring::Server::IDLE;
        cycles(&mut server, &memory, 0..1);
        let control = {
            let memory = memory.clone();
            thread::spawn(move || cycles(&mut server, &memory, 1..3))
        };
        let _reader = ring::Reader::ask(&memory.0, [5].into_iter(), 2);
        let mut is_own = true;
        if memory.0[ring::of::WRITTEN].load(Acquire) > 0 {
            let [cycle, _, value] = [0, 1, 2].map(|word| memory.1[word].load(Relaxed));
            is_own = value == sampled(5, cycle);
        }
        control.join().unwrap();
        assert!(is_own, "of the other reader");
    });
}
