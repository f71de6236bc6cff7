//! The least that a cycle can be: fixed frames, fixed offsets, nothing checked but what must be, as one would write it in C.
//!
//! It has no states, no boot-up, no asynchronous phase and no errors; it is the floor that the stack is measured against.

use super::network::PAYLOAD;
use powerlink::wire::{Mac, multicast};

/// Octets of every frame here: the shortest that Ethernet knows.
pub(crate) const LEN: usize = 60;
pub(crate) type Short = [u8; LEN];

const MN_MAC: Mac = [2, 0, 0, 0, 0, 0xF0];

fn frame(destination: Mac, source: Mac, epl: &[u8]) -> Short {
    let mut octets = [0; LEN];
    octets[..6].copy_from_slice(&destination);
    octets[6..12].copy_from_slice(&source);
    octets[12..14].copy_from_slice(&[0x88, 0xAB]);
    octets[14..14 + epl.len()].copy_from_slice(epl);
    octets
}

/// The PRes of node `id`: OPERATIONAL, RD, six octets.
pub(crate) fn pres(id: u8) -> Short {
    let epl = [0x04, 255, id, 0xFD, 0x01, 0, 0, 0, PAYLOAD as u8, 0, id, 2, 3, 4, 5, 6];
    frame(multicast::PRES, [2, 0, 0, 0x45, 0x50, id], &epl)
}

/// A managing node of fixed frames.
pub(crate) struct Minimal {
    soc: Short,
    soa: Short,
    preqs: Vec<Short>,
    /// Process data to the nodes and from them.
    pub(crate) outputs: Vec<[u8; PAYLOAD]>,
    pub(crate) inputs: Vec<[u8; PAYLOAD]>,
    relative_us: u64,
    pub(crate) wrong: u64,
}

impl Minimal {
    pub(crate) fn new(nodes: usize) -> Minimal {
        Minimal {
            soc: frame(multicast::SOC, MN_MAC, &[0x01, 255, 240]),
            soa: frame(multicast::SOA, MN_MAC, &[0x05, 255, 240, 0xFD, 0, 0, 0, 0, 0x20]),
            preqs: (1..=nodes as u8)
                .map(|id| {
                    let epl = [0x03, id, 240, 0, 0x01, 0, 0, 0, PAYLOAD as u8, 0];
                    frame([2, 0, 0, 0x45, 0x50, id], MN_MAC, &epl)
                })
                .collect(),
            outputs: vec![[0; PAYLOAD]; nodes],
            inputs: vec![[0; PAYLOAD]; nodes],
            relative_us: 0,
            wrong: 0,
        }
    }

    pub(crate) fn soc(&mut self, now_ns: u64, cycle_us: u64) -> &Short {
        self.relative_us += cycle_us;
        self.soc[20..24].copy_from_slice(&((now_ns / 1_000_000_000) as u32).to_le_bytes());
        self.soc[24..28].copy_from_slice(&((now_ns % 1_000_000_000) as u32).to_le_bytes());
        self.soc[28..36].copy_from_slice(&self.relative_us.to_le_bytes());
        &self.soc
    }

    pub(crate) fn preq(&mut self, node: usize) -> &Short {
        let frame = &mut self.preqs[node];
        frame[24..24 + PAYLOAD].copy_from_slice(&self.outputs[node]);
        frame
    }

    pub(crate) fn pres(&mut self, node: usize, frame: &[u8]) {
        let good = frame.len() >= LEN
            && frame[12..14] == [0x88, 0xAB]
            && frame[14] == 0x04
            && usize::from(frame[16]) == node + 1
            && frame[18] & 1 != 0
            && frame[22..24] == [PAYLOAD as u8, 0];
        if good {
            self.inputs[node].copy_from_slice(&frame[24..24 + PAYLOAD]);
        } else {
            self.wrong += 1;
        }
    }

    pub(crate) fn soa(&self) -> &Short {
        &self.soa
    }
}
