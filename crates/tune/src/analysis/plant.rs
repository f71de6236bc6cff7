//! What a position loop drives: amplifier, motor and load, as a model with a few numbers, found from moves.
//!
//! In:  a [`Record`] of a joint whose loop the control closes. Out: a [`Plant`] and how well it fits.
//!
//! | amplifier | model |
//! |---|---|
//! | velocity | `T x'' + x' = K u(t - D)` |
//! | torque | `x'' = A u(t - D) - B x'` |
//!
//! beside a constant drift and friction. `D` is all that passes from a computed output to its first effect on a position that is read:
//! the two cycles of the bus, and what drive and encoder add.

use super::linear::LeastSquares;
use super::record::{Move, Record};
use anyhow::ensure;
use serde::Serialize;

/// A model that leaves more than this share of a motion unexplained is none.
const LEFT_MAX: f64 = 0.1;
/// Cycles before a move with which it is looked at.
const BEFORE: usize = 4;
/// Of the rest behind it, s.
const BEHIND_S: f64 = 0.05;
/// Dead times that are tried: up to so many cycles, in steps of that share of one.
const DEAD_CYCLES: f64 = 12.0;
const DEAD_STEP: f64 = 0.05;

/// What an amplifier makes of the output of the loop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "amplifier")]
pub enum Plant {
    /// Told a velocity.
    Velocity {
        /// mm/s that come of an output of 1 mm/s.
        gain: f64,
        lag_s: f64,
        dead_s: f64,
    },
    /// Told a torque, as a share of the rated one.
    Torque {
        /// Acceleration by the rated torque, mm/s².
        gain: f64,
        /// Deceleration for each mm/s, 1/s.
        damping: f64,
        dead_s: f64,
    },
}

impl Plant {
    pub fn dead_s(&self) -> f64 {
        match *self {
            Plant::Velocity { dead_s, .. } | Plant::Torque { dead_s, .. } => dead_s,
        }
    }
}

/// A plant that was found.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Identified {
    #[serde(flatten)]
    pub plant: Plant,
    /// Output that friction takes, in units of the output.
    pub friction: f64,
    /// Output that is needed at rest, such as for a weight, in units of the output.
    pub bias: f64,
    /// Share of the motion that the model does not explain (root of the mean square).
    pub left: f64,
}

/// Output and place around one move, from its first cycle on.
struct Window<'a> {
    record: &'a Record,
    begin: usize,
    end: usize,
    /// ∫u from the beginning of the record to each of its cycles.
    outputs: &'a [f64],
}

impl Window<'_> {
    /// ∫u up to `dead_s` before a cycle, from the same before the beginning of the window.
    fn delayed(&self, at: usize, dead_s: f64) -> f64 {
        let cycle_s = self.record.cycle_s;
        let integral = |at: usize| {
            let place = (at as f64 - dead_s / cycle_s).max(0.0);
            let whole = place.floor();
            let cycle = whole as usize;
            self.outputs[cycle] + self.record.cycles[cycle].output * (place - whole) * cycle_s
        };
        integral(at) - integral(self.begin)
    }
}

