//! What a control tells Prometheus: text exposition format 0.0.4.
//!
//! In:  what real time publishes; values of pins; the network. Out: families with HELP and TYPE, base units, labels of small sets.

use crate::api::network_view::NetworkView;
use crate::machine::state::State;
use crate::rt::overrides::Overridden;
use crate::rt::shared::RtStatus;
use std::fmt::Write;

/// What is told beside what real time publishes.
pub(super) struct Facts<'a> {
    pub(super) machine: &'a str,
    /// Letter of each axis, and whether it counts degrees.
    pub(super) axes: &'a [(char, bool)],
    pub(super) joints: usize,
    pub(super) network: &'a NetworkView,
    pub(super) parts: u64,
    pub(super) tool: u32,
    pub(super) is_alarm: bool,
    pub(super) controlled: bool,
}

/// A family and its samples.
struct Text(String);

impl Text {
    fn family(&mut self, name: &str, kind: &str, help: &str) {
        // Writing to a text cannot fail.
        let _ = write!(self.0, "# HELP isocnc_{name} {help}\n# TYPE isocnc_{name} {kind}\n");
    }

    fn sample(&mut self, name: &str, labels: &[(&str, &str)], value: f64) {
        let labels: Vec<String> = (labels.iter())
            .map(|(label, value)| format!("{label}=\"{}\"", escaped(value)))
            .collect();
        let labels = match labels.is_empty() {
            true => String::new(),
            false => format!("{{{}}}", labels.join(",")),
        };
        let value = match value {
            value if value.is_nan() => "NaN".to_owned(),
            value if value.is_infinite() => if value > 0.0 { "+Inf" } else { "-Inf" }.to_owned(),
            value => value.to_string(),
        };
        let _ = writeln!(self.0, "isocnc_{name}{labels} {value}");
    }

    fn single(&mut self, name: &str, kind: &str, help: &str, value: f64) {
        self.family(name, kind, help);
        self.sample(name, &[], value);
    }
}

fn escaped(value: &str) -> String {
    value.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', "\\n")
}

