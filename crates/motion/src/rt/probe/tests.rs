use super::*;
use crate::rt::otg::tests::{any_limits, mill};
use proptest::prelude::*;

const CYCLE_S: f64 = 1e-3;
const TOWARDS: ProbeMode = ProbeMode {
    towards: true,
    must_trip: true,
};

/// 100 mm downwards.
fn line() -> Piece {
    Piece::line(Position::xyz(5.0, 7.0, 10.0), Position::xyz(5.0, 7.0, -90.0)).unwrap()
}

fn z(position: &Position) -> f64 {
    position.0[2]
}

/// Runs against a surface: the contact is closed below `surface`; gives the result and the cycles.
fn run(probe: &mut Probe, surface: f64, cycles_max: usize) -> (Probed, usize) {
    let mut position = Position::xyz(5.0, 7.0, 10.0);
    for cycle in 1..=cycles_max {
        position = probe.step(z(&position) <= surface, &position);
        if let Some(result) = probe.result() {
            return (result, cycle);
        }
    }
    panic!("no result");
}

#[test]
fn a_contact_is_latched_and_the_move_rests_behind_it() {
    let mut probe = Probe::new(line(), TOWARDS, 20.0, mill(), CYCLE_S);
    let (result, _) = run(&mut probe, -40.0, 10_000);
    assert_eq!(result.end, ProbeEnd::Tripped);
    assert!(result.end.is_fine(TOWARDS));
    // Seen within one cycle; v^1.5/J^0.5 = 0.258 mm to rest, and one cycle until the stop begins.
    assert!(z(&result.at) <= -40.0 && z(&result.at) > -40.0 - 0.02, "{result:?}");
    let way = z(&result.at) - z(&result.rest);
    assert!(way > 0.2 && way < 0.2583 + 0.02, "{way}");
    assert_eq!((result.rest.0[0], result.rest.0[1]), (5.0, 7.0));
}

#[test]
fn what_drives_have_latched_counts_near_the_contact_only() {
    for (exact_z, counts) in [(-40.003, true), (-30.0, false), (-41.0, false), (f64::NAN, false)] {
        let mut probe = Probe::new(line(), TOWARDS, 20.0, mill(), CYCLE_S);
        probe.step(false, &Position::xyz(5.0, 7.0, 10.0));
        // A shock on the way, or the contact of the move before.
        probe.refine(&Position::xyz(5.0, 7.0, exact_z));
        let (result, _) = run(&mut probe, -40.0, 10_000);
        assert_eq!(z(&result.at) == exact_z, counts, "{exact_z}: {result:?}");
        assert!((z(&result.at) + 40.0).abs() < 0.02, "{result:?}");
    }
}

#[test]
fn no_contact_is_an_error_where_the_mode_demands_one() {
    for must_trip in [true, false] {
        let mode = ProbeMode {
            towards: true,
            must_trip,
        };
        let mut probe = Probe::new(line(), mode, 50.0, mill(), CYCLE_S);
        let (result, _) = run(&mut probe, -95.0, 10_000);
        assert_eq!(result.end, ProbeEnd::Missed);
        assert_eq!(result.at, Position::xyz(5.0, 7.0, -90.0));
        assert_eq!(result.end.is_fine(mode), !must_trip);
    }
}

#[test]
fn a_contact_that_is_there_already_moves_nothing() {
    let mut probe = Probe::new(line(), TOWARDS, 20.0, mill(), CYCLE_S);
    let (result, cycles) = run(&mut probe, 10.0, 10);
    assert_eq!((result.end, cycles), (ProbeEnd::Already, 1));
    assert_eq!(result.rest, Position::xyz(5.0, 7.0, 10.0));
    assert!(!result.end.is_fine(TOWARDS));
}

