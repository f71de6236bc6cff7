//! The managing node and controllers of this project against the simulated machine, on virtual time.

use super::{Disturbance, NetConfig, SimMachine, VirtualNet, test_config};
use cia402::axis::{Axis, AxisConfig, AxisFault, Feedback, HomingState, Request, Status};
use cia402::profile::State;
use config::{Config, Mapped, Node, Profile};
use host::setup::STACK_SIZE;
use obd::cdc::CdcWriter;
use obd::mapping::MappingEntry;
use powerlink::link::Link;
use powerlink::link::pcap::{PcapReader, PcapWriter};
use powerlink::mn::{Assignment, BootTimes, Mn, MnConfig, NodeConfig, NodeState, Step};
use powerlink::nmt::NmtState;
use powerlink::wire::NetTime;
use std::hash::{DefaultHasher, Hasher};
use std::sync::{Arc, Mutex};

const MS: u64 = 1_000_000;
const X: usize = 0;
const IO: usize = 3;

/// Octets of a PDO.
fn octets(mapped: &[Mapped]) -> u16 {
    mapped.iter().map(|object| u16::from(object.bits) / 8).sum()
}

/// The concise DCF of a node: cycle, mapping of both PDOs.
fn configuration(node: &Node, cycle_us: u32) -> Vec<u8> {
    let mut buffer = vec![0; 2000];
    let mut writer = CdcWriter::new(&mut buffer).unwrap();
    writer.push(0x1006, 0, &cycle_us.to_le_bytes()).unwrap();
    for (index, mapped) in [(0x1600, &node.outputs), (0x1A00, &node.inputs)] {
        writer.push(index, 0, &[0]).unwrap();
        let mut bit_offset = 0;
        for (sub, object) in (1..).zip(mapped) {
            let (index_of, sub_of, bit_length) = (object.index, object.sub, u16::from(object.bits));
            let entry = MappingEntry {
                index: index_of,
                sub: sub_of,
                bit_offset,
                bit_length,
            };
            writer.push(index, sub, &entry.to_u64().to_le_bytes()).unwrap();
            bit_offset += bit_length;
        }
        writer.push(index, 0, &[mapped.len() as u8]).unwrap();
    }
    writer.finish().to_vec()
}

/// A control in miniature: managing node, one controller for each drive, outputs of the I/O node.
struct Rig {
    net: VirtualNet,
    mn: Mn<'static, 4>,
    axes: Vec<Axis>,
    /// Commanded positions, counts.
    commanded: [i64; 3],
    /// Following errors as the drives show them, counts.
    following_errors: [i32; 3],
    outputs: [u8; 2],
    inputs: [u8; 2],
    next_cycle_ns: u64,
    /// Whether each node's inputs came in the last cycle.
    fresh: [bool; 4],
}

impl Rig {
    fn new(net: NetConfig) -> Rig {
        Rig::with(test_config(), net)
    }

    fn with(config: Config, net: NetConfig) -> Rig {
        let nodes: Vec<NodeConfig<'static>> = config
            .bus
            .nodes
            .iter()
            .map(|node| NodeConfig {
                id: node.id,
                assignment: Assignment {
                    mandatory: node.mandatory,
                    ..Assignment::default()
                },
                pres_timeout_ns: node.pres_timeout_us * 1000,
                identity: powerlink::mn::Identity {
                    device_type: node.identity.device_type,
                    ..powerlink::mn::Identity::default()
                },
                preq_bytes: octets(&node.outputs),
                pres_bytes: octets(&node.inputs),
                configuration: configuration(node, config.cycle_us).leak(),
                ..NodeConfig::default()
            })
            .collect();
        let boot = BootTimes {
            wait_not_active_us: 10_000,
            wait_pre_op_1_us: 10_000,
            reset_pause_us: 10_000,
            ..BootTimes::default()
        };
        let mn = Mn::new(MnConfig {
            cycle_ns: config.cycle_us * 1000,
            async_slot_timeout_ns: config.bus.async_slot_timeout_us * 1000,
            boot,
            pres_lost_max: config.bus.pres_lost_max,
            nodes: nodes.leak(),
            mac: [0x02, 0, 0, 0, 0, 0xF0],
            ..MnConfig::default()
        })
        .unwrap();
        let drives = config
            .bus
            .nodes
            .iter()
            .filter(|node| node.profile == Profile::Cia402)
            .count();
        Rig {
            net: VirtualNet::new(SimMachine::new(&config).unwrap(), net),
            mn,
            axes: (0..drives).map(|_| Axis::new(AxisConfig::default())).collect(),
            commanded: [0; 3],
            following_errors: [0; 3],
            outputs: [0; 2],
            inputs: [0; 2],
            next_cycle_ns: 0,
            fresh: [false; 4],
        }
    }

