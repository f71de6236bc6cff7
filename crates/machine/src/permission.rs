//! What may be ordered when: the one table of orders and conditions.
//!
//! In:  what somebody wants, and how the machine is. Out: yes, or why not and what would help.
//!
//! Power, homing and what is going on are three independent facts. The page `docs/states.md` is made of this table.

use protocol::Message;
pub use protocol::{Activity, Next, Power};
use std::fmt;

/// What an operator may want.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wish {
    /// Drives on.
    On,
    /// To rest, then drives off.
    Off,
    /// Emergency stop.
    Estop,
    /// The emergency stop is over; switches nothing on.
    EstopReset,
    /// Motion may be ordered again after a fault; switches nothing on.
    Acknowledge,
    /// Home joints; drives go on first.
    Home,
    /// Move by hand.
    Jog,
    /// Switch spindle or coolant.
    ByHand,
    /// Run lines that are typed.
    Mdi,
    /// An axis shall read a value where it stands.
    TouchOff,
    /// Set an offset or the measures of a tool by value.
    Set,
    /// Check a program and keep it.
    Load,
    /// Run the program that is loaded.
    Start,
    /// All that it takes: drives on, joints home that are not, load, start.
    Run,
    /// To rest on the path; what runs is kept.
    Hold,
    /// Go on.
    Resume,
    /// Give up a block that waits.
    Skip,
    /// Go back along the path.
    Reverse,
    /// Rest at the end of each block, or not.
    SingleBlock,
    /// Stop at M1, or not.
    OptionalStop,
    /// Leave out lines that begin with /, or not.
    BlockDelete,
    /// To rest; what runs is given up, drives stay on.
    Stop,
}

impl Wish {
    /// All of them.
    pub const ALL: [Wish; 22] = [
        Wish::On,
        Wish::Off,
        Wish::Estop,
        Wish::EstopReset,
        Wish::Acknowledge,
        Wish::Home,
        Wish::Jog,
        Wish::ByHand,
        Wish::Mdi,
        Wish::TouchOff,
        Wish::Set,
        Wish::Load,
        Wish::Start,
        Wish::Run,
        Wish::Hold,
        Wish::Resume,
        Wish::Skip,
        Wish::Reverse,
        Wish::SingleBlock,
        Wish::OptionalStop,
        Wish::BlockDelete,
        Wish::Stop,
    ];

    /// What the journal has of an order.
    pub fn message(self) -> Message {
        let code = match self {
            Wish::On => "order.on",
            Wish::Off => "order.off",
            Wish::Estop => "order.estop",
            Wish::EstopReset => "order.estop_reset",
            Wish::Acknowledge => "order.acknowledge",
            Wish::Home => "order.home",
            Wish::Jog => "order.jog",
            Wish::ByHand => "order.by_hand",
            Wish::Mdi => "order.mdi",
            Wish::TouchOff => "order.touch_off",
            Wish::Set => "order.set",
            Wish::Load => "order.load",
            Wish::Start => "order.start",
            Wish::Run => "order.run",
            Wish::Hold => "order.hold",
            Wish::Resume => "order.resume",
            Wish::Skip => "order.skip",
            Wish::Reverse => "order.reverse",
            Wish::SingleBlock => "order.single_block",
            Wish::OptionalStop => "order.optional_stop",
            Wish::BlockDelete => "order.block_delete",
            Wish::Stop => "order.stop",
        };
        Message::new(code, format_args!("order: {}", self.command()), [])
    }

    /// The command that orders it.
    pub const fn command(self) -> &'static str {
        match self {
            Wish::On => "on",
            Wish::Off => "off",
            Wish::Estop => "estop",
            Wish::EstopReset => "estop reset",
            Wish::Acknowledge => "alarm acknowledge",
            Wish::Home => "home",
            Wish::Jog => "jog",
            Wish::ByHand => "spindle, coolant",
            Wish::Mdi => "mdi",
            Wish::TouchOff => "touch-off",
            Wish::Set => "offset set, tool set",
            Wish::Load => "program load",
            Wish::Start => "program start",
            Wish::Run => "program run",
            Wish::Hold => "hold",
            Wish::Resume => "resume",
            Wish::Skip => "skip",
            Wish::Reverse => "reverse",
            Wish::SingleBlock => "single-block",
            Wish::OptionalStop => "optional-stop",
            Wish::BlockDelete => "block-delete",
            Wish::Stop => "stop",
        }
    }

    /// Whether it is carried out by a control that was started for one program.
    fn is_for_one_program(self) -> bool {
        matches!(
            self,
            Wish::Hold
                | Wish::Resume
                | Wish::Skip
                | Wish::Reverse
                | Wish::SingleBlock
                | Wish::OptionalStop
                | Wish::Stop
                | Wish::Estop
        )
    }
}

