//! A whole program planned without a machine.
//!
//! In:  all calls of a program. Out: one position per cycle, and what the program asked for.

use super::{PlanError, Planner, Programmed, Settings};
use crate::canon::{Event, Position};
use crate::element::{Element, Synced};
use crate::ring::{Publish, Sink, Timed};
use crate::rt::probe::Prober;
use crate::rt::{Follower, SpindleFeedback};

/// A program, planned.
#[derive(Clone, Debug)]
pub struct Offline {
    /// Machine position at each cycle, the first at rest at the start, the last at rest at the end.
    pub samples: Vec<Position>,
    /// Programmed path before rounding.
    pub ideal: Vec<Programmed>,
    /// From the first move to the last, waits included, s.
    pub motion_time_s: f64,
    /// Elements that would go through the ring.
    pub elements: usize,
}

/// Keeps everything that is handed over.
#[derive(Debug, Default)]
pub struct Recorder {
    /// Elements that are final, in the order of the path.
    pub elements: Vec<Element>,
    /// The stop behind them.
    pub tail: Vec<Element>,
}

impl Sink<Element> for Recorder {
    fn free(&self) -> usize {
        usize::MAX
    }

    fn publish(&mut self, committed: &[Element], tail: &[Element]) -> Publish {
        self.elements.extend_from_slice(committed);
        self.tail.clear();
        self.tail.extend_from_slice(tail);
        Publish::Done
    }
}

/// Plans a whole program.
///
/// # Errors
///
/// The first call that cannot be planned.
pub fn plan_offline<'a>(events: impl IntoIterator<Item = &'a Event>, settings: Settings) -> Result<Offline, PlanError> {
    let mut planner = Planner::new(settings, Recorder::default());
    for event in events {
        planner.push(event)?;
        planner.pump();
    }
    planner.finish();
    planner.pump();
    let ideal = planner.ideal_path().collect();
    let elements = &planner.sink().elements;
    Ok(Offline {
        samples: sample(elements, settings.start, settings.cycle_s),
        ideal,
        motion_time_s: elements.iter().map(Timed::duration_s).sum(),
        elements: elements.len(),
    })
}

/// Positions at multiples of the cycle time along `elements`, from `start` to the end of the last.
pub fn sample(elements: &[Element], start: Position, cycle_s: f64) -> Vec<Position> {
    let mut samples = vec![start];
    let mut rest = start;
    // Time from the last sample to the beginning of the element.
    let mut before = 0.0;
    for element in elements {
        if matches!(element, Element::Synced(_) | Element::Probing(_)) && before > 0.0 {
            // These begin with a cycle, once the motion before them has come to rest.
            samples.push(rest);
        }
        if let Element::Synced(synced) = element {
            follow(synced, cycle_s, &mut samples);
            rest = samples.last().copied().unwrap_or(rest);
            before = 0.0;
            continue;
        }
        if let Element::Probing(probing) = element {
            // To its end: nothing is touched.
            let mut prober = Prober::new(cycle_s);
            prober.begin(probing);
            while !prober.take_result() {
                prober.step(probing, false);
                samples.push(prober.position());
            }
            rest = probing.piece.position(probing.piece.length());
            before = 0.0;
            continue;
        }
        let duration = element.duration_s();
        let mut t = cycle_s - before;
        while t <= duration {
            samples.push(match element {
                Element::Span(span) => span.piece.position(span.place(t)),
                Element::Synced(_) | Element::Probing(_) | Element::Dwell { .. } | Element::Action { .. } => rest,
            });
            t += cycle_s;
        }
        before = duration - (t - cycle_s);
        match element {
            Element::Span(span) => rest = span.piece.position(span.place(duration)),
            Element::Synced(_) | Element::Probing(_) | Element::Dwell { .. } | Element::Action { .. } => {}
        }
    }
    samples.push(rest);
    samples
}

/// Positions of a move in step with a spindle that keeps its programmed speed, and reverses at once.
fn follow(synced: &Synced, cycle_s: f64, samples: &mut Vec<Position>) {
    let mut follower = Follower::new(cycle_s);
    follower.begin(synced);
    let mut spindle = SpindleFeedback {
        turns: 0.0,
        indexed: true,
    };
    while !follower.is_over() {
        spindle.turns += cycle_s * synced.turns_s * follower.reversal().map_or(1.0, |scale| -scale);
        follower.observe(&spindle);
        follower.step(&spindle);
        samples.push(synced.piece.position(follower.place()));
    }
}
