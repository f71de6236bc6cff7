//! The section under construction: its parts become spans between knots, and those windows.
//!
//! In:  parts, zones, rests and ends of sections, as they are found.
//! Out: steps to hand over, some of them windows that are still to be solved; their jobs.

use super::{
    After, Asked, CAREFUL_PARTS, Entry, Made, Next, Open, Part, Pending, Place, Ready, Section, State, Step, Stream,
};
use crate::element::Element;
use crate::plan::optimal::checkpoints::{Checkpoints, Seen};
use crate::plan::optimal::knots::Knots;
use crate::plan::optimal::sections::{Found, Item};
use crate::plan::optimal::slopes::{Side, is_as_good_as_straight, launch};
use crate::plan::optimal::solver::{Grid, Launch};
use crate::plan::optimal::windows::{Border, Uncut, Window};

impl Stream {
    pub(super) fn push_found(&mut self, found: Found) {
        match found {
            Found::Part(part) => match &mut self.section {
                None => {
                    self.section = Some(Section {
                        begin: Place {
                            item: part.item,
                            s: part.from,
                        },
                        entry: self.next.entry,
                        parts: vec![part],
                        open: None,
                    });
                }
                Some(_) => self.go_on(part),
            },
            Found::End => self.end(),
            Found::Rest { item } => {
                let elements = match self.log.get(item) {
                    Some(Item::Rest(element)) => element.iter().map(|element| still(**element, item)).collect(),
                    Some(Item::Stretch(_)) | None => Vec::new(),
                };
                self.steps.push_back(Step::Ready(Ready {
                    elements,
                    end: Place { item: item + 1, s: 0.0 },
                    after: After::Rest,
                }));
            }
        }
    }

    /// The section under construction goes on with another part.
    fn go_on(&mut self, part: Part) {
        if self.section.as_ref().is_some_and(|section| section.open.is_none()) {
            self.open();
        }
        let Some(section) = &mut self.section else { return };
        match &mut section.open {
            Some(open) => {
                open.knots.push(
                    part,
                    &self.log,
                    &self.joints,
                    self.times.knotting.step_s,
                    &mut self.jets,
                );
                self.add_spans(None);
                self.cut(false);
            }
            None => {
                section.parts.push(part);
                if section.parts.len() >= CAREFUL_PARTS {
                    self.phases();
                }
            }
        }
    }

    /// Begins with knots in a section of which one part is known. Where that cannot be, the section stays closed, and is
    /// planned without them.
    fn open(&mut self) {
        let Some(section) = &mut self.section else { return };
        let (false, &[part]) = (self.next.careful, &section.parts[..]) else {
            return;
        };
        let grid = Grid::new(self.joints.limits());
        let mut start = None;
        let mut first = part;
        let (mut knots, uncut) = match section.entry {
            Entry::TakenOver(from) => (Knots::taken_over(from), Uncut::taken_over(from.state, grid, self.times)),
            Entry::Rest => {
                let Some(launch) = launch(part, Side::Start, &self.log, &self.joints, &mut self.jets) else {
                    return;
                };
                first.from += launch.length();
                start = Some((part, launch));
                let state = launch.start();
                let knots = Knots::new(state.b.sqrt());
                (knots, Uncut::new(state, grid, self.times))
            }
        };
        knots.push(
            first,
            &self.log,
            &self.joints,
            self.times.knotting.step_s,
            &mut self.jets,
        );
        section.open = Some(Open { knots, uncut, start });
    }

    /// Takes the spans of which the knots are certain into the grid.
    fn add_spans(&mut self, exit: Option<f64>) {
        let Some(open) = self.section.as_mut().and_then(|section| section.open.as_mut()) else {
            return;
        };
        let mut spans = Vec::new();
        open.knots.drain(exit, self.times.knotting.step_s, &mut spans);
        let mut seen = Seen::default();
        let mut taken = Vec::new();
        for span in spans {
            let Some(stretch) = self.log.stretch(span.item) else {
                continue;
            };
            let kinks = || self.log.kinks(span.item, span.near);
            self.joints.taken(kinks(), &mut taken);
            let checkpoints = Checkpoints {
                joints: &self.joints,
                stretch,
                feed: self.log.feed(span.item),
                slowest: kinks().fold(f64::INFINITY, |least, kink| least.min(kink.speed)),
                taken: &taken,
            };
            checkpoints.add(span, &mut open.uncut, &mut seen);
        }
    }

