//! Numbers as computing leaves them: beside every value and every end there is something between 1e-17 and 1e-3, in any axis, on
//! machines of every family of kinematics, with both planners.
//!
//! Judged are the limits of every joint in every sample, the end of every move to the last bit where it is programmed as a stop, the
//! end of the program, and the order of lines. More of them: `ISOCNC_MOVES=1000000 cargo test --release -p isocnc-motion residues`, and `ISOCNC_SEED` is the first seed.

use super::*;
use crate::canon::Axis;
use crate::element::{Element, Span};
use crate::kinematics::{
    Elbow, Follows, Hand, HeadTable, JOINTS, Kinematics, LinearDelta, Rotary, RotaryAxis, Scara, TableTable, ToolFrame,
    Transform,
};
use crate::plan::frame::Frame;
use crate::plan::offline::Recorder;
use crate::ring::Timed;

/// Numbers that are the same everywhere (SplitMix64).
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        bits ^ (bits >> 31)
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn below(&mut self, count: usize) -> usize {
        (self.bits() % count as u64) as usize
    }

    fn once_in(&mut self, count: usize) -> bool {
        self.below(count) == 0
    }

    fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.below(of.len())]
    }

    /// What computing leaves behind, and what it does not: of either sign, all orders of magnitude alike; mostly nothing.
    fn residue(&mut self) -> f64 {
        match self.below(4) {
            0 => libm::pow(10.0, self.within(-17.0, -3.0)) * self.pick(&[1.0, -1.0]),
            1 => self.pick(&[1e-8, -1e-8, 1.1e-8, 5e-9, 2e-7, f64::EPSILON]),
            _ => 0.0,
        }
    }
}

/// A machine, and where its programs take place.
struct Machine {
    name: &'static str,
    settings: Settings,
    room: Vec<(Axis, [f64; 2])>,
    tool_centre: bool,
}

const LINEAR: AxisLimits = AxisLimits {
    velocity: 150.0,
    acceleration: 1500.0,
    jerk: 30_000.0,
    travel: [-1e4, 1e4],
};
const ROTARY: AxisLimits = AxisLimits {
    velocity: 120.0,
    acceleration: 1200.0,
    jerk: 40_000.0,
    travel: [-1e5, 1e5],
};

fn limits(axis: Axis) -> AxisLimits {
    match axis {
        Axis::Z => AxisLimits {
            velocity: 100.0,
            acceleration: 1000.0,
            jerk: 20_000.0,
            ..LINEAR
        },
        axis if axis.is_rotary() => ROTARY,
        _ => LINEAR,
    }
}

fn machine(name: &'static str, transform: Option<Transform>, room: &[(Axis, [f64; 2])]) -> Machine {
    let mut start = Position::ZERO;
    for &(axis, [low, high]) in room {
        start[axis] = 0.5 * (low + high);
    }
    let axes: Vec<Axis> = room.iter().map(|(axis, _)| *axis).collect();
    let mut settings = Settings::new(Axis::ALL.map(|axis| axes.contains(&axis).then(|| limits(axis))), 1e-3);
    settings.start = start;
    if let Some(transform) = transform {
        let follows: Vec<Follows> = axes
            .iter()
            .map(|&axis| Follows {
                axis: Some(axis),
                offset: 0.0,
            })
            .collect();
        let kinematics = Kinematics::new(transform, &follows);
        let mut of_joints = [LINEAR; JOINTS];
        for (limits, axis) in of_joints.iter_mut().zip(&axes) {
            *limits = super::residues::limits(*axis);
        }
        if let Transform::Scara(_) = transform {
            of_joints[..2].fill(ROTARY);
        }
        settings.joints = Some(JointSpace {
            kinematics,
            limits: of_joints,
        });
    }
    let tool_centre = matches!(transform, Some(Transform::TableTable(_) | Transform::HeadTable(_)));
    Machine {
        name,
        settings,
        room: room.to_vec(),
        tool_centre,
    }
}

