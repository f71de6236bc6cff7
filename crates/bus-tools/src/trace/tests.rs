use super::*;
use powerlink::link::pcap::PcapWriter;
use powerlink::nmt::{NmtCommand, NmtState, NodeList};
use powerlink::wire::{
    Asnd, Header, NmtCommandFrame, NmtRequestFrame, Pres, RequestedService, Requests, Soa, Soc, StatusResponse,
    multicast, node,
};
use proptest::prelude::*;

/// The boot of one node by another vendor's managing node; see `crates/powerlink/tests/data/README.md`.
const BOOT: &[u8] = include_bytes!("../../../../crates/powerlink/tests/data/openpowerlink-node1-boot.pcap");

fn args() -> TraceArgs {
    TraceArgs {
        file: "test.pcap".into(),
        node: None,
        from: None,
        to: None,
        summary: false,
    }
}

fn lines(args: &TraceArgs, octets: &[u8]) -> (Vec<String>, Ended) {
    let (text, ended) = trace_octets(args, octets, false).unwrap();
    let mut lines = text.lines().map(str::to_owned);
    assert_eq!(lines.next().as_deref(), Some(HEAD));
    (lines.collect(), ended)
}

#[test]
fn a_boot_of_another_vendor_in_words() {
    let (lines, ended) = lines(&args(), BOOT);
    assert!(!ended.trouble);
    let expected = [
        "    0.005163      -  SoA     240  all  PreOp1              will send an NMT command itself",
        "    0.005169      -  ASnd    240  all  -                   ResetNode to all nodes",
        "    0.509961      1  SoC     240  all  -                   start of cycle, relative time 0 us",
        "    0.510003      1  SoA     240  all  PreOp2              IdentRequest to node 1",
        "    0.510065      1  ASnd      1  all  PreOp1              IdentResponse: type 0x000F0191, revision 0x20007, \"01-ffffffff\"",
    ];
    assert_eq!(lines[10..15], expected);
    // Frames of the boot, each told once and in this order.
    let mut rest = lines.iter();
    for meaning in [
        "PS     start of cycle, relative time 20000 us",
        "SDO opens a connection to node 1",
        "ER     StatusRequest to node 1",
        "EC     StatusResponse: no errors; wants to send 1",
        "RD     1 octet: 10",
        "no data; wants to send 1",
        "SDO agrees to a connection with the managing node",
        "SDO confirms the connection to node 1",
        "SDO write 0x1011/1 = 0x64616F6C (load) to node 1",
        "SDO refused: 0x1011/1: object does not exist in the object dictionary (0x06020000)",
        "SDO write 0x1006 = 10000 (0x2710) to node 1",
        "SDO answer: 0x1006 is written",
        "SDO write 0x1A00/1 = 0x6000/1, 8 bits at bit 0 to node 1",
        "ResetConfiguration to node 1",
        "EnableReadyToOperate to node 1",
        "StartNode to node 1",
    ] {
        assert!(
            rest.any(|line| line.ends_with(meaning)),
            "no {meaning}, or not in this order"
        );
    }
    assert!(lines.iter().all(|line| line.len() <= 143));
}

#[test]
fn the_summary_of_that_boot() {
    let summary = TraceArgs {
        summary: true,
        ..args()
    };
    let (json, ended) = trace_octets(&summary, BOOT, true).unwrap();
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["cycles"]["period_us"].as_f64().unwrap().round(), 10_000.0);
    let nodes = json["nodes"].as_array().unwrap();
    assert_eq!(
        nodes
            .iter()
            .map(|node| node["node"].as_u64().unwrap())
            .collect::<Vec<_>>(),
        [1, 240]
    );
    let states: Vec<&str> = (nodes[0]["states"].as_array().unwrap().iter())
        .map(|change| change["nmt_state"].as_str().unwrap())
        .collect();
    assert_eq!(states, ["PreOp1", "PreOp2", "ReadyToOp", "Operational"]);
    assert_eq!(nodes[0]["identity"]["device_type"], 0x000F_0191);
    assert_eq!(nodes[0]["lost"], 0);
    assert_eq!(nodes[0]["polls"], nodes[0]["answers"]);
    // The recorded node knows neither store nor restore; the excerpt leaves out half a second.
    let trouble: Vec<&str> = (json["trouble"].as_array().unwrap().iter())
        .map(|line| line.as_str().unwrap())
        .collect();
    let no_object = "object does not exist in the object dictionary (0x06020000)";
    assert_eq!(
        trouble,
        [
            format!("node 1: SDO refused: 0x1011/1: {no_object} at 0.851289 s"),
            format!("node 1: SDO refused: 0x1010/1: {no_object} at 2.451294 s"),
            "1 cycle took longer than one and a half, 510.000 ms at the most".to_owned(),
        ]
    );
    assert!(ended.trouble);
}

