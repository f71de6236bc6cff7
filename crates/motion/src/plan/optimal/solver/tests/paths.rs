//! Straight lines with smooth bends: from one line to engraving-like sequences.

use proptest::prelude::*;
use proptest::strategy::ValueTree;

use super::motion::{Path, Planned, try_plan};
use super::*;

/// A plane path of straight stretches and bends: the direction turns by a quintic step, so curvature is smooth.
#[derive(Clone, Debug, Default)]
pub(super) struct Bends {
    length: f64,
    heading: f64,
    /// Where it begins, its length, by what angle.
    bends: Vec<(f64, f64, f64)>,
}

impl Bends {
    pub(super) fn new(heading: f64) -> Bends {
        Bends {
            heading,
            ..Bends::default()
        }
    }
    pub(super) fn line(&mut self, length: f64) {
        self.length += length;
    }
    pub(super) fn bend(&mut self, length: f64, angle: f64) {
        self.bends.push((self.length, length, angle));
        self.length += length;
    }
}

impl Path for Bends {
    fn length(&self) -> f64 {
        self.length
    }
    fn place(&self, _: f64) -> Vec<f64> {
        unreachable!("only derivatives are asked for")
    }
    fn jets(&self, s: f64) -> Vec<JointJet> {
        let (mut angle, mut k, mut dk) = (self.heading, 0.0, 0.0);
        for &(begin, length, turn) in &self.bends {
            let x = ((s - begin) / length).clamp(0.0, 1.0);
            angle += turn * x * x * x * (10.0 + x * (6.0 * x - 15.0));
            k += turn / length * 30.0 * x * x * (1.0 - x) * (1.0 - x);
            dk += turn / (length * length) * 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x);
        }
        let (sin, cos) = angle.sin_cos();
        let jet = |along: f64, across: f64| JointJet {
            d1: along,
            d2: k * across,
            d3: dk * across - k * k * along,
        };
        vec![jet(cos, -sin), jet(sin, cos)]
    }
    fn borders(&self) -> Vec<f64> {
        self.bends
            .iter()
            .flat_map(|&(begin, length, _)| [begin, begin + length])
            .collect()
    }
}

fn report(name: &str, path: &Bends, cap: f64, dt: f64) {
    match try_plan(path, &[LIMITS; 2], cap, dt) {
        Ok(planned) => println!(
            "{name}: length {:.3} {} spans, {:?}, vigour {}, time {:.4}, between {:.4?}",
            path.length,
            planned.grid.spans(),
            planned.solved,
            planned.vigour,
            planned.time(),
            planned.between(path, &[LIMITS; 2], 8)
        ),
        Err(error) => println!("{name}: {error}"),
    }
}

#[test]
#[ignore = "prints figures"]
fn stress() {
    for length in [1e-4, 1e-2, 1.0, 10.0, 100.0] {
        for feed in [1.0, 30.0, 1e4] {
            let mut path = Bends::new(0.0);
            path.line(length);
            report(&format!("line {length} F {feed}"), &path, feed * feed, 0.005);
        }
    }
    for (size, bend) in [(10.0, 0.06), (1.0, 0.06), (0.2, 0.1), (3.0, 0.002), (0.05, 0.05)] {
        for dt in [0.005, 0.01] {
            let mut path = Bends::new(0.3);
            for k in 0..40 {
                path.line(size);
                path.bend(bend, if k % 3 == 0 { -1.57 } else { 1.57 });
            }
            path.line(size);
            report(&format!("zigzag {size} bend {bend} dt {dt}"), &path, f64::INFINITY, dt);
        }
    }
}

/// Time of the fastest straight move from rest to rest.
fn seven_phases(length: f64, v: f64, a: f64, j: f64) -> f64 {
    // Time to reach a speed: two jerk phases and what is between.
    let rise = |v: f64| {
        if v * j < a * a {
            2.0 * (v / j).sqrt()
        } else {
            v / a + a / j
        }
    };
    let (mut low, mut high) = (0.0, v);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if rise(middle) * middle <= length {
            low = middle
        } else {
            high = middle
        }
    }
    let on = (length - low * rise(low)) / low;
    2.0 * rise(low) + on
}

#[test]
fn straight_moves_take_little_more_than_seven_phases() {
    for (length, feed) in [
        (1e-3, 100.0),
        (0.1, 3.0),
        (1.0, 100.0),
        (10.0, 30.0),
        (30.0, 1e3),
        (100.0, 1e3),
    ] {
        let mut path = Bends::new(0.0);
        path.line(length);
        let planned = try_plan(&path, &[LIMITS; 2], feed * feed, 0.005).unwrap();
        let best = seven_phases(
            length,
            LIMITS.velocity.min(feed) * SPEED_USE,
            LIMITS.acceleration * ACCELERATION_USE,
            LIMITS.jerk * JERK_USE,
        );
        let ratio = planned.time() / best;
        assert!(
            (0.9999..1.01).contains(&ratio),
            "{length} at {feed}: {} s, {ratio} of the best",
            planned.time()
        );
    }
}

