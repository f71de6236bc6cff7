//! With any valid numbers: the interpreter takes the program, nothing is deeper or wider than was said, all of it is cut, and rapid moves
//! stay above the surface.

use crate::driven::{Way, ways};
use jobs::*;
use proptest::prelude::*;

/// Words have four decimals.
const ROUNDING_MM: f64 = 0.000_2;

/// A number with two decimals.
fn between(low: f64, high: f64) -> impl Strategy<Value = f64> {
    ((low * 100.0).ceil() as i64..=(high * 100.0).floor() as i64).prop_map(|number| number as f64 / 100.0)
}

/// Top, depth, most depth of a level, safe height.
fn heights() -> impl Strategy<Value = (f64, f64, f64, f64)> {
    (
        between(-20.0, 20.0),
        between(0.05, 12.0),
        between(0.5, 5.0),
        between(0.1, 30.0),
    )
        .prop_map(|(top, depth, stepdown, above)| (top, depth, stepdown, top + above))
}

/// Never deeper than said, and as deep; rapid moves no lower than a little above the surface, but straight up,
/// and where they `may` be.
fn check_heights(
    ways: &[Way],
    top: f64,
    depth: f64,
    safe: f64,
    may: impl Fn([f64; 3]) -> bool,
) -> Result<(), TestCaseError> {
    let clearance = safe.min(top + 1.0) - ROUNDING_MM;
    let mut lowest = f64::INFINITY;
    // The first one goes up from where the machine is.
    for way in &ways[1..] {
        let (from, to) = (way.points[0], way.points[way.points.len() - 1]);
        let is_up = from[0] == to[0] && from[1] == to[1] && to[2] >= from[2];
        for &[x, y, z] in &way.points {
            lowest = lowest.min(z);
            prop_assert!(
                !way.rapid || is_up || z >= clearance || may([x, y, z]),
                "line {}: rapid at Z{z}, surface at {top}",
                way.line
            );
        }
    }
    prop_assert!(ways[0].rapid && (ways[0].points.last().unwrap()[2] - safe).abs() < ROUNDING_MM);
    prop_assert!(
        (lowest - (top - depth)).abs() <= ROUNDING_MM,
        "down to {lowest}, not {}",
        top - depth
    );
    let end = ways.last().unwrap().points.last().unwrap();
    prop_assert!((end[2] - safe).abs() < ROUNDING_MM);
    Ok(())
}

/// Rapid moves across, which may meet clamps, are at this height.
fn check_across(ways: &[Way], height: f64) -> Result<(), TestCaseError> {
    for way in ways.iter().skip(1).filter(|way| way.rapid) {
        let [a, .., b] = way.points[..] else { continue };
        let is_across = (a[0] - b[0]).abs() + (a[1] - b[1]).abs() > 1e-9;
        prop_assert!(!is_across || (a[2] - height).abs() < ROUNDING_MM, "line {}", way.line);
    }
    Ok(())
}

/// How far a point is from the nearest piece of these ways.
fn distance(ways: &[&Way], [x, y]: [f64; 2]) -> f64 {
    let pieces = ways.iter().flat_map(|way| way.points.windows(2));
    let off = pieces.map(|piece| {
        let (a, b) = (piece[0], piece[1]);
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let length = dx * dx + dy * dy;
        let share = match length > 0.0 {
            true => (((x - a[0]) * dx + (y - a[1]) * dy) / length).clamp(0.0, 1.0),
            false => 0.0,
        };
        (x - a[0] - share * dx).hypot(y - a[1] - share * dy)
    });
    off.fold(f64::INFINITY, f64::min)
}

/// Ways at feed at this height.
fn at_height(ways: &[Way], z: f64) -> Vec<&Way> {
    let flat = |way: &&Way| !way.rapid && way.points.iter().all(|point| (point[2] - z).abs() < ROUNDING_MM);
    ways.iter().filter(flat).collect()
}

prop_compose! {
    fn facing()(
        (top, depth, stepdown, safe_height) in heights(),
        (x, y, length, width) in (between(-50.0, 50.0), between(-50.0, 50.0), between(5.0, 80.0), between(5.0, 80.0)),
        tool_diameter in between(2.0, 60.0),
        (share, overrun, finish) in (0.2_f64..1.0, between(0.0, 10.0), prop_oneof![Just(0.0), Just(0.02)]),
        (one_way, along_y) in (any::<bool>(), any::<bool>()),
    ) -> Facing {
        Facing {
            x, y, length, width, depth, stepdown, finish, tool_diameter, top, safe_height, overrun,
            stepover: (tool_diameter * share).max(0.1),
            pattern: if one_way { Pattern::OneWay } else { Pattern::Zigzag },
            along: if along_y { Along::Y } else { Along::X },
            ..Facing::default()
        }
    }
}

