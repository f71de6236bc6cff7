//! Another bus than POWERLINK carries a whole machine: power-on, homing, a program, a fault, recovery.
//!
//! The bus is a table of CiA 402 devices whose objects are copied from and to the images in each cycle. Its drives are where
//! their set-points say. Nothing here knows of frames, and nothing of the control of this bus.

use cia402::device::{DRIVE_OBJECTS, Delays, Demand, Device, Sensors};
use isocnc::bus::layout::{Field, Layout};
use isocnc::bus::plan::NodePlan;
use isocnc::bus::{
    self, BusEvent, BusState, CycleReport, CyclicBus, InputImage, NodeIndex, NodeState, NodeStatistics, OutputImage,
    TimeReference,
};
use isocnc::config::{self, Config, HomingBy, Profile};
use isocnc::machine::sequence::Outcome;
use isocnc::machine::state::State;
use isocnc::operator::rehearsal::{Rehearsal, rehearse_on};
use isocnc::sim::near_end::VirtualTime;
use obd::Dictionary;
use std::collections::VecDeque;
use std::path::Path;

const ENTRIES: usize = obd::lines_of(DRIVE_OBJECTS);
const OCTETS: usize = obd::octets_of(DRIVE_OBJECTS);
const MACHINE: &str = include_str!("../configs/mill3-demo.toml");
const PART: &str = "G21 G90 G94 G54\nG0 X30 Y40 Z-5\nG1 X60 Y45 F3000\nG3 X60 Y65 J10\nM2\n";
/// What the bus takes of each cycle, ns.
const EXCHANGE_NS: u64 = 50_000;

struct Drive {
    objects: Dictionary<ENTRIES, OCTETS>,
    device: Device,
    demand: Demand,
}

impl Drive {
    /// One cycle of a drive that follows without a lag.
    fn cycle(&mut self, period_ns: u64) {
        let sensors = Sensors {
            position: self.demand.position.round() as i64,
            velocity: self.demand.velocity.round() as i64,
            ..Sensors::default()
        };
        let held = self.demand.position;
        self.demand = self.device.cycle(&mut self.objects, &sensors, period_ns > 0);
        if !self.demand.powered {
            self.demand.position = held;
        }
    }
}

/// The whole bus. Time passes by [`VirtualTime::advance`] and by what an exchange takes.
struct Table {
    now_ns: u64,
    period_ns: u64,
    plans: Vec<NodePlan>,
    /// `None`: a node that keeps its outputs and has no inputs of its own.
    drives: Vec<Option<Drive>>,
    events: VecDeque<BusEvent>,
    outputs: Option<OutputImage>,
    pulled: Option<NodeIndex>,
    state: BusState,
}

impl Table {
    fn new(config: &Config) -> Table {
        let plans = bus::plan(config);
        let period_ns = u64::from(config.cycle_us) * 1000;
        let drive = || {
            let mut objects = Dictionary::new(&[DRIVE_OBJECTS]).expect("a dictionary");
            // A drive that is homed where it stands.
            let method = objects.find(0x6098, 0).expect("6098h");
            objects.set_octets(method, &37_i8.to_le_bytes()).expect("a method");
            let device = Device::new(&objects, period_ns as u32, Delays::default()).expect("a drive");
            Drive {
                objects,
                device,
                demand: Demand::default(),
            }
        };
        let nodes = &config.bus.nodes;
        let mut events: VecDeque<_> = (0..nodes.len())
            .flat_map(|node| [BusEvent::Identified(node), BusEvent::NodeUp(node)])
            .collect();
        events.push_back(BusEvent::Network(BusState::Operational));
        Table {
            now_ns: 0,
            period_ns,
            plans,
            drives: nodes
                .iter()
                .map(|node| (node.profile == Profile::Cia402).then(drive))
                .collect(),
            events,
            outputs: None,
            pulled: None,
            state: BusState::Operational,
        }
    }
}

fn for_each(layout: &Layout, mut act: impl FnMut(Field, usize)) {
    layout
        .fields
        .iter()
        .for_each(|field| act(*field, usize::from(field.object.bits / 8)));
}

impl CyclicBus for Table {
    fn prepare(&mut self, _begin_ns: u64, outputs: &OutputImage) {
        self.outputs = Some(outputs.clone());
    }

