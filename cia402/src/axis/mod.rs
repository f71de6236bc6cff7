//! Controller side: one drive as the control sees it.
//!
//! In:  per cycle the drive's statusword and actual values ([`Feedback`]), the commanded position of the motion and,
//!      now and then, a [`Request`].
//! Out: per cycle the controlword and target ([`Setpoint`]), and a [`Status`] that says whether motion may command.
//!
//! The rules, each one a test: one step per statusword seen, each with a time limit; the target copies the actual
//! position until OPERATION ENABLED is seen, so that enabling never makes a jump; no enabling without a request, and
//! none that outlives a fault or an absence of the drive; a mode counts only when 6061 shows it; a statusword that the
//! profile does not define is a fault; a drive that ignores its target is a fault.
//!
//! How motion starts: while the status is not [`Status::Enabled`] the commanded position is not used. When it becomes
//! `Enabled`, take [`Axis::target_position`] as the place where the joint stands and go on from there.

mod fault;
mod homing;

pub use fault::{AxisFault, HomingFault, Step};
pub use homing::HomingState;

use crate::profile::{Command, State, controlword, mode, state, statusword};
use homing::{Homing, HomingStep};

/// Cycles for which bit 7 is shown as 0 before a fault reset, so that a lost frame does not cost the edge.
const RESET_LOW_CYCLES: u8 = 4;
/// Enabling as a whole may take this many step limits; ends a drive that steps to and fro for ever.
const ENABLING_STEPS_MAX: u64 = 8;

/// Cyclic mode in which the drive follows the interpolation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// Cyclic synchronous position (8): target in 607A.
    #[default]
    Csp,
    /// Interpolated position (7): target in 60C1:1; older drives.
    Ip,
}

impl Mode {
    /// The mode's code in 6060 and 6061.
    pub const fn code(self) -> i8 {
        match self {
            Mode::Csp => mode::CYCLIC_SYNCHRONOUS_POSITION,
            Mode::Ip => mode::INTERPOLATED_POSITION,
        }
    }

    /// Controlword bits that the mode needs beside *enable operation*.
    const fn controlword(self) -> u16 {
        match self {
            Mode::Csp => 0,
            Mode::Ip => controlword::MODE_START,
        }
    }
}

/// Settings of an [`Axis`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AxisConfig {
    /// Time limit of each step of the state machine, ns.
    pub step_timeout_ns: u64,
    /// Time limit of homing as a whole, ns.
    pub homing_timeout_ns: u64,
    /// Cyclic mode in which it is run.
    pub mode: Mode,
    /// How long an enabled drive may show that it does not follow the target, ns.
    pub follow_grace_ns: u64,
}

impl Default for AxisConfig {
    fn default() -> Self {
        AxisConfig {
            step_timeout_ns: 1_000_000_000,
            homing_timeout_ns: 120_000_000_000,
            mode: Mode::Csp,
            follow_grace_ns: 20_000_000,
        }
    }
}

/// What the drive sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Feedback {
    /// 6041.
    pub statusword: u16,
    /// 6064, counts.
    pub position: i32,
    /// 60F4, counts.
    pub following_error: i32,
    /// 6061.
    pub mode_display: i8,
    /// 60FD.
    pub digital_inputs: u32,
    /// 603F; 0 where it is not mapped.
    pub error_code: u16,
}

/// What the drive gets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Setpoint {
    /// 6040.
    pub controlword: u16,
    /// 607A or 60C1:1, counts; the low 32 bits of the unwrapped position.
    pub target_position: i32,
    /// 6060.
    pub mode: i8,
}

/// What the control wants of the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Power off, by the drive's own ramp.
    Disable,
    /// Power on and follow; accepted in [`Status::Disabled`] only.
    Enable,
    /// Stop by the quick-stop ramp, then power off.
    QuickStop,
    /// Acknowledge a fault; accepted in [`Status::Faulted`] only. Never enables.
    ResetFault,
    /// Home by the drive's own method (6098); accepted in [`Status::Enabled`] only.
    Home,
}

/// What the axis is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// The drive is not on the bus.
    Offline,
    /// No torque, no fault.
    Disabled,
    /// On the way to [`Status::Enabled`].
    Enabling,
    /// Follows the commanded position.
    Enabled,
    /// The drive homes itself; the commanded position is not used.
    Homing,
    /// On the way to [`Status::Disabled`].
    Disabling,
    /// Stopping by the quick-stop ramp.
    QuickStopping,
    /// Stopped by a fault until it is reset.
    Faulted(AxisFault),
}

