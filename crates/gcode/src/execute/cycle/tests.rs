use super::*;
use crate::Interpreter;
use crate::printed::printed;
use crate::{NoMachine, Settings, printed::printed_with};
use motion::canon::{Event, Position};
use proptest::prelude::*;

/// The calls of a program on one line; of moves X, Y and Z, without zeros at the end of numbers.
fn short(program: &str) -> String {
    let settings = Settings {
        spindles: 2,
        ..Settings::default()
    };
    let text = printed_with(program, settings, NoMachine);
    let calls = text.lines().map(|call| {
        let call = call
            .replace("STRAIGHT_TRAVERSE(", "rapid ")
            .replace("STRAIGHT_FEED(", "feed ")
            .replace(", 0.0000, 0.0000, 0.0000)", "")
            .replace(".0000", "");
        let trim = |word: &str| match word.contains('.') && word.starts_with(|c: char| c == '-' || c.is_ascii_digit()) {
            true => word.trim_end_matches('0').to_string(),
            false => word.to_string(),
        };
        call.split(", ")
            .map(|part| part.split(' ').map(trim).collect::<Vec<_>>().join(" "))
            .collect::<Vec<_>>()
            .join(" ")
    });
    calls.collect::<Vec<_>>().join("; ")
}

/// What LinuxCNC prints of each cycle behind "F100 G61 G98 G0 Z5".
const EACH: [(&str, &str); 11] = [
    (
        "G73 X1 Z-2 R1 Q1.25 D0.254",
        "rapid 1 0 5; rapid 1 0 1; feed 1 0 -0.25; rapid 1 0 0.004; feed 1 0 -1.5; rapid 1 0 -1.246; feed 1 0 -2; rapid 1 0 5",
    ),
    (
        "M4 G74 X1 Z-2 R1",
        "START_SPINDLE_COUNTERCLOCKWISE(0); rapid 1 0 5; rapid 1 0 1; DISABLE_FEED_OVERRIDE(); DISABLE_SPEED_OVERRIDE(0); \
         feed 1 0 -2; STOP_SPINDLE_TURNING(0); START_SPINDLE_CLOCKWISE(0); DWELL(0); feed 1 0 5; STOP_SPINDLE_TURNING(0); \
         START_SPINDLE_COUNTERCLOCKWISE(0); ENABLE_FEED_OVERRIDE(); ENABLE_SPEED_OVERRIDE(0)",
    ),
    ("G81 X1 Z-2 R1", "rapid 1 0 5; rapid 1 0 1; feed 1 0 -2; rapid 1 0 5"),
    (
        "G82 X1 Z-2 R1 P0.25",
        "rapid 1 0 5; rapid 1 0 1; feed 1 0 -2; DWELL(0.2500); rapid 1 0 5",
    ),
    (
        "G83 X1 Z-2 R1 Q1.25 D0.254",
        "rapid 1 0 5; rapid 1 0 1; feed 1 0 -0.25; rapid 1 0 1; rapid 1 0 0.004; feed 1 0 -1.5; rapid 1 0 1; \
         rapid 1 0 -1.246; feed 1 0 -2; rapid 1 0 5",
    ),
    (
        "M3 G84 X1 Z-2 R1 P0.25",
        "START_SPINDLE_CLOCKWISE(0); rapid 1 0 5; rapid 1 0 1; DISABLE_FEED_OVERRIDE(); DISABLE_SPEED_OVERRIDE(0); \
         feed 1 0 -2; STOP_SPINDLE_TURNING(0); START_SPINDLE_COUNTERCLOCKWISE(0); DWELL(0.2500); feed 1 0 5; \
         STOP_SPINDLE_TURNING(0); START_SPINDLE_CLOCKWISE(0); ENABLE_FEED_OVERRIDE(); ENABLE_SPEED_OVERRIDE(0)",
    ),
    (
        "G85 X1 Z-2 R1",
        "rapid 1 0 5; rapid 1 0 1; feed 1 0 -2; feed 1 0 1; rapid 1 0 5",
    ),
    (
        "M4 G86 X1 Z-2 R1 P0.25",
        "START_SPINDLE_COUNTERCLOCKWISE(0); rapid 1 0 5; rapid 1 0 1; feed 1 0 -2; DWELL(0.2500); STOP_SPINDLE_TURNING(0); \
         rapid 1 0 5; START_SPINDLE_COUNTERCLOCKWISE(0)",
    ),
    (
        "M3 G87 X1 Z-2 R1 I0.5 J0.25 K-1",
        "START_SPINDLE_CLOCKWISE(0); rapid 1 0 5; rapid 1 0 1; rapid 1.5 0.25 1; STOP_SPINDLE_TURNING(0); \
         ORIENT_SPINDLE(0 0 2); rapid 1.5 0.25 -2; rapid 1 0 -2; START_SPINDLE_CLOCKWISE(0); feed 1 0 -1; feed 1 0 -2; \
         STOP_SPINDLE_TURNING(0); ORIENT_SPINDLE(0 0 2); rapid 1.5 0.25 -2; rapid 1.5 0.25 5; rapid 1 0 5; \
         START_SPINDLE_CLOCKWISE(0)",
    ),
    (
        "M3 G88 X1 Z-2 R1 P0.25",
        "START_SPINDLE_CLOCKWISE(0); rapid 1 0 5; rapid 1 0 1; feed 1 0 -2; DWELL(0.2500); STOP_SPINDLE_TURNING(0); \
         PROGRAM_STOP(); START_SPINDLE_CLOCKWISE(0)",
    ),
    (
        "G89 X1 Z-2 R1 P0.25",
        "rapid 1 0 5; rapid 1 0 1; feed 1 0 -2; DWELL(0.2500); feed 1 0 5",
    ),
];

