//! What kinematics cost: the inverse of five axes with tool-centre-point control, plain and with derivatives, and a whole
//! interpolation step with it.
//!
//! `cargo bench --bench kinematics`

use motion::canon::{Axis, Position};
use motion::element::{Auxiliary, Element, Enables, Span};
use motion::kinematics::{Follows, Hand, Jet3, Kinematics, Rotary, RotaryAxis, TableTable, ToolFrame, Transform};
use motion::path::Piece;
use motion::ring::{self, Sink};
use motion::rt::{Interpolator, MotionLimits, ScaleRamp, StopLimits};
use std::hint::black_box;
use std::time::Instant;

const LETTERS: [Axis; 5] = [Axis::X, Axis::Y, Axis::Z, Axis::A, Axis::C];
const FRAME: ToolFrame = ToolFrame {
    tcp: true,
    length_mm: 60.0,
};
const ROUNDS: u32 = 1_000_000;

fn machine(transform: Transform) -> Kinematics {
    let follows = LETTERS.map(|axis| Follows {
        axis: Some(axis),
        offset: 0.0,
    });
    Kinematics::new(transform, &follows)
}

/// Nanoseconds of one call, on the mean.
fn mean_ns(mut call: impl FnMut(u32)) -> f64 {
    let begin = Instant::now();
    for round in 0..ROUNDS {
        call(round);
    }
    begin.elapsed().as_secs_f64() * 1e9 / f64::from(ROUNDS)
}

fn main() {
    let rotary = |axis| Rotary {
        axis,
        hand: Hand::Left,
        centre_mm: [1.0, 2.0, -30.0],
    };
    let trunnion = TableTable {
        primary: rotary(RotaryAxis::A),
        secondary: rotary(RotaryAxis::C),
    };
    let start = Position([10.0, 20.0, 30.0, 5.0, 0.0, 7.0, 0.0, 0.0, 0.0]);
    let end = Position([60.0, -20.0, 35.0, 25.0, 0.0, 90.0, 0.0, 0.0, 0.0]);
    let piece = Piece::line(start, end).expect("two places").in_frame(FRAME);
    let place = |round: u32| piece.length() * f64::from(round % 1000) / 1000.0;

    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    println!("load {}", load.trim());
    for (name, kinematics) in [
        ("trivial", machine(Transform::Trivial)),
        ("five axes, table on table", machine(Transform::TableTable(trunnion))),
    ] {
        let mut joints = [0.0; 5];
        let ns = mean_ns(|round| {
            let axes = black_box(piece.position(place(round)));
            let _ = black_box(kinematics.inverse(&FRAME, &axes.0, &mut joints));
        });
        println!("{name}: position and inverse {ns:.0} ns");
        let mut joints = [Jet3::ZERO; 5];
        let ns = mean_ns(|round| {
            let jet = black_box(piece.jet(place(round)));
            let _ = black_box(kinematics.jets(&FRAME, &jet, &mut joints));
        });
        println!("{name}: path and joints with three derivatives {ns:.0} ns");

        let (mut producer, consumer) = ring::channel(64);
        let span = Span {
            piece,
            s0: 0.0,
            v0: piece.length() / (f64::from(ROUNDS) * 1e-3),
            a0: 0.0,
            jerk: 0.0,
            gradient: 0.0,
            duration_s: f64::from(ROUNDS) * 1e-3,
            line: 1,
            rapid: false,
            enables: Enables::default(),
            auxiliary: Auxiliary::INITIAL,
            modes: 0,
        };
        producer.publish(&[Element::Span(span)], &[]);
        let plan = MotionLimits {
            velocity: 100.0,
            acceleration: 1000.0,
            jerk: 20_000.0,
        };
        let stop = StopLimits {
            acceleration: 2000.0,
            jerk: 80_000.0,
        };
        let mut interpolator = Interpolator::new(consumer, start, ScaleRamp::new(&[(plan, stop)], 1e-3));
        let mut joints = [0.0; 5];
        let ns = mean_ns(|_| {
            let sample = interpolator.step(1.0);
            let _ = black_box(kinematics.inverse(&sample.frame, &sample.position.0, &mut joints));
        });
        println!("{name}: whole interpolation step with inverse {ns:.0} ns");
    }
}
