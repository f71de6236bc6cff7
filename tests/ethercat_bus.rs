//! The bus on virtual time, with simulated drives of `ethercat::sub` at the other end.

use crate::segment_wire;

use ethercat::sub::models::{DriveModel, digital_terminal};
use ethercat::sub::{ClockConfig, IdealMotor, SubDeviceConfig};
use ethercat::wire::register::AlState;
use ethercat::wire::sii::Identity as SiiIdentity;
use isocnc::bus::ethercat::Ethercat;
use isocnc::bus::ethercat::open::new;
use isocnc::bus::ethercat::setup::{devices, network, tables};
use isocnc::bus::service::{Diagnose, Mailbox, MailboxError, MailboxRequest};
use isocnc::bus::watch::Watch;
use isocnc::bus::{
    self, BusEvent, BusState, CycleReport, CyclicBus, InputImage, Names, NodeIndex, NodeState, OutputImage,
    ProcessImage, TimeReference,
};
use isocnc::config::{self, Config};
use obd::AbortCode;
use segment_wire::Wire;
use std::path::Path;
use std::sync::Arc;

const CYCLE_NS: u64 = 1_000_000;
const MAC: [u8; 6] = [0x10; 6];
/// Of the simulated drives.
const VENDOR: u32 = 0x0A1B;