#[test]
fn away_is_until_the_contact_lets_go() {
    let away = ProbeMode {
        towards: false,
        must_trip: true,
    };
    let mut probe = Probe::new(line(), away, 10.0, mill(), CYCLE_S);
    let mut position = Position::xyz(5.0, 7.0, 10.0);
    let result = loop {
        position = probe.step(z(&position) > 3.0, &position);
        if let Some(result) = probe.result() {
            break result;
        }
    };
    assert_eq!(result.end, ProbeEnd::Tripped);
    assert!(z(&result.at) <= 3.0 && z(&result.at) > 2.98, "{result:?}");
    // Closed is what it waits for to end: open at the beginning moves nothing.
    let mut probe = Probe::new(line(), away, 10.0, mill(), CYCLE_S);
    probe.step(false, &position);
    assert_eq!(probe.result().unwrap().end, ProbeEnd::Already);
}

#[test]
fn a_hold_rests_on_the_line_and_a_resume_finds_the_contact() {
    let mut probe = Probe::new(line(), TOWARDS, 50.0, mill(), CYCLE_S);
    let mut position = Position::xyz(5.0, 7.0, 10.0);
    for _ in 0..300 {
        position = probe.step(false, &position);
    }
    probe.hold();
    for _ in 0..500 {
        position = probe.step(false, &position);
    }
    assert!(probe.is_at_rest() && probe.result().is_none());
    assert!(z(&position) < 9.0 && z(&position) > -20.0);
    probe.resume();
    let result = loop {
        position = probe.step(z(&position) <= -40.0, &position);
        if let Some(result) = probe.result() {
            break result;
        }
    };
    assert_eq!(result.end, ProbeEnd::Tripped);
    // Nothing more happens, whatever the contact does.
    probe.resume();
    assert_eq!(probe.step(false, &position), result.rest);
}

#[test]
fn an_abort_rests_and_is_no_success() {
    let mut probe = Probe::new(line(), TOWARDS, 50.0, mill(), CYCLE_S);
    let start = Position::xyz(5.0, 7.0, 10.0);
    for _ in 0..300 {
        probe.step(false, &start);
    }
    probe.abort();
    while probe.result().is_none() {
        probe.step(false, &start);
        assert!(probe.is_stopping());
    }
    assert_eq!(probe.result().unwrap().end, ProbeEnd::Aborted);
    assert_eq!(probe.speed(), 0.0);
}

#[test]
fn limits_along_a_line_are_those_of_the_slowest_joint() {
    let (motion, stop) = mill();
    let (along, stops) = limits_along([(0.6, motion, stop), (-0.8, motion, stop), (0.0, motion, stop)].into_iter());
    assert!((along.velocity - 150.0 / 0.8).abs() < 1e-9);
    assert!((stops.jerk - 120_000.0 / 0.8).abs() < 1e-9);
}

proptest! {
    /// Wherever the surface is, however fast: the latched place is within one cycle of it, and the rest behind it no
    /// farther than the stop limits need.
    #[test]
    fn the_stop_is_no_longer_than_the_limits_need(
        (motion, stop) in any_limits(),
        share in 0.001..=1.0_f64,
        surface in 0.05..0.95_f64,
    ) {
        let feed = share * motion.velocity;
        let length = motion.velocity;
        let end = Position::xyz(length, 0.0, 0.0);
        let piece = Piece::line(Position::ZERO, end).unwrap();
        let mut probe = Probe::new(piece, TOWARDS, feed, (motion, stop), CYCLE_S);
        let surface = surface * length;
        let mut position = Position::ZERO;
        let result = loop {
            position = probe.step(position.0[0] >= surface, &position);
            if let Some(result) = probe.result() {
                break result;
            }
        };
        prop_assert_eq!(result.end, ProbeEnd::Tripped);
        let cycle = feed * CYCLE_S + 1e-9;
        prop_assert!(result.at.0[0] >= surface && result.at.0[0] <= surface + cycle);
        // From v, with the acceleration of the way up still to be taken back: at most that much faster for that long.
        let v = feed;
        let (a, j) = (stop.acceleration, stop.jerk);
        let plain = if v * j > a * a { v * v / (2.0 * a) + v * a / (2.0 * j) } else { v * (v / j).sqrt() };
        let up = motion.acceleration.min((v * motion.jerk).sqrt());
        let taken_back = v * up / j;
        let way = result.rest.0[0] - result.at.0[0];
        prop_assert!(way <= plain + taken_back + cycle, "{way} > {plain} + {taken_back}");
        prop_assert!(result.rest.0[0] <= length);
    }
}
