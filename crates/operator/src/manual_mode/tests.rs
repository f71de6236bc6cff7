use super::*;
use crate::rehearsal::{Rehearsal, rehearse_with};
use machine::sequence::Job;
use motion::canon::{Axis, Position};
use rt::shared::RtStatus;
use serde_json::json;
use sim::{Disturbance, NetConfig};
use std::path::Path;

const PART: &str = "G21 G90 G94 G54\nG0 X5 Y5\nM2\n";
const CYCLES_MAX: u64 = 60_000;
const X: Jogged = Jogged::Axis(Axis::X);

fn run_at(what: Jogged, velocity_mm_s: f64) -> Jog {
    Jog {
        what: Some(what),
        motion: JogMotion::Run { velocity_mm_s },
    }
}

fn advance(distance_mm: f64) -> Jog {
    Jog {
        what: Some(X),
        motion: JogMotion::Advance {
            distance_mm,
            velocity_mm_s: 20.0,
        },
    }
}

const KEEP: Jog = Jog {
    what: None,
    motion: JogMotion::Keep,
};

/// A machine whose drives are off, and the operator's hands.
struct Hands<'r, 'a> {
    run: &'r mut Rehearsal<'a>,
    config: &'r Config,
}

impl Hands<'_, '_> {
    fn jog(&mut self, order: &Jog) -> Result<(), String> {
        self.outlook(order).map(drop)
    }

    fn outlook(&mut self, order: &Jog) -> Result<JogOutlook, String> {
        jog(order, self.config, &mut self.run.operator).map_err(|why| why.text)
    }

    fn reach(&mut self, state: State) {
        let reached = self
            .run
            .run_until(CYCLES_MAX, |run| run.control.state() == state)
            .unwrap();
        assert!(reached, "never {state:?}: {:#?}", self.run.operator.journal());
    }

    fn cycles(&mut self, count: u64) {
        self.run.run_until(count, |_| false).unwrap();
    }

    /// That many cycles with the hand on the key.
    fn keeping(&mut self, count: u64) {
        for _ in 0..count / 50 {
            self.jog(&KEEP).unwrap();
            self.cycles(50);
        }
    }

    fn homed(&mut self) {
        let now_ns = self.run.now_ns();
        let order = self.run.operator.homing_order(u64::MAX);
        assert!(self.run.operator.begin(now_ns, Job::Home(order)));
        let (mut done, mut since) = (false, 0);
        for _ in 0..CYCLES_MAX {
            self.run.cycle(0).unwrap();
            // Operators look every few cycles only.
            since = if self.run.operator.step() == Step::StandBy {
                since + 1
            } else {
                0
            };
            done |= since > 20;
            if done {
                break;
            }
        }
        assert!(done, "never homed: {:#?}", self.run.operator.journal());
        assert_eq!(self.run.control.state(), State::Ready);
    }

    fn position(&self) -> Position {
        self.run.operator.live().position
    }

    fn x_mm(&self) -> f64 {
        self.position().0[0]
    }

    /// Nothing went over a limit so far, nor was there an alarm.
    fn all_is_well(&self) {
        let over: Vec<_> = self.run.control.peaks().iter().map(|peaks| peaks.over).collect();
        assert!(over.iter().all(|over| *over == [0; 3]), "{over:?}");
        assert!(
            self.run.operator.alarms().is_empty(),
            "{:?}",
            self.run.operator.alarms()
        );
    }
}

fn by_hand(act: impl FnOnce(&mut Hands<'_, '_>)) {
    by_hand_on(include_str!("../../../../configs/mill3-demo.toml"), act);
}

fn by_hand_on(machine: &str, act: impl FnOnce(&mut Hands<'_, '_>)) {
    let config = config::parse(machine, Path::new("demo.toml")).unwrap();
    rehearse_with(
        &config,
        PART.as_bytes(),
        NetConfig::clean(3),
        Operator::standing_by,
        |run| {
            let mut hands = Hands { run, config: &config };
            hands.reach(State::Disabled);
            act(&mut hands);
            Ok(())
        },
    )
    .unwrap();
}

