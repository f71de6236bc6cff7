//! Orders: which of them fits which state, and what it begins.
//!
//! In:  orders of the operator and of pins.
//! Out: programs, homing and jogs that begin; states; wishes to stop.

use super::*;
use host::wait::monotonic_ns;

impl MotionController<dyn CyclicBus + '_> {
    pub(super) fn take_orders(&mut self) {
        // Before the orders in the ring: what follows a stop there was given behind it. Those that come now wait for the next
        // cycle: a stop that they follow is seen then, and must not come behind them.
        let given = self.outlets.commands.slots().min(COMMANDS_PER_CYCLE);
        let [hold, stop, estop] = self.outlets.live.take_at_once();
        if estop {
            self.obey(Command::Estop);
        }
        if hold {
            self.obey(Command::Hold);
        }
        if stop {
            self.stop_at_once();
        }
        let taken_before = self.orders_taken;
        for _ in 0..given {
            let Ok(command) = self.outlets.commands.pop() else {
                break;
            };
            self.obey(command);
            self.orders_taken += 1;
        }
        if self.orders_taken > taken_before {
            // Reads the clock, which is no system call.
            self.outlets.live.show_order(monotonic_ns());
        }
        let [pressed, reset] = self.parts.estop.take();
        if pressed {
            self.obey(Command::Estop);
        }
        if reset && !pressed && !estop {
            self.obey(Command::EstopReset);
        }
        self.parts.desk.follow(&self.outlets.live.desk);
        self.parts.changer.follow(&self.outlets.live.desk);
        if self.parts.desk.take_stop() {
            self.obey(Command::Stop);
            // What is still to come of a job the cycle does not know.
            self.notice(Notice::StopPressed);
        }
        if self.parts.desk.take_resume() {
            self.obey(Command::Resume);
        }
        let wanted = self.parts.desk.take();
        if wanted.pause {
            self.obey(Command::Hold);
        }
        for what in wanted.by_hand.into_iter().flatten() {
            self.obey(Command::ByHand(what));
        }
        let homed = self.homed();
        for number in 0..self.parts.jog.count() {
            let wanted = self.parts.jog.take(number, &self.parts.hand, homed);
            for order in wanted.into_iter().flatten() {
                self.obey(Command::Jog(order));
            }
        }
    }

    /// A stop that has overtaken its order, which comes to the operator in its turn.
    fn stop_at_once(&mut self) {
        let moves = matches!(
            self.state,
            State::Homing | State::Jogging | State::Running | State::Held | State::Away | State::Returning
        );
        self.obey(Command::Stop);
        if moves {
            // Else he would take the end of a program for its own end, and begin what waits behind it.
            self.notice(Notice::StopTaken);
        }
    }

    /// Orders that do not fit the state are without effect.
    pub(super) fn obey(&mut self, command: Command) {
        match (command, self.state) {
            (Command::Enable, State::Disabled) if !self.fault_seen => {
                self.parts.drives.request(u64::MAX, Request::Enable);
                self.enter(State::Enabling);
            }
            (Command::Home(joints), State::Ready) => {
                self.home(joints);
            }
            (Command::Home(_), _) => self.notice(Notice::NotBegun),
            (Command::TakeHome { joint, zero_mm }, State::Disabled) => self.parts.drives.take_home(joint, zero_mm),
            (Command::Jog(order), State::Ready | State::Jogging | State::Held | State::Away) => {
                if let JogMotion::Run { .. } | JogMotion::Advance { .. } = order.motion {
                    self.drop_continuation();
                }
                self.jog(&order);
            }
            (Command::Start { program, mdi }, State::Ready)
                if self.limits == [0; 2] && self.parts.drives.all(|drive| drive.is_homed()) =>
            {
                self.start(program, mdi);
            }
            (Command::Start { program, .. }, _) => {
                self.outlets.give_back(program);
                self.notice(Notice::NotBegun);
            }
            (Command::ToolChanged, State::Running | State::Held | State::Away) => {
                if let Some(Action::ChangeTool { tool }) = self.program.as_ref().and_then(|run| run.waiting) {
                    self.parts.changer.end();
                    self.tool_is_changed(tool);
                }
            }
            (Command::ByHand(what), State::Ready | State::Jogging | State::Running | State::Held | State::Away) => {
                self.by_hand(what)
            }
            // What a line of MDI or a hand has switched on.
            (Command::Stop, State::Ready) => self.all_off(),
            (Command::Hold, _) => self.hold(),
            (Command::Resume, State::Away | State::Running | State::Held)
                if !self.has_own_spindle(Continuation::Resume) => {}
            (Command::Reverse(share), State::Running | State::Held)
                if !self.has_own_spindle(Continuation::Reverse(share)) => {}
            (Command::Resume, State::Away) => {
                self.come_back(true);
                self.parts.hand.release_all();
            }
            (Command::Resume, State::Running | State::Held) => {
                self.run_along(None);
                if let Some(run) = &mut self.program
                    && let Some(Action::ProgramStop | Action::OptionalStop) = run.waiting
                {
                    run.end_wait();
                }
            }
            (Command::Skip(waiting), State::Running) if !self.is_held() && self.waits_for() == Some(waiting) => {
                if self.has_own_spindle(Continuation::Skip(waiting)) {
                    self.skip();
                }
            }
            (Command::Reverse(share), State::Running | State::Held) => self.run_along(Some(share)),
            (Command::SingleBlock(on), _) => {
                self.single_block = on;
                if let Some(run) = &mut self.program {
                    run.program.set_single_block(on);
                }
            }
            (Command::OptionalStop(on), _) => self.parts.desk.set_optional_stop(on),
            (Command::Stop, State::Jogging | State::Running | State::Held | State::Away | State::Returning) => {
                self.stop_then(AfterStop::Ready)
            }
            (
                Command::Disable,
                State::Jogging | State::Running | State::Held | State::Away | State::Returning | State::Stopping,
            ) => self.stop_then(AfterStop::Disable),
            (Command::Stop | Command::Disable, State::Homing) if self.parts.homer.is_active() => {
                self.stop_then(AfterStop::Disable);
            }
            // A drive that homes is on no path: it stops by its own ramp.
            (Command::Stop, State::Homing) | (Command::Disable, State::Enabling | State::Ready | State::Homing) => {
                self.switch_off(State::Disabling)
            }
            (Command::Estop, _) => self.fault(Fault::EmergencyStop {
                cause: EstopCause::Order,
            }),
            (Command::EstopReset, State::Estop) => {
                // A latch in the chain may close it by that: `step_state` goes on once it has.
                self.parts.estop.request_enable();
            }
            (Command::Acknowledge, State::Faulted) => self.end_fault(),
            (Command::ShutDown, _) => self.shut_down(),
            (Command::Enable, _)
            | (Command::TakeHome { .. }, _)
            | (Command::Jog(_), _)
            | (Command::ByHand(_), _)
            | (Command::EstopReset, _)
            | (Command::ToolChanged, _)
            | (Command::Resume, _)
            | (Command::Skip(_), _)
            | (Command::Reverse(_), _)
            | (Command::Stop, _)
            | (Command::Disable, _)
            | (Command::Acknowledge, _) => {}
        }
    }

    /// Rests where it is, on the path of a program.
    fn hold(&mut self) {
        match self.state {
            State::Running => {
                self.drop_continuation();
                if let Some(run) = &mut self.program {
                    run.hold = true;
                }
            }
            State::Held => self.drop_continuation(),
            State::Jogging => self.parts.hand.release_all(),
            State::Away | State::Returning => {
                self.drop_continuation();
                self.come_back(false);
                self.parts.hand.release_all();
            }
            _ => {}
        }
    }

    /// Comes to rest, switches drives off, then the network.
    fn shut_down(&mut self) {
        match self.state {
            State::ShuttingDown | State::Down => {}
            // Nothing can be sent that would bring it down.
            State::Silenced => self.enter(State::Down),
            State::Jogging | State::Running | State::Held | State::Away | State::Returning | State::Stopping => {
                self.stop_then(AfterStop::ShutDown);
            }
            State::Homing if self.parts.homer.is_active() => self.stop_then(AfterStop::ShutDown),
            // The network follows once the drives are without power: see `step_state`.
            _ => self.switch_off(State::ShuttingDown),
        }
    }

    /// What stopped the machine is over; drives stay off.
    pub(super) fn end_fault(&mut self) {
        self.fault_seen = false;
        self.parts.overruns.clear();
        self.parts.plc.logic.acknowledge();
        self.parts.drives.request(u64::MAX, Request::ResetFault);
        self.parts.spindles.first.request(Request::ResetFault);
        self.enter(State::Disabling);
    }

    /// Homes joints side by side, each by its drive or by the control.
    pub(super) fn home(&mut self, joints: u64) {
        let parts = &mut self.parts;
        let by_control = parts.homer.chosen(joints);
        parts.drives.request(joints & !by_control, Request::Home);
        parts.drives.begin_homing(by_control);
        for (command_mm, drive) in self.command_mm.iter_mut().zip(parts.drives.iter()) {
            *command_mm = drive.command_mm();
        }
        parts.homer.begin(by_control, &self.command_mm[..self.joints]);
        self.enter(State::Homing);
    }

    /// Takes in what came of homing by the control.
    pub(super) fn see_homing(&mut self) {
        let parts = &mut self.parts;
        match parts.homer.status() {
            HomingStatus::Running => {}
            HomingStatus::Failed { joint, failure } => self.fault(Fault::Homing { joint, failure }),
            HomingStatus::Done => {
                for joint in 0..self.joints {
                    if parts.homer.under_way() >> joint & 1 == 1
                        && let Some(found) = parts.homer.found(joint)
                    {
                        parts.drives.home_at(joint, &found);
                    }
                }
                parts.homer.end();
            }
        }
    }

    /// Runs a program, if it begins where every joint stands: one planned from elsewhere would begin with a jump.
    pub(super) fn start(&mut self, mut program: Box<Interpolator>, mdi: bool) {
        let mut begin_mm = [0.0; JOINTS_MAX];
        let begin_mm = &mut begin_mm[..self.joints];
        let begin = program.position().0;
        let far = match self.parts.kinematics.inverse(&ToolFrame::OFF, &begin, begin_mm) {
            Err(unreachable) => Some(unreachable.joint),
            Ok(()) => {
                let mut joints = begin_mm.iter().zip(self.parts.drives.iter());
                joints.position(|(begin_mm, drive)| {
                    let off_mm = (begin_mm - drive.command_mm()).abs();
                    off_mm.is_nan() || off_mm > START_SLACK_MM
                })
            }
        };
        if let Some(joint) = far {
            self.outlets.give_back(program);
            self.fault(Fault::IllegalCommand { joint, line: 0 });
            return;
        }
        program.set_single_block(self.single_block);
        self.program = Some(Run::new(program, mdi));
        self.sample.state = SampleState::Starved;
        self.enter(State::Running);
    }

    /// Goes on after whatever held the program, as [`Run::go_along`] says.
    fn run_along(&mut self, reverse: Option<f64>) {
        if let Some(run) = &mut self.program {
            run.go_along(reverse);
        }
        if self.state == State::Held {
            self.enter(State::Running);
        }
    }

    /// Whether no jog may begin: a pin keeps it from that.
    pub(super) fn is_jog_barred(&self) -> bool {
        self.parts.feed.is_held() || self.parts.jog.is_barred()
    }

    /// Whether a jog would lead a joint further onto its limit switch. Of axes that several joints move nobody knows.
    fn leads_into_limit(&self, order: &JogOrder) -> bool {
        let velocity_mm_s = match order.motion {
            JogMotion::Run { velocity_mm_s } => velocity_mm_s,
            JogMotion::Advance { distance_mm, .. } => distance_mm,
            JogMotion::Keep | JogMotion::Release => return false,
        };
        let [below, above] = self.limits;
        let together = self.parts.hand.moved_with(order.joints);
        if order.axis.is_some() {
            return (below | above) & together != 0;
        }
        together & if velocity_mm_s < 0.0 { below } else { above } != 0
    }

    /// Leaves the path on which the program is held; false: not in the middle of a move that the spindle or a probe leads.
    fn step_away(&mut self) -> bool {
        let Some(run) = &mut self.program else { return false };
        if run.program.is_probing() || !run.program.is_at_rest() || self.sample.turns_s_max.is_some() {
            return false;
        }
        for (command_mm, drive) in self.command_mm.iter_mut().zip(self.parts.drives.iter()) {
            *command_mm = drive.command_mm();
        }
        let joints = &self.command_mm[..self.joints];
        let Some(axes) = self.parts.kinematics.forward(&ToolFrame::OFF, joints) else {
            return false;
        };
        run.away_from = Some(Place {
            joints_mm: self.command_mm,
            axes,
        });
        run.goes_back = false;
        self.enter(State::Away);
        true
    }

    /// Moves joints by hand, if they and those that move with them know where they are or need not, and no pin keeps it from
    /// beginning.
    pub(super) fn jog(&mut self, order: &JogOrder) {
        let together = self.parts.hand.moved_with(order.joints);
        let homed = self.homed();
        // With a program there is always a place to come back to.
        let may_be_unhomed = order.unhomed && matches!(self.state, State::Ready | State::Jogging);
        let is_lost = together & !homed != 0 && !may_be_unhomed;
        let held = self.is_jog_barred();
        match (order.motion, self.state) {
            (JogMotion::Run { .. } | JogMotion::Advance { .. }, _)
                if is_lost || held || self.leads_into_limit(order) =>
            {
                return;
            }
            (JogMotion::Run { .. } | JogMotion::Advance { .. }, State::Held) => {
                if !self.step_away() {
                    return;
                }
                self.parts.hand.begin(&self.command_mm[..self.joints], homed, order);
            }
            (JogMotion::Keep | JogMotion::Release, State::Held) => return,
            // Whoever moves it does not want it back.
            (JogMotion::Run { .. } | JogMotion::Advance { .. }, State::Away) => {
                self.come_back(false);
                if !self.parts.hand.is_active() {
                    self.parts.hand.begin(&self.command_mm[..self.joints], homed, order);
                }
            }
            (JogMotion::Keep | JogMotion::Release, State::Away) if !self.parts.hand.is_active() => return,
            (JogMotion::Run { .. } | JogMotion::Advance { .. }, State::Ready) => {
                for (command_mm, drive) in self.command_mm.iter_mut().zip(self.parts.drives.iter()) {
                    *command_mm = drive.command_mm();
                }
                self.parts.hand.begin(&self.command_mm[..self.joints], homed, order);
                self.enter(State::Jogging);
            }
            // Neither a renewal nor a release begins anything.
            (JogMotion::Keep | JogMotion::Release, State::Ready) => return,
            (JogMotion::Run { .. } | JogMotion::Advance { .. } | JogMotion::Keep | JogMotion::Release, _) => {}
        }
        self.parts.hand.obey(order);
    }
}
