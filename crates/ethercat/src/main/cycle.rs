//! The frames of a cycle: the time of the reference clock, the states of all devices, and the process data of each member.
//!
//! In:  outputs, before the date; what came back. Out: frames that are ready to be sent; inputs, and for each member whether
//! they are those of this cycle.
//! RT: no allocation, no locks, bounded.
//!
//! Each member has a datagram LRW of its own, so that its working counter says what it alone has done. Inputs and outputs of a member
//! lie at the same logical address, which makes the frame shorter.

use crate::wire::register::{self, AlState};
use crate::wire::{
    BROADCAST, Command, DATA_MAX, DATAGRAM_HEADER_LEN, DATAGRAM_OVERHEAD, ETHER_TYPE, FRAME_LEN_MAX, FrameWriter,
    HEADER_LEN, Mac, WireError, answers,
};

/// A device or a group of devices that has a datagram of its own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Member {
    /// Where its process data begin in the logical image.
    pub logical: u32,
    /// Octets to it.
    pub outputs: u16,
    /// Octets from it.
    pub inputs: u16,
    /// What the working counter comes to where all is well; [`Member::one`]: that of one device.
    pub expected: u16,
}

impl Member {
    /// One device: 1 for inputs, 2 for outputs.
    pub const fn one(logical: u32, outputs: u16, inputs: u16) -> Member {
        Member {
            logical,
            outputs,
            inputs,
            expected: (inputs > 0) as u16 + 2 * (outputs > 0) as u16,
        }
    }

    /// Octets that it takes in a frame.
    pub const fn octets(&self) -> usize {
        if self.outputs > self.inputs {
            self.outputs as usize
        } else {
            self.inputs as usize
        }
    }

    /// A counter that says that inputs were read: of one device that of any read, of a group only that of all.
    const fn has_inputs(&self, counter: u16) -> bool {
        counter == self.expected || self.expected == 3 && counter == 1
    }
}

/// How a member has answered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Answered {
    /// It has read its outputs and written its inputs in this cycle.
    pub fresh: bool,
    /// Cycles in a row without such; 0 where this cycle's came.
    pub lost_in_row: u32,
    /// Its last working counter: 0 gone, 1 inputs only, 2 outputs only, 3 both.
    pub working_counter: u16,
}

/// What a frame was that came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Came {
    /// The answer to a frame of this cycle.
    Answer,
    /// The answer to one of a cycle before, or a second one: nothing was taken from it.
    Late,
    /// None of the cyclic frames.
    Other,
}

/// A member and its place: frame, first octet of its data.
#[derive(Clone, Copy, Debug, Default)]
struct Placed {
    member: Member,
    frame: usize,
    at: usize,
}

/// One of the frames.
#[derive(Clone, Copy, Debug)]
struct Slot {
    /// As it is sent.
    octets: [u8; FRAME_LEN_MAX],
    /// Inputs, at the places that they have in the frame.
    inputs: [u8; FRAME_LEN_MAX],
    length: usize,
    /// Members from the first to the one behind the last.
    members: (usize, usize),
    awaited: bool,
}

/// Datagram of the time in the first frame: its data, their length.
const TIME_AT: usize = HEADER_LEN + DATAGRAM_HEADER_LEN;
const TIME_LEN: usize = 8;
/// That of the states behind it.
const STATES_AT: usize = TIME_AT + TIME_LEN + DATAGRAM_OVERHEAD;
const STATES_LEN: usize = 2;
/// In the first eight octets of a datagram as a number: the index, which is compared by itself; the bit of frames that turn,
/// and the position, which devices change.
const INDEX: u64 = 0xFF00;
const CIRCULATING: u64 = 1 << 62;
const POSITION: u64 = 0xFFFF_0000;
/// Cyclic frames have indices below; those of other services the upper half.
pub(super) const INDEX_END: u8 = 0x80;

/// The frames of a cycle with up to `N` members in up to `F` frames, their inputs, and what is known of them.
#[derive(Clone, Debug)]
pub struct CyclicFrames<const N: usize, const F: usize> {
    mac: Mac,
    slots: [Slot; F],
    frames: usize,
    members: [Placed; N],
    used: usize,
    answered: [Answered; N],
    index: u8,
    has_reference: bool,
    bus_ns: Option<u64>,
    present: u16,
    states: u8,
}

