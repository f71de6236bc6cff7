//! One line of G-code: everything that Grbl finds wrong with it, and what it leaves in force.
//!
//! In:  words; the modes that the lines before have left.
//! Out: the modes behind it and the text for the control, or the number of the first thing that is wrong.
//!
//! Travel is not looked at: the control does that with all that it knows.

use crate::number::ErrorNumber;
use crate::words::{Word, words};
use std::fmt::Write;

const MM_PER_INCH: f64 = 25.4;
/// Greatest line number.
const LINE_NUMBER_MAX: f64 = 10_000_000.0;
/// Greatest tool number.
const TOOL_MAX: f64 = 255.0;

/// The motion in force.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Motion {
    #[default]
    Rapid,
    Feed,
    /// G2, G3.
    Arc {
        clockwise: bool,
    },
    /// G38.2 to G38.5: the digit behind the point.
    Probe(u8),
    /// G80.
    None,
}

impl Motion {
    pub(crate) fn word(self) -> String {
        match self {
            Motion::Rapid => "G0".into(),
            Motion::Feed => "G1".into(),
            Motion::Arc { clockwise: true } => "G2".into(),
            Motion::Arc { clockwise: false } => "G3".into(),
            Motion::Probe(kind) => format!("G38.{kind}"),
            Motion::None => "G80".into(),
        }
    }

    fn of_code(code: u16) -> Option<Motion> {
        Some(match code {
            0 => Motion::Rapid,
            100 => Motion::Feed,
            200 => Motion::Arc { clockwise: true },
            300 => Motion::Arc { clockwise: false },
            3820 | 3830 | 3840 | 3850 => Motion::Probe((code % 100 / 10) as u8),
            8000 => Motion::None,
            _ => return None,
        })
    }
}

/// Modes, as the lines that were accepted leave them. What Grbl begins with is the default.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Modes {
    pub(crate) motion: Motion,
    /// 17, 18 or 19.
    pub(crate) plane: u8,
    pub(crate) inch: bool,
    pub(crate) relative: bool,
    /// G93.
    pub(crate) inverse_time: bool,
    /// 54 to 59.
    pub(crate) system: u8,
    /// 3, 4 or 5.
    pub(crate) spindle: u8,
    pub(crate) flood: bool,
    pub(crate) mist: bool,
    /// mm/min; 0: none yet.
    pub(crate) feed_mm_min: f64,
    pub(crate) speed_rpm: f64,
    pub(crate) tool: u32,
    /// Where the lines lead, work coordinates, mm; `None`: not known here.
    at: [Option<f64>; 3],
}

impl Default for Modes {
    fn default() -> Modes {
        Modes {
            motion: Motion::Rapid,
            plane: 17,
            inch: false,
            relative: false,
            inverse_time: false,
            system: 54,
            spindle: 5,
            flood: false,
            mist: false,
            feed_mm_min: 0.0,
            speed_rpm: 0.0,
            tool: 0,
            at: [None; 3],
        }
    }
}

impl Modes {
    /// The line that puts a control into these modes, whatever it was in. Spindle and coolant are left as they are.
    pub(crate) fn line(&self) -> String {
        let Modes { plane, system, .. } = self;
        let [unit, distance, feed] = [
            20 + u8::from(!self.inch),
            90 + u8::from(self.relative),
            93 + u8::from(!self.inverse_time),
        ];
        format!("G80G{unit}G{distance}G{feed}G{plane}G40G49G91.1G{system}\n")
    }

    /// mm in the unit of the program.
    pub(crate) fn unit_mm(&self) -> f64 {
        if self.inch { MM_PER_INCH } else { 1.0 }
    }

    /// Where the axes are is not known any more, as after a stop.
    pub(crate) fn forget_place(&mut self) {
        self.at = [None; 3];
    }
}

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
enum Once {
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
struct Values {
    axes: [Option<f64>; 3],
    centre: [Option<f64>; 3],
    f: Option<f64>,
    l: Option<f64>,
    n: Option<f64>,
    p: Option<f64>,
    r: Option<f64>,
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

