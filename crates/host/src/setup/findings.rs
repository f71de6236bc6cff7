//! What is missing on a PC, in words, each with its cure; and what the kernel itself must be.
//!
//! In:  what the parts of the set-up have looked at.
//! Out: [`Finding`]s for warnings, [`Refusal`] where the machine file takes none.

use serde::Serialize;
use std::fmt;

/// The cure for most missing rights.
pub(super) const RIGHTS: &str = "run as root, or grant 'rtprio 99' and 'memlock unlimited' in \
                                 /etc/security/limits.d, or 'setcap cap_sys_nice,cap_ipc_lock,cap_net_raw+ep' on \
                                 the program";

/// What is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Item {
    Kernel,
    Timers,
    /// The core of the real-time threads.
    Core,
    Priority,
    Memory,
    /// No deep idle states.
    IdleStates,
    /// Blocked signals and timer slack of a real-time thread.
    Thread,
}

impl Item {
    /// A short name.
    pub const fn name(self) -> &'static str {
        match self {
            Item::Kernel => "kernel",
            Item::Timers => "timers",
            Item::Core => "core",
            Item::Priority => "priority",
            Item::Memory => "memory",
            Item::IdleStates => "idle states",
            Item::Thread => "thread",
        }
    }
}

/// One thing that is missing.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// What was looked at.
    pub item: Item,
    /// What was found.
    pub what: String,
    /// How to change it.
    pub fix: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "real time, {}: {}; {}", self.item.name(), self.what, self.fix)
    }
}

/// Findings in words, a line for all that have one cure.
pub fn by_cure(findings: &[Finding]) -> Vec<String> {
    let mut cures: Vec<(&str, Vec<String>)> = Vec::new();
    for Finding { item, what, fix } in findings {
        let what = format!("{}: {what}", item.name());
        match cures.iter_mut().find(|(cure, _)| cure == fix) {
            Some((_, found)) => found.push(what),
            None => cures.push((fix, vec![what])),
        }
    }
    let line = |(fix, found): (&str, Vec<String>)| format!("real time, {}; {fix}", found.join("; "));
    cures.into_iter().map(line).collect()
}

/// `require = "strict"` and something is missing.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Refusal {
    /// All that is missing.
    pub findings: Vec<Finding>,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "this PC lacks what rt.require = \"strict\" asks for (\"warn\" would run all the same):"
        )?;
        by_cure(&self.findings)
            .iter()
            .try_for_each(|line| write!(f, "\n  {line}"))
    }
}

impl std::error::Error for Refusal {}

impl Finding {
    pub(super) fn new(item: Item, what: impl Into<String>, fix: impl Into<String>) -> Finding {
        Finding {
            item,
            what: what.into(),
            fix: fix.into(),
        }
    }
}

/// `realtime`: what stands in `/sys/kernel/realtime`, which other kernels do not have.
pub(super) fn kernel(realtime: Option<&str>) -> Option<Finding> {
    (realtime.map(str::trim) != Some("1")).then(|| {
        Finding::new(
            Item::Kernel,
            "this kernel is not PREEMPT_RT, so lateness has no bound",
            "install a real-time kernel (Debian: linux-image-rt-amd64; Ubuntu: linux-realtime)",
        )
    })
}

pub(super) fn timers() -> Option<Finding> {
    let resolution = nix::time::clock_getres(nix::time::ClockId::CLOCK_MONOTONIC).ok()?;
    let coarse = resolution.tv_sec() > 0 || resolution.tv_nsec() > 1;
    coarse.then(|| {
        Finding::new(
            Item::Timers,
            format!("the clock moves in steps of {} ns", resolution.tv_nsec()),
            "boot without 'highres=off' on a kernel with CONFIG_HIGH_RES_TIMERS=y",
        )
    })
}
