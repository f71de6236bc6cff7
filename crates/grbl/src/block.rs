//! One line of G-code: everything that Grbl finds wrong with it, and what it leaves in force.
//!
//! In:  words; the modes that the lines before have left.
//! Out: the modes behind it and the text for the control, or the number of the first thing that is wrong.
//!
//! Travel is not looked at: the control does that with all that it knows.

use crate::modes::{MM_PER_INCH, Modes, Motion};
use crate::moves::{follow, motion_words};
use crate::number::ErrorNumber;
use crate::words::{Word, words};
use std::fmt::Write;

/// Greatest line number.
const LINE_NUMBER_MAX: f64 = 10_000_000.0;
/// Greatest tool number.
const TOOL_MAX: f64 = 255.0;

/// A line that can be run.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Block {
    /// The text for the control, with its end.
    pub(crate) text: String,
    /// The modes behind it.
    pub(crate) modes: Modes,
    /// It is answered once it has been executed: a dwell, a pause, an end, a probing move.
    pub(crate) waits: bool,
    /// It probes.
    pub(crate) probes: bool,
    /// It ends a program: M2 or M30.
    pub(crate) ends: bool,
}

/// A jog.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct JogBlock {
    /// mm.
    pub(crate) axes: [Option<f64>; 3],
    pub(crate) relative: bool,
    /// In machine coordinates (G53).
    pub(crate) of_machine: bool,
    pub(crate) feed_mm_min: f64,
}

/// Codes of no group that stays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Once {
    Dwell,
    SetOffset,
    Home(u8),
    StoreHome,
    Machine,
    SetPosition,
    ResetPosition,
}

/// Words with a value that are there at most once.
#[derive(Debug, Default)]
pub(crate) struct Values {
    pub(crate) axes: [Option<f64>; 3],
    pub(crate) centre: [Option<f64>; 3],
    pub(crate) f: Option<f64>,
    l: Option<f64>,
    n: Option<f64>,
    p: Option<f64>,
    pub(crate) r: Option<f64>,
    s: Option<f64>,
    t: Option<f64>,
}

impl Values {
    fn put(&mut self, word: Word) -> Result<(), ErrorNumber> {
        let place = match word.letter {
            'X' => &mut self.axes[0],
            'Y' => &mut self.axes[1],
            'Z' => &mut self.axes[2],
            'I' => &mut self.centre[0],
            'J' => &mut self.centre[1],
            'K' => &mut self.centre[2],
            'F' => &mut self.f,
            'L' => &mut self.l,
            'N' => &mut self.n,
            'P' => &mut self.p,
            'R' => &mut self.r,
            'S' => &mut self.s,
            'T' => &mut self.t,
            _ => return Err(ErrorNumber::Unsupported),
        };
        if place.is_some() {
            return Err(ErrorNumber::Repeated);
        }
        if "FNPST".contains(word.letter) && word.value < 0.0 {
            return Err(ErrorNumber::Negative);
        }
        *place = Some(word.value);
        Ok(())
    }

    pub(crate) fn has_axes(&self) -> bool {
        self.axes.iter().any(Option::is_some)
    }

    /// Whether there are words of centres, L, P or R beside these letters.
    fn has_others(&self, used: &[&str]) -> bool {
        let [i, j, k] = self.centre;
        let words = [
            ('I', i),
            ('J', j),
            ('K', k),
            ('L', self.l),
            ('P', self.p),
            ('R', self.r),
        ];
        let is_used = |letter: char| used.iter().any(|letters| letters.contains(letter));
        words
            .into_iter()
            .any(|(letter, value)| value.is_some() && !is_used(letter))
    }
}

