//! The cycle beside the floor of the PC: ratios round by round, medians over rounds, and which rounds met a stall.
//!
//! In:  [`Round`]s. Out: [`Ratios`], [`Medians`], [`Merged`].

use super::distribution::Distribution;
use super::report::{Medians, Merged, Round};
use analyser::SocReport;
use host::histogram::Summary;
use serde::{Deserialize, Serialize};

/// A gap or a period that is this much too long is a stall of the PC, not jitter.
const STALL_US: f64 = 1000.0;

/// The SoC period over a wake-up latency: distance of the period from nominal over latency, quantile by quantile. Below 1
/// the cycle is kept better than a thread wakes up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Ratios {
    /// Half of all.
    pub p50: f64,
    /// 99 % of all.
    pub p99: f64,
    /// 99.9 % of all.
    pub p99_9: f64,
    pub std: f64,
}

impl Ratios {
    /// Ratios of two distributions; `None` if one of them is empty or the latency has a figure of 0.
    pub fn between(period: &Distribution, latency: &Distribution) -> Option<Ratios> {
        if period.figures.n == 0 || latency.figures.n == 0 {
            return None;
        }
        let quantile = |q| period.deviation_quantile_us(q) / latency.quantile_us(q);
        let ratios = Ratios {
            p50: quantile(0.5),
            p99: quantile(0.99),
            p99_9: quantile(0.999),
            std: period.figures.std_us / latency.figures.std_us,
        };
        ratios.figures().iter().all(|ratio| ratio.is_finite()).then_some(ratios)
    }

    /// All four.
    pub fn figures(&self) -> [f64; 4] {
        [self.p50, self.p99, self.p99_9, self.std]
    }

    fn median(of: &[Ratios]) -> Option<Ratios> {
        let each = |at: usize| median(of.iter().map(|ratios| ratios.figures()[at]));
        Some(Ratios {
            p50: each(0)?,
            p99: each(1)?,
            p99_9: each(2)?,
            std: each(3)?,
        })
    }
}

/// Median; of an even number of values the mean of the two in the middle.
fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_unstable_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() {
        0 => None,
        odd if odd % 2 == 1 => Some(values[middle]),
        _ => Some((values[middle - 1] + values[middle]) / 2.0),
    }
}

/// Periods of the analyser as a distribution.
pub fn period_distribution(soc: &SocReport) -> Distribution {
    let mut periods = Distribution {
        nominal_ns: u64::from(soc.cycle_us) * 1000,
        figures: Summary {
            n: soc.n,
            mean_us: soc.period_mean_us,
            std_us: soc.period_std_us,
            min_us: soc.period_min_us,
            max_us: soc.period_max_us,
            range_us: soc.period_range_us,
            ..Summary::default()
        },
        histogram: soc.histogram.clone(),
    };
    periods.read_quantiles();
    periods
}

/// SoC periods of a round: those at the far end of the wire, or where nobody measured there, those of the control's own clock.
pub fn period(round: &Round) -> Distribution {
    match &round.soc_period {
        Some(soc) => period_distribution(soc),
        None => round.control.period.clone(),
    }
}

/// Fills in what follows from the measured parts of a round.
pub fn judge(round: &mut Round) {
    let period = period(round);
    let over = |latency: Option<&Distribution>| Ratios::between(&period, latency?);
    let floor = &round.floor;
    let (over_cyclictest, over_wakeup) = (over(floor.cyclictest_latency()), over(floor.wakeup.as_ref()));
    (round.over_cyclictest, round.over_wakeup) = (over_cyclictest, over_wakeup);
    round.stalls = stalls(round);
}

