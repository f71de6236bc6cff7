//! Events, logs and reports: everything that may wait.

pub mod analyser;
pub mod attend;
pub mod bell;
mod by_hand;
pub mod control;
pub mod desk;
pub mod jitter;
pub mod job;
mod keeper;
pub mod netns;
pub mod network_view;
pub mod operator;
pub mod plot;
pub mod process;
pub mod progress;
pub mod recorder;
pub mod refusal;
pub mod report;
pub mod signals;
pub mod stalls;
pub mod standby;
pub mod systemd;
pub mod tap;
