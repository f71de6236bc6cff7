//! A whole measurement: round after round the control with its program, then the floor of the PC.
//!
//! In:  [`Wanted`]. Out: [`JitterReport`].
//!
//! Each round is a session of its own from power-on to power-off, so that while the floor is measured nothing of ours is on
//! the core: no cycle, no time-out thread, nothing that keeps it awake, no simulated machine.

use super::bar::Bar;
use super::distribution::Distribution;
use super::floor;
use super::pc::{Facts, utc_now};
use super::processes::{FarAnalyser, FarMachine};
use super::ratios::{good_medians, judge, medians, merged, per_10000};
use super::report::{ControlFigures, Ended, JitterReport, Medians, Merged, Round, Settings};
use super::window::Window;
use anyhow::bail;
use config::{Config, ProtocolWords, Rt};
use host::signals::StopSignal;
use machine::sequence::Outcome;
use machine::tables::Tables;
use operator::session;
use operator::session::{Program, Session, Task, Wire};
use rt::phase::sync0_us;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Mutex;
use std::time::Instant;

/// The floor is measured as long as the program ran, but each probe no longer than this, s.
const PROBE_S_MAX: u64 = 20;
/// Boot of the network, homing and the way back take about this long, s; for the bar only.
const AROUND_S: f64 = 5.0;
/// Why a program did not run.
const SIGNAL: &str = "a signal came before";
/// How often a round is begun whose program never runs.
const TRIES: u32 = 3;
/// Probes of a floor.
const PROBES: u64 = 3;

/// What is to be measured.
pub struct Wanted<'a> {
    pub config: &'a Config,
    /// The program that runs meanwhile, again and again.
    pub program: Program<'a>,
    /// Cycles in all.
    pub cycles: u64,
    /// Parts into which they are divided.
    pub rounds: u32,
    pub far_end: FarEnd<'a>,
    /// Cuts the measurement; what was measured is kept.
    pub signal: StopSignal,
    /// Measure the floor of the PC after each round.
    pub floor: bool,
    pub quiet: bool,
}

/// Who is at the other end of the wire.
#[derive(Clone, Copy, Debug)]
pub enum FarEnd<'a> {
    /// The simulated machine of this file in a process of its own, and an analyser in another one.
    Private {
        machine: &'a Path,
        /// Our end of the private wire, and theirs.
        wire: [&'a str; 2],
    },
    /// The nodes of the machine on a network of their own.
    Network { interface: &'a str },
}

impl FarEnd<'_> {
    fn interface(&self) -> &str {
        match self {
            FarEnd::Private { wire, .. } => wire[0],
            FarEnd::Network { interface } => interface,
        }
    }

    fn words(&self, protocol: ProtocolWords) -> String {
        match self {
            FarEnd::Private { .. } => format!(
                "simulated {} in a process of their own; {} stamped by the kernel where it arrives, read by an analyser in a third \
                 process",
                protocol.nodes, protocol.cycle_start
            ),
            FarEnd::Network { .. } => {
                "nodes on the network; the SoC period is that of the control's own clock: measure at the \
                                       far end with 'isocnc jitter --listen' on another PC"
                    .into()
            }
        }
    }
}

/// Measures. Whatever was measured by the time that something went wrong is kept, with a note.
///
/// # Errors
/// Nothing could be measured.
pub fn run(wanted: &Wanted<'_>) -> anyhow::Result<JitterReport> {
    let cycles = wanted.cycles;
    // The first round finds the timing, the others keep it but for the spin, which depends on what else the PC does.
    let mut config = wanted.config.clone();
    if cycles == 0 {
        bail!("0 cycles: expected 1 or more");
    }
    let rounds = u64::from(wanted.rounds.max(1)).min(cycles);
    let mut report = empty_report(wanted, rounds as u32);
    let planned_s: f64 = (0..rounds)
        .map(|round| plan(&config, share(cycles, rounds, round)).iter().sum::<f64>())
        .sum();
    let mut bar = Bar::new(wanted.quiet, planned_s);
    for number in 0..rounds {
        let round = Measured {
            wanted,
            number: number as u32 + 1,
            rounds: rounds as u32,
            cycles: share(cycles, rounds, number),
        };
        let round = round.run_with_tries(&mut config, &mut bar, &mut report);
        match round {
            Ok(round) => {
                bar.say(&one_line(&round, rounds));
                report.rounds.push(round);
            }
            Err(error) if report.rounds.is_empty() => return Err(error),
            Err(error) => {
                report.result = match wanted.signal.caught() {
                    Some(_) => Ended::Cut,
                    None => Ended::Faulted,
                };
                report.notes.push(format!("round {}: {error:#}", number + 1));
                break;
            }
        }
        if wanted.signal.caught().is_some() {
            report.result = Ended::Cut;
            break;
        }
    }
    report.medians = medians(report.rounds.iter());
    report.medians_good_rounds = good_medians(&report.rounds);
    report.all = merged(&report.rounds);
    Ok(report)
}

