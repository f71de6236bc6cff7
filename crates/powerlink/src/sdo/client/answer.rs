//! Answers of the server: in one frame, in segments, or an abort.
//!
//! In:  commands of the server in order, each once. Out: data in the caller's buffer, the result of the command.

use obd::AbortCode;

use super::error::ClientError;
use super::state::{Client, Incoming, Progress};
use crate::sdo::command::{self, Command, CommandId, Segmentation};

impl Client {
    /// Takes a command of the server, which came in order; ends the command that runs when this completes its answer.
    pub(super) fn take_command(&mut self, command: Command<'_>, sink: &mut [u8]) {
        let ours = command.header.response && command.header.transaction == self.transaction;
        if self.progress != Progress::Running || self.request.numbered == 0 || !ours {
            return;
        }
        match self.take_answer(command, sink) {
            Ok(Some(len)) => {
                self.progress = Progress::Done(Ok(len));
                self.incoming = None;
            }
            Ok(None) => {}
            Err(error @ ClientError::Aborted(_)) => self.fail(error, None),
            Err(error @ ClientError::TooLong { .. }) => self.fail(error, Some(AbortCode::OUT_OF_MEMORY)),
            Err(
                error @ (ClientError::BadAnswer(_)
                | ClientError::TimedOut { .. }
                | ClientError::ConnectionLost
                | ClientError::Busy
                | ClientError::WrongLength { .. }),
            ) => self.fail(error, Some(AbortCode::GENERAL)),
        }
    }

    /// Octets of the answer when it is complete.
    fn take_answer(&mut self, command: Command<'_>, sink: &mut [u8]) -> Result<Option<usize>, ClientError> {
        let Command { header, data } = command;
        if header.abort {
            let code = command::abort_code(data).ok_or(ClientError::BadAnswer("an abort without a code"))?;
            return Err(ClientError::Aborted(code));
        }
        if header.id != self.request.id {
            return Err(ClientError::BadAnswer("another command than the one that was sent"));
        }
        if self.request.arrived < self.request.segments() {
            return Err(ClientError::BadAnswer("an answer before the request was complete"));
        }
        let (len, at, data) = match (header.segmentation, self.incoming) {
            // The answer to a write carries nothing.
            (Segmentation::Expedited, None) if self.request.id == CommandId::WriteByIndex => return Ok(Some(0)),
            (Segmentation::Expedited, None) => (data.len(), 0, data),
            (Segmentation::Initiate, None) => {
                let (len, data) = command::split_initiate(data)
                    .ok_or(ClientError::BadAnswer("a first segment that contradicts its own size"))?;
                (len, 0, data)
            }
            (Segmentation::Segment | Segmentation::Complete, Some(Incoming { len, done })) => (len, done, data),
            (Segmentation::Expedited | Segmentation::Initiate, Some(_)) => {
                return Err(ClientError::BadAnswer("a second answer begins within the first"));
            }
            (Segmentation::Segment | Segmentation::Complete, None) => {
                return Err(ClientError::BadAnswer("a segment without a first one"));
            }
        };
        if len > sink.len() {
            let most = sink.len();
            return Err(ClientError::TooLong { got: len, most });
        }
        let done = at + data.len();
        if done > len {
            return Err(ClientError::BadAnswer("more data than were announced"));
        }
        sink[at..done].copy_from_slice(data);
        match header.segmentation {
            Segmentation::Expedited => Ok(Some(done)),
            Segmentation::Complete if done == len => Ok(Some(done)),
            Segmentation::Complete => Err(ClientError::BadAnswer("fewer data than were announced")),
            Segmentation::Initiate | Segmentation::Segment => {
                self.incoming = Some(Incoming { len, done });
                Ok(None)
            }
        }
    }
}
