//! Checked expressions to instructions, and what they cost.

use super::tree::{Base, Node, NodeKind, Place};
use super::types::Type;
use super::{Body, Compiler};
use crate::code::{Op, Switch};
use crate::diagnostic::Span;

/// Instructions of one unit. Jumps go to its own instructions, counted from 0.
#[derive(Debug, Default)]
pub(super) struct Emitter {
    pub(super) ops: Vec<Op>,
    places: Vec<u32>,
    pub(super) switches: Vec<Switch>,
    /// Steps of the longest way to here.
    pub(super) steps: u64,
    /// Values on the stack here, and at most.
    depth: i64,
    most: i64,
    nesting: usize,
    /// Jumps that leave the loops around, to behind the loop and to its next iteration; the innermost loop is the last one.
    pub(super) exits: Vec<Vec<usize>>,
    pub(super) continues: Vec<Vec<usize>>,
    pub(super) returns: Vec<usize>,
}

impl Emitter {
    /// One instruction; its place.
    pub(super) fn op(&mut self, op: Op, at: Span) -> usize {
        self.depth += op.grows();
        self.most = self.most.max(self.depth);
        self.steps = self.steps.saturating_add(op.steps());
        self.ops.push(op);
        self.places.push(at.start);
        self.ops.len() - 1
    }

    pub(super) fn here(&self) -> u32 {
        self.ops.len() as u32
    }

    /// Lets jumps end here.
    pub(super) fn land(&mut self, jumps: impl IntoIterator<Item = usize>) {
        let here = self.here();
        for jump in jumps {
            if let Some(target) = self.ops[jump].target() {
                *target = here;
            }
        }
    }

    /// A call of another unit, whose address is on the stack.
    pub(super) fn call(&mut self, body: Body, at: Span) {
        self.op(Op::Call(body.entry), at);
        self.steps = self.steps.saturating_add(body.steps);
        self.most = self.most.max(self.depth + body.stack as i64);
        self.nesting = self.nesting.max(1 + body.nesting);
    }

    /// A place as an address.
    pub(super) fn address(&mut self, compiler: &Compiler<'_, '_>, place: &Place) {
        let at = place.at;
        match place.base {
            Base::Global => self.op(Op::Address(place.offset), at),
            Base::This => self.op(Op::AddressThis(place.offset), at),
            Base::GlobalReference(slot) => self.op(Op::Load(slot), at),
            Base::ThisReference(slot) => self.op(Op::LoadThis(slot), at),
        };
        if matches!(place.base, Base::GlobalReference(_) | Base::ThisReference(_)) && place.offset > 0 {
            self.op(Op::Offset(place.offset), at);
        }
        for index in &place.indices {
            self.node(compiler, &index.value);
            let (low, length, stride) = (index.low, index.length, index.stride);
            self.op(Op::Index { low, length, stride }, index.value.at);
        }
    }

    /// The value at a place; of something that is more than one value its address.
    pub(super) fn load(&mut self, compiler: &Compiler<'_, '_>, place: &Place) {
        let at = place.at;
        match place.base {
            _ if !place.ty.is_single() => self.address(compiler, place),
            Base::Global if place.indices.is_empty() => {
                self.op(Op::Load(place.offset), at);
            }
            Base::This if place.indices.is_empty() => {
                self.op(Op::LoadThis(place.offset), at);
            }
            _ => {
                self.address(compiler, place);
                self.op(Op::LoadAt, at);
            }
        }
    }

    /// Puts what `value` emits to a place.
    pub(super) fn store(&mut self, compiler: &Compiler<'_, '_>, place: &Place, value: impl FnOnce(&mut Self)) {
        let at = place.at;
        match place.base {
            _ if !place.ty.is_single() => {
                self.address(compiler, place);
                value(self);
                let size = compiler.types.size(place.ty, &compiler.units);
                self.op(Op::Copy(size), at);
            }
            Base::Global if place.indices.is_empty() => {
                value(self);
                self.op(Op::Store(place.offset), at);
            }
            Base::This if place.indices.is_empty() => {
                value(self);
                self.op(Op::StoreThis(place.offset), at);
            }
            _ => {
                self.address(compiler, place);
                value(self);
                self.op(Op::StoreAt, at);
            }
        }
    }

