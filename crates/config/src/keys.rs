//! What each protocol has of its own in the machine file: keys of `[bus]` and of `[[bus.node]]`.
//!
//! In:  tables of the machine file. Out: [`BusKeys`] and [`NodeKeys`], which a protocol that lacks a key fills with what it means there.

use super::device::IsOurs;
use super::document::Section;
use super::drive_profile::DriveProfile;
use super::ethercat::{self, Esi};
use super::node::Network;
use super::powerlink::{self, PendingCross};
use super::types::{
    BusClock, BusKind, BusLink, DeviceDescription, EthercatNode, Exchange, Mapped, Profile, Protocol, Stamp,
};

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

    /// What the manufacturer's file says of a node: an XDD or an ESI file.
    #[expect(
        clippy::type_complexity,
        reason = "`None`: cannot be used, `Some(None)`: there is none"
    )]
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

/// The part of a kind of bus. Of a kind that is not known yet, and where there is no bus, it is POWERLINK's.
pub(super) fn of(kind: Option<BusKind>) -> &'static dyn Keys {
    match kind.map_or(Protocol::None, BusKind::protocol) {
        Protocol::Powerlink | Protocol::None => &powerlink::Powerlink,
        Protocol::Ethercat => &ethercat::Ethercat,
    }
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