#[derive(Clone, Copy, Debug)]
enum Phase {
    Offline,
    Disabled,
    Enabling,
    Enabled,
    Homing(Homing),
    Disabling,
    QuickStopping,
    Faulted { fault: AxisFault, reset: Reset },
}

/// Progress of a fault reset.
#[derive(Clone, Copy, Debug)]
enum Reset {
    NotAsked,
    /// Bit 7 is shown as 0 for this many more cycles.
    Low(u8),
    /// Bit 7 is shown as 1.
    High,
}

/// A time limit at work.
#[derive(Clone, Copy, Debug)]
struct Timer {
    step: Step,
    since_ns: u64,
}

/// Supervisor of one drive.
#[derive(Clone, Debug)]
pub struct Axis {
    config: AxisConfig,
    phase: Phase,
    /// As told to the last cycle.
    online: bool,
    drive: Option<State>,
    statusword: u16,
    position: i32,
    actual: i64,
    target: i64,
    timer: Option<Timer>,
    /// When enabling began, or when the enabled drive was last seen to follow.
    mark_ns: u64,
    homed: HomingState,
}

impl Axis {
    /// An axis whose drive has not been seen yet.
    pub fn new(config: AxisConfig) -> Axis {
        Axis {
            config,
            phase: Phase::Offline,
            online: false,
            drive: None,
            statusword: 0,
            position: 0,
            actual: 0,
            target: 0,
            timer: None,
            mark_ns: 0,
            homed: HomingState::NotHomed,
        }
    }

    /// Takes a request, to act in the next [`Axis::cycle`]. A request that does not fit the present status (see
    /// [`Axis::accepts`]) changes nothing.
    ///
    /// RT: constant time.
    pub fn request(&mut self, request: Request) {
        if !self.accepts(request) {
            return;
        }
        self.timer = None;
        let phase = match (request, self.phase) {
            (Request::Enable, _) => Phase::Enabling,
            (Request::Disable, _) => Phase::Disabling,
            (Request::QuickStop, _) => Phase::QuickStopping,
            (Request::Home, _) => Phase::Homing(Homing::new()),
            (Request::ResetFault, Phase::Faulted { fault, .. }) if self.online => Phase::Faulted {
                fault,
                reset: Reset::Low(RESET_LOW_CYCLES),
            },
            (Request::ResetFault, _) => Phase::Offline,
        };
        self.enter(phase);
    }

    /// Whether a request fits the present status.
    ///
    /// RT: constant time.
    pub fn accepts(&self, request: Request) -> bool {
        match self.phase {
            Phase::Offline => false,
            Phase::Disabled => request == Request::Enable,
            Phase::Enabling | Phase::Homing(_) => matches!(request, Request::Disable | Request::QuickStop),
            Phase::Enabled => matches!(request, Request::Disable | Request::QuickStop | Request::Home),
            Phase::Disabling => request == Request::QuickStop,
            Phase::QuickStopping => false,
            Phase::Faulted { .. } => request == Request::ResetFault,
        }
    }

    /// One bus cycle: takes what the drive sent, returns what to send. `online` is false as long as the node is not
    /// OPERATIONAL or its data are too old; `feedback` is then not looked at. `commanded_position` is in unwrapped
    /// counts and is used in [`Status::Enabled`] only.
    ///
    /// RT: constant time.
    pub fn cycle(&mut self, now_ns: u64, online: bool, feedback: &Feedback, commanded_position: i64) -> Setpoint {
        if !online {
            return self.offline();
        }
        self.read_feedback(feedback);
        let Some(drive) = self.drive else {
            self.fail(AxisFault::UnknownState {
                statusword: feedback.statusword,
            });
            return self.setpoint(Command::QuickStop as u16, self.config.mode.code());
        };
        if matches!(drive, State::Fault | State::FaultReactionActive) {
            self.fail(AxisFault::Drive {
                error_code: feedback.error_code,
            });
        }
        if drive != State::OperationEnabled {
            self.target = self.actual;
        }
        let mut mode = self.config.mode.code();
        let controlword = match self.phase {
            Phase::Offline | Phase::Disabled => self.disabled(drive),
            Phase::Enabling => self.enabling(now_ns, drive, feedback),
            Phase::Enabled => self.enabled(now_ns, drive, feedback, commanded_position),
            Phase::Homing(homing) => {
                let word = self.homing_step(now_ns, drive, feedback, homing);
                if let Phase::Homing(Homing {
                    step: HomingStep::SetMode | HomingStep::Run { .. },
                    ..
                }) = self.phase
                {
                    mode = mode::HOMING;
                }
                word
            }
            Phase::Disabling => self.disabling(now_ns, drive),
            Phase::QuickStopping => self.quick_stopping(now_ns, drive),
            Phase::Faulted { fault, reset } => self.faulted(now_ns, drive, feedback, fault, reset),
        };
        self.setpoint(controlword, mode)
    }

