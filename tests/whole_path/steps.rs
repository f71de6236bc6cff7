//! Joints with step pulses: what comes out at the pins, as drivers of motors see it.

use super::*;
use isocnc::config::{StepKind, StepPortKind};
use isocnc::host::step_port::StepPort;

const PLOTTER: &str = include_str!("../../configs/plotter2-steps.toml");
const DRAWING: &str = include_str!("../../configs/plotter-part.ngc");
const STEPS_PER_MM: f64 = 80.0;

fn plotter() -> Config {
    config::parse(PLOTTER, Path::new("plotter2-steps.toml")).expect("a good machine file")
}

/// Levels as they were written, with their dates.
#[derive(Clone, Default)]
struct Recorder(Arc<Mutex<Vec<(u64, u32)>>>);

impl StepPort for Recorder {
    fn write(&mut self, now_ns: u64, levels: u32) -> bool {
        let mut all = self.0.lock().expect("one thread");
        if all.last().is_none_or(|(_, last)| *last != levels) {
            all.push((now_ns, levels));
        }
        true
    }

    fn pulse(&mut self, now_ns: u64, levels: u32, pulses: u32, _pulse_ns: u64) -> bool {
        self.write(now_ns, levels ^ pulses) && self.write(now_ns, levels)
    }
}

/// What a driver makes of two lines: +1, -1 or 0 for a change of levels.
fn step_of(kind: StepKind, before: [bool; 2], now: [bool; 2]) -> i64 {
    let rises = |line: usize| now[line] && !before[line];
    match kind {
        StepKind::StepDirection => i64::from(rises(0)) * if now[1] { 1 } else { -1 },
        StepKind::UpDown => i64::from(rises(0)) - i64::from(rises(1)),
        StepKind::Quadrature => {
            let order = [[false, false], [true, false], [true, true], [false, true]];
            let place = |lines| order.iter().position(|other| *other == lines).expect("one of four") as i64;
            match (place(now) - place(before)).rem_euclid(4) {
                0 => 0,
                1 => 1,
                3 => -1,
                _ => panic!("both phases changed at once"),
            }
        }
    }
}

/// Places of the pen at each step, mm.
fn drawn(config: &Config, levels: &[(u64, u32)]) -> Vec<Position> {
    let steps = config.steps.as_ref().expect("a port");
    let outputs: Vec<_> = config.joints.iter().filter_map(|joint| joint.step).collect();
    let mut before = vec![[false; 2]; outputs.len()];
    let (mut at, mut places) = ([0_i64; 2], vec![Position::ZERO]);
    for (_, levels) in levels {
        let high = |bit: u8| (levels ^ steps.inverted) >> bit & 1 == 1;
        let mut moved = false;
        for (joint, output) in outputs.iter().enumerate() {
            let now = output.lines.map(high);
            let step = step_of(output.kind, before[joint], now);
            before[joint] = now;
            at[joint] += step;
            moved |= step != 0;
        }
        if moved {
            let [x, y] = at.map(|steps| steps as f64 / STEPS_PER_MM);
            places.push(Position::xyz(x, y, 0.0));
        }
    }
    places
}

/// Draws with exact corners; gives the levels and how far steps lie beside the programmed path, in steps.
fn draw(config: &Config) -> (Vec<(u64, u32)>, f64) {
    let exact = DRAWING.replace("G64 P0.01", "G61.1");
    assert_ne!(exact, DRAWING);
    let recorder = Recorder::default();
    rehearse_on(config, NetConfig::clean(1), &exact, |run| {
        run.control.steps_mut().set_port(Box::new(recorder.clone()));
        assert_eq!(finish(run), Outcome::Completed);
        let levels = recorder.0.lock().expect("one thread").clone();
        let places = drawn(config, &levels);
        assert!(places.len() > 30_000, "{} steps", places.len());
        let off_mm = deviation(&places, run.path(), 0.5).off_mm;
        (levels, off_mm * STEPS_PER_MM)
    })
}

#[test]
fn a_plotter_draws_within_a_step_of_its_path() {
    let config = plotter();
    let (levels, off_steps) = draw(&config);
    assert!(off_steps <= 1.0, "{off_steps}");
    assert_eq!(drawn(&config, &levels).last(), Some(&Position::ZERO));
    let (begin_ns, _) = levels[1];
    assert!(
        levels[1..].iter().all(|(at_ns, _)| (at_ns - begin_ns) % 50_000 == 0),
        "off the grid"
    );
    // Without power nothing is left on.
    let (_, last) = levels.last().expect("some");
    let enables = 0b10_0100;
    assert_eq!(last & enables, 0, "{last:#b}");
}

#[test]
fn a_machine_without_a_bus_says_nothing_of_a_network() {
    let config = plotter();
    rehearse_on(&config, NetConfig::clean(1), DRAWING, |run| {
        assert_eq!(run.operator.step_code().name(), "start");
        assert_eq!(finish(run), Outcome::Completed);
        let told: Vec<&str> = run.operator.journal().iter().map(|entry| entry.text.as_str()).collect();
        assert!(
            told.len() > 5 && told.iter().all(|text| !text.contains("network")),
            "{told:?}"
        );
        assert_eq!(run.operator.operational_s(), None);
    });
}

