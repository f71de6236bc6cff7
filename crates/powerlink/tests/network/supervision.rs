//! What a controlled node has to count of its managing node's frames, worked out from the frames alone.
//!
//! In:  every frame a node hears, the time, its NMT state. Out: nothing, or a panic where its objects 0x1C0B (loss of SoC),
//! 0x1C0C (loss of SoA), 0x1C0D (loss of PReq) hold something else, or where it leaves the cycle without a threshold that was
//! reached (or stays in it with one).
//!
//! The model runs while a node exchanges process data (READY_TO_OPERATE, OPERATIONAL); when it begins to, the model takes the
//! counters over as they are.

use obd::Key;
use powerlink::nmt::NmtState;
use powerlink::wire::{Frame, Header, node};

use super::device::Node;
use super::watch::may_be;

/// One threshold counter: +8 for an error, -1 for a good cycle, back to 0 at the threshold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counter {
    pub cumulative: u32,
    pub count: u32,
}

impl Counter {
    /// True at the threshold; 0 switches it off.
    pub fn error(&mut self, threshold: u32) -> bool {
        self.cumulative += 1;
        if threshold > 0 {
            self.count += 8;
        }
        let reached = threshold > 0 && self.count >= threshold;
        if reached {
            self.count = 0;
        }
        reached
    }

    pub fn good(&mut self) {
        self.count = self.count.saturating_sub(1);
    }
}

/// Where a node keeps cumulative count, threshold count and threshold.
#[derive(Clone, Copy)]
struct Keys([[Key<u32>; 3]; 3]);

/// The model of one node.
pub struct Supervision {
    keys: Keys,
    id: u8,
    running: bool,
    soc: Counter,
    soa: Counter,
    preq: Counter,
    thresholds: [u32; 3],
    cycle_ns: u64,
    tolerance_ns: u64,
    soc_due_ns: Option<u64>,
    /// When the last one came, and its RelativeTime.
    last_soc: Option<(u64, u64)>,
    soa_due: bool,
    polled: bool,
    /// The last PReq was one of every cycle.
    every_cycle: bool,
    /// A threshold was reached in this call.
    reached: bool,
}

impl Supervision {
    pub fn new(node: &Node, id: u8) -> Supervision {
        let keys = |index| [1, 2, 3].map(|sub| node.dictionary().key(index, sub).unwrap());
        Supervision {
            keys: Keys([keys(0x1C0B), keys(0x1C0C), keys(0x1C0D)]),
            id,
            running: false,
            soc: Counter::default(),
            soa: Counter::default(),
            preq: Counter::default(),
            thresholds: [0; 3],
            cycle_ns: 0,
            tolerance_ns: 0,
            soc_due_ns: None,
            last_soc: None,
            soa_due: false,
            polled: false,
            every_cycle: false,
            reached: false,
        }
    }

    /// Time has come this far, before the node is told so.
    pub fn time(&mut self, now_ns: u64) {
        self.reached = false;
        // A length of 0 switches the watch off.
        let watched = self.cycle_ns > 0;
        while let Some(due_ns) = self.soc_due_ns.filter(|due_ns| watched && *due_ns <= now_ns) {
            self.soc_due_ns = Some(due_ns + self.cycle_ns);
            if self.running {
                self.reached |= self.soc.error(self.thresholds[0]);
                if !self.reached {
                    self.judge_soa();
                }
                self.running &= !self.reached;
            } else {
                self.soa_due = false;
            }
        }
    }

    fn judge_soa(&mut self) {
        if std::mem::take(&mut self.soa_due) {
            self.reached |= self.soa.error(self.thresholds[1]);
        }
    }

