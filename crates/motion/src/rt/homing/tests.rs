use super::*;
use crate::rt::otg::tests::{Differences, mill};
use proptest::prelude::*;

const CYCLE_S: f64 = 1e-3;

/// A home switch: closes above its place, opens lower by its hysteresis, and bounces on both.
#[derive(Clone, Debug)]
struct Switch {
    place: f64,
    hysteresis: f64,
    /// Longest bounce, cycles.
    bounce: u32,
    steady: bool,
    bouncing: u32,
    random: u64,
    /// Does not close, or does not open, any more.
    stuck: Option<bool>,
}

impl Switch {
    fn at(place: f64) -> Switch {
        Switch {
            place,
            hysteresis: 0.05,
            bounce: 8,
            steady: false,
            bouncing: 0,
            random: 1,
            stuck: None,
        }
    }

    fn any(&mut self) -> u64 {
        self.random = self
            .random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        self.random >> 33
    }

    fn read(&mut self, position: f64) -> bool {
        if let Some(stuck) = self.stuck {
            return stuck;
        }
        let edge = if self.steady {
            self.place - self.hysteresis
        } else {
            self.place
        };
        let closed = position >= edge;
        if closed != self.steady {
            self.steady = closed;
            self.bouncing = (self.any() % u64::from(self.bounce + 1)) as u32;
        }
        if self.bouncing > 0 {
            self.bouncing -= 1;
            return self.any().is_multiple_of(2);
        }
        self.steady
    }
}

fn way() -> HomingWay {
    HomingWay {
        sequence: 1,
        search: 20.0,
        latch: 2.0,
        search_distance: 400.0,
        release_distance: 5.0,
        index_distance: None,
        resolution: 1e-7,
        bounce_s: 0.02,
        home: 0.0,
        skew: 1.0,
    }
}

fn joint(joint: usize, switch: f64) -> HomingJoint {
    let (motion, stop) = mill();
    HomingJoint {
        joint,
        switch,
        motion,
        stop,
    }
}

/// Homing of all groups, begun at these positions.
fn begun(groups: &[(HomingWay, &[HomingJoint])], positions: &[f64]) -> Homing {
    let mut homing = Homing::new(groups, CYCLE_S);
    homing.begin(u64::MAX, positions);
    homing
}

/// How a run ended.
struct Run {
    status: HomingStatus,
    positions: Vec<f64>,
}

fn run(
    homing: &mut Homing,
    switches: &mut [Switch],
    start: &[f64],
    index: impl Fn(usize, f64, f64) -> Option<f64>,
) -> Run {
    let (motion, stop) = mill();
    let most = MotionLimits {
        velocity: motion.velocity,
        acceleration: stop.acceleration,
        jerk: stop.jerk,
    };
    let mut positions = start.to_vec();
    let mut differences: Vec<_> = start.iter().map(|start| Differences::new(*start, CYCLE_S)).collect();
    let mut before = positions.clone();
    for _ in 1..2_000_000 {
        let inputs: Vec<_> = (0..switches.len())
            .map(|joint| HomingInput {
                closed: switches[joint].read(positions[joint]),
                measured: positions[joint],
                index: index(joint, before[joint], positions[joint]),
            })
            .collect();
        before.clone_from(&positions);
        homing.step(&inputs, &mut positions);
        for (joint, differences) in differences.iter_mut().enumerate() {
            differences
                .check(positions[joint], most)
                .unwrap_or_else(|over| panic!("joint {joint}: {over}"));
        }
        let status = homing.status();
        if status != HomingStatus::Running {
            return Run { status, positions };
        }
    }
    panic!("never over: {homing:?}");
}

fn no_index(_: usize, _: f64, _: f64) -> Option<f64> {
    None
}

