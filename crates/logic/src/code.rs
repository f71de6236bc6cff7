//! Instructions of a compiled program.

use crate::arithmetic::{Binary, Unary};
use crate::block::Block;
use crate::scalar::Scalar;

/// An address behind any memory: what is read there is 0, what is written there is lost.
pub(crate) const NOWHERE: i64 = 1 << 62;

/// One step. Values come from a stack and go to it; `this` is the first slot of what is running: program, function, instance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Op {
    Push(i64),
    /// From a slot; from a slot of `this`; from the address on the stack.
    Load(u32),
    LoadThis(u32),
    LoadAt,
    Store(u32),
    StoreThis(u32),
    /// [address, value]
    StoreAt,
    /// The address of a slot; of one of `this`.
    Address(u32),
    AddressThis(u32),
    /// [address] to that so many slots behind.
    Offset(u32),
    /// [address, index] to the address of an element.
    Index {
        low: i32,
        length: u32,
        stride: u32,
    },
    /// [target, source]: so many slots.
    Copy(u32),
    Unary(Unary, Scalar),
    Binary(Binary, Scalar),
    Convert(Scalar, Scalar),
    /// [number of a text] to that of its first so many characters.
    Cut(u32),
    /// [number of a text] to its place in the order of all.
    Rank,
    /// [values] to whether each stands so to the next one.
    Row(Binary, Scalar, u32),
    /// [selector, value for FALSE, value for TRUE]
    Select,
    /// [selector, values]
    Choose(u32),
    Jump(u32),
    JumpUnless(u32),
    /// [selector]: to the branch of this table.
    Switch(u32),
    /// [from, to, by] to the iterations of a loop over values of a type.
    Iterations(Scalar),
    /// One from the slot, or to the exit if nothing is left.
    Count {
        slot: u32,
        exit: u32,
    },
    /// The same; that nothing is left is wrong.
    Guard {
        slot: u32,
        exit: u32,
    },
    /// [address of what runs]
    Call(u32),
    /// [address of the instance]
    Block(Block),
    Return,
}

impl Op {
    /// How many values are on the stack behind it, less those before.
    pub(crate) fn grows(self) -> i64 {
        match self {
            Op::Push(_) | Op::Load(_) | Op::LoadThis(_) | Op::Address(_) | Op::AddressThis(_) => 1,
            Op::LoadAt | Op::Offset(_) | Op::Unary(..) | Op::Convert(..) | Op::Cut(_) | Op::Rank => 0,
            Op::Jump(_) | Op::Count { .. } | Op::Guard { .. } | Op::Return => 0,
            Op::Store(_) | Op::StoreThis(_) | Op::Index { .. } | Op::Binary(..) => -1,
            Op::JumpUnless(_) | Op::Switch(_) | Op::Call(_) | Op::Block(_) => -1,
            Op::StoreAt | Op::Copy(_) | Op::Select | Op::Iterations(..) => -2,
            Op::Choose(values) => -i64::from(values),
            Op::Row(.., values) => 1 - i64::from(values),
        }
    }

    /// Steps that it counts.
    pub(crate) fn steps(self) -> u64 {
        match self {
            Op::Copy(slots) => 1 + u64::from(slots),
            Op::Row(.., values) => u64::from(values),
            _ => 1,
        }
    }

    /// The target of a jump.
    pub(crate) fn target(&mut self) -> Option<&mut u32> {
        match self {
            Op::Jump(target) | Op::JumpUnless(target) => Some(target),
            Op::Count { exit, .. } | Op::Guard { exit, .. } => Some(exit),
            _ => None,
        }
    }
}

/// Branches of CASE.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Switch {
    /// First and last value, and the instruction they lead to; ordered by value.
    pub(crate) ranges: Vec<(i64, i64, u32)>,
    pub(crate) otherwise: u32,
}

impl Switch {
    /// RT: no allocation, no locks, bounded.
    pub(crate) fn target(&self, value: i64) -> u32 {
        let behind = self.ranges.partition_point(|(first, ..)| *first <= value);
        match self.ranges.get(behind.wrapping_sub(1)) {
            Some((_, last, target)) if value <= *last => *target,
            _ => self.otherwise,
        }
    }
}
