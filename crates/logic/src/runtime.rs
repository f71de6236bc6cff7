//! Runs a compiled program, one scan after the other.
//!
//! In:  values of inputs, the time of the scan.
//! Out: values of outputs, and what went wrong.
//!
//! RT: a scan neither allocates nor locks, makes no system call, and ends within [`Logic::steps_max`] steps.

use crate::arithmetic::{Flags, binary, convert, unary};
use crate::code::{NOWHERE, Op};
use crate::logic::{Logic, Variable};
use crate::value::Value;
use std::fmt;
use std::sync::Arc;

/// What can go wrong while a program runs. Each has a result nevertheless, and the scan goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrong {
    /// The result is 0.
    DivisionByZero,
    /// SQRT of a negative number and the like: the result is 0.
    NoNumber,
    /// A REAL or LREAL beyond its range: the result is the greatest number, or the least.
    RealRange,
    /// What is read is 0, what is written is lost, a block is not called.
    Index,
    /// MUX with a selector that is no place of its inputs: the result is 0.
    Selector,
    /// A BCD of something else than decimal digits, or a number that has more of them than there is room for: the result is 0.
    Bcd,
    /// BY 0: the loop is left out.
    StepZero,
    /// The loop ends.
    Iterations,
    /// The scan ends: a mistake of this compiler, for the longest scan is counted.
    Steps,
}

impl Wrong {
    /// All of them.
    pub const ALL: [Wrong; 9] = [
        Wrong::DivisionByZero,
        Wrong::NoNumber,
        Wrong::RealRange,
        Wrong::Index,
        Wrong::Selector,
        Wrong::Bcd,
        Wrong::StepZero,
        Wrong::Iterations,
        Wrong::Steps,
    ];
}

impl fmt::Display for Wrong {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Wrong::Steps => "the scan has more steps than were counted, and ends",
            Wrong::DivisionByZero => "division by zero: the result is 0",
            Wrong::NoNumber => "SQRT, LN, LOG, ASIN, ACOS or ** has no result for this: it is 0",
            Wrong::RealRange => "the result is beyond the range of its type, and stays at its end",
            Wrong::Index => "an index is out of its array: 0 is read, nothing is written",
            Wrong::Selector => "MUX has no input of this number: the result is 0",
            Wrong::Bcd => "these are no decimal digits (BCD), or there is no room for them: the result is 0",
            Wrong::StepZero => "the step of the loop is 0: it is left out",
            Wrong::Iterations => {
                "the loop has more iterations than it is bound to, and ends: {max_iterations := n} sets more"
            }
        })
    }
}

/// Something that went wrong, and where.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fault {
    /// What.
    pub wrong: Wrong,
    /// Line of the program, counted from 1.
    pub line: u32,
    /// Character in the line, counted from 1.
    pub column: u32,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}: {}", self.line, self.column, self.wrong)
    }
}

/// A program that runs: its memory, and what went wrong so far.
#[derive(Clone, Debug)]
pub struct Runtime {
    logic: Arc<Logic>,
    memory: Box<[i64]>,
    stack: Box<[i64]>,
    /// Where calls go back to, and what ran there.
    calls: Box<[(u32, u32)]>,
    fault: Option<Fault>,
    faults: u64,
    overflows: u64,
    time_ns: i64,
}

impl Runtime {
    /// At its initial values; the first scan is yet to come.
    pub fn new(logic: Arc<Logic>) -> Runtime {
        Runtime {
            memory: logic.memory.clone(),
            stack: vec![0; logic.stack].into(),
            calls: vec![(0, 0); logic.nesting].into(),
            logic,
            fault: None,
            faults: 0,
            overflows: 0,
            time_ns: 0,
        }
    }

    /// What runs.
    pub fn logic(&self) -> &Arc<Logic> {
        &self.logic
    }

    /// The first thing that went wrong since the start or [`Runtime::clear_fault`].
    pub fn fault(&self) -> Option<Fault> {
        self.fault
    }

    /// Times that something went wrong.
    pub fn faults(&self) -> u64 {
        self.faults
    }