#[test]
fn nothing_jogs_before_drives_are_on_and_joints_know_where_they_are() {
    by_hand(|hands| {
        let why = hands.jog(&run_at(X, 10.0)).unwrap_err();
        assert_eq!(why, "not while the machine is disabled (standing by)");
        let now_ns = hands.run.now_ns();
        assert!(hands.run.operator.begin(now_ns, Job::On));
        hands.reach(State::Ready);
        hands.cycles(50);
        let before = hands.position();
        assert_eq!(
            hands.jog(&run_at(X, 10.0)).unwrap_err(),
            "joint 0 is not homed: isocnc home; before that it can be jogged by its number, slowly: isocnc jog 0 1"
        );
        assert_eq!(hands.jog(&KEEP).unwrap_err(), "nothing is being jogged");
        // Nor does the cycle thread believe it.
        hands.run.operator.give(Command::Jog(JogOrder {
            acceleration_share: 1.0,
            unhomed: false,
            axis: None,
            joints: 1,
            motion: JogMotion::Run { velocity_mm_s: 10.0 },
        }));
        hands.cycles(100);
        assert_eq!((hands.run.control.state(), hands.position()), (State::Ready, before));
        hands.homed();
        assert_eq!(hands.run.operator.live().homed, 0b111);
        let no_such_axis = hands.jog(&run_at(Jogged::Axis(Axis::A), 1.0)).unwrap_err();
        assert_eq!(no_such_axis, "the machine has no axis A; axes are X, Y, Z");
        let no_such_joint = hands.jog(&run_at(Jogged::Joint(3), 1.0)).unwrap_err();
        assert_eq!(no_such_joint, "there is no joint 3; joints are 0 to 2");
    });
}

/// Of the mill, of CoreXY, whose belts are no axes, and of a gantry, whose sides stay together.
#[test]
fn joints_that_are_not_homed_are_jogged_slowly_each_for_itself_and_home_behind_it() {
    for (machine, joint, together) in [
        (include_str!("../../../../configs/mill3-demo.toml"), 1, vec![1]),
        (include_str!("../../../../configs/corexy-demo.toml"), 0, vec![0]),
        (include_str!("../../../../configs/gantry-demo.toml"), 1, vec![1, 2]),
    ] {
        let machine = machine.replace("[[joint]]", "[[joint]]\nunhomed_jog_mm_s = 8.0");
        by_hand_on(&machine, |hands| {
            let now_ns = hands.run.now_ns();
            assert!(hands.run.operator.begin(now_ns, Job::On));
            hands.reach(State::Ready);
            hands.cycles(50);
            let joints = hands.config.joints.len();
            let loads = |hands: &mut Hands<'_, '_>| -> Vec<f64> {
                let machine = hands.run.net().machine();
                (0..joints)
                    .map(|joint| machine.joint_position_mm(joint).unwrap())
                    .collect()
            };
            let before = loads(hands);
            let told = hands.outlook(&run_at(Jogged::Joint(joint), 100.0)).unwrap();
            assert_eq!(told.velocity_mm_s, Some(8.0));
            hands.keeping(1_000);
            let ways: Vec<f64> = loads(hands)
                .iter()
                .zip(&before)
                .map(|(now, before)| now - before)
                .collect();
            for (number, way) in ways.iter().enumerate() {
                let moves = together.contains(&number);
                assert!(
                    if moves {
                        (7.0..8.01).contains(way)
                    } else {
                        way.abs() < 1e-3
                    },
                    "{ways:?}"
                );
            }
            // An increment, back.
            hands.cycles(500);
            let before = loads(hands)[joint];
            hands
                .jog(&Jog {
                    what: Some(Jogged::Joint(joint)),
                    motion: JogMotion::Advance {
                        distance_mm: -1.0,
                        velocity_mm_s: 50.0,
                    },
                })
                .unwrap();
            hands.keeping(400);
            hands.cycles(300);
            assert!((before - loads(hands)[joint] - 1.0).abs() < 1e-3);
            assert_eq!(
                (hands.run.control.state(), hands.run.operator.live().homed),
                (State::Ready, 0)
            );
            hands.homed();
            hands.jog(&run_at(X, 20.0)).unwrap();
            hands.keeping(300);
            hands.cycles(500);
            hands.all_is_well();
        });
    }
}

