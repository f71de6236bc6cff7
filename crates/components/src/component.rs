//! What a component is: a struct whose fields are its pins, and a function that is called once a cycle.
//!
//! In:  options of the machine file, values of inputs.
//! Out: declared pins, values of outputs.

use hal_pins::{AnyValue, Type};

/// Which way a pin goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Read before each update; what LinuxCNC calls a parameter, too.
    In,
    /// Written after each update.
    Out,
}

impl Direction {
    /// `in` or `out`.
    pub const fn name(self) -> &'static str {
        match self {
            Direction::In => "in",
            Direction::Out => "out",
        }
    }
}

/// The field behind a pin.
#[derive(Debug)]
pub enum Slot<'a> {
    /// [`Type::Bit`]
    Bit(&'a mut bool),
    /// [`Type::S32`]
    S32(&'a mut i32),
    /// [`Type::U32`]
    U32(&'a mut u32),
    /// [`Type::Float`]
    Float(&'a mut f64),
    /// [`Type::Float`], of an input that counts only where a net reaches it, else `None`.
    OnNet(&'a mut Option<f64>),
}

impl Slot<'_> {
    /// Its value now.
    pub fn value(&self) -> AnyValue {
        match self {
            Slot::Bit(value) => AnyValue::Bit(**value),
            Slot::S32(value) => AnyValue::S32(**value),
            Slot::U32(value) => AnyValue::U32(**value),
            Slot::Float(value) => AnyValue::Float(**value),
            Slot::OnNet(value) => AnyValue::Float(value.unwrap_or(0.0)),
        }
    }

    /// Its type.
    pub fn value_type(&self) -> Type {
        self.value().kind()
    }
}

/// A pin while it is visited.
#[derive(Debug)]
pub struct Pin<'a> {
    /// Name behind that of the instance, as it is declared: `_` for `-`, a trailing `_` for nothing, one or more `#` for
    /// the digits of `index`.
    pub pattern: &'static str,
    /// Number of one of several pins.
    pub index: usize,
    /// What it means, with its unit.
    pub doc: &'static str,
    /// Its value.
    pub slot: Slot<'a>,
}

impl Pin<'_> {
    /// Name behind that of the instance: `in-03`.
    pub fn name(&self) -> String {
        let pattern = self.pattern.trim_end_matches('_').replace('_', "-");
        let digits = pattern.matches('#').count();
        match pattern.find('#') {
            Some(at) => format!("{}{:0digits$}{}", &pattern[..at], self.index, &pattern[at + digits..]),
            None => pattern,
        }
    }
}

/// A declared pin, for lists of them.
#[derive(Clone, Debug, PartialEq)]
pub struct PinSpec {
    /// Name behind that of the instance.
    pub name: String,
    /// Which way it goes.
    pub direction: Direction,
    /// Value before anybody writes it; tells the type.
    pub default: AnyValue,
    /// What it means, with its unit.
    pub doc: &'static str,
}

/// The pins of a component: [`component!`](crate::component!) writes this.
pub trait Pins {
    /// Visits all inputs, or all outputs, always in the same order. RT: no allocation, no lock.
    fn visit(&mut self, direction: Direction, visitor: &mut dyn FnMut(Pin<'_>));
}

/// A component.
pub trait Component: Pins + Send {
    /// Makes as many pins as the options ask for; once, before anything else.
    fn shape(&mut self, _options: &Options<'_>) {}

    /// One call: outputs from inputs and state. `period_s`: time since the call before, above 0.
    /// RT: no allocation, no lock, no panic, bounded.
    fn update(&mut self, period_s: f64);

    /// All pins, inputs first.
    fn pins(&mut self) -> Vec<PinSpec> {
        let mut pins = Vec::new();
        for direction in [Direction::In, Direction::Out] {
            self.visit(direction, &mut |pin| {
                pins.push(PinSpec {
                    name: pin.name(),
                    direction,
                    default: pin.slot.value(),
                    doc: pin.doc,
                });
            });
        }
        pins
    }
}

/// An option that is given when an instance is made: it decides which pins there are.
#[derive(Debug)]
pub struct OptionSpec {
    /// Its key.
    pub name: &'static str,
    /// What it means.
    pub doc: &'static str,
    /// Value where none is given.
    pub default: i64,
    /// Least and greatest value.
    pub range: [i64; 2],
    /// Words that stand for values, the first one for 0.
    pub words: &'static [&'static str],
}

/// Options of an instance, checked.
#[derive(Debug)]
pub struct Options<'a> {
    specs: &'static [OptionSpec],
    given: &'a [(String, i64)],
}

impl Options<'_> {
    /// The value of an option; 0 where the kind has none of that name.
    pub fn get(&self, name: &str) -> i64 {
        let given = self.given.iter().find(|(key, _)| key == name);
        let default = || self.specs.iter().find(|spec| spec.name == name);
        match given {
            Some((_, value)) => *value,
            None => default().map_or(0, |spec| spec.default),
        }
    }

    /// The same as a number of things.
    pub fn count(&self, name: &str) -> usize {
        usize::try_from(self.get(name)).unwrap_or(0)
    }
}

/// An option that cannot be.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum OptionError {
    /// The kind has no such option.
    #[error("is no option of {kind}: {}", listed(.known))]
    Unknown {
        /// The option.
        name: String,
        /// Kind of the component.
        kind: &'static str,
        /// Options that it has.
        known: Vec<&'static str>,
    },
    /// Outside its range.
    #[error("must be {min} to {max}")]
    Range {
        /// The option.
        name: String,
        /// Least value.
        min: i64,
        /// Greatest value.
        max: i64,
    },
}

