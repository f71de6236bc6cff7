//! The observer: knows the rules of the wire by itself, sees every frame and every call, and stops the test at the first
//! thing that is not allowed.
//!
//! In:  what the managing node and the nodes send and hear. Out: nothing, or a panic that says what is wrong and when.
//!
//! A frame that was sent because of a fault (its cause was doubled, held back, damaged, or sent by an intruder) is excused
//! from the rules of order, and so is for a cycle what a managing node sends that such a frame has misled; everything else has to keep them whatever the wire does.

use std::collections::VecDeque;

use powerlink::link::simulated::{Arrival, Collision, Faults, Station};
use powerlink::mn::MnEvent;
use powerlink::nmt::{NmtCommand, NmtState};
use powerlink::wire::{Asnd, Frame, Header, node};

use super::device::{ANSWER_NS, MN_MAC, PRES_TIMEOUT_NS, Pattern, Polling};
use super::supervision::Counter;
use super::world::{Mn, PRES_LOST_MAX, Setup};

/// A poll that is not over yet.
#[derive(Clone, Copy, Debug)]
struct Outstanding {
    node: usize,
    /// Known once the managing node has come back from sending.
    deadline_ns: Option<u64>,
}

/// The asynchronous slot since the last SoA.
#[derive(Clone, Copy, Debug)]
struct Slot {
    target: u8,
    used: bool,
}

/// What the managing node should have counted for a node.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct NodeModel {
    preq_sent: u64,
    pres_received: u64,
    pres_lost: u64,
    lost_in_row: u32,
    lost_in_row_max: u32,
    loss_of_pres: Counter,
    polled_in_cycle: bool,
    /// PReqs that may still be answered on the wire: two only if a late cycle was cut off.
    asked: u32,
    asked_ns: u64,
    /// The row has become too long in this cycle.
    lost: Option<u32>,
    /// What the last taken PRes brought may be somebody else's.
    misled: bool,
    /// Cycle of the newest input.
    input_cycle: Option<u32>,
}

/// What the managing node should have counted for itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct MnModel {
    cycles: u64,
    soa_sent: u64,
    asnd_sent: u64,
    malformed: u64,
    own_frames: u64,
    foreign_mn_frames: u64,
}

/// Whether the standard lets this sender send this frame to this receiver. By octets, as the wire has them.
pub fn may_be(octets: &[u8]) -> bool {
    let [kind, to, from] = [octets[14] & 0x7F, octets[15], octets[16]];
    match (kind, from) {
        (1 | 5, 240) => to == 255,
        (3, 240) => matches!(to, 1..=239),
        (4, 1..=240) => to == 255,
        (6, 1..=240 | 253 | 254) | (0x0D, 240) => matches!(to, 1..=240 | 253..=255),
        (7, 241..=250) => to == 255,
        _ => false,
    }
}

/// Lines of the log that a failed test shows.
const LOG_LEN: usize = 100;
/// Octets of each frame in the log, from the message type on.
const LOG_OCTETS: std::ops::Range<usize> = 14..40;

/// How long a frame that was sent because of a fault is on the wire and in the way of others, at most: the longest frame there and
/// through.
const EXCUSED_NS: u64 = 200_000;

/// One frame, sent or heard.
struct Line {
    now_ns: u64,
    who: &'static str,
    station: usize,
    octets: [u8; LOG_OCTETS.end - LOG_OCTETS.start],
    faults: Faults,
}

/// The observer of one network.
pub struct Watch {
    log: VecDeque<Line>,
    ids: Vec<u8>,
    chained: Vec<bool>,
    /// The managing node has sent a PRes of its own in this cycle.
    pres_mn_seen: bool,
    timeout_ns: u64,
    cycle_ns: u64,
    pres_lost_max: u32,
    pres_threshold: u32,
    cycle_started_ns: u64,
    relative_time_us: Option<(u64, u64)>,
    soc_seen: bool,
    soa_seen: bool,
    /// The SoA of the cycle before, which was cut off, has to come before the next SoC.
    soa_owed: bool,
    outstanding: Option<Outstanding>,
    slot: Slot,
    mn: MnModel,
    mn_state: NmtState,
    /// Answers heard in NOT_ACTIVE, by node.
    unasked: [u64; 256],
    nodes: Vec<NodeModel>,
    /// The managing node was shown a frame that should not have been there, and may send too early until then.
    misled_until_ns: u64,
    /// What each station sends may be the consequence of a fault until then.
    excused_until_ns: Vec<u64>,
}