    /// One bus cycle; a cycle that begins late puts off those after it.
    fn cycle(&mut self) {
        let mut buffer = [0; 1514];
        let start_ns = self.next_cycle_ns.max(self.net.now_ns());
        while let Some(received) = self.net.receive(&mut buffer, start_ns).unwrap() {
            self.mn.receive(self.net.now_ns(), &buffer[..received.length]);
        }
        self.mn.start_cycle(
            self.net.now_ns(),
            NetTime {
                seconds: 0,
                nanoseconds: 0,
            },
        );
        self.next_cycle_ns = start_ns + MS;
        loop {
            match self.mn.poll(self.net.now_ns()) {
                Step::Send(frame) => self.net.send(frame).unwrap(),
                Step::WaitUntil(until_ns) => {
                    let deadline_ns = until_ns.min(self.next_cycle_ns);
                    let received = self.net.receive(&mut buffer, deadline_ns).unwrap();
                    match received {
                        Some(received) => self.mn.receive(self.net.now_ns(), &buffer[..received.length]),
                        None if self.net.now_ns() >= self.next_cycle_ns => return,
                        None => {}
                    }
                }
                Step::IsochronousDone => self.control(),
                Step::Idle => return,
            }
        }
    }

    /// What the control does with the inputs of a cycle.
    fn control(&mut self) {
        let now_ns = self.net.now_ns();
        self.mn.set_outputs_valid(true);
        for (index, axis) in self.axes.iter_mut().enumerate() {
            let online = self.mn.node_state(index) == NodeState::Operational;
            let input = self.mn.input(index);
            self.fresh[index] = input.fresh;
            let data = input.data;
            let word = |at: usize| u16::from_le_bytes([data[at], data[at + 1]]);
            let long = |at: usize| i32::from_le_bytes(data[at..at + 4].try_into().unwrap());
            let feedback = Feedback {
                statusword: word(0),
                position: long(2),
                following_error: long(6),
                mode_display: data[10] as i8,
                digital_inputs: long(11) as u32,
                error_code: word(15),
            };
            self.following_errors[index] = feedback.following_error;
            if axis.status() != Status::Enabled {
                self.commanded[index] = axis.target_position();
            }
            let setpoint = axis.cycle(now_ns, online, &feedback, self.commanded[index]);
            if axis.status() != Status::Enabled {
                self.commanded[index] = axis.target_position();
            }
            let output = self.mn.output_mut(index);
            output[..2].copy_from_slice(&setpoint.controlword.to_le_bytes());
            output[2..6].copy_from_slice(&setpoint.target_position.to_le_bytes());
            output[6] = setpoint.mode as u8;
        }
        self.inputs.copy_from_slice(self.mn.input(IO).data);
        self.mn.output_mut(IO).copy_from_slice(&self.outputs);
    }

    fn cycles(&mut self, cycles: u32) {
        for _ in 0..cycles {
            self.cycle();
        }
    }

