//! Switches and counters of the operator's desk that the operator's loop keeps, as pins.
//!
//! In:  what the operator's loop says they are; edges of pins.
//! Out: pins; what pins want of the operator's loop.
//!
//! RT: nothing allocates but [`DeskPins::new`].

use crate::shared::ByHand;
use config::{BUTTONS_MAX, Config};
use hal_pins::{Hal, HalError, Input, Output};
use machine::faults::Reaction;
use protocol::Mode;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, AtomicU64, Ordering::Relaxed};

/// What the operator's loop and the cycle thread tell each other of it.
#[derive(Debug, Default)]
pub struct Desk {
    block_delete: AtomicBool,
    /// Place in [`MODES`].
    mode: AtomicU8,
    /// Made, and wanted; 0: nobody says how many.
    parts: [AtomicU64; 2],
    /// In the spindle.
    tool: AtomicU32,
    /// Alarms and warnings since the start, by their reaction.
    alarms: [AtomicU64; Reaction::ALL.len()],
    /// 0: nothing, 1: off, 2: on.
    wanted: AtomicU8,
    reset: AtomicBool,
    /// Pins have asked for drives on, for drives off, for the program that is loaded.
    orders: [AtomicBool; PinOrder::ALL.len()],
    /// Buttons of the user that pins have pressed, a bit each.
    pressed: AtomicU64,
}

/// What pins may order of the operator's loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PinOrder {
    /// Drives off.
    Off,
    /// Drives on.
    On,
    /// The program that is loaded.
    Start,
}

impl PinOrder {
    /// All of them, in the order in which they are obeyed.
    pub const ALL: [PinOrder; 3] = [PinOrder::Off, PinOrder::On, PinOrder::Start];
}

/// Whose orders the machine follows, as `halui.mode` shows it.
const MODES: [Mode; 3] = [Mode::Manual, Mode::Auto, Mode::Mdi];

impl Desk {
    /// How things are: whether lines that begin with / are left out; parts made, and wanted (0: nobody says).
    pub fn show(&self, block_delete: bool, parts: [u64; 2]) {
        self.block_delete.store(block_delete, Relaxed);
        for (cell, value) in self.parts.iter().zip(parts) {
            cell.store(value, Relaxed);
        }
    }

    /// Whose orders the machine follows.
    pub fn show_mode(&self, mode: Mode) {
        let place = MODES.iter().position(|known| *known == mode);
        self.mode.store(place.unwrap_or_default() as u8, Relaxed);
    }

    /// Another alarm or warning was given. Of the operator's loop alone.
    pub fn count_alarm(&self, reaction: Reaction) {
        let count = &self.alarms[reaction as usize];
        count.store(count.load(Relaxed) + 1, Relaxed);
    }

    /// Alarms or warnings of this reaction since the start.
    pub fn alarms(&self, reaction: Reaction) -> u64 {
        self.alarms[reaction as usize].load(Relaxed)
    }

    /// Which tool is in the spindle, as far as the operator's loop knows.
    pub fn show_tool(&self, tool: u32) {
        self.tool.store(tool, Relaxed);
    }

    /// Which one it is.
    pub fn tool(&self) -> u32 {
        self.tool.load(Relaxed)
    }

    /// Whether a pin has asked since the last call to leave out lines that begin with /, or not to.
    pub fn take_block_delete(&self) -> Option<bool> {
        match self.wanted.swap(0, Relaxed) {
            0 => None,
            wanted => Some(wanted == 2),
        }
    }

    /// What pins have ordered since the last call.
    pub fn take_orders(&self) -> impl Iterator<Item = PinOrder> {
        let ordered = |order: &PinOrder| self.orders[*order as usize].swap(false, Relaxed);
        PinOrder::ALL.into_iter().filter(ordered)
    }

    /// Buttons of the user that pins have pressed since the last call, by their places in the machine file.
    pub fn take_pressed(&self) -> impl Iterator<Item = usize> {
        let pressed = self.pressed.swap(0, Relaxed);
        (0..BUTTONS_MAX).filter(move |place| pressed >> place & 1 == 1)
    }

    /// Whether a pin has asked since the last call that parts are counted from 0.
    pub fn take_reset(&self) -> bool {
        self.reset.swap(false, Relaxed)
    }
}

