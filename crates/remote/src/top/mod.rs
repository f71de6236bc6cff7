//! `isocnc top`: a running control on a whole screen of a terminal, over ssh, too.
//!
//! In:  the control socket of a machine, or of the only one that runs; keys.
//! Out: what a subscriber is told, drawn; orders. The terminal is as before when this ends, also by a panic or a signal. It waits for
//! a control that is not there, or not any more.

mod app;
mod link;
mod view;

use anyhow::{Context, bail};
use app::{Act, App};
use clap::Args;
use files::read::PROGRAM_MAX;
use host::signals::{StopSignal, exit_code};
use host::terminal::event_within;
use link::Link;
use ratatui::DefaultTerminal;
use ratatui::crossterm::event::Event;
use std::io::IsTerminal;
use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};
use terminal::refusal::Refusal;

/// Between two looks at what is new.
const PAUSE: Duration = Duration::from_millis(20);
/// A picture at least so often: it tells, too, that nothing is heard.
const REDRAW: Duration = Duration::from_millis(500);
/// Longest program whose lines are shown, octets.
const SHOWN_MAX: u64 = PROGRAM_MAX >> 6;

/// Arguments of `top`.
#[derive(Clone, Debug, Args)]
pub struct TopArgs {
    /// Control of this machine; without it that of ISOCNC_MACHINE, or the only one that runs
    #[arg(long, value_name = "NAME")]
    machine: Option<String>,
}

/// Shows a control until it is left.
///
/// # Errors
/// There is no terminal.
pub fn top(args: &TopArgs) -> anyhow::Result<ExitCode> {
    if !std::io::stdout().is_terminal() || !std::io::stdin().is_terminal() {
        bail!(Refusal::usage(
            "top needs a terminal; for scripts: isocnc status --follow"
        ));
    }
    let signal = StopSignal::install().context("signals")?;
    let link = Link::open(args.machine.clone())?;
    // Puts the terminal back if this panics, too.
    let mut terminal = ratatui::try_init().context("terminal")?;
    let ended = run(&mut terminal, &link, &signal);
    let restored = ratatui::try_restore().context("terminal");
    ended?;
    restored?;
    Ok(match signal.caught() {
        Some(signal) => ExitCode::from(exit_code(signal)),
        None => ExitCode::SUCCESS,
    })
}

fn run(terminal: &mut DefaultTerminal, link: &Link, signal: &StopSignal) -> anyhow::Result<()> {
    let begin = Instant::now();
    let now_ms = || begin.elapsed().as_millis() as u64;
    let (mut app, mut program) = (App::new(), Listing::default());
    let mut drawn: Option<Instant> = None;
    let mut pressed = None;
    while signal.caught().is_none() {
        let mut is_new = drawn.is_none_or(|drawn| drawn.elapsed() > REDRAW);
        while let Ok(news) = link.news.try_recv() {
            app.hear(news, now_ms());
            is_new = true;
        }
        let mut acts = app.tick(now_ms());
        // All that have come: repetitions of a key that were held up on the way are no more than one.
        let mut event = pressed.take();
        while let Some(now) = event {
            match now {
                Event::Key(key) => acts.extend(app.key(key, now_ms())),
                Event::FocusGained | Event::FocusLost | Event::Mouse(_) | Event::Paste(_) | Event::Resize(..) => {}
            }
            is_new = true;
            event = event_within(Duration::ZERO)?;
        }
        for act in acts {
            match act {
                Act::Quit => return Ok(()),
                Act::Send(method, params) => {
                    if let Err(why) = link.send(method, &params) {
                        app.said = Some(why);
                    }
                }
            }
        }
        if is_new {
            program.show(app.status().program.as_ref().map(|program| program.name.as_str()));
            terminal.draw(|frame| view::draw(frame, &app, &program.lines, now_ms()))?;
            drawn = Some(Instant::now());
        }
        pressed = event_within(PAUSE)?;
    }
    Ok(())
}

/// The lines of a program, where its file can be read here.
#[derive(Debug, Default)]
struct Listing {
    name: String,
    lines: Vec<(u32, String)>,
}

impl Listing {
    fn show(&mut self, name: Option<&str>) {
        let name = name.unwrap_or_default();
        if name == self.name {
            return;
        }
        name.clone_into(&mut self.name);
        // Another name is one that a client has given to what it sent.
        let path = Some(Path::new(name)).filter(|path| path.is_absolute());
        let text = path
            .and_then(|path| files::read(path, SHOWN_MAX).ok())
            .unwrap_or_default();
        let text = String::from_utf8_lossy(files::without_mark(&text));
        // Nothing in it is to steer the terminal.
        let printed = |line: &str| {
            line.chars()
                .map(|letter| if letter.is_control() { ' ' } else { letter })
                .collect()
        };
        self.lines = (1..).zip(text.lines().map(printed)).collect();
    }
}
