//! The simulated machine on a link, in a process or thread of its own.
//!
//! In:  frames of the managing node on a [`Link`]. Out: the machine's answers, each at once.

use super::SimMachine;
use powerlink::link::{Link, LinkError, Received};
use powerlink::wire::FRAME_LEN_MAX;
use std::sync::atomic::{AtomicBool, Ordering};

/// How long a wish to stop may go unnoticed, ns.
const STOP_LOOK_NS: u64 = 50_000_000;

/// The pause after a poll that leaves something due at once, ns. The thread has the highest priority of its core: it must
/// leave gaps whatever the nodes want. Longer than the link spins.
const POLL_PAUSE_NS: u64 = 50_000;

/// What came of [`serve`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Served {
    /// Frames of other nodes that arrived.
    pub received: u64,
    /// Frames that were sent.
    pub sent: u64,
    /// Answers that found no room on the link.
    pub dropped: u64,
}

/// Switches the machine on and answers on `link` until `stop` is set. `prepare` is called before each wait: to hand in what
/// else the nodes shall send. Every frame that arrives is first answered and then shown to `observe`, with
/// the link's own receive stamp. Sleeps in the link while nothing is due. An interface that goes down ends it.
///
/// RT as far as link and machine are: no allocation, no locks of its own.
pub fn serve(
    link: &mut dyn Link,
    machine: &mut SimMachine,
    stop: &AtomicBool,
    prepare: &mut dyn FnMut(&mut SimMachine),
    observe: &mut dyn FnMut(&[u8], &Received),
) -> Result<Served, LinkError> {
    let mut served = Served::default();
    let mut buffer = [0; FRAME_LEN_MAX];
    machine.switch_on(link.now_ns());
    let mut polled_ns = 0;
    while !stop.load(Ordering::Relaxed) {
        prepare(machine);
        let deadline_ns = look_ns(machine.next_poll_ns(), polled_ns).min(link.now_ns() + STOP_LOOK_NS);
        let received = link.receive(&mut buffer, deadline_ns)?;
        let now_ns = link.now_ns();
        let mut failed = None;
        let mut send = |frame: &[u8]| match link.send(frame) {
            Ok(()) => served.sent += 1,
            Err(LinkError::NoBuffers) => served.dropped += 1,
            Err(error) => failed = Some(error),
        };
        match received {
            Some(received) => {
                let frame = &buffer[..received.length.min(FRAME_LEN_MAX)];
                machine.receive(now_ns, frame, &mut send);
                served.received += 1;
                observe(frame, &received);
            }
            None => {
                machine.poll(now_ns, &mut send);
                polled_ns = now_ns;
            }
        }
        if let Some(error) = failed {
            return Err(error);
        }
    }
    Ok(served)
}

/// When to look at the clock again: when something is due, but not at once for what was due at the last look and still is.
fn look_ns(due_ns: u64, polled_ns: u64) -> u64 {
    if due_ns > polled_ns {
        due_ns
    } else {
        polled_ns + POLL_PAUSE_NS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stays_due_is_looked_at_again_after_a_pause() {
        assert_eq!(look_ns(7_001, 7_000), 7_001);
        assert_eq!(look_ns(7_000, 7_000), 57_000);
        assert_eq!(look_ns(0, 7_000), 57_000);
        assert_eq!(look_ns(0, 0), POLL_PAUSE_NS, "before the first look");
    }
}
