use super::*;
use crate::rt::otg::tests::Differences;
use proptest::prelude::*;

const CYCLE_S: f64 = 1e-3;
/// What the first joint of the mill of the examples can do.
const MOTION: MotionLimits = MotionLimits {
    velocity: 150.0,
    acceleration: 1500.0,
    jerk: 30_000.0,
};
const STOP: StopLimits = StopLimits {
    acceleration: 3000.0,
    jerk: 120_000.0,
};
const BOUNDS: PitchBounds = PitchBounds {
    correction_mm: 0.5,
    slope: 0.01,
};

fn table(rows: &[[f64; 3]]) -> PitchTable {
    let rows: Vec<PitchRow> = rows
        .iter()
        .map(|&[position_mm, forward_mm, backward_mm]| PitchRow {
            position_mm,
            forward_mm,
            backward_mm,
        })
        .collect();
    PitchTable::new(&rows, &BOUNDS).unwrap()
}

/// Errors of either way that are not the same, and not of the same slope.
fn worn() -> PitchTable {
    table(&[[0.0, 0.0, -0.01], [10.0, 0.02, 0.01], [30.0, -0.02, -0.02]])
}

fn joint(table: PitchTable, backlash_mm: f64, stop: StopLimits) -> (JointCompensation, CompensationShare) {
    let share = CompensationShare::new(table, MOTION, stop).unwrap();
    let joint = JointCompensation::new(share.table.clone(), backlash_mm, share.take_up, CYCLE_S);
    (joint, share)
}

/// Backlash is on neither side before the first move, then on that of the last one.
#[test]
fn backlash_follows_the_direction_and_remembers_it() {
    let (mut joint, _) = joint(PitchTable::default(), 0.02, STOP);
    let mut settled = |position_mm: f64| {
        (0..500).for_each(|_| _ = joint.step(position_mm));
        joint.correction_mm()
    };
    assert_eq!(settled(7.0), 0.0);
    assert_eq!(settled(7.1), 0.01);
    assert_eq!(settled(7.1), 0.01);
    // Rounding is no turn.
    assert_eq!(settled(7.1 - 1e-9), 0.01);
    assert_eq!(settled(7.09), -0.01);
    assert_eq!(settled(7.0), -0.01);
    assert_eq!(settled(9.0), 0.01);
    joint.restart();
    assert_eq!(joint.step(9.0), 9.0);
}

/// The motor stays where it is while it follows again: on which side of its joint, and with which correction, is known when it moves.
#[test]
fn a_motor_that_follows_again_is_not_moved_by_that() {
    let (mut joint, _) = joint(worn(), 0.0, STOP);
    for k in 0..300 {
        joint.step(f64::from(k) * 0.02);
    }
    let beside_mm = joint.correction_mm();
    assert!((beside_mm - 0.01196).abs() < 1e-12, "{beside_mm}");
    joint.hold();
    for _ in 0..100 {
        // Somebody has pushed it by 14 mm.
        assert_eq!(joint.step(20.0), 20.0 + beside_mm);
    }
    for k in 1..300 {
        joint.step(20.0 - f64::from(k) * 0.02);
    }
    assert_eq!(joint.correction_mm(), worn().correction_mm(20.0 - 299.0 * 0.02, false));
}

#[test]
fn many_small_steps_against_the_direction_are_a_turn() {
    let (mut joint, _) = joint(PitchTable::default(), 0.02, STOP);
    for k in 0..2000 {
        joint.step(f64::from(k) * 1e-3);
    }
    for k in 0..2000 {
        joint.step(1.999 - f64::from(k) * 1e-8);
    }
    assert_eq!(joint.correction_mm(), -0.01);
}

