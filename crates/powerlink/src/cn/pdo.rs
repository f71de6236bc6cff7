//! The PDOs of a controlled node: what arrives in the PReq, the PResMN or another node's PRes, and what leaves in the PRes.
//!
//! In:  mapping and communication objects of the dictionary, payloads as they arrive.
//! Out: values in the dictionary, the payload of the PRes; faults of received PDOs, each once.

use obd::mapping::{CopyPlan, Direction, MappingEntry, MappingError};
use obd::{AbortCode, Dictionary};

use super::error::code;
use super::keys::{Keys, PdoKeys};
use super::objects::{MAPPING_ENTRIES, RPDOS};
use crate::wire::node;

pub(super) type Plan = CopyPlan<MAPPING_ENTRIES>;

/// What an RPDO is read from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Source {
    /// The PReq of the managing node.
    Preq,
    /// The PRes of this node.
    Pres(u8),
}

impl Source {
    /// As 0x1400/1 tells it: 0 is the PReq, and no node.
    fn from_node_id(node_id: u8) -> Source {
        match node_id {
            node::INVALID => Source::Preq,
            from => Source::Pres(from),
        }
    }
}

/// A received PDO.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pdo<'a> {
    pub(super) source: Source,
    pub(super) version: u8,
    /// RD.
    pub(super) ready: bool,
    pub(super) payload: &'a [u8],
}

/// One RPDO as it is in use.
#[derive(Clone, Copy, Debug)]
struct Rpdo {
    plan: Plan,
    version: u8,
    source: Source,
    /// Longest payload its source may send, in octets.
    limit: usize,
    /// The fault of the last received PDO, so that a lasting fault is reported once.
    fault: Option<u16>,
}

/// The PDOs as they are in use; what the dictionary says becomes active by [`Pdos::activate`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Pdos {
    receive: [Rpdo; RPDOS],
    transmit: Plan,
    pub(super) transmit_version: u8,
    pub(super) transmit_limit: usize,
    preq_limit: usize,
    preq_too_long: bool,
}

/// What became of a received PDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Received {
    /// Copied into the dictionary.
    Valid,
    /// Not for the dictionary: from elsewhere, RD is 0, or nothing is mapped.
    Ignored,
    /// Dropped for this reason, which is new.
    NewFault(u16),
    /// Dropped for the reason already reported.
    SameFault,
}

impl Pdos {
    /// Nothing is mapped.
    pub(super) const EMPTY: Pdos = Pdos {
        receive: [Rpdo {
            plan: Plan::EMPTY,
            version: 0,
            source: Source::Preq,
            limit: 0,
            fault: None,
        }; RPDOS],
        transmit: Plan::EMPTY,
        transmit_version: 0,
        transmit_limit: 0,
        preq_limit: 0,
        preq_too_long: false,
    };

