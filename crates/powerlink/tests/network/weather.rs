//! What the world does to a network: faults of the wires, of nodes, of the managing node's machine, and intruders.
//!
//! In:  a kind of weather, a source of chance, the network. Out: the network's wires and intruders changed for one cycle.

use powerlink::link::simulated::{Path, SplitMix64};
use powerlink::mn::ForeignSign;
use powerlink::nmt::NmtState;
use powerlink::wire::{
    FRAME_LEN_MAX, Frame, Header, Mac, NetTime, RequestedService, Soa, Soc, message, multicast, node,
};

use super::world::World;

/// MAC of the second managing node.
pub const FOREIGN_MAC: Mac = [2, 0, 0, 0, 0, 0xEE];
/// How it is told.
pub const FOREIGN: ForeignSign = ForeignSign {
    id: node::MN,
    mac: FOREIGN_MAC,
};
/// Octets in which wires turn bits over: all that says what a frame is and whom it is for, with the sequence layer of SDO. What
/// lies behind (process data, values of objects) nobody could tell from right data: in the field the FCS guards it.
const CORRUPT_OCTETS: core::ops::Range<usize> = 0..24;

/// Kinds of trouble.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weather {
    Loss,
    Bursts,
    Duplicates,
    Reordering,
    Corruption,
    /// A node is switched off and on.
    Death,
    /// Somebody sends random octets.
    Babble,
    /// Another managing node sends its own cycle.
    SecondMn,
    /// The managing node's thread does not get its time.
    Late,
    /// All faults of wires at once, and late cycles.
    Everything,
}

impl Weather {
    pub const ALL: [Weather; 10] = [
        Weather::Loss,
        Weather::Bursts,
        Weather::Duplicates,
        Weather::Reordering,
        Weather::Corruption,
        Weather::Death,
        Weather::Babble,
        Weather::SecondMn,
        Weather::Late,
        Weather::Everything,
    ];

    /// Begins: wires get their faults.
    pub fn begin(self, world: &mut World, random: &mut SplitMix64) {
        let share = random.below(50) as f64 / 1000.0 + 0.001;
        match self {
            Weather::Loss => world.set_paths(|path| path.loss = share),
            Weather::Duplicates => world.set_paths(|path| path.duplicate = share),
            Weather::Reordering => world.set_paths(|path| path.reorder = share),
            Weather::Corruption => world.set_paths(|path| {
                path.corrupt = share / 4.0;
                path.corrupt_octets = CORRUPT_OCTETS;
            }),
            Weather::Everything => world.set_paths(|path| {
                path.loss = share / 4.0;
                path.duplicate = share / 4.0;
                path.reorder = share / 4.0;
                path.corrupt = share / 16.0;
                path.corrupt_octets = CORRUPT_OCTETS;
            }),
            Weather::Bursts | Weather::Death | Weather::Babble | Weather::SecondMn | Weather::Late => {}
        }
    }

    /// What happens in the coming cycle.
    pub fn cycle(self, world: &mut World, random: &mut SplitMix64) {
        match self {
            Weather::Loss | Weather::Duplicates | Weather::Reordering | Weather::Corruption => {}
            Weather::Bursts => {
                // Nothing gets through to one station for 1 to 6 cycles, then all is well for up to 50.
                let quiet = random.below(50) > 0;
                let station = random.below(world.devices.len() as u64 + 1) as usize;
                let all_lost = |path: &mut Path| path.loss = if quiet { 0.0 } else { 1.0 };
                if !quiet {
                    let station = world
                        .devices
                        .get(station)
                        .map_or(world.mn_station, |device| device.station);
                    all_lost(world.hub.path_mut(station));
                } else if random.below(4) == 0 {
                    world.set_paths(all_lost);
                }
            }
            Weather::Death => {
                let index = random.below(world.devices.len() as u64) as usize;
                let off = world.devices[index].node.is_none();
                if random.below(if off { 40 } else { 300 }) == 0 {
                    world.power(index, off);
                }
            }
            Weather::Babble => {
                let mut at_ns = world.now_ns;
                for _ in 0..random.below(5) {
                    at_ns += random.below(world.cycle_ns / 4);
                    let frame = babble(world, random);
                    world.intrusions.push_back((at_ns, frame));
                }
            }
            Weather::SecondMn => second_mn(world, random),
            Weather::Late => late(world, random, 5),
            Weather::Everything => late(world, random, 50),
        }
    }

    /// Ends: everything is as it was.
    pub fn end(world: &mut World) {
        world.set_paths(|path| {
            *path = Path {
                delay_ns: path.delay_ns,
                jitter_ns: path.jitter_ns,
                ..Path::default()
            }
        });
        world.intrusions.clear();
        world.nap = None;
        for index in 0..world.devices.len() {
            if world.devices[index].node.is_none() {
                world.power(index, true);
            }
        }
    }
}

/// One cycle in so many is disturbed: mostly a little, sometimes for several cycles.
fn late(world: &mut World, random: &mut SplitMix64, one_in: u64) {
    if random.below(one_in) == 0 {
        let longest_ns = [100_000, 300_000, world.cycle_ns, 4 * world.cycle_ns][random.below(4) as usize];
        world.nap = Some((random.below(20) as u32, random.below(longest_ns)));
    }
}

/// Random octets; half of them look like POWERLINK of somebody who is there.
pub fn babble(world: &World, random: &mut SplitMix64) -> Vec<u8> {
    let longest = if random.below(10) == 0 { FRAME_LEN_MAX } else { 200 };
    let mut frame: Vec<u8> = (0..14 + random.below(longest as u64 - 13))
        .map(|_| random.next() as u8)
        .collect();
    if random.below(2) == 0 {
        frame[6..12].copy_from_slice(&FOREIGN_MAC);
        frame[12..14].copy_from_slice(&[0x88, 0xAB]);
        let types = [
            message::SOC,
            message::PREQ,
            message::PRES,
            message::SOA,
            message::ASND,
            message::AMNI,
            message::AINV,
        ];
        let pick = |random: &mut SplitMix64| {
            let index = random.below(world.devices.len() as u64 + 1) as usize;
            world.devices.get(index).map_or(node::MN, |device| device.id)
        };
        let head = [types[random.below(7) as usize], pick(random), pick(random)];
        for (octet, value) in frame[14..].iter_mut().zip(head) {
            *octet = value;
        }
    }
    frame
}

/// The frames of another managing node in this cycle: SoC, and a SoA that asks one of our nodes for something at times.
pub fn second_mn(world: &mut World, random: &mut SplitMix64) {
    let mut buffer = [0; FRAME_LEN_MAX];
    let soc = Frame::Soc(Soc {
        multiplexed_cycle: false,
        prescaled_slot: false,
        net_time: NetTime::default(),
        relative_time_us: 0,
    });
    let index = random.below(world.devices.len() as u64) as usize;
    let (service, target) = match random.below(10) {
        0 => (RequestedService::IdentRequest, world.devices[index].id),
        1 => (RequestedService::StatusRequest, world.devices[index].id),
        _ => (RequestedService::NoService, 0),
    };
    let soa = Frame::Soa(Soa::new(NmtState::PreOperational2, service, target));
    let offset_ns = world.cycle_ns * 3 / 7;
    for (at_ns, destination, frame) in [(offset_ns, multicast::SOC, soc), (offset_ns * 2, multicast::SOA, soa)] {
        let header = Header::multicast(destination, FOREIGN_MAC, node::MN);
        let length = frame.emit(&header, &mut buffer).unwrap();
        world
            .intrusions
            .push_back((world.now_ns + at_ns, buffer[..length].to_vec()));
    }
}
