use super::segment::{SAME_MM, length, minus};
use super::*;
use crate::code::Pockets;
use crate::printed::printed;
use crate::{Error, Interpreter, Settings};
use motion::canon::{Call, Event};
use proptest::prelude::*;

const PROFILE: &str = "o1 sub\nG0 X5\nG1 Z-10\nX8\nZ-15\nX10 Z-18\no1 endsub\nG18 F10\nG0 X12 Z2\n";

/// The moves of a program behind its start at X12 Z2: first letter of the call, X, Z; of arcs also centre and direction.
fn moves(program: &str) -> Vec<String> {
    let shown = printed(program);
    let mut lines = shown
        .lines()
        .skip_while(|line| !line.starts_with("STRAIGHT_TRAVERSE(12.0000"));
    lines.next();
    lines
        .map(|line| {
            let numbers: Vec<&str> = line.trim_end_matches(')').split(['(', ',']).map(str::trim).collect();
            match numbers[0] {
                "STRAIGHT_TRAVERSE" => format!("R {} {}", numbers[1], numbers[3]),
                "STRAIGHT_FEED" => format!("F {} {}", numbers[1], numbers[3]),
                "ARC_FEED" => format!(
                    "A {} {} {} {} {}",
                    numbers[2], numbers[1], numbers[4], numbers[3], numbers[5]
                ),
                _ => line.to_owned(),
            }
        })
        .collect()
}

#[test]
fn g71_cuts_along_z_and_follows_the_profile() {
    // As LinuxCNC's interpreter prints it.
    assert_eq!(
        moves(&format!("{PROFILE}G71 Q1 I3\nM2\n")),
        [
            "R 12.0000 2.0000",
            "R 12.0000 2.0000",
            "R 12.0000 2.0000",
            "F 12.0000 -18.0000",
            "R 12.5000 -17.5000",
            "R 12.5000 1.5000",
            "R 12.0000 2.0000",
            "R 9.0000 2.0000",
            "F 9.0000 -16.5000",
            "R 9.5000 -16.0000",
            "R 9.5000 1.5000",
            "R 9.0000 2.0000",
            "R 6.0000 2.0000",
            "F 6.0000 -10.0000",
            "R 6.5000 -9.5000",
            "R 6.5000 1.5000",
            "R 6.0000 2.0000",
            "R 5.0000 2.0000",
            "F 5.0000 -10.0000",
            "F 8.0000 -10.0000",
            "F 8.0000 -15.0000",
            "F 10.0000 -18.0000",
            "F 12.0000 -18.0000",
        ]
    );
}

#[test]
fn g70_makes_passes_beside_the_profile() {
    assert_eq!(
        moves(&format!("{PROFILE}G70 Q1 D2 E1 P3\nM2\n"))[..8],
        [
            "R 12.0000 2.0000",
            "R 12.0000 2.0000",
            "R 6.6667 2.0000",
            "F 6.6667 -8.3333",
            "F 8.0000 -8.3333",
            "A 9.6667 -10.0000 8.0000 -10.0000 1",
            "F 9.6667 -14.4954",
            "F 11.3868 -17.0755",
        ]
    );
    let modal = printed(&format!("{PROFILE}G70 Q1\n(debug,#5420 #5422 #<_motion_mode>)\nM2\n"));
    assert!(
        modal.ends_with("MESSAGE(\"10.000000 -18.000000 10.000000\")\n"),
        "{modal}"
    );
}

#[test]
fn pockets_are_cut_left_or_cut_after() {
    // A valley by an arc; as LinuxCNC's interpreter prints it.
    let profile = "o1 sub\nG0 X3\nG1 Z-4\nX6 Z-6\nG2 X6 Z-12 R4\nG1 Z-14\nG3 X9 Z-17 R3\nG1 X12\no1 endsub\n\
                   G18 F10\nG0 X12 Z2\n";
    let left = moves(&format!("{profile}G71.1 Q1 I4\nM2\n"));
    assert_eq!(
        left[left.len() - 10..],
        [
            "F 3.0000 -4.0000",
            "F 3.0000 -4.0000",
            "F 6.0000 -6.0000",
            "F 6.0000 -12.0000",
            "F 6.0000 -12.0000",
            "F 6.0000 -14.0000",
            "F 6.0000 -14.0000",
            "A 9.0000 -17.0000 6.0000 -17.0000 1",
            "F 9.0000 -17.0000",
            "F 12.0000 -17.0000",
        ]
    );
    let after = moves(&format!("{profile}G71.2 Q1 I1.1\nM2\n"));
    assert_eq!(
        after[1..],
        [
            "R 12.0000 2.0000",
            "R 3.0000 2.0000",
            "F 3.0000 -4.0000",
            "F 6.0000 -6.0000",
            "F 6.0000 -12.0000",
            "R 6.5000 -11.5000",
            "R 6.5000 -6.5000",
            "F 6.0000 -6.0000",
            "A 4.9000 -7.5967 8.6458 -9.0000 -1",
            "F 4.9000 -10.4033",
            "R 5.4000 -9.9033",
            "R 5.4000 -8.0967",
            "F 4.9000 -7.5967",
            "A 6.0000 -12.0000 8.6458 -9.0000 -1",
            "F 6.0000 -14.0000",
            "A 9.0000 -17.0000 6.0000 -17.0000 1",
            "F 12.0000 -17.0000",
        ]
    );
}