    /// What the axis is doing.
    pub fn status(&self) -> Status {
        match self.phase {
            Phase::Offline => Status::Offline,
            Phase::Disabled => Status::Disabled,
            Phase::Enabling => Status::Enabling,
            Phase::Enabled => Status::Enabled,
            Phase::Homing(_) => Status::Homing,
            Phase::Disabling => Status::Disabling,
            Phase::QuickStopping => Status::QuickStopping,
            Phase::Faulted { fault, .. } => Status::Faulted(fault),
        }
    }

    /// The fault that stands, if any.
    pub fn fault(&self) -> Option<AxisFault> {
        if let Phase::Faulted { fault, .. } = self.phase {
            Some(fault)
        } else {
            None
        }
    }

    /// Whether an acknowledged fault is being reset: the drive has neither obeyed nor refused yet.
    pub fn is_resetting(&self) -> bool {
        match self.phase {
            Phase::Faulted { reset, .. } => matches!(reset, Reset::Low(_) | Reset::High),
            Phase::Offline
            | Phase::Disabled
            | Phase::Enabling
            | Phase::Enabled
            | Phase::Homing(_)
            | Phase::Disabling
            | Phase::QuickStopping => false,
        }
    }

    /// The drive's state as its last statusword showed it; `None`: offline or a pattern that is no state.
    pub fn drive_state(&self) -> Option<State> {
        self.drive
    }

    /// Actual position in counts, unwrapped from the 32 bits of 6064. It restarts at the drive's own value when
    /// the drive comes on line and when it has homed.
    pub fn actual_position(&self) -> i64 {
        self.actual
    }

    /// Target position as last sent, in unwrapped counts: where motion goes on from when the axis becomes enabled.
    pub fn target_position(&self) -> i64 {
        self.target
    }

    /// Whether the drive has been homed since it came on line.
    pub fn homing(&self) -> HomingState {
        if let Phase::Homing(_) = self.phase {
            HomingState::Running
        } else {
            self.homed
        }
    }

    /// Whether the drive shows a warning (bit 7 of the statusword).
    pub fn warning(&self) -> bool {
        self.online && self.statusword & statusword::WARNING != 0
    }

    fn setpoint(&self, controlword: u16, mode: i8) -> Setpoint {
        // The low 32 bits on purpose: 607A wraps as 6064 does.
        Setpoint {
            controlword,
            target_position: self.target as i32,
            mode,
        }
    }

    /// Changes the phase; time limits restart.
    fn enter(&mut self, phase: Phase) {
        if let (Phase::Homing(_), false) = (self.phase, matches!(phase, Phase::Homing(_))) {
            self.homed = HomingState::NotHomed;
        }
        self.phase = phase;
        self.timer = None;
    }

    /// The first cause stays: a fault upon a fault changes nothing.
    fn fail(&mut self, fault: AxisFault) {
        if !matches!(self.phase, Phase::Faulted { .. }) {
            self.enter(Phase::Faulted {
                fault,
                reset: Reset::NotAsked,
            });
            if let AxisFault::Homing(_) = fault {
                self.homed = HomingState::Failed;
            }
        }
    }

    fn offline(&mut self) -> Setpoint {
        self.online = false;
        self.drive = None;
        match self.phase {
            Phase::Offline | Phase::Disabled => self.enter(Phase::Offline),
            Phase::Faulted { fault, .. } => {
                self.phase = Phase::Faulted {
                    fault,
                    reset: Reset::NotAsked,
                }
            }
            Phase::Enabling | Phase::Enabled | Phase::Homing(_) | Phase::Disabling | Phase::QuickStopping => {
                self.fail(AxisFault::Lost);
            }
        }
        // It may have been switched off meanwhile, and then knows nothing of an earlier homing.
        self.homed = HomingState::NotHomed;
        // Our frames may still arrive where its frames do not: a drive that moves stops by its ramp.
        let command = if self.fault().is_some() {
            Command::QuickStop
        } else {
            Command::DisableVoltage
        };
        self.setpoint(command as u16, self.config.mode.code())
    }