/// Finds the plant of a velocity amplifier (`is_torque`: of a torque amplifier) from moves there and back.
///
/// # Errors
/// Moves that do not tell it.
pub fn identify(record: &Record, moves: &[Move], is_torque: bool) -> anyhow::Result<Identified> {
    ensure!(!moves.is_empty(), "nothing has moved");
    ensure!(record.has_output(), "the control does not close the loop of this joint");
    let mut outputs = vec![0.0];
    for (at, cycle) in record.cycles.iter().enumerate() {
        outputs.push(outputs[at] + cycle.output * record.cycle_s);
    }
    let behind = (BEHIND_S / record.cycle_s) as usize;
    let windows: Vec<Window<'_>> = moves
        .iter()
        .map(|of| Window {
            record,
            begin: of.motion.start.saturating_sub(BEFORE),
            end: of.end.min(of.motion.end + behind),
            outputs: &outputs,
        })
        .collect();
    let fit = |dead_s: f64| match is_torque {
        false => velocity(&windows, dead_s),
        true => torque(&windows, dead_s),
    };
    let steps = (DEAD_CYCLES / DEAD_STEP) as u32;
    let tried = (0..=steps).map(|step| fit(f64::from(step) * DEAD_STEP * record.cycle_s));
    let found = tried.min_by(|one, other| one.left.total_cmp(&other.left));
    let found = found.filter(|found| found.left < LEFT_MAX);
    let Some(found) = found else {
        anyhow::bail!("the moves do not tell what the amplifier is like");
    };
    let (Plant::Velocity { gain, .. } | Plant::Torque { gain, .. }) = found.plant;
    ensure!(
        gain > 0.0,
        "the joint does not move as it is told: a gain of {gain:.3}; look at velocity_ratio, counts_per_unit and the direction of the drive"
    );
    Ok(found)
}

/// `x = K ∫u - T x' + drift t - friction`, for one dead time.
fn velocity(windows: &[Window<'_>], dead_s: f64) -> Identified {
    let mut rows = LeastSquares::<5>::default();
    for window in windows {
        let start_mm = window.record.cycles[window.begin].actual_mm;
        let forward = forward(window);
        let mut rubbed_s = 0.0;
        for at in window.begin..window.end {
            let cycle = &window.record.cycles[at];
            let since_s = (at - window.begin) as f64 * window.record.cycle_s;
            if cycle.fresh {
                let slow_mm_s = -window.record.measured_mm_s(at);
                let row = [
                    window.delayed(at, dead_s),
                    slow_mm_s,
                    since_s,
                    -forward * rubbed_s,
                    forward,
                ];
                rows.add(&row, cycle.actual_mm - start_mm);
            }
            if moves(window, at) {
                rubbed_s += window.record.cycle_s;
            }
        }
    }
    let ([gain, lag_s, drift, friction, _], left) = rows.solve();
    Identified {
        plant: Plant::Velocity {
            gain,
            lag_s: lag_s.max(0.0),
            dead_s,
        },
        friction: friction / gain,
        bias: -drift / gain,
        left,
    }
}

/// `x' = A ∫u - B x + drift t - friction`, for one dead time.
fn torque(windows: &[Window<'_>], dead_s: f64) -> Identified {
    let mut rows = LeastSquares::<5>::default();
    for window in windows {
        let start_mm = window.record.cycles[window.begin].actual_mm;
        let forward = forward(window);
        let mut rubbed_s = 0.0;
        for at in window.begin..window.end {
            let cycle = &window.record.cycles[at];
            let since_s = (at - window.begin) as f64 * window.record.cycle_s;
            if cycle.fresh {
                let row = [
                    window.delayed(at, dead_s),
                    start_mm - cycle.actual_mm,
                    since_s,
                    -forward * rubbed_s,
                    1.0,
                ];
                rows.add(&row, window.record.measured_mm_s(at));
            }
            if moves(window, at) {
                rubbed_s += window.record.cycle_s;
            }
        }
    }
    let ([gain, damping, drift, friction, _], left) = rows.solve();
    Identified {
        plant: Plant::Torque {
            gain,
            damping: damping.max(0.0),
            dead_s,
        },
        friction: friction / gain,
        bias: -drift / gain,
        left,
    }
}

/// 1 or -1: the direction of the move of a window.
fn forward(window: &Window<'_>) -> f64 {
    let [from, to] = [window.begin, window.end - 1].map(|at| window.record.cycles[at].command_mm);
    (to - from).signum()
}

/// Whether the joint moves in a cycle, so that friction acts.
fn moves(window: &Window<'_>, at: usize) -> bool {
    window.record.velocity_mm_s(at.saturating_sub(2)) != 0.0
}