fn entry() -> impl Strategy<Value = Entry> {
    prop::sample::select(vec![Entry::Helix, Entry::Ramp, Entry::Plunge])
}

prop_compose! {
    fn rectangular()(
        (top, depth, stepdown, safe_height) in heights(),
        (x, y, length, width) in (between(-50.0, 50.0), between(-50.0, 50.0), between(10.0, 80.0), between(10.0, 80.0)),
        (tool, share, corner) in (0.1_f64..0.75, 0.1_f64..0.85, prop_oneof![Just(0.0), 0.5_f64..1.0]),
        (finish, entry, ramp_angle) in (prop_oneof![Just(0.0), 0.01_f64..0.9], entry(), between(1.0, 20.0)),
    ) -> RectangularPocket {
        let short = length.min(width);
        let radius = (short * tool * 100.0).round() / 200.0;
        RectangularPocket {
            x, y, length, width, depth, stepdown, top, safe_height, entry, ramp_angle,
            tool_diameter: 2.0 * radius,
            corner_radius: if corner == 0.0 { 0.0 } else { radius + (short / 2.0 - radius) * (2.0 * corner - 1.0) },
            stepover: 2.0 * radius * share,
            finish: finish * (0.4 * radius).min(0.3 / 1.3 * (short / 2.0 - radius)),
            ..RectangularPocket::default()
        }
    }
}

prop_compose! {
    fn circular()(
        (top, depth, stepdown, safe_height) in heights(),
        (x, y, diameter) in (between(-50.0, 50.0), between(-50.0, 50.0), between(5.0, 80.0)),
        (tool, share) in (0.1_f64..0.7, 0.1_f64..0.85),
        (finish, entry, ramp_angle) in (prop_oneof![Just(0.0), 0.01_f64..0.9], entry(), between(1.0, 20.0)),
    ) -> CircularPocket {
        let radius = diameter * tool / 2.0;
        CircularPocket {
            x, y, diameter, depth, stepdown, top, safe_height, entry, ramp_angle,
            tool_diameter: 2.0 * radius,
            stepover: 2.0 * radius * share,
            finish: finish * (0.4 * radius).min(0.3 / 1.3 * (diameter / 2.0 - radius)),
            ..CircularPocket::default()
        }
    }
}

prop_compose! {
    fn thread()(
        (x, y, diameter) in (between(-50.0, 50.0), between(-50.0, 50.0), between(4.0, 60.0)),
        (pitch, tool, depth, top) in (0.05_f64..0.2, 0.3_f64..0.95, between(2.0, 30.0), between(-20.0, 20.0)),
        (outside, left, conventional, passes) in (any::<bool>(), any::<bool>(), any::<bool>(), 1_u32..4),
    ) -> ThreadMilling {
        let pitch = ((diameter * pitch * 100.0).round() / 100.0).max(0.1);
        ThreadMilling {
            x, y, diameter, pitch, depth, top, passes,
            tool_diameter: (diameter - 1.1 * pitch) * tool,
            side: if outside { Side::Outside } else { Side::Inside },
            hand: if left { Hand::Left } else { Hand::Right },
            cut: if conventional { Cut::Conventional } else { Cut::Climb },
            safe_height: top + 2.0 * pitch + 1.0,
            ..ThreadMilling::default()
        }
    }
}

/// How far a place lies outside a rectangle with round corners about the origin; below 0 inside.
fn outside([x, y]: [f64; 2], half: [f64; 2], corner: f64) -> f64 {
    let (dx, dy) = (x.abs() - (half[0] - corner), y.abs() - (half[1] - corner));
    dx.max(0.0).hypot(dy.max(0.0)) + dx.max(dy).min(0.0) - corner
}

/// A pocket as it was asked for.
struct Asked {
    middle: [f64; 2],
    half: [f64; 2],
    corner: f64,
    radius: f64,
    bottom: f64,
}

