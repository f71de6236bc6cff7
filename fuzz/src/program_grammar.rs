//! Octets as choices in a grammar of part programs, so that a fuzzer gets past the reading of words.
//!
//! In:  any octets.
//! Out: a program that is mostly well formed: O-words nest and match, values have the right form, codes exist.

use std::fmt::Write;

/// Lines of a program at most; calls and loops run them many times.
const LINES: usize = 120;
/// O-words within O-words at most.
const DEPTH: usize = 5;

const CODES: [&str; 96] = [
    "G0",
    "G1",
    "G2",
    "G3",
    "G4",
    "G5",
    "G5.1",
    "G5.2",
    "G5.3",
    "G7",
    "G8",
    "G10 L1",
    "G10 L2",
    "G10 L10",
    "G10 L11",
    "G10 L20",
    "G17",
    "G18",
    "G19",
    "G17.1",
    "G18.1",
    "G19.1",
    "G20",
    "G21",
    "G28",
    "G28.1",
    "G30",
    "G30.1",
    "G33",
    "G33.1",
    "G38.2",
    "G38.3",
    "G38.4",
    "G38.5",
    "G40",
    "G41",
    "G42",
    "G41.1",
    "G42.1",
    "G43",
    "G43.1",
    "G43.2",
    "G49",
    "G52",
    "G53 G0",
    "G54",
    "G55",
    "G59.3",
    "G61",
    "G61.1",
    "G64",
    "G64 P1",
    "G70",
    "G71",
    "G72",
    "G73",
    "G74",
    "G76",
    "G80",
    "G81",
    "G82",
    "G83",
    "G84",
    "G85",
    "G86",
    "G88",
    "G89",
    "G90",
    "G90.1",
    "G91",
    "G91.1",
    "G92",
    "G92.1",
    "G92.3",
    "G93",
    "G94",
    "G95",
    "G96 D100",
    "G97",
    "G98",
    "G99",
    "M0",
    "M3",
    "M4",
    "M5",
    "M6",
    "M7",
    "M9",
    "M61 Q1",
    "M62 P1",
    "M66 P0 L0",
    "M70",
    "M72",
    "M73",
    "M99",
    "M101",
];
/// Lines that are right where the modes allow them; `?` is a value.
const TEMPLATES: [&str; 60] = [
    "G0 X? Y? Z?",
    "G1 X? Y?",
    "G1 Z? F100",
    "X?",
    "Y? Z?",
    "G1 A? X?",
    "G1 U? V? W?",
    "G2 X? Y? R50",
    "G3 X? Y? I? J?",
    "G2 I? P2 Z?",
    "G18 G2 X? Z? R100",
    "G19 G3 I0 J? K?",
    "G17",
    "G90.1 G2 X1 Y1 I? J?",
    "G91.1",
    "G4 P?",
    "G5 X? Y? I1 J1 P-1 Q1",
    "G5.1 X? Y? I1 J1",
    "G5.2 P1 L3\nX? Y? P1\nX? Y? P2\nX? Y? P1\nG5.3",
    "G7",
    "G8",
    "G10 L1 P1 Z?",
    "G10 L2 P0 X? R?",
    "G10 L2 P? X?",
    "G10 L20 P1 Y?",
    "G20",
    "G21",
    "G28 X?",
    "G28.1",
    "G30",
    "G33 Z? K1",
    "G33.1 Z? K1",
    "G38.2 Z?",
    "G38.3 X?",
    "G41.1 D1",
    "G42.1 D2",
    "G40",
    "G43.1 Z?",
    "G49",
    "G52 X?",
    "G92 X? Y?",
    "G92.1",
    "G53 G0 X?",
    "G55",
    "G54",
    "G64 P0.1",
    "G81 X? Z-5 R1",
    "G82 X? Z-5 R1 P1",
    "G83 Z-5 R1 Q1 L2",
    "G73 Y? Z-9 R2 Q2",
    "G76 P1 Z-9 I-1 J0.2 K1 Q29 H1",
    "G90",
    "G91",
    "G93 G1 X? F2\nG94 F100",
    "G96 D100 S?",
    "@? ^?",
    "M70",
    "M72",
    "M3 S?",
    "G80",
];
const LETTERS: &[u8] = b"XYZXYZXYZXYZABCUVWIJKIJKRRPQLLDHFFST";
const NAMES: [&str; 4] = ["a", "b", "_g", "_x"];
const FUNCTIONS: [&str; 13] = [
    "ABS", "ACOS", "ASIN", "COS", "EXP", "FIX", "FUP", "LN", "ROUND", "SIN", "SQRT", "TAN", "-",
];
const OPERATORS: [&str; 15] = [
    "+", "-", "*", "/", "**", " MOD ", " EQ ", " NE ", " GT ", " GE ", " LT ", " LE ", " AND ", " OR ", " XOR ",
];
const NUMBERS: [&str; 12] = [
    "0", "1", "2", "-1", "3.5", ".25", "-12.5", "100", "1000", "0.001", "30", "90",
];