fn empty_report(wanted: &Wanted<'_>, rounds: u32) -> JitterReport {
    let Wanted { config, .. } = wanted;
    JitterReport {
        version: env!("CARGO_PKG_VERSION").into(),
        result: Ended::Completed,
        notes: Vec::new(),
        pc: Facts::below("/").pc(0, Vec::new()),
        settings: Settings {
            machine: config.name.clone(),
            program: wanted.program.name.into(),
            interface: wanted.far_end.interface().into(),
            protocol: config.bus.kind.protocol().name().into(),
            far_end: wanted.far_end.words(config.bus.kind.protocol().words()),
            cycles: wanted.cycles,
            rounds,
            cycle_us: config.cycle_us,
            timeout_us: config.rt.timeout_us,
            priority: config.rt.priority,
            phase_us: config.rt.phase_us(config.cycle_us),
            sync0_us: sync0_us(config),
            spin_us: config.rt.spin_us(),
            keep_awake: String::new(),
            calibration: Vec::new(),
        },
        rounds: Vec::new(),
        medians: Medians::default(),
        medians_good_rounds: None,
        all: Merged::default(),
    }
}

/// Cycles of round `round` (from 0) if all are divided evenly.
fn share(cycles: u64, rounds: u64, round: u64) -> u64 {
    cycles / rounds + u64::from(round < cycles % rounds)
}

/// Time of the program, s.
fn program_s(config: &Config, cycles: u64) -> f64 {
    cycles as f64 * f64::from(config.cycle_us) * 1e-6
}

/// Time of each probe of the floor, s.
fn probe_s(config: &Config, cycles: u64) -> u64 {
    (program_s(config, cycles).ceil() as u64).clamp(1, PROBE_S_MAX)
}

/// Time of a round's parts by plan, s: boot and homing, program, floor.
fn plan(config: &Config, cycles: u64) -> [f64; 3] {
    let floor_s = PROBES * probe_s(config, cycles);
    [AROUND_S, program_s(config, cycles), floor_s as f64]
}

/// A round under way.
struct Measured<'a> {
    wanted: &'a Wanted<'a>,
    number: u32,
    rounds: u32,
    cycles: u64,
}

/// The machine did not come as far as the program; on a busy PC it may the next time.
#[derive(Debug, thiserror::Error)]
#[error("the program did not run: {0}")]
struct NotRun(String);

