//! What a control tells Prometheus: text exposition format 0.0.4.
//!
//! In:  what real time publishes; values of pins; the network. Out: families with HELP and TYPE, base units, labels of small sets.

use crate::network_view::NetworkView;
use machine::faults::Reaction;
use machine::state::State;
use rt::overrides::Overridden;
use rt::shared::{Phase, RtStatus, Snapshot};
use rt::times::Histogram;
use std::fmt::Write;

/// What is told beside what real time publishes.
pub(super) struct Facts<'a> {
    pub(super) machine: &'a str,
    /// Letter of each axis, and whether it counts degrees.
    pub(super) axes: &'a [(char, bool)],
    /// Joint of each axis, where it has one of its own.
    pub(super) joint_of: &'a [Option<usize>],
    pub(super) joints: usize,
    pub(super) cycle_s: f64,
    pub(super) network: &'a NetworkView,
    pub(super) parts: u64,
    pub(super) tool: u32,
    pub(super) is_alarm: bool,
    /// Variables of programs in Structured Text that somebody has forced.
    pub(super) forced: usize,
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

    /// A family with a sample for each row: the values of its labels, and its own.
    fn rows<const N: usize>(
        &mut self,
        name: &str,
        kind: &str,
        help: &str,
        labels: [&str; N],
        rows: impl IntoIterator<Item = ([String; N], f64)>,
    ) {
        self.family(name, kind, help);
        for (values, value) in rows {
            let values = values.each_ref().map(String::as_str);
            let labels: Vec<(&str, &str)> = labels.into_iter().zip(values).collect();
            self.sample(name, &labels, value);
        }
    }
}

impl Text {
    /// `origin_s` is added to all edges and values.
    fn histogram(&mut self, name: &str, help: &str, of: &Histogram, origin_s: f64) {
        self.family(name, "histogram", help);
        let edges = of
            .edges_ns()
            .iter()
            .map(|edge| (origin_s + *edge as f64 * 1e-9).to_string());
        let mut sum = 0;
        for (edge, count) in edges.chain(["+Inf".into()]).zip(of.counts()) {
            sum += count;
            self.sample(&format!("{name}_bucket"), &[("le", &edge)], sum as f64);
        }
        self.sample(
            &format!("{name}_sum"),
            &[],
            origin_s * sum as f64 + of.sum_ns() as f64 * 1e-9,
        );
        self.sample(&format!("{name}_count"), &[], sum as f64);
    }

    /// What the system knows of this process, under the names that every exporter uses.
    fn process(&mut self) {
        let text = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
        // Behind the name of the program, which may hold anything: fields 3 and following of proc(5).
        let stat = text("/proc/self/stat");
        let stat: Vec<f64> = (stat.rsplit(')').next().unwrap_or_default().split(' '))
            .map(|field| field.parse().unwrap_or(0.0))
            .collect();
        let field = |number: usize| stat.get(number - 2).copied().unwrap_or(0.0);
        let per_s = nix::unistd::sysconf(nix::unistd::SysconfVar::CLK_TCK)
            .ok()
            .flatten()
            .unwrap_or(100) as f64;
        let page = nix::unistd::sysconf(nix::unistd::SysconfVar::PAGE_SIZE)
            .ok()
            .flatten()
            .unwrap_or(4096) as f64;
        let booted_s = (text("/proc/stat").lines())
            .find_map(|line| line.strip_prefix("btime ")?.parse().ok())
            .unwrap_or(0.0);
        let files = std::fs::read_dir("/proc/self/fd").map_or(0, Iterator::count);
        for (name, kind, help, value) in [
            (
                "cpu_seconds_total",
                "counter",
                "Time of processors.",
                (field(14) + field(15)) / per_s,
            ),
            (
                "start_time_seconds",
                "gauge",
                "When it began, since 1970.",
                booted_s + field(22) / per_s,
            ),
            (
                "virtual_memory_bytes",
                "gauge",
                "Memory that it can address.",
                field(23),
            ),
            (
                "resident_memory_bytes",
                "gauge",
                "Memory that it has.",
                field(24) * page,
            ),
            ("open_fds", "gauge", "Open files.", files as f64),
        ] {
            // Writing to a text cannot fail.
            let _ = write!(
                self.0,
                "# HELP process_{name} {help}\n# TYPE process_{name} {kind}\nprocess_{name} {value}\n"
            );
        }
    }
}

