//! Units, types and variables.

use super::{OBJECTS, POINTERS, Parser, Read, STEPS};
use crate::diagnostic::{Kind, Reported};
use crate::duration;
use crate::syntax::{
    ArgumentValue, Expression, ExpressionKind, File, Initial, Name, Placed, Section, TypeDeclaration, TypeKind,
    TypeText, Unit, UnitKind, Variable,
};
use crate::token::{DATES, Token};
use std::rc::Rc;

/// Words that a part of a file begins with.
const PARTS: [&str; 7] = [
    "TYPE",
    "VAR_GLOBAL",
    "VAR_CONFIG",
    "PROGRAM",
    "FUNCTION",
    "FUNCTION_BLOCK",
    "CONFIGURATION",
];

const SECTIONS: [(&str, Section); 7] = [
    ("VAR", Section::Local),
    ("VAR_INPUT", Section::Input),
    ("VAR_OUTPUT", Section::Output),
    ("VAR_IN_OUT", Section::InOut),
    ("VAR_TEMP", Section::Temporary),
    ("VAR_GLOBAL", Section::Global),
    ("VAR_EXTERNAL", Section::External),
];

impl Parser<'_, '_> {
    pub(super) fn file(&mut self) -> File {
        let mut file = File::default();
        while *self.token() != Token::End {
            if self.part(&mut file).is_err() {
                self.skip_to(&PARTS);
            }
        }
        file
    }

    fn part(&mut self, file: &mut File) -> Read<()> {
        if self.take_word("TYPE") {
            while !self.is_word("END_TYPE") {
                match self.type_declaration() {
                    Ok(declaration) => file.types.push(declaration),
                    Err(Reported) => self.skip_declaration("END_TYPE")?,
                }
            }
            self.advance();
            self.take_sign(";");
        } else if self.is_word("VAR_GLOBAL") {
            self.variables(&mut file.globals)?;
        } else if self.is_any_word(&["PROGRAM", "FUNCTION", "FUNCTION_BLOCK"]) {
            file.units.push(self.unit()?);
        } else if self.is_word("CONFIGURATION") {
            self.configuration(file)?;
        } else if self.is_word("VAR_CONFIG") {
            self.places(file)?;
        } else if self.is_any_word(&["CLASS", "INTERFACE", "METHOD", "PROPERTY"]) {
            self.objects();
        } else if self.is_any_word(&["ACTION"]) {
            self.action();
        } else if self.is_word("VAR_ACCESS") {
            let at = self.span();
            self.told.error(at, Kind::Unsupported("VAR_ACCESS".into()));
            self.skip_to(&["END_VAR"]);
            self.advance();
        } else {
            let reported = self.expected("PROGRAM, FUNCTION_BLOCK, FUNCTION, TYPE or VAR_GLOBAL");
            self.advance();
            return Err(reported);
        }
        Ok(())
    }