impl Watch {
    pub fn new(ids: &[u8], stations: usize, setup: &Setup) -> Watch {
        Watch {
            log: VecDeque::with_capacity(LOG_LEN),
            ids: ids.to_vec(),
            chained: ids
                .iter()
                .map(|id| matches!(setup.polling_of(*id), Polling::Chained { .. }))
                .collect(),
            pres_mn_seen: false,
            timeout_ns: u64::from(PRES_TIMEOUT_NS),
            cycle_ns: setup.cycle_ns,
            pres_lost_max: PRES_LOST_MAX,
            pres_threshold: setup.pres_threshold,
            cycle_started_ns: 0,
            relative_time_us: None,
            soc_seen: false,
            soa_seen: false,
            soa_owed: false,
            outstanding: None,
            slot: Slot { target: 0, used: true },
            mn: MnModel::default(),
            mn_state: NmtState::NotActive,
            unasked: [0; 256],
            nodes: vec![NodeModel::default(); ids.len()],
            misled_until_ns: 0,
            excused_until_ns: vec![0; stations],
        }
    }

    fn note(&mut self, now_ns: u64, who: &'static str, station: Station, frame: &[u8], faults: Faults) {
        if self.log.len() == LOG_LEN {
            self.log.pop_front();
        }
        let mut octets = [0; LOG_OCTETS.end - LOG_OCTETS.start];
        for (to, from) in octets.iter_mut().zip(frame.iter().skip(LOG_OCTETS.start)) {
            *to = *from;
        }
        self.log.push_back(Line {
            now_ns,
            who,
            station: station.index(),
            octets,
            faults,
        });
    }

    fn excuse(&mut self, now_ns: u64, station: Station) {
        self.excused_until_ns[station.index()] = now_ns + EXCUSED_NS;
    }

    fn index(&self, id: u8) -> Option<usize> {
        self.ids.iter().position(|known| *known == id)
    }

    /// The caller begins a cycle; `late`: it was kept from doing so in time.
    pub fn cycle_starts(&mut self, now_ns: u64, late: bool) {
        if late {
            // A late cycle that is cut off may leave an answer on its way, which is then taken for that of the next poll.
            self.misled_until_ns = now_ns + self.cycle_ns;
        }
        if self.mn_state.is_isochronous() {
            if let Some(Outstanding { node, .. }) = self.outstanding.take() {
                assert!(
                    late,
                    "{now_ns}: the cycle ended while node {} was polled",
                    self.ids[node]
                );
                self.poll_lost(node);
            }
            assert!(
                late || self.soa_seen || !self.soc_seen,
                "{now_ns}: a cycle without SoA, begun at {}",
                self.cycle_started_ns
            );
            self.soa_owed |= self.soc_seen && !self.soa_seen;
        }
        self.cycle_started_ns = now_ns;
        self.soc_seen = false;
        self.soa_seen = false;
        self.pres_mn_seen = false;
        for node in &mut self.nodes {
            node.polled_in_cycle = false;
        }
    }

    /// The managing node is asked what to do.
    pub fn mn_polled(&mut self, now_ns: u64) {
        if let Some(Outstanding { node, deadline_ns }) = &mut self.outstanding {
            let deadline_ns = *deadline_ns.get_or_insert(now_ns + self.timeout_ns);
            if now_ns >= deadline_ns {
                let node = *node;
                self.outstanding = None;
                self.poll_lost(node);
            }
        }
    }

