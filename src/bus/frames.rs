//! Frames of the bus for whoever only listens: what one is, and a file of many.

use ethercat::wire::{Addressing, Command, Frame, MAC_PASSED};
pub use powerlink::link::pcap::PcapWriter;
use powerlink::wire::{ETHER_TYPE, message};

/// Ethernet type of EtherCAT.
const ETHERCAT: [u8; 2] = [0x88, 0xA4];

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

impl FrameKind {
    /// By the first octets of an Ethernet frame.
    pub fn of(frame: &[u8]) -> FrameKind {
        let (Some(ether_type), Some(message_type)) = (frame.get(12..14), frame.get(14)) else {
            return FrameKind::Foreign;
        };
        if ether_type == ETHERCAT {
            return FrameKind::of_ethercat(frame);
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

    fn of_ethercat(frame: &[u8]) -> FrameKind {
        let Ok(parsed) = Frame::parse(frame) else {
            return FrameKind::Other;
        };
        if frame[6] & MAC_PASSED != 0 {
            return FrameKind::PRes;
        }
        let has = |wanted: fn(Command) -> bool| parsed.datagrams().any(|datagram| wanted(datagram.command));
        let has_process_data = has(|command| command.addressing() == Addressing::Logical);
        // The time of the reference clock, or the room for it, is in the first frame of a cycle.
        let begins = has(|command| matches!(command, Command::Frmw | Command::Armw | Command::Nop));
        match (has_process_data, begins) {
            (true, true) => FrameKind::Soc,
            (true, false) => FrameKind::PReq,
            (false, _) => FrameKind::Asnd,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ethercat::wire::{BROADCAST, FRAME_LEN_MAX, FrameWriter};

    #[test]
    fn frames_of_ethercat_are_told_apart_by_what_they_carry_and_whence_they_come() {
        let kind = |commands: &[Command], source: u8| {
            let mut buffer = [0; FRAME_LEN_MAX];
            let mut writer = FrameWriter::new(&mut buffer, BROADCAST, [source, 0, 0, 0, 0, 1]).expect("room");
            for command in commands {
                writer.push(*command, 1, 0x0910_1001, 8).expect("room");
            }
            let length = writer.finish();
            FrameKind::of(&buffer[..length])
        };
        for (commands, source, expected) in [
            (&[Command::Frmw, Command::Brd, Command::Lrw][..], 0x10, FrameKind::Soc),
            (&[Command::Nop, Command::Brd, Command::Lrw][..], 0x10, FrameKind::Soc),
            (&[Command::Lrw, Command::Lrw][..], 0x10, FrameKind::PReq),
            (&[Command::Fprd, Command::Frmw][..], 0x10, FrameKind::Asnd),
            (&[Command::Frmw, Command::Brd, Command::Lrw][..], 0x12, FrameKind::PRes),
        ] {
            assert_eq!(kind(commands, source), expected, "{commands:?} from {source:02X}");
        }
        assert_eq!(FrameKind::of(&[0; 14]), FrameKind::Foreign);
    }
}
