//! `isocnc interpret`: what a part program comes to, as canonical calls or as plain G-code.
//!
//! In:  a part program, and what the machine remembers: machine file, tool table, parameter file.
//! Out: on standard output the calls, as LinuxCNC's `rs274 -g` prints them ([`gcode::CanonPrinter`]), as JSON (`json`) or
//!      as plain G-code ([`gcode::FlatWriter`]); errors and what the program prints on standard error.
//!
//! The program is read as it runs, line by line; the output can begin before its end is written.

mod json;
#[cfg(test)]
mod json_tests;
mod log;
mod tables;

use anyhow::Context;
use files::read::PROGRAM_MAX;
use gcode::{CanonPrinter, CheckLimits, Error, FlatError, FlatWriter, Interpreter, ReadSeek, Resume, Run, Settings};
use json::JsonPrinter;
use log::Log;
use motion::canon::{Call, Event, LengthUnit, Record, Source};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

/// Arguments of `isocnc interpret`.
#[derive(Clone, Debug, clap::Args)]
pub struct InterpretArgs {
    /// Part program; - reads it from standard input
    pub program: PathBuf,
    /// Form of the output
    #[arg(long, value_enum, default_value = "canon")]
    pub format: Format,
    /// Print all errors of the program and no calls; exit code 0 if there are none
    #[arg(long)]
    pub check: bool,
    /// Go on behind a line with an error, which then has no effect (rs274 -n 0)
    #[arg(short = 'n', long)]
    pub continue_after_error: bool,
    /// Leave out lines that begin with / (rs274 -b)
    #[arg(short, long)]
    pub block_delete: bool,
    /// Machine file: its units, axes, spindles, offsets, tool table, parameter file, remapped codes. Without one
    /// everything is as with LinuxCNC's rs274: all at zero, one spindle, tools 1 to 99 without measures
    #[arg(short, long, value_name = "MACHINE.toml")]
    pub machine: Option<PathBuf>,
    /// Tool table (rs274 -t), in place of the machine file's
    #[arg(short, long, value_name = "FILE")]
    pub tools: Option<PathBuf>,
    /// Parameter file (rs274 -v), in place of the machine file's; it is read, not written
    #[arg(short, long, value_name = "FILE")]
    pub var: Option<PathBuf>,
    /// Write the parameters behind the program to this file
    #[arg(long, value_name = "FILE")]
    pub write_var: Option<PathBuf>,
    /// Unit of lengths in tool table and parameter file; without it that of the machine file or else, as with rs274, inch
    #[arg(long, value_enum)]
    pub unit: Option<Unit>,
    /// Begin before this line: tells on standard error what is assumed, writes the calls that bring a machine into the state
    /// that the lines before would have left, then those from there on
    #[arg(long, value_name = "LINE", conflicts_with = "check")]
    pub start_line: Option<u32>,
    /// Further folder in which subroutines are looked for; may be given several times. The first one is always that of the
    /// program
    #[arg(long, value_name = "DIR")]
    pub subroutines: Vec<PathBuf>,
    /// Stop with an error after so many lines, those of loops counted each time
    #[arg(long, value_name = "LINES")]
    pub steps: Option<u64>,
    /// Write the files that (LOGOPEN, ..) and (LOGAPPEND, ..) name; without this they are only told
    #[arg(long)]
    pub write_logs: bool,
}

/// Form of the output.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    /// Canonical calls as LinuxCNC's rs274 -g prints them
    Canon,
    /// Canonical calls with all they say, one JSON object a line; lengths in mm, times in seconds
    Json,
    /// Plain G-code: no parameters, expressions, loops, subroutines and cycles
    Gcode,
}

/// Unit of lengths.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Unit {
    /// Millimetres
    Mm,
    /// Inches
    Inch,
}

impl From<Unit> for LengthUnit {
    fn from(unit: Unit) -> LengthUnit {
        match unit {
            Unit::Mm => LengthUnit::Millimetre,
            Unit::Inch => LengthUnit::Inch,
        }
    }
}

