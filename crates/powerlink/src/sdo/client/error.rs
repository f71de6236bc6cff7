//! Why a command of the client failed, or was not started.

use core::fmt;

use obd::AbortCode;

/// Why a command failed, or was not started.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClientError {
    /// The node refused the command.
    Aborted(AbortCode),
    /// Nothing new came within [`Timing::give_up_ns`](super::Timing::give_up_ns), though the frames were sent this many times.
    TimedOut {
        /// Frames sent for this command.
        frames: u32,
    },
    /// The node has forgotten the connection after the command was sent more than once: it may have been carried out.
    ConnectionLost,
    /// The answer does not follow the protocol.
    BadAnswer(&'static str),
    /// The last command has not ended, or its result was not taken.
    Busy,
    /// The answer does not fit in the caller's buffer.
    TooLong {
        /// Octets of the answer.
        got: usize,
        /// Octets of the buffer.
        most: usize,
    },
    /// What is to be written has another length than when the command was started.
    WrongLength {
        /// Octets as started.
        expected: usize,
        /// Octets handed in.
        got: usize,
    },
}

impl fmt::Display for ClientError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ClientError::Aborted(code) => write!(f, "aborted by the node: {code}"),
            ClientError::TimedOut { frames } => write!(f, "no answer, {frames} frames were sent"),
            ClientError::ConnectionLost => {
                write!(
                    f,
                    "the node lost the connection and may or may not have carried out the command"
                )
            }
            ClientError::BadAnswer(what) => write!(f, "bad answer: {what}"),
            ClientError::Busy => write!(f, "the command before has not ended"),
            ClientError::TooLong { got, most } => {
                write!(
                    f,
                    "an answer of {got} octets does not fit in the {most} octets there are for it"
                )
            }
            ClientError::WrongLength { expected, got } => {
                write!(
                    f,
                    "{got} octets were handed in to be written, announced were {expected}"
                )
            }
        }
    }
}

impl core::error::Error for ClientError {}
