//! What each protocol has of its own in the machine file: keys of `[bus]` and of `[[bus.node]]`.
//!
//! In:  tables of the machine file. Out: [`BusKeys`] and [`NodeKeys`], which a protocol that lacks a key fills with what it means there.

use super::bus_types::{BusClock, BusKind, BusLink, EthercatNode, Exchange, Mapped, Profile, Stamp};
use super::cross::PendingCross;
use super::device::IsOurs;
use super::drive::DriveUse;
use super::drive_profile::DriveProfile;
use super::esi::Esi;
use super::section::Section;
use obd::device::DeviceDescription;
use std::path::Path;

/// A key that cannot stand in a table, and why.
pub(super) type Foreign = (&'static str, &'static str);

/// A protocol's part of the machine file.
pub(super) trait Keys {
    /// Keys of `[bus]` that only another protocol has.
    fn foreign_of_bus(&self) -> &'static [Foreign];

    /// Keys of a node that only another protocol has.
    fn foreign_of_node(&self) -> &'static [Foreign];

    /// The protocol's own keys of `[bus]`.
    fn bus(&self, section: &mut Section<'_, '_>, kind: Option<BusKind>, cycle_us: Option<u32>) -> Option<BusKeys>;

    /// How the network starts (1F80); `Some(None)`: as it usually does.
    fn startup(&self, section: &mut Section<'_, '_>) -> Option<Option<u32>>;

    /// What the manufacturer's file says of a node: an XDD or an ESI file. `None`: cannot be used, `Some(None)`: there is none.
    fn device_file(
        &self,
        section: &mut Section<'_, '_>,
        network: &Network<'_>,
        drive: Option<&DriveProfile>,
    ) -> (Option<Option<DeviceDescription>>, Option<Option<Esi>>);

    /// When a node takes part in the exchange.
    fn exchange(
        &self,
        section: &mut Section<'_, '_>,
        network: &Network<'_>,
        profile: Option<Profile>,
        device: Option<&DeviceDescription>,
    ) -> Option<Exchange>;

    /// The protocol's own keys of a node, beside those above.
    fn node(&self, section: &mut Section<'_, '_>, network: &Network<'_>, facts: &NodeFacts<'_>) -> Option<NodeKeys>;

    /// Objects that the master of the bus writes by itself.
    fn written_by_master(&self) -> IsOurs;

    /// What a node reads from other nodes.
    fn cross<'d, 'l>(&self, section: &mut Section<'d, 'l>) -> Option<Vec<PendingCross<'d, 'l>>>;
}

/// What a node is read against.
pub(super) struct Network<'a> {
    /// Folder of the machine file.
    pub(super) folder: &'a Path,
    pub(super) cycle_us: Option<u32>,
    /// Cycles of a multiplexed round.
    pub(super) multiplex_cycles: Option<u8>,
    /// What drives are there for.
    pub(super) uses: &'a [DriveUse],
    /// What the protocol of the bus has of its own.
    pub(super) keys: &'static dyn Keys,
    /// Whose clock leads, where that is known.
    pub(super) clock: Option<BusClock>,
}

/// Keys of `[bus]` that not every protocol has.
pub(super) struct BusKeys {
    pub(super) link: BusLink,
    pub(super) async_slot_timeout_us: u32,
    pub(super) lost_max: u32,
    pub(super) soc_lost_max: u32,
    pub(super) multiplex_cycles: u8,
    pub(super) async_mtu: u16,
    pub(super) prescaler: u16,
    pub(super) tap: Option<String>,
    pub(super) clock: BusClock,
}

/// What is known of a node where its own keys are read.
pub(super) struct NodeFacts<'a> {
    pub(super) is_drive: bool,
    pub(super) device: Option<&'a DeviceDescription>,
    pub(super) esi: Option<&'a Esi>,
    /// `None`: wrong.
    pub(super) outputs: Option<&'a [Mapped]>,
    /// `None`: wrong.
    pub(super) inputs: Option<&'a [Mapped]>,
}

/// Keys of a node that not every protocol has.
pub(super) struct NodeKeys {
    pub(super) pres_timeout_us: u32,
    pub(super) software: Option<Stamp>,
    pub(super) pdo_version: u8,
    pub(super) ethercat: Option<EthercatNode>,
}