fn escaped(value: &str) -> String {
    value.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', "\\n")
}

/// All of it.
pub(super) fn text(facts: &Facts<'_>, live: &RtStatus, pin: impl Fn(&str) -> Option<f64>) -> String {
    let now = live.snapshot();
    let mut text = Text(String::new());
    text.machine(facts, &now, &pin);
    text.path(facts, &now, live, &pin);
    text.work(facts, live);
    text.cycle(facts, &now, live, &pin);
    text.bus(facts);
    text.process();
    text.0
}

impl Text {
    fn machine(&mut self, facts: &Facts<'_>, now: &Snapshot, pin: &dyn Fn(&str) -> Option<f64>) {
        self.rows(
            "build_info",
            "gauge",
            "Version of the control and name of the machine.",
            ["version", "machine"],
            [([env!("CARGO_PKG_VERSION").to_owned(), facts.machine.to_owned()], 1.0)],
        );
        let state = |state: State| ([state.code()], f64::from(state == now.state));
        self.rows(
            "state",
            "gauge",
            "1 at the state of the machine, 0 at all others.",
            ["state"],
            State::ALL.map(state),
        );
        for (name, rotary, unit) in [
            ("axis_position_metres", false, 1e-3),
            ("axis_angle_radians", true, std::f64::consts::PI / 180.0),
        ] {
            let mut rows = Vec::new();
            for ((place, (letter, is_rotary)), commanded) in facts.axes.iter().enumerate().zip(now.position.0) {
                if *is_rotary != rotary {
                    continue;
                }
                let joint = facts.joint_of.get(place).copied().flatten();
                let actual = joint.and_then(|joint| pin(&format!("joint.{joint}.motor-pos-fb")));
                for (kind, position) in [("commanded", Some(commanded)), ("actual", actual)] {
                    rows.extend(position.map(|position| ([letter.to_string(), kind.to_owned()], position * unit)));
                }
            }
            if !rows.is_empty() {
                let help = "Position of an axis, machine coordinates.";
                self.rows(name, "gauge", help, ["axis", "kind"], rows);
            }
        }
        let of_joints = |name: fn(usize) -> String| {
            (0..facts.joints).filter_map(move |joint| Some(([joint.to_string()], pin(&name(joint))? * 1e-3)))
        };
        self.rows(
            "joint_following_error_metres",
            "gauge",
            "Following error of a joint.",
            ["joint"],
            of_joints(|joint| format!("joint.{joint}.f-error")),
        );
        self.rows(
            "joint_torque_ratio",
            "gauge",
            "Torque that a drive tells, of the rated one.",
            ["joint"],
            of_joints(|joint| format!("cia402.{joint}.drv-actual-torque")),
        );
    }

    fn path(&mut self, facts: &Facts<'_>, now: &Snapshot, live: &RtStatus, pin: &dyn Fn(&str) -> Option<f64>) {
        let commanded = || "commanded".to_owned();
        self.rows(
            "feed_metres_per_second",
            "gauge",
            "Speed along the path.",
            ["kind"],
            [([commanded()], now.velocity_mm_s * 1e-3)],
        );
        self.rows(
            "override_ratio",
            "gauge",
            "Share of what is programmed.",
            ["what"],
            Overridden::ALL.map(|what| ([what.name().to_owned()], live.overrides.percent(what) * 1e-2)),
        );
        if let Some(rpm) = pin("spindle.0.speed-out") {
            let speeds = [
                (commanded(), Some(rpm / 60.0)),
                ("actual".to_owned(), pin("spindle.0.speed-in")),
            ];
            self.rows(
                "spindle_revolutions_per_second",
                "gauge",
                "Speed of a spindle.",
                ["spindle", "kind"],
                (speeds.into_iter()).filter_map(|(kind, turns_s)| Some((["0".to_owned(), kind], turns_s?))),
            );
        }
        self.single(
            "tool_number",
            "gauge",
            "Tool in the spindle, 0: none.",
            f64::from(facts.tool),
        );
    }