/// The program that `octets` choose.
pub fn program(octets: &[u8]) -> String {
    let mut grammar = Grammar {
        choices: octets.iter().copied(),
        text: String::from("#<a> = 1 #<b> = 2 #<_g> = 3\nF100 S100 M3\nG1 X1 Z1\n"),
        lines: 0,
        label: 0,
    };
    for subroutine in 1..=2 {
        grammar.line(&format!("o{subroutine} sub"));
        grammar.line("#<a> = #1 #<b> = 2");
        grammar.lines(1, 8 * subroutine);
        grammar.line(&format!("o{subroutine} endsub"));
    }
    grammar.lines(0, LINES);
    grammar.text.push_str("M2\n");
    grammar.text
}

struct Grammar<'o> {
    choices: std::iter::Copied<std::slice::Iter<'o, u8>>,
    text: String,
    lines: usize,
    label: usize,
}

impl Grammar<'_> {
    /// The next choice, below `count`.
    fn choose(&mut self, count: usize) -> usize {
        usize::from(self.choices.next().unwrap_or(0)) % count
    }

    fn of<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.choose(all.len())]
    }

    fn line(&mut self, line: &str) {
        self.lines += 1;
        let _ = writeln!(self.text, "{line}");
    }

    /// Lines until there are so many in the program.
    fn lines(&mut self, depth: usize, until: usize) {
        while self.choices.len() > 0 && self.lines < until {
            match self.choose(24) {
                0 if depth > 0 => return,
                1..=5 if depth < DEPTH => self.control(depth, until),
                6..=8 => {
                    let target = self.target();
                    let value = self.value(0);
                    self.line(&format!("{target} = {value}"));
                }
                9 => {
                    let (sub, first, second) = (self.choose(2) + 1, self.value(0), self.value(0));
                    self.line(&format!("o{sub} call [{first}] [{second}]"));
                }
                10 => {
                    let comment = self.of(&[
                        "(MSG,#1 #<a>)",
                        "(DEBUG,%d#<_x>)",
                        "(a) (LOG,b)",
                        "; end",
                        "(PRINT,%.3f#5)",
                    ]);
                    self.line(comment);
                }
                11 => self.words(),
                _ => {
                    let template = self.of(&TEMPLATES);
                    let mut line = String::new();
                    for (index, part) in template.split('?').enumerate() {
                        if index > 0 {
                            line.push_str(&self.value(1));
                        }
                        line.push_str(part);
                    }
                    self.line(&line);
                }
            }
        }
    }

    fn words(&mut self) {
        let mut line = String::new();
        for _ in 0..self.choose(3) {
            line.push_str(self.of(&CODES));
            line.push(' ');
        }
        for _ in 0..self.choose(6) {
            let (letter, value) = (char::from(self.of(LETTERS)), self.value(0));
            let _ = write!(line, "{letter}{value} ");
        }
        self.line(&line);
    }

    fn control(&mut self, depth: usize, until: usize) {
        self.label += 1;
        let label = 100 + self.label;
        let condition = self.value(0);
        match self.choose(5) {
            0 => {
                self.line(&format!("o{label} if [{condition}]"));
                self.lines(depth + 1, until);
                if self.choose(2) == 1 {
                    let other = self.value(0);
                    self.line(&format!("o{label} elseif [{other}]"));
                    self.lines(depth + 1, until);
                }
                self.line(&format!("o{label} else"));
                self.lines(depth + 1, until);
                self.line(&format!("o{label} endif"));
            }
            1 => {
                self.line(&format!("o{label} while [{condition}]"));
                self.lines(depth + 1, until);
                if self.choose(2) == 1 {
                    self.line(&format!("o{label} break"));
                }
                self.line(&format!("o{label} endwhile"));
            }
            2 => {
                self.line(&format!("o{label} do"));
                self.lines(depth + 1, until);
                self.line(&format!("o{label} while [{condition}]"));
            }
            3 => {
                self.line(&format!("o{label} repeat [{condition}]"));
                self.lines(depth + 1, until);
                if self.choose(2) == 1 {
                    self.line(&format!("o{label} continue"));
                }
                self.line(&format!("o{label} endrepeat"));
            }
            _ => {
                let sub = self.choose(2) + 1;
                self.line(&format!("o{sub} return [{condition}]"));
            }
        }
    }

    fn target(&mut self) -> String {
        match self.choose(3) {
            0 => format!("#{}", self.choose(40) + 1),
            1 => format!("#<{}>", self.of(&NAMES)),
            _ => self
                .of(&["#31", "#5161", "#5211", "#5230", "#5221", "#5599", "#32", "#33"])
                .into(),
        }
    }

    fn value(&mut self, depth: usize) -> String {
        match self.choose(if depth < 3 { 24 } else { 12 }) {
            0..=9 => self.of(&NUMBERS).into(),
            10 => format!("#{}", self.choose(40) + 1),
            11 => format!("#<{}>", self.of(&NAMES)),
            12 => format!("{}[{}]", self.of(&FUNCTIONS), self.value(depth + 1)),
            13 => format!("ATAN[{}]/[{}]", self.value(depth + 1), self.value(depth + 1)),
            14 => format!("EXISTS[#<{}>]", self.of(&NAMES)),
            _ => {
                let (left, operator) = (self.value(depth + 1), self.of(&OPERATORS));
                format!("[{left}{operator}{}]", self.value(depth + 1))
            }
        }
    }
}
