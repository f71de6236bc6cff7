//! Starts in the middle of a program: the events from there on are those of a run from the start.

use gcode::{Interpreter, Settings, Tool, ToolTable};
use motion::canon::{Call, Event, PathMode, Position, SpindleDirection};
use proptest::prelude::*;

const PROGRAM: &str = "\
o100 sub
  G1 X[#1 + #<_depth>] F#2
o100 endsub
G21 G90 G64 P0.01
#<_depth> = -2
G55 S800 M3 M8
G0 X1 Y2
#5 = 0
o1 while [#5 LT 3]
  o100 call [#5] [100 + #5]
  #5 = [#5 + 1]
o1 endwhile

G91 G1 Y1
o2 if [#5 EQ 7]
  G0 Z99
o2 endif
G90 G1 X0 (last)
M2
";

fn settings() -> Settings {
    let mut settings = Settings::default();
    settings.work_offsets[1] = Position::xyz(10.0, 0.0, 0.0);
    settings
}

fn events(text: &str) -> Vec<Event> {
    let run = Interpreter::new(settings()).run(text.as_bytes());
    run.map(|event| event.expect("a good program")).collect()
}

#[test]
fn the_state_is_told_in_the_order_in_which_it_is_to_be_established() {
    let mut run = Interpreter::new(settings()).run(PROGRAM.as_bytes());
    let resume = run.start_at_line(14).unwrap();
    assert_eq!(resume.from, Position::xyz(0.0, 2.0, 0.0));
    assert_eq!(resume.machine, Position::xyz(10.0, 2.0, 0.0));
    assert_eq!(resume.assumptions, [""; 0]);
    let at = |wanted: &Call| {
        let found = resume.calls.iter().position(|call| call == wanted);
        found.unwrap_or_else(|| panic!("{wanted:?} in {:?}", resume.calls))
    };
    let order = [
        at(&Call::SetG5xOffset {
            system: 2,
            origin: Position::xyz(10.0, 0.0, 0.0),
        }),
        at(&Call::SetPathMode(PathMode::Continuous {
            tolerance_mm: Some(0.01),
            naive_cam_tolerance_mm: Some(0.01),
        })),
        at(&Call::SetSpindleSpeed {
            spindle: 0,
            speed: 800.0,
        }),
        at(&Call::StartSpindle {
            spindle: 0,
            direction: SpindleDirection::Clockwise,
            wait_for_speed: true,
        }),
        at(&Call::Flood(true)),
        at(&Call::SetFeedRate {
            linear: 1.7,
            angular: 1.7,
        }),
        at(&Call::StraightTraverse { to: resume.from }),
    ];
    assert!(order.is_sorted(), "{order:?}");
    assert_eq!(order[6] + 1, resume.calls.len());
    let next = run.find_map(|event| match event.unwrap().call {
        Call::StraightFeed { to } => Some(to),
        _ => None,
    });
    assert_eq!(next, Some(Position::xyz(0.0, 3.0, 0.0)));
}

#[test]
fn a_line_of_a_loop_or_subroutine_is_reached_when_it_is_run_first() {
    let mut run = Interpreter::new(settings()).run(PROGRAM.as_bytes());
    run.start_at_line(2).unwrap();
    let rest: Vec<Event> = run.map(Result::unwrap).collect();
    let feeds = rest
        .iter()
        .filter(|event| matches!(event.call, Call::StraightFeed { .. }));
    assert_eq!(feeds.count(), 5);
}

#[test]
fn lines_at_which_a_program_cannot_start() {
    let refused = |text: &str, line: u32| {
        let mut run = Interpreter::new(settings()).run(text.as_bytes());
        let error = run.start_at_line(line).unwrap_err().to_string();
        assert!(run.next().is_none());
        error
    };
    let never = "is never run: it lies behind the end of the program or in a block that is passed over";
    assert!(refused(PROGRAM, 16).ends_with(&format!("line 16 {never}")));
    assert!(refused(PROGRAM, 99).ends_with(&format!("line 99 {never}")));
    assert_eq!(refused("G0 X1\nG1 X2\nM2\n", 3), "2:1: G1 needs a feed: F is not set");
    let compensated = "G1 F100 X1\nG41.1 D2\nG1 X10\nG1 Y10\nG40\nG1 X20\nM2\n";
    assert!(refused(compensated, 4).ends_with("as cutter compensation is on there: start before its G41 or G42"));
}

#[test]
fn what_only_the_machine_knows_is_told_as_an_assumption() {
    let mut tools = ToolTable::default();
    tools
        .set(Tool {
            number: 4,
            pocket: 1,
            ..Tool::default()
        })
        .unwrap();
    let settings = Settings {
        tools,
        ..Settings::default()
    };
    let mut run = Interpreter::new(settings).run(b"T4 M6\nG1 F10 X1\nM2\n");
    let resume = run.start_at_line(2).unwrap();
    assert_eq!(resume.assumptions, ["line 1: that the change brought tool 4"]);
    assert!(resume.calls.contains(&Call::ChangeTool { tool: 4, pocket: 1 }));
}

proptest! {
    /// The events behind a start at any line that is run at the program's own level are those of the whole run.
    #[test]
    fn events_from_a_line_on_are_those_of_the_whole_run(line in prop_oneof![4_u32..=9, 12_u32..=15, 18_u32..=19]) {
        let all = events(PROGRAM);
        let mut run = Interpreter::new(settings()).run(PROGRAM.as_bytes());
        run.start_at_line(line).unwrap();
        let rest: Vec<Event> = run.map(Result::unwrap).collect();
        prop_assert!(!rest.is_empty());
        prop_assert_eq!(&all[all.len() - rest.len()..], &rest[..]);
        prop_assert!(all[all.len() - rest.len() - 1].source.line != line);
    }
}