/// Checks a line, in these modes.
///
/// # Errors
/// The first thing that is wrong with it.
pub(crate) fn block(line: &str, before: &Modes) -> Result<Block, ErrorNumber> {
    let words = words(line)?;
    let (mut codes, mut values, mut modes) = (Codes::default(), Values::default(), before.clone());
    for word in &words {
        match word.letter {
            'G' => codes.g(word.code().ok_or(ErrorNumber::NotWhole)?, &mut modes)?,
            'M' => {
                let code = word.code().filter(|code| code.is_multiple_of(100));
                codes.m(code.ok_or(ErrorNumber::NotWhole)? / 100, &mut modes)?;
            }
            _ => values.put(*word)?,
        }
    }
    let Codes { motion, once, stop, .. } = codes;
    numbers(&values)?;
    if let Some(f) = values.f {
        modes.feed_mm_min = f * modes.unit_mm();
    } else if modes.inverse_time != before.inverse_time {
        // That of the other mode means something else.
        modes.feed_mm_min = 0.0;
    }
    modes.speed_rpm = values.s.unwrap_or(modes.speed_rpm);
    modes.tool = values.t.map_or(modes.tool, |tool| tool as u32);
    codes.check_axes(&values)?;
    modes.motion = motion.unwrap_or(modes.motion);
    let moves = values.has_axes() && !codes.take_axes() && once != Some(Once::ResetPosition);
    let of_motion = match moves || motion.is_some() {
        true => motion_words(&values, &modes, motion, once)?,
        false => "",
    };
    let of_once = match once {
        Some(Once::Dwell) => "P",
        Some(Once::SetOffset) => "LP",
        _ => "",
    };
    if values.has_others(&[of_motion, of_once]) {
        return Err(ErrorNumber::Unused);
    }
    follow(&values, before, &mut modes, once, moves);
    let probes = moves && matches!(modes.motion, Motion::Probe(_));
    // Another client may have left the control in another motion.
    let mut text = match moves && motion.is_none() {
        true => modes.motion.word(),
        false => String::new(),
    };
    for Word { letter, value } in words.iter().filter(|word| word.letter != 'N') {
        // Writing to a text cannot fail.
        let _ = write!(text, "{letter}{value}");
    }
    if !text.is_empty() {
        text.push('\n');
    }
    // The move of the line itself is still one of the modes before the end.
    let ends = matches!(stop, Some(2 | 30));
    if ends {
        modes = modes.at_end();
    }
    Ok(Block {
        text,
        modes,
        waits: once == Some(Once::Dwell) || stop.is_some() || probes,
        probes,
        ends,
    })
}

/// The codes of a line.
#[derive(Debug, Default)]
struct Codes {
    /// Groups of which there is one, a bit each.
    groups: u32,
    motion: Option<Motion>,
    once: Option<Once>,
    /// G43.1, not G49.
    tool_offset: Option<bool>,
    /// M0, M1, M2 or M30.
    stop: Option<u16>,
}

impl Codes {
    /// A code of a group, of which a line has one.
    fn group(&mut self, group: u8) -> Result<(), ErrorNumber> {
        let is_new = self.groups & 1 << group == 0;
        self.groups |= 1 << group;
        is_new.then_some(()).ok_or(ErrorNumber::Group)
    }

    /// A G code, as 100 times its number.
    fn g(&mut self, code: u16, modes: &mut Modes) -> Result<(), ErrorNumber> {
        if let Some(motion) = Motion::of_code(code) {
            self.motion = Some(motion);
            return self.group(1);
        }
        let once = match code {
            400 => Once::Dwell,
            1000 => Once::SetOffset,
            2800 => Once::Home(28),
            3000 => Once::Home(30),
            2810 | 3010 => Once::StoreHome,
            5300 => Once::Machine,
            9200 => Once::SetPosition,
            9210 => Once::ResetPosition,
            _ => return self.mode(code, modes),
        };
        self.once = Some(once);
        self.group(0)
    }

