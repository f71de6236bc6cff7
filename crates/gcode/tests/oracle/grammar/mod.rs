//! Programs that look like those of a shop: every code, words in any order, most of them without an error.
//!
//! In:  steps, each a kind of thing to do and the seed of its details: what a property test makes and shrinks.
//! Out: the text of a program. The modal state is followed just as far as it decides what is refused.

mod flow;
mod machine;
mod steps;

use super::Version;
use proptest::prelude::*;

/// One thing a program does: a line, or a few that belong together.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    kind: usize,
    seed: u64,
}

/// Steps for one program. Fewer steps are simpler, the details of a step stay as they are.
pub fn steps(most: usize) -> impl Strategy<Value = Vec<Step>> {
    let step = (0..steps::KINDS.len(), any::<u64>().no_shrink()).prop_map(|(kind, seed)| Step { kind, seed });
    prop::collection::vec(step, 1..most)
}

/// The program of the steps, without what a version is known to do otherwise.
pub fn program(steps: &[Step], version: Version) -> String {
    let mut writer = Writer {
        newest: version == Version::Newest,
        ..Writer::default()
    };
    // The stand-alone begins with the tool of its first pocket and the number 0.
    writer.text.push_str("T1 M6\n");
    for step in steps {
        writer.random = Random(step.seed | 1);
        (steps::KINDS[step.kind])(&mut writer);
    }
    writer.end_compensation();
    writer.text.push_str("M2\n");
    writer.text.push_str(&writer.subs);
    writer.text
}

/// A sequence of numbers that depends on its seed only (xorshift64*).
#[derive(Clone, Debug, Default)]
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 16
    }

    fn below(&mut self, bound: usize) -> usize {
        usize::try_from(self.next() % bound as u64).expect("below the bound")
    }

    /// True once in `often` times.
    fn once_in(&mut self, often: usize) -> bool {
        self.below(often) == 0
    }

    fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.below(from.len())]
    }
}

/// What decides whether the next line is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
enum FeedMode {
    #[default]
    PerMinute,
    InverseTime,
    PerTurn,
}

/// The text so far and the modal state behind it.
#[derive(Debug, Default)]
struct Writer {
    text: String,
    /// For the newest LinuxCNC.
    newest: bool,
    /// Subroutines, behind the main program.
    subs: String,
    random: Random,
    feed_mode: FeedMode,
    has_feed: bool,
    /// 1 clockwise, -1 the other way, 0 at rest.
    spindle: i8,
    has_speed: bool,
    plane: usize,
    incremental: bool,
    absolute_centres: bool,
    diameter: bool,
    compensated: bool,
    inch: bool,
    /// Whether axis words alone are a move.
    motion: bool,
    saved: bool,
    labels: u32,
    indent: usize,
}

/// First and second axis of G17, G18 and G19, the third one, and the letters of the offsets of a centre.
const PLANES: [(usize, usize, usize, char, char); 3] = [(0, 1, 2, 'I', 'J'), (2, 0, 1, 'K', 'I'), (1, 2, 0, 'J', 'K')];
const AXES: &[u8; 6] = b"XYZABC";

impl Writer {
    /// A line of words in any order, with blanks, line numbers, remarks and capital letters as they come.
    fn line(&mut self, mut words: Vec<String>) {
        for index in (1..words.len()).rev() {
            let other = self.random.below(index + 1);
            words.swap(index, other);
        }
        if self.random.once_in(12) {
            words.insert(0, format!("N{}", self.random.below(100_000)));
        }
        if self.random.once_in(20) {
            words.push(
                self.random
                    .pick(&["(a remark)", "(MSG, told)", "; unseen", "(two) (remarks)"])
                    .to_owned(),
            );
        }
        let between = self.random.pick(&[" ", " ", "", "  ", "\t"]);
        let mut line = words.join(between);
        if self.random.once_in(6) && !line.contains('(') {
            line.make_ascii_lowercase();
        }
        self.raw(&line);
    }

    /// A line as it is.
    fn raw(&mut self, line: &str) {
        self.text.push_str(&"  ".repeat(self.indent));
        self.text.push_str(line);
        self.text.push('\n');
    }

    /// A number of quarters: a half of it, an inch of it and their sums are far from where printing rounds.
    fn quarters(&mut self, from: i32, to: i32) -> f64 {
        let span = usize::try_from(to - from + 1).expect("a range");
        f64::from(from + i32::try_from(self.random.below(span)).expect("small")) / 4.0
    }

    /// A length, plain or as an expression.
    fn length(&mut self) -> String {
        let value = self.quarters(-80, 80);
        match self.random.below(8) {
            0 => format!("[{} + {}]", value - 2.5, 2.5),
            1 => format!("[{}*2]", value / 2.0),
            2 => format!("#{}", 101 + self.random.below(5)),
            3 => format!("-[{}]", -value),
            _ => format!("{value}"),
        }
    }

    /// A positive length.
    fn distance(&mut self) -> f64 {
        self.quarters(1, 40)
    }

    fn label(&mut self) -> u32 {
        self.labels += 1;
        self.labels
    }

    /// Axis words, one at least; in a compensated contour those of its plane only.
    fn axis_words(&mut self, axes: &[usize]) -> Vec<String> {
        let mut words = Vec::new();
        let sure = self.random.below(axes.len());
        for (index, &axis) in axes.iter().enumerate() {
            if index == sure || self.random.once_in(3) {
                words.push(format!("{}{}", AXES[axis] as char, self.length()));
            }
        }
        words
    }

    /// F where a feed is needed and now and then.
    fn feed_word(&mut self, words: &mut Vec<String>) {
        if self.feed_mode == FeedMode::InverseTime || !self.has_feed || self.random.once_in(6) {
            // Whole numbers: M72 of the packaged LinuxCNC rounds the feed it restores to tenths.
            words.push(format!("F{}", 1 + self.random.below(400)));
            self.has_feed = self.feed_mode != FeedMode::InverseTime;
        }
        if self.feed_mode == FeedMode::PerTurn && !self.has_speed {
            words.push("S100".to_owned());
            self.has_speed = true;
        }
    }

    fn spindle_on(&mut self, direction: i8) {
        if self.spindle != direction || !self.has_speed {
            self.raw(if direction > 0 { "M3 S500" } else { "M4 S500" });
            self.spindle = direction;
            self.has_speed = true;
        }
    }

    fn per_minute(&mut self) {
        if self.feed_mode != FeedMode::PerMinute {
            self.raw("G94 F100");
            self.feed_mode = FeedMode::PerMinute;
            self.has_feed = true;
        }
    }

    /// A move to where the tool is: the stand-alone's own machine, which a tool change asks where it is, does not follow
    /// splines, probing, rigid taps and what an operator does.
    fn stand(&mut self) {
        self.raw("G0");
        self.motion = true;
    }

    fn end_compensation(&mut self) {
        if self.compensated {
            self.raw("G40");
            self.compensated = false;
        }
    }
}
