//! One node against hand-made frames of a managing node.

use super::access::Access;
use super::*;
use crate::nmt::{NmtCommand, NodeList, Reset};
use crate::wire::{
    Asnd, Frame, Header, Mac, NetTime, NmtCommandFrame, Preq, Pres, RequestedService, Requests, Soc, multicast, node,
};
use obd::{AbortCode, DataType, EntryDef, lines_of, octets_of};
use objects::{COMMUNICATION_BYTES, COMMUNICATION_ENTRIES, COMMUNICATION_PROFILE};
use std::string::ToString;
use std::vec::Vec;

mod addresses;
mod any_frames;
mod chained;
mod errors;
mod losses;
mod process_data;
mod queues;
mod rpdos;
mod states;

const US: u64 = 1000;
const NODE: u8 = 5;
const MAC: Mac = [2, 0, 0, 0, 0, NODE];
const MN_MAC: Mac = [2, 0, 0, 0, 0, 240];

const DEVICE: &[EntryDef] = &[
    EntryDef::rw(0x6040, DataType::U16, "controlword").rpdo(),
    EntryDef::ro(0x6041, DataType::U16, "statusword").tpdo(),
    EntryDef::ro(0x6064, DataType::I32, "position actual").tpdo(),
    EntryDef::rw(0x607A, DataType::I32, "target position").rpdo(),
    EntryDef::rw(0x6060, DataType::I8, "mode wanted").rpdo(),
];
const ENTRIES: usize = COMMUNICATION_ENTRIES + lines_of(DEVICE);
const BYTES: usize = COMMUNICATION_BYTES + octets_of(DEVICE);
type Node = Cn<ENTRIES, BYTES>;

fn config() -> CnConfig<'static> {
    CnConfig {
        node_id: NODE,
        mac: MAC,
        device_type: 0x0002_0192,
        vendor_id: 0x11,
        product_code: 0x22,
        revision: 0x33,
        serial: 0x44,
        device_name: "drive",
        host_name: "x-axis",
        pres_max_latency_ns: 20_000,
    }
}

/// A node, the managing node's side of the wire, and a clock.
struct Bench {
    node: Node,
    now_ns: u64,
    relative_time_us: u64,
    response: [u8; FRAME_LEN_MAX],
    events: Vec<Events>,
}

impl Bench {
    fn new() -> Bench {
        let mut dictionary = Dictionary::new(&[COMMUNICATION_PROFILE, DEVICE]).unwrap();
        // Most cycles here have no SoA; the tests of its loss set a threshold.
        let threshold = dictionary.find(0x1C0C, 3).unwrap();
        dictionary.set_default(threshold, &[0; 4]).unwrap();
        let node = Node::new(&config(), dictionary, 0).unwrap();
        Bench {
            node,
            now_ns: 0,
            relative_time_us: 0,
            response: [0xA5; FRAME_LEN_MAX],
            events: Vec::new(),
        }
    }

    fn send(&mut self, destination: Mac, destination_node: u8, frame: &Frame<'_>) -> Option<Vec<u8>> {
        let header = Header {
            destination,
            source: MN_MAC,
            destination_node,
            source_node: node::MN,
        };
        let mut octets = [0; FRAME_LEN_MAX];
        let len = frame.emit(&header, &mut octets).unwrap();
        let reaction = self.node.receive(self.now_ns, &octets[..len], &mut self.response);
        self.events.push(reaction.events);
        reaction.transmit.map(|len| self.response[..len].to_vec())
    }

    fn soc(&mut self) -> Events {
        self.relative_time_us += 1000;
        let soc = Soc {
            relative_time_us: self.relative_time_us,
            ..Soc::default()
        };
        assert_eq!(self.send(multicast::SOC, node::BROADCAST, &Frame::Soc(soc)), None);
        *self.events.last().unwrap()
    }

    fn soa(&mut self, service: RequestedService, target: u8) -> Option<Vec<u8>> {
        let soa = Soa::new(NmtState::Operational, service, target);
        self.send(multicast::SOA, node::BROADCAST, &Frame::Soa(soa))
    }

    fn status(&mut self, exception_reset: bool, exception_acknowledge: bool) -> Vec<u8> {
        let soa = Soa {
            exception_reset,
            exception_acknowledge,
            ..Soa::new(NmtState::Operational, RequestedService::StatusRequest, NODE)
        };
        self.send(multicast::SOA, node::BROADCAST, &Frame::Soa(soa)).unwrap()
    }

    fn preq(&mut self, preq: Preq<'_>) -> Option<Vec<u8>> {
        self.send(MAC, NODE, &Frame::Preq(preq))
    }

