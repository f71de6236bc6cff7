//! The cycle: what happens every millisecond, as a table of contents.
//!
//! In:  answers of the nodes, orders, the plan in the ring.
//! Out: set-points for the nodes; pins, notices and trace records for everyone else.
//!
//! Orders are obeyed in `orders.rs`; faults and stops are in `stops.rs`.
//!
//! RT: nothing in [`MotionController::cycle`] allocates, locks, waits for another thread or touches a file; every loop is
//! bounded by the number of nodes, joints or ring slots. Budget in `benches/cycle.rs`.

mod laps;
mod orders;
mod stops;

pub use laps::{Laps, Part};

use super::drives::{Drive, Drives};
use super::homing::Homer;
use super::pins::Pins;
use super::shared::{Command, Notice, Phase, RtStatus, Snapshot, TimedNotice, Trace};
use crate::analog::AnalogDrives;
use crate::cycle_stats::Timing;
use crate::joint_jog::{JogMotion, JogOrder, JointJog};
use crate::logic::Ports;
use crate::overrides::Overridden;
use crate::steps::StepDrives;
use crate::waiting::Waiting;
use crate::way_back::{Place, Progress, Retract, WayBack};
use bus::{BusEvent, BusState, CycleReport, CyclicBus, InputImage, NodeIndex, NodeState, OutputImage};
use cia402::axis::{AxisFault, Request, Status};
use config::JOINTS_MAX;
use hal_pins::scope::Sampler;
use machine::faults::{EstopCause, Fault, Reaction};
use machine::overruns::{Overruns, Verdict};
use machine::state::State;
use motion::canon::Position;
use motion::element::Action;
use motion::kinematics::{Kinematics, ToolFrame};
use motion::rt::homing::HomingStatus;
use motion::rt::probe::Answer;
use motion::rt::{Interpolator, Monitor, Peaks, Sample, SampleState, Shares, SyncFault, Trip, Watched};
use std::sync::Arc;

/// Orders that are taken in one cycle at the most.
const COMMANDS_PER_CYCLE: usize = 4;
/// Bus events that are passed on in one cycle at the most.
const BUS_EVENTS_PER_CYCLE: usize = 8;

/// Distance between the place where a program begins and the place where a joint stands, mm, that is rounding only.
const START_SLACK_MM: f64 = 1e-6;

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
pub struct RtEndpoints {
    pub commands: rtrb::Consumer<Command>,
    /// Notices; what finds the ring full is counted in [`MotionController::notices_lost`].
    pub notices: rtrb::Producer<TimedNotice>,
    /// One record per cycle of a program.
    pub trace: rtrb::Producer<Trace>,
    /// Programs that are over go back, so that nothing is freed in real time.
    pub finished: rtrb::Producer<Box<Interpolator>>,
    pub live: Arc<RtStatus>,
}

/// What a machine file makes of a machine.
pub struct CycleParts {
    /// Payloads to the nodes.
    pub outputs: OutputImage,
    /// Payloads from the nodes.
    pub inputs: InputImage,
    /// Joints and their drives.
    pub drives: Drives,
    /// Those of the drives that are not on the bus.
    pub steps: StepDrives,
    pub analog: AnalogDrives,
    /// Nodes on the bus.
    pub nodes: usize,
    /// Axes to joints.
    pub kinematics: Kinematics,
    /// Watches what leaves for the joints.
    pub monitor: Monitor,
    /// Moves joints by hand.
    pub hand: JointJog,
    /// Whether the probe stops the hand as it comes into contact.
    pub probe_stops_jog: bool,
    /// Brings joints back to the path.
    pub way_back: WayBack,
    /// Homes joints whose drives do not.
    pub homer: Homer,
    /// The control's pins.
    pub pins: Pins,
    /// What an emergency stop asks of drives.
    pub estop: Request,
    /// What to do with the tool when the mains fail.
    pub retract: Option<Retract>,
    /// Whether M1 stops, until the operator says otherwise.
    pub optional_stop: bool,
    /// Counts cycles left out.
    pub overruns: Overruns,
    /// For each node: whether the machine cannot run without it.
    pub mandatory: Box<[bool]>,
    /// Nothing goes on while a node has missed up to so many answers in a row; 0: everything does.
    pub waits_for_answers: u32,
    /// Cycle time, s.
    pub cycle_s: f64,
}

