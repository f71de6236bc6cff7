//! Lines and circles in whole steps by digital differential analysers (DDA): counters and additions, no division while they run.
//!
//! In:  end points in whole steps.
//! Out: at each clock, which axis steps and in which direction.
//!
//! * [`LineDda`]: straight lines of any number of axes, never more than half a step beside the line.
//! * [`ArcDda`]: circles, from point to point, by the methods of the literature and by one better than those.
//!
//! The control itself computes circles with sine and cosine (`motion::path::Arc`), and its step pulses follow set-points
//! (`motion::rt::dda`); these are for outputs that are told end points only, and for comparison. RT: nothing here allocates, and a
//! clock is a fixed number of additions.

mod arc;
mod line;
mod quality;

pub use arc::{ArcDda, ArcError, Fill, Method, Registers, Rule, Turn};
pub use line::LineDda;
pub use quality::{path_variance, sawteeth};

#[cfg(test)]
mod tests;