fn machines() -> [Machine; 7] {
    use Axis::{A, B, C, U, V, W, X, Y, Z};
    let rotary = |axis, hand| Rotary {
        axis,
        hand,
        centre_mm: [0.0; 3],
    };
    let table = Transform::TableTable(TableTable {
        primary: rotary(RotaryAxis::A, Hand::Right),
        secondary: rotary(RotaryAxis::C, Hand::Right),
    });
    let head = Transform::HeadTable(HeadTable {
        head: rotary(RotaryAxis::B, Hand::Right),
        pivot_mm: [0.0, 0.0, 150.0],
        table: rotary(RotaryAxis::C, Hand::Left),
    });
    let scara = Transform::Scara(Scara {
        inner_arm_mm: 300.0,
        outer_arm_mm: 200.0,
        tool_offset_mm: 0.0,
        elbow: Elbow::Positive,
        shoulder_middle_degrees: 0.0,
    });
    let delta = Transform::LinearDelta(LinearDelta {
        rod_mm: 250.0,
        radius_mm: 150.0,
        towers: [90.0, -30.0, -150.0].map(LinearDelta::tower),
    });
    let cube = [(X, [-80.0, 80.0]), (Y, [-80.0, 80.0]), (Z, [-60.0, 20.0])];
    let with = |more: &[(Axis, [f64; 2])]| [&cube[..], more].concat();
    [
        machine("mill", None, &cube),
        machine(
            "nine axes",
            None,
            &with(&[
                (A, [-40.0, 40.0]),
                (B, [-90.0, 90.0]),
                (C, [-180.0, 180.0]),
                (U, [-20.0, 20.0]),
                (V, [-20.0, 20.0]),
                (W, [-20.0, 20.0]),
            ]),
        ),
        machine(
            "table-table",
            Some(table),
            &with(&[(A, [-40.0, 15.0]), (C, [-80.0, 80.0])]),
        ),
        machine(
            "head-table",
            Some(head),
            &with(&[(B, [-35.0, 35.0]), (C, [-80.0, 80.0])]),
        ),
        machine(
            "scara",
            Some(scara),
            &[
                (X, [280.0, 380.0]),
                (Y, [-60.0, 60.0]),
                (Z, [-100.0, -20.0]),
                (C, [-40.0, 40.0]),
            ],
        ),
        machine(
            "delta",
            Some(delta),
            &[(X, [-50.0, 50.0]), (Y, [-50.0, 50.0]), (Z, [-20.0, 20.0])],
        ),
        machine("corexy", Some(Transform::CoreXy), &cube),
    ]
}

/// A program under construction.
struct Writer<'m> {
    machine: &'m Machine,
    random: Random,
    at: Position,
    rapid: bool,
    calls: Vec<Call>,
    moves: usize,
}

