//! The managing node against controlled nodes of this crate, on virtual time; the test is the wire.

mod addresses;
mod assignment;
mod boot;
mod chaining;
mod cycle;
mod diagnosis;
mod faults;
mod objects;
mod rules;
mod server;
mod service;
mod speed;
mod startup;

use std::collections::BTreeMap;
use std::vec::Vec;

use obd::cdc::CdcWriter;
use obd::{DataType, Dictionary, EntryDef, lines_of, octets_of};

use super::event::Events;
use super::*;
use crate::cn::objects::{COMMUNICATION_BYTES, COMMUNICATION_ENTRIES, COMMUNICATION_PROFILE};
use crate::cn::{Cn, CnConfig};
use crate::link::simulated::SplitMix64;
use crate::nmt::{NmtCommand, Reset};
use crate::wire::{
    Asnd, FRAME_LEN_MAX, Frame, Header, Mac, NetTime, NmtCommandFrame, Pres, RequestedService, Soa, Soc, SyncResponse,
    multicast,
};

const US: u64 = 1_000;
const MS: u64 = 1_000_000;
const CYCLE_NS: u64 = MS;
const MN_MAC: Mac = [2, 0, 0, 0, 0, 0xF0];
const FOREIGN_MAC: Mac = [2, 0, 0, 0, 0, 0xEE];
const FOREIGN: ForeignSign = ForeignSign {
    id: 240,
    mac: FOREIGN_MAC,
};
/// What a node takes to answer.
const ANSWER_NS: u64 = 20 * US;
const NODES: usize = 8;

/// Boot times of the tests: short, all different.
const BOOT: BootTimes = BootTimes {
    wait_not_active_us: 20_000,
    timeout_pre_op_1_us: 80_000,
    wait_pre_op_1_us: 30_000,
    timeout_pre_op_2_us: 400_000,
    timeout_ready_to_operate_us: 200_000,
    reset_pause_us: 10_000,
};

const DEVICE: &[EntryDef] = &[
    EntryDef::rw(0x2F00, DataType::Domain, "motor data").capacity(1000),
    EntryDef::rw(0x6040, DataType::U16, "controlword").rpdo(),
    EntryDef::ro(0x6041, DataType::U16, "statusword").tpdo(),
    EntryDef::rw(0x6060, DataType::I8, "mode").rpdo(),
    EntryDef::ro(0x6064, DataType::I32, "position").tpdo(),
    EntryDef::rw(0x607A, DataType::I32, "target").rpdo(),
];
type Drive = Cn<{ COMMUNICATION_ENTRIES + lines_of(DEVICE) }, { COMMUNICATION_BYTES + octets_of(DEVICE) }>;

/// Concise DCF of a drive: 0x607A and 0x6040 out, 0x6064 and 0x6041 in; nine writes.
fn configuration() -> Vec<u8> {
    let mut octets = [0; 400];
    let mut writer = CdcWriter::new(&mut octets).unwrap();
    for (index, sub, raw) in [
        (0x1600, 1, 0x0020_0000_0000_607A_u64),
        (0x1600, 2, 0x0010_0020_0000_6040),
        (0x1A00, 1, 0x0020_0000_0000_6064),
        (0x1A00, 2, 0x0010_0020_0000_6041),
    ] {
        writer.push(index, sub, &raw.to_le_bytes()).unwrap();
    }
    writer.push(0x1600, 0, &[2]).unwrap();
    writer.push(0x1A00, 0, &[2]).unwrap();
    writer.push(0x1006, 0, &1000_u32.to_le_bytes()).unwrap();
    writer.push(0x6060, 0, &[8]).unwrap();
    writer.push(0x1020, 1, &20_000_u32.to_le_bytes()).unwrap();
    writer.finish().to_vec()
}

/// The same for a node that may hold a mapping already: it is switched off first; eleven writes.
fn configuration_anew() -> Vec<u8> {
    let mut octets = std::vec![11, 0, 0, 0];
    for index in [0x1600_u16, 0x1A00] {
        octets.extend(index.to_le_bytes());
        octets.extend([0, 1, 0, 0, 0, 0]);
    }
    octets.extend(&configuration()[4..]);
    octets
}

fn node_config(id: u8, configuration: &[u8]) -> NodeConfig<'_> {
    NodeConfig {
        id,
        pres_timeout_ns: 100_000,
        identity: Identity {
            device_type: Some(0x0002_0192),
            ..Identity::default()
        },
        // A drive that nobody configures maps nothing.
        preq_bytes: if configuration.is_empty() { 0 } else { 6 },
        pres_bytes: if configuration.is_empty() { 0 } else { 6 },
        configuration,
        ..NodeConfig::default()
    }
}

