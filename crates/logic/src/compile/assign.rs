//! What may be assigned, and what is.

use super::expression::{Checker, Read};
use super::tree::{Base, Node, NodeKind, Place};
use super::types::Type;
use crate::diagnostic::{Kind, Span};
use crate::syntax::{Access, Expression, ExpressionKind, Section, Step};
use std::collections::BTreeSet;

impl Checker<'_, '_, '_> {
    /// A place that is assigned.
    pub(super) fn target(&mut self, access: &Access) -> Read<Place> {
        let place = self.place(access)?;
        if self.controls.contains(&access.name.key()) {
            let name = access.name.text.clone();
            return self.error(access.at, Kind::ControlAssigned { name });
        }
        if let Some(what) = place.read_only {
            let name = place.name;
            return self.error(access.at, Kind::ReadOnly { name, what });
        }
        if let Some(found) = self.find(&access.name) {
            self.found(found).assigned = true;
        }
        self.told_of_limit(access);
        Ok(place)
    }

    /// What TO or BY of a loop around reads and is altered in it: others work it out before each iteration.
    pub(super) fn told_of_limit(&mut self, access: &Access) {
        if self.limits.iter().any(|limit| overlaps(limit, access)) {
            let name = access.name.text.clone();
            self.compiler.told.warning(access.at, Kind::LimitAltered { name });
        }
    }

    /// `target := value;`
    pub(super) fn assign(&mut self, target: &Access, value: &Expression, assigned: &mut BTreeSet<String>) -> Read<()> {
        let place = self.target(target);
        let expected = place.as_ref().ok().map(|place| place.ty);
        let node = self.expression(value, expected);
        let (place, node) = (place?, node?);
        let node = self.coerce(node, place.ty)?;
        self.told_once(target, assigned);
        self.store(&place, &node);
        Ok(())
    }

    /// An output that is assigned twice in one list of statements.
    fn told_once(&mut self, target: &Access, assigned: &mut BTreeSet<String>) {
        let Some(found) = self.find(&target.name).filter(|_| target.steps.is_empty()) else {
            return;
        };
        let variable = self.found(found);
        let is_output = variable.section == Section::Output || variable.address.is_some();
        if is_output && !assigned.insert(target.name.key()) {
            let name = target.name.text.clone();
            self.compiler.told.warning(target.at, Kind::AssignedTwice { name });
        }
    }

    pub(super) fn store(&mut self, place: &Place, node: &Node) {
        let compiler = &*self.compiler;
        let emitter = &mut self.emitter;
        emitter.store(compiler, place, |emitter| emitter.node(compiler, node));
    }

    /// A place that is read.
    pub(super) fn read(place: Place, at: Span) -> Node {
        Node {
            ty: place.ty,
            at,
            kind: NodeKind::Load(Box::new(place)),
        }
    }

    /// The control variable of FOR: an integer of the unit or of VAR_GLOBAL that may be assigned.
    pub(super) fn control(&mut self, access: &Access) -> Read<Place> {
        let place = self.target(access)?;
        // One that is passed by reference may be counted by two loops at once.
        let is_own = matches!(place.base, Base::This | Base::Global);
        let is_integer = matches!(place.ty, Type::Scalar(scalar) if scalar.is_integer());
        if !is_own || !is_integer || !access.steps.is_empty() {
            return self.error(access.at, Kind::ControlVariable);
        }
        Ok(place)
    }
}

/// Whether two may be the same, or one a part of the other.
fn overlaps(one: &Access, other: &Access) -> bool {
    let number = |index: &Expression| match index.kind {
        ExpressionKind::Integer(value) => Some(value),
        _ => None,
    };
    let is_other = |(one, other): (&Step, &Step)| match (one, other) {
        (Step::Member(one), Step::Member(other)) => one.key() != other.key(),
        (Step::Index(one, _), Step::Index(other, _)) => {
            let mut pairs = one.iter().map(number).zip(other.iter().map(number));
            pairs.any(|(one, other)| one.is_some() && other.is_some() && one != other)
        }
        _ => false,
    };
    one.name.key() == other.name.key() && !one.steps.iter().zip(&other.steps).any(is_other)
}