impl Writer<'_> {
    fn go(&mut self, to: Position) {
        let mut to = to;
        for &(axis, [low, high]) in &self.machine.room {
            to[axis] = to[axis].clamp(low, high);
        }
        self.calls.push(match self.rapid {
            true => Call::StraightTraverse { to },
            false => Call::StraightFeed { to },
        });
        self.at = to;
        self.moves += 1;
    }

    /// Some axes move by what people write; what is beside it, in any axis, is what computing leaves.
    fn line(&mut self) {
        let scale = self.random.pick(&[0.001, 0.02, 0.3, 5.0, 30.0]);
        let mut to = self.at;
        for &(axis, _) in &self.machine.room {
            if self.random.once_in(2) {
                to[axis] = ((to[axis] + self.random.within(-scale, scale)) * 1e4).round() / 1e4;
            }
            to[axis] += self.random.residue();
        }
        self.go(to);
    }

    /// The end is told again, or nearly.
    fn again(&mut self) {
        let mut to = self.at;
        for &(axis, _) in &self.machine.room {
            to[axis] += self.random.residue();
        }
        self.go(to);
    }

    /// One axis beside next to nothing of the others.
    fn one_axis(&mut self) {
        let mut to = self.at;
        for &(axis, _) in &self.machine.room {
            to[axis] += self.random.residue();
        }
        let (axis, _) = self.random.pick(&self.machine.room);
        let by = self.random.pick(&[0.001, 0.1, 2.54, 10.0, 90.0]);
        to[axis] += self.random.within(-by, by);
        self.go(to);
    }

    /// Counted up, then the sum as somebody else has it, then a turn.
    fn count_up(&mut self) {
        let (axis, _) = self.random.pick(&self.machine.room);
        let step = self.random.pick(&[2.54, 3.3, 0.1, 0.7, 1e-3]) * self.random.pick(&[1.0, -1.0]);
        let from = self.at[axis];
        let count = 1 + self.random.below(6);
        for _ in 0..count {
            let mut to = self.at;
            to[axis] += step;
            self.go(to);
        }
        let mut to = self.at;
        to[axis] = from + count as f64 * step;
        self.go(to);
        self.one_axis();
    }

    /// Turned, and turned back, in as many moves; in inches, with four digits of them.
    fn computed(&mut self) {
        let angle = self.random.within(-3.0, 3.0);
        let (sin, cos) = libm::sincos(angle);
        let mut to = self.at;
        let (x, y) = (to[Axis::X], to[Axis::Y]);
        let (u, v) = (x * cos - y * sin, x * sin + y * cos);
        (to[Axis::X], to[Axis::Y]) = (u * cos + v * sin, v * cos - u * sin);
        self.go(to);
        self.line();
        let mut to = self.at;
        for axis in [Axis::X, Axis::Y] {
            to[axis] = (to[axis] / 25.4 * 1e4).round() / 1e4 * 25.4;
        }
        self.go(to);
    }

    fn arc(&mut self) {
        let plane = self.random.pick(&[Plane::Xy, Plane::Zx, Plane::Yz]);
        let [first, second, normal] = plane.axes();
        let radius = self.random.pick(&[1e-9, 1e-7, 1e-5, 0.01, 0.5, 3.0, 8.0]) * self.random.within(0.5, 2.0);
        let from = self.random.within(-3.0, 3.0);
        let sweep = match self.random.below(4) {
            0 => libm::pow(10.0, self.random.within(-12.0, 0.0)),
            1 => std::f64::consts::TAU,
            _ => self.random.within(0.01, 6.0),
        };
        let turns = self.random.pick(&[1, -1, 2, -2]);
        let mut to = self.at;
        let centre_mm = [
            to[first] - radius * libm::cos(from),
            to[second] - radius * libm::sin(from),
        ];
        let until = if turns > 0 { from + sweep } else { from - sweep };
        to[first] = centre_mm[0] + radius * libm::cos(until) + 1e-2 * self.random.residue();
        to[second] = centre_mm[1] + radius * libm::sin(until) + 1e-2 * self.random.residue();
        to[normal] += self.random.residue();
        if self.random.once_in(3) {
            to[normal] += self.random.within(-2.0, 2.0);
        }
        for &(axis, _) in &self.machine.room {
            if axis.is_rotary() && self.random.once_in(4) {
                to[axis] += self.random.residue();
            }
        }
        let inside = |axis: Axis| {
            let (_, [low, high]) = self
                .machine
                .room
                .iter()
                .find(|(of, _)| *of == axis)
                .expect("an axis of it");
            let centre = if axis == first {
                centre_mm[0]
            } else if axis == second {
                centre_mm[1]
            } else {
                to[axis]
            };
            let out = if axis == normal { 0.0 } else { radius * 1.001 + 0.01 };
            centre - out > *low && centre + out < *high
        };
        let tiny = libm::hypot(to[first] - centre_mm[0], to[second] - centre_mm[1]) < 1e-10;
        if tiny || ![first, second, normal].into_iter().all(inside) {
            return;
        }
        self.calls.push(Call::ArcFeed {
            to,
            plane,
            centre_mm,
            turns,
        });
        self.at = to;
        self.moves += 1;
    }

    fn change(&mut self) {
        let call = match self.random.below(8) {
            0 => Call::SetPathMode(PathMode::ExactPath),
            1 | 2 => Call::SetPathMode(PathMode::ExactStop),
            3..=5 => Call::SetPathMode(PathMode::Continuous {
                tolerance_mm: Some(self.random.pick(&[0.001, 0.01, 0.1])),
                naive_cam_tolerance_mm: self.random.pick(&[None, Some(0.0), Some(0.01)]),
            }),
            6 => {
                let feed = self.random.pick(&[1.0, 5.0, 50.0, 200.0]);
                Call::SetFeedRate {
                    linear: feed,
                    angular: feed,
                }
            }
            _ => self
                .random
                .pick(&[Call::Flood(true), Call::Flood(false)].map(Some).each_ref())
                .clone()
                .unwrap_or(Call::Mist(true)),
        };
        self.calls.push(call);
        self.rapid = self.random.once_in(4);
    }

    fn write(&mut self, blocks: usize) {
        for _ in 0..blocks {
            match self.random.below(16) {
                0..=4 => self.line(),
                5 | 6 => self.again(),
                7 | 8 => self.one_axis(),
                9 => self.count_up(),
                10 => self.computed(),
                11 | 12 => self.arc(),
                13 => self.calls.push(Call::Dwell { seconds: 0.0037 }),
                _ => self.change(),
            }
        }
    }
}