/// Runs the command; exit code 1 if the program or one of the other files has errors.
///
/// # Errors
/// Files that cannot be read, output that cannot be written.
pub fn interpret(args: &InterpretArgs) -> anyhow::Result<ExitCode> {
    let Some(tables) = tables::read(args)? else {
        return Ok(ExitCode::FAILURE);
    };
    let text = Text::open(&args.program).with_context(|| args.program.display().to_string())?;
    let name = match &text {
        Text::File(path) => path.display().to_string(),
        Text::Memory(_) => "(standard input)".to_owned(),
    };
    let errors = if args.check {
        check(args, &text, &name, tables.settings)?
    } else {
        match run(args, &text, &name, tables) {
            Ok(errors) => errors,
            // The reader of a pipe may have seen enough.
            Err(error) if is_broken_pipe(&error) => 0,
            Err(error) => return Err(error),
        }
    };
    Ok(if errors == 0 {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    let kind = error.downcast_ref::<io::Error>().map(io::Error::kind);
    kind == Some(io::ErrorKind::BrokenPipe)
}

/// Where the text of the program is.
enum Text {
    File(PathBuf),
    /// Standard input cannot be read twice.
    Memory(Arc<[u8]>),
}

impl Text {
    fn open(path: &Path) -> io::Result<Text> {
        if path != Path::new("-") {
            return Ok(Text::File(path.to_owned()));
        }
        let mut text = Vec::new();
        io::stdin().lock().take(PROGRAM_MAX + 1).read_to_end(&mut text)?;
        if text.len() as u64 > PROGRAM_MAX {
            let what = format!("is longer than {PROGRAM_MAX} octets: give it as a file");
            return Err(io::Error::new(io::ErrorKind::FileTooLarge, what));
        }
        Ok(Text::Memory(text.into()))
    }

    fn read(&self) -> io::Result<Box<dyn ReadSeek>> {
        Ok(match self {
            Text::File(path) => Box::new(files::open(path)?),
            Text::Memory(text) => Box::new(io::Cursor::new(Arc::clone(text))),
        })
    }
}

/// Prints all errors; their number.
fn check(args: &InterpretArgs, text: &Text, name: &str, settings: Settings) -> anyhow::Result<usize> {
    let mut limits = CheckLimits::default();
    limits.steps = args.steps.unwrap_or(limits.steps);
    let read = || text.read();
    let first = read().with_context(|| name.to_owned())?;
    let errors = gcode::check_reader(first, read, settings, limits.clone()).with_context(|| name.to_owned())?;
    for error in &errors {
        files::errln!("{}\n", error.render(name));
    }
    match errors.len() {
        0 => {}
        1 => files::errln!("{name}: 1 error"),
        count if count >= limits.errors => files::errln!("{name}: {count} errors or more"),
        count => files::errln!("{name}: {count} errors"),
    }
    Ok(errors.len())
}

/// Runs the program and writes what it comes to; the number of errors, which were printed.
fn run(args: &InterpretArgs, text: &Text, name: &str, tables: tables::Tables) -> anyhow::Result<usize> {
    let mut printer = Printer::new(args.format, &tables.settings);
    let text = text.read().with_context(|| name.to_owned())?;
    let mut run = Interpreter::new(tables.settings).run_reader(text);
    if let Some(steps) = args.steps {
        run = run.limit_steps(steps);
    }
    if args.continue_after_error {
        run = run.continue_after_errors();
    }
    if let Format::Canon = args.format {
        run = run.number_by_release();
    }
    let mut out = files::printed::buffered();
    let mut log = args.write_logs.then(Log::default);
    let mut errors = 0;
    let mut first = Vec::new();
    if let Some(line) = args.start_line {
        match run.start_at_line(line) {
            Ok(resume) => first = resumed(resume, line, name),
            Err(error) => {
                print_error(&error, name);
                return Ok(1);
            }
        }
    }
    let mut first = first.into_iter();
    while let Some(event) = first.next().map(Ok).or_else(|| run.next()) {
        match event {
            Ok(event) => {
                if let Call::Record(record) = &event.call {
                    if let (Record::Print(text), Format::Canon) = (record, args.format) {
                        out.flush()?;
                        files::errln!("{text}");
                    }
                    if let Some(log) = &mut log {
                        log.record(record)?;
                    }
                }
                if let Err(reason) = printer.write(&event, &run, name, &mut out)? {
                    out.flush()?;
                    files::errln!("error: {name}:{reason}");
                    return Ok(errors + 1);
                }
            }
            Err(error) => {
                errors += 1;
                out.flush()?; // the calls before it are seen before it
                print_error(&error, name);
            }
        }
    }
    printer.end(errors > 0 && !args.continue_after_error, &mut out)?;
    out.flush()?;
    if let Some(log) = &mut log {
        log.close()?;
    }
    if let Some(path) = &tables.write_parameters {
        let parameters: Vec<(u16, f64)> = run.snapshot().parameters.into_iter().collect();
        let text = gcode::parameter::file::write(&parameters);
        files::write(path, text).with_context(|| path.display().to_string())?;
    }
    Ok(errors)
}

/// Tells what a start in the middle assumes; the events that come before those of the line.
fn resumed(resume: Resume, line: u32, name: &str) -> Vec<Event> {
    files::errln!(
        "{name}: starts before line {line} with {} calls for the state there",
        resume.calls.len()
    );
    for assumption in resume.assumptions {
        files::errln!("{name}: assumed: {assumption}");
    }
    let event = |call| Event {
        source: Source {
            line,
            ..Source::default()
        },
        call,
    };
    resume.calls.into_iter().map(event).collect()
}

fn print_error(error: &Error, name: &str) {
    files::errln!("{}", error.render(name));
}

/// Writes events in one of the forms.
enum Printer {
    Canon(CanonPrinter),
    Json(JsonPrinter),
    Gcode(Box<FlatWriter>),
}

impl Printer {
    fn new(format: Format, settings: &Settings) -> Printer {
        match format {
            Format::Canon => Printer::Canon(CanonPrinter::new(settings.machine_unit)),
            Format::Json => Printer::Json(JsonPrinter::default()),
            Format::Gcode => Printer::Gcode(Box::new(FlatWriter::new(settings))),
        }
    }

    /// Writes an event. `Ok(Err(..))`: the form cannot say it; line and reason.
    fn write(
        &mut self,
        event: &Event,
        run: &Run<'_>,
        name: &str,
        out: &mut impl Write,
    ) -> io::Result<Result<(), String>> {
        match self {
            Printer::Canon(printer) => printer.write(event, out)?,
            Printer::Json(printer) => {
                let file = match run.file_name(event.source.file) {
                    "" => name,
                    file => file,
                };
                writeln!(out, "{}", printer.object(event, file))?;
            }
            Printer::Gcode(writer) => match writer.write(event, out) {
                Ok(()) => {}
                Err(FlatError::Io(error)) => return Err(error),
                Err(FlatError::Unwritable { at, reason }) => return Ok(Err(format!("{}: {reason}", at.line))),
            },
        }
        Ok(Ok(()))
    }

    /// Writes what stands behind the last event.
    fn end(self, stopped_by_error: bool, out: &mut impl Write) -> anyhow::Result<()> {
        match self {
            Printer::Canon(mut printer) if stopped_by_error => Ok(printer.write_end_after_error(out)?),
            Printer::Canon(_) | Printer::Json(_) => Ok(()),
            Printer::Gcode(_) if stopped_by_error => Ok(()),
            Printer::Gcode(writer) => match writer.finish(out) {
                Ok(()) => Ok(()),
                Err(FlatError::Io(error)) => Err(error.into()),
                Err(error) => Err(error.into()),
            },
        }
    }
}
