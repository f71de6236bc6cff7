//! The cycle: what happens every millisecond, as a table of contents.
//!
//! In:  answers of the nodes, orders, the plan in the ring.
//! Out: set-points for the nodes; pins, notices and trace records for everyone else.
//!
//! RT: nothing in [`Control::cycle`] allocates, locks, waits for another thread or touches a file; every loop is
//! bounded by the number of nodes, joints or ring slots. Budget in `benches/cycle.rs`.

use super::diagnosis;
use super::drives::{Drive, Drives};
use super::figures::Timing;
use super::hand::{Hand, JogMotion, JogOrder};
use super::homing::Homer;
use super::pins::Pins;
use super::shared::{Command, Live, Notice, Snapshot, TimedNotice, Trace};
use crate::bus::{BusEvent, BusState, CycleReport, Fieldbus, InputImage, NodeIndex, NodeState, OutputImage};
use crate::config::JOINTS_MAX;
use crate::machine::faults::{Fault, Reaction};
use crate::machine::overruns::{Overruns, Verdict};
use crate::machine::state::State;
use cia402::axis::{AxisFault, Request, Status};
use motion::canon::Position;
use motion::element::Action;
use motion::kinematics::{Kinematics, ToolFrame};
use motion::rt::homing::HomingStatus;
use motion::rt::{Interpolator, Monitor, Peaks, Sample, SampleState, Shares, SyncFault, Trip};
use std::sync::Arc;

/// Orders that are taken in one cycle at the most.
const COMMANDS_PER_CYCLE: usize = 4;
/// Bus events that are passed on in one cycle at the most.
const BUS_EVENTS_PER_CYCLE: usize = 8;

/// Distance between the place where a program begins and the place where a joint stands, mm, that is rounding only.
const START_SLACK_MM: f64 = 1e-3;
/// Rounding of a commanded position against the travel, mm.
const TRAVEL_SLACK_MM: f64 = 1e-6;

/// What follows once a moving machine has come to rest; of two wishes the one that goes further counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum AfterStop {
    /// Drives hold their position.
    Ready,
    /// Drives are switched off.
    Disable,
    /// Drives are switched off, then the network goes down.
    ShutDown,
}

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
    /// What the bus is like, and access to parameters of its nodes.
    pub diagnosis: diagnosis::Outlet,
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
    /// Moves joints by hand.
    pub hand: Hand,
    /// Homes joints whose drives do not.
    pub homer: Homer,
    /// The control's pins.
    pub pins: Pins,
    /// Counts cycles left out.
    pub overruns: Overruns,
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
    after_stop: AfterStop,
    /// Present while running, held or stopping and never else, so that no old program commands drives switched on anew.
    program: Option<Box<Interpolator>>,
    sample: Sample,
    command_mm: [f64; JOINTS_MAX],
    hold: bool,
    /// Backward along the path, at this share of its speed.
    reverse: Option<f64>,
    single_block: bool,
    waiting: Option<Action>,
    fault_seen: bool,
    silenced: bool,
    network_closing: bool,
    cycle: u64,
    orders_taken: u64,
    program_cycles: u64,
    program_has_moved: bool,
    late_max_ns: u64,
    cycles_skipped: u64,
    notices_lost: u64,
    trace_lost: u64,
}

impl<B: Fieldbus> Control<B> {
    /// A machine whose network is down.
    pub fn new(bus: B, parts: Parts, outlets: Outlets) -> Control<B> {
        let joints = parts.drives.iter().len();
        Control {
            bus,
            parts,
            outlets,
            joints,
            state: State::Booting,
            after_stop: AfterStop::Ready,
            program: None,
            sample: Sample::resting(Position::ZERO),
            command_mm: [0.0; JOINTS_MAX],
            hold: false,
            reverse: None,
            single_block: false,
            waiting: None,
            fault_seen: false,
            silenced: false,
            network_closing: false,
            cycle: 0,
            orders_taken: 0,
            program_cycles: 0,
            program_has_moved: false,
            late_max_ns: 0,
            cycles_skipped: 0,
            notices_lost: 0,
            trace_lost: 0,
        }
    }

