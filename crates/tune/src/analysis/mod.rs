//! What moves of one joint say of its loop: how it follows, what its amplifier and motor are like, which gains suit them.
//!
//! In:  the cycles of a program that moves one joint to and fro.
//! Out: figures of each move, a frequency response, a model of the plant, gains with their stability margins.

pub mod complex;
pub mod frequency;
pub mod linear;
pub mod plant;
pub mod record;
pub mod stability;
pub mod step;