    /// The node has heard this frame; `time` was called before.
    pub fn frame(&mut self, now_ns: u64, octets: &[u8]) {
        let (Ok(header), Ok(frame)) = (Header::parse(octets), Frame::parse(octets)) else {
            return;
        };
        if header.source_node != node::MN || !may_be(octets) {
            return;
        }
        match frame {
            Frame::Soc(soc) => {
                // A doubled SoC is no new cycle: it comes within half a cycle and its time does not go on.
                let repeated = self.last_soc.is_some_and(|(at_ns, time_us)| {
                    now_ns - at_ns < self.cycle_ns / 2 && soc.relative_time_us <= time_us
                });
                if repeated {
                    return;
                }
                self.last_soc = Some((now_ns, soc.relative_time_us));
                if self.running {
                    self.soc.good();
                    self.judge_soa();
                    let missed = self.every_cycle && !self.polled && !self.reached;
                    self.reached |= missed && self.preq.error(self.thresholds[2]);
                    self.running &= !self.reached;
                }
                self.soc_due_ns = Some(now_ns + self.cycle_ns + self.tolerance_ns);
                self.soa_due = true;
                self.polled = false;
            }
            Frame::Soa(_) => {
                let was_due = std::mem::take(&mut self.soa_due);
                if was_due && self.running {
                    self.soa.good();
                }
            }
            Frame::Preq(preq) if header.destination_node == self.id => {
                // No node of these tests is multiplexed; damaged flags may say so until the next PReq.
                (self.polled, self.every_cycle) = (true, !preq.multiplexed);
                if self.running {
                    self.preq.good();
                }
            }
            _ => {}
        }
    }

    /// The node has dealt with it.
    pub fn compare(&mut self, now_ns: u64, node: &Node) {
        let exchanges = matches!(node.nmt_state(), NmtState::ReadyToOperate | NmtState::Operational);
        let id = self.id;
        if self.reached {
            assert!(!exchanges, "{now_ns}: node {id} stays in the cycle at its threshold");
        }
        if self.running && exchanges {
            let counters = self.read(node, [0, 1]);
            let model = [self.soc, self.soa, self.preq].map(|counter| [counter.cumulative, counter.count]);
            assert_eq!(
                counters, model,
                "{now_ns}: 0x1C0B, 0x1C0C, 0x1C0D of node {id} (left) and what it has heard"
            );
        }
        if exchanges && !self.running {
            self.take_over(node);
        }
        if node.nmt_state() == NmtState::NotActive {
            // Where every reset ends.
            self.activate(node);
        }
        if !node.nmt_state().is_isochronous() {
            // Out of the cycle nothing is due, and who polls is forgotten.
            (self.soc_due_ns, self.soa_due, self.polled, self.every_cycle) = (None, false, false, false);
            self.last_soc = None;
        }
        self.running = exchanges;
        self.reached = false;
    }

    fn read<const N: usize>(&self, node: &Node, subs: [usize; N]) -> [[u32; N]; 3] {
        self.keys.0.map(|keys| subs.map(|sub| node.dictionary().get(keys[sub])))
    }

    fn take_over(&mut self, node: &Node) {
        let [soc, soa, preq] = self
            .read(node, [0, 1])
            .map(|[cumulative, count]| Counter { cumulative, count });
        (self.soc, self.soa, self.preq) = (soc, soa, preq);
        self.thresholds = self.read(node, [2]).map(|[threshold]| threshold);
        // The last SoC came before these were known; without a cycle length it was no start of a watch.
        let last_ns = self.soc_due_ns.map(|due_ns| due_ns - self.cycle_ns - self.tolerance_ns);
        let last_ns = last_ns.filter(|_| self.cycle_ns > 0);
        self.activate(node);
        self.soc_due_ns = last_ns.map(|last_ns| last_ns + self.cycle_ns + self.tolerance_ns);
    }

    /// The values of the dictionary hold from now on.
    fn activate(&mut self, node: &Node) {
        let read = |index| {
            let octets = node.dictionary().read(index, 0).unwrap();
            u64::from(u32::from_le_bytes(octets.try_into().unwrap()))
        };
        (self.cycle_ns, self.tolerance_ns) = (read(0x1006) * 1_000, read(0x1C14));
    }
}
