//! Nodes on the bus: which of them the machine needs, and pins of what they send and get.
//!
//! In:  payloads and states of the nodes; pins that others drive.
//! Out: pins, named as those of LinuxCNC's drivers; payloads, as far as the control does not fill them itself.
//!
//! RT: nothing allocates but what makes the pins.

use super::drives::is_filled;
use super::io_channels::IoPins;
use super::spindle::Spindle;
use bus::layout::Field;
use bus::plan::NodePlan;
use bus::{CyclicBus, InputImage, NodeIndex, NodeState, OutputImage};
use cia402::profile::axis_of;
use config::{Config, Profile};
use hal_pins::{Hal, HalError, Input, Output};
use machine::faults::Fault;

/// A mapped object that a pin shows.
struct ObjectPin {
    node: usize,
    field: Field,
    value: ObjectValue,
}

/// What is left of a controlword that a pin has where no drive may be under power: quick stop, or no voltage.
const QUICK_STOP: u64 = 0x0002;

/// A mapped object that a pin sets: one that the control itself has no use for.
struct DrivenObject {
    node: usize,
    field: Field,
    pin: Input<i64>,
}

impl ObjectPin {
    fn show(&mut self, payload: &[u8]) {
        match &mut self.value {
            ObjectValue::Signed(pin) => pin.set(self.field.read_signed(payload)),
            ObjectValue::Unsigned(pin) => pin.set(self.field.read(payload)),
        }
    }
}

enum ObjectValue {
    Signed(Output<i64>),
    Unsigned(Output<u64>),
}

/// What a node is like, and how many of its answers were lost.
struct NodePins {
    state: Output<u32>,
    lost: Output<u64>,
}

/// Pins of the state of all nodes, and of the objects of drives.
pub(super) struct DrivePins {
    nodes: Vec<NodePins>,
    received: Vec<ObjectPin>,
    sent: Vec<ObjectPin>,
    driven: Vec<DrivenObject>,
}

impl DrivePins {
    pub(super) fn new(hal: &mut Hal, config: &Config, plans: &[NodePlan]) -> Result<DrivePins, HalError> {
        let (mut received, mut sent, mut driven) = (Vec::new(), Vec::new(), Vec::new());
        let mut nodes = Vec::new();
        let numbers = DriveNumbers::new(config, plans);
        for (index, (node, plan)) in config.bus.nodes.iter().zip(plans).enumerate() {
            nodes.push(NodePins {
                state: hal.output(&format!("plk.{}.state", node.id))?,
                lost: hal.output(&format!("plk.{}.pres-lost", node.id))?,
            });
            if node.profile != Profile::Cia402 {
                continue;
            }
            for &field in &plan.inputs.fields {
                let number = numbers.number(index, field);
                received.push(object_pin(hal, number, index, field)?);
            }
            for &field in &plan.outputs.fields {
                let object = (field.object.index, field.object.sub);
                let number = numbers.number(index, field);
                let joint = config.joints.get(number);
                let of_joint = joint.is_some_and(|joint| is_filled(joint, object));
                if of_joint || Spindle::fills(config, index, object) {
                    sent.push(object_pin(hal, number, index, field)?);
                } else {
                    let pin = hal.input(&object_name(number, field), 0)?;
                    driven.push(DrivenObject {
                        node: index,
                        field,
                        pin,
                    });
                }
            }
        }
        Ok(DrivePins {
            nodes,
            received,
            sent,
            driven,
        })
    }
}

/// The nodes of a machine.
pub struct Nodes {
    drives: DrivePins,
    io: IoPins,
    /// For each node: whether the machine cannot run without it.
    mandatory: Box<[bool]>,
    /// Nothing goes on while a node has missed up to so many answers in a row; 0: everything does.
    waits_for_answers: u32,
}

impl Nodes {
    pub(super) fn new(config: &Config, drives: DrivePins, io: IoPins) -> Nodes {
        Nodes {
            drives,
            io,
            mandatory: config.bus.nodes.iter().map(|node| node.mandatory).collect(),
            waits_for_answers: match config.bus.soc_lost_max {
                Some(_) => 0,
                None => config.bus.pres_lost_max,
            },
        }
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.mandatory.len()
    }

    /// Whether the machine cannot run without a node.
    pub fn is_mandatory(&self, node: NodeIndex) -> bool {
        self.mandatory[node]
    }

    /// The first node without which the machine cannot run and that is not operational.
    pub fn mandatory_node_down(&self, bus: &dyn CyclicBus) -> Option<NodeIndex> {
        let mut nodes = self.mandatory.iter().enumerate();
        nodes
            .find(|&(node, &mandatory)| mandatory && bus.node_state(node) != NodeState::Operational)
            .map(|(node, _)| node)
    }

    /// Whether a cycle is to be sent once more: who was not heard may have heard nothing.
    pub fn are_awaited(&self, inputs: &InputImage) -> bool {
        let lost_in_row = inputs.lost_in_row.iter().max().copied().unwrap_or(0);
        (1..=self.waits_for_answers).contains(&lost_in_row)
    }

