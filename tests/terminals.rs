//! A coupler with terminals on EtherCAT, through the control and on virtual time: what hangs at them is read and written by channels, and
//! a terminal that is missing, in another place or of another kind is named.

use crate::segment_wire;

use ethercat::sub::models::{analog_terminal, coupler, digital_terminal};
use ethercat::sub::{SubDeviceConfig, Terminal};
use ethercat::wire::sii::Identity;
use isocnc::bus::ethercat::Ethercat;
use isocnc::bus::ethercat::open::new;
use isocnc::bus::ethercat::setup::{devices, network, tables};
use isocnc::bus::watch::Watch;
use isocnc::bus::{
    self, BusEvent, BusState, CycleReport, CyclicBus, InputImage, NodeIndex, NodeState, NodeStatistics, OutputImage,
};
use isocnc::config::{self, Config};
use isocnc::machine::state::State;
use isocnc::operator::console::Operator;
use isocnc::operator::rehearsal::{Rehearsal, rehearse_on};
use isocnc::sim::near_end::VirtualTime;
use segment_wire::Wire;
use std::path::Path;
use std::sync::Arc;

const MAC: [u8; 6] = [0x10; 6];
/// Products of the terminals.
const DIGITAL: u32 = 0x0BB8;
const ANALOG: u32 = 0x0FA0;

/// Two digital terminals and two analog ones behind a coupler, which the file leaves out.
const MACHINE: &str = r#"
schema = 1
[machine]
name = "cabinet"
kinematics = "none"
[bus]
kind = "ethercat-memory"
[[bus.node]]
id = 2
name = "panel"
profile = "io"
vendor_id = 2
product_code = 0x0BB8
outputs = ["0x6200:1/8"]
inputs = ["0x6000:1/8"]
[[bus.node.channel]]
name = "door-closed"
object = "0x6000:1"
bit = 3
[[bus.node.channel]]
name = "lamp"
object = "0x6200:1"
bit = 6
type = "relay"
[[bus.node]]
id = 3
name = "oven"
profile = "io"
vendor_id = 2
product_code = 0x0FA0
outputs = ["0x7000:1/16", "0x7000:2/16", "0x7000:3/16", "0x7000:4/16"]
inputs = ["0x6000:1/16", "0x6000:2/16", "0x6000:3/16", "0x6000:4/16"]
[[bus.node.channel]]
name = "temperature"
object = "0x6000:2"
type = "analog"
unit = "degC"
scale = 0.1
signed = true
[[bus.node.channel]]
name = "heating"
object = "0x7000:3"
type = "analog"
unit = "%"
scale = 0.0030519
raw_min = 0
[[bus.node]]
id = 4
name = "valves"
profile = "io"
mandatory = false
vendor_id = 2
product_code = 0x0BB8
serial = 4711
outputs = ["0x6200:1/8"]
inputs = ["0x6000:1/8"]
[[bus.node]]
id = 5
name = "gauges"
profile = "io"
mandatory = false
vendor_id = 2
product_code = 0x0FA0
outputs = ["0x7000:1/16", "0x7000:2/16", "0x7000:3/16", "0x7000:4/16"]
inputs = ["0x6000:1/16", "0x6000:2/16", "0x6000:3/16", "0x6000:4/16"]
[[hal.net]]
name = "lamp"
source = "io.2.in-03"
targets = ["io.2.out-06"]
"#;

fn identity(product: u32, serial: u32) -> Identity {
    Identity {
        vendor: 2,
        product,
        revision: 1,
        serial,
    }
}

fn digital(serial: u32) -> SubDeviceConfig {
    digital_terminal(identity(DIGITAL, serial))
}

fn analog() -> SubDeviceConfig {
    analog_terminal(identity(ANALOG, 1)).expect("a terminal")
}

fn head() -> SubDeviceConfig {
    coupler(identity(0x044C, 1))
}

/// A bus whose time passes by the wire.
struct Timed<'a>(Box<Ethercat<'a, Wire, 8, 2>>);

impl CyclicBus for Timed<'_> {
    fn prepare(&mut self, begin_ns: u64, outputs: &OutputImage) {
        self.0.prepare(begin_ns, outputs);
    }

    fn exchange(&mut self, deadline_ns: u64, inputs: &mut InputImage) -> CycleReport {
        self.0.exchange(deadline_ns, inputs)
    }

    fn serve(&mut self, until_ns: u64) {
        self.0.serve(until_ns);
    }

    fn now_ns(&mut self) -> u64 {
        self.0.now_ns()
    }

    fn node_state(&self, node: NodeIndex) -> NodeState {
        self.0.node_state(node)
    }

    fn state(&self) -> BusState {
        self.0.state()
    }

    fn pop_event(&mut self) -> Option<BusEvent> {
        self.0.pop_event()
    }

    fn shut_down(&mut self) {
        self.0.shut_down();
    }

    fn statistics(&self, node: NodeIndex) -> NodeStatistics {
        self.0.statistics(node)
    }

    fn publish(&mut self, cycle: u64) {
        self.0.publish(cycle);
    }
}

impl VirtualTime for Timed<'_> {
    fn advance(&mut self, ns: u64) {
        let wire = self.0.link_mut();
        wire.now_ns += ns;
        wire.segment.poll(wire.now_ns);
    }
}

type Run<'a, 'b> = Rehearsal<'a, Timed<'b>>;