impl<const N: usize, const F: usize> CyclicFrames<N, F> {
    /// Frames for these members. Nobody leads until [`CyclicFrames::set_reference`].
    ///
    /// # Errors
    /// [`WireError::NoRoom`] where one does not fit into a frame, where they need more than `F` frames, or are more than `N`.
    pub fn new(mac: Mac, members: impl IntoIterator<Item = Member>) -> Result<CyclicFrames<N, F>, WireError> {
        let slot = Slot {
            octets: [0; FRAME_LEN_MAX],
            inputs: [0; FRAME_LEN_MAX],
            length: 0,
            members: (0, 0),
            awaited: false,
        };
        let mut frames = CyclicFrames {
            mac,
            slots: [slot; F],
            frames: 0,
            members: [Placed::default(); N],
            used: 0,
            answered: [Answered::default(); N],
            index: 0,
            has_reference: false,
            bus_ns: None,
            present: 0,
            states: 0,
        };
        let mut members = members.into_iter().peekable();
        loop {
            let got = F;
            let number = frames.frames;
            let Some(slot) = frames.slots.get_mut(number) else {
                return Err(WireError::NoRoom { need: number + 1, got });
            };
            slot.members = (frames.used, frames.used);
            let mut writer = FrameWriter::new(&mut slot.octets, BROADCAST, mac)?;
            if number == 0 {
                writer.push(Command::Nop, 0, 0, TIME_LEN)?;
                writer.push(Command::Brd, 0, register::station(0, register::AL_STATUS), STATES_LEN)?;
            }
            while let Some(member) = members.peek() {
                let need = member.octets();
                if need > writer.room() {
                    if need > DATA_MAX {
                        return Err(WireError::NoRoom { need, got: DATA_MAX });
                    }
                    break;
                }
                let at = writer.push(Command::Lrw, 0, member.logical, need)?;
                let Some(place) = frames.members.get_mut(frames.used) else {
                    let need = frames.used + 1;
                    return Err(WireError::NoRoom { need, got: N });
                };
                *place = Placed {
                    member: *member,
                    frame: number,
                    at,
                };
                frames.used += 1;
                members.next();
            }
            slot.length = writer.finish();
            slot.members.1 = frames.used;
            frames.frames += 1;
            if members.peek().is_none() {
                return Ok(frames);
            }
        }
    }

    /// The device whose clock leads gets this station address: the time goes from it to all others. `None`: there is none.
    pub fn set_reference(&mut self, reference: Option<u16>) {
        let (command, address) = match reference {
            Some(station) => (Command::Frmw, register::station(station, register::DC_SYSTEM_TIME)),
            None => (Command::Nop, 0),
        };
        let start = TIME_AT - DATAGRAM_HEADER_LEN;
        let octets = &mut self.slots[0].octets;
        octets[start] = command.into();
        octets[start + 2..start + 6].copy_from_slice(&address.to_le_bytes());
        self.has_reference = reference.is_some();
    }

    /// How many frames a cycle has.
    pub fn len(&self) -> usize {
        self.frames
    }

    /// It has none: never.
    pub fn is_empty(&self) -> bool {
        self.frames == 0
    }

    /// Octets of the frames of a cycle, without FCS.
    pub fn octets(&self) -> usize {
        self.slots[..self.frames].iter().map(|slot| slot.length).sum()
    }

    /// Outputs of a member, to be written before the cycle is made ready.
    pub fn outputs_mut(&mut self, member: usize) -> &mut [u8] {
        let Placed { member, frame, at } = self.members[member];
        &mut self.slots[frame].octets[at..at + usize::from(member.outputs)]
    }

    /// Inputs of a member: the last that came.
    pub fn inputs(&self, member: usize) -> &[u8] {
        let Placed { member, frame, at } = self.members[member];
        &self.slots[frame].inputs[at..at + usize::from(member.inputs)]
    }

    /// How a member has answered.
    pub fn answered(&self, member: usize) -> Answered {
        self.answered[member]
    }

    /// Time of the reference clock as the last frame passed it, ns; `None`: that did not come, or nobody leads.
    pub fn bus_ns(&self) -> Option<u64> {
        self.bus_ns
    }

    /// How many devices the last first frame has passed.
    pub fn present(&self) -> u16 {
        self.present
    }

    /// State of all devices: that of each where all are in the same one, else a sum of several; and whether one shows an error.
    pub fn states(&self) -> (AlState, bool) {
        (AlState::from(self.states), self.states & 0x10 != 0)
    }

    /// The next cycle: its frames get ready to be sent at their date. Each is sent once, whatever comes. `bus_ns`: time of the bus
    /// then, by which clocks go that lie before the reference.
    pub fn make_ready(&mut self, bus_ns: u64) {
        self.index = (self.index + 1) % INDEX_END;
        self.bus_ns = None;
        for answered in &mut self.answered[..self.used] {
            answered.fresh = false;
        }
        for slot in &mut self.slots[..self.frames] {
            slot.awaited = true;
        }
        let first = &mut self.slots[0].octets;
        first[TIME_AT..TIME_AT + TIME_LEN].copy_from_slice(&bus_ns.to_le_bytes());
        for at in [TIME_AT, STATES_AT] {
            first[at - DATAGRAM_HEADER_LEN + 1] = self.index;
        }
        for placed in &self.members[..self.used] {
            let octets = &mut self.slots[placed.frame].octets;
            octets[placed.at - DATAGRAM_HEADER_LEN + 1] = self.index;
            // What lies behind the outputs is free for longer inputs.
            let outputs = usize::from(placed.member.outputs);
            octets[placed.at + outputs..placed.at + placed.member.octets()].fill(0);
        }
    }

