//! `[steps]` and `step` of a joint: stepper motors that are moved by pulses of this PC.
//!
//! In:  the tables of the machine file. Out: what the port is, and how each joint puts its pulses on it.

use super::question::Bound;
use super::section::{Section, keys};
use super::values::ratio;
use motion::rt::dda::PulseTiming;
use std::path::PathBuf;

/// Parts of a step in which a joint is commanded: pulses come evenly although a command is a whole number.
pub const SUBSTEPS: u32 = 256;
/// Most pins of one port.
const PINS_MAX: usize = 32;
/// Pins of a parallel port that can be driven: eight of data, four of control.
pub const PARALLEL_PINS: [u8; 12] = [2, 3, 4, 5, 6, 7, 8, 9, 1, 14, 16, 17];

/// `[steps]`: where the pulses of this PC come out.
#[derive(Clone, Debug, PartialEq)]
pub struct Steps {
    pub port: StepPortKind,
    /// Length of pulses that end within the tick in which they begin, ns.
    pub pulse_ns: u32,
    /// The base rate: period of the time-out thread, or of the cycle, ns.
    pub tick_ns: u32,
    /// Pins that are used; bit n of what is written is the n-th of them.
    pub pins: Vec<u8>,
    /// Bits of pins that are low where they would be high.
    pub inverted: u32,
    /// How the simulated motors are.
    pub motor: SimStepper,
}

/// What puts levels on pins.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum StepPortKind {
    /// A parallel port, by the kernel's ppdev.
    Parallel(PathBuf),
    /// A GPIO character device of Linux.
    Gpio(PathBuf),
    /// HAL pins, which nets lead to outputs of an I/O node: one level a cycle.
    Pins,
    /// Simulated stepper motors.
    Simulated,
}

keys! {
    /// Simulated stepper motors.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct SimStepper(section) {
        /// Pulses that make a full step.
        pub microsteps: u32 = section.integer("microsteps", 1..=256, 16),
        /// Acceleration that the motor gives at rest, in multiples of `stop_acceleration_mm_s2` of its joint.
        pub acceleration: f64 = section.number("acceleration", Bound::Within(0.01, 1000.0), 4.0),
        /// Speed at which it gives half of that, in multiples of `velocity_mm_s` of its joint.
        pub speed: f64 = section.number("speed", Bound::Within(0.01, 1000.0), 2.0),
    }
}

/// `step` of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepOutput {
    pub kind: StepKind,
    /// Bits of the two lines in [`Steps::pins`].
    pub lines: [u8; 2],
    /// Bit of the line that is high while the motor has current.
    pub enable: Option<u8>,
    pub timing: PulseTiming,
}

/// How two lines tell of steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepKind {
    /// A pulse a step; the direction.
    StepDirection,
    /// A pulse a step up; a pulse a step down.
    UpDown,
    /// Two phases, one of which changes with each step.
    Quadrature,
}

impl StepKind {
    /// The word of the machine file.
    pub const fn name(self) -> &'static str {
        match self {
            StepKind::StepDirection => "step-dir",
            StepKind::UpDown => "up-down",
            StepKind::Quadrature => "quadrature",
        }
    }
}

/// Pins as `[steps]` hands them out.
pub(super) struct Port {
    steps: Steps,
    cycle_us: u32,
}

/// Reads `[steps]`; `timeout_us`, `cycle_us`: `None` where they have errors of their own.
pub(super) fn steps(mut section: Section<'_, '_>, timeout_us: Option<u32>, cycle_us: Option<u32>) -> Option<Port> {
    const WORDS: [(&str, u8); 4] = [("parallel", 0), ("gpio", 1), ("pins", 2), ("simulated", 3)];
    let port = section.word("port", &WORDS, None);
    let mut device = |usual| {
        section
            .optional_text("device")
            .map(|text| PathBuf::from(text.unwrap_or(usual)))
    };
    let kind = match port? {
        0 => StepPortKind::Parallel(device("/dev/parport0")?),
        1 => StepPortKind::Gpio(device("/dev/gpiochip0")?),
        2 => StepPortKind::Pins,
        _ => StepPortKind::Simulated,
    };
    match kind {
        StepPortKind::Pins | StepPortKind::Simulated => {
            section.refuse(&["device"], "is of port = \"parallel\" or \"gpio\"");
        }
        StepPortKind::Parallel(_) | StepPortKind::Gpio(_) => section.known(&["device"]),
    }
    // A tick must be over before the next one, with time for the others.
    let pulse_most = timeout_us.unwrap_or(50) * 1000 / 4;
    let pulse_ns = section.integer("pulse_ns", 100..=pulse_most, 2500);
    if kind != StepPortKind::Simulated && section.has("motor") {
        section.wrong("motor", "is of port = \"simulated\"");
    }
    let motor = section.section("motor")?.whole(SimStepper::read);
    let (timeout_us, cycle_us) = (timeout_us?, cycle_us?);
    let tick_ns = match kind {
        StepPortKind::Pins => cycle_us * 1000,
        StepPortKind::Parallel(_) | StepPortKind::Gpio(_) | StepPortKind::Simulated => timeout_us * 1000,
    };
    if !(cycle_us * 1000).is_multiple_of(tick_ns) {
        let rule = format!(
            "needs a cycle_us ({cycle_us}) that is a multiple of rt.timeout_us ({timeout_us}), the tick of its pulses"
        );
        section.wrong("port", rule);
    }
    section.done();
    Some(Port {
        steps: Steps {
            port: kind,
            pulse_ns: pulse_ns?,
            tick_ns,
            pins: Vec::new(),
            inverted: 0,
            motor: motor?,
        },
        cycle_us,
    })
}