    /// Cycles until `done`, at most `cycles`; how many it took.
    fn until(&mut self, cycles: u32, what: &str, mut done: impl FnMut(&Rig) -> bool) -> u32 {
        for cycle in 0..cycles {
            if done(self) {
                return cycle;
            }
            self.cycle();
        }
        panic!("not within {cycles} cycles: {what}; {:?}", self.net);
    }

    fn operational(&self) -> bool {
        self.mn.nmt_state() == NmtState::Operational
            && (0..4).all(|node| self.mn.node_state(node) == NodeState::Operational)
    }

    fn all(&self, status: Status) -> bool {
        self.axes.iter().all(|axis| axis.status() == status)
    }

    /// On a clean wire, with all drives enabled.
    fn enabled() -> Rig {
        let mut rig = Rig::new(NetConfig::clean(1));
        rig.until(1000, "network up", Rig::operational);
        rig.until(200, "drives disabled", |rig| rig.all(Status::Disabled));
        for axis in &mut rig.axes {
            axis.request(Request::Enable);
        }
        rig.until(200, "drives enabled", |rig| rig.all(Status::Enabled));
        rig
    }

    /// As [`Rig::enabled`], and X moves at 100 mm/s.
    fn moving() -> Rig {
        let mut rig = Rig::enabled();
        rig.ramp(200);
        rig
    }

    /// X at 100 mm/s, after 100 cycles of acceleration.
    fn ramp(&mut self, cycles: i64) {
        for cycle in 1..=cycles {
            self.commanded[X] += 10 * cycle.min(100);
            self.cycle();
        }
    }

    fn position_mm(&self, joint: usize) -> f64 {
        self.net.machine().joint_position_mm(joint).unwrap()
    }
}

/// What a simulated machine does in its own thread moves nothing large over the stack, which is locked memory.
#[test]
fn a_machine_is_switched_on_and_a_drive_again_on_a_small_stack() {
    let mut machine = SimMachine::new(&test_config()).expect("a machine");
    let run = move || {
        machine.switch_on(5_000_000);
        machine.power_off(1);
        assert_eq!(machine.nmt_state(1), Some(NmtState::Off));
        machine.power_on(1);
        assert_eq!(machine.nmt_state(1), Some(NmtState::NotActive));
        machine.poll(6_000_000, &mut |_| {});
    };
    let thread = std::thread::Builder::new().stack_size(STACK_SIZE / 8).spawn(run);
    thread.expect("a thread").join().expect("an end");
}

#[test]
fn the_network_comes_up_and_every_node_takes_its_configuration() {
    let mut rig = Rig::new(NetConfig::clean(7));
    let cycles = rig.until(1000, "network up", Rig::operational);
    assert!(cycles < 500, "{cycles}");
    for (position, id) in [(0, 1), (1, 2), (2, 3), (3, 10)] {
        assert_eq!(rig.net.machine().nmt_state(id), Some(NmtState::Operational));
        let statistics = rig.mn.statistics(position);
        let objects = if id == 10 {
            1 + 2 * (2 + 2)
        } else {
            1 + (2 + 4) + (2 + 6)
        };
        assert_eq!(
            (statistics.boots, statistics.objects_written, statistics.faults),
            (1, objects, 0)
        );
    }
    rig.cycles(100);
    assert!((0..4).all(|node| rig.mn.statistics(node).pres_lost == 0));
}

#[test]
fn drives_home_to_where_the_machine_file_puts_the_home_point() {
    let mut rig = Rig::enabled();
    assert_eq!(rig.position_mm(0), -5.0 + 0.37 * 310.0);
    for axis in &mut rig.axes {
        axis.request(Request::Home);
    }
    rig.until(10_000, "homed", |rig| {
        rig.axes.iter().all(|axis| axis.homing() == HomingState::Homed)
    });
    rig.cycles(200);
    for joint in 0..3 {
        let shown_mm = rig.axes[joint].actual_position() as f64 / 10_000.0;
        assert!(
            (shown_mm - rig.position_mm(joint)).abs() < 0.0003,
            "joint {joint}: {shown_mm}"
        );
        assert!(rig.all(Status::Enabled));
    }
}

