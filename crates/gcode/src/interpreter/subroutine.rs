//! Subroutines: where they are, their call and their return.

use super::{File, Outcome, ReadSeek, Run};
use crate::error::{ErrorKind, OWordError};
use crate::flow::{CALLS_MAX, Level, LevelKind, Place, SUBROUTINES_MAX, Search, SearchEnd, Subroutine};
use crate::o_word::{Keyword, Label, OWord};
use crate::parameter::ARGUMENTS_MAX;
use crate::scan::Span;
use std::io::{BufReader, Cursor};

impl Run<'_> {
    /// A definition in the way of reading: kept, and passed over.
    pub(super) fn define(&mut self, o_word: &OWord) -> Outcome {
        let level = self.levels.last().expect("the program's own level is never left");
        if let Some(outer) = &level.label {
            return Err(o_word.span.fault(OWordError::NestedSubroutine {
                label: o_word.label.to_string(),
                outer: outer.to_string(),
            }));
        }
        let here = self.place();
        let is_program = o_word.keyword == Keyword::Program;
        if is_program && !self.state.settings.fanuc_subprograms {
            let word = o_word.label.to_string();
            return Err((o_word.span, OWordError::FanucSubprogram { word }.into()));
        }
        let found = Subroutine {
            start: here,
            is_program,
        };
        if self.subroutines.len() >= SUBROUTINES_MAX {
            let max = SUBROUTINES_MAX;
            return Err((o_word.span, OWordError::TooManySubroutines { max }.into()));
        }
        let known = self.subroutines.insert(o_word.label.clone(), found);
        if o_word.keyword == Keyword::Sub {
            if let Some(first) = known.map(|first| first.start).filter(|first| *first != here) {
                return Err(o_word.span.fault(OWordError::DefinedTwice {
                    label: o_word.label.to_string(),
                    file: self.files[first.file].name.clone(),
                    line: first.line,
                }));
            }
            self.start_search(o_word, SearchEnd::EndSub);
        }
        Ok(())
    }

    pub(super) fn call(&mut self, o_word: &OWord) -> Outcome {
        self.enter(o_word.label.clone(), LevelKind::Call, o_word.span)?;
        self.state.parameters.set_arguments(o_word.arguments);
        Ok(())
    }

    /// Begins a subroutine: where it is known, goes there, else looks for it further down or in a file of its own.
    pub(super) fn enter(&mut self, label: Label, kind: LevelKind, span: Span) -> Outcome {
        if self.levels.len() > CALLS_MAX {
            return Err(span.fault(OWordError::CallsTooDeep {
                label: label.to_string(),
                depth: self.levels.len(),
                depth_max: CALLS_MAX,
            }));
        }
        let back = self.place();
        let arguments = self.state.parameters.arguments();
        let known = self.subroutines.get(&label).copied();
        let by_m98 = matches!(kind, LevelKind::Subprogram { .. });
        if known.is_some_and(|known| known.is_program != by_m98) {
            let label = label.to_string();
            return Err((span, OWordError::WrongCall { label, by_m98 }.into()));
        }
        if known.is_none() {
            self.open_file(&label, span)?;
        }
        self.levels
            .push(Level::new(Some(label.clone()), kind, Some(back), arguments));
        self.state.enter_call();
        match known {
            Some(known) => self.go_to(known.start),
            None => {
                self.search = Some(Search {
                    label,
                    target: SearchEnd::Sub,
                    keyword: Keyword::Call,
                    source: self.source(),
                    span,
                });
            }
        }
        Ok(())
    }

    /// Name of the file in which a subroutine would stand, and the folders in which it would.
    pub(super) fn file_of(&self, label: &Label) -> (String, String) {
        let file = match label {
            Label::Number(number) => format!("{number}.ngc"),
            Label::Name(name) => format!("{name}.ngc"),
        };
        let folders = &self.state.settings.subroutine_folders;
        let shown: Vec<String> = folders
            .iter()
            .map(|folder| match folder.as_os_str().is_empty() {
                true => ".".into(),
                false => folder.display().to_string(),
            })
            .collect();
        let shown = if shown.is_empty() {
            "any folder (none is set)".into()
        } else {
            shown.join(", ")
        };
        (file, shown)
    }

    /// Goes on in the file of a subroutine, if there is one.
    fn open_file(&mut self, label: &Label, span: Span) -> Outcome {
        let (name, _) = self.file_of(label);
        for folder in self.state.settings.subroutine_folders.clone() {
            let path = folder.join(&name);
            let shown = path.display().to_string();
            if self.is_read(&shown) {
                return Ok(());
            }
            match files::open(&path) {
                Ok(file) => {
                    self.read(shown, Box::new(BufReader::new(file)));
                    return Ok(());
                }
                Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
                Err(error) => {
                    let reason = format!("{shown}: {error}");
                    return Err((span, ErrorKind::NotReadable { reason }));
                }
            }
        }
        let of_that_name = |(path, _): &&(&str, &str)| path.rsplit('/').next() == Some(&*name);
        let mut shipped = self.state.settings.subroutine_files.iter();
        if let Some((path, text)) = shipped.find(of_that_name)
            && !self.is_read(path)
        {
            self.read((*path).into(), Box::new(Cursor::new(text)));
        }
        Ok(())
    }

    /// Whether a file is read already; then goes on at its start.
    fn is_read(&mut self, name: &str) -> bool {
        let known = self.files.iter().position(|file| file.name == name);
        if let Some(known) = known {
            self.file = known;
            self.files[known].text.seek(0, 0);
        }
        known.is_some()
    }

    /// Goes on in another file.
    fn read(&mut self, name: String, text: Box<dyn ReadSeek>) {
        self.files.push(File::new(name, text));
        self.file = self.files.len() - 1;
    }

    pub(super) fn return_from(&mut self, o_word: &OWord) -> Outcome {
        let level = self.levels.last().expect("the program's own level is never left");
        if matches!(level.kind, LevelKind::Program) {
            return Err(o_word.span.fault(OWordError::NoSubroutine {
                label: o_word.label.to_string(),
                keyword: o_word.keyword.name(),
            }));
        }
        let value = (o_word.argument_count > 0).then(|| o_word.argument());
        self.leave(value);
        Ok(())
    }

    /// Ends the subroutine under way.
    pub(super) fn leave(&mut self, value: Option<f64>) {
        if matches!(self.levels.last().map(|level| &level.kind), Some(LevelKind::Profile))
            && let Err(kind) = self.state.cut_profile(&mut self.calls)
        {
            self.fail(Span::default(), kind);
        }
        let Some(level) = self.levels.pop() else { return };
        self.state.leave_call(&mut self.calls);
        self.state.parameters.set_named("_value", value.unwrap_or(0.0));
        self.state
            .parameters
            .set_named("_value_returned", f64::from(value.is_some()));
        if !matches!(level.kind, LevelKind::Subprogram { .. }) {
            self.state.parameters.set_arguments(level.arguments);
        }
        if let Some(back) = level.back {
            self.go_to(back);
        }
        if let LevelKind::Remap(rest) = level.kind {
            self.state.remapping.pop();
            self.set_source(rest.source);
            self.run_rest_of_block(*rest);
        }
    }

    /// M98: the subprogram begins with its label alone.
    pub(super) fn call_program(&mut self, program: u32, times: u32, span: Span) {
        if times == 0 {
            return;
        }
        let label = Label::Number(program);
        // Where it is not known yet, the search for it sets the start.
        let known = self.subroutines.get(&label).map(|known| known.start);
        let start = known.unwrap_or_else(|| self.place());
        let kind = LevelKind::Subprogram { start, left: times - 1 };
        if let Err((span, kind)) = self.enter(label, kind, span) {
            self.fail(span, kind);
        }
    }

    /// A lathe cycle: the subroutine tells its profile.
    pub(super) fn call_profile(&mut self, program: u32, span: Span) {
        match self.enter(Label::Number(program), LevelKind::Profile, span) {
            Ok(()) => self.state.parameters.set_arguments([0.0; ARGUMENTS_MAX]),
            Err((span, kind)) => {
                self.state.leave_profile();
                self.fail(span, kind);
            }
        }
    }

    /// M99: the next time, the return, or in the program itself its end.
    pub(super) fn return_by_m99(&mut self) {
        let level = self.levels.last_mut().expect("the program's own level is never left");
        match &mut level.kind {
            LevelKind::Subprogram { start, left } if *left > 0 => {
                *left -= 1;
                let start = *start;
                level.blocks.clear();
                self.go_to(start);
            }
            LevelKind::Subprogram { .. } | LevelKind::Call | LevelKind::Remap(_) | LevelKind::Profile => {
                self.leave(None)
            }
            LevelKind::Program if self.state.settings.repeats_by_m99 => {
                level.blocks.clear();
                self.go_to(Place {
                    file: 0,
                    offset: 0,
                    line: 0,
                });
            }
            LevelKind::Program => {
                self.ended = true;
                self.state.end_by_m2(&mut self.calls);
            }
        }
    }

    /// The file of a subroutine ended without endsub.
    pub(super) fn end_of_subroutine(&mut self) {
        let level = self.levels.last().expect("the program's own level is never left");
        let label = level.label.as_ref().map_or_else(String::new, Label::to_string);
        self.ended = true;
        self.fail(
            Span::default(),
            OWordError::BlockNotClosed {
                expected: format!("{label} endsub"),
                label,
                keyword: "sub".into(),
            }
            .into(),
        );
    }
}

