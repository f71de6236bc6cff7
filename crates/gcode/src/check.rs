//! All errors of a program at once.
//!
//! In:  program text and [`Settings`].
//! Out: what is wrong with the form of any line ([`syntax`]), and the first thing that goes wrong when it is run.

use crate::error::{Error, ErrorKind};
use crate::interpreter::{Interpreter, ReadSeek};
use crate::limits::CheckLimits;
use crate::machine::{Machine, NoMachine};
use crate::{Settings, syntax};
use std::io;

/// All errors of a program in memory, in the order of its lines.
pub fn check(text: &[u8], settings: Settings) -> Vec<Error> {
    let again = || Ok(io::Cursor::new(text));
    match check_reader(io::Cursor::new(text), again, settings, CheckLimits::default()) {
        Ok(errors) => errors,
        Err(error) => unreachable!("memory can be read: {error}"),
    }
}

/// All errors of a program of any length, in the order of its lines.
///
/// `again` opens the text a second time. The lines are run, too, as far as the limits allow: what depends on the state
/// (a feed that is missing, a radius that does not fit) is found at the first line that fails. A line whose form is
/// wrong is told once. What is never run (behind M2, in subroutines without a call) is not judged.
///
/// # Errors
/// The text cannot be read.
pub fn check_reader<R: ReadSeek>(
    text: R,
    again: impl FnOnce() -> io::Result<R>,
    settings: Settings,
    limits: CheckLimits,
) -> io::Result<Vec<Error>> {
    check_on(text, again, settings, NoMachine, limits)
}

/// The same with a machine that answers while the program is run: which lines follow a probing move may depend on it.
///
/// # Errors
/// The text cannot be read.
pub fn check_on<R: ReadSeek>(
    text: R,
    again: impl FnOnce() -> io::Result<R>,
    settings: Settings,
    machine: impl Machine + Send + 'static,
    limits: CheckLimits,
) -> io::Result<Vec<Error>> {
    check_run(text, again, Interpreter::new(settings).with_machine(machine), limits)
}

