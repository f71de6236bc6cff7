//! The machine file: TOML to a checked [`Config`], or located errors.

mod types;

pub use types::*;