/// How the machine is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Condition {
    /// The control waits for orders; else it was started for one program.
    pub stands_by: bool,
    /// Whether the machine can move.
    pub power: Power,
    /// The machine has a network, which starts before it can.
    pub network: bool,
    /// All joints know where they are.
    pub homed: bool,
    /// A limit switch is closed.
    pub on_limit: bool,
    /// What is going on.
    pub activity: Activity,
    /// There is a program to start.
    pub loaded: bool,
}

/// Why an order is not carried out, and what would help.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// Code of the message.
    code: &'static str,
    /// What is in the way.
    pub why: &'static str,
    /// The next step of the operator.
    pub next: Next,
}

impl Refusal {
    /// Both, for whoever has ordered.
    pub fn message(&self) -> Message {
        Message::new(self.code, self, [("next", self.next.message().into())])
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.why, self.next)
    }
}

/// Whether an order is carried out.
///
/// # Errors
/// Why it is not, and what would help.
pub fn permit(wish: Wish, condition: &Condition) -> Result<(), Refusal> {
    let refused = |code, why, next| Err(Refusal { code, why, next });
    let Condition { power, activity, .. } = *condition;
    if power == Power::Ending {
        return refused("refused.ending", "the control is ending", Next::RunControl);
    }
    if !condition.stands_by && !wish.is_for_one_program() {
        return refused(
            "refused.one_program",
            "this control was started for one program",
            Next::RunWithoutProgram,
        );
    }
    match wish {
        Wish::Estop | Wish::SingleBlock | Wish::OptionalStop => Ok(()),
        Wish::EstopReset => match power {
            // A latch may hold the chain open that a reset closes.
            Power::Estop | Power::EstopOpen => Ok(()),
            _ => refused("refused.no_estop", "there is no emergency stop", Next::Nothing),
        },
        Wish::Acknowledge => match power {
            Power::Alarm => Ok(()),
            Power::Estop | Power::EstopOpen => refused("refused.estop", "emergency stop", Next::ResetEstop),
            _ => refused("refused.no_alarm", "there is nothing to acknowledge", Next::Status),
        },
        Wish::On => match power {
            // They are, and nothing is in its way.
            Power::On => is_idle(activity),
            _ => needs(condition, true),
        },
        // At rest and without power is what is wanted.
        Wish::Off => match power {
            Power::Switching | Power::Off | Power::On | Power::Alarm | Power::Estop | Power::EstopOpen => Ok(()),
            Power::Starting | Power::Ending => needs(condition, true),
        },
        Wish::Home => needs(condition, true).and_then(|()| is_idle(activity)),
        Wish::Run => {
            needs(condition, true)?;
            is_off_limits(condition)?;
            is_idle(activity)
        }
        Wish::Jog => {
            needs(condition, false)?;
            match activity {
                Activity::Jogging | Activity::Held | Activity::Away => Ok(()),
                Activity::Running => refused("refused.running", "a program runs", Next::HoldThenJog),
                _ => is_idle(activity),
            }
        }
        // What a program that runs waits for decides then.
        Wish::ByHand => {
            needs(condition, false)?;
            match activity {
                Activity::Jogging | Activity::Held | Activity::Away | Activity::Running => Ok(()),
                _ => is_idle(activity),
            }
        }
        Wish::Mdi => {
            needs(condition, false)?;
            is_homed(condition)?;
            is_off_limits(condition)?;
            is_idle(activity)
        }
        Wish::Start => {
            needs(condition, false)?;
            is_homed(condition)?;
            is_off_limits(condition)?;
            is_idle(activity)?;
            match condition.loaded {
                true => Ok(()),
                false => refused("refused.not_loaded", "no program is loaded", Next::LoadProgram),
            }
        }
        Wish::TouchOff => is_homed(condition).and_then(|()| is_idle(activity)),
        // What is under way has been checked with the lines that it leaves out.
        Wish::Set | Wish::BlockDelete => is_idle(activity),
        Wish::Load => match activity {
            Activity::Idle | Activity::Homing | Activity::Jogging => Ok(()),
            _ => is_idle(activity),
        },
        Wish::Hold => match activity {
            Activity::Running | Activity::Jogging | Activity::Held | Activity::Away | Activity::Returning => Ok(()),
            _ => refused(
                "refused.nothing_to_hold",
                "nothing runs that could be held",
                Next::Status,
            ),
        },
        // What it waits for decides then.
        Wish::Skip => match activity {
            Activity::Running => Ok(()),
            Activity::Held => refused("refused.held_in_path", "a program is held in its path", Next::Resume),
            _ => permit(Wish::Reverse, condition),
        },
        Wish::Resume | Wish::Reverse => match activity {
            Activity::Running | Activity::Held => Ok(()),
            Activity::Away if wish == Wish::Resume => Ok(()),
            Activity::Away => refused("refused.away", "the machine is away from the path", Next::Return),
            Activity::Returning => refused("refused.returning", "the machine returns to the path", Next::WaitOrHold),
            Activity::Stopping => refused("refused.given_up", "the program is being given up", Next::StartAgain),
            _ => refused(
                "refused.no_program_runs",
                "no program runs or is held",
                Next::StartProgram,
            ),
        },
        Wish::Stop => match (power, activity) {
            // Of a machine at rest, spindle and coolant.
            (Power::Switching | Power::On, _) => Ok(()),
            (_, Activity::Idle) => refused("refused.nothing_to_stop", "there is nothing to stop", Next::PowerOff),
            _ => Ok(()),
        },
    }
}

