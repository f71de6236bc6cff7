//! The oscilloscope in a terminal: what it knows, and what its keys do.
//!
//! In:  cycles of a stream, keys. Out: what `view.rs` draws; files that a key asks for.
//!
//! Memory is bounded: the last minute at the most, fewer seconds of many pins.

use super::view;
use anyhow::Context;
use hal_pins::Attached;
use hal_pins::scope::Channel;
use host::signals::{StopSignal, exit_code};
use host::terminal::event_within;
use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use scope::csv;
use scope::picture::{self, COLUMNS_MAX, Told};
use scope::record::{Mode, Step};
use scope::stream::{Stream, Wanted};
use scope::thin::{Column, Fitted};
use scope::trigger::Trigger;
use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Between two looks at what is new.
const PAUSE: Duration = Duration::from_millis(20);
/// A new picture so often at the most.
const REDRAW: Duration = Duration::from_millis(50);
/// Cycles that are taken at once.
const BLOCK: usize = 4096;
/// Values that are kept.
const VALUES_MAX: usize = 1 << 20;
/// Lengths of what is shown, s.
const LENGTHS_S: [f64; 13] = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0];
/// Shares of a record before its trigger, %.
const SHARES: [f64; 5] = [0.0, 10.0, 50.0, 90.0, 100.0];

/// Cycles of a record.
#[derive(Debug, Default)]
pub(super) struct Trace {
    times_ns: VecDeque<i64>,
    words: VecDeque<u64>,
    channels: usize,
}

impl Trace {
    fn new(channels: usize) -> Trace {
        Trace {
            channels,
            ..Trace::default()
        }
    }

    fn push(&mut self, time_ns: i64, words: &[u64]) {
        while !self.times_ns.is_empty() && self.words.len() + words.len() > VALUES_MAX {
            self.drop_first();
        }
        self.times_ns.push_back(time_ns);
        self.words.extend(words);
    }

    fn drop_first(&mut self) {
        self.times_ns.pop_front();
        self.words.drain(..self.channels.min(self.words.len()));
    }

    /// Leaves out what is older than so much before the last cycle.
    fn keep_last(&mut self, length_ns: i64) {
        while let (Some(first), Some(last)) = (self.times_ns.front(), self.times_ns.back())
            && last.saturating_sub(*first) > length_ns
        {
            self.drop_first();
        }
    }

    pub(super) fn last_ns(&self) -> Option<i64> {
        self.times_ns.back().copied()
    }

    /// Cycles in their order: time and the word of a channel.
    pub(super) fn of(&self, channel: usize) -> impl Iterator<Item = (i64, u64)> {
        let words = self.words.iter().skip(channel).step_by(self.channels.max(1));
        self.times_ns.iter().copied().zip(words.copied())
    }
}

/// The state of the screen.
pub(super) struct App {
    pub(super) machine: String,
    pub(super) wanted: Wanted,
    pub(super) channels: Vec<Channel>,
    pub(super) period_ns: u64,
    /// What is drawn: the record under way, or the last one.
    pub(super) trace: Trace,
    pub(super) record: u64,
    pub(super) is_forced: bool,
    pub(super) lost: u64,
    /// The channel that keys are for.
    pub(super) selected: usize,
    pub(super) is_overlaid: bool,
    pub(super) is_frozen: bool,
    pub(super) is_done: bool,
    pub(super) is_waiting: bool,
    /// Why nothing more will come.
    pub(super) ended: Option<String>,
    /// What came of the last key.
    pub(super) said: Option<String>,
    /// A trigger that is being typed.
    pub(super) typed: Option<String>,
    written: u32,
    folder: PathBuf,
}

/// What a key leads to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Act {
    Nothing,
    /// The capture begins anew, with what is wanted now.
    Begin,
    Quit,
}

impl App {
    pub(super) fn new(machine: &str, mut wanted: Wanted, folder: &Path) -> App {
        let mode = match (wanted.mode, &wanted.trigger) {
            (Some(mode), _) => mode,
            (None, Some(_)) => Mode::Normal,
            (None, None) => Mode::Roll,
        };
        wanted.mode = Some(mode);
        let length_s = wanted.seconds.unwrap_or(if mode == Mode::Roll { 5.0 } else { 1.0 });
        wanted.seconds = Some(length_s);
        App {
            machine: machine.to_owned(),
            wanted,
            channels: Vec::new(),
            period_ns: 1,
            trace: Trace::default(),
            record: 0,
            is_forced: false,
            lost: 0,
            selected: 0,
            is_overlaid: false,
            is_frozen: false,
            is_done: false,
            is_waiting: true,
            ended: None,
            said: None,
            typed: None,
            written: 0,
            folder: folder.to_owned(),
        }
    }