/// Cycles from the turn to the end of taking up: four ramps of full jerk, 4 (b/2J)^(1/3), where no other limit is reached, as half a
/// millimetre does.
#[test]
fn backlash_is_taken_up_in_the_time_that_its_jerk_takes() {
    const TIGHT: StopLimits = StopLimits {
        acceleration: 1.2 * MOTION.acceleration,
        jerk: 1.2 * MOTION.jerk,
    };
    for (stop, jerk, times) in [
        (
            STOP,
            45_000.0,
            [(0.001, 9), (0.005, 16), (0.02, 25), (0.1, 42), (0.5, 93)],
        ),
        (
            TIGHT,
            3_000.0,
            [(0.001, 23), (0.005, 38), (0.02, 60), (0.1, 103), (0.5, 175)],
        ),
    ] {
        let mut seen = Vec::new();
        for (backlash_mm, _) in times {
            let (mut joint, share) = joint(PitchTable::default(), backlash_mm, stop);
            assert!((share.take_up.jerk - jerk).abs() < 1e-9);
            (0..1000).for_each(|k| _ = joint.step(f64::from(k) * 1e-3));
            let end_mm = -backlash_mm / 2.0;
            let cycles = (1..1000).find(|k| {
                joint.step(0.999 - f64::from(*k) * 1e-3);
                joint.correction_mm() == end_mm
            });
            assert_eq!(joint.remainder.unsolved(), 0);
            seen.push((backlash_mm, cycles.unwrap()));
        }
        assert_eq!(seen, times, "{stop:?}");
    }
}

/// The correction is that of the position of this very cycle, at full acceleration, too.
#[test]
fn the_table_does_not_lag_behind_a_joint_that_speeds_up() {
    let steep = table(&[[0.0, 0.0, 0.0], [50.0, 0.4, 0.4], [100.0, 0.0, 0.0]]);
    let (mut joint, share) = joint(steep.clone(), 0.0, STOP);
    // It comes from where nothing is corrected.
    let mut command = TrajectoryGenerator::new(-20.0, share.motion, share.stop, CYCLE_S);
    command.go_to(100.0, f64::INFINITY);
    let mut fastest = 0.0_f64;
    let mut cycles = 0;
    while !command.is_at_rest() {
        let at = command.step();
        fastest = fastest.max(at.velocity);
        joint.step(at.position);
        cycles += 1;
        assert_eq!(
            joint.correction_mm(),
            share.table.correction_mm(at.position, true),
            "cycle {cycles}"
        );
        // Away from the bends it is that of the file, to the last bit.
        if [0.0, 50.0, 100.0]
            .iter()
            .all(|row| (at.position - row).abs() > share.table.rounding_mm())
        {
            assert_eq!(joint.correction_mm(), steep.correction_mm(at.position, true));
        }
    }
    assert!(cycles > 900 && fastest > 140.0, "{cycles} {fastest}");
}

#[test]
fn what_is_no_number_changes_nothing() {
    let (mut one, _) = joint(worn(), 0.02, STOP);
    let (mut other, _) = joint(worn(), 0.02, STOP);
    for k in 0..300 {
        let position_mm = f64::from(k) * 0.1;
        if k % 7 == 0 {
            assert!(one.step(f64::NAN).is_nan());
        }
        assert_eq!(one.step(position_mm), other.step(position_mm));
    }
}

#[test]
fn a_table_that_is_too_steep_for_the_joint_is_refused() {
    let tight = StopLimits {
        acceleration: 1.2 * MOTION.acceleration,
        jerk: 1.2 * MOTION.jerk,
    };
    let bounds = PitchBounds {
        correction_mm: 0.5,
        slope: 0.1,
    };
    let row = |position_mm: f64, forward_mm: f64| PitchRow {
        position_mm,
        forward_mm,
        backward_mm: forward_mm,
    };
    let table = PitchTable::new(&[row(0.0, 0.0), row(10.0, 0.3)], &bounds).unwrap();
    let refused = CompensationShare::new(table.clone(), MOTION, tight);
    assert_eq!(refused, Err(RoundError::Steep(Order::Acceleration)));
    // With more to spare its ends, where it becomes level, would be rounded by too much; and with still more they are not.
    assert!(matches!(
        CompensationShare::new(table.clone(), MOTION, STOP),
        Err(RoundError::Rough(11..))
    ));
    let free = StopLimits {
        acceleration: 20.0 * STOP.acceleration,
        jerk: 20.0 * STOP.jerk,
    };
    CompensationShare::new(table, MOTION, free).unwrap();
}

/// What a joint is told, and for how many cycles.
#[derive(Clone, Copy, Debug)]
enum Wish {
    Place(f64),
    Velocity(f64),
    Stop,
}

fn any_wishes() -> impl Strategy<Value = Vec<(Wish, usize)>> {
    let wish = prop_oneof![
        // Long ones, and ones that are shorter than the time of taking up.
        3 => (-20.0..50.0_f64).prop_map(Wish::Place),
        3 => (-0.5..0.5_f64).prop_map(|off| Wish::Place(10.0 + off)),
        2 => (-150.0..150.0_f64).prop_map(Wish::Velocity),
        1 => Just(Wish::Stop),
    ];
    prop::collection::vec((wish, 1_usize..200), 1..25)
}