    fn read_feedback(&mut self, feedback: &Feedback) {
        if self.online {
            self.actual += i64::from(feedback.position.wrapping_sub(self.position));
        } else {
            self.actual = i64::from(feedback.position);
            self.target = self.actual;
        }
        self.online = true;
        self.position = feedback.position;
        self.statusword = feedback.statusword;
        self.drive = state(feedback.statusword);
    }

    /// Runs the time limit of a step; true once it has passed. A new step starts a new limit.
    fn step_timed_out(&mut self, now_ns: u64, step: Step) -> bool {
        let since_ns = match self.timer {
            Some(timer) if timer.step == step => timer.since_ns,
            Some(_) | None => {
                self.timer = Some(Timer { step, since_ns: now_ns });
                now_ns
            }
        };
        now_ns.saturating_sub(since_ns) > self.config.step_timeout_ns
    }

    /// As [`Axis::over_time`]; a limit that has passed is a fault.
    fn limit(&mut self, now_ns: u64, step: Step) {
        if self.step_timed_out(now_ns, step) {
            self.fail(self.step_timeout(step));
        }
    }

    fn step_timeout(&self, step: Step) -> AxisFault {
        if self.statusword & statusword::REMOTE == 0 {
            AxisFault::LocalControl { step }
        } else {
            AxisFault::StepTimeout { step }
        }
    }

    /// Seen without being asked for: a drive that is powered, as after a restart of the control, is brought down.
    fn disabled(&mut self, drive: State) -> u16 {
        match drive {
            State::NotReadyToSwitchOn | State::SwitchOnDisabled => self.enter(Phase::Disabled),
            State::ReadyToSwitchOn
            | State::SwitchedOn
            | State::OperationEnabled
            | State::QuickStopActive
            | State::FaultReactionActive
            | State::Fault => self.enter(Phase::Disabling),
        }
        command_down(drive) as u16
    }

    fn enabling(&mut self, now_ns: u64, drive: State, feedback: &Feedback) -> u16 {
        if self.timer.is_none() {
            self.mark_ns = now_ns;
        }
        let (step, command) = match drive {
            State::NotReadyToSwitchOn => (Step::SelfTest, Command::DisableVoltage),
            State::SwitchOnDisabled => (Step::Shutdown, Command::Shutdown),
            State::ReadyToSwitchOn => (Step::SwitchOn, Command::SwitchOn),
            State::SwitchedOn if feedback.mode_display != self.config.mode.code() => (Step::Mode, Command::SwitchOn),
            State::SwitchedOn => (Step::EnableOperation, Command::EnableOperation),
            State::QuickStopActive | State::FaultReactionActive | State::Fault => {
                (Step::LeaveQuickStop, Command::DisableVoltage)
            }
            State::OperationEnabled => {
                // The target of this cycle is still the held one: motion learns of it from `target_position`.
                self.enter(Phase::Enabled);
                self.mark_ns = now_ns;
                return self.operation();
            }
        };
        self.limit(now_ns, step);
        if now_ns.saturating_sub(self.mark_ns) > ENABLING_STEPS_MAX * self.config.step_timeout_ns {
            self.fail(self.step_timeout(step));
        }
        if self.fault().is_some() {
            command_stop(drive) as u16
        } else {
            command as u16
        }
    }

    /// Controlword of an enabled drive in its cyclic mode.
    fn operation(&self) -> u16 {
        Command::EnableOperation as u16 | self.config.mode.controlword()
    }

    fn enabled(&mut self, now_ns: u64, drive: State, feedback: &Feedback, commanded_position: i64) -> u16 {
        if drive != State::OperationEnabled {
            self.fail(AxisFault::UnexpectedDisable { state: drive });
            return command_stop(drive) as u16;
        }
        let follows = feedback.statusword & statusword::MODE_ACK != 0;
        if follows && feedback.mode_display == self.config.mode.code() {
            self.mark_ns = now_ns;
        } else if now_ns.saturating_sub(self.mark_ns) > self.config.follow_grace_ns {
            self.fail(AxisFault::CommandIgnored {
                mode_display: feedback.mode_display,
            });
            return command_stop(drive) as u16;
        }
        self.target = commanded_position;
        self.operation()
    }

