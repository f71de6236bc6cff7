//! One controlled node: all that it holds from one call to the next.

use obd::Dictionary;

use super::chain::Chaining;
use super::config::{CnConfig, CnError};
use super::error::Signalling;
use super::event::{Events, WriteCheck};
use super::keys::Keys;
use super::outbox::Outbox;
use super::pdo::Pdos;
use super::watch::Watch;
use crate::nmt::{NmtState, Reset};
use crate::sdo::Server;
use crate::wire::{Mac, NetTime, node};

/// Network of all POWERLINK nodes: 192.168.100.0.
const IP_NETWORK: u32 = 0xC0A8_6400;

/// One controlled node with a dictionary of `E` lines and `B` octets.
#[derive(Clone, Debug)]
pub struct Cn<const E: usize, const B: usize> {
    pub(super) node_id: u8,
    pub(super) mac: Mac,
    pub(super) dictionary: Dictionary<E, B>,
    pub(super) keys: Keys,
    pub(super) state: NmtState,
    pub(super) check: Option<WriteCheck<E, B>>,
    pub(super) sdo: Server,
    pub(super) signalling: Signalling,
    pub(super) pdos: Pdos,
    pub(super) watch: Watch,
    pub(super) chaining: Chaining,
    pub(super) outbox: Outbox,
    /// 0x1F98/8 when the configuration was activated.
    pub(super) async_mtu: u16,
    /// 0x1020/1 and /2 when the configuration was activated: which one is in use.
    pub(super) configuration: (u32, u32),
    /// When NOT_ACTIVE ends for lack of frames.
    pub(super) silent_at_ns: Option<u64>,
    /// A reset asked for by 0x1F9E, carried out when the SDO answer is on its way.
    pub(super) reset_requested: Option<Reset>,
    /// Last ER of the managing node.
    pub(super) exception_reset: bool,
    pub(super) net_time: NetTime,
}

impl<const E: usize, const B: usize> Cn<E, B> {
    /// Builds the node and runs it through the reset cascade to NOT_ACTIVE. The dictionary has to contain
    /// [`COMMUNICATION_PROFILE`](super::objects::COMMUNICATION_PROFILE).
    ///
    /// # Errors
    /// [`CnError`]: a node id out of range, a missing object, a name that is too long.
    pub fn new(config: &CnConfig<'_>, mut dictionary: Dictionary<E, B>, now_ns: u64) -> Result<Self, CnError> {
        if !(1..=node::CN_MAX).contains(&config.node_id) {
            return Err(CnError::NodeId(config.node_id));
        }
        let keys = Keys::find(&dictionary)?;
        let ip_address = IP_NETWORK | u32::from(config.node_id);
        let own: [(u16, u8, &[u8]); 11] = [
            (0x1000, 0, &config.device_type.to_le_bytes()),
            (0x1008, 0, config.device_name.as_bytes()),
            (0x1018, 1, &config.vendor_id.to_le_bytes()),
            (0x1018, 2, &config.product_code.to_le_bytes()),
            (0x1018, 3, &config.revision.to_le_bytes()),
            (0x1018, 4, &config.serial.to_le_bytes()),
            (0x1030, 5, &config.mac),
            (0x1E40, 2, &ip_address.to_le_bytes()),
            (0x1F93, 1, &[config.node_id]),
            (0x1F98, 3, &config.pres_max_latency_ns.to_le_bytes()),
            (0x1F9A, 0, config.host_name.as_bytes()),
        ];
        for (index, sub, octets) in own {
            dictionary
                .find(index, sub)
                .and_then(|handle| dictionary.set_default(handle, octets))
                .map_err(|code| CnError::Object { index, sub, code })?;
        }
        let mut cn = Cn {
            node_id: config.node_id,
            mac: config.mac,
            dictionary,
            keys,
            state: NmtState::Off,
            check: None,
            sdo: Server::new(),
            signalling: Signalling::new(),
            pdos: Pdos::EMPTY,
            watch: Watch::NONE,
            chaining: Chaining::default(),
            outbox: Outbox::new(),
            async_mtu: 0,
            configuration: (0, 0),
            silent_at_ns: None,
            reset_requested: None,
            exception_reset: false,
            net_time: NetTime::default(),
        };
        cn.power_on(now_ns);
        Ok(cn)
    }

    /// Switched on, or off and on again: objects have their defaults, and nothing is under way. In place: a node is too large to be
    /// moved about on the stack of a real-time thread.
    ///
    /// RT: no allocation.
    pub fn power_on(&mut self, now_ns: u64) {
        self.watch = Watch::NONE;
        self.exception_reset = false;
        self.net_time = NetTime::default();
        // Through all resets, which do the rest.
        self.enter(NmtState::Initialising, now_ns, &mut Events::default());
    }
}
