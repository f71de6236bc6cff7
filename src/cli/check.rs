//! `isocnc check`: is this machine file good, and what machine does it describe?
//!
//! In:  a machine file.
//! Out: every mistake with its place, or a summary of the machine. Nothing is opened, sent or moved.

use crate::bus::network::{self, NodePlan};
use crate::config::{self, BusKind, Config, Joint, Profile};
use crate::rt::pins::{CAPACITY, Pins};
use anyhow::Context;
use hal_pins::Hal;
use serde_json::{Value as Json, json};
use std::fmt::{self, Write as _};
use std::io::{ErrorKind, Write as _};
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments of `check`.
#[derive(Debug, clap::Args)]
pub struct CheckArgs {
    /// Machine file.
    machine: PathBuf,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Checks a machine file: exit code 0 if it is good, 1 if it is not.
///
/// # Errors
/// Output that cannot be written.
pub fn check(args: &CheckArgs) -> anyhow::Result<ExitCode> {
    let config = match config::read(&args.machine) {
        Ok(config) => config,
        Err(errors) => {
            if args.json {
                print(&format!("{:#}\n", errors.to_json()))?;
            } else {
                eprint!("{errors}");
            }
            return Ok(ExitCode::FAILURE);
        }
    };
    let plans = network::plan(&config);
    if let Err(error) = connections(&config, &plans) {
        let file = args.machine.display();
        if args.json {
            let errors = json!([{ "rule": format!("{error:#}") }]);
            print(&format!(
                "{:#}\n",
                json!({ "file": file.to_string(), "errors": errors })
            ))?;
        } else {
            eprintln!("{file}: {error:#}\n1 error in {file}");
        }
        return Ok(ExitCode::FAILURE);
    }
    print(&if args.json {
        format!("{:#}\n", to_json(&config, &plans))
    } else {
        Summary(&config, &plans).to_string()
    })?;
    Ok(ExitCode::SUCCESS)
}

/// Writes to standard output; the reader of a pipe may have seen enough.
fn print(text: &str) -> std::io::Result<()> {
    match std::io::stdout().write_all(text.as_bytes()) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        result => result,
    }
}

/// What shows only when the parts are put together: whether the pins exist that nets name.
fn connections(config: &Config, plans: &[NodePlan]) -> anyhow::Result<()> {
    // A control of this machine may be running: not under its name, and not where it would be found.
    let name = format!("check-{}", std::process::id());
    Hal::create_in(&[std::env::temp_dir()], &name, CAPACITY)
        .and_then(|mut hal| Pins::new(&mut hal, config, plans).map(drop))
        .context("hal")
}

/// How a cycle is spent if every node leaves its poll unanswered, µs.
struct CycleUse {
    timeouts_us: u32,
    async_slot_us: u32,
    left_us: u32,
}

impl CycleUse {
    fn of(config: &Config) -> CycleUse {
        let timeouts_us = config.bus.nodes.iter().map(|node| node.pres_timeout_us).sum();
        let async_slot_us = config.bus.async_slot_timeout_us;
        CycleUse {
            timeouts_us,
            async_slot_us,
            left_us: config.cycle_us.saturating_sub(timeouts_us + async_slot_us),
        }
    }
}

fn profile_name(profile: Profile) -> &'static str {
    match profile {
        Profile::Cia402 => "cia402",
        Profile::Io => "io",
    }
}

fn bus_name(kind: BusKind) -> &'static str {
    match kind {
        BusKind::Powerlink => "powerlink",
        BusKind::Memory => "memory",
    }
}

/// Letters of the axes that move a joint, and whether its lengths are degrees.
fn axes_of(config: &Config, joint: usize) -> (String, bool) {
    let axes = config.axes.iter().filter(|map| map.joints.contains(&joint));
    let letters = axes.clone().map(|map| map.axis.letter()).collect();
    (letters, axes.clone().any(|map| map.axis.is_rotary()))
}

/// The machine in words.
struct Summary<'a>(&'a Config, &'a [NodePlan]);

impl fmt::Display for Summary<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Summary(config, plans) = *self;
        let CycleUse {
            timeouts_us,
            async_slot_us,
            left_us,
        } = CycleUse::of(config);
        writeln!(f, "{} is good\n", config.path.display())?;
        writeln!(f, "machine   {}", config.name)?;
        let interface = match config.bus.kind {
            BusKind::Powerlink => format!("powerlink on {}", config.bus.interface),
            BusKind::Memory => "memory: the simulated machine inside the control".into(),
        };
        writeln!(f, "bus       {interface}")?;
        writeln!(f, "cycle     {} us, if no node answers:", config.cycle_us)?;
        writeln!(
            f,
            "          {timeouts_us:>5} us time-outs of {} nodes",
            config.bus.nodes.len()
        )?;
        writeln!(f, "          {async_slot_us:>5} us asynchronous slot")?;
        writeln!(
            f,
            "          {left_us:>5} us left for the frames themselves and for computing"
        )?;
        writeln!(f, "nodes")?;
        for (node, plan) in config.bus.nodes.iter().zip(plans) {
            writeln!(
                f,
                "  {:>3}  {:<12} {:<7} {:<9} PRes within {} us, {} octets out, {} in",
                node.id,
                node.name,
                profile_name(node.profile),
                if node.mandatory { "mandatory" } else { "optional" },
                node.pres_timeout_us,
                plan.outputs.octets,
                plan.inputs.octets,
            )?;
        }
        writeln!(f, "joints")?;
        for (number, joint) in config.joints.iter().enumerate() {
            writeln!(f, "  {number:>3}  {}", self.joint(number, joint)?)?;
        }
        writeln!(f, "axes")?;
        for map in &config.axes {
            let joints: Vec<String> = map.joints.iter().map(usize::to_string).collect();
            writeln!(f, "    {}  joint {}", map.axis.letter(), joints.join(" and "))?;
        }
        writeln!(f, "nets")?;
        if config.nets.is_empty() {
            writeln!(f, "       none")?;
        }
        for net in &config.nets {
            writeln!(f, "       {}: {} -> {}", net.name, net.source, net.targets.join(", "))?;
        }
        Ok(())
    }
}

