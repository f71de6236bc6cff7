//! The machine file: TOML to a checked [`Config`], or to located errors.

mod cursor;
mod errors;
mod reader;
mod types;

pub use errors::{ConfigError, ConfigErrors};
pub use reader::{parse, read};
pub use types::*;
