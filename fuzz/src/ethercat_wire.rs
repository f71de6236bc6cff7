//! Any octets as a frame of EtherCAT, as a mailbox and as an EEPROM: what is read can be written, and is then read as the same.

use ethercat::wire::coe::Message;
use ethercat::wire::mailbox::{Mail, MailError};
use ethercat::wire::sii::{Sii, category};
use ethercat::wire::{FRAME_LEN_MAX, Frame};

/// One run of the fuzzer.
pub fn run(octets: &[u8]) {
    frame(octets);
    mail(octets);
    eeprom(octets);
}

fn frame(octets: &[u8]) {
    let Ok(frame) = Frame::parse(octets) else { return };
    let mut first = [0xA5; FRAME_LEN_MAX];
    let length = frame.emit(&mut first).expect("what is read fits into a frame");
    let again = Frame::parse(&first[..length]).expect("what was written is read");
    assert!(again.datagrams().eq(frame.datagrams()));
    for datagram in frame.datagrams() {
        mail(datagram.data);
    }
}

fn mail(octets: &[u8]) {
    let Ok(mail) = Mail::parse(octets) else { return };
    let _ = MailError::parse(mail.data);
    let Ok(message) = Message::parse(mail.data) else { return };
    let mut mailbox = vec![0xA5; octets.len() + 16];
    message.emit(1, &mut mailbox).expect("little more than what was read");
    let again = Mail::parse(&mailbox).expect("what was written is read");
    assert_eq!(Message::parse(again.data), Ok(message));
}

fn eeprom(octets: &[u8]) {
    let Ok(sii) = Sii::parse(octets) else { return };
    let within: usize = sii.categories().map(|category| 4 + category.data.len()).sum();
    assert!(within <= octets.len());
    assert!(sii.length().is_none_or(|length| length <= octets.len()));
    for number in 0..=u8::MAX {
        assert!(number > 0 || sii.string(number).is_none());
    }
    let _ = (sii.general(), sii.sync_managers().count(), sii.fmmus().len());
    for direction in [category::RX_PDO, category::TX_PDO] {
        let bits: usize = sii.pdos(direction).map(|pdo| pdo.bits()).sum();
        assert!(bits <= 255 * octets.len());
    }
}