/// Two drives and a terminal.
const MACHINE: &str = "\
schema = 1
[machine]
name = \"small\"
kinematics = \"none\"
[bus]
kind = \"ethercat-memory\"
[[bus.node]]
id = 1
name = \"x-drive\"
profile = \"cia402\"
vendor_id = 0x0A1B
device_type = 0x00020192
outputs = [\"0x6040/16\", \"0x6060/8\", \"0x607A/32\"]
inputs = [\"0x6041/16\", \"0x6061/8\", \"0x6064/32\"]
[[bus.node]]
id = 2
name = \"y-drive\"
profile = \"cia402\"
outputs = [\"0x6040/16\", \"0x6060/8\", \"0x607A/32\"]
inputs = [\"0x6041/16\", \"0x6061/8\", \"0x6064/32\"]
[[bus.node]]
id = 3
name = \"terminal\"
profile = \"io\"
outputs = [\"0x6200:1/8\"]
inputs = [\"0x6000:1/8\"]
";

/// Two drives whose clocks drift apart, and a terminal without one.
fn small_wire() -> Wire {
    let drive = |gain_ppb, start_ns| SubDeviceConfig {
        clock: Some(ClockConfig {
            gain_ppb,
            start_ns,
            wide: true,
        }),
        ..DriveModel::default()
            .build(vec![Box::new(IdealMotor::default())])
            .expect("a drive")
    };
    let terminal = digital_terminal(SiiIdentity {
        vendor: 2,
        product: 0x88,
        revision: 1,
        serial: 0,
    });
    Wire::new([drive(20_000, 7), drive(-30_000, 1_300_007), terminal])
}

fn read(text: &str) -> Config {
    config::parse(text, Path::new("m.toml")).unwrap_or_else(|errors| panic!("{errors}"))
}

type Bus<'a> = Ethercat<'a, Wire, 8, 2>;

/// Cycles of a bus.
struct Rig<'a> {
    bus: Box<Bus<'a>>,
    outputs: OutputImage,
    inputs: InputImage,
    date_ns: u64,
    cycle: u64,
    report: CycleReport,
    events: Vec<BusEvent>,
}

impl Rig<'_> {
    /// So many cycles; the dates follow the clock of the bus as those of the cycle thread do.
    fn run(&mut self, cycles: u32) {
        for _ in 0..cycles {
            self.bus.serve(self.date_ns - 100_000);
            self.bus.prepare(self.date_ns, &self.outputs);
            let link = self.bus.link_mut();
            link.now_ns = self.date_ns;
            link.segment.poll(self.date_ns);
            self.report = self.bus.exchange(self.date_ns + CYCLE_NS - 100_000, &mut self.inputs);
            let shift_ns = match self.report.time {
                TimeReference::Bus { late_ns } => -late_ns / 16,
                TimeReference::Ours | TimeReference::Unheard => 0,
            };
            while let Some(event) = self.bus.pop_event() {
                self.events.push(event);
            }
            self.bus.publish(self.cycle);
            self.cycle += 1;
            self.date_ns = (self.date_ns + CYCLE_NS).saturating_add_signed(shift_ns.clamp(-1000, 1000));
        }
    }

    fn node(&self, node: NodeIndex) -> &[u8] {
        self.inputs.payload.node(node)
    }
}

/// A bus of this machine, for the time of a call.
fn with<T>(text: &str, run: impl FnOnce(Rig<'_>, Config) -> T) -> T {
    let config = read(text);
    let plans = bus::plan(&config);
    let tables = tables(&config, &plans);
    let devices = devices(&config, &plans, &tables);
    let network = network(&config, &devices);
    let watch = Arc::new(Watch::default());
    let bus = new::<_, 8, 2>(&config, &network, small_wire(), MAC, watch).expect("it fits");
    let rig = Rig {
        bus: Box::new(bus),
        outputs: ProcessImage::new(plans.iter().map(|plan| plan.outputs.octets)),
        inputs: InputImage::new(plans.iter().map(|plan| plan.inputs.octets)),
        date_ns: 2_000_000,
        cycle: 0,
        report: CycleReport::default(),
        events: Vec::new(),
    };
    run(rig, config.clone())
}

/// As [`with`], operational.
fn operational<T>(run: impl FnOnce(Rig<'_>, Config) -> T) -> T {
    with(MACHINE, |mut rig, config| {
        rig.run(1000);
        assert_eq!(rig.bus.state(), BusState::Operational, "{:?}", rig.events);
        rig.events.clear();
        run(rig, config)
    })
}

#[test]
fn a_network_comes_up_exchanges_data_and_follows_the_clock_of_the_bus() {
    with(MACHINE, |mut rig, _| {
        rig.run(1000);
        assert_eq!(rig.bus.state(), BusState::Operational, "{:?}", rig.events);
        for node in 0..3 {
            assert!(rig.events.contains(&BusEvent::Identified(node)), "{node}");
            assert!(rig.events.contains(&BusEvent::NodeUp(node)), "{node}");
            assert_eq!(rig.bus.node_state(node), NodeState::Operational);
        }
        assert_eq!((rig.report.lost, &rig.inputs.fresh[..]), (0, &[true; 3][..]));
        // Switch on disabled; the terminal hands its outputs on.
        assert_eq!(rig.node(0)[0] & 0x4F, 0x40);
        rig.outputs.node_mut(0)[..3].copy_from_slice(&[0x06, 0, 8]);
        rig.outputs.node_mut(2)[0] = 0xA5;
        rig.run(20);
        assert_eq!((rig.node(0)[0] & 0x6F, rig.node(1)[0] & 0x4F), (0x21, 0x40));
        let late_ns = (0..100).map(|_| {
            rig.run(1);
            match rig.report.time {
                TimeReference::Bus { late_ns } => late_ns,
                other => panic!("nobody leads: {other:?}"),
            }
        });
        let worst_ns = late_ns.map(i64::abs).max();
        assert!(worst_ns < Some(2_000), "{worst_ns:?}");
        let statistics = rig.bus.statistics(0);
        assert!(statistics.lost == 0 && statistics.answers > 100, "{statistics:?}");
    });
}

#[test]
fn one_lost_frame_is_ridden_out_and_never_sent_again() {
    operational(|mut rig, _| {
        let sent = rig.bus.link_mut().sent;
        rig.run(1);
        let usual = rig.bus.link_mut().sent - sent;
        rig.bus.link_mut().lose = 1;
        // Nothing is asked in this cycle but the exchange.
        rig.bus.prepare(rig.date_ns, &rig.outputs);
        let before = rig.bus.link_mut().sent;
        rig.bus.link_mut().now_ns = rig.date_ns;
        let report = rig.bus.exchange(rig.date_ns + CYCLE_NS, &mut rig.inputs);
        assert_eq!((report.lost, rig.bus.link_mut().sent - before), (3, 1), "usual {usual}");
        assert_eq!(&rig.inputs.lost_in_row[..], [1; 3]);
        assert!(report.done_ns <= rig.date_ns + CYCLE_NS / 2);
        assert_eq!(report.time, TimeReference::Unheard);
        rig.date_ns += CYCLE_NS;
        rig.run(20);
        assert_eq!((&rig.inputs.lost_in_row[..], rig.report.lost), (&[0; 3][..], 0));
        assert!(
            !rig.events.iter().any(|event| matches!(event, BusEvent::NodeLost(_))),
            "{:?}",
            rig.events
        );
    });
}

#[test]
fn a_cable_break_is_told_between_two_names_and_the_rest_goes_on() {
    operational(|mut rig, config| {
        let names = Names::new(&config);
        rig.bus.link_mut().segment.cut(1);
        rig.run(200);
        let lost: Vec<&BusEvent> = rig
            .events
            .iter()
            .filter(|event| matches!(event, BusEvent::NodeLost(_)))
            .collect();
        assert_eq!(lost, [&BusEvent::NodeLost(1), &BusEvent::NodeLost(2)]);
        assert_eq!(&rig.inputs.fresh[..], [true, false, false]);
        let told: Vec<String> = rig
            .events
            .iter()
            .filter_map(|event| match event {
                BusEvent::Remark(remark) => Some(remark.text(&names)),
                _ => None,
            })
            .collect();
        let wanted =
            "no link between x-drive (node 1), port 1, and y-drive (node 2): the cable, or power of the latter";
        assert!(told.iter().any(|text| text == wanted), "{told:?}");
        let wanted = "y-drive (node 2) is lost: working counter 0, expected 3: it does not answer";
        assert!(told.iter().any(|text| text == wanted), "{told:?}");
        rig.events.clear();
        rig.bus.link_mut().segment.heal(1);
        rig.run(3000);
        assert!(rig.events.contains(&BusEvent::NodeUp(1)), "{:?}", rig.events);
        assert_eq!((&rig.inputs.fresh[..], rig.report.lost), (&[true; 3][..], 0));
    });
}

#[test]
fn a_drive_that_was_without_power_comes_back_and_the_others_never_leave() {
    operational(|mut rig, _| {
        let now_ns = rig.date_ns;
        rig.bus.link_mut().segment.power_off(1);
        rig.run(50);
        assert!(rig.events.contains(&BusEvent::NodeLost(1)), "{:?}", rig.events);
        rig.bus.link_mut().segment.power_on(1, now_ns + 50 * CYCLE_NS);
        rig.run(4000);
        assert!(rig.events.contains(&BusEvent::NodeUp(1)), "{:?}", rig.events);
        assert!(!rig.events.contains(&BusEvent::NodeLost(0)), "{:?}", rig.events);
    });
}

#[test]
fn another_device_or_another_value_is_told_as_on_any_bus() {
    let other = MACHINE.replace("vendor_id = 0x0A1B", "vendor_id = 7");
    with(&other, |mut rig, _| {
        rig.run(300);
        let wanted = BusEvent::WrongIdentity {
            node: 0,
            object: (0x1018, 1),
            expected: 7,
            got: VENDOR,
        };
        assert!(rig.events.contains(&wanted), "{:?}", rig.events);
        assert_eq!(
            (rig.bus.state(), rig.bus.node_state(0)),
            (BusState::Booting, NodeState::Faulted)
        );
    });
    let other = MACHINE.replace("device_type = 0x00020192", "device_type = 0x00030192");
    with(&other, |mut rig, _| {
        rig.run(300);
        let is_told = |event: &BusEvent| {
            let object = (0x1000, 0);
            matches!(event, BusEvent::WrongValue { node: 0, object: of, expected: 0x0003_0192, .. } if *of == object)
        };
        assert!(rig.events.iter().any(is_told), "{:?}", rig.events);
    });
}

#[test]
fn objects_are_read_and_written_while_the_cycle_runs() {
    operational(|mut rig, _| {
        let mut service = rig.bus.service();
        let mut ask = |rig: &mut Rig<'_>, node, index, sub, value: Option<Vec<u8>>| {
            let request = MailboxRequest {
                ticket: 5,
                node,
                index,
                sub,
                value,
            };
            service.request(request).expect("room");
            rig.run(100);
            service.reply().expect("an answer").result
        };
        assert_eq!(ask(&mut rig, 0, 0x1018, 1, None), Ok(VENDOR.to_le_bytes().to_vec()));
        assert_eq!(ask(&mut rig, 1, 0x6065, 0, Some(vec![1, 2, 0, 0])), Ok(Vec::new()));
        assert_eq!(ask(&mut rig, 1, 0x6065, 0, None), Ok(vec![1, 2, 0, 0]));
        let refused = Err(MailboxError::Aborted(AbortCode::NO_OBJECT));
        assert_eq!(ask(&mut rig, 0, 0x5FFF, 0, None), refused);
        assert!(matches!(
            ask(&mut rig, 9, 0x1000, 0, None),
            Err(MailboxError::Failed(_))
        ));
        let node = service.node(0, 0).expect("known");
        assert_eq!(node.identity.expect("known").device_type, 0x0002_0192);
        assert_eq!((node.operational, node.nmt_state.as_str()), (true, "OP"));
        assert!(node.stage.contains("at position 1"), "{}", node.stage);
        assert_eq!(service.network(0).expect("known").nmt_state, "OP");
    });
}

#[test]
fn another_main_device_is_told() {
    operational(|mut rig, _| {
        let mut frame = vec![0xFF; 6];
        frame.extend([0x20, 1, 2, 3, 4, 5, 0x88, 0xA4, 0x0E, 0x10]);
        frame.extend([7, 0x81, 0, 0, 0x30, 1, 2, 0, 0, 0, 0, 0, 0, 0]);
        frame.resize(60, 0);
        let at_ns = rig.date_ns;
        rig.bus.link_mut().answers.push((at_ns, frame));
        rig.run(2);
        let is_told =
            |event: &BusEvent| matches!(event, BusEvent::ForeignMaster(sign) if sign.mac == [0x20, 1, 2, 3, 4, 5]);
        assert!(rig.events.iter().any(is_told), "{:?}", rig.events);
    });
}

#[test]
fn an_orderly_end_leaves_all_devices_in_init() {
    operational(|mut rig, _| {
        rig.bus.shut_down();
        rig.run(5);
        assert_eq!(rig.bus.state(), BusState::Down);
        let states = (0..3).map(|at| rig.bus.link_mut().segment.device(at).state());
        assert_eq!(states.collect::<Vec<_>>(), [AlState::Init; 3]);
        assert_eq!(rig.events.last(), Some(&BusEvent::Network(BusState::Down)));
    });
}

#[test]
fn a_cycle_that_the_frames_do_not_fit_is_refused_with_the_sum() {
    let drive = |id: u32| format!("[[bus.node]]\nid = {id}\nprofile = \"cia402\"\n");
    let text: String = (4..80).map(drive).collect();
    let text = format!("{MACHINE}{text}").replace("name = \"small\"", "name = \"small\"\ncycle_us = 500");
    let refused = bus::check(&read(&text)).expect_err("it does not fit").to_string();
    let sum = "the frames do not fit the cycle of 500 us: 2 frames of";
    assert!(
        refused.contains(sum) && refused.contains("half of the cycle is 250 us"),
        "{refused}"
    );
    assert!(bus::check(&read(&text.replace("cycle_us = 500", "cycle_us = 2000"))).is_ok());
    let parts = bus::budget(&read(MACHINE));
    let total_us: f64 = parts.iter().map(|part| part.worst_us).sum();
    assert_eq!(total_us, bus::worst_exchange_ns(&read(MACHINE)) as f64 / 1e3);
}