/// All of it.
pub(super) fn text(facts: &Facts<'_>, live: &RtStatus, pin: impl Fn(&str) -> Option<f64>) -> String {
    let now = live.snapshot();
    let mut text = Text(String::new());
    text.family("build_info", "gauge", "Version of the control and name of the machine.");
    let labels = [("version", env!("CARGO_PKG_VERSION")), ("machine", facts.machine)];
    text.sample("build_info", &labels, 1.0);
    text.family("state", "gauge", "1 at the state of the machine, 0 at all others.");
    for state in State::ALL {
        let name = format!("{state:?}").to_lowercase();
        text.sample("state", &[("state", &name)], f64::from(state == now.state));
    }
    for (name, rotary, unit) in [
        ("axis_position_metres", false, 1e-3),
        ("axis_angle_radians", true, std::f64::consts::PI / 180.0),
    ] {
        let mut axes = facts
            .axes
            .iter()
            .zip(now.position.0)
            .filter(|((_, is_rotary), _)| *is_rotary == rotary)
            .peekable();
        if axes.peek().is_some() {
            text.family(name, "gauge", "Commanded position of an axis, machine coordinates.");
        }
        for ((letter, _), position) in axes {
            let letter = letter.to_string();
            text.sample(name, &[("axis", &letter), ("kind", "commanded")], position * unit);
        }
    }
    text.family("joint_following_error_metres", "gauge", "Following error of a joint.");
    for joint in 0..facts.joints {
        if let Some(error_mm) = pin(&format!("joint.{joint}.f-error")) {
            text.sample(
                "joint_following_error_metres",
                &[("joint", &joint.to_string())],
                error_mm * 1e-3,
            );
        }
    }
    text.family("feed_metres_per_second", "gauge", "Speed along the path.");
    text.sample(
        "feed_metres_per_second",
        &[("kind", "commanded")],
        now.velocity_mm_s * 1e-3,
    );
    text.family("override_ratio", "gauge", "Share of what is programmed.");
    for what in Overridden::ALL {
        text.sample(
            "override_ratio",
            &[("what", what.name())],
            live.overrides.percent(what) * 1e-2,
        );
    }
    if let Some(rpm) = pin("spindle.0.speed-out") {
        text.family("spindle_revolutions_per_second", "gauge", "Speed of a spindle.");
        text.sample(
            "spindle_revolutions_per_second",
            &[("spindle", "0"), ("kind", "commanded")],
            rpm / 60.0,
        );
    }
    text.single(
        "tool_number",
        "gauge",
        "Tool in the spindle, 0: none.",
        f64::from(facts.tool),
    );
    text.family(
        "parts_total",
        "counter",
        "Parts made, as the counter of the machine has them.",
    );
    text.sample("parts_total", &[("result", "completed")], facts.parts as f64);
    text.single(
        "alarm_active",
        "gauge",
        "1 while an alarm stands.",
        f64::from(facts.is_alarm),
    );
    text.single(
        "control_taken",
        "gauge",
        "1 while a client has control.",
        f64::from(facts.controlled),
    );
    text.single("cycles_total", "counter", "Cycles since the start.", now.cycles as f64);
    text.single(
        "cycles_skipped_total",
        "counter",
        "Cycles left out as they came too late.",
        now.cycles_skipped as f64,
    );
    text.single(
        "cycle_lateness_seconds_max",
        "gauge",
        "Worst lateness of a cycle since the start.",
        now.late_max_ns as f64 * 1e-9,
    );
    text.single(
        "queue_seconds",
        "gauge",
        "Motion that is planned ahead.",
        now.remaining_s,
    );
    let compute = [
        ("rt.compute-mean-ns", "mean"),
        ("rt.compute-p99-ns", "p99"),
        ("rt.compute-max-ns", "max"),
    ];
    text.family(
        "cycle_compute_seconds",
        "gauge",
        "Time that a cycle computes, over the last second.",
    );
    for (name, kind) in compute {
        if let Some(ns) = pin(name) {
            text.sample("cycle_compute_seconds", &[("kind", kind)], ns * 1e-9);
        }
    }
    text.family(
        "bus_frames_lost_total",
        "counter",
        "Answers of a node that did not come.",
    );
    for node in &facts.network.nodes {
        if let Some(live) = &node.live {
            text.sample(
                "bus_frames_lost_total",
                &[("node", &node.id.to_string())],
                live.lost as f64,
            );
        }
    }
    text.family(
        "bus_node_operational",
        "gauge",
        "1 while process data of a node are valid.",
    );
    for node in &facts.network.nodes {
        if let Some(live) = &node.live {
            text.sample(
                "bus_node_operational",
                &[("node", &node.id.to_string())],
                f64::from(live.operational),
            );
        }
    }
    text.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config;
    use std::collections::BTreeSet;
    use std::path::Path;

    #[test]
    fn every_sample_belongs_to_the_family_above_it_and_the_last_line_ends() {
        let file = include_str!("../../configs/mill3-demo.toml");
        let config = config::parse(file, Path::new("m.toml")).unwrap();
        let facts = Facts {
            machine: "a \"b\"\\",
            axes: &[('X', false), ('A', true)],
            joints: 2,
            network: &NetworkView::from_config(&config),
            parts: 7,
            tool: 3,
            is_alarm: true,
            controlled: false,
        };
        let pin = |name: &str| Some(if name == "joint.1.f-error" { 2.0 } else { f64::NAN });
        let text = text(&facts, &RtStatus::default(), pin);
        assert!(text.ends_with('\n'));
        let (mut family, mut seen) = (String::new(), BTreeSet::new());
        for line in text.lines() {
            match line.strip_prefix("# HELP ") {
                Some(rest) => {
                    family = rest.split(' ').next().unwrap().to_owned();
                    assert!(seen.insert(family.clone()), "{family} twice");
                }
                None if line.starts_with("# TYPE ") => assert!(line.contains(&family)),
                None => assert_eq!(line.split(['{', ' ']).next().unwrap(), family, "{line}"),
            }
        }
        for line in [
            "isocnc_build_info{version=\"0.1.0\",machine=\"a \\\"b\\\"\\\\\"} 1",
            "isocnc_joint_following_error_metres{joint=\"1\"} 0.002",
            "isocnc_joint_following_error_metres{joint=\"0\"} NaN",
            "isocnc_state{state=\"booting\"} 1",
            "isocnc_state{state=\"running\"} 0",
            "isocnc_parts_total{result=\"completed\"} 7",
            "isocnc_override_ratio{what=\"feed\"} 1",
        ] {
            assert!(text.lines().any(|told| told == line), "{line} is not in\n{text}");
        }
    }
}
