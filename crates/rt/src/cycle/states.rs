//! States of the machine: how one follows from the other where drives, network and motion are ready for it.

use super::*;

impl MotionController<dyn CyclicBus + '_> {
    /// Goes on to the next state where the drives and the network are ready for it.
    pub(super) fn step_state(&mut self) {
        if self.state == State::Homing && self.parts.homer.is_active() {
            self.see_homing();
        }
        let all = |wanted: Status| self.parts.drives.all(|drive| drive.status() == wanted);
        match self.state {
            State::Disabled if !self.network_up() => self.enter(State::Booting),
            State::Booting if self.network_up() && self.drives_off() => {
                // What was usual in boot-up counts no more against what follows.
                self.parts.overruns.clear();
                self.enter(State::Disabled);
            }
            State::Enabling if all(Status::Enabled) => self.enter(State::Ready),
            State::Homing if all(Status::Enabled) && !self.parts.homer.is_active() => self.enter(State::Ready),
            State::Jogging if self.parts.hand.is_over() => {
                self.parts.hand.end();
                self.enter(State::Ready);
            }
            State::Away if self.parts.hand.is_over() => {
                self.parts.hand.end();
                if self.program.as_ref().is_some_and(|run| run.goes_back) {
                    self.parts.hand.begin_to_go(&self.command_mm[..self.joints]);
                    self.parts.way_back.begin();
                    self.enter(State::Returning);
                }
            }
            State::Returning => self.go_back(),
            State::Running if self.is_held() && self.at_rest() => self.enter(State::Held),
            State::Running if self.sample.state == SampleState::Finished => {
                if self.program.as_ref().is_some_and(|run| !run.is_mdi) {
                    self.all_off();
                }
                self.let_program_go();
                self.enter(State::Ready);
            }
            State::Stopping if self.at_rest() => self.after_stop(),
            State::Disabling if self.drives_off() => self.enter(if self.network_up() {
                State::Disabled
            } else {
                State::Booting
            }),
            State::Estop if self.parts.estop.is_enable_requested() && self.chain_opened_by().is_none() => {
                self.end_fault();
            }
            State::ShuttingDown if self.bus.state() == BusState::Down => self.enter(State::Down),
            State::ShuttingDown if self.drives_off() && !self.network_closing => {
                self.network_closing = true;
                self.bus.shut_down();
            }
            State::Booting
            | State::Disabled
            | State::Enabling
            | State::Ready
            | State::Homing
            | State::Jogging
            | State::Running
            | State::Held
            | State::Stopping
            | State::Disabling
            | State::Faulted
            | State::ShuttingDown
            | State::Down
            | State::Estop
            | State::Away
            | State::Silenced => {}
        }
    }

    /// Joints that are homed (bit n: joint n).
    pub(super) fn homed(&self) -> u64 {
        let joints = self.parts.drives.iter().enumerate();
        joints.fold(0, |mask, (joint, drive)| mask | u64::from(drive.is_homed()) << joint)
    }

    fn drives_off(&self) -> bool {
        self.parts.drives.all(Drive::is_off) && self.parts.spindles.first.is_drive_off()
    }

    fn network_up(&self) -> bool {
        self.bus.state() == BusState::Operational && self.parts.nodes.mandatory_node_down(&self.bus).is_none()
    }

    pub(super) fn at_rest(&self) -> bool {
        let (hand, homer) = (&self.parts.hand, &self.parts.homer);
        self.program.as_ref().is_none_or(|run| run.program.is_at_rest())
            && (!hand.is_active() || hand.is_at_rest())
            && (!homer.is_active() || homer.is_at_rest())
            && !self.parts.monitor.is_stopping()
    }

    /// Gives the program up: spindle and coolant off.
    pub(super) fn end_program(&mut self) {
        self.all_off();
        self.let_program_go();
    }

    /// Whether the program is held.
    pub(super) fn is_held(&self) -> bool {
        self.program.as_ref().is_some_and(|run| run.hold)
    }

    fn let_program_go(&mut self) {
        let Some(run) = self.program.take() else { return };
        self.outlets.give_back(run.program);
        let joints = &self.command_mm[..self.joints];
        let position = self.parts.kinematics.forward(&ToolFrame::OFF, joints);
        self.sample = Sample::resting(position.unwrap_or(self.sample.position));
        self.notice(Notice::ProgramEnded);
    }

    pub(super) fn enter(&mut self, state: State) {
        if state != self.state {
            self.state = state;
            self.notice(Notice::State(state));
        }
    }
}
