//! `isocnc check`: is this machine file good, and what machine does it describe?
//!
//! In:  a machine file; or the concise DCF of a managing node (.cdc).
//! Out: every mistake with its place, or a summary of the machine, what this PC makes of its cycle, and its concise DCF; of a
//! .cdc its listing. Nothing is opened, sent or moved.

use crate::cli::bench_servo;
use crate::services;
use anyhow::{Context, ensure};
use bus::plan::NodePlan;
use bus_tools::check::{list_cdc, node_json, write_cdc, write_node};
use config::{BusKind, Config, HomingBy, Joint, Place, Protocol, SUBSTEPS, rate_max_hz};
use hal_pins::{Hal, file_len};
use host::steadiness::Steadiness;
use operator::session::check_start;
use rt::components::{LateRead, late_reads};
use rt::logic::budget::{self, Budget};
use rt::pins::{Pins, PinsError, capacity};
use rt::steps::StepDrives;
use serde_json::{Value as Json, json};
use std::fmt::{self, Write as _};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use terminal::print;
use terminal::refusal::Refusal;
use tune::analysis::stability::{GAIN_MARGIN_DB, Margins, PHASE_MARGIN_DEG, margins_of_joint};

/// Arguments of `check`.
#[derive(Debug, clap::Args)]
pub struct CheckArgs {
    /// Machine file, or a .cdc file to be listed.
    machine: PathBuf,
    /// Print JSON.
    #[arg(long)]
    json: bool,
    /// Write the managing node's concise DCF of a good machine file, to compare with other tools.
    #[arg(long, value_name = "FILE")]
    cdc: Option<PathBuf>,
}

