//! The NMT state of a controlled node: what leads to another state and what entering it does.
//!
//! In:  frames heard, NMT commands, the clock. Out: the state, as [`nmt::cn_next`] has it, and its [`Events`].

use super::access::FIRST_DEVICE_OBJECT;
use super::chain::Chaining;
use super::controlled_node::Cn;
use super::error::Signalling;
use super::event::Events;
use super::pdo::Pdos;
use crate::nmt::{self, CnEvent, NmtCommand, NmtState};
use crate::wire::NmtCommandFrame;

impl<const E: usize, const B: usize> Cn<E, B> {
    pub(super) fn receive_nmt_command(&mut self, now_ns: u64, frame: &NmtCommandFrame, events: &mut Events) {
        if frame.command.plain().is_some() && !frame.nodes().contains(self.node_id) {
            return;
        }
        if let Some(event) = frame.command.cn_event() {
            self.event(event, now_ns, events);
        } else if frame.command == NmtCommand::NetHostNameSet {
            self.set_host_name(&frame.data);
        }
    }

    /// Whether the isochronous cycle runs for this node.
    pub(super) fn expects_soc(&self) -> bool {
        self.state.is_isochronous() || self.state == NmtState::Stopped
    }

    /// A frame of a managing node, or of another node's isochronous traffic.
    pub(super) fn apply_traffic(&mut self, event: CnEvent, now_ns: u64, events: &mut Events) {
        if self.state == NmtState::NotActive {
            self.watch_silence(now_ns);
        }
        self.event(event, now_ns, events);
    }

    pub(super) fn run_timers(&mut self, now_ns: u64, events: &mut Events) {
        if self.sdo.pending() == 0
            && let Some(reset) = self.reset_requested.take()
        {
            self.event(CnEvent::Reset(reset), now_ns, events);
        }
        if self.silent_at_ns.is_some_and(|at_ns| now_ns >= at_ns) {
            self.silent_at_ns = None;
            self.event(CnEvent::BasicEthernetTimeout, now_ns, events);
        }
        if self.chaining.fall_back_at_ns().is_some_and(|at_ns| now_ns >= at_ns) {
            self.switch_chaining(false, now_ns);
        }
        self.count_overdue_socs(now_ns, events);
    }

    pub(super) fn event(&mut self, event: CnEvent, now_ns: u64, events: &mut Events) {
        if let Some(next) = nmt::cn_next(self.state, event) {
            if let CnEvent::Reset(reset) = event {
                events.reset = Some(reset);
            }
            self.enter(next, now_ns, events);
        }
    }

    /// Enters a state and runs through the reset cascade from there.
    pub(super) fn enter(&mut self, first: NmtState, now_ns: u64, events: &mut Events) {
        let mut next = Some(first);
        // At most the four steps of the cascade and NOT_ACTIVE.
        while let Some(state) = next {
            self.state = state;
            self.enter_one(state, now_ns);
            next = nmt::cascade(state);
        }
        if !self.expects_soc() {
            self.watch.rest();
            self.switch_chaining(false, now_ns);
        }
        if !self.state.is_isochronous() {
            self.chaining.cancel();
        }
        if self.state != NmtState::NotActive {
            self.silent_at_ns = None;
        }
        self.dictionary.set(self.keys.nmt_state, self.state.into());
        events.nmt_state = Some(self.state);
    }

    fn enter_one(&mut self, state: NmtState, now_ns: u64) {
        match state {
            NmtState::ResetApplication => self.dictionary.restore_defaults(FIRST_DEVICE_OBJECT, 0xFFFF),
            NmtState::ResetCommunication => {
                self.dictionary.restore_defaults(0x1000, FIRST_DEVICE_OBJECT - 1);
                self.sdo.reset();
                self.signalling = Signalling::new();
                self.reset_requested = None;
            }
            NmtState::ResetConfiguration => {
                self.outbox.clear();
                self.chaining = Chaining::default();
                self.activate_configuration();
            }
            NmtState::ReadyToOperate => self.activate_configuration(),
            NmtState::NotActive => self.watch_silence(now_ns),
            NmtState::Operational => self.clear_cycle_errors(),
            NmtState::Off
            | NmtState::Initialising
            | NmtState::BasicEthernet
            | NmtState::PreOperational1
            | NmtState::PreOperational2
            | NmtState::Stopped
            | NmtState::Unknown(_) => {}
        }
    }

    fn activate_configuration(&mut self) {
        let (dictionary, keys) = (&self.dictionary, &self.keys);
        self.pdos = Pdos::activate(dictionary, keys);
        self.async_mtu = dictionary.get(keys.timing.async_mtu);
        self.configuration = (
            dictionary.get(keys.configuration.date),
            dictionary.get(keys.configuration.time),
        );
        self.watch.configure(
            dictionary.get(keys.cycle_us),
            dictionary.get(keys.timing.multiplexed_cycles),
        );
    }

    fn watch_silence(&mut self, now_ns: u64) {
        let silence_ns = u64::from(self.dictionary.get(self.keys.basic_ethernet_us)) * 1000;
        self.silent_at_ns = (silence_ns > 0).then(|| now_ns.saturating_add(silence_ns));
    }

    /// NetHostNameSet: up to the first zero.
    fn set_host_name(&mut self, data: &[u8]) {
        let len = data.iter().position(|octet| *octet == 0).unwrap_or(data.len());
        if let Ok(handle) = self.dictionary.find(0x1F9A, 0) {
            // Command data are as long as the object.
            let _ = self.dictionary.set_octets(handle, &data[..len]);
        }
    }
}