/// Joints once a cycle and at the end.
fn joint_samples(elements: &[Element], settings: &Settings) -> (Vec<Position>, [Option<AxisLimits>; AXES]) {
    let Some(space) = &settings.joints else {
        return (
            super::super::offline::sample(elements, settings.start, settings.cycle_s),
            settings.axes,
        );
    };
    let count = space.count();
    let at = |span: &Span, into_s: f64| {
        let axes = span.piece.position(span.place(into_s));
        let mut joints = Position::ZERO;
        (space
            .kinematics
            .inverse(span.piece.frame(), &axes.0, &mut joints.0[..count]))
        .expect("a place in reach");
        joints
    };
    let mut start = Position::ZERO;
    (space
        .kinematics
        .inverse(&ToolFrame::OFF, &settings.start.0, &mut start.0[..count]))
    .expect("a place in reach");
    let (mut samples, mut into_s, mut end) = (vec![start], settings.cycle_s, start);
    for element in elements {
        let duration_s = element.duration_s();
        while into_s <= duration_s {
            samples.push(match element {
                Element::Span(span) => at(span, into_s),
                _ => end,
            });
            into_s += settings.cycle_s;
        }
        into_s -= duration_s;
        if let Element::Span(span) = element {
            end = at(span, duration_s);
        }
    }
    samples.push(end);
    let limits = std::array::from_fn(|joint| (joint < count).then(|| space.limits[joint]));
    (samples, limits)
}