    fn unit(&mut self) -> Read<Unit> {
        let (kind, end) = if self.take_word("PROGRAM") {
            (UnitKind::Program, "END_PROGRAM")
        } else if self.take_word("FUNCTION") {
            (UnitKind::Function, "END_FUNCTION")
        } else {
            self.advance();
            (UnitKind::Block, "END_FUNCTION_BLOCK")
        };
        let name = self.name()?;
        let extends = self.is_any_word(&["EXTENDS", "IMPLEMENTS"]);
        if extends {
            let (at, word) = (self.span(), self.written());
            self.told.unsupported(at, OBJECTS, &word);
            while self.is_any_word(&["EXTENDS", "IMPLEMENTS"]) || self.is_sign(",") || self.is_sign(".") {
                self.advance();
                self.name()?;
            }
        }
        let mut result = None;
        if kind == UnitKind::Function {
            self.sign(":")?;
            let start = self.span();
            let ty = self.type_text();
            while ty.is_err() && !self.at_section() && !self.is_sign(";") && *self.token() != Token::End {
                self.advance();
            }
            let (kind, at) = (TypeKind::Wrong, start);
            result = Some(ty.unwrap_or(TypeText { kind, at }));
        }
        self.take_sign(";");
        let (mut variables, mut refused) = (Vec::new(), Vec::new());
        loop {
            if self.at_section() {
                self.variables(&mut variables)?;
            } else if self.at_steps() {
                let (at, word) = (self.span(), self.written());
                self.told.error(at, Kind::UnsupportedOf { word, what: STEPS });
                self.skip_to(&[end]);
            } else if self.is_any_word(&["METHOD", "PROPERTY"]) && matches!(self.ahead(1).token, Token::Word(_)) {
                refused.extend(self.name_behind());
                self.objects();
            } else if self.is_word("ACTION") && matches!(self.ahead(1).token, Token::Word(_)) {
                refused.extend(self.name_behind());
                self.action();
            } else {
                break;
            }
        }
        let body = self.statements(&[end]);
        self.word(end)?;
        self.take_sign(";");
        Ok(Unit {
            kind,
            name,
            result,
            variables,
            extends,
            refused,
            body,
        })
    }

    fn at_section(&self) -> bool {
        SECTIONS.iter().any(|(word, _)| self.is_word(word))
    }

    /// Whether a step or a transition begins here; variables may be called so.
    fn at_steps(&self) -> bool {
        let begins = self.is_any_word(&["INITIAL_STEP", "STEP", "TRANSITION"]);
        begins && matches!(self.ahead(1).token, Token::Word(_))
    }

    /// The word that stands here.
    fn written(&self) -> String {
        match self.token() {
            Token::Word(word) => word.clone(),
            _ => String::new(),
        }
    }

    /// The name of a METHOD or the like: the last word before something else, as PUBLIC may come before it.
    fn name_behind(&self) -> Option<Name> {
        let words = (1..6).map_while(|count| match &self.ahead(count).token {
            Token::Word(text) if !super::KEYWORDS.iter().any(|word| word.eq_ignore_ascii_case(text)) => Some(Name {
                text: text.clone(),
                at: self.ahead(count).at,
            }),
            _ => None,
        });
        words.last()
    }

    /// Passes a CLASS, METHOD and the like as a whole.
    fn objects(&mut self) {
        let (at, word) = (self.span(), self.written());
        self.told.unsupported(at, OBJECTS, &word);
        let end = format!("END_{word}");
        self.skip_to(&[end.as_str()]);
        self.advance();
        self.take_sign(";");
    }

    /// Passes an ACTION.
    fn action(&mut self) {
        let (at, word) = (self.span(), self.written());
        self.told.unsupported(at, "actions", &word);
        self.skip_to(&["END_ACTION"]);
        self.advance();
        self.take_sign(";");
    }

    /// VAR .. END_VAR.
    fn variables(&mut self, variables: &mut Vec<Variable>) -> Read<()> {
        let section = SECTIONS.iter().find(|(word, _)| self.is_word(word));
        let section = section.map_or(Section::Local, |(_, section)| *section);
        self.advance();
        let (mut constant, mut retain) = (false, false);
        loop {
            if self.take_word("CONSTANT") {
                constant = true;
            } else if self.take_word("RETAIN") || self.take_word("PERSISTENT") {
                retain = true;
            } else if !self.take_word("NON_RETAIN") {
                break;
            }
        }
        while !self.take_word("END_VAR") {
            let first = variables.len();
            if self.declaration(section, variables).is_err() {
                self.skip_declaration("END_VAR")?;
            }
            for variable in &mut variables[first..] {
                (variable.constant, variable.retain) = (constant, retain);
            }
        }
        self.take_sign(";");
        Ok(())
    }

    /// Passes a declaration that is wrong: it takes none of the others along.
    fn skip_declaration(&mut self, end: &str) -> Read<()> {
        while !self.take_sign(";") && !self.is_word(end) {
            if *self.token() == Token::End || self.is_any_word(&PARTS) {
                return Err(Reported);
            }
            self.advance();
        }
        Ok(())
    }