#[cfg(test)]
mod tests {
    use crate::printed::printed_with;
    use crate::{NoMachine, Settings};
    use motion::canon::LengthUnit;

    const SHIPPED: &[(&str, &str)] = &[
        (
            "lib/outer.ngc",
            "o<outer> sub\n(debug,outer)\no<inner> call [#1 + 1]\no<outer> endsub\n",
        ),
        ("lib/inner.ngc", "o<inner> sub\n(debug,inner %d#1)\no<inner> endsub\n"),
        ("lib/wrong.ngc", "o<wrong> sub\n(abort,so it is)\no<wrong> endsub\n"),
    ];

    fn shipped() -> Settings {
        Settings {
            subroutine_files: SHIPPED,
            ..Settings::default()
        }
    }

    #[test]
    fn what_comes_with_the_machine_is_found_unless_a_folder_has_a_file_of_that_name() {
        let program = "o<outer> call [1]\no<inner> call [5]\no<outer> call [2]\nM2\n";
        let said = |settings| printed_with(program, settings, NoMachine).replace("MESSAGE", "");
        let both = "(\"outer\")\n(\"inner 2\")\n(\"inner 5\")\n(\"outer\")\n(\"inner 3\")\n";
        assert_eq!(said(shipped()), both);
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(
            folder.path().join("inner.ngc"),
            "o<inner> sub\n(debug,own)\no<inner> endsub\n",
        )
        .unwrap();
        let own = Settings {
            subroutine_folders: vec![folder.path().to_owned()],
            ..shipped()
        };
        assert_eq!(said(own), "(\"outer\")\n(\"own\")\n(\"own\")\n(\"outer\")\n(\"own\")\n");
        let wrong = printed_with("G0 X1\no<wrong> call\nM2\n", shipped(), NoMachine);
        assert!(wrong.contains("lib/wrong.ngc:2:"), "{wrong}");
    }

    #[test]
    fn a_program_knows_the_unit_of_the_machine_and_whether_it_is_run() {
        let program = "(debug,%d#<_metric_machine> #<_task>)\nM2\n";
        let said = |machine_unit| {
            let settings = Settings {
                machine_unit,
                ..Settings::default()
            };
            printed_with(program, settings, NoMachine)
        };
        assert_eq!(said(LengthUnit::Millimetre), "MESSAGE(\"1 0\")\n");
        assert_eq!(said(LengthUnit::Inch), "MESSAGE(\"0 0\")\n");
    }
}
