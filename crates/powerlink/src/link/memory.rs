//! A wire in memory: two links, one for each of two threads of a process.
//!
//! In:  frames from one thread. Out: the same frames at the other, in order, stamped with the time they were sent.
//! RT: rings of fixed size, no allocation after [`pair`], no lock; a full ring is [`LinkError::NoBuffers`]. A reader
//! spins as long as it was told to, then sleeps in the kernel until a frame or the deadline.

use std::boxed::Box;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use rtrb::{Consumer, Producer, RingBuffer};

use super::clock::{monotonic_ns, realtime_ns, to_timespec};
use super::{Link, LinkError, Received};
use crate::wire::FRAME_LEN_MAX;

/// Frames on their way in each direction.
const RING_FRAMES: usize = 256;

/// A frame in the ring. Boxed once at the start and moved between two rings, so that only pointers are copied.
struct Slot {
    length: usize,
    stamp_ns: u64,
    octets: [u8; FRAME_LEN_MAX],
}

/// Wakes the reader of one direction.
#[derive(Default)]
struct Bell {
    /// Counts frames sent; the reader sleeps while it does not change.
    rings: AtomicU32,
    /// The reader sleeps, or is about to.
    asleep: AtomicU32,
}

impl Bell {
    fn ring(&self) {
        self.rings.fetch_add(1, Ordering::SeqCst);
        if self.asleep.load(Ordering::SeqCst) != 0 {
            // SAFETY: the address is that of an atomic which `self` keeps alive; waking has no other effect.
            unsafe {
                libc::syscall(
                    libc::SYS_futex,
                    self.rings.as_ptr(),
                    libc::FUTEX_WAKE | libc::FUTEX_PRIVATE_FLAG,
                    1,
                );
            }
        }
    }

    /// Sleeps until the count differs from `seen` or until the deadline; may return early.
    fn wait(&self, seen: u32, deadline_ns: u64) {
        let deadline = to_timespec(deadline_ns);
        self.asleep.store(1, Ordering::SeqCst);
        // SAFETY: the address is that of an atomic which `self` keeps alive, the time lives through the call. The kernel
        // compares the count with `seen` itself, so that no ring between the look and the sleep is lost. With BITSET the
        // time is absolute, CLOCK_MONOTONIC.
        unsafe {
            libc::syscall(
                libc::SYS_futex,
                self.rings.as_ptr(),
                libc::FUTEX_WAIT_BITSET | libc::FUTEX_PRIVATE_FLAG,
                seen,
                &raw const deadline,
                core::ptr::null::<u32>(),
                libc::FUTEX_BITSET_MATCH_ANY,
            );
        }
        self.asleep.store(0, Ordering::SeqCst);
    }
}

/// One end of the wire.
pub struct MemoryLink {
    /// Frames to the other end, and the empty slots that come back.
    outgoing: Producer<Box<Slot>>,
    free: Consumer<Box<Slot>>,
    /// Frames from the other end, and the way back for their slots.
    incoming: Consumer<Box<Slot>>,
    used: Producer<Box<Slot>>,
    bell_here: Arc<Bell>,
    spin_ns: u64,
    /// Last, so that it rings when the rings above are gone.
    bell_there: Hangup,
}

/// Two ends of one wire. `spin_ns`: how long a reader spins before it sleeps; 0 on a machine that has no core to spare.
pub fn pair(spin_ns: u64) -> (MemoryLink, MemoryLink) {
    let (a_outgoing, b_incoming) = RingBuffer::new(RING_FRAMES);
    let (b_used, a_free) = full_ring();
    let (b_outgoing, a_incoming) = RingBuffer::new(RING_FRAMES);
    let (a_used, b_free) = full_ring();
    let (bell_a, bell_b) = (Arc::new(Bell::default()), Arc::new(Bell::default()));
    let a = MemoryLink {
        outgoing: a_outgoing,
        free: a_free,
        incoming: a_incoming,
        used: a_used,
        bell_there: Hangup(bell_b.clone()),
        bell_here: bell_a.clone(),
        spin_ns,
    };
    let b = MemoryLink {
        outgoing: b_outgoing,
        free: b_free,
        incoming: b_incoming,
        used: b_used,
        bell_there: Hangup(bell_a),
        bell_here: bell_b,
        spin_ns,
    };
    (a, b)
}

/// The ring of empty slots of one direction, full at the start.
fn full_ring() -> (Producer<Box<Slot>>, Consumer<Box<Slot>>) {
    let (mut producer, consumer) = RingBuffer::new(RING_FRAMES);
    for _ in 0..RING_FRAMES {
        // There is room for exactly these.
        let _ = producer.push(Box::new(Slot {
            length: 0,
            stamp_ns: 0,
            octets: [0; FRAME_LEN_MAX],
        }));
    }
    (producer, consumer)
}

impl MemoryLink {
    fn pop_frame(&mut self, buffer: &mut [u8]) -> Option<Received> {
        let slot = self.incoming.pop().ok()?;
        let length = slot.length.min(buffer.len());
        buffer[..length].copy_from_slice(&slot.octets[..length]);
        let stamp_ns = Some(slot.stamp_ns);
        // As many slots as the ring holds, so there is always room; if the other end is gone the slot is freed here.
        let _ = self.used.push(slot);
        Some(Received { length, stamp_ns })
    }
}