    /// `a, b AT %IX0.0 : INT := 5;`
    fn declaration(&mut self, section: Section, variables: &mut Vec<Variable>) -> Read<()> {
        let mut names = Vec::new();
        loop {
            let name = self.name()?;
            let mut address = None;
            if self.take_word("AT") {
                let at = self.span();
                match self.token().clone() {
                    Token::Address(text) | Token::Text(text) => address = Some((text, at)),
                    _ => return Err(self.expected("an address (%IX0.0) or the name of a pin ('io.5.in-03')")),
                }
                self.advance();
            }
            names.push((name, address));
            if !self.take_sign(",") {
                break;
            }
        }
        self.sign(":")?;
        let start = self.span();
        // What is refused is known by its name nevertheless, and not told again where it is used.
        let ty = self.type_text();
        let is_wrong = ty.is_err();
        let (kind, at) = (TypeKind::Wrong, start);
        let ty = Rc::new(ty.unwrap_or(TypeText { kind, at }));
        if is_wrong {
            names.drain(..).for_each(|(name, _)| {
                variables.push(Variable {
                    name,
                    section,
                    constant: false,
                    retain: false,
                    address: None,
                    edge: None,
                    ty: Rc::clone(&ty),
                    initial: None,
                })
            });
            return Err(Reported);
        }
        let edge = match (self.take_word("R_EDGE"), self.take_word("F_EDGE")) {
            (true, _) => Some(true),
            (_, true) => Some(false),
            _ => None,
        };
        let initial = self.initial()?.map(Rc::new);
        self.semicolon("the declaration");
        variables.extend(names.into_iter().map(|(name, address)| Variable {
            name,
            section,
            constant: false,
            retain: false,
            address,
            edge,
            ty: ty.clone(),
            initial: initial.clone(),
        }));
        Ok(())
    }

    fn type_declaration(&mut self) -> Read<TypeDeclaration> {
        let name = self.name()?;
        self.sign(":")?;
        let start = self.span();
        let ty = self.type_behind();
        if ty.is_err() && !self.is_word("END_TYPE") {
            let _ = self.skip_declaration("END_TYPE");
        }
        let Ok(ty) = ty else {
            let (kind, at, initial) = (TypeKind::Wrong, start, None);
            let ty = TypeText { kind, at };
            return Ok(TypeDeclaration { name, ty, initial });
        };
        let initial = self.initial()?;
        // Behind END_STRUCT many leave it out.
        if initial.is_none() && matches!(ty.kind, TypeKind::Struct(_)) {
            self.take_sign(";");
        } else {
            self.semicolon("the declaration");
        }
        Ok(TypeDeclaration { name, ty, initial })
    }

    /// What stands behind the name of a type.
    fn type_behind(&mut self) -> Read<TypeText> {
        let start = self.span();
        if self.is_word("UNION") {
            self.skip_to(&["END_UNION"]);
            self.advance();
            return Err(self.told.error(start, Kind::Unsupported("UNION".into())));
        }
        Ok(if self.take_word("STRUCT") {
            let mut members = Vec::new();
            while !self.is_word("END_STRUCT") {
                if self.declaration(Section::Local, &mut members).is_err() {
                    self.skip_declaration("END_STRUCT")?;
                }
            }
            self.advance();
            let at = start.to(self.last());
            let kind = TypeKind::Struct(members);
            TypeText { kind, at }
        } else {
            self.type_text()?
        })
    }

