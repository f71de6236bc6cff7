//! Near time-optimal planner: the square of the speed over the path as a quadratic B-spline.

pub mod solver;
