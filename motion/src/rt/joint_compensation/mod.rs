//! Backlash and pitch error of one joint.
//!
//! In:  commanded position of the joint, mm, once a cycle.
//! Out: what the motor is told instead: [`JointCompensation::step`]; taken off again from what it reports.
//!
//! What is wanted is a correction that jumps: the table of the pitch errors has another column for each direction, and the
//! backlash changes its sign, where the joint turns round. The take-up that follows it is
//!
//! ```text
//! rate limit v  ->  mean over N cycles  ->  mean over N cycles
//! ```
//!
//! With T the cycle time that keeps |velocity| <= v, |acceleration| <= 2v/(N·T) and |jerk| <= 4v/(N·T)² whatever the
//! joint does, never overshoots, and is exact 2N cycles after the rate limit has arrived. It lags by N-1 cycles, which is
//! why the table is looked up that far ahead of a joint that moves.
//!
//! Sums are kept in whole picometres: they do not drift, whatever time passes. RT but for the constructors.

/// Errors of a joint at one position, as measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PitchRow {
    /// What the joint was told, mm.
    pub position_mm: f64,
    /// Where it was, come there with growing positions, mm.
    pub forward_mm: f64,
    /// Where it was, come there with falling positions, mm.
    pub backward_mm: f64,
}

/// A row that cannot be used; rows count from 0.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PitchError {
    /// Not a number, or beyond any machine.
    #[error("a value is not a number or above {MOST_MM} mm")]
    Illegal {
        /// The row.
        row: usize,
    },
    /// Not above the one before.
    #[error("position {position_mm} is not above the one before, {before_mm}")]
    NotRising {
        /// The row.
        row: usize,
        /// Its position, mm.
        position_mm: f64,
        /// The position before, mm.
        before_mm: f64,
    },
    /// Column and position differ too much to be an error of pitch.
    #[error("{measured_mm} is more than {ERROR_MAX_MM} mm from {position_mm}: give measured positions, not errors")]
    TooFar {
        /// The row.
        row: usize,
        /// Its position, mm.
        position_mm: f64,
        /// What was measured there, mm.
        measured_mm: f64,
    },
}

impl PitchError {
    /// The row that cannot be used.
    pub fn row(&self) -> usize {
        match *self {
            PitchError::Illegal { row } | PitchError::NotRising { row, .. } | PitchError::TooFar { row, .. } => row,
        }
    }
}

/// No machine is larger.
const MOST_MM: f64 = 1e6;
/// No screw is that bad; what is, is a table of something else.
const ERROR_MAX_MM: f64 = 10.0;

/// Pitch errors over the travel; constant beyond its ends.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PitchTable {
    rows: Box<[PitchRow]>,
}

impl PitchTable {
    /// A table of measured rows with rising positions.
    ///
    /// # Errors
    ///
    /// The rows do not rise, or a value is out of range.
    pub fn new(rows: &[PitchRow]) -> Result<PitchTable, PitchError> {
        let mut before_mm = f64::NEG_INFINITY;
        for (row, values) in rows.iter().enumerate() {
            let PitchRow {
                position_mm,
                forward_mm,
                backward_mm,
            } = *values;
            let legal = |value: f64| value.abs() <= MOST_MM;
            if ![position_mm, forward_mm, backward_mm].into_iter().all(legal) {
                return Err(PitchError::Illegal { row });
            }
            if position_mm <= before_mm {
                return Err(PitchError::NotRising {
                    row,
                    position_mm,
                    before_mm,
                });
            }
            let far = |measured_mm: &f64| (measured_mm - position_mm).abs() > ERROR_MAX_MM;
            if let Some(measured_mm) = [forward_mm, backward_mm].into_iter().find(far) {
                return Err(PitchError::TooFar {
                    row,
                    position_mm,
                    measured_mm,
                });
            }
            before_mm = position_mm;
        }
        Ok(PitchTable { rows: rows.into() })
    }

    /// What must be added to `position_mm`, coming `forward` or backward; 0 without rows. RT: steps grow with the
    /// logarithm of the rows.
    pub fn correction_mm(&self, position_mm: f64, forward: bool) -> f64 {
        let error = |row: &PitchRow| row.position_mm - if forward { row.forward_mm } else { row.backward_mm };
        let after = self.rows.partition_point(|row| row.position_mm <= position_mm);
        match (
            after.checked_sub(1).map(|before| &self.rows[before]),
            self.rows.get(after),
        ) {
            (Some(below), Some(above)) => {
                let part = (position_mm - below.position_mm) / (above.position_mm - below.position_mm);
                error(below) + part * (error(above) - error(below))
            }
            (Some(end), None) | (None, Some(end)) => error(end),
            (None, None) => 0.0,
        }
    }
}

