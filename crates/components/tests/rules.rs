//! Rules of all components, whatever they do.

use crate::rig;

use components::{CATALOGUE, Direction};
use hal_pins::{AnyValue, Type, check_name};
use proptest::prelude::*;
use rig::{Rig, T};

#[test]
fn kinds_are_sorted_and_have_names_and_texts() {
    assert!(CATALOGUE.is_sorted_by(|a, b| a.name < b.name));
    for kind in &CATALOGUE {
        assert!(kind.doc.trim().ends_with('.'), "{}: {}", kind.name, kind.doc);
        let mut pins = kind.make(&[]).unwrap().pins();
        for pin in &pins {
            check_name(&format!("{}.0.{}", kind.name.replace('_', "-"), pin.name)).unwrap();
            assert!(!pin.doc.is_empty(), "{} {}", kind.name, pin.name);
        }
        assert!(pins.iter().any(|pin| pin.direction == Direction::Out), "{}", kind.name);
        let all = pins.len();
        pins.sort_by(|a, b| a.name.cmp(&b.name));
        pins.dedup_by(|a, b| a.name == b.name);
        assert_eq!(pins.len(), all, "{}: two pins of one name", kind.name);
    }
}

#[test]
fn every_component_has_a_table_and_a_model() {
    for folder in ["tables", "models"] {
        let files = std::fs::read_dir(format!("{}/tests/{folder}", env!("CARGO_MANIFEST_DIR"))).unwrap();
        let text: String = files
            .map(|file| std::fs::read_to_string(file.unwrap().path()).unwrap())
            .collect();
        for kind in &CATALOGUE {
            let quoted = format!("\"{}\"", kind.name);
            assert!(text.contains(&quoted), "{quoted}");
        }
    }
}

#[test]
fn an_option_outside_its_range_or_unknown_is_refused() {
    let logic = components::find("logic").unwrap();
    let refused = |options: &[(String, i64)]| logic.make(options).err().unwrap().to_string();
    assert_eq!(refused(&[("personality".into(), 17)]), "must be 1 to 16");
    assert_eq!(
        refused(&[("size".into(), 2)]),
        "is no option of logic: it has personality"
    );
    for kind in &CATALOGUE {
        for spec in kind.options {
            for value in spec.range {
                assert!(!kind.make(&[(spec.name.into(), value)]).unwrap().pins().is_empty());
            }
            assert!((spec.range[0]..=spec.range[1]).contains(&spec.default), "{}", spec.name);
        }
    }
}

/// Values that a pin may come to have, the worst included.
fn any_value(kind: Type) -> BoxedStrategy<AnyValue> {
    let worst = prop_oneof![
        Just(0.0),
        Just(1.0),
        Just(-1.0),
        Just(f64::NAN),
        Just(f64::INFINITY),
        Just(f64::NEG_INFINITY),
        Just(f64::MAX),
        Just(f64::MIN_POSITIVE),
        -1e3..1e3
    ];
    match kind {
        Type::Bit => any::<bool>().prop_map(AnyValue::Bit).boxed(),
        Type::S32 => prop_oneof![Just(i32::MIN), Just(i32::MAX), -9..9i32]
            .prop_map(AnyValue::S32)
            .boxed(),
        Type::U32 => prop_oneof![Just(u32::MAX), 0..40u32].prop_map(AnyValue::U32).boxed(),
        Type::Float => worst.prop_map(AnyValue::Float).boxed(),
        Type::S64 | Type::U64 => unreachable!("no component has such a pin"),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// Overflow checks are on in tests: this finds sums that overflow, too.
    #[test]
    fn nothing_that_comes_makes_one_panic(
        kind in 0..CATALOGUE.len(),
        least in any::<bool>(),
        seeds in proptest::collection::vec(any::<proptest::sample::Index>(), 20..60),
        calls in proptest::collection::vec(proptest::collection::vec(any_value(Type::Float), 8), 10),
        bits in any::<u64>(),
        integers in proptest::collection::vec((any_value(Type::S32), any_value(Type::U32)), 8),
    ) {
        let kind = &CATALOGUE[kind];
        let options: Vec<(&str, i64)> = kind.options.iter().map(|spec| (spec.name, spec.range[usize::from(!least)])).collect();
        let mut rig = Rig::new(kind.name, &options);
        let inputs = rig.inputs().len();
        for (call, floats) in calls.iter().enumerate() {
            for (at, seed) in seeds.iter().enumerate() {
                if inputs == 0 {
                    break;
                }
                let pin = (seed.index(inputs) + call * at) % inputs;
                let value = match rig.pins[pin].default.kind() {
                    Type::Bit => AnyValue::Bit(bits >> ((call * 7 + at) % 64) & 1 != 0),
                    Type::S32 => integers[(call + at) % 8].0,
                    Type::U32 => integers[(call + at) % 8].1,
                    _ => floats[at % 8],
                };
                rig.set_at(pin, value);
            }
            rig.update(T);
        }
    }

    /// The same inputs give the same outputs.
    #[test]
    fn nothing_depends_on_anything_but_inputs_and_calls(kind in 0..CATALOGUE.len(), bits in any::<u64>()) {
        let kind = &CATALOGUE[kind];
        let run = || {
            let mut rig = Rig::new(kind.name, &[]);
            let mut seen = Vec::new();
            for call in 0..40 {
                for pin in 0..rig.inputs().len() {
                    if rig.pins[pin].default.kind() == Type::Bit {
                        rig.set_at(pin, AnyValue::Bit(bits >> ((call * 5 + pin) % 64) & 1 != 0));
                    }
                }
                rig.update(T);
                seen.push(format!("{:?}", rig.outputs()));
            }
            seen
        };
        prop_assert_eq!(run(), run());
    }
}

#[test]
fn what_limits_or_remembers_never_shows_what_is_no_number() {
    let arithmetic = [
        "abs",
        "blend",
        "ddt",
        "deadzone",
        "div2",
        "feedcomp",
        "hypot",
        "invert",
        "joyhandle",
        "constant",
        "led_dim",
        "lincurve",
        "mult2",
        "mux16",
        "mux_generic",
        "mux2",
        "mux4",
        "mux8",
        "offset",
        "pid",
        "scale",
        "scaled_s32_sums",
        "siggen",
        "sum2",
        "tristate_float",
        "biquad",
        "orient",
        "gantry",
    ];
    for kind in CATALOGUE.iter().filter(|kind| !arithmetic.contains(&kind.name)) {
        let mut rig = Rig::new(kind.name, &[]);
        for call in 0..20 {
            for pin in 0..rig.inputs().len() {
                match rig.pins[pin].default {
                    AnyValue::Float(_) => rig.set_at(pin, AnyValue::Float(f64::NAN)),
                    AnyValue::Bit(_) => rig.set_at(pin, AnyValue::Bit(call % (pin + 2) == 0)),
                    _ => {}
                }
            }
            rig.update(T);
            for (pin, value) in rig.pins[rig.inputs().len()..].iter().zip(rig.outputs()) {
                let shown = !matches!(value, AnyValue::Float(value) if value.is_nan());
                assert!(shown, "{}.{}", kind.name, pin.name);
            }
        }
    }
}
