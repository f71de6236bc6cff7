//! `analog` of a joint: a servo amplifier with an analog input, behind an I/O node.
//!
//! In:  the table of the machine file, the nodes of the bus. Out: where its command, its encoder and its switches are.

use super::document::{Bound, Section};
use super::drive::DriveMode;
use super::spindle::{node, object};
use super::types::{Exchange, Mapped, Node, NodeIndex};

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
        joint.wrong(
            "mode",
            "must be \"csv\" (its input is a speed) or \"cst\" (a torque): an amplifier holds no position",
        );
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
    if let (Some((_, node)), Some(Some(command))) = (node, command)
        && let Some(channel) = node.channels.iter().find(|it| it.output && it.object == command)
    {
        let rule = format!(
            "is the channel {:?} of the node already: an output has one writer",
            channel.name
        );
        section.wrong("command", rule);
    }
    let bit_of = |section: &Section<'_, '_>, key: &str, object: Option<Mapped>, bit: Option<i64>| {
        let (object, bit) = (object?, bit?);
        if bit >= i64::from(object.bits) {
            section.wrong(key, format!("must be below {}, the bits of {object}", object.bits));
            return None;
        }
        Some((object, bit as u8))
    };
    let enable = bit_of(&section, "enable_bit", enable.flatten(), enable_bit);
    let fault = match (fault?, fault_bit?) {
        (None, None) => None,
        (Some(object), Some(bit)) => Some(bit_of(&section, "fault_bit", Some(object), Some(bit))?),
        (Some(_), None) => {
            section.wrong("fault_bit", "is missing: the bit of `fault`");
            return None;
        }
        (None, Some(_)) => {
            section.wrong("fault_bit", "is of `fault`, which is missing");
            return None;
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
