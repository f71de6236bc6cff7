//! `isocnc doctor`: what on this PC stands in the way of real time, and how to change it.
//!
//! In:  a machine file, a core, an interface: what the control would use.
//! Out: a line for everything that matters, and what to do first. Exit code 0: no must is missing, 1: one is, 2: wrong usage.

use anyhow::Context as _;
use api::client::{self, Client};
use config::{Config, Rt};
use host::doctor::{Level, Pc, Report, Target, ThisPc, examine, is_interface_name, isolcpus};
use host::setup;
use protocol::method;
use protocol::params::NoParams;
use remote::control::forced_words;
use std::io::{IsTerminal as _, Write as _};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;
use terminal::refusal::Refusal;

/// How long the PC is watched before the measurements: steal and interrupts grow by then.
const WATCH: Duration = Duration::from_secs(1);

/// Arguments of `doctor`.
#[derive(Clone, Debug, clap::Args)]
pub struct DoctorArgs {
    /// Machine file: whose core, priority and interface are looked at.
    machine: Option<PathBuf>,
    /// Core of the real-time threads [default: that of the machine file, else the last isolated one, else the last one].
    #[arg(long, value_name = "N")]
    cpu: Option<usize>,
    /// Interface of the field bus [default: that of the machine file].
    #[arg(long, value_name = "IF", value_parser = interface_name)]
    interface: Option<String>,
    /// Look only, measure nothing.
    #[arg(long, conflicts_with = "seconds")]
    no_tests: bool,
    /// Length of each of the two measurements on the core.
    #[arg(long, value_name = "S", default_value = "5", value_parser = test_time)]
    seconds: f64,
    /// Write isolcpus.sh, which keeps a core free, and its parts into this folder, and do nothing else.
    #[arg(long, value_name = "DIR", exclusive = true)]
    write_isolcpus: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

fn interface_name(text: &str) -> Result<String, &'static str> {
    is_interface_name(text)
        .then(|| text.to_owned())
        .ok_or("expected the name of a network interface: ip link shows them")
}

fn test_time(text: &str) -> Result<f64, &'static str> {
    let seconds = text.parse().ok().filter(|seconds| (0.1..=86_400.0).contains(seconds));
    seconds.ok_or("expected seconds from 0.1 to 86400")
}

/// Looks at the PC, measures, prints.
///
/// # Errors
/// Output that cannot be written.
pub fn doctor(args: &DoctorArgs) -> anyhow::Result<ExitCode> {
    if let Some(folder) = &args.write_isolcpus {
        let script = isolcpus::write(folder).with_context(|| folder.display().to_string())?;
        files::outln!("{}", script.display());
        return Ok(ExitCode::SUCCESS);
    }
    let config = args.machine.as_deref().map(bus::read).transpose();
    let config = config.map_err(|errors| Refusal::from(errors).wrong_usage())?;
    let target = target(args, config.as_ref());
    if !args.json && std::io::stderr().is_terminal() {
        let seconds = WATCH.as_secs_f64() + target.test_time.map_or(0.0, |time| 2.0 * time.as_secs_f64());
        files::errln!("looking at core {} for {seconds:.0} s ...", target.cpu);
    }
    let pc = Pc::new("/", &ThisPc, target, WATCH);
    let report = Report {
        about: about(&pc).into_iter().chain(forced()).collect(),
        findings: examine(&pc),
    };
    let text = if args.json {
        format!("{:#}\n", report.to_json())
    } else {
        report.to_string()
    };
    match files::printed::stdout().write_all(text.as_bytes()) {
        // The reader of a pipe may have seen enough.
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => {}
        written => written.context("standard output")?,
    }
    Ok(match report.missing(Level::Must) {
        0 => ExitCode::SUCCESS,
        _ => ExitCode::FAILURE,
    })
}

/// Variables of programs in Structured Text that somebody has forced in controls of this user: what such a machine does is no longer
/// what its program says.
fn forced() -> Vec<String> {
    let of = |(machine, mut client): (String, Client)| {
        let forced = client.ask::<method::Status>(&NoParams {}).map(|status| status.forced);
        let forced = forced.unwrap_or_default();
        let lines = forced_words(&forced).map(|forced| format!("FORCED:    {forced} (machine {machine})"));
        lines.collect::<Vec<_>>()
    };
    client::all().into_iter().flat_map(of).collect()
}

/// What the control would use.
fn target(args: &DoctorArgs, config: Option<&Config>) -> Target {
    let rt = config.map_or_else(Rt::default, |config| config.rt.clone());
    // Where the system does not tell, the word under which a shell finds it.
    let program = std::env::current_exe().unwrap_or_else(|_| "isocnc".into());
    let (cpu, cpu_from) = match (args.cpu, rt.cpu) {
        (Some(cpu), _) => (cpu, "--cpu".to_owned()),
        (None, Some(cpu)) => (cpu, "rt.cpu of the machine file".to_owned()),
        (None, None) => (
            setup::usual_core(),
            "not set: the last isolated one, else the last one".to_owned(),
        ),
    };
    let bus = config.map(|config| &config.bus).filter(|bus| bus.kind.has_interface());
    Target {
        cpu,
        cpu_from,
        // The time-out thread runs one above the cycle thread.
        priority: rt.priority.saturating_add(1),
        interface: args.interface.clone().or_else(|| bus.map(|bus| bus.interface.clone())),
        test_time: (!args.no_tests).then(|| Duration::from_secs_f64(args.seconds)),
        isolcpus: isolcpus::find(&program),
        program,
    }
}

/// The PC and what is looked at, in a few lines that make a pasted report complete.
fn about(pc: &Pc<'_>) -> Vec<String> {
    let target = &pc.target;
    let user = match nix::unistd::geteuid() {
        root if root.is_root() && pc.is_user_namespace() => "root of a user namespace".to_owned(),
        root if root.is_root() => "root".to_owned(),
        user => format!("user {user}"),
    };
    let interface = target.interface.as_deref().unwrap_or("none");
    vec![
        format!("isocnc {} doctor, as {user}", env!("CARGO_PKG_VERSION")),
        format!("PC:        {}", pc.describe()),
        format!("core:      {} ({})", target.cpu, target.cpu_from),
        format!("interface: {interface}"),
    ]
}