    /// Makes the cycle of the date `begin_ns` ready, so that its first frame leaves at once when [`Control::cycle`] is called
    /// at that date. Called again before, it moves the cycle to a later date.
    #[cfg_attr(feature = "rtsan", rtsan_standalone::nonblocking)]
    pub fn prepare(&mut self, begin_ns: u64) {
        self.bus.prepare(begin_ns, &self.parts.outputs);
    }

    /// The cycle that was made ready. `late_ns`: how late it begins; `skipped`: cycles that had to be left out before it; the exchange is
    /// over by `deadline_ns`. Gives what the exchange took.
    #[cfg_attr(feature = "rtsan", rtsan_standalone::nonblocking)]
    pub fn cycle(&mut self, late_ns: u64, skipped: u64, deadline_ns: u64) -> CycleReport {
        let report = self.bus.exchange(deadline_ns, &mut self.parts.inputs);
        self.parts
            .drives
            .read(&self.parts.inputs, |node| self.bus.node_state(node));
        self.parts.pins.spindle.see(&self.parts.inputs);
        self.parts.pins.show_inputs(&self.parts.inputs);
        if report.lost > 0 {
            self.parts.homer.doubt();
        }
        self.watch(late_ns, skipped);
        self.take_orders();
        self.step_state();
        self.interpolate();
        self.check_commands();
        self.parts
            .drives
            .write(report.sent_ns, &self.command_mm[..self.joints], &mut self.parts.outputs);
        self.parts.pins.write_outputs(&mut self.parts.outputs);
        self.show();
        self.outlets.diagnosis.attend(self.cycle, &mut self.bus);
        self.cycle += 1;
        report
    }

    /// Shows how the last cycle kept its time.
    #[cfg_attr(feature = "rtsan", rtsan_standalone::nonblocking)]
    pub fn show_timing(&mut self, timing: &Timing) {
        self.parts.pins.show_timing(timing);
    }

    /// The bus, for what is not cyclic between two cycles.
    pub fn bus_mut(&mut self) -> &mut B {
        &mut self.bus
    }

    /// What the machine is doing.
    pub fn state(&self) -> State {
        self.state
    }

    /// Whether the network is up, where nothing is awaited between the end of a cycle and the next one.
    pub fn network_is_up(&self) -> bool {
        self.bus.state() == BusState::Operational
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
        self.silenced = true;
        self.fault(Fault::CycleHung);
    }

