//! Logarithmic axes, and labels that do not stand on each other.

use plot::sheet::{Anchor, Face};

/// Values on a line of pixels, one decade as long as the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Log {
    /// Powers of ten at both ends.
    decades: (i32, i32),
    pixels: (f64, f64),
}

/// No axis is longer: 12 decades.
const DECADES_MAX: i32 = 12;

impl Log {
    /// Whole decades that hold both values, which need not be sensible.
    pub(super) fn holding(least: f64, most: f64, pixels: (f64, f64)) -> Log {
        let decade = |value: f64| {
            if value > 0.0 && value.is_finite() {
                value.log10()
            } else {
                0.0
            }
        };
        let first = (decade(least) + 1e-9).floor().clamp(-9.0, 12.0) as i32;
        let last = ((decade(most) - 1e-9).ceil() as i32).clamp(first + 1, first + DECADES_MAX);
        Log {
            decades: (first, last),
            pixels,
        }
    }

    /// Where a value lies; those outside lie at the ends.
    pub(super) fn place(&self, value: f64) -> f64 {
        let (first, last) = (f64::from(self.decades.0), f64::from(self.decades.1));
        let share = match value {
            value if value > 0.0 => (value.log10() - first) / (last - first),
            // Zero, negative or NaN.
            _ => 0.0,
        };
        self.pixels.0 + share.clamp(0.0, 1.0) * (self.pixels.1 - self.pixels.0)
    }

    /// The powers of ten.
    pub(super) fn ticks(&self) -> impl Iterator<Item = f64> + use<> {
        (self.decades.0..=self.decades.1).map(|decade| 10_f64.powi(decade))
    }

    pub(super) fn ends(&self) -> (f64, f64) {
        (10_f64.powi(self.decades.0), 10_f64.powi(self.decades.1))
    }
}

/// Finds room for labels beside marks on lines above each other.
#[derive(Debug)]
pub(super) struct Labels {
    face: Face,
    /// Left and right end of the room.
    room: (f64, f64),
    /// Taken: line, from, to.
    taken: Vec<(usize, f64, f64)>,
}

impl Labels {
    pub(super) fn new(face: Face, room: (f64, f64)) -> Labels {
        Labels {
            face,
            room,
            taken: Vec::new(),
        }
    }

    /// The line and the side on which a label of a mark at `x` stands free; `None` where there is no room on so many lines.
    pub(super) fn find(&mut self, x: f64, text: &str, lines: usize) -> Option<(usize, Anchor)> {
        let width = self.face.width(text) + 8.0;
        let found = (0..lines)
            .flat_map(|line| [(line, Anchor::Start), (line, Anchor::End)])
            .find(|(line, anchor)| {
                let (from, to) = span(x, width, *anchor);
                let apart = |(other, left, right): &(usize, f64, f64)| other != line || to < *left || *right < from;
                from >= self.room.0 && to <= self.room.1 && self.taken.iter().all(apart)
            })?;
        let (from, to) = span(x, width, found.1);
        self.taken.push((found.0, from, to));
        Some(found)
    }
}

fn span(x: f64, width: f64, anchor: Anchor) -> (f64, f64) {
    match anchor {
        Anchor::Start => (x, x + width),
        Anchor::Middle => (x - width / 2.0, x + width / 2.0),
        Anchor::End => (x - width, x),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decades_by_hand() {
        let axis = Log::holding(0.3, 20.0, (100.0, 400.0));
        assert_eq!(axis.ends(), (0.1, 100.0));
        let places = [0.1, 1.0, 100.0, 1e9, 0.0, -5.0, f64::NAN].map(|value| axis.place(value).round());
        assert_eq!(places, [100.0, 200.0, 400.0, 400.0, 100.0, 100.0, 100.0]);
        assert_eq!(axis.ticks().count(), 4);
        // Whole powers of ten are held by themselves.
        assert_eq!(Log::holding(1.0, 100.0, (0.0, 1.0)).ends(), (1.0, 100.0));
        for (least, most) in [(0.0, 0.0), (f64::NAN, f64::INFINITY), (1e300, 1e-300), (5.0, 5.0)] {
            let axis = Log::holding(least, most, (0.0, 1.0));
            assert!(axis.ends().0 < axis.ends().1, "{least} {most} {axis:?}");
        }
    }

    #[test]
    fn labels_find_room_or_are_left_out() {
        let mut labels = Labels::new(Face::new(10.0, "black"), (0.0, 100.0));
        // 5 characters of 5.7 pixels and 8 more: 36.5 pixels.
        assert_eq!(labels.find(50.0, "abcde", 2), Some((0, Anchor::Start)));
        assert_eq!(labels.find(49.0, "abcde", 2), Some((0, Anchor::End)));
        assert_eq!(labels.find(90.0, "abcde", 2), Some((1, Anchor::End)));
        assert_eq!(labels.find(20.0, "abcde", 1), None);
    }
}
