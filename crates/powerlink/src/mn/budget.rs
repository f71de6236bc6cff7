//! How a cycle is spent: the one sum that says whether a configuration fits its cycle, and what takes how long.
//!
//! In:  the configuration, and the latency of each node where its device file tells it.
//! Out: lines and two sums. *Expected*: every frame at 100 Mbit/s and every node answering after its latency. *Worst*: every
//! poll left unanswered until its time-out, and the asynchronous slot used to its end.
//!
//! Of a multiplexed round the longest cycle counts. The managing node's own computing is not part of it.

use core::fmt;

use super::config::{MnConfig, NodeConfig};
use crate::wire::{FRAME_LEN_MIN, PAYLOAD_LIMIT_MIN, POLL_HEADER_LEN};

/// Room between two frames of the chain beyond the gap of Ethernet: for different lengths of cable, in ns.
pub(super) const GUARD_NS: u32 = 1_000;
/// Octets of the Ethernet header, which the AsyncMTU does not count.
const ETHERNET_HEADER_LEN: usize = 14;

/// Time on a 100 Mbit/s wire of a frame of `octets` without check sequence, in ns: padded to 60 octets, with check sequence (4
/// octets), preamble (8) and gap (12).
pub const fn wire_time_ns(octets: usize) -> u64 {
    let padded = if octets < FRAME_LEN_MIN { FRAME_LEN_MIN } else { octets };
    (padded as u64 + 4 + 8 + 12) * 80
}

/// Octets of a PReq or PRes: its length follows the payload limit, which is never below 36.
const fn poll_octets(payload: u16) -> usize {
    let limit = if (payload as usize) < PAYLOAD_LIMIT_MIN {
        PAYLOAD_LIMIT_MIN
    } else {
        payload as usize
    };
    POLL_HEADER_LEN + limit
}

/// What a part of the cycle is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The SoC.
    Soc,
    /// From the SoC to the first PReq (object 0x1F8A/1).
    SocToPreq,
    /// PReq and PRes of a node that is polled; `octets` are those of the frames.
    Poll {
        /// Position in the configuration.
        node: usize,
        /// Octets of the PReq.
        preq_octets: usize,
        /// Octets of the PRes.
        pres_octets: usize,
        /// Cycle of the round in which it is polled; 0: in each.
        multiplex_cycle: u8,
    },
    /// The managing node's own PRes.
    PresMn {
        /// Octets of the frame.
        octets: usize,
    },
    /// The PRes of a chained node.
    Chained {
        /// Position in the configuration.
        node: usize,
        /// Octets of the PRes.
        octets: usize,
    },
    /// From the managing node's PRes to the first of the chain, and the wait for those that do not come.
    Chain,
    /// The SoA.
    Soa,
    /// The asynchronous slot, in which an ASnd of this many octets has room.
    AsyncSlot {
        /// Octets of the longest ASnd.
        octets: usize,
    },
}

/// One part of the cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BudgetLine {
    /// What it is for.
    pub part: Part,
    /// Frames on the wire, in ns.
    pub wire_ns: u64,
    /// Latency of the node; where it is not known, what its time-out leaves for it, in ns.
    pub latency_ns: u64,
    /// Time that it can take at most, in ns.
    pub worst_ns: u64,
}

impl BudgetLine {
    /// Time that it takes when all goes well, in ns.
    pub const fn expected_ns(&self) -> u64 {
        self.wire_ns + self.latency_ns
    }

    const fn frames(part: Part, wire_ns: u64) -> BudgetLine {
        BudgetLine {
            part,
            wire_ns,
            latency_ns: 0,
            worst_ns: wire_ns,
        }
    }
}

/// The worst cycle by its causes: `41 (frames) + 600 (PRes) + 150 (async slot) = 791 us`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WorstCycle {
    /// SoC, PReqs, SoA, PRes of our own and of the chain, and the pause after the SoC, in ns.
    pub frames_ns: u64,
    /// PRes time-outs, in ns.
    pub pres_ns: u64,
    /// Asynchronous slot, in ns.
    pub async_ns: u64,
}

