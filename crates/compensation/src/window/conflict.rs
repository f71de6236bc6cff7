//! Whether one move of the centre cuts into one move of the contour.

use super::super::element::{Closest, Element};
use super::super::geometry::{Point, add, cross, length, sub};
use super::{DEPTH_TOLERANCE_MM, Mark, TOLERANCE_MM, Track, Wall};

/// Halvings of two moves until what they may have in common is taken for a cut.
const HALVINGS: u32 = 16;

/// No more than this of the radius is left to the path's tolerance: with as much as a radius nothing would be compared.
const TOLERANCE_MAX_RADII: f64 = 0.1;

/// Where the centre comes too close, if it does.
pub(super) fn conflict(track: &Track, wall: &Wall, radius: f64) -> Option<Closest> {
    if !meet(&track.mark, &wall.mark) {
        return None;
    }
    let allowed = allowed_mm(track, wall, radius) - track.mark.tolerance_mm.min(TOLERANCE_MAX_RADII * radius);
    if is_beside(&track.element, &wall.element, allowed) || is_beside(&wall.element, &track.element, allowed) {
        return None;
    }
    let tool = Way {
        element: track.element,
        depth: track.mark.depth,
    };
    let wall_way = Way {
        element: wall.element,
        depth: wall.mark.depth,
    };
    // A contour that begins later goes, above this move, through what is cut already.
    let top = if wall.run >= track.walls {
        tool.highest()
    } else {
        f64::INFINITY
    };
    match track.joint {
        None => cut(&tool, top, &wall_way, allowed, HALVINGS),
        Some(joint) => away_from(&wall.element, joint, 2.0 * radius)
            .into_iter()
            .flatten()
            .filter_map(|part| cut(&tool, top, &wall_way.between(part), allowed, HALVINGS))
            .min_by(|a, b| a.distance.total_cmp(&b.distance)),
    }
}

/// A move with its way along the plane's normal, which goes evenly from the start to the end.
#[derive(Clone, Copy)]
struct Way {
    element: Element,
    depth: [f64; 2],
}

impl Way {
    fn between(&self, part: [f64; 2]) -> Way {
        Way {
            element: self.element.between(part),
            depth: depth_between(self.depth, part),
        }
    }

    fn lowest(&self) -> f64 {
        self.depth[0].min(self.depth[1])
    }

    fn highest(&self) -> f64 {
        self.depth[0].max(self.depth[1])
    }
}

/// Depths at the ends of a part of a move.
pub(super) fn depth_between(depth: [f64; 2], part: [f64; 2]) -> [f64; 2] {
    part.map(|part| depth[0] * (1.0 - part) + depth[1] * part)
}

/// Where a tool is closest to a wall, if it is closer than `allowed` where neither its end is above the wall nor the wall above
/// `top`. The steeper one of both is halved until that is known.
fn cut(tool: &Way, top: f64, wall: &Way, allowed: f64, halvings: u32) -> Option<Closest> {
    if tool.lowest() > wall.highest() + DEPTH_TOLERANCE_MM || wall.lowest() > top + DEPTH_TOLERANCE_MM {
        return None;
    }
    let closest = tool.element.closest(&wall.element);
    if closest.distance >= allowed {
        return None;
    }
    let is_known = tool.highest() <= wall.lowest() + DEPTH_TOLERANCE_MM && wall.highest() <= top + DEPTH_TOLERANCE_MM;
    if is_known || halvings == 0 {
        return Some(closest);
    }
    let halves = |way: &Way| [[0.0, 0.5], [0.5, 1.0]].map(|part| way.between(part));
    let pairs = if tool.highest() - tool.lowest() > wall.highest() - wall.lowest() {
        halves(tool).map(|tool| (tool, *wall))
    } else {
        halves(wall).map(|wall| (*tool, wall))
    };
    pairs
        .into_iter()
        .filter_map(|(tool, wall)| cut(&tool, top, &wall, allowed, halvings - 1))
        .min_by(|a, b| a.distance.total_cmp(&b.distance))
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

/// Whether two moves have a depth in common, and other axes in the same place.
pub(super) fn meet(a: &Mark, b: &Mark) -> bool {
    let [low, high] = [f64::min, f64::max].map(|end| [a, b].map(|mark| end(mark.depth[0], mark.depth[1])));
    a.pose == b.pose && low[0] <= high[1] + DEPTH_TOLERANCE_MM && low[1] <= high[0] + DEPTH_TOLERANCE_MM
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

/// What of an element lies further from a point than `radius`: parts of its way between the places where it passes that distance.
fn away_from(element: &Element, point: Point, radius: f64) -> [Option<[f64; 2]>; 3] {
    let circle = Element::arc(add(point, [radius, 0.0]), add(point, [radius, 0.0]), point, 1);
    let mut cuts = [0.0, 1.0, 1.0, 1.0];
    for (cut, crossing) in cuts[1..3].iter_mut().zip(element.crossings(&circle)) {
        *cut = element.part_at(crossing);
    }
    cuts.sort_by(f64::total_cmp);
    std::array::from_fn(|i| {
        let part = [cuts[i], cuts[i + 1]];
        let middle = element.at(0.5 * (part[0] + part[1]));
        (part[1] > part[0] && length(sub(middle, point)) > radius).then_some(part)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_near_a_point_is_left_out() {
        let line = Element::line([-10.0, 0.0], [10.0, 0.0]);
        let away = |element: &Element, point| {
            let parts = away_from(element, point, 2.0).into_iter().flatten();
            parts.map(|part| element.between(part)).collect::<Vec<Element>>()
        };
        let pieces = away(&line, [0.0, 0.0]);
        assert_eq!(pieces.len(), 2);
        assert!((pieces[0].to[0] + 2.0).abs() < 1e-12 && (pieces[1].from[0] - 2.0).abs() < 1e-12);
        assert_eq!(away_from(&line, [0.0, 3.0], 2.0).into_iter().flatten().count(), 1);
        assert_eq!(away_from(&line, [0.0, 0.0], 20.0).into_iter().flatten().count(), 0);
        let circle = Element::arc([5.0, 0.0], [5.0, 0.0], [0.0, 0.0], 1);
        let pieces = away(&circle, [5.0, 0.0]);
        assert_eq!(pieces.len(), 1);
        assert!(
            (pieces[0].length() - (circle.length() - 10.0 * 2.0 * 0.2f64.asin())).abs() < 1e-9,
            "{pieces:?}"
        );
    }
}
