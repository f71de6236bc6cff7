//! The cycle: what happens every millisecond, as a table of contents.
//!
//! In:  answers of the nodes, orders, the plan in the ring.
//! Out: set-points for the nodes; pins, notices and trace records for everyone else.
//!
//! RT: nothing in [`Control::cycle`] allocates, locks, waits for another thread or touches a file; every loop is
//! bounded by the number of nodes, joints or ring slots. Budget in `benches/cycle.rs`.

use super::drives::Drives;
use super::pins::Pins;
use super::shared::{Command, Live, Notice, Snapshot, TimedNotice, Trace};
use crate::bus::{BusEvent, BusState, CycleReport, Fieldbus, InputImage, NodeState, OutputImage};
use crate::config::JOINTS_MAX;
use crate::machine::faults::{Fault, Reaction};
use crate::machine::state::State;
use cia402::axis::{Request, Status};
use motion::canon::Position;
use motion::element::Action;
use motion::rt::{Interpolator, Kinematics, Monitor, Peaks, Sample, SampleState};
use std::sync::Arc;

/// Orders that are taken in one cycle at the most.
const COMMANDS_PER_CYCLE: usize = 4;
/// Bus events that are passed on in one cycle at the most.
const BUS_EVENTS_PER_CYCLE: usize = 8;

/// Ends of the rings that lead out of real time.
pub struct Outlets {
    /// Orders.
    pub commands: rtrb::Consumer<Command>,
    /// Notices; what finds the ring full is counted in [`Control::notices_lost`].
    pub notices: rtrb::Producer<TimedNotice>,
    /// One record per cycle of a program.
    pub trace: rtrb::Producer<Trace>,
    /// Programs that are over go back, so that nothing is freed in real time.
    pub finished: rtrb::Producer<Box<Interpolator>>,
    /// Latest values.
    pub live: Arc<Live>,
}

/// What a machine file makes of a machine.
pub struct Parts {
    /// Payloads to the nodes.
    pub outputs: OutputImage,
    /// Payloads from the nodes.
    pub inputs: InputImage,
    /// Joints and their drives.
    pub drives: Drives,
    /// Axes to joints.
    pub kinematics: Kinematics,
    /// Watches what leaves for the joints.
    pub monitor: Monitor,
    /// The control's pins.
    pub pins: Pins,
    /// For each node: whether the machine cannot run without it.
    pub mandatory: Box<[bool]>,
    /// Cycle time, s.
    pub cycle_s: f64,
}

/// Everything that the cycle thread owns.
pub struct Control<B> {
    bus: B,
    parts: Parts,
    outlets: Outlets,
    joints: usize,

    state: State,
    program: Option<Box<Interpolator>>,
    sample: Sample,
    command_mm: [f64; JOINTS_MAX],
    hold: bool,
    waiting: Option<Action>,
    fault_seen: bool,
    network_closing: bool,
    cycle: u64,
    orders_taken: u64,
    program_cycles: u64,
    late_max_ns: u64,
    cycles_skipped: u64,
    notices_lost: u64,
    trace_lost: u64,
}

impl<B: Fieldbus> Control<B> {
    /// A machine whose network is down.
    pub fn new(bus: B, parts: Parts, outlets: Outlets) -> Control<B> {
        let joints = parts.drives.iter().count();
        Control {
            bus,
            parts,
            outlets,
            joints,
            state: State::Booting,
            program: None,
            sample: Sample::resting(Position::ZERO),
            command_mm: [0.0; JOINTS_MAX],
            hold: false,
            waiting: None,
            fault_seen: false,
            network_closing: false,
            cycle: 0,
            orders_taken: 0,
            program_cycles: 0,
            late_max_ns: 0,
            cycles_skipped: 0,
            notices_lost: 0,
            trace_lost: 0,
        }
    }

    /// One cycle. `late_ns`: how late it begins; `skipped`: cycles that had to be left out before it; the exchange is
    /// over by `deadline_ns`.
    pub fn cycle(&mut self, late_ns: u64, skipped: u64, deadline_ns: u64) {
        let report = self
            .bus
            .exchange(deadline_ns, &self.parts.outputs, &mut self.parts.inputs);
        self.parts
            .drives
            .read(&self.parts.inputs, |node| self.bus.node_state(node));
        self.watch(late_ns, skipped);
        self.take_orders();
        self.step_state();
        self.interpolate();
        self.check_commands();
        self.parts
            .drives
            .write(report.sent_ns, &self.command_mm[..self.joints], &mut self.parts.outputs);
        self.parts.pins.write_outputs(&mut self.parts.outputs);
        self.show(&report, late_ns);
        self.cycle += 1;
    }

