//! Faults, and every way to rest.
//!
//! In:  lateness, events of the bus, drives.
//! Out: what a fault does by the table of [`machine::faults`]; stops on the path, quick stops, drives off.

use super::*;
use crate::external::Told;

impl MotionController<dyn CyclicBus + '_> {
    /// Looks for faults: lateness, the bus, the drives.
    pub(super) fn watch(&mut self, late_ns: u64, skipped: u64) {
        self.late_max_ns = self.late_max_ns.max(late_ns);
        if skipped > 0 {
            self.cycles_skipped += skipped;
            self.fault(Fault::CyclesSkipped { cycles: skipped });
        }
        match self.parts.overruns.count(skipped, self.is_at_ease()) {
            Verdict::Fine => {}
            Verdict::Many { skipped: cycles } => self.fault(Fault::ManyOverruns { cycles }),
            Verdict::TooMany { skipped: cycles } => self.fault(Fault::TooManyOverruns { cycles }),
        }
        if self.parts.pins.are_lost() {
            // They all read as 0, which says nothing of the chain.
            self.fault(Fault::PinsLost);
        } else {
            self.watch_chain();
            self.watch_limit_switches();
            self.watch_mains();
        }
        let in_step = self.sample.turns_s_max.is_some();
        if let Some(counts) = self.parts.spindles.first.take_slip(in_step) {
            self.fault(Fault::CountsLost { counts, in_step });
        }
        if let Some(fault) = self.parts.nodes.take_fault() {
            self.fault(fault);
        }
        self.watch_logic();
        match self.parts.plc.external.take_told() {
            Some(Told::Fault(fault)) => self.fault(fault),
            Some(Told::Change { component, change, pid }) => self.notice(Notice::External { component, change, pid }),
            None => {}
        }
        for _ in 0..BUS_EVENTS_PER_CYCLE {
            let Some(event) = self.bus.pop_event() else { break };
            self.notice(Notice::Bus(event));
            match event {
                BusEvent::NodeLost(node) if self.parts.nodes.is_mandatory(node) => {
                    self.fault(Fault::NodeLost { node });
                }
                BusEvent::ForeignMaster(sign) => self.fault(Fault::ForeignMaster { sign }),
                BusEvent::LinkFailed(error) => self.fault(Fault::LinkFailed { error }),
                BusEvent::Network(_)
                | BusEvent::Identified(_)
                | BusEvent::WrongIdentity { .. }
                | BusEvent::ConfigurationRefused { .. }
                | BusEvent::WrongValue { .. }
                | BusEvent::Missing(_)
                | BusEvent::Stranger { .. }
                | BusEvent::BootFailed(_)
                | BusEvent::NodeUp(_)
                | BusEvent::NodeLost(_)
                | BusEvent::NodeError { .. }
                | BusEvent::Remark(_) => {}
            }
        }
        if !self.under_command() {
            return;
        }
        // Beside the events, of which a burst may lose some.
        if let Some(node) = self.parts.nodes.mandatory_node_down(&self.bus) {
            self.fault(Fault::NodeLost { node });
        }
        let mut drives = self.parts.drives.iter().enumerate();
        if let Some(fault) = drives.find_map(|(joint, drive)| drive_fault(joint, drive)) {
            self.fault(fault);
        }
        if let Some(fault) = self.parts.spindles.first.drive_fault() {
            self.fault(Fault::SpindleDrive { fault });
        }
    }

    /// The emergency stop chain. While the network comes up, inputs of its nodes say nothing yet.
    fn watch_chain(&mut self) {
        let matters = !matches!(
            self.state,
            State::Booting | State::Estop | State::ShuttingDown | State::Down | State::Silenced
        );
        if let Some(cause) = self.chain_opened_by().filter(|_| matters) {
            self.fault(Fault::EmergencyStop { cause });
        }
    }

    /// What keeps the emergency stop chain open: a net without its source, its pin, or a drive whose safety circuit is open.
    pub(super) fn chain_opened_by(&self) -> Option<EstopCause> {
        match (self.parts.estop.is_held_open(), self.parts.estop.is_open()) {
            (true, _) => Some(EstopCause::Unwired),
            (false, true) => Some(EstopCause::Chain),
            (false, false) => (self.parts.drives.sto_open()).map(|joint| EstopCause::Sto { joint }),
        }
    }

    /// Programs in Structured Text. While the network comes up, inputs of its nodes say nothing yet.
    fn watch_logic(&mut self) {
        let matters = !matches!(
            self.state,
            State::Booting | State::ShuttingDown | State::Down | State::Silenced
        );
        if !matters {
            return;
        }
        while let Some(fault) = self.parts.plc.logic.take_fault() {
            match self.fault_seen {
                // It stops nothing any more, and is told all the same.
                true => self.notice(Notice::Fault { fault, first: false }),
                false => self.fault(fault),
            }
        }
        while let Some((task, text)) = self.parts.plc.logic.take_message() {
            self.notice(Notice::Logic { task, text });
        }
        if let Some(alarm) = self.parts.plc.logic.standing().filter(|_| self.under_command()) {
            self.fault(alarm);
        }
    }

    /// Whether a program in Structured Text may be replaced: nothing moves, and no program of parts is under way.
    pub(super) fn may_replace_logic(&self) -> bool {
        self.state.may_replace_logic() && self.program.is_none()
    }

    /// The mains. A program is left with the tool out of the work, as far as the energy carries it.
    fn watch_mains(&mut self) {
        if !self.under_command() || self.parts.pins.is_mains_ok() {
            return;
        }
        if let Some(run) = &mut self.program {
            run.retracts |= !self.fault_seen && run.away_from.is_none();
        }
        self.fault(Fault::MainsLost);
    }

    /// A limit switch that closes stops the machine; one that was closed before lets a jog lead away from it.
    fn watch_limit_switches(&mut self) {
        let (by_pins, by_drives) = (self.parts.pins.limit_switches(), self.parts.drives.limit_switches());
        let closed = [0, 1].map(|end| by_pins[end] | by_drives[end]);
        let before = std::mem::replace(&mut self.limits, closed);
        if !self.under_command() {
            return;
        }
        for (above, (now, before)) in [false, true].into_iter().zip(self.limits.into_iter().zip(before)) {
            // A joint that homes may do so onto its switch.
            let homing = match self.state {
                State::Homing => self.parts.homer.under_way() | self.parts.drives.homing(),
                _ => 0,
            };
            let closed = now & !before & !homing;
            if closed != 0 {
                let joint = closed.trailing_zeros() as usize;
                self.fault(Fault::LimitSwitch { joint, above });
            }
        }
    }

    /// Whether drives are or should be under power.
    pub(super) fn under_command(&self) -> bool {
        self.state.is_under_command()
    }

    /// Whether nothing moves and nothing can: drives are off, and the network may come and go.
    fn is_at_ease(&self) -> bool {
        matches!(self.state, State::Booting | State::Disabled)
    }

    /// Does what the table of faults says.
    pub(super) fn fault(&mut self, fault: Fault) {
        let reaction = fault.reaction();
        match reaction {
            Reaction::Count | Reaction::Warn => {
                self.notice(Notice::Fault { fault, first: false });
                return;
            }
            Reaction::ControlledStop | Reaction::QuickStop | Reaction::EmergencyStop | Reaction::Silence => {}
        }
        if self.state == State::Booting && fault.is_usual_in_boot() {
            return;
        }
        // Nodes that gave up because this PC stood still while nothing moved are booted again, and the next order waits for them.
        let stood_still = self.state == State::Disabled && self.parts.overruns.are_some();
        if stood_still && matches!(fault, Fault::NodeLost { .. }) {
            self.notice(Notice::Fault { fault, first: false });
            return;
        }
        // It is told also where a fault has stopped the machine before: another step of the operator gets on.
        let is_estop = reaction == Reaction::EmergencyStop && self.state != State::Estop;
        if !self.fault_seen || is_estop {
            self.fault_seen = true;
            self.notice(Notice::Fault { fault, first: true });
        } else if reaction == Reaction::ControlledStop {
            // The first cause has set everything going; but nothing goes on onto a switch, as the tool may on its way out of the work.
            if matches!(fault, Fault::LimitSwitch { .. }) && self.parts.hand.is_active() {
                self.parts.hand.stop();
            }
            return;
        }
        match (reaction, self.state) {
            (Reaction::Silence, _) => {
                self.end_program();
                self.parts.hand.end();
                self.parts.homer.end();
                self.enter(State::Silenced);
            }
            (Reaction::Count | Reaction::Warn, _)
            | (_, State::Estop | State::ShuttingDown | State::Down | State::Silenced) => {}
            (Reaction::EmergencyStop, _) => {
                self.end_program();
                self.parts.hand.end();
                self.parts.homer.end();
                let request = self.parts.estop.request();
                self.parts.drives.request(u64::MAX, request);
                self.parts.spindles.first.request(request);
                // A reset that came before is none of this one.
                self.parts.estop.forget_enable();
                self.enter(State::Estop);
            }
            (_, State::Faulted) => {}
            (Reaction::QuickStop, _) => {
                self.end_program();
                self.parts.hand.end();
                self.parts.homer.end();
                self.quick_stop();
            }
            // To rest on the path first; `step_state` goes on to the quick stop.
            (
                Reaction::ControlledStop,
                State::Jogging | State::Running | State::Held | State::Away | State::Returning | State::Stopping,
            ) => {
                self.stop_then(AfterStop::Ready);
            }
            (Reaction::ControlledStop, State::Homing) if self.parts.homer.is_active() => {
                self.stop_then(AfterStop::Ready);
            }
            (
                Reaction::ControlledStop,
                State::Booting | State::Disabled | State::Enabling | State::Ready | State::Homing | State::Disabling,
            ) => self.quick_stop(),
        }
    }

    pub(super) fn quick_stop(&mut self) {
        // What a line of MDI has switched on would else begin again with the next enabling.
        self.all_off();
        self.parts.drives.request(u64::MAX, Request::QuickStop);
        self.enter(State::Faulted);
    }

    /// Brings a machine that moves to rest, on its path if it has one; `step_state` goes on from there.
    pub(super) fn stop_then(&mut self, then: AfterStop) {
        if self.parts.hand.is_active() {
            self.parts.hand.stop();
        }
        if self.parts.homer.is_active() {
            self.parts.homer.stop();
            // Drives that home themselves are on no path of ours: they stop by their own ramps.
            self.parts.drives.request_of_homing(if self.fault_seen {
                Request::QuickStop
            } else {
                Request::Disable
            });
        }
        if let Some(run) = &mut self.program {
            // A hold cannot act there: the spindle leads. A tap is followed out of the work first.
            run.program.give_up_sync();
        }
        self.after_stop = if self.state == State::Stopping {
            self.after_stop.max(then)
        } else {
            then
        };
        self.enter(State::Stopping);
    }

    /// Goes on from rest, as the wish was or as the fault wants it.
    pub(super) fn after_stop(&mut self) {
        // Whatever was held back: from here on joints go on from where they stand.
        self.parts.monitor.rest_at(&self.command_mm[..self.joints]);
        // Where something harder has ended the program meanwhile, a later stop is not for that.
        let retracts = self.program.as_ref().is_some_and(|run| run.retracts);
        if retracts && self.parts.way_back.can_retract() {
            self.end_program();
            let joints_mm = &self.command_mm[..self.joints];
            self.parts.way_back.retract(joints_mm, &mut self.parts.hand);
            return;
        }
        self.end_program();
        self.parts.hand.end();
        self.parts.homer.end();
        match (self.after_stop, self.fault_seen) {
            (AfterStop::Ready | AfterStop::Disable, true) => self.quick_stop(),
            (AfterStop::Ready, false) => self.enter(State::Ready),
            (AfterStop::Disable, false) => self.switch_off(State::Disabling),
            (AfterStop::ShutDown, false) => self.switch_off(State::ShuttingDown),
            (AfterStop::ShutDown, true) => {
                self.quick_stop();
                self.enter(State::ShuttingDown);
            }
        }
    }

    pub(super) fn switch_off(&mut self, next: State) {
        self.all_off();
        self.parts.drives.request(u64::MAX, Request::Disable);
        self.enter(next);
    }
}

/// What is wrong with a drive that is or should be under power.
fn drive_fault(joint: usize, drive: &Drive) -> Option<Fault> {
    match drive.status() {
        Status::Faulted(fault) => Some(Fault::Drive { joint, fault }),
        // It was not there when the drives were switched on: a drive lost later is in fault.
        Status::Offline => Some(Fault::Drive {
            joint,
            fault: AxisFault::Lost,
        }),
        Status::Enabled if drive.warns() => Some(Fault::DriveWarning { joint }),
        Status::Enabled => {
            let (error_mm, limit_mm) = (drive.following_error_mm(), drive.following_error_max_mm());
            (error_mm.abs() > limit_mm).then_some(Fault::FollowingError {
                joint,
                error_mm,
                limit_mm,
                led: drive.position_loop().is_some(),
            })
        }
        Status::Disabled | Status::Enabling | Status::Homing | Status::Disabling | Status::QuickStopping => None,
    }
}
