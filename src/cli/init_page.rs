//! `isocnc init`: at a terminal, or as a page of the panel, which the control then takes the place of.

use ::panel::{Control, Guest, Listener, Settings, Setup, Tokens};
use anyhow::Context;
use bus_tools::init::{self, InitArgs, NotWritten, Page};
use clap::Args;
use host::terminal::say;
use protocol::Role;
use serde_json::Value;
use std::io;
use std::net::SocketAddr;
use std::os::unix::net::UnixStream;
use std::os::unix::process::CommandExt;
use std::process::{Command, ExitCode};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Arguments of `init`.
#[derive(Clone, Debug, Args)]
pub struct WithPage {
    #[command(flatten)]
    init: InitArgs,
    /// Ask in the browser, and run the control there when the file is written [default: 127.0.0.1:8402]
    #[arg(long, value_name = "ADDRESS:PORT", num_args = 0..=1, value_parser = super::run::panel_address)]
    panel: Option<Option<SocketAddr>>,
}

/// What an answer has to go out before the page ends.
const ANSWER_TIME: Duration = Duration::from_millis(300);

/// There is no control yet.
struct NoControl;

impl Control for NoControl {
    fn connect(&self, _: &Guest) -> io::Result<UnixStream> {
        Err(io::Error::new(
            io::ErrorKind::NotConnected,
            "there is no control yet: first its machine file",
        ))
    }
}

struct Dialogue {
    page: Page,
    is_written: AtomicBool,
    /// The panel ends as this is closed.
    end: Mutex<Option<UnixStream>>,
}

impl Setup for Dialogue {
    fn begin(&self) -> Value {
        self.page.begin()
    }

    fn scan(&self, interface: &str) -> Result<Value, String> {
        self.page.scan(interface)
    }

    fn check(&self, answers: &Value) -> Result<String, String> {
        self.page.check(answers)
    }

    fn write(&self, answers: &Value, replace: bool) -> Result<Option<String>, String> {
        match self.page.write(answers, replace) {
            Ok(()) => {
                self.is_written.store(true, Ordering::Relaxed);
                Ok(Some(self.page.file().display().to_string()))
            }
            Err(NotWritten::IsThere(_)) => Ok(None),
            Err(NotWritten::Wrong(why)) => Err(why),
        }
    }

    fn start(&self) -> Result<(), String> {
        if !self.is_written.load(Ordering::Relaxed) {
            return Err("no machine file is written yet".into());
        }
        let end = self.end.lock().unwrap_or_else(PoisonError::into_inner).take();
        // Called a second time, there is nothing left to do. The answer goes out first.
        std::thread::spawn(move || {
            std::thread::sleep(ANSWER_TIME);
            drop(end);
        });
        Ok(())
    }
}

/// Makes a machine file.
///
/// # Errors
/// As [`init::init`]; an address that cannot be had, or a control that does not begin.
pub fn init(args: &WithPage) -> anyhow::Result<ExitCode> {
    let Some(address) = args.panel else {
        return init::init(&args.init);
    };
    let listener = Listener::bind(address.unwrap_or(config::Panel::loopback())).context("the page cannot be shown")?;
    let (address, mut tokens) = (listener.address(), Tokens::default());
    let place = match listener.is_loopback() {
        true => format!("http://{address}/"),
        false => {
            let secret = tokens.add_passing("this run", Role::SetUp).context("a token")?;
            format!("http://{address}/#token={secret}")
        }
    };
    say(&format!("a machine file is made at {place}\n"));
    let (end, until) = UnixStream::pair()?;
    let dialogue = Arc::new(Dialogue {
        page: Page::new(&args.init),
        is_written: AtomicBool::new(false),
        end: Mutex::new(Some(end)),
    });
    let settings = Settings {
        tokens,
        setup: Some(Arc::clone(&dialogue) as Arc<dyn Setup>),
        ..Settings::default()
    };
    ::panel::serve(listener, settings, Arc::new(NoControl), Arc::default(), until)?;
    // The control in the place of this process: whoever waits for this one waits for it.
    let mut control = Command::new(std::env::current_exe()?);
    control
        .arg("run")
        .arg(dialogue.page.file())
        .arg("--panel")
        .arg(address.to_string());
    Err(control.exec()).context("the control does not begin")
}
