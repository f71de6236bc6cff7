//! `isocnc hal scope`: pins of a running control, cycle by cycle.
//!
//! In:  the ring of the control. Out: a screen, CSV, SVG, or lines on standard output.
//!
//! A recording of any length takes constant memory: what goes to a file leaves at once, a picture has a bounded number of columns.

mod screen;
mod view;

use anyhow::{Context, bail};
use api::methods::value_json;
use hal_pins::Attached;
use hal_pins::scope::{CHANNELS_MAX, Channel};
use host::signals::{StopSignal, exit_code};
use scope::csv;
use scope::picture::{self, COLUMNS_MAX, Told};
use scope::record::{Mode, Step};
use scope::stream::{Stream, Wanted};
use scope::thin::{Column, Fitted};
use scope::trigger::Trigger;
use serde_json::json;
use std::fs::File;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;
use terminal::refusal::Refusal;

/// Cycles that are taken at once.
const BLOCK: usize = 4096;
/// Between two looks, where nothing is there.
const PAUSE: Duration = Duration::from_millis(20);
/// A trigger that has not come is told so often, in looks.
const LOOKS_UNTIL_TOLD: u32 = 100;

/// Arguments of `isocnc hal scope`.
#[derive(Clone, Debug, clap::Args)]
pub struct ScopeArgs {
    /// Up to 32 pins or nets, or patterns as with list
    #[arg(required = true, value_name = "PIN")]
    pins: Vec<String>,
    /// Record around this moment: 'PIN>1.5', 'falling PIN<2', 'PIN=1..2', 'level PIN', 'changed PIN', alarm
    #[arg(long, value_name = "EXPRESSION", value_parser = trigger)]
    trigger: Option<Trigger>,
    /// auto, normal, single or roll: what follows a record, and what is done without a trigger
    #[arg(long, value_parser = mode)]
    mode: Option<Mode>,
    /// Length of a record; without it 1 s around a trigger, else until Ctrl-C
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    seconds: Option<f64>,
    /// Share of a record that lies before the trigger
    #[arg(long, value_name = "PERCENT", default_value_t = 10.0, allow_negative_numbers = true)]
    before: f64,
    /// Write every cycle to this file: t_s,name..
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Draw the record, the last one of several, to this file
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    /// Print every cycle as it comes, as with --csv
    #[arg(long)]
    follow: bool,
}

fn trigger(text: &str) -> Result<Trigger, String> {
    Trigger::parse(text).map_err(|error| error.to_string())
}

fn mode(text: &str) -> Result<Mode, String> {
    Mode::from_name(text).ok_or_else(|| "expected auto, normal, single or roll".into())
}

impl ScopeArgs {
    fn wanted(&self, pins: &Attached) -> anyhow::Result<Wanted> {
        let names: Vec<String> = super::chosen(pins, &self.pins)?
            .into_iter()
            .map(|pin| pin.name)
            .collect();
        if names.len() > CHANNELS_MAX {
            bail!(
                "{} pins fit, {CHANNELS_MAX} are shown at the most: name fewer",
                names.len()
            );
        }
        Ok(Wanted {
            pins: names,
            trigger: self.trigger.clone(),
            mode: self.mode,
            seconds: self.seconds,
            before_percent: self.before,
        })
    }
}

