//! Our managing node boots the recorded controlled nodes: they answer with the frames they sent to another managing node.
//!
//! A recorded answer is given when our managing node asks what the recorded one had asked. Adapted, as the recorded node would
//! have done, are only what depends on who asks when: the numbers of the SDO sequence layer and the transaction id, RS and PR
//! (whether an answer waits), and the NMT state of Ident- and StatusResponse.
#![cfg(feature = "std")]

use std::collections::{BTreeSet, VecDeque};

use obd::cdc::CdcWriter;
use powerlink::link::pcap::PcapReader;
use powerlink::mn::{Assignment, BootTimes, Identity, Mn, MnConfig, MnEvent, NodeConfig, NodeState, Step};
use powerlink::nmt::{NmtCommand, NmtState};
use powerlink::wire::{Asnd, Frame, Header, NetTime, RequestedService};

/// See `tests/data/README.md`.
const CAPTURE: &[u8] = include_bytes!("data/openpowerlink-3cn-10ms-distinct.pcap");
const NODES: [u8; 3] = [1, 32, 110];
const MN_MAC: [u8; 6] = [0x02, 0x00, 0x5E, 0x00, 0x00, 0x01];
const CYCLE_NS: u64 = 10_000_000;
/// What a recorded node takes to answer.
const ANSWER_NS: u64 = 40_000;
/// A recorded node answers nothing for about so long after it was reset.
const RESTART_NS: u64 = 550_000_000;
/// Octets that are adapted.
const FLAGS: usize = 18;
const REQUESTS: usize = 19;
const STATE: usize = 20;
const TRANSACTION: usize = 23;

/// Objects of the recorded download that belong to the node's configuration. The two that the recorded managing node added of
/// itself (0x1011/1, restore defaults, and 0x1010/1, store) are refused by the recorded nodes; 0x1006 it wrote twice.
fn is_configuration(index: u16) -> bool {
    !matches!(index, 0x1010 | 0x1011)
}

fn frames() -> impl Iterator<Item = (Header, Frame<'static>, &'static [u8])> {
    PcapReader::new(CAPTURE).unwrap().map(|captured| {
        let octets = captured.unwrap().frame;
        (Header::parse(octets).unwrap(), Frame::parse(octets).unwrap(), octets)
    })
}

/// An SDO command of the recorded managing node: transaction, object, value.
#[derive(Clone, Debug)]
struct Write {
    transaction: u8,
    index: u16,
    sub: u8,
    value: Vec<u8>,
}

/// A WriteByIndex in the service data of an SDO frame.
fn write_of(data: &[u8]) -> Option<Write> {
    let size = usize::from(u16::from_le_bytes(data.get(8..10)?.try_into().ok()?));
    let value = data.get(12..12 + size)?;
    (data[6] & 0x80 == 0 && data[7] == 0x01).then(|| Write {
        transaction: data[5],
        index: u16::from_le_bytes([value[0], value[1]]),
        sub: value[2],
        value: value[4..].to_vec(),
    })
}

/// The recorded writes to a node, each object once.
fn recorded_writes(node: u8) -> Vec<Write> {
    let mut seen = BTreeSet::new();
    frames()
        .filter(|(header, ..)| header.destination_node == node)
        .filter_map(|(_, frame, _)| match frame {
            Frame::Asnd(Asnd::Sdo(data)) => write_of(data),
            _ => None,
        })
        // Sent again under the same transaction it is the same command.
        .filter(|write| seen.insert(write.transaction))
        .collect()
}

/// Concise DCF that makes our managing node write what the recorded one wrote.
fn configuration(node: u8) -> Vec<u8> {
    let mut octets = [0; 400];
    let mut writer = CdcWriter::new(&mut octets).unwrap();
    for Write { index, sub, value, .. } in recorded_writes(node) {
        if is_configuration(index) {
            writer.push(index, sub, &value).unwrap();
        }
    }
    writer.finish().to_vec()
}

