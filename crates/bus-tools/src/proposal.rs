//! The machine file that is proposed for nodes: by `init`, and by `bus scan --write`.
//!
//! In:  the nodes, from options or from a wire of either bus; `configs/mill3-powerlink.toml`, whose comments and values the file has.
//! Out: the text. Each drive has a joint and an axis; without a drive nothing moves.

use crate::Protocol;
use anyhow::ensure;
use std::fmt::Write as _;
use terminal::refusal::Refusal;

const EXAMPLE: &str = include_str!("../../../configs/mill3-powerlink.toml");
/// What the example is called, where it is and how fast.
const EXAMPLE_NAME: &str = "\"mill3\"";
const EXAMPLE_INTERFACE: &str = "\"enp2s0\"";
const EXAMPLE_CYCLE: &str = "cycle_us = 1000";
/// What a machine needs, and what a PC without real time can keep; the last two of POWERLINK and of EtherCAT.
const TO_TRY: [(&str, &str); 6] = [
    ("require = \"strict\" ", "require = \"warn\"   "),
    ("# late_us_max = 250  ", "late_us_max = 500    "),
    (
        "lock_memory = true",
        "overruns_stop = 0               # cycles left out stop nothing\nlock_memory = true",
    ),
    ("pres_lost_max = 3  ", "pres_lost_max = 200"),
    ("soc_lost_max = 3  ", "soc_lost_max = 100"),
    ("\nlost_max = 3   ", "\nlost_max = 200 "),
];
/// Axes of a machine that says nothing else, as many as it has drives.
const LETTERS: &str = "XYZABCUVW";

/// A node of the new machine.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Node {
    pub(super) id: u8,
    /// What it calls itself, as far as that is a name; `None`: it is named by what it is for.
    pub(super) name: Option<String>,
    pub(super) is_drive: bool,
    /// Its keys behind name and profile, and its channels.
    pub(super) keys: String,
}

/// What is known of the joint of an axis; what is not is as in the example.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Travel {
    /// Increments of the drive, and the mm or degrees that it moves by them.
    pub(super) scale: Option<[u32; 2]>,
    /// Lower and upper end, mm or degrees.
    pub(super) ends: Option<[f64; 2]>,
    /// Greatest speed, mm/min or degrees/min.
    pub(super) speed_per_min: Option<f64>,
}

impl Travel {
    /// Writes what is known over the keys of an example.
    fn over(&self, keys: &str) -> String {
        let of = |line: &str| {
            let (key, _) = line.split_once(" = ")?;
            match (key, self) {
                (
                    "counts_per_unit",
                    Travel {
                        scale: Some([counts, unit]),
                        ..
                    },
                ) => Some(format!("{key} = [{counts}, {unit}]")),
                (
                    "travel_mm",
                    Travel {
                        ends: Some([lower, upper]),
                        ..
                    },
                ) => Some(format!("{key} = [{lower:?}, {upper:?}]")),
                (
                    "velocity_mm_s",
                    Travel {
                        speed_per_min: Some(speed),
                        ..
                    },
                ) => Some(format!("{key} = {:?}", speed / 60.0)),
                // A search is no faster than the joint.
                (
                    "homing",
                    Travel {
                        speed_per_min: Some(speed),
                        ..
                    },
                ) => {
                    let [search, latch] = [40.0, 4.0].map(|usual: f64| usual.min(speed / 60.0));
                    let line = line.replace("search_mm_s = 40.0", &format!("search_mm_s = {search:?}"));
                    Some(line.replace("latch_mm_s = 4.0", &format!("latch_mm_s = {latch:?}")))
                }
                _ => None,
            }
        };
        let lines = keys.split('\n').map(|line| of(line).unwrap_or_else(|| line.to_owned()));
        lines.collect::<Vec<_>>().join("\n")
    }
}

/// What is known of the machine.
#[derive(Clone, Copy, Debug)]
pub(super) struct Proposal<'a> {
    /// The command that writes it.
    pub(super) by: &'a str,
    pub(super) name: &'a str,
    pub(super) bus: Protocol,
    pub(super) interface: &'a str,
    pub(super) cycle_us: u32,
    /// Letters of the axes; `None`: as many as there are drives.
    pub(super) axes: Option<&'a str>,
    /// What is known of each axis, in the order of their letters; those that lack are as in the example.
    pub(super) travels: &'a [Travel],
    /// On a PC without real time: nothing is refused for want of it, and late cycles are borne.
    pub(super) to_try: bool,
    /// The first node with inputs and outputs switches spindle and coolant, as in the example.
    pub(super) with_nets: bool,
}