#[test]
fn a_valley_too_narrow_for_what_is_left_is_bridged() {
    // 1 mm wide and 1 mm deep, with 1 mm left on the profile: two arcs around its edges meet above it.
    let profile = "o1 sub\nG0 X5\nG1 Z-5\nX4\nZ-6\nX5\nZ-9\nX8\no1 endsub\nG18 F10\nG0 X12 Z2\n";
    assert_eq!(
        moves(&format!("{profile}G70 Q1 E1\nM2\n"))[2..],
        [
            "R 6.0000 2.0000",
            "F 6.0000 -5.0000",
            "A 5.8660 -5.5000 5.0000 -5.0000 1",
            "A 6.0000 -6.0000 5.0000 -6.0000 1",
            "F 6.0000 -8.0000",
            "F 8.0000 -8.0000",
        ]
    );
}

#[test]
fn corners_are_rounded_and_cut() {
    let profile = "o1 sub\nG0 X5\nG1 Z-10 A1\nX8\nZ-15 C1\nX10 Z-18\no1 endsub\nG18 F10\nG0 X12 Z2\n";
    assert_eq!(
        moves(&format!("{profile}G70 Q1\nM2\n"))[2..],
        [
            "R 5.0000 2.0000",
            "F 5.0000 -9.0000",
            "A 6.0000 -10.0000 6.0000 -9.0000 -1",
            "F 8.0000 -10.0000",
            "F 8.0000 -14.6972",
            "F 8.1679 -15.2519",
            "F 10.0000 -18.0000",
        ]
    );
}

#[test]
fn a_profile_is_a_subroutine_like_others() {
    let profile =
        "o1 sub\n#<x> = 5\nG0 X#<x>\no2 repeat [2]\n#<x> = [#<x> + 2]\nG1 W-5\nU2 (up)\no2 endrepeat\no1 endsub\n";
    let shown = moves(&format!("{profile}G18 F10\nG0 X12 Z2\nG70 Q1\nM2\n"));
    assert_eq!(
        shown[shown.len() - 5..],
        [
            "R 5.0000 2.0000",
            "F 5.0000 -3.0000",
            "F 7.0000 -3.0000",
            "F 7.0000 -8.0000",
            "F 9.0000 -8.0000"
        ],
    );
    assert_eq!(shown.iter().filter(|line| *line == "COMMENT(\"up\")").count(), 2);
}