    /// Looks for faults: lateness, the bus, the drives.
    fn watch(&mut self, late_ns: u64, skipped: u64) {
        self.late_max_ns = self.late_max_ns.max(late_ns);
        if skipped > 0 {
            self.cycles_skipped += skipped;
            self.fault(Fault::CyclesSkipped { cycles: skipped });
        }
        match self.parts.overruns.count(skipped) {
            Verdict::Fine => {}
            Verdict::Many { skipped: cycles } => self.fault(Fault::ManyOverruns { cycles }),
            Verdict::TooMany { skipped: cycles } => self.fault(Fault::TooManyOverruns { cycles }),
        }
        let in_step = self.sample.turns_s_max.is_some();
        if let Some(counts) = self.parts.pins.spindle.take_slip(in_step) {
            self.fault(Fault::CountsLost { counts, in_step });
        }
        for _ in 0..BUS_EVENTS_PER_CYCLE {
            let Some(event) = self.bus.pop_event() else { break };
            self.notice(Notice::Bus(event));
            match event {
                BusEvent::NodeLost(node) if self.parts.mandatory[node] => {
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
        // Beside the events, of which a burst may lose some.
        if let Some(node) = self.mandatory_node_down() {
            self.fault(Fault::NodeLost { node });
        }
        let mut drives = self.parts.drives.iter().enumerate();
        if let Some(fault) = drives.find_map(|(joint, drive)| drive_fault(joint, drive)) {
            self.fault(fault);
        }
    }

    /// Whether drives are or should be under power.
    fn under_command(&self) -> bool {
        match self.state {
            State::Enabling
            | State::Ready
            | State::Homing
            | State::Jogging
            | State::Running
            | State::Held
            | State::Stopping => true,
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
        let reaction = fault.reaction();
        match reaction {
            Reaction::Count | Reaction::Warn => {
                self.notice(Notice::Fault { fault, first: false });
                return;
            }
            Reaction::ControlledStop | Reaction::QuickStop | Reaction::Silence => {}
        }
        if self.state == State::Booting && fault.is_usual_in_boot() {
            return;
        }
        if !self.fault_seen {
            self.fault_seen = true;
            self.notice(Notice::Fault { fault, first: true });
        } else if reaction == Reaction::ControlledStop {
            // The first cause has set everything going.
            return;
        }
        match (reaction, self.state) {
            (Reaction::Count | Reaction::Warn, _) | (_, State::Faulted | State::ShuttingDown | State::Down) => {}
            (Reaction::Silence, _) => {
                self.end_program();
                self.parts.hand.end();
                self.parts.homer.end();
                self.enter(State::Faulted);
            }
            (Reaction::QuickStop, _) => {
                self.end_program();
                self.parts.hand.end();
                self.parts.homer.end();
                self.quick_stop();
            }
            // To rest on the path first; `step_state` goes on to the quick stop.
            (Reaction::ControlledStop, State::Jogging | State::Running | State::Held | State::Stopping) => {
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

    fn quick_stop(&mut self) {
        self.parts.drives.request(u64::MAX, Request::QuickStop);
        self.enter(State::Faulted);
    }

    /// Brings a machine that moves to rest, on its path if it has one; `step_state` goes on from there.
    fn stop_then(&mut self, then: AfterStop) {
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
        if let Some(program) = &mut self.program {
            // A hold cannot act there: the spindle has the say. A tap is followed out of the work first.
            program.give_up_sync();
        }
        self.after_stop = if self.state == State::Stopping {
            self.after_stop.max(then)
        } else {
            then
        };
        self.enter(State::Stopping);
    }

    /// Goes on from rest, as the wish was or as the fault wants it.
    fn after_stop(&mut self) {
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

    fn switch_off(&mut self, next: State) {
        self.parts.pins.all_off();
        self.parts.drives.request(u64::MAX, Request::Disable);
        self.enter(next);
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
                self.home(joints);
            }
            (Command::Jog(order), State::Ready | State::Jogging) => self.jog(&order),
            (Command::Start(program), State::Ready) if self.parts.drives.all(|drive| drive.is_homed()) => {
                self.start(program);
            }
            (Command::Start(program), _) => self.give_back(program),
            (Command::Hold, State::Running) => self.hold = true,
            (Command::Hold, State::Jogging) => self.parts.hand.release_all(),
            (Command::Resume, State::Running | State::Held) => {
                self.run_along(None);
                if let Some(Action::ProgramStop | Action::OptionalStop) = self.waiting {
                    self.end_wait();
                }
            }
            (Command::Reverse(share), State::Running | State::Held) => self.run_along(Some(share)),
            (Command::SingleBlock(on), _) => {
                self.single_block = on;
                if let Some(program) = &mut self.program {
                    program.set_single_block(on);
                }
            }
            (Command::Stop, State::Jogging | State::Running | State::Held) => self.stop_then(AfterStop::Ready),
            (Command::Disable, State::Jogging | State::Running | State::Held | State::Stopping) => {
                self.stop_then(AfterStop::Disable)
            }
            (Command::Stop | Command::Disable, State::Homing) if self.parts.homer.is_active() => {
                self.stop_then(AfterStop::Disable);
            }
            // A drive that homes is on no path: it stops by its own ramp.
            (Command::Stop, State::Homing) | (Command::Disable, State::Enabling | State::Ready | State::Homing) => {
                self.switch_off(State::Disabling)
            }
            // A control that was silenced stays so: only a new one is known to be sound.
            (Command::Acknowledge, State::Faulted) if !self.silenced => {
                self.fault_seen = false;
                self.parts.overruns.clear();
                self.parts.drives.request(u64::MAX, Request::ResetFault);
                self.enter(State::Disabling);
            }
            (Command::ShutDown, State::ShuttingDown | State::Down) => {}
            (Command::ShutDown, State::Jogging | State::Running | State::Held | State::Stopping) => {
                self.stop_then(AfterStop::ShutDown)
            }
            (Command::ShutDown, State::Homing) if self.parts.homer.is_active() => {
                self.stop_then(AfterStop::ShutDown);
            }
            // The network follows once the drives are without power: see `step_state`.
            (Command::ShutDown, _) => self.switch_off(State::ShuttingDown),
            (Command::Enable, _)
            | (Command::Home(_), _)
            | (Command::Jog(_), _)
            | (Command::Hold, _)
            | (Command::Resume, _)
            | (Command::Reverse(_), _)
            | (Command::Stop, _)
            | (Command::Disable, _)
            | (Command::Acknowledge, _) => {}
        }
    }

    /// Homes joints side by side, each by its drive or by the control.
    fn home(&mut self, joints: u64) {
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
    fn see_homing(&mut self) {
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
    fn start(&mut self, mut program: Box<Interpolator>) {
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
            self.give_back(program);
            self.fault(Fault::IllegalCommand { joint });
            return;
        }
        program.set_single_block(self.single_block);
        self.program = Some(program);
        self.hold = false;
        self.reverse = None;
        self.waiting = None;
        self.program_cycles = 0;
        self.program_has_moved = false;
        self.sample.state = SampleState::Starved;
        self.enter(State::Running);
    }

    /// Goes on after whatever held the program: forward, or backward with a share of the speed. In single block that is the next
    /// block, backward the one before.
    fn run_along(&mut self, reverse: Option<f64>) {
        self.hold = false;
        self.reverse = reverse;
        if let Some(program) = &mut self.program {
            program.next_block();
        }
        if self.state == State::Held {
            self.enter(State::Running);
        }
    }

    /// Moves joints by hand, if they and those that move with them know where they are, and no hold is asked for.
    fn jog(&mut self, order: &JogOrder) {
        let together = self.parts.hand.moved_with(order.joints);
        let mut drives = self.parts.drives.iter().enumerate();
        let homed = drives.all(|(joint, drive)| together >> joint & 1 == 0 || drive.is_homed());
        let held = self.parts.pins.is_feed_hold();
        match (order.motion, self.state) {
            (JogMotion::Run { .. } | JogMotion::Advance { .. }, _) if !homed || held => return,
            (JogMotion::Run { .. } | JogMotion::Advance { .. }, State::Ready) => {
                for (command_mm, drive) in self.command_mm.iter_mut().zip(self.parts.drives.iter()) {
                    *command_mm = drive.command_mm();
                }
                self.parts.hand.begin(&self.command_mm[..self.joints], order);
                self.enter(State::Jogging);
            }
            // Neither a renewal nor a release begins anything.
            (JogMotion::Keep | JogMotion::Release, State::Ready) => return,
            (JogMotion::Run { .. } | JogMotion::Advance { .. } | JogMotion::Keep | JogMotion::Release, _) => {}
        }
        self.parts.hand.obey(order);
    }

    /// Goes on to the next state where the drives and the network are ready for it.
    fn step_state(&mut self) {
        if self.state == State::Homing && self.parts.homer.is_active() {
            self.see_homing();
        }
        let all = |wanted: Status| self.parts.drives.all(|drive| drive.status() == wanted);
        match self.state {
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
            State::Running if self.hold && self.at_rest() => self.enter(State::Held),
            State::Running if self.sample.state == SampleState::Finished => {
                self.end_program();
                self.enter(State::Ready);
            }
            State::Stopping if self.at_rest() => self.after_stop(),
            State::Disabling if self.drives_off() => self.enter(if self.network_up() {
                State::Disabled
            } else {
                State::Booting
            }),
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
            | State::Down => {}
        }
    }

    /// Joints that are homed (bit n: joint n).
    fn homed(&self) -> u64 {
        let joints = self.parts.drives.iter().enumerate();
        joints.fold(0, |mask, (joint, drive)| mask | u64::from(drive.is_homed()) << joint)
    }

    fn drives_off(&self) -> bool {
        self.parts.drives.all(Drive::is_off)
    }

    fn network_up(&self) -> bool {
        self.bus.state() == BusState::Operational && self.mandatory_node_down().is_none()
    }

    /// The first node without which the machine cannot run and that is not operational.
    fn mandatory_node_down(&self) -> Option<NodeIndex> {
        let mut nodes = self.parts.mandatory.iter().enumerate();
        nodes
            .find(|&(node, &mandatory)| mandatory && self.bus.node_state(node) != NodeState::Operational)
            .map(|(node, _)| node)
    }

    fn at_rest(&self) -> bool {
        let (hand, homer) = (&self.parts.hand, &self.parts.homer);
        self.program.as_ref().is_none_or(|program| program.is_at_rest())
            && (!hand.is_active() || hand.is_at_rest())
            && (!homer.is_active() || homer.is_at_rest())
    }

    fn end_program(&mut self) {
        self.parts.pins.all_off();
        let Some(program) = self.program.take() else { return };
        self.give_back(program);
        self.waiting = None;
        let joints = &self.command_mm[..self.joints];
        let position = self.parts.kinematics.forward(&ToolFrame::OFF, joints);
        self.sample = Sample::resting(position.unwrap_or(self.sample.position));
        self.notice(Notice::ProgramEnded);
    }

    /// Next set-points of all joints.
    fn interpolate(&mut self) {
        let wanted = match self.state {
            State::Running if !self.hold => Shares {
                all: self.reverse.map_or(1.0, |share| -share),
                ..self.parts.pins.shares(&self.outlets.live.overrides)
            },
            _ => Shares::all(0.0),
        };
        if let Some(program) = &mut self.program {
            if program.is_probing() {
                let measured = self.parts.drives.measured(&self.parts.kinematics, &self.sample);
                program.see_probe(self.parts.pins.probe_input(), &measured);
            }
            let shares = Shares {
                turning: self.parts.pins.spindle.feed_share(),
                ..wanted
            };
            self.sample = program.step_shares(&shares, &self.parts.pins.spindle.place());
            self.program_cycles += 1;
            // Whoever runs block by block, or back, says when it goes on.
            self.hold |= program.is_block_over() || program.is_way_back_over();
            self.program_has_moved |= self.sample.state == SampleState::Moving;
            self.parts.pins.spindle.steer(&self.sample);
            let in_step = program.take_sync_report();
            let held = self.parts.pins.spindle.take_held();
            // A ramp to rest may just reach the end of a move: what stands behind it, a spindle say, must not begin then.
            if !wanted.hold(self.sample.enables)
                && self.waiting.is_none()
                && let Some(action) = self.sample.action
            {
                self.waiting = Some(action);
                self.notice(Notice::Action(action));
                self.parts.pins.begin_action(action);
            }
            let joints = &mut self.command_mm[..self.joints];
            let inverse = self
                .parts
                .kinematics
                .inverse(&self.sample.frame, &self.sample.position.0, joints);
            if let Err(unreachable) = inverse {
                // The joints stay where they are; the planner should have refused the move.
                self.fault(Fault::IllegalCommand {
                    joint: unreachable.joint,
                });
            }
            if let Some(share) = held {
                let line = self.sample.line;
                self.notice(Notice::SpindleHeld { line, share });
            }
            if let Some((line, report)) = in_step {
                self.notice(Notice::InStep { line, report });
            }
            // A move that was ended by a stop has no fault of its own.
            if let Some(fault) = self.sample.fault.filter(|&fault| fault != SyncFault::Aborted) {
                self.fault(Fault::OutOfStep { fault });
            }
        } else {
            let by_hand = self.parts.hand.is_active();
            if by_hand {
                if self.parts.pins.is_feed_hold() {
                    self.parts.hand.release_all();
                }
                self.parts.hand.step(&mut self.command_mm[..self.joints]);
                if let Some(obstruction) = self.parts.hand.take_obstruction() {
                    self.notice(Notice::Obstructed(obstruction));
                }
            } else {
                self.stay_or_home();
            }
            let joints = &self.command_mm[..self.joints];
            let position = self.parts.kinematics.forward(&ToolFrame::OFF, joints);
            self.sample = Sample::resting(position.unwrap_or(self.sample.position));
            if by_hand {
                self.sample.velocity_mm_s = self.parts.hand.speed_mm_s();
            } else if self.parts.homer.is_active() {
                self.sample.velocity_mm_s = self.parts.homer.speed_mm_s();
            }
        }
        if let Some(action) = self.waiting
            && self.parts.pins.action_done(action)
        {
            if let Action::ChangeTool { tool } | Action::SetTool { tool } = action {
                self.outlets.live.set_tool(tool);
            }
            self.end_wait();
        } else if let Some(late) = self.parts.pins.spindle.late().filter(|_| self.program.is_some()) {
            self.fault(Fault::SpindleLate { late });
        }
        (self.parts.pins).follow_overrides(&self.outlets.live.overrides, self.sample.enables);
    }

    /// Each joint stays where it was told to be, but for those that home by the control.
    fn stay_or_home(&mut self) {
        let parts = &mut self.parts;
        let homing = parts.homer.under_way();
        for (joint, (command_mm, drive)) in self.command_mm.iter_mut().zip(parts.drives.iter()).enumerate() {
            if homing >> joint & 1 == 0 {
                *command_mm = drive.command_mm();
            }
        }
        if homing != 0 {
            let command_mm = &mut self.command_mm[..self.joints];
            parts.homer.step(&parts.drives, &parts.pins, command_mm);
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
        let scaling = match &self.program {
            Some(program) => program.is_scaling(),
            None if self.parts.hand.is_active() => self.parts.hand.is_stopping(),
            None if self.parts.homer.is_active() => self.parts.homer.is_stopping(),
            None => {
                self.parts.monitor.restart();
                return;
            }
        };
        let homing = self.parts.homer.under_way();
        let mut watched_mm = self.command_mm;
        if homing != 0 {
            // Joints that home by their drives are led by these, and count anew at the end.
            for (joint, watched_mm) in watched_mm.iter_mut().enumerate() {
                if homing >> joint & 1 == 0 {
                    *watched_mm = 0.0;
                }
            }
        }
        if let Some(trip) = self.parts.monitor.see(&watched_mm[..self.joints], scaling) {
            self.fault(match trip {
                Trip::NotFinite { joint } => Fault::IllegalCommand { joint },
                Trip::Over {
                    joint,
                    order,
                    value,
                    limit,
                } => Fault::LimitExceeded {
                    joint,
                    order,
                    value,
                    limit,
                },
            });
        }
        let mut beyond = None;
        for (joint, (command_mm, drive)) in self.command_mm.iter_mut().zip(self.parts.drives.iter()).enumerate() {
            let (position_mm, [low_mm, high_mm]) = (*command_mm, drive.travel_mm());
            if !position_mm.is_finite() {
                *command_mm = drive.command_mm();
            } else if homing != 0 {
                // Travel has no meaning before a joint is homed; its search is bounded by distances.
            } else if position_mm < low_mm - TRAVEL_SLACK_MM || position_mm > high_mm + TRAVEL_SLACK_MM {
                beyond = beyond.or(Some(Fault::SoftLimit { joint, position_mm }));
            }
        }
        if let Some(fault) = beyond {
            self.fault(fault);
        }
    }

    /// Tells everyone else what happened.
    fn show(&mut self) {
        self.parts
            .pins
            .publish(&mut self.bus, &self.parts.drives, &self.sample, self.state);
        let (elapsed_s, remaining_s) = match &self.program {
            Some(program) => (self.program_cycles as f64 * self.parts.cycle_s, program.remaining_s()),
            None => (0.0, 0.0),
        };
        self.outlets.live.show(&Snapshot {
            state: self.state,
            enables: self.sample.enables,
            orders_taken: self.orders_taken,
            cycles: self.cycle,
            homed: self.homed(),
            line: self.sample.line,
            reversing: self.reverse.is_some(),
            single_block: self.single_block,
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
                actual: self
                    .parts
                    .kinematics
                    .forward(&self.sample.frame, &actual_mm[..self.joints])
                    .unwrap_or(self.sample.position),
                line: self.sample.line,
                rapid: self.sample.rapid,
                following_error_mm,
                starved: self.program_has_moved && self.sample.state == SampleState::Starved,
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
            })
        }
        Status::Disabled | Status::Enabling | Status::Homing | Status::Disabling | Status::QuickStopping => None,
    }
}