    /// The bus, for what is not cyclic between two cycles.
    pub fn bus_mut(&mut self) -> &mut B {
        &mut self.bus
    }

    /// What the machine is doing.
    pub fn state(&self) -> State {
        self.state
    }

    /// Notices that found their ring full.
    pub fn notices_lost(&self) -> u64 {
        self.notices_lost
    }

    /// Trace records that found their ring full.
    pub fn trace_lost(&self) -> u64 {
        self.trace_lost
    }

    /// Greatest velocities, accelerations and jerks commanded to the joints by programs.
    pub fn peaks(&self) -> Vec<Peaks> {
        self.parts.monitor.peaks().map(|(_, peaks)| *peaks).collect()
    }

    /// The cycle thread was taken for hung: no frame may leave any more.
    pub fn silence(&mut self) {
        self.fault(Fault::CycleHung);
    }

    /// Looks for faults: lateness, the bus, the drives.
    fn watch(&mut self, late_ns: u64, skipped: u64) {
        self.late_max_ns = self.late_max_ns.max(late_ns);
        if skipped > 0 {
            self.cycles_skipped += skipped;
            self.fault(Fault::CyclesSkipped { cycles: skipped });
        }
        for _ in 0..BUS_EVENTS_PER_CYCLE {
            let Some(event) = self.bus.pop_event() else { break };
            self.notice(Notice::Bus(event));
            match event {
                BusEvent::NodeLost(node) if self.parts.mandatory[node] && self.state != State::Booting => {
                    self.fault(Fault::NodeLost { node });
                }
                BusEvent::ForeignMaster(mac) => self.fault(Fault::ForeignMaster { mac }),
                BusEvent::LinkFailed(error) => self.fault(Fault::LinkFailed { error }),
                BusEvent::Network(_)
                | BusEvent::Identified(_)
                | BusEvent::WrongIdentity { .. }
                | BusEvent::ConfigurationRefused { .. }
                | BusEvent::Missing(_)
                | BusEvent::BootFailed(_)
                | BusEvent::NodeUp(_)
                | BusEvent::NodeLost(_)
                | BusEvent::NodeError { .. } => {}
            }
        }
        if !self.under_command() {
            return;
        }
        for joint in 0..self.joints {
            let Some(drive) = self.parts.drives.iter().nth(joint) else {
                break;
            };
            if let Some(fault) = drive.fault() {
                self.fault(Fault::Drive { joint, fault });
            } else if drive.status() == Status::Enabled {
                let (error_mm, limit_mm) = (drive.following_error_mm(), drive.following_error_max_mm());
                if error_mm.abs() > limit_mm {
                    self.fault(Fault::FollowingError {
                        joint,
                        error_mm,
                        limit_mm,
                    });
                }
            }
        }
    }

    /// Whether drives are or should be under power.
    fn under_command(&self) -> bool {
        match self.state {
            State::Enabling | State::Ready | State::Homing | State::Running | State::Held | State::Stopping => true,
            State::Booting
            | State::Disabled
            | State::Disabling
            | State::Faulted
            | State::ShuttingDown
            | State::Down => false,
        }
    }

    /// Does what the table of faults says.
    fn fault(&mut self, fault: Fault) {
        let first = !self.fault_seen && fault.reaction() > Reaction::Count;
        match fault.reaction() {
            Reaction::Count => {
                self.notice(Notice::Fault { fault, first: false });
                return;
            }
            Reaction::ControlledStop if self.state == State::Booting => return,
            Reaction::ControlledStop | Reaction::Silence => {}
        }
        if !first {
            return;
        }
        self.fault_seen = true;
        self.notice(Notice::Fault { fault, first });
        if fault.reaction() == Reaction::Silence {
            self.enter(State::Faulted);
            return;
        }
        match self.state {
            // To rest on the path first; `step_state` goes on to the quick stop.
            State::Running | State::Held | State::Stopping => self.enter(State::Stopping),
            State::Enabling | State::Ready | State::Homing => self.quick_stop(),
            State::Booting
            | State::Disabled
            | State::Disabling
            | State::Faulted
            | State::ShuttingDown
            | State::Down => {}
        }
    }

    fn quick_stop(&mut self) {
        self.parts.drives.request(u64::MAX, Request::QuickStop);
        self.enter(State::Faulted);
    }

    fn take_orders(&mut self) {
        for _ in 0..COMMANDS_PER_CYCLE {
            let Ok(command) = self.outlets.commands.pop() else {
                break;
            };
            self.obey(command);
            self.orders_taken += 1;
        }
        if self.parts.pins.take_stop() {
            self.obey(Command::Stop);
        }
        if self.parts.pins.take_resume() {
            self.obey(Command::Resume);
        }
    }

