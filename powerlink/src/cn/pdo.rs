//! The two PDOs of a controlled node: what arrives in the PReq (or in another node's PRes) and what leaves in the PRes.

use obd::mapping::{CopyPlan, Direction, MappingEntry, MappingError};
use obd::{AbortCode, Dictionary};

use super::error::code;
use super::objects::{MAPPING_ENTRIES, PdoKeys};

pub(super) type Plan = CopyPlan<MAPPING_ENTRIES>;

/// The PDOs as they are in use; what the dictionary says becomes active by [`Pdos::activate`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Pdos {
    receive: Plan,
    receive_version: u8,
    receive_limit: usize,
    /// 0: the PReq of the MN; else the node whose PRes is read.
    pub(super) receive_from: u8,
    transmit: Plan,
    pub(super) transmit_version: u8,
    pub(super) transmit_limit: usize,
    /// The fault of the last received PDO, so that a lasting fault is reported once.
    fault: Option<u16>,
}

/// What became of a received PDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Received {
    /// Copied into the dictionary.
    Valid,
    /// Not for the dictionary: RD is 0, or nothing is mapped.
    Ignored,
    /// Dropped for this reason, which is new.
    NewFault(u16),
    /// Dropped for the reason already reported.
    SameFault,
}

impl Pdos {
    /// Nothing is mapped.
    pub(super) const EMPTY: Pdos = Pdos {
        receive: Plan::EMPTY,
        receive_version: 0,
        receive_limit: 0,
        receive_from: 0,
        transmit: Plan::EMPTY,
        transmit_version: 0,
        transmit_limit: 0,
        fault: None,
    };

    /// Takes over what the dictionary says. A mapping that cannot be carried out (SDO writes are checked, so only the
    /// application can have made it) maps nothing.
    pub(super) fn activate<const E: usize, const B: usize>(
        dictionary: &Dictionary<E, B>,
        receive: &PdoKeys,
        transmit: &PdoKeys,
    ) -> Pdos {
        let mapped = |keys: &PdoKeys, direction| {
            let count = dictionary.get(keys.count);
            let limit = usize::from(dictionary.get(keys.payload_limit));
            plan(dictionary, keys, direction, count, limit).unwrap_or_default()
        };
        Pdos {
            receive: mapped(receive, Direction::Receive),
            receive_version: dictionary.get(receive.version),
            receive_limit: usize::from(dictionary.get(receive.payload_limit)),
            receive_from: dictionary.get(receive.node),
            transmit: mapped(transmit, Direction::Transmit),
            transmit_version: dictionary.get(transmit.version),
            transmit_limit: usize::from(dictionary.get(transmit.payload_limit)),
            fault: None,
        }
    }

    /// Octets of payload in the PRes.
    pub(super) fn transmit_octets(&self) -> usize {
        self.transmit.payload_octets()
    }

    /// Copies the objects of the PRes. RT: no allocation, no locks, bounded.
    pub(super) fn transmit<const E: usize, const B: usize>(&self, dictionary: &Dictionary<E, B>, payload: &mut [u8]) {
        // The caller's buffer holds the longest payload there is.
        let _ = self.transmit.gather(dictionary, payload);
    }

    /// Checks a received PDO and copies it into the dictionary if `ready` (RD) and `wanted` (the node is OPERATIONAL).
    /// RT: no allocation, no locks, bounded.
    pub(super) fn receive<const E: usize, const B: usize>(
        &mut self,
        dictionary: &mut Dictionary<E, B>,
        version: u8,
        payload: &[u8],
        ready: bool,
        wanted: bool,
    ) -> Received {
        let fault = if self.receive_from == 0 && payload.len() > self.receive_limit {
            Some(code::PREQ_LIMIT)
        } else if self.receive.is_empty() || !ready {
            None
        } else if self.receive_version != 0 && main_version(self.receive_version) != main_version(version) {
            Some(code::PDO_MAP_VERSION)
        } else if payload.len() < self.receive.payload_octets() {
            Some(code::PDO_SHORT_RX)
        } else {
            None
        };
        let known = core::mem::replace(&mut self.fault, fault);
        match fault {
            Some(code) if known == Some(code) => Received::SameFault,
            Some(code) => Received::NewFault(code),
            None if self.receive.is_empty() || !ready || !wanted => Received::Ignored,
            None => match self.receive.scatter(payload, dictionary) {
                Ok(()) => Received::Valid,
                Err(_) => Received::Ignored,
            },
        }
    }
}

const fn main_version(version: u8) -> u8 {
    version >> 4
}

/// The first `count` entries of a mapping object, checked.
pub(super) fn plan<const E: usize, const B: usize>(
    dictionary: &Dictionary<E, B>,
    keys: &PdoKeys,
    direction: Direction,
    count: u8,
    limit_octets: usize,
) -> Result<Plan, MappingError> {
    let entries = keys
        .entries
        .iter()
        .take(usize::from(count))
        .map(|key| MappingEntry::from_u64(dictionary.get(*key)));
    Plan::new(dictionary, direction, entries, limit_octets)
}

/// Whether an SDO may write sub-index `sub` of a mapping object: the count last, and only if the mapping can be carried out;
/// entries only while the count is 0.
pub(super) fn check_mapping_write<const E: usize, const B: usize>(
    dictionary: &Dictionary<E, B>,
    keys: &PdoKeys,
    direction: Direction,
    sub: u8,
    value: &[u8],
) -> Result<(), AbortCode> {
    if sub != 0 {
        let in_use = dictionary.get(keys.count) != 0;
        return if in_use {
            Err(AbortCode::PARAMETER_INCOMPATIBLE)
        } else {
            Ok(())
        };
    }
    let count = value.first().copied().unwrap_or(0);
    let limit_octets = usize::from(dictionary.get(keys.payload_limit));
    plan(dictionary, keys, direction, count, limit_octets)
        .map(|_| ())
        .map_err(|error| error.code)
}

/// Whether an SDO may set a payload limit: what is mapped must still fit.
pub(super) fn check_limit_write<const E: usize, const B: usize>(
    dictionary: &Dictionary<E, B>,
    keys: &PdoKeys,
    direction: Direction,
    value: &[u8],
) -> Result<(), AbortCode> {
    let &[low, high] = value else {
        return Err(AbortCode::LENGTH_MISMATCH);
    };
    let limit_octets = usize::from(u16::from_le_bytes([low, high]));
    let count = dictionary.get(keys.count);
    match plan(dictionary, keys, direction, count, limit_octets) {
        Ok(_) => Ok(()),
        Err(_) => Err(AbortCode::PARAMETER_INCOMPATIBLE),
    }
}
