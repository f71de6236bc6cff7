//! Orders that take their time: given, and waited for.
//!
//! In:  an order; what the control tells of itself. Out: a status line meanwhile, one line and the exit code at the end.

use super::{ControlArgs, GOES_ON, OrderArgs, connect, print, warn};
use anyhow::Context;
use api::client::{Client, ClientError};
use host::signals::{StopSignal, exit_code};
use host::terminal::{self, StatusLine};
use machine::faults::silenced;
use protocol::params::NoParams;
use protocol::{Activity, Method, Mode, Outcome, State, Status, Step, method};
use serde::Serialize;
use serde_json::json;
use std::process::ExitCode;
use std::time::Duration;

/// Between two looks while an order is carried out.
pub(super) const LOOK: Duration = Duration::from_millis(50);
/// Pause between two lines about it where the output is no terminal.
const PAUSE: Duration = Duration::from_secs(5);

/// An order that takes its time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lasting {
    /// Switches drives on.
    On,
    /// To rest, then switches drives off.
    Off,
    /// Homes joints.
    Home,
    /// Comes to rest on the path, gives the program up.
    Stop,
    /// Runs a program.
    Program,
    /// Runs a line of G-code.
    Mdi,
    /// Comes to rest on the path, keeps the program.
    Hold,
    /// Goes on after a hold; away from the path, returns to it.
    Return,
}

/// What whoever has given an order is told when it has begun.
pub(super) struct Words {
    pub(super) text: String,
    /// What he should know of it.
    pub(super) warning: Option<String>,
}

impl Words {
    pub(super) fn new(text: &str) -> Words {
        Words {
            text: text.to_owned(),
            warning: None,
        }
    }
}

/// Gives an order, and waits until it is carried out if that is wanted.
pub(super) fn give<M: Method>(
    args: &OrderArgs,
    order: Lasting,
    params: &M::Params,
    words: impl FnOnce(&M::Answer) -> Words,
) -> anyhow::Result<ExitCode> {
    give_by(args, order, |client| Ok(client.ask::<M>(params)?), words)
}

/// The same, where more than one thing has to be asked.
pub(super) fn give_by<A: Serialize>(
    args: &OrderArgs,
    order: Lasting,
    begin: impl FnOnce(&mut Client) -> anyhow::Result<A>,
    words: impl FnOnce(&A) -> Words,
) -> anyhow::Result<ExitCode> {
    let signal = StopSignal::install().context("signals")?;
    let mut client = connect(&args.control)?;
    let cancel = signal.cancel().clone();
    client.wait_unless(Some(Box::new(move || cancel.is_cancelled())));
    let begun = begin(&mut client);
    client.wait_unless(None);
    let begun = match (begun, signal.caught()) {
        (Err(error), Some(signal)) if matches!(error.downcast_ref(), Some(ClientError::GivenUp)) => {
            print(&args.control, &json!({}), "given up before it began");
            return Ok(ExitCode::from(exit_code(signal)));
        }
        (begun, _) => begun?,
    };
    let Words { text: words, warning } = words(&begun);
    warn(&args.control, warning.as_deref());
    if args.no_wait {
        print(&args.control, &begun, &words);
        return Ok(ExitCode::SUCCESS);
    }
    if !args.control.json && order == Lasting::Program {
        terminal::say(&format!("{words}\n"));
    }
    wait(&mut client, &args.control, order, &signal)
}

