//! What only trying it can tell.
//!
//! In:  questions of the lines. Out: whether it was given, or the reason in words. `this_pc.rs` answers for the PC that
//! this runs on; the tests have a PC of their own.

use std::fmt;
use std::path::Path;
use std::time::Duration;

/// What is really tried. Nothing that is tried sticks.
pub trait Tries {
    /// Lets time go by.
    fn pause(&self, time: Duration);

    /// Resolution of CLOCK_MONOTONIC, ns.
    fn timer_resolution_ns(&self) -> Result<u64, String>;

    /// Name of the hypervisor as the processor gives it; empty if it has none to give; `None`: there is no hypervisor.
    fn hypervisor(&self) -> Option<String>;

    /// Contents of a compressed file.
    fn unzip(&self, path: &Path) -> Result<String, String>;

    /// A thread on that core and no other.
    fn take_core(&self, cpu: usize) -> Result<(), String>;

    /// A thread with SCHED_FIFO on that core.
    fn fifo(&self, cpu: usize, priority: u8) -> Result<(), String>;

    /// All memory of a process, and what it gets later, locked.
    fn lock_memory(&self) -> Result<(), String>;

    /// A socket for whole Ethernet frames.
    fn raw_socket(&self) -> Result<(), String>;

    /// The file by which idle states are forbidden, opened for writing.
    fn dma_latency(&self) -> Result<(), String>;

    /// IP addresses of an interface.
    fn addresses(&self, interface: &str) -> Result<Vec<String>, String>;

    /// Name of the driver of an interface.
    fn driver(&self, interface: &str) -> Result<String, NoAnswer>;

    /// How long interrupts of an interface wait for more frames.
    fn coalescing(&self, interface: &str) -> Result<Coalescing, NoAnswer>;

    /// Offloads of an interface that are on.
    fn offloads(&self, interface: &str) -> Result<Vec<Offload>, NoAnswer>;

    /// Whether Energy-Efficient Ethernet is on.
    fn energy_efficient(&self, interface: &str) -> Result<bool, NoAnswer>;

    /// Whether PAUSE frames are sent or obeyed.
    fn flow_control(&self, interface: &str) -> Result<bool, NoAnswer>;

    /// Who stamps frames of an interface.
    fn time_stamps(&self, interface: &str) -> Result<TimeStamps, NoAnswer>;

    /// Measures how late a thread is woken up on a core.
    fn wake_up(&self, cpu: usize, priority: u8, time: Duration) -> Result<Latency, String>;

    /// Measures what takes the core from a thread that never sleeps.
    fn gaps(&self, cpu: usize, priority: u8, time: Duration) -> Result<Latency, String>;
}

/// Why a network interface does not tell something.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NoAnswer {
    /// Its driver has no such thing.
    NotSupported,
    /// Another reason, in words.
    Refused(String),
}

/// How long interrupts wait for more frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Coalescing {
    /// After a frame has come, us.
    pub rx_usecs: u32,
    /// After a frame was sent, us.
    pub tx_usecs: u32,
    /// Whether the driver sets either by itself.
    pub adaptive: bool,
}

/// What gathers frames on their way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Offload {
    /// Generic receive offload.
    Gro,
    /// Large receive offload.
    Lro,
    /// Generic segmentation offload.
    Gso,
    /// TCP segmentation offload.
    Tso,
    /// VLAN tags taken off by the NIC.
    RxVlan,
    /// VLAN tags put in by the NIC.
    TxVlan,
}

impl Offload {
    /// All that are looked at.
    pub const ALL: [Offload; 6] = [
        Offload::Gro,
        Offload::Lro,
        Offload::Gso,
        Offload::Tso,
        Offload::RxVlan,
        Offload::TxVlan,
    ];

    /// As `ethtool -K` takes it.
    pub const fn name(self) -> &'static str {
        match self {
            Offload::Gro => "gro",
            Offload::Lro => "lro",
            Offload::Gso => "gso",
            Offload::Tso => "tso",
            Offload::RxVlan => "rxvlan",
            Offload::TxVlan => "txvlan",
        }
    }
}

/// Who stamps frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimeStamps {
    /// The NIC stamps frames that come; otherwise the kernel does.
    pub hardware: bool,
}

/// What a measurement came to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Latency {
    /// Number of values.
    pub n: u64,
    /// Half of the values are at or below this.
    pub p50_us: f64,
    /// As `p50_us`, for 99 %.
    pub p99_us: f64,
    /// As `p50_us`, for 99.9 %.
    pub p99_9_us: f64,
    pub max_us: f64,
}

impl fmt::Display for Latency {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Latency {
            p50_us,
            p99_us,
            p99_9_us,
            max_us,
            ..
        } = self;
        write!(
            f,
            "max {max_us:.1} us, p50 {p50_us:.1}, p99 {p99_us:.1}, p99.9 {p99_9_us:.1}"
        )
    }
}
