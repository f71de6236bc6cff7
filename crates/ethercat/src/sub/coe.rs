//! SDO server of a simulated device: takes mails of CoE and makes answers.

use super::objects::ObjectStore;
use crate::wire::coe::{
    Bytes4, InfoRequest, InfoResponse, ListKind, Message, Object, SdoRequest, SdoResponse, Segment, abort, segment_room,
};
use crate::wire::coe::{HEADER_LEN, SDO_LEN};
use crate::wire::mailbox;
use obd::{AbortCode, Access, DataType, PdoAccess};
use std::vec;
use std::vec::Vec;

/// Octets that a write may have in all; more is refused before it comes.
const VALUE_MAX: usize = 64 * 1024;

/// What the device can do beyond plain SDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Abilities {
    /// Complete access.
    pub complete_access: bool,
    /// SDO information.
    pub information: bool,
    /// A value that fits into one mail comes in one; else always in segments.
    pub one_mail: bool,
    /// A refusal comes as an SDO response, else as a request, as those of most devices do.
    pub abort_is_response: bool,
}

impl Default for Abilities {
    fn default() -> Abilities {
        Abilities {
            complete_access: true,
            information: true,
            one_mail: true,
            abort_is_response: false,
        }
    }
}

#[derive(Clone, Debug)]
enum Transfer {
    None,
    Upload {
        object: Object,
        value: Vec<u8>,
        sent: usize,
        toggle: bool,
    },
    Download {
        object: Object,
        value: Vec<u8>,
        total: usize,
        toggle: bool,
    },
}

/// The server.
#[derive(Clone, Debug)]
pub(super) struct Server {
    pub(super) abilities: Abilities,
    transfer: Transfer,
}

/// Answers that wait for the mailbox.
pub(super) type Mails = Vec<Vec<u8>>;

impl Server {
    pub(super) fn new(abilities: Abilities) -> Server {
        Server {
            abilities,
            transfer: Transfer::None,
        }
    }

    /// The connection begins anew.
    pub(super) fn reset(&mut self) {
        self.transfer = Transfer::None;
    }

    /// Takes the data of a mail; `room` is the length of the mailbox of the answers, `counter` their next counter.
    pub(super) fn receive(
        &mut self,
        message: Message<'_>,
        objects: &mut ObjectStore,
        in_pre_op: bool,
        room: usize,
    ) -> Mails {
        match message {
            Message::Request(request) => {
                let mut mail = vec![0; room];
                let answer = self.sdo(request, objects, in_pre_op, room, &mut mail);
                if answer { vec![mail] } else { Vec::new() }
            }
            Message::InfoRequest(request) => self.information(request, objects, room),
            // Emergencies and answers come from devices.
            Message::Emergency(_) | Message::Response(_) | Message::InfoResponse(_) => Vec::new(),
        }
    }

    /// Whether there is an answer, in `mail`.
    fn sdo(
        &mut self,
        request: SdoRequest<'_>,
        objects: &mut ObjectStore,
        in_pre_op: bool,
        room: usize,
        mail: &mut [u8],
    ) -> bool {
        let (object, result) = match request {
            SdoRequest::Abort { .. } => {
                self.transfer = Transfer::None;
                return false;
            }
            SdoRequest::Upload(object) => (object, self.upload(object, objects, room, mail)),
            SdoRequest::UploadSegment { toggle } => self.upload_segment(toggle, room, mail),
            SdoRequest::DownloadExpedited { object, value } => {
                self.transfer = Transfer::None;
                let written = self.store(object, value.octets(), objects, in_pre_op);
                (object, written.map(|()| emit(SdoResponse::DownloadDone(object), mail)))
            }
            SdoRequest::Download { object, total, data } => {
                (object, self.download(object, total, data, (objects, in_pre_op), mail))
            }
            SdoRequest::DownloadSegment(segment) => self.download_segment(segment, objects, in_pre_op, mail),
        };
        if let Err(code) = result {
            self.transfer = Transfer::None;
            self.refuse(object, code, mail);
        }
        true
    }

