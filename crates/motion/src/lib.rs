//! Canonical moves to joint positions per cycle.
//!
//! In:  canonical moves ([`canon`]).
//! Out: one position per joint and cycle (`rt`).
//!
//! Everything left of the ring plans and may allocate; everything right of it runs in the cycle thread and may not.
//!
//! ```text
//! canon -> plan -> ring -> rt                     -> kinematics
//! calls    speed           positions per cycle       joints
//! ```
//!
//! Lengths are mm, angles degrees, times seconds, if nothing else is said. The same calls give the same positions, to the last
//! bit, on every machine.
//!
//! ```
//! use motion::canon::{AXES, Call, Event, Position, Source};
//! use motion::plan::{AxisLimits, Settings, plan_offline};
//!
//! let axis = AxisLimits { velocity: 100.0, acceleration: 1000.0, jerk: 20_000.0, travel: [-500.0, 500.0] };
//! let settings = Settings::new([Some(axis); AXES], 1e-3);
//! let calls = [
//!     Call::SetFeedRate { linear: 50.0, angular: 50.0 },
//!     Call::StraightFeed { to: Position::xyz(30.0, 40.0, 0.0) },
//! ];
//! let events = calls.map(|call| Event { source: Source::default(), call });
//! let plan = plan_offline(&events, settings)?;
//! // 50 mm at 50 mm/s, and as long as it takes to reach that speed.
//! assert!(plan.motion_time_s > 1.0 && plan.motion_time_s < 1.2);
//! assert_eq!(plan.samples.last(), Some(&Position::xyz(30.0, 40.0, 0.0)));
//! # Ok::<(), motion::plan::PlanError>(())
//! ```
//!
//! # Where to read
//!
//! | to learn | where |
//! |---|---|
//! | pieces of path and their derivatives by length | `path/` |
//! | how axes become joints, for planner and interpolation alike: one inverse, generic over the number (f64, or a value with three derivatives) | `kinematics/` |
//! | what a move is in machine coordinates; what the planner refuses, and why | `plan/program/`, `plan/frame.rs`, `plan/travel.rs`, `plan/joint_space.rs` |
//! | short moves to long curves; corners; collinear moves | `plan/smooth/` (`naive_cam`, `steps`; `compress`, `fit`, `bspline`; `corners`, `round`, `overlap`) |
//! | tangential and gentle joints of lines and arcs | `plan/smooth/min_jerk_blend/` (`pace`, `least_jerk`, `track`, `curve`) |
//! | splines and NURBS to quintics with their own curvature, within a proven 0.1 µm | `plan/curve/`, `plan/program/curves.rs` |
//! | pieces that are not rounded and meet with a small jump; what it takes of the limits | `plan/junctions.rs` |
//! | the gate: every seam of what is handed over; what is refused is planned again | `plan/gate.rs` |
//! | the optimal planner: nearly the shortest time under speed, acceleration and jerk of every joint | `plan/optimal/`, from `mod.rs` on; `plan/optimal/stream/mod.rs` has the table of its parts |
//! | the interior point method alone: a grid in, b = v² as a quadratic spline out | `plan/optimal/solver/` |
//! | the classic planner: corner speeds, passes, seven phases; its look-ahead in overlapping buffers | `plan/classic/`, `plan/classic/buffers/` |
//! | motion in step with the spindle | `rt/synced/` |
//! | which share of the planned speed acts on which element | `rt/shares.rs` |
//! | plan time that stops at a given place; elements kept for the way back | `rt/braking.rs`, `rt/track.rs` |
//! | a probing move, from the plan to the contact and back to the program, which waits for its end | `plan/probing.rs`, `rt/probe/prober.rs`, then `waits.rs` of the crate `program` |
//! | motion without a plan: jog of joints and of axes (`world`), homing, probing | `rt/otg/`, `rt/jog/`, `rt/homing/`, `rt/probe/` |
//! | the position loop of a joint | `rt/pid/` |
//! | step pulses; backlash and pitch errors, and their file; what watches every command | `rt/dda.rs`; `rt/joint_compensation/`, `pitch_file.rs` in it; `rt/monitor.rs` |
//!
//! # How speeds are planned
//!
//! The optimal planner cuts the path into sections between rests, places knots about evenly in time, and cuts sections into
//! windows by estimated time. A small jump of direction or curvature is no border: within three cycles of it, it takes a part
//! of the limits that grows with the speed (`junctions.rs`); if that costs more than a rest, the machine rests. Around every
//! border a small window is solved first, which gives the speed and acceleration there; then each window is solved between its
//! borders, from a profile that keeps all limits. Every step of the solver keeps them, so a plan is legal whenever it stops; if
//! no start is found, a few pieces are run from rest to rest. On straight stretches knots are further apart: what is handed over
//! there is the fastest motion between the solved states at both ends, in closed form (`plan/optimal/s_curve.rs`).
//!
//! Sharp corners are passed slowly rather than at rest: the end of motion on one leg overlaps the beginning on the other, and the
//! path swings out within the tolerance before it turns. Several shapes (`smooth/overlap.rs`) and a stop are compared by the time
//! that each would take; the classic planner, with one speed per piece, rounds corners that it can pass fast. A corner between a
//! rapid move and one at feed is rounded as well, by the optimal planner: both speeds and both overrides bound it. Its exact way,
//! over a rest at the corner itself, is kept with it (`smooth::Seam`), and is planned instead while the move after it is held by
//! an override of 0 %, so that the machine waits where the program says (`plan/optimal/sections.rs`).
//! `cargo bench -p isocnc-motion --bench corners` prints what corners cost.
//!
//! Limits are planned with 0.9999 (speed), 0.995 (acceleration; 0.9985 on straight lines) and 0.965 to 0.985 (jerk; the more it
//! may vary between checkpoints, the less); `tests/plan_proof.rs` of the program proves 1 ms set-points.
//!
//! Motion that takes long costs no more than motion that does not: knots grow apart inside stretches on which nothing changes,
//! and an element that takes long stays whole until it is handed over. A machine that may have to leave its plan on the way then
//! gets it in parts of 10 ms, some thousands at a time, with what is left of it as the tail after them; `isocnc plan`, which no
//! override ever interrupts, gets it whole, runs its ends and many places on the way, and says how many cycles it has judged.
//!
//! A changed override is a new plan from the end of an element a little ahead of the machine, with the speed and acceleration
//! there; it replaces final motion in the ring by one compare-exchange, or the old plan stays. It is never faster than the old one
//! would have become, and comes down to its feed with limited jerk. Holds and stops scale time instead (`rt/scale.rs`), against
//! the stop limits. 0 % is a hold; with `classic`, all of it is time scaling, up to 100 %.
//!
//! What spindle, coolant, tool changer and operator are told is part of every move (`element::Auxiliary`), and what differs from
//! the move before is done by the cycle thread as the move begins (`Sample::on_the_way`): no rest is planned for it, and a new plan,
//! a stop or a start in the middle need nothing of their own. Outputs (M62, M63, M67) are part of it as well, and all change in the
//! cycle in which the move begins (`Sample::outputs`). What has to be waited for is an element of its own at rest (`Action`).
//!
//! # The same bits everywhere
//!
//! What comes out never depends on how many threads work: they return results by number (`plan/workers.rs`). Functions of angles,
//! powers and logarithms come from libm; `clippy.toml` in `motion`, `gcode` and `logic` refuses the others. The solver's passes over
//! the constraints are compiled for any processor, for AVX2 and for AVX-512, and chosen at run time (crate multiversion); no
//! product is fused with a sum, so all give the same bits.
//!
//! The classic planner looks ahead over `look_ahead_blocks` and at least three braking lengths, however many blocks these are, up to
//! three of the longest stops that a publication may have (8192 elements). Its passes and slopes are computed ahead in overlapping
//! buffers by all threads (`classic/buffers/`); a pass uses a result only if it was computed from the speed that the pass itself has
//! come to, otherwise it computes again, so that buffers and overlaps change the time that planning takes and no bit of the plan.
//! `isocnc plan --efficiency FILE.svg` measures what they bring.
//!
//! # How a plan is judged
//!
//! What is no move is decided in one place, and no seam of a plan is published that a joint could feel: `plan/gate.rs`,
//! `docs/decisions/no-move.md`. How set-points are judged where one generator follows another (plan, probing, thread, hold, way
//! back, jog, homing): `tests/seams.rs` of the program. How a plan is judged: the crate `plan-report` (report, picture),
//! `tests/proof_programs/` (programs), `scripts/prove-plans.sh`, `scripts/reference-times.py`; `scripts/path-bound.py` (CasADi)
//! says what path and speed chosen together could still save; `cargo bench --bench dense` runs 10,000 blocks a second in real
//! time.

#![cfg_attr(
    test,
    allow(clippy::disallowed_methods, reason = "tests may use the PC's own functions")
)]

pub mod cancel;
pub mod canon;
pub mod element;
pub mod kinematics;
pub mod path;
pub mod plan;
pub mod ring;
pub mod rt;

#[cfg(test)]
#[path = "../../../tests/common/counting.rs"]
mod counting;
#[cfg(test)]
mod no_allocation_tests;
