//! What the operator does while a program runs, from a file: overrides, holds, the way back, single block, a stop.
//!
//! In:  a text, an order a line; every cycle that is run.
//! Out: shares of the planned speed for the interpolation, settings for the planner; what was done when.
//!
//! ```text
//! # an order a line, each once the one before it is done
//! at 2.5 s feed 50          # seconds after the start of the program, holds included
//! at line 120 hold          # once the machine is on the line, or has passed it
//! after 3 s resume          # seconds behind the order before
//! at rest reverse 50        # once nothing moves
//! spindle 80                # at once
//! ```
//!
//! Orders are those of the control, and are carried out by the same code: `rt::overrides` says who does what. A control takes an
//! order some milliseconds later, as its clients and threads come to it; here it is the next cycle.

use motion::plan::PlannerKind;
use motion::rt::{Interpolator, Sample, Shares};
use rt::overrides::{Overridden, Overrides};
use rt::shared::{RtStatus, Snapshot};
use serde::Serialize;
use std::fmt;
use std::sync::Arc;

/// Longest run with a script, s: a day.
const TIME_MAX_S: f64 = 86_400.0;
/// Orders of a script.
const ORDERS_MAX: usize = 10_000;
/// A machine on which nothing has changed for so long waits for an order, s: longer than a spindle takes.
const PATIENCE_S: f64 = 1.0;

/// Cycles without motion that are a rest: where motion turns back, there is one.
const RESTS: u32 = 2;
/// Times that are the same but for rounding, s.
const SAME_S: f64 = 1e-9;

/// A script that cannot be read: its line, and why.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ScriptError {
    pub(super) line: u32,
    pub(super) rule: String,
}

/// When an order is given.
#[derive(Clone, Copy, Debug, PartialEq)]
enum When {
    /// With the one before.
    AtOnce,
    /// After the start of the program, s.
    Time(f64),
    /// After the one before, s.
    After(f64),
    Line(u32),
    Rest,
}

/// What is ordered.
#[derive(Clone, Copy, Debug, PartialEq)]
enum What {
    Override(Overridden, f64),
    Hold,
    Resume,
    /// Share of the speed.
    Reverse(f64),
    SingleBlock(bool),
    Stop,
}

#[derive(Clone, Debug, PartialEq)]
struct Order {
    /// Of the script.
    line: u32,
    text: String,
    when: When,
    what: What,
}

/// A script.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Script {
    orders: Vec<Order>,
}

impl Script {
    /// Reads a script for a machine with this planner.
    pub(super) fn parse(text: &[u8], planner: PlannerKind) -> Result<Script, ScriptError> {
        let overrides = Overrides::new(planner);
        let mut orders: Vec<Order> = Vec::new();
        let mut latest_s = 0.0;
        for (line, octets) in (1_u32..).zip(text.split(|octet| *octet == b'\n')) {
            let failed = |rule: String| ScriptError { line, rule };
            let text = std::str::from_utf8(octets).map_err(|_| failed("expected UTF-8".into()))?;
            let text = text.split('#').next().unwrap_or_default().trim();
            let words: Vec<&str> = text.split_whitespace().collect();
            if words.is_empty() {
                continue;
            }
            if orders.len() == ORDERS_MAX {
                return Err(failed(format!("expected {ORDERS_MAX} orders at the most")));
            }
            if orders.last().is_some_and(|last| last.what == What::Stop) {
                return Err(failed("nothing comes behind stop, which ends the program".into()));
            }
            let (when, rest) = when(&words).map_err(failed)?;
            let what = what(rest).map_err(failed)?;
            if let What::Override(of, percent) = what {
                overrides.check(of, percent).map_err(failed)?;
            }
            match when {
                When::Time(time_s) if time_s < latest_s => {
                    return Err(failed(format!(
                        "{time_s} s are over: the orders before it end {latest_s} s after the start at the earliest"
                    )));
                }
                When::Time(time_s) => latest_s = time_s,
                When::After(time_s) => latest_s += time_s,
                When::AtOnce | When::Line(_) | When::Rest => {}
            }
            if latest_s > TIME_MAX_S {
                return Err(failed(format!("expected {TIME_MAX_S} s after the start at the most")));
            }
            orders.push(Order {
                line,
                text: rest.join(" "),
                when,
                what,
            });
        }
        Ok(Script { orders })
    }
}