/// One of the recorded nodes.
struct Recorded {
    id: u8,
    frames: Vec<(Frame<'static>, &'static [u8])>,
    writes: Vec<Write>,
    state: NmtState,
    configured: bool,
    /// Answers nothing until then.
    silent_until_ns: u64,
    exception_clear: bool,
    reset_seen: bool,
    /// Numbers of the last SDO frame received and sent.
    received: u8,
    sent: u8,
    answers: VecDeque<Vec<u8>>,
    written: Vec<(u16, u8)>,
}

impl Recorded {
    fn new(id: u8) -> Recorded {
        let own = frames().filter(|(header, ..)| header.source_node == id);
        Recorded {
            id,
            frames: own.map(|(_, frame, octets)| (frame, octets)).collect(),
            writes: recorded_writes(id),
            state: NmtState::NotActive,
            configured: false,
            silent_until_ns: 0,
            exception_clear: true,
            reset_seen: false,
            received: 0,
            sent: 0,
            answers: VecDeque::new(),
            written: Vec::new(),
        }
    }

    fn find(&self, what: &str, is: impl Fn(&Frame<'static>) -> bool) -> Vec<u8> {
        let found = self.frames.iter().find(|(frame, _)| is(frame));
        let (_, octets) = found.unwrap_or_else(|| panic!("node {}: no {what} was recorded", self.id));
        octets.to_vec()
    }

    /// RS and PR as the recorded nodes show them.
    fn requests(&self) -> u8 {
        match self.answers.len() {
            0 => 0,
            waiting => 0x18 | waiting.min(7) as u8,
        }
    }

    /// What the node sends when this arrives.
    fn receive(&mut self, now_ns: u64, octets: &[u8]) -> Option<Vec<u8>> {
        let header = Header::parse(octets).unwrap();
        if now_ns < self.silent_until_ns {
            return None;
        }
        match Frame::parse(octets).unwrap() {
            Frame::Soc(_) => {
                if matches!(self.state, NmtState::NotActive | NmtState::PreOperational1) {
                    self.state = NmtState::PreOperational2;
                }
                None
            }
            Frame::Soa(soa) => {
                if self.state == NmtState::NotActive {
                    self.state = NmtState::PreOperational1;
                }
                (soa.target == self.id)
                    .then(|| self.invited(soa.service, soa.exception_reset))
                    .flatten()
            }
            Frame::Preq(_) if header.destination_node == self.id && self.state.is_isochronous() => {
                let state = self.state;
                let mut pres = self.find(
                    "PRes",
                    |frame| matches!(frame, Frame::Pres(pres) if pres.nmt_state == state),
                );
                pres[REQUESTS] = self.requests();
                Some(pres)
            }
            Frame::Asnd(Asnd::NmtCommand(command))
                if matches!(header.destination_node, 255) || header.destination_node == self.id =>
            {
                match command.command.plain() {
                    Some(plain) if command.nodes().contains(self.id) => self.command(now_ns, plain),
                    Some(_) => {}
                    None => self.command(now_ns, command.command),
                }
                None
            }
            Frame::Asnd(Asnd::Sdo(data)) if header.destination_node == self.id => {
                self.sdo(data);
                None
            }
            _ => None,
        }
    }

    fn invited(&mut self, service: RequestedService, exception_reset: bool) -> Option<Vec<u8>> {
        let mut answer = match service {
            RequestedService::IdentRequest => {
                // The second IdentResponse shows the date of the configuration.
                let configured = self.configured;
                self.find("IdentResponse", |frame| {
                    matches!(frame, Frame::Asnd(Asnd::IdentResponse(ident)) if (ident.configuration_date != 0) == configured)
                })
            }
            RequestedService::StatusRequest => {
                let clear = self.exception_clear;
                self.reset_seen |= exception_reset;
                // The flag follows one request later.
                self.exception_clear = clear && (exception_reset || !self.reset_seen);
                self.find("StatusResponse", |frame| {
                    matches!(frame, Frame::Asnd(Asnd::StatusResponse(status)) if status.exception_clear == clear)
                })
            }
            RequestedService::UnspecifiedInvite => return self.answers.pop_front(),
            _ => return None,
        };
        answer[REQUESTS] = self.requests();
        answer[STATE] = self.state.into();
        assert_eq!(answer[FLAGS] & 0x10, 0, "no recorded node has new errors");
        Some(answer)
    }

    fn command(&mut self, now_ns: u64, command: NmtCommand) {
        match (command, self.state) {
            (NmtCommand::ResetNode | NmtCommand::ResetConfiguration, _) => {
                self.configured = command == NmtCommand::ResetConfiguration;
                self.state = NmtState::NotActive;
                self.silent_until_ns = now_ns + RESTART_NS;
                if command == NmtCommand::ResetNode {
                    self.exception_clear = true;
                    self.reset_seen = false;
                    self.answers.clear();
                }
            }
            (NmtCommand::EnableReadyToOperate, NmtState::PreOperational2) => self.state = NmtState::ReadyToOperate,
            (NmtCommand::StartNode, NmtState::ReadyToOperate) => self.state = NmtState::Operational,
            _ => panic!("node {}: {command:?} in {:?} was not recorded", self.id, self.state),
        }
    }

    /// An SDO frame arrived: the recorded answer, with the numbers it has in this connection.
    fn sdo(&mut self, data: &[u8]) {
        let (receive, send) = (data[0], data[1]);
        match (receive & 3, send & 3) {
            // The connection is set up, or confirmed; the recorded answers to both carry no command.
            (0 | 1, 1 | 2) => {
                (self.received, self.sent) = (send >> 2, receive >> 2);
                let con = send & 3;
                let mut answer = self.find("answer to the set-up", |frame| {
                    matches!(frame, Frame::Asnd(Asnd::Sdo(data)) if data[0] & 3 == con && data[1] & 3 == con && data[7] == 0)
                });
                answer[18] = self.received << 2 | con;
                answer[19] = self.sent << 2 | con;
                self.answers.push_back(answer);
            }
            (0, 0) => {}
            (2, _) => {
                if send >> 2 != (self.received + 1) & 0x3F {
                    return;
                }
                let write = write_of(data).unwrap_or_else(|| panic!("node {}: {data:02x?}", self.id));
                self.received = send >> 2;
                self.sent = (self.sent + 1) & 0x3F;
                let is_same = |recorded: &&Write| {
                    (recorded.index, recorded.sub, &recorded.value) == (write.index, write.sub, &write.value)
                };
                let recorded = self.writes.iter().find(is_same);
                let recorded = recorded.unwrap_or_else(|| panic!("node {}: {write:x?} was not recorded", self.id));
                let mut answer = self.find("answer to the write", |frame| {
                    matches!(frame, Frame::Asnd(Asnd::Sdo(data)) if data[5] == recorded.transaction && data[6] & 0x80 != 0)
                });
                answer[18] = self.received << 2 | 2;
                answer[19] = self.sent << 2 | 2;
                answer[TRANSACTION] = write.transaction;
                self.answers.push_back(answer);
                self.written.push((write.index, write.sub));
            }
            _ => panic!("node {}: SDO {data:02x?}", self.id),
        }
    }
}

/// What happened in a boot.
struct Boot {
    /// From the first frame to OPERATIONAL of the last node.
    cycles: u64,
    events: Vec<MnEvent>,
    commands: Vec<(u8, NmtCommand)>,
    nodes: Vec<Recorded>,
}

/// Boots all three nodes.
fn boot(mandatory: bool) -> Boot {
    let configurations = NODES.map(configuration);
    let configs: Vec<_> = NODES
        .iter()
        .zip(&configurations)
        .map(|(id, configuration)| NodeConfig {
            id: *id,
            assignment: Assignment {
                mandatory,
                ..Assignment::default()
            },
            pres_timeout_ns: 400_000,
            identity: Identity {
                device_type: Some(0x000F_0191),
                vendor_id: Some(0),
                revision: Some(0x0002_0007),
                ..Identity::default()
            },
            preq_bytes: 1,
            pres_bytes: 1,
            configuration,
            ..NodeConfig::default()
        })
        .collect();
    let config = MnConfig {
        cycle_ns: CYCLE_NS as u32,
        boot: BootTimes {
            wait_not_active_us: 0,
            // Longer than the recorded nodes need to restart.
            timeout_pre_op_1_us: 1_000_000,
            ..BootTimes::default()
        },
        nodes: &configs,
        mac: MN_MAC,
        ..MnConfig::default()
    };
    let mut mn = Box::new(Mn::<3>::new(config).unwrap());
    let mut boot = Boot {
        cycles: 0,
        events: Vec::new(),
        commands: Vec::new(),
        nodes: NODES.map(Recorded::new).into(),
    };
    let mut now_ns = 0;
    while mn.nmt_state() != NmtState::Operational || (0..3).any(|index| mn.node_state(index) != NodeState::Operational)
    {
        assert!(boot.cycles < 1_000, "not OPERATIONAL: {:#?}", boot.events);
        boot.cycles += 1;
        let end_ns = now_ns + CYCLE_NS;
        mn.start_cycle(now_ns, NetTime::default());
        let mut answer = None;
        while now_ns < end_ns {
            match mn.poll(now_ns) {
                Step::Send(frame) => {
                    if let (header, Frame::Asnd(Asnd::NmtCommand(command))) =
                        (Header::parse(frame).unwrap(), Frame::parse(frame).unwrap())
                    {
                        // An extended command is one to each node of its list.
                        match command.command.plain() {
                            Some(plain) => {
                                let listed = (1..=239).filter(|id| command.nodes().contains(*id));
                                boot.commands.extend(listed.map(|id| (id, plain)));
                            }
                            None => boot.commands.push((header.destination_node, command.command)),
                        }
                    }
                    for node in &mut boot.nodes {
                        answer = node
                            .receive(now_ns, frame)
                            .map(|octets| (now_ns + ANSWER_NS, octets))
                            .or(answer);
                    }
                }
                Step::WaitUntil(until_ns) => match answer.take() {
                    Some((at_ns, octets)) => {
                        now_ns = now_ns.max(at_ns);
                        mn.receive(now_ns, &octets);
                    }
                    None => now_ns = until_ns.min(end_ns),
                },
                Step::IsochronousDone => {}
                Step::Idle => now_ns = end_ns,
            }
        }
        boot.events.extend(std::iter::from_fn(|| mn.pop_event()));
    }
    boot
}

#[test]
fn three_recorded_nodes_reach_operational() {
    for mandatory in [true, false] {
        let boot = boot(mandatory);
        let ms = boot.cycles * CYCLE_NS / 1_000_000;
        println!(
            "mandatory {mandatory}: OPERATIONAL after {ms} ms, of which the nodes restart for twice {} ms",
            RESTART_NS / 1_000_000
        );
        let wrong = |event: &&MnEvent| {
            !matches!(
                event,
                MnEvent::NmtStateChanged { .. }
                    | MnEvent::NodeStateChanged { .. }
                    | MnEvent::Identified { .. }
                    | MnEvent::Configuring { .. }
            )
        };
        assert_eq!(boot.events.iter().find(wrong), None);
        for node in &boot.nodes {
            let commands: Vec<_> = boot
                .commands
                .iter()
                .filter(|(to, _)| *to == node.id)
                .map(|(_, command)| *command)
                .collect();
            let expected = [
                NmtCommand::ResetConfiguration,
                NmtCommand::EnableReadyToOperate,
                NmtCommand::StartNode,
            ];
            assert_eq!(commands, expected, "node {}", node.id);
            let recorded: Vec<_> = node
                .writes
                .iter()
                .map(|write| (write.index, write.sub))
                .filter(|(index, _)| is_configuration(*index))
                .collect();
            assert_eq!(recorded.len(), 15);
            assert_eq!(node.written, recorded, "node {}", node.id);
            assert_eq!(node.state, NmtState::Operational);
        }
        // The managing node of the recording took 3.5 s.
        assert!(ms <= 2_500, "{ms} ms");
    }
}