#[test]
fn the_drive_follows_with_an_error_of_hundredths_of_a_millimetre_and_stops_where_it_should() {
    let mut rig = Rig::moving();
    let start_mm = -5.0 + 0.37 * 310.0;
    // 2 d (1 - f) v / w: 2 · 0.8 · 0.1 · 100 mm/s / (2 π 60 Hz) = 0.0424 mm.
    let error_mm = f64::from(rig.following_errors[X]) / 10_000.0;
    assert!((error_mm - 0.0424).abs() < 0.006, "{error_mm}");
    rig.cycles(500);
    let commanded_mm = rig.commanded[X] as f64 / 10_000.0;
    assert!((rig.position_mm(X) - start_mm - commanded_mm).abs() < 0.0002);
    assert!(rig.all(Status::Enabled));
}

#[test]
fn outputs_switch_contactors_and_inputs_come_back() {
    let mut rig = Rig::enabled();
    rig.outputs = [0b101, 0b1];
    rig.net.at(0, Disturbance::Inputs { node: 10, wired: 0x80 });
    rig.cycles(3);
    assert_eq!(rig.net.machine().outputs(10), Some([0b101, 0b1]));
    assert_eq!(rig.inputs, [0b101, 0x80]);
    rig.net.advance(50 * MS);
    assert_eq!(
        rig.net.machine().outputs(10),
        Some([0, 0]),
        "without a managing node all contactors drop"
    );
}

#[test]
fn one_lost_pres_is_ridden_out() {
    let mut rig = Rig::moving();
    rig.net.machine_mut().drop_pres(1, 1);
    rig.cycle();
    assert!(!rig.fresh[X]);
    rig.ramp(100);
    assert_eq!(rig.mn.statistics(X).pres_lost, 1);
    assert!(rig.operational() && rig.all(Status::Enabled));
}

#[test]
fn five_lost_pres_in_a_row_lose_the_drive_and_it_comes_back() {
    let mut rig = Rig::moving();
    rig.net.machine_mut().drop_pres(1, 5);
    rig.cycles(6);
    assert_eq!(rig.axes[X].status(), Status::Faulted(AxisFault::Lost));
    assert_eq!(rig.axes[1].status(), Status::Enabled, "the others go on");
    rig.until(3000, "back", Rig::operational);
    assert_eq!(
        rig.axes[X].status(),
        Status::Faulted(AxisFault::Lost),
        "but enables nothing by itself"
    );
    rig.axes[X].request(Request::ResetFault);
    rig.until(200, "ready for a new start", |rig| {
        rig.axes[X].status() == Status::Disabled
    });
}

#[test]
fn a_lost_drive_that_is_reset_stops_by_its_ramp_first() {
    let mut rig = Rig::moving();
    rig.net.machine_mut().drop_pres(1, 5);
    let mut states = Vec::new();
    for _ in 0..100 {
        rig.commanded[X] += 1000;
        rig.cycle();
        states.extend(rig.net.machine().drive_state(1));
    }
    states.dedup();
    // SWITCH ON DISABLED is too short to be seen: the reset follows in the same period.
    assert_eq!(
        states[..3],
        [
            State::OperationEnabled,
            State::QuickStopActive,
            State::NotReadyToSwitchOn
        ]
    );
}

