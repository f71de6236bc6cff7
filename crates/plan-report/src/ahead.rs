//! The programmed path that comes, line by line, in the order of the path.
//!
//! In:  the programmed path; the lines at which the machine is.
//! Out: what there is to know of the line under way, and of the lines that were left behind.
//!
//! A line that comes again (loops, subroutines) is another one each time: it is found by the order. Memory is for what is planned and
//! not run yet.

use motion::canon::AXES;
use motion::path::Shape;
use motion::plan::Programmed;
use std::collections::VecDeque;

/// A line of the programmed path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Line {
    pub(super) line: u32,
    /// Highest feed of its moves, mm/s; `None`: it has rapid moves only.
    pub(super) feed: Option<f64>,
    pub(super) feed_mm: f64,
    pub(super) rapid_mm: f64,
    /// Whether a curve was programmed (G5, G6.2).
    pub(super) is_curve: bool,
    /// Sharpest corner at the beginning of its moves, degrees.
    pub(super) corner_degrees: f64,
}

/// The lines from the one under way on.
#[derive(Debug, Default)]
pub(super) struct Ahead {
    lines: VecDeque<Line>,
    /// The line that was last looked for, and whether it is the first of them.
    at: Option<(u32, bool)>,
    /// Direction in which the path ends so far.
    direction: Option<[f64; AXES]>,
}

impl Ahead {
    /// The programmed path goes on.
    pub(super) fn push_path(&mut self, part: &Programmed) {
        let length = part.piece.length();
        let is_curve = matches!(part.piece.shape(), Shape::Blend(_));
        let begins = part.piece.jet(0.0).d1;
        let corner_degrees = self.direction.map_or(0.0, |ends| angle_degrees(&ends, &begins));
        self.direction = Some(part.piece.jet(length).d1);
        let (feed, feed_mm, rapid_mm) = if part.rapid {
            (None, 0.0, length)
        } else {
            (Some(part.feed).filter(|feed| feed.is_finite()), length, 0.0)
        };
        match self.lines.back_mut() {
            // The same line may have several feeds in a row: the highest counts.
            Some(last) if last.line == part.line => {
                last.feed = last.feed.into_iter().chain(feed).reduce(f64::max);
                last.feed_mm += feed_mm;
                last.rapid_mm += rapid_mm;
                last.is_curve |= is_curve;
                last.corner_degrees = last.corner_degrees.max(corner_degrees);
            }
            _ => self.lines.push_back(Line {
                line: part.line,
                feed,
                feed_mm,
                rapid_mm,
                is_curve,
                corner_degrees,
            }),
        }
    }

    /// The machine is at a line: what there is to know of it, if it has moves. `behind` gets those that it has left.
    pub(super) fn reach(&mut self, line: u32, mut behind: impl FnMut(&Line)) -> Option<Line> {
        let known = self.at.filter(|(known, _)| *known == line);
        let is_first = match known {
            Some((_, is_first)) => is_first,
            None => match self.lines.iter().position(|own| own.line == line) {
                Some(place) => {
                    self.lines.drain(..place).for_each(|line| behind(&line));
                    true
                }
                None => false,
            },
        };
        self.at = Some((line, is_first));
        self.lines.front().copied().filter(|_| is_first)
    }

    /// The sharpest corner at either end of the line under way, degrees, as far as it is known.
    pub(super) fn corner_degrees(&self) -> f64 {
        let ends = self.lines.iter().take(2);
        ends.map(|line| line.corner_degrees).fold(0.0, f64::max)
    }

    /// The program is over.
    pub(super) fn finish(&mut self, mut behind: impl FnMut(&Line)) {
        self.lines.drain(..).for_each(|line| behind(&line));
    }
}

fn angle_degrees(a: &[f64; AXES], b: &[f64; AXES]) -> f64 {
    let dot = |a: &[f64; AXES], b: &[f64; AXES]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let cosine = dot(a, b) / (dot(a, a) * dot(b, b)).sqrt();
    if cosine.is_finite() {
        cosine.clamp(-1.0, 1.0).acos().to_degrees()
    } else {
        0.0
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use motion::canon::Position;
    use motion::path::Piece;

    /// A straight move.
    pub(crate) fn straight(line: u32, from: [f64; 2], to: [f64; 2], feed: Option<f64>) -> Programmed {
        let place = |[x, y]: [f64; 2]| Position::xyz(x, y, 0.0);
        Programmed {
            piece: Piece::line(place(from), place(to)).unwrap(),
            feed: feed.unwrap_or(f64::INFINITY),
            line,
            rapid: feed.is_none(),
        }
    }

    #[test]
    fn lines_are_found_by_their_order_with_their_corners_and_nothing_is_lost() {
        let mut ahead = Ahead::default();
        ahead.push_path(&straight(3, [0.0, 0.0], [10.0, 0.0], None));
        ahead.push_path(&straight(4, [10.0, 0.0], [10.0, 5.0], Some(20.0)));
        ahead.push_path(&straight(4, [10.0, 5.0], [10.0, 7.0], Some(30.0)));
        ahead.push_path(&straight(3, [10.0, 7.0], [10.0, 8.0], Some(5.0)));
        let mut left = Vec::new();
        let first = ahead.reach(3, |line| left.push(line.line)).unwrap();
        assert_eq!((first.feed, first.rapid_mm), (None, 10.0));
        assert!((ahead.corner_degrees() - 90.0).abs() < 1e-9);
        assert_eq!(ahead.reach(7, |line| left.push(line.line)), None);
        let second = ahead.reach(4, |line| left.push(line.line)).unwrap();
        assert_eq!((second.feed, second.feed_mm), (Some(30.0), 7.0));
        let third = ahead.reach(3, |line| left.push(line.line)).unwrap();
        assert_eq!((third.feed, third.corner_degrees), (Some(5.0), 0.0));
        ahead.finish(|line| left.push(line.line));
        assert_eq!(left, [3, 4, 3]);
    }
}
