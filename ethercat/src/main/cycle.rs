//! The frame of a cycle: the time of the reference clock, the states of all devices, and the process data of each drive.
//!
//! In:  outputs, before the date; what came back. Out: one frame that is ready to be sent; inputs, and for each member whether
//! they are those of this cycle.
//! RT: no allocation, no locks, bounded.
//!
//! Each member has a datagram LRW of its own, so that its working counter says what it alone has done. Inputs and outputs of a member
//! lie at the same logical address, which makes the frame shorter.

use crate::wire::register::{self, AlState};
use crate::wire::{BROADCAST, Command, FRAME_LEN_MAX, Frame, FrameWriter, HEADER_LEN, Mac, WireError, answers};

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

    const fn octets(&self) -> usize {
        if self.outputs > self.inputs {
            self.outputs as usize
        } else {
            self.inputs as usize
        }
    }
}

/// How a member has answered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Answered {
    /// Its inputs are those of this cycle.
    pub fresh: bool,
    /// Cycles in a row without such; 0 where this cycle's came.
    pub lost_in_row: u32,
    /// Its last working counter: 0 gone, 1 it was read only, 2 written only, 3 both.
    pub working_counter: u16,
}

/// What a frame was that came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Came {
    /// The answer of this cycle.
    Answer,
    /// The answer of a cycle before, or a second one: nothing was taken from it.
    Late,
    /// None of the cyclic frames.
    Other,
}

/// The frame of a cycle with up to `N` members, its inputs, and what is known of them.
#[derive(Clone, Debug)]
pub struct CyclicFrame<const N: usize> {
    mac: Mac,
    /// As it is sent.
    frame: [u8; FRAME_LEN_MAX],
    length: usize,
    /// Inputs, at the places that they have in the frame.
    inputs: [u8; FRAME_LEN_MAX],
    members: [(Member, usize); N],
    used: usize,
    answered: [Answered; N],
    index: u8,
    awaited: bool,
    time_at: Option<usize>,
    bus_ns: Option<u64>,
    present: u16,
    states: u8,
}

impl<const N: usize> CyclicFrame<N> {
    /// A frame for these members. `reference`: station address of the device whose clock leads; without one there is no FRMW.
    ///
    /// # Errors
    /// [`WireError::NoRoom`] where they do not fit into one frame or are more than `N`.
    pub fn new(mac: Mac, reference: Option<u16>, members: &[Member]) -> Result<CyclicFrame<N>, WireError> {
        if members.len() > N {
            let (need, got) = (members.len(), N);
            return Err(WireError::NoRoom { need, got });
        }
        let mut frame = [0; FRAME_LEN_MAX];
        let mut placed = [(Member::default(), 0); N];
        let mut writer = FrameWriter::new(&mut frame, BROADCAST, mac)?;
        let time_at = match reference {
            Some(station) => {
                let address = register::station(station, register::DC_SYSTEM_TIME);
                Some(writer.push(Command::Frmw, 0, address, 8)?)
            }
            None => None,
        };
        writer.push(Command::Brd, 0, register::station(0, register::AL_STATUS), 2)?;
        for (member, place) in members.iter().zip(&mut placed) {
            let at = writer.push(Command::Lrw, 0, member.logical, member.octets())?;
            *place = (*member, at);
        }
        let length = writer.finish();
        Ok(CyclicFrame {
            mac,
            frame,
            length,
            inputs: [0; FRAME_LEN_MAX],
            members: placed,
            used: members.len(),
            answered: [Answered::default(); N],
            index: 0,
            awaited: false,
            time_at,
            bus_ns: None,
            present: 0,
            states: 0,
        })
    }

    /// Outputs of a member, to be written before the cycle is made ready.
    pub fn outputs_mut(&mut self, member: usize) -> &mut [u8] {
        let (of, at) = self.members[member];
        &mut self.frame[at..at + usize::from(of.outputs)]
    }

