//! Frames of EtherCAT for whoever only listens.

use crate::powerlink::frames::FrameKind;
use ethercat::wire::{Addressing, Command, Frame, MAC_PASSED};

/// Ethernet type of EtherCAT.
pub const ETHER_TYPE: [u8; 2] = [0x88, 0xA4];

/// What a frame with that type is, in the words of POWERLINK: see [`FrameKind`].
pub fn kind(frame: &[u8]) -> FrameKind {
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