#[test]
fn each_cycle_makes_its_hole_as_linuxcnc_does() {
    let start = "SET_FEED_RATE(100); SET_MOTION_CONTROL_MODE(CANON_EXACT_PATH); \
                 COMMENT(\"interpreter: retract mode set to old_z\"); rapid 0 0 5; ";
    for (line, expected) in EACH {
        let program = format!("F100 G61 G98 G0 Z5\n{line}\nM2\n");
        assert_eq!(short(&program), format!("{start}{expected}"), "{line}");
    }
}

#[test]
fn a_tap_in_another_plane_goes_along_its_normal() {
    // LinuxCNC exchanges the axes here and feeds to another place.
    let moves = |program: &str| {
        let all = short(program);
        let moves: Vec<&str> = all
            .split("; ")
            .filter(|call| call.starts_with("feed") || call.starts_with("rapid"))
            .collect();
        moves.join("; ")
    };
    assert_eq!(
        moves("F100 M3 S1 G18 G0 Y5\nG84 X1 Z2 Y-2 R1\nM2\n"),
        "rapid 0 5 0; rapid 1 5 2; rapid 1 1 2; feed 1 -2 2; feed 1 1 2"
    );
    assert_eq!(
        moves("F100 M3 S1 G19 G0 X5\nG84 Y1 Z2 X-2 R1\nM2\n"),
        "rapid 5 0 0; rapid 5 1 2; rapid 1 1 2; feed -2 1 2; feed 1 1 2"
    );
}

#[test]
fn a_tap_takes_the_wait_of_the_cycle_before_and_its_own_spindle() {
    let program = "F100 S100 M3 $1\nG0 Z5\nG82 X1 Z-2 R1 P0.5\nG84 X2 Z-2 R1 $1\nG86 Z-2 R1 P0\nX3\nM2\n";
    let text = short(program);
    assert!(text.contains("START_SPINDLE_COUNTERCLOCKWISE(1); DWELL(0.5"), "{text}");
    assert!(
        text.contains("feed 3 0 -2; DWELL(0); STOP_SPINDLE_TURNING(1)"),
        "{text}"
    );
}

