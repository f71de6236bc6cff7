//! The components of the machine file, in two lists: before motion and after it.
//!
//! In:  the checked components; pins. Out: pins.
//!
//! A cycle: inputs of nodes → list before motion → orders, interpolation, set-points, what the control shows → list after motion →
//! outputs of nodes. [`late_reads`] says which nets carry a value of the cycle before because of that order.
//!
//! RT: nothing allocates but [`Lists::new`].

use components::{Instance, find};
use config::{Component, Config, Place};
use hal_pins::{AnyValue, Hal, HalError};

/// All components of a machine.
pub struct Lists {
    before: Vec<Instance>,
    after: Vec<Instance>,
    period_s: f64,
}

impl Lists {
    /// Claims the pins of all components and gives inputs the values of the machine file.
    ///
    /// # Errors
    /// Number of the component whose pins cannot be had, and why: names that are taken, shared memory too small.
    pub fn new(hal: &mut Hal, config: &Config) -> Result<Lists, (usize, HalError)> {
        let (mut before, mut after) = (Vec::new(), Vec::new());
        for (number, component) in config.components.iter().enumerate() {
            let Some(made) = make(component) else { continue };
            let instance = Instance::claim(hal, &component.name, made).map_err(|error| (number, error))?;
            for (pin, value) in &component.set {
                set(hal, &format!("{}.{pin}", component.name), *value).map_err(|error| (number, error))?;
            }
            match component.place {
                Place::BeforeMotion => before.push(instance),
                Place::AfterMotion => after.push(instance),
            }
        }
        Ok(Lists {
            before,
            after,
            period_s: f64::from(config.cycle_us) * 1e-6,
        })
    }

    /// Runs those before motion; `skipped`: cycles that were left out since the last one. RT.
    pub fn run_before_motion(&mut self, skipped: u64) {
        run(&mut self.before, self.period_s, skipped);
    }

    /// Runs those after motion. RT.
    pub fn run_after_motion(&mut self, skipped: u64) {
        run(&mut self.after, self.period_s, skipped);
    }
}

fn set(hal: &Hal, pin: &str, value: AnyValue) -> Result<(), HalError> {
    match value {
        AnyValue::Bit(value) => hal.set(pin, value),
        AnyValue::S32(value) => hal.set(pin, value),
        AnyValue::U32(value) => hal.set(pin, value),
        AnyValue::S64(value) => hal.set(pin, value),
        AnyValue::U64(value) => hal.set(pin, value),
        AnyValue::Float(value) => hal.set(pin, value),
    }
}

/// RT.
fn run(instances: &mut [Instance], period_s: f64, skipped: u64) {
    let since_s = period_s * (skipped + 1) as f64;
    for instance in instances {
        instance.update(since_s);
    }
}

/// The component behind a checked description; `None` for one that was not checked.
fn make(component: &Component) -> Option<Box<dyn components::Component>> {
    find(component.kind)?.make(&component.options).ok()
}

/// Pins of all components, for the size of the shared memory.
pub fn count_pins(config: &Config) -> usize {
    let made = config.components.iter().filter_map(make);
    made.map(|mut component| component.pins().len()).sum()
}

/// A net whose target reads what its source had in the cycle before.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LateRead {
    /// Name of the net.
    pub net: String,
    /// Pin that writes it, later in the cycle.
    pub source: String,
    /// Pin that reads it, earlier.
    pub target: String,
}

/// Nets with a component at one end at least that carry a value of the cycle before. Rings of components are meant to do so
/// once; elsewhere another order helps.
pub fn late_reads(config: &Config) -> Vec<LateRead> {
    let mut late = Vec::new();
    for net in config.nets.iter().filter(|net| !net.is_unwired()) {
        let (written, by_component) = moment(config, &net.source, true);
        for target in &net.targets {
            let (read, for_component) = moment(config, target, false);
            // A component that reads its own output reads it before.
            let is_late = read < written || read == written && for_component;
            if is_late && (by_component || for_component) {
                late.push(LateRead {
                    net: net.name.clone(),
                    source: net.source.clone(),
                    target: target.clone(),
                });
            }
        }
    }
    late
}

/// Whether it is a pin of a node, of a program in Structured Text or of another process: their outputs are taken before components
/// run, and their inputs are read behind everything.
pub fn is_of_others(config: &Config, pin: &str) -> bool {
    let of_external = config.external.iter().any(|external| {
        let rest = pin.strip_prefix(external.name.as_str());
        rest.is_some_and(|rest| rest.starts_with('.'))
    });
    of_external || ["io.", "cia402.", "logic."].iter().any(|start| pin.starts_with(start))
}

