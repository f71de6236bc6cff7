//! What the main device is told of the network and of each device, from the machine file; what a cycle costs.
//!
//! In:  the checked machine description. Out: the configuration of `ethercat::main`, plans of nodes, the budget of the cycle.

use crate::configuration::Configuration;
use crate::layout::Layout;
use crate::plan::NodePlan;
use crate::service::BudgetView;
use cia402::profile::axis_of;
use config::{Config, ConfigErrors, DriveProfile, Node, bus_error};
use ethercat::main::config::{
    ClockConfig, Config as Network, DeviceConfig, Expected, PdoConfig, Place, ProcessDataConfig, StartValue, Times,
};
use ethercat::main::{Budget, CyclicFrames, Member};
use ethercat::wire::WireError;
use ethercat::wire::register::AlState;

/// Most devices that one bus can have: positions 1 to 239.
pub const DEVICES_MAX: usize = 239;
/// Most frames of a cycle.
pub const FRAMES_MAX: usize = 8;

/// Plans of all nodes, in the order of the machine file.
pub fn plan(config: &Config) -> Vec<NodePlan> {
    let nodes = config.bus.nodes.iter().enumerate();
    nodes
        .map(|(index, node)| {
            let objects = node.ethercat.as_ref().and_then(|own| own.dictionary.as_ref());
            let mut own = Configuration::new(None, node.drive.as_ref()).with_dictionary(objects);
            own.application(config, index);
            NodePlan {
                expected: expected(&own, config, index),
                stamp: None,
                outputs: Layout::new(&node.outputs),
                inputs: Layout::new(&node.inputs),
                configuration: Vec::new(),
                writes: own.writes,
                left_out: own.left_out,
            }
        })
        .collect()
}

/// What a device must say of itself: its type where the machine file has it, and what [`Configuration::expected`] says.
fn expected(own: &Configuration<'_>, config: &Config, index: usize) -> Vec<obd::Expected> {
    let device_type = config.bus.nodes[index].identity.device_type;
    let device_type = device_type.map(|value| obd::Expected {
        index: 0x1000,
        sub: 0,
        mask: u32::MAX,
        value,
    });
    device_type.into_iter().chain(own.expected(config, index)).collect()
}

/// What a device is told, in the form of the main device.
pub struct Table<'c> {
    outputs: Vec<PdoConfig<'c>>,
    inputs: Vec<PdoConfig<'c>>,
    start: Vec<StartValue<'c>>,
}

/// Who wants a value written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StartSource<'c> {
    /// Its ESI file, with what it says of it.
    DeviceFile(&'c str),
    /// The profile of its drive, by its name.
    DriveProfile(&'c str),
    /// `sdo` of the node.
    MachineFile,
    /// The control, from other keys.
    Control,
}

/// What a device is told in PRE-OP, in the order in which it is written.
pub fn start_values<'c>(node: &'c Node, plan: &'c NodePlan) -> impl Iterator<Item = (StartValue<'c>, StartSource<'c>)> {
    let is_written = |index, sub| plan.writes.iter().any(|write| (write.index, write.sub) == (index, sub));
    let of_file = node.ethercat.as_ref().map_or(&[][..], |own| &own.start);
    let of_file = of_file
        .iter()
        .filter(move |it| it.complete || !is_written(it.index, it.sub))
        .map(|it| {
            let value = StartValue {
                index: it.index,
                sub: it.sub,
                complete: it.complete,
                optional: false,
                value: &it.value,
            };
            (value, StartSource::DeviceFile(&it.comment))
        });
    let of_plan = plan.writes.iter().map(|write| {
        let value = StartValue {
            index: write.index,
            sub: write.sub,
            complete: false,
            optional: false,
            value: &write.value,
        };
        let is_of_profile = |drive: &&DriveProfile| {
            let mut own = drive.writes.iter();
            own.any(|own| {
                (own.sub, &own.value) == (write.sub, &write.value)
                    && [write.index, axis_of(write.index).1].contains(&own.index)
            })
        };
        let source = match node.drive.as_ref().filter(is_of_profile) {
            _ if !node.writes.contains(write) => StartSource::Control,
            Some(drive) => StartSource::DriveProfile(&drive.name),
            None => StartSource::MachineFile,
        };
        let optional = source == StartSource::Control && can_be_missing(axis_of(write.index).1);
        (StartValue { optional, ..value }, source)
    });
    of_file.chain(of_plan)
}

/// Whether a drive runs without an object that the control wants set: interpolation time, watch of the following error, reactions,
/// ramp of the quick stop, speeds of homing and home offset have values of their own in every drive.
fn can_be_missing(index: u16) -> bool {
    matches!(
        index,
        0x60C2 | 0x6065 | 0x605A..=0x605E | 0x6085 | 0x6099 | 0x609A | 0x607C
    )
}

