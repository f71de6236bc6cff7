//! The loop against its reference, and against amplifiers.

use super::*;
use proptest::prelude::*;
use std::fmt::Write as _;
use std::io::Write as _;
use std::process::{Command, Stdio};

const PERIOD_S: f64 = 1e-3;
/// That the reference is missing is told once.
static SKIPPED: std::sync::Once = std::sync::Once::new();

/// Outputs and limits of the reference for these gains and calls; `None`: there is no Python.
fn reference(gains: &PidGains, start: f64, calls: &[(f64, f64)]) -> Option<Vec<(f64, f64)>> {
    let mut child = Command::new("python3")
        .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/src/rt/pid/reference.py"))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .ok()?;
    let [ff0, ff1, ff2, ff3] = gains.ff;
    let [velocity_max, acceleration_max, jerk_max] = gains.ff_max;
    let numbers = [
        PERIOD_S,
        gains.p,
        gains.i,
        gains.d,
        ff0,
        ff1,
        ff2,
        ff3,
        gains.bias,
        gains.dead_band,
        gains.error_max,
        gains.integral_max,
        gains.derivative_max,
        velocity_max,
        acceleration_max,
        jerk_max,
        gains.output_max,
    ];
    let mut text: String = numbers.iter().map(|number| format!("{number:?} ")).collect();
    let _ = writeln!(text, "\n{start:?}");
    for (command, feedback) in calls {
        let _ = writeln!(text, "{command:?} {feedback:?}");
    }
    child.stdin.take().unwrap().write_all(text.as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success());
    let said = String::from_utf8(output.stdout).unwrap();
    let rows = said.lines().map(|line| {
        let (output, limited) = line.split_once(' ').unwrap();
        (output.parse().unwrap(), limited.parse().unwrap())
    });
    Some(rows.collect())
}

fn gains() -> impl Strategy<Value = PidGains> {
    let limit = |most: f64| prop_oneof![Just(0.0), 0.01..most];
    (
        (0.0..200.0, 0.0..500.0, 0.0..2.0, -1.0..1.0),
        prop::array::uniform4(-1.0..1.0),
        (limit(0.1), limit(2.0), limit(0.5), limit(50.0)),
        (prop::array::uniform3(limit(1e3)), limit(80.0)),
    )
        .prop_map(
            |((p, i, d, bias), ff, (dead_band, error_max, integral_max, derivative_max), (ff_max, output_max))| {
                PidGains {
                    p,
                    i,
                    d,
                    ff: [ff[0] * 0.1, ff[1], ff[2] * 0.01, ff[3] * 1e-5],
                    bias,
                    dead_band,
                    error_max,
                    integral_max,
                    derivative_max,
                    ff_max,
                    output_max,
                }
            },
        )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn every_output_is_that_of_the_reference(
        gains in gains(),
        calls in prop::collection::vec((-2.0..2.0, -2.0..2.0), 1..200),
        start in -2.0..2.0,
    ) {
        let mut pid = Pid::new(gains, PERIOD_S);
        pid.restart(start);
        let Some(wanted) = reference(&gains, start, &calls) else {
            SKIPPED.call_once(|| {
                // Past the harness, which keeps to itself what a test that passes prints.
                let _ = writeln!(std::io::stderr(), "skipped: the reference of the position loop needs python3");
            });
            return Ok(());
        };
        prop_assert_eq!(wanted.len(), calls.len());
        for (call, ((command, feedback), (output, limited))) in calls.iter().zip(wanted).enumerate() {
            let found = pid.step(*command, *feedback);
            prop_assert!((found - output).abs() <= 1e-9 * output.abs().max(1.0), "call {}: {} {}", call, found, output);
            prop_assert_eq!(pid.limited, limited);
        }
    }
}

/// A velocity amplifier with a motor that follows in `lag_s`, and two cycles from the set-point to what is measured of it.
struct Amplifier {
    lag_s: f64,
    wire: [f64; 2],
    velocity: f64,
    position: f64,
}

