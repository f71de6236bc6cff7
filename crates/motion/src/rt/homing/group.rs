//! Joints of one axis on their way home.
//!
//! In:  switches and measured positions of the joints. Out: commanded positions. RT.

use super::{HomingFailure, HomingInput, HomingJoint, HomingWay};
use crate::rt::TrajectoryGenerator;

/// Each pass that latches is this much slower than the one before.
const FINER: f64 = 16.0;
/// Passes at most, however fine the resolution.
const PASSES_MAX: u8 = 8;
/// Cycles in which a switch may be seen late after an answer was lost: that one, and the one in which it comes again.
const DOUBT_CYCLES: u8 = 2;

/// Where a group is on its way home; see the table of the parent module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Not asked to home.
    Idle,
    /// Other groups come first.
    Waiting,
    /// Off a switch that was closed at the beginning.
    Clear,
    /// Looks for a switch.
    Search,
    /// Off the switch that was found.
    BackOff,
    /// Latches the places of the switches.
    Latch,
    /// Off the switches for another pass.
    Reopen,
    /// To just before the places.
    Approach,
    /// Looks for the index pulses.
    Index,
    /// To the home position.
    Home,
    /// There.
    Done,
    /// Not homed.
    Failed,
}

#[derive(Debug)]
struct Member {
    spec: HomingJoint,
    otg: TrajectoryGenerator,
    /// Position before homing began: of all, so that skew is what has been added to it.
    start: f64,
    /// Position at the beginning of the phase.
    from: f64,
    /// Position in which the search came to rest.
    found: f64,
    open_s: f64,
    latched: Option<f64>,
}

impl Member {
    fn position(&self) -> f64 {
        self.otg.state().position
    }

    fn offset(&self) -> f64 {
        self.latched.map_or(0.0, |latched| self.spec.switch - latched)
    }
}

#[derive(Debug)]
pub(super) struct Group {
    way: HomingWay,
    cycle_s: f64,
    direction: f64,
    members: Box<[Member]>,
    phase: Phase,
    /// Whether the phase has seen what it waited for and only comes to rest.
    over: bool,
    /// Speed of the pass that latches.
    speed: f64,
    pass: u8,
    /// Cycles for which what is read may be old still.
    doubt_cycles: u8,
    /// A place of this pass was latched in doubt: it is looked for once more.
    again: bool,
    failure: Option<(usize, HomingFailure)>,
}

impl Group {
    pub(super) fn new(way: HomingWay, joints: &[HomingJoint], cycle_s: f64) -> Group {
        let member = |spec: &HomingJoint| Member {
            spec: *spec,
            otg: TrajectoryGenerator::new(0.0, spec.motion, spec.stop, cycle_s),
            start: 0.0,
            from: 0.0,
            found: 0.0,
            open_s: 0.0,
            latched: None,
        };
        Group {
            way,
            cycle_s,
            direction: way.search.signum(),
            members: joints.iter().map(member).collect(),
            phase: Phase::Idle,
            over: false,
            speed: way.latch,
            pass: 0,
            doubt_cycles: 0,
            again: false,
            failure: None,
        }
    }

    /// Waits for its turn if it has any of `joints` (bit n: joint n), all at rest at `positions`; else idle. RT.
    pub(super) fn begin(&mut self, joints: u64, positions: &[f64]) {
        let asked = self.members.iter().any(|member| joints >> member.spec.joint & 1 == 1);
        self.phase = if asked { Phase::Waiting } else { Phase::Idle };
        self.over = false;
        self.speed = self.way.latch;
        self.pass = 0;
        self.doubt_cycles = 0;
        self.again = false;
        self.failure = None;
        for member in &mut self.members {
            let position = positions.get(member.spec.joint).copied().unwrap_or_default();
            member.otg.restart(position, member.spec.motion, member.spec.stop);
            member.start = position;
            member.from = position;
            member.found = position;
            member.open_s = 0.0;
            member.latched = None;
        }
    }