/// For each node its PDOs and start values.
pub fn tables<'c>(config: &'c Config, plans: &'c [NodePlan]) -> Vec<Table<'c>> {
    let pdos = |pdos: &'c [config::Pdo]| {
        let pdo = |pdo: &'c config::Pdo| PdoConfig {
            index: pdo.index,
            entries: &pdo.entries,
        };
        pdos.iter().map(pdo).collect()
    };
    let table = |(node, plan): (&'c Node, &'c NodePlan)| {
        let own = node.ethercat.as_ref();
        Table {
            outputs: pdos(own.map_or(&[], |own| &own.outputs)),
            inputs: pdos(own.map_or(&[], |own| &own.inputs)),
            start: start_values(node, plan).map(|(value, _)| value).collect(),
        }
    };
    config.bus.nodes.iter().zip(plans).map(table).collect()
}

/// All devices, in the order of the machine file.
pub fn devices<'t>(config: &Config, plans: &'t [NodePlan], tables: &'t [Table<'_>]) -> Vec<DeviceConfig<'t>> {
    let device = |((node, plan), table): ((&Node, &'t NodePlan), &'t Table<'_>)| {
        let own = node.ethercat.as_ref();
        DeviceConfig {
            place: place(node),
            expected: Expected {
                vendor: node.identity.vendor_id,
                product: node.identity.product_code,
                revision: node.identity.revision,
                serial: node.identity.serial,
            },
            outputs: ProcessDataConfig {
                octets: plan.outputs.octets as u16,
                pdos: &table.outputs,
            },
            inputs: ProcessDataConfig {
                octets: plan.inputs.octets as u16,
                pdos: &table.inputs,
            },
            start: &table.start,
            checks: &plan.expected,
            clock: own.and_then(|own| own.clock).map(|clock| ClockConfig {
                activate: clock.activate,
                shift_ns: clock.shift_ns,
                sync1_ns: clock.sync1_ns,
            }),
            watchdog_ms: own.and_then(|own| own.watchdog_ms),
            goal: AlState::Op,
        }
    };
    config.bus.nodes.iter().zip(plans).zip(tables).map(device).collect()
}

/// Where a node is on the wire.
pub fn place(node: &Node) -> Place {
    match node.ethercat.as_ref().and_then(|own| own.alias) {
        Some(alias) => Place::Alias(alias),
        None => Place::Position(u16::from(node.id) - 1),
    }
}