    fn exchange(&mut self, _deadline_ns: u64, inputs: &mut InputImage) -> CycleReport {
        let sent_ns = self.now_ns;
        let outputs = self.outputs.take();
        let mut lost = 0;
        for (node, plan) in self.plans.iter().enumerate() {
            let there = self.pulled != Some(node);
            inputs.fresh[node] = there;
            inputs.lost_in_row[node] = if there { 0 } else { inputs.lost_in_row[node] + 1 };
            lost += u32::from(!there);
            let (Some(drive), Some(outputs), true) = (&mut self.drives[node], &outputs, there) else {
                continue;
            };
            for_each(&plan.outputs, |field, octets| {
                let handle = drive
                    .objects
                    .find(field.object.index, field.object.sub)
                    .expect("an object");
                let value = &outputs.node(node)[field.offset..field.offset + octets];
                drive.objects.set_octets(handle, value).expect("its length");
            });
            drive.cycle(self.period_ns);
            for_each(&plan.inputs, |field, octets| {
                let handle = drive
                    .objects
                    .find(field.object.index, field.object.sub)
                    .expect("an object");
                inputs.payload.node_mut(node)[field.offset..field.offset + octets]
                    .copy_from_slice(drive.objects.octets(handle));
            });
        }
        self.now_ns += EXCHANGE_NS;
        CycleReport {
            sent_ns,
            started_ns: Some(sent_ns),
            done_ns: self.now_ns,
            lost,
            time: TimeReference::Ours,
        }
    }

    fn serve(&mut self, _until_ns: u64) {}

    fn now_ns(&mut self) -> u64 {
        self.now_ns
    }

    fn node_state(&self, node: NodeIndex) -> NodeState {
        if self.pulled == Some(node) {
            NodeState::Faulted
        } else {
            NodeState::Operational
        }
    }

    fn state(&self) -> BusState {
        self.state
    }

    fn pop_event(&mut self) -> Option<BusEvent> {
        self.events.pop_front()
    }

    fn shut_down(&mut self) {
        self.state = BusState::Down;
        self.events.push_back(BusEvent::Network(BusState::Down));
    }

    fn statistics(&self, _node: NodeIndex) -> NodeStatistics {
        NodeStatistics::default()
    }

    fn publish(&mut self, _cycle: u64) {}
}

impl VirtualTime for Table {
    fn advance(&mut self, ns: u64) {
        self.now_ns += ns;
    }
}

fn machine() -> Config {
    let mut config = config::parse(MACHINE, Path::new("mill3-demo.toml")).unwrap_or_else(|errors| panic!("{errors}"));
    for joint in &mut config.joints {
        if let HomingBy::Drive { method, .. } = &mut joint.homing.by {
            *method = 37;
        }
    }
    config
}

#[test]
fn a_program_is_homed_run_and_ended() {
    let config = machine();
    rehearse_on(
        &config,
        PART.as_bytes(),
        Table::new(&config),
        |operator| operator,
        |run| {
            assert_eq!(run.run(120_000)?, Outcome::Completed, "{:#?}", run.operator.journal());
            // G54 of the demo machine lies at X 20, Y 20, Z -60; its drives count 10,000 to a mm from where they were homed.
            let wanted = [80.0, 85.0, -65.0];
            let told = run.operator.live().position.0;
            for axis in 0..3 {
                let drive = run.control.bus_mut().drives[axis].as_ref().expect("a drive");
                assert!((told[axis] - wanted[axis]).abs() < 1e-6, "axis {axis}: {}", told[axis]);
                assert_eq!(drive.demand.position, 10_000.0 * wanted[axis], "axis {axis}");
            }
            Ok(())
        },
    )
    .expect("a run");
}

/// Runs to the middle of the program, lets something go wrong there, and gives the alarm of the machine that has stopped.
fn alarm_of(go_wrong: impl FnOnce(&mut Table)) -> String {
    let config = machine();
    let cut = |run: &mut Rehearsal<'_, Table>| run.control.state() == State::Running && run.operator.live().line == 3;
    rehearse_on(
        &config,
        PART.as_bytes(),
        Table::new(&config),
        |operator| operator,
        |run| {
            assert!(run.run_until(60_000, cut)?, "{:#?}", run.operator.journal());
            go_wrong(run.control.bus_mut());
            let stopped = run.run_until(10_000, |run| run.control.state() == State::Faulted)?;
            assert!(stopped, "{:#?}", run.operator.journal());
            Ok(run.operator.alarm().expect("an alarm").cause.clone())
        },
    )
    .expect("a run")
}

#[test]
fn a_node_that_is_lost_stops_the_machine() {
    let alarm = alarm_of(|bus| {
        bus.pulled = Some(1);
        bus.events.push_back(BusEvent::NodeLost(1));
    });
    assert!(alarm.contains("lost"), "{alarm}");
}

#[test]
fn a_fault_of_a_drive_stops_the_machine() {
    let alarm = alarm_of(|bus| {
        let drive = bus.drives[0].as_mut().expect("a drive");
        drive.device.raise_fault(cia402::device::ERROR_FOLLOWING);
    });
    assert!(alarm.contains("8611h"), "{alarm}");
}
