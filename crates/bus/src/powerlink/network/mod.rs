//! What each node is told before it may take part: its concise DCF.
//!
//! In:  the checked machine description, with the device files of the nodes.
//! Out: payload layouts and configuration writes per node, in the order in which the nodes want them: what the network needs,
//! process data, what the device file holds, the drive, what the machine file adds. Of two writes of one object the later counts.

use super::managing_node::{exchanges, pres_mn_octets};
use crate::configuration::Configuration;
use crate::layout::Layout;
use crate::plan::{LeftOut, LeftOutReason, NodePlan};
use config::{Bus, Config, ConfigurationWrite, Exchange, Mapped, Node, Stamp};
use obd::cdc::CdcWriter;
use obd::mapping::MappingEntry;
use powerlink::nmt::NmtState;
use powerlink::wire::{PAYLOAD_LIMIT_MIN, node::MN};

/// States that a node can tell.
pub fn node_states() -> impl Iterator<Item = String> {
    NmtState::ALL.iter().map(ToString::to_string)
}

/// Plans of all nodes, in the order of the machine file.
pub fn plan(config: &Config) -> Vec<NodePlan> {
    let exchanges = exchanges(&config.bus);
    let pres_mn_octets = pres_mn_octets(&exchanges).unwrap_or(0);
    let nodes = config.bus.nodes.iter().zip(&exchanges).enumerate();
    nodes
        .map(|(index, (node, exchange))| {
            let mut dcf = Configuration::new(node.device.as_ref(), node.drive.as_ref());
            dcf.network(config, node);
            let pres_mn = PresMn {
                octets: pres_mn_octets,
                offset: exchange.pres_mn_offset,
            };
            dcf.process_data(&config.bus, node, pres_mn);
            dcf.device_file(node);
            dcf.application(config, index);
            let stamp = dcf.stamp();
            let expected = dcf.expected(config, index);
            NodePlan {
                expected,
                stamp,
                outputs: Layout::new(&node.outputs),
                inputs: Layout::new(&node.inputs),
                configuration: concise_dcf(&dcf.writes),
                writes: dcf.writes,
                left_out: dcf.left_out,
            }
        })
        .collect()
}

/// The octets of a concise DCF.
fn concise_dcf(writes: &[ConfigurationWrite]) -> Vec<u8> {
    /// Count in front of all, header of each write.
    const OCTETS: [usize; 2] = [4, 7];
    let length: usize = writes.iter().map(|write| OCTETS[1] + write.value.len()).sum();
    let mut octets = vec![0; OCTETS[0] + length];
    let mut dcf = CdcWriter::new(&mut octets).expect("there is room for the count");
    for write in writes {
        dcf.push(write.index, write.sub, &write.value)
            .expect("the length was summed up");
    }
    dcf.finish().to_vec()
}

/// Hash of octets, the same on every machine (Fowler, Noll, Vo: FNV-1a of 64 bits).
fn fnv_1a(octets: &[u8]) -> u64 {
    let step = |hash: u64, octet: &u8| (hash ^ u64::from(*octet)).wrapping_mul(0x0000_0100_0000_01B3);
    octets.iter().fold(0xCBF2_9CE4_8422_2325, step)
}

/// What the error counters of POWERLINK add for each loss; each good cycle takes one back.
pub(super) const LOSS_COUNT: u32 = 8;
/// Value of 0x1F98/9 that every node starts with.
const PRESCALER_DEFAULT: u16 = 2;

/// Values of 0x1F81 in a node that reads the PRes of others: that there is such a node, and that it is a controlled one.
const OTHER_NODE: u32 = 1 | 1 << 1;
/// Value of 0x1F81/240 in a chained node: that there is a managing node, and that it sends a PRes.
const MN_THAT_SENDS: u32 = 1 | 1 << 12;

/// Where a PDO comes from, with the octets of its whole payload.
#[derive(Clone, Copy)]
enum Source {
    /// The PReq to the node.
    Preq(u16),
    /// The node: it sends the PDO in its PRes.
    Own(u16),
    /// The PRes of another node, or of the managing node.
    Pres(u8, u16),
}

/// The managing node's own PRes: its octets, and where those for one node begin.
#[derive(Clone, Copy)]
struct PresMn {
    octets: u16,
    offset: u16,
}

