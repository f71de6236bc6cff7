//! What happens at a node, for the device behind it.

use obd::{AbortCode, Dictionary};

use super::watch::CycleError;
use crate::nmt::{NmtState, Reset};
use crate::wire::Soc;

/// Which parameters 0x1010 or 0x1011 mean: their sub-index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StorageGroup {
    /// 1: all parameters.
    All,
    /// 2: 0x1000..0x1FFF.
    Communication,
    /// 3: 0x6000..0x9FFF.
    Application,
    /// 4: 0x2000..0x5FFF.
    Manufacturer,
}

impl StorageGroup {
    pub(super) fn from_sub(sub: u8) -> Option<StorageGroup> {
        match sub {
            1 => Some(StorageGroup::All),
            2 => Some(StorageGroup::Communication),
            3 => Some(StorageGroup::Application),
            4 => Some(StorageGroup::Manufacturer),
            _ => None,
        }
    }
}

/// What an SDO asks of a device that can store parameters (see [`STORAGE`](super::objects::STORAGE)); the node itself stores nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Storage {
    /// "save": values are to be kept over a power failure. The device hands them to
    /// [`Dictionary::set_default`] when it starts again.
    Store(StorageGroup),
    /// "load": the next reset brings the factory's values.
    Restore(StorageGroup),
}

/// What happened, for the device behind the node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Events {
    /// A SoC arrived in a state with isochronous traffic or in STOPPED: this is the synchronous instant.
    pub sync: Option<Soc>,
    /// Valid outputs were copied into the dictionary.
    pub outputs: bool,
    /// The NMT state is another one than before the call.
    pub nmt_state: Option<NmtState>,
    /// A reset ran, entered at this depth. Objects of the device (from 0x2000) have their defaults again after
    /// [`Reset::Software`] and [`Reset::Node`].
    pub reset: Option<Reset>,
    /// SoCs that were due and did not arrive.
    pub soc_missed: u32,
    /// A counter reached its threshold and the node has left the isochronous states; the first one, where there are several.
    pub cycle_error: Option<CycleError>,
    /// An SDO wrote this object of the device (index from 0x2000); the last one, if several.
    pub written: Option<(u16, u8)>,
    /// The frame wrote other objects of the device before (WriteMultipleByIndex).
    pub written_several: bool,
    /// An SDO asks for parameters to be stored or restored.
    pub storage: Option<Storage>,
}

/// Answer of [`Cn::receive`](super::Cn::receive).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Reaction {
    /// Octets of `response` to be sent at once as an Ethernet frame; `None`: send nothing.
    pub transmit: Option<usize>,
    /// For the device behind the node.
    pub events: Events,
}

/// Judges an SDO write to an object of the device (index from 0x2000) after the dictionary has accepted it and before it is
/// stored.
pub type WriteCheck<const E: usize, const B: usize> = fn(&Dictionary<E, B>, u16, u8, &[u8]) -> Result<(), AbortCode>;