    fn type_text(&mut self) -> Read<TypeText> {
        let start = self.span();
        if self.take_word("ARRAY") {
            self.sign("[")?;
            let mut dimensions = Vec::new();
            loop {
                let first = self.expression()?;
                self.sign("..")?;
                dimensions.push((first, self.expression()?));
                if !self.take_sign(",") {
                    break;
                }
            }
            self.sign("]")?;
            self.word("OF")?;
            let element = self.nested(Self::type_text)?;
            let at = start.to(self.last());
            let kind = TypeKind::Array(dimensions, Box::new(element));
            return Ok(TypeText { kind, at });
        }
        if self.is_word("STRUCT") {
            self.skip_to(&["END_STRUCT"]);
            self.advance();
            let what = "a structure without a name of its own (one may be declared in TYPE)";
            return Err(self.told.error(start, Kind::Unsupported(what.into())));
        }
        if self.take_sign("(") {
            let mut values = Vec::new();
            loop {
                let name = self.name()?;
                let value = if self.take_sign(":=") {
                    Some(self.expression()?)
                } else {
                    None
                };
                values.push((name, value));
                if !self.take_sign(",") {
                    break;
                }
            }
            self.sign(")")?;
            let at = start.to(self.last());
            let kind = TypeKind::Enumeration(values);
            return Ok(TypeText { kind, at });
        }
        let refers = self.is_any_word(&["POINTER", "REFERENCE"]) && self.is_word_ahead(1, "TO");
        if refers || self.is_any_word(&["REF_TO"]) {
            let word = self.written();
            return Err(self.told.unsupported(start, POINTERS, &word));
        }
        if self.is_any_word(&["WSTRING", "CHAR", "WCHAR"]) {
            let word = self.written();
            return Err(self.told.error(start, Kind::Unsupported(word)));
        }
        if DATES.iter().any(|date| date.len() > 2 && self.is_word(date)) {
            let word = self.written();
            return Err(self.told.unsupported(start, "dates", &word));
        }
        let name = self.name()?;
        if name.text.eq_ignore_ascii_case("STRING") && (self.is_sign("[") || self.is_sign("(")) {
            let close = if self.take_sign("[") {
                "]"
            } else {
                self.advance();
                ")"
            };
            let length = self.expression()?;
            self.sign(close)?;
            let at = start.to(self.last());
            let kind = TypeKind::Text(Box::new(length));
            return Ok(TypeText { kind, at });
        } else if self.is_sign("(") {
            return Err(self.told.error(start, Kind::Unsupported("a subrange".into())));
        }
        let at = start.to(self.last());
        let kind = TypeKind::Named(name);
        Ok(TypeText { kind, at })
    }

    fn initial(&mut self) -> Read<Option<Initial>> {
        if self.take_sign(":=") {
            Ok(Some(self.initial_value()?))
        } else {
            Ok(None)
        }
    }

    fn initial_value(&mut self) -> Read<Initial> {
        let start = self.span();
        if self.take_sign("[") {
            let mut values = Vec::new();
            loop {
                let repeated = matches!(self.token(), Token::Integer(_)) && self.ahead(1).token == Token::Sign("(");
                if repeated {
                    let Token::Integer(value) = *self.token() else {
                        return Err(Reported);
                    };
                    let kind = ExpressionKind::Integer(value);
                    let at = self.span();
                    let count = Expression { kind, at, depth: 1 };
                    self.advance();
                    self.advance();
                    let value = match self.is_sign(")") {
                        true => Initial::Default(self.span()),
                        false => self.nested(Self::initial_value)?,
                    };
                    self.sign(")")?;
                    values.push((Some(count), value));
                } else {
                    values.push((None, self.nested(Self::initial_value)?));
                }
                if !self.take_sign(",") {
                    break;
                }
            }
            self.sign("]")?;
            return Ok(Initial::List(values, start.to(self.last())));
        }
        let is_member = matches!(self.ahead(1).token, Token::Word(_)) && self.ahead(2).token == Token::Sign(":=");
        if self.is_sign("(") && is_member {
            self.advance();
            let mut members = Vec::new();
            loop {
                let name = self.name()?;
                self.sign(":=")?;
                members.push((name, self.nested(Self::initial_value)?));
                if !self.take_sign(",") {
                    break;
                }
            }
            self.sign(")")?;
            return Ok(Initial::Members(members, start.to(self.last())));
        }
        Ok(Initial::Value(self.expression()?))
    }

