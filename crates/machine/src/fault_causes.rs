//! Why something is wrong: what a fault carries, each with its words.
//!
//! In:  what was seen. Out: words for the operator.

use std::fmt;

/// Why the spindle is not at the angle of M19.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OrientFailure {
    /// The time of Q is over.
    Late {
        /// Wanted angle, degrees.
        degrees: f64,
        /// The time, s.
        timeout_s: f64,
    },
    /// `spindle.0.orient-fault` is not 0.
    Fault {
        /// Its value.
        code: i32,
    },
}

impl fmt::Display for OrientFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            OrientFailure::Late { degrees, timeout_s } => write!(
                f,
                "spindle.0.is-oriented does not tell within {timeout_s} s that {degrees} degrees are reached (M19)"
            ),
            OrientFailure::Fault { code } => {
                write!(f, "what orients it reports fault {code} (spindle.0.orient-fault, M19)")
            }
        }
    }
}

/// Speed of a spindle that has been waited for too long.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedNotReached {
    /// Number of the spindle.
    pub spindle: u8,
    /// Wanted, 1/min, above 0 with M3.
    pub wanted_rpm: f64,
    /// Measured; `None` without an encoder.
    pub measured_rpm: Option<f64>,
}

impl fmt::Display for SpeedNotReached {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let SpeedNotReached {
            spindle,
            wanted_rpm,
            measured_rpm,
        } = self;
        match measured_rpm {
            Some(measured_rpm) => write!(
                f,
                "turns at {measured_rpm:.0} 1/min, wanted are {wanted_rpm:.0}: its drive, its encoder and spindle.0.at-speed tell why"
            ),
            None => write!(
                f,
                "spindle.{spindle}.at-speed does not tell that {wanted_rpm:.0} 1/min are reached"
            ),
        }
    }
}

/// Why the network adapter does not send or receive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinkFailure {
    /// The interface is down or gone.
    Down,
    /// The transmit queue is full; the frame was not sent.
    QueueFull,
    /// The frame is longer or shorter than the link can carry.
    FrameLength {
        /// Octets of the frame.
        octets: usize,
        /// Octets that the link can carry at most.
        max: usize,
    },
    /// Any other error of the operating system.
    Os {
        /// `errno`.
        errno: i32,
    },
}

impl fmt::Display for LinkFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            LinkFailure::Down => f.write_str("the interface is down"),
            LinkFailure::QueueFull => f.write_str("the transmit queue is full"),
            LinkFailure::FrameLength { octets, max } => {
                write!(f, "a frame of {octets} octets, the link carries 14 to {max}")
            }
            LinkFailure::Os { errno } => write!(f, "system error {errno}"),
        }
    }
}

/// Another master of the bus on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ForeignMaster {
    /// Who was heard: the other master, or a node that answers it; `None`: its frames do not tell.
    pub node: Option<u8>,
    /// MAC of the sender.
    pub mac: [u8; 6],
    /// The master itself was heard, and not only a node that answers it.
    pub is_itself: bool,
}

impl fmt::Display for ForeignMaster {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ForeignMaster {
            node,
            mac: [a, b, c, d, e, g],
            ..
        } = self;
        let mac = format_args!("{a:02x}:{b:02x}:{c:02x}:{d:02x}:{e:02x}:{g:02x}");
        match (node, self.is_itself) {
            (None, _) => write!(f, "another main device is on the wire: {mac}"),
            (Some(node), true) => write!(f, "another managing node is on the wire: {mac}, node id {node}"),
            (Some(node), false) => write!(
                f,
                "another managing node is on the wire, perhaps on this PC: node {node} ({mac}) answers one"
            ),
        }
    }
}

/// Something that went wrong in a scan of a program in Structured Text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogicError {
    /// What.
    pub wrong: logic::Wrong,
    /// Place in the program, counted from 1.
    pub line: u32,
    pub column: u32,
    /// The outputs of the scan count, and the next one comes.
    pub goes_on: bool,
}

impl fmt::Display for LogicError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let LogicError {
            wrong, line, column, ..
        } = self;
        let then = match self.goes_on {
            true => "it goes on (on_error)",
            false => "the program stands, its outputs have their safe values; it restarts when you acknowledge",
        };
        write!(f, "{line}:{column}: {wrong}; {then}")
    }
}
