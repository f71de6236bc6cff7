//! Every component as a table: a pin a line, a call a column.
//!
//! The figures are worked out by hand from what each component is to do.

mod arithmetic;
mod convert;
mod counting;
mod filters;
mod keys;
mod limits;
mod logic;
mod machine;
mod pid;
mod select;
mod spindle;
mod timing;