#[test]
fn node_and_time_choose_frames() {
    let (all, _) = lines(&args(), BOOT);
    let (of_node, _) = lines(
        &TraceArgs {
            node: Some(1),
            ..args()
        },
        BOOT,
    );
    assert!(of_node.len() < all.len());
    assert!(
        of_node
            .iter()
            .all(|line| all.contains(line) && !line.contains("  SoC  "))
    );
    // SoAs that invite the node stay.
    assert!(of_node.iter().any(|line| line.ends_with("IdentRequest to node 1")));
    let (nobody, _) = lines(
        &TraceArgs {
            node: Some(9),
            ..args()
        },
        BOOT,
    );
    assert!(nobody.is_empty());
    let cut = TraceArgs {
        from: Some(0.509961),
        to: Some(0.51),
        ..args()
    };
    assert_eq!(lines(&cut, BOOT).0, all[12..13]);
    let wrong = TraceArgs {
        from: Some(2.0),
        to: Some(1.0),
        ..args()
    };
    let error = trace(&wrong, false, &mut Vec::new()).unwrap_err();
    assert_eq!(error.to_string(), "--from 2 is behind --to 1");
}

const MN: [u8; 6] = [2, 0, 0, 0, 0, 0xF0];
const CN: [u8; 6] = [2, 0, 0, 0, 0, 3];

/// A capture of the given frames, one every 100 us.
fn capture(frames: &[Vec<u8>]) -> Vec<u8> {
    let mut writer = PcapWriter::new(Vec::new()).unwrap();
    for (number, frame) in (0..).zip(frames) {
        writer.write(1_000_000_000 + number * 100_000, frame).unwrap();
    }
    writer.finish().unwrap()
}

fn frame(source: [u8; 6], from: u8, to: u8, frame: Frame<'_>) -> Vec<u8> {
    let header = Header {
        destination: multicast::ASND,
        source,
        destination_node: to,
        source_node: from,
    };
    let mut buffer = [0; 1514];
    let len = frame.emit(&header, &mut buffer).unwrap();
    buffer[..len].to_vec()
}

fn soc() -> Vec<u8> {
    let mut octets = [0; 60];
    octets[12..17].copy_from_slice(&[0x88, 0xAB, 0x01, 0xFF, 0xF0]);
    octets[6..12].copy_from_slice(&MN);
    let Content::Frame(_, Frame::Soc(Soc { .. })) = decode::parse(&octets) else {
        panic!("no SoC")
    };
    octets.to_vec()
}

fn preq(to: u8) -> Vec<u8> {
    let mut octets = vec![0; 60];
    octets[12..17].copy_from_slice(&[0x88, 0xAB, 0x03, to, 0xF0]);
    octets[6..12].copy_from_slice(&MN);
    octets
}

fn pres(from: u8) -> Vec<u8> {
    let pres = Pres {
        nmt_state: NmtState::Operational,
        multiplexed: true,
        exception_new: true,
        ready: true,
        requests: Requests { count: 7, priority: 7 },
        pdo_version: 0x21,
        payload: &[0xAB],
    };
    frame(CN, from, node::BROADCAST, Frame::Pres(pres))
}

fn soa(source: [u8; 6], service: RequestedService, target: u8) -> Vec<u8> {
    let soa = Soa::new(NmtState::Operational, service, target);
    frame(source, node::MN, node::BROADCAST, Frame::Soa(soa))
}

fn command(to: u8, command: NmtCommandFrame) -> Vec<u8> {
    frame(MN, node::MN, to, Frame::Asnd(Asnd::NmtCommand(command)))
}

