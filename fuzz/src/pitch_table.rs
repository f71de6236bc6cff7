//! Any octets as a file of pitch errors: a table that corrects within its bounds, or refused with a place; and a joint under it
//! that never takes up faster than it may.

use motion::rt::{JointCompensation, PitchTable, TakeUpLimits};

const CYCLE_S: f64 = 1e-3;
const LIMITS: TakeUpLimits = TakeUpLimits {
    velocity_mm_s: 5.0,
    acceleration_mm_s2: 500.0,
    jerk_mm_s3: 100_000.0,
};

/// One run of the fuzzer: the first octet is the backlash in 0.01 mm, the second the way of a joint, the rest is the file.
pub fn run(octets: &[u8]) {
    let (head, text) = octets.split_at(octets.len().min(2));
    let number = |at: usize| f64::from(head.get(at).copied().unwrap_or(0));
    let text = String::from_utf8_lossy(text);
    let table = match PitchTable::parse(&text) {
        Ok(table) => table,
        Err(error) => {
            assert!(error.line >= 1 && error.line <= text.lines().count().max(1));
            assert!(error.column >= 1 && !error.rule.is_empty());
            return;
        }
    };
    // No row is more than 10 mm off, and between rows and beyond them no place is.
    for place in [-1e9, -1e3, -1.0, -0.0, 0.5, 20.0, 1e3, 1e9] {
        for forward in [false, true] {
            assert!(table.correction_mm(place, forward).abs() <= 10.0 + 1e-6);
        }
    }
    let mut joint = JointCompensation::new(table, 0.01 * number(0), &LIMITS, CYCLE_S);
    let (reach, mut before) = (number(1), joint.correction_mm());
    for cycle in 0..200_u32 {
        let command = reach * (f64::from(cycle) * 0.05).sin();
        let told = joint.step(command);
        let correction = joint.correction_mm();
        assert!((told - command - correction).abs() < 1e-6);
        assert!((correction - before).abs() <= LIMITS.velocity_mm_s * CYCLE_S + 1e-9);
        before = correction;
    }
}
