//! From power-on to the end of a program and back, or to stand-by: the order of steps of `run` and `demo`.
//!
//! In:  the state that the cycle thread shows, polled every few cycles; wishes to stop.
//! Out: one step at a time whose order is due.
//!
//! Every step has a time limit, so that nothing ever hangs.

use super::state::State;

/// How the sequence ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The program ran to its end.
    Completed,
    /// The operator stopped it.
    Stopped,
    /// A fault stopped it.
    Faulted,
    /// A step took longer than its limit.
    TimedOut(Step),
}

impl Outcome {
    /// As clients are told.
    pub const fn code(self) -> protocol::Outcome {
        match self {
            Outcome::Completed => protocol::Outcome::Completed,
            Outcome::Stopped => protocol::Outcome::Stopped,
            Outcome::Faulted => protocol::Outcome::Faulted,
            Outcome::TimedOut(_) => protocol::Outcome::TimedOut,
        }
    }
}

/// Steps of the sequence, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Network up to OPERATIONAL.
    Network,
    /// Waits for orders, drives off or on; for the network, or for an acknowledge.
    StandBy,
    /// Drives to OPERATION ENABLED.
    Enable,
    /// Joints home, one group after the other.
    Home,
    Program,
    /// To rest on the path.
    Stop,
    /// Drives without power.
    Disable,
    ShutDown,
    Done,
}

impl Step {
    /// Longest that the step may take, ns.
    const fn limit_ns(self) -> u64 {
        const SECOND: u64 = 1_000_000_000;
        match self {
            Step::Network => 15 * SECOND,
            Step::Enable => 10 * SECOND,
            Step::Home => 120 * SECOND,
            Step::StandBy | Step::Program | Step::Done => u64::MAX,
            Step::Stop => 10 * SECOND,
            Step::Disable => 5 * SECOND,
            Step::ShutDown => 3 * SECOND,
        }
    }

    /// As clients are told; `network`: the machine has one.
    pub const fn code(self, network: bool) -> protocol::Step {
        match self {
            Step::Network if network => protocol::Step::NetworkBoot,
            Step::Network => protocol::Step::Start,
            Step::StandBy => protocol::Step::StandingBy,
            Step::Enable => protocol::Step::SwitchingOn,
            Step::Home => protocol::Step::Homing,
            Step::Program => protocol::Step::Program,
            Step::Stop => protocol::Step::Stop,
            Step::Disable => protocol::Step::SwitchingOff,
            Step::ShutDown if network => protocol::Step::NetworkShutDown,
            Step::ShutDown => protocol::Step::ShutDown,
            Step::Done => protocol::Step::Done,
        }
    }
}

/// What is to be done while standing by. Drives that are off are switched on first, and stay on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Job {
    /// Nothing but that.
    On,
    /// These sets of joints are homed, one after the other.
    Home(Vec<u64>),
    /// A program so many times, or a line of MDI, behind the homing of these sets of joints.
    Program { home: Vec<u64>, runs: u32 },
}

/// The sequence and where it is.
#[derive(Debug)]
pub struct Sequence {
    step: Step,
    step_since_ns: u64,
    /// How much longer drives may take to be off: a spindle has to run down first, ns.
    run_down_ns: u64,
    /// Groups of joints still to be homed, the next one last.
    homing: Vec<u64>,
    /// A program runs behind that.
    has_program: bool,
    ordered: bool,
    /// The program is begun again whenever it has ended, until somebody wants an end.
    repeats: bool,
    /// How often the program is to be begun still.
    runs: u32,
    /// Behind a job the drives stay on and the next one is waited for.
    stands_by: bool,
    /// Drives are to go off once the machine rests.
    goes_off: bool,
    outcome: Outcome,
    /// Something was begun while standing by.
    has_begun: bool,
    /// How the last program ended.
    program: Outcome,
}

impl Sequence {
    /// `homing`: sets of joints in the order in which they are homed.
    pub fn new(now_ns: u64, homing: &[u64]) -> Sequence {
        Sequence {
            step: Step::Network,
            step_since_ns: now_ns,
            homing: homing.iter().rev().copied().collect(),
            has_program: true,
            ordered: false,
            repeats: false,
            runs: 0,
            stands_by: false,
            goes_off: false,
            outcome: Outcome::Completed,
            has_begun: false,
            program: Outcome::Completed,
            run_down_ns: 0,
        }
    }

