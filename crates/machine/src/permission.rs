//! What may be ordered when: the one table of orders and conditions.
//!
//! In:  what somebody wants, and how the machine is. Out: yes, or why not and what would help.
//!
//! Power, homing and what is going on are three independent facts. The page `docs/states.md` is made of this table.

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
    pub const ALL: [Wish; 21] = [
        Wish::On,
        Wish::Off,
        Wish::Estop,
        Wish::EstopReset,
        Wish::Acknowledge,
        Wish::Home,
        Wish::Jog,
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

/// Whether the machine can move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Power {
    /// The network is not up.
    Starting,
    /// Emergency stop, its chain still open.
    EstopOpen,
    /// Emergency stop, the chain closed again.
    Estop,
    /// A fault waits for an acknowledge.
    Alarm,
    /// Drives off.
    Off,
    /// Drives go on or off.
    Switching,
    /// Drives on.
    On,
    /// The control ends.
    Ending,
}

impl Power {
    /// All of them.
    pub const ALL: [Power; 8] = [
        Power::Starting,
        Power::EstopOpen,
        Power::Estop,
        Power::Alarm,
        Power::Off,
        Power::Switching,
        Power::On,
        Power::Ending,
    ];

    /// Word for the operator.
    pub const fn name(self) -> &'static str {
        match self {
            Power::Starting => "starting",
            Power::EstopOpen => "estop, chain open",
            Power::Estop => "estop",
            Power::Alarm => "alarm",
            Power::Off => "off",
            Power::Switching => "switching",
            Power::On => "on",
            Power::Ending => "ending",
        }
    }
}

/// What is going on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activity {
    /// Nothing.
    Idle,
    /// A program is read and checked.
    Checking,
    /// Joints home.
    Homing,
    /// Something is moved by hand.
    Jogging,
    /// A program or a line of MDI runs, or waits for something.
    Running,
    /// It rests on its path.
    Held,
    /// It is held, and the machine was moved away from its path by hand.
    Away,
    /// The machine returns to where it is held.
    Returning,
    /// It comes to rest and is given up.
    Stopping,
}

impl Activity {
    /// All of them.
    pub const ALL: [Activity; 9] = [
        Activity::Idle,
        Activity::Checking,
        Activity::Homing,
        Activity::Jogging,
        Activity::Running,
        Activity::Held,
        Activity::Away,
        Activity::Returning,
        Activity::Stopping,
    ];

    /// Word for the operator.
    pub const fn name(self) -> &'static str {
        match self {
            Activity::Idle => "idle",
            Activity::Checking => "checking",
            Activity::Homing => "homing",
            Activity::Jogging => "jogging",
            Activity::Running => "running",
            Activity::Held => "held",
            Activity::Away => "away",
            Activity::Returning => "returning",
            Activity::Stopping => "stopping",
        }
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

/// The next step where an alarm is what is in the way.
pub const ACKNOWLEDGE: &str = "isocnc alarm acknowledge";

/// Why an order is not carried out, and what would help.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// What is in the way.
    pub why: &'static str,
    /// The next step of the operator.
    pub next: &'static str,
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
    let refused = |why, next| Err(Refusal { why, next });
    let Condition { power, activity, .. } = *condition;
    if power == Power::Ending {
        return refused("the control is ending", "start it again with isocnc run");
    }
    if !condition.stands_by && !wish.is_for_one_program() {
        return refused(
            "this control was started for one program",
            "start it without a program to give it other orders",
        );
    }
    match wish {
        Wish::Estop | Wish::SingleBlock | Wish::OptionalStop => Ok(()),
        Wish::EstopReset => match power {
            // A latch may hold the chain open that a reset closes.
            Power::Estop | Power::EstopOpen => Ok(()),
            _ => refused("there is no emergency stop", "nothing has to be reset"),
        },
        Wish::Acknowledge => match power {
            Power::Alarm => Ok(()),
            Power::Estop | Power::EstopOpen => refused("emergency stop", "isocnc estop reset"),
            _ => refused(
                "there is nothing to acknowledge",
                "isocnc status tells how the machine is",
            ),
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
                Activity::Running => refused("a program runs", "isocnc hold, then jog"),
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
                false => refused("no program is loaded", "isocnc program load FILE"),
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
                "nothing runs that could be held",
                "isocnc status tells how the machine is",
            ),
        },
        // What it waits for decides then.
        Wish::Skip => match activity {
            Activity::Running => Ok(()),
            Activity::Held => refused(
                "a program is held in its path",
                "isocnc resume; isocnc skip leaves out waits only",
            ),
            _ => permit(Wish::Reverse, condition),
        },
        Wish::Resume | Wish::Reverse => match activity {
            Activity::Running | Activity::Held => Ok(()),
            Activity::Away if wish == Wish::Resume => Ok(()),
            Activity::Away => refused("the machine is away from the path", "isocnc resume returns to it"),
            Activity::Returning => refused("the machine returns to the path", "wait, or isocnc hold"),
            Activity::Stopping => refused("the program is being given up", "start it again"),
            _ => refused(
                "no program runs or is held",
                "isocnc program start, or isocnc program run FILE",
            ),
        },
        Wish::Stop => match (power, activity) {
            // Of a machine at rest, spindle and coolant.
            (Power::Switching | Power::On, _) => Ok(()),
            (_, Activity::Idle) => refused("there is nothing to stop", "isocnc off switches drives off"),
            _ => Ok(()),
        },
    }
}

