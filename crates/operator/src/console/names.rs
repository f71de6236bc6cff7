//! What parts of the machine are called in entries and alarms.

use config::{BusKind, Config};
use machine::faults::silenced;
use protocol::{Message, message};

/// Names by the numbers that notices have.
pub(super) struct Names {
    /// `z-drive (node 3)`
    pub(super) nodes: Vec<String>,
    /// For what only the bus of this machine tells.
    pub(super) bus: bus::Names,
    /// `axis Z (joint 2)`
    pub(super) joints: Vec<Message>,
    /// Drives of the joints on the bus.
    pub(super) drives: Vec<Option<String>>,
    /// External components.
    pub(super) external: Vec<String>,
    /// There is a bus; else nothing is said of a network.
    pub(super) has_network: bool,
    /// What is said where the cycle thread hung.
    pub(super) silenced: Message,
}

impl Names {
    pub(super) fn new(config: &Config) -> Names {
        let nodes = config.bus.nodes.iter();
        let has_network = config.bus.kind != BusKind::None;
        Names {
            nodes: nodes.map(|node| format!("{} (node {})", node.name, node.id)).collect(),
            bus: bus::Names::new(config),
            joints: joints(config),
            drives: config.joints.iter().map(|joint| config.drive_name(joint)).collect(),
            external: config.external.iter().map(|of| of.name.clone()).collect(),
            has_network,
            silenced: silenced(has_network, config.steps.is_some()),
        }
    }
}

fn joints(config: &Config) -> Vec<Message> {
    let joints = config.joints.iter().enumerate();
    let name = |(number, joint): (usize, &config::Joint)| {
        // Which of several drives of a node it is, does not go without saying.
        let node = config.bus.nodes.get(joint.node).filter(|_| config.shares_node(joint));
        let axis = config.axes.iter().find(|map| map.joints.contains(&number));
        let axis = axis.map(|map| map.axis.letter().to_string());
        match (axis, node) {
            (Some(axis), Some(node)) => message!(
                "joint.of_axis_and_drive",
                "axis {axis} (joint {joint}, axis {drive_axis} of {node})",
                axis = axis.as_str(),
                drive_axis = joint.drive_axis,
                joint = number,
                node = &node.name
            ),
            (Some(axis), None) => message!(
                "joint.of_axis",
                "axis {axis} (joint {joint})",
                axis = axis.as_str(),
                joint = number
            ),
            (None, Some(node)) => message!(
                "joint.of_drive",
                "joint {joint}, axis {drive_axis} of {node}",
                drive_axis = joint.drive_axis,
                node = &node.name,
                joint = number
            ),
            (None, None) => message!("joint", "joint {joint}", joint = number),
        }
    };
    joints.map(name).collect()
}