    fn has_axes(&self) -> bool {
        self.axes.iter().any(Option::is_some)
    }
}

/// Checks a line, in these modes.
///
/// # Errors
/// The first thing that is wrong with it.
pub(crate) fn block(line: &str, before: &Modes) -> Result<Block, ErrorNumber> {
    let words = words(line)?;
    let (mut values, mut modes) = (Values::default(), before.clone());
    let mut seen: u32 = 0;
    let mut group = |bit: u8| {
        let is_new = seen & 1 << bit == 0;
        seen |= 1 << bit;
        is_new.then_some(()).ok_or(ErrorNumber::Group)
    };
    let (mut motion, mut once, mut tool_offset, mut stop) = (None, None, None, None);
    for word in &words {
        match word.letter {
            'G' => {
                let code = word.code().ok_or(ErrorNumber::NotWhole)?;
                if let Some(new) = Motion::of_code(code) {
                    group(1)?;
                    motion = Some(new);
                    continue;
                }
                let new = match code {
                    400 => Once::Dwell,
                    1000 => Once::SetOffset,
                    2800 => Once::Home(28),
                    3000 => Once::Home(30),
                    2810 | 3010 => Once::StoreHome,
                    5300 => Once::Machine,
                    9200 => Once::SetPosition,
                    9210 => Once::ResetPosition,
                    _ => {
                        mode_word(code, &mut modes, &mut group, &mut tool_offset)?;
                        continue;
                    }
                };
                group(0)?;
                once = Some(new);
            }
            'M' => {
                let code = word
                    .code()
                    .filter(|code| code.is_multiple_of(100))
                    .ok_or(ErrorNumber::NotWhole)?;
                match code / 100 {
                    new @ (0 | 1 | 2 | 30) => {
                        group(9)?;
                        stop = Some(new);
                    }
                    new @ (3..=5) => {
                        group(10)?;
                        modes.spindle = new as u8;
                    }
                    // Both kinds of coolant may be on.
                    7 => modes.mist = true,
                    8 => modes.flood = true,
                    9 => (modes.mist, modes.flood) = (false, false),
                    _ => return Err(ErrorNumber::Unsupported),
                }
            }
            _ => values.put(*word)?,
        }
    }
    numbers(&values)?;
    let unit_mm = modes.unit_mm();
    if let Some(f) = values.f {
        modes.feed_mm_min = f * unit_mm;
    } else if modes.inverse_time != before.inverse_time {
        // That of the other mode means something else.
        modes.feed_mm_min = 0.0;
    }
    modes.speed_rpm = values.s.unwrap_or(modes.speed_rpm);
    modes.tool = values.t.map_or(modes.tool, |tool| tool as u32);
    axes_once(&motion, once, tool_offset, &values)?;
    let axes_taken = matches!(
        once,
        Some(Once::SetOffset | Once::Home(_) | Once::StoreHome | Once::SetPosition)
    ) || tool_offset == Some(true);
    modes.motion = motion.unwrap_or(modes.motion);
    let moves = values.has_axes() && !axes_taken && once != Some(Once::ResetPosition);
    let mut used = String::new();
    if moves || motion.is_some() {
        used.push_str(motion_words(&values, &modes, motion, once)?);
    }
    used.push_str(match once {
        Some(Once::Dwell) => "P",
        Some(Once::SetOffset) => "LP",
        _ => "",
    });
    let is_there = [("L", values.l), ("P", values.p), ("R", values.r)];
    let centre = ["I", "J", "K"].into_iter().zip(values.centre);
    if is_there
        .into_iter()
        .chain(centre)
        .any(|(letter, value)| value.is_some() && !used.contains(letter))
    {
        return Err(ErrorNumber::Unused);
    }
    follow(&values, before, &mut modes, once, moves);
    let probes = moves && matches!(modes.motion, Motion::Probe(_));
    let ends = matches!(stop, Some(2 | 30));
    if ends {
        // What Grbl keeps at the end of a program.
        let end = Modes::default();
        let kept = modes.clone();
        modes = Modes {
            inch: kept.inch,
            feed_mm_min: kept.feed_mm_min,
            speed_rpm: kept.speed_rpm,
            tool: kept.tool,
            at: [None; 3],
            motion: Motion::Feed,
            ..end
        };
    }
    let mut text = String::new();
    // Another client may have left the control in another motion.
    if moves && motion.is_none() {
        text.push_str(&modes.motion.word());
    }
    for Word { letter, value } in words.iter().filter(|word| word.letter != 'N') {
        // Writing to a text cannot fail.
        let _ = write!(text, "{letter}{value}");
    }
    if !text.is_empty() {
        text.push('\n');
    }
    Ok(Block {
        text,
        modes,
        waits: once == Some(Once::Dwell) || stop.is_some() || probes,
        probes,
        ends,
    })
}

/// A G code of a group that stays.
fn mode_word(
    code: u16,
    modes: &mut Modes,
    group: &mut impl FnMut(u8) -> Result<(), ErrorNumber>,
    tool_offset: &mut Option<bool>,
) -> Result<(), ErrorNumber> {
    match code {
        1700 | 1800 | 1900 => {
            group(2)?;
            modes.plane = (code / 100) as u8;
        }
        9000 | 9100 => {
            group(3)?;
            modes.relative = code == 9100;
        }
        // Centres of arcs are relative, always.
        9110 => group(4)?,
        9300 | 9400 => {
            group(5)?;
            modes.inverse_time = code == 9300;
        }
        2000 | 2100 => {
            group(6)?;
            modes.inch = code == 2000;
        }
        4000 => group(7)?,
        4310 | 4900 => {
            group(8)?;
            *tool_offset = Some(code == 4310);
        }
        5400..=5900 if code.is_multiple_of(100) => {
            group(12)?;
            modes.system = (code / 100) as u8;
        }
        5910 | 5920 | 5930 => return Err(ErrorNumber::WorkSystem),
        6100 => group(13)?,
        // Codes that would be known without what is behind the point.
        _ if !code.is_multiple_of(100) && is_whole(code / 100) => return Err(ErrorNumber::NotWhole),
        _ => return Err(ErrorNumber::Unsupported),
    }
    Ok(())
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

/// What codes that stand for one line want of the axes.
fn axes_once(
    motion: &Option<Motion>,
    once: Option<Once>,
    tool_offset: Option<bool>,
    values: &Values,
) -> Result<(), ErrorNumber> {
    let has_axes = values.has_axes();
    let takes = [
        matches!(
            once,
            Some(Once::SetOffset | Once::Home(_) | Once::StoreHome | Once::SetPosition)
        ),
        motion.is_some_and(|motion| motion != Motion::None),
        tool_offset == Some(true),
    ];
    if takes.into_iter().filter(|takes| *takes).count() > 1 {
        return Err(ErrorNumber::TwoAxisCodes);
    }
    match once {
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
    if tool_offset == Some(true) {
        match values.axes {
            [None, None, None] => return Err(ErrorNumber::NoAxis),
            [None, None, Some(_)] => {}
            _ => return Err(ErrorNumber::ToolAxis),
        }
    }
    Ok(())
}

/// What a motion wants; the letters that it uses.
fn motion_words(
    values: &Values,
    modes: &Modes,
    motion: Option<Motion>,
    once: Option<Once>,
) -> Result<&'static str, ErrorNumber> {
    let has_axes = values.has_axes();
    if once == Some(Once::Machine) && !matches!(modes.motion, Motion::Rapid | Motion::Feed) {
        return Err(ErrorNumber::MachineMove);
    }
    if modes.motion == Motion::None {
        return match has_axes {
            true => Err(ErrorNumber::UnusedAxis),
            false => Ok(""),
        };
    }
    if modes.motion == Motion::Rapid || !has_axes && modes.motion == Motion::Feed {
        return Ok("");
    }
    let has_feed = match modes.inverse_time {
        // It counts for one line.
        true => values.f.is_some_and(|f| f > 0.0),
        false => modes.feed_mm_min > 0.0,
    };
    if !has_feed && has_axes {
        return Err(ErrorNumber::Feed);
    }
    if !has_axes {
        return match motion {
            Some(Motion::Arc { .. } | Motion::Probe(_)) => Err(ErrorNumber::NoAxis),
            _ => Ok(""),
        };
    }
    match modes.motion {
        Motion::Arc { .. } => arc(values, modes),
        Motion::Probe(_) => {
            let stays = ends(values, modes)
                .iter()
                .zip(modes.at)
                .zip(values.axes)
                .all(|((end, at), word)| word.is_none() || at.is_some() && *end == at);
            if stays { Err(ErrorNumber::Target) } else { Ok("") }
        }
        Motion::Rapid | Motion::Feed | Motion::None => Ok(""),
    }
}

/// Where a move ends, work coordinates, mm; `None`: not known here.
fn ends(values: &Values, modes: &Modes) -> [Option<f64>; 3] {
    let mut ends = modes.at;
    for (end, word) in ends.iter_mut().zip(values.axes) {
        let Some(word) = word.map(|word| word * modes.unit_mm()) else {
            continue;
        };
        *end = match modes.relative {
            true => end.map(|at| at + word),
            false => Some(word),
        };
    }
    ends
}

fn arc(values: &Values, modes: &Modes) -> Result<&'static str, ErrorNumber> {
    let [a, b, _] = match modes.plane {
        17 => [0, 1, 2],
        18 => [2, 0, 1],
        _ => [1, 2, 0],
    };
    if values.axes[a].is_none() && values.axes[b].is_none() {
        return Err(ErrorNumber::ArcEnd);
    }
    let unit_mm = modes.unit_mm();
    let end = ends(values, modes);
    // How far the end is from where it begins, where that is known.
    let way = |axis: usize| match (modes.relative, values.axes[axis]) {
        (true, word) => Some(word.unwrap_or(0.0) * unit_mm),
        (false, _) => Some(end[axis]? - modes.at[axis]?),
    };
    let way = way(a).zip(way(b));
    if let Some(radius) = values.r {
        let radius_mm = radius * unit_mm;
        return match way {
            Some((0.0, 0.0)) => Err(ErrorNumber::Target),
            Some((x, y)) if x.hypot(y) > 2.0 * radius_mm.abs() + 0.005 => Err(ErrorNumber::ArcRadius),
            _ => Ok("R"),
        };
    }
    let (i, j) = (values.centre[a], values.centre[b]);
    if i.is_none() && j.is_none() {
        return Err(ErrorNumber::ArcCentre);
    }
    if let Some((x, y)) = way {
        let (i, j) = (i.unwrap_or(0.0) * unit_mm, j.unwrap_or(0.0) * unit_mm);
        let (radius_mm, at_end_mm) = (i.hypot(j), (x - i).hypot(y - j));
        let off_mm = (radius_mm - at_end_mm).abs();
        // The tolerances of Grbl.
        if off_mm > 0.5 || off_mm > 0.005 && off_mm > 0.001 * radius_mm {
            return Err(ErrorNumber::Target);
        }
    }
    Ok(match modes.plane {
        17 => "IJ",
        18 => "IK",
        _ => "JK",
    })
}

/// Follows where the axes are.
fn follow(values: &Values, before: &Modes, modes: &mut Modes, once: Option<Once>, moves: bool) {
    let is_elsewhere =
        before.system != modes.system || matches!(once, Some(Once::SetOffset | Once::Home(_) | Once::ResetPosition));
    match once {
        Some(Once::SetPosition) => {
            for (at, word) in modes.at.iter_mut().zip(values.axes) {
                *at = word.map(|word| word * before.unit_mm()).or(*at);
            }
        }
        Some(Once::Machine) => {
            for (at, _) in modes.at.iter_mut().zip(values.axes).filter(|(_, word)| word.is_some()) {
                *at = None;
            }
        }
        _ if is_elsewhere => modes.at = [None; 3],
        _ if moves => {
            let end = ends(values, modes);
            modes.at = end;
            if matches!(modes.motion, Motion::Probe(_)) {
                // It ends where something is touched.
                for (at, _) in modes.at.iter_mut().zip(values.axes).filter(|(_, word)| word.is_some()) {
                    *at = None;
                }
            }
        }
        _ => {}
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
