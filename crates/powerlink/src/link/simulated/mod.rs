//! A network in memory on virtual time: stations on one hub, with faults from a seed.
//!
//! In:  frames that stations send, each at its time; how the wire to each station treats frames; a seed.
//! Out: the frames as every other station receives them, in the order of time; frames that met on the wire; all frames to a tap.
//!
//! No threads and no clock: [`Hub::send`] puts a frame on the wire, [`Hub::receive`] takes the next arrival. The same seed
//! and calls make the same run, octet by octet. Not RT; allocates nothing once its queues have grown.

use core::cmp::Reverse;
use core::fmt;
use core::ops::Range;
use std::boxed::Box;
use std::collections::BinaryHeap;
use std::vec::Vec;

use super::LinkError;
use crate::wire::{FRAME_LEN_MAX, FRAME_LEN_MIN};

/// Octets on the wire beside the frame that belong to it: preamble and FCS.
const FRAME_OVERHEAD: usize = 8 + 4;
/// One octet at 100 Mbit/s.
const OCTET_NS: u64 = 80;
/// Silence after every frame: 12 octets.
pub const GAP_NS: u64 = 12 * OCTET_NS;
/// Ethernet header; shorter frames cannot be sent.
const HEADER_LEN: usize = 14;

/// Time a frame without FCS occupies the wire at 100 Mbit/s, preamble and FCS included, the gap after it not, in ns.
pub fn wire_ns(length: usize) -> u64 {
    (length.max(FRAME_LEN_MIN) + FRAME_OVERHEAD) as u64 * OCTET_NS
}

/// What happens to frames on the last stretch to a station. Shares are from 0 to 1, each drawn for every frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    /// Time from the hub to the station and from the station to the hub, in ns.
    pub delay_ns: u64,
    /// Most that is added at random to the time from the hub, in ns.
    pub jitter_ns: u64,
    /// Share of frames that do not arrive.
    pub loss: f64,
    /// Share of frames that arrive twice.
    pub duplicate: f64,
    /// Share of frames that are held back for up to `reorder_ns`, so that later ones may overtake them.
    pub reorder: f64,
    /// Longest time that a frame is held back, in ns.
    pub reorder_ns: u64,
    /// Share of frames in which one bit is turned over unnoticed by the FCS.
    pub corrupt: f64,
    /// Octets of the frame in which that bit lies.
    pub corrupt_octets: Range<usize>,
}

impl Default for Path {
    /// A good wire: 1 µs, no faults.
    fn default() -> Path {
        Path {
            delay_ns: 1_000,
            jitter_ns: 0,
            loss: 0.0,
            duplicate: 0.0,
            reorder: 0.0,
            reorder_ns: 300_000,
            corrupt: 0.0,
            corrupt_octets: 0..FRAME_LEN_MAX,
        }
    }
}

/// One of the stations of a [`Hub`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Station(usize);

impl Station {
    /// Position in the order of attachment.
    pub fn index(self) -> usize {
        self.0
    }
}

/// What was done to a frame on its way, as far as its receiver could be misled by it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Faults {
    /// It is the second copy.
    pub duplicated: bool,
    /// It was held back.
    pub held_back: bool,
    /// One bit of it is wrong.
    pub corrupted: bool,
}

impl Faults {
    /// Anything at all.
    pub fn any(self) -> bool {
        self.duplicated || self.held_back || self.corrupted
    }
}

/// A frame that arrived; its octets lie in the caller's buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Arrival {
    /// When its last octet was received.
    pub at_ns: u64,
    /// Who sent it.
    pub from: Station,
    /// Who receives it.
    pub to: Station,
    /// Length in octets.
    pub length: usize,
    /// What was done to it.
    pub faults: Faults,
}

/// Two frames on the wire at once. Both are delivered nevertheless, as switches do it; on a hub they would be lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Collision {
    /// When the second one began.
    pub at_ns: u64,
    /// Who sent the first and the second one.
    pub stations: [Station; 2],
}

/// What a station does to the wire: from when to when it sent without a pause.
#[derive(Clone, Debug)]
struct Port {
    path: Path,
    plugged: bool,
    busy_from_ns: u64,
    busy_until_ns: u64,
}

/// A frame on its way to one station; ordered by arrival, then by departure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Flight {
    at_ns: u64,
    order: u64,
    to: Station,
    frame: usize,
    /// Bit that is turned over.
    corrupt: Option<usize>,
    duplicated: bool,
    held_back: bool,
}

