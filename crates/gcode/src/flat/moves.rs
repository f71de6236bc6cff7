//! Moves, and the words of axes and feeds in them.
//!
//! In:  where a move ends, work coordinates in mm and degrees; where the axes stand, the feed in force.
//! Out: G0, G1, G2, G3, G5.2, G33, G33.1 and G38.x with the axes that move, and F on the first move that it concerns.

use super::line::Exactness;
use super::{FlatWriter, SAME_MM_OR_DEGREES, Unwritable};
use crate::code::plane_name;
use crate::execute::circle;
use motion::canon::{AXES, Axis, LengthUnit, Plane, Position};

impl FlatWriter {
    /// Adds the words of a move to the line that was begun, and ends it; the axes stand at `to` behind it.
    pub(super) fn move_to(&mut self, to: Position) -> Result<(), Unwritable> {
        self.push_axes(to)?;
        if !self.line.has_words() {
            self.push_axis(Axis::X, to)?;
        }
        self.end_move(to)
    }

    fn push_axes(&mut self, to: Position) -> Result<(), Unwritable> {
        for axis in Axis::ALL {
            if to[axis] != self.at[axis] || !self.known[axis as usize] {
                self.push_axis(axis, to)?;
            }
        }
        Ok(())
    }

    fn push_axis(&mut self, axis: Axis, to: Position) -> Result<(), Unwritable> {
        if self.wrapped_rotary[axis as usize] {
            let place = wrapped_word(self.at[axis], to[axis]).ok_or(Unwritable::Wrapped(axis.letter()))?;
            self.line.signed_word(axis.letter(), place);
            self.known[axis as usize] = false; // a place and some turns: rounded
        } else {
            self.line.word(axis.letter(), to[axis]);
            self.known[axis as usize] = true;
        }
        Ok(())
    }

    fn end_move(&mut self, to: Position) -> Result<(), Unwritable> {
        if self.push_line()? == Exactness::Rounded {
            self.known = [false; AXES];
        }
        self.at = to;
        Ok(())
    }

    /// Adds F to the line if it is not the one in force. `to`: where the move ends.
    fn push_feed(&mut self, to: Position) -> Result<(), Unwritable> {
        let moves = |axis: &Axis| (to[*axis] - self.at[*axis]).abs() > SAME_MM_OR_DEGREES;
        let (rotary, linear): (Vec<Axis>, Vec<Axis>) = Axis::ALL
            .iter()
            .filter(|axis| moves(axis))
            .partition(|axis| axis.is_rotary());
        let turns_only = linear.is_empty() && !rotary.is_empty();
        if let Some(word) = self.feed.changed_word(turns_only)? {
            self.line.word('F', word);
        }
        Ok(())
    }

    pub(super) fn straight_feed(&mut self, to: Position) -> Result<(), Unwritable> {
        let Some((spindle, mm_per_turn)) = self.synchronised else {
            self.line.begin("G1");
            self.push_axes(to)?;
            if !self.line.has_words() {
                self.push_axis(Axis::X, to)?;
            }
            self.push_feed(to)?;
            return self.end_move(to);
        };
        self.line.begin("G33");
        self.push_axes(to)?;
        if !self.line.has_words() {
            self.push_axis(Axis::Z, to)?;
        }
        self.line.word('K', mm_per_turn).spindle(spindle);
        self.end_move(to)
    }

    pub(super) fn arc(
        &mut self,
        to: Position,
        plane: Plane,
        centre_mm: [f64; 2],
        turns: i32,
    ) -> Result<(), Unwritable> {
        if self.synchronised.is_some() {
            return Err(Unwritable::Synchronised("an arc"));
        }
        let [first, second, _] = plane.axes();
        let in_plane = |position: Position| [position[first], position[second]];
        circle::by_centre(
            in_plane(self.at),
            in_plane(to),
            centre_mm,
            turns,
            LengthUnit::Millimetre,
            self.arc_tolerance_mm,
        )
        .and_then(|_| circle::turns_of(f64::from(turns).abs()))
        .map_err(|kind| Unwritable::Arc(kind.to_string()))?;
        self.line.begin(if turns < 0 { "G2" } else { "G3" });
        if plane != self.plane {
            self.plane = plane;
            self.line.code(plane_name(plane));
        }
        self.push_axes(to)?;
        let letters = match plane {
            Plane::Xy | Plane::Uv => ['I', 'J'],
            Plane::Zx | Plane::Wu => ['K', 'I'],
            Plane::Yz | Plane::Vw => ['J', 'K'],
        };
        for (letter, number) in letters.into_iter().zip(centre_mm) {
            self.line.word(letter, number);
        }
        if turns.abs() > 1 {
            self.line.word('P', turns.abs());
        }
        self.push_feed(to)?;
        self.end_move(to)
    }

