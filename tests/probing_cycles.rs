//! The probing cycles (`programs/probing`), run by the whole control on virtual time on bodies whose places are known.

use crate::common;

use common::Control;
use isocnc::config::{self, Config};
use isocnc::machine::sequence::Outcome;
use isocnc::operator::rehearsal::{Rehearsal, rehearse};
use isocnc::sim::NetConfig;
use std::path::Path;
use std::process::Stdio;

const MACHINE: &str = include_str!("../configs/mill3-demo.toml");
const CYCLES_MAX: u64 = 400_000;
/// What a cycle may be wrong by.
const TOLERANCE_MM: f64 = 0.005;
/// Of the probe: the ball at its tip, and how far below the place of the axes it ends.
const BALL_MM: f64 = 6.0;
const LENGTH_MM: f64 = 50.0;
/// Origin of G54 before the cycle.
const G54: [f64; 3] = [20.0, 20.0, -60.0];

/// The demo's machine with other bodies before its probe.
fn machine(bodies: &str) -> Config {
    let (before, _) = MACHINE.split_once("[sim.probe]").expect("a probe");
    let text = format!(
        "{before}[sim.probe]\nnode = 10\ninput = 8\ndiameter_mm = {BALL_MM}\nlength_mm = {LENGTH_MM}\n{bodies}\n\
         [program.values.setter]\nx_mm = 250.0\ny_mm = 150.0\nz_mm = -110.0\nabove_mm = 0.0\n"
    );
    config::parse(&text, Path::new("mill3-demo.toml")).unwrap_or_else(|errors| panic!("{errors}"))
}

/// To a place of the tip, machine coordinates, with the probe in the spindle.
fn begin([x, y, z]: [f64; 3]) -> String {
    format!(
        "G21 G90 G94 G54\nT99 M6\nG10 L1 P99 R{} Z{LENGTH_MM}\nG53 G0 Z0\nG53 G0 X{x} Y{y}\nG53 G0 Z{}\n",
        BALL_MM / 2.0,
        z + LENGTH_MM
    )
}

/// What these parameters are at the end of a program.
fn run(config: &Config, text: &str, values: &[&str]) -> Vec<f64> {
    let folder = tempfile::tempdir().unwrap();
    let mut config = config.clone();
    config.program.log_directory = Some(folder.path().to_owned());
    let told: String = values.iter().map(|value| format!("%.6f#{value} ")).collect();
    let text = format!("{text}(LOGOPEN,values)\n(LOG,{told})\n(LOGCLOSE)\nM2\n");
    rehearse(
        &config,
        text.as_bytes(),
        NetConfig::clean(1),
        |run: &mut Rehearsal<'_>| {
            let outcome = run.run(CYCLES_MAX).unwrap_or_else(|error| panic!("{error:#}\n{text}"));
            assert_eq!((outcome, run.operator.alarms()), (Outcome::Completed, &[][..]));
            Ok(())
        },
    )
    .expect("a machine to rehearse on");
    let told = std::fs::read_to_string(folder.path().join("values")).expect("a log");
    told.split_whitespace()
        .map(|value| value.parse().expect("a number"))
        .collect()
}

/// A cycle from a place of the tip, and what these parameters have to be behind it.
#[track_caller]
fn assert_cycle(bodies: &str, from: [f64; 3], call: &str, wanted: &[(&str, f64)]) {
    let names: Vec<&str> = wanted.iter().map(|(name, _)| *name).collect();
    let found = run(&machine(bodies), &format!("{}{call}\n", begin(from)), &names);
    let mut worst = 0.0_f64;
    for ((name, wanted), found) in wanted.iter().zip(&found) {
        let off = found - wanted;
        assert!(
            off.abs() <= TOLERANCE_MM,
            "{call}: {name} is {found}, should be {wanted}"
        );
        worst = worst.max(off.abs());
    }
    println!("{call}: off by {worst:.4} mm at the most");
}

/// Where the middle of a bore, boss or block is.
const MIDDLE: [f64; 2] = [150.0, 100.0];

