//! Generators of motion without a plan ask nothing of the allocator once they are made, whatever they are told.

use crate::canon::{AXES, Axis, Call, Event, Position, ProbeMode, Source};
use crate::counting::calls;
use crate::element::{Auxiliary, Element, Enables, Span};
use crate::kinematics::{Elbow, Follows, Kinematics, Scara, ToolFrame, Transform};
use crate::path::Piece;
use crate::plan::{AxisLimits, Planner, PlannerKind, Pumped, Settings};
use crate::ring::{Producer, Publish, Sink, channel};
use crate::rt::homing::{Homing, HomingInput, HomingJoint, HomingStatus, HomingWay};
use crate::rt::jog::{Jog, JogLimits, WorldJog};
use crate::rt::probe::Probe;
use crate::rt::{Interpolator, MotionLimits, ScaleRamp, StopLimits, TrajectoryGenerator};
use std::cell::Cell;
use std::rc::Rc;

const LIMITS: MotionLimits = MotionLimits {
    velocity: 150.0,
    acceleration: 1500.0,
    jerk: 30_000.0,
};
const STOP: StopLimits = StopLimits {
    acceleration: 3000.0,
    jerk: 120_000.0,
};
const CYCLE_S: f64 = 1e-3;

/// Numbers from 0 to 1, the same ones in every run.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

#[test]
fn the_counter_counts() {
    assert_eq!(calls(|| drop(std::hint::black_box(Box::new(1)))), 2);
}

#[test]
fn goals_at_any_cycle_cost_no_allocation() {
    let mut otg = TrajectoryGenerator::new(0.0, LIMITS, STOP, CYCLE_S);
    otg.set_range([-100.0, 100.0]);
    let mut numbers = Numbers(1);
    let counted = calls(|| {
        for _ in 0..20_000 {
            match (numbers.next() * 8.0) as u8 {
                0 => otg.run_at(300.0 * numbers.next() - 150.0),
                1 => otg.stop(),
                2 => otg.go_to(f64::NAN, 1.0),
                _ => otg.go_to(240.0 * numbers.next() - 120.0, 150.0 * numbers.next()),
            }
            for _ in 0..(numbers.next() * 60.0) as u8 {
                otg.step();
            }
        }
    });
    assert_eq!(counted, 0);
}

/// Why the solver is called directly: where there is no way, it says so and builds no text.
#[test]
fn a_way_that_is_not_found_costs_no_allocation() {
    use rsruckig::block::Block;
    use rsruckig::position_third_step1::PositionThirdOrderStep1;
    use rsruckig::profile::Profile;
    let mut profile = Profile::default();
    // No way leads to what is no number.
    profile.set_boundary(0.0, 0.0, 0.0, f64::NAN, 0.0, 0.0);
    let mut solver = PositionThirdOrderStep1::new(0.0, 0.0, 0.0, f64::NAN, 0.0, 0.0, 1.0, -1.0, 1.0, -1.0, 1.0);
    let mut block = Block::default();
    let mut found = true;
    let counted = calls(|| found = solver.get_profile(&profile, &mut block));
    assert_eq!((found, counted), (false, 0));
}