impl Port {
    pub(super) fn into_steps(self) -> Steps {
        self.steps
    }

    /// The bit of a pin that no other line has.
    fn take(&mut self, section: &mut Section<'_, '_>, key: &'static str, pin: u8, inverted: bool) -> Option<u8> {
        if let StepPortKind::Parallel(_) = self.steps.port
            && !PARALLEL_PINS.contains(&pin)
        {
            let rule = format!("must be an output of a parallel port: one of {PARALLEL_PINS:?}");
            return section.refused(key, rule);
        }
        if self.steps.pins.contains(&pin) {
            return section.refused(key, format!("pin {pin} is taken by another line"));
        }
        if self.steps.pins.len() == PINS_MAX {
            let rule = format!("must not be one more line: a port has {PINS_MAX} at the most");
            return section.refused(key, rule);
        }
        let bit = self.steps.pins.len() as u8;
        self.steps.pins.push(pin);
        self.steps.inverted |= u32::from(inverted) << bit;
        Some(bit)
    }
}

/// Reads `step` of a joint with `output = "step"`; `port`: `None` where `[steps]` has errors of its own or is missing.
pub(super) fn output(
    joint: &mut Section<'_, '_>,
    port: Option<&mut Port>,
    has_port: bool,
    velocity_mm_s: Option<f64>,
    counts_per_unit: Option<[u32; 2]>,
) -> Option<StepOutput> {
    if !has_port {
        let rule = "\"step\" needs a table [steps], which says where pulses come out";
        joint.wrong("output", rule);
    }
    let mut section = match joint.optional_section("step") {
        Some(section) => section,
        None => {
            if !joint.has("step") {
                joint.required(
                    "step",
                    "how pulses come out, like { type = \"step-dir\", pins = [2, 3] }",
                );
            }
            return None;
        }
    };
    let kind = section.word(
        "type",
        &[StepKind::StepDirection, StepKind::UpDown, StepKind::Quadrature].map(|kind| (kind.name(), kind)),
        StepKind::StepDirection,
    );
    let (each, rule) = (
        "one for each of the two lines, like [2, 3]",
        "must be two: one for each line",
    );
    let pins: Option<[u8; 2]> = (section.required("pins", each))
        .and_then(|item| section.array("pins", item, rule, |item, path| item.integer(path, 0..=u8::MAX)));
    let inverted = match section.has("inverted") {
        true => (section.required("inverted", each))
            .and_then(|item| section.array("inverted", item, rule, |item, path| item.flag(path))),
        false => Some([false; 2]),
    };
    let enable = section.optional_integer("enable_pin", 0..=u8::MAX);
    let enable_inverted = section.flag("enable_inverted", false);
    let within_tick = port.as_ref().is_some_and(|port| port.steps.port != StepPortKind::Pins);
    let high_ticks = section.integer("length_ticks", u32::from(!within_tick)..=1000, 1);
    let low_ticks = section.integer("space_ticks", 1..=1000, 1);
    let setup_ticks = section.integer("setup_ticks", 0..=1000, 1);
    let hold_ticks = section.integer("hold_ticks", 0..=1000, 1);
    let (kind, pins, inverted) = (kind?, pins?, inverted?);
    let port = port?;
    // Only where there is a line of the direction.
    let directed = |ticks: u32| if kind == StepKind::StepDirection { ticks } else { 0 };
    if kind != StepKind::StepDirection {
        for key in ["setup_ticks", "hold_ticks"] {
            if section.has(key) {
                section.wrong(key, "is of type = \"step-dir\": there is no line of the direction");
            }
        }
    }
    let timing = PulseTiming {
        ticks_per_cycle: port.cycle_us * 1000 / port.steps.tick_ns,
        high_ticks: high_ticks?,
        low_ticks: low_ticks?,
        setup_ticks: directed(setup_ticks?),
        hold_ticks: directed(hold_ticks?),
    };
    let rate_hz = rate_max_hz(&timing, port.steps.tick_ns);
    if let (Some(velocity), Some(counts)) = (velocity_mm_s, counts_per_unit) {
        let most = rate_hz / ratio(counts);
        if velocity > most {
            let rule = format!(
                "must not be above {most}: a pulse of {} and a pause of {} ticks of {} us make {rate_hz:.0} steps/s at the most",
                timing.high_ticks,
                timing.low_ticks,
                port.steps.tick_ns / 1000
            );
            joint.wrong("velocity_mm_s", rule);
        }
    }
    let mut lines = [0; 2];
    for ((line, pin), inverted) in lines.iter_mut().zip(pins).zip(inverted) {
        *line = port.take(&mut section, "pins", pin, inverted)?;
    }
    let enable = match enable? {
        Some(pin) => Some(port.take(&mut section, "enable_pin", pin, enable_inverted?)?),
        None => {
            if section.has("enable_inverted") {
                section.wrong("enable_inverted", "needs an enable_pin");
            }
            None
        }
    };
    section.done();
    Some(StepOutput {
        kind,
        lines,
        enable,
        timing,
    })
}

/// Steps a second that a timing allows at the most.
pub fn rate_max_hz(timing: &PulseTiming, tick_ns: u32) -> f64 {
    1e9 / f64::from(tick_ns) / f64::from(timing.high_ticks + timing.low_ticks)
}
