//! Leaves out what the tool cannot reach: where its path comes too close to the contour, it goes on where it crosses itself.
//!
//! In:  the contour, and the path of the centre beside each of its moves from end to end, with an arc about each corner.
//! Out: the same path without its loops.
//!
//! ```text
//!        ___________                 the path beside both walls of a neck that is narrower than the tool crosses itself
//!   ____/           \                at x; all between, around the belly, is dropped
//!  .....x...........|
//!   ____  ..........|                An inner corner is the same in small: both paths end where they cross.
//!       \___________/
//! ```
//!
//! Each move of the path is divided into what keeps its distance from all walls and what does not. Where the path comes to
//! something that does not, the last crossing before it with a later move that does is where it goes on. Only moves of
//! one contour can be left out, and nothing of the entry and the exit: else it is a gouge like any other.

use motion::canon::{Call, Event, Position};

use super::super::element::Element;
use super::super::geometry::{Point, add, left, length, scale, sub, unit};
use super::super::{CompensationErrorKind as Kind, end_of, end_of_mut, in_plane, with_plane};
use super::conflict::allowed_mm;
use super::{Track, Wall, Window};

/// Lengths up to this are rounding, mm.
const ROUNDING_MM: f64 = 1e-7;

/// A crossing is looked for among so many moves that were kept before.
const BACK_MAX: usize = 64;

/// From and to on a move, by the part of its way.
type Span = [f64; 2];

/// What is kept of a move.
#[derive(Clone, Copy, Debug)]
struct Piece {
    track: usize,
    span: Span,
}

/// A move of the path and what of it is far enough from all walls.
struct Judged {
    track: Track,
    free: Vec<Span>,
    gouge: Option<Kind>,
}

/// Drops the loops of all that waits.
pub(super) fn drop_loops(window: &mut Window) -> Result<(), Kind> {
    let mut path = Vec::with_capacity(window.tracks.len());
    for number in window.tracks.numbers() {
        if let Some(track) = window.tracks.get(number).copied() {
            path.push(judge(window, track)?);
        }
    }
    if path.iter().any(|judged| judged.gouge.is_some()) {
        let pieces = walk(window, &path)?;
        rewrite(window, &path, &pieces);
    }
    Ok(())
}

fn judge(window: &mut Window, track: Track) -> Result<Judged, Kind> {
    let radius = window.radius;
    let walls = window.gouged(&track);
    let gouge = walls.first().and_then(|wall| window.gouge_of(&track, wall));
    let stays = track.joint.is_some() || track.element.arc.is_some_and(|arc| arc.sweep.abs() > 6.3);
    match gouge {
        Some(gouge) if stays || walls.iter().any(|wall| wall.run != track.run) => Err(gouge),
        Some(_) | None => Ok(Judged {
            free: free_spans(&track, &walls, radius),
            track,
            gouge,
        }),
    }
}

/// What of a move keeps its distance from the walls.
fn free_spans(track: &Track, walls: &[Wall], radius: f64) -> Vec<Span> {
    let element = &track.element;
    let mut cuts = vec![0.0, 1.0];
    for wall in walls {
        for border in borders(&wall.element, allowed_mm(track, wall, radius)) {
            cuts.extend(element.crossings(&border).map(|at| element.part_at(at)));
        }
    }
    cuts.sort_by(f64::total_cmp);
    let mut free: Vec<Span> = Vec::new();
    for span in cuts.windows(2) {
        let middle = element.at(0.5 * (span[0] + span[1]));
        let is_free = walls
            .iter()
            .all(|wall| length(sub(middle, wall.element.nearest(middle))) >= allowed_mm(track, wall, radius));
        if !is_free || span[1] <= span[0] {
            continue;
        }
        match free.last_mut() {
            Some(last) if last[1] == span[0] => last[1] = span[1],
            Some(_) | None => free.push([span[0], span[1]]),
        }
    }
    free
}

/// Curves on which all points lie that have a distance from an element, and others.
fn borders(element: &Element, distance: f64) -> impl Iterator<Item = Element> {
    let circle = |centre: Point, radius: f64| {
        let start = add(centre, [radius, 0.0]);
        Element::arc(start, start, centre, 1)
    };
    let beside = |distance: f64| match element.arc {
        Some(arc) => circle(arc.centre, (arc.radius + distance).abs()),
        None => {
            let by = scale(left(unit(sub(element.to, element.from))), distance);
            Element::line(add(element.from, by), add(element.to, by))
        }
    };
    let ends = [element.at(0.0), element.to].map(|end| circle(end, distance));
    ends.into_iter().chain([beside(distance), beside(-distance)])
}

