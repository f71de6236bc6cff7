//! Triggers: the moment around which a record is made.
//!
//! In:  an expression such as `joint.0.f-error>0.05`; values of its pin, cycle by cycle.
//! Out: whether the trigger fires in this cycle.
//!
//! | expression | condition |
//! |---|---|
//! | `PIN>1.5`, `PIN<1.5`, `PIN>=1.5`, `PIN<=1.5`, `PIN==1.5`, `PIN!=1.5` | compares |
//! | `PIN=1..2`, `PIN!=1..2` | inside the window, ends included; outside |
//! | `PIN`, `!PIN` | on (not 0); off |
//! | `alarm` | a fault has stopped the machine |
//!
//! A word before it says when it fires: `rising`, as without a word, as the condition becomes true; `falling`, as it becomes false;
//! `both`, either; `level`, while it is true. `changed PIN` fires as the value changes.

use std::fmt;

/// The pin behind `alarm`.
pub const ALARM: &str = "motion.fault";

/// Longest expression, octets.
const LEN_MAX: usize = 256;

/// A trigger.
#[derive(Clone, Debug, PartialEq)]
pub struct Trigger {
    /// The pin or net that is looked at.
    pub pin: String,
    condition: Condition,
    fires: Fires,
    text: String,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Condition {
    Above(f64),
    Below(f64),
    AtLeast(f64),
    AtMost(f64),
    Equal(f64),
    Unequal(f64),
    Inside(f64, f64),
    Outside(f64, f64),
    On,
    Off,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fires {
    Rising,
    Falling,
    Both,
    Level,
    Changed,
}

/// What is wrong with an expression, and where.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TriggerError {
    /// Column, from 1.
    pub column: usize,
    /// What was expected there.
    pub what: String,
}

impl fmt::Display for TriggerError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "trigger, column {}: {}", self.column, self.what)
    }
}

impl std::error::Error for TriggerError {}

impl fmt::Display for Trigger {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.text)
    }
}

impl Trigger {
    /// Reads an expression.
    ///
    /// # Errors
    /// Where it stops being one, and what was expected.
    pub fn parse(text: &str) -> Result<Trigger, TriggerError> {
        if text.len() > LEN_MAX {
            return Err(TriggerError {
                column: LEN_MAX + 1,
                what: format!("an expression has {LEN_MAX} octets at the most"),
            });
        }
        let mut rest = text.trim_start();
        // What is left is a part of the text, and lies in it.
        let error = |rest: &str, what: &str| {
            Err(TriggerError {
                column: text[..rest.as_ptr().addr() - text.as_ptr().addr()].chars().count() + 1,
                what: what.to_owned(),
            })
        };
        let mut fires = Fires::Rising;
        if let Some((word, behind)) = rest.split_once(char::is_whitespace) {
            let named = match word {
                "rising" => Some(Fires::Rising),
                "falling" => Some(Fires::Falling),
                "both" => Some(Fires::Both),
                "level" => Some(Fires::Level),
                "changed" => Some(Fires::Changed),
                _ => None,
            };
            if let Some(named) = named {
                (fires, rest) = (named, behind.trim_start());
            }
        }
        let is_off = rest.strip_prefix('!');
        rest = is_off.unwrap_or(rest).trim_start();
        let is_of_name = |letter: char| letter.is_ascii_alphanumeric() || matches!(letter, '.' | '-');
        let end = rest.find(|letter| !is_of_name(letter)).unwrap_or(rest.len());
        let (name, behind) = rest.split_at(end);
        let pin = if name == "alarm" { ALARM } else { name };
        if hal_pins::check_name(pin).is_err() {
            return error(rest, "expected the name of a pin, such as joint.0.f-error, or alarm");
        }
        rest = behind.trim();
        let trigger = |condition| {
            Ok(Trigger {
                pin: pin.to_owned(),
                condition,
                fires,
                text: text.trim().to_owned(),
            })
        };
        if rest.is_empty() {
            return trigger(if is_off.is_some() {
                Condition::Off
            } else {
                Condition::On
            });
        }
        if is_off.is_some() || fires == Fires::Changed {
            return error(rest, "expected the end: this is a trigger by itself");
        }
        let operators = [">=", "<=", "==", "!=", ">", "<", "="];
        let Some(operator) = operators.iter().find(|operator| rest.starts_with(**operator)) else {
            return error(
                rest,
                "expected one of > < >= <= == != and a value, or = and a window such as 1..2",
            );
        };
        rest = rest[operator.len()..].trim_start();
        if let Some((low, high)) = rest.split_once("..")
            && matches!(*operator, "=" | "!=" | "==")
        {
            let [low, high] = [low, high].map(number);
            return match (low, high) {
                (Some(low), Some(high)) if low <= high => trigger(match *operator {
                    "!=" => Condition::Outside(low, high),
                    _ => Condition::Inside(low, high),
                }),
                _ => error(rest, "expected a window such as 1..2, its lower end first"),
            };
        }
        let Some(value) = number(rest) else {
            return error(rest, "expected a number");
        };
        trigger(match *operator {
            ">" => Condition::Above(value),
            "<" => Condition::Below(value),
            ">=" => Condition::AtLeast(value),
            "<=" => Condition::AtMost(value),
            "!=" => Condition::Unequal(value),
            _ => Condition::Equal(value),
        })
    }