#[test]
fn what_is_rare_on_the_wire_has_words_too() {
    let mut list = NodeList([0; 32]);
    list.insert(3);
    list.insert(110);
    let mut reset = NmtCommandFrame::plain(NmtCommand::ResetNode);
    reset.data[..2].copy_from_slice(&0x8243u16.to_le_bytes());
    let mut refused = NmtCommandFrame::plain(NmtCommand::InvalidService);
    refused.data[0] = 0x21;
    let request = NmtRequestFrame {
        command: NmtCommand::IdentRequest,
        target: 4,
        data: [0; 32],
    };
    let mut entries = [0; 40];
    entries[..4].copy_from_slice(&[0x02, 0x30, 0x45, 0x82]);
    let status = StatusResponse {
        exception_clear: false,
        exception_new: true,
        requests: Requests::default(),
        nmt_state: NmtState::Unknown(0x11),
        static_errors: [0x81, 0, 0, 0, 0, 0, 0, 0],
        entries: powerlink::wire::ErrorEntries(&entries),
    };
    // Initiate of a segmented write, then a segment; answer to a read that was never seen.
    let initiate = [
        2, 6, 0, 0, 0, 9, 0x10, 1, 10, 0, 0, 0, 0xE8, 3, 0, 0, 0x22, 0x1F, 1, 0, 0xAA, 0xBB,
    ];
    let segment = [2, 10, 0, 0, 0, 9, 0x20, 1, 1, 0, 0, 0, 0xCC];
    let answered = [2, 10, 0, 0, 0, 1, 0x80, 2, 2, 0, 0, 0, 0x11, 0x22];
    let short = [2, 6, 0, 0, 0, 9, 0, 1, 0xFF, 0xFF, 0, 0];
    let mut odd = soc();
    odd[14] = 0x42;
    let frames = [
        command(3, reset),
        command(255, NmtCommandFrame::extended(NmtCommand::StartNodeEx, list)),
        command(255, NmtCommandFrame::extended(NmtCommand::PublishActiveNodes, list)),
        command(
            255,
            NmtCommandFrame::extended(NmtCommand::StopNodeEx, NodeList([0; 32])),
        ),
        command(3, refused),
        command(3, NmtCommandFrame::plain(NmtCommand::Unknown(0x77))),
        frame(CN, 3, 240, Frame::Asnd(Asnd::NmtRequest(request))),
        frame(CN, 3, 255, Frame::Asnd(Asnd::StatusResponse(status))),
        soa(MN, RequestedService::Unknown(0x33), 3),
        soa(MN, RequestedService::NmtRequestInvite, 3),
        pres(3),
        frame(MN, 240, 3, Frame::Asnd(Asnd::Sdo(&initiate))),
        frame(MN, 240, 3, Frame::Asnd(Asnd::Sdo(&segment))),
        frame(CN, 3, 240, Frame::Asnd(Asnd::Sdo(&answered))),
        frame(MN, 240, 3, Frame::Asnd(Asnd::Sdo(&short))),
        odd,
        vec![0; 13],
        [vec![0xFF; 12], vec![0x08, 0x06], vec![0; 46]].concat(),
    ];
    let (lines, ended) = lines(&args(), &capture(&frames));
    let meanings: Vec<&str> = lines.iter().map(|line| line[58.min(line.len())..].trim()).collect();
    assert_eq!(
        meanings,
        [
            "ResetNode to node 3 because of 0x8243 (too many answers to polls were missed)",
            "StartNodeEx to nodes 3, 110",
            "PublishActiveNodes: nodes 3, 110",
            "StopNodeEx to no node",
            "refuses the request StartNode of node 3",
            "unknown NMT command 0x77 to node 3",
            "asks the managing node for IdentRequest to node 4",
            "StatusResponse: error register 0x81; error 8245h E_DLL_LOSS_SOC_TH: too many starts of cycle were missed (occurred)",
            "unknown service 0x33 to node 3",
            "invites node 3 to send an NMT request",
            "EN  1 octet: ab, mapping version 2.1; wants to send 7 or more, NMT first",
            "SDO write 0x1F22/1 = 992 octets in several frames to node 3",
            "SDO write to node 3, next frame, 1 octet",
            "SDO answer: read: 11 22",
            "SDO command cut off: it announces more octets than there are",
            "cannot be read: unknown message type 0x42",
            "cannot be read: frame has 13 octets, needs 17",
            "neither POWERLINK nor EtherCAT: EtherType 0x0806",
        ]
    );
    assert_eq!(ended.unreadable, 2);
    assert!(ended.trouble);
}

