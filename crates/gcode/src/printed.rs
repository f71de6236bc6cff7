//! What a program prints, for unit tests.

use crate::{CanonPrinter, Interpreter, Machine, NoMachine, Settings};
use motion::canon::LengthUnit;

/// The calls of a program without those that every program begins and ends with, one a line without count and N column;
/// an error as the last line.
pub(crate) fn printed(program: &str) -> String {
    printed_with(program, Settings::default(), NoMachine)
}

/// The same of a machine.
pub(crate) fn printed_with(program: &str, settings: Settings, machine: impl Machine + Send + 'static) -> String {
    let mut printer = CanonPrinter::new(LengthUnit::Millimetre);
    let mut shown = String::new();
    for event in Interpreter::new(settings).with_machine(machine).run(program.as_bytes()) {
        let event = match event {
            Ok(event) => event,
            Err(error) => {
                shown += &format!("{error}\n");
                break;
            }
        };
        let mut lines = Vec::new();
        printer.write(&event, &mut lines).expect("memory");
        let is_move = event.source.line > 0;
        for line in String::from_utf8_lossy(&lines).lines().filter(|_| is_move) {
            let call = line.get(13..).unwrap_or(line);
            if call.starts_with("SET_G5X_OFFSET(1, 0.0000") {
                return shown; // M2 begins so
            }
            shown += call;
            shown += "\n";
        }
    }
    shown
}
