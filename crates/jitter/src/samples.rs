//! Made-up reports for the tests of what is printed, written and drawn.

use super::Distribution;
use super::ratios::{good_medians, judge, medians, merged, per_10000};
use super::report::{
    ControlFigures, Cyclictest, Ended, Floor, Gaps, JitterReport, Load, Medians, Merged, Pc, Round, Settings,
};
use analyser::{Breaks, SocReport};
use host::histogram::{Bucket, Jitter, Summary};
use std::sync::LazyLock;

/// Values around a nominal.
pub(crate) fn distribution(nominal_ns: u64, values_ns: impl IntoIterator<Item = u64>) -> Distribution {
    let mut jitter = Jitter::new(nominal_ns);
    values_ns.into_iter().for_each(|value_ns| jitter.record(value_ns));
    Distribution::from(&jitter)
}

/// Latencies in whole µs.
pub(crate) fn cyclictest(values_us: impl IntoIterator<Item = u64>) -> Distribution {
    let mut latency = distribution(0, values_us.into_iter().map(|us| us * 1000));
    let mut bins: Vec<Bucket> = Vec::new();
    for bucket in &latency.histogram {
        let us_ns = (bucket.from_ns + 999) / 1000 * 1000;
        match bins.last_mut() {
            Some(last) if last.from_ns == us_ns => last.count += bucket.count,
            Some(_) | None => bins.push(Bucket {
                from_ns: us_ns,
                to_ns: us_ns,
                count: bucket.count,
            }),
        }
    }
    latency.histogram = bins;
    latency
}

/// Numbers that look like chance and are the same every time.
pub(crate) struct Dice(pub(crate) u64);

impl Dice {
    /// Between 0 and 1, neither of them.
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    }

    /// A lateness, ns: mostly about `usual`, with a tail that falls off by a power.
    fn lateness(&mut self, usual_ns: f64, tail: f64) -> f64 {
        let body = usual_ns * (0.5 + self.next() + self.next()) / 1.5;
        let rare = if self.next() < 0.02 {
            usual_ns * self.next().powf(-tail)
        } else {
            0.0
        };
        body + rare
    }
}

/// How a made-up round is.
#[derive(Clone, Copy)]
pub(crate) struct Kind {
    pub(crate) cycles: u64,
    pub(crate) jitter_ns: f64,
    pub(crate) wakeup_ns: f64,
    pub(crate) tail: f64,
    /// A stall of the PC this long, ns.
    pub(crate) stall_ns: u64,
}