/// Waits until an order is carried out. Exit code 1: it was not.
pub(super) fn wait(
    client: &mut Client,
    args: &ControlArgs,
    order: Lasting,
    signal: &StopSignal,
) -> anyhow::Result<ExitCode> {
    let mut line = StatusLine::new("{wide_msg}", PAUSE, args.json);
    loop {
        let status = match client.ask::<method::Status>(&NoParams {}) {
            Ok(status) => status,
            // A control that was started for one program ends with it.
            Err(_) if order == Lasting::Stop => {
                drop(line);
                print(
                    args,
                    &json!({ "step": Step::Done, "state": State::Down }),
                    "at rest, drives are off",
                );
                return Ok(ExitCode::SUCCESS);
            }
            Err(error) => return Err(error.into()),
        };
        if let Some(end) = end_of(order, &status) {
            drop(line);
            let (words, code) = match end {
                Ok(words) => (words, ExitCode::SUCCESS),
                Err(words) => (words, ExitCode::FAILURE),
            };
            print(args, &status, &words);
            return Ok(code);
        }
        if let Some(signal) = signal.caught() {
            drop(line);
            print(
                args,
                &status,
                "not waited for any longer; the control goes on: isocnc status, isocnc stop",
            );
            return Ok(ExitCode::from(exit_code(signal)));
        }
        if line.is_due() {
            let words = on_the_way(&status);
            line.show(|bar| bar.set_message(files::printed::plain(&words)), || words.clone());
        }
        std::thread::sleep(LOOK);
    }
}

/// What came of an order: done, or why not; `None`: neither yet.
fn end_of(order: Lasting, status: &Status) -> Option<Result<String, String>> {
    let (step, state) = (status.step, status.state);
    if state == State::Silenced {
        return Some(Err(terminal::alarm(silenced(false, false).text).to_string()));
    }
    // A control that was started for one program ends with it.
    let is_over = step == Step::Done;
    let job = status.job;
    // Comes a moment behind the state: whoever looks next shall not be told of what is over.
    let activity = status.activity;
    let lasts = match order {
        // What waits rests as well.
        Lasting::Hold => match state {
            State::Running => status.waiting.is_none(),
            _ => state == State::Held && activity == Activity::Running,
        },
        Lasting::Return => state == State::Returning || state == State::Held && activity == Activity::Returning,
        // There may never have been a job: a program that was being checked is none yet. Nothing is taken before it is no longer stopping.
        Lasting::Stop => !is_over && (step != Step::StandingBy || activity == Activity::Stopping),
        _ => job.is_none() && !is_over,
    };
    if lasts {
        return None;
    }
    let drives = match state {
        State::Ready | State::Jogging => "drives are on",
        _ => "drives are off",
    };
    let alarm = status.alarm.as_ref();
    let failed = |words: String| {
        let alarm = alarm.map(|cause| terminal::alarm(format!("alarm: {cause}")).to_string());
        Some(Err(alarm.unwrap_or(words)))
    };
    match order {
        Lasting::Off if matches!(state, State::Ready | State::Jogging) => None,
        Lasting::Stop if matches!(state, State::Jogging | State::Stopping) => None,
        Lasting::Off | Lasting::Stop => Some(Ok(format!("at rest, {drives}"))),
        Lasting::Hold => match state {
            State::Running | State::Held | State::Away => Some(Ok(format!("at rest on the path; {GOES_ON}"))),
            // Of a jog.
            State::Ready | State::Jogging => Some(Ok("comes to rest".into())),
            _ => failed(format!("no program is held: the machine is {state} ({step})")),
        },
        Lasting::Return => match state {
            State::Held => Some(Ok(format!("on the path again; {GOES_ON}"))),
            _ => failed(format!("not back on the path: the machine is {state} ({step})")),
        },
        Lasting::On | Lasting::Home | Lasting::Program | Lasting::Mdi => match job {
            Some(Outcome::Completed) => Some(Ok(match order {
                Lasting::Home => format!("homed; {drives}"),
                Lasting::Program | Lasting::Mdi => format!("completed; {drives}"),
                Lasting::On | Lasting::Off | Lasting::Stop | Lasting::Hold | Lasting::Return => drives.to_owned(),
            })),
            Some(Outcome::Stopped) => failed(format!("stopped before its end; {drives}")),
            _ => failed(format!("given up: the machine is {state} ({step})")),
        },
    }
}