    /// Shows what the nodes sent, so that what follows in this cycle sees it behind every net.
    pub fn show_inputs(&mut self, inputs: &InputImage) {
        for object in &mut self.drives.received {
            object.show(inputs.payload.node(object.node));
        }
        self.io.show(inputs);
    }

    /// Copies pins into the payloads, as far as the control does not fill them itself, and shows what it sends.
    /// `commanded`: drives may be under power; a drive without a joint whose controlword is a pin is else told to stop.
    pub fn write_outputs(&mut self, commanded: bool, outputs: &mut OutputImage) {
        for object in &self.drives.driven {
            let value = object.pin.get() as u64;
            let value = match commanded || object.field.object.index != 0x6040 {
                true => value,
                false => value & QUICK_STOP,
            };
            object.field.write(outputs.node_mut(object.node), value);
        }
        for object in &mut self.drives.sent {
            object.show(outputs.node(object.node));
        }
        self.io.write(outputs);
    }

    /// Shows how the nodes are.
    pub fn publish(&mut self, bus: &dyn CyclicBus) {
        for (node, pins) in self.drives.nodes.iter_mut().enumerate() {
            pins.state.set(bus.node_state(node) as u32);
            pins.lost.set(bus.statistics(node).lost);
        }
    }

    /// An input that went out of its range, one a call; each once as it does.
    pub fn take_fault(&mut self) -> Option<Fault> {
        self.io.take_fault()
    }
}

/// Numbers of drives in the names of their pins: that of their joint; those without one follow, in the order of the machine file.
struct DriveNumbers {
    /// Nodes and axes.
    of: Vec<(usize, u8)>,
}

impl DriveNumbers {
    fn new(config: &Config, plans: &[NodePlan]) -> DriveNumbers {
        let mut of: Vec<_> = config
            .joints
            .iter()
            .map(|joint| (joint.node, joint.drive_axis))
            .collect();
        for (index, (node, plan)) in config.bus.nodes.iter().zip(plans).enumerate() {
            if node.profile != Profile::Cia402 {
                continue;
            }
            for field in plan.outputs.fields.iter().chain(&plan.inputs.fields) {
                let axis = (index, axis_of(field.object.index).0);
                if !of.contains(&axis) {
                    of.push(axis);
                }
            }
        }
        DriveNumbers { of }
    }

    /// Of the drive that an object of a node belongs to.
    fn number(&self, node: usize, field: Field) -> usize {
        let axis = (node, axis_of(field.object.index).0);
        self.of.iter().position(|other| *other == axis).unwrap_or(self.of.len())
    }
}

/// Name of the pin of a CiA 402 object; LinuxCNC drivers' names where there is one.
fn object_name(joint: usize, field: Field) -> String {
    let (_, index) = axis_of(field.object.index);
    let sub = field.object.sub;
    let name = match (index, sub) {
        (0x603F, 0) => "error-code",
        (0x6040, 0) => "controlword",
        (0x6041, 0) => "statusword",
        (0x6060, 0) => "opmode",
        (0x6061, 0) => "opmode-display",
        (0x6042, 0) => "vl-target-velocity",
        (0x6043, 0) => "vl-velocity-demand",
        (0x6044, 0) => "vl-actual-velocity",
        (0x6064, 0) => "drv-actual-position",
        (0x606C, 0) => "drv-actual-velocity",
        (0x6077, 0) => "drv-actual-torque",
        (0x6078, 0) => "drv-actual-current",
        (0x6079, 0) => "drv-dc-link-voltage",
        (0x6071, 0) => "drv-target-torque",
        (0x607A, 0) => "drv-target-position",
        (0x60FF, 0) => "drv-target-velocity",
        (0x60B1, 0) => "velocity-offset",
        (0x60B2, 0) => "torque-offset",
        (0x60F4, 0) => "drv-following-error",
        (0x60FD, 0) => "digital-inputs",
        (0x60FE, 1) => "digital-outputs",
        _ => return format!("cia402.{joint}.object-{index:04x}-{sub:02x}"),
    };
    format!("cia402.{joint}.{name}")
}

/// Whether the number in an object has a sign, for objects without which it would read wrong.
fn is_signed(index: u16) -> bool {
    matches!(
        axis_of(index).1,
        0x6042..=0x6044 | 0x6060..=0x6064 | 0x6069..=0x606C | 0x6071 | 0x6074 | 0x6077 | 0x6078 | 0x607A | 0x60B0..=0x60B2 | 0x60F4 | 0x60FA | 0x60FF
    )
}

fn object_pin(hal: &mut Hal, joint: usize, node: usize, field: Field) -> Result<ObjectPin, HalError> {
    let name = object_name(joint, field);
    let value = if is_signed(field.object.index) {
        ObjectValue::Signed(hal.output(&name)?)
    } else {
        ObjectValue::Unsigned(hal.output(&name)?)
    };
    Ok(ObjectPin { node, field, value })
}