/// The usual letters of so many axes; there are nine.
pub(super) fn letters(count: usize) -> String {
    LETTERS.chars().take(count).collect()
}

fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}

/// A part of the example.
fn between(from: &str, to: &str) -> &'static str {
    let rest = EXAMPLE.split_once(from).map_or("", |(_, rest)| rest);
    rest.split_once(to).map_or(rest, |(part, _)| part)
}

impl Node {
    /// Its `[[bus.node]]`.
    pub(super) fn text(&self, name: &str) -> String {
        let profile = if self.is_drive { "cia402" } else { "io" };
        let (id, keys) = (self.id, &self.keys);
        format!("[[bus.node]]\nid = {id}\nname = \"{name}\"\nprofile = \"{profile}\"\n{keys}\n")
    }
}

impl Proposal<'_> {
    /// The text of the machine file.
    ///
    /// # Errors
    /// Axes that are asked for and are not as many as the drives.
    pub(super) fn machine_file(&self, mut nodes: Vec<Node>) -> anyhow::Result<String> {
        nodes.sort_by_key(|node| !node.is_drive);
        let drives = nodes.iter().filter(|node| node.is_drive).count();
        let axes = match self.axes {
            Some(axes) => axes.to_ascii_uppercase(),
            None => letters(drives),
        };
        let count = axes.chars().count();
        ensure!(
            self.axes.is_none() || count == drives,
            Refusal::usage(format_args!(
                "{count} axes ({axes}) and {drives} drives: each axis has one drive; more drives of an axis are added in the file"
            ))
        );
        let mut text = self.head(count > 0);
        let mut names: Vec<String> = Vec::new();
        let mut letters = axes.chars();
        for node in &nodes {
            let letter = if node.is_drive { letters.next() } else { None };
            let usual = match letter {
                Some(letter) => format!("{}-drive", letter.to_ascii_lowercase()),
                None if node.is_drive => format!("drive-{}", node.id),
                None => format!("io-{}", node.id),
            };
            let own = node.name.clone().filter(|name| !names.contains(name));
            let numbered = (2..).map(|number| format!("{usual}-{number}"));
            let mut free = own.into_iter().chain([usual.clone()]).chain(numbered);
            let name = free.find(|name| !names.contains(name)).unwrap_or(usual);
            text += &node.text(&name);
            names.push(name);
        }
        if count > 0 {
            // A String takes everything.
            let _ = self.motion(&mut text, &axes, &nodes);
        }
        text.truncate(text.trim_end().len());
        text.push('\n');
        Ok(text)
    }

    fn head(&self, moves: bool) -> String {
        let by = self.by;
        if !moves {
            return format!(
                "# Written by `{by}`: names of nodes and channels are proposals; `isocnc check` names every mistake.\n\
                 schema = 1\n\n[machine]\nname = {}\nkinematics = \"none\"             # nothing moves\n\n[bus]\n\
                 kind = \"{}\"\ninterface = {}\n\n",
                quoted(self.name),
                self.kind(),
                quoted(self.interface)
            );
        }
        let head = between("schema = 1", "[[bus.node]]");
        let head = head.replacen(EXAMPLE_NAME, &quoted(self.name), 1);
        let mut head = head.replacen(EXAMPLE_CYCLE, &format!("cycle_us = {}", self.cycle_us), 1);
        match self.bus {
            Protocol::Powerlink => head = head.replacen(EXAMPLE_INTERFACE, &quoted(self.interface), 1),
            Protocol::Ethercat => {
                head.truncate(head.find("[bus]").unwrap_or(head.len()));
                head += &format!(
                    "[bus]\nkind = \"ethercat\"               # \"ethercat-memory\": the simulated machine inside this process\n\
                     interface = {}\nlost_max = 3                    # cycles in a row without a device's data that are ridden out\n\n",
                    quoted(self.interface)
                );
            }
        }
        if self.to_try {
            head = TO_TRY
                .iter()
                .fold(head, |head, (strict, tried)| head.replacen(strict, tried, 1));
        }
        format!(
            "# Written by `{by}`: set scale, travel, limits and homing of each joint to those of the machine.\n\
             # `isocnc check` names every mistake; `isocnc schema > machine.schema.json` and a first line\n\
             # `#:schema ./machine.schema.json` show in an editor what each key means.\nschema = 1{head}"
        )
    }

    fn kind(&self) -> &'static str {
        match self.bus {
            Protocol::Powerlink => "powerlink",
            Protocol::Ethercat => "ethercat",
        }
    }

    /// Joints, axes and what a machine with them has; drives come first.
    fn motion(&self, text: &mut String, axes: &str, nodes: &[Node]) -> std::fmt::Result {
        // Three joints stand there: one with remarks, a plain one, and one that homes upward.
        let joints: Vec<&str> = between("[[joint]]\n", "[[axis]]").split("[[joint]]\n").collect();
        let travels = self.travels.iter().copied().chain(std::iter::repeat(Travel::default()));
        for ((letter, drive), travel) in axes.chars().zip(nodes).zip(travels) {
            let joint = joints[if letter == 'Z' { 2 } else { 1 }];
            let keys = joint.split_once('\n').map_or("", |(_, keys)| keys);
            write!(
                text,
                "# {letter}\n[[joint]]\nnode = {}\n{}",
                drive.id,
                travel.over(keys)
            )?;
        }
        for (joint, letter) in axes.chars().enumerate() {
            write!(text, "[[axis]]\nletter = \"{letter}\"\njoints = [{joint}]\n\n")?;
        }
        let zeros: Vec<String> = axes
            .to_ascii_lowercase()
            .chars()
            .map(|letter| format!("{letter} = 0.0"))
            .collect();
        write!(
            text,
            "[offsets]\ng54 = {{ {} }}\n\n[spindle]{}",
            zeros.join(", "),
            between("[spindle]", "# I/O as")
        )?;
        if let Some(io) = nodes.iter().find(|node| !node.is_drive && self.with_nets) {
            let nets = between("# I/O as", "\u{0}").replace("io.10.", &format!("io.{}.", io.id));
            write!(text, "# I/O as{nets}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_example_has_all_that_is_taken_from_it() {
        for part in [
            EXAMPLE_NAME,
            EXAMPLE_INTERFACE,
            EXAMPLE_CYCLE,
            "schema = 1",
            "[spindle]",
            "# I/O as",
        ] {
            assert_eq!(EXAMPLE.matches(part).count(), 1, "{part}");
        }
        assert_eq!(EXAMPLE.matches("[[joint]]\nnode = ").count(), 3);
    }

    /// The same generator for both buses: joints and axes for drives, names that devices have, none twice.
    #[test]
    fn drives_have_joints_and_axes_on_either_bus() {
        for (bus, kind) in [(Protocol::Powerlink, "powerlink"), (Protocol::Ethercat, "ethercat")] {
            let proposal = Proposal {
                by: "isocnc bus scan",
                name: "found",
                bus,
                interface: "eth7",
                cycle_us: 500,
                axes: None,
                travels: &[],
                to_try: false,
                with_nets: false,
            };
            let node = |id, name: Option<&str>, is_drive| Node {
                id,
                name: name.map(str::to_owned),
                is_drive,
                keys: "vendor_id = 0x2D\n".into(),
            };
            let nodes = vec![
                node(3, None, false),
                node(1, Some("servo"), true),
                node(2, Some("servo"), true),
            ];
            let text = proposal.machine_file(nodes.clone()).unwrap();
            let config =
                config::parse(&text, "found.toml".as_ref()).unwrap_or_else(|errors| panic!("{errors}\n{text}"));
            let names: Vec<&str> = config.bus.nodes.iter().map(|node| node.name.as_str()).collect();
            assert_eq!(names, ["servo", "y-drive", "io-3"]);
            assert_eq!((config.bus.kind.name(), config.cycle_us), (kind, 500));
            assert_eq!(config.bus.interface, "eth7");
            let axes: Vec<_> = config
                .axes
                .iter()
                .map(|map| (map.axis.letter(), map.joints.clone()))
                .collect();
            assert_eq!(axes, [('X', vec![0]), ('Y', vec![1])]);
            let joints: Vec<usize> = config.joints.iter().map(|joint| joint.node).collect();
            assert_eq!(joints, [0, 1]);
            let still = proposal.machine_file(nodes[..1].to_vec()).unwrap();
            let config =
                config::parse(&still, "found.toml".as_ref()).unwrap_or_else(|errors| panic!("{errors}\n{still}"));
            assert_eq!((config.joints.len(), config.bus.kind.name()), (0, kind));
        }
    }
}
