//! Who may send what to whom: every type, every sender, every receiver.

use super::*;

/// A frame that is readable whatever its type says.
fn readable(message_type: u8, source: u8, destination: u8) -> [u8; 64] {
    let mut octets = [0; 64];
    octets[12..17].copy_from_slice(&[0x88, 0xAB, message_type, destination, source]);
    octets
}

/// Whether the standard has such a frame; written down beside the table in another order.
fn is_known(message_type: u8, source: u8, destination: u8) -> bool {
    let to_all = destination == 255;
    let to_a_station = !matches!(destination, 0 | 241..=252);
    match source {
        1..=239 => (message_type == 4 && to_all) || (message_type == 6 && to_a_station),
        240 => match message_type {
            1 | 4 | 5 => to_all,
            3 => (1..=239).contains(&destination),
            6 | 13 => to_a_station,
            _ => false,
        },
        241..=250 => message_type == 7 && to_all,
        253 | 254 => message_type == 6 && to_a_station,
        _ => false,
    }
}

#[test]
fn every_type_from_every_sender_to_every_receiver() {
    let mut known = 0;
    for message_type in 0..=u8::MAX {
        for source in 0..=u8::MAX {
            for destination in 0..=u8::MAX {
                let octets = readable(message_type, source, destination);
                // Bit 7 is no part of the type.
                let expected = is_known(message_type & 0x7F, source, destination);
                let accepted = accept(&octets);
                assert_eq!(
                    accepted.is_ok(),
                    expected,
                    "{message_type} from {source} to {destination}"
                );
                known += u32::from(expected);
                if let Ok((header, frame)) = accepted {
                    assert_eq!((header.source_node, header.destination_node), (source, destination));
                    assert_eq!(frame.message_type(), message_type & 0x7F);
                    assert_eq!(header.is_from_managing_node(), (240..=250).contains(&source));
                }
            }
        }
    }
    // SoC, SoA, PRes of 240 nodes, AMNI of 10; PReq to 239; ASnd of 242 and AInv of one to 243. Each with and without bit 7.
    assert_eq!(known, 2 * (1 + 1 + 240 + 10 + 239 + 242 * 243 + 243));
}

#[test]
fn what_is_wrong_is_told() {
    let told = |message_type, source, destination| {
        let octets = readable(message_type, source, destination);
        accept(&octets).unwrap_err().to_string()
    };
    assert_eq!(told(4, 0, 255), "node 0 cannot be the sender of message type 0x04");
    assert_eq!(told(3, 240, 255), "message type 0x03 does not go to node 255");
    assert_eq!(told(2, 240, 255), "unknown message type 0x02");
}
