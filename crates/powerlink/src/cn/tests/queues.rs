//! The asynchronous slot: SDO answers and the application's Ethernet frames; storing parameters.

use super::*;
use crate::wire::ETHER_TYPE;

/// A frame of EtherType IPv4 with a mark in it.
fn ip_frame(mark: u8, len: usize) -> Vec<u8> {
    let mut frame = std::vec![mark; len];
    frame[12..14].copy_from_slice(&[0x08, 0x00]);
    frame
}

fn sdo(bench: &mut Bench, octets: &[u8]) {
    bench.send(multicast::ASND, NODE, &Frame::Asnd(Asnd::Sdo(octets)));
}

/// RS and PR of the next PRes.
fn requests(bench: &mut Bench) -> (u8, u8) {
    let octet = bench.poll_with(&[]).unwrap()[19];
    (octet & 7, octet >> 3)
}

#[test]
fn ethernet_frames_and_sdo_answers_take_turns() {
    let mut bench = Bench::new();
    bench.wake();
    bench.node.send_ethernet(&ip_frame(1, 14)).unwrap();
    bench.node.send_ethernet(&ip_frame(2, 100)).unwrap();
    bench.node.send_ethernet(&ip_frame(3, 314)).unwrap();
    sdo(&mut bench, &[0x00, 0x01, 0, 0]);
    assert_eq!(requests(&mut bench), (4, 3));
    let mut invite = || bench.soa(RequestedService::UnspecifiedInvite, NODE);
    let first = invite().unwrap();
    assert_eq!((first.len(), &first[12..14], first[0]), (60, &[8, 0][..], 1));
    assert_eq!(first[14..], [0; 46], "padded with zeros");
    assert_eq!(invite().unwrap()[17], 5);
    assert_eq!(invite().unwrap(), ip_frame(2, 100));
    assert_eq!(invite().unwrap(), ip_frame(3, 314));
    assert_eq!(invite(), None);
}

#[test]
fn frames_that_cannot_be_sent_are_refused_with_the_reason() {
    let mut bench = Bench::new();
    let mut refused = |frame: &[u8]| bench.node.send_ethernet(frame).unwrap_err();
    let too_long = refused(&ip_frame(0, 315));
    assert_eq!(too_long, QueueError::Length { octets: 315, most: 314 });
    assert_eq!(
        too_long.to_string(),
        "an Ethernet frame of 315 octets, 14..=314 can be sent"
    );
    assert_eq!(refused(&[0; 13]), QueueError::Length { octets: 13, most: 314 });
    let mut powerlink = ip_frame(0, 60);
    powerlink[12..14].copy_from_slice(&ETHER_TYPE.to_be_bytes());
    assert_eq!(refused(&powerlink), QueueError::Powerlink);
    for _ in 0..ETHERNET_FRAMES {
        bench.node.send_ethernet(&ip_frame(0, 60)).unwrap();
    }
    assert_eq!(bench.node.send_ethernet(&ip_frame(0, 60)), Err(QueueError::Full));
    bench.wake();
    assert_eq!(requests(&mut bench), (ETHERNET_FRAMES as u8, 3));
    // A reset empties the queue.
    bench.plain(NmtCommand::ResetConfiguration);
    bench.wake();
    assert_eq!(requests(&mut bench), (0, 0));
}

#[test]
fn the_async_mtu_is_that_of_the_active_configuration() {
    let mut bench = Bench::new();
    bench.wake();
    bench.write(0x1F98, 8, &1500_u16.to_le_bytes()).unwrap();
    let longest = ip_frame(5, 1514);
    assert!(bench.node.send_ethernet(&longest).is_err());
    bench.plain(NmtCommand::ResetConfiguration);
    bench.wake();
    bench.node.send_ethernet(&longest).unwrap();
    assert_eq!(bench.soa(RequestedService::UnspecifiedInvite, NODE).unwrap(), longest);
}

#[test]
fn the_ring_of_frames_goes_round() {
    let mut bench = Bench::new();
    bench.wake();
    for mark in 0..50 {
        bench.node.send_ethernet(&ip_frame(mark, 60)).unwrap();
        if mark % 2 == 1 {
            for expected in [mark - 1, mark] {
                let sent = bench.soa(RequestedService::UnspecifiedInvite, NODE).unwrap();
                assert_eq!(sent[0], expected);
            }
        }
    }
}

