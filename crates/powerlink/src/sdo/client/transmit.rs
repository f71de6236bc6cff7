//! What a client sends, and when.

use obd::AbortCode;

use super::error::ClientError;
use super::state::{Client, Missing, Progress, State};
use crate::sdo::command::{self, Header, Segmentation};
use crate::sdo::sequence::{self, Con, Flow, Number, Sequence};
use crate::sdo::service_data::{EMPTY_LEN, SERVICE_DATA_MAX};

impl Client {
    /// Whether [`poll_transmit`](Self::poll_transmit) has a frame to send at this time: then the node needs the asynchronous
    /// slot.
    pub fn wants_to_transmit(&self, now_ns: u64) -> bool {
        let owes = self.missing == Missing::ToReport || self.acknowledge_at_ns.is_some_and(|at_ns| now_ns >= at_ns);
        match self.progress {
            Progress::Running => {
                let timer = self.again_at_ns.is_none_or(|at_ns| now_ns >= at_ns);
                timer || (self.state == State::Open && (owes || self.flow.due() > 0 || self.can_number()))
            }
            Progress::Idle | Progress::Done(_) => self.closing || (self.state == State::Open && owes),
        }
    }

    /// When [`wants_to_transmit`](Self::wants_to_transmit) becomes true if nothing is received before; `None`: not at all.
    pub fn next_deadline_ns(&self) -> Option<u64> {
        if self.wants_to_transmit(0) {
            return Some(0);
        }
        let again_ns = self.again_at_ns.filter(|_| self.progress == Progress::Running);
        let acknowledge_ns = self.acknowledge_at_ns.filter(|_| self.state == State::Open);
        match (again_ns, acknowledge_ns) {
            (Some(again_ns), Some(acknowledge_ns)) => Some(again_ns.min(acknowledge_ns)),
            (at_ns, None) | (None, at_ns) => at_ns,
        }
    }

    /// Whether a further segment of the request may follow.
    pub(super) fn can_number(&self) -> bool {
        self.flow.has_room() && self.request.numbered < self.request.segments()
    }

    /// Writes the service data of the frame that is due into `out` and returns its length. `value` is what is written, as long
    /// as announced at the start; empty when an object is read. `None`: nothing to send now. A command whose time is over fails
    /// here.
    pub fn poll_transmit(&mut self, now_ns: u64, value: &[u8], out: &mut [u8; SERVICE_DATA_MAX]) -> Option<usize> {
        if self.progress == Progress::Running {
            if value.len() != self.request.len {
                let (expected, got) = (self.request.len, value.len());
                self.fail(ClientError::WrongLength { expected, got }, Some(AbortCode::GENERAL));
            } else if self
                .alive_ns
                .is_some_and(|alive_ns| now_ns.saturating_sub(alive_ns) >= self.timing.give_up_ns)
            {
                self.fail(ClientError::TimedOut { frames: self.frames }, None);
                self.closing = self.state != State::Closed;
            }
        }
        if !self.wants_to_transmit(now_ns) {
            return None;
        }
        match self.progress {
            Progress::Running => {
                if self.again_at_ns.is_some_and(|at_ns| now_ns >= at_ns) {
                    self.timeout_ns = self.timeout_ns.saturating_mul(2).min(self.timing.longest_timeout_ns);
                    self.flow.repeat_last();
                }
                self.alive_ns.get_or_insert(now_ns);
                self.frames += 1;
                let again_at_ns = now_ns.saturating_add(self.timeout_ns);
                let timer = self
                    .again_at_ns
                    .replace(again_at_ns)
                    .is_none_or(|at_ns| now_ns >= at_ns);
                self.transmit_running(now_ns, timer, value, out)
            }
            Progress::Idle | Progress::Done(_) if self.closing => self.transmit_close(out),
            Progress::Idle | Progress::Done(_) => self.transmit_acknowledge(Con::Valid, out),
        }
    }

