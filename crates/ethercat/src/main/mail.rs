//! Mails to a device and from it: one SDO at a time, what comes unasked, and what was lost on the way.
//!
//! In:  an object and its value. Out: datagrams; the value, or why there is none; emergencies.
//!
//! A mail is sent with the same number until a frame comes back that says that the mailbox has taken it; a device that has it already
//! drops the second. A mailbox that is full takes nothing, and does not tell whose mail is in it: of a device that waits for its own mail
//! to be fetched, one is fetched in between. A mail of the device that was lost behind its mailbox is asked for by the repeat bit of the
//! SyncManager.
//!
//! An SDO that was given up may still be answered, and its answer has nothing but object and direction to tell it from that to the next
//! one. So the next one waits until a question of another object is answered: a device answers one behind the other.

use super::event::SetupError;
use crate::wire::coe::{
    Bytes4, Emergency, HEADER_LEN, Message, Object, SDO_LEN, SdoRequest, SdoResponse, Segment, segment_room,
};
use crate::wire::mailbox::{self, Mail, MailError, Protocol, next_counter};
use crate::wire::register::{self, SyncManager};
use crate::wire::sii::Mailboxes;
use crate::wire::{Command, FrameWriter, WireError};
use obd::AbortCode;

/// SyncManager of the device's mails.
const MAIL_IN: u8 = 1;
/// Registers of a SyncManager from its status on.
const STATUS_AT: u16 = 5;
/// How long a device may take to put its last mail into the mailbox again, ns; after that it had none.
const REPEAT_NS: u64 = 20_000_000;

/// What every device has: its identity. Whether it has the sub-index is of no interest.
const KNOWN_OBJECT: u16 = 0x1018;

/// Where the mailboxes are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Nothing is to be done.
    Idle,
    /// A mail is to be sent; it may have been before.
    Send,
    /// A mail is to be fetched.
    Fetch,
    /// The last mail is to be asked for once more.
    Repeat,
    /// Until it is there again.
    Repeated { until_ns: u64 },
}

/// An SDO that is under way.
#[derive(Clone, Copy, Debug)]
struct Transfer {
    object: Object,
    is_write: bool,
    /// Octets of the value.
    total: usize,
    /// Octets that have passed.
    done: usize,
    /// Octets in the mail that is on its way.
    on_way: usize,
    /// The first mail was answered.
    begun: bool,
    toggle: bool,
    until_ns: u64,
}

/// What came of a mail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    /// Nothing yet.
    Nothing,
    /// The SDO is done; so many octets of a value that was read.
    Done(usize),
    /// It is not.
    Failed(SetupError),
    /// The device reports this; the SDO goes on.
    Emergency(Emergency),
}

/// Both mailboxes of a device.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mailbox {
    boxes: Mailboxes,
    phase: Phase,
    transfer: Option<Transfer>,
    /// The mailbox has taken the mail of this transfer that was sent last.
    taken: bool,
    /// Numbers of the last mail that was sent and of the last that came.
    sent: u8,
    came: u8,
    /// Repeat bit, and whether the device may have another one.
    repeat: bool,
    repeat_unknown: bool,
    /// Sub-index of the [`KNOWN_OBJECT`] whose answer all of what was given up comes before.
    behind: Option<u8>,
    not_before_ns: u64,
    pause_ns: u64,
}

impl Mailbox {
    /// Both are empty, and the device is in INIT.
    pub(super) fn new(boxes: Mailboxes, pause_ns: u64) -> Mailbox {
        Mailbox {
            boxes,
            phase: Phase::Idle,
            transfer: None,
            taken: false,
            sent: 0,
            came: 0,
            repeat: false,
            repeat_unknown: false,
            behind: None,
            not_before_ns: 0,
            pause_ns,
        }
    }

    /// Whether an SDO can be begun.
    pub(super) fn is_free(&self) -> bool {
        self.transfer.is_none()
    }

    /// Begins to write a value of this length, or to read one.
    pub(super) fn begin(&mut self, object: Object, write: Option<usize>, until_ns: u64) {
        self.transfer = Some(Transfer {
            object,
            is_write: write.is_some(),
            total: write.unwrap_or(0),
            done: 0,
            on_way: 0,
            begun: false,
            toggle: false,
            until_ns,
        });
        self.send_next();
    }

    fn send_next(&mut self) {
        self.sent = next_counter(self.sent);
        self.taken = false;
        self.not_before_ns = 0;
        self.go_to(Phase::Send);
    }

    /// Looks whether a mail is there that nobody asked for.
    pub(super) fn look(&mut self) {
        if self.phase == Phase::Idle {
            self.phase = Phase::Fetch;
        }
    }

    /// An SDO whose time is over.
    pub(super) fn expired(&mut self, now_ns: u64) -> Option<SetupError> {
        let transfer = self.transfer.filter(|transfer| transfer.until_ns <= now_ns)?;
        self.give_up();
        Some(SetupError::SdoTimeout {
            object: transfer.object,
        })
    }

