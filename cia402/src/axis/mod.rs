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
//! How motion starts: while the status is not [`Status::Enabled`] the commanded target is not used. When it becomes
//! `Enabled`, take [`Axis::target_position`] as the place where the joint stands and go on from there.
//!
//! In CSV and CST ([`AxisConfig::mode`]) the drive is led by the velocity or the torque of the [`Target`]; both are 0 in every
//! cycle in which the axis is not enabled, so that a drive that is stopped, homed or lost is never left with the last one.

mod fault;
mod homing;
mod interface;
mod state;

pub use fault::{AxisFault, HomingFault, Step};
pub use interface::{AxisConfig, Feedback, Mode, Request, Setpoint, Status, Target};
pub use state::{Axis, HomingState};

use crate::profile::{Command, State, controlword, mode, state, statusword};
use state::{Homing, HomingStep, Phase, Reset, Timer, command_down, command_stop};

/// Cycles for which bit 7 is shown as 0 before a fault reset, so that a lost frame does not cost the edge.
const RESET_LOW_CYCLES: u8 = 4;
/// Bit of 60FD: interlock.
const INTERLOCK_BIT: u32 = 3;
/// Enabling as a whole may take this many step limits; ends a drive that steps to and fro for ever.
const ENABLING_STEPS_MAX: u64 = 8;

impl Axis {
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
            (Request::CutPower, _) => Phase::CuttingPower,
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
    #[inline]
    pub fn accepts(&self, request: Request) -> bool {
        match self.phase {
            Phase::Offline => false,
            Phase::Disabled => request == Request::Enable,
            Phase::Enabling | Phase::Homing(_) => {
                matches!(request, Request::Disable | Request::QuickStop | Request::CutPower)
            }
            Phase::Enabled => matches!(
                request,
                Request::Disable | Request::QuickStop | Request::CutPower | Request::Home
            ),
            Phase::Disabling => matches!(request, Request::QuickStop | Request::CutPower),
            Phase::QuickStopping => request == Request::CutPower,
            Phase::CuttingPower => false,
            Phase::Faulted { .. } => request == Request::ResetFault,
        }
    }

