//! A wire on virtual time between a managing node and the simulated machine.
//!
//! In:  frames of the managing node through [`Link`]; a seed; [`Disturbance`]s at given times.
//! Out: frames of the machine through [`Link`]; every frame to a tap (such as a pcap file).
//!
//! Time passes only in [`Link::receive`] and [`VirtualNet::advance`], by leaps from event to event. The same seed, calls
//! and machine make the same run, octet by octet.

use super::SimMachine;
use powerlink::link::simulated::SplitMix64;
use powerlink::link::{Link, LinkError, Received};
use powerlink::wire::{FRAME_LEN_MAX, FRAME_LEN_MIN};
use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};
use std::fmt;

/// Octets on the wire beside the frame: preamble, FCS, gap.
const OVERHEAD: usize = 8 + 4 + 12;
/// One octet at 100 Mbit/s.
const OCTET_NS: u64 = 80;
/// Ethernet header; shorter frames cannot be sent.
const HEADER_LEN: usize = 14;

/// How the wire treats frames. Shares are from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NetConfig {
    /// Start of all that is random.
    pub seed: u64,
    /// Least and greatest time from the end of a frame on the wire to its reception, ns.
    pub delay_ns: [u64; 2],
    /// Share of frames that get lost.
    pub loss: f64,
    /// Share of frames that arrive twice.
    pub duplicate: f64,
    /// Share of frames that are held back for up to `reorder_ns`, so that later ones may overtake them.
    pub reorder: f64,
    /// Longest time that a frame is held back, ns.
    pub reorder_ns: u64,
    /// Share of frames in which one bit is turned over unnoticed by the CRC.
    pub corrupt: f64,
}

impl NetConfig {
    /// A good wire: 2 to 5 µs of delay and no faults.
    pub fn clean(seed: u64) -> NetConfig {
        NetConfig {
            seed,
            delay_ns: [2_000, 5_000],
            loss: 0.0,
            duplicate: 0.0,
            reorder: 0.0,
            reorder_ns: 300_000,
            corrupt: 0.0,
        }
    }
}

/// What can be done to the machine at a time of choice. Node ids that are not in the machine file change nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Disturbance {
    /// The node's next PRes get lost.
    DropPres {
        /// Node id.
        node: u8,
        /// How many.
        count: u32,
    },
    /// The node is switched off.
    PowerOff {
        /// Node id.
        node: u8,
    },
    /// The node is switched on again.
    PowerOn {
        /// Node id.
        node: u8,
    },
    /// The node's cable is pulled.
    Unplug {
        /// Node id.
        node: u8,
    },
    /// The node's cable is plugged in again.
    Plug {
        /// Node id.
        node: u8,
    },
    /// A fault inside a drive.
    DriveFault {
        /// Node id.
        node: u8,
        /// 603F.
        error_code: u16,
    },
    /// What is wired to the inputs 6000h/2 of an I/O node.
    Inputs {
        /// Node id.
        node: u8,
        /// Levels.
        wired: u8,
    },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum To {
    ManagingNode,
    Machine,
}

/// A frame on its way; ordered by arrival, then by departure.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Flight {
    at_ns: u64,
    order: u64,
    to: To,
    frame: Vec<u8>,
}

/// Called with the time and each frame that was not lost, in the order of sending.
pub type Tap = Box<dyn FnMut(u64, &[u8]) + Send>;

/// The wire, seen by the managing node as its link.
pub struct VirtualNet {
    machine: SimMachine,
    config: NetConfig,
    random: SplitMix64,
    now_ns: u64,
    flights: BinaryHeap<Reverse<Flight>>,
    order: u64,
    inbox: VecDeque<Vec<u8>>,
    /// When the wire is free again, to the managing node and to the machine.
    free_ns: [u64; 2],
    /// Latest first.
    disturbances: Vec<(u64, Disturbance)>,
    tap: Option<Tap>,
    /// Frames that got lost by chance.
    lost: u64,
}

impl fmt::Debug for VirtualNet {
    /// The seed and the time: what a failing test has to show.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("VirtualNet")
            .field("config", &self.config)
            .field("now_ns", &self.now_ns)
            .finish_non_exhaustive()
    }
}

impl VirtualNet {
    /// The wire to a machine, at time 0.
    pub fn new(machine: SimMachine, config: NetConfig) -> VirtualNet {
        VirtualNet {
            machine,
            config,
            random: SplitMix64::new(config.seed),
            now_ns: 0,
            flights: BinaryHeap::new(),
            order: 0,
            inbox: VecDeque::new(),
            free_ns: [0; 2],
            disturbances: Vec::new(),
            tap: None,
            lost: 0,
        }
    }

    /// The wire to a machine that is switched on at this time.
    pub fn starting_at(mut machine: SimMachine, config: NetConfig, now_ns: u64) -> VirtualNet {
        machine.switch_on(now_ns);
        VirtualNet {
            now_ns,
            ..VirtualNet::new(machine, config)
        }
    }

    /// Time on the wire, ns.
    pub fn time_ns(&self) -> u64 {
        self.now_ns
    }

    /// The machine at the far end.
    pub fn machine(&self) -> &SimMachine {
        &self.machine
    }

    /// The machine at the far end, to do something to it now.
    pub fn machine_mut(&mut self) -> &mut SimMachine {
        &mut self.machine
    }

    /// How the wire treats frames; may change during a run. The seed counts at the start only.
    pub fn config_mut(&mut self) -> &mut NetConfig {
        &mut self.config
    }

