//! The probing moves of a program, one after the other.
//!
//! In:  probing moves of the plan; in every cycle the contact, and where the axes were measured when it was read.
//! Out: commanded positions; one [`Answer`] for each move to whoever reads the program and waits for it.
//!
//! RT: nothing allocates but [`Prober::new`].

use super::{Answer, Probe};
use crate::canon::Position;
use crate::element::Probing;
use crate::rt::{MotionLimits, StopLimits};

/// How much harder than planned motion a stop may be on every joint: factors, 1 or more.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StopShares {
    acceleration: f64,
    jerk: f64,
}

impl StopShares {
    /// A stop keeps the limits of planned motion.
    pub const NONE: StopShares = StopShares {
        acceleration: 1.0,
        jerk: 1.0,
    };

    /// What the limits of all joints leave, where joints are linear functions of the axes or not: the acceleration grows no
    /// more than the jerk, so that what the bend of a joint's way adds stays in proportion.
    pub fn new(joints: impl Iterator<Item = (MotionLimits, StopLimits)>) -> StopShares {
        let mut shares = [f64::INFINITY; 2];
        for (motion, stop) in joints {
            shares[0] = shares[0].min(stop.acceleration / motion.acceleration);
            shares[1] = shares[1].min(stop.jerk / motion.jerk);
        }
        let jerk = if shares[1].is_finite() { shares[1].max(1.0) } else { 1.0 };
        StopShares {
            acceleration: shares[0].clamp(1.0, jerk),
            jerk,
        }
    }

    /// Limits of stops beside those of planned motion.
    pub fn along(self, motion: MotionLimits) -> StopLimits {
        StopLimits {
            acceleration: self.acceleration * motion.acceleration,
            jerk: self.jerk * motion.jerk,
        }
    }
}

/// Runs probing moves.
#[derive(Debug)]
pub struct Prober {
    probe: Probe,
    shares: StopShares,
    /// Who waits for the results; `None`: every move goes its whole way.
    answers: Option<rtrb::Producer<Answer>>,
    /// `None`: nothing has been read since the move was begun.
    contact: Option<bool>,
    measured: Position,
    /// Latched by the drives where the contact closed, and where it opened.
    latched: [Option<Position>; 2],
}

impl Prober {
    /// Without a probe: no contact ever changes, and no result is waited for.
    pub fn new(cycle_s: f64) -> Prober {
        Prober {
            probe: Probe::idle(cycle_s),
            shares: StopShares::NONE,
            answers: None,
            contact: None,
            measured: Position::ZERO,
            latched: [None; 2],
        }
    }

    /// The same with somebody who waits for the results, and with harder stops.
    pub fn answering(self, answers: rtrb::Producer<Answer>, shares: StopShares) -> Prober {
        Prober {
            answers: Some(answers),
            shares,
            ..self
        }
    }

    /// What was read in this cycle. RT.
    pub fn observe(&mut self, contact: bool, measured: &Position) {
        self.contact = Some(contact);
        self.measured = *measured;
    }

    /// Where the drives latched that the contact closed, and that it opened, since the move began. RT.
    pub fn observe_latches(&mut self, latched: [Option<Position>; 2]) {
        self.latched = latched;
    }

    /// Begins a move, from rest at its start. RT.
    pub fn begin(&mut self, probing: &Probing) {
        self.contact = None;
        self.latched = [None; 2];
        let limits = (probing.limits, self.shares.along(probing.limits));
        self.probe.set_out(probing.piece, probing.mode, probing.feed, limits);
    }

    /// One cycle further. RT.
    pub fn step(&mut self, probing: &Probing, held: bool) {
        if held {
            self.probe.hold();
        } else {
            self.probe.resume();
        }
        // Without a probe the contact is never as it is to become.
        let contact = match self.answers {
            Some(_) => self.contact,
            None => Some(!probing.mode.towards),
        };
        // What was read before the move counts for nothing.
        if let Some(contact) = contact {
            self.probe.step(contact, &self.measured);
            let [closed, opened] = &self.latched;
            if let Some(exact) = if probing.mode.towards { closed } else { opened } {
                self.probe.refine(exact);
            }
        }
    }

    /// For how long the move goes on by its law; nothing where a contact may come. RT.
    pub fn even_s(&self) -> f64 {
        match self.answers {
            Some(_) => 0.0,
            None => self.probe.even_s(),
        }
    }

    /// Goes on by so many cycles at once, which are no longer than that. RT.
    pub fn skip(&mut self, cycles: f64) {
        self.probe.otg.skip(cycles);
    }

    /// Whether the move is over; who waits for its result is told once. RT.
    pub fn take_result(&mut self) -> bool {
        let Some(result) = self.probe.result() else {
            return false;
        };
        self.answer(Answer::Probed(result));
        true
    }

    /// Tells who waits. RT.
    pub fn answer(&mut self, answer: Answer) {
        if let Some(answers) = &mut self.answers {
            // Nothing else is waited for before the answer has been read.
            let _ = answers.push(answer);
        }
    }

    /// Where the move has come to. RT.
    pub fn position(&self) -> Position {
        self.probe.position
    }

    /// Speed along the line, mm/s (degrees/s). RT.
    pub fn speed(&self) -> f64 {
        self.probe.speed()
    }

    /// Whether nothing moves. RT.
    pub fn is_at_rest(&self) -> bool {
        self.probe.is_at_rest()
    }

    /// Whether the last cycle was part of a stop, for which the stop limits count. RT.
    pub fn is_stopping(&self) -> bool {
        self.probe.is_stopping()
    }
}