fn mn_config<'a>(nodes: &'a [NodeConfig<'a>]) -> MnConfig<'a> {
    MnConfig {
        cycle_ns: CYCLE_NS as u32,
        async_slot_timeout_ns: 150_000,
        boot: BOOT,
        pres_lost_max: 3,
        nodes,
        mac: MN_MAC,
        ..MnConfig::default()
    }
}

fn drive(id: u8, now_ns: u64) -> Drive {
    let config = CnConfig {
        node_id: id,
        mac: [2, 0, 0, 0, 0, id],
        device_type: 0x0002_0192,
        vendor_id: 1,
        product_code: 2,
        revision: 3,
        serial: u32::from(id),
        device_name: "drive",
        host_name: "drive",
        pres_max_latency_ns: ANSWER_NS as u32,
    };
    Drive::new(
        &config,
        Dictionary::new(&[COMMUNICATION_PROFILE, DEVICE]).unwrap(),
        now_ns,
    )
    .unwrap()
}

/// A frame that was on the wire, and who sent it.
#[derive(Clone, Debug)]
struct OnWire {
    now_ns: u64,
    source: u8,
    octets: Vec<u8>,
}

impl OnWire {
    fn frame(&self) -> Frame<'_> {
        Frame::parse(&self.octets).unwrap()
    }
}

/// The network: managing node, drives, everything that was sent.
struct Net<'a> {
    mn: Mn<'a, NODES>,
    drives: BTreeMap<u8, Drive>,
    now_ns: u64,
    log: Vec<OnWire>,
    /// (node, how many of its next PRes are lost)
    lose_pres: BTreeMap<u8, u32>,
    /// These drives hear and say nothing.
    dead: Vec<u8>,
    events: Vec<MnEvent>,
    /// SyncResponses are lost.
    refuse_sync: bool,
    /// The next such NMT command is lost to all.
    lose_command: Option<NmtCommand>,
    /// Resets that nodes ran through.
    resets: Vec<(u8, Reset)>,
    /// Share of the ASnd frames that are lost, at each receiver by itself.
    lose_asnd: Option<(SplitMix64, f64)>,
    /// Asks the managing node by SDO.
    tool: Option<server::Tool>,
    /// Answers on their way, with the time they arrive.
    coming: Vec<(u64, Vec<u8>)>,
}