/// Runs the command.
///
/// # Errors
/// Unknown pins, no oscilloscope that is free, files that cannot be written.
pub(super) fn scope(
    args: &ScopeArgs,
    machine: &str,
    pins: &Attached,
    as_json: bool,
    out: &mut impl Write,
) -> anyhow::Result<ExitCode> {
    let wanted = args.wanted(pins)?;
    let to_files = args.csv.is_some() || args.svg.is_some() || args.follow;
    if !to_files {
        if !std::io::stdout().is_terminal() || !std::io::stdin().is_terminal() {
            bail!(Refusal::usage(
                "scope needs a terminal; without one: --csv FILE, --svg FILE or --follow"
            ));
        }
        return screen::screen(machine, pins, wanted);
    }
    let signal = StopSignal::install().context("signals")?;
    let mut recording = Recording::begin(args, machine, pins, &wanted, as_json, out)?;
    let mut looks = 0;
    while recording.look()? {
        if signal.caught().is_some() {
            break;
        }
        looks += 1;
        if looks == LOOKS_UNTIL_TOLD && recording.stream.recorder().number() == 0 {
            // Nobody need be there to read it.
            let _ = writeln!(files::printed::stderr(), "waiting for the trigger; Ctrl-C gives up");
        }
    }
    let told = recording.finish()?;
    let _ = writeln!(files::printed::stderr(), "{}", told.text);
    Ok(match signal.caught() {
        // Without a length, this is how a recording ends.
        Some(signal) if args.seconds.is_some() => ExitCode::from(exit_code(signal)),
        _ if told.is_whole => ExitCode::SUCCESS,
        _ => ExitCode::from(1),
    })
}

/// What has become of a recording.
struct Outcome {
    text: String,
    /// It was recorded as asked for, without a loss.
    is_whole: bool,
}

/// A recording under way.
struct Recording<'a, W> {
    args: &'a ScopeArgs,
    stream: Stream,
    out: &'a mut W,
    as_json: bool,
    csv: Option<Csv>,
    picture: Option<Fitted>,
    told: Told,
    /// Date of the first record's time 0, and of that of the one under way.
    zeros_ns: Option<(u64, u64)>,
    cycles: u64,
    has_ended: bool,
}

/// A table under way.
struct Csv {
    path: PathBuf,
    /// Once there is something to be written.
    file: Option<File>,
    was_there: bool,
}

impl Csv {
    /// Makes sure that it can be written before a rare moment is waited for; what stands there stays until then.
    fn begin(path: &Path) -> anyhow::Result<Csv> {
        let was_there = std::fs::symlink_metadata(path).is_ok();
        drop(files::append(path).with_context(|| path.display().to_string())?);
        Ok(Csv {
            path: path.to_owned(),
            file: None,
            was_there,
        })
    }

    fn write(&mut self, header: &str, text: &str) -> anyhow::Result<()> {
        let failed = || self.path.display().to_string();
        if self.file.is_none() {
            let mut file = files::create(&self.path).with_context(failed)?;
            file.write_all(header.as_bytes()).with_context(failed)?;
            self.file = Some(file);
        }
        match &mut self.file {
            Some(file) => file.write_all(text.as_bytes()).with_context(failed),
            None => Ok(()),
        }
    }
}

impl Drop for Csv {
    fn drop(&mut self) {
        if self.file.is_none() && !self.was_there {
            // An empty one that was made to see whether it can be.
            let _ = files::remove(&self.path);
        }
    }
}