    fn poll_lost(&mut self, node: usize) {
        let (pres_lost_max, threshold) = (self.pres_lost_max, self.pres_threshold);
        let node = &mut self.nodes[node];
        node.pres_lost += 1;
        node.lost_in_row += 1;
        node.lost_in_row_max = node.lost_in_row_max.max(node.lost_in_row);
        let reached = node.loss_of_pres.error(threshold);
        if node.lost_in_row > pres_lost_max || reached {
            node.lost = Some(node.lost_in_row);
        }
    }

    /// The managing node sends.
    pub fn mn_sends(&mut self, now_ns: u64, station: Station, octets: &[u8]) {
        let header =
            Header::parse(octets).unwrap_or_else(|error| panic!("{now_ns}: the MN sent {octets:02x?}: {error}"));
        assert_eq!((header.source, header.source_node), (MN_MAC, node::MN), "{now_ns}");
        if now_ns < self.misled_until_ns {
            self.excuse(now_ns, station);
        }
        self.note(now_ns, "MN sends", station, octets, Faults::default());
        if let Some(Outstanding { node, .. }) = self.outstanding {
            panic!(
                "{now_ns}: the MN sends while node {} is polled: {octets:02x?}",
                self.ids[node]
            );
        }
        match Frame::parse(octets).unwrap() {
            Frame::Soc(soc) => {
                assert!(
                    self.mn_state.is_isochronous() && !self.soc_seen && !self.soa_seen && !self.soa_owed,
                    "{now_ns}: SoC"
                );
                if let Some((last_ns, last_us)) = self.relative_time_us {
                    let cycles = (self.cycle_started_ns - last_ns + self.cycle_ns / 2) / self.cycle_ns;
                    let expected = last_us + cycles.max(1) * self.cycle_ns / 1_000;
                    assert_eq!(soc.relative_time_us, expected, "{now_ns}: RelativeTime");
                }
                self.relative_time_us = Some((self.cycle_started_ns, soc.relative_time_us));
                self.soc_seen = true;
                self.mn.cycles += 1;
            }
            Frame::Preq(_) => {
                let index = self.index(header.destination_node);
                let index = index.unwrap_or_else(|| panic!("{now_ns}: PReq to {}", header.destination_node));
                assert!(
                    self.soc_seen && !self.soa_seen,
                    "{now_ns}: PReq outside of the isochronous phase"
                );
                let node = &mut self.nodes[index];
                assert!(
                    !node.polled_in_cycle,
                    "{now_ns}: second PReq to node {}",
                    self.ids[index]
                );
                node.polled_in_cycle = true;
                node.preq_sent += 1;
                // A node that has not answered until now will not.
                let may_answer = now_ns < node.asked_ns + 4 * ANSWER_NS;
                node.asked = if may_answer { node.asked + 1 } else { 1 };
                node.asked_ns = now_ns;
                self.outstanding = Some(Outstanding {
                    node: index,
                    deadline_ns: None,
                });
            }
            Frame::Soa(soa) => {
                let isochronous = self.mn_state.is_isochronous();
                assert_eq!(soa.nmt_state, self.mn_state, "{now_ns}: state in the SoA");
                if isochronous && std::mem::take(&mut self.soa_owed) {
                    assert!(
                        soa.target == 0 && !self.soc_seen,
                        "{now_ns}: {soa:?} of the cycle before"
                    );
                } else {
                    assert!(!isochronous || (self.soc_seen && !self.soa_seen), "{now_ns}: SoA");
                    self.soa_seen = true;
                }
                self.soa_owed = false;
                self.mn.soa_sent += 1;
                self.slot = Slot {
                    target: soa.target,
                    used: false,
                };
            }
            Frame::Asnd(_) => {
                assert!(
                    self.slot.target == node::MN && !self.slot.used,
                    "{now_ns}: ASnd of the MN in {:?}",
                    self.slot
                );
                self.slot.used = true;
                self.mn.asnd_sent += 1;
            }
            Frame::Pres(_) => {
                assert!(
                    self.soc_seen && !self.soa_seen && !self.pres_mn_seen,
                    "{now_ns}: PRes of the MN"
                );
                self.pres_mn_seen = true;
            }
            Frame::Amni(_) | Frame::Ainv(_) => panic!("{now_ns}: the MN sent {octets:02x?}"),
        }
    }

