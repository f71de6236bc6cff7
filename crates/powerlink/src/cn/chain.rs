//! What a node knows of PRes chaining.

/// Times and mode that the managing node has set, and what was measured.
#[derive(Clone, Debug, Default)]
pub(super) struct Chaining {
    /// PResMode: the PRes follows the PResMN.
    pub(super) on: bool,
    pub(super) pres_time_first_ns: Option<u32>,
    pub(super) pres_time_second_ns: Option<u32>,
    /// 0: the mode is never left for lack of a PResMN.
    pub(super) fall_back_timeout_ns: u32,
    /// When the mode ends for lack of a PResMN.
    pub(super) fall_back_at_ns: Option<u64>,
    /// When the PRes of this cycle is due.
    pub(super) transmit_at_ns: Option<u64>,
    /// The other node that was sent a SyncRequest in this slot, and when.
    pub(super) asked: Option<(u8, u64)>,
    /// The node whose SyncResponse was measured last, and the delay in ns.
    pub(super) measured: Option<(u8, u32)>,
}

impl Chaining {
    pub(super) fn is_enabled(&self) -> bool {
        self.on
    }

    pub(super) fn transmit_at_ns(&self) -> Option<u64> {
        self.transmit_at_ns
    }

    pub(super) fn fall_back_at_ns(&self) -> Option<u64> {
        self.fall_back_at_ns
    }

    /// The chain of this cycle is over, and so is the slot before it: what was asked there is not answered any more.
    pub(super) fn cancel(&mut self) {
        self.transmit_at_ns = None;
        self.asked = None;
    }

    pub(super) fn switch(&mut self, on: bool, now_ns: u64) {
        self.on = on;
        self.transmit_at_ns = None;
        self.fall_back_at_ns = None;
        if on {
            self.watch(now_ns);
        }
    }

    pub(super) fn watch(&mut self, now_ns: u64) {
        let timeout_ns = u64::from(self.fall_back_timeout_ns);
        self.fall_back_at_ns = (timeout_ns > 0).then(|| now_ns.saturating_add(timeout_ns));
    }
}
