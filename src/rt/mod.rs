//! Real time: the cycle thread, the time-out thread and what they need from the system.