/// Checks a machine file: exit code 0 if it is good, 1 if it is not.
///
/// # Errors
/// Output that cannot be written.
pub fn check(args: &CheckArgs) -> anyhow::Result<ExitCode> {
    if args.machine.extension().is_some_and(|extension| extension == "cdc") {
        return list_cdc(&args.machine);
    }
    let config = bus::read(&args.machine).map_err(Refusal::from)?;
    let plans = bus::plan(&config);
    connections(&config, &plans).map_err(|error| match error {
        PinsError::Nets(errors) => Refusal::from(errors),
        error => {
            let (file, rule) = (args.machine.display().to_string(), format!("hal: {error}"));
            let json = json!({ "file": file, "errors": [{ "rule": rule }] });
            Refusal::new(format!("{file}: {rule}\n1 error in {file}"), json)
        }
    })?;
    services::check(&config)?;
    check_start(&config)?;
    let budgets = budget::of_machine(&config).map_err(Refusal::from)?;
    let timing = Steadiness::measure(&config.rt).advice(&config);
    let servo = (!config.joints.is_empty()).then(|| bench_servo::servo(&config, bench_servo::CYCLES_OF_CHECK));
    print(&if args.json {
        let mut json = to_json(&config, &plans);
        json["timing"] = json!(timing);
        json["logic"] = logic_json(&config, &budgets);
        json["servo"] = servo.and_then(Result::ok).map_or(Json::Null, |servo| servo.to_json());
        format!("{json:#}\n")
    } else {
        let timing = timing.unwrap_or_else(|| "this PC bears what the file asks for, by a look of 0.4 s".into());
        let servo = match servo {
            Some(Ok(servo)) => format!("servo\n       {servo}\n"),
            Some(Err(why)) => format!("servo\n       not measured: {why:#}\n"),
            None => String::new(),
        };
        let logic = logic_words(&config, &budgets);
        format!("{}{logic}timing\n       {timing}\n{servo}", Summary(&config, &plans))
    })?;
    if let Some(path) = &args.cdc {
        ensure!(
            config.bus.kind.protocol() != Protocol::Ethercat,
            "a concise DCF is POWERLINK's: bus.kind is \"{}\"",
            config.bus.kind.name()
        );
        // Behind the result, which a full disk must not keep from the user.
        let octets = write_cdc(&config, &plans).with_context(|| format!("{}: cannot be written", path.display()))?;
        files::write(path, octets).with_context(|| format!("{}: cannot be written", path.display()))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Programs in Structured Text, and how long their scans take.
fn logic_words(config: &Config, budgets: &[Budget]) -> String {
    let lines = config.logics.iter().zip(budgets).map(|(task, budget)| {
        let period_ms = task.every as f64 * f64::from(config.cycle_us) / 1000.0;
        let warnings = match task.logic.warnings().len() {
            0 => String::new(),
            count => format!("; {count} warnings and notes: isocnc logic check {}", task.file.display()),
        };
        format!(
            "       {}: {}, every {period_ms} ms, {} steps at most, about {:.1} us on this PC: {:.2} % of the period{warnings}\n",
            task.name,
            task.file.display(),
            budget.steps,
            budget.scan_us,
            100.0 * budget.share
        )
    });
    let lines = lines.collect::<String>();
    if lines.is_empty() {
        lines
    } else {
        format!("logic\n{lines}")
    }
}

fn logic_json(config: &Config, budgets: &[Budget]) -> Json {
    let tasks = config.logics.iter().zip(budgets).map(|(task, budget)| {
        json!({
            "name": task.name, "file": task.file.display().to_string(),
            "period_ms": task.every as f64 * f64::from(config.cycle_us) / 1000.0,
            "steps": budget.steps, "scan_us": budget.scan_us, "share": budget.share,
        })
    });
    tasks.collect()
}

/// What shows only when the parts are put together: whether the pins exist that nets name.
fn connections(config: &Config, plans: &[NodePlan]) -> Result<(), PinsError> {
    // A control of this machine may be running: not under its name, and not where it would be found.
    static CHECKS: AtomicU64 = AtomicU64::new(0);
    let name = format!("check-{}-{}", std::process::id(), CHECKS.fetch_add(1, Relaxed));
    let mut hal = Hal::create_in(&[std::env::temp_dir()], &name, capacity(config))?;
    Pins::new(&mut hal, config, plans, &StepDrives::new(config)).map(drop)
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
        writeln!(f, "{} is good\n", config.path.display())?;
        writeln!(f, "machine   {}", config.name)?;
        let interface = match config.bus.kind {
            kind if kind.has_interface() => format!("{} on {}", kind.name(), config.bus.interface),
            BusKind::None => "none".into(),
            kind => format!("{}: the simulated machine inside the control", kind.name()),
        };
        writeln!(f, "bus       {interface}")?;
        let room = capacity(config);
        let mib = file_len(room) as f64 / f64::from(1 << 20);
        writeln!(f, "pins      room for {room}: {mib:.1} MiB of memory that is locked")?;
        if config.bus.kind != BusKind::None {
            bus_tools::budget::write(f, config, plans)?;
            writeln!(f, "nodes")?;
        }
        for (node, plan) in config.bus.nodes.iter().zip(plans) {
            write_node(f, config, node, plan)?;
        }
        writeln!(f, "joints")?;
        if config.joints.is_empty() {
            writeln!(
                f,
                "       none: the machine exchanges inputs and outputs, and runs no programs"
            )?;
        }
        for (number, joint) in config.joints.iter().enumerate() {
            writeln!(f, "  {number:>3}  {}", self.joint(number, joint)?)?;
            if joint.pid.is_some() {
                writeln!(f, "       loop      {}", loop_text(config, joint))?;
            }
        }
        if !config.axes.is_empty() {
            writeln!(f, "axes")?;
        }
        for map in &config.axes {
            let joints: Vec<String> = map.joints.iter().map(usize::to_string).collect();
            writeln!(f, "    {}  joint {}", map.axis.letter(), joints.join(" and "))?;
        }
        if !config.components.is_empty() {
            writeln!(f, "components")?;
        }
        for component in &config.components {
            let place = match component.place {
                Place::BeforeMotion => "before motion",
                Place::AfterMotion => "after motion",
            };
            writeln!(f, "       {}: {}, {place}", component.name, component.kind)?;
        }
        if !config.external.is_empty() {
            writeln!(f, "external components")?;
        }
        for external in &config.external {
            let (pins, heartbeat) = (external.pins.len(), external.heartbeat_ms);
            writeln!(f, "       {}: {pins} pins, heartbeat {heartbeat} ms", external.name)?;
        }
        writeln!(f, "nets")?;
        if config.nets.is_empty() {
            writeln!(f, "       none")?;
        }
        for net in &config.nets {
            writeln!(f, "       {}: {} -> {}", net.name, net.source, net.targets.join(", "))?;
        }
        for net in config.nets.iter().filter(|net| net.is_unwired()) {
            let (name, targets) = (&net.name, net.targets.join(", "));
            writeln!(
                f,
                "       {name}: keeps the machine from moving: name the pin that writes {targets} as its source"
            )?;
        }
        for LateRead { net, source, target } in late_reads(config) {
            writeln!(
                f,
                "       {net}: {target} is read before {source} is made: a cycle late"
            )?;
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
            "{:<12} {} to {} {unit}, {} {unit}/s, {} {unit}/s2, {} {unit}/s3, {}",
            match (joint.analog, self.0.bus.nodes.get(joint.node)) {
                (Some(analog), _) => self.0.bus.nodes[analog.node].name.clone(),
                (None, Some(node)) if self.0.shares_node(joint) => format!("{} axis {}", node.name, joint.drive_axis),
                (None, Some(node)) => node.name.clone(),
                (None, None) => "step pulses".to_owned(),
            },
            joint.travel_mm[0],
            joint.travel_mm[1],
            joint.limits.velocity_mm_s,
            joint.limits.acceleration_mm_s2,
            joint.limits.jerk_mm_s3,
            match joint.homing.by {
                HomingBy::Drive { method, .. } => format!("homing method {method}"),
                HomingBy::Control(_) => "homed by the control".to_owned(),
            },
        )?;
        if let (Some(output), Some(steps)) = (joint.step, &self.0.steps) {
            let rate_hz = rate_max_hz(&output.timing, steps.tick_ns);
            let [parts, units] = joint.counts_per_unit.map(f64::from);
            let pins = output.lines.map(|bit| steps.pins[usize::from(bit)]);
            write!(
                text,
                "\n                    {}, pins {} and {}: at most {rate_hz:.0} steps/s, {} {unit}/s",
                output.kind.name(),
                pins[0],
                pins[1],
                rate_hz / (parts / units / f64::from(SUBSTEPS)),
            )?;
        }
        Ok(text)
    }
}

fn margins(config: &Config, joint: &Joint) -> Option<Margins> {
    margins_of_joint(joint, f64::from(config.cycle_us) * 1e-6)
}

/// How far the loop of a joint, which the control closes, is from ringing.
fn loop_text(config: &Config, joint: &Joint) -> String {
    match margins(config, joint) {
        Some(margins) if margins.suffice() => margins.to_string(),
        Some(margins) => {
            format!("{margins}; {GAIN_MARGIN_DB} dB and {PHASE_MARGIN_DEG} degrees are wanted at the least")
        }
        None => "margins unknown without lag_ms: isocnc tune pid measures it".to_owned(),
    }
}

fn to_json(config: &Config, plans: &[NodePlan]) -> Json {
    let nodes = config.bus.nodes.iter().zip(plans);
    let nodes = nodes.map(|(node, plan)| node_json(node, plan));
    let joints = config.joints.iter().enumerate().map(|(number, joint)| {
        json!({
            "node": config.bus.nodes.get(joint.node).map(|node| node.id),
            "drive_axis": joint.drive_axis,
            "axes": axes_of(config, number).0,
            "travel_mm": joint.travel_mm,
            "velocity_mm_s": joint.limits.velocity_mm_s,
            "acceleration_mm_s2": joint.limits.acceleration_mm_s2,
            "jerk_mm_s3": joint.limits.jerk_mm_s3,
            "margins": margins(config, joint),
            "homing_method": match joint.homing.by {
                HomingBy::Drive { method, .. } => Some(method),
                HomingBy::Control(_) => None,
            },
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
    let components = config
        .components
        .iter()
        .map(|component| json!({ "name": component.name, "type": component.kind }));
    let external = config.external.iter().map(
        |external| json!({ "name": external.name, "pins": external.pins.len(), "heartbeat_ms": external.heartbeat_ms }),
    );
    let late_reads = late_reads(config).into_iter();
    let late_reads = late_reads.map(|late| json!({ "net": late.net, "source": late.source, "target": late.target }));
    json!({
        "file": config.path.display().to_string(),
        "errors": [],
        "machine": config.name,
        "bus": config.bus.kind.name(),
        "interface": config.bus.interface,
        "cycle_us": config.cycle_us,
        "async_slot_timeout_us": config.bus.async_slot_timeout_us,
        "pins": { "room": capacity(config), "memory_octets": file_len(capacity(config)) },
        "budget": bus_tools::budget::json(config, plans),
        "nodes": nodes.collect::<Vec<_>>(),
        "joints": joints.collect::<Vec<_>>(),
        "axes": axes.collect::<Vec<_>>(),
        "components": components.collect::<Vec<_>>(),
        "external": external.collect::<Vec<_>>(),
        "nets": nets.collect::<Vec<_>>(),
        "unwired": config.nets.iter().filter(|net| net.is_unwired()).map(|net| &net.name).collect::<Vec<_>>(),
        "late_reads": late_reads.collect::<Vec<_>>(),
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
        let plans = bus::plan(&config);
        let text = Summary(&config, &plans).to_string();
        let mut lines = text.lines();
        for expected in [
            "m.toml is good",
            "machine   mill3-demo",
            "cycle     1000 us                                       expected us worst us",
            "          SoC                                                   6.7      6.7",
            "          x-drive      60 + 60 octets, latency unknown        156.7    156.7",
            "          asynchronous slot, ASnd of up to 1514 octets        123.0    150.0",
            "          sum                                                 763.4    790.3",
            "          left for computing                                  236.6    209.7",
            "    1  x-drive      cia402  mandatory PRes within 150 us, 11 octets out, 17 in",
            "       identity  device type 0x00020192, vendor 0x00000000",
            "       out       bit    0  16 bits  0x6040:0",
            "       in        bit   72  32 bits  0x6064:0",
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
    fn a_loop_of_the_control_has_its_margins_where_the_lag_is_known() {
        let file = include_str!("../../configs/loop3-demo.toml");
        let said = |lag: &str| {
            let gains = "pid = { p = 40.0, ff1 = 1.0, ";
            assert!(file.contains(gains));
            let text = file.replacen(gains, &format!("{gains}{lag}"), 1);
            let config = config::parse(&text, Path::new("m.toml")).expect("a machine file without errors");
            loop_text(&config, &config.joints[0])
        };
        assert_eq!(said(""), "margins unknown without lag_ms: isocnc tune pid measures it");
        // 40 /s behind 2 ms, half a cycle and 1.66 ms: 40 rad/s take 9.5 degrees.
        assert_eq!(
            said("lag_ms = 1.66, "),
            "gain margin 21.5 dB, phase margin 80 degrees, crossover 6.4 Hz"
        );
        assert!(said("lag_ms = 30.0, ").ends_with("6 dB and 45 degrees are wanted at the least"));
    }

    #[test]
    fn json_holds_the_same() {
        let config = demo("", "");
        let json = to_json(&config, &bus::plan(&config));
        assert_eq!(json["budget"]["left_ns"], 209_680);
        assert_eq!(json["nodes"][0]["inputs"][4]["bit_offset"], 72);
        assert_eq!(json["nodes"][3]["identity"]["device_type"], 0x000F_0191);
        assert_eq!(json["nodes"][3]["id"], 10);
        assert_eq!(json["joints"][1]["axes"], "Y");
        assert_eq!(json["joints"][0]["travel_mm"], json!([-5.0, 305.0]));
        assert_eq!(json["nets"].as_array().map(Vec::len), Some(4));
    }

    #[test]
    fn a_device_file_gives_names_and_says_what_is_not_written() {
        let drive = "profile = \"cia402\"\nmandatory = true\npres_timeout_us = 150\ndevice_type = 0x00020192        # checked against what the device reports; left out: not checked\nvendor_id = 0x00000000\n";
        let config = demo(
            drive,
            "profile = \"cia402\"\ndevice_file = \"obd/tests/data/servo.xdc\"\n",
        );
        let text = Summary(&config, &bus::plan(&config)).to_string();
        let mut lines = text.lines();
        for expected in [
            "          pause before the first PReq                           1.0      1.0",
            // 30 us latency and two frames; 137 us time-out and a PReq.
            "          x-drive      60 + 60 octets                          43.4    143.7",
            "       device    obd/tests/data/servo.xdc: Example Drives ED-402",
            "       identity  device type 0x00020192, vendor 0x0000FACE, product 0x00000402",
            "       out       bit   56  32 bits  0x607A:0   Target position",
            "       without   0x1C14:0: left to the managing node",
            "       without   0x2030:0: cannot be written",
        ] {
            assert!(
                lines.any(|line| line == expected),
                "no {expected:?}, in this order, in\n{text}"
            );
        }
    }

    /// A person sees what will be written before power is on, on a terminal of 80 columns.
    #[test]
    fn start_values_of_ethercat_are_shown_with_who_wants_them() {
        const ESI: &str = r##"<EtherCATInfo><Vendor><Id>1</Id></Vendor><Descriptions><Devices><Device><Type ProductCode="2">IO</Type>
            <Sm>MBoxOut</Sm><Sm>MBoxIn</Sm><Sm>Outputs</Sm><Sm>Inputs</Sm>
            <RxPdo Fixed="1" Sm="2"><Index>#x1600</Index>
              <Entry><Index>#x7000</Index><SubIndex>1</SubIndex><BitLen>16</BitLen></Entry></RxPdo>
            <Mailbox><CoE>
              <InitCmd><Transition>PS</Transition><Index>#x8000</Index><SubIndex>2</SubIndex><Data>3412</Data>
                <Comment>range of all
                  channels, as the maker has it</Comment></InitCmd>
              <InitCmd CompleteAccess="1"><Transition>PS</Transition><Index>#x8010</Index><SubIndex>0</SubIndex><Data>LONG</Data></InitCmd>
              <InitCmd><Transition>PS</Transition><Index>#x8020</Index><SubIndex>1</SubIndex><Data>01</Data></InitCmd>
            </CoE></Mailbox></Device></Devices></Descriptions></EtherCATInfo>"##;
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("io.xml"), ESI.replace("LONG", &"5A".repeat(70))).expect("our folder");
        let text = "schema = 1\n[machine]\nname = \"m\"\nkinematics = \"none\"\n[bus]\nkind = \"ethercat-memory\"\n[[bus.node]]\n\
                    id = 1\nprofile = \"io\"\ndevice_file = \"io.xml\"\nsdo = [{ object = \"0x8020:1\", value = 1000, bits = 32 }]\n";
        let config = config::parse(text, &folder.path().join("m.toml")).unwrap_or_else(|errors| panic!("{errors}"));
        let plans = bus::plan(&config);
        let text = Summary(&config, &plans).to_string();
        let row = vec!["5A"; 16].join(" ");
        let expected = [
            "       writes    3 values, in this order:".to_owned(),
            "                 0x8000:2   0x1234             device file: range of all chan...".to_owned(),
            "                 0x8010:all 70 octets          device file".to_owned(),
            format!("                   {row}"),
            format!("                   {row}"),
            format!("                   {row}"),
            format!("                   {row}"),
            "                   6 more octets: --json has them".to_owned(),
            "                 0x8020:1   0x000003E8         machine file".to_owned(),
        ];
        let expected = expected.join("\n");
        assert!(text.contains(&expected), "no\n{expected}\nin\n{text}");
        assert!(expected.lines().all(|line| line.len() <= 80));
        let json = to_json(&config, &plans);
        let node = &json["nodes"][0];
        assert_eq!(node["configuration_writes"], 3);
        assert_eq!(node["writes"][1]["octets"], "5A".repeat(70));
        assert_eq!(
            node["writes"][2],
            json!({ "object": "0x8020:1", "octets": "E8030000", "from": "machine file" })
        );
    }

    /// What the control writes by itself, and what the profile of a drive asks for.
    #[test]
    fn every_drive_of_the_shipped_machine_shows_its_start_values() {
        let text = include_str!("../../configs/mill3-ethercat.toml");
        let config = config::parse(text, Path::new("m.toml")).expect("a machine file without errors");
        let text = Summary(&config, &bus::plan(&config)).to_string();
        for (line, count) in [
            ("0x60C2:1   0x01               control", 3),
            ("0x60C2:2   0xFD               control", 3),
        ] {
            assert_eq!(text.matches(line).count(), count, "{line} in\n{text}");
        }
    }

    #[test]
    fn nets_without_a_source_are_named() {
        let text = format!(
            "{DEMO}\n{}",
            "[[hal.net]]\nname = \"estop-ok\"\nsource = \"unwired\"\ntargets = [\"iocontrol.0.emc-enable-in\"]\n",
        );
        let config = config::parse(&text, Path::new("m.toml")).expect("a machine file without errors");
        let plans = bus::plan(&config);
        let text = Summary(&config, &plans).to_string();
        let line = "       estop-ok: keeps the machine from moving: name the pin that writes iocontrol.0.emc-enable-in as its source\n";
        assert!(text.contains(line), "{text}");
        assert_eq!(to_json(&config, &plans)["unwired"], json!(["estop-ok"]));
        connections(&config, &plans).expect("it is no error");
    }

    #[test]
    fn the_concise_dcf_is_written_and_listed() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("mn.cdc");
        let args = CheckArgs {
            machine: "configs/mill3-demo.toml".into(),
            json: true,
            cdc: Some(path.clone()),
        };
        assert_eq!(check(&args).expect("it is written"), ExitCode::SUCCESS);
        let octets = std::fs::read(&path).expect("it is there");
        // The configuration of node 10 is in it: 1F22h, sub-index 10.
        assert!(octets.windows(3).any(|octets| octets == [0x22, 0x1F, 10]));
        assert_eq!(list_cdc(&path).expect("it is listed"), ExitCode::SUCCESS);
        std::fs::write(&path, &octets[..20]).expect("it is cut");
        assert_eq!(list_cdc(&path).expect("it is told"), ExitCode::FAILURE);
    }

    #[test]
    fn a_net_to_a_pin_that_does_not_exist_is_an_error() {
        let good = demo("", "");
        connections(&good, &bus::plan(&good)).expect("nets between pins that exist");
        let text = include_str!("../../configs/mill3-demo.toml")
            .replace("source = \"spindle.0.on\"", "source = \"spindle.0.onn\"")
            .replace(
                "targets = [\"io.10.out-01\"]",
                "targets = [\"io.10.out-02\", \"io.10.in-01\"]",
            );
        let file = tempfile::NamedTempFile::new().expect("a file");
        std::fs::write(file.path(), &text).expect("it can be written");
        let config = config::read(file.path()).expect("each net is well formed");
        let error = connections(&config, &bus::plan(&config)).expect_err("no such pins");
        let PinsError::Nets(errors) = error else {
            panic!("{error}")
        };
        let name = file.path().display();
        let row = |what: &str| text.lines().position(|line| line.contains(what)).expect("it is there") + 1;
        assert_eq!(
            errors.lines().collect::<Vec<_>>(),
            [
                format!(
                    "{name}:{}:10: hal.net[0].source = \"spindle.0.onn\": no pin or net 'spindle.0.onn'; did you mean \
                     'spindle.0.on'?",
                    row("spindle.0.onn")
                ),
                format!(
                    "{name}:{}:28: hal.net[2].targets[1] = \"io.10.in-01\": net 'coolant-flood': target 'io.10.in-01' is an output \
                     and has its own writer; targets must be inputs",
                    row("io.10.in-01")
                ),
            ]
        );
        // One that has been changed meanwhile has no places.
        std::fs::write(file.path(), "").expect("it can be written");
        let error = connections(&config, &bus::plan(&config))
            .expect_err("no such pins")
            .to_string();
        assert!(
            error.contains("hal.net[0].source: no pin or net 'spindle.0.onn'"),
            "{error}"
        );
    }
}
