//! What plain G-code cannot say.
//!
//! In:  what another part of the writer found in a call.
//! Out: [`Unwritable`], and with the line of the program that the call comes from [`FlatError`].

use super::line::{LINE_CHARACTERS_MAX, LineError};
use motion::canon::Source;
use std::io;

/// A call that plain G-code cannot say.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Unwritable {
    /// A number that is infinite or none.
    #[error("the number of {0} is not finite")]
    NotFinite(char),
    /// Numbers beyond all machines, or a long text.
    #[error("the line would be longer than {LINE_CHARACTERS_MAX} characters")]
    TooLong,
    /// A comment with a bracket or line end in it, or that would do something.
    #[error("the text {0:?} would mean something else in a comment")]
    Text(String),
    /// A move at feed without one.
    #[error("a move at feed before a feed above 0 was set")]
    FeedMissing,
    /// An arc that G2 and G3 refuse in mm: start and end differ in radius.
    #[error("an arc that G2 and G3 refuse in mm: {0}")]
    Arc(String),
    /// A whole turn or more at once.
    #[error("{0} has no ends and turns by a whole turn or more, which a word cannot say")]
    Wrapped(char),
    /// A curve that does not begin where the axes stand, or in a plane of U, V and W.
    #[error("a spline {0}")]
    Spline(&'static str),
    /// An arc, spline or probing move in step with a spindle.
    #[error("{0} in step with a spindle")]
    Synchronised(&'static str),
    /// Tool-centre-point control.
    #[error("tool-centre-point control (G43.4)")]
    ToolCentrePoint,
    /// A tap without the pitch.
    #[error("a rigid tap outside of synchronised motion has no pitch")]
    TapWithoutPitch,
    /// Synchronised in speed only.
    #[error("motion that follows the speed of a spindle, but not its angle")]
    SpeedOnly,
    /// No code starts a spindle so.
    #[error("a spindle that starts without a wait for its speed")]
    SpindleWithoutWait,
    /// A wait for an angle that is not behind its M19.
    #[error("a wait for the angle of a spindle that is not behind its M19")]
    WaitWithoutOrient,
    /// A change of pallets without the stop or end that belongs to it.
    #[error("a change of pallets without M30 or M60")]
    PalletAlone,
    /// A number that no user code has.
    #[error("a user code M{0}: they are M100 to M199")]
    UserCode(u8),
}

/// Why a flat text could not be written.
#[derive(Debug, thiserror::Error)]
pub enum FlatError {
    /// The text could not be written.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// A call cannot be written.
    #[error("line {}: cannot be written as plain G-code: {reason}", at.line)]
    Unwritable {
        /// The block that it comes from.
        at: Source,
        /// What plain G-code has no form for.
        reason: Unwritable,
    },
}

impl From<LineError> for Unwritable {
    fn from(error: LineError) -> Unwritable {
        match error {
            LineError::NotFinite(letter) => Unwritable::NotFinite(letter),
            LineError::TooLong => Unwritable::TooLong,
        }
    }
}
