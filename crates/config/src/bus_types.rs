//! The bus of a machine and its nodes, as checked as the rest of the machine.

use super::channels::{Channel, ChannelKind, ObjectKind, Typed, kind_of};
use super::drive_profile::DriveProfile;
pub use super::objects::{Identity, Mapped, Profile};
use obd::device::{ConfigurationWrite, DeviceDescription, EsiDictionary};

/// A node by its place in the machine file.
pub type NodeIndex = usize;

/// `[bus]`
#[derive(Clone, Debug, PartialEq)]
pub struct Bus {
    pub kind: BusKind,
    /// Network interface of a real wire.
    pub interface: String,
    /// What carries frames to and from it.
    pub link: BusLink,
    /// AsyncSlotTimeout (1F8A:2), µs.
    pub async_slot_timeout_us: u32,
    /// Polls lost in a row that are ridden out; EtherCAT: cycles in a row without data of a device.
    pub pres_lost_max: u32,
    /// SoCs lost in a row that the nodes ride out with their last set-point before they stop by themselves (1C0B:3), counted where
    /// the order of frames shows them. Without any frames they are counted after as many cycles more (1C14). `None`: any number,
    /// polls too; where an answer is missing the machine stands still in the control as it does at the far end. For a
    /// simulated machine on a busy PC.
    pub soc_lost_max: Option<u32>,
    /// Cycles of a multiplexed round (1F98:7); 0: none.
    pub multiplex_cycles: u8,
    /// Longest ASnd, octets after the Ethernet header (1F98:8); it fits the asynchronous slot.
    pub async_mtu: u16,
    /// The PS flag of the SoC toggles every so many cycles (1F98:9); 0: never.
    pub prescaler: u16,
    /// TAP device by which programs of this PC reach the nodes over IP, in asynchronous slots; `None`: they do not.
    pub tap: Option<String>,
    /// How the network starts (1F80), served bits only; `None`: the defaults of the managing node.
    pub startup: Option<u32>,
    /// Whose clock the dates of cycles follow; POWERLINK: ours.
    pub clock: BusClock,
    /// Nodes in polling order.
    pub nodes: Vec<Node>,
}

/// Which wire carries the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusKind {
    /// Ethernet POWERLINK on a network interface.
    Powerlink,
    /// Ethernet POWERLINK frames through memory to the simulated machine in this process.
    Memory,
    /// EtherCAT on a network interface.
    Ethercat,
    /// EtherCAT frames through memory to the simulated machine in this process.
    EthercatMemory,
    /// There is no bus: all joints have step pulses.
    None,
    /// The toy bus of tests, on a network interface or through memory.
    #[cfg(feature = "testing")]
    Toy,
}

impl BusKind {
    /// The words of the machine file. The toy bus of tests is in no list.
    pub const WORDS: [(&'static str, BusKind); 5] = [
        ("powerlink", BusKind::Powerlink),
        ("memory", BusKind::Memory),
        ("ethercat", BusKind::Ethercat),
        ("ethercat-memory", BusKind::EthercatMemory),
        ("none", BusKind::None),
    ];

    /// The word of the machine file.
    pub const fn name(self) -> &'static str {
        match self {
            BusKind::Powerlink => "powerlink",
            BusKind::Memory => "memory",
            BusKind::Ethercat => "ethercat",
            BusKind::EthercatMemory => "ethercat-memory",
            BusKind::None => "none",
            #[cfg(feature = "testing")]
            BusKind::Toy => "toy",
        }
    }

    /// The protocol of its frames.
    pub const fn protocol(self) -> Protocol {
        match self {
            BusKind::Powerlink | BusKind::Memory => Protocol::Powerlink,
            BusKind::Ethercat | BusKind::EthercatMemory => Protocol::Ethercat,
            BusKind::None => Protocol::None,
            #[cfg(feature = "testing")]
            BusKind::Toy => Protocol::Toy,
        }
    }

    /// Whether its wire is a network interface.
    pub const fn has_interface(self) -> bool {
        match self {
            BusKind::Powerlink | BusKind::Ethercat => true,
            BusKind::Memory | BusKind::EthercatMemory | BusKind::None => false,
            #[cfg(feature = "testing")]
            BusKind::Toy => true,
        }
    }
}

/// The protocol of a bus. What it needs is in one registry for each layer, which the compiler wants whole: its keys here
/// (`protocol.rs`), checking and opening it in `bus::protocol`, its nodes in `sim::protocol`, its budget in `bus-tools`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Protocol {
    /// Ethernet POWERLINK.
    Powerlink,
    /// EtherCAT.
    Ethercat,
    /// No bus. Without nodes, POWERLINK's half of each registry serves it.
    None,
    /// The toy bus of tests. Only crates that are built for tests know it: the third kind that proves that two are not built in.
    #[cfg(feature = "testing")]
    Toy,
}