#[test]
fn a_drive_switched_off_runs_out_and_boots_again_with_a_new_encoder_zero() {
    let mut rig = Rig::moving();
    let (start_mm, start_ns) = (rig.position_mm(X), rig.net.now_ns());
    rig.net.at(start_ns, Disturbance::PowerOff { node: 1 });
    rig.ramp(10);
    assert_eq!(rig.axes[X].status(), Status::Faulted(AxisFault::Lost));
    assert_eq!(rig.net.machine().nmt_state(1), Some(NmtState::Off));
    rig.cycles(200);
    let run_out_mm = rig.position_mm(X) - start_mm;
    assert!(run_out_mm > 1.0 && run_out_mm < 5.0, "{run_out_mm}");
    let now_ns = rig.net.now_ns();
    rig.net.at(now_ns, Disturbance::PowerOn { node: 1 });
    rig.until(3000, "back", Rig::operational);
    rig.cycles(50);
    assert_eq!(rig.axes[X].actual_position(), 0);
}

#[test]
fn a_pulled_cable_stops_that_drive_by_its_quick_stop_ramp() {
    let mut rig = Rig::moving();
    let start_mm = rig.position_mm(X);
    rig.net.machine_mut().plug(1, false);
    rig.cycles(100);
    assert_eq!(rig.net.machine().drive_state(1), Some(State::SwitchOnDisabled));
    // Five periods on the last target, then from rest of demand: well below v²/2a + 5 ms · v = 2.2 mm.
    let way_mm = rig.position_mm(X) - start_mm;
    assert!(way_mm.abs() < 2.2, "{way_mm}");
    assert_eq!(rig.axes[1].status(), Status::Enabled);
}

#[test]
fn without_a_managing_node_all_drives_quick_stop() {
    let mut rig = Rig::moving();
    rig.net.advance(4 * MS);
    assert_eq!(rig.net.machine().drive_state(1), Some(State::OperationEnabled));
    rig.net.advance(200 * MS);
    for node in 1..=3 {
        assert_eq!(rig.net.machine().drive_state(node), Some(State::SwitchOnDisabled));
    }
    let (before, after) = (rig.position_mm(X), {
        rig.net.advance(100 * MS);
        rig.position_mm(X)
    });
    assert_eq!(before, after);
}

#[test]
fn a_late_cycle_is_ridden_out() {
    let mut rig = Rig::moving();
    rig.net.advance(MS + MS / 2);
    rig.ramp(100);
    assert!(rig.operational() && rig.all(Status::Enabled));
}

#[test]
fn a_drive_fault_comes_up_with_its_code_and_can_be_reset() {
    let mut rig = Rig::moving();
    rig.net.at(
        0,
        Disturbance::DriveFault {
            node: 1,
            error_code: 0x4310,
        },
    );
    rig.until(10, "fault", |rig| {
        rig.axes[X].fault() == Some(AxisFault::Drive { error_code: 0x4310 })
    });
    rig.cycles(100);
    rig.axes[X].request(Request::ResetFault);
    rig.until(50, "reset", |rig| rig.axes[X].status() == Status::Disabled);
    assert!(rig.operational(), "a fault of a drive is no fault of the network");
}

#[test]
fn a_blocked_target_is_a_following_error() {
    let mut rig = Rig::enabled();
    rig.commanded[X] += 100_000;
    rig.until(50, "fault 8611", |rig| {
        rig.axes[X].fault() == Some(AxisFault::Drive { error_code: 0x8611 })
    });
}

/// Boots and moves on a bad wire; returns a digest of every frame with its time.
fn bad_wire(seed: u64) -> u64 {
    let faults = NetConfig {
        loss: 0.002,
        duplicate: 0.002,
        reorder: 0.002,
        corrupt: 0.002,
        ..NetConfig::clean(seed)
    };
    let mut rig = Rig::new(faults);
    let digest = Arc::new(Mutex::new(DefaultHasher::new()));
    let tapped = Arc::clone(&digest);
    rig.net.set_tap(Box::new(move |now_ns, frame| {
        let mut digest = tapped.lock().unwrap();
        digest.write_u64(now_ns);
        digest.write(frame);
    }));
    let mut moved = 0;
    for round in 0..20 {
        for axis in &mut rig.axes {
            for request in [Request::ResetFault, Request::Enable] {
                axis.request(request);
            }
        }
        rig.ramp(if round % 2 == 0 { 100 } else { 0 });
        rig.cycles(50);
        moved += u32::from(rig.axes[X].status() == Status::Enabled);
        for joint in 0..3 {
            let position_mm = rig.position_mm(joint);
            assert!(position_mm > -120.0 && position_mm < 320.0, "{:?}", rig.net);
        }
    }
    assert!(rig.net.lost() > 0);
    assert!(moved > 0, "the wire is not so bad that nothing can run: {:?}", rig.net);
    digest.lock().unwrap().finish()
}

