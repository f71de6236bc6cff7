//! Tool-centre-point control through the whole path, on virtual time: what the joints of a simulated five-axis machine really
//! do is turned back into where the tip of the tool is on the work.

use isocnc::config;
use isocnc::machine::sequence::Outcome;
use isocnc::machine::state::State;
use isocnc::operator::rehearsal::rehearse;
use isocnc::sim::NetConfig;
use motion::kinematics::ToolFrame;
use std::path::Path;

/// Line of [`PROGRAM`] on which the tip stands still while the work turns, and the next one, on which it goes straight.
const TURNING: u32 = 4;
const STRAIGHT: u32 = 5;
/// `@` is the letter of the axis that tilts. Without a tool the programmed point is the gauge point of the spindle.
const PROGRAM: &str = "G21 G90 G61\n\
                       G0 X30 Y20 Z10\n\
                       G43.4 H0\n\
                       G1 @-40 C60 F600\n\
                       G1 X50 Y20 Z10 @-20 C10 F300\n\
                       G49\n\
                       M2\n";
/// By so much drives are behind their set-points, rotary ones seen at the tip.
const FOLLOWING_MM: f64 = 0.1;
/// Where line 2 goes.
const BEGIN: [f64; 3] = [30.0, 20.0, 10.0];
const CYCLES_MAX: u64 = 60_000;

#[test]
fn the_tip_stands_still_while_the_work_turns_and_goes_straight_while_all_joints_move() {
    for (name, tilts, text) in [
        (
            "trunnion5-demo.toml",
            "A",
            include_str!("../configs/trunnion5-demo.toml"),
        ),
        ("head5-demo.toml", "B", include_str!("../configs/head5-demo.toml")),
    ] {
        let config = config::parse(text, Path::new(name)).expect("a good machine file");
        let (kinematics, frame) = (
            config.kinematics(),
            ToolFrame {
                tcp: true,
                length_mm: 0.0,
            },
        );
        let count = config.joints.len();
        let mut zero = Vec::new();
        // For each line: the tips on it, and how far the first joint went.
        let mut tips: [Vec<[f64; 3]>; 2] = Default::default();
        let mut first_joint = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        let program = PROGRAM.replace('@', tilts);
        rehearse(&config, program.as_bytes(), NetConfig::clean(1), |run| {
            let ended = run.run_until(CYCLES_MAX, |run| {
                let machine = run.net().machine();
                let joints: Vec<f64> = (0..count)
                    .map(|joint| machine.joint_position_mm(joint).expect("a joint"))
                    .collect();
                // Homing calls the place where the joints stand zero.
                if run.control.state() == State::Ready && zero.is_empty() {
                    zero.clone_from(&joints);
                }
                let line = run.operator.live().line;
                let on = [TURNING, STRAIGHT].iter().position(|&number| line == number);
                if let (Some(on), State::Running) = (on, run.control.state()) {
                    let joints: Vec<f64> = joints.iter().zip(&zero).map(|(joint, zero)| joint - zero).collect();
                    let tip = kinematics.forward(&frame, &joints).expect("a place of the machine").0;
                    tips[on].push([tip[0], tip[1], tip[2]]);
                    first_joint[on] = [first_joint[on][0].min(joints[0]), first_joint[on][1].max(joints[0])];
                }
                run.operator.outcome().is_some()
            })?;
            assert!(ended, "{name}: no end");
            assert_eq!(
                run.operator.outcome(),
                Some(Outcome::Completed),
                "{name}: {:?}",
                run.operator.journal()
            );
            Ok(())
        })
        .expect("a machine that can be rehearsed");

        for (tips, first_joint) in tips.iter().zip(first_joint) {
            assert!(tips.len() > 500, "{name}: {} cycles", tips.len());
            assert!(
                first_joint[1] - first_joint[0] > 5.0,
                "{name}: joint 0 on {first_joint:?}"
            );
        }
        let [standing, straight] = &tips;
        let begin = BEGIN;
        for tip in standing {
            let off = (0..3).map(|axis| (tip[axis] - begin[axis]).powi(2)).sum::<f64>().sqrt();
            assert!(
                off < FOLLOWING_MM,
                "{name}: the tip is {off} mm from where it should stand"
            );
        }
        for tip in straight {
            let off = (1..3).map(|axis| (tip[axis] - begin[axis]).powi(2)).sum::<f64>().sqrt();
            assert!(off < FOLLOWING_MM, "{name}: the tip is {off} mm off its line along X");
        }
        assert!(
            (straight[straight.len() - 1][0] - begin[0] - 20.0).abs() < FOLLOWING_MM,
            "{name}"
        );
    }
}