#[test]
fn a_jog_that_is_not_renewed_comes_to_rest_and_a_renewal_begins_nothing() {
    by_hand(|hands| {
        hands.homed();
        let from_mm = hands.x_mm();
        hands.jog(&run_at(X, 20.0)).unwrap();
        hands.keeping(1000);
        assert_eq!(hands.run.control.state(), State::Jogging);
        let kept_mm = hands.x_mm();
        assert!(kept_mm > from_mm + 17.0 && kept_mm < from_mm + 20.1, "{kept_mm}");
        // The client is lost: 0.2 s more, less what the last order has used up, and the way of a stop.
        hands.cycles(400);
        assert_eq!(hands.run.control.state(), State::Ready);
        let rest_mm = hands.x_mm();
        assert!(rest_mm - kept_mm < 0.2 * 20.0 + 1.0, "{}", rest_mm - kept_mm);
        // A late renewal, past the operator, too.
        assert_eq!(hands.jog(&KEEP).unwrap_err(), "nothing is being jogged");
        hands.run.operator.give(Command::Jog(JogOrder {
            acceleration_share: 1.0,
            unhomed: false,
            axis: None,
            joints: u64::MAX,
            motion: JogMotion::Keep,
        }));
        hands.cycles(100);
        assert_eq!((hands.run.control.state(), hands.x_mm()), (State::Ready, rest_mm));
        hands.all_is_well();
    });
}

#[test]
fn a_jog_ends_at_the_soft_limit_to_the_last_increment() {
    by_hand_on(&without_probe(), |hands| {
        hands.homed();
        let travel_mm = hands
            .config
            .joints
            .iter()
            .map(|joint| joint.travel_mm)
            .collect::<Vec<_>>();
        hands.jog(&run_at(X, 1000.0)).unwrap();
        hands.jog(&run_at(Jogged::Joint(1), -1000.0)).unwrap();
        hands.keeping(6000);
        let at = hands.position();
        assert_eq!((at.0[0], at.0[1]), (travel_mm[0][1], travel_mm[1][0]));
        assert_eq!(hands.run.control.state(), State::Jogging, "the hand is on the key");
        hands.all_is_well();
        hands.cycles(300);
        hands.jog(&run_at(X, 10.0)).unwrap();
        hands.cycles(300);
        assert_eq!(hands.x_mm(), travel_mm[0][1], "no farther");
        hands.jog(&run_at(X, -10.0)).unwrap();
        hands.cycles(100);
        assert!(hands.x_mm() < travel_mm[0][1]);
        hands.cycles(400);
        hands.all_is_well();
    });
}

#[test]
fn increments_add_up() {
    by_hand(|hands| {
        hands.homed();
        let from_mm = hands.x_mm();
        for _ in 0..10 {
            hands.jog(&advance(0.1)).unwrap();
            hands.cycles(10);
        }
        hands.keeping(300);
        assert!(
            (hands.x_mm() - from_mm - 1.0).abs() < 1e-9,
            "{}",
            hands.x_mm() - from_mm
        );
        hands.all_is_well();
    });
}

#[test]
fn a_hold_and_a_stop_end_a_jog_whatever_the_hand_says() {
    by_hand(|hands| {
        hands.homed();
        hands.jog(&run_at(X, 50.0)).unwrap();
        hands.keeping(500);
        hands.run.operator.give(Command::Hold);
        for _ in 0..10 {
            let _ = hands.jog(&KEEP);
            hands.cycles(50);
        }
        assert_eq!(hands.run.control.state(), State::Ready);
        let rest_mm = hands.x_mm();
        hands.cycles(100);
        assert_eq!(hands.x_mm(), rest_mm);
        // A stop leaves drives on; an order to switch them off does so at rest and not before.
        hands.jog(&run_at(X, 50.0)).unwrap();
        hands.keeping(500);
        let now_ns = hands.run.now_ns();
        hands.run.operator.stop(now_ns);
        hands.reach(State::Stopping);
        hands.reach(State::Ready);
        assert_eq!(hands.run.operator.live().velocity_mm_s, 0.0);
        hands.cycles(100);
        assert_eq!(hands.run.control.state(), State::Ready);
        hands.jog(&run_at(X, -50.0)).unwrap();
        hands.keeping(500);
        let now_ns = hands.run.now_ns();
        hands.run.operator.off(now_ns);
        hands.reach(State::Stopping);
        hands.reach(State::Disabling);
        assert_eq!(hands.run.operator.live().velocity_mm_s, 0.0);
        hands.reach(State::Disabled);
        hands.cycles(50);
        assert_eq!(hands.run.operator.step(), Step::StandBy);
        hands.all_is_well();
    });
}