    /// With a spindle that takes so long to stand, ns.
    #[must_use]
    pub fn with_run_down(self, run_down_ns: u64) -> Sequence {
        Sequence { run_down_ns, ..self }
    }

    /// The same with the program begun again whenever it has ended, until [`Sequence::stop`] or [`Sequence::stopped`].
    pub fn repeating(self) -> Sequence {
        Sequence { repeats: true, ..self }
    }

    /// The same that waits for jobs: behind each it waits again, drives on, until [`Sequence::end`]. There is no time limit on the
    /// network: drives may be switched on later than the PC.
    pub fn standing_by(self) -> Sequence {
        Sequence {
            stands_by: true,
            has_program: false,
            homing: Vec::new(),
            step: Step::StandBy,
            ..self
        }
    }

    /// Begins a job; only while standing by. `state`: of the machine.
    pub fn begin(&mut self, now_ns: u64, state: State, job: Job) {
        if self.step != Step::StandBy {
            return;
        }
        self.outcome = Outcome::Completed;
        self.has_begun = true;
        self.has_program = matches!(job, Job::Program { .. });
        self.runs = match job {
            Job::Program { runs, .. } => runs.saturating_sub(1),
            Job::On | Job::Home(_) => 0,
        };
        self.homing = match job {
            Job::On => Vec::new(),
            Job::Home(groups) | Job::Program { home: groups, .. } => groups.into_iter().rev().collect(),
        };
        let is_on = state == State::Ready;
        self.enter(if is_on { self.behind_enable() } else { Step::Enable }, now_ns);
    }

    /// Where the sequence is.
    pub fn step(&self) -> Step {
        self.step
    }

    /// How often the program under way is to be begun behind this time.
    pub fn runs_left(&self) -> u32 {
        if self.has_program() { self.runs } else { 0 }
    }

    /// Whether what is under way is or leads to a program.
    pub fn has_program(&self) -> bool {
        self.has_program && self.step != Step::StandBy
    }

    /// How the last program ended, while none is under way.
    pub fn program_outcome(&self) -> Option<Outcome> {
        (!self.has_program()).then_some(self.program)
    }

    /// How the last job ended, while none is under way; `None` where there was none, too.
    pub fn job_outcome(&self) -> Option<Outcome> {
        (self.step == Step::StandBy && self.has_begun).then_some(self.outcome)
    }

    /// How it ended, once it has.
    pub fn outcome(&self) -> Option<Outcome> {
        (self.step == Step::Done).then_some(self.outcome)
    }

    /// The operator wants an end of everything. May be called again and again.
    pub fn end(&mut self, now_ns: u64) {
        self.stands_by = false;
        if self.step == Step::StandBy {
            self.enter(Step::Disable, now_ns);
        }
        self.stop(now_ns);
    }

    /// The operator wants an end of what is under way. May be called again and again.
    pub fn stop(&mut self, now_ns: u64) {
        match self.step {
            Step::Home | Step::Program => {
                self.outcome = Outcome::Stopped;
                self.enter(Step::Stop, now_ns);
            }
            Step::Network | Step::Enable => {
                self.outcome = Outcome::Stopped;
                self.enter(Step::Disable, now_ns);
            }
            Step::StandBy | Step::Stop | Step::Disable | Step::ShutDown | Step::Done => {}
        }
    }

    /// The operator wants drives off, the machine at rest first. May be called again and again.
    pub fn off(&mut self, now_ns: u64) {
        self.goes_off = true;
        self.has_begun = true;
        match self.step {
            Step::StandBy => self.enter(Step::Disable, now_ns),
            _ => self.stop(now_ns),
        }
    }

    /// Something outside of the machine went wrong: an end of what is under way, as of a fault.
    pub fn fail(&mut self, now_ns: u64) {
        self.stop(now_ns);
        if self.step == Step::Stop || self.step == Step::Disable {
            self.outcome = Outcome::Faulted;
        }
    }

    /// The machine stops the program without an order of this sequence, because a pin asked for it.
    pub fn stopped(&mut self) {
        if self.step == Step::Program && self.outcome == Outcome::Completed {
            self.outcome = Outcome::Stopped;
        }
    }

