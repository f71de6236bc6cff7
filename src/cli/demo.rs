//! `isocnc demo`: the whole control on a private wire, with a simulated machine at the far end.

use crate::cli::run::panel_address;
use crate::services;
use analyser::SocReport;
use anyhow::{Context, ensure};
use clap::{Args, ValueEnum};
use config::{self, Config, KeepAwake};
use host::netns;
use host::signals::StopSignal;
use host::steadiness::Steadiness;
use host::terminal::say;
use jitter::plot::soc_period_svg;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use operator::report::{FarEnd, SOC_PERIOD_DATA};
use operator::session::{Program, Wire};
use operator::single_run::{Job, run_and_report};
use operator::standby::stand_by;
use program::text::{Reader, Text};
use sim::READY;
use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitCode, Stdio};
use std::time::{Duration, Instant};
use terminal::refusal::Refusal;

/// Machine of each bus.
const MACHINES: [(DemoBus, &str); 2] = [
    (DemoBus::Powerlink, include_str!("../../configs/mill3-demo.toml")),
    (DemoBus::Ethercat, include_str!("../../configs/mill3-ethercat.toml")),
];
const PROGRAM: &[u8] = include_bytes!("../../configs/sample-part.ngc");
const PROGRAM_NAME: &str = "sample-part.ngc";
/// Ends of the private wire: the control's, which the machine file names, and the machine's.
const INTERFACES: [&str; 2] = ["plk0", "plk1"];
/// Polls lost in a row that the demo rides out, and how much farther behind its command a drive may be meanwhile.
const LOST_MAX: u32 = 300;
const FOLLOWING_ERROR: f64 = 10.0;
/// The cycle is at most so many times as long as the machine file has it.
const CYCLES_MAX: u32 = 4;
/// Longest wait for the simulated machine to write its measurement down.
const FAR_END_WAIT: Duration = Duration::from_secs(5);

/// The bus of a demonstration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum DemoBus {
    #[default]
    Powerlink,
    Ethercat,
}

/// Arguments of `demo`.
#[derive(Debug, Args)]
pub struct DemoArgs {
    /// Part program instead of the sample part.
    #[arg(long, value_name = "FILE")]
    program: Option<PathBuf>,
    /// Machine file instead of the demo's own.
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
    /// Bus of the demo's own machine [default: powerlink]
    #[arg(long, value_name = "BUS", conflicts_with = "machine")]
    bus: Option<DemoBus>,
    /// Folder for the report and its pictures.
    #[arg(long, default_value = "isocnc-out")]
    out: PathBuf,
    /// Record every frame on the wire to this file (pcap, decoded by Wireshark).
    #[arg(long, value_name = "FILE")]
    capture: Option<PathBuf>,
    /// Use a wire in memory, on which time waits for the PC, even where a private network would be allowed.
    #[arg(long)]
    memory: bool,
    /// Serve the operator panel in the browser, and keep the machine running in stand-by for it [default: 127.0.0.1:8402]
    #[arg(long, value_name = "ADDRESS:PORT", num_args = 0..=1, value_parser = panel_address)]
    panel: Option<Option<SocketAddr>>,
    /// Print the report as JSON instead of text.
    #[arg(long)]
    json: bool,
}

/// Runs the demo.
pub fn demo(args: &DemoArgs) -> anyhow::Result<ExitCode> {
    let signal = StopSignal::install().context("signals")?;
    let (name, text) = match &args.program {
        Some(path) => (
            path.display().to_string(),
            Text::read(path).with_context(|| path.display().to_string())?,
        ),
        None => (PROGRAM_NAME.to_owned(), PROGRAM.to_vec().into()),
    };
    files::make_folder(&args.out).with_context(|| args.out.display().to_string())?;
    let machine = machine_file(args.machine.as_deref(), args.bus, &args.out)?;
    let mut config = bus::read(&machine).map_err(Refusal::from)?;
    if !args.json && args.panel.is_none() {
        say(&format!(
            "isocnc demo: a simulated machine cuts {name}, report in {}\n\
             Nothing real moves: what this PC lacks for real time is told, and is harmless here.\n",
            args.out.display()
        ));
    }
    // The name is also that of the shared pins: any number of demos may run side by side.
    config.name = format!("{}-{}", config.name, std::process::id());

    // Before the namespace, in which nobody could reach it.
    let services = match args.panel {
        None => Vec::new(),
        Some(_) => {
            let of_file = config.panel.take();
            let mut wanted = of_file.unwrap_or_else(|| config::Panel::at(config::Panel::loopback(), None));
            if wanted.programs.is_none() {
                let folder = args.out.join("programs");
                files::make_folder(&folder).with_context(|| folder.display().to_string())?;
                files::write(&folder.join(PROGRAM_NAME), PROGRAM).with_context(|| folder.display().to_string())?;
                wanted.programs = Some(std::path::absolute(folder)?);
            }
            config.panel = Some(wanted);
            services::of(&config, args.panel, args.json, true)?
        }
    };

    // First of all: a namespace can be entered by a process of one thread only.
    let network = (!args.memory).then(|| netns::private_wire(INTERFACES[0], INTERFACES[1]));
    let cycle_us = match &network {
        None => None,
        Some(Err(error)) => {
            files::errln!("no private network, so the same over a wire in memory: {error}");
            None
        }
        Some(Ok(_)) => kept_cycle_us(
            &Steadiness::measure(&config.rt),
            config.cycle_us,
            args.capture.is_some(),
        ),
    };
    let mut far_end = None;
    if let Some(cycle_us) = cycle_us {
        if cycle_us != config.cycle_us {
            config = Config {
                name: config.name,
                ..bus::read_with_cycle(&machine, Some(cycle_us)).map_err(Refusal::from)?
            };
        }
        far_end = Some(FarMachine::start(&machine, cycle_us, args)?);
    } else {
        config.rt.calibrate = false;
        config.rt.keep_awake = Some(KeepAwake::None);
    }
    bear(&mut config);
    ensure!(
        far_end.is_some() || args.capture.is_none(),
        Refusal::usage("--capture needs the private network: in memory nothing passes a network interface")
    );
    let wire = match far_end {
        Some(_) => Wire::Interface(INTERFACES[0].into()),
        // In memory, time waits for whoever is late, so no load of this PC ends in an alarm.
        None => Wire::Paced,
    };
    if args.panel.is_some() {
        // Ended with this.
        let _far_end = far_end;
        return stand_by(&config, wire, args.json, signal, services);
    }
    let job = Job {
        config: &config,
        program: Program {
            name: &name,
            text: Reader::from(&text),
        },
        out: &args.out,
        json: args.json,
        signal,
        services,
        far_end: far_end.map(|machine| Box::new(machine) as Box<dyn FarEnd>),
    };
    run_and_report(job, wire)
}