fn when<'w>(words: &'w [&'w str]) -> Result<(When, &'w [&'w str]), String> {
    let seconds = |word: &str| match word.parse::<f64>() {
        Ok(time_s) if time_s >= 0.0 && time_s.is_finite() => Ok(time_s),
        _ => Err(format!("\"{word}\": expected seconds, 0 or more")),
    };
    match words {
        ["at", "rest", rest @ ..] => Ok((When::Rest, rest)),
        ["at", "line", line, rest @ ..] => match line.parse::<u32>() {
            Ok(line) if line > 0 => Ok((When::Line(line), rest)),
            _ => Err(format!("\"{line}\": expected the number of a line, from 1 on")),
        },
        ["at", time, "s", rest @ ..] => Ok((When::Time(seconds(time)?), rest)),
        ["after", time, "s", rest @ ..] => Ok((When::After(seconds(time)?), rest)),
        ["at" | "after", ..] => {
            Err("expected \"at 2.5 s\", \"at line 120\", \"at rest\" or \"after 2.5 s\" before the order".into())
        }
        rest => Ok((When::AtOnce, rest)),
    }
}

fn what(words: &[&str]) -> Result<What, String> {
    let percent = |word: &str| match word.trim_end_matches('%').parse::<f64>() {
        Ok(percent) if percent.is_finite() => Ok(percent),
        _ => Err(format!("\"{word}\": expected percent")),
    };
    let words = match words {
        [rest @ .., "%"] => rest,
        all => all,
    };
    Ok(match words {
        ["hold"] => What::Hold,
        ["resume"] => What::Resume,
        ["stop"] => What::Stop,
        ["reverse"] => What::Reverse(1.0),
        ["reverse", share] => match percent(share)? {
            share if share > 0.0 && share <= 100.0 => What::Reverse(share / 100.0),
            share => return Err(format!("reverse {share} %: expected above 0, to 100 %")),
        },
        ["single-block", "on"] => What::SingleBlock(true),
        ["single-block", "off"] => What::SingleBlock(false),
        [name, share] if Overridden::ALL.iter().any(|of| of.name() == *name) => {
            let of = Overridden::ALL.into_iter().find(|of| of.name() == *name);
            What::Override(of.unwrap_or(Overridden::Feed), percent(share)?)
        }
        all => {
            return Err(format!(
                "\"{}\": expected feed, rapid or spindle with percent, hold, resume, reverse, single-block on or off, stop",
                all.join(" ")
            ));
        }
    })
}

/// An order that was given.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Done {
    /// Of the script.
    pub(super) script_line: u32,
    pub(super) order: String,
    /// After the start of the program, and the line on which the machine was.
    pub(super) time_s: f64,
    pub(super) line: u32,
    /// When nothing moved for the first time behind it, if that came before the next order.
    pub(super) rest_s: Option<f64>,
}

/// What came of a script.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(super) struct ScriptReport {
    pub(super) orders: Vec<Done>,
    /// `finished`; `stopped`; `held`: nothing would have moved any more; `too long`.
    pub(super) end: &'static str,
    /// From the start of the program to its end.
    pub(super) time_s: f64,
    /// Orders that never came, with their lines in the script.
    pub(super) left_out: Vec<(u32, String)>,
    /// At rest on the path, held.
    pub(super) held_s: f64,
}

impl fmt::Display for ScriptReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for done in &self.orders {
            write!(
                f,
                "script          {:.3} s, line {}: {}",
                done.time_s, done.line, done.order
            )?;
            match done.rest_s {
                Some(rest_s) => writeln!(f, "; at rest {:.3} s later", rest_s - done.time_s)?,
                None => writeln!(f)?,
            }
        }
        let ScriptReport {
            end, time_s, held_s, ..
        } = self;
        writeln!(f, "with the script {end} after {time_s:.3} s, {held_s:.3} s of it held")
    }
}

/// The operator, as the script has him.
pub(super) struct Operator {
    script: Script,
    next: usize,
    live: Arc<RtStatus>,
    cycle_s: f64,
    hold: bool,
    stopping: bool,
    reverse: Option<f64>,
    /// When the last order was given, s.
    given_s: f64,
    /// Whether it was one to come to rest.
    is_to_rest: bool,
    /// Cycles at rest up to now.
    rested: u32,
    /// Line of the cycle before.
    line: u32,
    /// What would change if anything did, and since when it has not.
    still: Option<([u64; 3], f64)>,
    /// The farthest that plan time has come, s.
    farthest_s: f64,
    report: ScriptReport,
}