#[test]
fn every_rule_has_its_error() {
    let cycle = |words: &str| printed(&format!("{PROFILE}{words}\nM2\n"));
    for (words, error) in [
        ("G17 G71 Q1", "10:5: G71 turns in the ZX plane, and G17 is active"),
        ("G41.1 D1\nG71 Q1", "11:1: G71 cuts along Z or X"),
        ("G93 G72 Q1 F1", "10:5: G72 makes many moves"),
        ("G71 I3", "10:1: G71 needs Q"),
        ("G71 Q1.5", "10:5: Q1.5 is no number of a subroutine"),
        ("G71 Q1 I0", "10:8: I0 is no depth of a cut"),
        ("G71 Q1 R-1", "10:8: R-1 is no distance to retract"),
        ("G70 Q1 P0", "10:8: P0 is no number of finishing passes"),
        ("G71 Q1 Y5", "10:8: Y has no place here"),
        ("G71 Q1 M2", "10:8: the lathe cycle reads its profile behind this line"),
        ("F0 G71 Q1", "10:4: G71 needs a feed"),
        ("G71 Q1 I0.00001", "7:1: roughing would take more than 100000 cuts"),
    ] {
        let shown = cycle(words);
        assert!(shown.lines().any(|line| line.starts_with(error)), "{words}: {shown}");
    }
    for (lines, error) in [
        ("G0 X5\nM3", "3:1: a profile has moves"),
        ("G0 X5\nG91 Z3", "3:1: a profile has moves"),
        ("G0 X5\nG81 Z3", "3:1: a profile has moves"),
        ("G0 X5\nG1 Z-3 Y3", "3:8: Y has no place here"),
        ("G0 X5\nG1 Z-3 W3", "3:8: Z and W both tell where Z goes"),
        ("G0 X5\nG1 Z-3 A1 C1", "3:11: A rounds the corner"),
        (
            "G0 X5\nG1 Z-3 A9\nX8",
            "5:1: a rounding of 9.0000 does not fit behind this move of the profile (line 3)",
        ),
        ("G0 X5", "3:1: the profile has 1 moves"),
        (
            "G0 X5\nG1 Z-5\nZ-3\nX9\nZ-8",
            "7:1: the profile turns back along Z with the move of line 4",
        ),
        ("G0 X5\nG2 Z-3", "3:1: G2 needs I, K or R"),
    ] {
        let shown = printed(&format!("o1 sub\n{lines}\no1 endsub\nG18 F10\nG0 X12 Z2\nG71 Q1\nM2\n"));
        assert!(shown.lines().any(|line| line.starts_with(error)), "{lines}: {shown}");
    }
    let narrow = "o1 sub\nG0 X5\nG1 Z-5\nX6\nZ-6\nX5\nZ-9\no1 endsub\nG18 F10\nG0 X12 Z2\nG71 Q1 D-1\nM2\n";
    assert!(
        printed(narrow).contains("D: -1.0000 beside the profile there is no path"),
        "{}",
        printed(narrow)
    );
    let short = "o1 sub\nG0 X5 Z0.0000001\nG0 X5 Z0\no1 endsub\nG18 F10\nG0 X12 Z2\nG70 Q1\nM2\n";
    assert!(printed(short).contains("the profile has 1 moves"), "{}", printed(short));
}

/// A random profile from its start on, in its frame: ways down, up and along.
fn profiles() -> impl Strategy<Value = Vec<(i32, i32)>> {
    prop::collection::vec((0_i32..4, -3_i32..4), 1..12)
}

fn path_of(steps: &[(i32, i32)]) -> Vec<Segment> {
    let mut at = [0.0, 3.0];
    let mut path = vec![Segment::line([0.0, 20.0], at)];
    for (along, up) in steps {
        let to = [at[0] - f64::from(*along), (at[1] + f64::from(*up)).clamp(0.0, 19.0)];
        if to != at {
            path.push(Segment::line(at, to));
            at = to;
        }
    }
    path.push(Segment::line(at, [at[0], 20.0]));
    path
}

/// Height of a path at a place that no wall stands on.
fn height(path: &[Segment], p: f64) -> f64 {
    path.iter()
        .filter(|segment| segment.end[0] + SAME_MM < p && p < segment.start[0] - SAME_MM)
        .map(|segment| segment.at((segment.start[0] - p) / (segment.start[0] - segment.end[0]))[1])
        .fold(f64::MIN, f64::max)
}