impl OptionError {
    /// The option that is meant.
    pub fn option(&self) -> &str {
        match self {
            OptionError::Unknown { name, .. } | OptionError::Range { name, .. } => name,
        }
    }
}

fn listed(known: &[&'static str]) -> String {
    match known.is_empty() {
        true => "it has none".to_owned(),
        false => format!("it has {}", known.join(", ")),
    }
}

/// A kind of component.
#[derive(Debug)]
pub struct Kind {
    /// Name as in LinuxCNC's `loadrt`.
    pub name: &'static str,
    /// What it does, in a sentence or two.
    pub doc: &'static str,
    /// Options of its instances.
    pub options: &'static [OptionSpec],
    /// Makes one without options.
    pub new: fn() -> Box<dyn Component>,
}

impl Kind {
    /// Makes one with these options.
    ///
    /// # Errors
    /// The first option that is unknown or outside its range.
    pub fn make(&self, given: &[(String, i64)]) -> Result<Box<dyn Component>, OptionError> {
        for (name, value) in given {
            let Some(spec) = self.options.iter().find(|spec| spec.name == name) else {
                return Err(OptionError::Unknown {
                    name: name.clone(),
                    kind: self.name,
                    known: self.options.iter().map(|spec| spec.name).collect(),
                });
            };
            let [min, max] = spec.range;
            if !(min..=max).contains(value) {
                return Err(OptionError::Range {
                    name: name.clone(),
                    min,
                    max,
                });
            }
        }
        let mut made = (self.new)();
        made.shape(&Options {
            specs: self.options,
            given,
        });
        Ok(made)
    }
}

/// A field that is a pin, or several: `bool`, `i32`, `u32`, `f64`, and arrays and vectors of them; `Option<f64>`: [`Slot::OnNet`].
pub trait Field {
    /// Visits it. RT.
    fn visit(&mut self, pattern: &'static str, doc: &'static str, visitor: &mut dyn FnMut(Pin<'_>));
}

macro_rules! field {
    ($rust:ty, $slot:ident) => {
        impl Field for $rust {
            fn visit(&mut self, pattern: &'static str, doc: &'static str, visitor: &mut dyn FnMut(Pin<'_>)) {
                let slot = Slot::$slot(self);
                visitor(Pin {
                    pattern,
                    index: 0,
                    doc,
                    slot,
                });
            }
        }
        impl<const N: usize> Field for [$rust; N] {
            fn visit(&mut self, pattern: &'static str, doc: &'static str, visitor: &mut dyn FnMut(Pin<'_>)) {
                self.as_mut_slice().visit(pattern, doc, visitor);
            }
        }
        impl Field for Vec<$rust> {
            fn visit(&mut self, pattern: &'static str, doc: &'static str, visitor: &mut dyn FnMut(Pin<'_>)) {
                self.as_mut_slice().visit(pattern, doc, visitor);
            }
        }
        impl Field for [$rust] {
            fn visit(&mut self, pattern: &'static str, doc: &'static str, visitor: &mut dyn FnMut(Pin<'_>)) {
                for (index, value) in self.iter_mut().enumerate() {
                    let slot = Slot::$slot(value);
                    visitor(Pin {
                        pattern,
                        index,
                        doc,
                        slot,
                    });
                }
            }
        }
    };
}

field!(bool, Bit);
field!(i32, S32);
field!(u32, U32);
field!(f64, Float);

impl Field for Option<f64> {
    fn visit(&mut self, pattern: &'static str, doc: &'static str, visitor: &mut dyn FnMut(Pin<'_>)) {
        let slot = Slot::OnNet(self);
        visitor(Pin {
            pattern,
            index: 0,
            doc,
            slot,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_follow_the_patterns_of_linuxcnc_s_components() {
        let name = |pattern, index| {
            let slot = Slot::Bit(&mut false);
            let pin = Pin {
                pattern,
                index,
                doc: "",
                slot,
            };
            pin.name()
        };
        assert_eq!(name("in_", 0), "in");
        assert_eq!(name("on_delay", 0), "on-delay");
        assert_eq!(name("in_##", 3), "in-03");
        assert_eq!(name("sense_#", 12), "sense-12");
        assert_eq!(name("joint.##.pos_cmd", 1), "joint.01.pos-cmd");
    }
}