#[test]
fn sdo_in_udp() {
    // IPv4 without options, UDP 3819, then MessageType, destination, source, ServiceID and the SDO: read of 0x1018/1.
    let mut datagram = vec![0; 14 + 20 + 8 + 4];
    datagram.extend([2, 6, 0, 0, 0, 5, 0, 2, 4, 0, 0, 0, 0x18, 0x10, 1, 0]);
    let total = (datagram.len() - 14) as u16;
    datagram[12..14].copy_from_slice(&[0x08, 0x00]);
    datagram[14] = 0x45;
    datagram[16..18].copy_from_slice(&total.to_be_bytes());
    datagram[23] = 17;
    datagram[36..38].copy_from_slice(&3819u16.to_be_bytes());
    datagram[42..46].copy_from_slice(&[0x06, 3, 240, 0x05]);
    let (lines, _) = lines(&args(), &capture(&[datagram.clone()]));
    let expected = "    0.000000      -  UDP     240    3  -                   SDO read 0x1018/1 of node 3";
    assert_eq!(lines, [expected]);
    // What belongs to somebody else is not taken for SDO.
    datagram[36..38].copy_from_slice(&53u16.to_be_bytes());
    assert_eq!(decode::parse(&datagram), Content::Other(0x0800));
}

#[test]
fn lost_answers_a_second_master_and_long_cycles_are_trouble() {
    let other = [2, 0, 0, 0, 0, 0xEE];
    let mut frames = Vec::new();
    for cycle in 0..10 {
        frames.extend([soc(), preq(3)]);
        // Lost in cycles 2, 3 and 7.
        if ![2, 3, 7].contains(&cycle) {
            frames.push(pres(3));
        } else {
            frames.push(vec![0; 60]);
        }
        frames.push(soa(MN, RequestedService::StatusRequest, 3));
    }
    frames.extend(vec![vec![0; 60]; 8]);
    frames.extend([soc(), soa(other, RequestedService::NoService, 0)]);
    let summary = TraceArgs {
        summary: true,
        ..args()
    };
    let (text, ended) = trace_octets(&summary, &capture(&frames), false).unwrap();
    assert!(ended.trouble);
    let trouble: Vec<&str> = text.lines().skip_while(|line| *line != "trouble").skip(1).collect();
    assert_eq!(
        trouble,
        [
            "  a second managing node is on the wire: 02:00:00:00:00:ee at 0.004900 s",
            "  1 cycle took longer than one and a half, 1.200 ms at the most",
            "  node 3: 3 of 10 polls without an answer, 2 in a row at the most, first at 0.001100 s",
        ]
    );
    let row = text.lines().find(|line| line.starts_with("   3  02:")).unwrap();
    let columns: Vec<&str> = row.split_whitespace().collect();
    assert_eq!(
        columns,
        [
            "3",
            "02:00:00:00:00:03",
            "10",
            "3",
            "2",
            "100.0",
            "100.0",
            "100.0",
            "10",
            "10"
        ]
    );
}

#[test]
fn damaged_files_say_where() {
    let (all, _) = lines(&args(), BOOT);
    // Within the last frame.
    let (most, ended) = lines(&args(), &BOOT[..BOOT.len() - 1]);
    assert_eq!(most.len(), all.len() - 1);
    let damage = ended.damage.unwrap().to_string();
    assert!(damage.starts_with("offset "), "{damage}");
    assert!(ended.trouble);
    for (octets, expected) in [
        (&b""[..], "offset 0: expected 24 octets, 0 are left"),
        (
            &[0; 24],
            "magic number 0x00000000 is neither that of a pcap file nor of a pcapng file",
        ),
        (
            &[
                0x0A, 0x0D, 0x0D, 0x0A, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
            ],
            "offset 0: no block of a pcapng file",
        ),
    ] {
        let Err(error) = trace_octets(&args(), octets, false) else {
            panic!("{expected}")
        };
        assert_eq!(error.to_string(), expected);
    }
}

#[test]
fn times_are_exact() {
    assert_eq!(time(0), "0.000000");
    assert_eq!(time(1_000_001_999), "1.000001");
    assert_eq!(time(-1_500_000_000), "-1.500000");
}