/// Plans a program of this machine and judges all of it; how many moves it had.
fn judge(machine: &Machine, planner_kind: PlannerKind, seed: u64, blocks: usize) -> usize {
    let name = format!("{} {planner_kind:?} seed {seed} blocks {blocks}", machine.name);
    let settings = Settings {
        planner_kind,
        ..machine.settings
    };
    let mut writer = Writer {
        machine,
        random: Random(seed),
        at: settings.start,
        rapid: false,
        calls: vec![F, ROUND],
        moves: 0,
    };
    if machine.tool_centre && writer.random.once_in(2) {
        writer.calls.push(Call::SetToolLengthOffset {
            offset: Position::xyz(0.0, 0.0, 40.0),
        });
        writer.at[Axis::Z] -= 40.0;
    }
    writer.write(blocks);
    let calls = events(writer.calls);
    let mut planner = Planner::new(settings, Recorder::default());
    let (mut frame, mut stops, mut stopped) = (Frame::default(), false, Vec::new());
    let mut end = settings.start;
    for event in &calls {
        if let Err(error) = planner.push(event) {
            panic!("{name}: {error}");
        }
        planner.pump();
        match &event.call {
            Call::SetPathMode(mode) => stops = *mode == PathMode::ExactStop,
            Call::SetToolLengthOffset { offset } => frame.tool = *offset,
            Call::StraightFeed { to } | Call::StraightTraverse { to } | Call::ArcFeed { to, .. } => {
                end = frame.machine(to);
                if stops {
                    stopped.push((event.source.line, end));
                }
            }
            _ => {}
        }
    }
    planner.finish();
    loop {
        match planner.pump() {
            Pumped::Done => break,
            Pumped::Refused { line } => panic!("{name}: line {line}: the gate has refused what was planned anew"),
            _ => {}
        }
    }
    assert_eq!(planner.planned_anew(), 0, "{name}: the gate has refused a plan");
    let elements = std::mem::take(&mut planner.sink().elements);
    let time_s: f64 = elements.iter().map(Timed::duration_s).sum();
    assert!(time_s < 1e4, "{name}: {time_s} s");
    let (samples, limits) = joint_samples(&elements, &settings);
    let peaks = check(&samples, settings.cycle_s, &limits);
    assert_eq!(peaks.over(), 0, "{name}: {peaks:?}");
    let spans = || {
        elements.iter().filter_map(|element| match element {
            Element::Span(span) => Some(span),
            _ => None,
        })
    };
    let last = spans()
        .next_back()
        .map_or(settings.start, |span| span.piece.position(span.place(span.duration_s)));
    assert_eq!(
        last.0.map(f64::to_bits),
        end.0.map(f64::to_bits),
        "{name}: ends at {last:?}, not at {end:?}"
    );
    assert!(spans().map(|span| span.line).is_sorted(), "{name}: the order of lines");
    for (line, place) in stopped {
        // One that is no move has no elements.
        let Some(span) = spans().rfind(|span| span.line == line) else {
            continue;
        };
        let there = span.piece.position(span.place(span.duration_s));
        assert_eq!(
            there.0.map(f64::to_bits),
            place.0.map(f64::to_bits),
            "{name}: line {line}: {there:?}, not {place:?}"
        );
    }
    writer.moves
}

/// How many blocks the program of a seed has.
fn blocks(seed: u64) -> usize {
    2 + (seed % 40) as usize
}

#[test]
fn what_computing_leaves_behind_moves_nothing() {
    let wanted: usize = std::env::var("ISOCNC_MOVES").map_or(4000, |moves| moves.parse().expect("a number of moves"));
    let first: u64 = std::env::var("ISOCNC_SEED").map_or(0, |seed| seed.parse().expect("a seed"));
    let machines = machines();
    let (mut moves, mut seed) = (0, first);
    while moves < wanted {
        for machine in &machines {
            for planner_kind in [PlannerKind::Optimal, PlannerKind::Classic] {
                // The classic planner is for joints that are axes.
                if planner_kind == PlannerKind::Classic && machine.settings.joints.is_some() {
                    continue;
                }
                moves += judge(machine, planner_kind, seed, blocks(seed));
            }
        }
        seed += 1;
    }
    println!("{moves} moves, {} seeds", seed - first);
}

/// Found among a million moves: corners on which the length nearly stands still. Their table of lengths was wrong by up to a hundredth
/// of the speed, and the samples from which a slow profile takes its limits leapt over the place.
#[test]
fn corners_on_which_the_length_nearly_stands_still_keep_every_limit() {
    let machines = machines();
    let found = [
        ("scara", 1925),
        ("head-table", 2076),
        ("nine axes", 2079),
        ("mill", 2986),
        ("mill", 3236),
        ("nine axes", 3507),
        ("scara", 4194),
    ];
    for (name, seed) in found {
        let machine = machines
            .iter()
            .find(|machine| machine.name == name)
            .expect("a machine of this name");
        judge(machine, PlannerKind::Optimal, seed, blocks(seed));
    }
}
