//! What the cycle thread and the bus say of themselves to the thread that watches their time limits: atomics only.
//!
//! In:  cycles that begin and end, frames that are waited for. Out: whether a wait is still open, whether a SoC may be sent;
//!      the counters of the time-out thread, which looks at all of it.

use std::sync::atomic::{AtomicBool, AtomicI32, AtomicU64, Ordering};

/// What is watched. Shared by the cycle thread, the time-out thread and whoever reads the counters.
#[derive(Debug, Default)]
pub struct Watch {
    // Written by the cycle thread.
    /// Date of the cycle that has begun last; 0: none is expected.
    pub deadline_ns: AtomicU64,
    pub cycle: AtomicU64,
    /// Number of the cycle that has ended last, plus 1.
    pub finished: AtomicU64,
    /// No wait begins between that end and the next cycle.
    pub rests: AtomicBool,
    /// Clock of its processor time; 0: not known.
    cpu_clock: AtomicI32,
    /// Outstanding waits, see `open_wait`; 0: none. Whoever sets one to 0 has decided it.
    pub poll: AtomicU64,
    pub async_slot: AtomicU64,
    // Written by the time-out thread.
    pub soc_forbidden: AtomicBool,
    pub ticks: AtomicU64,
    pub missed_ticks: AtomicU64,
    pub polls_lost: AtomicU64,
    pub async_lost: AtomicU64,
    pub late_cycles: AtomicU64,
    pub reports_dropped: AtomicU64,
    pub cpu_ns: AtomicU64,
    pub wall_ns: AtomicU64,
}

/// Counters of the time-out thread.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Counters {
    pub ticks: u64,
    /// Ticks left out because the thread ran too late.
    pub missed_ticks: u64,
    /// Polls whose PRes did not come in time.
    pub polls_lost: u64,
    /// Async slots that ended without a frame.
    pub async_lost: u64,
    /// Cycles that had not begun when they were later than the limit.
    pub late_cycles: u64,
    /// Reports that found the ring full.
    pub reports_dropped: u64,
    /// Share of one core that the thread uses, 0 to 1.
    pub cpu_share: f64,
}

impl Watch {
    /// The clock of the processor time of the cycle thread, where there is one.
    pub fn set_cpu_clock(&self, clock: Option<i32>) {
        self.cpu_clock.store(clock.unwrap_or(0), Ordering::Release);
    }

    /// RT: that clock.
    pub fn cpu_clock(&self) -> Option<i32> {
        Some(self.cpu_clock.load(Ordering::Acquire)).filter(|clock| *clock != 0)
    }

    /// RT: the cycle thread leaves cycles out and waits for the one of `deadline_ns`: it is late and alive.
    pub fn leave_out(&self, deadline_ns: u64, period_ns: u64) {
        self.deadline_ns
            .store(deadline_ns.saturating_sub(period_ns), Ordering::Release);
    }

    /// RT: the cycle thread begins a cycle. `deadline_ns` is the date it was planned for, not the time now.
    pub fn begin_cycle(&self, cycle: u64, deadline_ns: u64) {
        self.cycle.store(cycle, Ordering::Relaxed);
        self.deadline_ns.store(deadline_ns, Ordering::Release);
    }

    /// RT: the cycle thread has done everything of a cycle and goes to sleep. `rests`: no wait begins before the next cycle.
    pub fn end_cycle(&self, cycle: u64, rests: bool) {
        self.rests.store(rests, Ordering::Relaxed);
        self.finished.store(cycle + 1, Ordering::Release);
    }

    /// RT: no more cycles are expected (orderly end, or a pause of the network).
    pub fn disarm(&self) {
        self.deadline_ns.store(0, Ordering::Release);
    }

    /// RT: a PReq has left; the PRes of `node` is due by `deadline_ns`.
    pub fn begin_poll(&self, node: u8, deadline_ns: u64) {
        self.poll.store(open_wait(node, deadline_ns), Ordering::Release);
    }

    /// RT: whether the PRes may still come; false once its time is over.
    pub fn is_poll_open(&self) -> bool {
        self.poll.load(Ordering::Acquire) != 0
    }

    /// RT: the PRes has come. False: too late, the time-out thread has counted it as lost. Exactly one of both decides.
    pub fn end_poll(&self) -> bool {
        self.poll.swap(0, Ordering::AcqRel) != 0
    }

    /// RT: a SoA has given the async slot to `node`; its frame is due by `deadline_ns`.
    pub fn begin_async(&self, node: u8, deadline_ns: u64) {
        self.async_slot.store(open_wait(node, deadline_ns), Ordering::Release);
    }

    /// RT: whether the async slot is still open.
    pub fn is_async_open(&self) -> bool {
        self.async_slot.load(Ordering::Acquire) != 0
    }

    /// RT: the async frame has come. False: too late.
    pub fn end_async(&self) -> bool {
        self.async_slot.swap(0, Ordering::AcqRel) != 0
    }

    /// RT: whether the cycle thread may send a SoC. Ask before each one; once false, it stays so: what the
    /// cycle thread was about nobody knows, and the nodes have left the network. The control is restarted.
    pub fn soc_allowed(&self) -> bool {
        !self.soc_forbidden.load(Ordering::Acquire)
    }

    /// The counters now.
    pub fn counters(&self) -> Counters {
        let read = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        let wall_ns = read(&self.wall_ns);
        Counters {
            ticks: read(&self.ticks),
            missed_ticks: read(&self.missed_ticks),
            polls_lost: read(&self.polls_lost),
            async_lost: read(&self.async_lost),
            late_cycles: read(&self.late_cycles),
            reports_dropped: read(&self.reports_dropped),
            cpu_share: if wall_ns == 0 {
                0.0
            } else {
                read(&self.cpu_ns) as f64 / wall_ns as f64
            },
        }
    }
}

/// RT: a wait for a node in one word: the lowest 8 bits of the date make room for the node, the date is rounded up to whole
/// 256 ns. A PC runs for years; shifted by 8 bits, dates would last for two.
fn open_wait(node: u8, deadline_ns: u64) -> u64 {
    (deadline_ns.saturating_add(0xFF) & !0xFF) | u64::from(node)
}

/// RT: when a wait is over.
pub fn date_ns(wait: u64) -> u64 {
    wait & !0xFF
}

/// RT: takes an expired wait away from the cycle thread, unless its answer comes in this very moment.
pub fn take_expired(wait: &AtomicU64, now_ns: u64) -> Option<u8> {
    let waiting = wait.load(Ordering::Acquire);
    if waiting == 0 || now_ns < date_ns(waiting) {
        return None;
    }
    wait.compare_exchange(waiting, 0, Ordering::AcqRel, Ordering::Acquire)
        .ok()
        .map(|_| waiting as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wait_keeps_its_node_and_its_date_is_rounded_up_by_less_than_256_ns() {
        assert!((1..=256).all(|ns| (ns..ns + 256).contains(&date_ns(open_wait(0xFF, ns)))));
        assert_eq!(open_wait(7, 1) as u8, 7);
    }
}