/// Octets of a frame that some stations have still to receive.
#[derive(Clone, Debug)]
struct Shared {
    from: Station,
    octets: Vec<u8>,
    flights: usize,
}

/// Called with the virtual time at which its first octet leaves, in ns, and each frame as it was sent, in the order of sending.
pub type Tap = Box<dyn FnMut(u64, &[u8]) + Send>;

/// Stations on one wire, on virtual time.
pub struct Hub {
    random: SplitMix64,
    ports: Vec<Port>,
    flights: BinaryHeap<Reverse<Flight>>,
    frames: Vec<Shared>,
    /// Positions in `frames` that are not in use.
    free: Vec<usize>,
    order: u64,
    collision: Option<Collision>,
    lost: u64,
    tap: Option<Tap>,
}

impl fmt::Debug for Hub {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Hub")
            .field("ports", &self.ports)
            .field("flights", &self.flights.len())
            .field("lost", &self.lost)
            .finish_non_exhaustive()
    }
}

impl Hub {
    /// A hub without stations. Everything random comes from the seed.
    pub fn new(seed: u64) -> Hub {
        Hub {
            random: SplitMix64::new(seed),
            ports: Vec::new(),
            flights: BinaryHeap::new(),
            frames: Vec::new(),
            free: Vec::new(),
            order: 0,
            collision: None,
            lost: 0,
            tap: None,
        }
    }

    /// Plugs a new station in.
    pub fn attach(&mut self, path: Path) -> Station {
        self.ports.push(Port {
            path,
            plugged: true,
            busy_from_ns: 0,
            busy_until_ns: 0,
        });
        Station(self.ports.len() - 1)
    }

    /// How the wire treats frames to a station; may change during a run.
    pub fn path_mut(&mut self, station: Station) -> &mut Path {
        &mut self.ports[station.0].path
    }

    /// Pulls a station's cable (frames on their way to it are lost) or plugs it in again.
    pub fn plug(&mut self, station: Station, plugged: bool) {
        self.ports[station.0].plugged = plugged;
    }

    /// Shows every frame to `tap`, such as a capture file.
    pub fn set_tap(&mut self, tap: Tap) {
        self.tap = Some(tap);
    }

    /// A station sends a frame: at once, or when the frame before it has left. Returns when its last octet has left. Times
    /// must not go back from call to call.
    ///
    /// # Errors
    /// [`LinkError::FrameLength`], and [`LinkError::Down`] without a cable.
    pub fn send(&mut self, from: Station, now_ns: u64, frame: &[u8]) -> Result<u64, LinkError> {
        if !(HEADER_LEN..=FRAME_LEN_MAX).contains(&frame.len()) {
            return Err(LinkError::FrameLength {
                got: frame.len(),
                max: FRAME_LEN_MAX,
            });
        }
        if !self.ports[from.0].plugged {
            return Err(LinkError::Down);
        }
        let port = &mut self.ports[from.0];
        let free_ns = port.busy_until_ns + GAP_NS;
        let begin_ns = if port.busy_until_ns > 0 {
            now_ns.max(free_ns)
        } else {
            now_ns
        };
        if begin_ns > free_ns {
            port.busy_from_ns = begin_ns;
        }
        let end_ns = begin_ns + wire_ns(frame.len());
        port.busy_until_ns = end_ns;
        self.detect_collision(from, begin_ns, end_ns);
        if let Some(tap) = &mut self.tap {
            tap(begin_ns, frame);
        }
        self.launch(from, end_ns, frame);
        Ok(end_ns)
    }

    /// Compares the time a frame is at the hub with what the others are sending.
    fn detect_collision(&mut self, from: Station, begin_ns: u64, end_ns: u64) {
        let own_delay_ns = self.ports[from.0].path.delay_ns;
        let (begin_ns, end_ns) = (begin_ns + own_delay_ns, end_ns + own_delay_ns);
        for (other, port) in self.ports.iter().enumerate() {
            let (other_begin_ns, other_end_ns) = (
                port.busy_from_ns + port.path.delay_ns,
                port.busy_until_ns + port.path.delay_ns,
            );
            if other != from.0 && port.busy_until_ns > 0 && begin_ns < other_end_ns && other_begin_ns < end_ns {
                self.collision = Some(Collision {
                    at_ns: begin_ns.max(other_begin_ns),
                    stations: [Station(other), from],
                });
            }
        }
    }

