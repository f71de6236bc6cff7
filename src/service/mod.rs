//! Events, logs and reports: everything that may wait.

pub mod netns;
pub mod operator;
pub mod recorder;