impl WorstCycle {
    /// All together, in ns.
    pub const fn total_ns(&self) -> u64 {
        self.frames_ns + self.pres_ns + self.async_ns
    }
}

impl fmt::Display for WorstCycle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let us = |ns: u64| ns.div_ceil(1000);
        let (frames, pres, slot) = (us(self.frames_ns), us(self.pres_ns), us(self.async_ns));
        let total = frames + pres + slot;
        write!(
            f,
            "{frames} (frames) + {pres} (PRes) + {slot} (async slot) = {total} us"
        )
    }
}

/// How the cycle of a configuration is spent.
#[derive(Clone, Copy, Debug)]
pub struct Budget<'a> {
    config: &'a MnConfig<'a>,
    latencies_ns: &'a [Option<u32>],
}

impl<'a> Budget<'a> {
    /// The budget of a configuration. `latencies_ns`: per node, in the order of the configuration, the longest time from the end
    /// of a PReq to the start of the PRes (object 0x1F98/3); what is missing is not known.
    pub const fn new(config: &'a MnConfig<'a>, latencies_ns: &'a [Option<u32>]) -> Budget<'a> {
        Budget { config, latencies_ns }
    }

    /// Every part, in the order of the cycle.
    pub fn lines(self) -> impl Iterator<Item = BudgetLine> + 'a {
        let Budget { config, latencies_ns } = self;
        let minimal_ns = wire_time_ns(FRAME_LEN_MIN);
        let soc = BudgetLine::frames(Part::Soc, minimal_ns);
        let wait_ns = u64::from(config.soc_preq_wait_ns);
        let wait = BudgetLine {
            part: Part::SocToPreq,
            wire_ns: 0,
            latency_ns: wait_ns,
            worst_ns: wait_ns,
        };
        let pres_mn = config.pres_mn_bytes.map(|payload| {
            let octets = poll_octets(payload);
            BudgetLine::frames(Part::PresMn { octets }, wire_time_ns(octets))
        });
        let latency = move |node: usize| latencies_ns.get(node).copied().flatten();
        let nodes = config.nodes.iter().enumerate();
        let polled = nodes
            .clone()
            .filter(|(_, node)| !node.assignment.async_only && !node.assignment.chained);
        let polls = polled.map(move |(index, node)| poll(index, node, latency(index)));
        let chained = nodes.filter(|(_, node)| node.assignment.chained);
        let pres = chained.clone().map(|(node, config)| {
            let octets = poll_octets(config.pres_bytes);
            BudgetLine::frames(
                Part::Chained { node, octets },
                wire_time_ns(octets) + u64::from(GUARD_NS),
            )
        });
        // The first of the chain waits for the longest latency that could come first; the last may leave its time-out unused.
        let first_ns = chained
            .clone()
            .map(|(index, node)| latency(index).unwrap_or(node.pres_timeout_ns))
            .max();
        let timeout_ns = chained.map(|(_, node)| node.pres_timeout_ns).max();
        let chain = first_ns.zip(timeout_ns).map(|(first_ns, timeout_ns)| BudgetLine {
            part: Part::Chain,
            wire_ns: 0,
            latency_ns: u64::from(first_ns),
            worst_ns: u64::from(first_ns) + u64::from(timeout_ns),
        });
        let soa = BudgetLine::frames(Part::Soa, minimal_ns);
        let octets = ETHERNET_HEADER_LEN + usize::from(config.async_mtu);
        let slot = BudgetLine {
            part: Part::AsyncSlot { octets },
            wire_ns: wire_time_ns(octets).min(u64::from(config.async_slot_timeout_ns)),
            latency_ns: 0,
            worst_ns: u64::from(config.async_slot_timeout_ns),
        };
        let wait = (wait_ns > 0).then_some(wait);
        [soc]
            .into_iter()
            .chain(wait)
            .chain(pres_mn)
            .chain(chain)
            .chain(pres)
            .chain(polls)
            .chain([soa, slot])
    }

    /// Cycle of the round that can take longest; 0: there is no round.
    pub fn longest_cycle(&self) -> u8 {
        let worst_ns = |cycle| self.sum(cycle, |line| line.worst_ns);
        // Of two that take as long the first: `max_by_key` would take the last.
        (1..=self.config.multiplex_cycles)
            .rev()
            .max_by_key(|cycle| worst_ns(*cycle))
            .unwrap_or(0)
    }