/// A pin of which a rising edge acts.
pub struct Button {
    pin: Input<bool>,
    before: bool,
}

impl Button {
    /// # Errors
    /// Shared memory too small.
    pub fn new(hal: &mut Hal, name: &str) -> Result<Button, HalError> {
        Ok(Button {
            pin: hal.input(name, false)?,
            before: false,
        })
    }

    /// Whether it has risen since the last call.
    pub fn take(&mut self) -> bool {
        let now = self.pin.get();
        let before = std::mem::replace(&mut self.before, now);
        now && !before
    }
}

/// `.on` and `.off`, of which a rising edge acts, and `.is-on`.
pub struct SwitchPins {
    on: Button,
    off: Button,
    is_on: Output<bool>,
}

impl SwitchPins {
    /// # Errors
    /// Shared memory too small.
    pub fn new(hal: &mut Hal, name: &str) -> Result<SwitchPins, HalError> {
        Ok(SwitchPins {
            on: Button::new(hal, &format!("{name}.on"))?,
            off: Button::new(hal, &format!("{name}.off"))?,
            is_on: hal.output(&format!("{name}.is-on"))?,
        })
    }

    /// What is wanted, if one of them has risen since the last call; off wins.
    pub fn take(&mut self) -> Option<bool> {
        match [self.on.take(), self.off.take()] {
            [_, true] => Some(false),
            [true, false] => Some(true),
            [false, false] => None,
        }
    }

    pub fn show(&mut self, on: bool) {
        self.is_on.set(on);
    }
}

/// The spindle by hand.
struct SpindlePins {
    forward: Button,
    reverse: Button,
    stop: Button,
    rpm: Input<f64>,
}

impl SpindlePins {
    fn new(hal: &mut Hal) -> Result<SpindlePins, HalError> {
        let name = |pin: &str| format!("halui.spindle.0.{pin}");
        Ok(SpindlePins {
            forward: Button::new(hal, &name("forward"))?,
            reverse: Button::new(hal, &name("reverse"))?,
            stop: Button::new(hal, &name("stop"))?,
            rpm: hal.input(&name("speed"), 0.0)?,
        })
    }

    /// What is wanted, at `rpm_max` at the most, if one of them has risen since the last call; stop wins.
    fn take(&mut self, rpm_max: f64) -> Option<ByHand> {
        // Not `clamp`, which lets NaN pass.
        #[allow(clippy::manual_clamp, reason = "max and min turn NaN into 0")]
        let rpm = self.rpm.get().max(0.0).min(rpm_max);
        match [self.forward.take(), self.reverse.take(), self.stop.take()] {
            [_, _, true] => Some(ByHand::Spindle(0.0)),
            [true, _, _] => Some(ByHand::Spindle(rpm)),
            [_, true, _] => Some(ByHand::Spindle(-rpm)),
            [false, false, false] => None,
        }
    }
}

/// Which of several holds, one pin each.
struct OneOf<const N: usize>([Output<bool>; N]);

impl<const N: usize> OneOf<N> {
    fn new(hal: &mut Hal, names: [&str; N]) -> Result<OneOf<N>, HalError> {
        let mut pins = Vec::with_capacity(N);
        for name in names {
            pins.push(hal.output(name)?);
        }
        let pins = pins.try_into().unwrap_or_else(|_| unreachable!("one for each name"));
        Ok(OneOf(pins))
    }

    fn show(&mut self, which: usize) {
        for (place, pin) in self.0.iter_mut().enumerate() {
            pin.set(place == which);
        }
    }
}

/// How a program is, as `halui.program` shows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProgramState {
    /// None runs or is held.
    Idle,
    /// It runs.
    Running,
    /// It is held, or waits for the operator.
    Paused,
}

/// What pins want of the cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wanted {
    /// Rest on the path.
    pub pause: bool,
    /// Spindle, flood and mist.
    pub by_hand: [Option<ByHand>; 3],
}

