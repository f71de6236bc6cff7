//! Events, logs and reports: everything that may wait.

pub mod operator;
pub mod recorder;
pub mod netns;