impl Configuration<'_> {
    /// What a node must know of the network.
    fn network(&mut self, config: &Config, node: &Node) {
        let bus = &config.bus;
        self.write(0x1006, 0, config.cycle_us);
        // A node that waits for the SoC by its clock begins to count after that; one that sees by the order of frames that a SoC
        // is missing counts at once.
        let tolerance_ns = bus.soc_lost_max.map(|lost_max| lost_max * config.cycle_us * 1000);
        self.set(0x1C14, 0, tolerance_ns.unwrap_or(u32::MAX));
        // 0 switches a watch off.
        let socs = bus.soc_lost_max.map_or(0, |lost_max| lost_max.max(1));
        self.set(0x1C0B, 3, LOSS_COUNT * socs);
        // Polls that get lost on the wire are judged by the control, which misses the answers. To a node, a control too late to
        // poll is one too late for its SoC; by default it would bear only one within eight cycles. A node that is never polled
        // must not wait for polls.
        let polls_lost_max = match (node.exchange, bus.soc_lost_max) {
            (Exchange::AsyncOnly, _) | (_, None) => 0,
            (Exchange::Polled | Exchange::Multiplexed(_) | Exchange::Chained, Some(lost_max)) => {
                lost_max.max(bus.pres_lost_max + 1)
            }
        };
        self.set(0x1C0D, 3, LOSS_COUNT * polls_lost_max);
        if bus.multiplex_cycles > 0 {
            self.set(0x1F98, 7, bus.multiplex_cycles);
        }
        if let Exchange::Multiplexed(cycle) = node.exchange
            && self.device.is_some()
        {
            // Only nodes whose file says so keep the table of the round themselves.
            self.set(0x1F9B, node.id, cycle);
        }
        self.set(0x1F98, 8, bus.async_mtu);
        if bus.prescaler != PRESCALER_DEFAULT {
            self.set(0x1F98, 9, bus.prescaler);
        }
    }

    /// PDO mapping: switched off, entries, switched on (order of DS 301).
    fn process_data(&mut self, bus: &Bus, node: &Node, pres_mn: PresMn) {
        let inputs = in_order(&node.inputs, 0);
        let (source, bit_offset) = match node.exchange {
            Exchange::AsyncOnly => return,
            Exchange::Polled | Exchange::Multiplexed(_) => (Source::Preq(octets(&node.outputs)), 0),
            Exchange::Chained => (Source::Pres(MN, pres_mn.octets), 8 * pres_mn.offset),
        };
        let outputs = in_order(&node.outputs, bit_offset);
        self.map(0x1400, 0x1600, source, node.pdo_version, &outputs);
        self.map(
            0x1800,
            0x1A00,
            Source::Own(octets(&node.inputs)),
            node.pdo_version,
            &inputs,
        );
        let mut sources: Vec<usize> = node.cross.iter().map(|cross| cross.from).collect();
        sources.sort_unstable();
        sources.dedup();
        for (channel, source) in (1_u16..).zip(sources) {
            let source_node = &bus.nodes[source];
            let sent = in_order(&source_node.inputs, 0);
            let entries: Vec<MappingEntry> = node
                .cross
                .iter()
                .filter(|cross| cross.from == source)
                .filter_map(|cross| {
                    let read = sent
                        .iter()
                        .find(|entry| (entry.index, entry.sub) == (cross.read.index, cross.read.sub))?;
                    Some(MappingEntry {
                        index: cross.into.index,
                        sub: cross.into.sub,
                        ..*read
                    })
                })
                .collect();
            self.map(
                0x1400 + channel,
                0x1600 + channel,
                Source::Pres(source_node.id, octets(&source_node.inputs)),
                source_node.pdo_version,
                &entries,
            );
        }
    }

    fn map(&mut self, communication: u16, mapping: u16, source: Source, version: u8, entries: &[MappingEntry]) {
        self.write(mapping, 0, 0_u8);
        let node = match source {
            Source::Preq(octets) => {
                self.limit((0x1F98, 4), octets);
                0
            }
            Source::Own(octets) => {
                self.limit((0x1F98, 5), octets);
                0
            }
            Source::Pres(node, octets) => {
                // Some nodes listen only to those that this object tells them of.
                self.set(0x1F81, node, if node == MN { MN_THAT_SENDS } else { OTHER_NODE });
                self.limit((0x1F8D, node), octets);
                node
            }
        };
        self.write(communication, 1, node);
        self.write(communication, 2, version);
        for (sub, entry) in (1_u8..).zip(entries) {
            self.write(mapping, sub, entry.to_u64());
        }
        self.write(mapping, 0, entries.len() as u8);
    }

    /// The limits a node starts with hold 36 octets; a mapping beyond them would be refused.
    fn limit(&mut self, (index, sub): (u16, u8), octets: u16) {
        if usize::from(octets) > PAYLOAD_LIMIT_MIN {
            self.write(index, sub, octets);
        }
    }

    /// What a configured device file (XDC, DCF) wants to have written.
    fn device_file(&mut self, node: &Node) {
        let Some(device) = self.device else { return };
        let mut stored = device.stored_parameters(node.id);
        if !node.cross.is_empty() {
            // The machine file says what is read from other nodes.
            stored
                .writes
                .retain(|write| !matches!(write.index, 0x1401..=0x14FF | 0x1601..=0x16FF));
        }
        self.writes.append(&mut stored.writes);
        let reasons = [
            (stored.left_to_managing_node, LeftOutReason::ManagingNodeSets),
            (stored.not_writable, LeftOutReason::NotWritable),
        ];
        for (objects, reason) in reasons {
            let left_out = objects.into_iter().map(|(index, sub)| LeftOut { index, sub, reason });
            self.left_out.extend(left_out);
        }
    }

    /// Date and time of the configuration, written behind all else: a node that keeps them, and shows them when it is found,
    /// holds this very configuration. They are made from its content, so that they change with it and with nothing else.
    fn stamp(&mut self) -> Option<Stamp> {
        const DATE: (u16, u8) = (0x1020, 1);
        const TIME: (u16, u8) = (0x1020, 2);
        // Days since 1984 up to the end of 16 bits; milliseconds of a day. Neither is 0, which means none.
        const DAYS: u64 = 0xFFFF;
        const MILLISECONDS: u64 = 86_399_999;
        for (index, sub) in [DATE, TIME] {
            self.forget(index, sub);
        }
        let content = fnv_1a(&concise_dcf(&self.writes));
        let stamp = Stamp {
            date: 1 + (content / MILLISECONDS % DAYS) as u32,
            time: 1 + (content % MILLISECONDS) as u32,
        };
        self.set(DATE.0, DATE.1, stamp.date);
        self.set(TIME.0, TIME.1, stamp.time);
        (self.has(DATE.0, DATE.1) && self.has(TIME.0, TIME.1)).then_some(stamp)
    }
}