/// How a cycle is meant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Manner {
    /// Share of the programmed feed; 0: held.
    pub(super) feed: f64,
    /// On the way back, or forward again on what has been run.
    pub(super) again: bool,
    /// Whether stop limits hold.
    pub(super) scaling: bool,
}

impl Manner {
    /// As programmed.
    pub(super) const PLAIN: Manner = Manner {
        feed: 1.0,
        again: false,
        scaling: false,
    };
}

impl Operator {
    pub(super) fn new(script: Script, planner: PlannerKind, cycle_s: f64) -> Operator {
        Operator {
            script,
            next: 0,
            live: Arc::new(RtStatus::new(Overrides::new(planner))),
            cycle_s,
            hold: false,
            stopping: false,
            reverse: None,
            given_s: 0.0,
            is_to_rest: false,
            rested: 0,
            line: 0,
            still: None,
            farthest_s: 0.0,
            report: ScriptReport {
                end: "finished",
                ..ScriptReport::default()
            },
        }
    }

    /// Where the planner looks for overrides.
    pub(super) fn live(&self) -> Arc<RtStatus> {
        Arc::clone(&self.live)
    }

    /// Gives the orders whose time has come; `last` is what the cycle before came to.
    pub(super) fn act(&mut self, number: u64, last: &Sample, interpolator: &mut Interpolator) {
        let now_s = number as f64 * self.cycle_s;
        while let Some(order) = self.script.orders.get(self.next) {
            let due = match order.when {
                When::AtOnce => true,
                When::Time(time_s) => self.reaches(now_s, time_s),
                When::After(time_s) => self.reaches(now_s, self.given_s + time_s),
                When::Line(line) => last.line == line || (self.line < line && line < last.line),
                When::Rest => last.line > 0 && self.rested >= RESTS,
            };
            if !due {
                break;
            }
            let order = order.clone();
            self.next += 1;
            self.rested = 0;
            self.given_s = now_s;
            self.still = None;
            self.is_to_rest = matches!(
                order.what,
                What::Hold | What::Reverse(_) | What::SingleBlock(true) | What::Stop | What::Override(_, 0.0)
            );
            self.give(&order, interpolator);
            self.report.orders.push(Done {
                script_line: order.line,
                order: order.text,
                time_s: now_s,
                line: last.line,
                rest_s: None,
            });
        }
        self.line = last.line;
    }

    fn reaches(&self, now_s: f64, time_s: f64) -> bool {
        now_s > time_s - self.cycle_s / 2.0
    }

    fn give(&mut self, order: &Order, interpolator: &mut Interpolator) {
        match order.what {
            // Its range was looked at when the script was read.
            What::Override(of, percent) => self.live.overrides.set_percent(of, percent),
            What::Hold => self.hold = true,
            What::Resume => self.run_along(None, interpolator),
            What::Reverse(share) => self.run_along(Some(share), interpolator),
            What::SingleBlock(on) => {
                interpolator.set_single_block(on);
                self.live.show(&Snapshot {
                    single_block: on,
                    ..self.live.snapshot()
                });
            }
            What::Stop => self.stopping = true,
        }
    }

    fn run_along(&mut self, reverse: Option<f64>, interpolator: &mut Interpolator) {
        self.hold = false;
        self.reverse = reverse;
        interpolator.next_block();
    }

    /// For the next cycle.
    pub(super) fn shares(&self) -> Shares {
        if self.hold || self.stopping {
            return Shares::all(0.0);
        }
        let [feed, rapid] = self.live.overrides.of_time();
        Shares {
            all: self.reverse.map_or(1.0, |share| -share),
            feed,
            rapid,
            ..Shares::FULL
        }
    }

    /// Factor on the programmed speed of the spindle.
    pub(super) fn spindle(&self, sample: &Sample) -> f64 {
        if sample.enables.spindle_override {
            self.live.overrides.share(Overridden::Spindle)
        } else {
            1.0
        }
    }

    /// So many cycles need not be run before the next order, where nothing else forbids it.
    pub(super) fn may_skip(&self, number: u64) -> u64 {
        let due_s = match self.script.orders.get(self.next).map(|order| order.when) {
            None => return u64::MAX,
            Some(When::Time(time_s)) => time_s,
            Some(When::After(time_s)) => self.given_s + time_s,
            // An element has one line, and what is skipped of it moves.
            Some(When::Line(_)) => return u64::MAX,
            Some(When::AtOnce | When::Rest) => return 0,
        };
        ((due_s / self.cycle_s) as u64).saturating_sub(number + 1)
    }

