//! Commands as the server carries them out: requests that come in one frame or in segments, and their answers.
//!
//! In:  commands in order, each once; the objects. Out: the frames of the answer, from the command header on, in order.

use obd::{AbortCode, Objects};

use crate::sdo::command::{self, Address, Command, CommandId, Header, SEGMENT_MAX, Segmentation};
use crate::sdo::multiple::{self, BlockWriter, Blocks, FAILURE_LEN};

/// Where octets of a long value lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    /// In the staging area.
    Staging,
    /// With the object, which takes or gives them in parts.
    Object(Address),
}

/// Which command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Name {
    transaction: u8,
    id: CommandId,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// Nothing under way.
    Idle,
    /// Segments of a request come: `done` of `len` octets. What is to be written stands without its address.
    Receiving {
        name: Name,
        address: Option<Address>,
        place: Place,
        len: usize,
        done: usize,
        /// Of the write in parts.
        ticket: u32,
    },
    /// The answer goes out; `at` counts its segments.
    Answering {
        name: Name,
        place: Place,
        len: usize,
        at: usize,
    },
    /// The command was refused.
    Aborting { name: Name, code: AbortCode },
}

/// Numbers the writes in parts of all connections: a new one makes those before it void.
pub(super) type Tickets = u32;

/// The command of one connection, with a staging area for what is handed to the objects, or comes from them, as a whole.
#[derive(Clone, Debug)]
pub(super) struct Transfer<const STAGING: usize> {
    stage: Stage,
    /// The transaction that was refused last: segments of it may still come.
    refused: Option<u8>,
    staging: [u8; STAGING],
}

impl<const STAGING: usize> Transfer<STAGING> {
    pub(super) fn new() -> Self {
        const { assert!(STAGING >= SEGMENT_MAX) };
        Transfer {
            stage: Stage::Idle,
            refused: None,
            staging: [0; STAGING],
        }
    }

    /// Whether a further frame of the answer is to come.
    pub(super) fn has_answer(&self) -> bool {
        match self.stage {
            Stage::Idle | Stage::Receiving { .. } => false,
            Stage::Answering { .. } | Stage::Aborting { .. } => true,
        }
    }

    /// Breaks off what is under way.
    pub(super) fn cancel(&mut self, objects: &mut impl Objects, tickets: Tickets) {
        if let Stage::Receiving {
            place: Place::Object(Address { index, sub }),
            ticket,
            ..
        } = self.stage
            && ticket == tickets
        {
            objects.sdo_write_cancel(index, sub);
        }
        self.stage = Stage::Idle;
        self.refused = None;
    }

    /// Takes the next command, or the next segment of one.
    pub(super) fn receive_command(&mut self, command: Command<'_>, objects: &mut impl Objects, tickets: &mut Tickets) {
        let name = Name {
            transaction: command.header.transaction,
            id: command.header.id,
        };
        if command.header.abort {
            if self.name() == Some(name) {
                self.cancel(objects, *tickets);
            }
            return;
        }
        let result = match command.header.segmentation {
            Segmentation::Expedited => {
                self.cancel(objects, *tickets);
                self.execute(name, command.data, objects)
            }
            Segmentation::Initiate => {
                self.cancel(objects, *tickets);
                self.initiate(name, command.data, objects, tickets)
            }
            Segmentation::Segment | Segmentation::Complete if self.refused == Some(name.transaction) => return,
            Segmentation::Segment => self.append(name, command.data, objects, *tickets).map(|_| ()),
            Segmentation::Complete => self
                .append(name, command.data, objects, *tickets)
                .and_then(|complete| if complete { Ok(()) } else { Err(AbortCode::BLOCK_SIZE) })
                .and_then(|()| self.complete(objects)),
        };
        if let Err(code) = result {
            self.cancel(objects, *tickets);
            self.refused = Some(name.transaction);
            self.stage = Stage::Aborting { name, code };
        }
    }

    fn name(&self) -> Option<Name> {
        match self.stage {
            Stage::Idle => None,
            Stage::Receiving { name, .. } | Stage::Answering { name, .. } | Stage::Aborting { name, .. } => Some(name),
        }
    }

    fn answer(&mut self, name: Name, place: Place, len: usize) {
        self.stage = Stage::Answering {
            name,
            place,
            len,
            at: 0,
        };
    }

