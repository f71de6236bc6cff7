//! How a joint follows moves from rest to rest.
//!
//! In:  a [`Record`]. Out: figures of each move; what of the following error goes with velocity and what with acceleration.

use super::linear::LeastSquares;
use super::record::{Move, Record};
use serde::Serialize;

/// Shares of the way between which the rise is timed.
const RISE: [f64; 2] = [0.1, 0.9];
/// Of its greatest value, from which on a command counts as accelerating, or as being at speed.
const SHARE: f64 = 0.05;
const AT_SPEED: f64 = 0.98;

/// What one move shows.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StepFigures {
    pub from_mm: f64,
    pub to_mm: f64,
    /// From 10 to 90 % of the way: of the command, and of the joint; `None`: it did not come so far.
    pub command_rise_ms: f64,
    pub rise_ms: Option<f64>,
    /// How far the joint went beyond the end of the way, um.
    pub overshoot_um: f64,
    /// From the end of the command until the joint stays within the window around its end; `None`: it never did.
    pub settling_ms: Option<f64>,
    /// Greatest following error while the command speeds up, runs at its greatest speed, slows down; and at the end of the rest
    /// behind it, um.
    pub accelerating_um: f64,
    pub at_speed_um: f64,
    pub braking_um: f64,
    pub at_rest_um: f64,
}

/// Figures of a move; it has settled within `window_mm` of its end.
pub fn step_figures(record: &Record, of: &Move, window_mm: f64) -> StepFigures {
    let (from_mm, to_mm) = (record.from_mm(of), record.to_mm(of));
    let ms = |cycles: usize| cycles as f64 * record.cycle_s * 1e3;
    let way = |place_mm: f64| (place_mm - from_mm) / (to_mm - from_mm);
    let span = of.motion.start..of.end;
    let rise = |place: &dyn Fn(usize) -> f64| {
        let first = |share: f64| span.clone().find(|&at| way(place(at)) >= share);
        Some(ms(first(RISE[1])? - first(RISE[0])?))
    };
    let command_rise_ms = rise(&|at| record.cycles[at].command_mm).unwrap_or(0.0);
    let rise_ms = rise(&|at| record.cycles[at].actual_mm);
    let beyond = span.clone().map(|at| way(record.cycles[at].actual_mm) - 1.0);
    let overshoot_um = beyond.fold(0.0, f64::max) * (to_mm - from_mm).abs() * 1e3;
    let off = |at: &usize| (record.cycles[*at].actual_mm - to_mm).abs() > window_mm;
    let settling_ms = match (of.motion.end..of.end).rev().find(off) {
        Some(last) if last + 1 >= of.end => None,
        Some(last) => Some(ms(last + 1 - of.motion.end)),
        None => Some(0.0),
    };
    let fastest = of.motion.clone().map(|at| record.velocity_mm_s(at).abs());
    let fastest = fastest.fold(0.0, f64::max);
    let hardest = of.motion.clone().map(|at| record.acceleration_mm_s2(at).abs());
    let hardest = hardest.fold(0.0, f64::max);
    let direction = (to_mm - from_mm).signum();
    let greatest = |counts: &dyn Fn(f64, f64) -> bool| {
        let cycles = of.motion.clone().filter(|&at| {
            counts(
                record.velocity_mm_s(at) * direction / fastest,
                record.acceleration_mm_s2(at) * direction / hardest,
            )
        });
        let errors = cycles.map(|at| record.cycles[at].following_error_mm.abs());
        errors.fold(0.0, f64::max) * 1e3
    };
    let at_speed_um = greatest(&|velocity, acceleration| velocity > AT_SPEED && acceleration.abs() < SHARE);
    StepFigures {
        from_mm,
        to_mm,
        command_rise_ms,
        rise_ms,
        overshoot_um,
        settling_ms,
        accelerating_um: greatest(&|_, acceleration| acceleration > SHARE),
        at_speed_um,
        braking_um: greatest(&|_, acceleration| acceleration < -SHARE),
        at_rest_um: record.cycles[of.end - 1].following_error_mm.abs() * 1e3,
    }
}

/// The following error as a sum of parts, each with what it goes with.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ErrorParts {
    /// With velocity, ms: a time by which the joint is late.
    pub with_velocity_ms: f64,
    /// With acceleration, um for 1000 mm/s².
    pub with_acceleration_um: f64,
    /// With the direction: friction, um.
    pub with_direction_um: f64,
    /// Always, um.
    pub constant_um: f64,
    /// Share of all of it that is none of these (root of the mean square).
    pub left: f64,
}

