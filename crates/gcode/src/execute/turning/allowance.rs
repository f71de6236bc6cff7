//! The path beside a profile: what roughing leaves, and what finishing passes cut before the last one.
//!
//! In:  a profile in its frame, without the way to its start; the distance.
//! Out: a path to the right of it (towards the tool). Outer corners are rounded about their vertex, inner ones cut where
//!      the two sides meet, and what has no room between its neighbours is left out. Where that leads nowhere (a valley too
//!      narrow, an arc that leaves one at an angle) it is what a disc of that radius touches that comes from above.

use super::segment::{Point, SAME_MM, Segment, cross, length, minus};
use crate::execute::circle::Arc;

/// How much nearer than asked the path may come, mm.
const TOLERANCE_MM: f64 = 1e-4;
/// Places of a segment at which its distance is looked at.
const SAMPLES_PER_SEGMENT: u32 = 16;

/// The path so far to the right of a profile; negative: to the left. `None`: there is no such path.
pub(super) fn beside(profile: &[Segment], right_mm: f64) -> Option<Vec<Segment>> {
    let path = joined(profile, right_mm);
    if path.is_none() && right_mm > 0.0 {
        return above(profile, right_mm);
    }
    path
}

/// Segment by segment, each joined to the one before.
fn joined(profile: &[Segment], right_mm: f64) -> Option<Vec<Segment>> {
    if right_mm == 0.0 {
        return Some(profile.to_vec());
    }
    let mut path: Vec<Segment> = Vec::with_capacity(profile.len());
    for (index, segment) in profile.iter().enumerate() {
        let Some(mut next) = segment.beside(right_mm) else {
            continue; // an arc with less than this radius: its neighbours meet
        };
        if let Some(before) = index.checked_sub(1).map(|index| profile[index]) {
            let turn = cross(before.direction(before.end), segment.direction(segment.start));
            let gap = path.last().map_or(0.0, |last| length(minus(next.start, last.end)));
            if gap > SAME_MM && turn * right_mm > 0.0 {
                let last = path.last()?;
                let turns = if right_mm > 0.0 { 1 } else { -1 };
                path.push(Segment {
                    of: segment.of,
                    ..Segment::arc(last.end, next.start, segment.start, turns)
                });
            } else if gap > SAME_MM {
                join(&mut path, &mut next)?;
            }
        }
        path.push(next);
    }
    let clear = |point: [f64; 2]| {
        // The profile goes to smaller p, so most of it is seen at once to be far away.
        let near =
            |segment: &&Segment| segment.start[0] + right_mm >= point[0] && segment.end[0] - right_mm <= point[0];
        let mut near = profile.iter().filter(near);
        near.all(|segment| segment.distance(point) >= right_mm - TOLERANCE_MM)
    };
    let keeps = |segment: &Segment| {
        (0..=SAMPLES_PER_SEGMENT).all(|at| clear(segment.at(f64::from(at) / f64::from(SAMPLES_PER_SEGMENT))))
    };
    (!path.is_empty() && (right_mm < 0.0 || path.iter().all(keeps))).then_some(path)
}

/// Cuts the end of a path and the segment behind it where they meet; takes off what lies beyond.
fn join(path: &mut Vec<Segment>, next: &mut Segment) -> Option<()> {
    while let Some(last) = path.last_mut() {
        let on_both = |point: &[f64; 2]| {
            let within = |share: f64| (-1e-9..=1.0 + 1e-9).contains(&share);
            within(last.share(*point)) && within(next.share(*point))
        };
        let near = |a: &[f64; 2], b: &[f64; 2]| {
            let distance = |point: &[f64; 2]| length(minus(*point, last.end));
            distance(a).total_cmp(&distance(b))
        };
        if let Some(point) = last.meets(next).into_iter().filter(on_both).min_by(near) {
            last.end = point;
            next.start = point;
            return Some(());
        }
        path.pop();
    }
    None
}