#[test]
fn a_fault_stops_a_jog_within_the_stop_limits() {
    by_hand(|hands| {
        hands.homed();
        hands.jog(&run_at(X, 100.0)).unwrap();
        hands.keeping(500);
        let now_ns = hands.run.now_ns();
        hands.run.net().at(
            now_ns,
            Disturbance::DriveFault {
                node: 2,
                error_code: 0x7305,
            },
        );
        hands.reach(State::Faulted);
        assert_eq!(hands.run.operator.live().velocity_mm_s, 0.0);
        hands.cycles(50);
        assert_eq!(hands.run.operator.step(), Step::StandBy);
        assert_eq!(hands.run.operator.alarms().len(), 1);
        let over: Vec<_> = hands.run.control.peaks().iter().map(|peaks| peaks.over).collect();
        assert!(over.iter().all(|over| *over == [0; 3]), "{over:?}");
    });
}

#[test]
fn axes_of_an_arm_run_in_the_world_until_the_hand_is_off() {
    by_hand_on(include_str!("../../../../configs/scara-demo.toml"), |hands| {
        hands.homed();
        let begin = hands.position();
        hands.jog(&run_at(X, 50.0)).unwrap();
        hands.keeping(500);
        assert_eq!(hands.run.control.state(), State::Jogging);
        let speed = hands.run.operator.live().velocity_mm_s;
        assert!((speed - 50.0).abs() < 1e-6, "{speed}");
        // Straight in the world, whatever the arms do for it.
        let along = hands.position();
        assert!(along.0[0] > begin.0[0] + 10.0, "{along:?}");
        for axis in [1, 2, 3] {
            assert!((along.0[axis] - begin.0[axis]).abs() < 1e-6, "{along:?} from {begin:?}");
        }
        // The hand is off.
        hands.reach(State::Ready);
        let rest = hands.position();
        assert!(
            rest.0[0] > along.0[0] && rest.0[0] < along.0[0] + 50.0 * 0.5,
            "{rest:?}"
        );
        assert_eq!(hands.jog(&KEEP).unwrap_err(), "nothing is being jogged");

        // And back, another axis along with it.
        hands.jog(&run_at(X, -50.0)).unwrap();
        hands.jog(&run_at(Jogged::Axis(Axis::Z), -10.0)).unwrap();
        hands.keeping(200);
        let back = hands.position();
        assert!(back.0[0] < rest.0[0] - 2.0 && back.0[2] < rest.0[2] - 0.5, "{back:?}");
        assert!(
            hands.run.operator.alarms().is_empty(),
            "{:?}",
            hands.run.operator.alarms()
        );
        // Joints are jogged by their numbers as before.
        hands.reach(State::Ready);
        hands.jog(&run_at(Jogged::Joint(0), 5.0)).unwrap();
        hands.keeping(200);
        let turned = hands.position();
        assert!((turned.0[1] - back.0[1]).abs() > 0.5, "{turned:?}");
        assert!(
            hands.run.operator.alarms().is_empty(),
            "{:?}",
            hands.run.operator.alarms()
        );
    });
}

#[test]
fn axes_of_an_arm_advance_by_a_distance_to_the_end_and_no_farther() {
    by_hand_on(include_str!("../../../../configs/scara-demo.toml"), |hands| {
        hands.homed();
        let begin = hands.position();
        for _ in 0..3 {
            hands.jog(&advance(-2.5)).unwrap();
            hands.cycles(20);
        }
        hands.keeping(1500);
        let end = hands.position();
        assert!((end.0[0] - begin.0[0] + 7.5).abs() < 1e-6, "{end:?} from {begin:?}");
        for axis in [1, 2, 3] {
            assert!((end.0[axis] - begin.0[axis]).abs() < 1e-6, "{end:?} from {begin:?}");
        }
        // The hand is off before the end.
        hands.reach(State::Ready);
        hands.jog(&advance(-50.0)).unwrap();
        hands.reach(State::Ready);
        let way_mm = end.0[0] - hands.position().0[0];
        assert!(
            way_mm > 3.0 && way_mm < 10.0,
            "0.2 s at 20 mm/s and a release: {way_mm}"
        );
        // Beyond the reach, a joint is named.
        hands.jog(&advance(500.0)).unwrap();
        let mut cycles = 0;
        while hands.run.operator.obstruction().is_none() {
            hands.keeping(50);
            cycles += 50;
            assert!(cycles < 40_000, "at {:?}", hands.position());
        }
        hands.reach(State::Ready);
        hands.all_is_well();
    });
}

