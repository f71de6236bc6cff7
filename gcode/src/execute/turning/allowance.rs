//! The path beside a profile: what roughing leaves, and what finishing passes cut before the last one.
//!
//! In:  a profile in its frame, without the way to its start; the distance.
//! Out: a path to the right of it (towards the tool). Outer corners are rounded about their vertex, inner ones cut where
//!      the two sides meet, and what has no room between its neighbours is left out.

use super::segment::{SAME_MM, Segment, cross, length, minus};

/// How much nearer than asked the path may come, mm.
const TOLERANCE_MM: f64 = 1e-4;
/// Places of a segment at which its distance is looked at.
const SAMPLES: u32 = 16;

/// The path so far to the right of a profile; negative: to the left. `None`: there is no such path.
pub(super) fn beside(profile: &[Segment], right_mm: f64) -> Option<Vec<Segment>> {
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
                path.push(Segment::arc(last.end, next.start, segment.start, turns));
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
    let keeps = |segment: &Segment| (0..=SAMPLES).all(|at| clear(segment.at(f64::from(at) / f64::from(SAMPLES))));
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