    fn poll_with(&mut self, payload: &[u8]) -> Option<Vec<u8>> {
        self.preq(Preq {
            multiplexed: false,
            exception_acknowledge: false,
            ready: true,
            pdo_version: 0,
            payload,
        })
    }

    /// A PRes of another node, or of the managing node.
    fn pres_from(&mut self, from: u8, payload: &[u8], ready: bool) -> Events {
        let pres = Pres {
            nmt_state: NmtState::Operational,
            multiplexed: false,
            exception_new: false,
            ready,
            requests: Requests::default(),
            pdo_version: 0,
            payload,
        };
        let mut octets = [0; FRAME_LEN_MAX];
        let header = Header::multicast(multicast::PRES, [7; 6], from);
        let len = pres.emit(&header, 36, &mut octets).unwrap();
        let reaction = self.node.receive(self.now_ns, &octets[..len], &mut self.response);
        assert_eq!(reaction.transmit, None);
        reaction.events
    }

    fn cumulative(&self, index: u16) -> (u32, u32) {
        (self.u32_of(index, 1), self.u32_of(index, 2))
    }

    fn command(&mut self, destination_node: u8, command: NmtCommandFrame) -> Events {
        let frame = Frame::Asnd(Asnd::NmtCommand(command));
        assert_eq!(self.send(multicast::ASND, destination_node, &frame), None);
        *self.events.last().unwrap()
    }

    fn plain(&mut self, command: NmtCommand) -> Events {
        self.command(NODE, NmtCommandFrame::plain(command))
    }

    /// Writes an object as an SDO does once it has arrived, without the sequence layer.
    fn write(&mut self, index: u16, sub: u8, value: &[u8]) -> Result<(), AbortCode> {
        let node = &mut self.node;
        let mut access = Access {
            dictionary: &mut node.dictionary,
            keys: &node.keys,
            state: node.state,
            check: node.check,
            written: None,
            written_several: false,
            reset: None,
            storage: None,
        };
        obd::Objects::sdo_write(&mut access, index, sub, value)
    }

    fn map(&mut self) {
        // Receive 0x607A, 0x6060, 0x6040; transmit 0x6064, 0x6041.
        for (sub, raw) in [0x0020_0000_0000_607A_u64, 0x0008_0020_0000_6060, 0x0010_0028_0000_6040]
            .iter()
            .enumerate()
        {
            self.write(0x1600, sub as u8 + 1, &raw.to_le_bytes()).unwrap();
        }
        for (sub, raw) in [0x0020_0000_0000_6064_u64, 0x0010_0020_0000_6041].iter().enumerate() {
            self.write(0x1A00, sub as u8 + 1, &raw.to_le_bytes()).unwrap();
        }
        self.write(0x1600, 0, &[3]).unwrap();
        self.write(0x1A00, 0, &[2]).unwrap();
        self.write(0x1006, 0, &1000_u32.to_le_bytes()).unwrap();
    }

    /// Takes the node to PRE_OPERATIONAL_2.
    fn wake(&mut self) {
        self.soa(RequestedService::NoService, 0);
        self.soc();
        assert_eq!(self.node.nmt_state(), NmtState::PreOperational2);
    }

    fn start(&mut self) {
        self.wake();
        self.map();
        self.plain(NmtCommand::EnableReadyToOperate);
        self.plain(NmtCommand::StartNode);
        assert_eq!(self.node.nmt_state(), NmtState::Operational);
    }

    fn u32_of(&self, index: u16, sub: u8) -> u32 {
        self.node
            .dictionary()
            .get(self.node.dictionary().key(index, sub).unwrap())
    }
}

const OUTPUTS: [u8; 7] = [0x78, 0x56, 0x34, 0x12, 8, 0x0F, 0x00];

#[test]
fn a_node_is_refused_with_the_reason() {
    let dictionary = || Dictionary::<ENTRIES, BYTES>::new(&[COMMUNICATION_PROFILE, DEVICE]).unwrap();
    let refused = |config: CnConfig<'_>| Node::new(&config, dictionary(), 0).unwrap_err().to_string();
    assert_eq!(
        refused(CnConfig {
            node_id: 240,
            ..config()
        }),
        "node id 240: controlled nodes have 1..=239"
    );
    let long = "a host name of more than 32 octets";
    assert_eq!(
        refused(CnConfig {
            host_name: long,
            ..config()
        }),
        "object 0x1F9A/0: 0x06070012 (data type does not match, length of the parameter too high)"
    );
    let bare = Dictionary::<ENTRIES, BYTES>::new(&[DEVICE]).unwrap();
    let error = Node::new(&config(), bare, 0).unwrap_err();
    assert_eq!(
        error,
        CnError::Object {
            index: 0x1000,
            sub: 0,
            code: AbortCode::NO_OBJECT
        }
    );
}