#[test]
fn the_spindle_reverses_in_the_bottom_without_a_wait_for_its_speed() {
    let program = b"F100 M3 S1 G0 Z5\nG84 X1 Z-2 R1\nM2\n";
    let events = Interpreter::new(Settings::default()).run(program).map(Result::unwrap);
    let waits: Vec<bool> = events
        .filter_map(|event| match event.call {
            Call::StartSpindle { wait_for_speed, .. } => Some(wait_for_speed),
            _ => None,
        })
        .collect();
    assert_eq!(waits, [true, false, true]);
}

#[test]
fn settings_tell_how_far_pecks_come_out() {
    let settings = Settings {
        chip_breaking_clearance_mm: Some(0.5),
        peck_clearance_mm: Some(0.75),
        ..Settings::default()
    };
    let program = "F100 G61\nG73 X1 Z-1 R1 Q1\nG83 X1 Z-1 R1 Q1\nM2\n";
    let text = printed_with(program, settings, NoMachine);
    assert!(text.contains("(1.0000, 0.0000, 0.5000"), "{text}");
    assert!(text.contains("(1.0000, 0.0000, 0.7500"), "{text}");
}

#[test]
fn a_peck_below_the_clearance_does_not_come_out_above_r() {
    // R 1, pecks of 0.5, clearance 0.75: behind the first one there is no room for it.
    let moves = |line: &str| {
        let text = short(&format!("F100 G61 G98 G0 Z5\n{line}\nM2\n"));
        text.split_once("rapid 1 0 5; ").map(|(_, moves)| moves.to_owned())
    };
    assert_eq!(
        moves("G83 X1 Z-0.5 R1 Q0.5 D0.75").as_deref(),
        Some(
            "rapid 1 0 1; feed 1 0 0.5; rapid 1 0 1; rapid 1 0 1; feed 1 0 0; rapid 1 0 1; rapid 1 0 0.75; feed 1 0 -0.5; rapid 1 0 5"
        )
    );
    assert_eq!(
        moves("G73 X1 Z-0.5 R1 Q0.5 D0.75").as_deref(),
        Some("rapid 1 0 1; feed 1 0 0.5; rapid 1 0 1; feed 1 0 0; rapid 1 0 0.75; feed 1 0 -0.5; rapid 1 0 5")
    );
}

/// The message about the last line but one of a program, behind usual lines before.
fn refusal(line: &str) -> String {
    let text = printed(&format!("F100 G0 Z5\n{line}\nM2\n"));
    text.lines().last().unwrap_or_default().to_string()
}