#[test]
fn the_joint_ends_at_home_and_knows_where_the_switch_is() {
    let mut homing = begun(&[(way(), &[joint(0, 250.0)])], &[3.0]);
    let run = run(&mut homing, &mut [Switch::at(90.0)], &[3.0], no_index);
    assert_eq!(run.status, HomingStatus::Done);
    let offset = homing.offset(0).unwrap();
    assert!((offset - 160.0).abs() < 1e-6, "{offset}");
    // Home is 0 in the coordinates that hold from now on.
    assert!((run.positions[0] + offset).abs() < 1e-9);
    assert_eq!(homing.phase(0), Some(Phase::Done));
}

#[test]
fn every_phase_that_fails_has_a_name_and_ends_at_rest() {
    let closed_for_ever = Switch {
        stuck: Some(true),
        ..Switch::at(0.0)
    };
    let dead = Switch {
        stuck: Some(false),
        ..Switch::at(0.0)
    };
    for (switch, failure) in [
        (closed_for_ever, HomingFailure::StaysClosed),
        (dead, HomingFailure::NoSwitch),
        (Switch::at(500.0), HomingFailure::NoSwitch),
    ] {
        let mut homing = begun(&[(way(), &[joint(0, 0.0)])], &[3.0]);
        let run = run(&mut homing, &mut [switch], &[3.0], no_index);
        assert_eq!(run.status, HomingStatus::Failed { joint: 0, failure });
        assert_eq!(homing.offset(0), None);
        // One cycle beyond the distance, and the way of a stop from 20 mm/s: 0.26 mm.
        assert!(
            (run.positions[0] - 3.0).abs() < 400.0 + 0.3,
            "{failure:?}: {}",
            run.positions[0]
        );
    }
}

#[test]
fn a_switch_that_fails_on_the_way_is_named() {
    for (phase, stuck, failure) in [
        (Phase::BackOff, true, HomingFailure::StaysClosed),
        (Phase::Latch, false, HomingFailure::Lost),
        (Phase::Reopen, true, HomingFailure::StaysClosed),
    ] {
        let mut homing = begun(&[(way(), &[joint(0, 0.0)])], &[80.0]);
        let mut switch = Switch::at(90.0);
        let mut positions = [80.0];
        while homing.status() == HomingStatus::Running {
            if homing.phase(0) == Some(phase) {
                switch.stuck = Some(stuck);
            }
            let input = HomingInput {
                closed: switch.read(positions[0]),
                measured: positions[0],
                index: None,
            };
            homing.step(&[input], &mut positions);
        }
        assert_eq!(homing.status(), HomingStatus::Failed { joint: 0, failure }, "{phase:?}");
        assert!((positions[0] - 90.0).abs() < 6.0, "{phase:?}: {}", positions[0]);
    }
}

#[test]
fn the_index_pulse_counts_where_there_is_one() {
    let way = HomingWay {
        index_distance: Some(6.0),
        resolution: 0.01,
        ..way()
    };
    // One pulse every 5 mm.
    let pulse = |_: usize, from: f64, to: f64| {
        let place = (to / 5.0).floor() * 5.0;
        (from < place && to >= place).then_some(place)
    };
    let mut homing = begun(&[(way, &[joint(0, 7.0)])], &[3.0]);
    let found = run(&mut homing, &mut [Switch::at(91.7)], &[3.0], pulse);
    assert_eq!(found.status, HomingStatus::Done);
    assert_eq!(homing.offset(0), Some(7.0 - 95.0));

    let mut homing = begun(&[(way, &[joint(0, 7.0)])], &[3.0]);
    let missing = run(&mut homing, &mut [Switch::at(91.7)], &[3.0], no_index);
    let failure = HomingFailure::NoIndex;
    assert_eq!(missing.status, HomingStatus::Failed { joint: 0, failure });
}