/// How fast a correction may change; all above 0, mm and s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TakeUpLimits {
    /// mm/s
    pub velocity_mm_s: f64,
    /// mm/s²
    pub acceleration_mm_s2: f64,
    /// mm/s³
    pub jerk_mm_s3: f64,
}

/// A turn shorter than this is rounding, no change of direction, mm.
const TURN_MM: f64 = 1e-6;
/// Cycles of a mean at the most: bounds memory and lag; the speed goes down where that is not enough for the jerk.
const MEAN_MAX: f64 = 512.0;
const PM_PER_MM: f64 = 1e9;

/// Mean of the last values, exact. The ring starts full of zeros.
#[derive(Clone, Debug)]
struct Mean {
    ring: Box<[i64]>,
    oldest: usize,
    sum: i64,
}

impl Mean {
    fn new(length: usize) -> Mean {
        Mean {
            ring: vec![0; length].into(),
            oldest: 0,
            sum: 0,
        }
    }

    /// Takes a value, gives the sum of the last ones.
    fn push(&mut self, value: i64) -> i64 {
        self.sum += value - std::mem::replace(&mut self.ring[self.oldest], value);
        self.oldest = (self.oldest + 1) % self.ring.len();
        self.sum
    }

    fn clear(&mut self) {
        self.ring.fill(0);
        self.sum = 0;
    }
}

/// Compensation of one joint.
#[derive(Clone, Debug)]
pub struct JointCompensation {
    table: PitchTable,
    half_backlash_mm: f64,
    /// Greatest change in a cycle, pm.
    rate_pm: i64,
    delay_cycles: f64,
    /// `None` until the joint has moved: on which side it stands is not known then.
    forward: Option<bool>,
    /// The farthest position in that direction, mm; `None` before the first one.
    turning_mm: Option<f64>,
    before_mm: f64,
    rated_pm: i64,
    means: [Mean; 2],
    correction_mm: f64,
}

impl JointCompensation {
    /// Compensation by `table` and a backlash, that changes within `limits`; `cycle_s` above 0.
    pub fn new(table: PitchTable, backlash_mm: f64, limits: &TakeUpLimits, cycle_s: f64) -> JointCompensation {
        let TakeUpLimits {
            velocity_mm_s: v,
            acceleration_mm_s2: a,
            jerk_mm_s3: j,
        } = *limits;
        let wanted_s = (2.0 * v / a).max(2.0 * (v / j).sqrt());
        let length = (wanted_s / cycle_s).ceil().clamp(1.0, MEAN_MAX);
        let mean_s = length * cycle_s;
        let v = v.min(a * mean_s / 2.0).min(j * mean_s * mean_s / 4.0);
        JointCompensation {
            table,
            half_backlash_mm: backlash_mm / 2.0,
            // Rounded down to stay within the limits; never 0, or it would never arrive.
            rate_pm: ((v * cycle_s * PM_PER_MM) as i64).max(1),
            delay_cycles: length - 1.0,
            forward: None,
            turning_mm: None,
            before_mm: 0.0,
            rated_pm: 0,
            means: [Mean::new(length as usize), Mean::new(length as usize)],
            correction_mm: 0.0,
        }
    }

    /// What is added now, mm. RT.
    pub fn correction_mm(&self) -> f64 {
        self.correction_mm
    }

    /// What is added in the end at a place that was come to in one direction, mm. RT.
    pub fn correction_at_mm(&self, position_mm: f64, forward: bool) -> f64 {
        let backlash_mm = if forward {
            self.half_backlash_mm
        } else {
            -self.half_backlash_mm
        };
        backlash_mm + self.table.correction_mm(position_mm, forward)
    }

    /// Forgets correction and direction: only while the motor does not follow commands. RT.
    pub fn restart(&mut self) {
        self.forward = None;
        self.turning_mm = None;
        self.rated_pm = 0;
        self.correction_mm = 0.0;
        self.means.iter_mut().for_each(Mean::clear);
    }