/// A made-up round.
pub(crate) fn round(number: u32, kind: Kind) -> Round {
    let mut dice = Dice(u64::from(number) * 7919);
    let mut late_before = 0.0;
    let (mut periods, mut lateness) = (Jitter::new(1_000_000), Jitter::new(0));
    let cycles = kind.cycles as usize;
    let intervals = (cycles / 50).clamp(1, 1024);
    let mut maxima_us = vec![0.0_f64; intervals];
    let mut overruns = 0;
    for cycle in 0..cycles {
        let mut late = dice.lateness(kind.jitter_ns, kind.tail);
        if cycle == cycles / 3 {
            late += kind.stall_ns as f64;
        }
        let period_ns = (1e6 + late - late_before).max(0.0) as u64;
        late_before = if late < 5e5 { late } else { 0.0 };
        periods.record(period_ns);
        lateness.record(late as u64);
        overruns += u64::from(period_ns >= 1_500_000);
        let at = cycle * intervals / cycles;
        maxima_us[at] = maxima_us[at].max(period_ns as f64 / 1000.0);
    }
    let figures = periods.summary();
    let soc_period = SocReport {
        interface: "plk1".into(),
        cycle_us: 1000,
        duration_s: cycles as f64 * 1e-3,
        n: figures.n,
        period_mean_us: figures.mean_us,
        period_std_us: figures.std_us,
        period_min_us: figures.min_us,
        period_max_us: figures.max_us,
        period_range_us: figures.range_us,
        breaks: Breaks {
            overruns,
            soc_missing: overruns,
            ..Breaks::default()
        },
        interval_s: cycles as f64 * 1e-3 / intervals as f64,
        interval_maxima_us: maxima_us,
        histogram: periods.buckets().collect(),
        ..SocReport::default()
    };
    let mut floor = |usual: f64| -> Vec<u64> {
        (0..cycles / 2)
            .map(|_| dice.lateness(usual, kind.tail * 1.2) as u64)
            .collect()
    };
    let wakeup = distribution(0, floor(kind.wakeup_ns));
    let tested = cyclictest(floor(kind.wakeup_ns * 1.3).into_iter().map(|ns| ns / 1000));
    let small = |mean_us: f64| Summary {
        n: kind.cycles,
        mean_us,
        std_us: mean_us / 5.0,
        min_us: mean_us / 2.0,
        max_us: mean_us * 4.0,
        range_us: mean_us * 3.5,
        p50_us: mean_us,
        p90_us: mean_us * 1.2,
        p99_us: mean_us * 1.5,
        p99_9_us: mean_us * 2.0,
        p99_99_us: mean_us * 3.0,
    };
    let mut round = Round {
        number,
        began: format!("2026-01-02T03:0{}:00Z", number % 10),
        load_with_program: Load {
            seconds: cycles as f64 * 1e-3,
            load_average_before: 1.25,
            load_average_after: 2.5,
            steal_ms: if kind.stall_ns > 0 { 20.0 } else { 0.0 },
        },
        load_at_floor: Load {
            seconds: cycles as f64 * 1e-3,
            ..Load::default()
        },
        soc_period: Some(soc_period),
        control: ControlFigures {
            cycles: kind.cycles,
            programs: 1,
            overruns,
            overruns_per_10000: per_10000(overruns, kind.cycles),
            period: Distribution::from(&periods),
            lateness: Distribution::from(&lateness),
            exchange: small(31.0),
            wake_up: small(0.4),
            compute: small(3.2),
            free: small(940.0),
            ..ControlFigures::default()
        },
        floor: Floor {
            wakeup: Some(wakeup),
            wakeup_skipped: 0,
            cyclictest: Some(Cyclictest {
                version: "2.40".into(),
                command: "cyclictest -q -m -t1 -p90 -i1000 -a1 -D10s -h50000".into(),
                latency: tested,
                overflows: 0,
            }),
            gaps: Some(Gaps {
                threshold_us: 5.0,
                scanned_s: 5.0,
                lost_us: 900.0,
                lost_share: 180e-6,
                gaps: distribution(0, (0..120).map(|i| 6_000 + i * 236)),
            }),
            notes: Vec::new(),
        },
        ..Round::default()
    };
    judge(&mut round);
    round
}

/// A report without rounds.
pub(crate) fn empty() -> JitterReport {
    JitterReport {
        version: "0.1.0".into(),
        result: Ended::Cut,
        notes: Vec::new(),
        pc: Pc {
            kernel: "6.18.0-cloud #1 SMP PREEMPT_DYNAMIC".into(),
            virtual_machine: true,
            cpu_model: "Intel(R) Xeon(R) Processor @ 2.10GHz".into(),
            cores: 2,
            core: 1,
            ..Pc::default()
        },
        settings: Settings {
            machine: "mill3".into(),
            program: "generated, 100,000 lines".into(),
            interface: "plk0".into(),
            protocol: "powerlink".into(),
            sync0_us: None,
            far_end: "simulated drives in a process of their own; SoC stamped by the kernel at plk1".into(),
            cycles: 100_000,
            rounds: 5,
            cycle_us: 1000,
            timeout_us: 50,
            priority: 90,
            phase_us: 370,
            spin_us: 50,
            keep_awake: "time-out thread".into(),
            calibration: Vec::new(),
        },
        rounds: Vec::new(),
        medians: Medians::default(),
        medians_good_rounds: None,
        all: Merged::default(),
    }
}

/// A report of rounds.
pub(crate) fn report_of(rounds: Vec<Round>) -> JitterReport {
    JitterReport {
        result: Ended::Completed,
        medians: medians(rounds.iter()),
        medians_good_rounds: good_medians(&rounds),
        all: merged(&rounds),
        rounds,
        ..empty()
    }
}

const QUIET: Kind = Kind {
    cycles: 20_000,
    jitter_ns: 600.0,
    wakeup_ns: 9_000.0,
    tail: 0.4,
    stall_ns: 0,
};

/// A quiet PC.
pub(crate) fn quiet() -> JitterReport {
    report_of((1..=5).map(|number| round(number, QUIET)).collect())
}