/// Takes the following error of moves apart.
pub fn error_parts(record: &Record, moves: &[Move]) -> ErrorParts {
    let mut rows = LeastSquares::<4>::default();
    for at in moves.iter().flat_map(|of| of.motion.clone()) {
        let velocity = command_before(record, at).0;
        let sign = if velocity == 0.0 { 0.0 } else { velocity.signum() };
        let regressors = [velocity, command_before(record, at).1, sign, 1.0];
        rows.add(&regressors, record.cycles[at].following_error_mm);
    }
    let ([velocity, acceleration, sign, constant], left) = rows.solve();
    ErrorParts {
        with_velocity_ms: velocity * 1e3,
        with_acceleration_um: acceleration * 1e6,
        with_direction_um: sign * 1e3,
        constant_um: constant * 1e3,
        left,
    }
}

/// Torque that a drive needs for an acceleration, 1/1000 of the rated torque for 1 mm/s², by what it tells (6077).
pub fn torque_per_mm_s2(record: &Record, moves: &[Move]) -> f64 {
    let mut rows = LeastSquares::<4>::default();
    for at in moves.iter().flat_map(|of| of.motion.clone()) {
        // What is told of a place and of a torque is of one time; what it is of the command is a few cycles before.
        let (before, behind) = (
            record.measured_mm_s(at - 1),
            record.measured_mm_s((at + 1).min(record.cycles.len() - 1)),
        );
        let velocity = record.measured_mm_s(at);
        let sign = if record.velocity_mm_s(at) == 0.0 {
            0.0
        } else {
            velocity.signum()
        };
        let acceleration = (behind - before) / (2.0 * record.cycle_s);
        rows.add(&[acceleration, velocity, sign, 1.0], record.cycles[at].torque);
    }
    rows.solve().0[0]
}

/// Velocity and acceleration of the command that the place told in a cycle answers to.
fn command_before(record: &Record, at: usize) -> (f64, f64) {
    let before = at.saturating_sub(1);
    (record.velocity_mm_s(before), record.acceleration_mm_s2(before))
}

#[cfg(test)]
mod tests {
    use super::super::record::tests::commanded;
    use super::*;

    /// From rest to rest by half a wave of acceleration each way; 0.2 s of motion, 0.2 s of rest.
    fn smooth(length_mm: f64) -> impl Iterator<Item = f64> {
        let at = move |share: f64| {
            let turn = std::f64::consts::TAU * share;
            length_mm * (share - turn.sin() / std::f64::consts::TAU)
        };
        (0..=100)
            .map(|_| 0.0)
            .chain((1..=200).map(move |step| at(f64::from(step) / 200.0)))
            .chain((0..200).map(move |_| length_mm))
    }

    #[test]
    fn a_joint_that_is_late_and_swings_is_seen_to_be() {
        let mut record = commanded(smooth(10.0));
        let commands: Vec<f64> = record.cycles.iter().map(|cycle| cycle.command_mm).collect();
        for at in 0..commands.len() {
            // 10 ms late, and 50 um beyond its end for 30 ms.
            let late = commands[at.saturating_sub(10)];
            let beyond = if (311..341).contains(&at) { 0.05 } else { 0.0 };
            record.cycles[at].actual_mm = late + beyond;
            record.cycles[at].following_error_mm = commands[at.saturating_sub(1)] - late - beyond;
        }
        let moves = record.moves();
        assert_eq!(moves.len(), 1);
        let figures = step_figures(&record, &moves[0], 0.01);
        assert_eq!(figures.rise_ms, Some(figures.command_rise_ms));
        assert!((figures.overshoot_um - 50.0).abs() < 0.1, "{figures:?}");
        assert!((figures.settling_ms.unwrap() - 40.0).abs() < 2.0, "{figures:?}");
        // 9 cycles at up to 100 mm/s.
        assert!((figures.at_speed_um - 900.0).abs() < 20.0, "{figures:?}");
        assert_eq!(figures.at_rest_um, 0.0);
        record.cycles.truncate(330);
        assert_eq!(step_figures(&record, &record.moves()[0], 0.01).settling_ms, None);
    }

    #[test]
    fn the_following_error_is_taken_apart() {
        let mut record = commanded(smooth(10.0));
        for at in 2..record.cycles.len() {
            let (velocity, acceleration) = command_before(&record, at);
            let sign = if velocity == 0.0 { 0.0 } else { 0.002 };
            record.cycles[at].following_error_mm = 0.003 * velocity + 5e-6 * acceleration + sign + 0.001;
        }
        let parts = error_parts(&record, &record.moves());
        for (found, expected) in [
            (parts.with_velocity_ms, 3.0),
            (parts.with_acceleration_um, 5.0),
            (parts.with_direction_um + parts.constant_um, 3.0),
        ] {
            assert!((found - expected).abs() < 0.01, "{parts:?}");
        }
        assert!(parts.left < 0.01, "{parts:?}");
    }
}
