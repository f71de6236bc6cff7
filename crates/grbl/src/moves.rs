//! What moves demand of the words of a line, and where they lead.
//!
//! In:  words with values, the modes of the line.
//! Out: the letters that a motion uses, or what is wrong with it; where the axes are behind the line.

use crate::block::{Once, Values};
use crate::modes::{Modes, Motion};
use crate::number::ErrorNumber;

/// What a motion wants; the letters that it uses.
pub(crate) fn motion_words(
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
pub(crate) fn follow(values: &Values, before: &Modes, modes: &mut Modes, once: Option<Once>, moves: bool) {
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