    /// The managing node is handed a frame.
    pub fn mn_hears(&mut self, now_ns: u64, octets: &[u8], arrival: &Arrival, intruder: bool) {
        self.note(now_ns, "MN hears, from", arrival.from, octets, arrival.faults);
        if arrival.faults.any() || intruder || now_ns < self.excused_until_ns[arrival.from.index()] {
            self.misled_until_ns = now_ns + self.cycle_ns;
        }
        let frame = match Frame::parse(octets) {
            Ok(frame) if may_be(octets) => frame,
            Ok(_) | Err(_) => {
                self.mn.malformed += 1;
                return;
            }
        };
        let header = Header::parse(octets).unwrap();
        if header.source == MN_MAC {
            self.mn.own_frames += 1;
            return;
        }
        if (240..=250).contains(&header.source_node) {
            self.mn.foreign_mn_frames += 1;
            return;
        }
        if self.mn_state == NmtState::NotActive {
            let answers = &mut self.unasked[usize::from(header.source_node)];
            *answers += 1;
            self.mn.foreign_mn_frames += u64::from(*answers > 2);
            return;
        }
        match frame {
            Frame::Pres(_) => {
                let Some(Outstanding { node, .. }) = self.outstanding else {
                    return;
                };
                if self.ids[node] == header.source_node {
                    self.outstanding = None;
                    let node = &mut self.nodes[node];
                    node.pres_received += 1;
                    node.loss_of_pres.good();
                    node.lost_in_row = 0;
                    node.misled = arrival.faults.any() || intruder;
                }
            }
            Frame::Soc(_) | Frame::Preq(_) | Frame::Soa(_) | Frame::Amni(_) | Frame::Asnd(_) | Frame::Ainv(_) => {}
        }
    }

    /// Inputs are complete.
    pub fn inputs(&mut self, now_ns: u64, mn: &Mn) {
        for (index, (id, model)) in self.ids.iter().zip(&mut self.nodes).enumerate() {
            if self.chained[index] {
                continue;
            }
            let input = mn.input(index);
            let pattern = Pattern::from_octets(input.data);
            if input.data.iter().all(|octet| *octet == 0) || model.misled {
                continue;
            }
            assert!(pattern.is_whole(*id), "{now_ns}: torn input of node {id}: {pattern:x?}");
            if let Some(newest) = model.input_cycle {
                assert!(
                    pattern.cycle() >= newest,
                    "{now_ns}: stale input of node {id}: {pattern:x?} after {newest:x}"
                );
            }
            model.input_cycle = Some(pattern.cycle());
            assert_eq!(
                input.lost_in_row, model.lost_in_row,
                "{now_ns}: lost in a row, node {id}"
            );
            assert!(
                !input.fresh || model.polled_in_cycle,
                "{now_ns}: fresh input without a poll, node {id}"
            );
        }
    }

    /// The managing node has reported something.
    pub fn event(&mut self, now_ns: u64, event: &MnEvent) {
        use NmtState::{NotActive, Off, Operational, PreOperational1, PreOperational2, ReadyToOperate};
        match *event {
            MnEvent::NmtStateChanged { state } => {
                let legal = matches!(
                    (self.mn_state, state),
                    (NotActive, PreOperational1)
                        | (PreOperational1, PreOperational2)
                        | (PreOperational2, ReadyToOperate | PreOperational1)
                        | (ReadyToOperate, Operational | PreOperational1)
                        | (Operational, PreOperational1)
                        | (_, Off)
                );
                assert!(legal, "{now_ns}: the MN went from {:?} to {state:?}", self.mn_state);
                self.mn_state = state;
            }
            MnEvent::Lost { node, in_row } => {
                let index = self.index(node).unwrap();
                let model = &mut self.nodes[index];
                match model.lost.take() {
                    Some(expected) => assert_eq!(in_row, expected, "{now_ns}: node {node} lost"),
                    None => {
                        assert!(!model.polled_in_cycle, "{now_ns}: node {node} lost, but it was polled");
                        model.lost_in_row = 0;
                    }
                }
            }
            MnEvent::Identified { node }
            | MnEvent::IdentityMismatch { node, .. }
            | MnEvent::BootTimeout { node, .. }
            | MnEvent::SdoAbort { node, .. }
            | MnEvent::SdoFailed { node, .. }
            | MnEvent::WrongState { node, .. } => {
                let index = self.index(node).unwrap();
                self.nodes[index].lost_in_row = 0;
                if matches!(event, MnEvent::Identified { .. }) {
                    // A node that was switched off counts on from where it is told to.
                    self.nodes[index].input_cycle = None;
                }
            }
            _ => {}
        }
    }