/// Longer than what is kept for the way back, so that its oldest elements make room.
#[test]
fn backward_and_block_by_block_cost_no_allocation() {
    const SPANS: u32 = 6000;
    let (mut producer, consumer) = channel(8192);
    let piece = Piece::line(Position::ZERO, Position::xyz(100.0, 0.0, 0.0)).unwrap();
    // Rest to rest in spans of 1 ms: speed up for a third of the way, slow down for another.
    let third = f64::from(SPANS / 3) * 1e-3;
    let mut s0 = 0.0;
    let spans: Vec<Element> = (0..SPANS)
        .map(|number| {
            let time_s = f64::from(number) * 1e-3;
            let (v0, a0) = match number / (SPANS / 3) {
                0 => (5.0 * time_s, 5.0),
                1 => (5.0 * third, 0.0),
                _ => (5.0 * (3.0 * third - time_s), -5.0),
            };
            let span = Span {
                piece,
                s0,
                v0,
                a0,
                jerk: 0.0,
                gradient: 0.0,
                duration_s: 1e-3,
                line: number / 500,
                rapid: false,
                enables: Enables::INITIAL,
                auxiliary: Auxiliary::INITIAL,
                modes: 0,
            };
            s0 = span.place(1e-3);
            Element::Span(span)
        })
        .collect();
    assert_eq!(producer.publish(&spans, &[]), Publish::Done);
    let mut interpolator = Interpolator::new(consumer, Position::ZERO, ScaleRamp::new(&[(LIMITS, STOP)], CYCLE_S));
    let mut numbers = Numbers(7);
    let (mut scale, mut blocks) = (1.0, 0);
    let counted = calls(|| {
        for _ in 0..3_000 {
            match (numbers.next() * 9.0) as u8 {
                0 => scale = 0.0,
                1 | 2 => scale = -numbers.next(),
                3..=5 => scale = 1.0,
                6 => interpolator.set_single_block(true),
                7 => interpolator.set_single_block(false),
                _ => interpolator.next_block(),
            }
            for _ in 0..(numbers.next() * 400.0) as u16 {
                interpolator.step(scale);
            }
            blocks += u32::from(interpolator.is_block_over());
        }
        for _ in 0..8_000 {
            interpolator.step(-1.0);
        }
    });
    assert_eq!(counted, 0);
    assert!(blocks > 0 && interpolator.is_way_back_over(), "{blocks} blocks");
}

#[test]
fn jogging_costs_no_allocation() {
    let limits = JogLimits {
        motion: LIMITS,
        stop: STOP,
        range: [-50.0, 50.0],
    };
    let mut jog = Jog::new(&[limits; 3], CYCLE_S);
    let mut numbers = Numbers(2);
    let mut positions = [0.0; 3];
    let counted = calls(|| {
        for _ in 0..5_000 {
            let joint = (numbers.next() * 3.0) as usize;
            match (numbers.next() * 6.0) as u8 {
                0 => jog.release(joint),
                1 => jog.stop_all(),
                2 => _ = jog.advance(joint, 10.0 * numbers.next() - 5.0, 100.0),
                _ => jog.run(joint, 300.0 * numbers.next() - 150.0),
            }
            for _ in 0..(numbers.next() * 60.0) as u8 {
                jog.step(&mut positions);
            }
        }
    });
    assert_eq!(counted, 0);
}

#[test]
fn homing_costs_no_allocation() {
    let way = HomingWay {
        sequence: 1,
        search: 20.0,
        latch: 2.0,
        search_distance: 400.0,
        release_distance: 5.0,
        index_distance: None,
        resolution: 1e-5,
        bounce_s: 0.01,
        home: 0.0,
        skew: 1.0,
    };
    let joint = HomingJoint {
        joint: 0,
        switch: 0.0,
        motion: LIMITS,
        stop: STOP,
    };
    let mut homing = Homing::new(&[(way, &[joint])], CYCLE_S);
    let mut positions = [0.0];
    let counted = calls(|| {
        homing.begin(1, &positions);
        for _ in 0..100_000 {
            let input = HomingInput {
                closed: positions[0] > 30.0,
                measured: positions[0],
                index: None,
            };
            homing.step(&[input], &mut positions);
        }
    });
    assert_eq!((homing.status(), counted), (HomingStatus::Done, 0));
}

#[test]
fn probing_costs_no_allocation() {
    let line = Piece::line(Position::ZERO, Position::xyz(0.0, 0.0, -50.0)).unwrap();
    let mode = ProbeMode {
        towards: true,
        must_trip: true,
    };
    let mut probe = Probe::new(line, mode, 20.0, (LIMITS, STOP), CYCLE_S);
    let mut position = Position::ZERO;
    let counted = calls(|| {
        for _ in 0..5_000 {
            position = probe.step(position.0[2] < -20.0, &position);
        }
    });
    assert!(probe.result().is_some());
    assert_eq!(counted, 0);
}