/// A control of the machine that stands by, on a wire with these devices.
fn with<T>(there: Vec<SubDeviceConfig>, act: impl FnOnce(&mut Rehearsal<'_, Timed<'_>>) -> T) -> T {
    let config: Config = config::parse(MACHINE, Path::new("m.toml")).unwrap_or_else(|errors| panic!("{errors}"));
    let plans = bus::plan(&config);
    let tables = tables(&config, &plans);
    let devices = devices(&config, &plans, &tables);
    let network = network(&config, &devices);
    let bus = new::<_, 8, 2>(&config, &network, Wire::new(there), MAC, Arc::new(Watch::default())).expect("it fits");
    rehearse_on(&config, b"", Timed(Box::new(bus)), Operator::standing_by, |run| {
        Ok(act(run))
    })
    .expect("a control")
}

fn reach(run: &mut Run<'_, '_>, done: impl FnMut(&mut Run<'_, '_>) -> bool) {
    let reached = run.run_until(20_000, done).expect("a cycle");
    assert!(reached, "{:#?}", run.operator.journal());
}

fn cycles(run: &mut Run<'_, '_>, count: u64) {
    for _ in 0..count {
        run.cycle(0).expect("a cycle");
    }
}

/// The terminal at a position.
fn terminal<'r>(run: &'r mut Run<'_, '_>, position: usize) -> &'r mut Terminal {
    let segment = &mut run.control.bus_mut().0.link_mut().segment;
    let application = segment.device_mut(position).application_mut();
    application.as_terminal().expect("a terminal")
}

fn word(octets: &[u8], at: usize) -> i16 {
    i16::from_le_bytes([octets[2 * at], octets[2 * at + 1]])
}

#[test]
fn channels_of_all_terminals_behind_a_coupler_are_read_and_written() {
    with(vec![head(), digital(1), analog(), digital(4711), analog()], |run| {
        reach(run, |run| run.control.state() == State::Disabled);
        let bit = |run: &Run<'_, '_>, name: &str| run.hal.reader::<bool>(name).expect("a pin").get();
        let float = |run: &Run<'_, '_>, name: &str| run.hal.reader::<f64>(name).expect("a pin").get();
        cycles(run, 5);
        assert!(!bit(run, "io.2.door-closed") && !bit(run, "io.2.lamp"));
        terminal(run, 1).inputs = vec![0b1000];
        // What an analog terminal measures is in its objects.
        let oven = run.control.bus_mut().0.link_mut().segment.device_mut(2).objects_mut();
        oven.preset(0x6000, 2, &(-215_i16).to_le_bytes()).expect("an object");
        run.hal.set("io.3.heating", 50.0).expect("a pin");
        run.hal.set("io.4.out-05", true).expect("a pin");
        run.hal.set("io.5.object-7000-04", 60_000_u32).expect("a pin");
        cycles(run, 5);
        assert!(bit(run, "io.2.door-closed") && bit(run, "io.2.in-03"));
        // A net leads from the door to the lamp of the same terminal.
        assert_eq!(terminal(run, 1).outputs, [0b0100_0000]);
        let temperature = float(run, "io.3.temperature");
        assert!((temperature + 21.5).abs() < 1e-9, "{temperature}");
        let heated = word(&terminal(run, 2).outputs, 2);
        assert_eq!(heated, (50.0_f64 / 0.003_051_9).round() as i16);
        assert_eq!(terminal(run, 3).outputs, [0b0010_0000]);
        assert_eq!(word(&terminal(run, 4).outputs, 3) as u16, 60_000);
        // What stands in the one terminal has nothing to do with the others.
        assert_eq!(word(&terminal(run, 4).outputs, 2), 0);
    });
}

/// What the journal has after some seconds with these devices on the wire.
fn journal(there: Vec<SubDeviceConfig>) -> String {
    with(there, |run| {
        run.run_until(10_000, |_| false).expect("a cycle");
        let entries = run.operator.journal().iter();
        entries.map(|entry| format!("{}\n", entry.text)).collect()
    })
}

#[test]
fn a_terminal_that_is_missing_moved_or_swapped_is_named() {
    let all = journal(vec![head(), digital(1), analog(), digital(4711), analog()]);
    assert!(all.contains("gauges (node 5) operational"), "{all}");
    assert!(!all.contains("missing") && !all.contains("another device"), "{all}");
    // The last one is not there.
    let missing = journal(vec![head(), digital(1), analog(), digital(4711)]);
    let told = "gauges (node 5) is missing: expected vendor 0x00000002, product 0x00000FA0";
    assert!(missing.contains(told), "{missing}");
    // Two have changed their places.
    let swapped = journal(vec![head(), digital(1), digital(4711), analog(), analog()]);
    for told in [
        "oven (node 3) is another device: expected vendor 0x00000002, product 0x00000FA0",
        "valves (node 4) is another device",
    ] {
        assert!(swapped.contains(told), "{told}\n{swapped}");
    }
    // One more stands before the last but one, so that all behind have moved by a place.
    let moved = journal(vec![head(), digital(1), analog(), analog(), digital(4711)]);
    assert!(moved.contains("valves (node 4) is another device"), "{moved}");
    // Nothing of it is where it should be: without coupler, all are one place too early.
    let early = journal(vec![digital(1), analog(), digital(4711), analog()]);
    for told in [
        "panel (node 2)",
        "oven (node 3)",
        "valves (node 4)",
        "gauges (node 5) is missing",
    ] {
        assert!(early.contains(told), "{told}\n{early}");
    }
}
