//! Whatever comes, and in whatever pieces: each line has one answer, and nothing grows.

use crate::{Answer, ErrorNumber, LINE_MAX, Machine, Order, Session, Status, TAKE_MAX, WAITING_MAX};
use proptest::prelude::*;

/// A control that does all that is wanted, some of it late.
fn serve(session: &mut Session, octets: &[&[u8]], late: &mut Vec<u32>) -> Vec<u8> {
    let mut told = Vec::new();
    for piece in octets {
        session.take(piece);
        while let Some((number, order)) = session.order() {
            match order {
                Order::Status => {
                    let status = Status {
                        is_ready: true,
                        ..Status::default()
                    };
                    session.answered(number, Ok(Answer::Status(Box::new(status))));
                }
                Order::Offsets => session.answered(number, Ok(Answer::Offsets(Box::default()))),
                Order::Probe { .. } => {
                    let place_mm = [0.0; 3];
                    session.answered(
                        number,
                        Ok(Answer::Probed {
                            place_mm,
                            touched: true,
                        }),
                    );
                }
                Order::Lines { text, .. } => {
                    assert!(text.len() <= WAITING_MAX + 4 * LINE_MAX, "{} octets", text.len());
                    late.push(number);
                }
                _ => session.answered(number, Ok(Answer::Done)),
            }
        }
        told.extend(session.output());
    }
    told
}

fn settle(session: &mut Session, late: &mut Vec<u32>) -> Vec<u8> {
    let mut told = Vec::new();
    while !late.is_empty() {
        for number in std::mem::take(late) {
            session.answered(number, Ok(Answer::Done));
        }
        told.extend(serve(session, &[b""], late));
    }
    told
}

/// Lines of words that mean something now and then.
fn line() -> impl Strategy<Value = String> {
    let word = prop_oneof![
        Just("G0".to_owned()),
        Just("G1".to_owned()),
        Just("G2".to_owned()),
        Just("G91".to_owned()),
        Just("G4P0.1".to_owned()),
        Just("M2".to_owned()),
        Just("F100".to_owned()),
        Just("$".to_owned()),
        Just("J=".to_owned()),
        (-100.0..100.0).prop_map(|x| format!("X{x:.3}")),
        (-100.0..100.0).prop_map(|y| format!("Y{y:.3}")),
        "[A-Z][0-9.-]{0,6}",
    ];
    prop::collection::vec(word, 0..6).prop_map(|words| words.concat())
}

proptest! {
    #[test]
    fn octets_in_any_order_and_any_pieces_come_to_the_same_lines(octets in prop::collection::vec(any::<u8>(), 0..400), cut in 1..50_usize) {
        let mut whole = Session::new(Machine::default());
        let mut pieces = Session::new(Machine::default());
        let (mut late, mut late_too) = (Vec::new(), Vec::new());
        let all = serve(&mut whole, &[&octets], &mut late);
        let cut: Vec<&[u8]> = octets.chunks(cut).collect();
        let parts = serve(&mut pieces, &cut, &mut late_too);
        prop_assert!(whole.has_room() && pieces.has_room());
        prop_assert!(all.is_ascii() && parts.is_ascii());
    }

    #[test]
    fn each_line_is_answered_once(lines in prop::collection::vec(line(), 1..60)) {
        let mut session = Session::new(Machine::default());
        let mut late = Vec::new();
        let mut told = serve(&mut session, &[b""], &mut late);
        for line in &lines {
            told.extend(serve(&mut session, &[line.as_bytes(), b"\n"], &mut late));
            told.extend(settle(&mut session, &mut late));
        }
        let told = String::from_utf8(told).unwrap();
        let answers = told.lines().filter(|line| *line == "ok" || line.starts_with("error:")).count();
        prop_assert_eq!(answers, lines.len(), "{}", told);
    }

    /// What the sender may have in its window is never lost, however late the control is.
    #[test]
    fn a_sender_that_counts_octets_is_answered_when_the_control_is_late(count in 1..600_usize) {
        let mut session = Session::new(Machine::default());
        let mut late = Vec::new();
        serve(&mut session, &[b"?"], &mut late);
        let (mut sent, mut answered, mut turns) = (0, 0, 0);
        while answered < count {
            let mut told = Vec::new();
            while sent < count && sent - answered < 10 {
                told.extend(serve(&mut session, &[format!("G1X{sent}F100\n").as_bytes()], &mut late));
                sent += 1;
            }
            turns += 1;
            if turns % 7 == 0 {
                told.extend(settle(&mut session, &mut late));
            }
            answered += String::from_utf8(told).unwrap().lines().filter(|line| *line == "ok").count();
            prop_assert!(turns < 100_000);
        }
        prop_assert_eq!(answered, count);
    }
}

/// Sends without waiting, as long as its octets are taken, while the control answers nothing; then it answers all.
fn flood(octets: &[u8]) -> (String, usize) {
    let mut session = Session::new(Machine::default());
    let (mut told, mut open, mut most) = (Vec::new(), Vec::new(), 0);
    let mut pieces = octets.chunks(TAKE_MAX).peekable();
    loop {
        while session.has_room()
            && let Some(piece) = pieces.next()
        {
            session.take(piece);
        }
        open.extend(std::iter::from_fn(|| session.order()));
        told.extend(session.output());
        most = most.max(open.len());
        let ready = Status {
            is_ready: true,
            ..Status::default()
        };
        for (number, order) in std::mem::take(&mut open) {
            let answer = match order {
                Order::Status => Answer::Status(Box::new(ready.clone())),
                Order::Offsets => Answer::Offsets(Box::default()),
                Order::Probe { .. } => Answer::Probed {
                    place_mm: [0.0; 3],
                    touched: false,
                },
                _ => Answer::Done,
            };
            session.answered(number, Ok(answer));
        }
        open.extend(std::iter::from_fn(|| session.order()));
        told.extend(session.output());
        if open.is_empty() && pieces.peek().is_none() {
            return (String::from_utf8(told).unwrap(), most);
        }
    }
}

#[test]
fn a_flood_of_lines_is_answered_line_by_line() {
    // Blank lines are the most that fit into what is taken at once; the dwell keeps those behind it waiting.
    for text in ["\n".repeat(10_000), "G4P1\n\n\nG1X1F100\n".repeat(2000)] {
        let (told, most) = flood(text.as_bytes());
        let answers = told
            .lines()
            .filter(|line| *line == "ok" || line.starts_with("error:"))
            .count();
        assert_eq!(answers, text.matches('\n').count());
        assert!(most < 20, "{most} orders at once");
    }
}

#[test]
fn numbers_of_errors_are_those_of_grbl() {
    assert_eq!(ErrorNumber::Unsupported as u8, 20);
    assert_eq!(ErrorNumber::Tool as u8, 38);
}