/// The cycle that this PC keeps, µs, told where it is not the one of the machine file. `None`: none, so the wire is in memory,
/// unless frames shall be captured: the longest that there is.
fn kept_cycle_us(steadiness: &Steadiness, cycle_us: u32, captured: bool) -> Option<u32> {
    // Longer cycles make another machine of it: its drives would hear of a new position too rarely.
    let longest_us = CYCLES_MAX * cycle_us;
    let kept_us = steadiness
        .kept_cycle_us(cycle_us)
        .filter(|kept_us| *kept_us <= longest_us)
        .or(captured.then_some(longest_us));
    let busy = format!(
        "this PC is busy (a thread wakes up to {:.1} ms late)",
        steadiness.late.max_us / 1e3
    );
    match kept_us {
        Some(kept_us) if kept_us == cycle_us => {}
        Some(kept_us) => files::errln!("{busy}: the cycle is {kept_us} us"),
        None => files::errln!(
            "{busy}: the same over a wire in memory, where time stands still while the PC does something else"
        ),
    }
    kept_us
}

/// However busy this PC gets while it runs: a simulated machine bears it. No node counts what it has lost, and where an answer is
/// missing everything waits for it.
pub(super) fn bear(config: &mut Config) {
    config.rt.overruns_stop = 0;
    config.bus.pres_lost_max = config.bus.pres_lost_max.max(LOST_MAX);
    config.bus.soc_lost_max = None;
    for device in config.bus.nodes.iter_mut().filter_map(|node| node.ethercat.as_mut()) {
        device.watchdog_ms = Some(0);
    }
    for joint in &mut config.joints {
        joint.following_error_mm *= FOLLOWING_ERROR;
    }
}

/// The machine file that was given, or that of the demo on a bus, put into the folder for the processes that read it, too.
pub(super) fn machine_file(given: Option<&Path>, bus: Option<DemoBus>, out: &Path) -> anyhow::Result<PathBuf> {
    if let Some(path) = given {
        return Ok(path.to_owned());
    }
    let path = out.join("machine.toml");
    let bus = bus.unwrap_or_default();
    let of_bus = MACHINES.iter().find(|(of, _)| *of == bus);
    files::write(&path, of_bus.map_or("", |(_, text)| text)).with_context(|| path.display().to_string())?;
    Ok(path)
}

/// The simulated machine in a process of its own at the far end of the wire.
struct FarMachine {
    process: Child,
    measurement: PathBuf,
}

impl FarMachine {
    fn start(machine: &Path, cycle_us: u32, args: &DemoArgs) -> anyhow::Result<FarMachine> {
        let measurement = args.out.join(SOC_PERIOD_DATA);
        let mut command = Command::new("/proc/self/exe");
        command
            .arg("simulate")
            .arg(machine)
            .args(["--interface", INTERFACES[1], "--with-parent"])
            .arg(std::process::id().to_string())
            .args(["--cycle-us", &cycle_us.to_string()]);
        command.arg("--analyse").arg(&measurement);
        if let Some(capture) = &args.capture {
            command
                .arg("--capture")
                .arg(capture)
                .args(["--other-end", INTERFACES[0]]);
        }
        let process = command
            // A signal to all processes of the terminal is for the control: the machine lives on until that has stopped.
            .process_group(0)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .context("simulated machine")?;
        // Ended with this, whatever comes.
        let mut machine = FarMachine { process, measurement };
        let mut line = String::new();
        if let Some(output) = machine.process.stdout.take() {
            BufReader::new(output).read_line(&mut line)?;
        }
        ensure!(line.trim() == READY, "the simulated machine did not start");
        Ok(machine)
    }
}

impl FarEnd for FarMachine {
    fn finish(&mut self) -> Option<SocReport> {
        // A machine that is gone already has left no measurement.
        kill(Pid::from_raw(self.process.id() as i32), Signal::SIGTERM).ok()?;
        let give_up = Instant::now() + FAR_END_WAIT;
        while self.process.try_wait().ok()?.is_none() {
            if Instant::now() > give_up {
                self.process.kill().ok()?;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        let text = files::read_text(&self.measurement, files::read::TEXT_MAX).ok()?;
        serde_json::from_str(&text).ok()
    }

    fn draw(&self, soc_period: &SocReport) -> String {
        soc_period_svg(soc_period)
    }
}

impl Drop for FarMachine {
    fn drop(&mut self) {
        // Gone already in the ordinary case.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
