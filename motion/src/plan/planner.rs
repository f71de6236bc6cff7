//! The planner as a whole: calls in, publications out.
//!
//! In:  canonical calls.
//! Out: publications to a ring.

use super::classic;
use super::program::{Entry, Program};
use super::smooth::{Passed, Smoother, Stretch};
use super::{PlanError, Programmed, Settings};
use crate::canon::Event;
use crate::element::Element;
use crate::kinematics::ToolFrame;
use crate::ring::Sink;

/// What became of [`Planner::pump`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pumped {
    /// Everything final has been handed over; more calls, or [`Planner::finish`], are needed.
    Hungry,
    /// The sink is full: pump again later. Do not push much more before that.
    Blocked,
    /// Everything has been handed over, down to the rest at the end.
    Done,
}

impl Settings {
    /// Elements that the largest publication may have; the ring must hold as many.
    pub fn largest_publication(&self) -> usize {
        classic::largest_publication()
    }
}

/// Turns canonical calls into a plan and hands it over.
#[derive(Debug)]
pub struct Planner<S> {
    settings: Settings,
    sink: S,
    program: Program,
    smoother: Smoother,
    steps: classic::Steps,
    /// How the axes of what passes the stages are meant.
    frame: ToolFrame,
    ideal: Vec<Programmed>,
}

impl<S: Sink<Element>> Planner<S> {
    /// A planner at rest at the start position.
    pub fn new(settings: Settings, sink: S) -> Planner<S> {
        Planner {
            settings,
            sink,
            program: Program::new(settings.start),
            smoother: Smoother::default(),
            steps: classic::Steps::default(),
            frame: ToolFrame::OFF,
            ideal: Vec::new(),
        }
    }

    /// Takes the next call. An error concerns this call only, which is then of no effect.
    pub fn push(&mut self, event: &Event) -> Result<(), PlanError> {
        let entry = self
            .program
            .take(event.source.line, &event.call, &self.settings)
            .map_err(|kind| PlanError {
                source: event.source,
                kind,
            })?;
        match entry {
            None => {}
            Some(Entry::Move(part)) => {
                self.ideal.push(Programmed {
                    piece: part.piece,
                    feed: part.feed,
                    line: part.line,
                    rapid: part.rapid,
                });
                let mut passed = Vec::new();
                self.smoother.push(part, &self.settings, &mut passed);
                self.pass(passed);
            }
            Some(Entry::Halt) => {
                self.rest(None);
                self.frame = self.program.tool_frame();
            }
            Some(Entry::Rest(element)) => self.rest(Some(element)),
        }
        Ok(())
    }

    /// Nothing follows for now: what is known is planned to its end, at rest. More may be pushed later.
    pub fn finish(&mut self) {
        self.rest(None);
        self.steps.finish();
    }

    /// Whether everything has been handed over after [`Planner::finish`].
    pub fn is_done(&self) -> bool {
        self.steps.is_done()
    }

    /// Programmed moves since the last call of this function, in machine coordinates.
    pub fn ideal_path(&mut self) -> std::vec::Drain<'_, Programmed> {
        self.ideal.drain(..)
    }

    /// The sink.
    pub fn sink(&mut self) -> &mut S {
        &mut self.sink
    }

    /// Hands over what is final.
    pub fn pump(&mut self) -> Pumped {
        self.steps.pump(&self.settings, &mut self.sink)
    }

    /// Sends everything through the stages; it ends at rest.
    fn rest(&mut self, element: Option<Element>) {
        let mut passed = Vec::new();
        self.smoother.flush(&self.settings, &mut passed);
        self.pass(passed);
        self.steps.rest(element, &self.settings);
    }

    /// What the smoother lets go, to the slope. Pieces that it made are meant as the moves they come from: it is empty when
    /// that changes.
    fn pass(&mut self, passed: Vec<Passed>) {
        for passed in passed {
            let passed = match passed {
                Passed::Stretch(stretch) => Passed::Stretch(Stretch {
                    piece: stretch.piece.in_frame(self.frame),
                    ..stretch
                }),
                Passed::Stop => Passed::Stop,
            };
            self.steps.push(passed, &self.settings);
        }
    }
}