    fn refuse(&self, object: Object, code: AbortCode, mail: &mut [u8]) {
        if self.abilities.abort_is_response {
            emit(SdoResponse::Abort { object, code }, mail);
        } else {
            // The counter is put in when the mail leaves.
            let _ = Message::Request(SdoRequest::Abort { object, code }).emit(0, mail);
        }
    }

    /// The value of an object, or of all its sub-indices.
    fn load(&self, object: Object, objects: &ObjectStore) -> Result<Vec<u8>, AbortCode> {
        if !object.complete {
            return objects.read(object.index, object.sub).map(<[u8]>::to_vec);
        }
        self.check_complete(object)?;
        let last = self.last_sub(object, objects)?;
        let mut value = Vec::new();
        for sub in object.sub..=last {
            match objects.read(object.index, sub) {
                Ok(octets) => value.extend_from_slice(octets),
                // Holes are left out, as some devices do.
                Err(AbortCode::NO_SUB_INDEX) => {}
                Err(code) => return Err(code),
            }
            if sub == 0 {
                value.resize(2, 0);
            }
        }
        Ok(value)
    }

    /// The last sub-index that holds a value: by sub-index 0 where that counts the entries, else by the definition.
    fn last_sub(&self, object: Object, objects: &ObjectStore) -> Result<u8, AbortCode> {
        let sub_max = objects.describe(object.index, 0)?.sub_max;
        match objects.read(object.index, 0)? {
            [count] => Ok((*count).min(sub_max)),
            _ => Ok(sub_max),
        }
    }

    fn check_complete(&self, object: Object) -> Result<(), AbortCode> {
        if !self.abilities.complete_access {
            return Err(abort::NO_COMPLETE_ACCESS);
        }
        if object.sub > 1 {
            Err(AbortCode::UNSUPPORTED_ACCESS)
        } else {
            Ok(())
        }
    }

    fn store(&self, object: Object, value: &[u8], objects: &mut ObjectStore, in_pre_op: bool) -> Result<(), AbortCode> {
        if !object.complete {
            return objects.write(object.index, object.sub, value, in_pre_op);
        }
        self.check_complete(object)?;
        // Number of entries to 0, the entries, their number: as by single writes, on a copy until all is well.
        let mut copy = objects.clone();
        let mut rest = value;
        let mut count = None;
        if object.sub == 0 {
            let (number, entries) = rest.split_first_chunk::<2>().ok_or(AbortCode::TOO_SHORT)?;
            count = Some(number[0]);
            rest = entries;
            copy.write(object.index, 0, &[0], in_pre_op)?;
        }
        let mut sub = 1;
        while !rest.is_empty() {
            let size = copy.describe(object.index, sub)?.octets;
            let (entry, others) = rest.split_at_checked(size).ok_or(AbortCode::TOO_SHORT)?;
            copy.write(object.index, sub, entry, in_pre_op)?;
            rest = others;
            sub += 1;
        }
        if let Some(count) = count {
            copy.write(object.index, 0, &[count], in_pre_op)?;
        }
        *objects = copy;
        Ok(())
    }

    fn upload(&mut self, object: Object, objects: &ObjectStore, room: usize, mail: &mut [u8]) -> Result<(), AbortCode> {
        self.transfer = Transfer::None;
        let value = self.load(object, objects)?;
        let in_mail = room.saturating_sub(mailbox::HEADER_LEN + HEADER_LEN + SDO_LEN);
        if let Some(value) = Bytes4::new(&value).filter(|_| !object.complete) {
            emit(SdoResponse::UploadExpedited { object, value }, mail);
            return Ok(());
        }
        let total = value.len() as u32;
        let first = if value.len() <= in_mail && !self.abilities.one_mail {
            0
        } else {
            value.len().min(in_mail)
        };
        emit(
            SdoResponse::Upload {
                object,
                total,
                data: &value[..first],
            },
            mail,
        );
        if first < value.len() {
            self.transfer = Transfer::Upload {
                object,
                value,
                sent: first,
                toggle: false,
            };
        }
        Ok(())
    }

