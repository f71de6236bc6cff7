//! The command line: arguments to one command each.

mod bench_servo;
pub mod check;
pub mod dda;
pub mod demo;
pub mod doctor;
#[cfg(feature = "panel")]
pub mod init_page;
pub mod input;
pub mod interpret;
pub mod jitter;
pub mod job;
pub mod logic;
pub mod pages;
#[cfg(feature = "panel")]
pub mod panel;
pub mod run;
pub mod simulate;

#[cfg(not(feature = "panel"))]
use bus_tools::init::{InitArgs, init};
use clap::{CommandFactory, Parser, Subcommand};
use hal_tools::hal;
use host::terminal::say;
#[cfg(feature = "panel")]
use init_page::{WithPage as InitArgs, init};
use remote::{buttons, control, jog, tables, top};
use std::ffi::OsString;
use std::process::ExitCode;
use terminal::refusal::Refusal;

/// The whole command line.
#[derive(Debug, Parser)]
#[command(name = "isocnc", version, about = env!("CARGO_PKG_DESCRIPTION"), long_about = None)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Cut a sample part on a simulated machine behind a real wire of POWERLINK or EtherCAT; needs no hardware.
    #[command(after_help = "Example: isocnc demo --program configs/short-part.ngc")]
    Demo(demo::DemoArgs),
    /// Be the control of a machine: run a part program, or stand by for programs.
    #[command(after_help = "Example: isocnc run configs/mill3-powerlink.toml configs/sample-part.ngc")]
    Run(run::RunArgs),
    /// Check this PC: what stands in the way of real time, and how to change it.
    #[command(after_help = "Example: isocnc doctor configs/mill3-powerlink.toml")]
    Doctor(doctor::DoctorArgs),
    /// Show what a running control does and waits for.
    #[command(after_help = "Example: isocnc status --json")]
    Status(control::StatusArgs),
    /// Switch the drives on; nothing moves.
    #[command(after_help = "Example: isocnc on")]
    On(control::OrderArgs),
    /// Bring the machine to rest and switch drives off.
    #[command(after_help = "Example: isocnc off")]
    Off(control::OrderArgs),
    /// Emergency stop: quick stop of all drives until `estop reset`. Not a safety function.
    #[command(after_help = "Example: isocnc estop")]
    Estop(control::EstopArgs),
    /// Home joints; drives are switched on first and stay on.
    #[command(after_help = "Example: isocnc home X 2")]
    Home(control::HomeArgs),
    /// Load, start or run a program on a control that stands by.
    Program(control::ProgramArgs),
    /// Run a line of G-code in the modes that the last one left active.
    #[command(after_help = "Example: isocnc mdi G0")]
    Mdi(control::MdiArgs),
    /// Touch off: let an axis read a value where it stands, as a work offset or a tool length.
    #[command(after_help = "Example: isocnc touch-off X 0 --system G54")]
    TouchOff(tables::TouchOffArgs),
    /// Show or set work offsets.
    Offset(tables::OffsetArgs),
    /// Show or set tools.
    Tool(tables::ToolArgs),
    /// Confirm that the tool the program waits for is in the spindle.
    #[command(after_help = "Example: isocnc tool-changed")]
    ToolChanged(control::ControlArgs),
    /// Move an axis or a joint by hand.
    #[command(after_help = "Example: isocnc jog X -2.5 --speed 20")]
    Jog(jog::JogArgs),
    /// Bring the program of a running control to rest on its path, and keep it.
    #[command(after_help = "Example: isocnc hold")]
    Hold(control::OrderArgs),
    /// Continue after a hold, forward; in single block, with the next block.
    #[command(after_help = "Example: isocnc resume")]
    Resume(control::OrderArgs),
    /// Skip what the program waits for: a dwell, an input (M66), M0, M1; no move.
    #[command(after_help = "Example: isocnc skip")]
    Skip(control::ControlArgs),
    /// Run the program backward along its path.
    #[command(after_help = "Example: isocnc reverse 50")]
    Reverse(control::ReverseArgs),
    /// Stop the program at the end of each block; `resume` runs the next one.
    #[command(after_help = "Example: isocnc single-block on")]
    SingleBlock(control::SwitchArgs),
    /// Turn the spindle by hand; also at M0 and while a program is held.
    #[command(after_help = "Example: isocnc spindle 1200")]
    Spindle(control::SpindleArgs),
    /// Switch coolant by hand; also at M0 and while a program is held.
    #[command(after_help = "Example: isocnc coolant flood on")]
    Coolant(control::CoolantArgs),
    /// Show whether the machine can move, and what prevents it.
    #[command(after_help = "Example: isocnc power")]
    Power(control::ControlArgs),
    /// Stop the program at M1 as at M0, or not.
    #[command(after_help = "Example: isocnc optional-stop on")]
    OptionalStop(control::SwitchArgs),
    /// Skip lines that begin with /, or run them; not while a program runs.
    #[command(after_help = "Example: isocnc block-delete on")]
    BlockDelete(control::SwitchArgs),
    /// Bring the machine to rest, a program on its path, and give it up; drives stay on.
    #[command(after_help = "Example: isocnc stop")]
    Stop(control::OrderArgs),
    /// Run feed, rapid moves or the spindle at another percentage of what is programmed.
    #[command(after_help = "Example: isocnc override feed 80")]
    Override(control::OverrideArgs),
    /// Press a button of the user, [[panel.button]] of the machine file; without a name list them.
    #[command(after_help = "Example: isocnc button park")]
    Button(buttons::ButtonArgs),
    /// Show or set the part counter of a running control and its target.
    #[command(after_help = "Example: isocnc parts target 50")]
    Parts(tables::PartsArgs),
    /// Print the journal of a running control; with a state folder, that of earlier runs too.
    #[command(after_help = "Example: isocnc journal --since 100")]
    Journal(tables::JournalArgs),
    /// Simulate a fault of a simulated drive, or clear it.
    #[command(after_help = "Example: isocnc fault overcurrent --node 1")]
    Fault(control::FaultArgs),
    /// Operate a running control on the full screen of a terminal, by keys.
    #[command(after_help = "Example: isocnc top")]
    Top(top::TopArgs),
    /// Acknowledge the alarm of a running control.
    Alarm(control::AlarmArgs),
    /// Check a machine file: all errors at once, located.
    #[command(after_help = "Example: isocnc check configs/mill3-powerlink.toml")]
    Check(check::CheckArgs),
    /// Write a first machine file: asks, or takes the nodes that answer on an interface.
    #[command(after_help = "Example: isocnc init machine.toml --scan eth1\nExample: isocnc init machine.toml --panel")]
    Init(InitArgs),
    /// Print the canonical calls of a part program, one a line.
    #[command(after_help = "Example: isocnc interpret configs/sample-part.ngc --check")]
    Interpret(interpret::InterpretArgs),
    /// Plan a whole part program off line: motion time, peaks, samples.
    #[command(after_help = "Example: isocnc plan machine.toml part.ngc --svg plan.svg")]
    Plan(plan_report::PlanArgs),
    /// How well step pulses by digital differential analysers follow a circle: path variance of each method and register width.
    #[command(after_help = "Example: isocnc dda --width 6,8 --svg dda.svg")]
    Dda(dda::DdaArgs),
    /// Write the program of a simple job: facing, pockets, holes, threads, engraving.
    Job(job::JobArgs),
    /// List input devices (game pads, pendants, keyboards), or show what one says: for [[hal.input]].
    #[command(after_help = "Example: isocnc input Gamepad")]
    Input(input::InputArgs),
    /// Be the machine of a machine file: its drives and I/O as the nodes of its bus on an interface.
    #[command(after_help = "Example: isocnc simulate configs/mill3-powerlink.toml --interface eth1")]
    Simulate(simulate::SimulateArgs),
    /// Measure how exactly the cycle is kept while a program runs, beside what the PC can do at all.
    #[command(after_help = "Example: isocnc jitter --cycles 20000 --rounds 2")]
    Jitter(jitter::JitterArgs),
    /// Measure how long a cycle takes on this PC, by axes and parts, and how fast programs are planned.
    #[command(after_help = "Example: isocnc bench-servo --axes 2,3")]
    BenchServo(bench_servo::BenchServoArgs),
    /// Measure how well the joints of a machine follow what they are told.
    Tune(tune::TuneArgs),
    /// Make, list or revoke tokens of the operator panel in the browser.
    #[cfg(feature = "panel")]
    Panel(panel::PanelArgs),
    /// List, read, set or watch the pins of a running control.
    Hal(hal::HalArgs),
    /// Check or run Structured Text, the logic of a machine, without a machine.
    Logic(logic::LogicArgs),
    /// Inspect the network: who is on it, its state, what went over the wire.
    Bus(bus_tools::BusArgs),
    /// Print the completion script of a shell.
    #[command(after_help = "Example: isocnc completions bash")]
    Completions(pages::CompletionsArgs),
    /// Print the JSON schema of the machine file, for editors; or what the control socket serves.
    #[command(after_help = "Example: isocnc schema --rpc")]
    Schema(pages::SchemaArgs),
    /// Write the pages of the manual, one a command.
    #[command(after_help = "Example: isocnc man man1")]
    Man(pages::ManArgs),
}