    /// Orders that do not fit the state are without effect.
    fn obey(&mut self, command: Command) {
        match (command, self.state) {
            (Command::Enable, State::Disabled) if !self.fault_seen => {
                self.parts.drives.request(u64::MAX, Request::Enable);
                self.enter(State::Enabling);
            }
            (Command::Home(joints), State::Ready) => {
                self.parts.drives.request(joints, Request::Home);
                self.enter(State::Homing);
            }
            (Command::Start(program), State::Ready) if self.parts.drives.all(|drive| drive.is_homed()) => {
                if let Some(before) = self.program.replace(program) {
                    self.give_back(before);
                }
                self.hold = false;
                self.waiting = None;
                self.program_cycles = 0;
                self.sample.state = SampleState::Starved;
                self.enter(State::Running);
            }
            (Command::Start(program), _) => self.give_back(program),
            (Command::Hold, State::Running) => self.hold = true,
            (Command::Resume, State::Running | State::Held) => {
                self.hold = false;
                if let Some(Action::ProgramStop | Action::OptionalStop) = self.waiting {
                    self.end_wait();
                }
                if self.state == State::Held {
                    self.enter(State::Running);
                }
            }
            (Command::Stop, State::Running | State::Held) => self.enter(State::Stopping),
            (Command::Stop, State::Homing) => {
                self.parts.drives.request(u64::MAX, Request::Disable);
                self.enter(State::Disabling);
            }
            (Command::Disable, State::Enabling | State::Ready | State::Homing | State::Running | State::Held)
            | (Command::Disable, State::Stopping) => {
                self.parts.pins.all_off();
                self.parts.drives.request(u64::MAX, Request::Disable);
                self.enter(State::Disabling);
            }
            (Command::Acknowledge, State::Faulted) => {
                self.fault_seen = false;
                self.parts.drives.request(u64::MAX, Request::ResetFault);
                self.enter(State::Disabling);
            }
            (Command::ShutDown, State::ShuttingDown | State::Down) => {}
            (Command::ShutDown, _) => {
                // The network follows once the drives are without power: see `step_state`.
                self.parts.pins.all_off();
                self.parts.drives.request(u64::MAX, Request::Disable);
                self.enter(State::ShuttingDown);
            }
            (Command::Enable, _)
            | (Command::Home(_), _)
            | (Command::Hold, _)
            | (Command::Resume, _)
            | (Command::Stop, _)
            | (Command::Disable, _)
            | (Command::Acknowledge, _) => {}
        }
    }

    /// Goes on to the next state where the drives and the network are ready for it.
    fn step_state(&mut self) {
        let all = |wanted: Status| self.parts.drives.all(|drive| drive.status() == wanted);
        match self.state {
            State::Booting if self.bus.state() == BusState::Operational && self.mandatory_nodes_up() => {
                self.enter(State::Disabled);
            }
            State::Enabling if all(Status::Enabled) => self.enter(State::Ready),
            State::Homing if all(Status::Enabled) => self.enter(State::Ready),
            State::Running if self.hold && self.at_rest() => self.enter(State::Held),
            State::Running if self.sample.state == SampleState::Finished => self.end_program(State::Ready),
            State::Stopping if self.at_rest() => {
                if self.fault_seen {
                    self.end_program(State::Faulted);
                    self.quick_stop();
                } else {
                    self.end_program(State::Ready);
                }
            }
            State::Disabling if self.drives_off() => self.enter(State::Disabled),
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
            | State::Running
            | State::Held
            | State::Stopping
            | State::Disabling
            | State::Faulted
            | State::ShuttingDown
            | State::Down => {}
        }
    }

    fn drives_off(&self) -> bool {
        self.parts.drives.all(|drive| match drive.status() {
            Status::Disabled | Status::Offline | Status::Faulted(_) => true,
            Status::Enabling | Status::Enabled | Status::Homing | Status::Disabling | Status::QuickStopping => false,
        })
    }

    fn mandatory_nodes_up(&self) -> bool {
        let mut nodes = self.parts.mandatory.iter().enumerate();
        nodes.all(|(node, &mandatory)| !mandatory || self.bus.node_state(node) == NodeState::Operational)
    }

    fn at_rest(&self) -> bool {
        self.program.as_ref().is_none_or(|program| program.is_at_rest())
    }

    fn end_program(&mut self, next: State) {
        if let Some(program) = self.program.take() {
            self.give_back(program);
        }
        self.waiting = None;
        self.sample = Sample::resting(self.sample.position);
        self.parts.pins.all_off();
        self.notice(Notice::ProgramEnded);
        self.enter(next);
    }