    /// A cycle was run. `false`: the run is over, though the program may be not.
    pub(super) fn see(&mut self, number: u64, sample: &Sample, interpolator: &Interpolator) -> (Manner, bool) {
        self.hold |= interpolator.is_block_over() || interpolator.is_way_back_over();
        let now_s = number as f64 * self.cycle_s;
        let rests = sample.velocity_mm_s == 0.0 && interpolator.is_at_rest();
        let shares = self.shares();
        self.rested = if rests { self.rested + 1 } else { 0 };
        if self.rested == RESTS
            && self.is_to_rest
            && let Some(last) = self.report.orders.last_mut()
        {
            last.rest_s.get_or_insert(now_s - f64::from(RESTS - 1) * self.cycle_s);
        }
        let passed_s = interpolator.passed_s();
        let again = passed_s < self.farthest_s - SAME_S;
        self.farthest_s = self.farthest_s.max(passed_s);
        if rests && shares.hold(sample.enables) {
            self.report.held_s += self.cycle_s;
        }
        let pace = self.live.overrides.share(Overridden::Feed);
        let manner = Manner {
            feed: match shares.all {
                all if all <= 0.0 => 0.0,
                _ if sample.enables.feed_override => pace,
                _ => 1.0,
            },
            again,
            scaling: interpolator.is_scaling(),
        };
        let goes_on = if self.stopping && rests {
            self.report.end = "stopped";
            false
        } else if now_s > TIME_MAX_S {
            self.report.end = "too long";
            false
        } else if self.is_stuck(now_s, rests, sample, interpolator) {
            self.report.end = "held";
            false
        } else {
            true
        };
        (manner, goes_on)
    }

    /// Whether nothing will change any more.
    fn is_stuck(&mut self, now_s: f64, rests: bool, sample: &Sample, interpolator: &Interpolator) -> bool {
        let now = [
            interpolator.passed_s().to_bits(),
            u64::from(sample.line),
            sample.state as u64,
        ];
        match self.still {
            Some((before, since_s)) if rests && before == now => {
                let waits = self.script.orders.get(self.next).map(|order| order.when);
                let comes = matches!(waits, Some(When::Time(_) | When::After(_)));
                now_s - since_s > PATIENCE_S && !comes
            }
            _ => {
                self.still = Some((now, now_s));
                false
            }
        }
    }

    /// Whether nothing changes before the next order.
    pub(super) fn is_still(&self, now_s: f64) -> bool {
        self.still.is_some_and(|(_, since_s)| now_s - since_s > PATIENCE_S)
    }

    /// So many cycles at rest were not run.
    pub(super) fn skip_rest(&mut self, cycles: u64) {
        self.report.held_s += cycles as f64 * self.cycle_s;
    }

