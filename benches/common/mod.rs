//! What every bench prints beside its figures: how busy the PC was meanwhile.

use std::fs::read_to_string;

/// Processor time of all cores since boot, in ticks.
pub(crate) struct Busyness {
    all: u64,
    idle: u64,
    steal: u64,
}

impl Busyness {
    /// Looks at the PC now.
    pub(crate) fn now() -> Busyness {
        let stat = read_to_string("/proc/stat").unwrap_or_default();
        let fields = stat.lines().next().unwrap_or_default().split_whitespace().skip(1);
        let ticks: Vec<u64> = fields.filter_map(|field| field.parse().ok()).collect();
        let at = |index: usize| ticks.get(index).copied().unwrap_or(0);
        Busyness {
            // Guests are contained in the first two.
            all: ticks.iter().take(8).sum(),
            idle: at(3) + at(4),
            steal: at(7),
        }
    }

    /// A line about the time since then.
    pub(crate) fn line(&self) -> String {
        let now = Busyness::now();
        let all = (now.all - self.all).max(1) as f64;
        let percent = |ticks: u64| ticks as f64 / all * 100.0;
        format!(
            "load average {}; meanwhile {:.0} % of all cores busy, {:.1} % stolen by the host",
            read_to_string("/proc/loadavg").unwrap_or_default().trim(),
            100.0 - percent(now.idle - self.idle),
            percent(now.steal - self.steal)
        )
    }
}