/// In G54 as it was before.
fn in_work([x, y]: [f64; 2]) -> [(&'static str, f64); 2] {
    [("<_probe_x>", x - G54[0]), ("<_probe_y>", y - G54[1])]
}

/// G54 itself, set.
fn origin([x, y]: [f64; 2]) -> [(&'static str, f64); 2] {
    [("5221", x), ("5222", y)]
}

fn round(diameter_mm: f64, z_mm: [f64; 2], hole: bool) -> String {
    let [x, y] = MIDDLE;
    format!(
        "[[sim.probe.cylinder]]\nx_mm = {x}\ny_mm = {y}\ndiameter_mm = {diameter_mm:?}\nz_mm = {z_mm:?}\nhole = {hole}\n"
    )
}

/// 60 mm by 40 mm about the middle.
fn rectangle(angle_degrees: f64, z_mm: [f64; 2], hole: bool) -> String {
    format!(
        "[[sim.probe.box]]\nx_mm = [120.0, 180.0]\ny_mm = [80.0, 120.0]\nz_mm = {z_mm:?}\n\
         angle_degrees = {angle_degrees:?}\nhole = {hole}\n"
    )
}

const TALL: [f64; 2] = [-110.0, -80.0];

#[test]
fn a_surface() {
    let body = rectangle(0.0, TALL, false);
    let from = [150.0, 100.0, -71.0];
    assert_cycle(
        &body,
        from,
        "o<probe-surface> call [20] [1]",
        &[("5223", -80.0), ("5221", G54[0]), ("5222", G54[1])],
    );
    assert_cycle(
        &body,
        from,
        "o<probe-surface> call [20]",
        &[("<_probe_z>", -80.0 - G54[2]), ("5223", G54[2])],
    );
}

#[test]
fn edges_from_four_sides() {
    let body = rectangle(0.0, TALL, false);
    for (from, call, set, wanted) in [
        ([112.0, 100.0], "[10] [0]", "5221", 120.0),
        ([190.0, 100.0], "[-12] [0]", "5221", 180.0),
        ([150.0, 70.0], "[0] [12]", "5222", 80.0),
        ([150.0, 131.0], "[0] [-12]", "5222", 120.0),
    ] {
        let from = [from[0], from[1], -90.0];
        assert_cycle(&body, from, &format!("o<probe-edge> call {call} [1]"), &[(set, wanted)]);
        let (name, before) = match set {
            "5221" => ("<_probe_x>", G54[0]),
            _ => ("<_probe_y>", G54[1]),
        };
        let only = format!("o<probe-edge> call {call}");
        assert_cycle(&body, from, &only, &[(name, wanted - before), (set, before)]);
    }
}

#[test]
fn outside_corners() {
    let body = rectangle(0.0, TALL, false);
    for (x, y, sx, sy) in [
        (120.0, 80.0, 1.0, 1.0),
        (180.0, 80.0, -1.0, 1.0),
        (120.0, 120.0, 1.0, -1.0),
        (180.0, 120.0, -1.0, -1.0),
    ] {
        let from = [x - 8.0 * sx, y - 9.0 * sy, -90.0];
        let call = format!("o<probe-corner-outside> call [{}] [{}] [1]", 18.0 * sx, 20.0 * sy);
        assert_cycle(&body, from, &call, &origin([x, y]));
    }
}

#[test]
fn inside_corners() {
    let body = rectangle(0.0, TALL, true);
    for (x, y, sx, sy) in [
        (120.0, 80.0, -1.0, -1.0),
        (180.0, 80.0, 1.0, -1.0),
        (120.0, 120.0, -1.0, 1.0),
        (180.0, 120.0, 1.0, 1.0),
    ] {
        let from = [x - 8.0 * sx, y - 9.0 * sy, -90.0];
        let call = format!("o<probe-corner-inside> call [{}] [{}] [1]", 12.0 * sx, 14.0 * sy);
        assert_cycle(&body, from, &call, &origin([x, y]));
    }
}

#[test]
fn bores() {
    for (diameter, told, x, y) in [(40.0, 40.0, 153.0, 98.0), (12.0, 11.0, 149.0, 101.0)] {
        let mut wanted = origin(MIDDLE).to_vec();
        wanted.extend([("<_probe_diameter>", diameter), ("<_probe_width_x>", diameter)]);
        let call = format!("o<probe-bore> call [{told}] [1]");
        assert_cycle(&round(diameter, TALL, true), [x, y, -90.0], &call, &wanted);
    }
}

#[test]
fn bosses() {
    for (diameter, told, x, y) in [(40.0, 41.0, 151.0, 98.0), (10.0, 10.0, 149.0, 101.0)] {
        let mut wanted = in_work(MIDDLE).to_vec();
        wanted.extend([("<_probe_diameter>", diameter), ("<_probe_width_y>", diameter)]);
        let call = format!("o<probe-boss> call [{told}] [15]");
        assert_cycle(&round(diameter, TALL, false), [x, y, -75.0], &call, &wanted);
    }
}

#[test]
fn pockets_and_valleys() {
    let body = rectangle(0.0, TALL, true);
    let from = [152.0, 97.0, -90.0];
    let mut wanted = origin(MIDDLE).to_vec();
    wanted.extend([("<_probe_width_x>", 60.0), ("<_probe_width_y>", 40.0)]);
    assert_cycle(&body, from, "o<probe-pocket> call [61] [40] [1]", &wanted);
    let valley = [("5221", G54[0]), ("5222", MIDDLE[1]), ("<_probe_width_y>", 40.0)];
    assert_cycle(&body, from, "o<probe-pocket> call [0] [40] [1]", &valley);
}

#[test]
fn blocks_and_ridges() {
    let body = rectangle(0.0, TALL, false);
    let from = [152.0, 98.0, -75.0];
    let mut wanted = origin(MIDDLE).to_vec();
    wanted.extend([("<_probe_width_x>", 60.0), ("<_probe_width_y>", 40.0)]);
    assert_cycle(&body, from, "o<probe-block> call [60] [41] [12] [1]", &wanted);
    let ridge = [("5221", MIDDLE[0]), ("5222", G54[1]), ("<_probe_width_x>", 60.0)];
    assert_cycle(&body, from, "o<probe-block> call [60] [0] [12] [1]", &ridge);
}

#[test]
fn angles_of_edges() {
    for degrees in [3.0_f64, -7.0] {
        let body = rectangle(degrees, TALL, false);
        for (from, call) in [
            ([140.0, 68.0], "[0] [20] [20]"),
            ([160.0, 132.0], "[0] [-20] [-20]"),
            ([108.0, 92.0], "[20] [0] [15]"),
            ([192.0, 108.0], "[-20] [0] [-15]"),
        ] {
            let from = [from[0], from[1], -90.0];
            let text = format!("{}o<probe-angle> call {call} [1]\n", begin(from));
            let found = run(&machine(&body), &text, &["<_probe_angle>", "5230"]);
            for found in found {
                let off_mm = (found - degrees).to_radians() * 20.0;
                assert!(off_mm.abs() <= TOLERANCE_MM, "{call}: {found}, should be {degrees}");
                println!("o<probe-angle> call {call}: off by {off_mm:.4} mm over 20 mm");
            }
        }
        // In the turned system the block is square, and its middle where it was.
        let text = format!(
            "{}o<probe-angle> call [0] [20] [20] [1]\nG53 G0 Z-25\nG53 G0 X151 Y101\n\
             o<probe-block> call [60] [40] [15] [1]\n",
            begin([140.0, 68.0, -90.0])
        );
        let found = run(
            &machine(&body),
            &text,
            &["5221", "5222", "<_probe_width_x>", "<_probe_width_y>"],
        );
        for (found, wanted) in found.iter().zip([MIDDLE[0], MIDDLE[1], 60.0, 40.0]) {
            assert!((found - wanted).abs() <= TOLERANCE_MM, "{found}, should be {wanted}");
        }
    }
}

/// Its middle at X 250 Y 150, where a tool of no length would touch it with Z at -110.
const SETTER: &str =
    "[[sim.probe.cylinder]]\nx_mm = 250.0\ny_mm = 150.0\ndiameter_mm = 20.0\nz_mm = [-130.0, -110.0]\n";

#[test]
fn the_length_of_a_tool() {
    let text = "G21 G90 G94 G54\nT5 M6\nG10 L1 P5 R2 Z30 \nG43\nG53 G0 Z-20\no<probe-tool-length> call [1]\n\
                G53 G0 Z-10\nG53 G0 X50\no<probe-tool-check> call\n";
    let found = run(&machine(SETTER), text, &["5403", "5410", "<_probe_length>"]);
    for (found, wanted) in found.iter().zip([LENGTH_MM, 4.0, LENGTH_MM]) {
        assert!((found - wanted).abs() <= TOLERANCE_MM, "{found}, should be {wanted}");
    }
    println!("o<probe-tool-length>: off by {:.4} mm", (found[0] - LENGTH_MM).abs());
}

#[test]
fn the_tip_by_a_ring_and_by_a_square() {
    let square =
        "[[sim.probe.box]]\nx_mm = [135.0, 165.0]\ny_mm = [85.0, 115.0]\nz_mm = [-110.0, -80.0]\nhole = true\n";
    for (body, width) in [(&*round(25.0, TALL, true), 25.0), (square, 30.0)] {
        // It is not known before.
        let text = format!(
            "{}G10 L1 P99 R0\no<probe-calibrate> call [{width}] [1]\n",
            begin([151.0, 99.0, -90.0])
        );
        let found = run(&machine(body), &text, &["5410", "5403"]);
        assert!((found[0] - BALL_MM).abs() <= TOLERANCE_MM, "{found:?}");
        assert_eq!(found[1], LENGTH_MM);
        println!(
            "o<probe-calibrate> call [{width}]: off by {:.4} mm",
            (found[0] - BALL_MM).abs()
        );
    }
}

#[test]
fn a_cycle_leaves_modes_as_they_were_and_speaks_the_units_of_the_program() {
    let from = begin([151.0, 99.0, -90.0]);
    let diameter = 40.0 / 25.4;
    let text = format!("{from}G55 G20 G91 G95 G49 G18 F7\no<probe-bore> call [{diameter}] [1]\n");
    let found = run(
        &machine(&round(40.0, TALL, true)),
        &text,
        &[
            "<_imperial>",
            "<_incremental>",
            "<_units_per_rev>",
            "<_tool_offset>",
            "<_coord_system>",
            "<_plane>",
            "<_feed>",
            "<_probe_diameter>",
            "5241",
            "5242",
        ],
    );
    assert_eq!(found[..7], [1.0, 1.0, 1.0, 0.0, 550.0, 180.0, 7.0]);
    assert!((found[7] - diameter).abs() * 25.4 <= TOLERANCE_MM, "{found:?}");
    // G55, in the machine's unit.
    for (found, wanted) in found[8..].iter().zip(MIDDLE) {
        assert!((found - wanted).abs() <= TOLERANCE_MM, "{found}, should be {wanted}");
    }
}

#[test]
fn a_machine_in_inches_measures_the_same_in_either_unit() {
    let mut config = machine(&round(40.0, TALL, true));
    config.unit = motion::canon::LengthUnit::Inch;
    for (units, diameter) in [("G20", 40.0 / 25.4), ("G21", 40.0)] {
        let text = format!(
            "{}{units}\no<probe-bore> call [{diameter}] [1]\n",
            begin([151.0, 99.0, -90.0])
        );
        // The origin and the tool table are in inches.
        let found = run(&config, &text, &["5221", "5222", "<_probe_diameter>", "5410"]);
        let wanted = [MIDDLE[0] / 25.4, MIDDLE[1] / 25.4, diameter, BALL_MM / 25.4];
        for (found, wanted) in found.iter().zip(wanted) {
            assert!(
                (found - wanted).abs() <= TOLERANCE_MM,
                "{units}: {found}, should be {wanted}"
            );
        }
    }
}

/// A cycle that gives up: what it says, and where the machine stands then.
#[track_caller]
fn assert_gives_up(bodies: &str, text: &str, says: &str, stands: Option<[f64; 3]>) {
    let config = machine(bodies);
    rehearse(
        &config,
        text.as_bytes(),
        NetConfig::clean(1),
        |run: &mut Rehearsal<'_>| {
            let failed = run.run_until(CYCLES_MAX, |run| run.operator.outcome().is_some());
            let failed = match failed {
                Err(failed) => failed.to_string(),
                Ok(_) => panic!("{text}: it did not give up: {:?}", run.operator.outcome()),
            };
            assert!(failed.contains(says), "{failed}");
            let now_ns = run.now_ns();
            run.operator.fail(now_ns, failed);
            assert_eq!(run.run(CYCLES_MAX)?, Outcome::Faulted);
            if let Some(stands) = stands {
                let last = run.operator.recorder.samples().last().expect("it moved").command;
                for (found, wanted) in last.iter().zip(stands) {
                    assert!((found - wanted).abs() < 1e-6, "{last:?}, should be {stands:?}");
                }
            }
            Ok(())
        },
    )
    .expect("a machine to rehearse on");
}

#[test]
fn where_nothing_is_it_goes_back_to_its_start_and_says_so() {
    for (bodies, from, call) in [
        ("", [150.0, 100.0, -71.0], "o<probe-surface> call [20] [1]"),
        ("", [150.0, 100.0, -71.0], "o<probe-edge> call [0] [-20] [1]"),
        ("", [150.0, 100.0, -71.0], "o<probe-bore> call [20] [1]"),
        ("", [150.0, 100.0, -71.0], "o<probe-boss> call [20] [15] [1]"),
        ("", [150.0, 100.0, -71.0], "o<probe-angle> call [0] [9] [20] [1]"),
        // The second side of the corner is farther away than it may go.
        (
            &rectangle(0.0, TALL, false),
            [112.0, 50.0, -90.0],
            "o<probe-corner-outside> call [20] [-40] [1]",
        ),
    ] {
        let [x, y, z] = from;
        let text = format!("{}{call}\nM2\n", begin(from));
        let rest = Some([x, y, z + LENGTH_MM]);
        assert_gives_up(bodies, &text, "nothing was touched within ", rest);
    }
}

#[test]
fn what_is_in_its_way_stops_it() {
    let body = rectangle(0.0, TALL, false);
    // Beside the block, as if it were above it.
    let text = format!("{}o<probe-boss> call [20] [15]\nM2\n", begin([112.0, 100.0, -90.0]));
    let says = "the probe touched something on its way, at X96.9";
    assert_gives_up(&body, &text, says, Some([112.0, 100.0, -40.0]));
    // Within it from the beginning, or its wiring the wrong way round.
    let text = format!("{}o<probe-edge> call [20] [0]\nM2\n", begin([118.0, 100.0, -90.0]));
    let says = "the probe was in contact before it moved";
    assert_gives_up(&body, &text, says, Some([118.0, 100.0, -40.0]));
    let text = format!("{}o<probe-boss> call [20] [15]\nM2\n", begin([118.0, 100.0, -90.0]));
    let says = "the probe touched something on its way";
    assert_gives_up(&body, &text, says, Some([118.0, 100.0, -40.0]));
}

#[test]
fn it_does_not_begin_where_probing_is_not_safe() {
    let from = begin([150.0, 100.0, -90.0]);
    for (before, call, says) in [
        (
            "T5 M6",
            "o<probe-bore> call [40]",
            "tool 5 is in the spindle; the probe is tool 99",
        ),
        ("M3 S500", "o<probe-bore> call [40]", "the spindle turns"),
        ("M3 S500", "o<probe-tool-length> call", "the spindle turns"),
        ("G41.1 D1", "o<probe-surface> call [5]", "cutter compensation is on"),
        (
            "G10 L1 P99 R0",
            "o<probe-edge> call [5] [0]",
            "has no diameter in the tool table",
        ),
        ("T0 M6", "o<probe-tool-check> call", "there is no tool in the spindle"),
        ("", "o<probe-bore> call", "the diameter has to be above 0"),
        ("", "o<probe-edge> call [5] [5]", "the other one is 0"),
        ("", "o<probe-edge> call", "the other one is 0"),
        ("", "o<probe-angle> call [5] [0]", "along is not"),
        ("", "o<probe-corner-inside> call [5]", "and not 0"),
        ("", "o<probe-pocket> call [5] [-5]", "widths have to be above 0"),
        ("", "o<probe-block> call [5] [5]", "depth above 0"),
    ] {
        let text = format!("{from}{before}\n{call} \nM2\n");
        assert_gives_up("", &text, says, None);
    }
}

#[test]
fn a_broken_tool_ends_the_program() {
    let text = "G21 G90 G94 G54\nT5 M6\nG10 L1 P5 R2 Z53.2\no<probe-tool-check> call [1]\nM2\n";
    let says = "in the tool table 53.200: is it broken";
    assert_gives_up(SETTER, text, says, Some([250.0, 150.0, 0.0]));
}

/// Who checks a program has no machine: nothing is found then, and nothing is wrong.
#[test]
fn a_check_goes_through_all_cycles() {
    use isocnc::machine::tables::Tables;
    use isocnc::program::{Begin, check};
    use motion::cancel::Cancel;
    let config = machine("");
    let text = format!(
        "{}o<probe-surface> call [5] [1]\no<probe-edge> call [5] [0] [1]\no<probe-corner-outside> call [5] [5] [1]\n\
         o<probe-corner-inside> call [5] [5] [1]\no<probe-bore> call [20] [1]\no<probe-boss> call [20] [5] [1]\n\
         o<probe-pocket> call [20] [20] [1]\no<probe-block> call [20] [20] [5] [1]\n\
         o<probe-angle> call [0] [5] [20] [1]\no<probe-calibrate> call [20] [1]\nT5 M6\n\
         o<probe-tool-length> call [1]\no<probe-tool-check> call\nM2\n",
        begin([150.0, 100.0, -90.0])
    );
    let tables = Tables::read(&config).expect("no tables");
    let checked = check(
        &config,
        &tables,
        "part",
        text.as_bytes(),
        &Begin::at_home(&config),
        &Cancel::default(),
    );
    if let Err(errors) = checked {
        panic!("{errors}");
    }
    // What holds wherever things are is found before anything moves.
    let text = format!("{}o<probe-bore> call\nM2\n", begin([150.0, 100.0, -90.0]));
    let checked = check(
        &config,
        &tables,
        "part",
        text.as_bytes(),
        &Begin::at_home(&config),
        &Cancel::default(),
    );
    let errors = checked.expect_err("no diameter").to_string();
    assert!(errors.contains("the diameter has to be above 0"), "{errors}");
}

/// Each cycle has its picture and its line in the document, and that has no other.
#[test]
fn the_document_has_all_cycles_with_their_arguments() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = include_str!("../docs/probing.md");
    let mut calls = Vec::new();
    for entry in std::fs::read_dir(root.join("programs/probing")).expect("cycles") {
        let path = entry.expect("a file").path();
        let name = path
            .file_stem()
            .and_then(|name| name.to_str())
            .expect("a name")
            .to_owned();
        let text = std::fs::read_to_string(&path).expect("a text");
        assert!(text.contains(&format!("\no<{name}> sub\n")), "{name}");
        if text.starts_with("(Part of the probing cycles: ") {
            continue;
        }
        let (call, _) = text[1..].split_once(": ").expect("its call");
        calls.push(call.to_owned());
        let row = page.lines().find(|line| line.starts_with(&format!("| `{call}` |")));
        let picture = format!("pictures/{name}.svg");
        assert!(row.is_some_and(|row| row.contains(&picture)), "{call}");
        assert!(root.join("docs").join(&picture).is_file(), "{picture}");
    }
    assert_eq!(
        calls.len(),
        page.lines().filter(|line| line.starts_with("| `o<")).count(),
        "{calls:?}"
    );
}