#[test]
fn refusals_tell_the_rule() {
    let refused = |line: &str, message: &str| assert_eq!(refusal(line), format!("2:{message}"), "{line}");
    refused("G81", "1: G81 needs at least one axis word");
    refused(
        "G81 X1 Z-1",
        "1: G81 needs R, the level at which feeding begins: no G81 is active whose R would still hold",
    );
    refused(
        "G81 X1 R1",
        "1: G81 needs Z, the depth of the hole: no G81 is active whose Z would still hold",
    );
    refused(
        "G81 X1 Z2 R-1",
        "11: R -1.0000 is below the depth Z 2.0000: the hole goes from R down",
    );
    refused("G83 X1 Z-1 R1", "1: G83 needs Q, the depth of one peck");
    refused(
        "G83 X1 Z-1 R1 Q-1",
        "15: G83 needs Q above 0, the depth of one peck: it is -1",
    );
    refused("G82 X1 Z-1 R1", "1: G82 needs P, the seconds to wait at the bottom");
    refused("G82 X1 Z-1 R1 P-1", "15: P-1 is negative: it must be 0 or more");
    refused(
        "G87 X1 Z-1 R1 I1 K1",
        "1: G87 needs J, how far beside the hole the tool goes in and out",
    );
    refused(
        "G18 G87 X1 Y-1 R1 I1 K1",
        "5: G87 needs J, the level at which the counterbore ends",
    );
    refused(
        "G81 X1 Z-1 R1 L0",
        "15: L0 asks G81 for no hole at all: L is how many holes in a row, 1 or more",
    );
    refused("G81 X1 Z-1 R1 L-2", "15: L-2 is negative: it must be 0 or more");
    refused("G81 X1 Z-1 R1 L1.5", "15: L1.5 is not an integer");
    refused(
        "G81 X1 Z-1 R1 L20001",
        "1: G81 would go into the work 20001 times on this line: at most 20000 are allowed: is L right?",
    );
    refused(
        "G83 X1 Z-1 R1 L3 Q0.00001",
        "1: G83 would go into the work 600000 times on this line: at most 20000 are allowed: are Q and L right?",
    );
    refused(
        "G81 X1 Z-1 R1 B1",
        "15: B cannot turn during G81: move it on a line before",
    );
    refused(
        "G81 X1 Z-1 R1 U1",
        "15: U cannot move during G81 in the plane XY (G17): its axes are X Y Z",
    );
    refused(
        "G18 G81 Y-1 R1 @1",
        "16: polar coordinates (@, ^) tell X and Y, so G81 takes them in the plane XY (G17) only",
    );
    refused(
        "G93 G81 X1 Z-1 R1 F1",
        "5: G81 is many moves, for which one time (G93) cannot do: write G94 and F",
    );
    refused(
        "G94 G81 X1 Z-1 R1",
        "5: G81 needs a feed: F is not set (G93, G94 clear it)",
    );
    refused("G84 X1 Z-1 R1", "1: G84 needs spindle 0 to turn: write M3 and S first");
    refused(
        "G88 X1 Z-1 R1 P0",
        "1: G88 needs spindle 0 to turn: write M3 or M4 and S first",
    );
    refused(
        "M3 G74 X1 Z-1 R1",
        "4: G74 needs a spindle that turns counter-clockwise (M4), and it turns the other way: G84 taps so",
    );
    refused(
        "M3 G84 X1 Z-1 R1 $-1",
        "18: $-1 is no spindle that G84 can go with: one of 0 to 0",
    );
}

/// Two lines of a cycle behind a rapid to a level, all numbers in quarters so that sums are exact.
#[derive(Clone, Debug)]
struct Random {
    plane: usize,
    code: usize,
    incremental: bool,
    to_r: bool,
    inch: bool,
    start: i32,
    r: i32,
    depth: i32,
    peck: i32,
    repeats: u32,
    lines: Vec<[i32; 2]>,
}

const PLANES: [(&str, Plane); 6] = [
    ("G17", Plane::Xy),
    ("G18", Plane::Zx),
    ("G19", Plane::Yz),
    ("G17.1", Plane::Uv),
    ("G18.1", Plane::Wu),
    ("G19.1", Plane::Vw),
];

/// Codes with the M code and words that they need.
const CODES: [(&str, &str); 11] = [
    ("G73", "Q"),
    ("G74", "M4"),
    ("G81", ""),
    ("G82", "P1"),
    ("G83", "Q"),
    ("G84", "M3 P1"),
    ("G85", ""),
    ("G86", "M3 P1"),
    ("G87", "M3 I101 J102 K100"),
    ("G88", "M4 P1"),
    ("G89", "P1"),
];

impl Random {
    /// Level of R, of the bottom and of the start.
    fn levels(&self) -> [f64; 3] {
        let [start, r, depth] = [self.start, self.r, self.depth].map(|quarters| f64::from(quarters) / 4.0);
        let r = if self.incremental { start + r } else { r };
        [r, r - depth, start]
    }

    fn program(&self) -> String {
        let (g, plane) = PLANES[self.plane];
        let [first, second, normal] = plane.axes().map(Axis::letter);
        let (code, words) = CODES[self.code];
        let words = words.replace('Q', &format!("Q{}", f64::from(self.peck) / 4.0));
        let [_, bottom, start] = self.levels();
        let depth = if self.incremental {
            -f64::from(self.depth) / 4.0
        } else {
            bottom
        };
        let unit = if self.inch { "G20" } else { "G21" };
        let distance = if self.incremental { "G91" } else { "G90" };
        let retract = if self.to_r { "G99" } else { "G98" };
        let mut program = format!("{g} {unit} {retract} F100 S100 G64 P1 G0 {normal}{start}\n{distance}");
        for (number, place) in self.lines.iter().enumerate() {
            let [a, b] = place.map(|quarters| f64::from(quarters) / 4.0);
            if number == 0 {
                let r = f64::from(self.r) / 4.0;
                program += &format!(" {code} {words} R{r} {normal}{depth}");
            }
            program += &format!(" {first}{a} {second}{b} L{}\n", self.repeats);
        }
        program + "M2\n"
    }
}