    pub(super) fn mode(&self) -> Mode {
        self.wanted.mode.unwrap_or(Mode::Roll)
    }

    pub(super) fn length_s(&self) -> f64 {
        self.wanted.seconds.unwrap_or(1.0)
    }

    /// The times that are shown, ns on that of the record.
    pub(super) fn shown_ns(&self) -> (i64, i64) {
        let length_ns = (self.length_s() * 1e9) as i64;
        match (self.mode(), &self.wanted.trigger) {
            (Mode::Roll, _) | (_, None) => {
                let last_ns = self.trace.last_ns().unwrap_or(0).saturating_add(self.period_ns as i64);
                let end_ns = last_ns.max(length_ns);
                (end_ns - length_ns, end_ns)
            }
            (_, Some(_)) => {
                let before_ns = (length_ns as f64 * self.wanted.before_percent / 100.0) as i64;
                (-before_ns, length_ns - before_ns)
            }
        }
    }

    /// A capture has begun.
    pub(super) fn begin(&mut self, stream: &Stream) {
        self.channels = stream.channels().to_vec();
        self.period_ns = stream.capture().period_ns();
        self.trace = Trace::new(self.channels.len());
        (self.record, self.is_done, self.is_waiting, self.ended) = (0, false, true, None);
        self.selected = self.selected.min(self.channels.len().saturating_sub(1));
    }

    /// A part of a record.
    pub(super) fn take(&mut self, step: Step<'_>) {
        match step {
            Step::Begins { number, is_forced, .. } => {
                if self.is_frozen {
                    return;
                }
                self.trace = Trace::new(self.channels.len());
                (self.record, self.is_forced, self.is_waiting) = (number, is_forced, false);
            }
            Step::Sample { time_ns, words } if !self.is_frozen => {
                self.trace.push(time_ns, words);
                if self.mode() == Mode::Roll {
                    self.trace.keep_last((LENGTHS_S[LENGTHS_S.len() - 1] * 1e9) as i64);
                }
            }
            Step::Ends { .. } if !self.is_frozen => self.is_waiting = true,
            Step::Sample { .. } | Step::Ends { .. } => {}
        }
    }

    pub(super) fn key(&mut self, key: KeyEvent) -> Act {
        if key.kind == KeyEventKind::Release {
            return Act::Nothing;
        }
        if key.modifiers.contains(KeyModifiers::CONTROL) {
            return match key.code {
                KeyCode::Char('c') => Act::Quit,
                _ => Act::Nothing,
            };
        }
        self.said = None;
        if let Some(typed) = self.typed.take() {
            return self.key_of_line(typed, key.code);
        }
        match key.code {
            KeyCode::Char('q') => Act::Quit,
            KeyCode::Char(' ') => {
                self.is_frozen = !self.is_frozen;
                // What is shown is a whole record, or the newest.
                if self.is_frozen { Act::Nothing } else { Act::Begin }
            }
            KeyCode::Char('s') if self.wanted.trigger.is_some() => self.change(|app| {
                app.is_frozen = false;
                app.wanted.mode = Some(Mode::Single);
            }),
            KeyCode::Char('m') => {
                let modes = match self.wanted.trigger {
                    Some(_) => &Mode::ALL[..],
                    None => {
                        self.said = Some("without a trigger there is only roll; t types one".into());
                        return Act::Nothing;
                    }
                };
                let at = modes.iter().position(|(mode, _)| *mode == self.mode()).unwrap_or(0);
                let next = modes[(at + 1) % modes.len()].0;
                self.change(|app| app.wanted.mode = Some(next))
            }
            KeyCode::Char('t') => {
                let text = match (&self.wanted.trigger, self.channels.get(self.selected)) {
                    (Some(trigger), _) => trigger.to_string(),
                    (None, Some(channel)) => format!("{}>", channel.name),
                    (None, None) => String::new(),
                };
                self.typed = Some(text);
                Act::Nothing
            }
            KeyCode::Char('+' | '=') => self.length(1),
            KeyCode::Char('-') => self.length(-1),
            KeyCode::Left | KeyCode::Right if self.wanted.trigger.is_some() => {
                let more = key.code == KeyCode::Right;
                let now = self.wanted.before_percent;
                let next = match more {
                    true => SHARES.into_iter().find(|share| *share > now),
                    false => SHARES.into_iter().rev().find(|share| *share < now),
                };
                let share = next.unwrap_or(now);
                self.change(|app| app.wanted.before_percent = share)
            }
            KeyCode::Down => {
                self.selected = (self.selected + 1).min(self.channels.len().saturating_sub(1));
                Act::Nothing
            }
            KeyCode::Up => {
                self.selected = self.selected.saturating_sub(1);
                Act::Nothing
            }
            KeyCode::Char('o') => {
                self.is_overlaid = !self.is_overlaid;
                Act::Nothing
            }
            KeyCode::Char('w') => {
                self.said = Some(match self.write() {
                    Ok(said) => said,
                    Err(error) => format!("{error:#}"),
                });
                Act::Nothing
            }
            _ => Act::Nothing,
        }
    }