impl<'a> Net<'a> {
    fn new(nodes: &'a [NodeConfig<'a>]) -> Net<'a> {
        Net::with(mn_config(nodes))
    }

    fn with(config: MnConfig<'a>) -> Net<'a> {
        let nodes = config.nodes;
        Net {
            mn: Mn::new(config).unwrap(),
            drives: nodes.iter().map(|node| (node.id, drive(node.id, 0))).collect(),
            now_ns: 0,
            log: Vec::new(),
            lose_pres: BTreeMap::new(),
            dead: Vec::new(),
            events: Vec::new(),
            refuse_sync: false,
            lose_command: None,
            resets: Vec::new(),
            lose_asnd: None,
            tool: None,
            coming: Vec::new(),
        }
    }

    /// One cycle of the caller's loop; the virtual time jumps from deadline to deadline.
    fn cycle(&mut self) {
        let start_ns = self.now_ns;
        self.mn.start_cycle(
            start_ns,
            NetTime {
                seconds: (start_ns / 1_000_000_000) as u32,
                nanoseconds: 0,
            },
        );
        let end_ns = start_ns + u64::from(self.mn.config.cycle_ns);
        let mut done = 0;
        // Bounded, so that a loop in the managing node is a failed test.
        for _ in 0..4000 {
            match self.mn.poll(self.now_ns) {
                Step::Send(frame) => {
                    let frame = frame.to_vec();
                    self.transmit(frame);
                }
                Step::WaitUntil(until_ns) => {
                    let until_ns = until_ns.min(end_ns);
                    if !self.deliver(until_ns) {
                        self.now_ns = self.now_ns.max(until_ns);
                    }
                    if self.now_ns >= end_ns {
                        break;
                    }
                }
                Step::IsochronousDone => done += 1,
                Step::Idle => break,
            }
        }
        while self.deliver(end_ns) {}
        assert_eq!(done, 1, "IsochronousDone once a cycle, at {start_ns}");
        self.now_ns = end_ns;
        for drive in self.drives.values_mut() {
            drive.poll(end_ns);
        }
        while let Some(event) = self.mn.pop_event() {
            self.events.push(event);
        }
    }

    /// The node at this position is reset, as 0x1F9F asks for.
    fn reset_node(&mut self, node: usize) {
        let network = self.mn.network(self.now_ns);
        let node = self.mn.nodes.get_mut(node).unwrap();
        node.reset(&network, &mut self.mn.events);
    }

    /// Hands in the next frame that arrives by `until_ns`.
    fn deliver(&mut self, until_ns: u64) -> bool {
        if self.coming.is_empty() || self.coming[0].0 > until_ns {
            return false;
        }
        let (at_ns, frame) = self.coming.remove(0);
        self.now_ns = self.now_ns.max(at_ns);
        self.mn.receive(self.now_ns, &frame);
        true
    }

    fn transmit(&mut self, frame: Vec<u8>) {
        self.now_ns += 7 * US;
        self.log.push(OnWire {
            now_ns: self.now_ns,
            source: 240,
            octets: frame.clone(),
        });
        if let Ok(Frame::Asnd(Asnd::NmtCommand(sent))) = Frame::parse(&frame)
            && self.lose_command == Some(sent.command)
        {
            self.lose_command = None;
            return;
        }
        let mut response = [0; FRAME_LEN_MAX];
        for (id, drive) in &mut self.drives {
            let is_asnd = frame[14] == 0x06;
            let mut lost = |is_asnd: bool| match &mut self.lose_asnd {
                Some((random, share)) => is_asnd && random.happens(*share),
                None => false,
            };
            if self.dead.contains(id) || lost(is_asnd) {
                continue;
            }
            let reaction = drive.receive(self.now_ns, &frame, &mut response);
            self.resets.extend(reaction.events.reset.map(|reset| (*id, reset)));
            let Some(len) = reaction.transmit else { continue };
            let answer = response[..len].to_vec();
            if self.refuse_sync && matches!(Frame::parse(&answer), Ok(Frame::Asnd(Asnd::SyncResponse(_)))) {
                continue;
            }
            if matches!(Frame::parse(&answer), Ok(Frame::Pres(_)))
                && let Some(left) = self.lose_pres.get_mut(id).filter(|left| **left > 0)
            {
                *left -= 1;
                continue;
            }
            if lost(answer[14] == 0x06) {
                continue;
            }
            let at_ns = self.now_ns + ANSWER_NS;
            self.log.push(OnWire {
                now_ns: at_ns,
                source: *id,
                octets: answer.clone(),
            });
            self.coming.push((at_ns, answer));
        }
        if let Some(tool) = &mut self.tool
            && let Some(answer) = tool.hear(self.now_ns, &frame)
        {
            let at_ns = self.now_ns + ANSWER_NS;
            self.log.push(OnWire {
                now_ns: at_ns,
                source: answer[16],
                octets: answer.clone(),
            });
            self.coming.push((at_ns, answer));
        }
        self.answer_by_time(&frame);
    }

    /// Chained drives answer our PRes at times of their own.
    fn answer_by_time(&mut self, frame: &[u8]) {
        if !matches!(Frame::parse(frame), Ok(Frame::Pres(_))) {
            return;
        }
        let mut response = [0; FRAME_LEN_MAX];
        for (id, drive) in &mut self.drives {
            let Some(due_ns) = drive.next_deadline_ns().filter(|_| drive.is_chained()) else {
                continue;
            };
            let Some(len) = drive.poll_transmit(due_ns, &mut response) else {
                continue;
            };
            if self.dead.contains(id) {
                continue;
            }
            if let Some(left) = self.lose_pres.get_mut(id).filter(|left| **left > 0) {
                *left -= 1;
                continue;
            }
            let at_ns = due_ns + 7 * US;
            self.log.push(OnWire {
                now_ns: at_ns,
                source: *id,
                octets: response[..len].to_vec(),
            });
            self.coming.push((at_ns, response[..len].to_vec()));
        }
        self.coming.sort_by_key(|(at_ns, _)| *at_ns);
    }

    fn cycles(&mut self, count: usize) {
        for _ in 0..count {
            self.cycle();
        }
    }

    /// Runs until the condition holds; the number of cycles it took.
    fn until(&mut self, most: usize, mut holds: impl FnMut(&Net<'a>) -> bool) -> usize {
        for count in 0..most {
            if holds(self) {
                return count;
            }
            self.cycle();
        }
        panic!(
            "not within {most} cycles; managing node {:?}, stages {:?}, events {:?}",
            self.mn.nmt_state(),
            self.mn
                .nodes
                .iter()
                .map(|node| (node.config.id, node.stage))
                .collect::<Vec<_>>(),
            self.events
        );
    }

    fn all_operational(&self) -> bool {
        let count = self.mn.config.nodes.len();
        (0..count).all(|node| self.mn.node_state(node) == NodeState::Operational)
    }

    fn boot(&mut self) -> usize {
        self.until(2000, Net::all_operational)
    }

    /// NMT commands that were sent, and to whom; an extended one as plain ones to each node of its list.
    fn commands(&self) -> Vec<(u8, NmtCommand)> {
        let mut commands = Vec::new();
        for sent in &self.log {
            if let Frame::Asnd(Asnd::NmtCommand(frame)) = sent.frame() {
                match frame.command.plain() {
                    None => commands.push((sent.octets[15], frame.command)),
                    Some(plain) => {
                        assert_eq!(sent.octets[15], 255);
                        let listed = (1..=239).filter(|id| frame.nodes().contains(*id));
                        commands.extend(listed.map(|id| (id, plain)));
                    }
                }
            }
        }
        commands
    }

    /// Extended NMT commands that were sent.
    fn extended_commands(&self) -> Vec<NmtCommand> {
        let sent = self.log.iter().filter_map(|sent| match sent.frame() {
            Frame::Asnd(Asnd::NmtCommand(frame)) => frame.command.plain().and(Some(frame.command)),
            _ => None,
        });
        sent.collect()
    }

    fn count_events(&self, is: impl Fn(&MnEvent) -> bool) -> usize {
        self.events.iter().filter(|event| is(event)).count()
    }

    /// A frame of a stranger arrives.
    fn hear(&mut self, header: Header, frame: &Frame<'_>) {
        let mut octets = [0; FRAME_LEN_MAX];
        let len = frame.emit(&header, &mut octets).unwrap();
        self.mn.receive(self.now_ns, &octets[..len]);
    }
}

/// The rules of the wire, over everything that was sent: never two polls open, one ASnd a slot and only from whom the SoA
/// invited, order within the cycle. Lost PRes are known to the caller and count as answered.
fn check_order(log: &[OnWire], lost: usize) {
    #[derive(Debug, PartialEq)]
    enum Slot {
        Closed,
        Granted(u8),
        Used,
    }
    // Answers were written down when they were caused; what counts is when they were on the wire.
    let mut log = log.to_vec();
    log.sort_by_key(|sent| sent.now_ns);
    let mut open_poll = None;
    let mut unanswered = 0;
    let mut slot = Slot::Closed;
    let mut polled: Vec<u8> = Vec::new();
    let mut chain_open = false;
    for (position, sent) in log.iter().enumerate() {
        let place = std::format!("frame {position} at {} from {}", sent.now_ns, sent.source);
        match sent.frame() {
            Frame::Soc(_) => {
                assert_eq!(sent.source, 240, "{place}");
                polled.clear();
                unanswered += usize::from(open_poll.take().is_some());
                slot = Slot::Closed;
            }
            Frame::Preq(_) => {
                unanswered += usize::from(open_poll.is_some());
                let target = sent.octets[15];
                assert!(!polled.contains(&target), "{place}: polled twice");
                assert_eq!(slot, Slot::Closed, "{place}: PReq after the SoA");
                polled.push(target);
                chain_open = false;
                open_poll = Some(target);
            }
            Frame::Pres(_) if sent.source == 240 => chain_open = true,
            // Chained nodes send by time, before the first poll.
            Frame::Pres(_) if chain_open && open_poll.is_none() => {}
            Frame::Pres(_) => {
                assert_eq!(open_poll.take(), Some(sent.source), "{place}: PRes nobody asked for");
            }
            Frame::Soa(Soa { service, target, .. }) => {
                unanswered += usize::from(open_poll.take().is_some());
                assert_eq!(service == RequestedService::NoService, target == 0, "{place}");
                slot = Slot::Granted(target);
            }
            Frame::Asnd(_) => {
                assert_eq!(slot, Slot::Granted(sent.source), "{place}: not invited");
                slot = Slot::Used;
            }
            Frame::Amni(_) | Frame::Ainv(_) => panic!("{place}"),
        }
    }
    assert_eq!(unanswered, lost, "polls without an answer");
}