/// What a disc touches that comes from above, whose centre the path is: the highest of all that is beside the segments and
/// around their ends.
pub(super) fn above(profile: &[Segment], radius_mm: f64) -> Option<Vec<Segment>> {
    let (first, last) = (profile.first()?, profile.last()?);
    let start = first.beside(radius_mm).map_or(first.start, |beside| beside.start);
    let end = last.beside(radius_mm).map_or(last.end, |beside| beside.end);
    if start[0] < end[0] {
        return None; // a wall, and back along it
    }
    let vertices = profile.iter().map(|segment| (segment.end, segment.of));
    let vertices = vertices.chain([(first.start, first.of)]);
    let around = |(vertex, of): (Point, u32)| {
        let [p, q] = vertex;
        Segment {
            of,
            ..Segment::arc([p + radius_mm, q], [p - radius_mm, q], vertex, 1)
        }
    };
    let upright = |segment: &Segment| segment.start[0] - segment.end[0] < SAME_MM;
    let sides = profile.iter().filter_map(|segment| segment.beside(radius_mm));
    let parts: Vec<Segment> = sides
        .filter(|side| !upright(side))
        .chain(vertices.map(around))
        .collect();
    // Between these places one of the parts is the highest.
    let mut places = vec![start[0], end[0]];
    for (index, part) in parts.iter().enumerate() {
        places.extend([part.start[0], part.end[0]]);
        for other in &parts[index + 1..] {
            if other.end[0] < part.start[0] && part.end[0] < other.start[0] {
                places.extend(part.meets(other).into_iter().map(|place| place[0]));
            }
        }
    }
    places.retain(|p| (end[0]..=start[0]).contains(p));
    places.sort_by(|a, b| b.total_cmp(a));
    // Where an arc begins upright, its height grows by much more than the way along.
    places.dedup_by(|a, b| (*a - *b).abs() < 1e-3 * SAME_MM);
    let mut path: Vec<Segment> = Vec::new();
    let mut at = start;
    let mut of: Option<usize> = None;
    for ends in places.windows(2) {
        let middle = 0.5 * (ends[0] + ends[1]);
        let heights = parts.iter().map(|part| height(part, middle)).enumerate();
        let (highest, _) = heights
            .filter_map(|(index, q)| Some((index, q?)))
            .max_by(|a, b| a.1.total_cmp(&b.1))?;
        let part = parts[highest];
        // Between two arcs that all but touch, each is as high as its end, and none is there.
        let narrow = ends[0] - ends[1] <= 2.0 * SAME_MM;
        let [from, to] = [ends[0], ends[1]].map(|p| [p, height(&part, p).unwrap_or(at[1])]);
        if of == Some(highest)
            && let Some(before) = path.last_mut()
        {
            before.end = to;
        } else {
            // Where even the first or the last place is too low, the path begins or ends above it.
            let begins_above = path.is_empty() && from[1] > at[1];
            if length(minus(from, at)) > SAME_MM && !begins_above {
                path.push(Segment {
                    of: part.of,
                    ..Segment::line(at, from)
                });
            }
            path.push(Segment {
                start: from,
                end: to,
                arc: part.arc.filter(|_| !narrow),
                of: part.of,
            });
        }
        (at, of) = (to, (!narrow).then_some(highest));
    }
    if end[1] > at[1] + SAME_MM {
        path.push(Segment {
            of: last.of,
            ..Segment::line(at, end)
        });
    }
    (!path.is_empty()).then_some(path)
}

/// Where a segment is at a place along; `None`: not there.
fn height(segment: &Segment, p: f64) -> Option<f64> {
    let (high, low) = (segment.start[0], segment.end[0]);
    if !(low - SAME_MM..=high + SAME_MM).contains(&p) {
        return None;
    }
    Some(match segment.arc {
        None => segment.start[1] + (segment.end[1] - segment.start[1]) * ((high - p) / (high - low)),
        Some(Arc { centre_mm, turns }) => {
            let radius = length(minus(segment.start, centre_mm));
            let along = p - centre_mm[0];
            // Towards smaller p a circle is run on its upper half counter-clockwise.
            centre_mm[1] + f64::from(turns) * ((radius - along) * (radius + along)).max(0.0).sqrt()
        }
    })
}