#[test]
fn a_bad_wire_breaks_nothing_and_the_same_seed_is_the_same_run() {
    let runs: Vec<u64> = (0..8).map(bad_wire).collect();
    assert_eq!(bad_wire(3), runs[3]);
    assert_ne!(runs[3], runs[4]);
}

#[test]
fn a_node_of_another_identity_is_not_booted() {
    let mut config = test_config();
    let machine = SimMachine::new(&config).unwrap();
    config.bus.nodes[1].identity.device_type = Some(0x0001_0192);
    let mut rig = Rig::with(config, NetConfig::clean(1));
    rig.net = VirtualNet::new(machine, NetConfig::clean(1));
    rig.cycles(1000);
    assert_ne!(rig.mn.node_state(1), NodeState::Operational);
    assert_ne!(rig.mn.nmt_state(), NmtState::Operational, "it is mandatory");
}

/// A link that plays frames and then stops the machine's loop.
struct Play {
    frames: Vec<Vec<u8>>,
    sent: Vec<Vec<u8>>,
    now_ns: u64,
    stop: Arc<std::sync::atomic::AtomicBool>,
}

impl Link for Play {
    fn now_ns(&mut self) -> u64 {
        self.now_ns
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), powerlink::link::LinkError> {
        self.sent.push(frame.to_vec());
        Ok(())
    }

    fn receive(
        &mut self,
        buffer: &mut [u8],
        deadline_ns: u64,
    ) -> Result<Option<powerlink::link::Received>, powerlink::link::LinkError> {
        self.now_ns += 1000;
        let Some(frame) = self.frames.pop() else {
            self.now_ns = deadline_ns;
            self.stop.store(true, std::sync::atomic::Ordering::Relaxed);
            return Ok(None);
        };
        buffer[..frame.len()].copy_from_slice(&frame);
        Ok(Some(powerlink::link::Received {
            length: frame.len(),
            stamp_ns: Some(self.now_ns),
        }))
    }
}

#[test]
fn the_machine_on_a_link_answers_each_node_and_shows_what_came() {
    // SoA with IdentRequest as sent by a managing node: octets by hand from the frame layout.
    let ident_request = |target: u8| {
        let mut frame = vec![0; 60];
        frame[..6].copy_from_slice(&[0x01, 0x11, 0x1E, 0, 0, 3]);
        frame[6..12].copy_from_slice(&[0x02, 0, 0, 0, 0, 0xF0]);
        frame[12..24].copy_from_slice(&[0x88, 0xAB, 0x05, 255, 240, 0x1D, 0, 0, 0x01, target, 0x20, 0]);
        frame
    };
    let stop = Arc::new(std::sync::atomic::AtomicBool::new(false));
    let frames = [10, 4, 3, 2, 1].map(ident_request).to_vec();
    let mut link = Play {
        frames,
        sent: Vec::new(),
        now_ns: 1_000_000 * MS,
        stop: Arc::clone(&stop),
    };
    let mut machine = SimMachine::new(&test_config()).unwrap();
    let mut seen = 0;
    let served = super::serve(&mut link, &mut machine, &stop, &mut |_| {}, &mut |frame, received| {
        assert_eq!((frame.len(), received.stamp_ns.is_some()), (60, true));
        seen += 1;
    });
    let served = served.unwrap();
    assert_eq!(
        (served.received, served.sent, served.dropped, seen),
        (5, 4, 0, 5),
        "nobody is node 4"
    );
    assert_eq!(
        machine.nmt_state(1),
        Some(NmtState::PreOperational1),
        "the clock of the link counts from its own start"
    );
    let sources: Vec<u8> = link.sent.iter().map(|frame| frame[16]).collect();
    assert_eq!(sources, [1, 2, 3, 10]);
    // IdentResponse: ASnd, service 1, device type at 40.
    assert!(
        link.sent
            .iter()
            .all(|frame| frame.len() == 176 && frame[14] == 0x06 && frame[17] == 0x01)
    );
    assert_eq!(link.sent[0][40..44], [0x92, 0x01, 0x02, 0x00]);
    assert_eq!(link.sent[3][40..44], [0x91, 0x01, 0x0F, 0x00]);
}

