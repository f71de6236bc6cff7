//! This PC: what real time needs of it, what it can do, what stands in the way.
//!
//! In:  `[rt]` of the machine file; the files in which the kernel describes this PC.
//! Out: prepared threads, measured times, findings with their cures.
//!
//! | to learn | file |
//! |---|---|
//! | what real time needs, as a table | `setup/mod.rs` |
//! | how spin, phase and the way to keep the core awake are chosen | `calibrate/` |
//! | the floor of the PC, used by calibration, `doctor` and `jitter` | `latency.rs` |
//! | which cycle this PC keeps, and which keys of a machine file tolerate too little for it: at the start, in `check`, in the demo | `steadiness.rs` |
//! | how the network's locks of a PREEMPT_RT kernel are passed before the spin, so that no SoC waits for them | `network_locks.rs` |
//! | how the spin grows if wake-ups come later than at the start | `spin.rs` |
//! | whether the cycle thread computed or waited, as the kernel counted it | `stalls.rs` |
//! | everything that `doctor` asks of the PC, as a table (`scripts/isolcpus.sh` sets it) | `doctor/checks.rs` |
//! | which rights a thread keeps, as a table | `capabilities.rs` |
//! | where step pulses leave | `step_port.rs` |
//! | the log of the ordinary threads; the real-time threads have none | `logging.rs` |
//! | waiting for a date; Ctrl-C; the terminal of a command | `wait.rs`; `signals.rs`; `terminal.rs` |

// What is public here is so for the program and its tests, and says more than its name only where there is more to say.
#![allow(missing_docs)]

pub mod calibrate;
pub mod capabilities;
pub mod doctor;
pub mod histogram;
pub mod latency;
pub mod logging;
pub mod netns;
pub mod network_locks;
pub mod other_controls;
pub mod setup;
pub mod signals;
pub mod spin;
pub mod stalls;
pub mod steadiness;
pub mod step_port;
pub mod terminal;
pub mod wait;
pub mod wake_signal;
