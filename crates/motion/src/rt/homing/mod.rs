//! Homing by the control: finds out where joints are by their home switches.
//!
//! In:  in every cycle, for each joint, its switch, its measured position and the index pulse if the drive saw one.
//! Out: one commanded position per joint and cycle; at the end, for each joint, what its positions are off by.
//!
//! Joints that move one axis together (a gantry) are one group. Groups of the same sequence number home side by side, lower
//! numbers first. A group goes through these phases, each with a distance after which it has failed:
//!
//! | phase | moves | until |
//! |---|---|---|
//! | clear | away from the switch, all together | all switches are open (only if one was closed) |
//! | search | towards it, all together | one switch closes |
//! | back off | away, all together | all are open |
//! | latch | towards it, slowly, each for itself | its own switch closes: its place is latched |
//! | reopen, approach | away until open, then to just before the place | once for each finer pass |
//! | index | on, slowly, each for itself | the index pulse of its encoder |
//! | home | each by its own offset, so that a gantry ends square | the home position is reached |
//!
//! A switch is read once a cycle, so a pass finds its place to the way of one cycle. Passes become slower until that is
//! within the wanted resolution; each finer one looks only where the one before has found the place. A switch may bounce:
//! it counts as closed at once and as open when it has been so for a while. A place found while answers of nodes are lost
//! does not count.
//!
//! Homing is made once and begun as often as joints have to be homed. RT: nothing allocates but [`Homing::new`].

mod group;

use super::scale::{MotionLimits, StopLimits};
use group::Group;
pub use group::Phase;

/// How a group of joints homes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HomingWay {
    /// Groups of lower numbers home first.
    pub sequence: u8,
    /// Velocity towards the switch, mm/s (degrees/s); its sign is the direction.
    pub search: f64,
    /// Speed of the first pass that latches, mm/s (degrees/s).
    pub latch: f64,
    /// Where the switch must be found within, mm (degrees).
    pub search_distance: f64,
    /// Where the switch must open again within, and how far beyond the place of the search it may be found,
    /// mm (degrees).
    pub release_distance: f64,
    /// Where the index pulse must come within, behind the switch, mm (degrees); `None`: the switch itself counts.
    pub index_distance: Option<f64>,
    /// How exactly a switch is to be found, mm (degrees).
    pub resolution: f64,
    /// How long a switch must be open to count as open, s.
    pub bounce_s: f64,
    /// Where the joints end, mm (degrees).
    pub home: f64,
    /// How far joints of a group may be displaced against each other on the way, mm (degrees).
    pub skew: f64,
}

/// One joint of a group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HomingJoint {
    /// Its number, by which inputs and positions are found.
    pub joint: usize,
    /// Position that the place of its switch (its index pulse) has, mm (degrees).
    pub switch: f64,
    /// Limits of all motion but stops at a switch.
    pub motion: MotionLimits,
    /// Limits of stops at a switch.
    pub stop: StopLimits,
}

/// What is known of a joint in a cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HomingInput {
    /// Whether the switch is closed.
    pub closed: bool,
    /// Measured position when it was read, mm (degrees).
    pub measured: f64,
    /// Where the drive saw the index pulse, mm (degrees), if it did since the last cycle.
    pub index: Option<f64>,
}

/// Why a joint was not homed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HomingFailure {
    /// No switch within the search distance.
    NoSwitch,
    /// The switch does not open within the distance for it.
    StaysClosed,
    /// The switch that the search has found is not found again.
    Lost,
    /// The switch moves about, or cannot be found as exactly as wanted.
    Unsteady,
    /// No index pulse within its distance.
    NoIndex,
    /// Joints of a gantry were displaced against each other by more than they may.
    Skewed,
    /// The operator ended it.
    Aborted,
}

impl HomingFailure {
    /// In words, for alarms.
    pub fn words(self) -> &'static str {
        match self {
            HomingFailure::NoSwitch => "no home switch within the search distance",
            HomingFailure::StaysClosed => "the home switch does not open when the joint leaves it",
            HomingFailure::Lost => "the home switch was not found again when it was approached slowly",
            HomingFailure::Unsteady => "the home switch is not steady enough for the wanted resolution",
            HomingFailure::NoIndex => "no index pulse behind the home switch",
            HomingFailure::Skewed => "the joints of the gantry are too far from square",
            HomingFailure::Aborted => "ended by the operator",
        }
    }
}

