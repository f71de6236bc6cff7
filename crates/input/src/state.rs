//! What a device says, as values of pins.
//!
//! In:  codes that are wanted, how the device is when it appears, its events. Out: a value for each code.

use evdev::{AbsoluteAxisCode, EventSummary, InputEvent, KeyCode, RelativeAxisCode};
use hal_pins::AnyValue;
use std::str::FromStr;

/// A stick has been moved by a hand if it is so far from where it was, as a share of its way to one side.
const MOVED: f64 = 0.1;

/// A code that is wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Code {
    Key(KeyCode),
    Axis(AbsoluteAxisCode),
    Wheel(RelativeAxisCode),
}

impl Code {
    /// The code of a pin: `btn-south` is `BTN_SOUTH`.
    pub(crate) fn of_pin(pin: &str) -> Option<Code> {
        let name = pin.to_ascii_uppercase().replace('-', "_");
        match name.get(..4)? {
            "BTN_" | "KEY_" => KeyCode::from_str(&name).ok().map(Code::Key),
            "ABS_" => AbsoluteAxisCode::from_str(&name).ok().map(Code::Axis),
            "REL_" => RelativeAxisCode::from_str(&name).ok().map(Code::Wheel),
            _ => None,
        }
    }

    /// The pin of a code; one that the kernel has no name for has none.
    pub(crate) fn pin(self) -> Option<String> {
        let name = match self {
            Code::Key(code) => format!("{code:?}"),
            Code::Axis(code) => format!("{code:?}"),
            Code::Wheel(code) => format!("{code:?}"),
        };
        let pin = name.to_ascii_lowercase().replace('_', "-");
        (Code::of_pin(&pin) == Some(self)).then_some(pin)
    }

    /// What it is while nobody touches it.
    fn at_rest(self) -> AnyValue {
        match self {
            Code::Key(_) => AnyValue::Bit(false),
            Code::Axis(_) => AnyValue::Float(0.0),
            Code::Wheel(_) => AnyValue::S32(0),
        }
    }
}

/// The way of a stick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Way {
    pub(crate) min: i32,
    pub(crate) max: i32,
    /// Up to this far from its middle it is at rest.
    pub(crate) flat: i32,
}

impl Way {
    /// -1 to 1.
    fn share(self, value: i32) -> f64 {
        let [min, max, value] = [self.min, self.max, value].map(f64::from);
        let off = value - (min + max) / 2.0;
        if max <= min || off.abs() <= f64::from(self.flat) {
            return 0.0;
        }
        (2.0 * off / (max - min)).clamp(-1.0, 1.0)
    }
}

/// How a device is when it appears.
pub(crate) trait Device {
    /// Whether a key is pressed.
    fn pressed(&self, code: KeyCode) -> bool;
    /// The way of a stick and where it is; `None`: it has none.
    fn axis(&self, code: AbsoluteAxisCode) -> Option<(Way, i32)>;
}

/// One wanted code.
#[derive(Debug)]
struct Entry {
    code: Code,
    value: AnyValue,
    way: Option<Way>,
    /// Where a stick was, or 1 for a pressed button, when the device appeared: it does not count before a hand has moved it.
    waits: Option<f64>,
    /// It has changed since values were taken.
    is_fresh: bool,
}

/// Values of all wanted codes.
#[derive(Debug)]
pub(crate) struct State(Vec<Entry>);

impl State {
    /// All at rest.
    pub(crate) fn new(codes: impl IntoIterator<Item = Code>) -> State {
        let entry = |code: Code| Entry {
            code,
            value: code.at_rest(),
            way: None,
            waits: None,
            is_fresh: false,
        };
        State(codes.into_iter().map(entry).collect())
    }

    /// A device has appeared. Counts go on from these values of its wheels, in the order of the codes.
    pub(crate) fn appears(&mut self, device: &impl Device, counts: impl Fn(usize) -> i32) {
        for (place, entry) in self.0.iter_mut().enumerate() {
            match entry.code {
                Code::Key(code) => entry.waits = device.pressed(code).then_some(1.0),
                Code::Axis(code) => {
                    let found = device.axis(code);
                    entry.way = found.map(|(way, _)| way);
                    entry.waits = found.map(|(way, value)| way.share(value)).filter(|share| *share != 0.0);
                }
                Code::Wheel(_) => entry.value = AnyValue::S32(counts(place)),
            }
        }
    }

    /// It has gone: at rest is what a hand holds; counts stay.
    pub(crate) fn goes(&mut self) {
        for entry in &mut self.0 {
            if !matches!(entry.code, Code::Wheel(_)) {
                entry.value = entry.code.at_rest();
            }
            entry.waits = None;
        }
    }

    /// Takes an event. `false`: it would cover a change of the same button that nobody has seen yet; it is to be given again once
    /// [`State::taken`] was called.
    pub(crate) fn take(&mut self, event: InputEvent) -> bool {
        let (code, value) = match event.destructure() {
            // 2: it repeats, which is no news.
            EventSummary::Key(_, code, value @ (0 | 1)) => (Code::Key(code), value),
            EventSummary::AbsoluteAxis(_, code, value) => (Code::Axis(code), value),
            EventSummary::RelativeAxis(_, code, value) => (Code::Wheel(code), value),
            _ => return true,
        };
        let Some(entry) = self.0.iter_mut().find(|entry| entry.code == code) else {
            return true;
        };
        let new = match (code, entry.value) {
            (Code::Wheel(_), AnyValue::S32(count)) => AnyValue::S32(count.wrapping_add(value)),
            (Code::Axis(_), _) => {
                let share = entry.way.map_or(0.0, |way| way.share(value));
                let is_moved = |from: f64| share == 0.0 || (share - from).abs() > MOVED;
                if entry.waits.is_some_and(|from| !is_moved(from)) {
                    return true;
                }
                AnyValue::Float(share)
            }
            _ => {
                if entry.waits.is_some() && value != 0 {
                    return true;
                }
                AnyValue::Bit(value != 0)
            }
        };
        if entry.is_fresh && matches!(code, Code::Key(_)) && new != entry.value {
            return false;
        }
        entry.waits = None;
        entry.is_fresh |= new != entry.value;
        entry.value = new;
        true
    }

