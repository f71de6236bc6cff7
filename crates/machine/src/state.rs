//! What the machine is doing, and what it may be asked to do next.
//!
//! In:  orders of the operator or of the [`Sequence`](super::sequence::Sequence), one at a time.
//! Out: [`State`], which the cycle thread shows after every cycle.

/// What the machine is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum State {
    /// The network is being brought up; no drive can be steered.
    Booting = 0,
    /// Drives reachable, without power.
    Disabled,
    /// Drives are being switched on.
    Enabling,
    /// Drives hold their position under command.
    Ready,
    /// Some joints seek their home point.
    Homing,
    /// A program moves the machine.
    Running,
    /// A program is held on its path.
    Held,
    /// Coming to rest on the path; the program is given up.
    Stopping,
    /// Drives are being switched off.
    Disabling,
    /// A fault stopped the machine; waits for an acknowledge.
    Faulted,
    /// The network is being brought down.
    ShuttingDown,
    /// Nothing is sent any more.
    Down,
    /// Joints are moved by hand. Behind the others, because the numbers of the states are shown by a pin.
    Jogging,
    /// Nothing may be sent any more: the cycle thread hung, and what it was about nobody knows. Drives stop by themselves for
    /// want of SoC; the control ends and has to be restarted.
    Silenced,
    /// Emergency stop: drives are stopped and without power; waits for a reset once the chain is closed.
    Estop,
    /// A program is held, and the machine is moved by hand or rests away from its path.
    Away,
    /// On the way back to where the program is held.
    Returning,
}

impl State {
    /// Whether drives are or should be under power.
    #[inline]
    pub fn is_under_command(self) -> bool {
        match self {
            State::Enabling
            | State::Ready
            | State::Homing
            | State::Jogging
            | State::Running
            | State::Held
            | State::Away
            | State::Returning
            | State::Stopping => true,
            State::Booting
            | State::Disabled
            | State::Disabling
            | State::Faulted
            | State::ShuttingDown
            | State::Down
            | State::Estop
            | State::Silenced => false,
        }
    }

    /// Whether programs in Structured Text may be replaced: nothing moves.
    pub fn may_replace_logic(self) -> bool {
        matches!(
            self,
            State::Booting | State::Disabled | State::Ready | State::Faulted | State::Estop
        )
    }

    /// All of them, by their numbers.
    pub const ALL: [State; 17] = [
        State::Booting,
        State::Disabled,
        State::Enabling,
        State::Ready,
        State::Homing,
        State::Running,
        State::Held,
        State::Stopping,
        State::Disabling,
        State::Faulted,
        State::ShuttingDown,
        State::Down,
        State::Jogging,
        State::Silenced,
        State::Estop,
        State::Away,
        State::Returning,
    ];

    /// The state of a number made by `as u8`.
    pub fn from_u8(number: u8) -> Option<State> {
        State::ALL.get(usize::from(number)).copied()
    }

    /// Word for the operator.
    pub fn name(self) -> &'static str {
        match self {
            State::Booting => "booting",
            State::Disabled => "disabled",
            State::Enabling => "enabling",
            State::Ready => "ready",
            State::Homing => "homing",
            State::Jogging => "jogging",
            State::Running => "running",
            State::Held => "held",
            State::Stopping => "stopping",
            State::Disabling => "disabling",
            State::Faulted => "faulted",
            State::ShuttingDown => "shutting down",
            State::Down => "down",
            State::Silenced => "silenced",
            State::Estop => "estop",
            State::Away => "away",
            State::Returning => "returning",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_states_are_one_to_one() {
        for number in 0..=u8::MAX {
            match State::from_u8(number) {
                Some(state) => assert_eq!(state as u8, number),
                None => assert!(usize::from(number) >= State::ALL.len()),
            }
        }
    }
}
