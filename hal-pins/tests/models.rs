//! Models of the protocols of shared memory: the very code of `src/`, on words of the crate loom, which tries every order in which
//! threads may see what others write.

#[path = "../src/cell.rs"]
mod cell;
#[path = "../src/external/exchange.rs"]
#[allow(dead_code, unreachable_pub, reason = "models need not all of it")]
mod exchange;
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
