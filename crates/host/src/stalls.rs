//! Why the cycle thread did not run: what the kernel has counted of it and of its core.
//!
//! In:  `/proc/self/task/ID/schedstat` and `status` of the cycle thread, `/proc/stat` of its core, looked at once a second.
//! Out: a sentence on the time since the look before, which tells a cycle thread that computed without an end from one that
//! had to wait for its core, and from a whole virtual machine that its host did not run.
//!
//! The kernel counts stolen time in ticks, and only where the host tells it.

use super::other_controls::CYCLE_THREAD;
use std::fmt;
use std::fs::read_to_string;
use std::path::PathBuf;

/// Time between two looks, ns.
const LOOK_EVERY_NS: u64 = 1_000_000_000;
/// A tick of `/proc/stat`, ms (USER_HZ is 100 on every PC).
const TICK_MS: u64 = 10;

/// What was counted up to a moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Counts {
    at_ns: u64,
    /// The cycle thread ran, ns.
    ran_ns: u64,
    /// It could have run and waited for its core, ns.
    waited_ns: u64,
    /// It was put aside for another thread, times.
    put_aside: u64,
    /// The host ran something else on its core, ms.
    stolen_ms: u64,
}

/// Looks at the cycle thread.
#[derive(Debug)]
pub struct Stalls {
    cpu: usize,
    /// Its folder in `/proc`, once it is there.
    thread: Option<PathBuf>,
    last: Counts,
}

/// What was counted since the last look.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Evidence {
    cpu: usize,
    since: Counts,
}

impl Stalls {
    /// The cycle thread of this process, on its core.
    pub fn new(cpu: usize) -> Stalls {
        Stalls {
            cpu,
            thread: None,
            last: Counts::default(),
        }
    }

    /// Looks, where it is time to.
    pub fn update(&mut self, now_ns: u64) {
        if now_ns.saturating_sub(self.last.at_ns) >= LOOK_EVERY_NS {
            self.thread = self.thread.take().or_else(|| thread(CYCLE_THREAD));
            self.last = self.read_counts(now_ns);
        }
    }

    /// What was counted since the last look, about a second ago at the most.
    pub fn evidence(&self, now_ns: u64) -> Evidence {
        let (now, last) = (self.read_counts(now_ns), &self.last);
        let since = Counts {
            at_ns: now.at_ns.saturating_sub(last.at_ns),
            ran_ns: now.ran_ns.saturating_sub(last.ran_ns),
            waited_ns: now.waited_ns.saturating_sub(last.waited_ns),
            put_aside: now.put_aside.saturating_sub(last.put_aside),
            stolen_ms: now.stolen_ms.saturating_sub(last.stolen_ms),
        };
        let cpu = self.cpu;
        Evidence { cpu, since }
    }

    /// What cannot be read counts as 0.
    fn read_counts(&self, now_ns: u64) -> Counts {
        let of_thread = |name: &str| {
            let folder = self.thread.as_ref()?;
            read_to_string(folder.join(name)).ok()
        };
        let schedule = of_thread("schedstat").unwrap_or_default();
        let mut schedule = schedule.split_whitespace().map(|text| text.parse().unwrap_or(0));
        let status = of_thread("status").unwrap_or_default();
        let stat = read_to_string("/proc/stat").unwrap_or_default();
        Counts {
            at_ns: now_ns,
            ran_ns: schedule.next().unwrap_or(0),
            waited_ns: schedule.next().unwrap_or(0),
            put_aside: put_aside(&status).unwrap_or(0),
            stolen_ms: stolen_ms(&stat, self.cpu).unwrap_or(0),
        }
    }
}

impl fmt::Display for Evidence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ms = |ns: u64| ns as f64 * 1e-6;
        let Counts {
            at_ns,
            ran_ns,
            waited_ns,
            put_aside,
            stolen_ms,
        } = self.since;
        write!(
            f,
            "within the last {:.0} ms it ran {:.1} ms, waited {:.1} ms for core {} and was put aside {put_aside} times; the \
             host of a virtual machine took {stolen_ms} ms of that core",
            ms(at_ns),
            ms(ran_ns),
            ms(waited_ns),
            self.cpu
        )
    }
}

/// Folder of a thread of this process in `/proc`.
fn thread(name: &str) -> Option<PathBuf> {
    let threads = std::fs::read_dir("/proc/self/task").ok()?.flatten();
    threads
        .map(|thread| thread.path())
        .find(|folder| read_to_string(folder.join("comm")).is_ok_and(|comm| comm.trim() == name))
}

/// From `/proc/self/task/ID/status`.
fn put_aside(status: &str) -> Option<u64> {
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("nonvoluntary_ctxt_switches:"));
    line?.trim().parse().ok()
}

/// From `/proc/stat`: user, nice, system, idle, iowait, irq, softirq, steal.
fn stolen_ms(stat: &str, cpu: usize) -> Option<u64> {
    let line = stat.lines().find_map(|line| line.strip_prefix(&format!("cpu{cpu} ")));
    let ticks: u64 = line?.split_whitespace().nth(7)?.parse().ok()?;
    Some(ticks * TICK_MS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wait::thread_cpu_ns;

    #[test]
    fn counts_of_the_kernel_are_read() {
        let stat = "cpu  1 2 3 4 5 6 7 8 0 0\ncpu0 1 2 3 4 5 6 7 80 0 0\ncpu10 1 2 3 4 5 6 7 90 0 0\nintr 1\n";
        assert_eq!(
            (stolen_ms(stat, 0), stolen_ms(stat, 10), stolen_ms(stat, 1)),
            (Some(800), Some(900), None)
        );
        assert_eq!(
            put_aside("voluntary_ctxt_switches:\t1\nnonvoluntary_ctxt_switches:\t27\n"),
            Some(27)
        );
    }

    #[test]
    fn what_a_thread_computes_is_seen_and_told() {
        const COMPUTED_NS: u64 = 30_000_000;
        let (tell, told) = std::sync::mpsc::channel::<()>();
        let (computed, wait) = std::sync::mpsc::channel();
        let looked_at = std::thread::Builder::new().name("looked-at".into()).spawn(move || {
            told.recv().unwrap();
            while thread_cpu_ns() < COMPUTED_NS {}
            computed.send(()).unwrap();
            told.recv().unwrap_err();
        });
        let mut stalls = Stalls::new(0);
        // It gives itself its name once it runs.
        while stalls.thread.is_none() {
            stalls.thread = thread("looked-at");
        }
        stalls.update(LOOK_EVERY_NS);
        tell.send(()).unwrap();
        wait.recv().unwrap();
        let Evidence { since, .. } = stalls.evidence(LOOK_EVERY_NS + 7);
        drop(tell);
        looked_at.unwrap().join().unwrap();
        assert_eq!(since.at_ns, 7);
        assert!(since.ran_ns > COMPUTED_NS / 2, "{since:?}");

        let since = Counts {
            at_ns: 812_000_000,
            ran_ns: 640_400_000,
            waited_ns: 20_000_000,
            put_aside: 3,
            stolen_ms: 10,
        };
        assert_eq!(
            Evidence { cpu: 1, since }.to_string(),
            "within the last 812 ms it ran 640.4 ms, waited 20.0 ms for core 1 and was put aside 3 times; the host of a \
             virtual machine took 10 ms of that core"
        );
    }
}