/// When in a cycle a pin is written or read: part of the cycle and place in its list; and whether it is a component's.
fn moment(config: &Config, pin: &str, is_source: bool) -> ((u8, usize), bool) {
    const INPUTS: u8 = 0;
    const BEFORE: u8 = 1;
    const MOTION: u8 = 2;
    const AFTER: u8 = 3;
    const OUTPUTS: u8 = 4;
    let of_component = |component: &Component| {
        let rest = pin.strip_prefix(component.name.as_str());
        rest.is_some_and(|rest| rest.starts_with('.'))
    };
    if let Some(at) = config.components.iter().position(of_component) {
        let part = match config.components[at].place {
            Place::BeforeMotion => BEFORE,
            Place::AfterMotion => AFTER,
        };
        return ((part, at), true);
    }
    let part = match (is_of_others(config, pin), is_source) {
        (true, true) => INPUTS,
        (true, false) => OUTPUTS,
        (false, _) => MOTION,
    };
    ((part, 0), false)
}

#[cfg(test)]
mod tests {
    use super::*;
    use config::parse;
    use std::path::Path;

    const DEMO: &str = include_str!("../../../configs/mill3-demo.toml");

    fn machine(components: &[(&str, &str, &str)], nets: &[(&str, &str)]) -> Config {
        let mut text = DEMO.to_owned();
        for (name, kind, place) in components {
            text += &format!("[[hal.component]]\nname = {name:?}\ntype = {kind:?}\nplace = {place:?}\n");
        }
        for (number, (source, target)) in nets.iter().enumerate() {
            text += &format!("[[hal.net]]\nname = \"n{number}\"\nsource = {source:?}\ntargets = [{target:?}]\n");
        }
        parse(&text, Path::new("m.toml")).unwrap_or_else(|errors| panic!("{errors}"))
    }

    #[test]
    fn a_value_read_before_it_is_made_is_named() {
        let both = [("not.0", "not", "before-motion"), ("not.1", "not", "before-motion")];
        let late = |components: &[(&str, &str, &str)], source: &str, target: &str| {
            !late_reads(&machine(components, &[(source, target)])).is_empty()
        };
        assert!(!late(&both, "not.0.out", "not.1.in"));
        assert!(late(&both, "not.1.out", "not.0.in"));
        assert!(late(&both, "not.0.out", "not.0.in"));
        // Inputs of nodes come first, their outputs last, the control between the lists.
        assert!(!late(&both, "io.10.in-09", "not.0.in"));
        assert!(!late(&both, "not.0.out", "io.10.out-05"));
        assert!(!late(&both, "not.0.out", "motion.feed-hold"));
        assert!(late(&both, "motion.digital-out-01", "not.0.in"));
        let after = [("not.0", "not", "after-motion"), ("not.1", "not", "before-motion")];
        assert!(!late(&after, "motion.digital-out-01", "not.0.in"));
        assert!(late(&after, "not.0.out", "motion.feed-hold"));
        assert!(late(&after, "not.0.out", "not.1.in"));
        assert!(!late(&after, "not.1.out", "not.0.in"));
        // A net without components is as it always was.
        assert!(!late(&after, "motion.digital-out-01", "motion.feed-hold"));
    }

    #[test]
    fn pins_of_other_processes_are_made_first_and_read_last() {
        let late = |place: &str, source: &str, target: &str| {
            let text = format!(
                "{DEMO}[[hal.component]]\nname = \"not.0\"\ntype = \"not\"\nplace = {place:?}\n[[hal.external]]\nname = \"panel\"\n\
                 pins = [{{ name = \"key\", direction = \"out\", type = \"bit\", safe = false }},\n\
                 {{ name = \"lamp\", direction = \"in\", type = \"bit\" }}]\n\
                 [[hal.net]]\nname = \"n\"\nsource = {source:?}\ntargets = [{target:?}]\n"
            );
            !late_reads(&parse(&text, Path::new("m.toml")).unwrap_or_else(|errors| panic!("{errors}"))).is_empty()
        };
        for place in ["before-motion", "after-motion"] {
            assert!(!late(place, "panel.key", "not.0.in") && !late(place, "not.0.out", "panel.lamp"));
        }
    }

    #[test]
    fn inputs_begin_with_the_values_of_the_file_and_outputs_with_their_defaults() {
        let text = format!(
            "{DEMO}[[hal.component]]\nname = \"a\"\ntype = \"scale\"\nset = {{ gain = 2, offset = 0.5 }}\n\
             [[hal.component]]\nname = \"b\"\ntype = \"estop-latch\"\nset = {{ ok-in = false }}\n"
        );
        let config = parse(&text, Path::new("m.toml")).unwrap_or_else(|errors| panic!("{errors}"));
        let name = format!("lists-{}", std::process::id());
        let mut hal = Hal::create_in(&[std::env::temp_dir()], &name, 64).unwrap();
        let mut lists = Lists::new(&mut hal, &config).map_err(|(_, error)| error).unwrap();
        let value = |pin: &str| hal.view().value(pin).unwrap();
        assert_eq!(value("a.gain"), AnyValue::Float(2.0));
        assert_eq!(
            (value("b.ok-in"), value("b.fault-out")),
            (AnyValue::Bit(false), AnyValue::Bit(true))
        );
        assert_eq!(count_pins(&config), 4 + 6);
        lists.run_before_motion(0);
        assert_eq!(value("a.out"), AnyValue::Float(0.5));
        assert_eq!(Lists::new(&mut hal, &config).err().map(|(number, _)| number), Some(0));
    }
}
