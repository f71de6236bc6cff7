//! What O-words, M98 and M99 do with a run.
//!
//! In:  O-words in the order in which they are run.
//! Out: the place from which reading goes on.

use crate::error::ErrorKind;
use crate::flow::{
    CALLS_MAX, Level, LevelKind, Open, OpenKind, Place, REMEMBERED_MAX, SUBROUTINES_MAX, Search, SearchEnd, Subroutine,
};
use crate::interpreter::{File, Outcome, Run};
use crate::o_word::{self, Keyword, Label, OWord};
use crate::parameter::ARGUMENTS;
use crate::scan::Span;
use std::io::BufReader;

impl Run<'_> {
    /// Runs an O-word line.
    pub(crate) fn o_word(&mut self, o_word: &OWord) -> Outcome {
        let line = self.source().line;
        let here = self.place();
        let before = Place {
            offset: u64::from(self.source().start),
            line: line - 1,
            ..here
        };
        let at = |kind| (o_word.span, kind);
        let label = &o_word.label;
        let not_open = |opener| {
            Err(at(ErrorKind::BlockNotOpen {
                label: label.to_string(),
                keyword: o_word.keyword.name(),
                opener,
            }))
        };
        let level = self.levels.last_mut().expect("the program's own level is never left");
        let open = |kind| Open {
            label: label.clone(),
            kind,
            line,
        };
        match o_word.keyword {
            Keyword::Sub | Keyword::Program => return self.define(o_word),
            Keyword::Call => return self.call(o_word),
            Keyword::Return | Keyword::EndSub => return self.return_from(o_word),
            Keyword::If => {
                if o_word.argument() == 0.0 {
                    self.look_for(o_word, SearchEnd::Branch);
                } else {
                    level.open(open(OpenKind::If)).map_err(at)?;
                }
            }
            Keyword::ElseIf | Keyword::Else => match level.find(label).map(|open| open.kind) {
                Some(OpenKind::If) => self.look_for(o_word, SearchEnd::EndIf),
                Some(OpenKind::While { .. } | OpenKind::Do { .. } | OpenKind::Repeat { .. }) | None => {
                    return not_open("if");
                }
            },
            Keyword::EndIf => match level.find(label).map(|open| open.kind) {
                Some(OpenKind::If) => drop(level.blocks.pop()),
                Some(OpenKind::While { .. } | OpenKind::Do { .. } | OpenKind::Repeat { .. }) | None => {
                    return not_open("if");
                }
            },
            Keyword::Do => level.open(open(OpenKind::Do { start: here })).map_err(at)?,
            Keyword::While => match level.find(label).map(|open| open.kind) {
                Some(OpenKind::Do { start }) if o_word.argument() != 0.0 => self.go_to(start),
                Some(OpenKind::Do { .. }) => drop(level.blocks.pop()),
                Some(OpenKind::While { start }) if start == before => {
                    if o_word.argument() == 0.0 {
                        level.blocks.pop();
                        self.look_for(o_word, SearchEnd::EndWhile);
                    }
                }
                Some(OpenKind::While { .. } | OpenKind::If | OpenKind::Repeat { .. }) | None => {
                    level.open(open(OpenKind::While { start: before })).map_err(at)?;
                    if o_word.argument() == 0.0 {
                        level.blocks.pop();
                        self.look_for(o_word, SearchEnd::EndWhile);
                    }
                }
            },
            Keyword::EndWhile => match level.find(label).map(|open| open.kind) {
                Some(OpenKind::While { start }) => self.go_to(start),
                Some(OpenKind::If | OpenKind::Do { .. } | OpenKind::Repeat { .. }) | None => return not_open("while"),
            },
            Keyword::Repeat => {
                let times = o_word.argument().round();
                level
                    .open(open(OpenKind::Repeat {
                        start: here,
                        left: if times >= 1.0 { times as u64 } else { 0 },
                    }))
                    .map_err(at)?;
                if times < 1.0 {
                    level.blocks.pop();
                    self.look_for(o_word, SearchEnd::EndRepeat);
                }
            }
            Keyword::EndRepeat => match level.find(label) {
                Some(Open {
                    kind: OpenKind::Repeat { start, left },
                    ..
                }) => {
                    *left -= 1;
                    let (start, left) = (*start, *left);
                    if left > 0 {
                        self.go_to(start);
                    } else {
                        level.blocks.pop();
                    }
                }
                Some(_) | None => return not_open("repeat"),
            },
            Keyword::Break => match level.find(label).map(|open| open.kind) {
                Some(OpenKind::While { .. } | OpenKind::Do { .. }) => {
                    level.blocks.pop();
                    self.look_for(o_word, SearchEnd::EndWhile);
                }
                // LinuxCNC knows neither for repeat.
                Some(OpenKind::If | OpenKind::Repeat { .. }) | None => return not_open("while or do"),
            },
            Keyword::Continue => match level.find(label).map(|open| open.kind) {
                Some(OpenKind::While { start }) => self.go_to(start),
                Some(OpenKind::Do { .. }) => self.look_for(o_word, SearchEnd::EndWhile),
                Some(OpenKind::If | OpenKind::Repeat { .. }) | None => return not_open("while or do"),
            },
        }
        Ok(())
    }

    /// Passes lines over from here on.
    fn look_for(&mut self, o_word: &OWord, target: SearchEnd) {
        let source = self.source();
        // Where a search from this line ended once, the next one for the same label does too.
        if let Some((label, place)) = self.search_ends.get(&(self.file, source.line, target))
            && *label == o_word.label
        {
            let place = *place;
            self.go_to(place);
        }
        self.search = Some(Search {
            label: o_word.label.clone(),
            target,
            keyword: o_word.keyword,
            source,
            span: o_word.span,
        });
    }

    /// A line while something is looked for: only O-words with its label matter.
    pub(crate) fn pass_over(&mut self) {
        let octets = self.files[self.file].text.octets();
        let Some((mut cursor, _)) = o_word::start(octets) else {
            return;
        };
        // A label may be computed; one that cannot be is another one.
        let Ok((Some(label), keyword)) = o_word::head(&mut cursor, &self.state) else {
            return;
        };
        if let Some(search) = &self.search
            && search.target == SearchEnd::EndSub
            && keyword == Keyword::Sub
        {
            let (label, outer) = (label.to_string(), search.label.to_string());
            return self.fail(cursor.span(), ErrorKind::NestedSubroutine { label, outer });
        }
        let found = |search: &mut Search| search.label == label && search.target.is(keyword);
        let Some(search) = self.search.take_if(found) else {
            return;
        };
        let source = self.source();
        let before = Place {
            file: self.file,
            offset: u64::from(source.start),
            line: source.line - 1,
        };
        if search.target != SearchEnd::Sub {
            if self.search_ends.len() >= REMEMBERED_MAX {
                self.search_ends.clear();
            }
            let from = (self.file, search.source.line, search.target);
            self.search_ends.insert(from, (search.label.clone(), before));
        }
        if let Err((span, kind)) = self.found(&search, keyword) {
            self.fail(span, kind);
        }
    }

    /// The search ended at the line read last.
    fn found(&mut self, search: &Search, keyword: Keyword) -> Outcome {
        let here = self.place();
        match search.target {
            SearchEnd::Branch => match keyword {
                // Reads the line again for its condition.
                Keyword::ElseIf => {
                    let line = self.files[self.file].text.octets().to_vec();
                    let Some((cursor, _)) = o_word::start(&line) else {
                        return Ok(());
                    };
                    let Some(o_word) = o_word::read(cursor, &self.state)? else {
                        return Ok(());
                    };
                    if o_word.argument() == 0.0 {
                        self.look_for(&o_word, SearchEnd::Branch);
                        Ok(())
                    } else {
                        self.open_branch(&search.label, search.source.line)
                    }
                }
                Keyword::Else => self.open_branch(&search.label, search.source.line),
                _ => Ok(()),
            },
            SearchEnd::EndIf => {
                let level = self.levels.last_mut().expect("the program's own level is never left");
                if level.find(&search.label).is_some() {
                    level.blocks.pop();
                }
                Ok(())
            }
            SearchEnd::EndWhile if search.keyword == Keyword::Continue => {
                // The end of the block decides whether it goes round again.
                let source = self.source();
                self.go_to(Place {
                    offset: u64::from(source.start),
                    line: source.line - 1,
                    ..here
                });
                Ok(())
            }
            SearchEnd::EndWhile | SearchEnd::EndRepeat => Ok(()),
            SearchEnd::EndSub => Ok(()),
            SearchEnd::Sub => {
                let is_program = keyword == Keyword::Program;
                let found = Subroutine {
                    start: here,
                    is_program,
                };
                self.subroutines.insert(search.label.clone(), found);
                if let Some(level) = self.levels.last_mut()
                    && let LevelKind::Subprogram { start, .. } = &mut level.kind
                {
                    *start = here;
                }
                Ok(())
            }
        }
    }

    fn open_branch(&mut self, label: &Label, line: u32) -> Outcome {
        let level = self.levels.last_mut().expect("the program's own level is never left");
        level.blocks.push(Open {
            label: label.clone(),
            kind: OpenKind::If,
            line,
        });
        Ok(())
    }

    /// The file ended before what was looked for.
    #[cold]
    pub(crate) fn search_failed(&mut self, search: &Search) {
        let label = search.label.to_string();
        if search.target == SearchEnd::Sub {
            let (file, folders) = self.file_of(&search.label);
            self.leave_failed_call();
            self.set_source(search.source);
            return self.fail(search.span, ErrorKind::NoSuchSubroutine { label, file, folders });
        }
        self.set_source(search.source);
        self.fail(
            search.span,
            ErrorKind::BlockNotClosed {
                label,
                keyword: search.keyword.name(),
                expected: format!("{} {}", search.label, search.target.name()),
            },
        );
    }

    fn leave_failed_call(&mut self) {
        self.state.leave_profile();
        if let Some(level) = self.levels.pop()
            && let Some(back) = level.back
        {
            self.go_to(back);
        }
    }

    /// A definition in the way of reading: kept, and passed over.
    fn define(&mut self, o_word: &OWord) -> Outcome {
        let level = self.levels.last().expect("the program's own level is never left");
        if let Some(outer) = &level.label {
            return Err((
                o_word.span,
                ErrorKind::NestedSubroutine {
                    label: o_word.label.to_string(),
                    outer: outer.to_string(),
                },
            ));
        }
        let here = self.place();
        let is_program = o_word.keyword == Keyword::Program;
        if is_program && !self.state.settings.fanuc_subprograms {
            let word = o_word.label.to_string();
            return Err((o_word.span, ErrorKind::FanucSubprogram { word }));
        }
        let found = Subroutine {
            start: here,
            is_program,
        };
        if self.subroutines.len() >= SUBROUTINES_MAX {
            let max = SUBROUTINES_MAX;
            return Err((o_word.span, ErrorKind::TooManySubroutines { max }));
        }
        let known = self.subroutines.insert(o_word.label.clone(), found);
        if o_word.keyword == Keyword::Sub {
            if let Some(first) = known.map(|first| first.start).filter(|first| *first != here) {
                return Err((
                    o_word.span,
                    ErrorKind::DefinedTwice {
                        label: o_word.label.to_string(),
                        file: self.files[first.file].name.clone(),
                        line: first.line,
                    },
                ));
            }
            self.look_for(o_word, SearchEnd::EndSub);
        }
        Ok(())
    }

    fn call(&mut self, o_word: &OWord) -> Outcome {
        self.enter(o_word.label.clone(), LevelKind::Call, o_word.span)?;
        self.state.parameters.set_arguments(o_word.arguments);
        Ok(())
    }

    /// Begins a subroutine: where it is known, goes there, else looks for it further down or in a file of its own.
    pub(crate) fn enter(&mut self, label: Label, kind: LevelKind, span: Span) -> Outcome {
        if self.levels.len() > CALLS_MAX {
            return Err((
                span,
                ErrorKind::CallsTooDeep {
                    label: label.to_string(),
                    depth: self.levels.len(),
                    depth_max: CALLS_MAX,
                },
            ));
        }
        let back = self.place();
        let arguments = self.state.parameters.arguments();
        let known = self.subroutines.get(&label).copied();
        let by_m98 = matches!(kind, LevelKind::Subprogram { .. });
        if known.is_some_and(|known| known.is_program != by_m98) {
            let label = label.to_string();
            return Err((span, ErrorKind::WrongCall { label, by_m98 }));
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
    fn file_of(&self, label: &Label) -> (String, String) {
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
            if let Some(known) = self.files.iter().position(|file| file.name == shown) {
                self.file = known;
                self.files[known].text.seek(0, 0);
                return Ok(());
            }
            match files::open(&path) {
                Ok(file) => {
                    self.files.push(File::new(shown, Box::new(BufReader::new(file))));
                    self.file = self.files.len() - 1;
                    return Ok(());
                }
                Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
                Err(error) => {
                    let reason = format!("{shown}: {error}");
                    return Err((span, ErrorKind::NotReadable { reason }));
                }
            }
        }
        Ok(())
    }

    fn return_from(&mut self, o_word: &OWord) -> Outcome {
        let level = self.levels.last().expect("the program's own level is never left");
        if matches!(level.kind, LevelKind::Program) {
            return Err((
                o_word.span,
                ErrorKind::NoSubroutine {
                    label: o_word.label.to_string(),
                    keyword: o_word.keyword.name(),
                },
            ));
        }
        let value = (o_word.argument_count > 0).then(|| o_word.argument());
        self.leave(value);
        Ok(())
    }

    /// Ends the subroutine under way.
    pub(crate) fn leave(&mut self, value: Option<f64>) {
        if matches!(self.levels.last().map(|level| &level.kind), Some(LevelKind::Profile))
            && let Err(kind) = self.state.turn(&mut self.calls)
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
            self.rest_of_block(*rest);
        }
    }

    /// M98: the subprogram begins with its label alone.
    pub(crate) fn call_program(&mut self, program: u32, times: u32, span: Span) {
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
    pub(crate) fn call_profile(&mut self, program: u32, span: Span) {
        match self.enter(Label::Number(program), LevelKind::Profile, span) {
            Ok(()) => self.state.parameters.set_arguments([0.0; ARGUMENTS]),
            Err((span, kind)) => {
                self.state.leave_profile();
                self.fail(span, kind);
            }
        }
    }

    /// M99: the next time, the return, or in the program itself its end.
    pub(crate) fn return_by_m99(&mut self) {
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
    pub(crate) fn end_of_subroutine(&mut self) {
        let level = self.levels.last().expect("the program's own level is never left");
        let label = level.label.as_ref().map_or_else(String::new, Label::to_string);
        self.ended = true;
        self.fail(
            Span::default(),
            ErrorKind::BlockNotClosed {
                expected: format!("{label} endsub"),
                label,
                keyword: "sub".into(),
            },
        );
    }
}