proptest! {
    #[test]
    fn roughing_never_cuts_below_the_profile_and_leaves_nothing_above_a_step(
        steps in profiles(),
        step_mm in 0.3..3.0_f64,
        retract_mm in 0.0..2.0_f64,
        which in 0_usize..3,
    ) {
        let pockets = [Pockets::With, Pockets::Without, Pockets::After][which];
        let path = path_of(&steps);
        let cuts = rough::rough(&path, pockets, step_mm, retract_mm).unwrap();
        let mut at = path[0].start;
        for cut in &cuts {
            let to = cut.to();
            for place in 1..40 {
                let share = f64::from(place) / 40.0 + 0.0001;
                let [p, q] = [0, 1].map(|axis| at[axis] + share * (to[axis] - at[axis]));
                prop_assert!(q >= height(&path, p) - 1e-6, "{cut:?} from {at:?} is below {}", height(&path, p));
            }
            at = to;
        }
        let end = path[path.len() - 1].end;
        prop_assert!(length(minus(at, end)) < SAME_MM, "ends at {at:?}, not {end:?}");
        if pockets == Pockets::With {
            // All of the profile was followed: every corner is the end of a move.
            for segment in &path {
                let reached = cuts.iter().any(|cut| length(minus(cut.to(), segment.end)) < SAME_MM);
                prop_assert!(reached, "{segment:?} was left out: {cuts:?}");
            }
        }
    }

    #[test]
    fn a_path_beside_keeps_its_distance(steps in profiles(), allowance_mm in 0.01..2.0_f64) {
        let path = path_of(&steps);
        if let Some(beside) = allowance::beside(&path[1..], allowance_mm) {
            for segment in &beside {
                for place in 0..=10 {
                    let point = segment.at(f64::from(place) / 10.0);
                    let near = path[1..].iter().map(|other| other.distance(point)).fold(f64::MAX, f64::min);
                    prop_assert!((near - allowance_mm).abs() < 2e-4, "{near} at {point:?} of {segment:?}");
                }
            }
            for two in beside.windows(2) {
                prop_assert!(length(minus(two[0].end, two[1].start)) < SAME_MM);
            }
        }
    }

    #[test]
    fn a_disc_from_above_never_comes_nearer_and_leaves_nothing(steps in profiles(), radius_mm in 0.01..6.0_f64) {
        let path = path_of(&steps);
        let (first, last) = (path[1].beside(radius_mm).unwrap(), path[path.len() - 1].beside(radius_mm).unwrap());
        prop_assume!(first.start[0] >= last.end[0]);
        let above = allowance::above(&path[1..], radius_mm).unwrap();
        for (ends, wanted) in [(above[0].start, first.start), (above[above.len() - 1].end, last.end)] {
            prop_assert!((ends[0] - wanted[0]).abs() < SAME_MM && ends[1] > wanted[1] - SAME_MM, "{ends:?} {wanted:?}");
        }
        for segment in &above {
            for place in 0..=10 {
                let point = segment.at(f64::from(place) / 10.0);
                let near = path[1..].iter().map(|other| other.distance(point)).fold(f64::MAX, f64::min);
                prop_assert!((near - radius_mm).abs() < 1e-4, "{near} at {point:?} of {segment:?}");
            }
        }
        for two in above.windows(2) {
            prop_assert!(length(minus(two[0].end, two[1].start)) < SAME_MM, "{two:?}");
        }
    }
}

/// A program that finishes a profile under compensation, with a tool of this radius.
fn finished(radius: f64, words: &str, profile: &str) -> Vec<String> {
    let program = format!(
        "G18 F10\nG0 X40 Z20\nG42.1 D{} L2\nG1 X30 Z5\nG70 Q1 {words}\nG40\nG0 X60 Z30\nM2\no1 sub\n{profile}o1 endsub\n",
        2.0 * radius
    );
    let run = Interpreter::new(Settings::default()).run(program.as_bytes());
    let told = |event: Result<Event, Box<Error>>| match event {
        Ok(Event {
            source,
            call: Call::StraightFeed { .. } | Call::ArcFeed { .. },
        }) => Some(source.line.to_string()),
        Ok(_) => None,
        Err(error) => Some(error.to_string()),
    };
    run.filter_map(told).collect()
}

#[test]
fn moves_of_a_cycle_stand_where_the_profile_does() {
    // Entry, then two passes along lines 11 to 14.
    let profile = "G0 X5 Z2\nG1 Z-10\nX10 Z-20\nZ-30\nX20\n";
    let lines = finished(0.4, "D1 E0 P2", profile);
    assert!(
        !lines.iter().any(|line| line.contains("cut")),
        "a pass beside the next one is no gouge: {lines:?}"
    );
    let mut found = lines.clone();
    found.dedup();
    assert_eq!(
        found,
        ["4", "11", "12", "13", "14", "11", "12", "13", "14"],
        "{lines:?}"
    );
    // Roughing goes along no move of it.
    let shown = moves(&format!("{PROFILE}G71 Q1 I3\nM2\n"));
    let program = format!("{PROFILE}G71 Q1 I3\nM2\n");
    let run = Interpreter::new(Settings::default()).run(program.as_bytes());
    let of_cycle = run.map(Result::unwrap).filter(|event| event.source.line == 10).count();
    assert!(of_cycle >= shown.len() - 1, "{of_cycle} {shown:?}");
}

#[test]
fn a_gouge_names_lines_of_the_profile() {
    let told = finished(4.0, "P1", "G0 X5 Z2\nG1 Z-10\nX3\nZ-12\nX10\nZ-30\nX20\n");
    let error = told.last().unwrap();
    let line: u32 = error.split(':').next().unwrap().parse().unwrap();
    assert!((11..=16).contains(&line), "{told:?}");
}
