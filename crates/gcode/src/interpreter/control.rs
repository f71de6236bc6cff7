//! What O-words, M98 and M99 do with a run.
//!
//! In:  O-words in the order in which they are run.
//! Out: the place from which reading goes on.

use super::{Outcome, Run};
use crate::error::OWordError;
use crate::flow::{LevelKind, Open, OpenKind, Place, REMEMBERED_MAX, Search, SearchEnd, Subroutine};
use crate::o_word::{self, Keyword, Label, OWord};

impl Run<'_> {
    /// Runs an O-word line.
    pub(super) fn run_o_word(&mut self, o_word: &OWord) -> Outcome {
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
            Err(at(OWordError::BlockNotOpen {
                label: label.to_string(),
                keyword: o_word.keyword.name(),
                opener,
            }
            .into()))
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
                    self.start_search(o_word, SearchEnd::Branch);
                } else {
                    level.open(open(OpenKind::If)).map_err(at)?;
                }
            }
            Keyword::ElseIf | Keyword::Else => match level.find(label).map(|open| open.kind) {
                Some(OpenKind::If) => self.start_search(o_word, SearchEnd::EndIf),
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
                        self.start_search(o_word, SearchEnd::EndWhile);
                    }
                }
                Some(OpenKind::While { .. } | OpenKind::If | OpenKind::Repeat { .. }) | None => {
                    level.open(open(OpenKind::While { start: before })).map_err(at)?;
                    if o_word.argument() == 0.0 {
                        level.blocks.pop();
                        self.start_search(o_word, SearchEnd::EndWhile);
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
                    self.start_search(o_word, SearchEnd::EndRepeat);
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
                    self.start_search(o_word, SearchEnd::EndWhile);
                }
                // LinuxCNC knows neither for repeat.
                Some(OpenKind::If | OpenKind::Repeat { .. }) | None => return not_open("while or do"),
            },
            Keyword::Continue => match level.find(label).map(|open| open.kind) {
                Some(OpenKind::While { start }) => self.go_to(start),
                Some(OpenKind::Do { .. }) => self.start_search(o_word, SearchEnd::EndWhile),
                Some(OpenKind::If | OpenKind::Repeat { .. }) | None => return not_open("while or do"),
            },
        }
        Ok(())
    }

    /// Passes lines over from here on.
    pub(super) fn start_search(&mut self, o_word: &OWord, target: SearchEnd) {
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
    pub(super) fn search_line(&mut self) {
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
            return self.fail(cursor.span(), OWordError::NestedSubroutine { label, outer }.into());
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
                        self.start_search(&o_word, SearchEnd::Branch);
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
    pub(super) fn search_failed(&mut self, search: &Search) {
        let label = search.label.to_string();
        if search.target == SearchEnd::Sub {
            let percent = self.source().line;
            let behind = self.line_behind_percent(&search.label);
            let (file, folders) = self.file_of(&search.label);
            self.leave_failed_call();
            self.set_source(search.source);
            let kind = match behind {
                Some(line) => OWordError::SubroutineBehindPercent { label, line, percent }.into(),
                None => OWordError::NoSuchSubroutine { label, file, folders }.into(),
            };
            return self.fail(search.span, kind);
        }
        self.set_source(search.source);
        self.fail(
            search.span,
            OWordError::BlockNotClosed {
                label,
                keyword: search.keyword.name(),
                expected: format!("{} {}", search.label, search.target.name()),
            }
            .into(),
        );
    }

    /// The line behind the closing `%`, which was read last, in which a subroutine begins. Its end is looked for no further.
    fn line_behind_percent(&mut self, wanted: &Label) -> Option<u32> {
        while !self.is_cancelled()
            && let Ok(Some(line)) = self.files[self.file].text.next_line()
        {
            let octets = self.files[self.file].text.octets();
            let head = o_word::start(octets).map(|(mut cursor, _)| o_word::head(&mut cursor, &self.state));
            if let Some(Ok((Some(label), Keyword::Sub | Keyword::Program))) = head
                && label == *wanted
            {
                return Some(line.number);
            }
        }
        None
    }

    fn leave_failed_call(&mut self) {
        self.state.leave_profile();
        if let Some(level) = self.levels.pop()
            && let Some(back) = level.back
        {
            self.go_to(back);
        }
    }
}