    /// Next set-points of all joints.
    fn interpolate(&mut self) {
        let scale = match self.state {
            State::Running if !self.hold => self.parts.pins.feed_scale(),
            _ => 0.0,
        };
        if let Some(program) = &mut self.program {
            self.sample = program.step(scale);
            self.program_cycles += 1;
            if self.waiting.is_none()
                && let Some(action) = self.sample.action
            {
                self.waiting = Some(action);
                self.notice(Notice::Action(action));
                self.parts.pins.begin_action(action);
            }
            self.parts
                .kinematics
                .inverse(&self.sample.position, &mut self.command_mm[..self.joints]);
        } else {
            // Without a program each joint stays where it was told to be.
            for (command_mm, drive) in self.command_mm.iter_mut().zip(self.parts.drives.iter()) {
                *command_mm = drive.command_mm();
            }
            self.sample = Sample::resting(self.parts.kinematics.forward(&self.command_mm[..self.joints]));
        }
        if let Some(action) = self.waiting
            && self.parts.pins.action_done(action)
        {
            self.end_wait();
        }
    }

    fn end_wait(&mut self) {
        self.waiting = None;
        if let Some(program) = &mut self.program {
            program.acknowledge_action();
        }
    }

    /// The last look at what leaves for the drives: numbers, inside the travel, within the limits.
    fn check_commands(&mut self) {
        let Some(program) = &self.program else {
            self.parts.monitor.restart();
            return;
        };
        let scaling = program.is_scaling();
        const SLACK_MM: f64 = 1e-6;
        if let Some(joint) = self.parts.monitor.see(&self.command_mm[..self.joints], scaling) {
            self.fault(Fault::IllegalCommand { joint });
        }
        for joint in 0..self.joints {
            let Some(drive) = self.parts.drives.iter().nth(joint) else {
                break;
            };
            let (position_mm, [low_mm, high_mm]) = (self.command_mm[joint], drive.travel_mm());
            if !position_mm.is_finite() {
                self.command_mm[joint] = drive.command_mm();
            } else if position_mm < low_mm - SLACK_MM || position_mm > high_mm + SLACK_MM {
                self.fault(Fault::SoftLimit { joint, position_mm });
            }
        }
    }

    /// Tells everyone else what happened.
    fn show(&mut self, report: &CycleReport, late_ns: u64) {
        self.parts.pins.publish(
            &mut self.bus,
            &self.parts.inputs,
            &self.parts.drives,
            &self.sample,
            self.state,
            report,
            late_ns,
        );
        let (elapsed_s, remaining_s) = match &self.program {
            Some(program) => (self.program_cycles as f64 * self.parts.cycle_s, program.remaining_s()),
            None => (0.0, 0.0),
        };
        self.outlets.live.show(&Snapshot {
            state: self.state,
            orders_taken: self.orders_taken,
            cycles: self.cycle,
            line: self.sample.line,
            velocity_mm_s: self.sample.velocity_mm_s,
            position: self.sample.position,
            late_max_ns: self.late_max_ns,
            cycles_skipped: self.cycles_skipped,
            remaining_s,
            elapsed_s,
        });
        if self.program.is_some() {
            let mut actual_mm = [0.0; JOINTS_MAX];
            let mut following_error_mm = 0.0_f64;
            for (actual_mm, drive) in actual_mm.iter_mut().zip(self.parts.drives.iter()) {
                *actual_mm = drive.actual_mm();
                following_error_mm = following_error_mm.max(drive.following_error_mm().abs());
            }
            let record = Trace {
                cycle: self.cycle,
                command: self.sample.position,
                actual: self.parts.kinematics.forward(&actual_mm[..self.joints]),
                line: self.sample.line,
                rapid: self.sample.rapid,
                following_error_mm,
            };
            self.trace_lost += u64::from(self.outlets.trace.push(record).is_err());
        }
    }

    fn enter(&mut self, state: State) {
        if state != self.state {
            self.state = state;
            self.notice(Notice::State(state));
        }
    }

    fn notice(&mut self, notice: Notice) {
        let timed = TimedNotice {
            cycle: self.cycle,
            notice,
        };
        self.notices_lost += u64::from(self.outlets.notices.push(timed).is_err());
    }

    fn give_back(&mut self, program: Box<Interpolator>) {
        // The ring holds as many as there can ever be; should it be full all the same, leaking is what real time
        // can afford and freeing is not.
        if let Err(rtrb::PushError::Full(program)) = self.outlets.finished.push(program) {
            std::mem::forget(program);
        }
    }
}