    /// Looks at the switches and gives the joints their next goals. RT.
    pub(super) fn decide(&mut self, inputs: &[HomingInput]) {
        for member in &mut self.members {
            let closed = inputs.get(member.spec.joint).is_some_and(|input| input.closed);
            member.open_s = if closed { 0.0 } else { member.open_s + self.cycle_s };
        }
        let any_closed = self.members.iter().any(|member| member.open_s == 0.0);
        let all_open = self.members.iter().all(|member| member.open_s >= self.way.bounce_s);
        let search = self.way.search.abs();
        match self.phase {
            Phase::Waiting if any_closed => self.leave(Phase::Clear, search),
            Phase::Waiting => self.begin_search(),
            Phase::Clear => self.open_then(Phase::Search, all_open, self.way.search_distance),
            Phase::Search if self.over => self.rest_then(Phase::BackOff),
            Phase::Search => {
                if any_closed {
                    self.over = true;
                    self.stop();
                } else {
                    self.check(HomingFailure::NoSwitch, |group, member| {
                        group.way_of(member) > group.way.search_distance
                    });
                }
            }
            Phase::BackOff => self.open_then(Phase::Latch, all_open, self.way.release_distance),
            Phase::Latch => self.latch(inputs),
            Phase::Reopen => self.open_then(Phase::Approach, all_open, self.way.release_distance),
            // Closed already: the place has moved by more than a pass may be off; it is looked for once more from there.
            Phase::Approach if any_closed => {
                self.speed = self.way.latch;
                self.begin_latch();
            }
            Phase::Approach => self.rest_then(Phase::Latch),
            Phase::Index => self.index(inputs),
            Phase::Home => self.rest_then(Phase::Done),
            Phase::Idle | Phase::Done | Phase::Failed => {}
        }
        self.doubt_cycles = self.doubt_cycles.saturating_sub(1);
        self.check_skew();
    }

    /// What is read in this cycle may be old. RT.
    pub(super) fn doubt(&mut self) {
        self.doubt_cycles = DOUBT_CYCLES;
    }

    /// One cycle further. RT.
    pub(super) fn step(&mut self, positions: &mut [f64]) {
        if matches!(self.phase, Phase::Idle | Phase::Waiting) {
            return;
        }
        for member in &mut self.members {
            let state = member.otg.step();
            if let Some(position) = positions.get_mut(member.spec.joint) {
                *position = state.position;
            }
        }
    }

    pub(super) fn stop(&mut self) {
        for member in &mut self.members {
            member.otg.stop();
        }
    }

    /// Way of a joint since the beginning of the phase.
    fn way_of(&self, member: &Member) -> f64 {
        (member.position() - member.from).abs()
    }

    fn enter(&mut self, phase: Phase) {
        self.phase = phase;
        self.over = false;
        for member in &mut self.members {
            member.from = member.position();
        }
    }

    /// All joints at the same velocity, positive towards the switch.
    fn run(&mut self, velocity: f64) {
        let velocity = velocity * self.direction;
        for member in &mut self.members {
            member.otg.run_at(velocity);
        }
    }

    /// Begins a phase that leaves the switches.
    fn leave(&mut self, phase: Phase, speed: f64) {
        self.enter(phase);
        self.run(-speed);
    }

    fn begin_search(&mut self) {
        self.enter(Phase::Search);
        self.run(self.way.search.abs());
    }

    fn begin_latch(&mut self) {
        self.enter(Phase::Latch);
        self.again = false;
        for member in &mut self.members {
            member.latched = None;
        }
        self.run(self.speed);
    }

    /// Away from the switches until all are open, then to rest.
    fn open_then(&mut self, next: Phase, all_open: bool, distance: f64) {
        if self.over {
            self.rest_then(next);
        } else if all_open {
            self.over = true;
            self.run(0.0);
        } else {
            self.check(HomingFailure::StaysClosed, |group, member| {
                group.way_of(member) > distance
            });
        }
    }

    /// Begins the next phase once all joints are at rest.
    fn rest_then(&mut self, next: Phase) {
        if !self.is_at_rest() {
            return;
        }
        match next {
            Phase::BackOff => {
                for member in &mut self.members {
                    member.found = member.position();
                }
                self.leave(next, self.way.search.abs());
            }
            Phase::Reopen => self.leave(next, self.way.latch),
            Phase::Search => self.begin_search(),
            Phase::Latch => self.begin_latch(),
            Phase::Approach => {
                self.enter(next);
                // The place lies within the way of a cycle and of a bounce before where it was seen.
                let before = self.speed * FINER * (2.0 * self.cycle_s + self.way.bounce_s) * self.direction;
                for member in &mut self.members {
                    let place = member.latched.unwrap_or(member.from);
                    member.otg.go_to(place - before, self.way.latch);
                }
            }
            Phase::Index => {
                self.enter(next);
                self.run(self.way.latch);
                for member in &mut self.members {
                    member.latched = None;
                }
            }
            Phase::Home => {
                self.enter(next);
                for member in &mut self.members {
                    let target = self.way.home - member.offset();
                    member.otg.go_to(target, self.way.search);
                }
            }
            Phase::Done => self.enter(next),
            Phase::Idle | Phase::Waiting | Phase::Clear | Phase::Failed => {}
        }
    }

