//! What PC this is, and what else it does meanwhile: facts that belong beside every figure.
//!
//! In:  `/proc` and `/sys` below a folder, which is `/` outside tests.
//! Out: [`Pc`], [`Load`], the time of day.

use super::report::{Load, Pc};
use host::doctor::cpus::Cpus;
use std::path::{Path, PathBuf};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// The kernel counts time stolen by the host in these, ms (USER_HZ is 100 on every PC).
const STEAL_TICK_MS: f64 = 10.0;

/// Where facts are read.
#[derive(Clone, Debug)]
pub struct Facts {
    root: PathBuf,
}

impl Facts {
    /// Facts below a folder.
    pub fn below(root: impl Into<PathBuf>) -> Facts {
        Facts { root: root.into() }
    }

    /// The PC. What cannot be read is empty.
    pub fn pc(&self, core: usize, findings: Vec<String>) -> Pc {
        let cpuinfo = self.text("proc/cpuinfo");
        let field = |name: &str| {
            let mut lines = cpuinfo.lines().filter_map(|line| line.split_once(':'));
            lines
                .find(|(key, _)| key.trim() == name)
                .map_or("", |(_, value)| value.trim())
        };
        let list = |path: &str| Cpus::parse_list(&self.text(path));
        Pc {
            kernel: format!(
                "{} {}",
                self.text("proc/sys/kernel/osrelease"),
                self.text("proc/sys/kernel/version")
            ),
            preempt_rt: self.text("sys/kernel/realtime") == "1",
            virtual_machine: field("flags").split_whitespace().any(|flag| flag == "hypervisor"),
            cpu_model: field("model name").to_owned(),
            cores: list("sys/devices/system/cpu/online").map_or(0, |online| online.len()),
            core,
            core_isolated: list("sys/devices/system/cpu/isolated").is_some_and(|isolated| isolated.contains(core)),
            findings,
        }
    }

    /// Begins to look at what else the PC does.
    pub fn watch(&self) -> LoadWatch {
        LoadWatch {
            facts: self.clone(),
            began: Instant::now(),
            load_average: self.load_average(),
            stat: self.text("proc/stat"),
        }
    }

    /// Load average of the last minute.
    fn load_average(&self) -> f64 {
        let text = self.text("proc/loadavg");
        text.split_whitespace()
            .next()
            .and_then(|first| first.parse().ok())
            .unwrap_or(0.0)
    }

    fn text(&self, path: &str) -> String {
        let text = std::fs::read_to_string(self.root.join(Path::new(path))).unwrap_or_default();
        text.trim().to_owned()
    }
}

/// A look at what else the PC does.
#[derive(Clone, Debug)]
pub struct LoadWatch {
    facts: Facts,
    began: Instant,
    load_average: f64,
    stat: String,
}

impl LoadWatch {
    /// What it did since the look began; stolen time of one core.
    pub fn end(&self, core: usize) -> Load {
        let stolen = steal_ticks(&self.facts.text("proc/stat"), core).saturating_sub(steal_ticks(&self.stat, core));
        Load {
            seconds: self.began.elapsed().as_secs_f64(),
            load_average_before: self.load_average,
            load_average_after: self.facts.load_average(),
            steal_ms: stolen as f64 * STEAL_TICK_MS,
        }
    }
}

/// What the host has given to others although a core wanted to run.
fn steal_ticks(stat: &str, core: usize) -> u64 {
    let name = format!("cpu{core}");
    let mut lines = stat.lines().map(str::split_whitespace);
    let line = lines.find_map(|mut words| (words.next() == Some(&name)).then_some(words));
    line.and_then(|mut numbers| numbers.nth(7)?.parse().ok()).unwrap_or(0)
}

/// The time of day, UTC: `2026-11-21T10:40:03Z`.
pub fn utc_now() -> String {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    utc(since.as_secs())
}

/// Seconds since 1970 as date and time of day.
fn utc(unix_s: u64) -> String {
    let (days, second) = (unix_s / 86_400, unix_s % 86_400);
    // Days since 1 March 0000, in eras of 400 years; a year begins in March so that its last day is the leap day.
    let shifted = days + 719_468;
    let (era, day_of_era) = (shifted / 146_097, shifted % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1_460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_from_march = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = if month_from_march < 10 {
        month_from_march + 3
    } else {
        month_from_march - 9
    };
    let year = era * 400 + year_of_era + u64::from(month <= 2);
    format!(
        "{year:04}-{month:02}-{day:02}T{:02}:{:02}:{:02}Z",
        second / 3600,
        second / 60 % 60,
        second % 60
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_by_hand() {
        for (unix_s, date) in [
            (0, "1970-01-01T00:00:00Z"),
            (951_782_399, "2000-02-28T23:59:59Z"),
            (951_782_400, "2000-02-29T00:00:00Z"),
            (951_868_800, "2000-03-01T00:00:00Z"),
            (1_795_257_603, "2026-11-21T10:40:03Z"),
            (4_107_542_399, "2100-02-28T23:59:59Z"),
            (4_107_542_400, "2100-03-01T00:00:00Z"),
        ] {
            assert_eq!(utc(unix_s), date);
        }
    }

    #[test]
    fn facts_of_a_made_up_pc() {
        let root = tempfile::tempdir().unwrap();
        let put = |path: &str, text: &str| {
            let path = root.path().join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        };
        let facts = Facts::below(root.path());
        let nothing = facts.pc(1, vec!["a finding".into()]);
        assert_eq!(
            (nothing.kernel.trim(), nothing.preempt_rt, nothing.virtual_machine),
            ("", false, false)
        );
        assert_eq!((nothing.cores, nothing.core, nothing.core_isolated), (0, 1, false));
        assert_eq!(facts.watch().end(1).steal_ms, 0.0);

        put("proc/sys/kernel/osrelease", "6.12.9-rt\n");
        put("proc/sys/kernel/version", "#1 SMP PREEMPT_RT\n");
        put("sys/kernel/realtime", "1\n");
        put(
            "proc/cpuinfo",
            "processor\t: 0\nmodel name\t: Some CPU\nflags\t\t: fpu tsc hypervisor\n\nprocessor\t: 1\n",
        );
        put("sys/devices/system/cpu/online", "0-3\n");
        put("sys/devices/system/cpu/isolated", "2-3\n");
        let pc = facts.pc(2, Vec::new());
        assert_eq!(pc.kernel, "6.12.9-rt #1 SMP PREEMPT_RT");
        assert!(pc.preempt_rt && pc.virtual_machine && pc.core_isolated);
        assert_eq!((pc.cpu_model.as_str(), pc.cores), ("Some CPU", 4));
        assert!(!facts.pc(1, Vec::new()).core_isolated);

        put("proc/loadavg", "2.50 1.00 0.50 3/129 4711\n");
        put(
            "proc/stat",
            "cpu  9 9 9 9 9 9 9 99 0 0\ncpu1 1 2 3 4 5 6 7 8 0 0\ncpu12 1 1 1 1 1 1 1 70 0 0\n",
        );
        let watch = facts.watch();
        put("proc/loadavg", "3.50 1.00 0.50 3/129 4711\n");
        put(
            "proc/stat",
            "cpu  9 9 9 9 9 9 9 99 0 0\ncpu1 1 2 3 4 5 6 7 11 0 0\ncpu12 1 1 1 1 1 1 1 90 0 0\n",
        );
        let load = watch.end(1);
        assert_eq!(
            (load.load_average_before, load.load_average_after, load.steal_ms),
            (2.5, 3.5, 30.0)
        );
    }
}
