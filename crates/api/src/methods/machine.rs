//! The machine file, this PC, and how cycles have kept their time.
//!
//! In:  texts of whoever may change what the machine is. Out: what is wrong with them, each with its place; a file that takes effect
//! at the next start, with the one before beside it.

use super::{Call, Methods, value, who};
use crate::errands::Errand;
use crate::orders::Order;
use crate::rpc::{RpcError, code, to_hex};
use crate::server::Ticket;
use files::read::TEXT_MAX;
use machine::state::State;
use protocol::{Activity, Doctor, Errors, FileError, FileWritten, MachineFile, OrdersTaken, Power, Times, message};
use rt::times::Histogram;
use serde::Serialize;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Longest text of a machine file that fits into a message, octets: in JSON, it grows.
const FILE_MAX: usize = 48 * 1024;
/// What the file before is called, behind the name of the file.
const BEFORE: &str = ".before";
/// States of a machine at rest.
const RESTING: [State; 5] = [
    State::Booting,
    State::Disabled,
    State::Ready,
    State::Faulted,
    State::Estop,
];
/// A look at this PC takes so long at the most.
const DOCTOR_MAX: Duration = Duration::from_secs(30);

fn refused(what: impl Into<protocol::Message>) -> RpcError {
    RpcError::new(code::REFUSED, what)
}

/// What is wrong with the text of a machine file.
fn check(text: &str, path: &Path) -> Vec<FileError> {
    let checked = config::parse(text, path).and_then(|config| bus::check(&config));
    match checked {
        Ok(()) => Vec::new(),
        Err(errors) => serde_json::from_value(errors.to_json()["errors"].take()).unwrap_or_default(),
    }
}

fn sum(text: &str) -> String {
    to_hex(&Sha256::digest(text))
}

fn read(path: &Path) -> Result<String, RpcError> {
    let text = files::read_text(path, TEXT_MAX).map_err(|cause| refused(format!("{}: {cause}", path.display())))?;
    match text.len() {
        0..=FILE_MAX => Ok(text),
        long => Err(refused(format!(
            "{}: has {long} octets, and {FILE_MAX} are shown at the most: change it at the PC",
            path.display()
        ))),
    }
}

fn write(path: &Path, text: &str, based_on: &str) -> Result<FileWritten, RpcError> {
    let before = read(path)?;
    if sum(&before) != based_on {
        return Err(refused(format!(
            "{}: somebody has changed it meanwhile: read it again",
            path.display()
        )));
    }
    let errors = check(text, path);
    if let Some(first) = errors.first() {
        let line = first.line.map_or_else(|| "null".to_owned(), |line| line.to_string());
        let what = format!("{}:{line}: {}: {}", path.display(), first.key, first.rule);
        return Err(refused(what).with_data(json!({ "errors": errors })));
    }
    let mut kept = path.as_os_str().to_owned();
    kept.push(BEFORE);
    let kept = PathBuf::from(kept);
    let written = |path: &Path, text: &str| {
        files::write(path, text).map_err(|cause| refused(format!("{}: {cause}", path.display())))
    };
    written(&kept, &before)?;
    written(path, text)?;
    Ok(FileWritten {
        before: kept.display().to_string(),
        sha256: sum(text),
    })
}