/// How far an order is, as one line.
fn on_the_way(status: &Status) -> String {
    if let Some(waiting) = &status.waiting {
        return format!("waits: {}; {}", waiting.what, waiting.release);
    }
    match (status.step, status.mode, &status.program) {
        (Step::Program, Mode::Mdi, _) => status.state.to_string(),
        (Step::Program, _, Some(program)) => format!("line {} of {}  {}", status.line, program.lines, status.state),
        (Step::Program, _, None) => format!("line {}  {}", status.line, status.state),
        (step, _, _) => step.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whoever_waits_hears_that_the_control_is_silenced() {
        for order in [Lasting::On, Lasting::Home, Lasting::Stop, Lasting::Program] {
            let status = Status {
                step: Step::Program,
                state: State::Silenced,
                ..Status::default()
            };
            let ended = end_of(order, &status);
            let said = ended.expect("an end").expect_err("no success");
            assert_eq!(console::strip_ansi_codes(&said), silenced(false, false).text);
        }
    }

    #[test]
    fn an_order_ends_when_it_is_carried_out_or_has_failed() {
        let status = |step: Step, state: State, job: Option<Outcome>| Status {
            step,
            state,
            job,
            ..Status::default()
        };
        let end = |order, step, state, job| {
            let end = end_of(order, &status(step, state, job))?;
            Some(end.map_err(|said| console::strip_ansi_codes(&said).into_owned()))
        };
        let by = Step::StandingBy;
        let done = |said: &str| Some(Ok(said.to_owned()));
        let failed = |said: &str| Some(Err(said.to_owned()));
        assert_eq!(end(Lasting::On, Step::SwitchingOn, State::Enabling, None), None);
        assert_eq!(
            end(Lasting::On, by, State::Ready, Some(Outcome::Completed)),
            done("drives are on")
        );
        assert_eq!(end(Lasting::Home, Step::Homing, State::Ready, None), None);
        assert_eq!(
            end(Lasting::Home, by, State::Ready, Some(Outcome::Completed)),
            done("homed; drives are on")
        );
        assert_eq!(
            end(Lasting::Home, by, State::Disabled, Some(Outcome::Stopped)),
            failed("stopped before its end; drives are off")
        );
        assert_eq!(end(Lasting::Off, by, State::Ready, Some(Outcome::Completed)), None);
        assert_eq!(
            end(Lasting::Off, by, State::Disabled, Some(Outcome::Completed)),
            done("at rest, drives are off")
        );
        assert_eq!(
            end(Lasting::Stop, by, State::Ready, Some(Outcome::Stopped)),
            done("at rest, drives are on")
        );
        let mut ends = status(by, State::Ready, Some(Outcome::Stopped));
        ends.activity = Activity::Stopping;
        assert_eq!(end_of(Lasting::Stop, &ends), None, "the next order would be refused");
        assert_eq!(
            end(Lasting::Stop, Step::Done, State::Down, None),
            done("at rest, drives are off")
        );
        assert_eq!(end(Lasting::Program, Step::Program, State::Running, None), None);
        assert_eq!(
            end(Lasting::Program, by, State::Ready, Some(Outcome::Completed)),
            done("completed; drives are on")
        );
        assert_eq!(
            end(Lasting::On, by, State::Disabled, Some(Outcome::TimedOut)),
            failed("given up: the machine is disabled (standing by)")
        );
        for (order, before) in [
            (Lasting::Hold, Activity::Running),
            (Lasting::Return, Activity::Returning),
        ] {
            let mut behind = status(Step::Program, State::Held, None);
            behind.activity = before;
            assert_eq!(end_of(order, &behind), None);
            behind.activity = Activity::Held;
            assert!(end_of(order, &behind).is_some_and(|end| end.is_ok()));
        }
        let mut over = status(by, State::Faulted, Some(Outcome::Faulted));
        over.alarm = Some("x-drive lost".into());
        let said = end_of(Lasting::Program, &over)
            .and_then(Result::err)
            .unwrap_or_default();
        assert_eq!(console::strip_ansi_codes(&said), "alarm: x-drive lost");
    }
}