/// Nothing outside, the wall all around, and all of the floor.
fn check_pocket(ways: &[Way], asked: &Asked) -> Result<(), TestCaseError> {
    let [x, y] = asked.middle;
    let tool = asked.half.map(|half| half - asked.radius);
    let corner = (asked.corner - asked.radius).max(0.0);
    for way in ways.iter().filter(|way| !way.rapid) {
        for point in &way.points {
            let off = outside([point[0] - x, point[1] - y], tool, corner);
            prop_assert!(off <= 0.001, "line {}: {off} mm into the wall", way.line);
        }
    }
    let floor = at_height(ways, asked.bottom);
    for index in 0..20 {
        for other in 0..20 {
            let place = |index: i32, half: f64| (f64::from(index) / 19.0 * 2.0 - 1.0) * half;
            let [u, v] = [place(index, asked.half[0]), place(other, asked.half[1])];
            // What a round tool can reach.
            if outside([u, v], asked.half, asked.corner.max(asked.radius)) > 0.0 {
                continue;
            }
            let off = distance(&floor, [x + u, y + v]) - asked.radius;
            prop_assert!(off <= 0.005, "{off} mm of material at {u} {v}");
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn a_surface_is_faced_all_over(job in facing()) {
        prop_assume!(job.finish < job.depth);
        let text = job.program().unwrap();
        let ways = ways(&text);
        check_heights(&ways, job.top, job.depth, job.safe_height, |_| false)?;
        check_across(&ways, job.safe_height)?;
        let radius = job.tool_diameter / 2.0;
        let floor = at_height(&ways, job.top - job.depth);
        for (u, v) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (0.5, 0.5), (0.3, 0.9), (0.95, 0.1)] {
            let off = distance(&floor, [job.x + u * job.length, job.y + v * job.width]) - radius;
            prop_assert!(off <= 0.001, "{off} mm of material at {u} {v}\n{text}");
        }
        for way in ways.iter().skip(1).filter(|way| !way.rapid) {
            let is_down = way.points[0][2] > way.points.last().unwrap()[2];
            for &[x, y, _] in &way.points {
                let [dx, dy] = [(job.x - x).max(x - job.x - job.length), (job.y - y).max(y - job.y - job.width)];
                let most = radius + job.overrun + ROUNDING_MM;
                prop_assert!(dx <= most && dy <= most, "line {}", way.line);
                prop_assert!(!is_down || dx.max(dy) >= radius - ROUNDING_MM, "line {}: down in the material\n{text}", way.line);
            }
        }
        if job.pattern == Pattern::OneWay {
            // What is still to be cut is on the right.
            for way in &floor {
                let (a, b) = (way.points[0], way.points.last().unwrap());
                let ahead = match job.along { Along::X => a[0] - b[0], Along::Y => b[1] - a[1] };
                prop_assert!(ahead > 0.0);
            }
        }
    }

    #[test]
    fn a_rectangle_is_cleared_and_its_wall_stands(job in rectangular()) {
        let text = match job.program() {
            // Too narrow or too short for it.
            Err(wrong) if wrong.field == Some("entry") => return Ok(()),
            text => text.unwrap(),
        };
        let ways = ways(&text);
        check_heights(&ways, job.top, job.depth, job.safe_height, |_| false)?;
        check_across(&ways, job.safe_height)?;
        check_pocket(&ways, &Asked {
            middle: [job.x, job.y],
            half: [job.length / 2.0, job.width / 2.0],
            corner: job.corner_radius,
            radius: job.tool_diameter / 2.0,
            bottom: job.top - job.depth,
        })?;
    }

    #[test]
    fn a_circle_is_cleared_and_its_wall_stands(job in circular()) {
        let text = match job.program() {
            Err(wrong) if wrong.field == Some("entry") => return Ok(()),
            text => text.unwrap(),
        };
        let ways = ways(&text);
        check_heights(&ways, job.top, job.depth, job.safe_height, |_| false)?;
        check_across(&ways, job.safe_height)?;
        check_pocket(&ways, &Asked {
            middle: [job.x, job.y],
            half: [job.diameter / 2.0; 2],
            corner: job.diameter / 2.0,
            radius: job.tool_diameter / 2.0,
            bottom: job.top - job.depth,
        })?;
    }

    #[test]
    fn holes_are_where_they_belong(
        (top, depth, peck, safe_height) in heights(),
        (x, y, diameter, count) in (between(-50.0, 50.0), between(-50.0, 50.0), between(20.0, 80.0), 1_u32..20),
        (angle, span) in (between(-360.0, 360.0), prop_oneof![Just(360.0), between(170.0, 300.0)]),
        cycle in prop::sample::select(vec![Cycle::Drill, Cycle::Dwell, Cycle::Peck, Cycle::ChipBreak]),
    ) {
        let job = BoltCircle {
            x, y, diameter, count, angle, span, depth, cycle, peck, top,
            tool_diameter: 2.0,
            retract: (safe_height - top).min(1.0),
            safe_height,
            ..BoltCircle::default()
        };
        let ways = ways(&job.program().unwrap());
        let step = if span == 360.0 { 360.0 / f64::from(count) } else { span / f64::from(count.max(2) - 1) };
        let holes: Vec<[f64; 2]> = (0..count).map(|index| {
            let at = (angle + f64::from(index) * step).to_radians();
            [x + diameter / 2.0 * at.cos(), y + diameter / 2.0 * at.sin()]
        }).collect();
        let over = |[x, y, _]: [f64; 3]| holes.iter().any(|hole| (hole[0] - x).hypot(hole[1] - y) < ROUNDING_MM);
        check_heights(&ways, top, depth, job.safe_height, over)?;
        check_across(&ways, job.safe_height)?;
        for hole in &holes {
            let deepest = ways.iter().flat_map(|way| &way.points)
                .filter(|[x, y, _]| (hole[0] - x).hypot(hole[1] - y) < ROUNDING_MM)
                .fold(f64::INFINITY, |lowest, point| lowest.min(point[2]));
            prop_assert!((deepest - (top - depth)).abs() < ROUNDING_MM);
        }
        for way in ways.iter().filter(|way| !way.rapid) {
            prop_assert!(way.points.iter().all(|&point| over(point)));
        }
    }

    #[test]
    fn rows_of_holes_are_where_they_belong(
        (x, y, columns, rows) in (between(-50.0, 50.0), between(-50.0, 50.0), 1_u32..8, 1_u32..8),
        (column_spacing, row_spacing, angle) in (between(5.0, 20.0), between(-20.0, -5.0), between(-360.0, 360.0)),
    ) {
        let job = HoleRows { x, y, columns, rows, column_spacing, row_spacing, angle, ..HoleRows::default() };
        let ways = ways(&job.program().unwrap());
        let mut bottoms: Vec<[f64; 3]> = ways.iter().filter(|way| !way.rapid).map(|way| *way.points.last().unwrap()).collect();
        prop_assert_eq!(bottoms.len() as u32, columns * rows);
        let (sin, cos) = angle.to_radians().sin_cos();
        for row in 0..rows {
            for column in 0..columns {
                let (u, v) = (f64::from(column) * column_spacing, f64::from(row) * row_spacing);
                let hole = [x + u * cos - v * sin, y + u * sin + v * cos, -job.depth];
                let before = bottoms.len();
                bottoms.retain(|bottom| bottom.iter().zip(hole).any(|(a, b)| (a - b).abs() > ROUNDING_MM));
                prop_assert_eq!(bottoms.len() + 1, before);
            }
        }
    }

    #[test]
    fn a_thread_is_a_helix_of_its_pitch_and_hand(job in thread()) {
        let text = job.program().unwrap();
        let ways = ways(&text);
        check_heights(&ways, job.top, job.depth, job.safe_height, |_| false)?;
        check_across(&ways, job.safe_height)?;
        let inside = job.side == Side::Inside;
        let profile = job.pitch * if inside { 0.541_266 } else { 0.613_435 };
        let radius = match inside {
            true => (job.diameter - job.tool_diameter) / 2.0,
            false => (job.diameter + job.tool_diameter) / 2.0 - profile,
        };
        let polar = |point: [f64; 3]| (point[1] - job.y).atan2(point[0] - job.x);
        let distance = |point: [f64; 3]| (point[0] - job.x).hypot(point[1] - job.y);
        let mut full = 0.0;
        for way in ways.iter().filter(|way| !way.rapid) {
            for &point in &way.points {
                let off = if inside { distance(point) - radius } else { radius - distance(point) };
                prop_assert!(off <= 0.001, "line {}: {off} mm too deep", way.line);
            }
            if way.points.iter().all(|&point| (distance(point) - radius).abs() < 0.001) {
                let turn: f64 = way.points.windows(2).map(|pair| {
                    let turn = polar(pair[1]) - polar(pair[0]);
                    turn - (turn / std::f64::consts::TAU).round() * std::f64::consts::TAU
                }).sum();
                let rise = way.points.last().unwrap()[2] - way.points[0][2];
                let right = turn * rise > 0.0;
                prop_assert_eq!(right, job.hand == Hand::Right);
                prop_assert_eq!(turn > 0.0, inside == (job.cut == Cut::Climb));
                prop_assert!((rise.abs() / turn.abs() * std::f64::consts::TAU - job.pitch).abs() < ROUNDING_MM, "{text}");
                full += rise.abs();
            }
        }
        prop_assert!(full >= job.depth - job.pitch / 4.0 - ROUNDING_MM, "{full}\n{text}");
    }

    #[test]
    fn any_text_is_engraved_or_its_letters_are_named(
        text in prop_oneof!["\\PC{0,20}", "[ -~ÄÖÜäöüß]{1,30}", any::<String>()],
        (height, angle, depth) in (between(0.5, 20.0), between(-360.0, 360.0), between(0.01, 1.0)),
        layout in prop::sample::select(vec![Layout::Line, Layout::ArcOutwards, Layout::ArcInwards]),
    ) {
        let job = Engraving { text: text.clone(), height, angle, depth, layout, radius: 2000.0, ..Engraving::default() };
        let known = |letter: char| (' '..='~').contains(&letter) || "ÄÖÜäöüß".contains(letter);
        match job.program() {
            Ok(program) => {
                prop_assert!(text.chars().all(known));
                let ways = ways(&program);
                check_heights(&ways, job.top, depth, job.safe_height, |_| false)?;
            }
            Err(wrong) => {
                prop_assert_eq!(wrong.field, Some("text"));
                for letter in text.chars().filter(|&letter| !known(letter) && !letter.is_control()) {
                    prop_assert!(wrong.message.text.contains(letter));
                }
            }
        }
    }
}

/// Letters as they stand on a line: capitals are as high as said, and the text as wide.
#[test]
fn letters_have_their_height_and_stand_on_their_line() {
    for angle in [0.0, 90.0] {
        let place = |[x, y, _]: [f64; 3]| if angle == 0.0 { [x, y] } else { [y, -x] };
        let job = Engraving {
            text: "HIH".into(),
            angle,
            height: 16.0,
            ..Engraving::default()
        };
        let ways = ways(&job.program().unwrap());
        let points: Vec<[f64; 2]> = ways
            .iter()
            .filter(|way| !way.rapid)
            .flat_map(|way| way.points.iter().map(|&point| place(point)))
            .collect();
        let most = |axis: usize| points.iter().map(|point| point[axis]).fold(f64::NEG_INFINITY, f64::max);
        let least = |axis: usize| points.iter().map(|point| point[axis]).fold(f64::INFINITY, f64::min);
        assert!((most(1) - 16.0).abs() < ROUNDING_MM && least(1).abs() < ROUNDING_MM);
        // 5, 0 and 5 units of 2 mm, and two spaces of 2 units.
        assert!((most(0) - 28.0).abs() < ROUNDING_MM && least(0).abs() < ROUNDING_MM);
    }
    // On a circle, outwards and inwards.
    for (layout, inner, outer) in [(Layout::ArcOutwards, 30.0, 38.0), (Layout::ArcInwards, 22.0, 30.0)] {
        let job = Engraving {
            text: "IIIIIIII".into(),
            layout,
            angle: 90.0,
            align: Align::Middle,
            ..Engraving::default()
        };
        let ways = ways(&job.program().unwrap());
        let points: Vec<[f64; 3]> = ways
            .iter()
            .filter(|way| !way.rapid)
            .flat_map(|way| way.points.clone())
            .collect();
        let radii: Vec<f64> = points.iter().map(|[x, y, _]| x.hypot(*y)).collect();
        assert!((radii.iter().fold(0.0_f64, |most, radius| most.max(*radius)) - outer).abs() < ROUNDING_MM);
        assert!((radii.iter().fold(99.0_f64, |least, radius| least.min(*radius)) - inner).abs() < ROUNDING_MM);
        let mean = points.iter().map(|point| point[0]).sum::<f64>() / points.len() as f64;
        assert!(mean.abs() < 0.01 && points.iter().all(|point| point[1] > 0.0), "{mean}");
    }
}

/// A tool that touches each place where it was told to: no thin last pass or row.
#[test]
fn steps_are_equal() {
    let job = RectangularPocket {
        depth: 5.1,
        stepdown: 2.5,
        finish: 0.0,
        ..RectangularPocket::default()
    };
    let text = job.program().unwrap();
    let levels: Vec<&str> = text.lines().filter(|line| line.starts_with("(Level at")).collect();
    assert_eq!(levels, ["(Level at Z-1.7)", "(Level at Z-3.4)", "(Level at Z-5.1)"]);
    let job = Facing {
        width: 58.0,
        stepover: 20.0,
        tool_diameter: 40.0,
        ..Facing::default()
    };
    let text = job.program().unwrap();
    assert!(text.contains("(Rows: 3 of 20 mm, passes: 1)"), "{text}");
}
