//! What each node is told before it may take part: its concise DCF.
//!
//! In:  the checked machine description.
//! Out: payload layouts and configuration writes per node, in the order in which the nodes want them.

use super::layout::Layout;
use crate::config::{Config, Joint, Mapped, Profile};
use obd::Scalar;
use obd::cdc::CdcWriter;
use obd::mapping::MappingEntry;

/// One node of the network, ready for the managing node.
#[derive(Clone, Debug)]
pub struct NodePlan {
    /// What the control sends.
    pub outputs: Layout,
    /// What the node sends.
    pub inputs: Layout,
    /// Concise DCF: configuration writes, downloaded by SDO.
    pub configuration: Vec<u8>,
}

/// Plans of all nodes, in the order of the machine file.
pub fn plan(config: &Config) -> Vec<NodePlan> {
    config
        .bus
        .nodes
        .iter()
        .enumerate()
        .map(|(index, node)| {
            let mut octets = vec![0; DCF_OCTETS_MAX];
            let mut dcf = configuration(&mut octets);
            dcf.write(0x1006, 0, config.cycle_us);
            dcf.write(0x1C14, 0, config.bus.soc_lost_max * config.cycle_us * 1000);
            // Polls that get lost on the wire are judged by the control, which misses the answers. To a node, a control
            // too late to poll is one too late for its SoC; by default it would bear only one within eight cycles.
            let polls_lost_max = config.bus.soc_lost_max.max(config.bus.pres_lost_max + 1);
            dcf.write(0x1C0D, 3, LOSS_COUNT * polls_lost_max);
            dcf.map(0x1400, 0x1600, &node.outputs);
            dcf.map(0x1800, 0x1A00, &node.inputs);
            if node.profile == Profile::Cia402
                && let Some(joint) = config.joints.iter().find(|joint| joint.node == index)
            {
                dcf.drive(joint, config.cycle_us);
            }
            NodePlan {
                outputs: Layout::new(&node.outputs),
                inputs: Layout::new(&node.inputs),
                configuration: dcf.0.finish().to_vec(),
            }
        })
        .collect()
}

fn configuration(octets: &mut [u8]) -> Configuration<'_> {
    Configuration(CdcWriter::new(octets).expect("there is room for the count"))
}

/// What the error counters of POWERLINK add for each loss; each good cycle takes one back.
const LOSS_COUNT: u32 = 8;

/// Room for the concise DCF of one node: each mapped object takes 15 octets, all the rest under 400.
const DCF_OCTETS_MAX: usize = 8192;

/// Configuration writes of one node.
struct Configuration<'a>(CdcWriter<'a>);

impl Configuration<'_> {
    fn write<T: Scalar>(&mut self, index: u16, sub: u8, value: T) {
        let mut octets = [0; 8];
        value.store(&mut octets[..T::SIZE]);
        self.0
            .push(index, sub, &octets[..T::SIZE])
            .expect("DCF_OCTETS_MAX holds the longest payload");
    }

    /// PDO mapping: switched off, entries, switched on (order of DS 301).
    fn map(&mut self, communication: u16, mapping: u16, objects: &[Mapped]) {
        self.write(mapping, 0, 0_u8);
        self.write(communication, 1, 0_u8);
        self.write(communication, 2, 0_u8);
        let mut bit_offset = 0;
        for (entry, object) in (1_u8..).zip(objects) {
            let bit_length = u16::from(object.bits);
            let mapped = MappingEntry {
                index: object.index,
                sub: object.sub,
                bit_offset,
                bit_length,
            };
            self.write(mapping, entry, mapped.to_u64());
            bit_offset += bit_length;
        }
        self.write(mapping, 0, objects.len() as u8);
    }

    /// What a servo drive must know: interpolation time, following error, ramps, homing.
    fn drive(&mut self, joint: &Joint, cycle_us: u32) {
        let [counts, units] = joint.counts_per_unit.map(f64::from);
        let increments = |mm: f64| (mm * counts / units).round().clamp(0.0, f64::from(u32::MAX)) as u32;
        // 60C2: cycle = digits * 10^exponent s; whole hundreds of microseconds fit the octet up to 25.5 ms.
        let (digits, exponent) = if cycle_us.is_multiple_of(1000) {
            (cycle_us / 1000, -3)
        } else if cycle_us.is_multiple_of(100) {
            (cycle_us / 100, -4)
        } else {
            (cycle_us / 10, -5)
        };
        self.write(0x60C2, 1, digits.min(255) as u8);
        self.write(0x60C2, 2, exponent as i8);
        // The drive's own watch is wider than ours: it is the second line of defence.
        self.write(0x6065, 0, increments(2.0 * joint.following_error_mm));
        self.write(0x605A, 0, 2_i16);
        self.write(0x6085, 0, increments(joint.stop.acceleration_mm_s2));
        self.write(0x6098, 0, joint.homing.method);
        self.write(0x6099, 1, increments(joint.homing.search_mm_s));
        self.write(0x6099, 2, increments(joint.homing.latch_mm_s));
        self.write(0x609A, 0, increments(joint.homing.acceleration_mm_s2));
        self.write(0x607C, 0, 0_i32);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mapping_is_switched_off_written_and_switched_on() {
        let mut octets = [0; 256];
        let mut dcf = configuration(&mut octets);
        dcf.map(
            0x1400,
            0x1600,
            &[Mapped {
                index: 0x6200,
                sub: 1,
                bits: 8,
            }],
        );
        let octets = dcf.0.finish();
        assert_eq!(octets[..4], 5_u32.to_le_bytes());
        assert_eq!(octets[4..12], [0x00, 0x16, 0, 1, 0, 0, 0, 0]);
        // The entry recorded from another vendor's network: 8 bits at bit 0 of 6200:1.
        let entry = [
            0x00, 0x16, 1, 8, 0, 0, 0, 0x00, 0x62, 0x01, 0x00, 0x00, 0x00, 0x08, 0x00,
        ];
        assert!(octets.windows(entry.len()).any(|window| window == entry));
        assert_eq!(octets[octets.len() - 8..], [0x00, 0x16, 0, 1, 0, 0, 0, 1]);
    }
}
