//! `isocnc hal graph`: nets as a picture, in the order of a cycle.
//!
//! In:  components and nets of a machine file, or the nets of a running control.
//! Out: SVG with a layout of its own; DOT for graphviz.
//!
//! ```text
//!  inputs of nodes │ components before motion, by who feeds whom │ the control │ those after motion │ outputs of nodes
//! ```
//!
//! A net that leads to the left carries a value of the cycle before, and is dashed.

use config::{Component, Config, Place};
use hal_pins::{Kind, PinInfo};
use plot::sheet::{Anchor, Face, Sheet};
use plot::{BODY, INK, SMALL, TITLE};
use rt::components::is_of_others;
use std::collections::BTreeMap;
use std::fmt::Write;

const PIN_FACE: Face = Face::new(11.0, INK);
const ROW: f64 = 16.0;
const HEAD: f64 = 20.0;
const PADDING: f64 = 8.0;
/// Between two layers: room for the nets.
const CHANNEL: f64 = 120.0;
const BETWEEN: f64 = 18.0;
const TOP: f64 = 96.0;
const LEFT: f64 = 24.0;
const LATE: &str = "#d55e00";
const COLOURS: [&str; 6] = ["#0072b2", "#009e73", "#7b4fa0", "#a05a00", "#4a6a8a", "#6a6a00"];

/// Part of a cycle in which a group of pins is written or read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Part {
    Inputs,
    Before,
    Control,
    After,
    Outputs,
}

impl Part {
    fn name(self) -> &'static str {
        match self {
            Part::Inputs => "inputs of nodes",
            Part::Before => "before motion",
            Part::Control => "the control",
            Part::After => "after motion",
            Part::Outputs => "outputs of nodes",
        }
    }
}

/// Pins that belong together.
#[derive(Clone, Debug)]
struct Group {
    name: String,
    /// Type of a component.
    kind: String,
    part: Part,
    /// Place in the list of its part.
    order: usize,
    inputs: Vec<String>,
    outputs: Vec<String>,
    layer: usize,
}

/// A net from one pin to another; numbers of groups and of their pins.
#[derive(Clone, Debug)]
struct Wire {
    net: usize,
    from: (usize, usize),
    to: (usize, usize),
    is_late: bool,
}

/// Groups and what connects them.
pub(super) struct Graph {
    title: String,
    text: String,
    nets: Vec<String>,
    groups: Vec<Group>,
    wires: Vec<Wire>,
    layers: usize,
}

/// A net by the names of its pins.
struct Net<'a> {
    name: &'a str,
    source: &'a str,
    targets: Vec<&'a str>,
}

impl Graph {
    /// Of a machine file.
    pub(super) fn of_file(config: &Config) -> Graph {
        let nets = config.nets.iter().map(|net| Net {
            name: &net.name,
            source: &net.source,
            targets: net.targets.iter().map(String::as_str).collect(),
        });
        Graph::new(
            &format!("Nets of {}", config.name),
            &config.components,
            &nets.collect::<Vec<_>>(),
            Some(&|pin| is_of_others(config, pin)),
        )
    }

    /// Of a running control, which does not tell its lists of components.
    pub(super) fn of_pins(machine: &str, pins: &[PinInfo]) -> Graph {
        let nets = pins
            .iter()
            .filter(|pin| pin.kind == Kind::Net && pin.alias_of.is_none());
        let nets = nets.filter_map(|net| {
            let targets = pins.iter().filter(|pin| {
                pin.kind == Kind::Input && pin.net.as_deref() == Some(net.name.as_str()) && pin.alias_of.is_none()
            });
            Some(Net {
                name: &net.name,
                source: net.source.as_deref()?,
                targets: targets.map(|pin| pin.name.as_str()).collect(),
            })
        });
        Graph::new(
            &format!("Nets of {machine}, as it runs"),
            &[],
            &nets.collect::<Vec<_>>(),
            None,
        )
    }