    fn sum(&self, cycle: u8, of: impl Fn(&BudgetLine) -> u64) -> u64 {
        let takes_part = |line: &BudgetLine| match line.part {
            Part::Poll { multiplex_cycle, .. } => multiplex_cycle == 0 || multiplex_cycle == cycle,
            Part::Soc | Part::SocToPreq | Part::PresMn { .. } => true,
            Part::Chained { .. } | Part::Chain | Part::Soa | Part::AsyncSlot { .. } => true,
        };
        self.lines().filter(takes_part).map(|line| of(&line)).sum()
    }

    /// The longest cycle when all goes well, in ns.
    pub fn expected_ns(&self) -> u64 {
        let cycles = 1..=self.config.multiplex_cycles.max(1);
        cycles
            .map(|cycle| self.sum(cycle, BudgetLine::expected_ns))
            .max()
            .unwrap_or(0)
    }

    /// What the longest cycle leaves for the chain, from the end of the managing node's PRes to the last time-out, when nothing
    /// else goes well, in ns.
    pub(super) fn chain_room_ns(&self) -> u64 {
        let others_ns = self.sum(self.longest_cycle(), |line| match line.part {
            Part::Chain | Part::Chained { .. } => 0,
            Part::Soc | Part::SocToPreq | Part::PresMn { .. } => line.worst_ns,
            Part::Poll { .. } | Part::Soa | Part::AsyncSlot { .. } => line.worst_ns,
        });
        u64::from(self.config.cycle_ns).saturating_sub(others_ns)
    }

    /// The longest cycle when nothing goes well.
    pub fn worst(&self) -> WorstCycle {
        let cycle = self.longest_cycle();
        let pres_ns = self.sum(cycle, |line| match line.part {
            Part::Poll { node, .. } => self
                .config
                .nodes
                .get(node)
                .map_or(0, |node| u64::from(node.pres_timeout_ns)),
            Part::Chain => line.worst_ns,
            Part::Soc | Part::SocToPreq | Part::PresMn { .. } => 0,
            Part::Chained { .. } | Part::Soa | Part::AsyncSlot { .. } => 0,
        });
        let async_ns = u64::from(self.config.async_slot_timeout_ns);
        let total_ns = self.sum(cycle, |line| line.worst_ns);
        WorstCycle {
            frames_ns: total_ns - pres_ns - async_ns,
            pres_ns,
            async_ns,
        }
    }
}

fn poll(index: usize, node: &NodeConfig<'_>, latency_ns: Option<u32>) -> BudgetLine {
    let (preq_octets, pres_octets) = (poll_octets(node.preq_bytes), poll_octets(node.pres_bytes));
    let (preq_ns, pres_ns) = (wire_time_ns(preq_octets), wire_time_ns(pres_octets));
    let timeout_ns = u64::from(node.pres_timeout_ns);
    let latency_ns = latency_ns.map_or(timeout_ns.saturating_sub(pres_ns), u64::from);
    BudgetLine {
        part: Part::Poll {
            node: index,
            preq_octets,
            pres_octets,
            multiplex_cycle: node.multiplex_cycle,
        },
        wire_ns: preq_ns + pres_ns,
        latency_ns,
        worst_ns: preq_ns + timeout_ns,
    }
}

#[cfg(test)]
mod tests {
    use super::super::Assignment;
    use super::*;
    use std::string::ToString;
    use std::vec::Vec;