    fn key_of_line(&mut self, mut typed: String, code: KeyCode) -> Act {
        match code {
            KeyCode::Esc => return Act::Nothing,
            KeyCode::Enter if typed.trim().is_empty() => {
                return self.change(|app| {
                    app.wanted.trigger = None;
                    app.wanted.mode = Some(Mode::Roll);
                });
            }
            KeyCode::Enter => match Trigger::parse(&typed) {
                Ok(trigger) => {
                    return self.change(|app| {
                        app.wanted.trigger = Some(trigger);
                        if app.mode() == Mode::Roll {
                            app.wanted.mode = Some(Mode::Normal);
                        }
                    });
                }
                Err(error) => self.said = Some(error.to_string()),
            },
            KeyCode::Backspace => _ = typed.pop(),
            KeyCode::Char(letter) if !letter.is_control() && typed.len() < 200 => typed.push(letter),
            _ => {}
        }
        self.typed = Some(typed);
        Act::Nothing
    }

    fn length(&mut self, by: i32) -> Act {
        let now = self.length_s();
        let next = match by > 0 {
            true => LENGTHS_S.into_iter().find(|length| *length > now),
            false => LENGTHS_S.into_iter().rev().find(|length| *length < now),
        };
        let Some(next) = next else { return Act::Nothing };
        self.wanted.seconds = Some(next);
        // What rolls is there already.
        match self.mode() {
            Mode::Roll => Act::Nothing,
            Mode::Auto | Mode::Normal | Mode::Single => Act::Begin,
        }
    }

    fn change(&mut self, change: impl FnOnce(&mut App)) -> Act {
        change(self);
        self.is_frozen = false;
        Act::Begin
    }

    /// Writes what is shown; gives the names of the files.
    fn write(&mut self) -> anyhow::Result<String> {
        let (from_ns, to_ns) = self.shown_ns();
        let mut text = csv::header(&self.channels);
        let mut fitted = Fitted::new(COLUMNS_MAX);
        let mut cycles = 0_u64;
        let per_record = self.trace.channels.max(1);
        for (at, time_ns) in self.trace.times_ns.iter().enumerate() {
            if !(from_ns..to_ns).contains(time_ns) {
                continue;
            }
            cycles += 1;
            let words: Vec<u64> = self
                .trace
                .words
                .iter()
                .skip(at * per_record)
                .take(per_record)
                .copied()
                .collect();
            csv::push_line(&mut text, *time_ns, &self.channels, &words);
            let values = self.channels.iter().zip(&words);
            fitted.push(*time_ns, values.map(|(channel, word)| channel.value(*word).to_f64()));
        }
        if cycles == 0 {
            return Ok("nothing is shown that could be written".into());
        }
        let free = |number: &u32| {
            let taken = |ending| self.folder.join(format!("scope-{number}.{ending}")).exists();
            !taken("csv") && !taken("svg")
        };
        let number = (self.written + 1..)
            .take(10_000)
            .find(free)
            .context("scope-1 to scope-10000 are there already")?;
        self.written = number;
        let path = |ending| self.folder.join(format!("scope-{number}.{ending}"));
        let levels = self.wanted.trigger.iter().flat_map(|trigger| {
            let of = self.channels.iter().position(|channel| channel.name == trigger.pin);
            of.into_iter()
                .flat_map(|of| trigger.levels().into_iter().map(move |level| (of, level)))
        });
        let told = Told {
            title: format!("Pins of {}", self.machine),
            text: format!("{cycles} cycles, {} lost", self.lost),
            period_ns: self.period_ns,
            trigger: self
                .wanted
                .trigger
                .as_ref()
                .filter(|_| self.mode() != Mode::Roll)
                .map(Trigger::to_string),
            levels: levels.collect(),
        };
        let columns: Vec<Column> = fitted.columns().cloned().collect();
        files::write(&path("csv"), text).with_context(|| path("csv").display().to_string())?;
        let svg = picture::svg(&told, &self.channels, &columns);
        files::write(&path("svg"), svg).with_context(|| path("svg").display().to_string())?;
        Ok(format!("written: scope-{number}.csv, scope-{number}.svg"))
    }
}