    /// Values were taken.
    pub(crate) fn taken(&mut self) {
        for entry in &mut self.0 {
            entry.is_fresh = false;
        }
    }

    /// Values in the order of the codes.
    pub(crate) fn values(&self) -> impl Iterator<Item = AnyValue> {
        self.0.iter().map(|entry| entry.value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use evdev::EventType;

    /// A pad: its pressed button, where its stick is.
    struct Pad(Option<KeyCode>, i32);

    impl Device for Pad {
        fn pressed(&self, code: KeyCode) -> bool {
            self.0 == Some(code)
        }

        fn axis(&self, _code: AbsoluteAxisCode) -> Option<(Way, i32)> {
            Some((WAY, self.1))
        }
    }

    const WAY: Way = Way {
        min: 0,
        max: 255,
        flat: 15,
    };

    fn state(device: &Pad) -> State {
        let codes = ["btn-south", "abs-x", "rel-wheel"].map(|pin| Code::of_pin(pin).unwrap());
        let mut state = State::new(codes);
        state.appears(device, |_| 40);
        state
    }

    fn values(state: &State) -> (bool, f64, i32) {
        let values: Vec<_> = state.values().collect();
        match values[..] {
            [AnyValue::Bit(button), AnyValue::Float(stick), AnyValue::S32(wheel)] => (button, stick, wheel),
            _ => panic!("{values:?}"),
        }
    }

    fn event(code: &str, value: i32) -> InputEvent {
        match Code::of_pin(code).unwrap() {
            Code::Key(code) => InputEvent::new(EventType::KEY.0, code.0, value),
            Code::Axis(code) => InputEvent::new(EventType::ABSOLUTE.0, code.0, value),
            Code::Wheel(code) => InputEvent::new(EventType::RELATIVE.0, code.0, value),
        }
    }

    #[test]
    fn names_of_pins_are_those_of_the_kernel() {
        for pin in [
            "btn-south",
            "btn-trigger-happy1",
            "key-f1",
            "abs-x",
            "abs-hat0y",
            "rel-wheel",
            "rel-dial",
        ] {
            assert_eq!(Code::of_pin(pin).and_then(Code::pin).as_deref(), Some(pin));
        }
        for none in ["btn-none-of-these", "abs-", "south", "sw-lid", ""] {
            assert_eq!(Code::of_pin(none), None, "{none}");
        }
    }

    #[test]
    fn a_stick_is_a_share_of_its_way_and_at_rest_in_its_flat_middle() {
        let share = |value| (WAY.share(value) * 1000.0).round() / 1000.0;
        assert_eq!([0, 64, 127, 140, 255].map(share), [-1.0, -0.498, 0.0, 0.0, 1.0]);
        assert_eq!([-9, 999].map(share), [-1.0, 1.0], "beyond its way");
        let none = Way {
            min: 5,
            max: 5,
            flat: 0,
        };
        assert_eq!(none.share(9), 0.0);
        let whole = Way {
            min: i32::MIN,
            max: i32::MAX,
            flat: 0,
        };
        assert_eq!([i32::MIN, i32::MAX].map(|value| whole.share(value)), [-1.0, 1.0]);
    }

    #[test]
    fn events_change_pins_and_counts_go_on() {
        let mut state = state(&Pad(None, 127));
        assert_eq!(values(&state), (false, 0.0, 40));
        for event in [
            event("btn-south", 1),
            event("abs-x", 255),
            event("rel-wheel", -3),
            event("btn-south", 2),
        ] {
            assert!(state.take(event));
        }
        assert_eq!(values(&state), (true, 1.0, 37));
        // What is not wanted.
        assert!(state.take(event("abs-y", 3)) && state.take(event("key-a", 1)));
        state.goes();
        assert_eq!(values(&state), (false, 0.0, 37), "the wheel stands");
    }

    #[test]
    fn a_press_and_its_release_in_one_breath_are_both_seen() {
        let mut state = state(&Pad(None, 127));
        assert!(state.take(event("btn-south", 1)));
        assert!(
            !state.take(event("btn-south", 0)),
            "not before somebody has seen it pressed"
        );
        assert!(values(&state).0);
        state.taken();
        assert!(state.take(event("btn-south", 0)));
        assert!(!values(&state).0);
    }

    #[test]
    fn what_is_held_when_a_device_appears_counts_once_a_hand_has_moved_it() {
        let south = KeyCode::BTN_SOUTH;
        let mut state = state(&Pad(Some(south), 255));
        assert_eq!(values(&state), (false, 0.0, 40));
        // It trembles, and repeats.
        for event in [event("abs-x", 250), event("abs-x", 255), event("btn-south", 1)] {
            assert!(state.take(event));
        }
        assert_eq!(values(&state), (false, 0.0, 40));
        assert!(state.take(event("btn-south", 0)) && state.take(event("abs-x", 127)));
        assert!(state.take(event("btn-south", 1)) && state.take(event("abs-x", 255)));
        assert_eq!(values(&state), (true, 1.0, 40));
    }
}