    /// Takes over what the dictionary says. A mapping that cannot be carried out (SDO writes are checked, so only the
    /// application can have made it) maps nothing.
    pub(super) fn activate<const E: usize, const B: usize>(dictionary: &Dictionary<E, B>, keys: &Keys) -> Pdos {
        let mut pdos = Pdos::EMPTY;
        for (rpdo, keys_of) in pdos.receive.iter_mut().zip(&keys.receive) {
            let source = Source::from_node_id(dictionary.get(keys_of.node));
            let limit = source_limit(dictionary, keys, source);
            let count = dictionary.get(keys_of.count);
            *rpdo = Rpdo {
                plan: plan(dictionary, keys_of, Direction::Receive, count, limit).unwrap_or_default(),
                version: dictionary.get(keys_of.version),
                source,
                limit,
                fault: None,
            };
        }
        let count = dictionary.get(keys.transmit.count);
        pdos.transmit_limit = usize::from(dictionary.get(keys.timing.pres_limit));
        pdos.transmit_version = dictionary.get(keys.transmit.version);
        let transmit = plan(
            dictionary,
            &keys.transmit,
            Direction::Transmit,
            count,
            pdos.transmit_limit,
        );
        pdos.transmit = transmit.unwrap_or_default();
        pdos.preq_limit = usize::from(dictionary.get(keys.timing.preq_limit));
        pdos
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

    /// Checks the length of a PReq, mapped or not; the error holds the fault unless it was reported before.
    pub(super) fn check_preq(&mut self, pdo: &Pdo<'_>) -> Result<(), Option<u16>> {
        if pdo.source != Source::Preq {
            return Ok(());
        }
        let known = core::mem::replace(&mut self.preq_too_long, pdo.payload.len() > self.preq_limit);
        match (self.preq_too_long, known) {
            (false, _) => Ok(()),
            (true, false) => Err(Some(code::PREQ_LIMIT)),
            (true, true) => Err(None),
        }
    }

    /// Checks what RPDO `number` has to do with a received PDO and copies it into the dictionary if `wanted` (the node is
    /// OPERATIONAL). RT: no look-up, no allocation, no locks, bounded.
    pub(super) fn receive<const E: usize, const B: usize>(
        &mut self,
        number: usize,
        dictionary: &mut Dictionary<E, B>,
        pdo: &Pdo<'_>,
        wanted: bool,
    ) -> Received {
        let Some(rpdo) = self.receive.get_mut(number) else {
            return Received::Ignored;
        };
        if rpdo.source != pdo.source || rpdo.plan.is_empty() {
            return Received::Ignored;
        }
        let fault = if pdo.payload.len() > rpdo.limit {
            Some(code::PRES_RX_LIMIT)
        } else if !pdo.ready {
            None
        } else if rpdo.version != 0 && main_version(rpdo.version) != main_version(pdo.version) {
            Some(code::PDO_MAP_VERSION)
        } else if pdo.payload.len() < rpdo.plan.payload_octets() {
            Some(code::PDO_SHORT_RX)
        } else {
            None
        };
        let known = core::mem::replace(&mut rpdo.fault, fault);
        match fault {
            Some(code) if known == Some(code) => Received::SameFault,
            Some(code) => Received::NewFault(code),
            None if !pdo.ready || !wanted => Received::Ignored,
            None => match rpdo.plan.scatter(pdo.payload, dictionary) {
                Ok(()) => Received::Valid,
                Err(_) => Received::Ignored,
            },
        }
    }
}

const fn main_version(version: u8) -> u8 {
    version >> 4
}

/// Longest payload of a source in octets: 0x1F98/4 for the PReq, 0x1F8D/n for the PRes of node n.
fn source_limit<const E: usize, const B: usize>(dictionary: &Dictionary<E, B>, keys: &Keys, source: Source) -> usize {
    let Source::Pres(from) = source else {
        return usize::from(dictionary.get(keys.timing.preq_limit));
    };
    // Sub-indices 1..=254 are those of the node ids that 0x1400/1 takes.
    match dictionary.read(0x1F8D, from) {
        Ok(&[low, high]) => usize::from(u16::from_le_bytes([low, high])),
        Ok(_) | Err(_) => 0,
    }
}

/// The first `count` entries of a mapping object, checked.
fn plan<const E: usize, const B: usize>(
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

/// Whether an SDO may write an object that PDOs depend on: communication and mapping objects and payload limits. The order is
/// that of the profile: count 0, the entries, then the count, which is refused unless the mapping can be carried out.
pub(super) fn check_write<const E: usize, const B: usize>(
    dictionary: &Dictionary<E, B>,
    keys: &Keys,
    (index, sub): (u16, u8),
    value: &[u8],
) -> Result<(), AbortCode> {
    let first = value.first().copied().unwrap_or(0);
    let number = usize::from(index & 0xFF);
    match (index, sub) {
        (0x1400..=0x14FF, 1) => {
            let limit = source_limit(dictionary, keys, Source::from_node_id(first));
            keys.receive
                .get(number)
                .map_or(Ok(()), |rpdo| still_fits(dictionary, rpdo, Direction::Receive, limit))
        }
        (0x1600..=0x16FF, _) => keys.receive.get(number).map_or(Ok(()), |rpdo| {
            let limit = source_limit(dictionary, keys, Source::from_node_id(dictionary.get(rpdo.node)));
            check_mapping(dictionary, rpdo, Direction::Receive, (sub, first), limit)
        }),
        (0x1A00, _) => {
            let limit = usize::from(dictionary.get(keys.timing.pres_limit));
            check_mapping(dictionary, &keys.transmit, Direction::Transmit, (sub, first), limit)
        }
        (0x1F98, 5) => still_fits(dictionary, &keys.transmit, Direction::Transmit, octets_of(value)?),
        (0x1F98, 4) => check_source(dictionary, keys, Source::Preq, octets_of(value)?),
        (0x1F8D, from @ 1..=node::MN) => check_source(dictionary, keys, Source::Pres(from), octets_of(value)?),
        _ => Ok(()),
    }
}

/// Whether a write to this object is refused while PDOs are exchanged.
pub(super) const fn is_fixed_in_use(index: u16, sub: u8) -> bool {
    matches!(
        (index, sub),
        (0x1400..=0x14FF | 0x1600..=0x16FF | 0x1800 | 0x1A00 | 0x1F8D, _) | (0x1F98, 4 | 5)
    )
}

fn octets_of(value: &[u8]) -> Result<usize, AbortCode> {
    match *value {
        [low, high] => Ok(usize::from(u16::from_le_bytes([low, high]))),
        _ => Err(AbortCode::LENGTH_MISMATCH),
    }
}

/// The count last, and only if the mapping can be carried out; entries only while the count is 0.
fn check_mapping<const E: usize, const B: usize>(
    dictionary: &Dictionary<E, B>,
    keys: &PdoKeys,
    direction: Direction,
    (sub, count): (u8, u8),
    limit_octets: usize,
) -> Result<(), AbortCode> {
    if sub == 0 {
        return plan(dictionary, keys, direction, count, limit_octets)
            .map(|_| ())
            .map_err(|error| error.code);
    }
    match dictionary.get(keys.count) {
        0 => Ok(()),
        1.. => Err(AbortCode::PARAMETER_INCOMPATIBLE),
    }
}

/// Every RPDO that reads from `source` must still fit.
fn check_source<const E: usize, const B: usize>(
    dictionary: &Dictionary<E, B>,
    keys: &Keys,
    source: Source,
    limit_octets: usize,
) -> Result<(), AbortCode> {
    let readers = keys
        .receive
        .iter()
        .filter(|rpdo| Source::from_node_id(dictionary.get(rpdo.node)) == source);
    for rpdo in readers {
        still_fits(dictionary, rpdo, Direction::Receive, limit_octets)?;
    }
    Ok(())
}

/// What is mapped must fit in another limit.
fn still_fits<const E: usize, const B: usize>(
    dictionary: &Dictionary<E, B>,
    keys: &PdoKeys,
    direction: Direction,
    limit_octets: usize,
) -> Result<(), AbortCode> {
    match plan(dictionary, keys, direction, dictionary.get(keys.count), limit_octets) {
        Ok(_) => Ok(()),
        Err(_) => Err(AbortCode::PARAMETER_INCOMPATIBLE),
    }
}