    pub(super) fn probe(&mut self, to: Position, towards: bool, must_trip: bool) -> Result<(), Unwritable> {
        if self.synchronised.is_some() {
            return Err(Unwritable::Synchronised("a probing move"));
        }
        self.line.begin(match (towards, must_trip) {
            (true, true) => "G38.2",
            (true, false) => "G38.3",
            (false, true) => "G38.4",
            (false, false) => "G38.5",
        });
        let (from, known) = (self.at, self.known);
        self.push_axes(to)?;
        if !self.line.has_words() {
            self.push_axis(Axis::X, to)?;
        }
        self.push_feed(to)?;
        self.end_move(to)?;
        // Where it ends is for the machine to say.
        for axis in Axis::ALL {
            self.known[axis as usize] = known[axis as usize] && from[axis] == to[axis];
        }
        Ok(())
    }

    /// Ends where it began.
    pub(super) fn rigid_tap(&mut self, to: Position, return_scale: f64) -> Result<(), Unwritable> {
        let Some((spindle, mm_per_turn)) = self.synchronised else {
            return Err(Unwritable::TapWithoutPitch);
        };
        let (at, known) = (self.at, self.known);
        self.line.begin("G33.1");
        self.push_axes(to)?;
        if !self.line.has_words() {
            self.push_axis(Axis::Z, to)?;
        }
        self.line.word('K', mm_per_turn);
        if return_scale != 1.0 {
            self.line.word('I', return_scale);
        }
        self.line.spindle(spindle);
        self.push_line()?;
        // Axes whose place was not sure were named, and the way back leads to where they were.
        (self.at, self.known) = (at, known);
        Ok(())
    }

    pub(super) fn nurbs(
        &mut self,
        plane: Plane,
        points: &[([f64; 2], f64)],
        order: u32,
        knots: &[f64],
    ) -> Result<(), Unwritable> {
        if self.synchronised.is_some() {
            return Err(Unwritable::Synchronised("a spline"));
        }
        if let Plane::Uv | Plane::Wu | Plane::Vw = plane {
            return Err(Unwritable::Spline("in a plane of U, V and W"));
        }
        let [first, second, _] = plane.axes();
        let letters = [first, second].map(Axis::letter);
        let Some(((start, start_weight), rest)) = points.split_first() else {
            return Err(Unwritable::Spline("without points"));
        };
        if points.len() < order as usize || order < 2 || (order < 3 && knots.is_empty()) {
            return Err(Unwritable::Spline(
                "with fewer points than its order, or an order below 3",
            ));
        }
        if (start[0] - self.at[first]).abs() > SAME_MM_OR_DEGREES
            || (start[1] - self.at[second]).abs() > SAME_MM_OR_DEGREES
        {
            return Err(Unwritable::Spline("that does not begin where the axes stand"));
        }
        self.select_plane(plane)?;
        let mut to = self.at;
        if let Some((last, _)) = rest.last() {
            [to[first], to[second]] = *last;
        }
        match knots.first() {
            None => self.line.begin("G5.2").word('P', *start_weight).word('L', order),
            Some(knot) => {
                let line = self
                    .line
                    .begin("G6.2")
                    .word(letters[0], start[0])
                    .word(letters[1], start[1]);
                line.word('R', *start_weight)
                    .word('K', *knot)
                    .word('P', order)
                    .word('Q', 1)
            }
        };
        // Its feed counts mm, also where it ends where it began.
        let mut along = self.at;
        along[first] += 1.0;
        self.push_feed(along)?;
        self.push_line()?;
        for (index, ([x, y], weight)) in rest.iter().enumerate() {
            let line = self.line.begin("").word(letters[0], *x).word(letters[1], *y);
            match knots.get(index + 1) {
                None => line.word('P', *weight),
                Some(knot) => line.word('R', *weight).word('K', *knot),
            };
            self.push_line()?;
        }
        for knot in knots.iter().skip(points.len()) {
            self.line.begin("").word('K', *knot);
            self.push_line()?;
        }
        if knots.is_empty() {
            self.plain("G5.3")?;
        }
        self.at = to;
        self.known[first as usize] = true;
        self.known[second as usize] = true;
        Ok(())
    }
}

/// The word by which an axis without ends goes from `at` to `to`: its sign is the direction, also that of -0, its
/// magnitude the place on the turn. `None`: it turns by a whole turn or more.
pub(super) fn wrapped_word(at: f64, to: f64) -> Option<f64> {
    let place = Some(to.rem_euclid(360.0)).filter(|place| *place < 360.0).unwrap_or(0.0);
    let way = to - at;
    (way.abs() < 360.0).then_some(if way < 0.0 { -place } else { place })
}