impl Summary<'_> {
    fn joint(&self, number: usize, joint: &Joint) -> Result<String, fmt::Error> {
        let (_, rotary) = axes_of(self.0, number);
        let unit = if rotary { "degrees" } else { "mm" };
        let mut text = String::new();
        write!(
            text,
            "{:<12} {} to {} {unit}, {} {unit}/s, {} {unit}/s2, {} {unit}/s3, homing method {}",
            self.0.bus.nodes[joint.node].name,
            joint.travel_mm[0],
            joint.travel_mm[1],
            joint.limits.velocity_mm_s,
            joint.limits.acceleration_mm_s2,
            joint.limits.jerk_mm_s3,
            joint.homing.method,
        )?;
        Ok(text)
    }
}

fn to_json(config: &Config, plans: &[NodePlan]) -> Json {
    let spent = CycleUse::of(config);
    let nodes = config.bus.nodes.iter().zip(plans).map(|(node, plan)| {
        json!({
            "id": node.id,
            "name": node.name,
            "profile": profile_name(node.profile),
            "mandatory": node.mandatory,
            "pres_timeout_us": node.pres_timeout_us,
            "output_octets": plan.outputs.octets,
            "input_octets": plan.inputs.octets,
        })
    });
    let joints = config.joints.iter().enumerate().map(|(number, joint)| {
        json!({
            "node": config.bus.nodes[joint.node].id,
            "axes": axes_of(config, number).0,
            "travel_mm": joint.travel_mm,
            "velocity_mm_s": joint.limits.velocity_mm_s,
            "acceleration_mm_s2": joint.limits.acceleration_mm_s2,
            "jerk_mm_s3": joint.limits.jerk_mm_s3,
            "homing_method": joint.homing.method,
        })
    });
    let axes = config
        .axes
        .iter()
        .map(|map| json!({ "letter": map.axis.letter().to_string(), "joints": map.joints }));
    let nets = config
        .nets
        .iter()
        .map(|net| json!({ "name": net.name, "source": net.source, "targets": net.targets }));
    json!({
        "file": config.path.display().to_string(),
        "errors": [],
        "machine": config.name,
        "bus": bus_name(config.bus.kind),
        "interface": config.bus.interface,
        "cycle_us": config.cycle_us,
        "pres_timeouts_us": spent.timeouts_us,
        "async_slot_timeout_us": spent.async_slot_us,
        "cycle_left_us": spent.left_us,
        "nodes": nodes.collect::<Vec<_>>(),
        "joints": joints.collect::<Vec<_>>(),
        "axes": axes.collect::<Vec<_>>(),
        "nets": nets.collect::<Vec<_>>(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    const DEMO: &str = include_str!("../../configs/mill3-demo.toml");

    fn demo(from: &str, to: &str) -> Config {
        assert!(DEMO.contains(from), "the demo machine has no {from:?}");
        config::parse(&DEMO.replacen(from, to, 1), Path::new("m.toml")).expect("a machine file without errors")
    }

    #[test]
    fn the_summary_says_how_a_cycle_is_spent_and_what_moves() {
        let config = demo("", "");
        let plans = network::plan(&config);
        let text = Summary(&config, &plans).to_string();
        let mut lines = text.lines();
        for expected in [
            "m.toml is good",
            "machine   mill3-demo",
            "cycle     1000 us, if no node answers:",
            "            600 us time-outs of 4 nodes",
            "            150 us asynchronous slot",
            "            250 us left for the frames themselves and for computing",
            "    1  x-drive      cia402  mandatory PRes within 150 us, 11 octets out, 17 in",
            "    2  z-drive      -105 to 5 mm, 100 mm/s, 1000 mm/s2, 20000 mm/s3, homing method 23",
            "    Z  joint 2",
            "       spindle-run: spindle.0.on -> io.10.out-00",
        ] {
            assert!(
                lines.any(|line| line == expected),
                "no {expected:?}, in this order, in\n{text}"
            );
        }
    }

    #[test]
    fn json_holds_the_same() {
        let config = demo("", "");
        let json = to_json(&config, &network::plan(&config));
        assert_eq!(json["cycle_left_us"], 250);
        assert_eq!(json["nodes"][3]["id"], 10);
        assert_eq!(json["joints"][1]["axes"], "Y");
        assert_eq!(json["joints"][0]["travel_mm"], json!([-5.0, 305.0]));
        assert_eq!(json["nets"].as_array().map(Vec::len), Some(3));
    }

    #[test]
    fn a_net_to_a_pin_that_does_not_exist_is_an_error() {
        let good = demo("", "");
        connections(&good, &network::plan(&good)).expect("nets between pins that exist");
        let config = demo("source = \"spindle.0.on\"", "source = \"spindle.0.onn\"");
        let error = connections(&config, &network::plan(&config)).expect_err("no such pin");
        let text = format!("{error:#}");
        assert!(text.starts_with("hal: ") && text.contains("spindle.0.onn"), "{text}");
    }
}