/// By the commands that a person types, on the demo's machine: set, then one that finds nothing and leaves all as it was.
#[test]
fn a_cycle_by_hand() {
    let control = Control::start_in(
        tempfile::tempdir().unwrap(),
        "probing-by-hand",
        Stdio::null(),
        str::to_owned,
    );
    control.wait_for("the network", |status| {
        status["power"] != "starting" && status["step"] == "standing_by"
    });
    let mdi = |line: &str| {
        control
            .ask(&["mdi", line])
            .unwrap_or_else(|errors| panic!("{line}: {errors}"))
    };
    let status = || control.ask(&["status"]).unwrap();
    let origin = |system: usize, axis: &str| {
        let offsets = control.ask(&["offset", "list"]).unwrap();
        offsets["systems"][system]["origin"][axis].as_f64().unwrap()
    };
    control.ask(&["home"]).unwrap();
    // The block of the demo, 40 mm long in Y.
    control.refused(
        &["mdi", "o<probe-block> call [0] [40] [10] [1]"],
        "the probe is tool 99",
    );
    mdi("T99 M6");
    mdi("G10 L1 P99 R2");
    mdi("G53 G0 X230 Y140");
    mdi("G53 G0 Z-80");
    mdi("G55 G91 F123");
    let mut codes = status()["codes"].clone();
    codes[0] = "G80".into();
    mdi("o<probe-block> call [0] [40] [10] [1]");
    assert!((origin(1, "Y") - 140.0).abs() <= TOLERANCE_MM, "{}", origin(1, "Y"));
    assert_eq!(origin(0, "Y"), G54[1]);
    assert_eq!(status()["codes"], codes);
    // What was found is known to the next line.
    mdi("G90 G53 G0 X[#<_probe_width_y>]");
    let at = status()["position_mm"].clone();
    assert!((at[0].as_f64().unwrap() - 40.0).abs() <= TOLERANCE_MM, "{at}");

    let codes = status()["codes"].clone();
    let origins = [origin(1, "X"), origin(1, "Y"), origin(1, "Z")];
    let (code, said) = control.words(&["mdi", "o<probe-edge> call [5] [0] [1]"]);
    let why = "the program gives up: nothing was touched within 5.000";
    assert!(code == Some(1) && said.contains(why), "{said}");
    let now = status();
    assert_eq!(now["codes"], codes);
    assert_eq!([origin(1, "X"), origin(1, "Y"), origin(1, "Z")], origins);
    for axis in 0..3 {
        let [at, was] = [&now["position_mm"], &at].map(|position| position[axis].as_f64().unwrap());
        assert!((at - was).abs() < 1e-6, "{now}");
    }
}