/// Everything that the cycle thread owns.
///
/// What a cycle does is compiled once, for any bus.
pub struct MotionController<B: ?Sized = dyn CyclicBus> {
    parts: CycleParts,
    outlets: RtEndpoints,
    joints: usize,

    state: State,
    after_stop: AfterStop,
    /// Present while running, held or stopping and never else, so that no old program commands drives switched on again.
    program: Option<Box<Interpolator>>,
    /// It is a line of MDI.
    is_mdi: bool,
    sample: Sample,
    command_mm: [f64; JOINTS_MAX],
    hold: bool,
    /// Backward along the path, at this share of its speed.
    reverse: Option<f64>,
    single_block: bool,
    optional_stop: bool,
    /// Where the program is held while the machine is elsewhere.
    away_from: Option<Place>,
    /// Whether the probe was in contact in the last cycle, and is in this one.
    probe_in_contact: [bool; 2],
    /// It is to return there, once the hand is off.
    goes_back: bool,
    /// The tool is to leave the work behind the stop.
    retracts: bool,
    waiting: Option<Action>,
    /// An override or a switch lets feed or rapid moves rest.
    is_fed_nothing: bool,
    /// Closed limit switches: lower, upper (bit n: joint n).
    limits: [u64; 2],
    switched_off: u64,
    fault_seen: bool,
    network_closing: bool,
    cycle: u64,
    orders_taken: u64,
    program_cycles: u64,
    program_has_moved: bool,
    late_max_ns: u64,
    cycles_skipped: u64,
    notices_lost: u64,
    trace_lost: u64,
    laps: Laps,
    /// Shows pins to those who watch them cycle by cycle.
    scope: Option<Sampler>,
    /// Date of the cycle that is made ready.
    begin_ns: u64,
    #[cfg(any(test, feature = "testing"))]
    tampering: Tampering,
    bus: B,
}

/// What a test does to the commands of a cycle, mm.
#[cfg(any(test, feature = "testing"))]
pub type Tamper = dyn FnMut(&mut [f64]) + Send;

/// The same, behind the kinematics, if there is a test that does.
#[cfg(any(test, feature = "testing"))]
#[derive(Default)]
struct Tampering(Option<Box<Tamper>>);

#[cfg(any(test, feature = "testing"))]
impl Tampering {
    fn tamper(&mut self, command_mm: &mut [f64]) {
        if let Some(tamper) = &mut self.0 {
            tamper(command_mm);
        }
    }
}

impl<B: CyclicBus> MotionController<B> {
    /// A machine whose network is down.
    pub fn new(bus: B, parts: CycleParts, outlets: RtEndpoints) -> MotionController<B> {
        let (joints, optional_stop) = (parts.drives.iter().len(), parts.optional_stop);
        MotionController {
            parts,
            outlets,
            joints,
            state: State::Booting,
            after_stop: AfterStop::Ready,
            program: None,
            is_mdi: false,
            sample: Sample::resting(Position::ZERO),
            command_mm: [0.0; JOINTS_MAX],
            hold: false,
            reverse: None,
            single_block: false,
            optional_stop,
            away_from: None,
            goes_back: false,
            probe_in_contact: [false; 2],
            retracts: false,
            waiting: None,
            is_fed_nothing: false,
            limits: [0; 2],
            switched_off: 0,
            fault_seen: false,
            network_closing: false,
            cycle: 0,
            orders_taken: 0,
            program_cycles: 0,
            program_has_moved: false,
            late_max_ns: 0,
            cycles_skipped: 0,
            notices_lost: 0,
            trace_lost: 0,
            laps: Laps::default(),
            scope: None,
            begin_ns: 0,
            #[cfg(any(test, feature = "testing"))]
            tampering: Tampering::default(),
            bus,
        }
    }

    /// The bus, for what is not cyclic between two cycles.
    pub fn bus_mut(&mut self) -> &mut B {
        &mut self.bus
    }