/// Whether drives are on, or (`or_off`) can be switched on.
fn needs(condition: &Condition, or_off: bool) -> Result<(), Refusal> {
    let (why, next) = match condition.power {
        Power::On => return Ok(()),
        Power::Off if or_off => return Ok(()),
        Power::Off => ("drives are off", "isocnc on"),
        Power::Switching => ("drives are being switched", "wait until that is over"),
        Power::Starting if condition.network => ("the network is not operational yet", "isocnc bus state"),
        Power::Starting => ("the machine is still starting", "wait until that is over"),
        Power::EstopOpen => (
            "emergency stop, and the chain is open",
            "release the button that opened it, then isocnc estop reset",
        ),
        Power::Estop => ("emergency stop", "isocnc estop reset"),
        Power::Alarm => ("an alarm waits to be acknowledged", ACKNOWLEDGE),
        Power::Ending => ("the control is ending", "start it again with isocnc run"),
    };
    Err(Refusal { why, next })
}

fn is_homed(condition: &Condition) -> Result<(), Refusal> {
    match condition.homed {
        true => Ok(()),
        false => Err(Refusal {
            why: "not all joints are homed",
            next: "isocnc home",
        }),
    }
}

fn is_off_limits(condition: &Condition) -> Result<(), Refusal> {
    match condition.on_limit {
        false => Ok(()),
        true => Err(Refusal {
            why: "a limit switch is closed",
            next: "jog away from it; isocnc status names the joint",
        }),
    }
}

fn is_idle(activity: Activity) -> Result<(), Refusal> {
    let (why, next) = match activity {
        Activity::Idle => return Ok(()),
        Activity::Checking => ("a program is being checked", "wait, or isocnc stop"),
        Activity::Homing => ("joints are being homed", "wait, or isocnc stop"),
        Activity::Jogging => ("something is moved by hand", "let it come to rest"),
        Activity::Running => ("a program runs", "wait, or isocnc stop"),
        Activity::Held => ("a program is held", "isocnc resume, or isocnc stop"),
        Activity::Away => (
            "a program is held, away from its path",
            "isocnc resume returns to it, isocnc stop gives it up",
        ),
        Activity::Returning => ("the machine returns to the path", "wait, or isocnc stop"),
        Activity::Stopping => ("the machine comes to rest", "wait until it has"),
    };
    Err(Refusal { why, next })
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
                    Err(Refusal { why, next }) => {
                        refused += 1;
                        assert!(!why.is_empty() && !next.is_empty(), "{wish:?} {condition:?}");
                    }
                }
            }
        }
        assert_eq!(done + refused, 21 * 16 * 8 * 9);
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
                "isocnc estop reset" => condition.power = Power::Off,
                "isocnc on" => condition.power = Power::On,
                "isocnc home" => condition.homed = true,
                "isocnc program load FILE" => condition.loaded = true,
                _ => condition.power = Power::Estop,
            }
        }
        assert_eq!(permit(Wish::Start, &condition), Ok(()), "{steps:?}");
        assert_eq!(steps.len(), 5, "{steps:?}");
    }
}
