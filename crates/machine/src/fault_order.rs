//! What is asked of a simulated drive: that something goes wrong with it.
//!
//! In:  the kind of fault and how long it lasts.
//! Out: the octets of the object [`FAULT`] of that drive, and back.

use config::SimFaultKind;

/// Object of a simulated drive, with a subindex for each axis from 1 on, into which a [`FaultOrder`] is written. No drive that turns
/// a motor has it.
pub const FAULT: u16 = 0x5F00;

/// What is to go wrong with an axis of a simulated drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaultOrder {
    /// `None`: nothing, and what had gone wrong is mended.
    pub kind: Option<SimFaultKind>,
    /// For so many tenths of a second; 0: until it is mended.
    pub lasts_100ms: u16,
}

impl FaultOrder {
    /// Behind the order: a drive that happens to have such an object and that means something else by it takes no such value.
    const SIGN: [u8; 5] = *b"iSIM\x01";

    /// The octets of the object: number of the kind, how long, `FaultOrder::SIGN`.
    pub fn octets(self) -> [u8; 8] {
        let number = SimFaultKind::WORDS
            .iter()
            .position(|(_, kind)| Some(*kind) == self.kind);
        let number = number.map_or(0, |at| at as u8 + 1);
        let [low, high] = self.lasts_100ms.to_le_bytes();
        let [a, b, c, d, e] = FaultOrder::SIGN;
        [number, low, high, a, b, c, d, e]
    }

    /// The order in those octets; `None`: there is none.
    pub fn from_octets(octets: &[u8]) -> Option<FaultOrder> {
        let [number, low, high, sign @ ..] = octets else {
            return None;
        };
        let kind = match number.checked_sub(1) {
            None => None,
            Some(at) => Some(SimFaultKind::WORDS.get(usize::from(at))?.1),
        };
        (*sign == FaultOrder::SIGN).then_some(FaultOrder {
            kind,
            lasts_100ms: u16::from_le_bytes([*low, *high]),
        })
    }

    /// The order in a value of [`FAULT`]; `None`: there is none.
    pub fn of_value(value: u64) -> Option<FaultOrder> {
        FaultOrder::from_octets(&value.to_le_bytes())
    }
}
