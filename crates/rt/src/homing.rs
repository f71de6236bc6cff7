//! Homing by the control: joints look for their home switches in the cyclic mode of their drives.
//!
//! In:  sets of joints to home; home switches by pins or in 60FDh, measured positions.
//! Out: commanded positions of these joints, mm; what their positions were off by; which joint failed and why.
//!
//! The joints of an axis are one group. Whoever gives a set of joints of equal sequence numbers has them home side by side,
//! those that home by their drives among them. Motion keeps the limits of the joints; soft limits are unknown until a joint
//! is homed, so distances of the machine file bound the search instead. As with drives that home themselves, a hold or an
//! override does not act; a stop ends it.
//!
//! Belts of CoreXY have no switches of their own: what homes in their place are X and Y.
//!
//! RT: nothing allocates but [`Homer::new`].

use super::drives::Drives;
use super::machine_pins::MachinePins;
use crate::joint_jog;
use config::{Config, HomeSwitch, HomingBy, JOINTS_MAX};
use motion::rt::homing::{Homing, HomingInput, HomingJoint, HomingStatus, HomingWay};
use motion::rt::jog::JogLimits;
use motion::rt::{MotionLimits, StopLimits};

/// A joint that homes by the control.
#[derive(Clone, Copy, Debug)]
struct Place {
    switch: HomeSwitch,
    switch_mm: f64,
    towards_positive: bool,
    /// Between the coordinates in which a group homes and those of the joint, mm.
    squaring_offset_mm: f64,
    /// All joints of its axis (bit n: joint n).
    together: u64,
}

/// What a joint has found out, for its drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// To be added to positions of the joint, mm.
    pub offset_mm: f64,
    /// Position of the switch, mm.
    pub switch_mm: f64,
    /// Direction in which the joint moved when it found it.
    pub forward: bool,
}

#[derive(Debug)]
pub struct Homer {
    homing: Homing,
    /// `None`: the drive homes the joint.
    joints: Box<[Option<Place>]>,
    /// The joints in whose places X and Y home, by whose sum and difference they move.
    belts: Option<[usize; 2]>,
    /// Joints that home (bit n: joint n).
    under_way: u64,
    inputs: [HomingInput; JOINTS_MAX],
}

impl Homer {
    /// All joints that home by the control, at rest.
    pub fn new(config: &Config) -> Homer {
        let cycle_s = f64::from(config.cycle_us) * 1e-6;
        let mut groups: Vec<(HomingWay, Vec<HomingJoint>)> = Vec::new();
        let mut joints = vec![None; config.joints.len()];
        let belts = config.belts();
        for map in &config.axes {
            let mut group: Option<(HomingWay, Vec<HomingJoint>)> = None;
            for &number in &map.joints {
                let joint = &config.joints[number];
                let homing = &joint.homing;
                let HomingBy::Control(control) = homing.by else {
                    continue;
                };
                let sign = if control.towards_positive { 1.0 } else { -1.0 };
                let way = HomingWay {
                    sequence: homing.sequence(map.axis),
                    search: sign * homing.search_mm_s,
                    latch: homing.latch_mm_s,
                    search_distance: control.search_distance_mm,
                    release_distance: control.release_distance_mm,
                    index_distance: control.index.map(|index| index.distance_mm),
                    resolution: control.resolution_mm,
                    bounce_s: control.bounce_s,
                    home: homing.position_mm - joint.squaring_offset_mm,
                    skew: control.skew_mm.unwrap_or(f64::INFINITY),
                };
                let limits = joint_jog::limits(config, number);
                let (mut motion, mut stop) = (limits.motion, limits.stop);
                let mut together = map.joints.iter().fold(0, |mask, joint| mask | 1 << joint);
                if let Some(belts) = belts.filter(|belts| belts.contains(&number)) {
                    (motion, stop) = shared(belts.map(|joint| joint_jog::limits(config, joint)));
                    together = belts.iter().fold(0, |mask, joint| mask | 1 << joint);
                }
                let member = HomingJoint {
                    joint: number,
                    switch: control.switch_mm - joint.squaring_offset_mm,
                    motion,
                    stop,
                };
                let (common, members) = group.get_or_insert_with(|| (way, Vec::new()));
                // Where each side has its switch elsewhere, so is the far end of its search.
                common.search_distance = common.search_distance.max(way.search_distance);
                members.push(member);
                joints[number] = Some(Place {
                    switch: control.switch,
                    switch_mm: control.switch_mm,
                    towards_positive: control.towards_positive,
                    squaring_offset_mm: joint.squaring_offset_mm,
                    together,
                });
            }
            groups.extend(group);
        }
        let groups: Vec<(HomingWay, &[HomingJoint])> =
            groups.iter().map(|(way, joints)| (*way, joints.as_slice())).collect();
        Homer {
            homing: Homing::new(&groups, cycle_s),
            joints: joints.into(),
            belts,
            under_way: 0,
            inputs: [HomingInput::default(); JOINTS_MAX],
        }
    }