/// While it probes, it says so; and what it has found, where the machine has come to it.
#[test]
fn it_tells_that_it_probes_and_what_it_has_found() {
    let config = machine(&rectangle(0.0, TALL, false));
    let text = format!("{}o<probe-surface> call [20]\nM2\n", begin([150.0, 100.0, -71.0]));
    rehearse(
        &config,
        text.as_bytes(),
        NetConfig::clean(1),
        |run: &mut Rehearsal<'_>| {
            let probes = |run: &mut Rehearsal<'_>| {
                let waiting = run.operator.live().waiting;
                waiting.is_some_and(|waiting| waiting.code().name() == "probe")
            };
            assert!(run.run_until(CYCLES_MAX, probes)?, "{:?}", run.operator.journal());
            assert_eq!(run.run(CYCLES_MAX)?, Outcome::Completed);
            assert_eq!(run.operator.live().waiting, None);
            let journal = run.operator.journal();
            let said = journal
                .iter()
                .find_map(|entry| entry.text.strip_prefix("message: surface at Z"));
            let z_mm: f64 = said
                .unwrap_or_else(|| panic!("{journal:#?}"))
                .parse()
                .expect("a number");
            assert!((z_mm + 20.0).abs() <= TOLERANCE_MM, "{z_mm}");
            Ok(())
        },
    )
    .expect("a machine to rehearse on");
}