proptest! {
    /// The whole command of the motor, whatever the joint does within its share: never above what the joint can do, and exact at
    /// rest.
    #[test]
    fn command_and_correction_together_stay_within_the_limits(
        wishes in any_wishes(),
        backlash_mm in prop_oneof![Just(0.0), 0.0..0.5_f64],
        wear in prop::collection::vec((0.5..20.0_f64, -1.0..1.0_f64, -1.0..1.0_f64), 0..8),
        steepness in 0.0..0.0099_f64,
        more in (1.2..4.0_f64, 1.2..8.0_f64),
    ) {
        let stop = StopLimits { acceleration: more.0 * MOTION.acceleration, jerk: more.1 * MOTION.jerk };
        let mut rows = vec![[-10.0, 0.0, 0.0]];
        for (gap_mm, forward, backward) in wear {
            let [at_mm, a, b] = rows[rows.len() - 1];
            let by = |from: f64, share: f64| (from + share * steepness * gap_mm).clamp(-0.4, 0.4);
            rows.push([at_mm + gap_mm, by(a, forward), by(b, backward)]);
        }
        // A table that cannot be followed is refused.
        let Ok(share) = CompensationShare::new(table(&rows), MOTION, stop) else { return Ok(()) };
        let mut joint = JointCompensation::new(share.table.clone(), backlash_mm, share.take_up, CYCLE_S);
        let mut command = TrajectoryGenerator::new(0.0, share.motion, share.stop, CYCLE_S);
        let whole = MotionLimits { velocity: MOTION.velocity, acceleration: stop.acceleration, jerk: stop.jerk };
        let mut differences = Differences::new(0.0, CYCLE_S);
        let mut step = |command: &mut TrajectoryGenerator| {
            let at_mm = command.step().position;
            let motor_mm = joint.step(at_mm);
            prop_assert_eq!(motor_mm, at_mm + joint.correction_mm());
            if let Err(over) = differences.check(motor_mm, whole) {
                prop_assert!(false, "{}", over);
            }
            Ok((at_mm, joint.correction_mm(), joint.forward, joint.remainder.unsolved()))
        };
        for (wish, cycles) in wishes {
            match wish {
                Wish::Place(place) => command.go_to(place, f64::INFINITY),
                Wish::Velocity(velocity) => command.run_at(velocity),
                Wish::Stop => command.stop(),
            }
            for _ in 0..cycles {
                step(&mut command)?;
            }
        }
        command.run_at(0.0);
        let mut last = (0.0, 0.0, None, 0);
        for _ in 0..3000 {
            last = step(&mut command)?;
        }
        let (at_mm, correction_mm, forward, _) = last;
        let side = forward.map_or(0.0, |forward| if forward { 0.5 } else { -0.5 });
        let wanted = side * backlash_mm + forward.map_or(0.0, |forward| share.table.correction_mm(at_mm, forward));
        prop_assert!((correction_mm - wanted).abs() < 1e-12, "{} {}", correction_mm, wanted);
    }
}

/// Ways of the take-up that are not found cost time: there are as good as none, however small or sudden they are.
#[test]
fn ways_of_taking_up_are_found() {
    use proptest::strategy::ValueTree;
    use proptest::test_runner::TestRunner;
    let mut runner = TestRunner::deterministic();
    let strategy = prop::collection::vec((-8.0..0.5_f64, 1..60_u32), 1..30);
    let (mut turns, mut unsolved) = (0, 0);
    for _ in 0..500 {
        let (mut joint, _) = joint(worn(), 0.0, STOP);
        let mut at_mm = 15.0;
        for (number, (log_way, cycles)) in strategy
            .new_tree(&mut runner)
            .unwrap()
            .current()
            .into_iter()
            .enumerate()
        {
            let way_mm = 10_f64.powf(log_way) * if number % 2 == 0 { 1.0 } else { -1.0 };
            for _ in 0..cycles {
                at_mm += way_mm / f64::from(cycles);
                joint.step(at_mm);
            }
            turns += 1;
        }
        unsolved += joint.remainder.unsolved();
    }
    assert!(turns > 5000 && unsolved * 1000 <= turns, "{unsolved} of {turns}");
}
