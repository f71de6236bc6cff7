//! Simple jobs without CAM: facing, pockets, holes, threads and text, each written as a plain program.
//!
//! In:  the kind of a job and its numbers, mm and degrees, in the active work system. Out: the text of a program, or which number is
//! wrong and what to do about it.
//!
//! A program never goes below the depth, never cuts outside the contour, and moves rapidly only above the surface (and inside a hole that
//! it has drilled). It reads as a person writes it. Nothing here does I/O, and no input causes a panic.
//!
//! | to learn | file |
//! |---|---|
//! | which numbers a job has: names, units, defaults, bounds | `fields.rs`, and the head of the file of each kind |
//! | how lines are written, head and end of each program | `writer.rs` |
//! | rows over a surface | `facing.rs` |
//! | rings, entries, finishing pass | `pocket.rs` |
//! | holes on a circle and in rows | `drilling.rs` |
//! | helices | `thread_milling.rs` |
//! | strokes and where they go; the letters | `engraving.rs`; `font.rs` |

mod drilling;
mod engraving;
mod facing;
mod fields;
mod font;
mod pocket;
mod thread_milling;
mod writer;

pub use drilling::{BoltCircle, Cycle, HoleRows};
pub use engraving::{Align, Engraving, Layout};
pub use facing::{Along, Facing, Pattern};
pub use fields::{Coolant, Field, Values, What, Wrong, value};
pub use pocket::{CircularPocket, Entry, RectangularPocket};
pub use thread_milling::{Cut, Hand, Side, ThreadMilling};
pub use writer::LINES_MAX;

use fields::read;
use protocol::{JobField, JobKind, JobValue, message};

/// A kind of job.
#[derive(Clone, Copy, Debug)]
pub struct Kind {
    /// Its name: `rectangular_pocket`.
    pub name: &'static str,
    /// What it makes.
    pub about: &'static str,
    /// Its numbers, in the order of a form.
    pub fields: fn() -> Vec<Field>,
    make: fn(&Values) -> Result<String, Wrong>,
}

/// All kinds.
pub const KINDS: [Kind; 7] = [
    Kind {
        name: "facing",
        about: Facing::ABOUT,
        fields: Facing::fields,
        make: |values| read::<Facing>(values, &Facing::fields())?.program(),
    },
    Kind {
        name: "rectangular_pocket",
        about: RectangularPocket::ABOUT,
        fields: RectangularPocket::fields,
        make: |values| read::<RectangularPocket>(values, &RectangularPocket::fields())?.program(),
    },
    Kind {
        name: "circular_pocket",
        about: CircularPocket::ABOUT,
        fields: CircularPocket::fields,
        make: |values| read::<CircularPocket>(values, &CircularPocket::fields())?.program(),
    },
    Kind {
        name: "bolt_circle",
        about: BoltCircle::ABOUT,
        fields: BoltCircle::fields,
        make: |values| read::<BoltCircle>(values, &BoltCircle::fields())?.program(),
    },
    Kind {
        name: "hole_rows",
        about: HoleRows::ABOUT,
        fields: HoleRows::fields,
        make: |values| read::<HoleRows>(values, &HoleRows::fields())?.program(),
    },
    Kind {
        name: "thread_milling",
        about: ThreadMilling::ABOUT,
        fields: ThreadMilling::fields,
        make: |values| read::<ThreadMilling>(values, &ThreadMilling::fields())?.program(),
    },
    Kind {
        name: "engraving",
        about: Engraving::ABOUT,
        fields: Engraving::fields,
        make: |values| read::<Engraving>(values, &Engraving::fields())?.program(),
    },
];

/// The kind of this name.
///
/// # Errors
/// There is none.
pub fn kind(name: &str) -> Result<&'static Kind, Wrong> {
    KINDS.iter().find(|kind| kind.name == name).ok_or_else(|| {
        let kinds: Vec<&str> = KINDS.iter().map(|kind| kind.name).collect();
        let message = message!(
            "job.no_kind",
            "there is no kind of job \"{kind}\": {kinds}",
            kind = name,
            kinds = kinds.join(", ")
        );
        Wrong { field: None, message }
    })
}

impl Kind {
    /// The program with these numbers, at most [`LINES_MAX`] lines; a number that is not given has its default.
    ///
    /// # Errors
    /// Which number is wrong, and what to do about it.
    pub fn make(&self, values: &Values) -> Result<String, Wrong> {
        (self.make)(values)
    }

    /// As a client gets it.
    pub fn told(&self) -> JobKind {
        JobKind {
            kind: self.name.to_owned(),
            about: self.about.to_owned(),
            fields: (self.fields)().iter().map(told).collect(),
        }
    }
}

fn told(field: &Field) -> JobField {
    let (min, max) = match field.what {
        What::Number { min, max, .. } => (Some(min), Some(max)),
        What::Whole { min, max, .. } => (Some(f64::from(min)), Some(f64::from(max))),
        What::Choice { .. } | What::Text { .. } => (None, None),
    };
    let length_max = match field.what {
        What::Text { length_max, .. } => Some(length_max as u64),
        _ => None,
    };
    let choices = match field.what {
        What::Choice { of } => of.iter().map(|choice| (*choice).to_owned()).collect(),
        _ => Vec::new(),
    };
    JobField {
        name: field.name.to_owned(),
        doc: field.doc.trim().to_owned(),
        unit: field.unit.to_owned(),
        whole: matches!(field.what, What::Whole { .. }),
        default: match field.what {
            What::Number { default, .. } => JobValue::Number(default),
            What::Whole { default, .. } => JobValue::Number(f64::from(default)),
            What::Choice { of } => JobValue::Text(of.first().copied().unwrap_or_default().to_owned()),
            What::Text { default, .. } => JobValue::Text(default.to_owned()),
        },
        min,
        max,
        length_max,
        choices,
    }
}