    fn disabling(&mut self, now_ns: u64, drive: State) -> u16 {
        let step = match drive {
            State::NotReadyToSwitchOn | State::SwitchOnDisabled => {
                self.enter(Phase::Disabled);
                return Command::DisableVoltage as u16;
            }
            State::OperationEnabled => Step::DisableOperation,
            State::SwitchedOn => Step::Shutdown,
            State::ReadyToSwitchOn => Step::DisableVoltage,
            State::QuickStopActive | State::FaultReactionActive | State::Fault => Step::LeaveQuickStop,
        };
        self.limit(now_ns, step);
        command_down(drive) as u16
    }

    fn quick_stopping(&mut self, now_ns: u64, drive: State) -> u16 {
        match drive {
            State::NotReadyToSwitchOn | State::SwitchOnDisabled => {
                self.enter(Phase::Disabled);
                Command::DisableVoltage as u16
            }
            State::QuickStopActive => self.leave_quick_stop(now_ns),
            State::ReadyToSwitchOn
            | State::SwitchedOn
            | State::OperationEnabled
            | State::FaultReactionActive
            | State::Fault => {
                self.limit(now_ns, Step::QuickStop);
                Command::QuickStop as u16
            }
        }
    }

    /// A drive that holds its position after the stop (605A = 5 to 8) is switched off when the time of the stop is over.
    fn leave_quick_stop(&mut self, now_ns: u64) -> u16 {
        let command = if self.step_timed_out(now_ns, Step::LeaveQuickStop) {
            Command::DisableVoltage
        } else {
            Command::QuickStop
        };
        command as u16
    }

    fn faulted(
        &mut self,
        now_ns: u64,
        drive: State,
        feedback: &Feedback,
        mut fault: AxisFault,
        mut reset: Reset,
    ) -> u16 {
        // Many drives show the code a cycle or two after the state.
        if let (AxisFault::Drive { error_code: 0 }, State::Fault | State::FaultReactionActive) = (fault, drive) {
            fault = AxisFault::Drive {
                error_code: feedback.error_code,
            };
        }
        let mut word = match drive {
            State::QuickStopActive => self.leave_quick_stop(now_ns),
            State::NotReadyToSwitchOn
            | State::SwitchOnDisabled
            | State::ReadyToSwitchOn
            | State::SwitchedOn
            | State::OperationEnabled
            | State::FaultReactionActive
            | State::Fault => command_stop(drive) as u16,
        };
        match (reset, drive) {
            (Reset::NotAsked, _) => {}
            (Reset::Low(0), State::Fault) => {
                reset = Reset::High;
                self.timer = Some(Timer {
                    step: Step::FaultReset,
                    since_ns: now_ns,
                });
                word = Command::FaultReset as u16;
            }
            (Reset::Low(cycles), State::Fault) => reset = Reset::Low(cycles - 1),
            (Reset::High, State::Fault) => {
                word = Command::FaultReset as u16;
                if self.step_timed_out(now_ns, Step::FaultReset) {
                    // The cause is still there; the drive knows it better than an older fault of ours.
                    fault = AxisFault::Drive {
                        error_code: feedback.error_code,
                    };
                    reset = Reset::NotAsked;
                    word = Command::DisableVoltage as u16;
                }
            }
            (Reset::Low(_) | Reset::High, State::FaultReactionActive) => {}
            (
                Reset::Low(_) | Reset::High,
                State::NotReadyToSwitchOn
                | State::SwitchOnDisabled
                | State::ReadyToSwitchOn
                | State::SwitchedOn
                | State::OperationEnabled
                | State::QuickStopActive,
            ) => return self.disabled(drive),
        }
        self.phase = Phase::Faulted { fault, reset };
        word
    }
}

/// The command that brings a drive one step nearer to SWITCH ON DISABLED by its own ramp.
fn command_down(drive: State) -> Command {
    match drive {
        State::OperationEnabled => Command::SwitchOn,
        State::SwitchedOn => Command::Shutdown,
        State::ReadyToSwitchOn
        | State::QuickStopActive
        | State::NotReadyToSwitchOn
        | State::SwitchOnDisabled
        | State::FaultReactionActive
        | State::Fault => Command::DisableVoltage,
    }
}

/// As [`command_down`], but a drive that moves stops by the quick-stop ramp.
fn command_stop(drive: State) -> Command {
    match drive {
        State::OperationEnabled | State::QuickStopActive => Command::QuickStop,
        State::NotReadyToSwitchOn
        | State::SwitchOnDisabled
        | State::ReadyToSwitchOn
        | State::SwitchedOn
        | State::FaultReactionActive
        | State::Fault => command_down(drive),
    }
}

#[cfg(test)]
mod tests;