/// Runs the command of the process's arguments. Exit code 0: ok, 1: trouble found, 2: wrong usage.
pub fn main() -> ExitCode {
    #[cfg(feature = "cell")]
    cell_link::carrier::prepare();
    let as_json = wants_json(std::env::args_os());
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) if as_json && error.use_stderr() => {
            say(&format!("{:#}\n", Refusal::json_of_text(&rule(&error))));
            return ExitCode::from(2);
        }
        Err(error) => return show(&error),
    };
    if let Err(error) = host::logging::begin() {
        files::errln!("isocnc: {error}");
        return ExitCode::from(2);
    }
    if let Command::Demo(_) | Command::Run(_) | Command::Jitter(_) = &cli.command {
        host::setup::keep_one_heap();
    }
    let result = match &cli.command {
        Command::Demo(args) => demo::demo(args),
        Command::Run(args) => run::run(args),
        Command::Doctor(args) => doctor::doctor(args),
        Command::Status(args) => control::status(args),
        Command::On(args) => control::lasting(args, control::Lasting::On),
        Command::Off(args) => control::lasting(args, control::Lasting::Off),
        Command::Estop(args) => control::estop(args),
        Command::Home(args) => control::home(args),
        Command::Program(args) => control::program(args),
        Command::Mdi(args) => control::mdi(args),
        Command::TouchOff(args) => tables::touch_off(args),
        Command::Offset(args) => tables::offset(args),
        Command::Tool(args) => tables::tool(args),
        Command::ToolChanged(args) => control::tool_changed(args),
        Command::Jog(args) => jog::jog(args),
        Command::Hold(args) => control::lasting(args, control::Lasting::Hold),
        Command::Resume(args) => control::lasting(args, control::Lasting::Return),
        Command::Skip(args) => control::skip(args),
        Command::Reverse(args) => control::reverse(args),
        Command::SingleBlock(args) => control::single_block(args),
        Command::Spindle(args) => control::spindle(args),
        Command::Coolant(args) => control::coolant(args),
        Command::Power(args) => control::power(args),
        Command::OptionalStop(args) => control::optional_stop(args),
        Command::BlockDelete(args) => control::block_delete(args),
        Command::Stop(args) => control::lasting(args, control::Lasting::Stop),
        Command::Override(args) => control::set_overrides(args),
        Command::Button(args) => buttons::button(args),
        Command::Parts(args) => tables::parts(args),
        Command::Journal(args) => tables::journal(args),
        Command::Fault(args) => control::fault(args),
        Command::Top(args) => top::top(args),
        Command::Alarm(args) => control::alarm(args),
        Command::Check(args) => check::check(args),
        Command::Init(args) => init(args),
        Command::Interpret(args) => interpret::interpret(args),
        Command::Plan(args) => plan_report::plan(args),
        Command::Job(args) => job::job(args),
        Command::Input(args) => input::input(args),
        Command::Simulate(args) => simulate::simulate(args),
        Command::Jitter(args) => jitter::jitter(args),
        Command::Dda(args) => dda::dda(args),
        Command::BenchServo(args) => bench_servo::bench_servo(args),
        Command::Tune(args) => tune::tune(args),
        #[cfg(feature = "panel")]
        Command::Panel(args) => panel::panel(args),
        Command::Hal(args) => hal::hal(args),
        Command::Logic(args) => logic::logic(args),
        Command::Bus(args) => bus_tools::bus(args),
        Command::Completions(args) => pages::completions(args, Cli::command()),
        Command::Schema(args) => pages::schema(args),
        Command::Man(args) => pages::man(args, Cli::command()),
    };
    result.unwrap_or_else(|error| {
        let refusal = error.downcast_ref::<Refusal>();
        match refusal {
            _ if as_json => say(&format!("{:#}\n", Refusal::json_of(&error))),
            // It names its file itself, where it is of one.
            Some(refusal) if !refusal.json["file"].is_null() => files::errln!("{refusal}"),
            Some(_) | None => files::errln!("isocnc: {error:#}"),
        }
        ExitCode::from(Refusal::code_of(&error))
    })
}

