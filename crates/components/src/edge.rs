//! Edges of a bit.

/// Remembers a bit from call to call; the first call makes no edge.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Edge {
    before: Option<bool>,
}

impl Edge {
    /// RT: whether it has risen, and whether it has fallen, since the call before.
    pub(crate) fn see(&mut self, now: bool) -> (bool, bool) {
        let before = self.before.replace(now).unwrap_or(now);
        (now && !before, before && !now)
    }

    /// RT: whether it has risen since the call before.
    pub(crate) fn rises(&mut self, now: bool) -> bool {
        self.see(now).0
    }
}