#[test]
fn nodes_hear_an_answer_behind_the_frame_that_asked_for_it() {
    // SoA with SyncRequest without values.
    let sync_request = |target: u8| {
        let mut frame = [0; 60];
        frame[..6].copy_from_slice(&[0x01, 0x11, 0x1E, 0, 0, 3]);
        frame[6..12].copy_from_slice(&[0x02, 0, 0, 0, 0, 0xF0]);
        frame[12..24].copy_from_slice(&[0x88, 0xAB, 0x05, 255, 240, 0x5D, 0, 0, 0x06, target, 0x20, 0]);
        frame
    };
    let mut machine = SimMachine::new(&test_config()).unwrap();
    let mut sent = Vec::new();
    // Each further node has measured the one asked before it, whichever stands first in the machine file.
    for (target, measured) in [(1, 0), (2, 1), (1, 2), (3, 1)] {
        sent.clear();
        machine.receive(MS, &sync_request(target), &mut |frame| sent.push(frame.to_vec()));
        assert_eq!(sent.len(), 1);
        assert_eq!(sent[0][14..18], [0x06, 240, target, 0x06]);
        // The inter-frame gap: 960 ns.
        let delay: [u8; 2] = if measured == 0 { [0, 0] } else { [0xC0, 0x03] };
        let expected = [measured, 0, 0, 0, delay[0], delay[1], 0, 0];
        assert_eq!(sent[0][28..36], expected, "node {target}");
    }
}

#[test]
fn every_frame_can_be_captured_and_a_drive_fault_is_signalled_in_them() {
    let mut rig = Rig::moving();
    let writer = Arc::new(Mutex::new(PcapWriter::new(Vec::new()).unwrap()));
    let tapped = Arc::clone(&writer);
    rig.net.set_tap(Box::new(move |now_ns, frame| {
        tapped.lock().unwrap().write(now_ns, frame).unwrap()
    }));
    let polls_before = rig.mn.statistics(X).pres_received;
    rig.net.at(
        0,
        Disturbance::DriveFault {
            node: 1,
            error_code: 0x4310,
        },
    );
    rig.cycles(100);
    let polls = rig.mn.statistics(X).pres_received - polls_before;
    drop(rig);
    let file = Arc::into_inner(writer).unwrap().into_inner().unwrap().finish().unwrap();
    let frames: Vec<_> = PcapReader::new(&file).unwrap().map(|frame| frame.unwrap()).collect();
    assert!(frames.is_sorted_by_key(|frame| frame.stamp_ns));
    let of_x = |kind: u8| {
        frames
            .iter()
            .filter(move |frame| frame.frame[14] == kind && frame.frame[16] == 1)
    };
    assert_eq!((of_x(0x04).count() as u64, polls), (100, 100), "one PRes a cycle");
    // StatusResponse: entry type "occurred", profile 402; error code, little endian.
    let entry = [0x92, 0x31, 0x10, 0x43];
    assert!(of_x(0x06).any(|frame| frame.frame[17] == 0x02 && frame.frame[32..36] == entry));
}
