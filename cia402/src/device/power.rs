//! The power state machine of a drive: transitions 0 to 16 of the profile.
//!
//! In:  the controlword, and what happens inside the drive (faults, ends of stops, time).
//! Out: the state. How the motor is stopped on the way is [`super::Device`]'s business.

use crate::profile::{Command, State};

/// (number, from, command, to): the transitions that a command in object 6040 causes. Fault reset stands for its rising edge.
const TRANSITIONS: [(u8, State, Command, State); 16] = [
    (2, State::SwitchOnDisabled, Command::Shutdown, State::ReadyToSwitchOn),
    (3, State::ReadyToSwitchOn, Command::SwitchOn, State::SwitchedOn),
    (3, State::ReadyToSwitchOn, Command::EnableOperation, State::SwitchedOn),
    (4, State::SwitchedOn, Command::EnableOperation, State::OperationEnabled),
    (5, State::OperationEnabled, Command::SwitchOn, State::SwitchedOn),
    (6, State::SwitchedOn, Command::Shutdown, State::ReadyToSwitchOn),
    (
        7,
        State::ReadyToSwitchOn,
        Command::DisableVoltage,
        State::SwitchOnDisabled,
    ),
    (7, State::ReadyToSwitchOn, Command::QuickStop, State::SwitchOnDisabled),
    (8, State::OperationEnabled, Command::Shutdown, State::ReadyToSwitchOn),
    (
        9,
        State::OperationEnabled,
        Command::DisableVoltage,
        State::SwitchOnDisabled,
    ),
    (10, State::SwitchedOn, Command::DisableVoltage, State::SwitchOnDisabled),
    (10, State::SwitchedOn, Command::QuickStop, State::SwitchOnDisabled),
    (11, State::OperationEnabled, Command::QuickStop, State::QuickStopActive),
    (
        12,
        State::QuickStopActive,
        Command::DisableVoltage,
        State::SwitchOnDisabled,
    ),
    (15, State::Fault, Command::FaultReset, State::SwitchOnDisabled),
    (
        16,
        State::QuickStopActive,
        Command::EnableOperation,
        State::OperationEnabled,
    ),
];

/// The transition, by number and end state, that a command causes in a state.
pub fn transition(state: State, command: Command) -> Option<(u8, State)> {
    TRANSITIONS
        .iter()
        .find(|row| row.1 == state && row.2 == command)
        .map(|row| (row.0, row.3))
}

/// How long each transition takes, ns, by its number. Number 0 is the time to NOT READY, 1 the self-test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Delays(pub [u32; 17]);

impl Default for Delays {
    /// A quick servo: 20 ms of self-test, 5 ms to switch on, 10 ms to magnetise and lift the brake.
    fn default() -> Self {
        let mut delays = [0; 17];
        delays[1] = 20_000_000;
        delays[3] = 5_000_000;
        delays[4] = 10_000_000;
        Delays(delays)
    }
}

/// A transition under way.
#[derive(Clone, Copy, Debug)]
struct Pending {
    to: State,
    left_ns: u32,
}

/// State of the power section.
#[derive(Clone, Copy, Debug)]
pub(super) struct Power {
    state: State,
    pending: Option<Pending>,
    delays: Delays,
    reset_bit: bool,
}

impl Power {
    pub(super) fn new(delays: Delays) -> Power {
        let left_ns = delays.0[0].saturating_add(delays.0[1]);
        let pending = Some(Pending {
            to: State::SwitchOnDisabled,
            left_ns,
        });
        Power {
            state: State::NotReadyToSwitchOn,
            pending,
            delays,
            reset_bit: true,
        }
    }

    /// Off and on again.
    pub(super) fn restart(&mut self) {
        *self = Power::new(self.delays);
    }

    /// One that is under way goes on as it began.
    pub(super) fn set_delays(&mut self, delays: Delays) {
        self.delays = delays;
    }

    pub(super) fn state(&self) -> State {
        self.state
    }

