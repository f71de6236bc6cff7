//! Placeholder of the workspace skeleton.
#![no_std]