    /// The cycle is over, all events are taken.
    pub fn cycle_ends(&mut self, now_ns: u64, mn: &Mn) {
        assert_eq!(mn.nmt_state(), self.mn_state, "{now_ns}: state without an event");
        let counters = mn.counters();
        let counted = MnModel {
            cycles: counters.cycles,
            soa_sent: counters.soa_sent,
            asnd_sent: counters.asnd_sent,
            malformed: counters.malformed.total(),
            own_frames: counters.own_frames,
            foreign_mn_frames: counters.foreign_mn_frames,
        };
        assert_eq!(
            counted, self.mn,
            "{now_ns}: counters of the MN (left) and what was on the wire"
        );
        assert_eq!(counters.events_dropped, 0, "{now_ns}");
        for (index, (id, model)) in self.ids.iter().zip(&self.nodes).enumerate() {
            if self.chained[index] {
                continue;
            }
            let statistics = mn.statistics(index);
            let counted = (
                statistics.preq_sent,
                statistics.pres_received,
                statistics.pres_lost,
                statistics.lost_in_row_max,
            );
            let expected = (
                model.preq_sent,
                model.pres_received,
                model.pres_lost,
                model.lost_in_row_max,
            );
            assert_eq!(
                counted, expected,
                "{now_ns}: PReq, PRes, lost, longest row of node {id}"
            );
            let counted = (statistics.loss_of_pres.cumulative, statistics.loss_of_pres.count);
            let expected = (model.loss_of_pres.cumulative, model.loss_of_pres.count);
            assert_eq!(counted, expected, "{now_ns}: 0x1C07, 0x1C08 of node {id}");
            assert_eq!(model.lost, None, "{now_ns}: node {id} was lost, and no event says so");
        }
    }

    /// A controlled node sends because of what has arrived.
    pub fn node_sends(&mut self, now_ns: u64, id: u8, state: NmtState, octets: &[u8], cause: &Arrival, excused: bool) {
        self.note(now_ns, "node sends", cause.to, octets, cause.faults);
        let excused = excused || cause.faults.any();
        if excused {
            self.excuse(now_ns, cause.to);
        }
        let header = Header::parse(octets).unwrap();
        assert_eq!(header.source_node, id, "{now_ns}");
        match Frame::parse(octets).unwrap() {
            Frame::Pres(pres) => {
                assert!(state.is_isochronous(), "{now_ns}: PRes of node {id} in {state:?}");
                assert_eq!(pres.nmt_state, state, "{now_ns}: state in the PRes of node {id}");
                assert_eq!(
                    pres.ready,
                    state == NmtState::Operational,
                    "{now_ns}: RD of node {id} in {state:?}"
                );
                if !excused {
                    let index = self.index(id).unwrap();
                    let asked = &mut self.nodes[index].asked;
                    assert!(*asked > 0, "{now_ns}: PRes of node {id} unasked");
                    *asked -= 1;
                }
            }
            Frame::Asnd(asnd) => {
                assert!(
                    !matches!(asnd, Asnd::NmtCommand(_)),
                    "{now_ns}: NMT command of node {id}"
                );
                // A managing node that was misled may have begun the next slot too early.
                if !excused && now_ns >= self.misled_until_ns {
                    let allowed = self.slot.target == id && !self.slot.used;
                    assert!(allowed, "{now_ns}: ASnd of node {id} in {:?}", self.slot);
                    self.slot.used = true;
                }
            }
            Frame::Soc(_) | Frame::Preq(_) | Frame::Soa(_) | Frame::Amni(_) | Frame::Ainv(_) => {
                panic!("{now_ns}: node {id} sent {octets:02x?}")
            }
        }
    }

