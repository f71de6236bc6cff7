//! The other processes of a measurement: the simulated machine at the far end, and the analyser, which is neither of both.
//!
//! In:  this program, started again with other arguments; orders over a pipe.
//! Out: answers over another one. They end with this process, or when they are dropped.

use analyser::{SocReport, listen};
use anyhow::{Context, bail, ensure};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use std::io::{BufRead, BufReader, Write};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

/// Longest wait for a process to end by itself.
const PATIENCE: Duration = Duration::from_secs(5);

/// A process of ours whose first line says that it is ready.
struct Helper {
    name: &'static str,
    process: Child,
    orders: Option<ChildStdin>,
    answers: BufReader<ChildStdout>,
}

impl Helper {
    fn start(name: &'static str, ready: &str, configure: impl FnOnce(&mut Command)) -> anyhow::Result<Helper> {
        let mut command = Command::new("/proc/self/exe");
        configure(&mut command);
        let mut process = command
            // A signal to all processes of the terminal is for the control: this one lives on until that has stopped.
            .process_group(0)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .context(name)?;
        let (orders, answers) = (process.stdin.take(), process.stdout.take());
        let mut helper = Helper {
            name,
            process,
            orders,
            answers: BufReader::new(answers.context("no pipe")?),
        };
        let line = helper.answer()?;
        ensure!(line == ready, "the {name} says '{line}' instead of '{ready}'");
        Ok(helper)
    }

    fn order(&mut self, order: &str) -> anyhow::Result<()> {
        let orders = self.orders.as_mut().context("no pipe")?;
        writeln!(orders, "{order}")
            .and_then(|()| orders.flush())
            .with_context(|| format!("the {} has ended", self.name))
    }

    fn answer(&mut self) -> anyhow::Result<String> {
        let mut line = String::new();
        let octets = self.answers.read_line(&mut line).context(self.name)?;
        if octets == 0 {
            bail!("the {} has ended by itself", self.name);
        }
        Ok(line.trim().to_owned())
    }
}

impl Drop for Helper {
    fn drop(&mut self) {
        drop(self.orders.take());
        // Gone already or not: in the end it is, and no error changes that.
        let _ = kill(Pid::from_raw(self.process.id() as i32), Signal::SIGTERM);
        let give_up = Instant::now() + PATIENCE;
        while matches!(self.process.try_wait(), Ok(None)) {
            if Instant::now() > give_up {
                let _ = self.process.kill();
            }
            std::thread::sleep(Duration::from_millis(2));
        }
    }
}

/// The simulated machine of a machine file, at its end of the wire.
pub(super) struct FarMachine {
    _process: Helper,
}

impl FarMachine {
    pub(super) fn start(machine: &Path, cycle_us: u32, interface: &str) -> anyhow::Result<FarMachine> {
        let process = Helper::start("simulated machine", sim::READY, |command| {
            command.arg("simulate").arg(machine).args(["--interface", interface]);
            command.args(["--with-parent", &std::process::id().to_string()]);
            command.args(["--cycle-us", &cycle_us.to_string()]);
        })?;
        Ok(FarMachine { _process: process })
    }
}

/// The analyser at the far end.
pub(super) struct FarAnalyser {
    process: Helper,
}

impl FarAnalyser {
    pub(super) fn start(interface: &str, cycle_us: u32) -> anyhow::Result<FarAnalyser> {
        let process = Helper::start("analyser", listen::READY, |command| {
            command.args(["jitter", "--listen", "--orders", "--interface", interface]);
            command.args(["--period-us", &cycle_us.to_string()]);
        })?;
        Ok(FarAnalyser { process })
    }

    /// Measured is what comes from now on. Does not wait.
    pub(super) fn begin(&mut self) -> anyhow::Result<()> {
        self.process.order(listen::BEGIN)
    }

    /// Measured is what has come until now. Does not wait.
    pub(super) fn end(&mut self) -> anyhow::Result<()> {
        self.process.order(listen::END)
    }

    /// What was measured; ends it if it has not ended yet.
    pub(super) fn report(mut self) -> anyhow::Result<SocReport> {
        drop(self.process.orders.take());
        let answer = self.process.answer()?;
        serde_json::from_str(&answer).context("answer of the analyser")
    }
}