    /// The machine was in no state to begin what was ordered last; whether that ends the job.
    pub fn not_begun(&mut self, now_ns: u64) -> bool {
        let is_job = matches!(self.step, Step::Home | Step::Program) && self.ordered;
        if is_job {
            self.outcome = Outcome::Stopped;
            self.enter(self.behind_job(), now_ns);
        }
        is_job
    }

    /// The step whose order is due, if it is one that brings the machine to rest or down: that needs no state.
    pub fn order_end(&mut self) -> Option<Step> {
        let is_end = matches!(self.step, Step::Stop | Step::Disable | Step::ShutDown);
        if !is_end || self.ordered {
            return None;
        }
        self.ordered = true;
        Some(self.step)
    }

    /// The set of joints that [`Step::Home`] homes next (bit n: joint n); 0: all are homed.
    pub fn joints_to_home(&self) -> u64 {
        self.homing.last().copied().unwrap_or(0)
    }

    /// The step whose order is due now, given the state of the machine and whether the program has ended. Each is told once.
    pub fn poll(&mut self, now_ns: u64, state: State, program_ended: bool) -> Option<Step> {
        if state == State::Silenced {
            // No order would be heard by anybody.
            self.outcome = Outcome::Faulted;
            self.enter(Step::Done, now_ns);
        }
        if matches!(state, State::Faulted | State::Estop)
            && !matches!(self.step, Step::StandBy | Step::Disable | Step::ShutDown | Step::Done)
        {
            self.outcome = Outcome::Faulted;
            self.enter(Step::Disable, now_ns);
        }
        let run_down_ns = match self.step {
            Step::Disable | Step::ShutDown => self.run_down_ns,
            _ => 0,
        };
        if now_ns.saturating_sub(self.step_since_ns) > self.step.limit_ns().saturating_add(run_down_ns) {
            if !matches!(self.outcome, Outcome::Faulted | Outcome::TimedOut(_)) {
                self.outcome = Outcome::TimedOut(self.step);
            }
            let next = match self.step {
                Step::Network | Step::Enable | Step::Home | Step::Program | Step::Stop => Step::Disable,
                Step::StandBy => Step::StandBy,
                Step::Disable => self.behind_drives(),
                Step::ShutDown | Step::Done => Step::Done,
            };
            self.enter(next, now_ns);
        }
        match (self.step, state) {
            (Step::Network, State::Disabled) => self.enter(Step::Enable, now_ns),
            (Step::Enable, State::Ready) => self.enter(self.behind_enable(), now_ns),
            (Step::Home, State::Ready) if self.ordered => {
                self.homing.pop();
                self.ordered = false;
                // Each set of joints has the whole limit.
                self.step_since_ns = now_ns;
            }
            // A pin has stopped it.
            (Step::Home, State::Disabled) if self.ordered => {
                self.outcome = Outcome::Stopped;
                self.enter(Step::Disable, now_ns);
            }
            (Step::Program, State::Ready) if program_ended && self.ordered => {
                let again = (self.repeats || self.runs > 0) && self.outcome == Outcome::Completed;
                self.runs = self.runs.saturating_sub(1);
                self.enter(if again { Step::Program } else { self.behind_job() }, now_ns);
            }
            (Step::Stop, State::Ready | State::Disabled) => self.enter(self.behind_job(), now_ns),
            (Step::Disable, State::Disabled | State::Booting | State::Faulted | State::Estop | State::Down) => {
                self.enter(self.behind_drives(), now_ns);
            }
            (Step::ShutDown, State::Down) => self.enter(Step::Done, now_ns),
            _ => {}
        }
        if self.step == Step::Home && self.homing.is_empty() {
            self.enter(self.behind_enable(), now_ns);
        }
        let waits = matches!(self.step, Step::Network | Step::StandBy | Step::Done);
        if self.ordered || waits {
            return None;
        }
        self.ordered = true;
        Some(self.step)
    }

    /// Where it goes on with drives on: a step that has nothing to do is never under way, and is told to nobody.
    fn behind_enable(&self) -> Step {
        match (self.homing.is_empty(), self.has_program) {
            (false, _) => Step::Home,
            (true, true) => Step::Program,
            (true, false) => self.behind_job(),
        }
    }