    fn work(&mut self, facts: &Facts<'_>, live: &RtStatus) {
        self.rows(
            "parts_total",
            "counter",
            "Parts made, as the counter of the machine has them.",
            ["result"],
            [(["completed".to_owned()], facts.parts as f64)],
        );
        let seconds = |phase: Phase| ([phase.name().to_owned()], live.phase(phase) as f64 * facts.cycle_s);
        self.rows(
            "program_seconds_total",
            "counter",
            "Time of programs, by what it was spent on.",
            ["phase"],
            Phase::ALL.map(seconds),
        );
        let alarms = |reaction: Reaction| ([reaction.severity().to_string()], live.desk.alarms(reaction) as f64);
        self.rows(
            "alarms_total",
            "counter",
            "Alarms and warnings, by what the machine does.",
            ["class"],
            Reaction::ALL.map(alarms),
        );
        for (name, help, value) in [
            ("alarm_active", "1 while an alarm stands.", f64::from(facts.is_alarm)),
            (
                "logic_forced",
                "Variables of programs in Structured Text that somebody has forced.",
                facts.forced as f64,
            ),
            (
                "control_taken",
                "1 while a client has control.",
                f64::from(facts.controlled),
            ),
        ] {
            self.single(name, "gauge", help, value);
        }
    }

    fn cycle(&mut self, facts: &Facts<'_>, now: &Snapshot, live: &RtStatus, pin: &dyn Fn(&str) -> Option<f64>) {
        self.single("cycles_total", "counter", "Cycles since the start.", now.cycles as f64);
        self.single(
            "cycles_skipped_total",
            "counter",
            "Cycles skipped because they came too late.",
            now.cycles_skipped as f64,
        );
        self.single(
            "cycle_lateness_seconds_max",
            "gauge",
            "Worst lateness of a cycle since the start.",
            now.late_max_ns as f64 * 1e-9,
        );
        let [period, times @ ..] = live.times.all();
        self.histogram(
            "cycle_period_seconds",
            "Distance from one SoC to the next.",
            period.1,
            facts.cycle_s,
        );
        for (name, histogram) in times {
            let help = match name {
                "lateness" => "How long after its date a SoC was sent.",
                "exchange" => "From a SoC to the end of the exchange.",
                _ => "From the end of the exchange to that of the cycle.",
            };
            self.histogram(&format!("cycle_{name}_seconds"), help, histogram, 0.0);
        }
        self.single(
            "queue_seconds",
            "gauge",
            "Motion that is planned ahead.",
            now.remaining_s,
        );
        let of_second = ["mean", "p99", "max"].into_iter().filter_map(|kind| {
            let ns = pin(&format!("rt.compute-{kind}-ns"))?;
            Some(([kind.to_owned()], ns * 1e-9))
        });
        self.rows(
            "cycle_compute_recent_seconds",
            "gauge",
            "Time that a cycle computes, over the last second.",
            ["kind"],
            of_second,
        );
    }

