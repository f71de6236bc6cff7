//! `[sim]`: what the simulated machine is made of.

use super::document::{Bound, Section};
use super::joints::letter;
use super::types::{Node, Profile, Sim, SimProbe, SimSurface};
use motion::canon::Axis;

/// No machine is larger, mm.
const LENGTH_MAX: f64 = 1e6;
/// Inputs of a simulated I/O node that something can be wired to; those below are the contacts of its own contactors.
const WIRED: std::ops::RangeInclusive<i64> = 8..=15;

/// Reads `[sim]`; `nodes`: `None` where the bus has errors of its own.
pub(super) fn sim(mut section: Section<'_, '_>, nodes: Option<&[Node]>) -> Option<Sim> {
    // Beyond, the motor model of the simulated drives would need finer steps than the bus cycle gives.
    let natural_frequency_hz = section.number("natural_frequency_hz", Bound::Within(0.1, 1000.0), 60.0);
    let damping = section.number("damping", Bound::Within(0.01, 10.0), 0.8);
    let start = section.number("start", Bound::Within(0.0, 1.0), 0.4);
    let probe = section.optional_section("probe").map(|section| probe(section, nodes));
    section.done();
    Some(Sim {
        natural_frequency_hz: natural_frequency_hz?,
        damping: damping?,
        start: start?,
        probe: match probe {
            None => None,
            Some(probe) => Some(probe?),
        },
    })
}

fn probe(mut section: Section<'_, '_>, nodes: Option<&[Node]>) -> Option<SimProbe> {
    let wire = wire(&mut section, nodes);
    let surfaces: Vec<Option<SimSurface>> = section.some_sections("surface").into_iter().map(surface).collect();
    section.done();
    let (node, input) = wire?;
    Some(SimProbe {
        node,
        input,
        surfaces: surfaces.into_iter().collect::<Option<Vec<SimSurface>>>()?,
    })
}

/// Keys `node` and `input`: the node as an index, and the number of the input as in the name of its pin.
fn wire(section: &mut Section<'_, '_>, nodes: Option<&[Node]>) -> Option<(usize, u8)> {
    let id = section.integer("node", 1..=239, None);
    let input = section.integer("input", WIRED, None);
    let index = nodes?.iter().position(|node| Some(i64::from(node.id)) == id);
    if id.is_some() && index.is_none_or(|index| nodes.is_some_and(|nodes| nodes[index].profile != Profile::Io)) {
        section.wrong("node", "must be a [[bus.node]] of profile \"io\"");
        return None;
    }
    Some((index?, input? as u8))
}

fn surface(mut section: Section<'_, '_>) -> Option<SimSurface> {
    let axis: Option<Axis> = letter(&mut section, "axis");
    let limit = |section: &mut Section<'_, '_>, key| {
        let item = section.optional(key)?;
        item.number(&section.key(key), Bound::Size(LENGTH_MAX))
    };
    let above_mm = limit(&mut section, "above_mm");
    let below_mm = limit(&mut section, "below_mm");
    if section.has("above_mm") == section.has("below_mm") {
        section.wrong(
            "axis",
            "must have either above_mm or below_mm beside it: where the body is",
        );
    }
    section.done();
    let (at_mm, above) = match (above_mm, below_mm) {
        (Some(at_mm), None) => (at_mm, true),
        (None, Some(at_mm)) => (at_mm, false),
        (None, None) | (Some(_), Some(_)) => return None,
    };
    Some(SimSurface {
        axis: axis?,
        at_mm,
        above,
    })
}