/// Shows pins until it is left.
///
/// # Errors
/// Unknown pins, no oscilloscope that is free, the terminal.
pub(super) fn screen(machine: &str, pins: &Attached, wanted: Wanted) -> anyhow::Result<ExitCode> {
    let folder = std::env::current_dir().context("this folder")?;
    let mut app = App::new(machine, wanted, &folder);
    // What is wrong is told before the screen is taken.
    let stream = Stream::begin(pins, &app.wanted)?;
    app.begin(&stream);
    let signal = StopSignal::install().context("signals")?;
    // Puts the terminal back if this panics, too.
    let mut terminal = ratatui::try_init().context("terminal")?;
    let ended = run(&mut terminal, pins, &mut app, stream, &signal);
    let restored = ratatui::try_restore().context("terminal");
    ended?;
    restored?;
    Ok(match signal.caught() {
        Some(signal) => ExitCode::from(exit_code(signal)),
        None => ExitCode::SUCCESS,
    })
}

fn run(
    terminal: &mut DefaultTerminal,
    pins: &Attached,
    app: &mut App,
    stream: Stream,
    signal: &StopSignal,
) -> anyhow::Result<()> {
    let mut stream = Some(stream);
    let mut good = app.wanted.clone();
    let mut drawn: Option<Instant> = None;
    let mut pressed = None;
    while signal.caught().is_none() {
        let mut begins = false;
        let mut event = pressed.take();
        while let Some(now) = event {
            if let Event::Key(key) = now {
                match app.key(key) {
                    Act::Quit => return Ok(()),
                    Act::Begin => begins = true,
                    Act::Nothing => {}
                }
            }
            drawn = None;
            event = event_within(Duration::ZERO)?;
        }
        if begins && app.ended.is_none() {
            // Its ring is free for the next one.
            drop(stream.take());
            stream = begin_anew(app, pins, &mut good);
        }
        look(app, &mut stream);
        if drawn.is_none_or(|drawn| drawn.elapsed() >= REDRAW) {
            terminal.draw(|frame| view::draw(frame, app))?;
            drawn = Some(Instant::now());
        }
        pressed = event_within(PAUSE)?;
    }
    Ok(())
}

/// Begins as is wanted now, or, where that cannot be, as before, and says why.
pub(super) fn begin_anew(app: &mut App, pins: &Attached, good: &mut Wanted) -> Option<Stream> {
    let begun = Stream::begin(pins, &app.wanted).or_else(|error| {
        app.said = Some(error.to_string());
        app.wanted = good.clone();
        Stream::begin(pins, good)
    });
    match begun {
        Ok(stream) => {
            *good = app.wanted.clone();
            app.begin(&stream);
            Some(stream)
        }
        Err(error) => {
            app.ended = Some(error.to_string());
            None
        }
    }
}

/// Takes in what has come.
fn look(app: &mut App, stream: &mut Option<Stream>) {
    let Some(capture) = stream else { return };
    // Asked before, so that the last cycles of a control that ends are taken.
    let is_running = capture.capture().is_running();
    let result = capture.read(BLOCK, |_, step| app.take(step));
    app.lost = capture.capture().lost();
    app.is_done = capture.recorder().is_done();
    match result {
        Err(error) => app.ended = Some(error.to_string()),
        Ok(0) if !is_running => app.ended = Some("the control has ended".into()),
        Ok(_) => return,
    }
    *stream = None;
}
