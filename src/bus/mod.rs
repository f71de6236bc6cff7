//! Field buses, seen as images that are exchanged once a cycle.
