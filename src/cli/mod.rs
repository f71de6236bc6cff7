//! The command line: arguments to one command each.

pub mod bus;
pub mod check;
pub mod control;
pub mod demo;
pub mod doctor;
pub mod hal;
pub mod interpret;
pub mod jitter;
pub mod jog;
pub mod plan;
pub mod run;
pub mod simulate;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// CNC control for Linux PCs with a built-in Ethernet POWERLINK managing node.
#[derive(Debug, Parser)]
#[command(name = "isocnc", version, about, disable_help_subcommand = true)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Cut a sample part on a simulated machine behind a real POWERLINK wire; needs no hardware.
    Demo(demo::DemoArgs),
    /// Be the control of a machine: run a part program, or stand by for programs.
    Run(run::RunArgs),
    /// Look at this PC: what stands in the way of real time, and how to change it.
    Doctor(doctor::DoctorArgs),
    /// Show how a running control is.
    Status(control::ControlArgs),
    /// Run a program on a control that stands by.
    Program(control::ProgramArgs),
    /// Switch the drives of a control that stands by on, to home and jog by hand; `stop` switches them off.
    Enable(control::ControlArgs),
    /// Home all joints; drives are switched on first and stay on.
    Home(control::ControlArgs),
    /// Move an axis or a joint by hand.
    Jog(jog::JogArgs),
    /// Bring the program of a running control to rest on its path, and keep it.
    Hold(control::ControlArgs),
    /// Go on after a hold, forward; in single block, with the next block.
    Resume(control::ControlArgs),
    /// Run the program that runs or is held back along its path.
    Reverse(control::ReverseArgs),
    /// Let the program rest at the end of each block; `resume` runs the next one.
    SingleBlock(control::SingleBlockArgs),
    /// Bring the program of a running control to rest on its path, give it up, switch drives off.
    Stop(control::ControlArgs),
    /// Run feed, rapid moves or the spindle at another percentage of what is programmed.
    Override(control::OverrideArgs),
    /// Acknowledge the alarm of a running control.
    Alarm(control::AlarmArgs),
    /// Check a machine file: all errors at once, located.
    Check(check::CheckArgs),
    /// Print the canonical calls of a part program, one a line.
    Interpret(interpret::InterpretArgs),
    /// Plan a whole part program off line: motion time, peaks, samples.
    Plan(plan::PlanArgs),
    /// Be the machine of a machine file: its drives and I/O as controlled nodes on an interface.
    Simulate(simulate::SimulateArgs),
    /// Measure how exactly the cycle is kept while a program runs, beside what the PC can do at all.
    Jitter(jitter::JitterArgs),
    /// List, read, set or watch the pins of a running control.
    Hal(hal::HalArgs),
    /// Look at the network: who is on it, how it is, what went over the wire.
    Bus(bus::BusArgs),
}

/// Runs the command of the process's arguments. Exit code 0: ok, 1: trouble found, 2: wrong usage.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    let result = match &cli.command {
        Command::Demo(args) => demo::demo(args),
        Command::Run(args) => run::run(args),
        Command::Doctor(args) => doctor::doctor(args),
        Command::Status(args) => control::status(args),
        Command::Program(args) => control::program(args),
        Command::Enable(args) => control::order(args, control::Order::Enable),
        Command::Home(args) => control::order(args, control::Order::Home),
        Command::Jog(args) => jog::jog(args),
        Command::Hold(args) => control::order(args, control::Order::Hold),
        Command::Resume(args) => control::order(args, control::Order::Resume),
        Command::Reverse(args) => control::reverse(args),
        Command::SingleBlock(args) => control::single_block(args),
        Command::Stop(args) => control::order(args, control::Order::Stop),
        Command::Override(args) => control::turn(args),
        Command::Alarm(args) => control::alarm(args),
        Command::Check(args) => check::check(args),
        Command::Interpret(args) => interpret::interpret(args),
        Command::Plan(args) => plan::plan(args),
        Command::Simulate(args) => simulate::simulate(args),
        Command::Jitter(args) => jitter::jitter(args),
        Command::Hal(args) => hal::hal(args),
        Command::Bus(args) => bus::bus(args),
    };
    result.unwrap_or_else(|error| {
        eprintln!("isocnc: {error:#}");
        ExitCode::FAILURE
    })
}