impl Measured<'_> {
    fn run_with_tries(&self, config: &mut Config, bar: &mut Bar, report: &mut JitterReport) -> anyhow::Result<Round> {
        let mut left = TRIES;
        loop {
            left -= 1;
            match self.run(config, bar, report) {
                Err(error) if left > 0 && error.is::<NotRun>() && self.wanted.signal.caught().is_none() => {
                    let note = format!("round {} was begun again: {error}", self.number);
                    bar.say(&note);
                    report.notes.push(note);
                }
                ended => return ended,
            }
        }
    }

    fn run(&self, config: &mut Config, bar: &mut Bar, report: &mut JitterReport) -> anyhow::Result<Round> {
        let mut round = Round {
            number: self.number,
            began: utc_now(),
            ..Round::default()
        };
        let [around_s, program_s, floor_s] = plan(config, self.cycles);
        let name = |part: &str| format!("round {} of {}: {part}", self.number, self.rounds);
        let core = {
            // The first round warns of what the PC lacks and tells its timing, and must have the lines for itself.
            if self.number > 1 {
                bar.show(&name("network, homing"), 0.0);
            }
            let running = name("program");
            let mut progress = |cycles: u64| {
                let share = cycles as f64 / self.cycles as f64;
                bar.show(&running, around_s + program_s * share.min(1.0));
            };
            self.program(config, &mut round, report, &mut progress)?
        };
        bar.part_over(around_s + program_s);
        if self.wanted.floor && self.wanted.signal.caught().is_none() {
            let load = Facts::below("/").watch();
            let began = Instant::now();
            let measuring = name("floor of the PC");
            let floor_plan = floor::Plan {
                core,
                cycle_us: config.cycle_us,
                seconds: probe_s(config, self.cycles),
            };
            round.floor = floor_plan.measure(&mut || {
                bar.show(&measuring, began.elapsed().as_secs_f64().min(floor_s));
                match self.wanted.signal.caught() {
                    Some(_) => ControlFlow::Break(()),
                    None => ControlFlow::Continue(()),
                }
            });
            round.load_at_floor = load.end(core);
        }
        bar.part_over(floor_s);
        judge(&mut round);
        Ok(round)
    }

    /// The control with its program; gives the core of its real-time threads.
    fn program(
        &self,
        config: &mut Config,
        round: &mut Round,
        report: &mut JitterReport,
        progress: &mut dyn FnMut(u64),
    ) -> anyhow::Result<usize> {
        let Wanted {
            program,
            far_end,
            ref signal,
            quiet,
            ..
        } = *self.wanted;
        if signal.caught().is_some() {
            return Err(NotRun(SIGNAL.into()).into());
        }
        let (_machine, analyser) = match far_end {
            FarEnd::Private { machine, wire } => (
                Some(FarMachine::start(machine, config.cycle_us, wire[1])?),
                Some(FarAnalyser::start(wire[1], config.cycle_us)?),
            ),
            FarEnd::Network { .. } => (None, None),
        };
        let tables = Mutex::new(Tables::read(config)?);
        let session = Session {
            config,
            tables: &tables,
            task: Task::Repeat(program),
            quiet: quiet || self.number > 1,
            signal: signal.clone(),
            keep_rights: true,
            services: Vec::new(),
        };
        let mut window = Window::new(self.cycles, analyser, signal.clone(), progress);
        let wire = Wire::Interface(far_end.interface().to_owned());
        let ended = session::run(&session, wire, &mut window)?;

        let findings = ended.findings.iter().map(ToString::to_string).collect();
        report.pc = Facts::below("/").pc(ended.cpu, findings);
        let settings = &mut report.settings;
        settings.keep_awake = ended.kept_awake.name().into();
        settings.phase_us = ended.calibration.phase_us.value;
        settings.spin_us = ended.calibration.applied(&config.rt).spin_us();
        if self.number == 1 {
            settings.calibration = ended.calibration.to_string().lines().map(str::to_owned).collect();
            config.rt = Rt {
                spin_us: config.rt.spin_us,
                ..ended.calibration.applied(&config.rt)
            };
        }
        if let Some(raised_us) = ended.calibration.spin_raised_us {
            let round = self.number;
            report.notes.push(format!(
                "round {round}: the spin was raised to {raised_us} µs: wake-ups came later than at the start"
            ));
        }
        if !window.was_open() {
            let cause = match (ended.operator.alarms().first(), ended.operator.outcome()) {
                (Some(alarm), _) => alarm.cause.text.clone(),
                (None, _) if signal.caught().is_some() => SIGNAL.into(),
                (None, Some(Outcome::TimedOut(step))) => format!("{} took too long", step.code(true)),
                (None, Some(Outcome::Completed | Outcome::Stopped | Outcome::Faulted) | None) => {
                    "the machine stopped before".into()
                }
            };
            return Err(NotRun(cause).into());
        }
        round.load_with_program = window.load;
        // Where the control stopped by itself so early that no window could be cut, all from the beginning on is it.
        let figures = window.figures.unwrap_or(ended.figures);
        if figures.cycles == 0 && signal.caught().is_some() {
            return Err(NotRun(SIGNAL.into()).into());
        }
        let heard = match (window.error, window.analyser) {
            (Some(error), _) => Err(error),
            (None, Some(analyser)) => analyser.report().map(Some),
            (None, None) => Ok(None),
        };
        // What the control itself has measured is kept without it.
        round.soc_period = heard.unwrap_or_else(|error| {
            report.result = Ended::Faulted;
            let note = format!("round {}: nothing from the analyser: {error:#}", self.number);
            report.notes.push(note);
            None
        });
        let faults: Vec<String> = ended
            .operator
            .alarms()
            .iter()
            .map(|alarm| alarm.cause.text.clone())
            .collect();
        round.control = ControlFigures {
            cycles: figures.cycles,
            programs: window.programs,
            overruns: figures.skipped,
            overruns_per_10000: per_10000(figures.skipped, figures.cycles),
            pres_lost: figures.pres_lost,
            faults,
            period: Distribution::from(&figures.period),
            lateness: Distribution::from(&figures.lateness),
            wake_up: figures.wake_up.summary(),
            exchange: figures.exchange.summary(),
            compute: figures.compute.summary(),
            free: figures.free.summary(),
            phase: figures.phase.figures(),
            thread: figures.thread,
            timeout_thread: ended.timeouts,
        };
        if let Some(fault) = round.control.faults.first() {
            report.result = Ended::Faulted;
            report
                .notes
                .push(format!("round {}: the machine stopped by itself: {fault}", self.number));
        }
        Ok(ended.cpu)
    }
}

/// A round as one line.
fn one_line(round: &Round, rounds: u64) -> String {
    let control = &round.control;
    let (n, std_us, max_us) = match &round.soc_period {
        Some(soc) => (soc.n, soc.period_std_us, soc.period_max_us),
        None => (
            control.period.figures.n,
            control.period.figures.std_us,
            control.period.figures.max_us,
        ),
    };
    let floor = round.floor.wakeup.as_ref().map_or(String::new(), |wakeup| {
        format!(
            "; wake-up std {:.2} us, longest {:.1}",
            wakeup.figures.std_us, wakeup.figures.max_us
        )
    });
    let stalls = match round.stalls.len() {
        0 => "",
        _ => "; the PC stood still",
    };
    format!(
        "round {} of {rounds}: {n} SoC periods, std {std_us:.2} us, longest {max_us:.1}, {} overruns{floor}{stalls}",
        round.number, control.overruns
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cycles_are_divided_evenly_and_none_is_lost() {
        for (cycles, rounds) in [(10, 5), (11, 5), (14, 5), (1, 1), (20_000_000, 7)] {
            let shares: Vec<u64> = (0..rounds).map(|round| share(cycles, rounds, round)).collect();
            assert_eq!(shares.iter().sum::<u64>(), cycles);
            assert!(shares.iter().max().unwrap() - shares.iter().min().unwrap() <= 1);
        }
    }
}
