//! Motion without knots: seven phases on one part, constant speed beside a kink.
//!
//! In:  a section of straight parts, or one that the solver found no way through; zones beside junctions.
//! Out: steps to hand over, with places where the machine could stop.

use super::{After, Entry, Made, Part, Place, Ready, Step, Stream, Tail};
use crate::plan::limits::PathLimits;
use crate::plan::optimal::slopes::{Emission, steady_limits};
use crate::plan::profile::{Phase, change_length, profile};

impl Stream {
    /// Plans the section under construction without knots: one part from speed to speed, several from rest to rest.
    pub(super) fn phases(&mut self, speed: f64) {
        self.careful = false;
        let Some(section) = self.section.take() else {
            self.entry = Entry::Speed(speed);
            return;
        };
        let Entry::Speed(begin_speed) = section.entry else {
            self.changes.fail();
            return;
        };
        self.entry = Entry::Speed(speed);
        let mut elements = Vec::new();
        let mut end = section.begin;
        let last = section.parts.len() - 1;
        for (k, part) in section.parts.iter().enumerate() {
            let v0 = if k == 0 { begin_speed } else { 0.0 };
            let v1 = if k == last { speed } else { 0.0 };
            let limits = steady_limits(*part, &self.log, &self.joints, &mut self.jets);
            for phase in profile(v0, v1, part.to - part.from, &limits) {
                self.cruise(*part, phase, &limits, &mut elements);
            }
            end = Place {
                item: part.item,
                s: part.to,
            };
        }
        if speed > 0.0
            && let Some(last) = elements.last_mut()
        {
            last.opens = false;
        }
        self.steps.push_back(Step::Ready(Ready {
            elements,
            end,
            after: if speed > 0.0 { After::More } else { After::Rest },
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

    /// Constant speed beside a kink; behind it, the machine could stop on what is left of the stretch.
    pub(super) fn zone(&mut self, part: Part, speed: f64, behind: bool) {
        if matches!(self.entry, Entry::Speed(entry) if entry != speed) {
            self.zone_from_rest(part);
            return;
        }
        let mut elements = Vec::new();
        Emission {
            log: &self.log,
            out: &mut elements,
        }
        .steady(part, speed);
        let count = elements.len();
        for (k, made) in elements.iter_mut().enumerate() {
            // Only from its end on, all is as it is planned again.
            made.opens = behind && k + 1 == count;
        }
        let end = Place {
            item: part.item,
            s: part.to,
        };
        let after = match self.log.stretch(part.item) {
            Some(stretch) if behind => {
                let rest = Part {
                    from: part.to,
                    to: stretch.piece.length(),
                    ..part
                };
                let limits = steady_limits(rest, &self.log, &self.joints, &mut self.jets);
                let phases = profile(speed, 0.0, change_length(speed, 0.0, &limits), &limits);
                let mut elements = Vec::new();
                let rest = Emission {
                    log: &self.log,
                    out: &mut elements,
                }
                .phases(&[rest], &phases);
                After::Stop(Tail { elements, rest })
            }
            Some(_) | None => After::More,
        };
        self.steps.push_back(Step::Ready(Ready { elements, end, after }));
    }

    /// A zone before which a section without knots has come to rest already: the kink is passed at rest as well.
    fn zone_from_rest(&mut self, part: Part) {
        let mut elements = Vec::new();
        let limits = steady_limits(part, &self.log, &self.joints, &mut self.jets);
        for phase in profile(0.0, 0.0, part.to - part.from, &limits) {
            self.cruise(part, phase, &limits, &mut elements);
        }
        self.entry = Entry::Speed(0.0);
        let end = Place {
            item: part.item,
            s: part.to,
        };
        let after = After::Rest;
        self.steps.push_back(Step::Ready(Ready { elements, end, after }));
    }
}