impl Protocol {
    /// Its name in reports and on the control socket.
    pub const fn name(self) -> &'static str {
        match self {
            Protocol::Powerlink => "powerlink",
            Protocol::Ethercat => "ethercat",
            Protocol::None => "none",
            #[cfg(feature = "testing")]
            Protocol::Toy => "toy",
        }
    }

    /// The protocol of a name.
    pub fn named(name: &str) -> Option<Protocol> {
        let all = [
            Protocol::Powerlink,
            Protocol::Ethercat,
            Protocol::None,
            #[cfg(feature = "testing")]
            Protocol::Toy,
        ];
        all.into_iter().find(|protocol| protocol.name() == name)
    }

    /// Its words for what every bus has.
    pub const fn words(self) -> ProtocolWords {
        match self {
            Protocol::Powerlink | Protocol::None => ProtocolWords {
                frame: "SoC",
                cycle_start: "SoC",
                nodes: "drives",
            },
            Protocol::Ethercat => ProtocolWords {
                frame: "frame",
                cycle_start: "the first frame of each cycle",
                nodes: "devices",
            },
            #[cfg(feature = "testing")]
            Protocol::Toy => Protocol::Ethercat.words(),
        }
    }

    /// Whether the id of a node is its position along the cable, which nobody sets.
    pub const fn ids_are_positions(self) -> bool {
        match self {
            Protocol::Ethercat => true,
            Protocol::Powerlink | Protocol::None => false,
            #[cfg(feature = "testing")]
            Protocol::Toy => false,
        }
    }
}

/// Words of a protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProtocolWords {
    /// The frame that begins a cycle, in a column.
    pub frame: &'static str,
    /// The same in a sentence.
    pub cycle_start: &'static str,
    /// What is simulated at the far end.
    pub nodes: &'static str,
}

/// Whose clock leads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusClock {
    /// That of a device, the first with a clock (distributed clocks): the cycle follows it.
    Bus,
    /// That of this PC.
    Own,
}

/// What carries frames to and from a network interface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusLink {
    /// A packet socket with a ring shared with the kernel.
    Raw,
    /// libpnet: several system calls a frame.
    Pnet,
}

/// Date and time of the software of a node (1F52).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamp {
    /// Days since 1984-01-01.
    pub date: u32,
    /// Milliseconds since midnight.
    pub time: u32,
}

/// `[[bus.node]]`
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// Node id, 1 to 239, unique; EtherCAT: position on the bus, from 1.
    pub id: u8,
    /// Name for messages, unique; default `node-ID`.
    pub name: String,
    /// What it is.
    pub profile: Profile,
    /// Whether the machine needs it; default true.
    pub mandatory: bool,
    /// PRes time-out (1F92), µs.
    pub pres_timeout_us: u32,
    /// Identity that it must report (1F84 to 1F88); `None`: not checked.
    pub identity: Identity,
    /// PReq payload: objects that the control sends, in order.
    pub outputs: Vec<Mapped>,
    /// PRes payload: objects that the node sends, in order.
    pub inputs: Vec<Mapped>,
    /// How process data are exchanged.
    pub exchange: Exchange,
    /// Date and time that its software must have (1F53, 1F54); `None`: not checked.
    pub software: Option<Stamp>,
    /// Mapping version of its PDOs (1400:2, 1800:2); 0: not checked.
    pub pdo_version: u8,
    /// What is known of its kind of drive; everything above fits it.
    pub drive: Option<DriveProfile>,
    /// What its device file says; everything above fits it.
    pub device: Option<DeviceDescription>,
    /// Values that are written besides those that the control itself needs, in order.
    pub writes: Vec<ConfigurationWrite>,
    /// What it reads from the PRes of other nodes.
    pub cross: Vec<Cross>,
    /// Inputs and outputs that have a name.
    pub channels: Vec<Channel>,
    /// What only EtherCAT has; `None` on any other bus.
    pub ethercat: Option<EthercatNode>,
}