/// What `isocnc doctor` says without measuring: by a process of its own, as some of it is tried out.
fn doctor(path: &Path) -> Result<Doctor, RpcError> {
    let program = std::env::current_exe().map_err(|cause| refused(cause.to_string()))?;
    let failed = |what: String| refused(format!("isocnc doctor: {what}"));
    let mut child = Command::new(program)
        .args(["doctor", "--no-tests", "--json"])
        .arg(path)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .map_err(|cause| failed(cause.to_string()))?;
    let output = child.stdout.take();
    // Its end closes the pipe, and so does being killed.
    let reading = std::thread::spawn(move || {
        let mut text = Vec::new();
        let read = output.map(|output| output.take(TEXT_MAX).read_to_end(&mut text));
        read.map(|_| text)
    });
    let give_up = Instant::now() + DOCTOR_MAX;
    while child.try_wait().is_ok_and(|ended| ended.is_none()) {
        if Instant::now() >= give_up {
            // It may have ended just now.
            let _ = child.kill();
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    let text = reading.join().ok().flatten().unwrap_or_default();
    serde_json::from_slice(&text).map_err(|_| failed("told nothing: run it at the PC".into()))
}

fn shown(histogram: &Histogram) -> protocol::Histogram {
    protocol::Histogram {
        edges_us: histogram.edges_ns().iter().map(|edge| *edge as f64 / 1e3).collect(),
        counts: histogram.counts().collect(),
    }
}

impl Methods {
    fn machine_file(&self) -> Result<PathBuf, RpcError> {
        match self.network.file.is_empty() {
            true => Err(refused("this control has no machine file")),
            false => Ok(PathBuf::from(&self.network.file)),
        }
    }

    /// The text of the machine file, and what is wrong with it.
    pub(super) fn read_machine_file(&self) -> Result<Errand, RpcError> {
        self.errand(|path| {
            let text = read(&path)?;
            Ok(MachineFile {
                file: path.display().to_string(),
                sha256: sum(&text),
                errors: check(&text, &path),
                text,
            })
        })
    }

    /// What is wrong with a text.
    pub(super) fn check_machine_file(&self, call: &Call<'_>) -> Result<Errand, RpcError> {
        let text = text(call)?;
        self.errand(move |path| {
            Ok(Errors {
                errors: check(&text, &path),
            })
        })
    }

    /// Puts a text in its place, for the next start.
    pub(super) fn write_machine_file(&mut self, call: &Call<'_>) -> Result<Errand, RpcError> {
        let text = text(call)?;
        let sum = to_hex(&call.params.octets("sha256", 32)?);
        let state = self.live.snapshot().state;
        let shown = self.operator.shown();
        // What has been ordered and not begun shows there; a control that runs one program shows nothing.
        let is_idle = shown.power != Power::Switching && shown.activity == Activity::Idle;
        if !is_idle || !RESTING.contains(&state) {
            let what = format!(
                "the machine is {}: it must rest, and nothing be under way",
                state.name()
            );
            return Err(refused(what));
        }
        let errand = self.errand(move |path| write(&path, &text, &sum))?;
        self.writing.push((call.ticket, who(call.caller).name));
        Ok(errand)
    }

    /// The answer to an errand: where that has replaced the machine file, the journal has it.
    pub(super) fn note_machine_file(&mut self, ticket: Ticket, answer: &Result<Value, RpcError>) {
        let Some(at) = self.writing.iter().position(|(of, _)| *of == ticket) else {
            return;
        };
        let (_, by) = self.writing.swap_remove(at);
        if let Ok(written) = answer {
            let before = written["before"].as_str().unwrap_or_default();
            let what = message!(
                "machine.file_written",
                "the machine file was replaced for the next start; the one before is {before}",
                before = before
            );
            // Nobody waits for its answer.
            let _ = self.operator.put_by(0, Order::Note(what), Some(by));
        }
    }

    pub(super) fn doctor(&self) -> Result<Errand, RpcError> {
        self.errand(|path| doctor(&path))
    }

    /// Something that is done with the machine file.
    fn errand<A: Serialize>(
        &self,
        work: impl FnOnce(PathBuf) -> Result<A, RpcError> + Send + 'static,
    ) -> Result<Errand, RpcError> {
        let path = self.machine_file()?;
        Ok(Box::new(move || Some(work(path).and_then(|answer| value(&answer)))))
    }

    /// How long the parts of cycles have taken since the start.
    pub(super) fn cycle_times(&self) -> Times {
        let last_unix_s = self.live.order_taken_ns().map(|taken_ns| {
            let ago_ns = (self.now_ns)().saturating_sub(taken_ns);
            (self.time_of_day)() - ago_ns as f64 * 1e-9
        });
        let times = &self.live.times;
        Times {
            cycle_us: self.network.cycle_us,
            orders: OrdersTaken {
                taken: self.live.snapshot().orders_taken,
                last_unix_s,
            },
            period: shown(&times.period),
            lateness: shown(&times.lateness),
            exchange: shown(&times.exchange),
            compute: shown(&times.compute),
        }
    }
}

fn text(call: &Call<'_>) -> Result<String, RpcError> {
    let text = call.params.text("text")?;
    text.map(str::to_owned).ok_or_else(|| {
        RpcError::new(
            code::INVALID_PARAMS,
            "parameter \"text\": expected a text, it is missing",
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const DEMO: &str = include_str!("../../../../configs/mill3-demo.toml");

    #[test]
    fn a_file_is_changed_if_it_is_right_and_is_what_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("machine.toml");
        std::fs::write(&path, DEMO).unwrap();
        assert_eq!(check(DEMO, &path), []);
        let wrong = DEMO.replacen("cycle_us", "cycle_ms", 1);
        let errors = check(&wrong, &path);
        assert!(errors[0].line.is_some_and(|line| line > 0), "{errors:?}");
        let told = write(&path, &wrong, &sum(DEMO)).unwrap_err();
        assert!(
            told.message.text.contains("machine.toml:") && told.data.is_some(),
            "{}",
            told.message
        );
        let changed = format!("{DEMO}\n# another one\n");
        assert!(
            write(&path, &changed, &sum("x"))
                .unwrap_err()
                .message
                .text
                .contains("meanwhile")
        );
        assert_eq!(std::fs::read_to_string(&path).unwrap(), DEMO);

        let told = write(&path, &changed, &sum(DEMO)).unwrap();
        assert_eq!(told.sha256, sum(&changed));
        assert_eq!(std::fs::read_to_string(&path).unwrap(), changed);
        let before = std::fs::read_to_string(told.before).unwrap();
        assert_eq!(before, DEMO);
        std::fs::write(&path, "#".repeat(FILE_MAX + 1)).unwrap();
        assert!(read(&path).unwrap_err().message.text.contains("at the PC"));
    }
}