    /// Cuts off all windows that are certain.
    fn cut(&mut self, ended: bool) {
        loop {
            let Some(section) = &mut self.section else { return };
            let Some(open) = &mut section.open else { return };
            let Some((window, border)) = open.uncut.cut(ended) else {
                return;
            };
            let start = open.start.take();
            let begin = (section.begin, section.entry);
            self.add_window(window, start, None, begin, Some(border), false);
        }
    }

    fn add_window(
        &mut self,
        mut window: Window,
        start: Option<(Part, Launch)>,
        stop: Option<(Part, Launch)>,
        section: (Place, Entry),
        border: Option<Border>,
        rests: bool,
    ) {
        let number = self.windows;
        self.windows += 1;
        let mut behind = Vec::new();
        if let Some(Border {
            job,
            before,
            behind: spans,
        }) = border
        {
            behind = spans;
            self.order_job(Asked::Border { window: number, before }, job);
        }
        let mut left_tail = None;
        if self
            .left_over
            .as_ref()
            .is_some_and(|(for_window, ..)| *for_window == number)
            && let Some((_, states, tail)) = self.left_over.take()
        {
            window.set_left(states);
            left_tail = tail;
        }
        self.steps.push_back(Step::Window(number));
        self.pending.push_back(Pending {
            number,
            window,
            start,
            stop,
            behind,
            tail: None,
            left_tail,
            section,
            rests,
        });
        self.ask(number);
    }

    /// Hands in the job of a window if both its ends are known.
    pub(super) fn ask(&mut self, number: u64) {
        let Some(index) = self.index(number) else { return };
        match self.pending[index].window.job() {
            None => {}
            Some(Ok(job)) => {
                self.order_job(Asked::Window(number), job);
            }
            Some(Err(_)) => self.give_up(index),
        }
    }

    pub(super) fn index(&self, number: u64) -> Option<usize> {
        self.pending.iter().position(|pending| pending.number == number)
    }

    /// The section ends.
    fn end(&mut self) {
        if self
            .section
            .as_ref()
            .is_some_and(|section| section.open.is_none() && !self.is_phased(section))
        {
            self.open();
        }
        let stop = self.stop();
        let Some(section) = &mut self.section else { return };
        let Some(open) = &mut section.open else {
            self.phases();
            return;
        };
        if let Some((_, launch)) = stop {
            open.knots.trim(launch.length());
        }
        // Nothing leads to a state that is none: the window is given up as soon as it is clear where it begins.
        let state = stop.map_or(State { b: f64::NAN, u: 0.0 }, |(_, launch)| launch.stop());
        self.add_spans(Some(stop.map_or(0.0, |(_, launch)| launch.stop().b.sqrt())));
        self.cut(true);
        let Some(section) = self.section.take() else { return };
        let Some(open) = section.open else { return };
        let window = open.uncut.last(state);
        self.next = Next::REST;
        self.add_window(window, open.start, stop, (section.begin, section.entry), None, true);
    }

    /// The launch of the stop at the end of the open section; `None` where geometry leaves none.
    fn stop(&mut self) -> Option<(Part, Launch)> {
        let Some(Section { open: Some(open), .. }) = &self.section else {
            return None;
        };
        let part = open.knots.last_part()?;
        let launch = launch(part, Side::Stop, &self.log, &self.joints, &mut self.jets)?;
        Some((part, launch))
    }

    /// Whether seven phases run a closed section in the shortest time, or very nearly: one part, as good as straight.
    fn is_phased(&self, section: &Section) -> bool {
        let straight = |part: &Part| {
            self.log.stretch(part.item).is_some_and(|stretch| {
                let feed = self.log.feed(part.item);
                is_as_good_as_straight(&stretch.piece, feed, &self.joints)
            })
        };
        matches!(section.entry, Entry::Rest) && matches!(&section.parts[..], [part] if straight(part))
    }
}

/// An element at rest, which is item `item` of the log.
fn still(element: Element, item: u64) -> Made {
    Made {
        element,
        end: Place { item: item + 1, s: 0.0 },
        opens: false,
    }
}