/// The whole network.
pub fn network<'d>(config: &Config, devices: &'d [DeviceConfig<'d>]) -> Network<'d> {
    Network {
        cycle_ns: config.cycle_us * 1000,
        devices,
        lost_max: config.bus.pres_lost_max,
        times: Times::default(),
    }
}

/// What a cycle costs; what does not fit into frames at all is told.
fn cost(config: &Config) -> Result<Budget, WireError> {
    let mut logical = 0;
    let members = config.bus.nodes.iter().map(|node| {
        let octets = |objects: &[config::Mapped]| objects.iter().map(|it| u16::from(it.bits / 8)).sum();
        let member = Member::one(logical, octets(&node.outputs), octets(&node.inputs));
        logical += member.octets() as u32;
        member
    });
    let frames = Box::new(CyclicFrames::<DEVICES_MAX, FRAMES_MAX>::new([0; 6], members)?);
    let lengths = (0..frames.len()).map(|number| frames.frame(number).len());
    Ok(Budget::of(lengths, config.bus.nodes.len(), config.cycle_us * 1000))
}

/// Whether the frames of a cycle fit into half of it.
///
/// # Errors
/// The sum that shows why not, at the nodes in the file.
pub fn check(config: &Config) -> Result<(), ConfigErrors> {
    let rule = match cost(config) {
        Ok(budget) if budget.fits() => return Ok(()),
        Ok(budget) => format!("the frames do not fit the cycle of {} us: {budget}", config.cycle_us),
        Err(error) => format!("the process data do not fit {FRAMES_MAX} frames: {error}"),
    };
    Err(bus_error(config, "node", rule))
}

/// How the cycle is spent, part by part.
pub fn budget(config: &Config) -> Vec<BudgetView> {
    let Ok(budget) = cost(config) else { return Vec::new() };
    let us = |ns: u64| ns as f64 / 1e3;
    let view = |part: String, wire_ns: u64, latency_ns: u64| BudgetView {
        part,
        node: None,
        wire_us: us(wire_ns),
        latency_us: us(latency_ns),
        worst_us: us(wire_ns + latency_ns),
    };
    let (frames, octets) = (budget.frames, budget.octets);
    vec![
        view(format!("{frames} frames of {octets} octets"), budget.wire_ns, 0),
        view("through the devices and back".into(), 0, budget.devices_ns),
        view("this PC, from a frame to its answer".into(), 0, budget.pc_ns),
    ]
}

/// The longest that the exchange of a cycle can take, ns.
pub fn worst_exchange_ns(config: &Config) -> u64 {
    cost(config).map_or(0, |budget| budget.total_ns())
}

#[cfg(test)]
mod tests {
    use super::*;

    const MACHINE: &str = r#"schema = 1
[machine]
name = "m"
cycle_us = 1000
[bus]
kind = "ethercat-memory"
[[bus.node]]
id = 1
name = "drive"
profile = "cia402"
device_file = "FILE"
[[joint]]
node = 1
counts_per_unit = [10000, 1]
travel_mm = [-5.0, 305.0]
velocity_mm_s = 50.0
acceleration_mm_s2 = 500.0
jerk_mm_s3 = 5000.0
following_error_mm = 20.0
homing = { method = 35, search_mm_s = 10.0, latch_mm_s = 1.0, acceleration_mm_s2 = 500.0, position_mm = 0.0 }
[[axis]]
letter = "X"
joints = [0]
"#;

    /// A drive whose file tells these objects.
    fn esi(objects: &[u16]) -> String {
        let entry = |index: u16, bits: u8| {
            format!(
                "<Entry><Index>#x{index:04X}</Index><SubIndex>0</SubIndex><BitLen>{bits}</BitLen><Name>n</Name></Entry>"
            )
        };
        let object =
            |index: &u16| format!("<Object><Index>#x{index:04X}</Index><Flags><Access>rw</Access></Flags></Object>");
        let objects: String = objects.iter().map(object).collect();
        format!(
            "<EtherCATInfo><Vendor><Id>1</Id></Vendor><Descriptions><Devices><Device>\
             <Type ProductCode=\"2\" RevisionNo=\"1\">DRIVE</Type>\
             <Profile><Dictionary><DataTypes/><Objects>{objects}</Objects></Dictionary></Profile>\
             <Sm StartAddress=\"#x1000\" ControlByte=\"#x26\" DefaultSize=\"128\" Enable=\"1\">MBoxOut</Sm>\
             <Sm StartAddress=\"#x1080\" ControlByte=\"#x22\" DefaultSize=\"128\" Enable=\"1\">MBoxIn</Sm>\
             <Sm StartAddress=\"#x1100\" ControlByte=\"#x64\" Enable=\"1\">Outputs</Sm>\
             <Sm StartAddress=\"#x1400\" ControlByte=\"#x20\" Enable=\"1\">Inputs</Sm>\
             <RxPdo Sm=\"2\"><Index>#x1600</Index><Name>o</Name>{}{}{}</RxPdo>\
             <TxPdo Sm=\"3\"><Index>#x1A00</Index><Name>i</Name>{}{}{}</TxPdo>\
             <Mailbox><CoE SdoInfo=\"1\" PdoAssign=\"1\" PdoConfig=\"1\"/></Mailbox>\
             </Device></Devices></Descriptions></EtherCATInfo>",
            entry(0x6040, 16),
            entry(0x607A, 32),
            entry(0x6060, 8),
            entry(0x6041, 16),
            entry(0x6064, 32),
            entry(0x6061, 8),
        )
    }

    #[test]
    fn a_drive_is_told_only_what_its_file_says_it_has() {
        let told = |objects: &[u16]| {
            let file = tempfile::NamedTempFile::new().unwrap();
            std::fs::write(file.path(), esi(objects)).unwrap();
            let text = MACHINE.replace("FILE", &file.path().display().to_string());
            let config = config::parse(&text, "m.toml".as_ref()).unwrap_or_else(|errors| panic!("{errors}"));
            let plan = plan(&config).remove(0);
            let left_out: Vec<(u16, u8)> = plan.left_out.iter().map(|left| (left.index, left.sub)).collect();
            let written: Vec<(u16, u8)> = plan.writes.iter().map(|write| (write.index, write.sub)).collect();
            (written, left_out)
        };
        // Nothing is said of the objects of drives.
        let (all, none) = told(&[0x1000]);
        assert!(
            none.is_empty() && all.contains(&(0x60C2, 1)) && all.contains(&(0x6085, 0)),
            "{all:?}"
        );
        let (written, left_out) = told(&[0x6040, 0x6060, 0x605A, 0x6065, 0x6098, 0x609A, 0x607C]);
        assert_eq!(
            left_out,
            [(0x60C2, 1), (0x60C2, 2), (0x6085, 0), (0x6099, 1), (0x6099, 2)]
        );
        let kept: Vec<(u16, u8)> = all.into_iter().filter(|object| !left_out.contains(object)).collect();
        assert_eq!(written, kept);
    }
}