impl Amplifier {
    fn step(&mut self, wanted: f64) -> f64 {
        let [now, next] = self.wire;
        self.wire = [next, wanted];
        self.velocity += (now - self.velocity) * (1.0 - (-PERIOD_S / self.lag_s).exp());
        self.position += self.velocity * PERIOD_S;
        self.position
    }
}

fn amplifier() -> Amplifier {
    Amplifier {
        lag_s: 0.004,
        wire: [0.0; 2],
        velocity: 0.0,
        position: 0.0,
    }
}

#[test]
fn a_velocity_amplifier_follows_without_error_at_constant_speed_and_settles() {
    let gains = PidGains {
        p: 40.0,
        ff: [0.0, 1.0, 0.0, 0.0],
        output_max: 200.0,
        ..PidGains::default()
    };
    let (mut pid, mut amplifier) = (Pid::new(gains, PERIOD_S), amplifier());
    let (mut command, mut position) = (0.0, 0.0);
    for _ in 0..1000 {
        command += 100.0 * PERIOD_S;
        position = amplifier.step(pid.step(command, position));
    }
    assert!(pid.error().abs() < 1e-6, "{}", pid.error());
    for _ in 0..1000 {
        position = amplifier.step(pid.step(command, position));
    }
    assert!((position - command).abs() < 1e-9, "{position} {command}");
}

#[test]
fn an_integral_takes_a_steady_load_away_and_does_not_wind_up_at_the_limit() {
    let gains = PidGains {
        p: 30.0,
        i: 100.0,
        ff: [0.0, 1.0, 0.0, 0.0],
        output_max: 10.0,
        ..PidGains::default()
    };
    let (mut pid, mut amplifier) = (Pid::new(gains, PERIOD_S), amplifier());
    let mut position = 0.0;
    let mut most = 0.0_f64;
    // A step of 50 with at most 10 a second, against an offset of the amplifier.
    for _ in 0..8000 {
        position = amplifier.step(pid.step(50.0, position) - 0.5);
        most = most.max(position);
    }
    assert!((position - 50.0).abs() < 1e-3, "{position}");
    assert!(most < 50.5, "overshoot to {most}");
}

#[test]
fn a_loop_begins_without_a_jump_and_forgets_what_was_before() {
    let gains = PidGains {
        p: 40.0,
        i: 10.0,
        d: 0.1,
        ff: [0.0, 1.0, 0.1, 0.0],
        ..PidGains::default()
    };
    let mut pid = Pid::new(gains, PERIOD_S);
    pid.step(1.0, -1.0);
    pid.restart(123.4);
    assert_eq!(pid.step(123.4, 123.4), 0.0);
    assert!(!pid.is_saturated());
}

#[test]
fn a_period_that_was_left_out_is_no_speed() {
    let gains = PidGains {
        d: 1.0,
        ..PidGains::default()
    };
    let mut pid = Pid::new(gains, PERIOD_S);
    pid.restart(0.0);
    // At 100 a second, the joint as the command.
    assert!(pid.step(0.1, 0.1).abs() < 1e-9);
    pid.leave_out(2);
    assert!(pid.step(0.2, 0.4).abs() < 1e-9, "three periods' way in three periods");
    assert!(pid.step(0.3, 0.5).abs() < 1e-9);
}

#[test]
fn other_gains_leave_the_integral_where_it_is() {
    let gains = PidGains {
        i: 10.0,
        ..PidGains::default()
    };
    let mut pid = Pid::new(gains, PERIOD_S);
    pid.restart(0.0);
    pid.step(1.0, 0.0);
    pid.step(1.0, 0.0);
    let before = pid.step(1.0, 1.0);
    assert!(before > 0.0);
    pid.set_gains(PidGains { i: 20.0, ..gains });
    assert!((pid.step(1.0, 1.0) - before).abs() < 1e-12);
    pid.set_gains(PidGains::default());
    assert_eq!(pid.step(1.0, 1.0), 0.0);
}
