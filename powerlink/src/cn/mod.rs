//! The controlled node.