    /// The same, whichever bus it is on.
    fn on_any_bus(&mut self) -> &mut MotionController<dyn CyclicBus + '_> {
        self
    }

    /// Makes the cycle of the date `begin_ns` ready.
    pub fn prepare(&mut self, begin_ns: u64) {
        self.on_any_bus().prepare(begin_ns);
    }

    /// Serves what is not cyclic, until `until_ns`.
    pub fn serve(&mut self, until_ns: u64) {
        self.on_any_bus().serve(until_ns);
    }

    /// The cycle that was made ready.
    pub fn cycle(&mut self, late_ns: u64, skipped: u64, deadline_ns: u64) -> CycleReport {
        self.on_any_bus().cycle(late_ns, skipped, deadline_ns)
    }

    /// Whether the network is up, where nothing is awaited between the end of a cycle and the next one.
    pub fn network_is_up(&mut self) -> bool {
        self.on_any_bus().network_is_up()
    }

    /// The cycle thread was taken for hung: no frame may leave any more.
    pub fn inhibit_soc(&mut self) {
        self.on_any_bus().inhibit_soc();
    }
}

impl<B: ?Sized> MotionController<B> {
    /// Shows how the last cycle kept its time.
    #[cfg_attr(feature = "rtsan", rtsan_standalone::nonblocking)]
    pub fn show_timing(&mut self, timing: &Timing) {
        self.parts.pins.show_timing(timing);
        self.outlets.live.times.record(timing);
    }

    /// From now on pins are sampled at the end of each cycle, for those who ask for it.
    pub fn set_scope(&mut self, scope: Sampler) {
        self.scope = Some(scope);
    }

    /// Joints with step pulses, before the first cycle.
    pub fn steps_mut(&mut self) -> &mut StepDrives {
        &mut self.parts.steps
    }

    /// Programs in Structured Text, before the first cycle.
    pub fn logic_mut(&mut self) -> &mut Ports {
        &mut self.parts.pins.logic
    }

    /// What the machine is doing.
    pub fn state(&self) -> State {
        self.state
    }

    /// Notices that found their ring full.
    pub fn notices_lost(&self) -> u64 {
        self.notices_lost
    }

    /// From now on `tamper` changes the commands of every cycle, mm, before they are looked at: to prove that what is wrong with them does not
    /// leave.
    #[cfg(any(test, feature = "testing"))]
    pub fn tamper_with_commands(&mut self, tamper: Box<Tamper>) {
        self.tampering = Tampering(Some(tamper));
    }

    /// From now on the parts of each cycle are timed.
    pub fn time_parts(&mut self) {
        self.laps = Laps::timed();
    }

    /// What the parts of the cycles have taken since [`MotionController::time_parts`].
    pub fn laps(&self) -> &Laps {
        &self.laps
    }

    /// Trace records that found their ring full.
    pub fn trace_lost(&self) -> u64 {
        self.trace_lost
    }

    /// Greatest velocities, accelerations and jerks commanded to the joints by programs.
    pub fn peaks(&self) -> Vec<Peaks> {
        self.parts.monitor.peaks().map(|(_, peaks)| *peaks).collect()
    }
}

