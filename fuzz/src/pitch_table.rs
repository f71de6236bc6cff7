//! Any octets as a file of pitch errors: a table that corrects within its bounds, or refused with a place; and a joint under it
//! whose corrections change no faster than slope and take-up allow.

use motion::rt::{
    CompensationShare, JointCompensation, MotionLimits, PitchBounds, PitchFileKind, PitchTable, StopLimits,
};

const CYCLE_S: f64 = 1e-3;
const BOUNDS: PitchBounds = PitchBounds {
    correction_mm: 10.0,
    slope: 0.1,
};
const MOTION: MotionLimits = MotionLimits {
    velocity: 100.0,
    acceleration: 1000.0,
    jerk: 20_000.0,
};
const STOP: StopLimits = StopLimits {
    acceleration: 2000.0,
    jerk: 80_000.0,
};

/// One run of the fuzzer: the first octet is the backlash in 0.01 mm, the second the way of a joint, and by its lowest bit the
/// kind of file; the rest is the file.
pub fn run(octets: &[u8]) {
    let (head, text) = octets.split_at(octets.len().min(2));
    let number = |at: usize| f64::from(head.get(at).copied().unwrap_or(0));
    let text = String::from_utf8_lossy(text);
    let kind = match head.get(1).is_some_and(|octet| octet & 1 == 1) {
        true => PitchFileKind::Corrections,
        false => PitchFileKind::Positions,
    };
    let table = match PitchTable::parse(&text, kind, &BOUNDS) {
        Ok(table) => table,
        Err(error) => {
            assert!(error.line >= 1 && error.line <= text.lines().count().max(1));
            assert!(error.column >= 1 && !error.rule.is_empty());
            return;
        }
    };
    let Ok(share) = CompensationShare::new(table, MOTION, STOP) else {
        return;
    };
    let slope = share.table.slope();
    assert!(slope <= BOUNDS.slope + 1e-9);
    // No row is above the bound, and no place between rows and beyond them but by the rounding of bends.
    let most_mm = BOUNDS.correction_mm + slope * share.table.rounding_mm() + 1e-6;
    for place in [-1e9, -1e3, -1.0, -0.0, 0.5, 20.0, 1e3, 1e9] {
        for forward in [false, true] {
            assert!(share.table.correction_mm(place, forward).abs() <= most_mm);
        }
    }
    let take_up_mm = share.take_up.velocity * CYCLE_S;
    let mut joint = JointCompensation::new(share.table, 0.01 * number(0), share.take_up, CYCLE_S);
    let reach = number(1);
    let (mut before, mut command_before) = (joint.correction_mm(), 0.0);
    for cycle in 0..200_u32 {
        let command = reach * (f64::from(cycle) * 0.01).sin();
        let told = joint.step(command);
        let correction = joint.correction_mm();
        assert!((told - command - correction).abs() < 1e-6);
        // At a turn the difference of two slopes goes on with the take-up.
        let most_mm = 3.0 * slope * f64::abs(command - command_before).max(reach * 1e-3) + take_up_mm;
        assert!((correction - before).abs() <= most_mm + 1e-9);
        (before, command_before) = (correction, command);
    }
}
