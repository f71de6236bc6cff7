//! The oscilloscope behind the ring: what a trigger is, which cycles make a record, how many of them a picture needs.
//!
//! In:  records of a [`hal_pins::scope::Capture`].
//! Out: samples on the time of a record, thinned by least and greatest value; CSV, SVG.

pub mod csv;
pub mod picture;
pub mod record;
pub mod stream;
pub mod thin;
pub mod trigger;