#[test]
fn a_gantry_ends_square() {
    // The second joint's switch is 0.4 mm further on, which is to be 0 for both: it stands 0.4 mm behind.
    let joints = [joint(0, 100.0), joint(1, 100.0)];
    let mut homing = begun(&[(way(), &joints)], &[50.0, 50.0]);
    let mut switches = [Switch::at(90.0), Switch::at(90.4)];
    let run = run(&mut homing, &mut switches, &[50.0, 50.0], no_index);
    assert_eq!(run.status, HomingStatus::Done);
    assert!(
        (run.positions[1] - run.positions[0] - 0.4).abs() < 1e-6,
        "{:?}",
        run.positions
    );
    assert!((homing.offset(0).unwrap() - homing.offset(1).unwrap() - 0.4).abs() < 1e-6);
}

#[test]
fn a_gantry_too_far_from_square_is_not_bent() {
    let joints = [joint(0, 100.0), joint(1, 100.0)];
    let mut homing = begun(&[(way(), &joints)], &[50.0, 50.0]);
    let mut switches = [Switch::at(90.0), Switch::at(91.5)];
    let run = run(&mut homing, &mut switches, &[50.0, 50.0], no_index);
    let failure = HomingFailure::Skewed;
    assert_eq!(run.status, HomingStatus::Failed { joint: 1, failure });
    assert!(
        (run.positions[1] - run.positions[0]).abs() < 1.02,
        "{:?}",
        run.positions
    );
}

#[test]
fn lower_sequence_numbers_home_first_equal_ones_side_by_side() {
    let second = HomingWay { sequence: 2, ..way() };
    let groups: [(HomingWay, &[HomingJoint]); 3] = [
        (second, &[joint(0, 0.0)]),
        (way(), &[joint(1, 0.0)]),
        (way(), &[joint(2, 0.0)]),
    ];
    let mut homing = begun(&groups, &[0.0; 3]);
    let mut switches = [Switch::at(30.0), Switch::at(20.0), Switch::at(40.0)];
    let mut positions = [0.0; 3];
    let mut done = [0; 3];
    for cycle in 0..200_000 {
        let mut inputs = [HomingInput::default(); 3];
        for (joint, input) in inputs.iter_mut().enumerate() {
            input.closed = switches[joint].read(positions[joint]);
            input.measured = positions[joint];
        }
        homing.step(&inputs, &mut positions);
        for (joint, done) in done.iter_mut().enumerate() {
            if homing.phase(joint) == Some(Phase::Done) && *done == 0 {
                *done = cycle;
            }
        }
        if positions[0] != 0.0 {
            assert!(done[1] > 0 && done[2] > 0);
        }
        if homing.status() == HomingStatus::Done {
            break;
        }
    }
    assert!(done[1] < done[2] && done[2] < done[0], "{done:?}");
}

#[test]
fn an_abort_rests_and_says_so() {
    let mut homing = begun(&[(way(), &[joint(0, 0.0)])], &[0.0]);
    let mut positions = [0.0];
    for _ in 0..500 {
        homing.step(&[HomingInput::default()], &mut positions);
    }
    homing.abort();
    while homing.status() == HomingStatus::Running {
        homing.step(&[HomingInput::default()], &mut positions);
    }
    let failure = HomingFailure::Aborted;
    assert_eq!(homing.status(), HomingStatus::Failed { joint: 0, failure });
    assert!(positions[0] > 5.0 && positions[0] < 11.0, "{positions:?}");
}