proptest! {
    #[test]
    fn no_file_panics(mut octets in prop::collection::vec(any::<u8>(), 0..600), at in 0..BOOT.len(), summary: bool) {
        let args = TraceArgs { summary, ..args() };
        // Any octets behind a file header, and a capture with octets of it replaced.
        let mut file = BOOT[..24].to_vec();
        file.append(&mut octets.clone());
        let _ = trace_octets(&args, &file, false);
        let mut file = BOOT[..BOOT.len().min(20_000)].to_vec();
        let at = at.min(file.len() - 1);
        let room = (file.len() - at).min(octets.len()).min(40);
        octets.truncate(room);
        file[at..at + room].copy_from_slice(&octets);
        let _ = trace_octets(&args, &file, true);
    }

    #[test]
    fn no_frame_panics(octets in prop::collection::vec(any::<u8>(), 0..100), kind in 0u8..16, service in 0u8..8) {
        let mut frame = vec![0; 12];
        frame.extend([0x88, 0xAB, kind, 3, 240, service]);
        frame.extend(octets);
        let file = capture(&[frame.clone(), frame[..frame.len() / 2].to_vec()]);
        let (lines, _) = lines(&args(), &file);
        prop_assert_eq!(lines.len(), 2);
    }
}

#[test]
fn a_frame_of_ethercat_is_told_there_and_back() {
    use ethercat::wire::{BROADCAST, Command, FrameWriter, MAC_PASSED, register};
    let mut buffer = [0; 1514];
    let mut writer = FrameWriter::new(&mut buffer, BROADCAST, [0x10; 6]).unwrap();
    writer
        .push(Command::Frmw, 1, register::station(0x1001, 0x0910), 8)
        .unwrap();
    writer.push(Command::Aprd, 1, register::position(2, 0x0130), 2).unwrap();
    writer.push(Command::Lrw, 1, 0x10, 7).unwrap();
    let length = writer.finish();
    let told = |octets: &[u8]| decode::Decoder::default().line(&decode::parse(octets));
    let line = told(&buffer[..length]);
    let words = "FRMW 1001h 0910h/8; APRD position 3 0130h/2; LRW logical 00000010h/7";
    assert_eq!((line.kind, line.what.as_str(), line.trouble), ("ECAT", words, false));
    // As the devices would send it back, where the last one was missing.
    buffer[6] |= MAC_PASSED;
    let places: Vec<usize> = ethercat::wire::Frame::parse(&buffer[..length])
        .unwrap()
        .datagrams()
        .map(|datagram| datagram.at + 10 + datagram.data.len())
        .collect();
    for (place, counter) in places.into_iter().zip([3, 1, 0]) {
        buffer[place] = counter;
    }
    let line = told(&buffer[..length]);
    let words = "FRMW 1001h 0910h/8, working counter 3; APRD 0130h/2, working counter 1; LRW logical 00000010h/7, \
                 working counter 0";
    assert_eq!(
        (line.flags.as_slice(), line.what.as_str(), line.trouble),
        (&["back"][..], words, true)
    );
}

