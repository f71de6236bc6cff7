//! Motion without knots: seven phases on one part.
//!
//! In:  a section of one straight part, or one that the solver found no way through.
//! Out: steps to hand over, with places where the machine could stop.

use super::{After, Entry, Made, Next, Part, Place, Ready, Step, Stream, Tail};
use crate::plan::limits::PathLimits;
use crate::plan::optimal::slopes::{Emission, limits_from_rest_to_rest};
use crate::plan::profile::{Phase, change_length, profile};

impl Stream {
    /// Plans the section under construction without knots, each part from rest to rest.
    pub(super) fn phases(&mut self) {
        self.next = Next::REST;
        let Some(section) = self.section.take() else { return };
        if let Entry::TakenOver(_) = section.entry {
            self.changes.fail();
            return;
        }
        let mut elements = Vec::new();
        let mut end = section.begin;
        for part in &section.parts {
            let limits = limits_from_rest_to_rest(*part, &self.log, &self.joints, &mut self.jets);
            for phase in profile(0.0, 0.0, part.to - part.from, &limits) {
                self.cruise(*part, phase, &limits, &mut elements);
            }
            end = Place {
                item: part.item,
                s: part.to,
            };
        }
        self.steps.push_back(Step::Ready(Ready {
            elements,
            end,
            after: After::Rest,
        }));
    }

    /// A phase on a part; where the speed stays the same for long, the machine could stop now and then.
    fn cruise(&mut self, part: Part, phase: Phase, limits: &PathLimits, elements: &mut Vec<Made>) {
        /// Time between such places.
        const STEADY_S: f64 = 3.0;
        /// What takes longer is handed over bit by bit in any case, with the stop at its end.
        const WHOLE_S: f64 = 10.0;
        let steady = phase.jerk == 0.0 && phase.a == 0.0;
        let count = if steady && phase.duration <= WHOLE_S {
            (phase.duration / STEADY_S).ceil().max(1.0)
        } else {
            1.0
        };
        let step = phase.duration / count;
        let stop = change_length(phase.v, 0.0, limits);
        let mut done = 0.0;
        while done < count {
            let begin = step * done;
            done += 1.0;
            let mut piece = Phase {
                duration: step,
                s: phase.place(begin),
                ..phase
            };
            if done >= count {
                piece.duration = phase.duration - begin;
            }
            let end = Emission {
                log: &self.log,
                out: elements,
            }
            .phases(&[part], &[piece]);
            if done >= count || end.s + stop >= part.to {
                continue;
            }
            let mut tail = Vec::new();
            let rest = Emission {
                log: &self.log,
                out: &mut tail,
            }
            .phases(&[Part { from: end.s, ..part }], &profile(phase.v, 0.0, stop, limits));
            self.steps.push_back(Step::Ready(Ready {
                elements: std::mem::take(elements),
                end,
                after: After::Stop(Tail { elements: tail, rest }),
            }));
        }
    }
}