    fn upload_segment(&mut self, toggle: bool, room: usize, mail: &mut [u8]) -> (Object, Result<(), AbortCode>) {
        let Transfer::Upload {
            object,
            value,
            sent,
            toggle: expected,
        } = &mut self.transfer
        else {
            return (NO_OBJECT, Err(AbortCode::UNKNOWN_COMMAND));
        };
        let object = *object;
        if toggle != *expected {
            return (object, Err(abort::TOGGLE));
        }
        let part = (value.len() - *sent).min(segment_room(room));
        let last = *sent + part == value.len();
        let data = &value[*sent..*sent + part];
        emit(SdoResponse::UploadSegment(Segment { toggle, last, data }), mail);
        *sent += part;
        *expected = !*expected;
        if last {
            self.transfer = Transfer::None;
        }
        (object, Ok(()))
    }

    fn download(
        &mut self,
        object: Object,
        total: u32,
        data: &[u8],
        (objects, in_pre_op): (&mut ObjectStore, bool),
        mail: &mut [u8],
    ) -> Result<(), AbortCode> {
        self.transfer = Transfer::None;
        let total = usize::try_from(total).unwrap_or(usize::MAX);
        if total > VALUE_MAX {
            return Err(AbortCode::OUT_OF_MEMORY);
        }
        if data.len() == total {
            self.store(object, data, objects, in_pre_op)?;
        } else {
            self.transfer = Transfer::Download {
                object,
                value: data.to_vec(),
                total,
                toggle: false,
            };
        }
        emit(SdoResponse::DownloadDone(object), mail);
        Ok(())
    }

    fn download_segment(
        &mut self,
        segment: Segment<'_>,
        objects: &mut ObjectStore,
        in_pre_op: bool,
        mail: &mut [u8],
    ) -> (Object, Result<(), AbortCode>) {
        let Transfer::Download {
            object,
            value,
            total,
            toggle,
        } = &mut self.transfer
        else {
            return (NO_OBJECT, Err(AbortCode::UNKNOWN_COMMAND));
        };
        let (object, total) = (*object, *total);
        if segment.toggle != *toggle {
            return (object, Err(abort::TOGGLE));
        }
        value.extend_from_slice(segment.data);
        *toggle = !*toggle;
        if value.len() > total {
            return (object, Err(AbortCode::TOO_LONG));
        }
        if segment.last {
            let value = core::mem::take(value);
            self.transfer = Transfer::None;
            if value.len() < total {
                return (object, Err(AbortCode::TOO_SHORT));
            }
            if let Err(code) = self.store(object, &value, objects, in_pre_op) {
                return (object, Err(code));
            }
        }
        emit(SdoResponse::DownloadSegmentDone { toggle: segment.toggle }, mail);
        (object, Ok(()))
    }

    fn information(&self, request: InfoRequest, objects: &ObjectStore, room: usize) -> Mails {
        if !self.abilities.information {
            return vec![info(InfoResponse::Error(AbortCode::UNSUPPORTED_ACCESS), room)];
        }
        let result = match request {
            InfoRequest::List(kind) => return list(kind, objects, room),
            InfoRequest::Object { index } => objects.describe(index, 0).map(|of| {
                let text = objects.describe(index, if of.sub_max > 0 { 1 } else { 0 });
                let name = text.map_or(of.name, |entry| entry.name).as_bytes();
                let most = room.saturating_sub(mailbox::HEADER_LEN + HEADER_LEN + 10);
                let response = InfoResponse::Object {
                    index,
                    data_type: of.data_type.code(),
                    sub_max: of.sub_max,
                    code: if of.sub_max > 0 { RECORD } else { VARIABLE },
                    name: &name[..name.len().min(most)],
                };
                info(response, room)
            }),
            InfoRequest::Entry { index, sub, wanted } => objects.describe(index, sub).map(|of| {
                let bits = if of.data_type == DataType::Bool {
                    1
                } else {
                    8 * of.octets
                };
                let most = room.saturating_sub(mailbox::HEADER_LEN + HEADER_LEN + 14);
                let name = of.name.as_bytes();
                let response = InfoResponse::Entry {
                    index,
                    sub,
                    wanted: 0,
                    data_type: of.data_type.code(),
                    bits: bits as u16,
                    access: access_bits(of.access, of.pdo),
                    data: &name[..name.len().min(most)],
                };
                // Units, defaults and limits are not told.
                let _ = wanted;
                info(response, room)
            }),
        };
        vec![result.unwrap_or_else(|code| info(InfoResponse::Error(code), room))]
    }
}

