//! All tests of this crate that see it from outside, in one program: each is linked once.

mod oracle;

mod contour_feed;
mod corpus;
mod curves;
mod differential;
mod endless;
mod flat;
mod printed;
mod properties;
mod resume;
mod tool_centre_point;