/// Busy neighbours: lateness of milliseconds, a round with a stall, cycles left out.
pub(crate) fn very_bad() -> JitterReport {
    let kind = |number| Kind {
        jitter_ns: 5_000.0,
        wakeup_ns: 15_000.0,
        tail: 0.8,
        stall_ns: if number % 3 == 2 { 12_300_000 } else { 0 },
        ..QUIET
    };
    report_of((1..=5).map(|number| round(number, kind(number))).collect())
}

/// One short round, without `cyclictest` and gap scan.
pub(crate) fn one_round() -> JitterReport {
    let mut one = round(1, Kind { cycles: 1_000, ..QUIET });
    one.floor.cyclictest = None;
    one.floor.gaps = None;
    one.floor.notes = vec!["cyclictest is not installed; it comes with the package rt-tests".into()];
    judge(&mut one);
    report_of(vec![one])
}

/// Far more cycles than are made up one by one.
pub(crate) fn huge() -> JitterReport {
    let mut report = quiet();
    for round in &mut report.rounds {
        let mut scale = |part: &mut Distribution| {
            part.figures.n *= 1_000_000;
            part.histogram.iter_mut().for_each(|bucket| bucket.count *= 1_000_000);
        };
        scale(&mut round.control.lateness);
        round.floor.wakeup.as_mut().map(&mut scale);
        if let Some(soc) = &mut round.soc_period {
            soc.n *= 1_000_000;
            soc.interval_s *= 1e6;
            soc.duration_s *= 1e6;
            soc.histogram.iter_mut().for_each(|bucket| bucket.count *= 1_000_000);
        }
        round.control.cycles *= 1_000_000;
    }
    report_of(report.rounds)
}

/// A network that is not ours: nobody of us at the far end.
pub(crate) fn without_far_end() -> JitterReport {
    let mut rounds = quiet().rounds;
    for round in &mut rounds {
        round.soc_period = None;
        judge(round);
    }
    report_of(rounds)
}

/// One of each kind.
pub(crate) fn all() -> &'static [JitterReport; 6] {
    static ALL: LazyLock<[JitterReport; 6]> =
        LazyLock::new(|| [quiet(), very_bad(), empty(), one_round(), huge(), without_far_end()]);
    &ALL
}

/// Numbers that [`strange`] needs.
pub(crate) const STRANGE: usize = 12;

/// A report with anything in it that its types allow, as one read from a file might have.
pub(crate) fn strange(
    which: usize,
    floats: &[f64],
    buckets: &[(i64, i64, u64)],
    n: u64,
    cycle_us: u32,
    name: &str,
) -> JitterReport {
    let mut report = all()[which].clone();
    let histogram: Vec<Bucket> = buckets
        .iter()
        .map(|(from_ns, to_ns, count)| Bucket {
            from_ns: *from_ns,
            to_ns: *to_ns,
            count: *count,
        })
        .collect();
    report.settings.program = name.into();
    report.settings.machine = name.into();
    report.settings.cycle_us = cycle_us;
    report.notes.push(name.into());
    let all = &mut report.all;
    all.soc_period.histogram = histogram.clone();
    all.soc_period.figures.n = n;
    all.soc_period.figures.std_us = floats[0];
    all.wakeup.histogram = histogram;
    all.wakeup.figures.max_us = floats[1];
    all.overruns_per_10000 = floats[2];
    for round in &mut report.rounds {
        round.control.compute.n = n;
        round.control.compute.mean_us = floats[3];
        round.control.cycles = n;
        round.load_with_program.load_average_after = floats[4];
        round.load_with_program.steal_ms = floats[5];
        round.stalls.push(name.into());
        if let Some(gaps) = &mut round.floor.gaps {
            (gaps.gaps.figures.max_us, gaps.scanned_s, gaps.gaps.figures.n) = (floats[6], floats[7], n);
        }
        if let Some(cyclictest) = &mut round.floor.cyclictest {
            cyclictest.latency.figures.max_us = floats[8];
        }
        if let Some(soc) = &mut round.soc_period {
            (soc.period_max_us, soc.interval_s, soc.cycle_us) = (floats[8], floats[9], cycle_us);
            soc.interval_maxima_us = floats.to_vec();
            soc.breaks.overruns = n;
        }
        if let Some(ratios) = &mut round.over_cyclictest {
            (ratios.p99, ratios.p99_9) = (floats[9], floats[10]);
        }
    }
    if let Some(ratios) = &mut report.medians.over_cyclictest {
        (ratios.p50, ratios.std) = (floats[10], floats[11]);
    }
    report
}