/// Whether drives are on, or (`or_off`) can be switched on.
fn needs(condition: &Condition, or_off: bool) -> Result<(), Refusal> {
    let (code, why, next) = match condition.power {
        Power::On => return Ok(()),
        Power::Off if or_off => return Ok(()),
        Power::Off => ("refused.drives_off", "drives are off", Next::PowerOn),
        Power::Switching => ("refused.switching", "drives are being switched", Next::Wait),
        Power::Starting if condition.network => {
            ("refused.network", "the network is not operational yet", Next::BusState)
        }
        Power::Starting => ("refused.starting", "the machine is still starting", Next::Wait),
        Power::EstopOpen => (
            "refused.estop_open",
            "emergency stop, and the chain is open",
            Next::CloseChain,
        ),
        Power::Estop => ("refused.estop", "emergency stop", Next::ResetEstop),
        Power::Alarm => ("refused.alarm", "an alarm waits to be acknowledged", Next::Acknowledge),
        Power::Ending => ("refused.ending", "the control is ending", Next::RunControl),
    };
    Err(Refusal { code, why, next })
}

fn is_homed(condition: &Condition) -> Result<(), Refusal> {
    match condition.homed {
        true => Ok(()),
        false => Err(Refusal {
            code: "refused.not_homed",
            why: "not all joints are homed",
            next: Next::Home,
        }),
    }
}

fn is_off_limits(condition: &Condition) -> Result<(), Refusal> {
    match condition.on_limit {
        false => Ok(()),
        true => Err(Refusal {
            code: "refused.on_limit",
            why: "a limit switch is closed",
            next: Next::JogOffSwitch,
        }),
    }
}

