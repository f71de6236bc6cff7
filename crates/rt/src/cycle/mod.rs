//! The cycle: what happens every millisecond, as a table of contents.
//!
//! In:  answers of the nodes, orders, the plan in the ring.
//! Out: set-points for the nodes; pins, notices and trace records for everyone else.
//!
//! Orders are obeyed in `orders.rs`; faults and stops are in `stops.rs`; set-points are made in `set_points.rs`, and what a program
//! wants beside motion is done in `actions.rs`.
//!
//! RT: nothing in [`MotionController::cycle`] allocates, locks, waits for another thread or touches a file; every loop is
//! bounded by the number of nodes, joints or ring slots. Budget in `benches/cycle.rs`.

mod actions;
mod by_hand;
mod laps;
mod orders;
mod outlets;
mod run;
mod set_points;
mod show;
mod states;
mod stops;

pub use laps::{Laps, Part};
pub use outlets::RtEndpoints;

use super::drives::{Drive, Drives};
use super::homing::Homer;
use super::io_pins::{InputPins, OutputPins};
use super::machine_pins::MachinePins;
use super::nodes::Nodes;
use super::shared::{Command, Notice, Phase, Snapshot, TimedNotice, Trace};
use crate::analog::AnalogDrives;
use crate::cycle_stats::Timing;
use crate::desk::DeskPins;
use crate::estop_chain::EstopChain;
use crate::feed_pins::FeedPins;
use crate::jog_pins::JogPins;
use crate::joint_jog::{JogMotion, JogOrder, JointJog};
use crate::logic::Ports;
use crate::overrides::Overridden;
use crate::plc::Plc;
use crate::probe::Probe;
use crate::spindle::Spindles;
use crate::steps::StepDrives;
use crate::tool_changer::ToolChanger;
use crate::waiting::Waiting;
use crate::way_back::{Place, Progress, WayBack};
use bus::{BusEvent, BusState, CycleReport, CyclicBus, InputImage, NodeState, OutputImage};
use by_hand::Continuation;
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
use run::Run;

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

/// What a machine file makes of a machine.
pub struct CycleParts {
    /// Payloads to the nodes.
    pub outputs: OutputImage,
    /// Payloads from the nodes.
    pub inputs: InputImage,
    pub nodes: Nodes,
    /// Joints and their drives.
    pub drives: Drives,
    /// Those of the drives that are not on the bus.
    pub steps: StepDrives,
    pub analog: AnalogDrives,
    /// Axes to joints.
    pub kinematics: Kinematics,
    /// Watches what leaves for the joints.
    pub monitor: Monitor,
    /// Moves joints by hand.
    pub hand: JointJog,
    /// Wheels and keys for that.
    pub jog: JogPins,
    /// Brings joints back to the path.
    pub way_back: WayBack,
    /// Homes joints whose drives do not.
    pub homer: Homer,
    pub probe: Probe,
    pub spindles: Spindles,
    pub changer: ToolChanger,
    /// Inputs for which programs wait.
    pub program_inputs: InputPins,
    /// Outputs that programs set.
    pub program_outputs: OutputPins,
    /// What scales the speed of programs.
    pub feed: FeedPins,
    pub desk: DeskPins,
    pub estop: EstopChain,
    pub plc: Plc,
    /// What is shown of the machine.
    pub pins: MachinePins,
    /// Counts cycles left out.
    pub overruns: Overruns,
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
    program: Option<Run>,
    sample: Sample,
    command_mm: [f64; JOINTS_MAX],
    single_block: bool,
    /// Closed limit switches: lower, upper (bit n: joint n).
    limits: [u64; 2],
    switched_off: u64,
    fault_seen: bool,
    network_closing: bool,
    cycle: u64,
    orders_taken: u64,
    late_max_ns: u64,
    cycles_skipped: u64,
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
        MotionController {
            joints: parts.drives.iter().len(),
            parts,
            outlets,
            state: State::Booting,
            after_stop: AfterStop::Ready,
            program: None,
            sample: Sample::resting(Position::ZERO),
            command_mm: [0.0; JOINTS_MAX],
            single_block: false,
            limits: [0; 2],
            switched_off: 0,
            fault_seen: false,
            network_closing: false,
            cycle: 0,
            orders_taken: 0,
            late_max_ns: 0,
            cycles_skipped: 0,
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
        &mut self.parts.plc.logic
    }

    /// What the machine is doing.
    pub fn state(&self) -> State {
        self.state
    }

    /// Notices that found their ring full.
    pub fn notices_lost(&self) -> u64 {
        self.outlets.notices_lost
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
        self.outlets.trace_lost
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
        if self.parts.nodes.are_awaited(&self.parts.inputs) {
            // The same commands once more.
            self.bus.publish(self.cycle);
            self.cycle += 1;
            return report;
        }
        self.parts.steps.read(report.sent_ns, &mut self.parts.inputs);
        self.parts.analog.read(&mut self.parts.inputs);
        let (bus, analog, nodes) = (&self.bus, &self.parts.analog, self.parts.nodes.count());
        let state = |node| match node < nodes {
            true => bus.node_state(node),
            false => analog
                .node_of(node)
                .map_or(NodeState::Operational, |node| bus.node_state(node)),
        };
        self.parts.drives.read(&self.parts.inputs, state);
        let spindle = &mut self.parts.spindles.first;
        spindle.read_drive(&self.parts.inputs, |node| self.bus.node_state(node));
        self.laps.end(Part::Drives);
        spindle.update_feedback(&self.parts.inputs);
        self.parts.nodes.show_inputs(&self.parts.inputs);
        self.parts.program_inputs.look();
        self.parts.changer.look();
        self.parts.plc.run_before_motion(skipped);
        self.laps.end(Part::Pins);
        if report.lost > 0 {
            self.parts.homer.input_lost();
        }
        self.watch(late_ns, skipped);
        self.parts.drives.leave_out(skipped);
        self.take_orders();
        self.step_state();
        self.see_continuation();
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
        (self.parts.spindles.first).lead_drive(report.sent_ns, may_turn, &mut self.parts.outputs);
        self.parts.steps.write(&self.parts.outputs);
        self.laps.end(Part::Drives);
        self.parts.pins.show_steps(&self.parts.steps);
        self.show();
        let may_replace = self.may_replace_logic();
        self.parts.plc.run_after_motion(skipped, may_replace);
        self.parts.nodes.write_outputs(may_turn, &mut self.parts.outputs);
        self.parts.spindles.first.write(&mut self.parts.outputs);
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
}