    /// A request in one frame.
    fn execute(&mut self, name: Name, data: &[u8], objects: &mut impl Objects) -> Result<(), AbortCode> {
        match name.id {
            CommandId::WriteByIndex => {
                let (Address { index, sub }, value) = Address::split(data).ok_or(AbortCode::BLOCK_SIZE)?;
                objects.sdo_write(index, sub, value)?;
                self.answer(name, Place::Staging, 0);
            }
            CommandId::ReadByIndex => {
                let (address, _) = Address::split(data).ok_or(AbortCode::BLOCK_SIZE)?;
                let Address { index, sub } = address;
                match objects.sdo_read_parts(index, sub)? {
                    Some(len) => self.answer(name, Place::Object(address), len),
                    None => {
                        let len = objects.sdo_read(index, sub, &mut self.staging)?;
                        if len > STAGING {
                            return Err(AbortCode::INTERNAL_INCOMPATIBLE);
                        }
                        self.answer(name, Place::Staging, len);
                    }
                }
            }
            CommandId::WriteMultipleByIndex | CommandId::ReadMultipleByIndex => {
                self.stage(0, data)?;
                self.execute_multiple(name, data.len(), objects)?;
            }
            CommandId::WriteAllByIndex
            | CommandId::ReadAllByIndex
            | CommandId::WriteByName
            | CommandId::ReadByName
            | CommandId::FileWrite
            | CommandId::FileRead
            | CommandId::MaximumSegmentSize
            | CommandId::LinkNameToIndex
            | CommandId::Other(_) => return Err(AbortCode::UNKNOWN_COMMAND),
        }
        Ok(())
    }

    fn stage(&mut self, at: usize, octets: &[u8]) -> Result<(), AbortCode> {
        let room = self.staging.get_mut(at..).and_then(|rest| rest.get_mut(..octets.len()));
        room.ok_or(AbortCode::OUT_OF_MEMORY)?.copy_from_slice(octets);
        Ok(())
    }

    /// The first segment of a request.
    fn initiate(
        &mut self,
        name: Name,
        data: &[u8],
        objects: &mut impl Objects,
        tickets: &mut Tickets,
    ) -> Result<(), AbortCode> {
        let (len, data) = command::split_initiate(data).ok_or(AbortCode::BLOCK_SIZE)?;
        let (address, len, data) = match name.id {
            CommandId::WriteByIndex => {
                let (address, value) = Address::split(data).ok_or(AbortCode::BLOCK_SIZE)?;
                (Some(address), len - command::ADDRESS_LEN, value)
            }
            CommandId::WriteMultipleByIndex | CommandId::ReadMultipleByIndex => (None, len, data),
            CommandId::ReadByIndex
            | CommandId::WriteAllByIndex
            | CommandId::ReadAllByIndex
            | CommandId::WriteByName
            | CommandId::ReadByName
            | CommandId::FileWrite
            | CommandId::FileRead
            | CommandId::MaximumSegmentSize
            | CommandId::LinkNameToIndex
            | CommandId::Other(_) => return Err(AbortCode::UNKNOWN_COMMAND),
        };
        let mut place = Place::Staging;
        if let Some(address @ Address { index, sub }) = address
            && objects.sdo_write_parts(index, sub, len)?
        {
            *tickets = tickets.wrapping_add(1);
            place = Place::Object(address);
        } else if len > STAGING {
            return Err(AbortCode::OUT_OF_MEMORY);
        }
        self.stage = Stage::Receiving {
            name,
            address,
            place,
            len,
            done: 0,
            ticket: *tickets,
        };
        self.append(name, data, objects, *tickets).map(|_| ())
    }

    /// A segment of a request; returns whether all octets have come.
    fn append(
        &mut self,
        segment: Name,
        data: &[u8],
        objects: &mut impl Objects,
        tickets: Tickets,
    ) -> Result<bool, AbortCode> {
        let Stage::Receiving {
            name,
            place,
            len,
            ref mut done,
            ticket,
            ..
        } = self.stage
        else {
            return Err(AbortCode::UNKNOWN_COMMAND);
        };
        if name != segment {
            return Err(AbortCode::UNKNOWN_COMMAND);
        }
        let at = *done;
        *done += data.len();
        let done = *done;
        if done > len {
            return Err(AbortCode::BLOCK_SIZE);
        }
        match place {
            Place::Staging => self.stage(at, data)?,
            // Another client has begun to write in parts.
            Place::Object(_) if ticket != tickets => return Err(AbortCode::DEVICE_STATE),
            Place::Object(Address { index, sub }) => objects.sdo_write_part(index, sub, at, data)?,
        }
        Ok(done == len)
    }