    /// Position of the motor for the position of the joint, mm. NaN comes back and changes nothing. RT.
    pub fn step(&mut self, command_mm: f64) -> f64 {
        if !command_mm.is_finite() {
            return command_mm;
        }
        let wanted_mm = self.wanted_mm(command_mm);
        // Tables and backlash are bounded: far within 64 bits.
        let wanted_pm = (wanted_mm * PM_PER_MM).round() as i64;
        self.rated_pm += (wanted_pm - self.rated_pm).clamp(-self.rate_pm, self.rate_pm);
        let sum = self.means[0].push(self.rated_pm);
        let sum = self.means[1].push(sum);
        let length = self.means[0].ring.len() as f64;
        self.correction_mm = sum as f64 / (length * length * PM_PER_MM);
        command_mm + self.correction_mm
    }

    /// The correction where the joint is, in the direction in which it moves or has moved last.
    fn wanted_mm(&mut self, command_mm: f64) -> f64 {
        let turning_mm = *self.turning_mm.get_or_insert_with(|| {
            self.before_mm = command_mm;
            command_mm
        });
        let way_mm = command_mm - turning_mm;
        let onwards = self
            .forward
            .is_some_and(|forward| (way_mm > 0.0) == forward && way_mm != 0.0);
        if onwards || way_mm.abs() > TURN_MM {
            self.forward = Some(way_mm > 0.0);
            self.turning_mm = Some(command_mm);
        }
        let moved_mm = command_mm - self.before_mm;
        self.before_mm = command_mm;
        let Some(forward) = self.forward else { return 0.0 };
        self.correction_at_mm(command_mm + moved_mm * self.delay_cycles, forward)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LIMITS: TakeUpLimits = TakeUpLimits {
        velocity_mm_s: 5.0,
        acceleration_mm_s2: 500.0,
        jerk_mm_s3: 30_000.0,
    };
    const CYCLE_S: f64 = 1e-3;

    fn row(position_mm: f64, forward_mm: f64, backward_mm: f64) -> PitchRow {
        PitchRow {
            position_mm,
            forward_mm,
            backward_mm,
        }
    }

    fn table() -> PitchTable {
        let rows = [row(0.0, 0.0, -0.01), row(10.0, 10.02, 10.01), row(30.0, 29.98, 29.98)];
        PitchTable::new(&rows).unwrap()
    }

    #[test]
    fn a_table_is_linear_between_its_rows_and_constant_beyond() {
        let table = table();
        for (position_mm, forward, backward) in [
            (-5.0, 0.0, 0.01),
            (0.0, 0.0, 0.01),
            (5.0, -0.01, 0.0),
            (10.0, -0.02, -0.01),
            (20.0, 0.0, 0.005),
            (30.0, 0.02, 0.02),
            (99.0, 0.02, 0.02),
        ] {
            assert!(
                (table.correction_mm(position_mm, true) - forward).abs() < 1e-12,
                "{position_mm}"
            );
            assert!(
                (table.correction_mm(position_mm, false) - backward).abs() < 1e-12,
                "{position_mm}"
            );
        }
        assert_eq!(PitchTable::default().correction_mm(1.0, true), 0.0);
    }

    #[test]
    fn a_bad_row_is_named() {
        for (rows, text) in [
            (
                vec![row(0.0, 0.0, 0.0), row(0.0, 0.0, 0.0)],
                "position 0 is not above the one before, 0",
            ),
            (
                vec![row(-1.0, -1.0, -1.0), row(0.0, f64::NAN, 0.0)],
                "a value is not a number or above 1000000 mm",
            ),
            (
                vec![row(0.0, 0.0, 0.0), row(100.0, 100.0, 0.02)],
                "0.02 is more than 10 mm from 100: give measured positions, not errors",
            ),
        ] {
            let error = PitchTable::new(&rows).unwrap_err();
            assert_eq!((error.row(), error.to_string().as_str()), (1, text));
        }
    }

    /// Backlash is on neither side before the first move, then on that of the last one.
    #[test]
    fn backlash_follows_the_direction_and_remembers_it() {
        let mut joint = JointCompensation::new(PitchTable::default(), 0.02, &LIMITS, CYCLE_S);
        let mut settled = |position_mm: f64| {
            (0..500).for_each(|_| _ = joint.step(position_mm));
            joint.correction_mm()
        };
        assert_eq!(settled(7.0), 0.0);
        assert_eq!(settled(7.1), 0.01);
        assert_eq!(settled(7.1), 0.01);
        // Rounding is no turn.
        assert_eq!(settled(7.1 - 1e-9), 0.01);
        assert_eq!(settled(7.09), -0.01);
        assert_eq!(settled(7.0), -0.01);
        assert_eq!(settled(9.0), 0.01);
        joint.restart();
        assert_eq!(joint.step(9.0), 9.0);
    }

    #[test]
    fn many_small_steps_against_the_direction_are_a_turn() {
        let mut joint = JointCompensation::new(PitchTable::default(), 0.02, &LIMITS, CYCLE_S);
        for k in 0..2000 {
            joint.step(f64::from(k) * 1e-3);
        }
        for k in 0..2000 {
            joint.step(1.999 - f64::from(k) * 1e-8);
        }
        assert_eq!(joint.correction_mm(), -0.01);
    }

    /// At an even speed the table is met as if there were no lag.
    #[test]
    fn the_table_does_not_lag_behind_a_moving_joint() {
        let mut joint = JointCompensation::new(table(), 0.0, &LIMITS, CYCLE_S);
        for k in 0..300 {
            let position_mm = 10.5 + f64::from(k) * 0.05;
            joint.step(position_mm);
            let off_mm = joint.correction_mm() - table().correction_mm(position_mm, true);
            assert!(k < 150 || off_mm.abs() < 1e-7, "cycle {k}: {off_mm}");
        }
    }

    #[test]
    fn what_is_no_number_changes_nothing() {
        let mut joint = JointCompensation::new(table(), 0.02, &LIMITS, CYCLE_S);
        let mut other = joint.clone();
        for k in 0..300 {
            let position_mm = f64::from(k) * 0.1;
            if k % 7 == 0 {
                assert!(joint.step(f64::NAN).is_nan());
            }
            assert_eq!(joint.step(position_mm), other.step(position_mm));
        }
    }

    #[test]
    fn limits_that_would_need_a_long_mean_lower_the_speed() {
        let limits = TakeUpLimits {
            jerk_mm_s3: 10.0,
            ..LIMITS
        };
        let mut joint = JointCompensation::new(PitchTable::default(), 0.02, &limits, CYCLE_S);
        assert_eq!(joint.means[0].ring.len(), 512);
        joint.step(0.0);
        (0..2000).for_each(|_| _ = joint.step(1.0));
        assert_eq!(joint.correction_mm(), 0.01);
    }

    proptest! {
        /// Whatever the joint does, jumps too: the limits hold, the motor is where command and correction say, and at rest
        /// the correction is exact.
        #[test]
        fn the_take_up_holds_its_limits(
            ways in prop::collection::vec((-3.0..3.0_f64, 1..120_u32, any::<bool>()), 1..12),
            backlash_mm in 0.0..0.5_f64,
            velocity_mm_s in 0.5..20.0_f64,
            acceleration_mm_s2 in 50.0..5000.0_f64,
            jerk_mm_s3 in 1e3..1e6_f64,
        ) {
            let limits = TakeUpLimits { velocity_mm_s, acceleration_mm_s2, jerk_mm_s3 };
            let mut joint = JointCompensation::new(table(), backlash_mm, &limits, CYCLE_S);
            let (mut at, mut seen) = (5.0, vec![0.0; 3]);
            let mut step = |at: f64| {
                let motor = joint.step(at);
                seen.push(joint.correction_mm());
                (motor, at + joint.correction_mm(), joint.forward)
            };
            for (way, cycles, jump) in ways {
                for k in 0..cycles {
                    at += if jump { if k == 0 { way } else { 0.0 } } else { way / f64::from(cycles) };
                    let (motor, expected, _) = step(at);
                    prop_assert_eq!(motor, expected);
                }
            }
            let mut forward = None;
            for _ in 0..4000 {
                forward = step(at).2;
            }
            let side = forward.map_or(0.0, |forward| if forward { 0.5 } else { -0.5 });
            let wanted = side * backlash_mm + forward.map_or(0.0, |forward| table().correction_mm(at, forward));
            prop_assert!((seen[seen.len() - 1] - wanted).abs() < 1e-9);
            // Rounding of a correction, differenced three times.
            let slack = |order: i32| 8.0 * 1e-15 / CYCLE_S.powi(order);
            for window in seen.windows(4) {
                let [d, c, b, a] = window[..] else { unreachable!() };
                let v = (a - b).abs() / CYCLE_S;
                let acceleration = (a - 2.0 * b + c).abs() / CYCLE_S.powi(2);
                let jerk = (a - 3.0 * b + 3.0 * c - d).abs() / CYCLE_S.powi(3);
                prop_assert!(v <= velocity_mm_s + slack(1), "velocity {}", v);
                prop_assert!(acceleration <= acceleration_mm_s2 + slack(2), "acceleration {}", acceleration);
                prop_assert!(jerk <= jerk_mm_s3 + slack(3), "jerk {}", jerk);
            }
        }
    }
}
