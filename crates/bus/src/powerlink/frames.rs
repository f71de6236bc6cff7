//! Frames of the bus for whoever only listens: what one is, and a file of many.

use crate::ethercat::frames as of_ethercat;
pub use powerlink::link::pcap::PcapWriter;
use powerlink::wire::{ETHER_TYPE, message};

/// What a frame is, as far as it matters to whoever counts or measures. The words are those of POWERLINK. Of EtherCAT, SoC is the
/// frame that begins a cycle, PReq one more with process data, ASnd one of a service, PRes any that has passed a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "named as the frames of the bus")]
pub enum FrameKind {
    Soc,
    PReq,
    PRes,
    SoA,
    Asnd,
    /// A frame of the bus of another kind.
    Other,
    /// No frame of the bus.
    Foreign,
}

/// Whether a frame is one of EtherCAT.
pub fn is_ethercat(frame: &[u8]) -> bool {
    frame.get(12..14) == Some(&of_ethercat::ETHER_TYPE)
}

impl FrameKind {
    /// By the first octets of an Ethernet frame.
    pub fn of(frame: &[u8]) -> FrameKind {
        let (Some(ether_type), Some(message_type)) = (frame.get(12..14), frame.get(14)) else {
            return FrameKind::Foreign;
        };
        if ether_type == of_ethercat::ETHER_TYPE {
            return of_ethercat::kind(frame);
        }
        #[cfg(feature = "testing")]
        if ether_type == crate::toy::ETHER_TYPE {
            return crate::toy::kind(frame);
        }
        if ether_type != ETHER_TYPE.to_be_bytes() {
            return FrameKind::Foreign;
        }
        // Bit 7 is no part of the type.
        match message_type & 0x7F {
            message::SOC => FrameKind::Soc,
            message::PREQ => FrameKind::PReq,
            message::PRES => FrameKind::PRes,
            message::SOA => FrameKind::SoA,
            message::ASND => FrameKind::Asnd,
            _ => FrameKind::Other,
        }
    }
}
