//! The oscilloscope behind the ring: what a trigger is, which cycles make a record, how many of them a picture needs.
//!
//! In:  records of a [`hal_pins::scope::Capture`].
//! Out: samples on the time of a record, thinned by least and greatest value; CSV, SVG.

// What is public here is so for the program and its tests, and says more than its name only where there is more to say.
#![allow(missing_docs)]

pub mod csv;
pub mod picture;
pub mod record;
pub mod stream;
pub mod thin;
pub mod trigger;