#[test]
fn jogging_in_the_world_costs_no_allocation() {
    let scara = Scara {
        inner_arm_mm: 300.0,
        outer_arm_mm: 200.0,
        tool_offset_mm: 0.0,
        elbow: Elbow::Positive,
        shoulder_middle_degrees: 0.0,
    };
    let follows = [Axis::X, Axis::Y, Axis::Z, Axis::C].map(|axis| Follows {
        axis: Some(axis),
        offset: 0.0,
    });
    let limits = JogLimits {
        motion: LIMITS,
        stop: STOP,
        range: [-120.0, 120.0],
    };
    let kinematics = Kinematics::new(Transform::Scara(scara), &follows);
    let of_axes = JogLimits {
        range: [-400.0, 400.0],
        ..limits
    };
    let mut jog = WorldJog::new(kinematics, &[of_axes; AXES], &[limits; 4], CYCLE_S);
    assert!(jog.rest_at(&Position::xyz(300.0, 100.0, 0.0), ToolFrame::OFF));
    let mut numbers = Numbers(4);
    let mut positions = [0.0; 4];
    let mut obstructions = 0;
    let counted = calls(|| {
        for _ in 0..300 {
            let axis = [Axis::X, Axis::Y, Axis::Z][(numbers.next() * 3.0) as usize];
            if numbers.next() < 0.3 {
                jog.advance(axis, 60.0 * numbers.next() - 30.0, 100.0);
            } else {
                jog.run(axis, 200.0 * numbers.next() - 100.0);
            }
            for _ in 0..500 {
                jog.step(&mut positions);
            }
            obstructions += usize::from(jog.obstruction().is_some());
        }
    });
    assert_eq!(counted, 0);
    assert!(obstructions > 0, "nothing was ever in the way");
}

/// A ring that counts what is offered to it.
struct Offered {
    ring: Producer<Element>,
    times: Rc<Cell<u32>>,
}

impl Sink<Element> for Offered {
    fn free(&self) -> usize {
        self.ring.free()
    }

    fn is_full(&self, count: usize) -> bool {
        self.ring.is_full(count)
    }

    fn publish(&mut self, committed: &[Element], tail: &[Element]) -> Publish {
        self.times.set(self.times.get() + 1);
        self.ring.publish(committed, tail)
    }

    fn next_number(&self) -> u64 {
        self.ring.next_number()
    }

    fn consumer_at(&self) -> Option<u64> {
        self.ring.consumer_at()
    }
}

/// The control asks some hundred times a second whether there is room again, for as long as the machine runs what it has.
#[test]
fn a_planner_whose_ring_is_full_puts_nothing_together() {
    let axis = AxisLimits {
        velocity: LIMITS.velocity,
        acceleration: LIMITS.acceleration,
        jerk: LIMITS.jerk,
        travel: [-1e4, 1e4],
    };
    for kind in [PlannerKind::Optimal, PlannerKind::Classic] {
        let mut axes = [None; AXES];
        axes[..3].fill(Some(axis));
        let settings = Settings {
            planner_kind: kind,
            ..Settings::new(axes, CYCLE_S)
        };
        let times = Rc::new(Cell::new(0));
        let (ring, _consumer) = channel(settings.largest_publication() + 1);
        let times_seen = Rc::clone(&times);
        let mut planner = Planner::new(settings, Offered { ring, times });
        let mut number = 0;
        let mut push = |planner: &mut Planner<Offered>, call| {
            number += 1;
            let source = Source {
                line: number,
                ..Source::default()
            };
            planner.push(&Event { source, call }).unwrap();
        };
        let feed = Call::SetFeedRate {
            linear: 50.0,
            angular: 0.0,
        };
        push(&mut planner, feed);
        let mut moves = 0_u32;
        while planner.pump() != Pumped::Blocked {
            moves += 1;
            assert!(moves < 1_000_000, "{kind:?}: the ring is never full");
            let to = Position::xyz(f64::from(moves % 2), f64::from(moves % 3), 0.0);
            push(&mut planner, Call::StraightFeed { to });
        }
        let offered = times_seen.get();
        let counted = calls(|| {
            for _ in 0..1000 {
                assert_eq!(planner.pump(), Pumped::Blocked);
            }
        });
        assert_eq!((counted, times_seen.get() - offered), (0, 0), "{kind:?}");
    }
}
