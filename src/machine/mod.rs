//! Machine state, alarms and limits.