    /// One bus cycle: takes what the drive sent, returns what to send. `online` is false as long as the node is not
    /// OPERATIONAL or its data are too old; `feedback` is then not looked at. `commanded` is used in [`Status::Enabled`]
    /// only; a bare `i64` is a position in unwrapped counts.
    ///
    /// RT: constant time.
    pub fn cycle(&mut self, now_ns: u64, online: bool, feedback: &Feedback, commanded: impl Into<Target>) -> Setpoint {
        (self.velocity, self.torque) = (0, 0);
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
            Phase::Enabled => self.enabled(now_ns, drive, feedback, commanded.into()),
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
            Phase::CuttingPower => self.cutting_power(now_ns, drive),
            Phase::QuickStopping => self.quick_stopping(now_ns, drive),
            Phase::Faulted { fault, reset } => self.faulted(now_ns, drive, feedback, fault, reset),
        };
        self.setpoint(controlword, mode)
    }

    /// What the axis is doing.
    #[inline]
    pub fn status(&self) -> Status {
        match self.phase {
            Phase::Offline => Status::Offline,
            Phase::Disabled => Status::Disabled,
            Phase::Enabling => Status::Enabling,
            Phase::Enabled => Status::Enabled,
            Phase::Homing(_) => Status::Homing,
            Phase::Disabling | Phase::CuttingPower => Status::Disabling,
            Phase::QuickStopping => Status::QuickStopping,
            Phase::Faulted { fault, .. } => Status::Faulted(fault),
        }
    }

    /// The fault that stands, if any.
    #[inline]
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
            | Phase::CuttingPower
            | Phase::QuickStopping => false,
        }
    }

    /// Actual position in counts, unwrapped from the 32 bits of 6064. It restarts at the drive's own value when
    /// the drive comes on line and when it has homed.
    #[inline]
    pub fn actual_position(&self) -> i64 {
        self.actual
    }

    /// The position that this feedback tells, in unwrapped counts, before [`Axis::cycle`] has taken it.
    ///
    /// RT: constant time.
    pub fn position_in(&self, feedback: &Feedback) -> i64 {
        self.actual + i64::from(feedback.position.wrapping_sub(self.position))
    }

    /// Target position as last sent, in unwrapped counts: where motion goes on from when the axis becomes enabled.
    #[inline]
    pub fn target_position(&self) -> i64 {
        self.target
    }

    /// Whether the drive has been homed since it came on line.
    #[inline]
    pub fn homing(&self) -> HomingState {
        if let Phase::Homing(_) = self.phase {
            HomingState::Running
        } else {
            self.homed
        }
    }

    /// Somebody knows that the drive counts from where it was homed once, although it has not been homed since it came on line:
    /// its encoder is absolute. Without effect while it is off line or homes.
    ///
    /// RT: constant time.
    pub fn take_for_homed(&mut self) {
        if self.online && !matches!(self.phase, Phase::Homing(_)) {
            self.homed = HomingState::Homed;
        }
    }

    /// The drive is to be homed again.
    ///
    /// RT: constant time.
    pub fn forget_home(&mut self) {
        self.homed = HomingState::NotHomed;
    }

    /// Whether the drive shows a warning (bit 7 of the statusword).
    #[inline]
    pub fn warning(&self) -> bool {
        self.online && self.statusword & statusword::WARNING != 0
    }

    fn setpoint(&self, controlword: u16, mode: i8) -> Setpoint {
        let (velocity, torque) = (self.velocity, self.torque);
        let (target_velocity, target_torque, velocity_offset, torque_offset) = match self.config.mode {
            Mode::Csp | Mode::Ip => (0, 0, velocity, torque),
            Mode::Csv => (velocity, 0, 0, torque),
            Mode::Cst | Mode::Tq => (0, torque, 0, 0),
            Mode::Pv => (velocity, 0, 0, 0),
            Mode::Vl => (velocity.clamp(i16::MIN.into(), i16::MAX.into()), 0, 0, 0),
            Mode::Pp => (0, 0, 0, 0),
        };
        Setpoint {
            controlword,
            // The low 32 bits on purpose: 607A wraps as 6064 does.
            target_position: self.target as i32,
            target_velocity,
            target_torque,
            velocity_offset,
            torque_offset,
            mode,
        }
    }

    /// Changes the phase; time limits restart.
    fn enter(&mut self, phase: Phase) {
        self.new_set_point = false;
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
            Phase::Enabling
            | Phase::Enabled
            | Phase::Homing(_)
            | Phase::Disabling
            | Phase::CuttingPower
            | Phase::QuickStopping => {
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
            self.actual = self.position_in(feedback);
        } else {
            self.actual = i64::from(feedback.position);
            self.target = self.actual;
        }
        self.online = true;
        self.position = feedback.position;
        self.statusword = feedback.statusword;
        self.interlock = feedback.digital_inputs >> INTERLOCK_BIT & 1 == 1;
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
        } else if self.interlock && matches!(step, Step::Shutdown | Step::SwitchOn | Step::EnableOperation) {
            AxisFault::Interlock
        } else {
            AxisFault::StepTimeout { step }
        }
    }

    /// What a drive that left OPERATION ENABLED by itself is told to be wrong.
    fn unexpected_disable(&self, state: State) -> AxisFault {
        if self.interlock {
            AxisFault::Interlock
        } else {
            AxisFault::UnexpectedDisable { state }
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
        let new = if self.new_set_point { controlword::MODE_START } else { 0 };
        Command::EnableOperation as u16 | self.config.mode.controlword() | new
    }

    fn enabled(&mut self, now_ns: u64, drive: State, feedback: &Feedback, commanded: Target) -> u16 {
        if drive != State::OperationEnabled {
            self.fail(self.unexpected_disable(drive));
            return command_stop(drive) as u16;
        }
        let acknowledged = feedback.statusword & statusword::MODE_ACK != 0;
        let follows = acknowledged || !self.config.mode.tells_following();
        if follows && feedback.mode_display == self.config.mode.code() {
            self.mark_ns = now_ns;
        } else if now_ns.saturating_sub(self.mark_ns) > self.config.follow_grace_ns {
            self.fail(AxisFault::CommandIgnored {
                mode_display: feedback.mode_display,
            });
            return command_stop(drive) as u16;
        }
        match self.config.mode {
            // A set-point is shown until the drive has it, and the next one when the drive has seen the bit go.
            Mode::Pp if self.new_set_point => self.new_set_point = !acknowledged,
            Mode::Pp if acknowledged || commanded.position == self.target => {}
            Mode::Pp => (self.target, self.new_set_point) = (commanded.position, true),
            Mode::Csp | Mode::Ip | Mode::Csv | Mode::Cst | Mode::Vl | Mode::Pv | Mode::Tq => {
                self.target = commanded.position;
            }
        }
        (self.velocity, self.torque) = (commanded.velocity, commanded.torque);
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

    fn cutting_power(&mut self, now_ns: u64, drive: State) -> u16 {
        match drive {
            State::NotReadyToSwitchOn | State::SwitchOnDisabled => self.enter(Phase::Disabled),
            State::QuickStopActive
            | State::ReadyToSwitchOn
            | State::SwitchedOn
            | State::OperationEnabled
            | State::FaultReactionActive
            | State::Fault => self.limit(now_ns, Step::DisableVoltage),
        }
        Command::DisableVoltage as u16
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

#[cfg(test)]
mod tests;