#[test]
fn a_reset_of_communication_ends_sdo_connections() {
    let mut bench = Bench::new();
    let sdo = |bench: &mut Bench, octets: &[u8]| {
        bench.send(multicast::ASND, NODE, &Frame::Asnd(Asnd::Sdo(octets)));
        let answer = bench.soa(RequestedService::UnspecifiedInvite, NODE).unwrap();
        [answer[18], answer[19]]
    };
    let read = [0x02, 0x06, 0, 0, 0, 1, 0, 2, 4, 0, 0, 0, 0x00, 0x10, 0, 0];
    for (command, expected) in [
        (NmtCommand::ResetConfiguration, [0x06, 0x06]),
        (NmtCommand::ResetCommunication, [0x04, 0x00]),
    ] {
        bench.wake();
        sdo(&mut bench, &[0x00, 0x01, 0, 0]);
        sdo(&mut bench, &[0x01, 0x02, 0, 0]);
        bench.plain(command);
        bench.wake();
        assert_eq!(sdo(&mut bench, &read), expected, "{command:?}");
        bench.plain(NmtCommand::ResetNode);
    }
}

#[test]
fn resets_restore_as_deep_as_they_say() {
    let written = |bench: &mut Bench| {
        bench.wake();
        bench.map();
        bench.write(0x1020, 1, &7_u32.to_le_bytes()).unwrap();
        bench.write(0x6060, 0, &[8]).unwrap();
    };
    let left = |bench: &Bench| {
        let read = |index, sub| bench.node.dictionary().read(index, sub).unwrap()[0];
        (read(0x1020, 1), read(0x1600, 0), read(0x6060, 0))
    };
    for (command, reset, expected) in [
        (NmtCommand::ResetConfiguration, Reset::Configuration, (7, 3, 8)),
        (NmtCommand::ResetCommunication, Reset::Communication, (0, 0, 8)),
        (NmtCommand::ResetNode, Reset::Node, (0, 0, 0)),
        (NmtCommand::SwReset, Reset::Software, (0, 0, 0)),
    ] {
        let mut bench = Bench::new();
        written(&mut bench);
        let events = bench.plain(command);
        assert_eq!(
            (events.reset, events.nmt_state),
            (Some(reset), Some(NmtState::NotActive))
        );
        assert_eq!(left(&bench), expected, "{command:?}");
        assert_eq!(
            bench.node.dictionary().read(0x1018, 1).unwrap(),
            [0x11, 0, 0, 0],
            "identity stays"
        );
        assert_eq!(bench.node.dictionary().read(0x1F8C, 0).unwrap(), [0x1C]);
    }
}

#[test]
fn extended_commands_act_on_the_listed_nodes() {
    let mut bench = Bench::new();
    bench.wake();
    let mut others = NodeList::default();
    others.insert(NODE + 1);
    bench.command(
        node::BROADCAST,
        NmtCommandFrame::extended(NmtCommand::EnableReadyToOperateEx, others),
    );
    assert_eq!(bench.node.nmt_state(), NmtState::PreOperational2);
    let mut all = others;
    all.insert(NODE);
    bench.command(
        node::BROADCAST,
        NmtCommandFrame::extended(NmtCommand::EnableReadyToOperateEx, all),
    );
    assert_eq!(bench.node.nmt_state(), NmtState::ReadyToOperate);
    bench.command(NODE + 1, NmtCommandFrame::plain(NmtCommand::StartNode));
    assert_eq!(
        bench.node.nmt_state(),
        NmtState::ReadyToOperate,
        "addressed to another node"
    );
    bench.command(node::BROADCAST, NmtCommandFrame::extended(NmtCommand::ResetNodeEx, all));
    assert_eq!(bench.node.nmt_state(), NmtState::NotActive);
}