    /// Inputs of a member: the last that came.
    pub fn inputs(&self, member: usize) -> &[u8] {
        let (of, at) = self.members[member];
        &self.inputs[at..at + usize::from(of.inputs)]
    }

    /// How a member has answered.
    pub fn answered(&self, member: usize) -> Answered {
        self.answered[member]
    }

    /// Time of the reference clock as the last frame passed it, ns; `None`: that did not come, or nobody leads.
    pub fn bus_ns(&self) -> Option<u64> {
        self.bus_ns
    }

    /// How many devices the last frame has passed.
    pub fn present(&self) -> u16 {
        self.present
    }

    /// State of all devices: that of each where all are in the same one, else a sum of several; and whether one shows an error.
    pub fn states(&self) -> (AlState, bool) {
        (AlState::from(self.states), self.states & 0x10 != 0)
    }

    /// The next cycle: the frame to be sent at its date. Sent once, whatever comes.
    pub fn make_ready(&mut self) -> &[u8] {
        self.index = self.index.wrapping_add(1);
        self.awaited = true;
        self.bus_ns = None;
        for answered in &mut self.answered[..self.used] {
            answered.fresh = false;
        }
        let mut at = HEADER_LEN;
        for _ in 0..self.used + 1 + usize::from(self.time_at.is_some()) {
            self.frame[at + 1] = self.index;
            let length = u16::from_le_bytes([self.frame[at + 6], self.frame[at + 7]]) & 0x07FF;
            at += crate::wire::DATAGRAM_OVERHEAD + usize::from(length);
        }
        &self.frame[..self.length]
    }

    /// A frame came. Any octets: what is not the answer of this cycle changes nothing.
    pub fn receive(&mut self, octets: &[u8]) -> Came {
        let Ok(frame) = Frame::parse(octets) else {
            return Came::Other;
        };
        let Ok(sent) = Frame::parse(&self.frame[..self.length]) else {
            return Came::Other;
        };
        if !answers(frame.source, self.mac) {
            return Came::Other;
        }
        // The same datagrams as were sent; their positions are changed by those who read them.
        let mut pairs = frame.datagrams().zip(sent.datagrams());
        let same = pairs.all(|(came, sent)| {
            let is_at = came.ado() == sent.ado() && (came.command == Command::Brd || came.adp() == sent.adp());
            came.command == sent.command && came.data.len() == sent.data.len() && is_at
        });
        if !same || frame.datagrams().count() != sent.datagrams().count() {
            return Came::Other;
        }
        if !self.awaited || frame.datagrams().any(|datagram| datagram.index != self.index) {
            return Came::Late;
        }
        self.awaited = false;
        let mut datagrams = frame.datagrams();
        if self.time_at.is_some()
            && let Some(time) = datagrams.next()
        {
            let octets = time.data.first_chunk().copied().unwrap_or_default();
            self.bus_ns = (time.working_counter > 0).then(|| u64::from_le_bytes(octets));
        }
        if let Some(states) = datagrams.next() {
            self.present = states.working_counter;
            self.states = states.data.first().copied().unwrap_or(0);
        }
        let members = self.members[..self.used].iter().zip(&mut self.answered);
        for (datagram, ((member, at), answered)) in datagrams.zip(members) {
            answered.working_counter = datagram.working_counter;
            if datagram.working_counter == member.expected {
                self.inputs[*at..*at + datagram.data.len()].copy_from_slice(datagram.data);
                answered.fresh = true;
                answered.lost_in_row = 0;
            }
        }
        Came::Answer
    }

    /// The time of the cycle is over: who has not answered is counted; how many they are.
    pub fn finish(&mut self) -> u32 {
        let came = !self.awaited;
        self.awaited = false;
        let mut lost = 0;
        for answered in self.answered[..self.used].iter_mut().filter(|answered| !answered.fresh) {
            answered.lost_in_row = answered.lost_in_row.saturating_add(1);
            if !came {
                answered.working_counter = 0;
            }
            lost += 1;
        }
        lost
    }
}
