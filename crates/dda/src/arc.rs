//! Circles in steps, from point to point, in either direction, through all quadrants.
//!
//! In:  start and end point about the centre, in steps; the method.
//! Out: at each clock, which of the two axes steps.
//!
//! In a circle about the origin dx = -y dφ and dy = x dφ. A DDA adds y to one accumulator and x to another at each clock; an
//! accumulator that runs over its modulus M = 2^width makes a step of its axis. Both axes see the coordinates before the
//! clock. An arc is cut into legs at the axes; each leg is turned and mirrored into the first quadrant, where it runs from
//! (u, v) with u falling and v rising, and begins with fresh accumulators.
//!
//! An axis that has arrived at the end of its leg is locked. What then cannot arrive by itself (the increment of the other
//! axis has become 0, or the clocks that any sound arc needs are used up) is stepped straight to the end and counted:
//! [`ArcDda::forced_steps`].

/// When an axis steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// The accumulator runs over. Increments are the whole coordinates: a register too small for the radius goes wrong. As
    /// printed, a sum of exactly M makes no step and is lost all the same: wide of the circle where R divides M.
    Traditional,
    /// The same with an eighth of the coordinates: like three more bits.
    Weighted,
    /// Sawtooth elimination as the literature prints it: the test looks one increment ahead, but nothing is taken off the
    /// accumulator for the early step, so it runs over once more: two steps for one. For comparison only.
    Printed,
    /// Sawtooth elimination as it is meant: the test looks one increment ahead, the early step takes M off, and the
    /// accumulator may become negative.
    Signed,
    /// An axis steps one increment early only if the other one steps now: two steps of single axes become one of both.
    Pair,
}

/// Accumulators at the beginning of a leg.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fill {
    /// M/2: the first step comes after half the way, which rounds.
    Half,
    /// 0.
    Empty,
}

/// The registers of a DDA.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Registers {
    /// When an axis steps.
    pub rule: Rule,
    /// Width of the accumulators, 1 to 32 bits; more than the radius needs, else the path is wrong.
    pub width_bits: u32,
    /// How a leg begins.
    pub fill: Fill,
}

/// How steps are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// By accumulators.
    Registers(Registers),
    /// Of the three steps that lead on, the one with the least |x² + y² - R²|: within half a step of the circle.
    LeastError,
}

/// Direction of an arc.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turn {
    /// From X+ to Y+.
    CounterClockwise,
    /// From X+ to Y-.
    Clockwise,
}

/// Why an arc cannot be run.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ArcError {
    /// No radius.
    #[error("the arc begins at its centre: give a start point on the circle")]
    NoRadius,
    /// The end is not on the circle.
    #[error(
        "the end is {end:.3} steps from the centre, the start {start:.3}: both must lie on the circle, within {SLACK} steps"
    )]
    OffCircle {
        /// Distance of the start from the centre, steps.
        start: f64,
        /// Distance of the end from the centre, steps.
        end: f64,
    },
    /// Too large.
    #[error("coordinates must be within {COORDINATE_MAX} steps of the centre")]
    TooLarge,
    /// Registers that cannot be built.
    #[error("accumulators of {width_bits} bits: 1 to {WIDTH_MAX} are possible")]
    Width {
        /// What was asked for.
        width_bits: u32,
    },
}

/// Both end points may be rounded to whole steps, each by half the diagonal of a step.
const SLACK: f64 = 1.5;
/// Keeps squares and sums far from overflow.
const COORDINATE_MAX: i32 = 1 << 29;
const WIDTH_MAX: u32 = 32;
/// A full circle touches the quadrant in which it begins twice.
const LEGS_MAX: u8 = 5;
/// Registers count in eighths, so that the weight of 0.125 is 1 and everything is exact.
const EIGHTHS: i64 = 8;

impl Rule {
    /// Weight of the coordinates, in eighths.
    fn weight(self) -> i64 {
        match self {
            Rule::Traditional => EIGHTHS,
            Rule::Weighted | Rule::Printed | Rule::Signed | Rule::Pair => 1,
        }
    }
}

/// A leg in coordinates of its own: from (u, v), both at least 0, with u falling and v rising, to `end`.
#[derive(Clone, Debug)]
struct Leg {
    at: [i64; 2],
    end: [i64; 2],
    /// Directions of u and v in the plane.
    axes: [[i8; 2]; 2],
    accumulators: [i64; 2],
    clocks_left: u64,
    /// The end of the leg is the end of the arc.
    last: bool,
}