fn check_run<R: ReadSeek>(
    text: R,
    again: impl FnOnce() -> io::Result<R>,
    interpreter: Interpreter,
    limits: CheckLimits,
) -> io::Result<Vec<Error>> {
    let mut errors = syntax::errors(text, interpreter.settings(), limits.errors, &limits.cancel)?;
    let run = interpreter.run_reader(again()?).within(limits);
    for error in run.filter_map(Result::err) {
        // That of the run tells who called the subroutine.
        let same = |known: &Error| {
            (&known.file, known.line, known.column) == (&error.file, error.line, error.column)
                && known.kind == error.kind
        };
        match errors.iter_mut().find(|known| same(known)) {
            Some(known) => *known = *error,
            None => errors.push(*error),
        }
    }
    errors.sort_by_key(|error| error.line);
    let is_of_another = |error: &Error| matches!(error.kind, ErrorKind::OtherLanguage(_)) && error.file.is_empty();
    if let Some(first) = errors.iter().position(is_of_another) {
        errors.truncate(first + 1);
    }
    Ok(errors)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Remap;

    fn told_with(text: &[u8], settings: Settings) -> Vec<String> {
        let errors = check(text, settings);
        errors.iter().map(|error| error.to_string()).collect()
    }

    /// Lines with errors.
    fn lines(text: &str) -> Vec<u32> {
        let errors = check(text.as_bytes(), Settings::default());
        errors.iter().map(|error| error.line).collect()
    }

    #[test]
    fn what_is_never_run_is_not_judged() {
        for (name, text) in [
            ("notes behind M2", "G0 X1\nM2\nsome notes, in words: 5 %\no1 while\n"),
            ("a lone % at the end", "G0 X1\nM30\n%\n"),
            (
                "a subroutine that nobody calls",
                "o1 sub\nG0 Q5\no1 endsub\nG0 X1\nM2\n",
            ),
            ("one behind M2", "G0 X1\nM2\no1 sub\nG0 Q5\no1 if [1]\no1 endsub\n"),
            (
                "one that only such a one calls",
                "M2\no1 sub\no2 call\no1 endsub\no2 sub\nG99999\no2 endsub\n",
            ),
            ("another program behind M2", "G0 X1\nM2\nG0 Q5\nM2\nO7\nG0 Q5\nM99\n"),
            ("a subroutine behind M2 without its end", "M2\no1 sub\nG0 X1\n"),
        ] {
            assert_eq!(lines(text), [0; 0], "{name}");
        }
    }

    #[test]
    fn what_can_be_run_is_judged() {
        for (name, text, wrong) in [
            ("before M2", "G0 Q5\nM2\n", &[1][..]),
            (
                "M2 in a block",
                "o1 if [#1 EQ 5]\nM2\no1 endif\nG99999\nM2\nG99999\n",
                &[4],
            ),
            ("M2 that may be left out", "G0 X1\n/M2\nG99999\nM2\n", &[3]),
            (
                "a subroutine behind M2",
                "o1 call\nM2\nG99999\no1 sub\no2 call\no1 endsub\no2 sub\nG99999\no2 endsub\n",
                &[8],
            ),
            (
                "a call that is never made",
                "o3 if [0]\no1 call\no3 endif\nM2\no1 sub\nG99999\no1 endsub\n",
                &[6],
            ),
            (
                "a computed label",
                "#100 = 1\no3 if [0]\no#100 call\no3 endif\nM2\no1 sub\nG99999\no1 endsub\n",
                &[7],
            ),
            ("M98", "M98 P7\nM2\nO7\nG99999\nM99\nG99999\n", &[4]),
            ("a profile", "G18 F1 G71 Q1\nM2\no1 sub\nG99999\no1 endsub\n", &[4]),
            ("a subroutine without its end", "o1 sub\nG0 X1\nM2\n", &[1]),
            ("no M2, and a lone %", "G0 X1\n%\n", &[2]),
        ] {
            assert_eq!(lines(text), wrong, "{name}");
        }
    }

    #[test]
    fn codes_that_call_subroutines_are_known() {
        let remap = Remap {
            code: "G88.1".into(),
            subroutine: "drill".into(),
            arguments: "X".into(),
            modal_group: 1,
        };
        let settings = Settings {
            remaps: vec![remap],
            ..Settings::default()
        };
        let text = b"o1 if [0]\nG88.1 X5\no1 endif\nM2\no<drill> sub\nG99999\no<drill> endsub\n";
        assert_eq!(
            told_with(text, settings.clone()).len(),
            1,
            "{:?}",
            told_with(text, settings)
        );
    }

    #[test]
    fn a_file_that_is_no_program_is_told_by_what_it_is() {
        let told = told_with(b"\x7fELF\x02\x01\0\0\0\0\nG0 X1\n\0\0\0\nM2\n", Settings::default());
        assert_eq!(
            told,
            ["1:1: this is no text: it has octets of 0, which no program has; is it a binary file?"]
        );
        let folder = std::fs::File::open(".").unwrap();
        let mut run = Interpreter::new(Settings::default()).run_reader(folder);
        let error = run.find_map(Result::err).unwrap();
        assert_eq!(error.kind.to_string(), "the file cannot be read: it is a folder");
        assert!(run.next().is_none());
    }

    #[test]
    fn a_mark_of_the_encoding_is_passed_over() {
        assert_eq!(told_with(b"\xEF\xBB\xBFG0 X1\nM2\n", Settings::default()), [""; 0]);
        let told = told_with(b"\xEF\xBB\xBFG0 Q1\n\xEF\xBB\xBFM2\n", Settings::default());
        assert!(told[0].starts_with("1:4: Q is used by no code"), "{told:?}");
        assert!(told[1].starts_with("2:1: character"), "{told:?}");
        let text = b"\xEF\xBB\xBFo1 repeat [2]\nG91 G0 X1\no1 endrepeat\nM2\n";
        assert_eq!(told_with(text, Settings::default()), [""; 0]);
    }

    #[test]
    fn messages_say_what_to_write() {
        for (text, message) in [
            (
                "G0 X1,5\nM2\n",
                "1:6: character ',' is not allowed here: a number has a decimal point, as in 1.5",
            ),
            ("F0\nG1 X1\nM2\n", "2:1: G1 needs a feed: F is 0 since line 1"),
            ("F5\nG1 X1 F0\nM2\n", "2:1: G1 needs a feed: F is 0 since line 2"),
            ("F0\nG95 S5\nG1 X1\nM2\n", "3:1: G1 needs a feed: F is not set"),
            ("G41.2 X1\nM2\n", "1:1: G41.2 is no known G code: did you mean G41.1?"),
            (
                "G0 X1.5e-05 Y2\nM2\n",
                "1:5: 1.5e-05 is no number here, as there is no exponent: write 0.000015",
            ),
            (
                "G0 X-2E1\nM2\n",
                "1:5: -2E1 is no number here, as there is no exponent: write -20",
            ),
            (
                "G0 X1e2 Y3e1\nM2\n",
                "1:10: 3e1 is no number here, as there is no exponent: write 30",
            ),
            (
                "#1 = 1e-3\nM2\n",
                "1:6: 1e-3 is no number here, as there is no exponent: write 0.001",
            ),
            (
                "G0 X[1.5E-05 * 2]\nM2\n",
                "1:6: 1.5E-05 is no number here, as there is no exponent: write 0.000015",
            ),
            (
                "G0\u{a0}X1\nM2\n",
                "1:3: character '\\u{a0}' is not allowed here: it looks like a blank, as texts from a page have it: write a blank",
            ),
            (
                "# right: M2 selects G54, in #5220 too\nM2\n",
                "1:1: these are no words of G-code, each of which is a letter and a number: a comment stands in ( ) or behind ;",
            ),
            (
                "G4 P100000000\nM2\n",
                "1:4: P is seconds, and would wait for 1157 days: no more than a year is allowed",
            ),
            (
                "F1 G82 X1 Z-1 R1 P31536001\nM2\n",
                "1:18: P is seconds, and would wait for 365 days: no more than a year is allowed",
            ),
            (
                "o<x> [1]\nM2\n",
                "1:1: O<x> needs a word between its name and the values: O<x> call [...]",
            ),
            (
                "%\nM98 P23\nM30\n%\nO23\nG0 X1\nM99\n",
                "2:5: O23 stands in line 5, behind the % of line 4, which ends the program: move it before that %, or leave the % out",
            ),
            (
                "%\no<a> call\nM30\n%\no<a> sub\no<a> endsub\n",
                "2:1: O<a> stands in line 5, behind the % of line 4, which ends the program: move it before that %, or leave the % out",
            ),
            (
                "%\nM98 P23\nM30\n%\n",
                "2:5: subroutine O23 is not found: it is neither in this file nor as 23.ngc in any folder (none is set)",
            ),
            (
                "T0101 M6\nM2\n",
                "1:1: tool 101 is not in the tool table: add it there, or call one that is; if T0101 is tool 1 with offset 1, as on \
                 other lathes, write T1 M6 and G43 H1",
            ),
            (
                "T201 M6\nM2\n",
                "1:1: tool 201 is not in the tool table: add it there, or call one that is",
            ),
            (
                "G17 F9 G2 X2 I1 K0.5\nM2\n",
                "1:17: K is no centre offset of the plane G17: it takes I, J",
            ),
            (
                "G20 G0 X1\nG3 X0 Y1.5 I-1 F5\nM2\n",
                "2:12: radius at start 1.0000, at end 1.5000: difference 0.5000 > 0.0028 tolerance (centre 0.0000 0.0000, \
                 end 0.0000 1.5000, in the units of the program); is the unit right (G20, G21), and are the centre's words \
                 offsets from the start (G91.1) or a place (G90.1)?",
            ),
        ] {
            let mut settings = Settings::default();
            let tool = crate::Tool {
                number: 1,
                pocket: 1,
                ..crate::Tool::default()
            };
            settings.tools.set(tool).unwrap();
            assert_eq!(told_with(text.as_bytes(), settings)[0], message);
        }
    }

    #[test]
    fn what_a_serial_line_puts_between_the_words_is_passed_over() {
        let leader = [0; 700];
        let text = b"\0\0%\r\n\x11G\x000 X1\x13\x12.5 Y\x142\0\r\n\0\0M2\n%\n\0\0\0";
        for text in [text.to_vec(), [&leader, &text[..], &leader].concat()] {
            assert_eq!(told_with(&text, Settings::default()), [""; 0]);
            let run = Interpreter::new(Settings::default()).run(&text);
            let moves: Vec<_> = run
                .filter_map(|event| match event.unwrap().call {
                    motion::canon::Call::StraightTraverse { to } => Some(to),
                    _ => None,
                })
                .collect();
            assert_eq!(moves, [motion::canon::Position::xyz(1.5, 2.0, 0.0)]);
        }
        // A mistake beside them is that mistake, and what is no text at all is no text.
        let told = told_with(b"\0G0 Q1\nM2\n", Settings::default());
        assert!(told[0].starts_with("1:4: Q is used by no code"), "{told:?}");
        let told = told_with(b"\x7fELF\x02\x01\0\0>\n\0\xff\n", Settings::default());
        assert!(told.len() == 1 && told[0].contains("this is no text"), "{told:?}");
    }

    #[test]
    fn a_centre_of_0_along_the_normal_says_nothing() {
        for line in [
            "G17 F9 G2 X2 I1 K0.000",
            "G18 F9 G2 X2 I1 J0",
            "G19 F9 G2 Y2 J1 I0",
            "G90.1 F9 G2 X2 I1 J0 K0",
        ] {
            assert_eq!(
                told_with(format!("{line}\nM2\n").as_bytes(), Settings::default()),
                [""; 0],
                "{line}"
            );
        }
    }
}
