//! `isocnc jitter`: how exactly the cycle is kept while a program runs, beside what the PC can do at all.

use super::demo::{DemoBus, bear, machine_file};
use ::program::text::{Reader, Text};
use ::program::{Begin, check};
use analyser::listen;
use anyhow::{Context, ensure};
use clap::Args;
use host::netns;
use host::signals;
use host::signals::StopSignal;
use host::terminal::say;
use jitter::report::Ended;
use jitter::run::{FarEnd, Wanted};
use jitter::table::table;
use jitter::{output, program, run};
use machine::tables::Tables;
use operator::session::Program;
use std::path::PathBuf;
use std::process::ExitCode;
use terminal::refusal::Refusal;

/// Ends of the private wire: the control's and the machine's.
const INTERFACES: [&str; 2] = ["plk0", "plk1"];
/// Cycles where nothing is said: with the floor beside them about a minute and a half.
const CYCLES: u64 = 15_000;

/// Arguments of `jitter`.
#[derive(Debug, Args)]
pub struct JitterArgs {
    /// Cycles to measure in all.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    cycles: Option<u64>,
    /// Parts into which they are divided; after each the floor of the PC is measured.
    #[arg(long, value_name = "R", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    rounds: u32,
    /// Measure the cycle only, not what the PC could do at best.
    #[arg(long)]
    no_floor: bool,
    /// Cycle time instead of that of the machine file, µs.
    #[arg(long, value_name = "P")]
    period_us: Option<u32>,
    /// Part program that runs meanwhile, again and again, instead of a generated one.
    #[arg(long, value_name = "FILE")]
    program: Option<PathBuf>,
    /// Machine file instead of that of the demo.
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
    /// Bus of the machine of the demo [default: powerlink]
    #[arg(long, value_name = "BUS", conflicts_with = "machine")]
    bus: Option<DemoBus>,
    /// Run on this network interface, with the nodes that are there, instead of on a private wire with simulated drives. The
    /// machine moves.
    #[arg(long, value_name = "IF")]
    interface: Option<String>,
    /// Be the analyser: only listen at the interface and measure the period of the cycles of another PC.
    #[arg(long, requires = "interface", conflicts_with_all = ["program", "machine", "bus", "rounds"])]
    listen: bool,
    /// As an analyser, take orders on standard input.
    #[arg(long, requires = "listen", hide = true)]
    orders: bool,
    /// Folder for the report and its pictures.
    #[arg(long, default_value = "isocnc-out")]
    out: PathBuf,
    /// Print the report as JSON instead of a table.
    #[arg(long)]
    json: bool,
}

/// Measures.
pub fn jitter(args: &JitterArgs) -> anyhow::Result<ExitCode> {
    if args.listen {
        return be_the_analyser(args);
    }
    let signal = StopSignal::install().context("signals")?;
    output::prepare(&args.out)?;
    let machine = machine_file(args.machine.as_deref(), args.bus, &args.out)?;
    let mut config = bus::read_with_cycle(&machine, args.period_us).map_err(Refusal::from)?;
    // The name is also that of the shared pins: a control of this machine may run beside it.
    config.name = format!("{}-{}", config.name, std::process::id());
    ensure!(
        args.interface.is_none() || (args.machine.is_some() && args.program.is_some()),
        "--interface moves the machine that is there: say which it is with --machine, and with --program what it shall do"
    );
    let (name, text) = match &args.program {
        Some(path) => (
            path.display().to_string(),
            Text::read(path).with_context(|| path.display().to_string())?,
        ),
        None => (
            program::NAME.to_owned(),
            program::pocket(&config, program::BLOCKS)?.into_bytes().into(),
        ),
    };
    let tables = Tables::read(&config).map_err(Refusal::from)?;
    let begin = Begin::at_home(&config);
    if let Err(errors) = check(&config, &tables, &name, &text, &begin, signal.cancel()) {
        return Err(match errors.is_cancelled() {
            true => nothing_measured(&signal, "a signal came before"),
            false => Refusal::of_program(&name, &errors).nothing_moved(),
        }
        .into());
    }
    let far_end = match &args.interface {
        Some(interface) => FarEnd::Network { interface },
        None => {
            // Before any thread is started: a namespace can be entered by a process of one thread only.
            netns::private_wire(INTERFACES[0], INTERFACES[1]).context(
                "no private wire to measure on; with a second PC, or two network ports and a cable, measure with --interface",
            )?;
            // What a busy PC does to the cycle is what is to be measured: it must not end the measurement.
            bear(&mut config);
            FarEnd::Private {
                machine: &machine,
                wire: INTERFACES,
            }
        }
    };
    let wanted = Wanted {
        config: &config,
        program: Program {
            name: &name,
            text: Reader::from(&text),
        },
        cycles: args.cycles.unwrap_or(CYCLES),
        rounds: args.rounds,
        far_end,
        signal: signal.clone(),
        floor: !args.no_floor,
        quiet: args.json,
    };
    let report = match (run::run(&wanted), signal.caught()) {
        (Ok(report), _) => report,
        (Err(error), Some(_)) => return Err(nothing_measured(&signal, &format!("{error:#}")).into()),
        (Err(error), None) => return Err(error),
    };
    // A full disk must not keep from the user what was measured.
    let written = output::write(&args.out, &report, config.state_directory.as_deref(), args.json);
    if args.json {
        say(&format!("{}\n", serde_json::to_string(&report)?));
    } else {
        say(&format!("\n{}\n\nreport in {}\n", table(&report), args.out.display()));
    }
    written.context("the report could not be written")?;
    Ok(match (report.result, signal.caught()) {
        (Ended::Cut, Some(signal)) => ExitCode::from(signals::exit_code(signal)),
        (Ended::Completed | Ended::Cut, _) => ExitCode::SUCCESS,
        (Ended::Faulted, _) => ExitCode::FAILURE,
    })
}

/// A signal ended the measurement before there was anything to report.
fn nothing_measured(signal: &StopSignal, why: &str) -> Refusal {
    let text = format!("nothing was measured: {why}");
    Refusal {
        code: signal.caught().map_or(1, signals::exit_code),
        ..Refusal::new(&text, Refusal::json_of_text(&text))
    }
}

fn be_the_analyser(args: &JitterArgs) -> anyhow::Result<ExitCode> {
    let interface = args.interface.clone().unwrap_or_default();
    if args.orders {
        return listen::serve(&interface, args.period_us.context("--orders needs --period-us")?);
    }
    listen::listen(&listen::Wanted {
        interface,
        cycle_us: args.period_us,
        cycles: args.cycles,
        json: args.json,
    })
}
