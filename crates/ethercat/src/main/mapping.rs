//! Process data of one direction: what is mapped and assigned is compared, written where it differs, and read again.
//!
//! A device whose objects are fixed refuses every write; where they are as they should be anyway, none is made.

use super::config::ProcessDataConfig;
use super::event::SetupError;
use crate::wire::coe::Object;
use crate::wire::sii::Usage;

/// Assignment of the outputs; that of the inputs behind it.
const ASSIGN_OUTPUTS: u16 = 0x1C12;
const ASSIGN_INPUTS: u16 = 0x1C13;

/// What is done with an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Pass {
    Compare,
    /// Nothing is assigned while mappings change.
    ClearAssignment,
    /// The number of entries becomes 0.
    Clear,
    Write,
    /// The number of entries, which puts them into force.
    Count,
    Verify,
}

/// An SDO that comes next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Task {
    pub(super) object: Object,
    /// A value and its octets; `None`: it is read.
    pub(super) write: Option<(u32, usize)>,
}

/// Where the work is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mapping {
    usage: Usage,
    /// Number of the PDO; the one behind the last is the assignment.
    object: usize,
    pass: Pass,
    sub: u8,
    cleared: bool,
}

impl Mapping {
    pub(super) fn new(usage: Usage) -> Mapping {
        Mapping {
            usage,
            object: 0,
            pass: Pass::Compare,
            sub: 0,
            cleared: false,
        }
    }

    fn assignment(&self) -> u16 {
        match self.usage {
            Usage::Outputs => ASSIGN_OUTPUTS,
            _ => ASSIGN_INPUTS,
        }
    }

    /// Index of the object and its entries' number, length in octets, and values.
    fn target(&self, data: &ProcessDataConfig<'_>, sub: u8) -> (u16, u32, usize) {
        let at = usize::from(sub).wrapping_sub(1);
        match data.pdos.get(self.object) {
            Some(pdo) if sub == 0 => (pdo.index, pdo.entries.len() as u32, 1),
            Some(pdo) => (pdo.index, pdo.entries.get(at).copied().unwrap_or(0), 4),
            None if sub == 0 => (self.assignment(), data.pdos.len() as u32, 1),
            None => (
                self.assignment(),
                data.pdos.get(at).map_or(0, |pdo| pdo.index.into()),
                2,
            ),
        }
    }

    fn count(&self, data: &ProcessDataConfig<'_>) -> u8 {
        let entries = data
            .pdos
            .get(self.object)
            .map_or(data.pdos.len(), |pdo| pdo.entries.len());
        entries.min(usize::from(u8::MAX)) as u8
    }

    /// The next SDO.
    pub(super) fn task(&mut self, data: &ProcessDataConfig<'_>) -> Task {
        // Those that stay as the device has them are only assigned.
        while data.pdos.get(self.object).is_some_and(|pdo| pdo.entries.is_empty()) {
            self.object += 1;
        }
        let sub = match self.pass {
            Pass::Compare | Pass::Verify | Pass::Write => self.sub,
            Pass::ClearAssignment | Pass::Clear | Pass::Count => 0,
        };
        let (index, value, octets) = self.target(data, sub);
        let (index, write) = match self.pass {
            Pass::Compare | Pass::Verify => (index, None),
            Pass::ClearAssignment => (self.assignment(), Some((0, 1))),
            Pass::Clear => (index, Some((0, 1))),
            Pass::Write | Pass::Count => (index, Some((value, octets))),
        };
        Task {
            object: Object {
                index,
                sub,
                complete: false,
            },
            write,
        }
    }

    /// An SDO is done; `value`: what was read. Whether it was the last.
    pub(super) fn done(&mut self, data: &ProcessDataConfig<'_>, value: u32) -> Result<bool, SetupError> {
        let (index, expected, _) = self.target(data, self.sub);
        let count = self.count(data);
        let is_assignment = self.object >= data.pdos.len();
        match self.pass {
            Pass::Compare if value != expected => {
                self.sub = 0;
                self.pass = if is_assignment || self.cleared {
                    Pass::Clear
                } else {
                    Pass::ClearAssignment
                };
            }
            Pass::Verify if value != expected => {
                let object = Object {
                    index,
                    sub: self.sub,
                    complete: false,
                };
                return Err(SetupError::Differs {
                    object,
                    expected,
                    found: value,
                });
            }
            Pass::Compare | Pass::Verify if self.sub < count => self.sub += 1,
            Pass::Compare | Pass::Verify => {
                if is_assignment {
                    return Ok(true);
                }
                self.object += 1;
                (self.pass, self.sub) = (Pass::Compare, 0);
            }
            Pass::ClearAssignment => {
                self.cleared = true;
                self.pass = Pass::Clear;
            }
            Pass::Clear if count == 0 => (self.pass, self.sub) = (Pass::Verify, 0),
            Pass::Clear => (self.pass, self.sub) = (Pass::Write, 1),
            Pass::Write if self.sub < count => self.sub += 1,
            Pass::Write => self.pass = Pass::Count,
            Pass::Count => (self.pass, self.sub) = (Pass::Verify, 0),
        }
        Ok(false)
    }
}
