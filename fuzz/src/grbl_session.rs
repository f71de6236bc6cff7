//! Any octets as a sender of the Grbl port, and a control that answers early, late, or with refusals and alarms: the session never
//! grows beyond its limits, and each order is answered at most once.

use grbl::{Activity, Answer, Axis, LINE_MAX, Machine, Order, Session, Status, WAITING_MAX};
use std::collections::VecDeque;

fn machine() -> Machine {
    let axis = Axis {
        travel_mm: [-100.0, 100.0],
        velocity_mm_min: 6000.0,
        acceleration_mm_s2: 500.0,
    };
    Machine {
        axes: [Some(axis), Some(axis), None],
        rpm_max: 10_000.0,
        feed_percent: [10, 120],
        spindle_percent: [50, 120],
    }
}

/// One run of the fuzzer: octets of the sender; F0h to F7h are turns of the control instead.
pub fn run(octets: &[u8]) {
    let mut session = Session::new(machine());
    let mut orders = VecDeque::new();
    let mut status = Status {
        is_ready: true,
        ..Status::default()
    };
    for octet in octets {
        match octet {
            0xF0 => session.tick(),
            0xF1 => status.alarm = Some("X 400.000 mm is machine 400.000, travel ends at 305.000".into()),
            0xF2 => (status.alarm, status.waiting) = (None, None),
            0xF3 => status.waiting = Some("the program waits".into()),
            0xF4..=0xF6 => {
                status.activity = match octet {
                    0xF4 => Activity::Idle,
                    0xF5 => Activity::Running,
                    _ => Activity::Jogging,
                };
            }
            0xF7 => {
                if let Some((number, _)) = orders.pop_front() {
                    session.answered(number, Err("refused [so]".into()));
                }
            }
            0xF8 => {
                if let Some((number, order)) = orders.pop_front() {
                    let answer = match order {
                        Order::Status => Answer::Status(Box::new(status.clone())),
                        Order::Offsets => Answer::Offsets(Box::default()),
                        Order::Probe { .. } => Answer::Probed {
                            place_mm: [1.0; 3],
                            touched: true,
                        },
                        _ => Answer::Done,
                    };
                    session.answered(number, Ok(answer));
                }
            }
            octet if session.has_room() => session.take(&[*octet]),
            _ => {}
        }
        while let Some((number, order)) = session.order() {
            assert!(orders.iter().all(|(other, _)| *other != number), "{number} twice");
            if let Order::Lines { text, .. } = &order {
                assert!(text.len() <= WAITING_MAX + 4 * LINE_MAX, "{} octets", text.len());
            }
            orders.push_back((number, order));
        }
        assert!(session.output().is_ascii());
    }
}
