//! The cuts of roughing and finishing.
//!
//! In:  a profile in its frame: the way to its start, then segments that never turn back to greater `p`.
//! Out: moves in that frame. Cuts lie at the levels of a grid of `q`, from the start downwards.
//!
//! Roughing goes down a falling flank of the profile; from each level it cuts ahead to the next flank, retracts, and
//! comes back. At the bottom it follows the profile up to the next falling flank: a pocket, which is cut in the same way.

use super::segment::{Point, SAME_MM, Segment, length, minus};
use crate::code::Pockets;
use crate::error::TurningError;
use crate::execute::circle::Arc;

/// A move in the frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Cut {
    Rapid(Point),
    Feed(Point),
    Arc { to: Point, arc: Arc },
}

impl Cut {
    pub(super) fn to(&self) -> Point {
        match self {
            Cut::Rapid(to) | Cut::Feed(to) | Cut::Arc { to, .. } => *to,
        }
    }
}

/// Most cuts of a cycle.
pub(super) const CUTS_MAX: usize = 100_000;

/// One pass along a path: rapid to its first point, then feed. Each cut with the move of the profile that it is of.
pub(super) fn finish(path: &[Segment], cuts: &mut Vec<(Cut, u32)>) {
    for (index, segment) in path.iter().enumerate() {
        if index == 0 {
            cuts.extend([segment.start, segment.end].map(|to| (Cut::Rapid(to), segment.of)));
        } else {
            cuts.push((along(segment, segment.end), segment.of));
        }
    }
}

fn along(segment: &Segment, to: Point) -> Cut {
    match segment.arc {
        Some(arc) => Cut::Arc { to, arc },
        None => Cut::Feed(to),
    }
}

/// Where roughing is.
struct Rougher<'p> {
    path: &'p [Segment],
    step_mm: f64,
    retract_mm: f64,
    at: Point,
    /// Segment on which it is.
    index: usize,
    /// The next level to cut.
    level: f64,
    cuts: Vec<Cut>,
}

/// The cuts down to a path. `step_mm` is above 0, the retract not negative.
pub(super) fn rough(
    path: &[Segment],
    pockets: Pockets,
    step_mm: f64,
    retract_mm: f64,
) -> Result<Vec<Cut>, TurningError> {
    let path = halves(path);
    let Some(first) = path.first() else {
        return Ok(Vec::new());
    };
    let mut top = first.start[1];
    let mut rougher = Rougher {
        path: &path,
        step_mm: step_mm.max(2.0 * SAME_MM),
        retract_mm,
        at: first.start,
        index: 0,
        level: top,
        cuts: vec![Cut::Rapid(first.start)],
    };
    if pockets == Pockets::After {
        rougher.go_down();
        top = f64::NEG_INFINITY;
    }
    loop {
        rougher.cut_flank()?;
        if pockets == Pockets::Without {
            rougher.bridge();
            return Ok(rougher.cuts);
        }
        if !rougher.climb() {
            return Ok(rougher.cuts);
        }
        if pockets == Pockets::After {
            top = top.max(rougher.at[1]);
        }
        rougher.level = top;
    }
}

/// Arcs in halves that only rise or only fall.
fn halves(path: &[Segment]) -> Vec<Segment> {
    let mut pieces = Vec::with_capacity(path.len());
    for segment in path {
        let summit = segment.arc.map(|arc| {
            let radius = length(minus(segment.start, arc.centre_mm));
            [arc.centre_mm[0], arc.centre_mm[1] + radius * f64::from(arc.turns)]
        });
        match summit {
            Some(summit) if summit[0] < segment.start[0] - SAME_MM && summit[0] > segment.end[0] + SAME_MM => {
                pieces.push(Segment {
                    end: summit,
                    ..*segment
                });
                pieces.push(Segment {
                    start: summit,
                    ..*segment
                });
            }
            Some(_) | None => pieces.push(*segment),
        }
    }
    pieces
}

fn falls(segment: &Segment) -> bool {
    segment.end[1] + SAME_MM < segment.start[1]
}