    /// Has something happen at a time; at once if the time is past.
    pub fn at(&mut self, at_ns: u64, disturbance: Disturbance) {
        let place = self.disturbances.partition_point(|(other_ns, _)| *other_ns > at_ns);
        self.disturbances.insert(place, (at_ns, disturbance));
    }

    /// Lets time pass while the managing node does not listen, as when its thread is late.
    pub fn advance(&mut self, duration_ns: u64) {
        let end_ns = self.now_ns + duration_ns;
        while self.next_event(end_ns) {}
        self.now_ns = end_ns;
    }

    /// Shows every frame on the wire to `tap`.
    pub fn set_tap(&mut self, tap: Tap) {
        self.tap = Some(tap);
    }

    /// Frames that got lost by chance so far.
    pub fn lost(&self) -> u64 {
        self.lost
    }

    /// Puts a frame of somebody else on the wire, to the managing node.
    pub fn inject(&mut self, frame: &[u8]) {
        self.launch(To::ManagingNode, frame.to_vec());
    }

    /// Puts a frame on the wire.
    fn launch(&mut self, to: To, mut frame: Vec<u8>) {
        if self.random.happens(self.config.loss) {
            self.lost += 1;
            return;
        }
        if self.random.happens(self.config.corrupt) {
            let bit = self.random.below(frame.len() as u64 * 8) as usize;
            frame[bit / 8] ^= 1 << (bit % 8);
        }
        let copies = if self.random.happens(self.config.duplicate) {
            2
        } else {
            1
        };
        if let Some(tap) = &mut self.tap {
            tap(self.now_ns, &frame);
        }
        let octets = (frame.len().max(FRAME_LEN_MIN) + OVERHEAD) as u64;
        for _ in 0..copies {
            let free_ns = &mut self.free_ns[to as usize];
            *free_ns = (*free_ns).max(self.now_ns) + octets * OCTET_NS;
            let sent_ns = *free_ns;
            let [least_ns, greatest_ns] = self.config.delay_ns;
            let mut at_ns = sent_ns + least_ns + self.random.below(greatest_ns.saturating_sub(least_ns) + 1);
            if self.random.happens(self.config.reorder) {
                at_ns += self.random.below(self.config.reorder_ns + 1);
            }
            self.order += 1;
            self.flights.push(Reverse(Flight {
                at_ns,
                order: self.order,
                to,
                frame: frame.clone(),
            }));
        }
    }

    /// Runs the next event that is due by `limit_ns`; false if there is none.
    fn next_event(&mut self, limit_ns: u64) -> bool {
        let disturbance_ns = self.disturbances.last().map(|(at_ns, _)| *at_ns);
        let flight_ns = self.flights.peek().map(|flight| flight.0.at_ns);
        let poll_ns = self.machine.next_poll_ns();
        let next_ns = [disturbance_ns, flight_ns]
            .into_iter()
            .flatten()
            .fold(poll_ns, u64::min);
        if next_ns > limit_ns {
            return false;
        }
        self.now_ns = self.now_ns.max(next_ns);
        let now_ns = self.now_ns;
        let mut answers = Vec::new();
        let mut send = |frame: &[u8]| answers.push(frame.to_vec());
        if disturbance_ns == Some(next_ns) {
            if let Some((_, disturbance)) = self.disturbances.pop() {
                self.disturb(disturbance);
            }
        } else if flight_ns == Some(next_ns) {
            match self.flights.pop() {
                Some(Reverse(Flight {
                    to: To::ManagingNode,
                    frame,
                    ..
                })) => self.inbox.push_back(frame),
                Some(Reverse(Flight {
                    to: To::Machine, frame, ..
                })) => {
                    self.machine.receive(now_ns, &frame, &mut send);
                }
                None => {}
            }
        } else {
            self.machine.poll(now_ns, &mut send);
        }
        for answer in answers {
            self.launch(To::ManagingNode, answer);
        }
        true
    }

    fn disturb(&mut self, disturbance: Disturbance) {
        let machine = &mut self.machine;
        match disturbance {
            Disturbance::DropPres { node, count } => machine.drop_pres(node, count),
            Disturbance::PowerOff { node } => machine.power_off(node),
            Disturbance::PowerOn { node } => machine.power_on(node),
            Disturbance::Unplug { node } => machine.plug(node, false),
            Disturbance::Plug { node } => machine.plug(node, true),
            Disturbance::DriveFault { node, error_code } => machine.raise_drive_fault(node, error_code),
            Disturbance::Inputs { node, wired } => machine.set_inputs(node, wired),
        };
    }
}

impl Link for VirtualNet {
    fn now_ns(&mut self) -> u64 {
        self.now_ns
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        if !(HEADER_LEN..=FRAME_LEN_MAX).contains(&frame.len()) {
            return Err(LinkError::FrameLength {
                got: frame.len(),
                max: FRAME_LEN_MAX,
            });
        }
        self.launch(To::Machine, frame.to_vec());
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], deadline_ns: u64) -> Result<Option<Received>, LinkError> {
        let limit_ns = deadline_ns.max(self.now_ns);
        loop {
            if let Some(frame) = self.inbox.pop_front() {
                let length = frame.len().min(buffer.len());
                buffer[..length].copy_from_slice(&frame[..length]);
                return Ok(Some(Received {
                    length,
                    stamp_ns: Some(self.now_ns),
                }));
            }
            if !self.next_event(limit_ns) {
                self.now_ns = limit_ns;
                return Ok(None);
            }
        }
    }
}