/// An arc under way. RT.
#[derive(Clone, Debug)]
pub struct ArcDda {
    method: Method,
    turn: Turn,
    at: [i32; 2],
    end: [i32; 2],
    radius_squared: i64,
    leg: Leg,
    legs_left: u8,
    clocks: u64,
    forced_steps: u64,
}

impl ArcDda {
    /// An arc about the origin; equal end points make a full circle.
    ///
    /// # Errors
    ///
    /// The start is the centre, the end is not on the circle, or a coordinate is out of range.
    pub fn new(start: [i32; 2], end: [i32; 2], turn: Turn, method: Method) -> Result<ArcDda, ArcError> {
        if start
            .iter()
            .chain(&end)
            .any(|value| value.unsigned_abs() > COORDINATE_MAX.unsigned_abs())
        {
            return Err(ArcError::TooLarge);
        }
        if start == [0, 0] {
            return Err(ArcError::NoRadius);
        }
        let [from, to] = [start, end].map(|[x, y]| libm::hypot(f64::from(x), f64::from(y)));
        if (from - to).abs() > SLACK {
            return Err(ArcError::OffCircle { start: from, end: to });
        }
        if let Method::Registers(Registers { width_bits, .. }) = method
            && !(1..=WIDTH_MAX).contains(&width_bits)
        {
            return Err(ArcError::Width { width_bits });
        }
        let [x, y] = start.map(i64::from);
        let radius_squared = x * x + y * y;
        Ok(ArcDda {
            method,
            turn,
            at: start,
            end,
            radius_squared,
            leg: Leg::new(start, end, turn, method, radius_squared, false),
            legs_left: LEGS_MAX - 1,
            clocks: 0,
            forced_steps: 0,
        })
    }

    /// One clock: -1, 0 or 1 for each axis, most often nothing; `None` at the end. RT.
    pub fn clock(&mut self) -> Option<[i8; 2]> {
        if self.leg.has_ended() {
            if self.leg.last {
                return None;
            }
            self.legs_left -= 1;
            let last = self.legs_left == 0;
            self.leg = Leg::new(self.at, self.end, self.turn, self.method, self.radius_squared, last);
        }
        self.clocks += 1;
        let local = if self.leg.is_stuck(self.method) {
            let step = self.leg.straight_on();
            self.forced_steps += step.iter().filter(|&&step| step != 0).count() as u64;
            step
        } else {
            self.leg.clocks_left = self.leg.clocks_left.saturating_sub(1);
            match self.method {
                Method::Registers(registers) => self.leg.accumulate(registers),
                Method::LeastError => self.leg.least_error(self.radius_squared),
            }
        };
        for (at, step) in self.leg.at.iter_mut().zip(local) {
            *at += step;
        }
        let step = self.leg.to_plane(local);
        for (at, step) in self.at.iter_mut().zip(step) {
            *at += i32::from(step);
        }
        Some(step)
    }

    /// Where the arc stands, steps from its centre.
    pub fn position(&self) -> [i32; 2] {
        self.at
    }

    /// Clocks so far.
    pub fn clocks(&self) -> u64 {
        self.clocks
    }

    /// Steps that the method did not find by itself: 0 for a sound one.
    pub fn forced_steps(&self) -> u64 {
        self.forced_steps
    }
}

/// The steps alone, without the clocks between them.
impl Iterator for ArcDda {
    type Item = [i8; 2];

    fn next(&mut self) -> Option<[i8; 2]> {
        loop {
            let step = self.clock()?;
            if step != [0, 0] {
                return Some(step);
            }
        }
    }
}

impl Leg {
    /// From `start` to the end of its quadrant, or to `end` if that comes before or if this must be the `last` leg.
    fn new(start: [i32; 2], end: [i32; 2], turn: Turn, method: Method, radius_squared: i64, last: bool) -> Leg {
        let side = match turn {
            Turn::CounterClockwise => 1,
            Turn::Clockwise => -1,
        };
        // Quarter turns until the point lies in the quadrant that begins at the axis of u.
        let mut axes = [[1, 0], [0, side]];
        for _ in 0..3 {
            let [u, v] = to_local(axes, start);
            if u > 0 && v >= 0 {
                break;
            }
            axes = [axes[1], axes[0].map(|value: i8| -value)];
        }
        let (at, end) = (to_local(axes, start), to_local(axes, end));
        let ahead = at[0] * end[1] - at[1] * end[0] > 0 && end[0] >= 0 && end[1] >= 0;
        let last = last || ahead;
        let radius = (radius_squared as f64).sqrt().round() as i64;
        let (fill, modulus, weight) = match method {
            Method::Registers(Registers { rule, width_bits, fill }) => (fill, EIGHTHS << width_bits, rule.weight()),
            // Each clock makes a step.
            Method::LeastError => (Fill::Empty, 2, 1),
        };
        Leg {
            at,
            end: if last { end } else { [0, radius] },
            axes,
            accumulators: match fill {
                Fill::Half => [modulus / 2; 2],
                Fill::Empty => [0; 2],
            },
            clocks_left: (radius + 1) as u64 * (modulus / weight) as u64,
            last,
        }
    }