fn is_idle(activity: Activity) -> Result<(), Refusal> {
    let (code, why, next) = match activity {
        Activity::Idle => return Ok(()),
        Activity::Checking => ("refused.checking", "a program is being checked", Next::WaitOrStop),
        Activity::Homing => ("refused.homing", "joints are being homed", Next::WaitOrStop),
        Activity::Jogging => ("refused.jogging", "something is moved by hand", Next::LetRest),
        Activity::Running => ("refused.running", "a program runs", Next::WaitOrStop),
        Activity::Held => ("refused.held", "a program is held", Next::ResumeOrStop),
        Activity::Away => (
            "refused.held_away",
            "a program is held, away from its path",
            Next::ReturnOrStop,
        ),
        Activity::Returning => ("refused.returning", "the machine returns to the path", Next::WaitOrStop),
        Activity::Stopping => ("refused.stopping", "the machine comes to rest", Next::WaitForRest),
    };
    Err(Refusal { code, why, next })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every condition there is.
    fn conditions() -> impl Iterator<Item = Condition> {
        let bits = (0..16_u8).map(|bits| [0, 1, 2, 3].map(|bit| bits >> bit & 1 == 1));
        bits.flat_map(|[stands_by, homed, loaded, on_limit]| {
            Power::ALL.into_iter().flat_map(move |power| {
                Activity::ALL.into_iter().map(move |activity| Condition {
                    stands_by,
                    power,
                    network: true,
                    homed,
                    on_limit,
                    activity,
                    loaded,
                })
            })
        })
    }

    #[test]
    fn every_order_in_every_condition_is_carried_out_or_refused_with_the_next_step() {
        let (mut done, mut refused) = (0, 0);
        for condition in conditions() {
            for wish in Wish::ALL {
                match permit(wish, &condition) {
                    Ok(()) => done += 1,
                    Err(Refusal { why, next, .. }) => {
                        refused += 1;
                        assert!(!why.is_empty() && !next.name().is_empty(), "{wish:?} {condition:?}");
                    }
                }
            }
        }
        assert_eq!(done + refused, 22 * 16 * 8 * 9);
        assert!(done > 1000 && refused > 1000, "{done} {refused}");
    }

    #[test]
    fn nothing_is_set_in_motion_without_power_an_acknowledge_and_a_known_place() {
        for condition in conditions() {
            let allowed = |wish| permit(wish, &condition).is_ok();
            for wish in [Wish::Jog, Wish::Mdi, Wish::Start] {
                assert!(!allowed(wish) || condition.power == Power::On, "{wish:?} {condition:?}");
            }
            for wish in [Wish::Home, Wish::Run, Wish::On] {
                let can_be_on = matches!(condition.power, Power::On | Power::Off);
                assert!(!allowed(wish) || can_be_on, "{wish:?} {condition:?}");
            }
            for wish in [Wish::Mdi, Wish::Start, Wish::TouchOff] {
                assert!(!allowed(wish) || condition.homed, "{wish:?} {condition:?}");
            }
        }
    }

    #[test]
    fn whatever_can_move_can_be_stopped_and_an_emergency_stop_always_be_made() {
        for condition in conditions().filter(|condition| condition.power != Power::Ending) {
            assert_eq!(permit(Wish::Estop, &condition), Ok(()));
            if condition.activity != Activity::Idle {
                assert_eq!(permit(Wish::Stop, &condition), Ok(()), "{condition:?}");
            }
            if condition.stands_by && condition.power == Power::On {
                assert_eq!(permit(Wish::Off, &condition), Ok(()), "{condition:?}");
            }
        }
    }

    #[test]
    fn nobody_is_sent_to_a_network_that_is_not_there() {
        for condition in conditions().map(|condition| Condition {
            network: false,
            ..condition
        }) {
            for refusal in Wish::ALL.into_iter().filter_map(|wish| permit(wish, &condition).err()) {
                let said = refusal.to_string();
                assert!(!said.contains("network") && !said.contains("isocnc bus"), "{said}");
            }
        }
    }

    #[test]
    fn whoever_follows_the_next_step_gets_on() {
        let mut condition = Condition {
            stands_by: true,
            power: Power::EstopOpen,
            network: true,
            homed: false,
            on_limit: false,
            activity: Activity::Idle,
            loaded: false,
        };
        let mut steps = Vec::new();
        for _ in 0..6 {
            let Err(refusal) = permit(Wish::Start, &condition) else {
                break;
            };
            steps.push(refusal.next);
            match refusal.next {
                Next::ResetEstop => condition.power = Power::Off,
                Next::PowerOn => condition.power = Power::On,
                Next::Home => condition.homed = true,
                Next::LoadProgram => condition.loaded = true,
                _ => condition.power = Power::Estop,
            }
        }
        assert_eq!(permit(Wish::Start, &condition), Ok(()), "{steps:?}");
        assert_eq!(steps.len(), 5, "{steps:?}");
    }
}
