//! The optimal planner: nearly the shortest time that the limits of every joint allow.
//!
//! In:  stretches and halts of the smoothed path.
//! Out: elements to the ring.
//!
//! ```text
//! sections   cuts the path where it cannot be passed at speed                  (joints: limits, derivatives)
//! knots      places knots about evenly in time
//! checkpoints  derivatives of the joints on every span, and whether three places show enough
//! windows    cuts sections into windows; jobs for the worker threads
//! solver     speed over a window: the square of the speed as a quadratic B-spline, interior point method
//! s_curve    straight stretches between two states, in closed form
//! slopes     states at knots, starts and stops -> elements
//! stream     all of them, and what is handed over when
//! ```
//!
//! What comes out depends on the path alone, not on the number of threads. Where the solver finds no way, the section is
//! planned with a seven-phase slope within limits that hold anywhere on it.

mod checkpoints;
mod joints;
mod knots;
mod s_curve;
mod sections;
mod slopes;
pub mod solver;
mod stream;
mod windows;

pub(super) use stream::{Override, Stream, largest_publication};
