//! Programs of a few plain codes to events and back to the lines that LinuxCNC's stand-alone interpreter prints.
//!
//! In:  lines of G0 G1 G2 G3 X Y Z A B C I J K P, G17 G18, G40, G41.1 G42.1 D L, G4 P, M0 M3 M5 M8 M9, F and comments.
//! Out: events, line by line; printed moves.

use motion::canon::{Axis, Call, Cutter, Event, Plane, Position, Side, Source, SpindleDirection};

/// Reads a program; all coordinates absolute, centres relative to the start, mm.
pub(crate) fn read(program: &str) -> Vec<Event> {
    let mut reader = Reader {
        at: Position::ZERO,
        plane: Plane::Xy,
        motion: 1,
        events: Vec::new(),
        line: 0,
    };
    for line in program.lines() {
        reader.line += 1;
        reader.block(line);
    }
    reader.events
}

struct Reader {
    at: Position,
    plane: Plane,
    motion: i32,
    events: Vec<Event>,
    line: u32,
}

impl Reader {
    fn block(&mut self, line: &str) {
        if let Some(comment) = line.strip_prefix('(') {
            let text = comment.trim_end_matches(')').to_owned();
            return match text.strip_prefix("MSG,") {
                Some(message) => self.event(Call::Message(message.to_owned())),
                None => self.event(Call::Comment(text.into())),
            };
        }
        let words = words(line);
        let word = |letter: char| words.iter().find(|word| word.0 == letter).map(|word| word.1);
        let mut dwell = None;
        let mut motion_here = false;
        for &(letter, value) in &words {
            match (letter, (value * 10.0).round() as i32) {
                ('G', code @ (0 | 10 | 20 | 30)) => {
                    self.motion = code / 10;
                    motion_here = true;
                }
                ('G', 40) => dwell = word('P'),
                ('G', 170) => self.select(Plane::Xy),
                ('G', 180) => self.select(Plane::Zx),
                ('G', 400) => self.event(Call::SetCutterCompensation(None)),
                ('G', side @ (411 | 421)) => self.event(Call::SetCutterCompensation(Some(Cutter {
                    side: if side == 411 { Side::Left } else { Side::Right },
                    radius_mm: word('D').expect("D") / 2.0,
                    orientation: word('L').unwrap_or(0.0) as u8,
                }))),
                ('M', 0) => self.event(Call::ProgramStop),
                ('M', 30) => self.event(Call::StartSpindle {
                    spindle: 0,
                    direction: SpindleDirection::Clockwise,
                    wait_for_speed: true,
                }),
                ('M', 50) => self.event(Call::StopSpindle { spindle: 0 }),
                ('M', 80) => self.event(Call::Flood(true)),
                ('M', 90) => self.event(Call::Flood(false)),
                ('F', _) => self.event(Call::SetFeedRate {
                    linear: value / 60.0,
                    angular: value / 60.0,
                }),
                ('X' | 'Y' | 'Z' | 'A' | 'B' | 'C' | 'D' | 'I' | 'J' | 'K' | 'L' | 'P', _) => {}
                other => panic!("{other:?} in {line}"),
            }
        }
        if let Some(seconds) = dwell {
            return self.event(Call::Dwell { seconds });
        }
        let mut to = self.at;
        for axis in Axis::ALL {
            to[axis] = word(axis.letter()).unwrap_or(to[axis]);
        }
        if !motion_here && !words.iter().any(|word| Axis::from_letter(word.0).is_some()) {
            return;
        }
        self.event(match self.motion {
            0 => Call::StraightTraverse { to },
            1 => Call::StraightFeed { to },
            arc => {
                let [first, second, _] = self.plane.axes();
                let offset = |axis| word([('X', 'I'), ('Y', 'J'), ('Z', 'K')][axis as usize].1).unwrap_or(0.0);
                let turns = word('P').unwrap_or(1.0) as i32;
                Call::ArcFeed {
                    to,
                    plane: self.plane,
                    centre_mm: [self.at[first] + offset(first), self.at[second] + offset(second)],
                    turns: if arc == 3 { turns } else { -turns },
                }
            }
        });
        self.at = to;
    }

    fn select(&mut self, plane: Plane) {
        self.plane = plane;
        self.event(Call::SelectPlane(plane));
    }

    fn event(&mut self, call: Call) {
        let source = Source {
            line: self.line,
            ..Source::default()
        };
        self.events.push(Event { source, call });
    }
}

fn words(line: &str) -> Vec<(char, f64)> {
    let line: String = line.split_whitespace().collect::<String>().to_ascii_uppercase();
    let starts: Vec<usize> = line
        .char_indices()
        .filter(|(_, c)| c.is_ascii_alphabetic())
        .map(|(i, _)| i)
        .collect();
    let ends = starts.iter().skip(1).copied().chain([line.len()]);
    let word = |(start, end): (&usize, usize)| {
        (
            line.as_bytes()[*start] as char,
            line[start + 1..end].parse().expect("number"),
        )
    };
    starts.iter().zip(ends).map(word).collect()
}

/// A call as LinuxCNC prints it, of those that [`read`] makes; trailing zeros of A B C are left out.
pub(crate) fn print(call: &Call) -> String {
    let number = |value: f64| format!("{value:.4}").replace("-0.0000", "0.0000");
    let list = |values: &[f64]| values.iter().map(|value| number(*value)).collect::<Vec<_>>().join(", ");
    let turned = |to: &Position| {
        if to.0[3..6] == [0.0; 3] {
            String::new()
        } else {
            format!(", {}", list(&to.0[3..6]))
        }
    };
    match call {
        Call::StraightTraverse { to } => format!("STRAIGHT_TRAVERSE({}{})", list(&to.0[..3]), turned(to)),
        Call::StraightFeed { to } => format!("STRAIGHT_FEED({}{})", list(&to.0[..3]), turned(to)),
        Call::ArcFeed {
            to,
            plane,
            centre_mm,
            turns,
        } => {
            let [first, second, normal] = plane.axes();
            let ends = list(&[to[first], to[second], centre_mm[0], centre_mm[1]]);
            format!("ARC_FEED({ends}, {turns}, {}{})", number(to[normal]), turned(to))
        }
        Call::Message(text) => format!("MESSAGE(\"{text}\")"),
        Call::Comment(text) => format!("COMMENT(\"{text}\")"),
        Call::Dwell { seconds } => format!("DWELL({})", number(*seconds)),
        Call::SetFeedRate { linear, .. } => format!("SET_FEED_RATE({})", number(linear * 60.0)),
        Call::Flood(true) => "FLOOD_ON()".to_owned(),
        Call::Flood(false) => "FLOOD_OFF()".to_owned(),
        Call::StartSpindle { .. } => "START_SPINDLE_CLOCKWISE(0)".to_owned(),
        Call::StopSpindle { .. } => "STOP_SPINDLE_TURNING(0)".to_owned(),
        Call::ProgramStop => "PROGRAM_STOP()".to_owned(),
        Call::SelectPlane(plane) => format!("SELECT_PLANE({plane:?})"),
        other => format!("{other:?}"),
    }
}