/// How homing stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HomingStatus {
    /// Under way, or coming to rest after a failure.
    Running,
    /// All joints are homed and at rest.
    Done,
    /// At rest without: the first joint that failed and why.
    Failed {
        /// Its number.
        joint: usize,
        /// Why.
        failure: HomingFailure,
    },
}

/// Homes groups of joints.
#[derive(Debug)]
pub struct Homing {
    groups: Box<[Group]>,
    failed: Option<(usize, HomingFailure)>,
}

impl Homing {
    /// Groups of joints, none of which homes before [`Homing::begin`].
    pub fn new(groups: &[(HomingWay, &[HomingJoint])], cycle_s: f64) -> Homing {
        let group = |(way, joints): &(HomingWay, &[HomingJoint])| Group::new(*way, joints, cycle_s);
        Homing {
            groups: groups.iter().map(group).collect(),
            failed: None,
        }
    }

    /// Begins to home the groups of `joints` (bit n: joint n), all at rest at `positions`, by their numbers. RT.
    pub fn begin(&mut self, joints: u64, positions: &[f64]) {
        self.failed = None;
        for group in &mut self.groups {
            group.begin(joints, positions);
        }
    }

    /// One cycle further; `inputs` and `positions` by the numbers of the joints. Positions of joints that do not home stay as
    /// they are. RT.
    pub fn step(&mut self, inputs: &[HomingInput], positions: &mut [f64]) {
        let now = self
            .groups
            .iter()
            .filter(|group| group.is_under_way())
            .map(Group::sequence)
            .min();
        for group in &mut self.groups {
            if self.failed.is_none() && group.is_under_way() && Some(group.sequence()) == now {
                group.decide(inputs);
            }
        }
        if self.failed.is_none() {
            self.failed = self.groups.iter().find_map(Group::failure);
            if self.failed.is_some() {
                self.stop_all();
            }
        }
        for group in &mut self.groups {
            group.step(positions);
        }
    }

    /// What is read in this cycle may be older than a cycle, because an answer was lost: a place that is latched then is
    /// looked for once more. Before [`Homing::step`]. RT.
    pub fn doubt(&mut self) {
        self.groups.iter_mut().for_each(Group::doubt);
    }

    /// Comes to rest as quickly as the stop limits allow, and has failed. RT.
    pub fn abort(&mut self) {
        let under_way = self.groups.iter().find(|group| group.is_under_way());
        if let Some(group) = under_way {
            self.failed = self.failed.or(Some((group.first_joint(), HomingFailure::Aborted)));
        }
        self.stop_all();
    }

    /// How it stands. RT.
    pub fn status(&self) -> HomingStatus {
        if !self.is_at_rest() {
            return HomingStatus::Running;
        }
        match self.failed {
            Some((joint, failure)) => HomingStatus::Failed { joint, failure },
            None if self.groups.iter().any(Group::is_under_way) => HomingStatus::Running,
            None => HomingStatus::Done,
        }
    }

    /// Whether no joint moves. RT.
    pub fn is_at_rest(&self) -> bool {
        self.groups.iter().all(Group::is_at_rest)
    }

    /// What has to be added to the positions of a joint, once it is homed. RT.
    pub fn offset(&self, joint: usize) -> Option<f64> {
        self.groups.iter().find_map(|group| group.offset(joint))
    }

    /// Phase of the group to which a joint belongs. RT.
    pub fn phase(&self, joint: usize) -> Option<Phase> {
        self.groups.iter().find(|group| group.has(joint)).map(Group::phase)
    }

    /// Whether the last cycle was part of a stop of some joint, for which the stop limits count. RT.
    pub fn is_stopping(&self) -> bool {
        self.groups.iter().any(Group::is_stopping)
    }

    /// Greatest speed of all joints. RT.
    pub fn speed(&self) -> f64 {
        self.groups.iter().map(Group::speed).fold(0.0, f64::max)
    }

    fn stop_all(&mut self) {
        for group in &mut self.groups {
            group.stop();
        }
    }
}

#[cfg(test)]
mod tests;