    /// All segments of a request have come.
    fn complete(&mut self, objects: &mut impl Objects) -> Result<(), AbortCode> {
        let Stage::Receiving {
            name,
            address,
            place,
            len,
            ..
        } = self.stage
        else {
            return Err(AbortCode::UNKNOWN_COMMAND);
        };
        match (place, address) {
            (Place::Object(Address { index, sub }), _) => objects.sdo_write_end(index, sub)?,
            (Place::Staging, Some(Address { index, sub })) => objects.sdo_write(index, sub, &self.staging[..len])?,
            (Place::Staging, None) => return self.execute_multiple(name, len, objects),
        }
        self.answer(name, Place::Staging, 0);
        Ok(())
    }

    /// A request for several objects, at the start of the staging area.
    fn execute_multiple(&mut self, name: Name, len: usize, objects: &mut impl Objects) -> Result<(), AbortCode> {
        let len = if name.id == CommandId::ReadMultipleByIndex {
            self.read_multiple(len, objects)?
        } else {
            self.write_multiple(len, objects)?
        };
        self.answer(name, Place::Staging, len);
        Ok(())
    }

    /// The request moves to the end of the staging area, the answer grows from its start.
    fn read_multiple(&mut self, len: usize, objects: &mut impl Objects) -> Result<usize, AbortCode> {
        if len == 0 || !len.is_multiple_of(command::ADDRESS_LEN) {
            return Err(AbortCode::BLOCK_SIZE);
        }
        self.staging.copy_within(..len, STAGING - len);
        let (answer, request) = self.staging.split_at_mut(STAGING - len);
        let mut blocks = BlockWriter::new(answer);
        for address in request.chunks_exact(command::ADDRESS_LEN).filter_map(Address::split) {
            let (address @ Address { index, sub }, _) = address;
            let read = blocks.push_with(address, |out| objects.sdo_read(index, sub, out));
            if let Err(code) = read
                && !blocks.push_abort(address, code)
            {
                return Err(AbortCode::OUT_OF_MEMORY);
            }
        }
        Ok(blocks.len())
    }

    /// All blocks are looked at before the first is carried out. A refusal is as long as the shortest block, so it never
    /// overwrites one that has not been read.
    fn write_multiple(&mut self, len: usize, objects: &mut impl Objects) -> Result<usize, AbortCode> {
        if len == 0 {
            return Err(AbortCode::BLOCK_SIZE);
        }
        for block in Blocks::new(&self.staging[..len]) {
            block?.value.map_err(|_| AbortCode::BLOCK_SIZE)?;
        }
        let (mut at, mut answer_len) = (Some(0), 0);
        while at.is_some() {
            let mut blocks = Blocks::resume(&self.staging[..len], at);
            let Some(Ok(block)) = blocks.next() else { break };
            at = blocks.position();
            let address = block.address;
            let result = block
                .value
                .and_then(|value| objects.sdo_write(address.index, address.sub, value));
            if let Err(code) = result
                && let Some(out) = self.staging[answer_len..].first_chunk_mut::<FAILURE_LEN>()
            {
                multiple::emit_failure(address, code, out);
                answer_len += FAILURE_LEN;
            }
        }
        Ok(answer_len)
    }

    /// Writes the next frame of the answer from the command header on; returns its length.
    pub(super) fn emit(&mut self, objects: &mut impl Objects, out: &mut [u8]) -> Option<usize> {
        if let Stage::Answering {
            name,
            place,
            len,
            ref mut at,
        } = self.stage
        {
            let (segmentation, range) = command::segment(len, *at);
            *at += 1;
            let (start, size) = (range.start, range.len());
            let mut result = Ok(());
            let written = command::emit_segment(header(name, segmentation), len, size, out, |data| match place {
                Place::Staging => data.copy_from_slice(&self.staging[range]),
                Place::Object(Address { index, sub }) => result = objects.sdo_read_part(index, sub, start, data),
            });
            let Err(code) = result else {
                if matches!(segmentation, Segmentation::Expedited | Segmentation::Complete) {
                    self.stage = Stage::Idle;
                }
                return written;
            };
            self.stage = Stage::Aborting { name, code };
        }
        let Stage::Aborting { name, code } = self.stage else {
            return None;
        };
        self.stage = Stage::Idle;
        let octets = code.0.to_le_bytes();
        let header = Header {
            abort: true,
            ..header(name, Segmentation::Expedited)
        };
        command::emit_segment(header, octets.len(), octets.len(), out, |data| {
            data.copy_from_slice(&octets);
        })
    }
}

fn header(name: Name, segmentation: Segmentation) -> Header {
    Header {
        transaction: name.transaction,
        response: true,
        abort: false,
        segmentation,
        id: name.id,
    }
}