    /// The SDO that is under way is not waited for any more; it may still be answered.
    pub(super) fn give_up(&mut self) {
        if let Some(Transfer { object, .. }) = self.transfer {
            // Never the one that was asked for last.
            self.behind = Some(match self.behind {
                Some(sub) => sub.wrapping_add(1),
                None if object.index == KNOWN_OBJECT => object.sub.wrapping_add(1),
                None => 0,
            });
        }
        self.end();
    }

    fn end(&mut self) {
        self.transfer = None;
        self.go_to(Phase::Idle);
    }

    /// Leaves what is under way.
    fn go_to(&mut self, phase: Phase) {
        // The repeat bit may have been written, and the answer that would tell it is nobody's now.
        self.repeat_unknown |= self.phase == Phase::Repeat;
        self.phase = phase;
    }

    fn question(&self) -> Option<Object> {
        self.behind.map(|sub| Object {
            index: KNOWN_OBJECT,
            sub,
            complete: false,
        })
    }

    /// Adds a datagram, if there is one to be sent. `source`: the value that is written.
    ///
    /// # Errors
    /// [`WireError::NoRoom`]: it has to wait for another frame.
    pub(super) fn ask(
        &mut self,
        now_ns: u64,
        station: u16,
        source: &[u8],
        writer: &mut FrameWriter<'_>,
        index: u8,
    ) -> Result<bool, WireError> {
        if now_ns < self.not_before_ns {
            return Ok(false);
        }
        let manager = register::sync_manager(MAIL_IN);
        match self.phase {
            Phase::Idle => return Ok(false),
            Phase::Send => {
                let area = self.boxes.receive;
                let at = writer.push(
                    Command::Fpwr,
                    index,
                    register::station(station, area.start),
                    area.length.into(),
                )?;
                let mailbox = writer.data_mut(at, area.length.into());
                self.write(source, mailbox)?;
            }
            Phase::Fetch => {
                let area = self.boxes.send;
                let address = register::station(station, area.start);
                writer.push(Command::Fprd, index, address, area.length.into())?;
            }
            Phase::Repeat if !self.repeat_unknown => {
                let address = register::station(station, manager + 6);
                let activate = 1 | u8::from(!self.repeat) << 1;
                writer.push_data(Command::Fpwr, index, address, &[activate])?;
            }
            Phase::Repeat | Phase::Repeated { .. } => {
                let address = register::station(station, manager + STATUS_AT);
                writer.push(Command::Fprd, index, address, SyncManager::LEN - usize::from(STATUS_AT))?;
            }
        }
        Ok(true)
    }

    /// Writes the mail that is to be sent.
    fn write(&mut self, source: &[u8], mailbox: &mut [u8]) -> Result<(), WireError> {
        if let Some(object) = self.question() {
            return Message::Request(SdoRequest::Upload(object)).emit(self.sent, mailbox);
        }
        let Some(transfer) = &mut self.transfer else {
            return Ok(());
        };
        let Transfer {
            object,
            toggle,
            done,
            total,
            ..
        } = *transfer;
        let rest = source.get(done..total).unwrap_or(&[]);
        let request = match (transfer.is_write, transfer.begun) {
            (true, false) => match Bytes4::new(rest).filter(|_| !object.complete) {
                Some(value) => {
                    transfer.on_way = total;
                    SdoRequest::DownloadExpedited { object, value }
                }
                None => {
                    let room = mailbox.len().saturating_sub(mailbox::HEADER_LEN + HEADER_LEN + SDO_LEN);
                    transfer.on_way = rest.len().min(room);
                    SdoRequest::Download {
                        object,
                        total: total as u32,
                        data: &rest[..transfer.on_way],
                    }
                }
            },
            (true, true) => {
                transfer.on_way = rest.len().min(segment_room(mailbox.len()));
                let last = done + transfer.on_way == total;
                SdoRequest::DownloadSegment(Segment {
                    toggle,
                    last,
                    data: &rest[..transfer.on_way],
                })
            }
            (false, false) => SdoRequest::Upload(object),
            (false, true) => SdoRequest::UploadSegment { toggle },
        };
        Message::Request(request).emit(self.sent, mailbox)
    }

    /// The frame with the datagram was lost.
    pub(super) fn lost(&mut self) {
        if self.phase == Phase::Fetch {
            // A mail may have been in there.
            self.phase = Phase::Repeat;
        }
    }