impl MotionController<dyn CyclicBus + '_> {
    /// Makes the cycle of the date `begin_ns` ready, so that its first frame leaves at once when [`MotionController::cycle`] is called
    /// at that date. Called again before, it moves the cycle to a later date.
    #[cfg_attr(feature = "rtsan", rtsan_standalone::nonblocking)]
    pub fn prepare(&mut self, begin_ns: u64) {
        self.laps.begin();
        self.begin_ns = begin_ns;
        self.bus.prepare(begin_ns, &self.parts.outputs);
        self.laps.end(Part::Bus);
    }

    /// Serves what is not cyclic, until `until_ns`.
    #[cfg_attr(feature = "rtsan", rtsan_standalone::nonblocking)]
    pub fn serve(&mut self, until_ns: u64) {
        self.laps.begin();
        self.bus.serve(until_ns);
        self.laps.end(Part::Bus);
    }

    /// The cycle that was made ready. `late_ns`: how late it begins; `skipped`: cycles that had to be left out before it; the exchange is
    /// over by `deadline_ns`. Gives what the exchange took.
    #[cfg_attr(feature = "rtsan", rtsan_standalone::nonblocking)]
    pub fn cycle(&mut self, late_ns: u64, skipped: u64, deadline_ns: u64) -> CycleReport {
        self.laps.begin();
        let report = self.bus.exchange(deadline_ns, &mut self.parts.inputs);
        self.laps.end(Part::Bus);
        let lost_in_row = self.parts.inputs.lost_in_row.iter().max().copied().unwrap_or(0);
        if (1..=self.parts.waits_for_answers).contains(&lost_in_row) {
            // Who was not heard may have heard nothing: the same commands once more.
            self.bus.publish(self.cycle);
            self.cycle += 1;
            return report;
        }
        self.parts.steps.read(report.sent_ns, &mut self.parts.inputs);
        self.parts.analog.read(&mut self.parts.inputs);
        let (bus, analog, nodes) = (&self.bus, &self.parts.analog, self.parts.nodes);
        let state = |node| match node < nodes {
            true => bus.node_state(node),
            false => analog
                .node_of(node)
                .map_or(NodeState::Operational, |node| bus.node_state(node)),
        };
        self.parts.drives.read(&self.parts.inputs, state);
        (self.parts.pins.spindle).read_drive(&self.parts.inputs, |node| self.bus.node_state(node));
        self.laps.end(Part::Drives);
        self.parts.pins.spindle.update_feedback(&self.parts.inputs);
        self.parts.pins.show_inputs(&self.parts.inputs);
        self.parts.pins.inputs.look();
        self.parts.pins.see_prepared_tool();
        self.parts.pins.logic.publish();
        self.parts.pins.external.take(skipped);
        self.parts.pins.components.run_before_motion(skipped);
        self.laps.end(Part::Pins);
        if report.lost > 0 {
            self.parts.homer.input_lost();
        }
        self.watch(late_ns, skipped);
        self.parts.drives.leave_out(skipped);
        self.take_orders();
        self.step_state();
        self.laps.end(Part::Orders);
        self.interpolate();
        self.laps.end(Part::Interpolation);
        self.check_commands();
        self.laps.end(Part::Monitor);
        self.parts.pins.turn_loops(&mut self.parts.drives);
        self.parts
            .drives
            .write(report.sent_ns, &self.command_mm[..self.joints], &mut self.parts.outputs);
        let may_turn = self.under_command();
        (self.parts.pins.spindle).lead_drive(report.sent_ns, may_turn, &mut self.parts.outputs);
        self.parts.steps.write(&self.parts.outputs);
        self.laps.end(Part::Drives);
        self.parts.pins.show_steps(&self.parts.steps);
        self.show();
        self.parts.pins.components.run_after_motion(skipped);
        let may_replace = self.may_replace_logic();
        self.parts.pins.logic.sample(skipped, may_replace);
        self.parts.pins.external.give();
        self.parts.pins.write_outputs(may_turn, &mut self.parts.outputs);
        self.parts.analog.write(&mut self.parts.outputs);
        if let Some(scope) = &mut self.scope {
            scope.sample(self.begin_ns);
        }
        self.laps.end(Part::Pins);
        self.bus.publish(self.cycle);
        self.laps.end(Part::Bus);
        self.cycle += 1;
        report
    }

    /// Whether the network is up, where nothing is awaited between the end of a cycle and the next one.
    pub fn network_is_up(&self) -> bool {
        self.bus.state() == BusState::Operational
    }

    /// The cycle thread was taken for hung: no frame may leave any more.
    pub fn inhibit_soc(&mut self) {
        if !matches!(self.state, State::Silenced | State::Down) {
            self.fault(Fault::CycleHung);
        }
    }

    /// Goes on to the next state where the drives and the network are ready for it.
    fn step_state(&mut self) {
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
                if self.goes_back {
                    self.parts.hand.begin_to_go(&self.command_mm[..self.joints]);
                    self.parts.way_back.begin();
                    self.enter(State::Returning);
                }
            }
            State::Returning => self.go_back(),
            State::Running if self.hold && self.at_rest() => self.enter(State::Held),
            State::Running if self.sample.state == SampleState::Finished => {
                if !self.is_mdi {
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
            State::Estop if self.parts.pins.is_enable_requested() && self.chain_opened_by().is_none() => {
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
    fn homed(&self) -> u64 {
        let joints = self.parts.drives.iter().enumerate();
        joints.fold(0, |mask, (joint, drive)| mask | u64::from(drive.is_homed()) << joint)
    }

    fn drives_off(&self) -> bool {
        self.parts.drives.all(Drive::is_off) && self.parts.pins.spindle.is_drive_off()
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
            && !self.parts.monitor.is_stopping()
    }

    /// Gives the program up: spindle and coolant off.
    fn end_program(&mut self) {
        self.all_off();
        self.let_program_go();
    }

    /// Spindle and coolant off, and whoever goes by what lines of MDI have switched on hears of it.
    fn all_off(&mut self) {
        self.parts.pins.all_off();
        self.switched_off += 1;
    }

    fn let_program_go(&mut self) {
        let Some(program) = self.program.take() else { return };
        self.give_back(program);
        self.waiting = None;
        self.away_from = None;
        self.reverse = None;
        let joints = &self.command_mm[..self.joints];
        let position = self.parts.kinematics.forward(&ToolFrame::OFF, joints);
        self.sample = Sample::resting(position.unwrap_or(self.sample.position));
        self.notice(Notice::ProgramEnded);
    }

    /// Next set-points of all joints.
    fn interpolate(&mut self) {
        let [_, before] = self.probe_in_contact;
        self.probe_in_contact = [before, self.parts.pins.probe_input()];
        let wanted = match self.state {
            State::Running if !self.hold => Shares {
                all: self.reverse.map_or(1.0, |share| -share),
                ..self.parts.pins.shares(&self.outlets.live.overrides)
            },
            _ => Shares::all(0.0),
        };
        let overrides = &self.outlets.live.overrides;
        self.is_fed_nothing = wanted.hold(self.sample.enables)
            || [Overridden::Feed, Overridden::Rapid]
                .map(|what| overrides.percent(what))
                .contains(&0.0);
        if self.away_from.is_some() {
            self.move_by_hand();
        } else if let Some(program) = &mut self.program {
            if program.is_probing() {
                let measured = self.parts.drives.measured(&self.parts.kinematics, &self.sample);
                let latched = self.parts.drives.touched(&self.parts.kinematics, &self.sample);
                // The probe may be wired to the drives alone: what all of them have latched is a contact, whatever the pin shows. For a
                // move towards the work it stays one, as a contact may bounce within a cycle.
                let [touched, released] = latched;
                let by_drives = touched.is_some() && (released.is_none() || program.is_probing_towards());
                let in_contact = self.probe_in_contact[1] || by_drives;
                program.see_probe(in_contact, &measured);
                program.see_latches(latched);
            } else {
                self.parts.drives.arm_touch_probes();
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
            if let Some(outputs) = &self.sample.outputs {
                self.parts.pins.outputs.set(outputs);
            }
            if let Some(action) = self.sample.on_the_way {
                self.notice(Notice::Action(action));
                self.begin_action(action);
            }
            // A ramp to rest may just reach the end of a move: what stands behind it, a spindle say, must not begin then.
            if !wanted.hold(self.sample.enables)
                && self.waiting.is_none()
                && let Some(action) = self.sample.action
            {
                // The switch counts as M1 is reached: what waits then waits until somebody resumes.
                self.waiting = Some(match action {
                    Action::OptionalStop if self.optional_stop => Action::ProgramStop,
                    action => action,
                });
                if let (Action::UserCode { .. }, Some(program)) = (action, &mut self.program) {
                    program.answer(Answer::Reached);
                }
                self.notice(Notice::Action(action));
                self.begin_action(action);
            }
            self.laps.end(Part::Interpolation);
            let joints = &mut self.command_mm[..self.joints];
            let inverse = self
                .parts
                .kinematics
                .inverse(&self.sample.frame, &self.sample.position.0, joints);
            self.laps.end(Part::Kinematics);
            if let Err(unreachable) = inverse {
                // The joints stay where they are; the planner should have refused the move.
                self.fault(Fault::IllegalCommand {
                    joint: unreachable.joint,
                    line: self.sample.line,
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
            self.sample = Sample::resting(self.sample.position);
            self.move_by_hand();
        }
        let has_more = self.program.as_ref().is_some_and(|program| program.has_more());
        if let Some(action) = self.waiting
            && (self.parts.pins.action_done(action) || matches!(action, Action::UserCode { .. }) && has_more)
        {
            match action {
                Action::ChangeTool { tool } | Action::SetTool { tool } => self.tool_is_changed(tool),
                Action::AwaitInput { .. } => {
                    let read = Answer::Input(self.parts.pins.inputs.read());
                    if let Some(program) = &mut self.program {
                        program.answer(read);
                    }
                    self.end_wait();
                }
                _ => self.end_wait(),
            }
        } else if let Some(late) = self.parts.pins.late().filter(|_| self.program.is_some()) {
            self.fault(Fault::SpindleLate { late });
        } else if let Some(failure) = self
            .parts
            .pins
            .spindle
            .orient_failure()
            .filter(|_| self.program.is_some())
        {
            self.fault(Fault::SpindleOrient { failure });
        }
        (self.parts.pins).follow_overrides(&self.outlets.live.overrides, self.sample.enables);
    }

    /// Joints follow the hand, or home, or stay.
    fn move_by_hand(&mut self) {
        let by_hand = self.parts.hand.is_active();
        if by_hand {
            let is_jog = matches!(self.state, State::Jogging | State::Away);
            if is_jog && self.parts.pins.jog.stops_at_once() {
                self.parts.hand.stop();
            } else if self.parts.pins.is_feed_hold() && self.state != State::Stopping
                || is_jog && self.parts.pins.jog.stops()
            {
                self.parts.hand.release_all();
            }
            // Out of a contact that was there before, the hand leads.
            if self.parts.probe_stops_jog && self.probe_in_contact == [false, true] {
                self.parts.hand.stop();
                // A way back is given up there.
                self.goes_back = false;
                self.notice(Notice::Touched);
            }
            self.parts.hand.step(&mut self.command_mm[..self.joints]);
            if let Some(obstruction) = self.parts.hand.take_obstruction() {
                self.goes_back = false;
                self.notice(Notice::Obstructed(obstruction));
            }
        } else {
            self.stay_or_home();
        }
        let joints = &self.command_mm[..self.joints];
        if let Some(position) = self.parts.kinematics.forward(&self.sample.frame, joints) {
            self.sample.position = position;
        }
        self.sample.velocity_mm_s = match () {
            () if by_hand => self.parts.hand.speed_mm_s(),
            () if self.parts.homer.is_active() => self.parts.homer.speed_mm_s(),
            () => 0.0,
        };
    }

    /// The next leg of the way back, or its end.
    fn go_back(&mut self) {
        let Some(place) = &self.away_from else { return };
        if !self.goes_back {
            if self.parts.hand.is_at_rest() {
                self.parts.hand.end();
                self.enter(State::Away);
            }
            return;
        }
        if self.parts.pins.is_feed_hold() {
            self.parts.way_back.interrupt();
            return;
        }
        let overrides = &self.outlets.live.overrides;
        let shares = [Overridden::Rapid, Overridden::Feed].map(|what| overrides.share(what).min(1.0));
        match self.parts.way_back.step(place, &mut self.parts.hand, shares) {
            Progress::Moving => {}
            Progress::There => {
                self.parts.hand.end();
                self.away_from = None;
                self.enter(State::Held);
            }
            Progress::Elsewhere => {
                self.goes_back = false;
                self.parts.hand.end();
                self.notice(Notice::NoWayBack);
                self.enter(State::Away);
            }
        }
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

    fn begin_action(&mut self, action: Action) {
        if let Action::SelectTool { tool } = action {
            self.parts
                .pins
                .prepare_tool(tool, self.outlets.live.pockets.pocket(tool));
        }
        self.parts.pins.begin_action(action);
    }

    fn tool_is_changed(&mut self, tool: u32) {
        self.outlets.live.set_tool(tool);
        self.notice(Notice::ToolChanged { tool });
        self.end_wait();
    }

    /// What a program that stands still, or probes, waits for.
    fn waits_for(&self) -> Option<Waiting> {
        if self.state == State::Away {
            return Some(Waiting::Return);
        }
        self.program.as_ref().filter(|_| self.state == State::Running)?;
        if let Some(action) = self.waiting {
            return Waiting::of(action);
        }
        let rests = self.sample.velocity_mm_s == 0.0;
        match self.sample.state {
            SampleState::Moving | SampleState::Starved if rests && self.is_fed_nothing => Some(Waiting::Feed),
            _ if self.program.as_ref().is_some_and(|program| program.is_probing()) => Some(Waiting::Probe),
            _ if self.program.as_ref().is_some_and(|program| program.is_dwelling()) => Some(Waiting::Dwell),
            SampleState::Starved if self.program_has_moved => Some(Waiting::Queue),
            _ => None,
        }
    }

    fn end_wait(&mut self) {
        self.waiting = None;
        if let Some(program) = &mut self.program {
            program.acknowledge_action();
        }
    }

    /// The last look at what leaves for the drives: numbers, inside the travel, within the limits. What is not does not leave.
    fn check_commands(&mut self) {
        #[cfg(any(test, feature = "testing"))]
        self.tampering.tamper(&mut self.command_mm[..self.joints]);
        let command_mm = &mut self.command_mm[..self.joints];
        let scaling = match &self.program {
            Some(program) if self.away_from.is_none() => program.is_scaling(),
            _ if self.parts.hand.is_active() => self.parts.hand.is_stopping(),
            _ if self.parts.homer.is_active() => self.parts.homer.is_stopping(),
            _ => {
                self.stay();
                return;
            }
        };
        let homing = self.parts.homer.under_way();
        // Joints that home by their drives are led by these, and count again at the end. Travel has no meaning before a joint is homed: its
        // search is bounded by distances, and the hand goes as far as the travel is long.
        let drives = self.parts.drives.iter().enumerate();
        let homed = drives.fold(0, |mask, (joint, drive)| mask | u64::from(drive.is_homed()) << joint);
        let watched = Watched {
            moving: if homing != 0 { homing } else { u64::MAX },
            within_travel: if homing != 0 { 0 } else { homed },
        };
        let trip = self.parts.monitor.watch(command_mm, watched, scaling);
        if self.parts.monitor.holds_back()
            && let Some(position) = self.parts.kinematics.forward(&self.sample.frame, command_mm)
        {
            self.sample.position = position;
        }
        if let Some(trip) = trip {
            let line = self.program.as_ref().map_or(0, |_| self.sample.line);
            self.fault(match trip {
                Trip::NotFinite { joint } => Fault::IllegalCommand { joint, line },
                Trip::Beyond { joint, position } => Fault::SoftLimit {
                    joint,
                    position_mm: position,
                    line,
                },
                Trip::Over {
                    joint,
                    order,
                    value,
                    limit,
                } => Fault::LimitExceeded {
                    joint,
                    line,
                    order,
                    value,
                    limit,
                },
            });
        }
    }

    /// Nothing moves: each joint is told what it was told before, whatever the commands say.
    fn stay(&mut self) {
        let mut elsewhere = None;
        for (joint, (command_mm, drive)) in self.command_mm.iter_mut().zip(self.parts.drives.iter()).enumerate() {
            if *command_mm != drive.command_mm() {
                elsewhere = elsewhere.or(Some(joint));
                *command_mm = drive.command_mm();
            }
        }
        self.parts.monitor.rest_at(&self.command_mm[..self.joints]);
        if let Some(joint) = elsewhere {
            self.fault(Fault::IllegalCommand { joint, line: 0 });
        }
    }

    /// Tells everyone else what happened.
    fn show(&mut self) {
        self.parts
            .pins
            .publish(&mut self.bus, &self.parts.drives, &self.sample, self.state);
        self.parts.pins.show_fault(self.fault_seen);
        let (elapsed_s, remaining_s) = match &self.program {
            Some(program) => (self.program_cycles as f64 * self.parts.cycle_s, program.remaining_s()),
            None => (0.0, 0.0),
        };
        for (joint, drive) in self.parts.drives.iter().enumerate() {
            self.outlets.live.show_place(joint, drive.place());
        }
        self.outlets.live.show(&Snapshot {
            state: self.state,
            enables: self.sample.enables,
            orders_taken: self.orders_taken,
            cycles: self.cycle,
            homed: self.homed(),
            line: self.sample.line,
            modes: self.sample.modes,
            reversing: self.program.is_some() && self.reverse.is_some(),
            single_block: self.single_block,
            optional_stop: self.optional_stop,
            velocity_mm_s: self.sample.velocity_mm_s,
            position: self.sample.position,
            late_max_ns: self.late_max_ns,
            cycles_skipped: self.cycles_skipped,
            remaining_s,
            way: self.program.as_ref().map_or(0.0, |program| program.way()),
            elapsed_s,
            waiting: self.waits_for(),
            switched_off: self.switched_off,
            jog_barred: self.parts.pins.is_jog_barred(),
            chain_open: self.chain_opened_by().is_some(),
            held_at: self.away_from.map(|place| place.axes),
            piece_end: self.program.as_ref().and_then(|program| program.piece_end()),
            limits: self.limits,
        });
        if self.program.is_some() {
            let phase = match self.sample.state {
                _ if self.away_from.is_some() || self.state == State::Held => Phase::Hold,
                SampleState::Moving if self.sample.rapid => Phase::Rapid,
                SampleState::Moving => Phase::Cut,
                _ => Phase::Wait,
            };
            self.outlets.live.count_phase(phase);
        }
        if self.program.is_some() && self.away_from.is_none() {
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
                joint: self.parts.drives.trace(self.outlets.live.traced_joint()),
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