    /// The value that a line in a picture stands for, if there is one.
    pub fn levels(&self) -> Vec<f64> {
        match self.condition {
            Condition::Above(value)
            | Condition::Below(value)
            | Condition::AtLeast(value)
            | Condition::AtMost(value)
            | Condition::Equal(value)
            | Condition::Unequal(value) => vec![value],
            Condition::Inside(low, high) | Condition::Outside(low, high) => vec![low, high],
            Condition::On | Condition::Off => Vec::new(),
        }
    }

    /// Whether the condition holds for a value; not for one that is no number.
    fn holds(&self, value: f64) -> bool {
        match self.condition {
            Condition::Above(level) => value > level,
            Condition::Below(level) => value < level,
            Condition::AtLeast(level) => value >= level,
            Condition::AtMost(level) => value <= level,
            Condition::Equal(level) => value == level,
            Condition::Unequal(level) => !value.is_nan() && value != level,
            Condition::Inside(low, high) => (low..=high).contains(&value),
            Condition::Outside(low, high) => value < low || value > high,
            Condition::On => !value.is_nan() && value != 0.0,
            Condition::Off => value == 0.0,
        }
    }
}

/// A finite number, or `true` or `false`.
fn number(text: &str) -> Option<f64> {
    match text.trim() {
        "true" => Some(1.0),
        "false" => Some(0.0),
        text => text.parse().ok().filter(|value: &f64| value.is_finite()),
    }
}

/// A trigger at work.
#[derive(Clone, Debug)]
pub struct Watch {
    trigger: Trigger,
    before: Option<f64>,
}

impl Watch {
    pub fn new(trigger: Trigger) -> Watch {
        Watch { trigger, before: None }
    }