impl Rougher<'_> {
    /// Down along the present segment. The first one, if it is straight, is the way to the profile beside the stock.
    fn dive(&mut self, to: Point) {
        if self.index == 0 && self.path[0].arc.is_none() {
            self.at = to;
            self.cuts.push(Cut::Rapid(to));
        } else {
            self.apply_flow(to);
        }
    }

    /// Cuts along the present segment.
    fn apply_flow(&mut self, to: Point) {
        let segment = self.path[self.index];
        let stays = length(minus(to, self.at)) < SAME_MM;
        self.at = to;
        if stays && segment.arc.is_some() {
            return; // not a full circle
        }
        let cut = along(&segment, to);
        // The two halves of a valley are one arc again.
        if let (Some(Cut::Arc { to: last, arc: before }), Cut::Arc { arc, .. }) = (self.cuts.last_mut(), cut)
            && *before == arc
            && arc.turns < 0
            && length(minus(*last, segment.start)) < SAME_MM
        {
            *last = to;
            return;
        }
        self.cuts.push(cut);
    }

    /// Down to the bottom without cuts beside.
    fn go_down(&mut self) {
        while let Some(segment) = self.path.get(self.index).filter(|segment| falls(segment)) {
            self.dive(segment.end);
            self.index += 1;
        }
    }

    /// Cuts from a falling flank, down to where it ends.
    fn cut_flank(&mut self) -> Result<(), TurningError> {
        while let Some(segment) = self.path.get(self.index).copied().filter(falls) {
            let above = ((self.level - SAME_MM - self.at[1]) / self.step_mm).ceil();
            if above > 0.0 {
                self.level -= above * self.step_mm;
            }
            if self.level < segment.end[1] - SAME_MM {
                self.dive(segment.end);
                self.index += 1;
                continue;
            }
            let level = self.level.max(segment.end[1]);
            let p = segment.crossings(level).last().copied().unwrap_or(segment.end[0]);
            self.dive([p, level]);
            self.cut_ahead();
            if self.cuts.len() > CUTS_MAX {
                return Err(TurningError::TooManyCuts { max: CUTS_MAX });
            }
        }
        Ok(())
    }

    /// Cuts at the present level to the next flank, and comes back.
    fn cut_ahead(&mut self) {
        let [p, q] = self.at;
        for (index, segment) in self.path.iter().enumerate().skip(self.index + 1) {
            let crossings = segment.crossings(q);
            let Some(to) = crossings.first().copied().filter(|to| *to <= p + SAME_MM) else {
                continue;
            };
            if p - to >= SAME_MM {
                // A short cut leaves no room for the whole retract.
                let retract = self.retract_mm.min((p - to) / 2.0);
                self.cuts.extend([
                    Cut::Feed([to, q]),
                    Cut::Rapid([to + retract, q + retract]),
                    Cut::Rapid([p - retract, q + retract]),
                ]);
                self.cuts.push(if self.index == 0 {
                    Cut::Rapid(self.at)
                } else {
                    Cut::Feed(self.at)
                });
            } else if length(minus(self.at, segment.start)) < SAME_MM {
                self.index = index;
                return;
            }
            break;
        }
        self.level -= self.step_mm;
    }

    /// Along the profile up to the next flank that falls; false: it ends.
    fn climb(&mut self) -> bool {
        while let Some(segment) = self.path.get(self.index) {
            if falls(segment) {
                return true;
            }
            self.apply_flow(segment.end);
            self.index += 1;
        }
        false
    }

    /// Along the profile, straight across its pockets.
    fn bridge(&mut self) {
        while let Some(segment) = self.path.get(self.index) {
            let crossings = segment.crossings(self.at[1]);
            if segment.end[1] >= segment.start[1] - SAME_MM
                && let Some(p) = crossings.first()
            {
                self.at[0] = *p;
                self.cuts.push(Cut::Feed(self.at));
                self.apply_flow(segment.end);
            }
            self.index += 1;
        }
    }
}
