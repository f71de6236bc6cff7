//! `[rt]`: what real time needs of the PC.

use super::section::{keys, left_out};
use serde::{Deserialize, Serialize};

/// More cores than any kernel is built for.
const CPU_MAX: usize = 8191;

keys! {
    /// `[rt]`. What is `None` is found out by a short measurement when the machine starts; the default holds where that is
    /// switched off or cannot be made.
    #[derive(Clone, Debug, PartialEq)]
    pub struct Rt(section, cycle_us: u32) {
        /// Core of the real-time threads; `None`: the last isolated one, else the last one online.
        pub cpu: Option<usize> = section.optional_integer("cpu", 0..=CPU_MAX),
        /// Core of the time-out thread; `None`: that of the cycle thread.
        pub timeout_cpu: Option<usize> = section.optional_integer("timeout_cpu", 0..=CPU_MAX),
        /// Cores of all threads without real time; empty: all but those of the real-time threads.
        pub housekeeping_cpus: Vec<usize> =
            section.list("housekeeping_cpus", |item, path| item.integer(path, 0..=CPU_MAX)),
        /// SCHED_FIFO priority of the cycle thread, 1 to 96; the time-out thread runs one above, a simulated machine two.
        pub priority: u8 = section.integer("priority", 1..=96, 80),
        /// Period of the time-out thread, µs.
        pub timeout_us: u32 = section.integer("timeout_us", 20..=cycle_us, 50),
        /// Cycles start at `k * cycle_us + phase_us` of CLOCK_MONOTONIC.
        pub phase_us: Option<u32> = section.optional_integer("phase_us", 0..=cycle_us - 1),
        /// Spin this long before each cycle, µs. A thread that spins all the time is stopped for 50 ms in each second (throttling, fair
        /// server): half is far below.
        pub spin_us: Option<u32> = section.optional_integer("spin_us", 0..=cycle_us / 2),
        /// How the core is kept from idle states that take long to leave.
        pub keep_awake: Option<KeepAwake> = section.optional_word("keep_awake", &KeepAwake::WORDS),
        /// Measure what is best for the three above.
        pub calibrate: bool = section.flag("calibrate", true),
        /// A cycle that begins later than this is left out, µs; `None`: a quarter of the cycle. See [`Rt::late_max_us`].
        pub late_max_us: Option<u32> = section.optional_integer("late_us_max", 1..=cycle_us / 2),
        /// Cycles left out of a thousand above which the operator is warned; 0: never.
        pub overruns_warn: u32 = section.integer("overruns_warn", 0..=1000, 5),
        /// Cycles left out of a thousand above which the machine stops with an alarm; 0: never.
        pub overruns_stop: u32 = section.integer("overruns_stop", 0..=1000, 200),
        /// Lock all memory.
        pub lock_memory: bool = section.flag("lock_memory", true),
        /// What to do where something is missing.
        pub require: Require = section.word("require", &REQUIRE, Require::Warn),
    }
}

impl Default for Rt {
    fn default() -> Rt {
        left_out(|section| Rt::read(section, 10_000))
    }
}

impl Rt {
    /// Spin of a machine that says nothing, µs.
    pub const SPIN_DEFAULT_US: u32 = 50;

    /// A cycle that begins later than this is left out, µs. A late SoC makes two periods uneven by as much; a missing one makes
    /// one period double: which of them drives take better, their manuals say.
    pub fn late_max_us(&self, cycle_us: u32) -> u32 {
        self.late_max_us.unwrap_or(cycle_us / 4)
    }

    /// The spin without a measurement, µs.
    pub fn spin_us(&self) -> u32 {
        self.spin_us.unwrap_or(Rt::SPIN_DEFAULT_US)
    }

    /// The phase without a measurement, µs: at 37 % of the cycle, far from the scheduler tick, which comes on whole
    /// milliseconds; there in the middle between two ticks of the time-out thread, where these meet the cycle regularly.
    pub fn phase_us(&self, cycle_us: u32) -> u32 {
        self.phase_us.unwrap_or_else(|| {
            let wanted_us = cycle_us * 37 / 100;
            if cycle_us.is_multiple_of(self.timeout_us) {
                wanted_us / self.timeout_us * self.timeout_us + self.timeout_us / 2
            } else {
                wanted_us
            }
        })
    }
}

/// How the core of the real-time threads is kept from idle states that take long to leave.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum KeepAwake {
    /// `/dev/cpu_dma_latency` is held open at 0: the kernel chooses no idle state that takes time to leave. For PCs whose
    /// kernel has a driver for idle states.
    DmaLatency,
    /// A thread of the lowest priority (SCHED_IDLE) spins on the core. For virtual machines without such a driver.
    IdleThread,
    /// The time-out thread wakes at each of its ticks, needed or not. Takes from a tenth (real PCs) to half (virtual machines)
    /// of the core.
    Ticks,
    /// Not at all.
    None,
}

impl KeepAwake {
    /// The words of the machine file.
    const WORDS: [(&'static str, KeepAwake); 4] = [
        (KeepAwake::DmaLatency.name(), KeepAwake::DmaLatency),
        (KeepAwake::IdleThread.name(), KeepAwake::IdleThread),
        (KeepAwake::Ticks.name(), KeepAwake::Ticks),
        (KeepAwake::None.name(), KeepAwake::None),
    ];

    /// The word of the machine file.
    pub const fn name(self) -> &'static str {
        match self {
            KeepAwake::DmaLatency => "dma-latency",
            KeepAwake::IdleThread => "idle-thread",
            KeepAwake::Ticks => "ticks",
            KeepAwake::None => "none",
        }
    }
}

/// What to do where the PC cannot give what real time needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Require {
    /// Refuse to run.
    Strict,
    /// Say so once per item and run.
    Warn,
}

const REQUIRE: [(&str, Require); 2] = [("strict", Require::Strict), ("warn", Require::Warn)];
