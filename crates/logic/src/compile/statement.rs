//! Statements: what they check, and their instructions with the longest way through them.

use super::emit::Emitter;
use super::expression::{Checker, Read};
use super::tree::{Node, Place};
use super::types::Type;
use super::{Body, CODE_MAX, Compiler, DEPTH_MAX, ITERATIONS_MAX, State};
use crate::arithmetic::Binary;
use crate::block::Block;
use crate::code::{Op, Switch};
use crate::diagnostic::{Kind, Reported, Span};
use crate::scalar::Scalar;
use crate::syntax::{Access, Expression, Label, Name, Section, Statement, StatementKind, UnitKind};
use std::collections::{BTreeMap, BTreeSet};

const BOOL: Type = Type::Scalar(Scalar::Bool);
/// Variables in TO and BY of one loop of which it is told that they are altered inside.
const LIMITS_MAX: usize = 20;

impl Compiler<'_, '_> {
    /// Compiles a unit, unless that is done; `at`: where it is called.
    pub(super) fn body(&mut self, unit: usize, at: Span) -> Read<Body> {
        match self.units[unit].body {
            State::Done(body) => return Ok(body),
            State::Wrong => return Err(Reported),
            State::UnderWay => {
                let name = self.units[unit].name.clone();
                return Err(self.told.error(at, Kind::Recursive { name }));
            }
            State::Untouched if self.depth >= DEPTH_MAX => {
                return Err(self.told.error(at, Kind::TooDeep { most: DEPTH_MAX }));
            }
            State::Untouched => {}
        }
        self.units[unit].body = State::UnderWay;
        self.depth += 1;
        let body = self.compiled(unit);
        self.depth -= 1;
        self.units[unit].body = body.map_or(State::Wrong, State::Done);
        body
    }

    fn compiled(&mut self, unit: usize) -> Read<Body> {
        let interface = self.units[unit].interface == State::Done(());
        let Some(text) = self.units[unit].text else {
            return Err(Reported);
        };
        let mut checker = Checker {
            unit: Some(unit),
            controls: Vec::new(),
            limits: Vec::new(),
            emitter: Emitter::default(),
            is_declaration: false,
            compiler: self,
        };
        checker.initialise(unit)?;
        checker.edges(unit);
        checker.statements(&text.body);
        let emitter = checker.emitter;
        if !interface {
            return Err(Reported);
        }
        if self.code.len() + emitter.ops.len() > CODE_MAX {
            return Err(self.told.error(text.name.at, Kind::Code { most: CODE_MAX }));
        }
        Ok(emitter.finish(self))
    }

    /// Once a file.
    pub(super) fn told_of_falling_edge(&mut self, at: Span) {
        if !std::mem::replace(&mut self.falling_edge_told, true) {
            self.told.note(at, Kind::FirstFallingEdge);
        }
    }
}