    /// The transition that a controlword asks for now; none while another one is under way. Watches the edge of bit 7.
    pub(super) fn requested_transition(&mut self, controlword: u16) -> Option<(u8, State)> {
        let reset_bit = controlword & Command::FaultReset as u16 != 0;
        let edge = reset_bit && !self.reset_bit;
        self.reset_bit = reset_bit;
        if self.pending.is_some() || (reset_bit && !edge) {
            return None;
        }
        transition(self.state, Command::from_controlword(controlword))
    }

    /// Starts a transition; without a delay it is done at once. One that is under way already goes on.
    pub(super) fn start_transition(&mut self, number: u8, to: State) {
        if self.pending.is_some_and(|pending| pending.to == to) {
            return;
        }
        let left_ns = self.delays.0.get(usize::from(number)).copied().unwrap_or(0);
        if left_ns == 0 {
            self.enter(to);
        } else {
            self.pending = Some(Pending { to, left_ns });
        }
    }

    /// Lets time pass; true when a transition has come to its end.
    pub(super) fn advance(&mut self, period_ns: u32) -> bool {
        match &mut self.pending {
            Some(pending) if pending.left_ns <= period_ns => {
                let to = pending.to;
                self.enter(to);
                true
            }
            Some(pending) => {
                pending.left_ns -= period_ns;
                false
            }
            None => false,
        }
    }

    fn enter(&mut self, state: State) {
        self.state = state;
        self.pending = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The profile's table by number, as text: from, to.
    #[test]
    fn the_table_holds_every_commanded_transition_of_the_profile() {
        use State::*;
        let expected = [
            (2, SwitchOnDisabled, ReadyToSwitchOn),
            (3, ReadyToSwitchOn, SwitchedOn),
            (4, SwitchedOn, OperationEnabled),
            (5, OperationEnabled, SwitchedOn),
            (6, SwitchedOn, ReadyToSwitchOn),
            (7, ReadyToSwitchOn, SwitchOnDisabled),
            (8, OperationEnabled, ReadyToSwitchOn),
            (9, OperationEnabled, SwitchOnDisabled),
            (10, SwitchedOn, SwitchOnDisabled),
            (11, OperationEnabled, QuickStopActive),
            (12, QuickStopActive, SwitchOnDisabled),
            (15, Fault, SwitchOnDisabled),
            (16, QuickStopActive, OperationEnabled),
        ];
        for (number, from, to) in expected {
            assert!(
                TRANSITIONS
                    .iter()
                    .any(|row| (row.0, row.1, row.3) == (number, from, to)),
                "{number}"
            );
        }
        for (number, from, _, to) in TRANSITIONS {
            assert!(expected.contains(&(number, from, to)), "{number}");
        }
        assert_eq!(transition(SwitchOnDisabled, Command::EnableOperation), None);
        assert_eq!(transition(FaultReactionActive, Command::DisableVoltage), None);
    }

    #[test]
    fn the_reset_bit_acts_on_its_edge_only() {
        let mut power = Power::new(Delays([0; 17]));
        power.advance(0);
        power.start_transition(13, State::FaultReactionActive);
        power.start_transition(14, State::Fault);
        assert_eq!(
            power.requested_transition(0x0080),
            None,
            "the bit must have been seen as 0"
        );
        assert_eq!(power.requested_transition(0x0000), None);
        assert_eq!(power.requested_transition(0x0080), Some((15, State::SwitchOnDisabled)));
        assert_eq!(power.requested_transition(0x0080), None);
    }

    #[test]
    fn delays_hold_the_old_state() {
        let mut power = Power::new(Delays([2_000_000; 17]));
        let states: [State; 5] = core::array::from_fn(|_| {
            power.advance(1_000_000);
            power.state()
        });
        assert_eq!(states[2], State::NotReadyToSwitchOn, "transitions 0 and 1 take 4 ms");
        assert_eq!(states[3], State::SwitchOnDisabled);
        power.start_transition(2, State::ReadyToSwitchOn);
        assert_eq!(power.requested_transition(0x0006), None, "one at a time");
        assert!(!power.advance(1_000_000));
        assert!(power.advance(1_000_000));
        assert_eq!(power.state(), State::ReadyToSwitchOn);
    }
}