impl<'a, W: Write> Recording<'a, W> {
    fn begin(
        args: &'a ScopeArgs,
        machine: &str,
        pins: &Attached,
        wanted: &Wanted,
        as_json: bool,
        out: &'a mut W,
    ) -> anyhow::Result<Recording<'a, W>> {
        let csv = args.csv.as_deref().map(Csv::begin).transpose()?;
        let stream = Stream::begin(pins, wanted)?;
        let levels = wanted.trigger.iter().flat_map(|trigger| {
            let of = wanted.pins.iter().position(|pin| *pin == trigger.pin);
            of.into_iter()
                .flat_map(|of| trigger.levels().into_iter().map(move |level| (of, level)))
        });
        Ok(Recording {
            picture: args.svg.is_some().then(|| Fitted::new(COLUMNS_MAX)),
            told: Told {
                title: format!("Pins of {machine}"),
                text: String::new(),
                period_ns: stream.capture().period_ns(),
                trigger: wanted.trigger.as_ref().map(|trigger| trigger.to_string()),
                levels: levels.collect(),
            },
            args,
            stream,
            out,
            as_json,
            csv,
            zeros_ns: None,
            cycles: 0,
            has_ended: false,
        })
    }

    /// Takes in what has come, waits where that is nothing; false: there will be no more.
    fn look(&mut self) -> anyhow::Result<bool> {
        // Asked before, so that the last cycles of a control that ends are taken.
        let is_running = self.stream.capture().is_running();
        let follows_json = self.args.follow && self.as_json;
        let mut text = String::new();
        let mut lines = String::new();
        let Recording {
            stream,
            picture,
            zeros_ns,
            cycles,
            ..
        } = self;
        let count = stream.read(BLOCK, |channels, step| match step {
            Step::Begins { time_ns, .. } => {
                let first_ns = zeros_ns.map_or(time_ns, |(first_ns, _)| first_ns);
                *zeros_ns = Some((first_ns, time_ns));
                if let Some(picture) = picture {
                    *picture = Fitted::new(COLUMNS_MAX);
                }
            }
            Step::Sample { time_ns, words } => {
                *cycles += 1;
                let (first_ns, zero_ns) = zeros_ns.unwrap_or_default();
                let since_ns = i64::try_from(zero_ns.saturating_sub(first_ns)).unwrap_or(i64::MAX);
                let since_first_ns = time_ns.saturating_add(since_ns);
                csv::push_line(&mut text, since_first_ns, channels, words);
                if follows_json {
                    lines.push_str(&json_line(since_first_ns, channels, words));
                }
                if let Some(picture) = picture {
                    let values = channels.iter().zip(words);
                    picture.push(time_ns, values.map(|(channel, word)| channel.value(*word).to_f64()));
                }
            }
            Step::Ends { .. } => {}
        })?;
        if !text.is_empty() {
            let header = csv::header(self.stream.channels());
            if let Some(csv) = &mut self.csv {
                csv.write(&header, &text)?;
            }
            if self.args.follow {
                let lines = if follows_json { lines } else { text };
                if !follows_json && self.cycles == lines.lines().count() as u64 {
                    self.out.write_all(header.as_bytes())?;
                }
                self.out.write_all(lines.as_bytes())?;
                self.out.flush()?;
            }
        }
        if self.stream.recorder().is_done() {
            return Ok(false);
        }
        if count == 0 {
            if !is_running {
                self.has_ended = true;
                return Ok(false);
            }
            std::thread::sleep(PAUSE);
        }
        Ok(true)
    }

    /// Writes what is written at the end; says what has become of all.
    fn finish(mut self) -> anyhow::Result<Outcome> {
        let lost = self.stream.capture().lost();
        let seconds = self.cycles as f64 * self.told.period_ns as f64 / 1e9;
        let pins = self.stream.channels().len();
        let mut text = format!(
            "{} cycles of {pins} pin{}, {seconds:.3} s, {lost} lost",
            self.cycles,
            if pins == 1 { "" } else { "s" }
        );
        self.told.text.clone_from(&text);
        if self.cycles == 0 {
            text = "nothing was recorded: no trigger came".into();
        } else {
            if let (Some(path), Some(picture)) = (&self.args.svg, &self.picture) {
                let columns: Vec<Column> = picture.columns().cloned().collect();
                let svg = picture::svg(&self.told, self.stream.channels(), &columns);
                files::write(path, svg).with_context(|| path.display().to_string())?;
            }
            let written = self.args.csv.iter().chain(&self.args.svg);
            let written: Vec<String> = written.map(|path| path.display().to_string()).collect();
            if !written.is_empty() {
                text += &format!(": {}", written.join(", "));
            }
        }
        if lost > 0 {
            text += "\ncycles were lost as this process did not read them in time; gaps in t_s show where";
        }
        if self.has_ended {
            text += "\nthe control has ended";
        }
        let is_short = self.has_ended && !self.stream.recorder().is_done();
        let is_whole = self.cycles > 0 && lost == 0 && !(is_short && self.args.seconds.is_some());
        Ok(Outcome { text, is_whole })
    }
}

fn json_line(time_ns: i64, channels: &[Channel], words: &[u64]) -> String {
    let values = channels.iter().zip(words);
    let values = values.map(|(channel, word)| (channel.name.clone(), value_json(channel.value(*word))));
    let values: serde_json::Map<String, serde_json::Value> = values.collect();
    format!("{}\n", json!({ "t_s": time_ns as f64 / 1e9, "values": values }))
}

#[cfg(test)]
mod tests;
