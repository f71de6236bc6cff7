//! Errors of a joint over its travel, and what is added for them.
//!
//! In:  measured rows, or rows of what is to be added; how the joint moves and what its limits have room for.
//! Out: what must be added at any position, coming forward or backward: [`PitchTable::correction_mm`].
//!
//! Between rows the correction is linear, beyond them constant. A joint that runs over such a bend would be told to jump in
//! velocity. So bends are rounded, by a mean of means over the width `a`, each. With `d` the distance from a bend at which the
//! slope changes by `b`, that adds
//!
//! ```text
//! r(d) = b (a - |d|)³/(6 a²)   where |d| < a;   b a/6 at the bend itself
//! ```
//!
//! and leaves a second derivative of at most b/a and a third of at most b/a² (2 s/a and 4 s/a² where bends lie closer to each other
//! than 2 a; s is the greatest slope). At velocity v, acceleration A and jerk J the joint itself then moves by no more than
//!
//! ```text
//! acceleration  s A + c'' v²
//! jerk          s J + 3 c'' v A + c''' v³
//! ```
//!
//! beside its command, and [`PitchTable::round`] finds the least `a` for which that has room. The correction is a function of the
//! position alone: at any speed and acceleration it is the one of the position that is commanded.

use super::MotionLimits;

/// A row of a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PitchRow {
    /// What the joint was told, mm.
    pub position_mm: f64,
    /// What is added there, coming with growing positions, mm.
    pub forward_mm: f64,
    /// What is added there, coming with falling positions, mm.
    pub backward_mm: f64,
}

/// How large corrections may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PitchBounds {
    /// The largest one, mm.
    pub correction_mm: f64,
    /// Their change from row to row, mm per mm.
    pub slope: f64,
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
    /// More is added than the bound.
    #[error("corrects by {} mm at {position_mm} mm, more than {most_mm}", shown(*correction_mm))]
    TooLarge {
        /// The row.
        row: usize,
        /// Its position, mm.
        position_mm: f64,
        /// What would be added there, mm.
        correction_mm: f64,
        /// The bound, mm.
        most_mm: f64,
    },
    /// The correction changes by more than the bound.
    #[error("corrects by {} mm per mm more than the row before, more than {most}", shown(*slope))]
    TooSteep {
        /// The row.
        row: usize,
        /// Change from the row before, mm per mm.
        slope: f64,
        /// The bound, mm per mm.
        most: f64,
    },
}

impl PitchError {
    /// The row that cannot be used.
    pub fn row(&self) -> usize {
        match *self {
            PitchError::Illegal { row }
            | PitchError::NotRising { row, .. }
            | PitchError::TooLarge { row, .. }
            | PitchError::TooSteep { row, .. } => row,
        }
    }
}

/// Without the digits that differences of decimal numbers leave behind.
fn shown(value: f64) -> f64 {
    (value * 1e9).round() / 1e9
}

/// Why a table cannot be followed within the limits of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RoundError {
    /// Its slope takes more than there is room for.
    #[error("its slope takes more {0} than there is room for")]
    Steep(super::Order),
    /// Real time would have to look at too many rows.
    #[error("it has more than {WITHIN_MAX} rows within the {0} mm over which its bends are rounded: leave some out")]
    Dense(u32),
    /// Rounded, it would not be the table any more.
    #[error("its bends would have to be rounded by {0} um, more than {ROUNDING_MAX_UM}")]
    Rough(u32),
}

/// No machine is larger.
const MOST_MM: f64 = 1e6;
/// Most by which rounding may change what is added at a row, um.
const ROUNDING_MAX_UM: u32 = 10;
/// Rows over which bends may be rounded together: bounds the time of a look-up.
const WITHIN_MAX: usize = 256;

/// A place at which the slope changes. Of two values the first is that of coming backward, the second that of coming forward.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Bend {
    position_mm: f64,
    correction_mm: [f64; 2],
    /// Change of the slope, mm per mm.
    by: [f64; 2],
}

/// Corrections over the travel; constant beyond its ends.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PitchTable {
    bends: Box<[Bend]>,
    /// Distance over which a bend is rounded to each side, mm.
    rounding_mm: f64,
}