#[test]
fn in_basic_ethernet_frames_are_sent_at_once() {
    let mut bench = Bench::new();
    let mut out = [0xA5; FRAME_LEN_MAX];
    bench.node.send_ethernet(&ip_frame(1, 60)).unwrap();
    assert_eq!(bench.node.poll_transmit(0, &mut out), None, "NOT_ACTIVE is silent");
    bench.now_ns = 5_000_000 * US;
    bench.node.poll(bench.now_ns);
    assert_eq!(bench.node.nmt_state(), NmtState::BasicEthernet);
    assert_eq!(bench.node.next_deadline_ns(), Some(0), "at once");
    assert_eq!(bench.node.poll_transmit(bench.now_ns, &mut out), Some(60));
    assert_eq!(out[..60], ip_frame(1, 60));
    assert_eq!(bench.node.poll_transmit(bench.now_ns, &mut out), None);
    assert_eq!(bench.node.next_deadline_ns(), None);
    bench.node.send_ethernet(&ip_frame(2, 60)).unwrap();
    bench.soa(RequestedService::NoService, 0);
    assert_eq!(
        bench.node.poll_transmit(bench.now_ns, &mut out),
        None,
        "a managing node is there again"
    );
    assert!(bench.soa(RequestedService::UnspecifiedInvite, NODE).is_some());
}

#[test]
fn a_status_response_shows_up_to_thirteen_errors() {
    let mut bench = Bench::new();
    bench.wake();
    for code in 1..=15 {
        bench.node.report_error(402, code, [0; 8]);
    }
    bench.status(false, false);
    let status = bench.status(false, false);
    assert_eq!(status.len(), 32 + 13 * 20);
    let codes: Vec<u8> = status[32..].chunks(20).map(|entry| entry[2]).collect();
    assert_eq!(codes, (1..=13).collect::<Vec<_>>());
    assert_eq!(status[18], 0x10, "EN");
    bench.status(false, true);
    let status = bench.status(false, true);
    assert_eq!((status.len(), status[18], status[34], status[54]), (72, 0x00, 14, 15));
    assert_eq!(bench.u32_of(0x1102, 7), 2, "EN flipped twice");
    assert_eq!((bench.u32_of(0x1102, 1), bench.u32_of(0x1102, 2)), (15, 15));
}

#[test]
fn parameters_are_stored_and_restored_by_the_device() {
    const STORING: usize = ENTRIES + lines_of(objects::STORAGE);
    const STORING_BYTES: usize = BYTES + octets_of(objects::STORAGE);
    let dictionary = Dictionary::new(&[COMMUNICATION_PROFILE, objects::STORAGE, DEVICE]).unwrap();
    let mut node = Cn::<STORING, STORING_BYTES>::new(&config(), dictionary, 0).unwrap();
    let mut write = |index, sub, value: &[u8]| {
        let mut access = Access {
            dictionary: &mut node.dictionary,
            keys: &node.keys,
            state: node.state,
            check: None,
            written: None,
            written_several: false,
            reset: None,
            storage: None,
        };
        let result = obd::Objects::sdo_write(&mut access, index, sub, value);
        (result, access.storage)
    };
    let save = Storage::Store(StorageGroup::All);
    assert_eq!(write(0x1010, 1, b"save"), (Ok(()), Some(save)));
    let load = Storage::Restore(StorageGroup::Application);
    assert_eq!(write(0x1011, 3, b"load"), (Ok(()), Some(load)));
    assert_eq!(write(0x1010, 1, b"load"), (Err(AbortCode::NOT_STORED), None));
    assert_eq!(write(0x1011, 1, b"save"), (Err(AbortCode::NOT_STORED), None));
    assert_eq!(write(0x1010, 5, b"save"), (Err(AbortCode::NO_SUB_INDEX), None));
    assert_eq!(node.dictionary().read(0x1010, 1).unwrap(), [1, 0, 0, 0]);
    // A device without storage has no such objects.
    let mut bench = Bench::new();
    assert_eq!(bench.write(0x1010, 1, b"save"), Err(AbortCode::NO_OBJECT));
}