const NO_OBJECT: Object = Object {
    index: 0,
    sub: 0,
    complete: false,
};
const VARIABLE: u8 = 7;
const RECORD: u8 = 9;

fn access_bits(access: Access, pdo: PdoAccess) -> u16 {
    let read = if access.readable() { 0x07 } else { 0 };
    let write = if access.writable() { 0x38 } else { 0 };
    let mapped = match pdo {
        PdoAccess::No => 0,
        PdoAccess::Rpdo => 0x40,
        PdoAccess::Tpdo => 0x80,
        PdoAccess::Both => 0xC0,
    };
    read | write | mapped
}

/// A list, in as many fragments as it takes.
fn list(kind: ListKind, objects: &ObjectStore, room: usize) -> Mails {
    let all = objects.indices();
    let of = |kind: ListKind| -> Vec<u16> {
        let is_mapped = |index: &u16, receive: bool| {
            let Ok(of) = objects.describe(*index, 0) else {
                return false;
            };
            (0..=of.sub_max).any(|sub| {
                objects.describe(*index, sub).is_ok_and(|entry| {
                    entry.pdo == PdoAccess::Both || entry.pdo == if receive { PdoAccess::Rpdo } else { PdoAccess::Tpdo }
                })
            })
        };
        match kind {
            ListKind::All => all.clone(),
            ListKind::RxPdo => all.iter().copied().filter(|index| is_mapped(index, true)).collect(),
            ListKind::TxPdo => all.iter().copied().filter(|index| is_mapped(index, false)).collect(),
            ListKind::Backup | ListKind::Settings | ListKind::Counts | ListKind::Unknown(_) => Vec::new(),
        }
    };
    let words: Vec<u16> = match kind {
        ListKind::Unknown(_) => return vec![info(InfoResponse::Error(AbortCode::VALUE_RANGE), room)],
        ListKind::Counts => [
            ListKind::All,
            ListKind::RxPdo,
            ListKind::TxPdo,
            ListKind::Backup,
            ListKind::Settings,
        ]
        .into_iter()
        .map(|kind| of(kind).len() as u16)
        .collect(),
        kind => of(kind),
    };
    let mut octets = u16::from(kind).to_le_bytes().to_vec();
    octets.extend(words.iter().flat_map(|word| word.to_le_bytes()));
    let most = (room.saturating_sub(mailbox::HEADER_LEN + HEADER_LEN + 4) & !1).max(2);
    let fragments = octets.len().div_ceil(most);
    let parts = octets.chunks(most).enumerate();
    parts
        .map(|(at, data)| {
            let left = (fragments - 1 - at) as u16;
            info(InfoResponse::List { left, data }, room)
        })
        .collect()
}

fn info(response: InfoResponse<'_>, room: usize) -> Vec<u8> {
    let mut mail = vec![0; room];
    // What is too long for the mailbox was cut.
    let _ = Message::InfoResponse(response).emit(0, &mut mail);
    mail
}

fn emit(response: SdoResponse<'_>, mail: &mut [u8]) {
    // The counter is put in when the mail leaves.
    let _ = Message::Response(response).emit(0, mail);
}