    /// A frame of this cycle, as it is sent.
    pub fn frame(&self, number: usize) -> &[u8] {
        let slot = &self.slots[number];
        &slot.octets[..slot.length]
    }

    /// A frame came. Any octets: what is not the answer to a frame of this cycle changes nothing.
    pub fn receive(&mut self, octets: &[u8]) -> Came {
        let Some(header) = octets.first_chunk::<HEADER_LEN>() else {
            return Came::Other;
        };
        let source = [header[6], header[7], header[8], header[9], header[10], header[11]];
        if header[12..14] != ETHER_TYPE.to_be_bytes() || !answers(source, self.mac) {
            return Came::Other;
        }
        for number in 0..self.frames {
            match self.compare(number, octets) {
                None => {}
                Some(false) => return Came::Late,
                Some(true) if !self.slots[number].awaited => return Came::Late,
                Some(true) => {
                    self.take(number, octets);
                    return Came::Answer;
                }
            }
        }
        Came::Other
    }

    /// Whether these octets are the answer to a frame, by the same datagrams; `Some(false)`: to that of another cycle.
    fn compare(&self, number: usize, octets: &[u8]) -> Option<bool> {
        let slot = &self.slots[number];
        if octets.len() < slot.length || octets[14..16] != slot.octets[14..16] {
            return None;
        }
        let mut is_of_cycle = true;
        let mut is_same = |at: usize, changed: u64| {
            let start = at - DATAGRAM_HEADER_LEN;
            let head = |frame: &[u8]| {
                frame[start..]
                    .first_chunk()
                    .map_or(0, |octets| u64::from_le_bytes(*octets))
            };
            let difference = head(octets) ^ head(&slot.octets);
            is_of_cycle &= difference & INDEX == 0;
            difference & !(INDEX | CIRCULATING | changed) == 0
        };
        let heads = number > 0 || is_same(TIME_AT, 0) && is_same(STATES_AT, POSITION);
        let mut members = self.members[slot.members.0..slot.members.1].iter();
        (heads && members.all(|placed| is_same(placed.at, 0))).then_some(is_of_cycle)
    }

    fn take(&mut self, number: usize, octets: &[u8]) {
        let counter = |at: usize| u16::from_le_bytes([octets[at], octets[at + 1]]);
        if number == 0 {
            let time = octets[TIME_AT..].first_chunk().map(|time| u64::from_le_bytes(*time));
            self.bus_ns = time.filter(|_| self.has_reference && counter(TIME_AT + TIME_LEN) > 0);
            self.present = counter(STATES_AT + STATES_LEN);
            self.states = octets[STATES_AT];
        }
        let slot = &mut self.slots[number];
        slot.awaited = false;
        let (first, end) = slot.members;
        for (Placed { member, at, .. }, answered) in self.members[first..end].iter().zip(&mut self.answered[first..end])
        {
            let working_counter = counter(at + member.octets());
            answered.working_counter = working_counter;
            if member.has_inputs(working_counter) {
                let place = *at..at + usize::from(member.inputs);
                slot.inputs[place.clone()].copy_from_slice(&octets[place]);
            }
            if working_counter == member.expected {
                answered.fresh = true;
                answered.lost_in_row = 0;
            }
        }
    }

    /// The time of the cycle is over: who has not answered is counted; how many they are.
    pub fn finish(&mut self) -> u32 {
        let mut lost = 0;
        for slot in &mut self.slots[..self.frames] {
            let (first, end) = slot.members;
            for answered in self.answered[first..end].iter_mut().filter(|answered| !answered.fresh) {
                answered.lost_in_row = answered.lost_in_row.saturating_add(1);
                if slot.awaited {
                    answered.working_counter = 0;
                }
                lost += 1;
            }
            slot.awaited = false;
        }
        lost
    }

    /// Whether all frames of this cycle have come back.
    pub fn is_whole(&self) -> bool {
        !self.slots[..self.frames].iter().any(|slot| slot.awaited)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inputs_came_where_the_counter_can_mean_a_read() {
        let both = Member::one(0, 4, 4);
        let came: std::vec::Vec<u16> = (0..8).filter(|counter| both.has_inputs(*counter)).collect();
        assert_eq!(came, [1, 3]);
        let only_inputs = Member::one(0, 0, 4);
        let came: std::vec::Vec<u16> = (0..8).filter(|counter| only_inputs.has_inputs(*counter)).collect();
        assert_eq!(came, [1]);
    }
}