impl Link for MemoryLink {
    fn now_ns(&mut self) -> u64 {
        monotonic_ns()
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        if !(14..=FRAME_LEN_MAX).contains(&frame.len()) {
            return Err(LinkError::FrameLength {
                got: frame.len(),
                max: FRAME_LEN_MAX,
            });
        }
        if self.outgoing.is_abandoned() {
            return Err(LinkError::Down);
        }
        let mut slot = self.free.pop().map_err(|_| LinkError::NoBuffers)?;
        slot.octets[..frame.len()].copy_from_slice(frame);
        slot.length = frame.len();
        slot.stamp_ns = realtime_ns();
        // As many slots as the ring holds, so there is always room.
        self.outgoing.push(slot).map_err(|_| LinkError::NoBuffers)?;
        self.bell_there.0.ring();
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], deadline_ns: u64) -> Result<Option<Received>, LinkError> {
        let mut spin_until_ns = None;
        loop {
            let seen = self.bell_here.rings.load(Ordering::SeqCst);
            if let Some(received) = self.pop_frame(buffer) {
                return Ok(Some(received));
            }
            if self.incoming.is_abandoned() {
                // What was sent before the other end went away is still delivered.
                return self.pop_frame(buffer).map(Some).ok_or(LinkError::Down);
            }
            let now_ns = monotonic_ns();
            if now_ns >= deadline_ns {
                return Ok(None);
            }
            if now_ns < *spin_until_ns.get_or_insert(now_ns.saturating_add(self.spin_ns)) {
                core::hint::spin_loop();
            } else {
                self.bell_here.wait(seen, deadline_ns);
            }
        }
    }
}

/// Wakes the other end for the last time when this end is gone.
struct Hangup(Arc<Bell>);

impl Drop for Hangup {
    fn drop(&mut self) {
        self.0.ring();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::thread;
    use std::vec::Vec;

    /// A frame of `len` octets that starts with a number.
    fn frame(number: u32, len: usize) -> Vec<u8> {
        let mut frame = std::vec![0xEE; len];
        frame[..4].copy_from_slice(&number.to_le_bytes());
        frame
    }

    #[test]
    fn frames_arrive_whole_in_order_and_stamped() {
        let (mut here, mut there) = pair(0);
        let before_ns = realtime_ns();
        for number in 0..10 {
            here.send(&frame(number, 60 + number as usize)).unwrap();
        }
        let mut buffer = [0; FRAME_LEN_MAX];
        for number in 0..10 {
            let received = there.receive(&mut buffer, 0).unwrap().unwrap();
            assert_eq!(buffer[..received.length], frame(number, 60 + number as usize));
            assert!(received.stamp_ns.unwrap() >= before_ns);
        }
        assert_eq!(
            there.receive(&mut buffer, 0),
            Ok(None),
            "a deadline in the past only looks"
        );
        assert_eq!(here.receive(&mut buffer, 0), Ok(None), "nobody hears himself");
    }

    #[test]
    fn a_full_ring_and_wrong_lengths_are_errors() {
        let (mut here, mut there) = pair(0);
        for length in [0, 13, FRAME_LEN_MAX + 1] {
            let error = LinkError::FrameLength {
                got: length,
                max: FRAME_LEN_MAX,
            };
            assert_eq!(here.send(&std::vec![0; length]), Err(error));
        }
        for number in 0..RING_FRAMES as u32 {
            here.send(&frame(number, 60)).unwrap();
        }
        assert_eq!(here.send(&frame(0, 60)), Err(LinkError::NoBuffers));
        let mut buffer = [0; 20];
        assert_eq!(
            there.receive(&mut buffer, 0).unwrap().unwrap().length,
            20,
            "cut to the buffer"
        );
        here.send(&frame(7, 60)).unwrap();
    }

    #[test]
    fn the_end_of_one_side_is_seen_after_its_last_frame() {
        let (mut here, mut there) = pair(0);
        here.send(&frame(1, 60)).unwrap();
        drop(here);
        let mut buffer = [0; FRAME_LEN_MAX];
        assert_eq!(there.receive(&mut buffer, u64::MAX / 2).unwrap().unwrap().length, 60);
        assert_eq!(there.receive(&mut buffer, u64::MAX / 2), Err(LinkError::Down));
        assert_eq!(there.send(&frame(1, 60)), Err(LinkError::Down));
    }

    #[test]
    fn two_threads_play_ping_pong_and_hang_up() {
        for spin_ns in [0, 20_000] {
            let (mut here, mut there) = pair(spin_ns);
            let echo = thread::spawn(move || {
                let mut buffer = [0; FRAME_LEN_MAX];
                let mut frames = 0;
                // Ends only because the other side hangs up: the deadline is far away.
                while let Ok(Some(received)) = there.receive(&mut buffer, u64::MAX / 2) {
                    there.send(&buffer[..received.length]).unwrap();
                    frames += 1;
                }
                frames
            });
            let mut buffer = [0; FRAME_LEN_MAX];
            for number in 0..2000 {
                here.send(&frame(number, 64)).unwrap();
                let received = here.receive(&mut buffer, u64::MAX / 2).unwrap().unwrap();
                assert_eq!(buffer[..received.length], frame(number, 64));
            }
            drop(here);
            assert_eq!(echo.join().unwrap(), 2000);
        }
    }
}