    /// A G code of a group that stays.
    fn mode(&mut self, code: u16, modes: &mut Modes) -> Result<(), ErrorNumber> {
        match code {
            1700 | 1800 | 1900 => {
                modes.plane = (code / 100) as u8;
                self.group(2)
            }
            9000 | 9100 => {
                modes.relative = code == 9100;
                self.group(3)
            }
            // Centres of arcs are relative, always.
            9110 => self.group(4),
            9300 | 9400 => {
                modes.inverse_time = code == 9300;
                self.group(5)
            }
            2000 | 2100 => {
                modes.inch = code == 2000;
                self.group(6)
            }
            4000 => self.group(7),
            4310 | 4900 => {
                self.tool_offset = Some(code == 4310);
                self.group(8)
            }
            5400..=5900 if code.is_multiple_of(100) => {
                modes.system = (code / 100) as u8;
                self.group(12)
            }
            5910 | 5920 | 5930 => Err(ErrorNumber::WorkSystem),
            6100 => self.group(13),
            // Codes that would be known without what is behind the point.
            _ if !code.is_multiple_of(100) && is_whole(code / 100) => Err(ErrorNumber::NotWhole),
            _ => Err(ErrorNumber::Unsupported),
        }
    }

    /// An M code.
    fn m(&mut self, code: u16, modes: &mut Modes) -> Result<(), ErrorNumber> {
        match code {
            0 | 1 | 2 | 30 => {
                self.stop = Some(code);
                self.group(9)
            }
            3..=5 => {
                modes.spindle = code as u8;
                self.group(10)
            }
            // Both kinds of coolant may be on.
            7 => {
                modes.mist = true;
                Ok(())
            }
            8 => {
                modes.flood = true;
                Ok(())
            }
            9 => {
                (modes.mist, modes.flood) = (false, false);
                Ok(())
            }
            _ => Err(ErrorNumber::Unsupported),
        }
    }

    /// Whether a code that is no motion takes the axis words.
    fn take_axes(&self) -> bool {
        self.once_takes_axes() || self.tool_offset == Some(true)
    }

    fn once_takes_axes(&self) -> bool {
        matches!(
            self.once,
            Some(Once::SetOffset | Once::Home(_) | Once::StoreHome | Once::SetPosition)
        )
    }

    /// What codes that stand for one line want of the axes.
    fn check_axes(&self, values: &Values) -> Result<(), ErrorNumber> {
        let has_axes = values.has_axes();
        let takes = [
            self.once_takes_axes(),
            self.motion.is_some_and(|motion| motion != Motion::None),
            self.tool_offset == Some(true),
        ];
        if takes.into_iter().filter(|takes| *takes).count() > 1 {
            return Err(ErrorNumber::TwoAxisCodes);
        }
        match self.once {
            Some(Once::Dwell) if values.p.is_none() => return Err(ErrorNumber::ValueMissing),
            Some(Once::SetOffset) => {
                if !has_axes {
                    return Err(ErrorNumber::NoAxis);
                }
                let (Some(p), Some(l)) = (values.p, values.l) else {
                    return Err(ErrorNumber::ValueMissing);
                };
                if p > 6.0 || p.fract() != 0.0 {
                    return Err(ErrorNumber::WorkSystem);
                }
                if l != 2.0 && l != 20.0 || values.r.is_some() {
                    return Err(ErrorNumber::Unsupported);
                }
            }
            Some(Once::SetPosition) if !has_axes => return Err(ErrorNumber::NoAxis),
            _ => {}
        }
        if self.tool_offset == Some(true) {
            match values.axes {
                [None, None, None] => return Err(ErrorNumber::NoAxis),
                [None, None, Some(_)] => {}
                _ => return Err(ErrorNumber::ToolAxis),
            }
        }
        Ok(())
    }
}

fn is_whole(code: u16) -> bool {
    matches!(
        code,
        0..=4 | 10 | 17..=21 | 28 | 30 | 40 | 49 | 53..=59 | 61 | 80 | 90..=94
    )
}

/// Numbers that are out of their range.
fn numbers(values: &Values) -> Result<(), ErrorNumber> {
    if values.n.is_some_and(|n| n >= LINE_NUMBER_MAX) {
        return Err(ErrorNumber::LineNumber);
    }
    if values.n.is_some_and(|n| n.fract() != 0.0) || values.t.is_some_and(|t| t.fract() != 0.0) {
        return Err(ErrorNumber::NotWhole);
    }
    match values.t.is_some_and(|t| t > TOOL_MAX) {
        true => Err(ErrorNumber::Tool),
        false => Ok(()),
    }
}