    /// A chained node sends by time.
    pub fn chained_sends(&mut self, now_ns: u64, id: u8, station: Station, state: NmtState, octets: &[u8]) {
        self.note(now_ns, "node sends", station, octets, Faults::default());
        let Frame::Pres(pres) = Frame::parse(octets).unwrap() else {
            panic!("{now_ns}: node {id} sent {octets:02x?} by time")
        };
        assert!(
            self.pres_mn_seen && !self.soa_seen,
            "{now_ns}: node {id} out of the chain"
        );
        assert_eq!(
            (pres.nmt_state, pres.ready),
            (state, state == NmtState::Operational),
            "{now_ns}: node {id}"
        );
    }

    /// A controlled node is in a new state, because of a frame or (without one) because of the time.
    pub fn node_state(&self, now_ns: u64, id: u8, from: NmtState, to: NmtState, cause: Option<&[u8]>) {
        use NmtState::{
            BasicEthernet, NotActive, Operational, PreOperational1, PreOperational2, ReadyToOperate, Stopped,
        };
        let frame = cause.and_then(|octets| Frame::parse(octets).ok());
        let command = match frame {
            Some(Frame::Asnd(Asnd::NmtCommand(command))) => Some(command.command),
            _ => None,
        };
        let plain = command.map(|command| command.plain().unwrap_or(command));
        let legal = match (from, to) {
            (_, NotActive) => match plain {
                Some(NmtCommand::ResetNode | NmtCommand::ResetCommunication) => true,
                Some(NmtCommand::ResetConfiguration | NmtCommand::SwReset) => true,
                // By a write to 0x1F9E, carried out when the answer has left.
                Some(_) | None => false,
            },
            (NotActive, BasicEthernet) => frame.is_none(),
            (NotActive, PreOperational1) => matches!(frame, Some(Frame::Soc(_) | Frame::Soa(_))),
            (BasicEthernet, PreOperational1) => {
                matches!(
                    frame,
                    Some(Frame::Soc(_) | Frame::Soa(_) | Frame::Preq(_) | Frame::Pres(_))
                )
            }
            (PreOperational1, PreOperational2) => matches!(frame, Some(Frame::Soc(_))),
            (PreOperational2, ReadyToOperate) => plain == Some(NmtCommand::EnableReadyToOperate),
            (ReadyToOperate, Operational) => plain == Some(NmtCommand::StartNode),
            (Operational | Stopped, PreOperational2) => plain == Some(NmtCommand::EnterPreOperational2),
            (PreOperational2 | ReadyToOperate | Operational, Stopped) => plain == Some(NmtCommand::StopNode),
            (PreOperational2 | ReadyToOperate | Operational | Stopped, PreOperational1) => command.is_none(),
            _ => false,
        };
        assert!(legal, "{now_ns}: node {id} went from {from:?} to {to:?} by {frame:?}");
    }

    /// Two frames have met on the wire.
    pub fn collision(&self, collision: Collision) {
        let excused = |station: &Station| collision.at_ns < self.excused_until_ns[station.index()];
        let misled = collision.at_ns < self.misled_until_ns;
        let excused = misled || collision.stations.iter().any(excused);
        assert!(excused, "two frames on the wire at once: {collision:?}");
    }

    /// A station that keeps no rules sends.
    pub fn intruder_sends(&mut self, now_ns: u64, station: Station, octets: &[u8]) {
        self.note(now_ns, "intruder sends", station, octets, Faults::default());
        self.excuse(now_ns, station);
    }
}

impl Drop for Watch {
    /// A test that fails shows what was on the wire before.
    fn drop(&mut self) {
        if std::thread::panicking() {
            for Line {
                now_ns,
                who,
                station,
                octets,
                faults,
            } in &self.log
            {
                eprintln!(
                    "{now_ns:>14} {who:>14} {station} {octets:02x?} {}",
                    if faults.any() { "after a fault" } else { "" }
                );
            }
        }
    }
}
