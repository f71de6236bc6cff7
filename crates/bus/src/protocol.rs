//! The registry of protocols: what each of them does for a machine as a whole.
//!
//! In:  a machine file. Out: its network checked, planned, and opened, by the protocol that the file names.

use crate::plan::NodePlan;
use crate::service::BudgetView;
#[cfg(feature = "testing")]
use crate::toy;
use crate::watch::Watch;
use crate::{Open, ethercat, powerlink};
use ::powerlink::link::Link;
use config::{Config, ConfigErrors, Protocol};
use std::sync::Arc;

/// What runs while a bus is open.
pub(crate) type Run<'r> = Box<dyn FnOnce(Open<'_>) + 'r>;

/// The master of a protocol: managing node, main device.
pub(crate) trait Master {
    /// As [`crate::check`].
    fn check(&self, config: &Config) -> Result<(), ConfigErrors>;

    /// As [`crate::plan`].
    fn plan(&self, config: &Config) -> Vec<NodePlan>;

    /// As [`crate::budget`].
    fn budget(&self, config: &Config) -> Vec<BudgetView>;

    /// As [`crate::worst_exchange_ns`].
    fn worst_exchange_ns(&self, config: &Config) -> u64;

    /// As [`crate::with_interface`].
    fn with_interface(
        &self,
        config: &Config,
        interface: &str,
        watch: Arc<Watch>,
        threads: fn(),
        warn: &mut dyn FnMut(&str),
        run: Run<'_>,
    ) -> anyhow::Result<()>;

    /// As [`crate::with_link`].
    fn with_link(
        &self,
        config: &Config,
        link: Box<dyn Link + Send + '_>,
        mac: [u8; 6],
        watch: Arc<Watch>,
        run: Run<'_>,
    ) -> anyhow::Result<()>;
}

/// The master for a machine. One without a bus has no nodes: what POWERLINK's says of these is nothing.
pub(crate) fn master(config: &Config) -> &'static dyn Master {
    match config.bus.kind.protocol() {
        Protocol::Powerlink | Protocol::None => &powerlink::open::ManagingNode,
        Protocol::Ethercat => &ethercat::open::MainDevice,
        #[cfg(feature = "testing")]
        Protocol::Toy => &toy::Master,
    }
}