/// All pins of it.
pub struct DeskPins {
    /// `halui.program.resume`, `halui.program.stop`.
    resume: Button,
    stop: Button,
    pause: Button,
    orders: [Button; PinOrder::ALL.len()],
    /// Those of the user that ask nothing, and their places in the machine file.
    buttons: Vec<(usize, Button)>,
    spindle: SpindlePins,
    rpm_max: f64,
    flood: SwitchPins,
    mist: SwitchPins,
    program: OneOf<3>,
    mode: OneOf<3>,
    optional_stop: SwitchPins,
    /// M1 stops.
    stops_optionally: bool,
    block_delete: SwitchPins,
    count: Output<u64>,
    target: Output<u64>,
    reset: Button,
}

impl DeskPins {
    /// # Errors
    /// Shared memory too small.
    pub fn new(hal: &mut Hal, config: &Config, [resume, stop]: [Button; 2]) -> Result<DeskPins, HalError> {
        let panel = config.panel.iter().flat_map(|panel| &panel.buttons);
        let mut buttons = Vec::new();
        for (place, button) in panel.enumerate() {
            if let Some(pin) = button.pin() {
                buttons.push((place, Button::new(hal, &pin)?));
            }
        }
        Ok(DeskPins {
            resume,
            stop,
            pause: Button::new(hal, "halui.program.pause")?,
            orders: [
                Button::new(hal, "halui.machine.off")?,
                Button::new(hal, "halui.machine.on")?,
                Button::new(hal, "halui.program.run")?,
            ],
            buttons,
            spindle: SpindlePins::new(hal)?,
            rpm_max: config.spindle.rpm_max,
            flood: SwitchPins::new(hal, "halui.flood")?,
            mist: SwitchPins::new(hal, "halui.mist")?,
            program: OneOf::new(
                hal,
                [
                    "halui.program.is-idle",
                    "halui.program.is-running",
                    "halui.program.is-paused",
                ],
            )?,
            mode: OneOf::new(hal, ["halui.mode.is-manual", "halui.mode.is-auto", "halui.mode.is-mdi"])?,
            optional_stop: SwitchPins::new(hal, "halui.program.optional-stop")?,
            stops_optionally: config.program.optional_stop,
            block_delete: SwitchPins::new(hal, "halui.program.block-delete")?,
            count: hal.output("halui.parts.count")?,
            target: hal.output("halui.parts.target")?,
            reset: Button::new(hal, "halui.parts.reset")?,
        })
    }

    /// Whether the resume pin has risen since the last call.
    pub fn take_resume(&mut self) -> bool {
        self.resume.take()
    }

    /// Whether the stop pin has risen since the last call.
    pub fn take_stop(&mut self) -> bool {
        self.stop.take()
    }

    /// Whether M1 stops.
    pub fn stops_optionally(&self) -> bool {
        self.stops_optionally
    }

    /// From now on M1 stops, or does not.
    pub fn set_optional_stop(&mut self, on: bool) {
        self.stops_optionally = on;
    }

    /// Once a cycle.
    pub fn follow(&mut self, desk: &Desk) {
        if let Some(on) = self.optional_stop.take() {
            self.stops_optionally = on;
        }
        self.optional_stop.show(self.stops_optionally);
        if let Some(on) = self.block_delete.take() {
            desk.wanted.store(if on { 2 } else { 1 }, Relaxed);
        }
        if self.reset.take() {
            desk.reset.store(true, Relaxed);
        }
        self.block_delete.show(desk.block_delete.load(Relaxed));
        self.count.set(desk.parts[0].load(Relaxed));
        self.target.set(desk.parts[1].load(Relaxed));
        for (button, ordered) in self.orders.iter_mut().zip(&desk.orders) {
            if button.take() {
                ordered.store(true, Relaxed);
            }
        }
        for (place, button) in &mut self.buttons {
            if button.take() {
                desk.pressed.fetch_or(1 << *place, Relaxed);
            }
        }
        self.mode.show(usize::from(desk.mode.load(Relaxed)));
    }

    /// What they want of the cycle, once in it.
    pub fn take(&mut self) -> Wanted {
        Wanted {
            pause: self.pause.take(),
            by_hand: [
                self.spindle.take(self.rpm_max),
                self.flood.take().map(ByHand::Flood),
                self.mist.take().map(ByHand::Mist),
            ],
        }
    }

    /// How the program is, and which pumps run.
    pub fn show(&mut self, program: ProgramState, [flood, mist]: [bool; 2]) {
        self.program.show(program as usize);
        self.flood.show(flood);
        self.mist.show(mist);
    }
}