    /// Joints of a set, and those that move with them, that home by the control (bit n: joint n). RT.
    pub fn chosen(&self, joints: u64) -> u64 {
        let places = self.joints.iter().enumerate();
        places.fold(0, |chosen, (number, place)| match place {
            Some(place) if joints >> number & 1 == 1 => chosen | place.together,
            Some(_) | None => chosen,
        })
    }

    /// Begins to home a set that [`Homer::chosen`] gave, all at rest at `positions_mm`. RT.
    pub fn begin(&mut self, joints: u64, positions_mm: &[f64]) {
        self.under_way = joints;
        let mut axes_mm = [0.0; JOINTS_MAX];
        let axes_mm = &mut axes_mm[..positions_mm.len()];
        axes_mm.copy_from_slice(positions_mm);
        if let Some(belts) = self.moving_belts() {
            axes_of(belts, axes_mm);
        }
        self.homing.begin(joints, axes_mm);
    }

    /// The belts, if they home by the control.
    fn moving_belts(&self) -> Option<[usize; 2]> {
        self.belts.filter(|[x, _]| self.under_way >> x & 1 == 1)
    }

    /// Joints that home (bit n: joint n). RT.
    pub fn under_way(&self) -> u64 {
        self.under_way
    }

    /// Whether some joint homes. RT.
    pub fn is_active(&self) -> bool {
        self.under_way != 0
    }

    /// Answers of nodes were lost in this cycle. RT.
    pub fn input_lost(&mut self) {
        self.homing.doubt();
    }

    /// One cycle further: positions of the joints that home, mm; others stay as they are. RT.
    pub fn step(&mut self, drives: &Drives, pins: &MachinePins, command_mm: &mut [f64]) {
        for (number, (place, drive)) in self.joints.iter().zip(drives.iter()).enumerate() {
            let Some(place) = place else { continue };
            self.inputs[number] = HomingInput {
                closed: match place.switch {
                    HomeSwitch::Pin => pins.home_switch(number),
                    HomeSwitch::Drive => drive.home_switch(),
                },
                measured: drive.actual_mm(),
                index: drive.index_mm(),
            };
        }
        let Some(belts) = self.moving_belts() else {
            self.homing.step(&self.inputs, command_mm);
            return;
        };
        let [x, y] = belts;
        let mut measured_mm = [0.0; JOINTS_MAX];
        (measured_mm[x], measured_mm[y]) = (self.inputs[x].measured, self.inputs[y].measured);
        axes_of(belts, &mut measured_mm);
        (self.inputs[x].measured, self.inputs[y].measured) = (measured_mm[x], measured_mm[y]);
        axes_of(belts, command_mm);
        self.homing.step(&self.inputs, command_mm);
        (command_mm[x], command_mm[y]) = (command_mm[x] + command_mm[y], command_mm[x] - command_mm[y]);
    }

    /// Brings all joints to rest as quickly as their stop limits allow; they are not homed then. RT.
    pub fn stop(&mut self) {
        self.homing.abort();
    }

    /// It is over, whatever came of it. RT.
    pub fn end(&mut self) {
        self.under_way = 0;
    }

    /// How it stands. RT.
    pub fn status(&self) -> HomingStatus {
        self.homing.status()
    }

    /// Whether all joints rest. RT.
    pub fn is_at_rest(&self) -> bool {
        self.homing.is_at_rest()
    }

    /// Whether the last cycle was part of a stop, for which the limits of stops count. RT.
    pub fn is_stopping(&self) -> bool {
        self.homing.is_stopping()
    }

    /// Greatest speed of all joints, mm/s. RT.
    pub fn speed_mm_s(&self) -> f64 {
        self.homing.speed()
    }

    /// What a joint has found out, once it is homed. RT.
    pub fn found(&self, joint: usize) -> Option<Found> {
        let place = (*self.joints.get(joint)?)?;
        let offset_mm = match self.belts {
            Some([x, y]) if joint == x => self.homing.offset(x)? + self.homing.offset(y)?,
            Some([x, y]) if joint == y => self.homing.offset(x)? - self.homing.offset(y)?,
            Some(_) | None => self.homing.offset(joint)?,
        };
        Some(Found {
            offset_mm: offset_mm + place.squaring_offset_mm,
            switch_mm: place.switch_mm,
            forward: place.towards_positive,
        })
    }
}

/// Limits for each of two axes that move two belts by their sum and difference.
fn shared([first, second]: [JogLimits; 2]) -> (MotionLimits, StopLimits) {
    let half = |first: f64, second: f64| 0.5 * first.min(second);
    let motion = MotionLimits {
        velocity: half(first.motion.velocity, second.motion.velocity),
        acceleration: half(first.motion.acceleration, second.motion.acceleration),
        jerk: half(first.motion.jerk, second.motion.jerk),
    };
    let stop = StopLimits {
        acceleration: half(first.stop.acceleration, second.stop.acceleration),
        jerk: half(first.stop.jerk, second.stop.jerk),
    };
    (motion, stop)
}

/// Positions of X and Y in place of those of the belts, mm. RT.
fn axes_of([x, y]: [usize; 2], positions_mm: &mut [f64]) {
    let (first, second) = (positions_mm[x], positions_mm[y]);
    (positions_mm[x], positions_mm[y]) = (0.5 * (first + second), 0.5 * (first - second));
}