    /// Whether it fires at the next value. The first one makes no edge.
    pub fn fires(&mut self, value: f64) -> bool {
        let before = self.before.replace(value);
        let now = self.trigger.holds(value);
        let Some(before) = before else {
            return now && self.trigger.fires == Fires::Level;
        };
        let held = self.trigger.holds(before);
        match self.trigger.fires {
            Fires::Rising => now && !held,
            Fires::Falling => held && !now,
            Fires::Both => held != now,
            Fires::Level => now,
            Fires::Changed => value != before && !(value.is_nan() && before.is_nan()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Cycles in which it fires.
    fn fired(text: &str, values: &[f64]) -> Vec<usize> {
        let mut watch = Watch::new(Trigger::parse(text).unwrap_or_else(|error| panic!("{text}: {error}")));
        (0..values.len()).filter(|at| watch.fires(values[*at])).collect()
    }

    #[test]
    fn expressions_by_hand() {
        let ramp = [0.0, 1.0, 2.0, 3.0, 2.0, 1.0, 0.0, f64::NAN, 2.0];
        for (text, at) in [
            ("a.b>1", vec![2, 8]),
            (" rising  a.b > 1 ", vec![2, 8]),
            ("falling a.b>1", vec![5]),
            ("both a.b>1", vec![2, 5, 8]),
            ("level a.b>=2", vec![2, 3, 4, 8]),
            ("a.b<1", vec![6]),
            ("level a.b<1", vec![0, 6]),
            ("a.b<=1", vec![5]),
            ("a.b==3", vec![3]),
            ("a.b=3", vec![3]),
            ("a.b!=3", vec![4, 8]),
            ("a.b=1..2", vec![1, 4, 8]),
            ("a.b!=1..2", vec![3, 6]),
            ("a.b != -1e3 .. 1.5", vec![2, 8]),
            ("a.b", vec![1, 8]),
            ("!a.b", vec![6]),
            ("falling a.b", vec![6]),
            ("changed a.b", vec![1, 2, 3, 4, 5, 6, 7, 8]),
            ("a.b==true", vec![1, 5]),
            ("alarm", vec![1, 8]),
        ] {
            assert_eq!(fired(text, &ramp), at, "{text}");
        }
        assert_eq!(Trigger::parse("alarm").unwrap().pin, ALARM);
        assert_eq!(
            Trigger::parse("rising rising").unwrap().pin,
            "rising",
            "a name like any other"
        );
        assert_eq!(Trigger::parse("a!=1..2").unwrap().levels(), [1.0, 2.0]);
    }

    #[test]
    fn errors_have_their_place() {
        for (text, column, what) in [
            ("", 1, "the name of a pin"),
            ("  >3", 3, "the name of a pin"),
            ("Joint.0>3", 1, "the name of a pin"),
            ("joint.0 3", 9, "one of >"),
            ("joint.0>", 9, "a number"),
            ("joint.0>3x", 9, "a number"),
            ("joint.0>nan", 9, "a number"),
            ("joint.0=2..1", 9, "a window"),
            ("joint.0>1..2", 9, "a number"),
            ("!joint.0>3", 9, "the end"),
            ("changed joint.0>3", 16, "the end"),
            ("level ", 7, "the name of a pin"),
            ("ä>3", 1, "the name of a pin"),
            ("a𝔞 ", 2, "one of >"),
        ] {
            let error = Trigger::parse(text).unwrap_err();
            assert!(error.column == column && error.what.contains(what), "{text}: {error}");
        }
        assert!(Trigger::parse(&"a".repeat(300)).is_err());
    }

    /// What an expression means, written down once more in another way.
    fn model(word: &str, operator: &str, level: f64, values: &[f64]) -> Vec<usize> {
        let holds: Vec<bool> = (values.iter())
            .map(|value| match (operator, value.partial_cmp(&level)) {
                (_, None) => false,
                (">", Some(order)) => order.is_gt(),
                ("<", Some(order)) => order.is_lt(),
                (">=", Some(order)) => order.is_ge(),
                ("<=", Some(order)) => order.is_le(),
                ("!=", Some(order)) => order.is_ne(),
                (_, Some(order)) => order.is_eq(),
            })
            .collect();
        let fires = |at: &usize| match (word, *at) {
            ("level", at) => holds[at],
            (_, 0) => false,
            ("rising", at) => holds[at - 1..=at] == [false, true],
            ("falling", at) => holds[at - 1..=at] == [true, false],
            (_, at) => holds[at - 1] != holds[at],
        };
        (0..values.len()).filter(fires).collect()
    }

    proptest! {
        #[test]
        fn triggers_fire_as_the_model_says(
            word in prop_oneof![Just("rising"), Just("falling"), Just("both"), Just("level")],
            operator in prop_oneof![Just(">"), Just("<"), Just(">="), Just("<="), Just("=="), Just("!=")],
            level in -3i32..4,
            values in prop::collection::vec(prop_oneof![8 => (-4i32..5).prop_map(f64::from), 1 => Just(f64::NAN)], 0..60),
        ) {
            let level = f64::from(level);
            let text = format!("{word} some.pin{operator}{level}");
            prop_assert_eq!(fired(&text, &values), model(word, operator, level, &values), "{}", text);
        }

        #[test]
        fn any_text_is_read_or_refused(text in any::<String>()) {
            if let Err(error) = Trigger::parse(&text) {
                prop_assert!(error.column >= 1 && error.column <= text.chars().count() + 1);
            }
        }
    }
}
