//! The registry of protocols: how each of them is simulated.
//!
//! In:  a machine file. Out: its nodes on their bus; its master on virtual time.

use super::carrier::Carrier;
use super::near_end::{self, VirtualBus};
#[cfg(feature = "testing")]
use super::toy;
use super::{SimError, VirtualNet, ethercat, powerlink};
use bus::watch::Watch;
use config::{Config, Protocol};
use std::sync::Arc;

/// A protocol whose nodes and master can be simulated.
pub(super) trait Simulated {
    /// The nodes of a machine on their bus.
    ///
    /// # Errors
    /// A node that cannot be simulated.
    fn nodes(&self, config: &Config) -> Result<Box<dyn Carrier>, SimError>;

    /// The master of a machine on virtual time, for the time of a call.
    ///
    /// # Errors
    /// A network that cannot be.
    fn with_virtual(
        &self,
        config: &Config,
        link: VirtualNet,
        watch: Arc<Watch>,
        run: Box<dyn FnOnce(VirtualBus<'_>) + '_>,
    ) -> anyhow::Result<()>;

    /// Whether frames of every kind are taken from the interface of the far end, not only POWERLINK's.
    fn takes_every_frame(&self) -> bool;
}

/// How the bus of a machine is simulated. Where there is none, POWERLINK's has no nodes.
pub(super) fn simulated(config: &Config) -> &'static dyn Simulated {
    match config.bus.kind.protocol() {
        Protocol::Powerlink | Protocol::None => &Powerlink,
        Protocol::Ethercat => &Ethercat,
        #[cfg(feature = "testing")]
        Protocol::Toy => &toy::Simulated,
    }
}

struct Powerlink;

impl Simulated for Powerlink {
    fn nodes(&self, config: &Config) -> Result<Box<dyn Carrier>, SimError> {
        Ok(Box::new(powerlink::Powerlink::new(config)?))
    }

    fn with_virtual(
        &self,
        config: &Config,
        link: VirtualNet,
        watch: Arc<Watch>,
        run: Box<dyn FnOnce(VirtualBus<'_>) + '_>,
    ) -> anyhow::Result<()> {
        near_end::with_virtual_powerlink(config, link, watch, run)
    }

    fn takes_every_frame(&self) -> bool {
        false
    }
}

struct Ethercat;

impl Simulated for Ethercat {
    fn nodes(&self, config: &Config) -> Result<Box<dyn Carrier>, SimError> {
        Ok(Box::new(ethercat::Ethercat::new(config)?))
    }

    fn with_virtual(
        &self,
        config: &Config,
        link: VirtualNet,
        watch: Arc<Watch>,
        run: Box<dyn FnOnce(VirtualBus<'_>) + '_>,
    ) -> anyhow::Result<()> {
        near_end::with_virtual_ethercat(config, link, watch, run)
    }

    fn takes_every_frame(&self) -> bool {
        true
    }
}