#[test]
fn an_sdo_is_answered_when_the_node_is_invited() {
    let mut bench = Bench::new();
    bench.wake();
    let mut sdo = |octets: &[u8]| {
        bench.send(multicast::ASND, NODE, &Frame::Asnd(Asnd::Sdo(octets)));
        let requests = bench.poll_with(&[]).unwrap()[19];
        let answer = bench.soa(RequestedService::UnspecifiedInvite, NODE);
        (requests, answer)
    };
    let (requests, answer) = sdo(&[0x00, 0x01, 0, 0]);
    assert_eq!(requests, 0x19, "PR 3, RS 1");
    let answer = answer.unwrap();
    assert_eq!(
        (answer.len(), &answer[..6], &answer[14..20]),
        (60, &multicast::ASND[..], &[6, 240, 5, 5, 1, 1][..])
    );
    assert_eq!(sdo(&[0x01, 0x02, 0, 0]).1.unwrap()[18..20], [2, 2]);
    // 0x6060 = 8: the device is told.
    let write = [0x02, 0x06, 0, 0, 0, 1, 0, 1, 5, 0, 0, 0, 0x60, 0x60, 0, 0, 8];
    assert_eq!(sdo(&write).1.unwrap()[18..27], [6, 6, 0, 0, 0, 1, 0x80, 1, 0]);
    assert_eq!(sdo(&[0x06, 0x06, 0, 0]), (0, None), "an acknowledge needs no answer");
    let written: Vec<_> = bench.events.iter().filter_map(|events| events.written).collect();
    assert_eq!(written, [(0x6060, 0)]);
}

#[test]
fn the_device_judges_writes_to_its_objects() {
    let mut bench = Bench::new();
    bench.wake();
    bench.node.set_write_check(|_, index, _, value| match (index, value) {
        (0x6060, [5]) => Err(AbortCode::VALUE_RANGE),
        _ => Ok(()),
    });
    assert_eq!(bench.write(0x6060, 0, &[5]), Err(AbortCode::VALUE_RANGE));
    assert_eq!(
        bench.write(0x6060, 0, &[]),
        Err(AbortCode::TOO_SHORT),
        "the dictionary judges first"
    );
    assert_eq!(bench.write(0x6060, 0, &[8]), Ok(()));
    assert_eq!(bench.node.dictionary().read(0x6060, 0).unwrap(), [8]);
}

#[test]
fn a_reset_by_object_waits_until_its_answer_is_on_the_way() {
    let mut bench = Bench::new();
    bench.wake();
    assert_eq!(
        bench.write(0x1F9E, 0, &[0x21]),
        Err(AbortCode::VALUE_RANGE),
        "StartNode is no reset"
    );
    assert_eq!(
        bench.write(0x1F9E, 0, &[0x48]),
        Err(AbortCode::VALUE_RANGE),
        "nor is an extended command"
    );
    let sdo = |bench: &mut Bench, octets: &[u8]| bench.send(multicast::ASND, NODE, &Frame::Asnd(Asnd::Sdo(octets)));
    let invite = |bench: &mut Bench| bench.soa(RequestedService::UnspecifiedInvite, NODE);
    sdo(&mut bench, &[0x00, 0x01, 0, 0]);
    invite(&mut bench).unwrap();
    sdo(&mut bench, &[0x01, 0x02, 0, 0]);
    invite(&mut bench).unwrap();
    sdo(
        &mut bench,
        &[0x02, 0x06, 0, 0, 0, 1, 0, 1, 5, 0, 0, 0, 0x9E, 0x1F, 0, 0, 0x28],
    );
    bench.soc();
    assert_eq!(bench.node.nmt_state(), NmtState::PreOperational2);
    assert_eq!(invite(&mut bench).unwrap()[24], 0x80);
    assert_eq!(bench.node.poll(bench.now_ns).reset, Some(Reset::Node));
    assert_eq!(bench.node.nmt_state(), NmtState::NotActive);
    assert_eq!(bench.node.dictionary().read(0x1F9E, 0).unwrap(), [0xFF]);
}

#[test]
fn the_host_name_can_be_set_by_command() {
    let mut bench = Bench::new();
    let mut command = NmtCommandFrame::plain(NmtCommand::NetHostNameSet);
    command.data[..6].copy_from_slice(b"z-axis");
    bench.command(NODE, command);
    let ident = bench.soa(RequestedService::IdentRequest, NODE).unwrap();
    assert_eq!(ident.len(), 176);
    assert_eq!(ident[96..104], *b"z-axis\0\0");
    assert_eq!(ident[40..48], [0x92, 0x01, 0x02, 0, 0x11, 0, 0, 0]);
    assert_eq!(ident[84..88], [5, 100, 168, 192]);
}

#[test]
fn only_node_240_manages() {
    let mut bench = Bench::new();
    let mut octets = [0; FRAME_LEN_MAX];
    let header = Header::multicast(multicast::SOC, MN_MAC, 7);
    let len = Soc::default().emit(&header, &mut octets).unwrap();
    assert_eq!(
        bench.node.receive(0, &octets[..len], &mut bench.response),
        Reaction::default()
    );
    assert_eq!(bench.node.nmt_state(), NmtState::NotActive);
}