    /// The datagram came back. `sink`: where a value goes that is read.
    pub(super) fn answer(&mut self, now_ns: u64, working_counter: u16, data: &[u8], sink: &mut [u8]) -> Outcome {
        match self.phase {
            Phase::Idle => {}
            Phase::Send => {
                self.taken = working_counter > 0;
                self.phase = Phase::Fetch;
                self.not_before_ns = now_ns + self.pause_ns;
            }
            Phase::Fetch => {
                let outcome = match working_counter {
                    0 => {
                        self.not_before_ns = now_ns + self.pause_ns;
                        Outcome::Nothing
                    }
                    _ => self.mail(data, sink),
                };
                if self.phase == Phase::Fetch {
                    self.phase = match self.transfer {
                        None => Phase::Idle,
                        Some(_) if self.taken => Phase::Fetch,
                        Some(_) => Phase::Send,
                    };
                }
                return outcome;
            }
            Phase::Repeat if self.repeat_unknown => {
                if let (1.., Some(activate)) = (working_counter, data.get(1)) {
                    self.repeat = activate & 2 != 0;
                    self.repeat_unknown = false;
                }
            }
            Phase::Repeat => {
                if working_counter > 0 {
                    self.repeat = !self.repeat;
                    self.phase = Phase::Repeated {
                        until_ns: now_ns + REPEAT_NS,
                    };
                }
                self.not_before_ns = now_ns + self.pause_ns;
            }
            Phase::Repeated { until_ns } => {
                let acknowledged = data.get(2).is_some_and(|pdi| (pdi & 2 != 0) == self.repeat);
                if working_counter > 0 && acknowledged || now_ns >= until_ns {
                    self.phase = Phase::Fetch;
                } else {
                    self.not_before_ns = now_ns + self.pause_ns;
                }
            }
        }
        Outcome::Nothing
    }

    /// A mail has come.
    fn mail(&mut self, data: &[u8], sink: &mut [u8]) -> Outcome {
        let Ok(mail) = Mail::parse(data) else {
            return Outcome::Nothing;
        };
        if mail.counter != 0 && mail.counter == self.came {
            return Outcome::Nothing; // It was here before.
        }
        self.came = mail.counter;
        if mail.protocol == Protocol::Error {
            let error = MailError::parse(mail.data).unwrap_or(MailError(0));
            if self.transfer.is_none() || self.behind.is_some() {
                return Outcome::Nothing;
            }
            self.end();
            return Outcome::Failed(SetupError::Mail(error));
        }
        match Message::parse(mail.data) {
            Ok(Message::Emergency(emergency)) if mail.protocol == Protocol::CoE => Outcome::Emergency(emergency),
            Ok(Message::Response(response)) if mail.protocol == Protocol::CoE => self.response(response, sink),
            // Most devices refuse with a request.
            Ok(Message::Request(SdoRequest::Abort { object, code })) if mail.protocol == Protocol::CoE => {
                self.response(SdoResponse::Abort { object, code }, sink)
            }
            _ => Outcome::Nothing,
        }
    }

    /// An answer to the SDO that is under way, or to one before.
    fn response(&mut self, response: SdoResponse<'_>, sink: &mut [u8]) -> Outcome {
        let Some(mut transfer) = self.transfer else {
            return Outcome::Nothing;
        };
        if let Some(question) = self.question() {
            if response
                .object()
                .is_some_and(|of| (of.index, of.sub) == (question.index, question.sub))
            {
                self.behind = None;
                self.send_next();
            }
            return Outcome::Nothing;
        }
        let Transfer {
            object,
            is_write,
            toggle,
            ..
        } = transfer;
        let is_first = !transfer.begun;
        transfer.begun = true;
        let is_own = |other: Object| (other.index, other.sub) == (object.index, object.sub);
        let taken = match response {
            SdoResponse::Abort { object: other, code } if is_own(other) || other.index == 0 => {
                self.end();
                return Outcome::Failed(SetupError::Sdo { object, code });
            }
            SdoResponse::DownloadDone(other) if is_write && is_first && is_own(other) => {
                transfer.done += transfer.on_way;
                Ok(transfer.done >= transfer.total)
            }
            SdoResponse::DownloadSegmentDone { toggle: other } if is_write && !is_first && toggle == other => {
                transfer.done += transfer.on_way;
                transfer.toggle = !toggle;
                Ok(transfer.done >= transfer.total)
            }
            SdoResponse::UploadExpedited { object: other, value } if !is_write && is_first && is_own(other) => {
                put(&mut transfer, value.octets(), sink).map(|()| true)
            }
            SdoResponse::Upload {
                object: other,
                total,
                data,
            } if !is_write && is_first && is_own(other) => {
                transfer.total = usize::try_from(total).unwrap_or(usize::MAX);
                put(&mut transfer, data, sink).map(|()| transfer.done >= transfer.total)
            }
            SdoResponse::UploadSegment(segment) if !is_write && !is_first && segment.toggle == toggle => {
                transfer.toggle = !toggle;
                put(&mut transfer, segment.data, sink).map(|()| segment.last)
            }
            _ => return Outcome::Nothing, // Of an SDO that was given up.
        };
        match taken {
            Ok(true) => {
                self.end();
                Outcome::Done(transfer.done)
            }
            Ok(false) => {
                self.transfer = Some(transfer);
                self.send_next();
                Outcome::Nothing
            }
            Err(code) => {
                self.end();
                Outcome::Failed(SetupError::Sdo { object, code })
            }
        }
    }
}

/// A part of a value that is read.
fn put(transfer: &mut Transfer, data: &[u8], sink: &mut [u8]) -> Result<(), AbortCode> {
    let place = sink.get_mut(transfer.done..transfer.done + data.len());
    place.ok_or(AbortCode::OUT_OF_MEMORY)?.copy_from_slice(data);
    transfer.done += data.len();
    Ok(())
}
