//! What comes back from the solver.
//!
//! In:  states at the knots of border windows and windows, or that there is no way.
//! Out: the elements of windows, and the stops behind them; where there is no way, planning restarts before it.

use super::{After, Asked, Entry, Next, Part, Place, Ready, State, Step, Stream, Tail};
use crate::plan::limits::PathLimits;
use crate::plan::optimal::joints::Joints;
use crate::plan::optimal::sections::Sections;
use crate::plan::optimal::slopes::{Emission, steady_limits};
use crate::plan::optimal::solver::JointJet;
use crate::plan::optimal::windows::States;
use crate::plan::profile::{Phase, change_length, profile};

impl Stream {
    /// Restarts planning at a place.
    pub(super) fn restart(&mut self, place: Place, entry: Entry, careful: bool) {
        self.begun_anew += 1;
        self.refused = 0;
        self.sections = Sections::new(place, &self.log);
        self.section = None;
        self.left_over = None;
        self.next = Next { entry, careful };
    }

    /// A window has no solution: what follows the last known place is planned again, its beginning without the solver.
    pub(super) fn give_up(&mut self, index: usize) {
        if self.changes.fails() {
            return;
        }
        let Some(failed) = self.pending.drain(index..).next() else {
            return;
        };
        while let Some(step) = self.steps.pop_back() {
            if matches!(step, Step::Window(number) if number == failed.number) {
                break;
            }
        }
        match failed.left_tail {
            Some(tail) => {
                self.steps.push_back(Step::Ready(Ready {
                    elements: tail.elements,
                    end: tail.rest,
                    after: After::Rest,
                }));
                self.restart(tail.rest, Entry::Rest, true);
            }
            None => self.restart(failed.section.0, failed.section.1, true),
        }
    }

    /// Takes the answers that are there; waits for one where nothing else is left to do.
    pub(super) fn collect(&mut self) {
        if self.changes.is_under_way() {
            self.do_urgent();
            return;
        }
        while let Some((asked, states)) = self.jobs.next(self.finished || self.jobs.are_many()) {
            self.solved(asked, states);
        }
    }

    pub(super) fn solved(&mut self, asked: Asked, states: Option<States>) {
        match asked {
            Asked::Border { window, before } => self.border_solved(window, before, states),
            Asked::Window(number) => self.window_solved(number, states),
        }
    }

    fn border_solved(&mut self, number: u64, before: usize, states: Option<States>) {
        let Some(index) = self.index(number) else { return };
        let Some(mut states) = states else {
            self.give_up(index);
            return;
        };
        let behind = states.split_off(before);
        states.push(behind[0]);
        let pending = &mut self.pending[index];
        pending.window.set_right(states);
        let tail = self.tail_behind(index, &behind);
        self.pending[index].tail = tail.clone();
        match self.pending.get_mut(index + 1) {
            Some(next) => {
                next.window.set_left(behind);
                next.left_tail = tail;
                self.ask(number + 1);
            }
            None => self.left_over = Some((number + 1, behind, tail)),
        }
        self.ask(number);
    }

    /// The stop behind the right border of a window: the solution there down to the feasible profile, and from there to rest.
    fn tail_behind(&mut self, index: usize, states: &[State]) -> Option<Tail> {
        let spans = &self.pending[index].behind;
        let mut elements = Vec::with_capacity(spans.len() + STOP_ELEMENTS);
        let mut out = Emission {
            log: &self.log,
            out: &mut elements,
        };
        for (span, states) in spans.iter().zip(states.windows(2)) {
            out.spline(span.part(), states[0], states[1]);
        }
        let (last, state) = (spans.last()?, states.last()?);
        let place = Place {
            item: last.item,
            s: last.to,
        };
        let rest = stop_from(place, *state, &mut out, &self.joints, &mut self.jets)?;
        Some(Tail { elements, rest })
    }