    /// Results of integers that did not fit into their type and wrapped, and conversions that ended at the end of a range.
    pub fn overflows(&self) -> u64 {
        self.overflows
    }

    /// Forgets what went wrong; variables stay as they are.
    pub fn clear_fault(&mut self) {
        self.fault = None;
    }

    /// The value of a variable of this program.
    pub fn get(&self, variable: &Variable) -> Value<'_> {
        let slot = self.memory.get(variable.slot as usize).copied().unwrap_or(0);
        self.logic.value(variable, slot)
    }

    /// Gives a variable a value; `false`: it is none of its type, and nothing changes.
    ///
    /// RT: no allocation, no locks, bounded.
    pub fn set(&mut self, variable: &Variable, value: Value<'_>) -> bool {
        let slot = self.logic.slot_value(variable, value);
        match (slot, self.memory.get_mut(variable.slot as usize)) {
            (Some(value), Some(slot)) => {
                *slot = value;
                true
            }
            _ => false,
        }
    }

    /// Takes over what another program remembers, one that runs until now: RETAIN variables or all, by name and type.
    /// Edges and timers go on, for blocks are taken over with what they remember: time must go on, too, from
    /// [`Runtime::time_ns`] of the other one. Says how many variables were taken.
    pub fn take_over(&mut self, before: &Runtime, only_retained: bool) -> usize {
        let same = self.logic.same_variables(&before.logic, only_retained);
        self.carry(before, &same);
        same.len()
    }

    /// As [`Runtime::take_over`], of variables that [`Logic::same_variables`] has found before.
    ///
    /// RT: no allocation, no locks, bounded by the number of variables.
    pub fn carry(&mut self, before: &Runtime, same: &[(usize, usize)]) {
        for (old, new) in same {
            if let (Some(value), Some(slot)) = (before.memory.get(*old), self.memory.get_mut(*new)) {
                *slot = *value;
            }
        }
    }

    /// Begins anew: all variables have their values of the start but those that are RETAIN.
    ///
    /// RT: no allocation, no locks, bounded by the number of variables.
    pub fn restart(&mut self) {
        let Runtime { logic, memory, .. } = self;
        let mut retained = logic.retained.iter().peekable();
        for (place, (slot, initial)) in memory.iter_mut().zip(&logic.memory).enumerate() {
            if retained.next_if(|retained| **retained as usize == place).is_none() {
                *slot = *initial;
            }
        }
        self.fault = None;
    }

    /// All values, each at its [`Variable::place`]; [`Logic::value`] says what they are.
    pub fn memory(&self) -> &[i64] {
        &self.memory
    }

    /// Puts a value to a place, as [`Logic::slot_value`] gives it.
    ///
    /// RT: no allocation, no locks, bounded.
    pub fn put(&mut self, place: usize, value: i64) {
        if let Some(slot) = self.memory.get_mut(place) {
            *slot = value;
        }
    }

    /// The time of the last scan; 0: there was none.
    pub fn time_ns(&self) -> i64 {
        self.time_ns
    }

    /// One scan: all programs once, in the order of the file. All blocks see this time, which must not go back. Steps that it took.
    ///
    /// RT: no allocation, no locks, bounded by [`Logic::steps_max`].
    pub fn scan(&mut self, now_ns: i64) -> u64 {
        self.scan_within(now_ns, self.logic.steps_max)
    }

    /// The same, which ends behind so many steps, wherever it is then: to see what steps take. What it has left half done makes this
    /// no program to control anything with.
    pub fn scan_within(&mut self, now_ns: i64, steps_max: u64) -> u64 {
        let Runtime {
            logic,
            memory,
            stack,
            calls,
            ..
        } = self;
        let mut machine = Machine { memory, stack, top: 0 };
        let mut flags = Flags::default();
        let (mut steps, mut at, mut this, mut depth) = (0_u64, logic.entry, 0_u32, 0_usize);
        let (mut fault, mut faults) = (None, 0_u64);
        while let Some(op) = logic.code.get(at as usize) {
            // Never more than were counted when it was compiled: the count bounds the scan whatever the code is.
            steps += op.steps();
            let here = at;
            if steps > steps_max {
                flags.wrong = Some(Wrong::Steps);
            }
            at += 1;
            match *op {
                _ if flags.wrong.is_some() => at = u32::MAX,
                Op::Push(value) => machine.push(value),
                Op::Load(slot) => machine.push(machine.read(i64::from(slot))),
                Op::LoadThis(offset) => machine.push(machine.read(i64::from(this) + i64::from(offset))),
                Op::LoadAt => machine.load_at(),
                Op::Store(slot) => machine.store(i64::from(slot)),
                Op::StoreThis(offset) => machine.store(i64::from(this) + i64::from(offset)),
                Op::StoreAt => machine.store_at(),
                Op::Address(slot) => machine.push(i64::from(slot)),
                Op::AddressThis(offset) => machine.push(i64::from(this) + i64::from(offset)),
                Op::Offset(offset) => machine.replace(|address| address.saturating_add(i64::from(offset))),
                Op::Index { low, length, stride } => machine.index(low, length, stride, &mut flags),
                Op::Copy(slots) => machine.copy(slots),
                Op::Unary(operation, scalar) => machine.replace(|a| unary(operation, scalar, a, &mut flags)),
                Op::Binary(operation, scalar) => {
                    let b = machine.pop();
                    machine.replace(|a| binary(operation, scalar, a, b, &mut flags));
                }
                Op::Convert(from, to) => machine.replace(|a| convert(from, to, a, &mut flags)),
                Op::Cut(length) => machine.replace(|text| logic.cut(text, length)),
                Op::Rank => machine.replace(|text| logic.rank(text)),
                Op::Row(operation, scalar, values) => {
                    let holds = |a, b| binary(operation, scalar, a, b, &mut flags) != 0;
                    let holds = machine.row(values, holds);
                    machine.push(i64::from(holds));
                }
                Op::Select => {
                    let b = machine.pop();
                    let a = machine.pop();
                    machine.replace(|selector| if selector != 0 { b } else { a });
                }
                Op::Choose(values) => {
                    let value = machine.choose(values);
                    machine.push_or(value, Wrong::Selector, &mut flags);
                }
                Op::Jump(target) => at = target,
                Op::JumpUnless(target) => {
                    if machine.pop() == 0 {
                        at = target;
                    }
                }
                Op::Switch(table) => {
                    let value = machine.pop();
                    at = logic
                        .switches
                        .get(table as usize)
                        .map_or(at, |table| table.target(value));
                }
                Op::Iterations(scalar) => {
                    let by = machine.pop();
                    let to = scalar.number(machine.pop());
                    let from = scalar.number(machine.pop());
                    let count = iterations(from, to, scalar.number(by));
                    machine.push_or(count, Wrong::StepZero, &mut flags);
                }
                Op::Count { slot, exit } | Op::Guard { slot, exit } => {
                    let left = machine.read(i64::from(slot));
                    machine.write(i64::from(slot), left.saturating_sub(1));
                    if left <= 0 {
                        at = exit;
                        if let Op::Guard { .. } = op {
                            flags.wrong = Some(Wrong::Iterations);
                        }
                    }
                }
                Op::Call(target) => {
                    if let Some(call) = calls.get_mut(depth) {
                        let address = machine.pop();
                        // An instance that an index does not reach is not called.
                        if let Ok(address) = u32::try_from(address) {
                            *call = (at, this);
                            depth += 1;
                            (at, this) = (target, address);
                        }
                    }
                }
                Op::Block(block) => block.call(machine.instance(), now_ns),
                Op::Return => match depth.checked_sub(1).and_then(|last| Some((last, calls.get(last)?))) {
                    Some((last, call)) => {
                        depth = last;
                        (at, this) = *call;
                    }
                    None => break,
                },
            }
            if let Some(wrong) = flags.wrong.take() {
                faults += 1;
                let (line, column) = logic.places.get(here as usize).copied().unwrap_or_default();
                fault = fault.or(Some(Fault { wrong, line, column }));
            }
        }
        self.fault = self.fault.or(fault);
        self.faults += faults;
        self.overflows += flags.overflows;
        self.time_ns = now_ns;
        steps
    }
}

