//! The memory of a program: what its variables hold at the start.
//!
//! In:  values of variables, in the order in which they are laid out.
//! Out: the slot of each. What there is no room for is told at the end, once.

use crate::diagnostic::{Diagnostics, Kind, Reported, Span};

/// Values that the variables of a program hold at most.
pub const MEMORY_MAX: usize = 1 << 16;
/// Values that are laid out at most, those of types counted, too.
const LAYOUT_MAX: usize = 1 << 22;
/// Values, each in its slot.
#[derive(Default)]
pub(super) struct Memory {
    values: Vec<i64>,
    /// Values that the variables need, whatever there is room for, and where the first one is beyond it.
    needed: usize,
    beyond: Option<Span>,
    /// Values that were laid out, those of types counted, too.
    laid_out: usize,
    is_told: bool,
}

impl Memory {
    /// Puts values into the memory; the slot of the first one.
    pub(super) fn allocate(&mut self, image: &[i64], at: Span) -> u32 {
        let slot = self.values.len();
        self.needed = self.needed.saturating_add(image.len());
        if self.needed > MEMORY_MAX {
            self.beyond = self.beyond.or(Some(at));
            return 0;
        }
        self.values.extend_from_slice(image);
        slot as u32
    }

    /// So many values more are laid out.
    ///
    /// # Errors
    /// They are too many.
    pub(super) fn lay_out(&mut self, values: usize, at: Span) -> Result<(), Reported> {
        self.laid_out = self.laid_out.saturating_add(values);
        if self.laid_out <= LAYOUT_MAX {
            return Ok(());
        }
        self.needed = self.needed.saturating_add(values);
        self.beyond = self.beyond.or(Some(at));
        Err(Reported)
    }

    /// So many values of one type are more than there is room for.
    pub(super) fn too_great(&mut self, needed: usize, at: Span, told: &mut Diagnostics<'_>) -> Reported {
        if !std::mem::replace(&mut self.is_told, true) {
            let most = MEMORY_MAX;
            told.error(at, Kind::Memory { needed, most });
        }
        Reported
    }

    pub(super) fn tell_what_is_beyond(&mut self, told: &mut Diagnostics<'_>) {
        let Some(at) = self.beyond else { return };
        if self.needed > MEMORY_MAX {
            self.too_great(self.needed, at, told);
        } else {
            told.error(at, Kind::Layout { most: LAYOUT_MAX });
        }
    }

    pub(super) fn into_values(self) -> Box<[i64]> {
        self.values.into()
    }
}