    /// The value of an expression.
    pub(super) fn node(&mut self, compiler: &Compiler<'_, '_>, node: &Node) {
        let at = node.at;
        match &node.kind {
            NodeKind::Constant(value) => {
                self.op(Op::Push(*value), at);
            }
            // A literal that no type was found for has been told.
            NodeKind::Integer(_) | NodeKind::Real(_) => {
                self.op(Op::Push(0), at);
            }
            NodeKind::Load(place) => self.load(compiler, place),
            NodeKind::Unary(operation, scalar, operand) => {
                self.node(compiler, operand);
                self.op(Op::Unary(*operation, *scalar), at);
            }
            NodeKind::Binary(operation, scalar, left, right) => {
                self.node(compiler, left);
                self.node(compiler, right);
                self.op(Op::Binary(*operation, *scalar), at);
            }
            NodeKind::Convert(from, to, operand) => {
                self.node(compiler, operand);
                self.op(Op::Convert(*from, *to), at);
            }
            NodeKind::Cut(length, operand) => {
                self.node(compiler, operand);
                self.op(Op::Cut(*length), at);
            }
            NodeKind::Rank(operand) => {
                self.node(compiler, operand);
                self.op(Op::Rank, at);
            }
            NodeKind::Row(operation, scalar, operands) => {
                operands.iter().for_each(|operand| self.node(compiler, operand));
                self.op(Op::Row(*operation, *scalar, operands.len() as u32), at);
            }
            NodeKind::AndThen(left, right) => {
                self.node(compiler, left);
                let to_false = self.op(Op::JumpUnless(0), at);
                self.node(compiler, right);
                let end = self.op(Op::Jump(0), at);
                self.land([to_false]);
                self.depth -= 1;
                self.op(Op::Push(0), at);
                self.land([end]);
            }
            NodeKind::OrElse(left, right) => {
                self.node(compiler, left);
                let to_right = self.op(Op::JumpUnless(0), at);
                self.op(Op::Push(1), at);
                let end = self.op(Op::Jump(0), at);
                self.land([to_right]);
                self.depth -= 1;
                self.node(compiler, right);
                self.land([end]);
            }
            NodeKind::Select(operands) => {
                operands.iter().for_each(|operand| self.node(compiler, operand));
                self.op(Op::Select, at);
            }
            NodeKind::Choose(operands) => {
                operands.iter().for_each(|operand| self.node(compiler, operand));
                self.op(Op::Choose(operands.len() as u32 - 1), at);
            }
            NodeKind::Call(unit, arguments) => self.function(compiler, *unit, arguments, node),
        }
    }

    /// A call of a function: all arguments are on the stack before the first one goes to its input, for among them may be calls
    /// of the same function.
    fn function(&mut self, compiler: &Compiler<'_, '_>, unit: usize, arguments: &[(u32, Node)], node: &Node) {
        let at = node.at;
        let called = &compiler.units[unit];
        for (offset, argument) in arguments {
            if !argument.ty.is_single() {
                self.op(Op::Address(called.frame + offset), argument.at);
            }
            self.node(compiler, argument);
        }
        for (offset, argument) in arguments.iter().rev() {
            let size = compiler.types.size(argument.ty, &compiler.units);
            let op = if argument.ty.is_single() {
                Op::Store(called.frame + offset)
            } else {
                Op::Copy(size)
            };
            self.op(op, argument.at);
        }
        if let super::State::Done(body) = called.body {
            self.op(Op::Address(called.frame), at);
            self.call(body, at);
        }
        let result = called.by_name.get(&crate::syntax::key(&called.name));
        let result = result.map_or(0, |index| called.variables[*index].offset);
        self.op(Op::Load(called.frame + result), at);
    }

    /// Values of a variable at the start of a call.
    pub(super) fn initialise(&mut self, offset: u32, ty: Type, image: &[i64], template: Option<u32>, at: Span) {
        match (template, image) {
            (None, [value]) if ty.is_single() => {
                self.op(Op::Push(*value), at);
                self.op(Op::StoreThis(offset), at);
            }
            (template, image) => {
                self.op(Op::AddressThis(offset), at);
                self.op(Op::Address(template.unwrap_or(0)), at);
                self.op(Op::Copy(image.len() as u32), at);
            }
        }
    }

    /// Puts the instructions behind those of other units.
    pub(super) fn finish(mut self, compiler: &mut Compiler<'_, '_>) -> Body {
        let returns = std::mem::take(&mut self.returns);
        self.land(returns);
        self.op(Op::Return, Span::default());
        let entry = compiler.code.len() as u32;
        let first_switch = compiler.switches.len() as u32;
        for mut op in self.ops {
            if let Some(target) = op.target() {
                *target += entry;
            }
            if let Op::Switch(table) = &mut op {
                *table += first_switch;
            }
            compiler.code.push(op);
        }
        for mut switch in self.switches {
            switch.otherwise += entry;
            switch.ranges.iter_mut().for_each(|(.., target)| *target += entry);
            compiler.switches.push(switch);
        }
        compiler.places.extend(self.places);
        Body {
            entry,
            steps: self.steps,
            stack: self.most.max(0) as usize,
            nesting: self.nesting,
        }
    }
}
