//! What a program waits for, between it and the cycle thread: how a probing move ended, what an input read (M66), how
//! a code of the user ended (M100 to M199).
//!
//! In:  results of the cycle thread, machine coordinates.
//! Out: answers to the interpreter, work coordinates.
//!
//! A program that is only looked at has nobody to wait for: its probing moves touch something at their very end, and its inputs
//! come as they are waited for. So loops that probe until they touch come to an end, and what follows a touch is seen.

use super::user_code::UserCode;
use config::UserCodes;
use motion::canon::{Call, Input, Position, ProbeEnd, ProbeMode, WaitMode};
use motion::rt::probe::Answer;
use std::sync::{Arc, Mutex, PoisonError, mpsc};

/// The line from the interpolation to the program.
pub fn line() -> (rtrb::Producer<Answer>, rtrb::Consumer<Answer>) {
    // The program goes on only once it has read the answer.
    rtrb::RingBuffer::new(1)
}

/// An answer to the interpreter.
#[derive(Clone, Debug)]
pub(super) enum Told {
    /// How a probing move ended, work coordinates.
    Probed(gcode::Probed),
    /// What an input read; `None`: the time ran out.
    Input(Option<f64>),
    /// How a code of the user ended.
    User(Result<(), String>),
}

/// Where answers to the interpreter come from; nobody gives any: `None`.
type Answered = Arc<Mutex<Option<mpsc::Receiver<Told>>>>;

/// The machine as the interpreter sees it: what it asks is answered as it was told, and all else as planned.
pub(super) struct Asked(Answered);

impl Asked {
    /// Waits for the answer; `None`: nobody gives one, or nobody wants to know any more.
    fn told(&self) -> Option<Told> {
        let answered = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        answered.as_ref().and_then(|answers| answers.recv().ok())
    }
}

impl gcode::Machine for Asked {
    fn probed(&mut self, _: Position, to: Position, _: ProbeMode) -> Option<gcode::Probed> {
        match self.told() {
            Some(Told::Probed(probed)) => Some(probed),
            Some(Told::Input(_) | Told::User(_)) | None => Some(gcode::Probed {
                end: ProbeEnd::Tripped,
                at: to,
                rest: to,
            }),
        }
    }

    fn waited(&mut self, _: Input, mode: WaitMode, _: f64) -> Option<f64> {
        match self.told() {
            Some(Told::Input(read)) => read,
            Some(Told::Probed(_) | Told::User(_)) | None => match mode {
                WaitMode::Rise | WaitMode::High => Some(1.0),
                WaitMode::Immediate | WaitMode::Fall | WaitMode::Low => Some(0.0),
            },
        }
    }

    fn user_code_ended(&mut self, _: u8, _: f64, _: f64) -> Result<(), String> {
        match self.told() {
            Some(Told::User(ended)) => ended,
            Some(Told::Probed(_) | Told::Input(_)) | None => Ok(()),
        }
    }
}

/// What a program waits for behind a call.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Awaited {
    /// The end of a probing move.
    Probe,
    /// An input (M66).
    Input,
    /// The program of a code of the user, once the machine rests there.
    UserCode {
        /// 100 to 199.
        number: u8,
        /// P, -1 if it is not there.
        p: f64,
        /// Q, -1 if it is not there.
        q: f64,
    },
}

/// What has become of what was waited for.
#[derive(Debug)]
pub(super) enum Known {
    /// The machine has answered.
    Machine(Answer),
    /// A code of the user has ended.
    User(Result<(), String>),
}

/// What the interpreter asks behind a call before it goes on.
pub(super) fn awaited_behind(call: &Call) -> Option<Awaited> {
    match call {
        Call::StraightProbe { .. } => Some(Awaited::Probe),
        Call::WaitInput { .. } => Some(Awaited::Input),
        &Call::UserCode { number, p, q } => Some(Awaited::UserCode { number, p, q }),
        _ => None,
    }
}

/// Who answers the interpreter.
pub(super) struct Answers(mpsc::Sender<Told>);

impl Answers {
    /// To be told once for each call behind which it asks, before it is asked for what follows.
    pub(super) fn send(&self, told: Told) {
        // The interpreter may have come to its end.
        let _ = self.0.send(told);
    }
}

/// What one program waits for.
pub(super) struct Waits {
    results: Option<rtrb::Consumer<Answer>>,
    answered: Answered,
    awaited: Option<Awaited>,
    codes: UserCodes,
    /// Runs in this moment.
    user_code: Option<UserCode>,
    probed: bool,
}

impl Waits {
    /// Of a program that is only looked at; and what its interpreter asks.
    pub(super) fn new(codes: UserCodes) -> (Waits, Asked) {
        let answered = Answered::default();
        let asked = Asked(Arc::clone(&answered));
        let waits = Waits {
            results: None,
            answered,
            awaited: None,
            codes,
            user_code: None,
            probed: false,
        };
        (waits, asked)
    }

    /// Of a program that runs.
    pub(super) fn wait_for(&mut self, results: rtrb::Consumer<Answer>) -> Answers {
        let (sender, receiver) = mpsc::channel();
        *self.answered.lock().unwrap_or_else(PoisonError::into_inner) = Some(receiver);
        self.results = Some(results);
        Answers(sender)
    }

    /// What is to be waited for goes to the machine; whether its end has to be awaited.
    pub(super) fn begin(&mut self, awaited: Awaited) -> bool {
        self.probed |= awaited == Awaited::Probe;
        self.awaited = self.results.is_some().then_some(awaited);
        self.awaited.is_some()
    }

    /// What is waited for.
    pub(super) fn awaited(&self) -> Option<Awaited> {
        self.awaited
    }

    /// What came of it, once that is known; then nothing is waited for any more.
    pub(super) fn receive(&mut self) -> Option<Known> {
        let known = match &mut self.user_code {
            Some(user_code) => Known::User(user_code.poll()?),
            None => match (self.results.as_mut()?.pop().ok()?, self.awaited) {
                (Answer::Reached, Some(Awaited::UserCode { number, p, q })) => {
                    match UserCode::start(&self.codes, number, p, q) {
                        Ok(user_code) => {
                            self.user_code = Some(user_code);
                            return None;
                        }
                        Err(reason) => Known::User(Err(reason)),
                    }
                }
                (answer, _) => Known::Machine(answer),
            },
        };
        (self.user_code, self.awaited) = (None, None);
        Some(known)
    }

    /// Whether there was a probing move whose end was only assumed.
    pub(super) fn has_assumed(&self) -> bool {
        self.probed && self.results.is_none()
    }
}
