//! A control that stands by: the network is up, and the machine does what clients ask for.
//!
//! In:  a machine, a wire; orders of clients over the inbox.
//! Out: what is carried out; answers; the journal on the terminal.
//!
//! A program is checked as a whole before it is accepted; stopped meanwhile, or forsaken by the client that wants it, it never
//! begins. Drives that were switched on stay on, and joints that are homed stay so: jogging, MDI and programs follow each other. A
//! fault waits for an acknowledge and lets nothing begin before.

mod check;
mod clients;
mod pins;
mod streamed;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod tests_by_hand;
#[cfg(test)]
mod tests_days;
mod wishes;

pub(super) use self::check::Part;
pub(super) use self::clients::Clients;
use crate::console::level;
use crate::operator_loop::{LoopTask, Running};
use crate::progress::told;
use crate::service::Service;
use crate::session;
use crate::session::{Session, Task, Wire};
use config::Config;
use host::logging;
use host::signals;
use host::signals::StopSignal;
use host::terminal::{is_heard, say};
use machine::tables::Tables;
use serde_json::json;
use std::process::ExitCode;
use std::sync::Mutex;
use terminal::refusal::Refusal;

/// Stands by until a signal ends it.
///
/// # Errors
/// What keeps it from starting.
pub fn stand_by(
    config: &Config,
    wire: Wire,
    as_json: bool,
    signal: StopSignal,
    services: Vec<Box<dyn Service>>,
) -> anyhow::Result<ExitCode> {
    let tables = Mutex::new(Tables::read(config).map_err(Refusal::from)?);
    let session = Session {
        config,
        tables: &tables,
        task: Task::StandBy,
        quiet: as_json,
        signal,
        keep_rights: false,
        services,
    };
    if !as_json {
        say(&format!(
            "isocnc: {} stands by with drives off; 'isocnc program run FILE' runs a program, Ctrl-C ends\n",
            config.name
        ));
    }
    let to_journal = logging::goes_to_journal(&std::io::stdout());
    let ended = session::run(&session, wire, &mut Journal { as_json, to_journal })?;
    let operator = &ended.operator;
    if as_json {
        let summary = json!({
            "machine": config.name,
            "signal": session.signal.caught(),
            "programs": operator.programs(),
            "alarms": operator.alarms(),
        });
        say(&format!("{summary}\n"));
    } else {
        let (programs, alarms) = (operator.programs(), operator.alarms().len());
        say(&format!("{programs} programs run, {alarms} alarms\n"));
    }
    if operator.needs_restart() {
        return Ok(ExitCode::from(session::EXIT_RESTART));
    }
    Ok(match session.signal.caught() {
        Some(signal) => ExitCode::from(signals::exit_code(signal)),
        None => ExitCode::FAILURE,
    })
}

/// Prints the journal as it comes.
struct Journal {
    as_json: bool,
    /// Standard output leads to the journal of systemd.
    to_journal: bool,
}

impl LoopTask for Journal {
    fn tick(&mut self, running: &mut Running, _now_ns: u64) {
        while is_heard()
            && let Some(entry) = running.operator.next_entry()
        {
            match self.as_json {
                true => say(&format!("{}\n", json!(entry))),
                false if self.to_journal => say(&format!("{}{}", logging::priority(level(entry)), told(entry))),
                false => say(&told(entry)),
            }
        }
    }
}