    /// Puts a frame that has left its station on its way to all the others.
    fn launch(&mut self, from: Station, end_ns: u64, octets: &[u8]) {
        let frame = self.free.pop().unwrap_or_else(|| {
            self.frames.push(Shared {
                from,
                octets: Vec::with_capacity(FRAME_LEN_MIN),
                flights: 0,
            });
            self.frames.len() - 1
        });
        self.frames[frame].from = from;
        self.frames[frame].octets.clear();
        self.frames[frame].octets.extend_from_slice(octets);
        let at_hub_ns = end_ns + self.ports[from.0].path.delay_ns;
        for to in 0..self.ports.len() {
            let Port { path, plugged, .. } = &self.ports[to];
            if to == from.0 || !plugged {
                continue;
            }
            let random = &mut self.random;
            if random.happens(path.loss) {
                self.lost += 1;
                continue;
            }
            let copies = 1 + u64::from(random.happens(path.duplicate));
            let held_back = random.happens(path.reorder);
            let mut at_ns = at_hub_ns + path.delay_ns;
            if path.jitter_ns > 0 {
                at_ns += random.below(path.jitter_ns + 1);
            }
            if held_back {
                at_ns += random.below(path.reorder_ns + 1);
            }
            let corrupt = random.happens(path.corrupt).then(|| {
                let octets = path.corrupt_octets.start..path.corrupt_octets.end.min(octets.len());
                8 * octets.start + random.below(8 * octets.len() as u64) as usize
            });
            for copy in 0..copies {
                self.order += 1;
                self.frames[frame].flights += 1;
                self.flights.push(Reverse(Flight {
                    at_ns: at_ns + copy * (wire_ns(octets.len()) + GAP_NS),
                    order: self.order,
                    to: Station(to),
                    frame,
                    corrupt,
                    duplicated: copy > 0,
                    held_back,
                }));
            }
        }
        if self.frames[frame].flights == 0 {
            self.free.push(frame);
        }
    }

    /// When the next frame arrives anywhere.
    pub fn next_ns(&self) -> Option<u64> {
        self.flights.peek().map(|flight| flight.0.at_ns)
    }

    /// Takes the next arrival, if it is not after `until_ns`. A frame longer than the buffer is cut.
    pub fn receive(&mut self, until_ns: u64, buffer: &mut [u8]) -> Option<Arrival> {
        while self.next_ns()? <= until_ns {
            let Reverse(flight) = self.flights.pop()?;
            let frame = &mut self.frames[flight.frame];
            let (from, length) = (frame.from, frame.octets.len().min(buffer.len()));
            buffer[..length].copy_from_slice(&frame.octets[..length]);
            frame.flights -= 1;
            if frame.flights == 0 {
                self.free.push(flight.frame);
            }
            if !self.ports[flight.to.0].plugged {
                self.lost += 1;
                continue;
            }
            if let Some(octet) = flight.corrupt.and_then(|bit| buffer[..length].get_mut(bit / 8)) {
                *octet ^= 1 << (flight.corrupt.unwrap_or(0) % 8);
            }
            return Some(Arrival {
                at_ns: flight.at_ns,
                from,
                to: flight.to,
                length,
                faults: Faults {
                    duplicated: flight.duplicated,
                    held_back: flight.held_back,
                    corrupted: flight.corrupt.is_some(),
                },
            });
        }
        None
    }

    /// The last two frames that met on the wire since the last call.
    pub fn take_collision(&mut self) -> Option<Collision> {
        self.collision.take()
    }

    /// Frames that did not arrive at a station, each counted once for every station it did not reach.
    pub fn lost(&self) -> u64 {
        self.lost
    }
}

/// Steele, Lea and Flood's generator: small, quick, the same everywhere.
#[derive(Clone, Debug)]
pub struct SplitMix64(u64);

impl SplitMix64 {
    /// The sequence of a seed.
    pub fn new(seed: u64) -> SplitMix64 {
        SplitMix64(seed)
    }

    /// The next number.
    #[expect(clippy::should_implement_trait, reason = "it never ends, and is no iterator")]
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// From 0 to `end`, not included; 0 if `end` is 0.
    pub fn below(&mut self, end: u64) -> u64 {
        self.next() % end.max(1)
    }

    /// From `low` to `high`, evenly.
    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// True in this share of calls; a share of 0 draws nothing.
    pub fn happens(&mut self, share: f64) -> bool {
        share > 0.0 && ((self.next() >> 11) as f64 / (1u64 << 53) as f64) < share
    }
}

#[cfg(test)]
mod tests;