    /// `is_outside`: of nodes, of programs, of other processes; `None`: of a control that does not tell its lists.
    fn new(
        title: &str,
        components: &[Component],
        nets: &[Net<'_>],
        is_outside: Option<&dyn Fn(&str) -> bool>,
    ) -> Graph {
        let knows_lists = is_outside.is_some();
        let is_outside = is_outside.unwrap_or(&|pin| pin.starts_with("io.") || pin.starts_with("cia402."));
        let mut groups: Vec<Group> = Vec::new();
        // A component without a net is part of its list all the same.
        for (order, component) in components.iter().enumerate() {
            groups.push(Group {
                name: component.name.clone(),
                kind: component.kind.to_string(),
                part: match component.place {
                    Place::BeforeMotion => Part::Before,
                    Place::AfterMotion => Part::After,
                },
                order,
                inputs: Vec::new(),
                outputs: Vec::new(),
                layer: 0,
            });
        }
        let mut wires = Vec::new();
        for (net, of) in nets.iter().enumerate() {
            let from = place(&mut groups, of.source, true, is_outside);
            for target in &of.targets {
                wires.push(Wire {
                    net,
                    from,
                    to: place(&mut groups, target, false, is_outside),
                    is_late: false,
                });
            }
        }
        let text = match knows_lists {
            true => format!(
                "{} components, {} nets; dashed: carries a value of the cycle before",
                components.len(),
                nets.len()
            ),
            false => format!(
                "{} nets; which component runs before or after motion only its machine file tells",
                nets.len()
            ),
        };
        let mut graph = Graph {
            title: title.to_owned(),
            text,
            nets: nets.iter().map(|net| net.name.to_owned()).collect(),
            groups,
            wires,
            layers: 0,
        };
        graph.lay_out(knows_lists);
        graph
    }

    /// Gives each group its layer: parts of the cycle from left to right, inside a part those that are fed behind those that feed.
    fn lay_out(&mut self, knows_lists: bool) {
        let mut first = 0;
        let parts = match knows_lists {
            true => vec![
                vec![Part::Inputs],
                vec![Part::Before],
                vec![Part::Control],
                vec![Part::After],
                vec![Part::Outputs],
            ],
            false => vec![
                vec![Part::Inputs],
                vec![Part::Before, Part::Control, Part::After],
                vec![Part::Outputs],
            ],
        };
        for part in parts {
            let of_part: Vec<usize> = (0..self.groups.len())
                .filter(|at| part.contains(&self.groups[*at].part))
                .collect();
            if of_part.is_empty() {
                continue;
            }
            for at in &of_part {
                self.groups[*at].layer = first;
            }
            // One pass for each is enough where there is no ring; a ring stops there, its way back leads to the left.
            for _ in 0..of_part.len() {
                for wire in &self.wires {
                    let (from, to) = (&self.groups[wire.from.0], &self.groups[wire.to.0]);
                    let is_inside = part.contains(&from.part) && part.contains(&to.part);
                    // What the control writes and reads itself needs no order.
                    let is_ordered = match knows_lists {
                        true => from.part != Part::Control && from.order < to.order,
                        false => wire.from.0 < wire.to.0,
                    };
                    if is_inside && is_ordered && to.layer <= from.layer {
                        self.groups[wire.to.0].layer = self.groups[wire.from.0].layer + 1;
                    }
                }
            }
            first = of_part
                .iter()
                .map(|at| self.groups[*at].layer + 1)
                .max()
                .unwrap_or(first);
        }
        self.layers = first;
        for wire in &mut self.wires {
            let (from, to) = (&self.groups[wire.from.0], &self.groups[wire.to.0]);
            let by_component = [from, to]
                .iter()
                .any(|group| matches!(group.part, Part::Before | Part::After));
            let is_earlier = (to.part, to.order) < (from.part, from.order) || wire.from.0 == wire.to.0;
            wire.is_late = knows_lists && by_component && is_earlier;
        }
    }

    /// The picture.
    pub(super) fn svg(&self) -> String {
        let width_of = |group: &Group| {
            let longest = |pins: &[String]| pins.iter().map(|pin| PIN_FACE.width(pin)).fold(0.0, f64::max);
            let pins = longest(&group.inputs) + longest(&group.outputs) + 3.0 * PADDING;
            pins.max(BODY.bold().width(&title(group)) + 2.0 * PADDING).max(80.0)
        };
        let height_of = |group: &Group| HEAD + ROW * group.inputs.len().max(group.outputs.len()) as f64 + PADDING;
        let mut columns: Vec<Vec<usize>> = vec![Vec::new(); self.layers.max(1)];
        for (at, group) in self.groups.iter().enumerate() {
            columns[group.layer].push(at);
        }
        self.straighten(&mut columns);
        // Places of the boxes: left, top, width.
        let mut boxes = vec![(0.0, 0.0, 0.0); self.groups.len()];
        let (mut x, mut bottom) = (LEFT, TOP);
        let mut heads: Vec<(Part, f64)> = Vec::new();
        for column in &columns {
            let width = column.iter().map(|at| width_of(&self.groups[*at])).fold(80.0, f64::max);
            let mut y = TOP;
            for at in column {
                boxes[*at] = (x, y, width);
                y += height_of(&self.groups[*at]) + BETWEEN;
                let part = self.groups[*at].part;
                if heads.last().is_none_or(|(last, _)| *last != part) && !heads.iter().any(|(head, _)| *head == part) {
                    heads.push((part, x));
                }
            }
            bottom = f64::max(bottom, y);
            x += width + CHANNEL;
        }
        let mut sheet = Sheet::new((x - CHANNEL + LEFT).max(640.0));
        sheet.text((LEFT, 34.0), TITLE, &self.title);
        sheet.text((LEFT, 56.0), BODY, &self.text);
        if self.groups.is_empty() {
            sheet.text((LEFT, TOP), BODY, "there is no net and no component");
        }
        for (part, x) in heads {
            sheet.text((x, TOP - 12.0), SMALL.bold(), part.name());
        }
        let row = |index: usize| HEAD + ROW * index as f64 + ROW / 2.0;
        let from_of = |wire: &Wire| {
            let (x, y, width) = boxes[wire.from.0];
            (x + width, y + row(wire.from.1))
        };
        let mut named = vec![false; self.nets.len()];
        for wire in &self.wires {
            let (from, (x, y, _)) = (from_of(wire), boxes[wire.to.0]);
            let to = (x, y + row(wire.to.1));
            let colour = if wire.is_late {
                LATE
            } else {
                COLOURS[wire.net % COLOURS.len()]
            };
            let dashes = if wire.is_late { "5 4" } else { "" };
            sheet.path(&curve(from, to), colour, 1.3, dashes);
            sheet.dot(to, 2.2, colour, true);
        }
        for (at, group) in self.groups.iter().enumerate() {
            let (x, y, width) = boxes[at];
            let height = height_of(group);
            let is_component = matches!(group.part, Part::Before | Part::After);
            sheet.rectangle(
                (x, y),
                (x + width, y + height),
                if is_component { "#eef4fa" } else { "#f4f4f0" },
            );
            let corners = [(x, y), (x + width, y), (x + width, y + height), (x, y + height), (x, y)];
            sheet.path(&corners, INK, 1.0, "");
            sheet.text(
                (x + width / 2.0, y + 15.0),
                BODY.bold().at(Anchor::Middle),
                &title(group),
            );
            for (pins, x, anchor) in [
                (&group.inputs, x + PADDING, Anchor::Start),
                (&group.outputs, x + width - PADDING, Anchor::End),
            ] {
                for (index, pin) in pins.iter().enumerate() {
                    sheet.text((x, y + row(index) + 4.0), PIN_FACE.at(anchor), pin);
                }
            }
        }
        // Over the lines, so that they can be read.
        for wire in &self.wires {
            if !std::mem::replace(&mut named[wire.net], true) {
                let (x, y) = from_of(wire);
                sheet.text_over((x + 6.0, y - 4.0), PIN_FACE, &self.nets[wire.net]);
            }
        }
        sheet.finish(bottom + 8.0)
    }

    /// Orders the boxes of each layer by where those are that feed them, so that fewer lines cross.
    fn straighten(&self, columns: &mut [Vec<usize>]) {
        let mut rank = vec![0.0; self.groups.len()];
        for column in columns.iter_mut() {
            let weight = |at: usize| {
                let feeding = self.wires.iter().filter(|wire| wire.to.0 == at);
                let feeding = feeding.filter(|wire| self.groups[wire.from.0].layer < self.groups[at].layer);
                let places: Vec<f64> = feeding
                    .map(|wire| rank[wire.from.0] + wire.from.1 as f64 * 0.01)
                    .collect();
                match places.is_empty() {
                    true => f64::INFINITY,
                    false => places.iter().sum::<f64>() / places.len() as f64,
                }
            };
            let mut weighted: Vec<(f64, usize)> = column.iter().map(|at| (weight(*at), *at)).collect();
            // Those that nothing feeds stay in their order, behind the others.
            weighted.sort_by(|a, b| a.0.total_cmp(&b.0));
            for (place, (_, at)) in weighted.iter().enumerate() {
                rank[*at] = place as f64;
            }
            *column = weighted.into_iter().map(|(_, at)| at).collect();
        }
    }

    /// The graph for graphviz.
    pub(super) fn dot(&self) -> String {
        let mut text = format!(
            "digraph hal {{\n  label={};\n  labelloc=t;\n  rankdir=LR;\n  node [shape=record, fontname=\"sans-serif\", fontsize=10];\n  \
             edge [fontname=\"sans-serif\", fontsize=9];\n",
            quoted(&self.title)
        );
        let mut parts: BTreeMap<Part, Vec<usize>> = BTreeMap::new();
        for (at, group) in self.groups.iter().enumerate() {
            parts.entry(group.part).or_default().push(at);
        }
        let port = |side: char, index: usize| format!("{side}{index}");
        // Writing to a text does not fail.
        for (number, (part, groups)) in parts.iter().enumerate() {
            let _ = writeln!(
                text,
                "  subgraph cluster_{number} {{\n    label={};",
                quoted(part.name())
            );
            for at in groups {
                let group = &self.groups[*at];
                let pins = |side: char, pins: &[String]| {
                    let fields = pins.iter().enumerate();
                    let fields = fields.map(|(index, pin)| format!("<{}> {pin}", port(side, index)));
                    fields.collect::<Vec<_>>().join("|")
                };
                let label = format!(
                    "{{{{{}}}|{}|{{{}}}}}",
                    pins('i', &group.inputs),
                    title(group),
                    pins('o', &group.outputs)
                );
                let _ = writeln!(text, "    g{at} [label={}];", quoted(&label));
            }
            text.push_str("  }\n");
        }
        for wire in &self.wires {
            let late = if wire.is_late {
                ", style=dashed, constraint=false"
            } else {
                ""
            };
            let _ = writeln!(
                text,
                "  g{}:{}:e -> g{}:{}:w [label={}{late}];",
                wire.from.0,
                port('o', wire.from.1),
                wire.to.0,
                port('i', wire.to.1),
                quoted(&self.nets[wire.net])
            );
        }
        text + "}\n"
    }
}

fn title(group: &Group) -> String {
    match group.kind.as_str() {
        "" => group.name.clone(),
        // A name that begins with the type says it already.
        kind if group.name.starts_with(kind) => group.name.clone(),
        kind => format!("{} ({kind})", group.name),
    }
}

fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}

