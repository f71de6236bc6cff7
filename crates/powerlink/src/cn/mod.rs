//! The controlled node.
//!
//! In:  every frame that arrives at the node's interface, the time, the object dictionary of the device.
//! Out: the frame to be sent at once in answer (PRes, IdentResponse, StatusResponse, SDO) or at its time (a chained PRes), and
//!      [`Events`]: the synchronous instant, new outputs in the dictionary, NMT state changes, loss of the managing node.
//!
//! [`Cn`] does no I/O and asks for no time. A process that is several nodes holds one `Cn` for each and hands every frame to
//! all of them, but for what may pass by one that [rests](Cn::rests_until_ns); each answers only what is meant for its node id.
//! Frames that are not POWERLINK are the caller's.
//!
//! The device reads its outputs from the dictionary when [`Events::outputs`] is set and writes its inputs there; the next
//! PRes carries them. Mapping (0x1600.., 0x1A00), mapping versions, payload limits and cycle length become active by
//! ResetConfiguration and on the way to READY_TO_OPERATE.
//!
//! | file | what |
//! |---|---|
//! | `controlled_node` | all that lasts from call to call; `chain`, `outbox` and `watch` are parts of it |
//! | `receive` | the way of a received frame |
//! | `state` | NMT state and resets |
//! | `supervision` | counters and thresholds of lost frames |
//! | `error` | history 0x1003 and error signalling |
//! | `pdo` | mappings and copy plans |
//! | `asynchronous` | answers to invitations and queues |
//! | `chaining` | PRes chaining |
//! | [`objects`], `keys`, `access` | the dictionary: table, handles, effects of SDO writes |

mod access;
mod asynchronous;
mod chain;
mod chaining;
mod config;
mod controlled_node;
mod error;
mod event;
mod keys;

pub mod objects;
mod outbox;
mod pdo;
mod receive;
mod state;
mod supervision;
mod watch;

use obd::{Dictionary, Key};

pub use crate::ethernet_queue::{ETHERNET_FRAMES, QueueError};
use crate::nmt::NmtState;
use crate::wire::{ErrorEntry, FRAME_LEN_MAX, Soa};
pub use config::{CnConfig, CnError};
pub use controlled_node::Cn;
pub use error::code as error_code;
use error::{Signalling, TYPE_OCCURRED};
pub use event::{Events, Reaction, Storage, StorageGroup, WriteCheck};
pub use watch::CycleError;

impl<const E: usize, const B: usize> Cn<E, B> {
    /// Node id (0x1F93/1).
    pub fn node_id(&self) -> u8 {
        self.node_id
    }

    /// NMT state (0x1F8C).
    pub fn nmt_state(&self) -> NmtState {
        self.state
    }

    /// The dictionary, for the device's outputs.
    pub fn dictionary(&self) -> &Dictionary<E, B> {
        &self.dictionary
    }

    /// The dictionary, for the device's inputs.
    pub fn dictionary_mut(&mut self) -> &mut Dictionary<E, B> {
        &mut self.dictionary
    }

    /// Has SDO writes to the objects of the device judged by `check`.
    pub fn set_write_check(&mut self, check: WriteCheck<E, B>) {
        self.check = Some(check);
    }

    /// Reports an error of the device: into the history 0x1003 and to the managing node. `profile` is the number of the device
    /// profile, as 402 (1 for a vendor's own codes).
    pub fn report_error(&mut self, profile: u16, code: u16, info: [u8; 8]) {
        let entry_type = TYPE_OCCURRED | (profile & 0x0FFF);
        let entry = ErrorEntry {
            entry_type,
            code,
            time: self.net_time,
            info,
        };
        error::record(&mut self.dictionary, &self.keys, &entry);
        self.count(self.keys.statistics.history_writes);
        let mut queued = false;
        self.signalling_step(|signalling| queued = signalling.push(entry));
        self.count(if queued {
            self.keys.statistics.queue_writes
        } else {
            self.keys.statistics.queue_overflows
        });
    }

    /// When [`poll`](Self::poll) and [`poll_transmit`](Self::poll_transmit) have to be called at the latest if no frame arrives
    /// before.
    pub fn next_deadline_ns(&self) -> Option<u64> {
        let at_once = (self.state == NmtState::BasicEthernet && self.outbox.has_frame()).then_some(0);
        [
            self.watch.soc_due_ns(),
            self.silent_at_ns,
            self.chaining.transmit_at_ns(),
            self.chaining.fall_back_at_ns(),
            at_once,
        ]
        .into_iter()
        .flatten()
        .min()
    }

    /// Looks at the clock. RT: no allocation, no locks, bounded.
    pub fn poll(&mut self, now_ns: u64) -> Events {
        let mut events = Events::default();
        self.run_timers(now_ns, &mut events);
        events
    }

    /// Writes a frame into `response` that is due by the clock and not the answer to a frame: the PRes of a chained node at its
    /// time, and in BASIC_ETHERNET what [`send_ethernet`](Self::send_ethernet) has queued. `None`: nothing is due.
    /// RT: no allocation, no locks, bounded.
    pub fn poll_transmit(&mut self, now_ns: u64, response: &mut [u8; FRAME_LEN_MAX]) -> Option<usize> {
        if self.state == NmtState::BasicEthernet {
            return self.outbox.pop_frame(response);
        }
        self.poll_chained_pres(now_ns, response)
    }

    /// Does something with error signalling and counts what it did to EN.
    fn signalling_step(&mut self, step: impl FnOnce(&mut Signalling)) {
        let before = self.signalling.exception_new();
        step(&mut self.signalling);
        if self.signalling.exception_new() != before {
            self.count(self.keys.statistics.new_edges);
        }
    }

    /// EA and ER of a StatusRequest to this node.
    fn take_status_request(&mut self, soa: &Soa) {
        self.count(self.keys.telegrams.status_requests);
        if soa.exception_reset && !self.exception_reset {
            self.count(self.keys.statistics.reset_edges);
        }
        self.exception_reset = soa.exception_reset;
        self.signalling_step(|signalling| {
            signalling.acknowledge(soa.exception_acknowledge);
            signalling.reset(soa.exception_reset);
        });
    }

    fn set_error_register(&mut self, register: u8) {
        if self.dictionary.get(self.keys.error_register) != register {
            self.dictionary.set(self.keys.error_register, register);
            self.count(self.keys.statistics.static_changes);
        }
    }

    /// One more of what 0x1101 and 0x1102 count.
    fn count(&mut self, counter: Key<u32>) {
        let count = self.dictionary.get(counter);
        self.dictionary.set(counter, count.wrapping_add(1));
    }
}

#[cfg(test)]
mod tests;