impl Checker<'_, '_, '_> {
    /// Variables that are fresh in each call: all of a function but its inputs, VAR_TEMP.
    fn initialise(&mut self, unit: usize) -> Read<()> {
        let own = &self.compiler.units[unit];
        let is_function = own.kind == UnitKind::Function;
        let fresh = own.variables.iter().filter(|variable| {
            let is_own = is_function && variable.section == Section::Local && !variable.constant;
            is_own || variable.section == Section::Temporary
        });
        let fresh: Vec<_> = fresh
            .map(|variable| (variable.offset, variable.ty, variable.at))
            .collect();
        for (offset, ty, at) in fresh {
            let start = offset as usize;
            let size = self.compiler.types.size(ty, &self.compiler.units) as usize;
            let image = self.compiler.units[unit].image[start..start + size].to_vec();
            let template = if ty.is_single() {
                None
            } else {
                Some(self.compiler.memory.allocate(&image, at))
            };
            self.emitter.initialise(offset, ty, &image, template, at);
        }
        Ok(())
    }

    /// Sees the edges of inputs that are R_EDGE or F_EDGE, once a call.
    fn edges(&mut self, unit: usize) {
        let edges = self.compiler.units[unit].variables.iter();
        let edges: Vec<_> = edges
            .filter_map(|variable| Some((variable.edge?, variable.offset, variable.at)))
            .collect();
        for (block, offset, at) in edges {
            if block == Block::FallingEdge {
                self.compiler.told_of_falling_edge(at);
            }
            self.emitter.op(Op::AddressThis(offset), at);
            self.emitter.op(Op::Block(block), at);
        }
    }

    fn statements(&mut self, statements: &[Statement]) {
        let mut assigned = BTreeSet::new();
        for statement in statements {
            // Told at the end of the unit.
            if self.emitter.ops.len() > CODE_MAX {
                return;
            }
            // What is wrong has been told; the next one may be wrong, too.
            let _ = self.statement(statement, &mut assigned);
        }
    }

    fn condition(&mut self, condition: &Expression) -> Read<bool> {
        let node = self.expression_of(condition, BOOL)?;
        self.emitter.node(self.compiler, &node);
        Ok(node.value() == Some(1))
    }

    fn statement(&mut self, statement: &Statement, assigned: &mut BTreeSet<String>) -> Read<()> {
        let at = statement.at;
        match &statement.kind {
            StatementKind::Assign(target, value) => self.assign(target, value, assigned),
            StatementKind::Call(instance, arguments) => self.call(instance, arguments),
            StatementKind::If(branches, otherwise) => {
                let otherwise = otherwise.as_ref().map(|(at, body)| (*at, body.as_slice()));
                self.choice(branches, otherwise)
            }
            StatementKind::Case {
                selector,
                branches,
                otherwise,
            } => self.case(selector, branches, otherwise.as_ref()),
            StatementKind::For {
                control,
                from,
                to,
                by,
                bound,
                body,
            } => {
                let limits = Limits {
                    from,
                    to,
                    by: by.as_ref(),
                    bound: *bound,
                };
                self.count(control, &limits, body, at)
            }
            StatementKind::While { condition, bound, body } => self.while_loop(condition, *bound, body, at),
            StatementKind::Repeat { until, bound, body } => self.repeat_loop(until, *bound, body, at),
            StatementKind::Exit => self.leave("EXIT", at),
            StatementKind::Continue => self.leave("CONTINUE", at),
            StatementKind::Return => {
                let jump = self.emitter.op(Op::Jump(0), at);
                self.emitter.returns.push(jump);
                Ok(())
            }
        }
    }

    fn leave(&mut self, word: &'static str, at: Span) -> Read<()> {
        let jump = self.emitter.op(Op::Jump(0), at);
        let lists = if word == "EXIT" {
            &mut self.emitter.exits
        } else {
            &mut self.emitter.continues
        };
        match lists.last_mut() {
            Some(jumps) => {
                jumps.push(jump);
                Ok(())
            }
            None => self.error(at, Kind::OutsideLoop(word)),
        }
    }

    fn choice(
        &mut self,
        branches: &[(Expression, Vec<Statement>)],
        otherwise: Option<(Span, &[Statement])>,
    ) -> Read<()> {
        let mut ends = Vec::new();
        let mut longest = 0;
        let mut good = Ok(());
        for (index, (condition, body)) in branches.iter().enumerate() {
            let is_true = self.condition(condition);
            let rest = branches.get(index + 1).map(|(next, _)| next.at);
            if let (Ok(true), Some(next)) = (is_true, rest.or(otherwise.map(|(at, _)| at))) {
                self.compiler.told.warning(next, Kind::BranchUnreachable);
            }
            good = good.and(is_true.map(|_| ()));
            let skip = self.emitter.op(Op::JumpUnless(0), condition.at);
            let before = self.emitter.steps;
            self.statements(body);
            ends.push(self.emitter.op(Op::Jump(0), condition.at));
            longest = longest.max(self.emitter.steps);
            self.emitter.steps = before;
            self.emitter.land([skip]);
        }
        if let Some((_, body)) = otherwise {
            self.statements(body);
        }
        self.emitter.steps = longest.max(self.emitter.steps);
        self.emitter.land(ends);
        good
    }

    /// What CASE selects by.
    fn selector(&mut self, selector: &Expression) -> Read<Node> {
        let node = self.typed(selector, None)?;
        match node.ty {
            Type::Enumeration(_) => Ok(node),
            Type::Scalar(scalar) if scalar.is_integer() || scalar.is_bit_string() => Ok(node),
            BOOL => self.error(selector.at, Kind::CaseType),
            _ => self.no_operand("CASE", &node),
        }
    }

    fn case(
        &mut self,
        selector: &Expression,
        branches: &[(Vec<Label>, Vec<Statement>)],
        otherwise: Option<&(Span, Vec<Statement>)>,
    ) -> Read<()> {
        let node = match self.selector(selector) {
            Ok(node) => node,
            // Its statements may be wrong, too.
            Err(Reported) => {
                let bodies = branches.iter().map(|(_, body)| body);
                for body in bodies.chain(otherwise.map(|(_, body)| body)) {
                    self.statements(body);
                }
                return Err(Reported);
            }
        };
        let ty = node.ty;
        self.emitter.node(self.compiler, &node);
        let table = self.emitter.switches.len();
        self.emitter.switches.push(Switch::default());
        self.emitter.op(Op::Switch(table as u32), selector.at);
        let before = self.emitter.steps;
        let (mut longest, mut ends) = (before, Vec::new());
        // By the first value of each range.
        let mut ranges: BTreeMap<i64, (i64, u32)> = BTreeMap::new();
        for (labels, body) in branches {
            let target = self.emitter.here();
            for label in labels {
                // The other labels may be wrong, too.
                if let Ok((first, last)) = self.label(label, ty, &ranges) {
                    ranges.insert(first, (last, target));
                }
            }
            self.emitter.steps = before;
            self.statements(body);
            ends.push(self.emitter.op(Op::Jump(0), selector.at));
            longest = longest.max(self.emitter.steps);
        }
        let all_selected = match ty {
            Type::Enumeration(index) => {
                let values = &self.compiler.types.enumerations[index as usize].values;
                let is_selected = |value: i64| {
                    ranges
                        .range(..=value)
                        .next_back()
                        .is_some_and(|(_, (last, _))| *last >= value)
                };
                values.iter().all(|(_, value)| is_selected(*value))
            }
            _ => false,
        };
        let ranges = ranges.into_iter().map(|(first, (last, target))| (first, last, target));
        let switch = Switch {
            ranges: ranges.collect(),
            otherwise: self.emitter.here(),
        };
        self.emitter.switches[table] = switch;
        self.emitter.steps = before;
        if let Some((at, body)) = otherwise {
            if all_selected {
                self.compiler.told.warning(*at, Kind::ElseUnreachable);
            }
            self.statements(body);
        }
        self.emitter.steps = self.emitter.steps.max(longest);
        self.emitter.land(ends);
        Ok(())
    }

    /// First and last value of a label, which are none of those above.
    fn label(&mut self, label: &Label, ty: Type, above: &BTreeMap<i64, (i64, u32)>) -> Read<(i64, i64)> {
        let first = self.constant_value(&label.first, ty)?;
        let at = label
            .last
            .as_ref()
            .map_or(label.first.at, |last| label.first.at.to(last.at));
        let last = match &label.last {
            Some(last) => self.constant_value(last, ty)?,
            None => first,
        };
        if last < first {
            return self.error(at, Kind::LabelRange);
        }
        // The nearest one above is enough, for these do not overlap each other.
        if let Some((other, (end, _))) = above.range(..=last).next_back()
            && *end >= first
        {
            let value = (*other).max(first).to_string();
            return self.error(at, Kind::LabelTwice { value });
        }
        Ok((first, last))
    }

    /// Statements of a loop; its jumps to the next iteration end behind them. Steps of one iteration.
    fn iteration(&mut self, body: &[Statement], land_continues: bool) -> u64 {
        let before = self.emitter.steps;
        self.emitter.exits.push(Vec::new());
        self.emitter.continues.push(Vec::new());
        self.statements(body);
        if land_continues {
            let continues = self
                .emitter
                .continues
                .last_mut()
                .map(std::mem::take)
                .unwrap_or_default();
            self.emitter.land(continues);
        }
        self.emitter.steps - before
    }

    /// The end of a loop whose last instructions jumped; `top`: where CONTINUE goes that has not landed.
    fn end_of_loop(&mut self, exit: impl IntoIterator<Item = usize>, top: u32) {
        for jump in self.emitter.continues.pop().unwrap_or_default() {
            if let Some(target) = self.emitter.ops[jump].target() {
                *target = top;
            }
        }
        let exits = self.emitter.exits.pop().unwrap_or_default();
        self.emitter.land(exits);
        self.emitter.land(exit);
    }

    /// Remembers a loop whose bound is missing, and the steps since `before`, which are all that it takes.
    fn note_bound(&mut self, bound: Option<u32>, at: Span, before: u64) {
        if bound.is_none() {
            self.compiler.unbound.push((at, self.emitter.steps - before));
        }
    }

    /// A slot with the iterations that are left.
    fn iterations_left(&mut self, bound: Option<u32>, at: Span) -> u32 {
        let bound = bound.unwrap_or(ITERATIONS_MAX);
        let slot = self.compiler.memory.allocate(&[0], at);
        self.emitter.op(Op::Push(i64::from(bound)), at);
        self.emitter.op(Op::Store(slot), at);
        slot
    }

    fn while_loop(&mut self, condition: &Expression, bound: Option<u32>, body: &[Statement], at: Span) -> Read<()> {
        let slot = self.iterations_left(bound, at);
        let top = self.emitter.here();
        let before = self.emitter.steps;
        let good = self.condition(condition).map(|_| ());
        let end = self.emitter.op(Op::JumpUnless(0), condition.at);
        let guard = self.emitter.op(Op::Guard { slot, exit: 0 }, at);
        let check = self.emitter.steps - before;
        let body = self.iteration(body, false);
        self.emitter.op(Op::Jump(top), at);
        let iterations = u64::from(bound.unwrap_or(ITERATIONS_MAX));
        let most = check
            .saturating_mul(iterations + 1)
            .saturating_add((body + 1).saturating_mul(iterations));
        self.emitter.steps = before.saturating_add(most);
        self.note_bound(bound, at, before);
        self.end_of_loop([end, guard], top);
        good
    }

    fn repeat_loop(&mut self, until: &Expression, bound: Option<u32>, body: &[Statement], at: Span) -> Read<()> {
        let slot = self.iterations_left(bound, at);
        let top = self.emitter.here();
        let before = self.emitter.steps;
        let guard = self.emitter.op(Op::Guard { slot, exit: 0 }, at);
        self.iteration(body, true);
        let good = self.condition(until).map(|_| ());
        self.emitter.op(Op::JumpUnless(top), until.at);
        let once = self.emitter.steps - before;
        self.emitter.steps = before
            .saturating_add(once.saturating_mul(u64::from(bound.unwrap_or(ITERATIONS_MAX))))
            .saturating_add(1);
        self.note_bound(bound, at, before);
        self.end_of_loop([guard], top);
        good
    }

    /// The control variable of FOR; from, to, by.
    fn count_head(&mut self, access: &Access, limits: &Limits<'_>) -> Read<(Place, [Node; 3])> {
        let place = self.control(access)?;
        let ty = place.ty;
        let (from, to) = (self.expression_of(limits.from, ty), self.expression_of(limits.to, ty));
        let by = match limits.by {
            Some(by) => self.expression_of(by, ty)?,
            None => Node::constant(ty, 1, access.at),
        };
        if by.value() == Some(0) {
            return self.error(by.at, Kind::StepZero);
        }
        Ok((place, [from?, to?, by]))
    }

    fn count(&mut self, control: &Name, limits: &Limits<'_>, body: &[Statement], at: Span) -> Read<()> {
        let access = Access {
            name: control.clone(),
            steps: Vec::new(),
            at: control.at,
        };
        let head = self.count_head(&access, limits);
        let Ok((place, [from, to, by])) = head else {
            // Its statements may be wrong, too.
            let top = self.emitter.here();
            self.controls.push(control.key());
            self.iteration(body, true);
            self.controls.pop();
            self.end_of_loop([], top);
            return Err(Reported);
        };
        let scalar = place.ty.scalar().unwrap_or(Scalar::Dint);
        self.store(&place, &from);
        let bound = limits.bound.unwrap_or(ITERATIONS_MAX);
        // What is left of the loop, its step, what is left of its bound.
        let slot = self.compiler.memory.allocate(&[0, 0, 0], at);
        let step = Op::Load(slot + 1);
        let known = from.value().zip(to.value()).zip(by.value());
        let (step, most) = if let Some(((from, to), by)) = known {
            let (from, to) = (scalar.number(from), scalar.number(to));
            let way = if by > 0 { to - from } else { from - to };
            // Up to all values of a type of 64 bits.
            let count = if way < 0 {
                0
            } else {
                u64::try_from(way / i128::from(by).abs() + 1).unwrap_or(u64::MAX)
            };
            let count = count.min(i64::MAX as u64);
            self.emitter.op(Op::Push(count as i64), at);
            (Op::Push(by), count)
        } else {
            let step = match by.value() {
                Some(value) => Op::Push(value),
                None => {
                    self.emitter.node(self.compiler, &by);
                    self.emitter.op(Op::Store(slot + 1), by.at);
                    step
                }
            };
            self.emitter.load(self.compiler, &place);
            self.emitter.node(self.compiler, &to);
            self.emitter.op(step, by.at);
            self.emitter.op(Op::Iterations(scalar), at);
            (step, u64::from(bound))
        };
        self.emitter.op(Op::Store(slot), at);
        if known.is_none() {
            self.emitter.op(Op::Push(i64::from(bound)), at);
            self.emitter.op(Op::Store(slot + 2), at);
        }
        let mut exits = vec![self.emitter.op(Op::Count { slot, exit: 0 }, at)];
        let top = self.emitter.here();
        let before = self.emitter.steps;
        if known.is_none() {
            let (slot, exit) = (slot + 2, 0);
            exits.push(self.emitter.op(Op::Guard { slot, exit }, at));
        }
        self.controls.push(control.key());
        let around = self.limits.len();
        for limit in [Some(limits.to), limits.by].into_iter().flatten() {
            limit.reads(&mut self.limits, around + LIMITS_MAX);
        }
        self.iteration(body, true);
        self.limits.truncate(around);
        self.controls.pop();
        // Behind the last iteration, too: programs see by it that the loop ran to its end.
        let compiler = &*self.compiler;
        self.emitter.store(compiler, &place, |emitter| {
            emitter.load(compiler, &place);
            emitter.op(step, at);
            emitter.op(Op::Binary(Binary::Advance, scalar), at);
        });
        exits.push(self.emitter.op(Op::Count { slot, exit: 0 }, at));
        self.emitter.op(Op::Jump(top), at);
        let once = self.emitter.steps - before;
        // Where the bound ends the loop, its guard is passed once more.
        self.emitter.steps = before.saturating_add(once.saturating_mul(most)).saturating_add(1);
        if known.is_none() {
            self.note_bound(limits.bound, at, before);
        }
        self.end_of_loop(exits, top);
        Ok(())
    }
}

/// What stands in the head of FOR.
struct Limits<'s> {
    from: &'s Expression,
    to: &'s Expression,
    by: Option<&'s Expression>,
    bound: Option<u32>,
}