#[test]
fn an_arm_that_is_nearly_stretched_comes_to_rest_and_the_joint_in_the_way_is_named() {
    by_hand_on(include_str!("../../../../configs/scara-demo.toml"), |hands| {
        hands.homed();
        hands.jog(&run_at(X, 100.0)).unwrap();
        let mut cycles = 0;
        while hands.run.operator.obstruction().is_none() {
            hands.keeping(50);
            cycles += 50;
            assert!(cycles < 20_000, "at {:?}", hands.position());
        }
        let said = hands.run.operator.obstruction().unwrap().to_string();
        assert!(said.contains("joint 1"), "{said}");
        hands.reach(State::Ready);
        assert!(
            hands.run.operator.alarms().is_empty(),
            "{:?}",
            hands.run.operator.alarms()
        );
        let over: Vec<_> = hands.run.control.peaks().iter().map(|peaks| peaks.over).collect();
        assert!(over.iter().all(|over| *over == [0; 3]), "{over:?}");
        // Back it goes, and nothing is in the way any more.
        let end = hands.position();
        hands.jog(&run_at(X, -50.0)).unwrap();
        hands.keeping(1000);
        assert!(
            hands.position().0[0] < end.0[0] - 5.0,
            "{:?} from {end:?}",
            hands.position()
        );
        assert_eq!(hands.run.operator.obstruction(), None);
    });
}

#[test]
fn what_will_come_of_a_jog_is_told() {
    let config = config::parse(
        include_str!("../../../../configs/mill3-demo.toml"),
        Path::new("demo.toml"),
    )
    .unwrap();
    let live = Snapshot {
        position: Position::xyz(300.0, 0.0, 0.0),
        homed: 0b011,
        ..RtStatus::default().snapshot()
    };
    let told = |motion, joints| json!(outlook(motion, joints, &config, &live));
    let unhomed = told(JogMotion::Run { velocity_mm_s: -20.0 }, 0b100);
    assert_eq!(
        unhomed,
        json!({ "axis": "Z", "unit": "mm", "velocity_mm_s": 10.0, "soft_limit_mm": null })
    );
    let advance = |distance_mm, velocity_mm_s| JogMotion::Advance {
        distance_mm,
        velocity_mm_s,
    };
    let expected = |velocity_mm_s: f64, soft_limit_mm: Option<f64>| json!({ "axis": "X", "unit": "mm", "velocity_mm_s": velocity_mm_s, "soft_limit_mm": soft_limit_mm });
    assert_eq!(told(advance(5.0, 20.0), 1), expected(20.0, None));
    assert_eq!(told(advance(5.1, 200.0), 1), expected(150.0, Some(305.0)));
    assert_eq!(told(advance(-400.0, 20.0), 1), expected(20.0, Some(-5.0)));
    assert_eq!(
        told(JogMotion::Run { velocity_mm_s: -20.0 }, 1),
        expected(20.0, Some(-5.0))
    );
    assert_eq!(told(JogMotion::Keep, 1), json!({}));
}

/// The demo's machine, whose probe stops no jog: there are walls just before the ends of its travel.
fn without_probe() -> String {
    let machine = include_str!("../../../../configs/mill3-demo.toml");
    machine.replace("# probe_stops_jog = false", "probe_stops_jog = false")
}

#[test]
fn a_probe_that_comes_into_contact_stops_the_jog_and_out_of_it_the_hand_leads() {
    let jog = |hands: &mut Hands<'_, '_>, distance_mm| {
        hands.jog(&advance(distance_mm)).unwrap();
        for _ in 0..20 {
            // Refused where it has ended.
            let _ = hands.jog(&KEEP);
            hands.cycles(50);
        }
        hands.reach(State::Ready);
        hands.cycles(50);
    };
    by_hand(|hands| {
        hands.homed();
        // The ball of 4 mm at a side at -4 mm.
        jog(hands, -4.9);
        let x_mm = hands.x_mm();
        assert!(x_mm < -2.0 && x_mm > -2.4, "{x_mm}");
        let said = hands.run.operator.obstruction().unwrap();
        assert_eq!(said.text, "jog ended: the probe has touched something");
        jog(hands, 0.1);
        assert!((hands.x_mm() - x_mm - 0.1).abs() < 1e-6, "{} from {x_mm}", hands.x_mm());
        assert_eq!(hands.run.operator.obstruction(), None);
        hands.all_is_well();
    });
    by_hand_on(&without_probe(), |hands| {
        hands.homed();
        jog(hands, -4.9);
        assert!(hands.x_mm() < -4.8, "{}", hands.x_mm());
        assert_eq!(hands.run.operator.obstruction(), None);
    });
}