fn random() -> impl Strategy<Value = Random> {
    let place = prop::array::uniform2(-40..40_i32);
    (
        (0..6_usize, 0..11_usize, any::<bool>(), any::<bool>(), any::<bool>()),
        (-20..20_i32, -20..20_i32, 1..20_i32, 1..8_i32, 1..4_u32),
        prop::collection::vec(place, 1..4),
    )
        .prop_map(|(modes, numbers, lines)| Random {
            plane: modes.0,
            code: modes.1,
            incremental: modes.2,
            to_r: modes.3,
            inch: modes.4,
            start: numbers.0,
            r: numbers.1,
            depth: numbers.2,
            peck: numbers.3,
            repeats: numbers.4,
            lines,
        })
}

proptest! {
    #[test]
    fn the_tool_crosses_above_r_makes_every_hole_and_ends_at_the_retract_level(random in random()) {
        let [r, bottom, start] = random.levels();
        let unit_mm = if random.inch { 25.4 } else { 1.0 };
        let [first, second, normal] = PLANES[random.plane].1.axes();
        let program = random.program();
        let events = Interpreter::new(Settings::default()).run(program.as_bytes());
        let events: Vec<Event> = events.collect::<Result<_, _>>().map_err(|error| TestCaseError::fail(format!("{error}\n{program}")))?;
        let retract = if random.to_r { r } else { start.max(r) };
        let near = |a: f64, b: f64| (a - b * unit_mm).abs() < 1e-9;
        let aside = [101.0, 102.0, 100.0, 0.0, 0.0, 0.0, 101.0, 102.0, 100.0];
        let is_back_boring = CODES[random.code].0 == "G87";

        let programmed = PathMode::Continuous {
            tolerance_mm: Some(unit_mm),
            naive_cam_tolerance_mm: Some(unit_mm),
        };
        let mut at = Position::ZERO;
        let (mut holes, mut path_modes) = (0, 0);
        let mut in_cycle = false;
        for event in &events {
            match event.call {
                Call::SetPathMode(mode) => {
                    path_modes += 1;
                    in_cycle = mode == PathMode::ExactPath;
                    prop_assert!(in_cycle || mode == programmed || path_modes == 1);
                }
                Call::StraightTraverse { to } | Call::StraightFeed { to } => {
                    let moved: Vec<Axis> = Axis::ALL.into_iter().filter(|axis| to[*axis] != at[*axis]).collect();
                    let across = moved.iter().any(|axis| *axis == first || *axis == second);
                    prop_assert!(moved.iter().all(|axis| [first, second, normal].contains(axis)), "{program}");
                    if across && in_cycle {
                        let low = at[normal].min(to[normal]);
                        let by_aside = [first, second].into_iter().all(|axis| {
                            near((to[axis] - at[axis]).abs(), aside[axis as usize])
                        });
                        prop_assert!(low >= r * unit_mm - 1e-9 || is_back_boring && by_aside, "{program}");
                    }
                    let feeds = matches!(event.call, Call::StraightFeed { .. });
                    prop_assert!(!feeds || !across, "{program}");
                    holes += usize::from(feeds && near(to[normal], bottom));
                    at = to;
                }
                Call::ProgramStop => at[normal] = retract * unit_mm, // the operator takes the tool of G88 out
                _ => {}
            }
        }
        prop_assert_eq!(holes, random.lines.len() * random.repeats as usize, "{}", program);
        prop_assert!(near(at[normal], retract), "{} is not {retract}\n{program}", at[normal] / unit_mm);
        prop_assert_eq!(path_modes, 2 + 2 * random.lines.len(), "{}", program);
        prop_assert!(!in_cycle);
    }
}