    /// Where it goes on once the machine rests.
    fn behind_job(&self) -> Step {
        match self.stands_by && !self.goes_off {
            true => Step::StandBy,
            false => Step::Disable,
        }
    }

    /// Where it goes on once drives are off.
    fn behind_drives(&self) -> Step {
        match self.stands_by {
            true => Step::StandBy,
            false => Step::ShutDown,
        }
    }

    fn enter(&mut self, step: Step, now_ns: u64) {
        if step == Step::StandBy && self.has_program {
            self.program = self.outcome;
        }
        if step == Step::StandBy {
            self.goes_off = false;
        }
        self.step = step;
        self.step_since_ns = now_ns;
        self.ordered = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: u64 = 1_000_000_000;

    /// The step that is due, and the joints that are homed in it.
    fn due(sequence: &mut Sequence, now_ns: u64, state: State, ended: bool) -> Option<(Step, u64)> {
        let step = sequence.poll(now_ns, state, ended)?;
        Some((
            step,
            if step == Step::Home {
                sequence.joints_to_home()
            } else {
                0
            },
        ))
    }

    #[test]
    fn a_good_run_gives_every_order_once_and_in_order() {
        let mut sequence = Sequence::new(0, &[0b100, 0b011]);
        let mut orders = Vec::new();
        let mut now = 0;
        let mut poll = |sequence: &mut Sequence, state, ended| {
            now += 1;
            orders.extend(due(sequence, now, state, ended));
        };
        for (state, ended) in [
            (State::Booting, false),
            (State::Disabled, false),
            (State::Enabling, false),
            (State::Ready, false),
            (State::Homing, false),
            (State::Ready, false),
            (State::Homing, false),
            (State::Ready, false),
            (State::Running, false),
            (State::Ready, true),
            (State::Disabling, true),
            (State::Disabled, true),
            (State::ShuttingDown, true),
            (State::Down, true),
        ] {
            poll(&mut sequence, state, ended);
        }
        assert_eq!(
            orders,
            [
                (Step::Enable, 0),
                (Step::Home, 0b100),
                (Step::Home, 0b011),
                (Step::Program, 0),
                (Step::Disable, 0),
                (Step::ShutDown, 0)
            ]
        );
        assert_eq!(sequence.outcome(), Some(Outcome::Completed));
    }

    #[test]
    fn a_repeated_program_is_ordered_again_until_somebody_wants_an_end() {
        let mut sequence = Sequence::new(0, &[]).repeating();
        for state in [State::Disabled, State::Ready] {
            sequence.poll(SECOND, state, false);
        }
        for _ in 0..3 {
            assert_eq!(sequence.poll(SECOND, State::Running, false), None);
            assert_eq!(sequence.poll(SECOND, State::Ready, true), Some(Step::Program));
            assert_eq!(sequence.poll(SECOND, State::Ready, false), None);
        }
        sequence.stop(SECOND);
        assert_eq!(sequence.poll(SECOND, State::Running, false), Some(Step::Stop));
        assert_eq!(sequence.poll(SECOND, State::Ready, true), Some(Step::Disable));
        sequence.poll(SECOND, State::Disabled, true);
        sequence.poll(SECOND, State::Down, true);
        assert_eq!(sequence.outcome(), Some(Outcome::Stopped));

        let mut sequence = Sequence::new(0, &[]).repeating();
        for state in [State::Disabled, State::Ready, State::Running] {
            sequence.poll(SECOND, state, false);
        }
        sequence.stopped();
        assert_eq!(sequence.poll(SECOND, State::Ready, true), Some(Step::Disable));
    }

    fn program(home: &[u64]) -> Job {
        Job::Program {
            home: home.to_vec(),
            runs: 1,
        }
    }

    #[test]
    fn a_program_runs_as_often_as_was_ordered_unless_it_is_stopped() {
        let begun = |runs| {
            let mut sequence = Sequence::new(0, &[]).standing_by();
            let home = Vec::new();
            sequence.begin(SECOND, State::Ready, Job::Program { home, runs });
            assert_eq!(sequence.poll(SECOND, State::Ready, false), Some(Step::Program));
            sequence
        };
        let mut sequence = begun(3);
        for left in [2, 1] {
            assert_eq!(sequence.runs_left(), left);
            assert_eq!(sequence.poll(SECOND, State::Running, false), None);
            assert_eq!(sequence.poll(SECOND, State::Ready, true), Some(Step::Program));
        }
        assert_eq!((sequence.runs_left(), sequence.program_outcome()), (0, None));
        assert_eq!(sequence.poll(SECOND, State::Ready, true), None);
        assert_eq!(sequence.program_outcome(), Some(Outcome::Completed));
        let mut sequence = begun(3);
        sequence.stop(SECOND);
        assert_eq!(sequence.poll(SECOND, State::Running, false), Some(Step::Stop));
        assert_eq!(sequence.poll(SECOND, State::Ready, true), None);
        assert_eq!(
            (sequence.runs_left(), sequence.program_outcome()),
            (0, Some(Outcome::Stopped))
        );
    }

    #[test]
    fn standing_by_gives_no_order_before_a_job_and_waits_again_behind_it_with_drives_on() {
        let mut sequence = Sequence::new(0, &[0b100, 0b011]).standing_by();
        // However long the network takes, and whatever is acknowledged meanwhile.
        for state in [State::Booting, State::Faulted, State::Disabling, State::Disabled] {
            assert_eq!(sequence.poll(3600 * SECOND, state, false), None);
            assert_eq!(sequence.step(), Step::StandBy);
        }
        let mut orders = Vec::new();
        sequence.begin(SECOND, State::Disabled, program(&[0b100, 0b011]));
        sequence.begin(SECOND, State::Disabled, Job::On);
        for (state, ended) in [
            (State::Disabled, false),
            (State::Ready, false),
            (State::Ready, false),
            (State::Ready, false),
            (State::Running, false),
            (State::Ready, true),
            (State::Ready, true),
        ] {
            orders.extend(due(&mut sequence, SECOND, state, ended));
        }
        let expected = [
            (Step::Enable, 0),
            (Step::Home, 0b100),
            (Step::Home, 0b011),
            (Step::Program, 0),
        ];
        assert_eq!(orders, expected);
        assert_eq!(
            (sequence.step(), sequence.program_outcome()),
            (Step::StandBy, Some(Outcome::Completed))
        );
        // The next one: drives are on, and joints know where they are.
        sequence.begin(SECOND, State::Ready, program(&[]));
        assert_eq!(sequence.program_outcome(), None);
        assert_eq!(due(&mut sequence, SECOND, State::Ready, true), Some((Step::Program, 0)));
        // A stop ends the program, and drives stay on; one before they are on switches them off.
        sequence.stop(SECOND);
        assert_eq!(sequence.poll(SECOND, State::Running, false), Some(Step::Stop));
        assert_eq!(sequence.poll(SECOND, State::Ready, true), None);
        assert_eq!(
            (sequence.step(), sequence.program_outcome()),
            (Step::StandBy, Some(Outcome::Stopped))
        );
        sequence.off(SECOND);
        assert_eq!(sequence.poll(SECOND, State::Ready, true), Some(Step::Disable));
        sequence.poll(SECOND, State::Disabled, true);
        sequence.begin(SECOND, State::Disabled, program(&[]));
        sequence.poll(SECOND, State::Disabled, false);
        sequence.stop(SECOND);
        assert_eq!(sequence.poll(SECOND, State::Enabling, false), Some(Step::Disable));
        sequence.poll(SECOND, State::Disabled, false);
        assert_eq!(sequence.program_outcome(), Some(Outcome::Stopped));
        // Nor does a fault end the standing by.
        sequence.begin(SECOND, State::Disabled, program(&[]));
        sequence.poll(SECOND, State::Disabled, false);
        assert_eq!(sequence.poll(SECOND, State::Faulted, false), None);
        assert_eq!(sequence.program_outcome(), Some(Outcome::Faulted));
        sequence.end(SECOND);
        assert_eq!(sequence.poll(SECOND, State::Faulted, false), Some(Step::ShutDown));
        sequence.poll(SECOND, State::Down, false);
        assert!(sequence.outcome().is_some());
    }

    /// Whoever looks at what is under way never sees a step that has nothing to do.
    #[test]
    fn nothing_homes_where_all_joints_are_homed() {
        let begun = |state, job| {
            let mut sequence = Sequence::new(0, &[0b1]).standing_by();
            sequence.begin(SECOND, state, job);
            let first = sequence.step();
            sequence.poll(SECOND, State::Ready, false);
            (first, sequence.step(), sequence.job_outcome())
        };
        let program = || Job::Program {
            home: Vec::new(),
            runs: 1,
        };
        assert_eq!(begun(State::Ready, program()), (Step::Program, Step::Program, None));
        assert_eq!(begun(State::Disabled, program()), (Step::Enable, Step::Program, None));
        let done = Some(Outcome::Completed);
        assert_eq!(begun(State::Ready, Job::On), (Step::StandBy, Step::StandBy, done));
        assert_eq!(begun(State::Disabled, Job::On), (Step::Enable, Step::StandBy, done));
        assert_eq!(
            begun(State::Ready, Job::Home(Vec::new())),
            (Step::StandBy, Step::StandBy, done)
        );
    }

    #[test]
    fn jobs_that_are_no_programs_leave_what_is_told_of_the_last_one() {
        let mut sequence = Sequence::new(0, &[0b1]).standing_by();
        sequence.begin(SECOND, State::Disabled, Job::On);
        assert_eq!(sequence.poll(SECOND, State::Disabled, false), Some(Step::Enable));
        assert_eq!(sequence.job_outcome(), None);
        assert_eq!(sequence.poll(SECOND, State::Ready, false), None);
        assert_eq!(sequence.job_outcome(), Some(Outcome::Completed));
        // However long the hands take.
        assert_eq!(sequence.poll(1000 * SECOND, State::Jogging, false), None);
        sequence.begin(1000 * SECOND, State::Ready, Job::Home(vec![1]));
        let home = due(&mut sequence, 1000 * SECOND, State::Ready, false);
        assert_eq!(home, Some((Step::Home, 1)));
        sequence.stop(1001 * SECOND);
        assert_eq!(sequence.poll(1001 * SECOND, State::Homing, false), Some(Step::Stop));
        // A drive that homes stops by its own ramp, and is off then.
        assert_eq!(sequence.poll(1001 * SECOND, State::Disabled, false), None);
        assert_eq!(
            (sequence.step(), sequence.job_outcome(), sequence.program_outcome()),
            (Step::StandBy, Some(Outcome::Stopped), Some(Outcome::Completed))
        );
        sequence.begin(1002 * SECOND, State::Disabled, Job::On);
        sequence.poll(1002 * SECOND, State::Disabled, false);
        assert_eq!(
            sequence.poll(1013 * SECOND, State::Enabling, false),
            Some(Step::Disable)
        );
        sequence.poll(1014 * SECOND, State::Disabled, false);
        assert_eq!(sequence.job_outcome(), Some(Outcome::TimedOut(Step::Enable)));
    }

    #[test]
    fn a_program_that_a_pin_stops_is_not_completed() {
        let mut sequence = Sequence::new(0, &[]);
        for state in [State::Disabled, State::Ready, State::Running] {
            sequence.poll(SECOND, state, false);
        }
        sequence.stopped();
        assert_eq!(sequence.poll(2 * SECOND, State::Ready, true), Some(Step::Disable));
        assert_eq!(sequence.outcome(), None);
        sequence.poll(2 * SECOND, State::Disabled, true);
        sequence.poll(2 * SECOND, State::Down, true);
        assert_eq!(sequence.outcome(), Some(Outcome::Stopped));
    }

    #[test]
    fn homing_that_a_pin_stops_is_over_and_each_set_of_joints_has_its_time() {
        let mut sequence = Sequence::new(0, &[0b01, 0b10]);
        for (now, state) in [(1, State::Disabled), (1, State::Ready), (1, State::Homing)] {
            sequence.poll(now * SECOND, state, false);
        }
        assert_eq!(
            due(&mut sequence, 100 * SECOND, State::Ready, false),
            Some((Step::Home, 0b10))
        );
        assert_eq!(sequence.poll(200 * SECOND, State::Homing, false), None);
        assert_eq!(sequence.step(), Step::Home);
        assert_eq!(sequence.poll(201 * SECOND, State::Disabled, false), Some(Step::Disable));
        sequence.poll(202 * SECOND, State::Disabled, false);
        sequence.poll(203 * SECOND, State::Down, false);
        assert_eq!(sequence.outcome(), Some(Outcome::Stopped));

        let mut sequence = Sequence::new(0, &[0b01]);
        for (now, state) in [(1, State::Disabled), (1, State::Ready), (1, State::Homing)] {
            sequence.poll(now * SECOND, state, false);
        }
        assert_eq!(sequence.poll(122 * SECOND, State::Homing, false), Some(Step::Disable));
    }

    #[test]
    fn a_network_that_never_comes_up_times_out() {
        let mut sequence = Sequence::new(0, &[]);
        assert_eq!(sequence.poll(14 * SECOND, State::Booting, false), None);
        assert_eq!(sequence.poll(16 * SECOND, State::Booting, false), Some(Step::ShutDown));
        sequence.poll(17 * SECOND, State::Down, false);
        assert_eq!(sequence.outcome(), Some(Outcome::TimedOut(Step::Network)));
    }

    #[test]
    fn a_fault_switches_off_and_a_network_that_will_not_go_down_does_not_hang() {
        let mut sequence = Sequence::new(0, &[]);
        for state in [State::Disabled, State::Ready, State::Running] {
            sequence.poll(SECOND, state, false);
        }
        assert_eq!(sequence.step(), Step::Program);
        assert_eq!(sequence.poll(2 * SECOND, State::Faulted, false), Some(Step::ShutDown));
        sequence.poll(6 * SECOND, State::ShuttingDown, false);
        assert_eq!(sequence.outcome(), Some(Outcome::Faulted));
    }

    #[test]
    fn a_wish_to_stop_stops_first_and_switches_off_then() {
        let mut sequence = Sequence::new(0, &[]);
        for state in [State::Disabled, State::Ready, State::Running] {
            sequence.poll(SECOND, state, false);
        }
        sequence.stop(SECOND);
        assert_eq!(sequence.poll(SECOND, State::Running, false), Some(Step::Stop));
        sequence.stop(SECOND);
        assert_eq!(sequence.poll(SECOND, State::Stopping, false), None);
        assert_eq!(sequence.poll(SECOND, State::Ready, false), Some(Step::Disable));
        sequence.poll(SECOND, State::Disabled, false);
        sequence.poll(SECOND, State::Down, false);
        assert_eq!(sequence.outcome(), Some(Outcome::Stopped));
    }

    #[test]
    fn a_job_that_the_machine_does_not_begin_is_over() {
        let mut sequence = Sequence::new(0, &[]).standing_by();
        let home = vec![0b111];
        sequence.begin(SECOND, State::Disabled, Job::Program { home, runs: 2 });
        assert_eq!(
            due(&mut sequence, SECOND, State::Disabled, false),
            Some((Step::Enable, 0))
        );
        assert!(!sequence.not_begun(SECOND), "drives go on by themselves");
        assert_eq!(
            due(&mut sequence, SECOND, State::Ready, false),
            Some((Step::Home, 0b111))
        );
        assert!(sequence.not_begun(SECOND));
        assert_eq!(
            (sequence.step(), sequence.job_outcome()),
            (Step::StandBy, Some(Outcome::Stopped))
        );
        assert_eq!(due(&mut sequence, SECOND, State::Ready, false), None);
        // One that runs a single program switches drives off, in a time that begins then.
        let mut sequence = Sequence::new(0, &[]);
        let now_ns = 3600 * SECOND;
        for (now_ns, state) in [(1, State::Disabled), (2, State::Ready)] {
            due(&mut sequence, now_ns, state, false);
        }
        assert_eq!(sequence.step(), Step::Program);
        assert!(sequence.not_begun(now_ns));
        assert_eq!(
            due(&mut sequence, now_ns, State::Ready, false),
            Some((Step::Disable, 0))
        );
    }

    #[test]
    fn an_end_is_ordered_once_whatever_else_is_ordered() {
        let mut sequence = Sequence::new(0, &[]).standing_by();
        let home = Vec::new();
        sequence.begin(SECOND, State::Ready, Job::Program { home, runs: 1 });
        assert_eq!(sequence.order_end(), None);
        sequence.stop(SECOND);
        assert_eq!(sequence.order_end(), Some(Step::Stop));
        assert_eq!(sequence.order_end(), None);
        assert_eq!(sequence.poll(SECOND, State::Stopping, false), None);
        assert_eq!(sequence.step(), Step::Stop);
    }
}
