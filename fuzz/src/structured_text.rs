//! Any text as a program in Structured Text: refused with places, or run within the steps that were counted.

use logic::{Runtime, Value};
use std::sync::Arc;

/// One run of the fuzzer; a second part of the input behind a zero octet are values of the inputs.
pub fn run(octets: &[u8]) {
    let end = octets.iter().position(|octet| *octet == 0).unwrap_or(octets.len());
    let (text, values) = octets.split_at(end);
    let text = String::from_utf8_lossy(text);
    let logic = match logic::compile(&text) {
        Ok(logic) => Arc::new(logic),
        Err(told) => {
            assert!(told.iter().any(|one| one.severity == logic::Severity::Error));
            assert!(told.is_sorted_by_key(|one| (one.line, one.column)));
            for one in told.iter().take(20) {
                assert!(!one.render("machine.st").is_empty());
            }
            return;
        }
    };
    // A bound says how long a scan may be; a fuzzer has no time for long ones.
    if logic.steps_max() > 1_000_000 {
        return;
    }
    let mut runtime = Runtime::new(Arc::clone(&logic));
    let mut values = values.iter().copied().cycle();
    for scan in 0..8 {
        for input in logic.inputs() {
            let value = values.next().unwrap_or(scan as u8);
            // One of them is of its type, or none is.
            let _ = runtime.set(input, Value::Bool(value & 1 == 1))
                || runtime.set(input, Value::Integer(i128::from(value as i8)))
                || runtime.set(input, Value::Time(i64::from(value) * 1_000_000))
                || runtime.set(input, Value::Lreal(f64::from(value as i8)));
        }
        let steps = runtime.scan(scan * 10_000_000);
        assert!(steps <= logic.steps_max());
        assert!(runtime.fault().is_none_or(|fault| fault.wrong != logic::Wrong::Steps));
    }
    for variable in logic.all_variables() {
        let name = logic.name(variable);
        assert_eq!(
            logic.variable(&name).map(|found| &found.line),
            Some(&variable.line),
            "{name}"
        );
        match runtime.get(variable) {
            Value::Real(value) => assert!(value.is_finite(), "{name}"),
            Value::Lreal(value) => assert!(value.is_finite(), "{name}"),
            value => drop(value.to_string()),
        }
    }
    // Compiled again it goes on where it was.
    let mut again = Runtime::new(logic);
    again.take_over(&runtime, false);
}
