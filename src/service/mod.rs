//! Events, logs and reports: everything that may wait.