fn octets(objects: &[Mapped]) -> u16 {
    objects.iter().map(|object| u16::from(object.bits / 8)).sum()
}

/// Objects one behind the other.
fn in_order(objects: &[Mapped], bit_offset: u16) -> Vec<MappingEntry> {
    let mut end = bit_offset;
    let place = |object: &Mapped| {
        let entry = MappingEntry {
            index: object.index,
            sub: object.sub,
            bit_offset: end,
            bit_length: u16::from(object.bits),
        };
        end += entry.bit_length;
        entry
    };
    objects.iter().map(place).collect()
}

#[cfg(test)]
mod others_tests;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mapping_is_switched_off_written_and_switched_on() {
        let mut dcf = Configuration::new(None, None);
        let output = Mapped {
            index: 0x6200,
            sub: 1,
            bits: 8,
        };
        dcf.map(0x1400, 0x1600, Source::Preq(1), 0, &in_order(&[output], 0));
        let octets = concise_dcf(&dcf.writes);
        assert_eq!(octets[..4], 5_u32.to_le_bytes());
        assert_eq!(octets[4..12], [0x00, 0x16, 0, 1, 0, 0, 0, 0]);
        // The entry recorded from another vendor's network: 8 bits at bit 0 of 6200:1.
        let entry = [
            0x00, 0x16, 1, 8, 0, 0, 0, 0x00, 0x62, 0x01, 0x00, 0x00, 0x00, 0x08, 0x00,
        ];
        assert!(octets.windows(entry.len()).any(|window| window == entry));
        assert_eq!(octets[octets.len() - 8..], [0x00, 0x16, 0, 1, 0, 0, 0, 1]);
    }

    const MACHINE: &str = include_str!("../../../../../configs/mill3-demo.toml");
    const DRIVE_1: &str = "profile = \"cia402\"\nmandatory = true\npres_timeout_us = 150\n";
    const IO: &str = "profile = \"io\"\npres_timeout_us = 150\n";

    /// The demo machine with lines for its first drive and for its I/O node; the drive's own identity keys are dropped.
    fn machine(drive: &str, io: &str) -> Config {
        assert!(MACHINE.contains(DRIVE_1) && MACHINE.contains(IO));
        let text = MACHINE.replacen(DRIVE_1, &format!("profile = \"cia402\"\n{drive}\n"), 1);
        let text = text
            .replacen(IO, &format!("{IO}{io}\n"), 1)
            .replace("vendor_id = 0x00000000", "");
        let text = text.replace("kind = \"powerlink\"", "kind = \"powerlink\"\nmultiplex_cycles = 2");
        config::parse(&text, std::path::Path::new("m.toml")).unwrap_or_else(|errors| panic!("{errors}"))
    }

    fn position(plan: &NodePlan, index: u16, sub: u8) -> usize {
        let at = |write: &ConfigurationWrite| (write.index, write.sub) == (index, sub);
        assert_eq!(
            plan.writes.iter().filter(|write| at(write)).count(),
            1,
            "0x{index:04X}:{sub}"
        );
        plan.writes.iter().position(at).unwrap()
    }

    #[test]
    fn the_device_file_is_written_before_what_the_machine_file_says() {
        let config = machine(
            "device_file = \"../../obd/tests/data/servo.xdc\"\nmultiplex = 2\npdo_version = 0x10\nsdo = [{ object = \"0x2010:1\", value = 7 }]",
            "",
        );
        let plan = &plan(&config)[0];
        let value = |index, sub| &plan.writes[position(plan, index, sub)].value[..];
        // From the file, from the machine file in its place, and from the joint.
        assert_eq!(value(0x2010, 4), [0xFE, 0xFF]);
        assert_eq!(value(0x2010, 1), [7, 0]);
        assert_eq!(value(0x2020, 0), [0x41], "the node's own id and 0x40");
        assert_eq!(value(0x6098, 0), [21]);
        assert_eq!(value(0x1400, 2), [0x10]);
        assert_eq!(value(0x1F98, 7), [2]);
        assert!(position(plan, 0x2010, 4) < position(plan, 0x6098, 0));
        assert!(position(plan, 0x6098, 0) < position(plan, 0x2010, 1));
        // The second RPDO of the file: off before, on after its entries.
        let of_second: Vec<_> = plan.writes.iter().filter(|write| write.index == 0x1601).collect();
        let order: Vec<_> = of_second.iter().map(|write| (write.sub, write.value[0])).collect();
        assert_eq!(order, [(0, 0), (1, 0x10), (0, 1)]);
        let left_out: Vec<_> = plan.left_out.iter().map(|it| (it.index, it.sub, it.reason)).collect();
        assert_eq!(plan.stamp, None, "the device keeps none");
        assert_eq!(
            left_out,
            [
                (0x1C0B, 3, LeftOutReason::NotInDevice),
                (0x1F9B, 1, LeftOutReason::NotInDevice),
                (0x1C14, 0, LeftOutReason::ManagingNodeSets),
                (0x2030, 0, LeftOutReason::NotWritable),
                (0x1020, 1, LeftOutReason::NotInDevice),
                (0x1020, 2, LeftOutReason::NotInDevice),
            ]
        );
    }

    #[test]
    fn cross_traffic_and_a_chain_are_mapped_where_their_data_lie() {
        let config = machine(
            "pres_timeout_us = 150\nchained = true\ncross = [{ from = \"io\", read = \"0x6000:2/8\", into = \"0x2000/8\" }]",
            "chained = true",
        );
        let plans = plan(&config);
        let entry = |plan: &NodePlan, index, sub| {
            let value = &plan.writes[position(plan, index, sub)].value;
            let entry = MappingEntry::from_u64(u64::from_le_bytes(value[..].try_into().unwrap()));
            (entry.index, entry.sub, entry.bit_offset, entry.bit_length)
        };
        let drive = &plans[0];
        assert_eq!(drive.writes[position(drive, 0x1400, 1)].value, [240]);
        assert_eq!(entry(drive, 0x1600, 4), (0x607A, 0, 56, 32));
        assert_eq!(drive.writes[position(drive, 0x1401, 1)].value, [10]);
        assert_eq!(entry(drive, 0x1601, 1), (0x2000, 0, 8, 8));
        // Behind the eleven octets of the drive.
        assert_eq!(entry(&plans[3], 0x1600, 1), (0x6200, 1, 88, 8));
        let nodes = crate::powerlink::managing_node::node_configs(&config.bus, &plans);
        let mn = crate::powerlink::managing_node::mn_config(&config, &nodes, [2, 0, 0, 0, 0, 1]);
        assert_eq!(
            (mn.pres_mn_bytes, nodes[3].pres_mn_offset, nodes[3].preq_bytes),
            (Some(13), 11, 2)
        );
        assert!(powerlink::mn::Mn::<4>::new(mn).is_ok());
    }

    #[test]
    fn a_long_payload_raises_the_limit_before_its_mapping() {
        let inputs: Vec<String> = (1..=5).map(|sub| format!("\"0x2000:{sub}/64\"")).collect();
        let config = machine("pres_timeout_us = 150", &format!("inputs = [{}]", inputs.join(", ")));
        let plan = &plan(&config)[3];
        assert_eq!(plan.writes[position(plan, 0x1F98, 5)].value, [40, 0]);
        // Behind the count of 0, as a limit must not cut off what is mapped.
        let mapping = |sub| {
            let mut writes = plan.writes.iter();
            writes
                .position(|write| (write.index, write.sub) == (0x1A00, sub))
                .unwrap()
        };
        assert!(mapping(0) < position(plan, 0x1F98, 5) && position(plan, 0x1F98, 5) < mapping(1));
    }
}