    /// The run is over, after so many cycles.
    pub(super) fn finish(mut self, cycles: u64) -> ScriptReport {
        let left = self.script.orders.drain(self.next..);
        self.report.left_out = left.map(|order| (order.line, order.text)).collect();
        self.report.time_s = cycles as f64 * self.cycle_s;
        self.report
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Report;
    use crate::run_down::{Wanted, Work, run_down};
    use config::{self, Config};
    use machine::tables::Tables;
    use proptest::prelude::*;
    use std::path::Path;

    const BOTH: [PlannerKind; 2] = [PlannerKind::Optimal, PlannerKind::Classic];
    const PART: &str =
        "G21 G90 G94 G64 P0.02\nG0 X0 Y0 Z0\nG1 X100 F3000\nY60\nG2 X80 Y80 I-20\nG1 X0\nG4 P0.2\nG0 Y0\nM2\n";

    fn machine(planner: PlannerKind) -> Config {
        let text = include_str!("../../../configs/mill3-demo.toml");
        let mut config = config::parse(text, Path::new("demo.toml")).unwrap();
        config.program.planner = planner;
        config
    }

    fn run(planner: PlannerKind, program: &str, script: &str, samples: bool) -> Work {
        let config = machine(planner);
        let wanted = Wanted {
            samples,
            script: Some(Script::parse(script.as_bytes(), planner).unwrap()),
            ..Wanted::default()
        };
        let tables = Tables::read(&config).unwrap();
        let work = run_down(&config, &tables, ("part.ngc", program.into()), Some(1), wanted).unwrap();
        // Whatever was ordered: within the limits, on the path.
        assert_eq!(Report::new(&config, &work).wrong(), [], "{planner:?} {script}");
        let found = work.judged.deviation;
        assert!(found.off_mm <= 0.02 + 1e-9, "{planner:?} {script}: {found:?}");
        work
    }

    fn report(work: &Work) -> &ScriptReport {
        work.script.as_ref().expect("a script")
    }

    #[test]
    fn a_hold_rests_on_the_path_and_goes_on() {
        for planner in BOTH {
            let plain = run(planner, PART, "", false);
            let held = run(
                planner,
                PART,
                "at 1 s hold\nafter 3 s resume\nat line 6 hold\nat rest resume\n",
                true,
            );
            let report = report(&held);
            assert_eq!(
                (report.end, report.left_out.len(), report.orders.len()),
                ("finished", 0, 4)
            );
            let [hold, resume, second, again] = &report.orders[..] else {
                panic!()
            };
            assert_eq!((hold.time_s, resume.time_s, second.line), (1.0, 4.0, 6));
            let behind_s = again.time_s - second.rest_s.unwrap();
            assert!((behind_s - 2e-3).abs() < 1e-9, "{report:#?}");
            let rest_s = hold.rest_s.expect("it rests") - hold.time_s;
            assert!(rest_s > 0.02 && rest_s < 1.0, "{rest_s}");
            // From rest to the order nothing moves.
            let samples = held.judged.samples.as_ref().unwrap();
            let rows: Vec<&str> = samples
                .lines()
                .skip(1)
                .map(|row| row.split_once(',').unwrap().1)
                .collect();
            let rests = &rows[(hold.rest_s.unwrap() * 1000.0) as usize + 1..4000];
            assert!(rests.windows(2).all(|pair| pair[0] == pair[1]) && rows[999] != rows[1001]);
            assert!(
                report.held_s > 2.0 && held.judged.cycles as f64 > plain.judged.cycles as f64 + 2000.0,
                "{report:#?}"
            );
            let length = held.judged.deviation.length_mm - held.judged.deviation.reached_mm;
            assert!(length < 1e-3, "{:?}", held.judged.deviation);
        }
    }

    #[test]
    fn overrides_act_as_on_the_machine() {
        for planner in BOTH {
            let plain = run(planner, PART, "", false);
            let slow = run(planner, PART, "feed 50\nrapid 25\nspindle 80\n", false);
            let times = |work: &Work| {
                let tool = &work.judged.times.tools[0].times;
                (tool.cutting_s, tool.rapid_s, tool.dwell_s)
            };
            let (plain, slow) = (times(&plain), times(&slow));
            assert!(
                slow.0 / plain.0 > 1.7 && slow.0 / plain.0 < 2.1,
                "{planner:?} {plain:?} {slow:?}"
            );
            assert!(slow.1 / plain.1 > 1.5, "{planner:?} {plain:?} {slow:?}");
            assert!((slow.2 - 0.2).abs() < 0.01, "{slow:?}");
            // Nothing at feed until it is turned up again.
            let none = run(planner, PART, "at 1 s feed 0\nafter 5 s feed 100\n", false);
            let report = report(&none);
            assert_eq!(report.end, "finished");
            assert!(report.orders[0].rest_s.is_some() && report.time_s > 8.0, "{report:#?}");
        }
    }

    #[test]
    fn the_way_back_ends_where_it_began_and_the_path_is_judged_once() {
        for planner in BOTH {
            let work = run(
                planner,
                PART,
                "at line 5 reverse 50\nat rest hold\nafter 1 s resume\n",
                false,
            );
            let report = report(&work);
            assert_eq!(report.end, "finished");
            assert!(report.orders[1].line <= 3, "{report:#?}");
            let found = work.judged.deviation;
            assert!(
                found.length_mm - found.reached_mm < 1e-3 && found.missed_mm < 0.021,
                "{found:?}"
            );
        }
    }

    #[test]
    fn a_run_from_which_nothing_comes_any_more_ends() {
        for planner in BOTH {
            for (script, end, left) in [
                ("at 1 s hold\nat line 6 resume\n", "held", 1),
                ("at 1 s feed 0\n", "held", 0),
                ("single-block on\n", "held", 0),
                ("at line 4 reverse\n", "held", 0),
                ("at 1 s stop\n", "stopped", 0),
                ("at line 99 hold\n", "finished", 1),
            ] {
                let work = run(planner, PART, script, false);
                let report = report(&work);
                assert_eq!((report.end, report.left_out.len()), (end, left), "{planner:?} {script}");
            }
            // Hours at rest are not run, and those of motion take no day.
            let work = run(planner, PART, "at 1 s hold\nat 80000 s resume\n", false);
            assert_eq!(report(&work).end, "finished");
            assert!(
                report(&work).held_s > 79_000.0 && work.judged.cycles_judged < 100_000,
                "{}",
                work.judged.cycles_judged
            );
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(12))]
        /// Whatever is ordered whenever: `run` looks at limits and path.
        #[test]
        fn limits_and_path_are_kept_whatever_the_script(
            orders in prop::collection::vec((0.0..1.5_f64, 0..7_u32, 1.0..100.0_f64), 1..12),
        ) {
            let script: String = orders
                .iter()
                .map(|(after_s, what, percent)| {
                    let what = match what {
                        0 => "hold".to_owned(),
                        1 => format!("feed {percent:.1}"),
                        2 => format!("rapid {percent:.1}"),
                        3 => format!("reverse {percent:.1}"),
                        4 => "single-block on".to_owned(),
                        5 => "single-block off".to_owned(),
                        _ => "feed 0".to_owned(),
                    };
                    format!("after {after_s:.3} s {what}\nafter 0.3 s resume\n")
                })
                .collect();
            for planner in BOTH {
                run(planner, PART, &(script.clone() + "after 1 s single-block off\nfeed 100\nrapid 100\nresume\n"), false);
            }
        }
    }

