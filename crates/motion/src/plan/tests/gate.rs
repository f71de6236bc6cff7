//! What the gate refuses is planned anew; nothing of it is handed over.

use super::*;
use crate::element::{Element, Span};
use crate::plan::offline::{Recorder, sample};

const P: f64 = 0.01;

/// Lines and arcs at feed, with corners of all kinds.
fn calls() -> Vec<Event> {
    let arc = Call::ArcFeed {
        to: Position::xyz(40.0, 40.0, 0.0),
        plane: Plane::Xy,
        centre_mm: [40.0, 20.0],
        turns: 1,
    };
    let lines = (1..60).map(|k| {
        let angle = f64::from(k) * 0.1;
        feed(40.0 - 20.0 * angle.sin(), 20.0 + 20.0 * angle.cos(), 0.3 * angle)
    });
    let moves = [feed(20.0, 0.0, 0.0), feed(40.0, 0.0, 0.0), arc];
    events(
        [F, ROUND]
            .into_iter()
            .chain(moves)
            .chain(lines)
            .chain([feed(0.0, 0.0, 10.0)]),
    )
}

/// The span in the midst of a publication that moves.
fn midst(elements: &mut [Element]) -> Option<&mut Span> {
    let count = elements.len();
    elements.iter_mut().skip(count / 2).find_map(|element| match element {
        Element::Span(span) if span.v0 > 5.0 => Some(span),
        _ => None,
    })
}

fn plan(planner_kind: PlannerKind, spoil: Spoil) -> (Pumped, u64, Vec<Element>) {
    let settings = Settings {
        planner_kind,
        tolerance_mm: P,
        ..settings()
    };
    let mut planner = Planner::new(settings, Recorder::default());
    planner.spoil(spoil);
    let mut pumped = Pumped::Hungry;
    for event in &calls() {
        planner.push(event).unwrap();
        pumped = planner.pump();
    }
    planner.finish();
    for _ in 0..1000 {
        pumped = planner.pump();
        if matches!(pumped, Pumped::Done | Pumped::Refused { .. }) {
            break;
        }
    }
    let planned_anew = planner.planned_anew();
    (pumped, planned_anew, std::mem::take(&mut planner.sink().elements))
}

/// What is done to a publication; whether something in it could be spoiled.
type Spoil = fn(&mut [Element]) -> bool;

const SPOILERS: [(&str, Spoil); 6] = [
    ("a jump", |elements| {
        midst(elements).map(|span| span.s0 += 1e-3).is_some()
    }),
    ("a step of speed", |elements| {
        midst(elements).map(|span| span.v0 *= 1.5).is_some()
    }),
    ("a step of acceleration", |elements| {
        midst(elements).map(|span| span.a0 += 300.0).is_some()
    }),
    ("no number", |elements| {
        midst(elements).map(|span| span.jerk = f64::NAN).is_some()
    }),
    ("no end", |elements| {
        midst(elements).map(|span| span.duration_s = f64::INFINITY).is_some()
    }),
    ("another piece", |elements| {
        let other = Piece::line(Position::ZERO, Position::xyz(500.0, 0.0, 0.0)).unwrap();
        midst(elements).map(|span| span.piece = other).is_some()
    }),
];

#[test]
fn what_the_gate_refuses_is_planned_anew_and_nothing_of_it_is_handed_over() {
    let (_, clean, whole) = plan(PlannerKind::Optimal, |_| false);
    assert_eq!(clean, 0);
    let settings = settings();
    let end = |elements: &[Element]| *sample(elements, settings.start, settings.cycle_s).last().unwrap();
    for (what, spoil) in SPOILERS {
        let (pumped, planned_anew, elements) = plan(PlannerKind::Optimal, spoil);
        assert_eq!((pumped, planned_anew), (Pumped::Done, 1), "{what}");
        let samples = sample(&elements, settings.start, settings.cycle_s);
        assert_eq!(check(&samples, settings.cycle_s, &settings.axes).over(), 0, "{what}");
        assert_eq!(end(&elements), end(&whole), "{what}");
    }
}

#[test]
fn the_classic_planner_ends_before_what_the_gate_refuses() {
    for (what, spoil) in SPOILERS {
        let (pumped, _, elements) = plan(PlannerKind::Classic, spoil);
        assert!(matches!(pumped, Pumped::Refused { .. }), "{what}: {pumped:?}");
        let settings = settings();
        let samples = sample(&elements, settings.start, settings.cycle_s);
        let peaks = check(&samples, settings.cycle_s, &settings.axes);
        assert_eq!(peaks.velocity.over, 0, "{what}");
    }
}

#[test]
fn what_is_refused_again_and_again_ends_the_plan_with_its_line() {
    let (pumped, planned_anew, _) = plan(PlannerKind::Optimal, |elements| {
        if let Some(span) = midst(elements) {
            span.v0 += 10.0;
        }
        false
    });
    let Pumped::Refused { line } = pumped else {
        panic!("{pumped:?}")
    };
    assert!(line > 0 && planned_anew >= 2, "{line} {planned_anew}");
}
