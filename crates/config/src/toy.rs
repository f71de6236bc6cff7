//! The toy bus of tests in the machine file: what every bus has, and no keys of its own but how much it rides out.
//!
//! In:  tables of the machine file. Out: as of any bus. Only where this crate is built for tests: `kind = "toy"` is no word otherwise.

use super::bus_types::{BusClock, BusKind, BusLink, Exchange, Profile};
use super::cross::PendingCross;
use super::device::IsOurs;
use super::drive_profile::DriveProfile;
use super::esi::Esi;
use super::protocol::{BusKeys, Foreign, Keys, Network, NodeFacts, NodeKeys};
use super::section::Section;
use obd::device::DeviceDescription;

/// The part of the toy bus.
pub(super) struct Toy;

/// Whether `[bus]` asks for it. No list of words has it, so that what is said of machine files is the same with and without it.
pub(super) fn is_meant(section: &mut Section<'_, '_>) -> bool {
    section.says("kind", BusKind::Toy.name())
}

impl Keys for Toy {
    fn foreign_of_bus(&self) -> &'static [Foreign] {
        &[]
    }

    fn foreign_of_node(&self) -> &'static [Foreign] {
        &[]
    }

    fn bus(&self, section: &mut Section<'_, '_>, _kind: Option<BusKind>, _cycle_us: Option<u32>) -> Option<BusKeys> {
        Some(BusKeys {
            link: BusLink::Raw,
            async_slot_timeout_us: 150,
            lost_max: section.integer("lost_max", 0..=1000, 3)?,
            soc_lost_max: 3,
            multiplex_cycles: 0,
            async_mtu: 1500,
            prescaler: 2,
            tap: None,
            clock: BusClock::Own,
        })
    }

    fn startup(&self, _section: &mut Section<'_, '_>) -> Option<Option<u32>> {
        Some(None)
    }

    fn device_file(
        &self,
        _section: &mut Section<'_, '_>,
        _network: &Network<'_>,
        _drive: Option<&DriveProfile>,
    ) -> (Option<Option<DeviceDescription>>, Option<Option<Esi>>) {
        (Some(None), Some(None))
    }

    fn exchange(
        &self,
        _section: &mut Section<'_, '_>,
        _network: &Network<'_>,
        _profile: Option<Profile>,
        _device: Option<&DeviceDescription>,
    ) -> Option<Exchange> {
        Some(Exchange::Polled)
    }

    fn node(&self, _section: &mut Section<'_, '_>, _network: &Network<'_>, _facts: &NodeFacts<'_>) -> Option<NodeKeys> {
        Some(NodeKeys {
            pres_timeout_us: 150,
            software: None,
            pdo_version: 0,
            ethercat: None,
        })
    }

    fn written_by_master(&self) -> IsOurs {
        |_, _| false
    }

    fn cross<'d, 'l>(&self, _section: &mut Section<'d, 'l>) -> Option<Vec<PendingCross<'d, 'l>>> {
        Some(Vec::new())
    }
}