    fn error(text: &str) -> (u32, String) {
        let error = Script::parse(text.as_bytes(), PlannerKind::Classic).expect_err(text);
        (error.line, error.rule)
    }

    #[test]
    fn scripts_are_read_and_their_errors_located() {
        let text = "# a script\n\nat 2.5 s feed 50\nat line 120 hold # here\r\nafter 3 s resume\nat rest reverse 50 %\nspindle 80%\n\
                    single-block on\nrapid 25\nstop\n";
        let script = Script::parse(text.as_bytes(), PlannerKind::Optimal).unwrap();
        let orders: Vec<_> = script
            .orders
            .iter()
            .map(|order| (order.line, order.when, order.what))
            .collect();
        assert_eq!(
            orders,
            [
                (3, When::Time(2.5), What::Override(Overridden::Feed, 50.0)),
                (4, When::Line(120), What::Hold),
                (5, When::After(3.0), What::Resume),
                (6, When::Rest, What::Reverse(0.5)),
                (7, When::AtOnce, What::Override(Overridden::Spindle, 80.0)),
                (8, When::AtOnce, What::SingleBlock(true)),
                (9, When::AtOnce, What::Override(Overridden::Rapid, 25.0)),
                (10, When::AtOnce, What::Stop),
            ]
        );
        assert_eq!(Script::parse(b"", PlannerKind::Optimal), Ok(Script::default()));
        for (text, line, words) in [
            ("hold\nat 5 feed 50", 2, "expected \"at 2.5 s\""),
            ("at 5 s", 1, "expected feed, rapid or spindle"),
            ("feed", 1, "expected feed, rapid or spindle"),
            ("feed 50 60", 1, "expected feed, rapid or spindle"),
            ("feed 1e400", 1, "expected percent"),
            ("feed 110", 1, "without effect with planner = \"classic\""),
            ("spindle 10", 1, "expected 50 to 120 %"),
            ("reverse 0", 1, "expected above 0"),
            ("at -1 s hold", 1, "expected seconds"),
            ("at nan s hold", 1, "expected seconds"),
            ("at line 0 hold", 1, "expected the number of a line"),
            ("at 1e9 s hold", 1, "expected 86400 s"),
            ("at 5 s hold\nafter 2 s resume\nat 6 s hold", 3, "6 s are over"),
            ("stop\nresume", 2, "nothing comes behind stop"),
        ] {
            let (at, rule) = error(text);
            assert_eq!(at, line, "{text}: {rule}");
            assert!(rule.contains(words), "{text}: {rule}");
        }
        assert_eq!(error(&"hold\nresume\n".repeat(6000)).0 as usize, ORDERS_MAX + 1);
        assert!(Script::parse(&[0xff, b'\n'], PlannerKind::Optimal).is_err());
    }
}