    fn node(id: u8, bytes: u16) -> NodeConfig<'static> {
        NodeConfig {
            id,
            pres_timeout_ns: 100_000,
            preq_bytes: bytes,
            pres_bytes: bytes,
            ..NodeConfig::default()
        }
    }

    #[test]
    fn frames_take_their_time_on_the_wire() {
        // 60 octets and 24 around them at 80 ns; the longest frame takes 123.04 us.
        assert_eq!(wire_time_ns(0), 6_720);
        assert_eq!(wire_time_ns(60), 6_720);
        assert_eq!(wire_time_ns(61), 6_800);
        assert_eq!(wire_time_ns(1514), 123_040);
    }

    #[test]
    fn each_part_has_a_line_and_the_sums_are_those_of_the_lines() {
        let nodes = [node(1, 10), node(2, 100)];
        let config = MnConfig {
            nodes: &nodes,
            soc_preq_wait_ns: 1_000,
            async_mtu: 300,
            pres_mn_bytes: Some(36),
            ..MnConfig::default()
        };
        let budget = Budget::new(&config, &[Some(30_000)]);
        let lines: Vec<_> = budget
            .lines()
            .map(|line| (line.part, line.wire_ns, line.latency_ns, line.worst_ns))
            .collect();
        let poll = |node, octets| Part::Poll {
            node,
            preq_octets: octets,
            pres_octets: octets,
            multiplex_cycle: 0,
        };
        assert_eq!(
            lines,
            [
                (Part::Soc, 6_720, 0, 6_720),
                (Part::SocToPreq, 0, 1_000, 1_000),
                (Part::PresMn { octets: 60 }, 6_720, 0, 6_720),
                (poll(0, 60), 13_440, 30_000, 106_720),
                // Its latency is not known: it may use its time-out.
                (poll(1, 124), 23_680, 88_160, 111_840),
                (Part::Soa, 6_720, 0, 6_720),
                (Part::AsyncSlot { octets: 314 }, 27_040, 0, 100_000),
            ]
        );
        assert_eq!(
            budget.expected_ns(),
            6_720 + 1_000 + 6_720 + 43_440 + 111_840 + 6_720 + 27_040
        );
        let worst = budget.worst();
        assert_eq!(
            (worst.frames_ns, worst.pres_ns, worst.async_ns),
            (39_720, 200_000, 100_000)
        );
        assert_eq!(
            worst.to_string(),
            "40 (frames) + 200 (PRes) + 100 (async slot) = 340 us"
        );
    }

    #[test]
    fn of_a_round_the_longest_cycle_counts() {
        let multiplexed = |id, bytes, multiplex_cycle| NodeConfig {
            multiplex_cycle,
            assignment: Assignment {
                multiplexed: true,
                ..Assignment::default()
            },
            ..node(id, bytes)
        };
        let nodes = [
            node(1, 0),
            multiplexed(2, 0, 1),
            multiplexed(3, 0, 2),
            multiplexed(4, 0, 2),
            multiplexed(5, 0, 3),
        ];
        let config = MnConfig {
            nodes: &nodes,
            multiplex_cycles: 3,
            ..MnConfig::default()
        };
        let budget = Budget::new(&config, &[]);
        assert_eq!(budget.longest_cycle(), 2);
        assert_eq!(
            budget.worst().pres_ns,
            300_000,
            "node 1 in each cycle, 3 and 4 in the second"
        );
        let none = MnConfig {
            nodes: &nodes[..1],
            ..MnConfig::default()
        };
        assert_eq!(Budget::new(&none, &[]).longest_cycle(), 0);
    }

    #[test]
    fn a_chain_waits_once_and_nodes_that_are_not_polled_cost_nothing() {
        let chained = |id| NodeConfig {
            assignment: Assignment {
                chained: true,
                ..Assignment::default()
            },
            ..node(id, 0)
        };
        let only_async = Assignment {
            async_only: true,
            ..Assignment::default()
        };
        let nodes = [
            chained(1),
            chained(2),
            NodeConfig {
                assignment: only_async,
                ..node(3, 0)
            },
        ];
        let config = MnConfig {
            nodes: &nodes,
            pres_mn_bytes: Some(0),
            ..MnConfig::default()
        };
        let latencies_ns = [Some(5_000), Some(8_000)];
        let budget = Budget::new(&config, &latencies_ns);
        assert_eq!(budget.lines().count(), 7);
        let worst = budget.worst();
        // SoC, PResMN, SoA, and two PRes with the room between them.
        assert_eq!(worst.frames_ns, 5 * 6_720 + 2 * u64::from(GUARD_NS));
        assert_eq!(worst.pres_ns, 108_000);
    }
}
