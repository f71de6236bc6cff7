//! Numbers by chance, and programs of them.

use super::{Mode, Size};
use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;

/// Pseudo-random numbers that are the same everywhere (SplitMix64).
#[derive(Clone, Debug)]
pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// 64 bits.
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        bits ^ (bits >> 31)
    }

    /// From `low` to `high`.
    pub(crate) fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// From 0 to below `count`.
    pub(crate) fn below(&mut self, count: u64) -> u64 {
        self.bits() % count
    }

    /// Between `low` and `high`, all orders of magnitude alike.
    fn magnitude(&mut self, low: f64, high: f64) -> f64 {
        self.within(low.ln(), high.ln()).exp()
    }

    /// A program of `blocks` moves of all kinds: runs of short chords, long lines, arcs and helices, sharp turns and
    /// tangential joints, changes of feed and of path mode, rapid moves, waits.
    ///
    /// Its path mode changes on the way, so that the tolerance of all of it is that of [`Mode::BlendCoarse`].
    pub(crate) fn program(&mut self, blocks: usize) -> String {
        let mut text = String::from("G21 G90 G17 G94\nG0 X0 Y0 Z0\nF3000\n");
        let mut at = [0.0, 0.0, 0.0];
        let mut heading = 0.0;
        let mut left = 0;
        let (mut length, mut turn) = (1.0, 0.0);
        for _ in 0..blocks {
            if left == 0 {
                left = 1 + self.below(12);
                // A run of chords of like length along a curve, or a single move.
                length = self.magnitude(0.002, 20.0);
                turn = if self.below(3) == 0 {
                    0.0
                } else {
                    self.within(-0.5, 0.5)
                };
                heading += match self.below(4) {
                    0 => 0.0,
                    1 => self.within(-0.05, 0.05),
                    2 => self.within(-PI, PI),
                    _ => self.within(-1.0, 1.0),
                };
                self.between(&mut text);
            }
            left -= 1;
            let [x, y, z]: [f64; 3] = at;
            if x.hypot(y) > 120.0 {
                heading = (-y).atan2(-x);
            }
            if self.below(6) == 0 {
                heading = self.arc(&mut text, &mut at, heading);
            } else {
                heading += turn;
                let length = length * self.within(0.7, 1.3);
                let rise = if self.below(4) == 0 {
                    self.within(-1.0, 1.0)
                } else {
                    0.0
                };
                at = [
                    round(x + length * heading.cos()),
                    round(y + length * heading.sin()),
                    round((z + length * rise).clamp(-40.0, 40.0)),
                ];
                let code = if self.below(25) == 0 { "G0" } else { "G1" };
                let _ = writeln!(text, "{code} X{:.4} Y{:.4} Z{:.4}", at[0], at[1], at[2]);
            }
        }
        text.push_str("M2\n");
        text
    }

    /// What computing leaves beside a number: of either sign, all orders of magnitude from 1e-17 to `most` alike; mostly nothing.
    fn residue(&mut self, most: f64) -> f64 {
        match self.below(4) {
            0 => self.magnitude(1e-17, most) * if self.below(2) == 0 { 1.0 } else { -1.0 },
            1 => [1e-8, -1e-8, 1.1e-8, -5e-9, f64::EPSILON][self.below(5) as usize].clamp(-most, most),
            _ => 0.0,
        }
    }

    /// The same program as computing writes it: something is beside its numbers, and ends are told again, or nearly.
    pub(crate) fn residues(&mut self, text: &str) -> String {
        let mut out = String::new();
        for line in text.lines() {
            let words: Vec<&str> = line.split_whitespace().collect();
            let is_of = |letters: &str| {
                words
                    .iter()
                    .any(|word| word.starts_with(|first| letters.contains(first)))
            };
            let bent = is_of("IJKR");
            let straight = matches!(words.first(), Some(&("G0" | "G1"))) && !bent && !is_of("(;#[LPQ");
            if !(straight || bent && matches!(words.first(), Some(&("G2" | "G3")))) {
                out.push_str(line);
                out.push('\n');
                continue;
            }
            let most = if bent { 1e-6 } else { 1e-3 };
            for again in 0..1 + usize::from(straight && self.below(3) == 0) {
                for word in &words {
                    let number = word.get(1..).and_then(|number| number.parse::<f64>().ok());
                    let _ = match number.filter(|_| word.starts_with(|first| "XYZABCUVW".contains(first))) {
                        Some(number) => write!(out, "{}{} ", &word[..1], number + self.residue(most)),
                        None if again > 0 && !word.starts_with('G') => Ok(()),
                        None => write!(out, "{word} "),
                    };
                }
                out.push('\n');
            }
        }
        out
    }

    /// What may stand between two runs.
    fn between(&mut self, text: &mut String) {
        match self.below(8) {
            0 => {
                let feed = self.magnitude(600.0, 12_000.0);
                let _ = writeln!(text, "F{feed:.1}");
            }
            1 => {
                const MODES: [Mode; 5] = [
                    Mode::ExactPath,
                    Mode::ExactStop,
                    Mode::Blend,
                    Mode::BlendCoarse,
                    Mode::BlendOnly,
                ];
                let mode = MODES[self.below(MODES.len() as u64) as usize];
                let _ = writeln!(text, "{}", mode.code());
            }
            2 if self.below(4) == 0 => text.push_str("G4 P0.02\n"),
            _ => {}
        }
    }

    /// A part of a circle or helix that begins in this direction, or nearly so; the direction at its end.
    fn arc(&mut self, text: &mut String, at: &mut [f64; 3], heading: f64) -> f64 {
        let heading = heading
            + if self.below(2) == 0 {
                0.0
            } else {
                self.within(-1.0, 1.0)
            };
        let radius = self.magnitude(0.05, 15.0);
        let sweep = self.within(0.05, TAU - 0.1);
        let side = if self.below(2) == 0 { 1.0 } else { -1.0 };
        let [x, y, z] = *at;
        let (cx, cy) = (x - side * radius * heading.sin(), y + side * radius * heading.cos());
        let from = (y - cy).atan2(x - cx);
        let to = from + side * sweep;
        let rise = if self.below(3) == 0 {
            self.within(-2.0, 2.0)
        } else {
            0.0
        };
        let end = [
            round(cx + radius * to.cos()),
            round(cy + radius * to.sin()),
            round((z + rise).clamp(-40.0, 40.0)),
        ];
        // The centre is written exactly enough for the radius at both ends to agree within the interpreter's tolerance.
        let code = if side > 0.0 { "G3" } else { "G2" };
        let _ = writeln!(
            text,
            "{code} X{:.4} Y{:.4} Z{:.4} I{:.6} J{:.6}",
            end[0],
            end[1],
            end[2],
            cx - x,
            cy - y
        );
        *at = end;
        heading + side * sweep
    }
}

/// As the text says it.
fn round(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

/// How many of something.
pub(super) fn count(size: Size, small: usize, full: usize) -> usize {
    match size {
        Size::Small => small,
        Size::Full => full,
    }
}
