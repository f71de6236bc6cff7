//! Whether one move of the centre cuts into one move of the contour.

use super::super::element::{Closest, Element};
use super::super::geometry::{Point, add, cross, length, sub};
use super::{DEPTH_TOLERANCE_MM, Mark, TOLERANCE_MM, Track, Wall};

/// Where the centre comes too close, if it does.
pub(super) fn conflict(track: &Track, wall: &Wall, radius: f64) -> Option<Closest> {
    if !meet(&track.mark, &wall.mark) {
        return None;
    }
    let allowed = allowed_mm(track, wall, radius);
    if is_beside(&track.element, &wall.element, allowed) || is_beside(&wall.element, &track.element, allowed) {
        return None;
    }
    let closest = match track.joint {
        None => track.element.closest(&wall.element),
        Some(joint) => away_from(&wall.element, joint, 2.0 * radius)
            .into_iter()
            .flatten()
            .map(|part| track.element.closest(&part))
            .min_by(|a, b| a.distance.total_cmp(&b.distance))?,
    };
    (closest.distance < allowed).then_some(closest)
}

/// Whether all of a line is on one side of another, endless one and no closer to it than `least`: so it is with most
/// neighbours, and costs little to see.
fn is_beside(endless: &Element, line: &Element, least: f64) -> bool {
    if endless.arc.is_some() || line.arc.is_some() {
        return false;
    }
    let way = sub(endless.to, endless.from);
    let height = [line.from, line.to].map(|end| cross(way, sub(end, endless.from)));
    let least = least * length(way);
    least > 0.0 && (height[0].min(height[1]) >= least || height[0].max(height[1]) <= -least)
}

/// Whether two moves are at the same depth, and other axes in the same place.
pub(super) fn meet(a: &Mark, b: &Mark) -> bool {
    a.pose == b.pose && a.depth[0] <= b.depth[1] + DEPTH_TOLERANCE_MM && b.depth[0] <= a.depth[1] + DEPTH_TOLERANCE_MM
}

/// How close the centre may come to a wall.
pub(super) fn allowed_mm(track: &Track, wall: &Wall, radius: f64) -> f64 {
    let flat = if track.mark.chain == wall.mark.chain {
        2.0 * radius * (1.0 - libm::cos(track.mark.bend.max(wall.mark.bend)))
    } else {
        0.0
    };
    radius - TOLERANCE_MM - flat - track.element.mismatch() - wall.element.mismatch()
}

/// What of an element lies further from a point than `radius`: pieces between the places where it passes that distance.
fn away_from(element: &Element, point: Point, radius: f64) -> [Option<Element>; 3] {
    let circle = Element::arc(add(point, [radius, 0.0]), add(point, [radius, 0.0]), point, 1);
    let mut cuts = [0.0, 1.0, 1.0, 1.0];
    for (cut, crossing) in cuts[1..3].iter_mut().zip(element.crossings(&circle)) {
        *cut = element.part_at(crossing);
    }
    cuts.sort_by(f64::total_cmp);
    std::array::from_fn(|i| {
        let part = [cuts[i], cuts[i + 1]];
        let middle = element.at(0.5 * (part[0] + part[1]));
        (part[1] > part[0] && length(sub(middle, point)) > radius).then(|| element.between(part))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_near_a_point_is_left_out() {
        let line = Element::line([-10.0, 0.0], [10.0, 0.0]);
        let pieces: Vec<Element> = away_from(&line, [0.0, 0.0], 2.0).into_iter().flatten().collect();
        assert_eq!(pieces.len(), 2);
        assert!((pieces[0].to[0] + 2.0).abs() < 1e-12 && (pieces[1].from[0] - 2.0).abs() < 1e-12);
        assert_eq!(away_from(&line, [0.0, 3.0], 2.0).into_iter().flatten().count(), 1);
        assert_eq!(away_from(&line, [0.0, 0.0], 20.0).into_iter().flatten().count(), 0);
        let circle = Element::arc([5.0, 0.0], [5.0, 0.0], [0.0, 0.0], 1);
        let pieces: Vec<Element> = away_from(&circle, [5.0, 0.0], 2.0).into_iter().flatten().collect();
        assert_eq!(pieces.len(), 1);
        assert!(
            (pieces[0].length() - (circle.length() - 10.0 * 2.0 * 0.2f64.asin())).abs() < 1e-9,
            "{pieces:?}"
        );
    }
}