/// Bends of all sizes between lines of all lengths.
fn paths() -> impl Strategy<Value = Bends> {
    let stretch = (-2.0..1.2f64, -2.3..0.7f64, -2.5..2.5f64);
    (
        0.0..std::f64::consts::TAU,
        prop::collection::vec(stretch, 1..8),
        -2.0..1.0f64,
    )
        .prop_map(|(heading, stretches, last)| {
            let mut path = Bends::new(heading);
            for (line, bend, angle) in stretches {
                path.line(10f64.powf(line));
                path.bend(10f64.powf(bend), angle);
            }
            path.line(10f64.powf(last));
            path
        })
}

fn check(path: &Bends, limits: &[JointLimits], feed: f64, dt: f64) -> Result<Planned, String> {
    let planned = try_plan(path, limits, feed * feed, dt)?;
    let worst = worst(&planned.grid, 0..planned.grid.spans(), &planned.profile);
    if worst.value.is_nan() || worst.value >= 1.0 {
        return Err(format!("{worst:?}"));
    }
    if !planned.solved.converged {
        return Err(format!("{:?}", planned.solved));
    }
    let between = planned.between(path, limits, 8);
    // Set-points see means over several cycles; for a moment, and rarely, jerk is that little higher: above 1.01 in 1 of the 2000
    // of `many_paths` (1.014), 1.019 in the worst that was ever found.
    if between[0] > 1.0 || between[1] > 1.0 || between[2] > 1.02 {
        return Err(format!("between checkpoints: {between:?}"));
    }
    Ok(planned)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]
    #[test]
    fn bends_and_lines_are_run_within_the_limits(path in paths(), feed in -0.5..3.0f64, slow in 0.2..1.0f64) {
        let slower = JointLimits { velocity: 300.0 * slow, acceleration: 2000.0 * slow, jerk: 3e4 * slow };
        if let Err(error) = check(&path, &[LIMITS, slower], 10f64.powf(feed), 0.006) {
            prop_assert!(false, "{error}");
        }
    }
}

#[test]
#[ignore = "many cases"]
fn many_paths() {
    let mut runner = proptest::test_runner::TestRunner::deterministic();
    let strategy = (paths(), -0.5..3.0f64, 0.2..1.0f64);
    let mut iterations = Vec::new();
    let mut over = Vec::new();
    for case in 0..2000 {
        let (path, feed, slow) = strategy.new_tree(&mut runner).unwrap().current();
        let slower = JointLimits {
            velocity: 300.0 * slow,
            acceleration: 2000.0 * slow,
            jerk: 3e4 * slow,
        };
        match check(&path, &[LIMITS, slower], 10f64.powf(feed), 0.006) {
            Ok(planned) => iterations.push((planned.solved.iterations, planned.grid.spans())),
            Err(error) if error.starts_with("between") => over.push(error),
            Err(error) => println!("case {case} {error} feed {feed} slow {slow} {path:?}"),
        }
    }
    iterations.sort_unstable();
    over.sort_by_key(|error: &String| error.rsplit_once(',').map(|(_, jerk)| jerk.to_owned()));
    println!(
        "{} over: {:?}",
        over.len(),
        over.iter().rev().step_by(1 + over.len() / 12).collect::<Vec<_>>()
    );
    println!(
        "{} good, iterations {:?} .. {:?} .. {:?}",
        iterations.len(),
        iterations[0],
        iterations[iterations.len() / 2],
        iterations[iterations.len() - 1]
    );
}

#[test]
fn first_profiles_are_found_from_launch_to_launch() {
    let mut runner = proptest::test_runner::TestRunner::deterministic();
    let strategy = (paths(), -0.5..3.0f64);
    for case in 0..30 {
        let (path, feed) = strategy.new_tree(&mut runner).unwrap().current();
        let feed = 10f64.powf(feed);
        let planned = try_plan(&path, &[LIMITS; 2], feed * feed, 0.006).unwrap();
        let (from, to) = (planned.from.start(), planned.to.stop());
        let spans = planned.grid.spans();
        let feasible = feasible_profile(&planned.grid, 0..spans, &Knotting::new(&[LIMITS; 2], 0.006));
        let first = initial_guess(&planned.grid, 0..spans, from, to, &feasible);
        let first = first.unwrap_or_else(|error| panic!("case {case}: {error:?} {path:?}"));
        assert!(worst(&planned.grid, 0..spans, &first).value < 1.0);
        assert_eq!((first[0], first[spans]), (from, to));
    }
}