/// Why a round says more of the PC than of the control.
fn stalls(round: &Round) -> Vec<String> {
    let mut stalls = Vec::new();
    for (load, part) in [
        (&round.load_with_program, "while the program ran"),
        (&round.load_at_floor, "while the floor was measured"),
    ] {
        if load.steal_ms > 0.0 {
            stalls.push(format!("the host took {:.0} ms of the core {part}", load.steal_ms));
        }
    }
    if let Some(soc) = &round.soc_period {
        let late_us = soc.period_max_us - f64::from(soc.cycle_us);
        if late_us >= STALL_US {
            stalls.push(format!("a SoC came {:.1} ms late", late_us / 1000.0));
        }
        if soc.breaks.restarts > 0 {
            stalls.push(format!(
                "the SoC paused {} times for more than 10 cycles",
                soc.breaks.restarts
            ));
        }
    }
    if let Some(gaps) = &round.floor.gaps
        && gaps.gaps.figures.max_us >= STALL_US
    {
        stalls.push(format!(
            "the core stood still for {:.1} ms while nothing else of ours ran",
            gaps.gaps.figures.max_us / 1000.0
        ));
    }
    let floors = [
        (round.floor.wakeup.as_ref(), "the wake-up probe"),
        (round.floor.cyclictest_latency(), "cyclictest"),
    ];
    for (latency, name) in floors {
        let max_us = latency.map_or(0.0, |latency| latency.figures.max_us);
        if max_us >= STALL_US {
            stalls.push(format!("{name} woke up {:.1} ms late", max_us / 1000.0));
        }
    }
    stalls
}

/// Medians over rounds.
pub fn medians<'a>(rounds: impl Iterator<Item = &'a Round> + Clone) -> Medians {
    let ratios = |of: fn(&Round) -> Option<Ratios>| {
        let each: Vec<Ratios> = rounds.clone().filter_map(of).collect();
        Ratios::median(&each)
    };
    Medians {
        rounds: rounds.clone().count() as u32,
        over_cyclictest: ratios(|round| round.over_cyclictest),
        over_wakeup: ratios(|round| round.over_wakeup),
        overruns_per_10000: median(rounds.clone().map(|round| round.control.overruns_per_10000)).unwrap_or(0.0),
    }
}

/// Medians over the rounds that are not bad, where these are some and not all.
pub fn good_medians(rounds: &[Round]) -> Option<Medians> {
    let good = rounds.iter().filter(|round| !round.is_bad());
    (1..rounds.len()).contains(&good.clone().count()).then(|| medians(good))
}

/// All rounds together.
pub fn merged(rounds: &[Round]) -> Merged {
    let periods: Vec<Distribution> = rounds.iter().map(period).collect();
    let cyclictest = rounds.iter().filter_map(|round| round.floor.cyclictest_latency());
    let (cycles, overruns) = rounds.iter().fold((0, 0), |(cycles, overruns), round| {
        (cycles + round.control.cycles, overruns + round.control.overruns)
    });
    Merged {
        soc_period: Distribution::merge(&periods),
        lateness: Distribution::merge(rounds.iter().map(|round| &round.control.lateness)),
        wakeup: Distribution::merge(rounds.iter().filter_map(|round| round.floor.wakeup.as_ref())),
        cyclictest: Distribution::merge(cyclictest),
        overruns_per_10000: per_10000(overruns, cycles),
    }
}