    fn has_ended(&self) -> bool {
        self.at == self.end
    }

    /// Which of u and v need no further step in their direction.
    fn arrived(&self) -> [bool; 2] {
        [self.at[0] <= self.end[0], self.at[1] >= self.end[1]]
    }

    /// Whether the end cannot be reached by the method any more.
    fn is_stuck(&self, method: Method) -> bool {
        let arrived = self.arrived();
        let still = match method {
            Method::Registers(Registers { rule, width_bits, .. }) => {
                // What an axis is given is the coordinate of the other one.
                let stands = |axis: usize| {
                    rule.weight() * self.at[1 - axis] == 0 && self.accumulators[axis] <= EIGHTHS << width_bits
                };
                arrived[0] && stands(1) || arrived[1] && stands(0)
            }
            Method::LeastError => false,
        };
        arrived == [true, true] || still || self.clocks_left == 0
    }

    /// Towards the end without regard to the circle.
    fn straight_on(&self) -> [i64; 2] {
        [0, 1].map(|axis| (self.end[axis] - self.at[axis]).signum())
    }

    /// One clock of the accumulators.
    fn accumulate(&mut self, registers: Registers) -> [i64; 2] {
        let modulus = EIGHTHS << registers.width_bits;
        let weight = registers.rule.weight();
        let increments = [weight * self.at[1], weight * self.at[0]];
        let over = |axis: usize, ahead: i64| self.accumulators[axis] + ahead * increments[axis] > modulus;
        let mut steps = match registers.rule {
            Rule::Traditional | Rule::Weighted => [over(0, 1), over(1, 1)],
            Rule::Printed | Rule::Signed => [over(0, 2), over(1, 2)],
            Rule::Pair => match [over(0, 1), over(1, 1)] {
                [true, false] => [true, over(1, 2)],
                [false, true] => [over(0, 2), true],
                both => both,
            },
        };
        let arrived = self.arrived();
        for axis in 0..2 {
            if arrived[axis] {
                steps[axis] = false;
                continue;
            }
            let sum = self.accumulators[axis] + increments[axis];
            self.accumulators[axis] = match registers.rule {
                Rule::Traditional | Rule::Weighted | Rule::Printed => sum % modulus,
                Rule::Signed | Rule::Pair => sum - if steps[axis] { modulus } else { 0 },
            };
        }
        [-i64::from(steps[0]), i64::from(steps[1])]
    }

    /// The step of u, v or both after which the distance from the circle is least; of equal ones the longest.
    fn least_error(&self, radius_squared: i64) -> [i64; 2] {
        let arrived = self.arrived();
        let error = |step: &[i64; 2]| {
            let [u, v] = [self.at[0] + step[0], self.at[1] + step[1]];
            (u * u + v * v - radius_squared).abs()
        };
        let free = |step: &[i64; 2]| !(step[0] != 0 && arrived[0] || step[1] != 0 && arrived[1]);
        let candidates = [[-1, 1], [0, 1], [-1, 0]];
        let best = candidates.into_iter().filter(free).min_by_key(error);
        // Without a candidate both have arrived, which is taken care of before.
        best.unwrap_or_default()
    }

    fn to_plane(&self, step: [i64; 2]) -> [i8; 2] {
        [0, 1].map(|axis| step[0] as i8 * self.axes[0][axis] + step[1] as i8 * self.axes[1][axis])
    }
}

/// Coordinates along the axes of a leg.
fn to_local(axes: [[i8; 2]; 2], point: [i32; 2]) -> [i64; 2] {
    axes.map(|axis| i64::from(axis[0]) * i64::from(point[0]) + i64::from(axis[1]) * i64::from(point[1]))
}
