//! Two closed curves with known best times.

use super::curves::{self, Curve, Parametric};
use super::motion::{Path, grid_of, plan};
use super::*;

impl Path for Curve {
    fn length(&self) -> f64 {
        Curve::length(self)
    }
    fn place(&self, s: f64) -> Vec<f64> {
        Curve::place(self, s).to_vec()
    }
    fn jets(&self, s: f64) -> Vec<JointJet> {
        Curve::jets(self, s).to_vec()
    }
}

const LAPS: [(&str, Parametric, f64); 2] = [("star", curves::star, 1.527), ("lissajous", curves::lissajous, 1.744)];

#[test]
#[ignore = "prints figures"]
fn figures() {
    for (name, at, reference) in LAPS {
        let curve = Curve::new(at);
        for dt in [0.002, 0.004, 0.006, 0.008, 0.01, 0.015, 0.02] {
            let planned = plan(&curve, &[LIMITS; 3], f64::INFINITY, dt);
            let spans = planned.grid.spans();
            let (differences, over) = planned.differences(&curve, &[LIMITS; 3]);
            println!(
                "{name} dt {dt}: {spans} spans, {} iterations, converged {}, time {:.4} = {:.4} of the reference; differences {differences:.4?}, {over} over; between {:.4?}",
                planned.solved.iterations,
                planned.solved.converged,
                planned.time(),
                planned.time() / reference,
                planned.between(&curve, &[LIMITS; 3], 8)
            );
        }
        for spans in [100, 300, 600, 1000] {
            let knots: Vec<f64> = (0..=spans).map(|k| curve.length() * k as f64 / spans as f64).collect();
            let grid = grid_of(&curve, &[LIMITS; 3], f64::INFINITY, &knots);
            let mut workspace = Workspace::default();
            let mut best = f64::INFINITY;
            let mut iterations = 0;
            for _ in 0..7 {
                let mut profile = vec![State { b: 400.0, u: 0.0 }; spans + 1];
                let begin = std::time::Instant::now();
                let solved = solve(&grid, 0..spans, &mut profile, &Options::default(), &mut workspace).unwrap();
                best = best.min(begin.elapsed().as_secs_f64());
                iterations = solved.iterations;
            }
            println!(
                "{name} {spans} spans from 20 mm/s: {iterations} iterations, {:.1} ns per checkpoint and iteration, {:.0} spans/s",
                best * 1e9 / (3.0 * spans as f64 * f64::from(iterations)),
                spans as f64 / best
            );
        }
    }
}

#[test]
fn laps_from_rest_to_rest_are_near_the_best_time_and_within_all_limits() {
    for (name, at, reference) in LAPS {
        let curve = Curve::new(at);
        let planned = plan(&curve, &[LIMITS; 3], f64::INFINITY, 0.005);
        assert!(planned.solved.converged, "{name}");
        let time = planned.time();
        assert!(time < 1.03 * reference, "{name}: {time} s");
        let (differences, over) = planned.differences(&curve, &[LIMITS; 3]);
        assert_eq!(over, 0, "{name}: {differences:?}");
        // Something is at its limit most of the time, else the time could not be good.
        assert!(differences[2] > 0.9, "{name}: {differences:?}");
    }
}
