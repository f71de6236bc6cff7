//! What there is to know of one cycle, and how it follows from where plan time is.

use super::Interpolator;
use crate::canon::Position;
use crate::element::{Action, Auxiliary, Element, Enables, Outputs, Probing, Span, Synced};
use crate::kinematics::ToolFrame;
use crate::rt::synced::SyncFault;

/// What the interpolation is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SampleState {
    /// On the way, or held on it.
    Moving,
    /// Waits at rest for time to pass.
    Dwelling,
    /// Waits at rest for an action to be acknowledged.
    Acting,
    /// At rest, because nothing more has been planned yet.
    Starved,
    /// The program is over.
    Finished,
}

/// What there is to know of one cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Axis positions in the machine, mm or degrees.
    pub position: Position,
    /// How they are meant: kinematics need both.
    pub frame: ToolFrame,
    /// Speed on the path, mm/s (degrees/s on a purely rotary move).
    pub velocity_mm_s: f64,
    /// Line of the program.
    pub line: u32,
    /// Whether the move is a rapid one.
    pub rapid: bool,
    /// What acts on it from outside; on what is done at rest, as on the move before.
    pub enables: Enables,
    /// What the interpolation is doing.
    pub state: SampleState,
    /// What waits to be acknowledged.
    pub action: Option<Action>,
    /// What is to be done in this cycle, on the way: nothing waits for it.
    pub on_the_way: Option<Action>,
    /// Outputs that are to change in this cycle, on the way.
    pub outputs: Option<Outputs>,
    /// Auxiliary functions of the move.
    pub auxiliary: Auxiliary,
    /// Number of the modes in force, as [`Source::modes`](crate::canon::Source::modes) says; 0: none has been told.
    pub modes: u32,
    /// A tap is on its way back: the spindle is to turn the other way, this much as fast as programmed.
    pub reversal: Option<f64>,
    /// A move in step with the spindle is under way, or waits for it: as fast as the axes can follow it, turns/s.
    pub turns_s_max: Option<f64>,
    /// Why a move in step with the spindle was given up; nothing moves from there on.
    pub fault: Option<SyncFault>,
}

impl Sample {
    /// At rest without a program.
    pub const fn resting(position: Position) -> Sample {
        Sample {
            position,
            frame: ToolFrame::OFF,
            velocity_mm_s: 0.0,
            line: 0,
            rapid: false,
            enables: Enables::INITIAL,
            state: SampleState::Finished,
            action: None,
            on_the_way: None,
            outputs: None,
            auxiliary: Auxiliary::INITIAL,
            modes: 0,
            reversal: None,
            turns_s_max: None,
            fault: None,
        }
    }
}

impl Interpolator {
    /// Makes the sample of where plan time is.
    pub(super) fn evaluate(&mut self) {
        self.sample.action = None;
        self.sample.reversal = None;
        self.sample.turns_s_max = None;
        self.sample.fault = None;
        self.sample.velocity_mm_s = 0.0;
        match self.track.current().copied() {
            Some(Element::Span(span)) => {
                let speed = span.speed(self.time_s).max(0.0) * self.ramp.share();
                self.show(&span, self.time_s, speed);
                self.sample.state = SampleState::Moving;
            }
            Some(Element::Synced(synced)) => {
                self.show_synced(&synced);
                self.sample.reversal = self.follower.reversal();
                self.sample.turns_s_max = Some(synced.turns_s_max());
                self.sample.fault = self.follower.fault().filter(|_| self.follower.is_over());
                self.sample.state = SampleState::Moving;
            }
            Some(Element::Probing(probing)) => {
                self.show_probing(&probing);
                self.sample.velocity_mm_s = self.prober.speed();
                self.sample.state = SampleState::Moving;
            }
            Some(Element::Dwell { line, .. }) => {
                self.sample.line = line;
                self.sample.state = SampleState::Dwelling;
            }
            // Where a way back rests just there.
            Some(Element::Action {
                action: Action::Modes { number },
                line,
            }) => {
                self.sample.line = line;
                self.sample.modes = number;
                self.sample.state = SampleState::Moving;
            }
            Some(Element::Action { action, line }) => {
                self.sample.line = line;
                // What the move before it has said comes first.
                self.sample.action = (self.told == self.sample.auxiliary).then_some(action);
                self.sample.state = SampleState::Acting;
            }
            None => {
                if self.sample.state != SampleState::Finished {
                    self.sample.state = if self.arrived.is_some() {
                        SampleState::Moving
                    } else {
                        SampleState::Starved
                    };
                }
            }
        }
    }

    pub(super) fn show(&mut self, span: &Span, time_s: f64, speed: f64) {
        let place = span.place(time_s).clamp(0.0, span.piece.length());
        self.sample.position = span.piece.position(place);
        self.sample.frame = *span.piece.frame();
        self.sample.velocity_mm_s = speed;
        self.sample.line = span.line;
        self.sample.rapid = span.rapid;
        self.sample.enables = span.enables;
        self.sample.auxiliary = span.auxiliary;
        self.sample.modes = span.modes;
    }

    pub(super) fn show_probing(&mut self, probing: &Probing) {
        self.sample.position = self.prober.position();
        self.sample.frame = *probing.piece.frame();
        self.sample.line = probing.line;
        self.sample.rapid = false;
    }

    pub(super) fn show_synced(&mut self, synced: &Synced) {
        let place = self.follower.place().clamp(0.0, synced.piece.length());
        self.sample.position = synced.piece.position(place);
        self.sample.frame = *synced.piece.frame();
        self.sample.velocity_mm_s = self.follower.velocity().abs();
        self.sample.line = synced.line;
        self.sample.rapid = false;
    }
}