#[test]
fn every_way_to_tell_steps_draws_the_same() {
    let (levels, _) = draw(&plotter());
    let wanted = drawn(&plotter(), &levels);
    for (kind, length_ticks, inverted) in [
        (StepKind::StepDirection, 0, 0b01_1011),
        (StepKind::UpDown, 1, 0),
        (StepKind::UpDown, 0, 0b10_0110),
        (StepKind::Quadrature, 1, 0b01_0000),
    ] {
        let mut config = plotter();
        config.steps.as_mut().expect("a port").inverted = inverted;
        for output in config.joints.iter_mut().filter_map(|joint| joint.step.as_mut()) {
            output.kind = kind;
            output.timing.high_ticks = length_ticks;
            if kind != StepKind::StepDirection {
                (output.timing.setup_ticks, output.timing.hold_ticks) = (0, 0);
            }
        }
        let (levels, off_steps) = draw(&config);
        assert!(off_steps <= 1.0, "{kind:?} {length_ticks}: {off_steps}");
        let places = drawn(&config, &levels);
        assert!(
            places.len().abs_diff(wanted.len()) < wanted.len() / 100,
            "{kind:?} {length_ticks}"
        );
        assert_eq!(places.last(), wanted.last(), "{kind:?} {length_ticks}");
    }
}

/// Steps that simulated motors have lost, with so much torque.
fn lost_with(acceleration: f64, speed: f64) -> [i64; 2] {
    let mut config = plotter();
    let motor = &mut config.steps.as_mut().expect("a port").motor;
    (motor.acceleration, motor.speed) = (acceleration, speed);
    rehearse_on(&config, NetConfig::clean(1), DRAWING, |run| {
        assert_eq!(finish(run), Outcome::Completed);
        [0, 1].map(|joint| {
            let read = |pin: &str| run.hal.view().value(&format!("stepgen.{joint}.{pin}")).expect("a pin");
            let number = |pin| match read(pin) {
                hal_pins::AnyValue::S64(number) => number as f64,
                hal_pins::AnyValue::Float(number) => number,
                other => panic!("{other:?}"),
            };
            assert_eq!(number("counts"), 0.0, "the control knows of what it sent only");
            number("lost") as i64
        })
    })
}

#[test]
fn a_motor_that_is_too_weak_loses_steps_and_one_that_is_not_does_not() {
    assert_eq!(lost_with(4.0, 2.0), [0, 0]);
    let lost = lost_with(0.3, 0.5);
    assert!(lost.iter().any(|lost| *lost != 0), "{lost:?}");
    // By whole periods of the field.
    assert!(lost.iter().all(|lost| lost % 64 == 0), "{lost:?}");
}

#[test]
fn levels_may_be_pins_that_lead_to_an_io_node() {
    let text = PLOTTER
        .replace("kind = \"none\"", "kind = \"memory\"\n[[bus.node]]\nid = 10\nname = \"outputs\"\nprofile = \"io\"\noutputs = [\"0x6200:1/8\"]")
        .replace("port = \"simulated\"", "port = \"pins\"\n[[hal.net]]\nname = \"step\"\nsource = \"stepgen.0.phase-a\"\ntargets = [\"io.10.out-00\"]\n[[hal.net]]\nname = \"dir\"\nsource = \"stepgen.0.phase-b\"\ntargets = [\"io.10.out-01\"]")
        .lines()
        .filter(|line| !line.starts_with("motor ="))
        .map(|line| match line.starts_with("step =") {
            true => line
                .replace("step-dir", "quadrature")
                .replace("length_ticks = 1, space_ticks = 1, setup_ticks = 1, hold_ticks = 1", "length_ticks = 1, space_ticks = 1"),
            false => line.replace("velocity_mm_s = 100.0", "velocity_mm_s = 5.0").replace("following_error_mm = 1.0", "following_error_mm = 0.1"),
        })
        .map(|line| line.replace("search_mm_s = 10.0", "search_mm_s = 5.0") + "\n")
        .collect::<String>();
    let config = config::parse(&text, Path::new("plotter2-steps.toml")).unwrap_or_else(|errors| panic!("{errors}"));
    assert_eq!(
        config.steps.as_ref().map(|steps| &steps.port),
        Some(&StepPortKind::Pins)
    );
    rehearse_on(&config, NetConfig::clean(1), "G1 X2 F240\nX-1\nM2\n", |run| {
        let (mut before, mut at, mut most) = ([false; 2], 0, 0);
        let ended = run.run_until(CYCLES_MAX, |run| {
            let [wired, _] = run.net().machine().outputs(10).expect("an I/O node");
            let now = [wired & 1 != 0, wired & 2 != 0];
            at += step_of(StepKind::Quadrature, before, now);
            before = now;
            most = most.max(at);
            run.operator.outcome().is_some() && run.control.state() == State::Down
        });
        assert!(ended.expect("a good program"), "{}", journal(run));
        assert_eq!((most, at), (160, -80), "{}", journal(run));
    });
}

#[test]
fn a_machine_may_have_drives_on_the_bus_and_step_pulses() {
    let mut config = machine();
    let plotter = plotter();
    let mut steps = plotter.steps.clone().expect("a port");
    steps.motor.acceleration = 10.0;
    config.steps = Some(steps);
    // Z of the mill by a stepper; its drive stays on the bus, off.
    let z = &mut config.joints[2];
    z.node = config.bus.nodes.len();
    z.step = plotter.joints[0].step;
    z.counts_per_unit = plotter.joints[0].counts_per_unit;
    z.homing.by = plotter.joints[0].homing.by;
    rehearse_on(&config, NetConfig::clean(1), PART, |run| {
        assert_eq!(finish(run), Outcome::Completed);
        let last = *commands(run).last().expect("a program ran");
        assert_eq!(last, PART_END);
    });
}