/// The pieces of the path that are kept, in order.
fn walk(window: &mut Window, path: &[Judged]) -> Result<Vec<Piece>, Kind> {
    let mut pieces: Vec<Piece> = Vec::new();
    let (mut at, mut from) = (0, 0.0);
    while let Some(judged) = path.get(at) {
        let slack = rounding(&judged.track.element);
        let end = judged
            .free
            .iter()
            .find(|span| span[0] <= from + slack && span[1] > from)
            .map_or(from, |span| span[1]);
        if end >= 1.0 - slack || judged.track.element.length() < ROUNDING_MM && !judged.free.is_empty() {
            pieces.push(Piece {
                track: at,
                span: [from, 1.0],
            });
            (at, from) = (at + 1, 0.0);
            continue;
        }
        pieces.push(Piece {
            track: at,
            span: [from, end],
        });
        let Some(jump) = jump(window, path, &pieces, at) else {
            // Some wall is in the way, be it that of the next move.
            let gouge = judged
                .gouge
                .or_else(|| path[at..].iter().find_map(|judged| judged.gouge));
            return Err(gouge.unwrap_or(Kind::NotFinite));
        };
        pieces.truncate(jump.keep + 1);
        pieces[jump.keep].span[1] = jump.leave;
        (at, from) = (jump.to.track, jump.to.span[0]);
    }
    Ok(pieces)
}

/// Where the path goes on.
struct Jump {
    /// The last piece that is kept.
    keep: usize,
    leave: f64,
    to: Piece,
}

/// The last crossing of the path so far with a move behind number `blocked`.
fn jump(window: &mut Window, path: &[Judged], pieces: &[Piece], blocked: usize) -> Option<Jump> {
    let run = path[blocked].track.run;
    let first = path[blocked].track.event;
    for (keep, piece) in pieces.iter().enumerate().rev().take(BACK_MAX) {
        let track = path[piece.track].track;
        if track.run != run || track.joint.is_some() {
            return None;
        }
        let mut later = Vec::new();
        window.tracks.near(&track.element, |other| {
            if other.event > first && other.run == run && other.joint.is_none() {
                later.push(other.event);
            }
            None::<()>
        });
        later.sort_unstable();
        let mut best: Option<Jump> = None;
        for event in later {
            let Ok(other) = path.binary_search_by_key(&event, |judged| judged.track.event) else {
                continue;
            };
            let there = &path[other];
            for crossing in track.element.crossings(&there.track.element) {
                let leave = track.element.part_at(crossing);
                let enter = there.track.element.part_at(crossing);
                let (slack, slack_there) = (rounding(&track.element), rounding(&there.track.element));
                let is_free = there
                    .free
                    .iter()
                    .any(|span| span[0] <= enter + slack_there && enter < span[1] - slack_there);
                let is_kept = piece.span[0] - slack <= leave && leave <= piece.span[1] + slack;
                if is_free && is_kept && best.as_ref().is_none_or(|best| leave > best.leave) {
                    best = Some(Jump {
                        keep,
                        leave: leave.max(piece.span[0]),
                        to: Piece {
                            track: other,
                            span: [enter, 1.0],
                        },
                    });
                }
            }
        }
        if best.is_some() {
            return best;
        }
    }
    None
}

/// The part of the way that is rounding.
fn rounding(element: &Element) -> f64 {
    ROUNDING_MM / element.length().max(1.0)
}

/// Makes the waiting events those of the pieces.
fn rewrite(window: &mut Window, path: &[Judged], pieces: &[Piece]) {
    let plane = window.plane;
    let mut kept = pieces.iter().peekable();
    let mut tracks = path.iter().enumerate().peekable();
    let mut at: Option<Position> = None;
    let first = window.gone;
    let mut number = 0;
    window.waiting.retain_mut(|waiting| {
        let event = first + number;
        number += 1;
        let Some((index, judged)) = tracks.next_if(|(_, judged)| judged.track.event == event) else {
            at = end_of(&waiting.event.call).copied().or(at);
            return true;
        };
        let before = at;
        let Some(piece) = kept.next_if(|piece| piece.track == index) else {
            // Left out, but for what other axes do.
            let (Some(before), Some(to)) = (before, end_of(&waiting.event.call)) else {
                return false;
            };
            let to = with_plane(*to, plane, in_plane(&before, plane));
            waiting.event.call = Call::StraightFeed { to };
            at = Some(to);
            return to != before;
        };
        let element = judged.track.element;
        if piece.span[1] < 1.0
            && let Some(to) = end_of_mut(&mut waiting.event.call)
        {
            *to = with_plane(*to, plane, add(element.at(piece.span[1]), window.shift));
        }
        shorten(&mut waiting.event, &element.between(piece.span));
        at = end_of(&waiting.event.call).copied();
        at != before
    });
}

/// Makes an arc's turns those of what is left of it.
fn shorten(event: &mut Event, left: &Element) {
    if let (Call::ArcFeed { to, turns, .. }, Some(arc)) = (&mut event.call, left.arc) {
        if left.length() < 10.0 * ROUNDING_MM {
            event.call = Call::StraightFeed { to: *to };
        } else {
            // Loops are dropped of arcs of one turn at most.
            *turns = if left.arc.is_some_and(|arc| arc.sweep.abs() > 6.3) {
                *turns
            } else {
                arc.sweep.signum() as i32
            };
        }
    }
}
