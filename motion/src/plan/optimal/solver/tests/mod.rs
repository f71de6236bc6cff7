mod curves;

use super::*;
use curves::Curve;

const LIMITS: JointLimits = JointLimits {
    velocity: 500.0,
    acceleration: 5000.0,
    jerk: 1e5,
};

fn grid(curve: &Curve, knots: &[f64]) -> Grid {
    let mut grid = Grid::new(&[LIMITS; 3]);
    for pair in knots.windows(2) {
        let h = pair[1] - pair[0];
        let jets = [curve.jets(pair[0]), curve.jets(pair[0] + 0.5 * h), curve.jets(pair[1])];
        grid.push_span(h, f64::INFINITY, [&jets[0], &jets[1], &jets[2]]);
    }
    grid
}

#[test]
#[ignore]
fn experiment() {
    for (name, at) in [
        ("star", curves::star as curves::Parametric),
        ("lissajous", curves::lissajous),
    ] {
        let curve = Curve::new(at);
        let spans = std::env::var("N").map_or(300, |n| n.parse().unwrap());
        let knots: Vec<f64> = (0..=spans).map(|k| curve.length() * k as f64 / spans as f64).collect();
        let grid = grid(&curve, &knots);
        let mut profile = vec![State { b: 400.0, u: 0.0 }; spans + 1];
        println!(
            "{name} length {} start worst {:?}",
            curve.length(),
            worst(&grid, 0..spans, &profile)
        );
        let options = Options::default();
        let mut workspace = Workspace::default();
        let start = profile.clone();
        let mut best = f64::INFINITY;
        let mut solved = None;
        for _ in 0..5 {
            profile.copy_from_slice(&start);
            let begin = std::time::Instant::now();
            solved = solve(&grid, 0..spans, &mut profile, &options, &mut workspace).ok();
            best = best.min(begin.elapsed().as_secs_f64());
        }
        let solved = solved.unwrap();
        println!(
            "{name} {solved:?} worst {:?} {:.1} ns per checkpoint and iteration, {:.0} spans/s",
            worst(&grid, 0..spans, &profile),
            best * 1e9 / (3.0 * spans as f64 * f64::from(solved.iterations)),
            spans as f64 / best
        );
    }
}

#[test]
fn a_lap_of_each_curve_converges_within_its_limits() {
    for (at, reference) in [(curves::star as curves::Parametric, 1.527), (curves::lissajous, 1.744)] {
        let curve = Curve::new(at);
        let knots: Vec<f64> = (0..=600).map(|k| curve.length() * f64::from(k) / 600.0).collect();
        let grid = grid(&curve, &knots);
        let mut profile = vec![State { b: 400.0, u: 0.0 }; 601];
        let ends = (profile[0], profile[600]);
        let solved = solve(
            &grid,
            0..600,
            &mut profile,
            &Options::default(),
            &mut Workspace::default(),
        )
        .unwrap();
        assert!(solved.converged && solved.iterations < 40, "{solved:?}");
        assert!(worst(&grid, 0..600, &profile).value < 1.0);
        assert_eq!((profile[0], profile[600]), ends);
        assert!((0.97..1.03).contains(&(solved.time_s / reference)), "{solved:?}");
    }
}