/// The start of a network of EtherCAT, as it is sent and as it comes back: states, a refused SDO, an EEPROM, a working counter that
/// falls, a frame that is lost and one that is spoilt.
#[test]
fn the_summary_of_a_capture_of_ethercat() {
    use ethercat::wire::coe::{Message, Object, SdoResponse};
    use ethercat::wire::{BROADCAST, Command, FrameWriter, MAC_PASSED, register};
    let mut writer = PcapWriter::new(Vec::new()).unwrap();
    let mut at_ns = 0;
    let mut send = |datagrams: &[(Command, u32, &[u8], u16)], comes_back: bool| {
        let mut buffer = [0; 1514];
        let mut frame = FrameWriter::new(&mut buffer, BROADCAST, [0x10; 6]).unwrap();
        for (command, address, data, _) in datagrams {
            frame.push_data(*command, 1, *address, data).unwrap();
        }
        let length = frame.finish();
        at_ns += 1_000_000;
        writer.write(at_ns, &buffer[..length]).unwrap();
        if comes_back {
            buffer[6] |= MAC_PASSED;
            let places: Vec<usize> = ethercat::wire::Frame::parse(&buffer[..length])
                .unwrap()
                .datagrams()
                .map(|datagram| datagram.data_at() + datagram.data.len())
                .collect();
            for (place, (.., counter)) in places.into_iter().zip(datagrams) {
                buffer[place..place + 2].copy_from_slice(&counter.to_le_bytes());
            }
            writer.write(at_ns + 10_000, &buffer[..length]).unwrap();
        }
    };
    let status = register::station(0x1001, register::AL_STATUS);
    send(
        &[(
            Command::Fpwr,
            register::station(0x1001, register::EEPROM_CONTROL),
            &[0, 1, 0, 0, 0, 0],
            1,
        )],
        true,
    );
    send(&[(Command::Fprd, status, &[1, 0, 0, 0, 0, 0], 1)], true);
    // Mirrored by a chip without firmware: no error.
    send(&[(Command::Fprd, status, &[0x12, 0, 0, 0, 0, 0], 1)], true);
    let abort = Message::Response(SdoResponse::Abort {
        object: Object {
            index: 0x1C12,
            sub: 0,
            complete: false,
        },
        code: obd::AbortCode::NO_OBJECT,
    });
    let mut mailbox = [0; 64];
    abort.emit(1, &mut mailbox).unwrap();
    send(&[(Command::Fprd, register::station(0x1001, 0x1080), &mailbox, 1)], true);
    // An empty mailbox.
    send(&[(Command::Fprd, register::station(0x1001, 0x1080), &[0; 64], 0)], true);
    send(&[(Command::Fprd, status, &[0x12, 0, 0, 0, 0x1E, 0], 1)], true);
    for counter in [1, 3, 3, 2, 3] {
        send(&[(Command::Lrw, 0x10, &[0; 7], counter)], true);
    }
    send(&[(Command::Lrw, 0x10, &[0; 7], 0)], false);
    let mut file = writer.finish().unwrap();
    let mut spoilt = PcapWriter::new(Vec::new()).unwrap();
    let mut octets = [0; 60];
    octets[12..16].copy_from_slice(&[0x88, 0xA4, 0xFF, 0x17]);
    spoilt.write(20_000_000, &octets).unwrap();
    file.extend(&spoilt.finish().unwrap()[24..]);

    let summary = TraceArgs {
        summary: true,
        ..args()
    };
    let (json, ended) = trace_octets(&summary, &file, true).unwrap();
    assert!(ended.trouble && ended.unreadable == 1);
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let found = &json["ethercat"];
    assert_eq!((&found["sent"], &found["back"]), (&json!(12), &json!(11)));
    let device = &found["devices"][0];
    let states: Vec<&str> = device["states"]
        .as_array()
        .unwrap()
        .iter()
        .map(|it| it["al_state"].as_str().unwrap())
        .collect();
    assert_eq!((&device["station"], states), (&json!(0x1001), vec!["INIT", "PRE-OP"]));
    assert_eq!(
        (&device["mails"], &device["refused"], &device["eeprom_reads"]),
        (&json!(1), &json!(1), &json!(1))
    );
    assert_eq!(found["process_data"][0]["working_counter"], 3);
    let trouble: Vec<&str> = json["trouble"]
        .as_array()
        .unwrap()
        .iter()
        .map(|line| line.as_str().unwrap())
        .collect();
    assert_eq!(trouble.len(), 5, "{trouble:#?}");
    assert!(
        trouble[0].starts_with("device 1001h refused SDO 1C12h:0: "),
        "{trouble:#?}"
    );
    assert!(
        trouble[1].starts_with("device 1001h is in PRE-OP with an error: 001Eh"),
        "{trouble:#?}"
    );
    assert!(
        trouble[2].starts_with("frame EtherCAT that cannot be read"),
        "{trouble:#?}"
    );
    assert_eq!(trouble[3], "1 of 12 frames of EtherCAT did not come back");
    assert!(
        trouble[4].starts_with("LRW 00000010h/7: working counter below 3 in 1 of 5, 2 at the least"),
        "{trouble:#?}"
    );
    let (text, _) = trace_octets(&summary, &file, false).unwrap();
    assert!(
        text.contains("1001h") && text.contains("INIT") && !text.contains("less than two SoC"),
        "{text}"
    );
}
