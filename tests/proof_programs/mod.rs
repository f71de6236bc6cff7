//! Part programs by which the planner is judged: text of G-code, made here and the same everywhere.
//!
//! In:  which one, and how large.
//! Out: G-code, metric and absolute, from X0 Y0 Z0, within ±220 mm; it uses nothing of the control that it judges.
//!
//! Shared by the tests, the benches and `examples/proof_programs.rs`, which writes them to files.

#![allow(dead_code)] // not every user uses all of it

mod chords;
mod curves;
mod drawn;
mod engraving;
pub(crate) mod five_axes;
mod random;

#[allow(unused_imports)] // neither uses every user random programs
pub(crate) use random::Random;
use std::fmt::Write as _;

/// How large a program is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Size {
    /// Planned in a blink, for tests.
    Small,
    /// As it comes from practice, for benches and pictures.
    Full,
}

/// How exactly a program wants its path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mode {
    /// G61.
    ExactPath,
    /// G61.1.
    ExactStop,
    /// G64 P0.01.
    Blend,
    /// G64 P0.1.
    BlendCoarse,
    /// G64 P0.01 Q0: without joining lines that are nearly straight.
    BlendOnly,
}

impl Mode {
    /// Its words.
    pub(crate) fn code(self) -> &'static str {
        match self {
            Mode::ExactPath => "G61",
            Mode::ExactStop => "G61.1",
            Mode::Blend => "G64 P0.01",
            Mode::BlendCoarse => "G64 P0.1",
            Mode::BlendOnly => "G64 P0.01 Q0",
        }
    }

    /// Greatest deviation from the path that it allows, mm; where it allows none, what rounding takes.
    pub(crate) fn tolerance_mm(self) -> f64 {
        match self {
            Mode::ExactPath | Mode::ExactStop => 1e-9,
            Mode::Blend | Mode::BlendOnly => 0.01,
            Mode::BlendCoarse => 0.1,
        }
    }
}

/// One program.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Case {
    /// A name for files and tables.
    pub(crate) name: &'static str,
    /// How exactly it wants its path.
    pub(crate) mode: Mode,
    /// Programmed feed, mm/min.
    pub(crate) feed_mm_min: f64,
    /// The moves behind the head.
    moves: fn(Size) -> String,
}

/// A program of 100 mm/s that is rounded within 0.01 mm.
const fn case(name: &'static str, moves: fn(Size) -> String) -> Case {
    Case {
        name,
        mode: Mode::Blend,
        feed_mm_min: 6000.0,
        moves,
    }
}

/// All programs for three axes.
pub(crate) const CASES: &[Case] = &[
    case("square", drawn::square),
    Case {
        mode: Mode::ExactPath,
        ..case("square_g61", drawn::square)
    },
    Case {
        mode: Mode::ExactStop,
        ..case("square_g61_1", drawn::square)
    },
    Case {
        mode: Mode::BlendCoarse,
        ..case("square_coarse", drawn::square)
    },
    case("zigzag", drawn::zigzag),
    case("mixed", drawn::mixed),
    Case {
        mode: Mode::ExactPath,
        ..case("mixed_g61", drawn::mixed)
    },
    case("helices", drawn::helices),
    case("text", engraving::text),
    case("circle", chords::circle),
    Case {
        mode: Mode::BlendOnly,
        ..case("circle_q0", chords::circle)
    },
    Case {
        mode: Mode::ExactPath,
        ..case("circle_g61", chords::circle)
    },
    case("rose", chords::rose),
    case("spiral", chords::spiral),
    case("trochoid", chords::trochoid),
    case("surface", chords::surface),
    case("splines", curves::splines),
    Case {
        mode: Mode::ExactPath,
        ..case("splines_g61", curves::splines)
    },
    Case {
        mode: Mode::ExactStop,
        ..case("splines_g61_1", curves::splines)
    },
    case("odd_splines", curves::odd_splines),
    Case {
        mode: Mode::ExactPath,
        ..case("odd_splines_g61", curves::odd_splines)
    },
    Case {
        feed_mm_min: 30_000.0,
        ..case("star", chords::star)
    },
    Case {
        feed_mm_min: 30_000.0,
        ..case("lissajous", chords::lissajous)
    },
];

impl Case {
    /// The whole program.
    pub(crate) fn text(&self, size: Size) -> String {
        format!(
            "({}: a program for proof)\nG21 G90 G17 G94 G40 G49 G80\nG54\n{}\nG0 X0 Y0 Z0\nG4 P0.1\nF{}\n{}G4 P0.1\nM2\n",
            self.name,
            self.mode.code(),
            self.feed_mm_min,
            (self.moves)(size)
        )
    }
}

/// The program of this name.
pub(crate) fn find(name: &str) -> Option<&'static Case> {
    CASES.iter().find(|case| case.name == name)
}

/// Moves along points of a curve, the first of which is approached at rapid speed.
fn along(points: impl IntoIterator<Item = [f64; 3]>) -> String {
    let mut text = String::new();
    for (index, [x, y, z]) in points.into_iter().enumerate() {
        let code = if index == 0 { "G0" } else { "G1" };
        let _ = writeln!(text, "{code} X{x:.5} Y{y:.5} Z{z:.5}");
    }
    text
}