    /// The next step towards the answer: opens the connection, or sends a part of the command.
    pub(super) fn transmit_running(
        &mut self,
        now_ns: u64,
        timer: bool,
        value: &[u8],
        out: &mut [u8; SERVICE_DATA_MAX],
    ) -> Option<usize> {
        match self.state {
            State::Closed | State::Opening => {
                self.state = State::Opening;
                self.flow = Flow::new(Number::new(0));
                return self.emit_empty(Con::None, Con::Init, out);
            }
            State::Confirming => {
                let len = self.emit_empty(Con::Init, Con::Valid, out);
                if core::mem::replace(&mut self.confirmed, true) {
                    // What got lost is our confirmation or the answer to it. Not every server answers one that it has already,
                    // so the command follows at once: that is answered by whoever has taken the connection as open.
                    self.state = State::Open;
                    self.send_now();
                }
                return len;
            }
            State::Open => {}
        }
        if self.missing == Missing::ToReport {
            return self.transmit_acknowledge(Con::Valid, out);
        }
        if self.flow.due() == 0 && self.can_number() {
            self.flow.add();
            self.request.numbered += 1;
        }
        if let Some(outgoing) = self.flow.transmit() {
            let segment = self.request.arrived + usize::from(outgoing.place);
            let last = segment + 1 == self.request.segments();
            let full = !last && !self.flow.has_room();
            let asks = outgoing.number == self.flow.sent() && (outgoing.repeated || full);
            if last {
                self.request.completed += 1;
            }
            let sent_con = if asks { Con::Request } else { Con::Valid };
            self.emit_sequence(Con::Valid, outgoing.number, sent_con, out)?;
            self.acknowledge_at_ns = None;
            self.unacknowledged = 0;
            return self.emit_segment(segment, value, &mut out[sequence::HEADER_LEN..]);
        }
        // Nothing left to say: the answer is late, or has to be acknowledged.
        let owes = self.acknowledge_at_ns.is_some_and(|at_ns| now_ns >= at_ns);
        let sent_con = if timer && !owes { Con::Request } else { Con::Valid };
        self.transmit_acknowledge(sent_con, out)
    }

    pub(super) fn emit_segment(&self, at: usize, value: &[u8], out: &mut [u8]) -> Option<usize> {
        let prefix = self.request.prefix();
        let len = prefix + self.request.len;
        let (segmentation, range) = command::segment(len, at);
        let header = Header {
            transaction: self.transaction,
            response: false,
            abort: false,
            segmentation,
            id: self.request.id,
        };
        let written = command::emit_segment(header, len, range.len(), out, |data| {
            let address = if at == 0 { self.request.address } else { None };
            let value_at = range.start.saturating_sub(prefix);
            match address.and_then(|address| Some((address, data.split_first_chunk_mut()?))) {
                Some((address, (octets, rest))) => {
                    address.emit(octets);
                    rest.copy_from_slice(&value[..rest.len()]);
                }
                None => data.copy_from_slice(&value[value_at..value_at + data.len()]),
            }
        })?;
        Some(sequence::HEADER_LEN + written)
    }

    /// Acknowledges without a command, asks for missing frames or for an acknowledge.
    pub(super) fn transmit_acknowledge(&mut self, sent_con: Con, out: &mut [u8; SERVICE_DATA_MAX]) -> Option<usize> {
        let received_con = if self.missing == Missing::ToReport {
            self.missing = Missing::Reported;
            Con::Request
        } else {
            Con::Valid
        };
        self.acknowledge_at_ns = None;
        self.unacknowledged = 0;
        self.emit_empty(received_con, sent_con, out)
    }

    /// Tells the server why the command ends, if it does not know; then closes.
    pub(super) fn transmit_close(&mut self, out: &mut [u8; SERVICE_DATA_MAX]) -> Option<usize> {
        if let (Some(code), State::Open) = (self.abort.take(), self.state) {
            let number = self.flow.add();
            self.emit_sequence(Con::Valid, number, Con::Valid, out)?;
            let header = Header {
                transaction: self.transaction,
                response: false,
                abort: true,
                segmentation: Segmentation::Expedited,
                id: self.request.id,
            };
            let octets = code.0.to_le_bytes();
            let out = &mut out[sequence::HEADER_LEN..];
            let written = command::emit_segment(header, octets.len(), octets.len(), out, |data| {
                data.copy_from_slice(&octets);
            })?;
            return Some(sequence::HEADER_LEN + written);
        }
        let len = self.emit_empty(Con::None, Con::None, out)?;
        self.reset_connection();
        Some(len)
    }

    pub(super) fn emit_empty(
        &self,
        received_con: Con,
        sent_con: Con,
        out: &mut [u8; SERVICE_DATA_MAX],
    ) -> Option<usize> {
        out[..EMPTY_LEN].fill(0);
        self.emit_sequence(received_con, self.flow.sent(), sent_con, out)?;
        Some(EMPTY_LEN)
    }

    pub(super) fn emit_sequence(
        &self,
        received_con: Con,
        sent: Number,
        sent_con: Con,
        out: &mut [u8; SERVICE_DATA_MAX],
    ) -> Option<()> {
        Sequence {
            received: self.flow.received(),
            received_con,
            sent,
            sent_con,
        }
        .emit(out.first_chunk_mut()?);
        Some(())
    }
}