/// A node of EtherCAT.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EthercatNode {
    /// Station alias of its EEPROM, by which it is found; `None`: by its position.
    pub alias: Option<u16>,
    /// Its clock and SYNC signals; `None`: it runs with the frames.
    pub clock: Option<SyncClock>,
    /// Watchdog of its outputs, ms; `None`: as it has it, 0: none.
    pub watchdog_ms: Option<u16>,
    /// PDOs to it, whose entries are [`Node::outputs`] (1C12).
    pub outputs: Vec<Pdo>,
    /// PDOs from it, whose entries are [`Node::inputs`] (1C13).
    pub inputs: Vec<Pdo>,
    /// What its ESI file has it told at its start, modules in its slots first (F030), in order.
    pub start: Vec<StartCommand>,
    /// `ModuleIdent` of what stands in each of its slots, 0: nothing.
    pub modules: Vec<u32>,
    /// Objects that its ESI file says it has; `None`: the file does not tell them, or there is none.
    pub dictionary: Option<EsiDictionary>,
    /// What its ESI file says of the bits of objects in its PDOs.
    pub types: Vec<Typed>,
}

/// A value that an ESI file has a device told in PRE-OP.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StartCommand {
    pub index: u16,
    pub sub: u8,
    /// All sub-indices at once.
    pub complete: bool,
    pub value: Vec<u8>,
    /// What it is for, in the words of the file.
    pub comment: String,
}

/// A process data object of EtherCAT.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pdo {
    /// 16xx or 1Axx.
    pub index: u16,
    /// Entries that are written into it: index << 16 | sub-index << 8 | bits; empty: it stays as the device has it.
    pub entries: Vec<u32>,
}

/// SYNC signals of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SyncClock {
    /// Registers 0980 and 0981: 0300 SYNC0, 0700 SYNC0 and SYNC1.
    pub activate: u16,
    /// SYNC0 comes so long after the date of the cycle, ns.
    pub shift_ns: i32,
    /// SYNC1 comes so long after SYNC0, ns.
    pub sync1_ns: u32,
}

/// How a node exchanges process data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exchange {
    /// A PReq and a PRes in each cycle.
    Polled,
    /// A PReq and a PRes in this cycle of a round only, from 1.
    Multiplexed(u8),
    /// No PReq: its outputs stand in the PRes of the managing node, and its PRes follows at a time of its own.
    Chained,
    /// None at all.
    AsyncOnly,
}

/// Cross traffic: an object of one node that another reads from its PRes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cross {
    /// Index into [`Bus::nodes`] of the node that sends it.
    pub from: usize,
    /// Object of that node; it stands among its inputs.
    pub read: Mapped,
    /// Object of this node that takes the value; of the same length.
    pub into: Mapped,
}

impl Node {
    /// Whether an object holds single inputs or outputs, whatever channels make of it.
    pub fn is_of_bits(&self, object: Mapped) -> bool {
        self.told_kind(object) == ObjectKind::Bits
    }

    /// What the bits of an object are, as far as its device file and CiA 401 tell.
    fn told_kind(&self, object: Mapped) -> ObjectKind {
        let types = self.ethercat.as_ref().map_or(&[][..], |own| &own.types);
        kind_of(object, self.device.as_ref(), types)
    }

    /// What the bits of one of its objects are: what a channel says, else its device file, else CiA 401. Of what nobody knows,
    /// octets are bits, and what is longer is a number.
    pub fn object_kind(&self, object: Mapped) -> ObjectKind {
        let known = self.told_kind(object);
        let as_number = |signed: Option<bool>| match (signed, known) {
            (Some(true), _) | (None, ObjectKind::Signed) => ObjectKind::Signed,
            (None, ObjectKind::Real) => ObjectKind::Real,
            (Some(false), _) | (None, ObjectKind::Unsigned | ObjectKind::Bits) => ObjectKind::Unsigned,
        };
        let named = self.channels.iter().find_map(|channel| match channel.kind {
            ChannelKind::Counter { follow } if follow.latch == Some(object) => Some(ObjectKind::Unsigned),
            _ if channel.object != object => None,
            ChannelKind::Bit { .. } | ChannelKind::Relay { .. } => Some(ObjectKind::Bits),
            ChannelKind::Integer { signed } | ChannelKind::Analog { signed, .. } => Some(as_number(signed)),
            ChannelKind::Counter { .. } => Some(ObjectKind::Unsigned),
            ChannelKind::Pwm { .. } => Some(as_number(None)),
        });
        named.unwrap_or(known)
    }
}

/// Shorter frames are padded.
const FRAME_OCTETS_MIN: usize = 60;

/// Time on a 100 Mbit/s wire of an Ethernet frame of `octets` without check sequence (4 octets), preamble (8) and gap (12), ns.
pub fn wire_time_ns(octets: usize) -> u64 {
    (octets.max(FRAME_OCTETS_MIN) as u64 + 4 + 8 + 12) * 80
}
