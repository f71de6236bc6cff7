//! Time-optimal speed over a path of continuous curvature, under speed, acceleration and jerk limits of every joint.
//!
//! In:  a [`Grid`]: joint derivatives by path length at three checkpoints of every span; limits; a strictly feasible
//!      profile between two fixed end states ([`initial_guess`]).
//! Out: the fastest profile between these end states ([`solve`]), strictly feasible at every checkpoint.
//!
//! Pure functions: no clock, no threads, no I/O; the same input gives the same bits.
//!
//! ```text
//! grid         derivatives at the checkpoints, scaled by the limits
//! profile      b = v² as a quadratic spline; its worst constraint
//! initial_guess  a slow feasible profile, and from it one to start from
//! launch       from rest, and the way from there to the feasible profile
//! rise         how fast speed is expected to rise: for where to put knots
//! interior     interior point method
//! constraints  bounds of several neighbouring spans at once, in the order in which they are worked on (lanes)
//! passes       over all constraints: Newton system, what a step uses up, multipliers
//! band         the linear system
//! ```
//!
//! # The problem
//!
//! With b = v² over the path length s, u = dv/dt = b'/2 and w = u', joint k has
//!
//! ```text
//! speed          |q'| sqrt(b)                                 <= V
//! acceleration   |q' u + q'' b|                               <= A
//! jerk           (|q' w + 3 q'' u + q''' b| + K) sqrt(b)      <= J
//! ```
//!
//! where K is what a kink takes, and 0 elsewhere; the time is the integral of 1/sqrt(b). b is a quadratic spline on the knots of
//! the grid: b and u continuous, u linear and w constant within a span. q''' and w jump at knots, hence checkpoints at both ends
//! of every span.

mod band;
mod brake;
mod constraints;
mod grid;
mod initial_guess;
mod interior;
mod lanes;
mod launch;
mod passes;
mod profile;
mod rise;

pub use brake::first_braking;
pub(in crate::plan) use grid::even_limits;
pub use grid::{ACCELERATION_USE, CREST, Grid, JERK_USE, JointJet, JointLimits, SPEED_USE, Taken, crest};
pub use initial_guess::{Knotting, feasible_profile, initial_guess};
pub use interior::{Infeasible, Options, Solved, Workspace, solve};
pub use launch::{Launch, NoStart, launch};
pub use profile::{State, Worst, coefficient, worst};
pub use rise::rise;

#[cfg(test)]
mod tests;