    fn bus(&mut self, facts: &Facts<'_>) {
        let nodes = || (facts.network.nodes.iter()).filter_map(|node| Some((node.id.to_string(), node.live.as_ref()?)));
        self.rows(
            "bus_frames_lost_total",
            "counter",
            "Answers of a node that did not come.",
            ["node"],
            nodes().map(|(node, live)| ([node], live.lost as f64)),
        );
        self.rows(
            "bus_node_operational",
            "gauge",
            "1 while process data of a node are valid.",
            ["node"],
            nodes().map(|(node, live)| ([node], f64::from(live.operational))),
        );
        let states = nodes().flat_map(|(node, live)| {
            bus::node_states().map(move |state| {
                let is_it = f64::from(live.nmt_state == state);
                ([node.clone(), state.to_lowercase()], is_it)
            })
        });
        self.rows(
            "bus_node_state",
            "gauge",
            "1 at the state that a node told last, 0 at all others.",
            ["node", "state"],
            states,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt::cycle_stats::Timing;
    use std::collections::BTreeSet;
    use std::path::Path;

    #[test]
    fn every_sample_belongs_to_the_family_above_it_and_the_last_line_ends() {
        let file = include_str!("../../../configs/mill3-demo.toml");
        let config = config::parse(file, Path::new("m.toml")).unwrap();
        let facts = Facts {
            machine: "a \"b\"\\",
            axes: &[('X', false), ('A', true)],
            joint_of: &[Some(0), None],
            joints: 2,
            cycle_s: 0.001,
            network: &NetworkView::from_config(&config),
            parts: 7,
            tool: 3,
            is_alarm: true,
            forced: 2,
            controlled: false,
        };
        let pin = |name: &str| Some(if name == "joint.1.f-error" { 2.0 } else { f64::NAN });
        let live = RtStatus::default();
        live.desk.count_alarm(Reaction::QuickStop);
        for difference_ns in [-700, 900_000] {
            live.count_phase(Phase::Cut);
            live.times.record(&Timing {
                period_difference_ns: Some(difference_ns),
                ..Timing::default()
            });
        }
        let text = text(&facts, &live, pin);
        assert!(text.ends_with('\n'));
        let (mut family, mut seen) = (String::new(), BTreeSet::new());
        for line in text.lines() {
            match line.strip_prefix("# HELP ") {
                Some(rest) => {
                    family = rest.split(' ').next().unwrap().to_owned();
                    assert!(seen.insert(family.clone()), "{family} twice");
                }
                None if line.starts_with("# TYPE ") => assert!(line.contains(&family)),
                None => {
                    let name = line.split(['{', ' ']).next().unwrap();
                    let of_histogram = ["_bucket", "_sum", "_count"]
                        .iter()
                        .find_map(|end| name.strip_suffix(end));
                    assert!(name == family || of_histogram == Some(&family), "{line}");
                }
            }
        }
        for line in [
            "isocnc_build_info{version=\"0.1.0\",machine=\"a \\\"b\\\"\\\\\"} 1",
            "isocnc_joint_following_error_metres{joint=\"1\"} 0.002",
            "isocnc_joint_following_error_metres{joint=\"0\"} NaN",
            "isocnc_logic_forced 2",
            "isocnc_state{state=\"booting\"} 1",
            "isocnc_state{state=\"running\"} 0",
            "isocnc_parts_total{result=\"completed\"} 7",
            "isocnc_override_ratio{what=\"feed\"} 1",
            "isocnc_axis_position_metres{axis=\"X\",kind=\"actual\"} NaN",
            "isocnc_program_seconds_total{phase=\"cut\"} 0.002",
            "isocnc_alarms_total{class=\"quick stop\"} 1",
            "isocnc_cycle_period_seconds_bucket{le=\"0.001\"} 1",
            "isocnc_cycle_period_seconds_bucket{le=\"+Inf\"} 2",
            "isocnc_cycle_lateness_seconds_count 2",
        ] {
            assert!(text.lines().any(|told| told == line), "{line} is not in\n{text}");
        }
        // Periods of 999.3 us and 1.9 ms.
        let of_period = |what: &str| {
            let value = text
                .lines()
                .find_map(|line| line.strip_prefix(&format!("isocnc_cycle_period_seconds_{what} ")));
            value.unwrap().parse::<f64>().unwrap()
        };
        let mean_s = of_period("sum") / of_period("count");
        assert!((mean_s - (0.000_999_3 + 0.001_9) / 2.0).abs() < 1e-12, "{mean_s}");
    }
}