#[test]
fn a_place_found_while_answers_are_lost_does_not_count() {
    // What is read in these cycles is that of the last one before.
    let found = |lost: &dyn Fn(f64) -> bool, doubts: bool| {
        let way = HomingWay {
            resolution: 0.002,
            ..way()
        };
        let mut homing = begun(&[(way, &[joint(0, 0.0)])], &[80.0]);
        let mut switch = Switch::at(90.0);
        let (mut positions, mut before) = ([80.0], 80.0);
        let (mut input, mut lost_cycles) = (HomingInput::default(), 0);
        let mut losses = 0;
        while homing.status() == HomingStatus::Running {
            let slow = positions[0] - before > 0.0015 && positions[0] - before < 0.0025;
            before = positions[0];
            if slow && lost_cycles == 0 && losses < 2 && lost(positions[0]) {
                lost_cycles = 5;
                losses += 1;
            }
            let closed = switch.read(positions[0]);
            if lost_cycles > 0 {
                lost_cycles -= 1;
                if doubts {
                    homing.doubt();
                }
            } else {
                input = HomingInput {
                    closed,
                    measured: positions[0],
                    index: None,
                };
            }
            homing.step(&[input], &mut positions);
        }
        assert_eq!(homing.status(), HomingStatus::Done);
        assert!(losses > 0 || doubts);
        (homing.offset(0).unwrap() + 90.0).abs()
    };
    let at_the_switch = |position: f64| position > 89.996 && position < 90.0;
    assert!(found(&at_the_switch, false) > 0.004, "it would be wrong");
    assert!(found(&at_the_switch, true) <= 0.002);
    assert!(found(&|_| false, true) <= 0.002);
}

#[test]
fn joints_that_are_not_asked_stay_and_those_that_failed_begin_anew() {
    let groups: [(HomingWay, &[HomingJoint]); 2] = [(way(), &[joint(0, 0.0)]), (way(), &[joint(1, 7.0)])];
    let mut homing = Homing::new(&groups, CYCLE_S);
    assert_eq!(homing.status(), HomingStatus::Done);
    assert_eq!((homing.phase(1), homing.offset(1)), (Some(Phase::Idle), None));
    let dead = Switch {
        stuck: Some(false),
        ..Switch::at(90.0)
    };
    let mut switches = [dead, Switch::at(40.0)];
    homing.begin(0b01, &[3.0, 5.0]);
    let failed = run(&mut homing, &mut switches, &[3.0, 5.0], no_index);
    let failure = HomingFailure::NoSwitch;
    assert_eq!(failed.status, HomingStatus::Failed { joint: 0, failure });
    assert_eq!(failed.positions[1], 5.0);

    // The cable is plugged in again. Nothing of the run before is left.
    switches[0].stuck = None;
    switches[0].steady = true;
    homing.begin(0b11, &failed.positions);
    assert_eq!((homing.offset(0), homing.offset(1)), (None, None));
    let homed = run(&mut homing, &mut switches, &failed.positions, no_index);
    assert_eq!(homed.status, HomingStatus::Done);
    assert!(
        (homing.offset(0).unwrap() + 90.0).abs() < 1e-6,
        "{:?}",
        homing.offset(0)
    );
    assert!(
        (homing.offset(1).unwrap() + 33.0).abs() < 1e-6,
        "{:?}",
        homing.offset(1)
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// From any start, on either side of the switch, in either direction, however it bounces: the same place.
    #[test]
    fn the_same_place_is_found_from_any_start(
        start in -150.0..150.0_f64,
        bounce in 0_u32..15,
        seed in any::<u64>(),
        back in any::<bool>(),
    ) {
        let sign = if back { -1.0 } else { 1.0 };
        let way = HomingWay { search: 20.0 * sign, ..way() };
        // The switch looks along the direction of the search: mirrored, the joint moves the other way.
        let mut switch = Switch { bounce, random: seed, ..Switch::at(12.345_678_9) };
        switch.steady = start >= switch.place;
        let mut homing = begun(&[(way, &[joint(0, 0.0)])], &[start * sign]);
        let mut positions = [start * sign];
        let mut cycles = 0;
        while homing.status() == HomingStatus::Running {
            let input = HomingInput {
                closed: switch.read(positions[0] * sign),
                measured: positions[0],
                index: None,
            };
            homing.step(&[input], &mut positions);
            cycles += 1;
            prop_assert!(cycles < 100_000);
        }
        prop_assert_eq!(homing.status(), HomingStatus::Done);
        let offset = homing.offset(0).unwrap();
        prop_assert!((offset * sign + 12.345_678_9).abs() < 1e-6, "{}", offset);
        prop_assert!((positions[0] + offset).abs() < 1e-9);
    }
}
