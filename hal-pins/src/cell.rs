//! The one word that holds the value of a pin.

use crate::mapped::AtomicU64;
use std::sync::atomic::Ordering::{Acquire, Release};

/// RT: shows a value; whoever sees it sees everything that was written before.
#[inline]
pub(crate) fn set(cell: &AtomicU64, value: u64) {
    cell.store(value, Release);
}

/// RT: the value now.
#[inline]
pub(crate) fn get(cell: &AtomicU64) -> u64 {
    cell.load(Acquire)
}
