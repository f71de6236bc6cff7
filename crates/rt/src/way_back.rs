//! The way back to the path, for a program that was held while the machine was moved by hand.
//!
//! In:  where the program rests on its path; where the hand has left the machine.
//! Out: orders for the hand, one after the other: the tool up, the other axes beside, the tool down, the last bit of it slowly;
//! or the tool out of the work, when the mains fail.
//!
//! RT: nothing allocates.

use crate::joint_jog::JointJog;
use config::{Config, JOINTS_MAX};
use motion::canon::{AXES, Axis, Position};

/// Last part of the way down, mm, and its speed, mm/s: the tool meets the work there.
pub const SLOW_MM: f64 = 5.0;
/// Its speed, mm/s.
const SLOW_MM_S: f64 = 100.0 / 60.0;
/// Distance between where a joint has come to and its place on the path, mm, that is rounding only.
const SLACK_MM: f64 = 1e-6;

/// Where a program rests on its path while the machine is elsewhere.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// All joints, mm.
    pub joints_mm: [f64; JOINTS_MAX],
    /// The axes, machine coordinates.
    pub axes: Position,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Leg {
    Up,
    Beside,
    Down,
    Last,
}

/// What becomes of a way back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// On its way.
    Moving,
    /// All joints are where they were.
    There,
    /// Something is in the way, or these axes belong to other places of the joints now.
    Elsewhere,
}

/// Brings all joints back.
#[derive(Debug)]
pub struct WayBack {
    /// Joints (bit n: joint n) and axes that lift the tool.
    lifts: [u64; 2],
    leg: Leg,
    /// The hand has its orders for this leg.
    ordered: bool,
    /// What to do with the tool when the mains fail.
    retract: Option<Retract>,
}

impl WayBack {
    /// For a machine; nothing is under way.
    pub fn new(config: &Config) -> WayBack {
        let z = config.axes.iter().find(|map| map.axis == Axis::Z);
        let joints = z.map_or(0, |map| map.joints.iter().fold(0, |mask, joint| mask | 1 << joint));
        WayBack {
            lifts: [joints, 1 << Axis::Z as u64],
            leg: Leg::Up,
            ordered: false,
            retract: Retract::new(config),
        }
    }

    /// Whether the tool leaves the work when the mains fail.
    pub fn can_retract(&self) -> bool {
        self.retract.is_some()
    }

    /// Lets the hand, which rests with all joints at `joints_mm`, lead the tool out of the work, as far as the machine file says.
    pub fn retract(&self, joints_mm: &[f64], hand: &mut JointJog) {
        let Some(retract) = &self.retract else { return };
        hand.begin_to_go(joints_mm);
        let number = retract.numbers[usize::from(hand.is_in_world())];
        hand.go_by(number, retract.distance_mm, hand.fastest(number));
    }

    /// Begins, from rest.
    pub fn begin(&mut self) {
        self.leg = Leg::Up;
        self.ordered = false;
    }

    /// The hand has been brought to rest: what is left of this leg is ordered once more.
    pub fn interrupt(&mut self) {
        self.ordered = false;
    }

    /// Gives the hand its orders. `rapid`, `feed`: shares of the speeds; at 0 it rests, others act from the next leg on.
    pub fn step(&mut self, place: &Place, hand: &mut JointJog, [rapid, feed]: [f64; 2]) -> Progress {
        let share = |leg| if leg == Leg::Last { feed } else { rapid };
        if self.ordered && share(self.leg) == 0.0 {
            hand.release_all();
            self.interrupt();
        }
        if !hand.is_at_rest() {
            return Progress::Moving;
        }
        if self.ordered {
            self.ordered = false;
            if !self.has_arrived(place, hand) {
                return Progress::Elsewhere;
            }
            self.leg = match self.leg {
                Leg::Up => Leg::Beside,
                Leg::Beside => Leg::Down,
                Leg::Down => Leg::Last,
                Leg::Last => match hand.is_at(&place.joints_mm, SLACK_MM) {
                    true => return Progress::There,
                    false => return Progress::Elsewhere,
                },
            };
        }
        let share = share(self.leg);
        if share > 0.0 {
            self.order(place, hand, share);
        }
        Progress::Moving
    }

    fn order(&mut self, place: &Place, hand: &mut JointJog, share: f64) {
        self.ordered = true;
        let in_world = hand.is_in_world();
        for number in 0..if in_world { AXES } else { JOINTS_MAX } {
            let (at, wanted) = match (in_world, hand.place(number)) {
                (_, None) => continue,
                (true, Some(at)) => (at, place.axes.0[number]),
                (false, Some(at)) => (at, place.joints_mm[number]),
            };
            let lifts = self.lifts[usize::from(in_world)] >> number & 1 == 1;
            let fastest = share * hand.fastest(number);
            let (distance, velocity) = match (self.leg, lifts) {
                (Leg::Up, true) => ((wanted - at).max(0.0), fastest),
                (Leg::Beside, false) => (wanted - at, fastest),
                (Leg::Down, true) => ((wanted - at + SLOW_MM).min(0.0), fastest),
                (Leg::Last, true) => (wanted - at, fastest.min(share * SLOW_MM_S)),
                _ => continue,
            };
            hand.go_by(number, distance, velocity);
        }
    }

    /// Whether a leg has led where it should: nothing goes sideways that is not up, and nothing down beside its place.
    fn has_arrived(&self, place: &Place, hand: &JointJog) -> bool {
        let in_world = hand.is_in_world();
        let wanted: &[f64] = if in_world { &place.axes.0 } else { &place.joints_mm };
        wanted.iter().enumerate().all(|(number, wanted)| {
            let Some(at) = hand.place(number) else { return true };
            let lifts = self.lifts[usize::from(in_world)] >> number & 1 == 1;
            match (self.leg, lifts) {
                (Leg::Up, true) => at >= wanted - SLACK_MM,
                (Leg::Beside, false) => (at - wanted).abs() <= SLACK_MM,
                (Leg::Down, true) => at <= wanted + SLOW_MM + SLACK_MM,
                _ => true,
            }
        })
    }
}

/// The way of the tool out of the work when the mains fail.
#[derive(Clone, Copy, Debug)]
struct Retract {
    /// The joint that leads, and the axis, by which the hand knows it.
    numbers: [usize; 2],
    /// Distance; its sign is the direction.
    distance_mm: f64,
}

impl Retract {
    /// As the machine file says; `None`: it stays where it stops.
    fn new(config: &Config) -> Option<Retract> {
        let (axis, distance_mm) = (config.stops.mains.retract_axis, config.stops.mains.retract_mm);
        let map = config.axes.iter().find(|map| map.axis == axis)?;
        let joint = *map.joints.first()?;
        (distance_mm != 0.0).then_some(Retract {
            numbers: [joint, axis as usize],
            distance_mm,
        })
    }
}