/// Checks what stands behind `$J=`; units and distances count for this line only.
///
/// # Errors
/// The first thing that is wrong with it.
pub(crate) fn jog(line: &str, modes: &Modes) -> Result<JogBlock, ErrorNumber> {
    let mut values = Values::default();
    let (mut inch, mut relative, mut of_machine) = (modes.inch, modes.relative, false);
    let (mut units, mut distances) = (0, 0);
    for word in words(line)? {
        match (word.letter, word.code()) {
            ('G', Some(code @ (2000 | 2100))) => {
                units += 1;
                inch = code == 2000;
            }
            ('G', Some(code @ (9000 | 9100))) => {
                distances += 1;
                relative = code == 9100;
            }
            ('G', Some(5300)) => of_machine = true,
            ('X' | 'Y' | 'Z' | 'F' | 'N', _) => values.put(word)?,
            _ => return Err(ErrorNumber::Jog),
        }
    }
    if units > 1 || distances > 1 {
        return Err(ErrorNumber::Group);
    }
    if !values.has_axes() {
        return Err(ErrorNumber::Jog);
    }
    let unit_mm = if inch { MM_PER_INCH } else { 1.0 };
    let Some(feed) = values.f.filter(|feed| *feed > 0.0) else {
        return Err(ErrorNumber::Feed);
    };
    Ok(JogBlock {
        axes: values.axes.map(|axis| axis.map(|axis| axis * unit_mm)),
        relative: relative && !of_machine,
        of_machine,
        feed_mm_min: feed * unit_mm,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(lines: &str) -> Modes {
        let modes = Modes::default();
        lines.lines().fold(modes, |modes, line| {
            let block = block(line, &modes);
            block.unwrap_or_else(|error| panic!("{line}: {error}")).modes
        })
    }

    fn error(before: &str, line: &str) -> u8 {
        match block(line, &after(before)) {
            Err(error) => error as u8,
            Ok(block) => panic!("{line}: {block:?}"),
        }
    }

    #[test]
    fn each_error_has_the_number_of_grbl() {
        for (before, line, number) in [
            ("", "*", 1),
            ("", "G1X", 2),
            ("", "F-1", 4),
            ("", "G4P-1", 4),
            ("", "G64", 20),
            ("", "M6", 20),
            ("", "A1", 20),
            ("", "G10L1P1X0", 20),
            ("", "G0G1X1", 21),
            ("", "G20G21", 21),
            ("", "M3M4", 21),
            ("", "G90G91", 21),
            ("", "G1X1", 22),
            ("F100\nG93", "G1X1", 22),
            ("G93\nG1X1F2", "X2", 22),
            ("", "G17.5", 23),
            ("", "M3.1", 23),
            ("", "G0G92X1", 24),
            ("", "G28X0G43.1Z1", 24),
            ("", "G0X1X2", 25),
            ("", "G0F1F2", 25),
            ("", "G92", 26),
            ("", "G10L2P1", 26),
            ("F1", "G2I1", 26),
            ("F1", "G38.2", 26),
            ("", "G43.1", 26),
            ("", "N10000000", 27),
            ("", "G4", 28),
            ("", "G10P1X0", 28),
            ("", "G10L2X0", 28),
            ("", "G59.1", 29),
            ("", "G10L2P7X0", 29),
            ("F1\nX0Y0", "G53G2X1I1", 30),
            ("G80", "X1", 31),
            ("", "G80X1", 31),
            ("F1", "G2Z1I1", 32),
            ("F1\nX0Y0", "G2X10Y0I4", 33),
            ("F1\nX0Y0", "G2X0Y0R5", 33),
            ("F1\nX0Y0Z5", "G38.2Z5", 33),
            ("F1\nX0Y0", "G2X10Y0R4", 34),
            ("F1", "G2X1K1", 35),
            ("F1", "G2X1", 35),
            ("", "G0X1I1", 36),
            ("", "G0X1P1", 36),
            ("F1", "G1X1R1", 36),
            ("", "L2", 36),
            ("", "G43.1X1", 37),
            ("", "T256", 38),
        ] {
            assert_eq!(error(before, line), number, "{before:?} {line}");
        }
    }

    #[test]
    fn what_is_right_is_passed_on_and_leaves_its_modes() {
        let modes = after("G20G91G93G18G55\nM3S1000M7M8T3\nG21G94\nG1X1F200");
        assert_eq!(
            (modes.plane, modes.system, modes.relative, modes.inch),
            (18, 55, true, false)
        );
        assert_eq!((modes.spindle, modes.speed_rpm, modes.tool), (3, 1000.0, 3));
        assert!(modes.flood && modes.mist);
        assert_eq!((modes.motion, modes.feed_mm_min), (Motion::Feed, 200.0));
        assert_eq!(after("G20\nF10").feed_mm_min, 254.0);
        let text = |before: &str, line: &str| block(line, &after(before)).unwrap().text;
        assert_eq!(text("G1F100", "X1.50Y-2"), "G1X1.5Y-2\n");
        assert_eq!(text("", "N10G0X1"), "G0X1\n");
        assert_eq!(text("", "G53G0Z0"), "G53G0Z0\n");
        assert_eq!(text("", ""), "");
        assert_eq!(text("", "N10"), "");
        for line in [
            "G28",
            "G28Z0",
            "G28.1",
            "G92.1",
            "G92X0",
            "G10L20P0X0Y0",
            "G49",
            "G43.1Z2",
            "G61",
            "G40",
            "M9",
            "S5",
            "G1",
        ] {
            block(line, &Modes::default()).unwrap_or_else(|error| panic!("{line}: {error}"));
        }
        for line in ["G2X10Y0R5", "G3X0Y0I5", "G2X10I5J0", "G18G2X10I5K0"] {
            block(line, &after("F1\nX0Y0Z0")).unwrap_or_else(|error| panic!("{line}: {error}"));
        }
        // Where it begins is not known: the control looks.
        block("G2X10Y0I4", &after("F1\nG54")).unwrap_or_else(|error| panic!("{error}"));
    }

    #[test]
    fn what_waits_is_told() {
        let told = |line: &str| {
            let block = block(line, &after("F100\nX0Z0")).unwrap();
            (block.waits, block.probes, block.ends)
        };
        assert_eq!(told("G4P0.5"), (true, false, false));
        assert_eq!(told("M0"), (true, false, false));
        assert_eq!(told("M30"), (true, false, true));
        assert_eq!(told("G38.2Z-10"), (true, true, false));
        assert_eq!(told("G1X1"), (false, false, false));
    }

    #[test]
    fn a_move_beside_an_end_is_one_of_the_motion_in_force() {
        for (before, text) in [("G0", "G0X1M30\n"), ("G1F100", "G1X1M30\n")] {
            assert_eq!(block("X1M30", &after(before)).expect("a block").text, text);
        }
    }

    #[test]
    fn an_end_puts_modes_back() {
        let modes = after("G91G55G18F100S5\nM3\nM30");
        assert_eq!(
            modes,
            Modes {
                feed_mm_min: 100.0,
                speed_rpm: 5.0,
                motion: Motion::Feed,
                ..Modes::default()
            }
        );
        assert_eq!(Modes::default().line(), "G80G21G90G94G17G40G49G91.1G54\n");
    }

    #[test]
    fn jogs_have_words_of_their_own() {
        let mm = Modes::default();
        let asked = jog("G91X10Z-1F600", &mm).unwrap();
        assert_eq!((asked.axes, asked.relative), ([Some(10.0), None, Some(-1.0)], true));
        assert_eq!(jog("G20Y1F10", &mm).unwrap().axes[1], Some(25.4));
        assert_eq!(jog("G20Y1F10", &mm).unwrap().feed_mm_min, 254.0);
        assert!(jog("G91G53X1F1", &mm).unwrap().of_machine);
        let number = |line| jog(line, &mm).unwrap_err() as u8;
        assert_eq!(
            ["X1", "X1F0", "F1", "G1X1F1", "M3X1F1", "G20G21X1F1"].map(number),
            [22, 22, 16, 16, 16, 21]
        );
    }
}
