//! Ethernet POWERLINK V2 (EPSG DS 301): frames, network management, managing node, controlled node, links to a wire.
//!
//! In:  octets of Ethernet frames with EtherType 0x88AB, the time, process data of the application.
//! Out: the frames to send and when; process data of the other nodes; events.
//!
//! Protocol code does no I/O and never asks for the time: [`mn`] and [`cn`] are told what arrived and when, and say
//! what to send and until when to wait. [`link`] holds what carries frames: a raw socket, memory, a pcap file.
//! Without the feature `std` everything but those links builds without `std` and without `alloc`.
//!
//! A managing node and a controlled node, each handed the frames of the other, on virtual time (`examples/two_nodes.rs` has
//! a wire between them that loses frames):
//!
//! ```
//! use obd::Dictionary;
//! use powerlink::cn::objects::{COMMUNICATION_BYTES, COMMUNICATION_ENTRIES, COMMUNICATION_PROFILE};
//! use powerlink::cn::{Cn, CnConfig};
//! use powerlink::mn::{Mn, MnConfig, NodeConfig, NodeState, Step};
//! use powerlink::wire::{FRAME_LEN_MAX, NetTime};
//!
//! let nodes = [NodeConfig { id: 1, ..NodeConfig::default() }];
//! let config = MnConfig { nodes: &nodes, mac: [2, 0, 0, 0, 0, 240], ..MnConfig::default() };
//! let mut mn = Mn::<1>::new(config)?;
//! let device = CnConfig {
//!     node_id: 1,
//!     mac: [2, 0, 0, 0, 0, 1],
//!     device_type: 0,
//!     vendor_id: 0,
//!     product_code: 0,
//!     revision: 0,
//!     serial: 1,
//!     device_name: "example",
//!     host_name: "example",
//!     pres_max_latency_ns: 20_000,
//! };
//! let dictionary = Dictionary::new(&[COMMUNICATION_PROFILE])?;
//! let mut cn = Cn::<COMMUNICATION_ENTRIES, COMMUNICATION_BYTES>::new(&device, dictionary, 0)?;
//! let mut answer = [0; FRAME_LEN_MAX];
//! let mut now_ns = 0;
//! while mn.node_state(0) != NodeState::Operational {
//!     assert!(now_ns < 10_000_000_000, "not OPERATIONAL within ten seconds: {:?}", mn.diagnosis(0));
//!     let end_ns = now_ns + u64::from(config.cycle_ns);
//!     mn.start_cycle(now_ns, NetTime::default());
//!     while now_ns < end_ns {
//!         match mn.poll(now_ns) {
//!             Step::Send(frame) => {
//!                 let reaction = cn.receive(now_ns, frame, &mut answer);
//!                 now_ns += 10_000;
//!                 if let Some(len) = reaction.transmit {
//!                     mn.receive(now_ns, &answer[..len]);
//!                 }
//!             }
//!             Step::WaitUntil(until_ns) => now_ns = until_ns.min(end_ns),
//!             Step::IsochronousDone => {} // inputs are complete: the next outputs are computed here
//!             Step::Idle => now_ns = end_ns,
//!         }
//!     }
//!     now_ns = end_ns;
//!     cn.poll(now_ns);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Where to read
//!
//! | to learn | file |
//! |---|---|
//! | what is on the wire, octet by octet; who may send what to whom | `wire/`; `wire/addresses.rs` |
//! | the NMT states of both ends, as tables | `nmt/` |
//! | what a cycle is made of: SoC, chain, polls, PRes of the managing node; SoA and slot | `mn/cycle.rs`; `mn/async_phase.rs` |
//! | how one node boots, stage by stage; how it is configured | `mn/boot.rs`; `mn/configure.rs` |
//! | who gets the asynchronous slot | `mn/async_scheduler.rs` |
//! | when the network as a whole takes a step | `mn/network.rs` |
//! | everything that lasts from call to call: the network; one node and its stage | `mn/state.rs`; `mn/node.rs`, `mn/stage.rs` |
//! | why a node is not operational; the same in words | `mn/reason.rs`; `mn/diagnosis.rs` |
//! | every object of the managing node; of a controlled node | `mn/objects/table.rs`; `cn/objects/mod.rs` |
//! | the process image by which other managing nodes map the same network | `mn/image.rs` |
//! | SDO: sequence layer, commands, segments, both ends | `sdo/` |
//! | what carries frames: raw socket with a ring shared with the kernel, libpnet (`bus.link = "pnet"`), memory, a simulated network with faults | `link/` |
//!
//! Four properties always hold and are tested: one frame at a time on the wire; a lost node never takes the network down, unless
//! the bits of [`mn::StartUp`] ask for it; late cycles are counted and skipped, never a reason to start again; any octets from
//! the wire are counted by reason and do nothing else. `tests/network/` runs whole networks on virtual time through faults of
//! all kinds, while an independent observer watches every frame.
//!
//! Nodes are already configured in PRE_OPERATIONAL_1, where asynchronous slots follow each other without waiting for a cycle.
//! A node that is polled in each cycle, in one cycle of a multiplexed round, or not at all but by a chain after the managing
//! node's own PRes differs only in `mn/cycle.rs` and `mn/chaining.rs`; process data reach the application in the same way.
#![no_std]
#![warn(clippy::missing_errors_doc)]

#[cfg(any(test, feature = "std"))]
extern crate std;

pub mod cn;
pub mod error_code;
mod ethernet_queue;
pub mod link;
pub mod mn;
pub mod nmt;
pub mod sdo;
pub mod wire;