/// The group and the number of a pin in it, both made where they are not there yet.
fn place(groups: &mut Vec<Group>, pin: &str, is_source: bool, is_outside: &dyn Fn(&str) -> bool) -> (usize, usize) {
    let of_component = |group: &&mut Group| {
        let rest = pin.strip_prefix(group.name.as_str());
        !group.kind.is_empty() && rest.is_some_and(|rest| rest.starts_with('.'))
    };
    let found = groups.iter_mut().enumerate().find(|(_, group)| of_component(group));
    let (at, name) = match found {
        Some((at, group)) => (at, pin[group.name.len() + 1..].to_owned()),
        None => {
            let (group, name) = pin.rsplit_once('.').unwrap_or(("", pin));
            let part = match (is_outside(pin), is_source) {
                (true, true) => Part::Inputs,
                (true, false) => Part::Outputs,
                (false, _) => Part::Control,
            };
            let known = groups
                .iter()
                .position(|known| known.name == group && known.part == part && known.kind.is_empty());
            let at = known.unwrap_or_else(|| {
                groups.push(Group {
                    name: group.to_owned(),
                    kind: String::new(),
                    part,
                    order: 0,
                    inputs: Vec::new(),
                    outputs: Vec::new(),
                    layer: 0,
                });
                groups.len() - 1
            });
            (at, name.to_owned())
        }
    };
    let pins = match is_source {
        true => &mut groups[at].outputs,
        false => &mut groups[at].inputs,
    };
    let index = pins.iter().position(|known| *known == name).unwrap_or_else(|| {
        pins.push(name);
        pins.len() - 1
    });
    (at, index)
}

