//! The managing node.
