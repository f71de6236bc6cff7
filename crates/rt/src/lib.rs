//! Real time: the cycle thread, the time-out thread and what they need from the system.
//!
//! In:  answers of the nodes, orders through a ring, the plan in the ring.
//! Out: set-points, step pulses, pins; notices and trace records through rings.
//!
//! RT: what runs in a cycle never allocates, locks, waits for another thread or touches a file. `tests/rt_sources.rs`,
//! `no_allocation.rs`, `system_calls.rs` and `realtime_sanitizer.rs` of the program prove it.
//!
//! | to learn | file |
//! |---|---|
//! | what a cycle does, in order; orders; faults and stops | `cycle/mod.rs`; `cycle/orders.rs`; `cycle/stops.rs` |
//! | set-points; what a program wants beside motion; states | `cycle/set_points.rs`; `cycle/actions.rs`; `cycle/states.rs` |
//! | when a cycle begins, and how its dates follow the clock of the bus | `thread.rs` |
//! | what watches the cycle and ends waits | `timeout/mod.rs`, its decisions in `timeout/watchdog/mod.rs` |
//! | what crosses the border to the ordinary threads | `shared.rs`; the latest values: `snapshot.rs` |
//! | how a machine file becomes a cycle | `assemble.rs` |
//! | drives: payload fields to millimetres and back, where a drive counts 0 | `drives/mod.rs` |
//! | drives in this process, controlled like those on the bus | `local_drive.rs`; with step pulses `steps/`, behind an I/O node `analog.rs` |
//! | the gains of a position loop while it runs (the loop is in `motion::rt`) | `loop_pins.rs` |
//! | the spindle; a CiA 402 drive that turns it; its place from a counter | `spindle/`; `spindle/drive.rs`; `encoder.rs`, `counter.rs` |
//! | which part has which pins, and the order in which they are made | `pins.rs` |
//! | nodes on the bus and their pins; the emergency stop chain; the tool changer | `nodes.rs`; `estop_chain.rs`; `tool_changer.rs` |
//! | joints moved by hand; axes of machines whose joints are not their axes | `joint_jog.rs`; `axis_jog.rs` |
//! | how a machine that was jogged away returns to its held program | `way_back.rs` |
//! | homing of joints whose drives do not home: switches, latched zero marks | `homing.rs` |
//! | who carries out an override | `overrides.rs` |
//! | what a program that stands still waits for, and what releases it | `waiting.rs` |
//! | inputs and outputs of programs (M62 to M68); channels of I/O nodes by type, name and unit | `io_pins.rs`; `io_channels.rs` |
//! | components before and after motion; pins that other processes write | `plc.rs`, `components.rs`; `external.rs` |
//! | programs in Structured Text: a scan gets the inputs of one cycle and shows in one cycle | `logic/mod.rs`; what ordinary threads see: `logic/desk.rs` |
//! | what is recorded of each cycle, in windows that can be cut while it runs; time of its parts on request | `cycle_stats.rs`; `cycle/laps.rs` |
//!
//! # Every way to rest
//!
//! | cause | who | how |
//! |---|---|---|
//! | hold, stop, Ctrl-C, drives off or shut-down during a program | cycle thread | feed scale to 0 by a ramp whose length is computed so that the stop limits are kept for any plan within the limits; on the path. A stop leaves drives on; power goes off only at rest |
//! | emergency stop: its chain, an order, a pin | cycle thread (`cycle/stops.rs`) | quick stop of every drive in the same cycle; nothing before a reset |
//! | limit switch | cycle thread | as a fault of class *controlled stop*; then only jogs away from it |
//! | fault of class *controlled stop* | cycle thread | all joints together as in a stop, then quick stop of every drive; the first cause is kept. A tap in the work is first followed out of it, with the spindle reversed |
//! | counts of the spindle's encoder lost | cycle thread (`encoder.rs`) | in a move in step with the spindle a controlled stop; otherwise a warning, and the new index is used |
//! | queue runs dry | the plan itself | the planned stop at its end; goes on by itself |
//! | end of a block in single block, end of the way back | cycle thread (`motion::rt`, `braking.rs`) | a ramp that ends exactly there, or the plan's own rest; then held |
//! | homing by the control aborted or stopped | cycle thread (`homing.rs`) | each joint to rest within its stop limits; it is not homed; drives off |
//! | jog released, not renewed for 0.2 s, hold | cycle thread (`joint_jog.rs`, `axis_jog.rs`) | each joint to rest within its limits |
//! | command beyond travel, or over velocity or acceleration by more than 1 %, or no number | cycle thread (`motion::rt::Monitor`) | it is not sent: from what was sent last each joint comes to rest within its stop limits, together and near the line on which they moved; then as a controlled stop |
//! | command over jerk by more than 1 % | the same | controlled stop on the path |
//! | following error of a joint whose loop the control closes | cycle thread (`drives/mod.rs`) | quick stop of the drives at once: the loop that would lead it on its path has failed |
//! | cycle thread hung, process dead | drives | no SoC: each drive stops by itself (loss of SoC, then quick stop); state *silenced*. The control ends by itself with its own exit code and is restarted |
//! | time-out thread hung | operator's loop (`operator_loop.rs` of `operator`) | as Ctrl-C, with that exit code |
//!
//! A program is in the cycle thread only while it runs, is held or stops, and one that does not begin where the joints stand is
//! refused: switching drives on never moves anything. After a fault nothing is enabled before an acknowledge, and then only by
//! its own order. A drive's warning (statusword bit 7) is a fault of class *controlled stop* as well: better a part that waits
//! than a drive that fails in the cut.
//!
//! A late cycle is counted; whole missed cycles are skipped on the old grid. The trajectory advances by one step per cycle that
//! really ran, so a late cycle costs time and is never a jump of position. The drives see a standstill of one cycle (one that gets
//! a velocity continues at it, and its loop then takes that back), which is why `machine::overruns` stops a machine with many.

// What is public here is so for the program and its tests, and says more than its name only where there is more to say.
#![allow(missing_docs)]

pub mod analog;
pub mod assemble;
pub mod axis_jog;
pub mod components;
pub mod counter;
pub mod cycle;
pub mod cycle_stats;
pub mod desk;
pub mod drives;
pub mod encoder;
pub mod estop_chain;
pub mod external;
pub mod feed_pins;
pub mod homing;
pub mod io_channels;
pub mod io_pins;
pub mod jog_pins;
pub mod joint_jog;
pub mod local_drive;
pub mod logic;
pub mod loop_pins;
pub mod machine_pins;
pub mod nodes;
pub mod override_pins;
pub mod overrides;
pub mod phase;
pub mod pins;
pub mod plc;
pub mod probe;
pub mod recent;
pub mod shared;
mod snapshot;
pub mod spindle;
pub mod step_pins;
pub mod steps;
pub mod thread;
pub mod timeout;
pub mod times;
mod timing_pins;
pub mod tool_changer;
pub mod tool_pockets;
pub mod waiting;
pub mod way_back;