/// From the right side of one box to the left side of another.
fn curve(from: (f64, f64), to: (f64, f64)) -> Vec<(f64, f64)> {
    let reach = ((to.0 - from.0).abs() / 2.0).clamp(40.0, 160.0);
    let (a, b) = ((from.0 + reach, from.1), (to.0 - reach, to.1));
    let at = |share: f64| {
        let (s, r) = (share, 1.0 - share);
        let mix = |p: [f64; 4]| r * r * r * p[0] + 3.0 * r * r * s * p[1] + 3.0 * r * s * s * p[2] + s * s * s * p[3];
        (mix([from.0, a.0, b.0, to.0]), mix([from.1, a.1, b.1, to.1]))
    };
    (0..=24).map(|step| at(f64::from(step) / 24.0)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use config::parse;
    use std::path::Path;

    const DEMO: &str = include_str!("../../../../configs/mill3-demo.toml");

    fn graph(components: &[(&str, &str, &str)], nets: &[(&str, &str)]) -> Graph {
        let mut text = DEMO.to_owned();
        for (name, kind, place) in components {
            text += &format!("[[hal.component]]\nname = {name:?}\ntype = {kind:?}\nplace = {place:?}\n");
        }
        for (number, (source, target)) in nets.iter().enumerate() {
            text += &format!("[[hal.net]]\nname = \"n{number}\"\nsource = {source:?}\ntargets = [{target:?}]\n");
        }
        Graph::of_file(&parse(&text, Path::new("m.toml")).unwrap_or_else(|errors| panic!("{errors}")))
    }

    #[test]
    fn layers_follow_the_cycle_and_late_nets_are_marked() {
        let graph = graph(
            &[
                ("first", "not", "before-motion"),
                ("second", "not", "before-motion"),
                ("last", "not", "after-motion"),
            ],
            &[
                ("io.10.in-09", "first.in"),
                ("first.out", "second.in"),
                ("second.out", "motion.feed-hold"),
                ("motion.digital-out-01", "last.in"),
                ("last.out", "io.10.out-05"),
            ],
        );
        let layer = |name: &str, part: Part| {
            let found = graph
                .groups
                .iter()
                .find(|group| group.name == name && group.part == part);
            found.unwrap_or_else(|| panic!("{name}")).layer
        };
        let layers = [
            layer("io.10", Part::Inputs),
            layer("first", Part::Before),
            layer("second", Part::Before),
            layer("motion", Part::Control),
            layer("last", Part::After),
            layer("io.10", Part::Outputs),
        ];
        assert_eq!(layers, [0, 1, 2, 3, 4, 5]);
        assert!(graph.wires.iter().all(|wire| !wire.is_late));
        let svg = graph.svg();
        assert!(roxmltree::Document::parse(&svg).is_ok());
        for text in [
            ">n4<",
            ">feed-hold<",
            ">second (not)<",
            ">before motion<",
            ">after motion<",
            ">outputs of nodes<",
        ] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(!svg.contains("stroke-dasharray"));
        let dot = graph.dot();
        assert!(dot.starts_with("digraph hal {") && dot.ends_with("}\n"), "{dot}");
        assert_eq!(dot.matches(" -> ").count(), graph.wires.len());
        assert!(dot.contains("<i0> in") && dot.contains("label=\"n1\""), "{dot}");
    }

    #[test]
    fn what_other_processes_write_comes_first_and_what_they_read_last() {
        let text = format!(
            "{DEMO}[[hal.component]]\nname = \"a\"\ntype = \"not\"\n[[hal.external]]\nname = \"panel\"\npins = [\n\
             {{ name = \"key\", direction = \"out\", type = \"bit\", safe = false }},\n\
             {{ name = \"lamp\", direction = \"in\", type = \"bit\" }}]\n\
             [[hal.net]]\nname = \"n\"\nsource = \"panel.key\"\ntargets = [\"a.in\"]\n\
             [[hal.net]]\nname = \"m\"\nsource = \"a.out\"\ntargets = [\"panel.lamp\"]\n"
        );
        let graph = Graph::of_file(&parse(&text, Path::new("m.toml")).unwrap_or_else(|errors| panic!("{errors}")));
        let parts: Vec<Part> = ["panel", "a", "panel"]
            .iter()
            .zip([0, 0, 1])
            .map(|(name, number)| {
                let mut of_name = graph.groups.iter().filter(|group| group.name == *name);
                of_name.nth(number).expect("a box").part
            })
            .collect();
        assert_eq!(parts, [Part::Inputs, Part::Before, Part::Outputs]);
        assert!(graph.wires.iter().all(|wire| !wire.is_late));
    }

    #[test]
    fn rings_and_wrong_orders_are_drawn_and_dashed() {
        let graph = graph(
            &[("a", "not", "before-motion"), ("b", "not", "before-motion")],
            &[("b.out", "a.in"), ("a.out", "b.in")],
        );
        let late: Vec<&str> = graph
            .wires
            .iter()
            .filter(|wire| wire.is_late)
            .map(|wire| graph.nets[wire.net].as_str())
            .collect();
        assert_eq!(late, ["n0"]);
        assert!(graph.svg().contains("stroke-dasharray") && graph.dot().contains("style=dashed"));
        let empty = Graph::new("nothing", &[], &[], None);
        assert!(roxmltree::Document::parse(&empty.svg()).is_ok());
    }
}