impl PitchTable {
    /// A table of rows with rising positions; its bends are sharp.
    ///
    /// # Errors
    ///
    /// The rows do not rise, or a value is out of range.
    pub fn new(rows: &[PitchRow], bounds: &PitchBounds) -> Result<PitchTable, PitchError> {
        let mut bends: Vec<Bend> = Vec::with_capacity(rows.len());
        let mut slopes = [0.0; 2];
        for (row, values) in rows.iter().enumerate() {
            let PitchRow {
                position_mm,
                forward_mm,
                backward_mm,
            } = *values;
            let correction_mm = [backward_mm, forward_mm];
            let legal = |value: f64| value.abs() <= MOST_MM;
            if ![position_mm, forward_mm, backward_mm].into_iter().all(legal) {
                return Err(PitchError::Illegal { row });
            }
            let most_mm = bounds.correction_mm;
            if let Some(correction_mm) = correction_mm
                .into_iter()
                .rev()
                .find(|value| shown(value.abs()) > most_mm)
            {
                return Err(PitchError::TooLarge {
                    row,
                    position_mm,
                    correction_mm,
                    most_mm,
                });
            }
            if let Some(before) = bends.last_mut() {
                let before_mm = before.position_mm;
                if position_mm <= before_mm {
                    return Err(PitchError::NotRising {
                        row,
                        position_mm,
                        before_mm,
                    });
                }
                for way in 0..2 {
                    let slope = (correction_mm[way] - before.correction_mm[way]) / (position_mm - before_mm);
                    let most = bounds.slope;
                    if shown(slope.abs()) > most {
                        return Err(PitchError::TooSteep { row, slope, most });
                    }
                    before.by[way] = slope - slopes[way];
                    slopes[way] = slope;
                }
            }
            bends.push(Bend {
                position_mm,
                correction_mm,
                by: [0.0; 2],
            });
        }
        if let Some(end) = bends.last_mut() {
            end.by = slopes.map(|slope| -slope);
        }
        Ok(PitchTable {
            bends: bends.into(),
            rounding_mm: 0.0,
        })
    }

    /// The greatest slope, mm per mm.
    pub fn slope(&self) -> f64 {
        let mut slopes = [0.0_f64; 2];
        let mut most = 0.0_f64;
        for bend in &self.bends {
            for (slope, by) in slopes.iter_mut().zip(bend.by) {
                *slope += by;
                most = most.max(slope.abs());
            }
        }
        most
    }

    /// How far from a bend its rounding reaches, mm.
    pub fn rounding_mm(&self) -> f64 {
        self.rounding_mm
    }

    /// Rounds the bends as little as acceleration and jerk of `room` allow for a joint that moves within `motion`. Gives the
    /// acceleration and the jerk that the table takes of it.
    ///
    /// # Errors
    ///
    /// There is not enough room, whatever the rounding.
    pub(super) fn round(&mut self, motion: &MotionLimits, room: [f64; 2]) -> Result<[f64; 2], RoundError> {
        let MotionLimits {
            velocity: v,
            acceleration,
            jerk,
        } = *motion;
        let slope = self.slope();
        if slope == 0.0 {
            return Ok([0.0; 2]);
        }
        let left = [room[0] - slope * acceleration, room[1] - slope * jerk];
        for (left, order) in left.into_iter().zip([super::Order::Acceleration, super::Order::Jerk]) {
            if left <= 0.0 {
                return Err(RoundError::Steep(order));
            }
        }
        // q = 1/a; jerk: v³ third q² + 3 v A second q = left, its root in the form without cancellation.
        let per_mm = |[second, third]: [f64; 2]| {
            let half = 1.5 * v * acceleration * second;
            let of_jerk = left[1] / (half + (half * half + v.powi(3) * third * left[1]).sqrt());
            of_jerk.min(left[0] / (v * v * second))
        };
        let sharpest = self
            .bends
            .iter()
            .flat_map(|bend| bend.by)
            .fold(0.0, |most: f64, by| most.max(by.abs()));
        let gaps = self
            .bends
            .windows(2)
            .map(|pair| pair[1].position_mm - pair[0].position_mm);
        let least_mm = gaps.fold(f64::INFINITY, f64::min);
        let mut bend = [sharpest; 2];
        let mut q = per_mm(bend);
        if 2.0 / q > least_mm {
            bend = [2.0 * slope, 4.0 * slope];
            q = per_mm(bend);
        }
        self.rounding_mm = 1.0 / q;
        let within = |first: &Bend| {
            let end_mm = first.position_mm + 2.0 * self.rounding_mm;
            self.bends.partition_point(|bend| bend.position_mm <= end_mm)
        };
        let crowd = self.bends.iter().enumerate().map(|(at, bend)| within(bend) - at).max();
        if crowd.is_some_and(|crowd| crowd > WITHIN_MAX) {
            return Err(RoundError::Dense((2.0 * self.rounding_mm).ceil() as u32));
        }
        let off_mm = |bend: &Bend| {
            let of = |way: usize| (self.correction_mm(bend.position_mm, way == 1) - bend.correction_mm[way]).abs();
            of(0).max(of(1))
        };
        let off_um = self.bends.iter().map(off_mm).fold(0.0, f64::max) * 1000.0;
        if off_um > f64::from(ROUNDING_MAX_UM) {
            return Err(RoundError::Rough(off_um.ceil() as u32));
        }
        Ok([
            slope * acceleration + v * v * bend[0] * q,
            slope * jerk + 3.0 * v * acceleration * bend[0] * q + v.powi(3) * bend[1] * q * q,
        ])
    }