/// Events per 10,000 cycles; 0 without cycles.
pub fn per_10000(events: u64, cycles: u64) -> f64 {
    if cycles == 0 {
        0.0
    } else {
        events as f64 * 10_000.0 / cycles as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{Cyclictest, Gaps};
    use host::histogram::Jitter;

    fn distribution(nominal_ns: u64, values_ns: &[u64]) -> Distribution {
        let mut jitter = Jitter::new(nominal_ns);
        values_ns.iter().for_each(|value_ns| jitter.record(*value_ns));
        Distribution::from(&jitter)
    }

    fn soc(values_ns: &[u64]) -> SocReport {
        let periods = distribution(1_000_000, values_ns);
        let figures = periods.figures;
        SocReport {
            cycle_us: 1000,
            n: figures.n,
            period_mean_us: figures.mean_us,
            period_std_us: figures.std_us,
            period_min_us: figures.min_us,
            period_max_us: figures.max_us,
            period_range_us: figures.range_us,
            histogram: periods.histogram,
            ..SocReport::default()
        }
    }

    #[test]
    fn ratios_by_hand() {
        // Distances 1, 1, 2, 2 µs, standard deviation sqrt(2.5) µs; latencies 4, 6, 8, 10 µs, standard deviation sqrt(5) µs.
        let period = distribution(1_000_000, &[999_000, 1_001_000, 998_000, 1_002_000]);
        let latency = distribution(0, &[4_000, 6_000, 8_000, 10_000]);
        let ratios = Ratios::between(&period, &latency).unwrap();
        // Quantiles are as exact as a bucket is wide: 1/32.
        for (ratio, exact) in [(ratios.p50, 1.0 / 6.0), (ratios.p99, 0.2), (ratios.p99_9, 0.2)] {
            assert!((ratio / exact - 1.0).abs() < 0.07, "{ratio} for {exact}");
        }
        assert!((ratios.std - 0.5_f64.sqrt()).abs() < 1e-9);
        assert_eq!(Ratios::between(&period, &Distribution::default()), None);
        assert_eq!(Ratios::between(&Distribution::default(), &latency), None);
        assert_eq!(
            Ratios::between(&period, &distribution(0, &[5_000, 5_000])),
            None,
            "a deviation of 0 divides nothing"
        );
    }

    #[test]
    fn medians_by_hand() {
        let none: [f64; 0] = [];
        assert_eq!(median(none.into_iter()), None);
        assert_eq!(median([3.0, 1.0, 2.0].into_iter()), Some(2.0));
        assert_eq!(median([4.0, 1.0, 2.0, 3.0].into_iter()), Some(2.5));
    }

    fn round(number: u32, period_max_ns: u64, latency_ns: u64) -> Round {
        let mut round = Round {
            number,
            soc_period: Some(soc(&[999_000, 1_000_000, period_max_ns])),
            ..Round::default()
        };
        round.floor.cyclictest = Some(Cyclictest {
            latency: distribution(0, &[1_000, latency_ns]),
            ..Cyclictest::default()
        });
        (round.control.cycles, round.control.overruns) = (10_000, u64::from(number));
        round.control.overruns_per_10000 = per_10000(u64::from(number), 10_000);
        judge(&mut round);
        round
    }

    #[test]
    fn bad_rounds_are_marked_and_counted() {
        let mut rounds = vec![
            round(1, 1_001_000, 20_000),
            round(2, 1_002_000, 40_000),
            round(3, 6_000_000, 30_000),
        ];
        assert_eq!(rounds[0].stalls, [] as [String; 0]);
        assert_eq!(rounds[2].stalls, ["a SoC came 5.0 ms late"]);
        let (all, good) = (medians(rounds.iter()), good_medians(&rounds).unwrap());
        assert_eq!((all.rounds, good.rounds), (3, 2));
        assert_eq!((all.overruns_per_10000, good.overruns_per_10000), (2.0, 1.5));
        assert!(all.over_cyclictest.unwrap().std > good.over_cyclictest.unwrap().std);
        assert_eq!(all.over_wakeup, None);
        let merged = merged(&rounds);
        assert_eq!(
            (
                merged.soc_period.figures.n,
                merged.cyclictest.figures.n,
                merged.wakeup.figures.n
            ),
            (9, 6, 0)
        );
        assert_eq!(
            (merged.soc_period.figures.max_us, merged.overruns_per_10000),
            (6000.0, 2.0)
        );
        rounds.truncate(2);
        assert_eq!(good_medians(&rounds), None, "all are good");
        assert_eq!(medians(rounds[..0].iter()), Medians::default());
    }

    #[test]
    fn every_kind_of_stall_is_named() {
        let mut round = round(1, 1_001_000, 1_500_000);
        round.load_with_program.steal_ms = 20.0;
        round.load_at_floor.steal_ms = 10.0;
        round.floor.wakeup = Some(distribution(0, &[1_000, 2_000_000]));
        round.floor.gaps = Some(Gaps {
            gaps: distribution(0, &[2_000, 4_100_000]),
            ..Gaps::default()
        });
        judge(&mut round);
        assert_eq!(
            round.stalls,
            [
                "the host took 20 ms of the core while the program ran",
                "the host took 10 ms of the core while the floor was measured",
                "the core stood still for 4.1 ms while nothing else of ours ran",
                "the wake-up probe woke up 2.0 ms late",
                "cyclictest woke up 1.5 ms late",
            ]
        );
    }
}