    /// CONFIGURATION: global variables and the interval of tasks are read, the rest has no effect.
    fn configuration(&mut self, file: &mut File) -> Read<()> {
        self.advance();
        self.name()?;
        loop {
            let start = self.span();
            if self.take_word("END_CONFIGURATION") {
                self.take_sign(";");
                return Ok(());
            } else if self.is_word("VAR_GLOBAL") {
                self.variables(&mut file.globals)?;
            } else if self.take_word("END_RESOURCE") {
                self.take_sign(";");
            } else if self.is_word("VAR_CONFIG") {
                self.places(file)?;
            } else if self.take_word("RESOURCE") {
                let name = self.name()?;
                file.resources.push(name);
                self.word("ON")?;
                self.name()?;
            } else if self.take_word("TASK") {
                self.task()?;
            } else if *self.token() == Token::End || self.is_any_word(&["TYPE", "FUNCTION", "FUNCTION_BLOCK"]) {
                return Err(self.expected("END_CONFIGURATION"));
            } else {
                if self.is_word("PROGRAM") {
                    self.instance(file);
                }
                while !self.take_sign(";") {
                    if *self.token() == Token::End || self.is_any_word(&["END_RESOURCE", "END_CONFIGURATION"]) {
                        break;
                    }
                    self.advance();
                }
                let at = start.to(self.last());
                self.told.note(at, Kind::ConfigurationIgnored);
            }
        }
    }

    /// `PROGRAM name WITH task : type`, of which only the names count.
    fn instance(&mut self, file: &mut File) {
        let at = |count: usize| match &self.ahead(count).token {
            Token::Word(text) => Some(Name {
                text: text.clone(),
                at: self.ahead(count).at,
            }),
            _ => None,
        };
        let colon = if self.is_word_ahead(2, "WITH") { 4 } else { 2 };
        if let (Some(name), Some(ty)) = (at(1), at(colon + 1))
            && self.ahead(colon).token == Token::Sign(":")
        {
            file.instances.push((name, ty));
        }
    }

    /// VAR_CONFIG: addresses of variables that are declared AT %I* and the like.
    fn places(&mut self, file: &mut File) -> Read<()> {
        self.advance();
        while !self.take_word("END_VAR") {
            match self.place() {
                Ok(placed) => file.placed.push(placed),
                Err(Reported) => self.skip_declaration("END_VAR")?,
            }
        }
        self.take_sign(";");
        Ok(())
    }

    fn place(&mut self) -> Read<Placed> {
        let mut path = vec![self.name()?];
        while self.take_sign(".") {
            path.push(self.name()?);
        }
        self.word("AT")?;
        let at = self.span();
        let (Token::Address(text) | Token::Text(text)) = self.token().clone() else {
            return Err(self.expected("an address (%IX0.0) or the name of a pin ('io.5.in-03')"));
        };
        self.advance();
        self.sign(":")?;
        let ty = self.type_text()?;
        self.semicolon("the declaration");
        let address = (text, at);
        Ok(Placed { path, address, ty })
    }

    /// `TASK name(INTERVAL := T#10ms, PRIORITY := 1);`
    fn task(&mut self) -> Read<()> {
        let Name { text: name, at } = self.name()?;
        let arguments = self.arguments()?;
        self.semicolon("TASK");
        for argument in arguments {
            let is_interval = argument.name.is_some_and(|name| name.key() == "interval");
            if let (true, ArgumentValue::Given(value)) = (is_interval, argument.value)
                && let ExpressionKind::Time(interval) = value.kind
            {
                let interval = duration::print(interval);
                let name = name.clone();
                self.told.note(at, Kind::TaskRead { name, interval });
            }
        }
        Ok(())
    }
}