    /// What must be added at `position_mm`, coming `forward` or backward; 0 without rows. RT: steps grow with the
    /// logarithm of the rows, and with those over which a bend is rounded, no more than 256.
    pub fn correction_mm(&self, position_mm: f64, forward: bool) -> f64 {
        let way = usize::from(forward);
        let after = self.bends.partition_point(|bend| bend.position_mm <= position_mm);
        let sharp_mm = match (
            after.checked_sub(1).map(|before| &self.bends[before]),
            self.bends.get(after),
        ) {
            (Some(below), Some(above)) => {
                let part = (position_mm - below.position_mm) / (above.position_mm - below.position_mm);
                let below_mm = below.correction_mm[way];
                below_mm + part * (above.correction_mm[way] - below_mm)
            }
            (Some(end), None) | (None, Some(end)) => end.correction_mm[way],
            (None, None) => return 0.0,
        };
        let a = self.rounding_mm;
        let rounding = |bend: &Bend| {
            let inside = a - (position_mm - bend.position_mm).abs();
            (inside > 0.0).then(|| bend.by[way] * inside * inside * inside / (6.0 * a * a))
        };
        let above: f64 = self.bends[after..].iter().map_while(rounding).sum();
        let below: f64 = self.bends[..after].iter().rev().map_while(rounding).sum();
        sharp_mm + above + below
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOUNDS: PitchBounds = PitchBounds {
        correction_mm: 0.5,
        slope: 0.01,
    };

    fn row(position_mm: f64, forward_mm: f64, backward_mm: f64) -> PitchRow {
        PitchRow {
            position_mm,
            forward_mm,
            backward_mm,
        }
    }

    const ROWS: [PitchRow; 3] = [
        PitchRow {
            position_mm: 0.0,
            forward_mm: 0.0,
            backward_mm: 0.01,
        },
        PitchRow {
            position_mm: 10.0,
            forward_mm: -0.02,
            backward_mm: -0.01,
        },
        PitchRow {
            position_mm: 30.0,
            forward_mm: 0.02,
            backward_mm: 0.02,
        },
    ];

    const MOTION: MotionLimits = MotionLimits {
        velocity: 142.5,
        acceleration: 2250.0,
        jerk: 75_000.0,
    };

    #[test]
    fn a_table_is_linear_between_its_rows_and_constant_beyond() {
        let table = PitchTable::new(&ROWS, &BOUNDS).unwrap();
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
        assert!((table.slope() - 0.002).abs() < 1e-15);
    }

    #[test]
    fn a_bad_row_is_named() {
        for (rows, text) in [
            (
                vec![row(0.0, 0.0, 0.0), row(0.0, 0.0, 0.0)],
                "position 0 is not above the one before, 0",
            ),
            (
                vec![row(-1.0, 0.0, 0.0), row(0.0, f64::NAN, 0.0)],
                "a value is not a number or above 1000000 mm",
            ),
            (
                vec![row(0.0, 0.0, 0.0), row(100.0, 0.1, 0.501)],
                "corrects by 0.501 mm at 100 mm, more than 0.5",
            ),
            (
                vec![row(0.0, 0.1, 0.0), row(1.0, 0.1, -0.0101)],
                "corrects by -0.0101 mm per mm more than the row before, more than 0.01",
            ),
        ] {
            let error = PitchTable::new(&rows, &BOUNDS).unwrap_err();
            assert_eq!((error.row(), error.to_string().as_str()), (1, text));
        }
        // At the bounds themselves, which are no binary numbers.
        PitchTable::new(&[row(0.1, 0.49, 0.0), row(1.1, 0.5, 0.01)], &BOUNDS).unwrap();
    }

    /// Rounded bends: the same beside them, nearly the same at them, and smooth: differences of a joint that runs over them at
    /// all speed stay within the room, which they nearly use.
    #[test]
    fn bends_are_rounded_as_little_as_the_room_allows() {
        for (rows, reach_mm) in [
            (ROWS.to_vec(), 1.5),
            // So dense that bends are rounded together.
            (
                (0..300)
                    .map(|n| row(f64::from(n) * 0.1, 0.0001 * f64::from(n % 2), 0.0))
                    .collect(),
                1.5,
            ),
        ] {
            let sharp = PitchTable::new(&rows, &BOUNDS).unwrap();
            let mut table = sharp.clone();
            let room = [375.0 / 2.0, 45_000.0 / 4.0];
            let taken = table.round(&MOTION, room).unwrap();
            let a = table.rounding_mm();
            assert!(a > 0.1 && a < reach_mm, "{a}");
            assert!(
                taken[0] <= room[0] * (1.0 + 1e-9) && taken[1] <= room[1] * (1.0 + 1e-9),
                "{taken:?}"
            );
            assert!(
                (taken[1] / room[1] - 1.0).abs() < 1e-9 || (taken[0] / room[0] - 1.0).abs() < 1e-9,
                "{taken:?}"
            );
            let cycle_s: f64 = 1e-3;
            let [mut most_acceleration, mut most_jerk] = [0.0_f64; 2];
            let places: Vec<f64> = (0..400)
                .map(|k| -10.0 + f64::from(k) * MOTION.velocity * cycle_s)
                .collect();
            for forward in [false, true] {
                let corrections: Vec<f64> = places
                    .iter()
                    .map(|place| table.correction_mm(*place, forward))
                    .collect();
                for window in corrections.windows(4) {
                    let [d, c, b, a] = window[..] else { unreachable!() };
                    most_acceleration = most_acceleration.max((a - 2.0 * b + c).abs() / cycle_s.powi(2));
                    most_jerk = most_jerk.max((a - 3.0 * b + 3.0 * c - d).abs() / cycle_s.powi(3));
                }
                for place in &places {
                    let off_mm = table.correction_mm(*place, forward) - sharp.correction_mm(*place, forward);
                    let near = rows.iter().any(|row| (row.position_mm - place).abs() < a);
                    assert!(
                        if near {
                            off_mm.abs() < 0.004 * a / 6.0 + 1e-4
                        } else {
                            off_mm == 0.0
                        },
                        "{place}: {off_mm}"
                    );
                }
            }
            assert!(
                most_acceleration <= taken[0] && most_jerk <= taken[1],
                "{most_acceleration} {most_jerk}"
            );
            assert!(most_jerk > 0.1 * taken[1], "{most_jerk}");
        }
    }

    #[test]
    fn a_table_for_which_there_is_no_room_is_refused() {
        let mut table = PitchTable::new(&ROWS, &BOUNDS).unwrap();
        assert_eq!(
            table.round(&MOTION, [4.4, 1e6]),
            Err(RoundError::Steep(super::super::Order::Acceleration))
        );
        assert_eq!(
            table.round(&MOTION, [1e3, 149.0]),
            Err(RoundError::Steep(super::super::Order::Jerk))
        );
        let dense: Vec<PitchRow> = (0..1000)
            .map(|n| row(f64::from(n) * 1e-3, 1e-6 * f64::from(n % 2), 0.0))
            .collect();
        let mut table = PitchTable::new(&dense, &BOUNDS).unwrap();
        let error = table.round(&MOTION, [375.0, 10_000.0]).unwrap_err();
        assert_eq!(error, RoundError::Dense(3));
    }
}