/// Shows help, or what is wrong with the words of a command line.
fn show(error: &clap::Error) -> ExitCode {
    let text = error.render();
    files::printed::tell(&text.to_string(), &text.ansi().to_string(), error.use_stderr());
    ExitCode::from(error.exit_code() as u8)
}

/// What is wrong with the words of a command line, without the usage around it.
fn rule(error: &clap::Error) -> String {
    let text = error.to_string();
    let lines = text.lines().take_while(|line| !line.is_empty()).map(str::trim);
    let text = lines.collect::<Vec<_>>().join(" ");
    text.strip_prefix("error: ").unwrap_or(&text).to_owned()
}

/// Whether errors are for a program to read; known before the arguments are, for these may be wrong.
fn wants_json(args: impl Iterator<Item = OsString>) -> bool {
    args.take_while(|word| word != "--").any(|word| word == "--json")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All commands that do something, by their words.
    fn commands(command: &clap::Command, words: &[String]) -> Vec<(Vec<String>, clap::Command)> {
        let below = command.get_subcommands().filter(|command| command.get_name() != "help");
        let below: Vec<_> = below
            .flat_map(|command| commands(command, &[words, &[command.get_name().to_owned()]].concat()))
            .collect();
        match below.is_empty() {
            true => vec![(words.to_vec(), command.clone())],
            false => below,
        }
    }

    #[test]
    fn the_help_of_every_command_has_an_example_that_is_understood_and_fits_80_columns() {
        let mut all = Cli::command().term_width(80);
        all.build();
        let commands = commands(&all, &["isocnc".to_owned()]);
        assert!(commands.len() > 30, "{} commands", commands.len());
        for (words, mut command) in commands {
            let help = command.render_long_help().to_string();
            let example = help.lines().find_map(|line| line.strip_prefix("Example: "));
            let example = example.unwrap_or_else(|| panic!("{words:?}: no example"));
            assert!(example.starts_with(&words.join(" ")), "{example}");
            // As a shell takes its quotes away.
            let typed = example.split(' ').map(|word| word.trim_matches('\''));
            if let Err(error) = Cli::try_parse_from(typed) {
                panic!("{example}: {error}");
            }
            let wide = help.lines().find(|line| line.chars().count() > 80);
            assert_eq!(wide, None, "{words:?}");
        }
    }

    #[test]
    fn help_is_a_command_too() {
        for words in [
            &["isocnc", "help"][..],
            &["isocnc", "help", "jog"],
            &["isocnc", "bus", "help", "sdo"],
        ] {
            let shown = Cli::try_parse_from(words).map(drop).unwrap_err();
            assert_eq!(shown.kind(), clap::error::ErrorKind::DisplayHelp, "{words:?}");
        }
    }

    #[test]
    fn errors_are_json_where_json_is_asked_for() {
        let wants = |words: &[&str]| wants_json(words.iter().map(OsString::from));
        assert!(wants(&["isocnc", "status", "--json"]) && wants(&["isocnc", "stauts", "--json", "x"]));
        let error = Cli::try_parse_from(["isocnc", "stauts", "--json"])
            .map(drop)
            .unwrap_err();
        assert_eq!(rule(&error), "unrecognized subcommand 'stauts'");
        assert!(!wants(&["isocnc", "status"]) && !wants(&["isocnc", "check", "--", "--json"]));
    }
}