/// Iterations of FOR; `None`: its step is 0.
fn iterations(from: i128, to: i128, by: i128) -> Option<i64> {
    let way = if by >= 0 { to - from } else { from - to };
    let count = if way < 0 {
        Some(0)
    } else {
        way.checked_div(by.abs()).map(|steps| steps + 1)
    };
    // All values of a type of 64 bits are more than any bound.
    count.map(|count| i64::try_from(count).unwrap_or(i64::MAX))
}

/// Memory and stack. What is beyond either is 0, and what goes there is lost.
struct Machine<'r> {
    memory: &'r mut [i64],
    stack: &'r mut [i64],
    top: usize,
}

impl Machine<'_> {
    #[inline]
    fn push(&mut self, value: i64) {
        if let Some(place) = self.stack.get_mut(self.top) {
            *place = value;
            self.top += 1;
        }
    }

    #[inline]
    fn pop(&mut self) -> i64 {
        self.top = self.top.saturating_sub(1);
        self.stack.get(self.top).copied().unwrap_or(0)
    }

    #[inline]
    fn read(&self, address: i64) -> i64 {
        self.memory.get(address as usize).copied().unwrap_or(0)
    }

    #[inline]
    fn write(&mut self, address: i64, value: i64) {
        if let Some(slot) = self.memory.get_mut(address as usize) {
            *slot = value;
        }
    }

    /// Puts another value in the place of the last one.
    #[inline]
    fn replace(&mut self, result: impl FnOnce(i64) -> i64) {
        let value = self.pop();
        self.push(result(value));
    }

    #[inline]
    fn push_or(&mut self, value: Option<i64>, otherwise: Wrong, flags: &mut Flags) {
        if value.is_none() {
            flags.wrong = Some(otherwise);
        }
        self.push(value.unwrap_or(0));
    }

    #[inline]
    fn load_at(&mut self) {
        let address = self.pop();
        self.push(self.read(address));
    }

    #[inline]
    fn store_at(&mut self) {
        let value = self.pop();
        let address = self.pop();
        self.write(address, value);
    }

    #[inline]
    fn store(&mut self, address: i64) {
        let value = self.pop();
        self.write(address, value);
    }

    #[inline]
    fn index(&mut self, low: i32, length: u32, stride: u32, flags: &mut Flags) {
        let index = self.pop().wrapping_sub(i64::from(low));
        let address = self.pop();
        if (0..i64::from(length)).contains(&index) {
            self.push(address.saturating_add(index * i64::from(stride)));
        } else {
            flags.wrong = Some(Wrong::Index);
            self.push(NOWHERE);
        }
    }

    fn copy(&mut self, slots: u32) {
        let source = self.pop();
        let target = self.pop();
        for offset in 0..i64::from(slots) {
            let value = self.read(source.saturating_add(offset));
            self.write(target.saturating_add(offset), value);
        }
    }

    /// The slots from the address on that is on the stack; none: there is no such instance.
    #[inline]
    fn instance(&mut self) -> &mut [i64] {
        let from = usize::try_from(self.pop()).ok();
        from.and_then(|from| self.memory.get_mut(from..)).unwrap_or_default()
    }

    /// Takes values off the stack; whether each stands so to the next one.
    fn row(&mut self, values: u32, mut holds: impl FnMut(i64, i64) -> bool) -> bool {
        let first = self.top.saturating_sub(values as usize);
        let row = self.stack.get(first..self.top).unwrap_or_default();
        self.top = first;
        row.windows(2).all(|pair| holds(pair[0], pair[1]))
    }

    /// Takes the selector and values off the stack; `None`: no value has this number.
    fn choose(&mut self, values: u32) -> Option<i64> {
        let first = self.top.saturating_sub(values as usize);
        self.top = first.saturating_sub(1);
        let selector = self.stack.get(self.top).copied()?;
        let index = u32::try_from(selector).ok().filter(|index| *index < values)?;
        self.stack.get(first + index as usize).copied()
    }
}
