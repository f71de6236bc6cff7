//! `analog` of a joint: a servo amplifier with an analog input, behind an I/O node.
//!
//! In:  the table of the machine file, the nodes of the bus. Out: where its command, its encoder and its switches are.

use super::bus_types::{Exchange, Mapped, Node, NodeIndex};
use super::modes::DriveMode;
use super::node_keys::{has_no_channel, node, object};
use super::question::Bound;
use super::section::Section;

/// An amplifier without a bus of its own; everything of it is at one I/O node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AnalogOutput {
    /// Index into `Bus::nodes`; exchanged in every cycle.
    pub node: NodeIndex,
    /// The output that it follows, signed.
    pub command: Mapped,
    /// Speed, mm/s, or share of the rated torque at the greatest value of that.
    pub full: f64,
    /// The counter of its encoder, which wraps with its length.
    pub position: Mapped,
    /// Output and its bit that let it have power.
    pub enable: (Mapped, u8),
    /// Input and its bit by which it tells a fault, and the level that says so; `None`: nothing tells.
    pub fault: Option<(Mapped, u8, bool)>,
}

/// Reads `analog` of a joint with `output = "analog"`.
pub(super) fn output(
    joint: &mut Section<'_, '_>,
    nodes: Option<&[Node]>,
    mode: Option<DriveMode>,
) -> Option<AnalogOutput> {
    if mode.is_some_and(|mode| !matches!(mode, DriveMode::Csv | DriveMode::Cst)) {
        let rule = "must be \"csv\" (its input is a speed) or \"cst\" (a torque): an amplifier holds no position";
        joint.wrong("mode", rule);
    }
    let what = "where the amplifier is, like { node = 10, command = \"0x6411:2\", full = 200.0, position = \"0x3000:3\", enable = \"0x6200:2\", enable_bit = 0 }";
    if !joint.has("analog") {
        joint.required("analog", what);
    }
    let mut section = joint.optional_section("analog")?;
    let every_cycle = |node: &Node| matches!(node.exchange, Exchange::Polled | Exchange::Chained);
    let node = node(&mut section, nodes, every_cycle);
    let (inputs, outputs) = (node.map(|(_, node)| &node.inputs), node.map(|(_, node)| &node.outputs));
    let command = object(&mut section, "command", true, outputs, "outputs");
    let full = section.number("full", Bound::Positive(1e6), None);
    let position = object(&mut section, "position", true, inputs, "inputs");
    let enable = object(&mut section, "enable", true, outputs, "outputs");
    let enable_bit = section.integer("enable_bit", 0..=63, None);
    let fault = object(&mut section, "fault", false, inputs, "inputs");
    let fault_bit = section.optional_integer("fault_bit", 0..=63);
    let fault_active = section.flag("fault_active", true);
    if let (Some((_, node)), Some(Some(command))) = (node, command) {
        has_no_channel(&section, "command", node, command);
    }
    let bit_of = |key: &str, object: Mapped, bit: u8| {
        let fits = bit < object.bits;
        if !fits {
            section.wrong(key, format!("must be below {}, the bits of {object}", object.bits));
        }
        fits.then_some((object, bit))
    };
    let enable = enable.flatten().zip(enable_bit);
    let enable = enable.and_then(|(object, bit)| bit_of("enable_bit", object, bit));
    let fault = match (fault?, fault_bit?) {
        (None, None) => None,
        (Some(object), Some(bit)) => Some(bit_of("fault_bit", object, bit)?),
        (Some(_), None) => {
            return section.refused("fault_bit", "is missing: the bit of `fault`");
        }
        (None, Some(_)) => {
            return section.refused("fault_bit", "is of `fault`, which is missing");
        }
    };
    section.done();
    let fault_active = fault_active?;
    Some(AnalogOutput {
        node: node?.0,
        command: command.flatten()?,
        full: full?,
        position: position.flatten()?,
        enable: enable?,
        fault: fault.map(|(object, bit)| (object, bit, fault_active)),
    })
}