    fn window_solved(&mut self, number: u64, states: Option<States>) {
        let Some(index) = self.index(number) else { return };
        let Some(states) = states else {
            self.give_up(index);
            return;
        };
        let Some(pending) = self.pending.remove(index) else {
            return;
        };
        let mut elements = Vec::with_capacity(2 * pending.window.sources.len() + STOP_ELEMENTS);
        let mut out = Emission {
            log: &self.log,
            out: &mut elements,
        };
        if let Some((part, launch)) = &pending.start {
            out.start(*part, launch);
        }
        let mut end = pending.section.0;
        out.spans(&pending.window.sources, &states, &self.joints, &mut self.jets);
        if let Some(span) = pending.window.sources.last() {
            end = Place {
                item: span.item,
                s: span.to,
            };
        }
        if let Some((part, launch)) = &pending.stop {
            out.stop(*part, launch);
            end = Place {
                item: part.item,
                s: part.to,
            };
        }
        if pending.tail.is_none()
            && !pending.rests
            && let Some(last) = elements.last_mut()
        {
            last.opens = false;
        }
        let after = match pending.tail {
            Some(tail) => After::Stop(tail),
            None if pending.rests => After::Rest,
            None => After::More,
        };
        for step in &mut self.steps {
            if matches!(step, Step::Window(waiting) if *waiting == number) {
                *step = Step::Ready(Ready { elements, end, after });
                return;
            }
        }
    }
}

/// Elements that such a stop has, mostly.
const STOP_ELEMENTS: usize = 16;
/// Speed of the stop behind a border, at the most, over that at the end of its spans.
const FASTER: f64 = 1.5;

/// A stop from a slow motion at a place, on whatever part of the path follows; where it ends.
fn stop_from(
    place: Place,
    state: State,
    out: &mut Emission<'_>,
    joints: &Joints,
    jets: &mut Vec<JointJet>,
) -> Option<Place> {
    let (v, a) = (state.b.sqrt(), state.u);
    // Slow as it is, kinks take little of the limits.
    let fastest = FASTER * v;
    let mut taken = Vec::new();
    let stretch = out.log.stretch(place.item)?;
    let mut parts = Vec::new();
    let mut part = Part {
        item: place.item,
        from: place.s,
        to: stretch.piece.length(),
        near: [
            out.log.kink_before(place.item).is_some_and(|kink| place.s < kink.zone),
            false,
        ],
    };
    let (mut length, mut limits) = (0.0, None::<PathLimits>);
    // Slow as it is, it takes a few pieces at the most; more means that something is wrong.
    for _ in 0..64 {
        if part.to > part.from {
            joints.taken(out.log.kinks(part.item, part.near), &mut taken);
            if out.log.kinks(part.item, part.near).any(|kink| kink.speed < fastest) {
                return None;
            }
            let left = joints.left(&taken, fastest);
            let here = steady_limits(part, &left, out.log, joints, jets);
            limits = Some(limits.map_or(here, |least| PathLimits {
                v: least.v.min(here.v),
                a: least.a.min(here.a),
                j: least.j.min(here.j),
            }));
            length += part.to - part.from;
            parts.push(part);
        }
        if let Some(limits) = &limits {
            // First away with the acceleration, then to rest.
            let settle = a.abs() / limits.j;
            let speed = v + 0.5 * a * settle;
            let first = settle * (v + settle * (a / 2.0 - settle * a.signum() * limits.j / 6.0));
            let rest = change_length(speed, 0.0, limits);
            if speed <= fastest && first + rest <= length {
                let mut phases = Vec::new();
                if settle > 0.0 {
                    phases.push(Phase {
                        duration: settle,
                        s: 0.0,
                        v,
                        a,
                        jerk: -a.signum() * limits.j,
                    });
                }
                phases.extend(profile(speed, 0.0, rest, limits).into_iter().map(|phase| Phase {
                    s: phase.s + first,
                    ..phase
                }));
                return Some(out.phases(&parts, &phases));
            }
        }
        let item = part.item + 1;
        if out.log.stops_before(item) {
            return None;
        }
        part = Part {
            item,
            from: 0.0,
            to: out.log.stretch(item)?.piece.length(),
            near: [true, false],
        };
    }
    None
}