    fn latch(&mut self, inputs: &[HomingInput]) {
        for member in &mut self.members {
            if member.latched.is_none() && member.open_s == 0.0 {
                let input = inputs.get(member.spec.joint).copied().unwrap_or_default();
                member.latched = Some(input.measured);
                member.otg.stop();
                self.again |= self.doubt_cycles > 0;
            }
        }
        if self.members.iter().all(|member| member.latched.is_some()) {
            if !self.is_at_rest() {
                return;
            }
            self.pass += 1;
            if self.speed * self.cycle_s <= self.way.resolution && !self.again {
                self.rest_then(self.behind_the_switch());
            } else if self.pass < PASSES_MAX {
                if !self.again {
                    self.speed /= FINER;
                }
                self.rest_then(Phase::Reopen);
            } else {
                self.check(HomingFailure::Unsteady, |_, _| true);
            }
        } else {
            let reach = self.way.release_distance;
            self.check(HomingFailure::Lost, |group, member| {
                member.latched.is_none() && (member.position() - member.found) * group.direction > reach
            });
        }
    }

    fn behind_the_switch(&self) -> Phase {
        match self.way.index_distance {
            Some(_) => Phase::Index,
            None => Phase::Home,
        }
    }

    fn index(&mut self, inputs: &[HomingInput]) {
        for member in &mut self.members {
            if member.latched.is_none()
                && let Some(place) = inputs.get(member.spec.joint).and_then(|input| input.index)
            {
                member.latched = Some(place);
                member.otg.stop();
            }
        }
        if self.members.iter().all(|member| member.latched.is_some()) {
            self.rest_then(Phase::Home);
        } else {
            let distance = self.way.index_distance.unwrap_or_default();
            self.check(HomingFailure::NoIndex, |group, member| {
                member.latched.is_none() && group.way_of(member) > distance
            });
        }
    }

    /// Fails if a joint fulfils the condition.
    fn check(&mut self, failure: HomingFailure, fails: impl Fn(&Group, &Member) -> bool) {
        let failed = self
            .members
            .iter()
            .find(|member| fails(self, member))
            .map(|member| member.spec.joint);
        if let Some(joint) = failed {
            self.fail(joint, failure);
        }
    }

    fn check_skew(&mut self) {
        let Some(first) = self.members.first().map(|first| first.position() - first.start) else {
            return;
        };
        let skew = self.way.skew;
        self.check(HomingFailure::Skewed, |_, member| {
            (member.position() - member.start - first).abs() > skew
        });
    }

    fn fail(&mut self, joint: usize, failure: HomingFailure) {
        self.failure = self.failure.or(Some((joint, failure)));
        self.phase = Phase::Failed;
    }

    pub(super) fn sequence(&self) -> u8 {
        self.way.sequence
    }

    /// Begun, and neither done nor failed.
    pub(super) fn is_under_way(&self) -> bool {
        !matches!(self.phase, Phase::Idle | Phase::Done | Phase::Failed)
    }

    pub(super) fn speed(&self) -> f64 {
        let speeds = self.members.iter().map(|member| member.otg.state().velocity.abs());
        speeds.fold(0.0, f64::max)
    }

    pub(super) fn is_at_rest(&self) -> bool {
        self.members.iter().all(|member| member.otg.is_at_rest())
    }

    pub(super) fn is_stopping(&self) -> bool {
        self.members.iter().any(|member| member.otg.is_stopping())
    }

    pub(super) fn failure(&self) -> Option<(usize, HomingFailure)> {
        self.failure
    }

    pub(super) fn first_joint(&self) -> usize {
        self.members.first().map_or(0, |member| member.spec.joint)
    }

    pub(super) fn has(&self, joint: usize) -> bool {
        self.members.iter().any(|member| member.spec.joint == joint)
    }

    pub(super) fn phase(&self) -> Phase {
        self.phase
    }

    pub(super) fn offset(&self, joint: usize) -> Option<f64> {
        let member = self.members.iter().find(|member| member.spec.joint == joint)?;
        (self.phase == Phase::Done).then(|| member.offset())
    }
}
