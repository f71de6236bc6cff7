use super::*;
use bus::service::{IdentityView, NetworkLive, NodeLive, Why};
use std::path::Path;

/// The demo machine with a running control: node 1 operational, node 2 of a wrong vendor, node 3 never heard of, node 10 not
/// shown yet.
fn view() -> NetworkView {
    let machine = include_str!("../../../../configs/mill3-demo.toml");
    let config = config::parse(machine, Path::new("demo.toml")).unwrap();
    let mut view = NetworkView::from_config(&config);
    view.live = Some(NetworkLive {
        nmt_state: "PRE_OPERATIONAL_1".into(),
        why: Some("PRE_OPERATIONAL_2 waits for mandatory node 2".into()),
        foreign: None,
        cycles: 1234,
        cycles_skipped: 2,
        cycles_overrun: 1,
        async_timeouts: 3,
        bad_frames: 1,
    });
    view.nodes[1].expected.vendor_id = Some(0x12D);
    view.nodes[1].line = Some(41);
    let identity = IdentityView {
        device_type: 0x0002_0192,
        vendor_id: 0,
        product_code: 0,
        revision: 0x0001_0002,
        serial: 7,
        feature_flags: 0,
        response_time_us: 50.0,
        mtu: 300,
        poll_in_octets: 36,
        poll_out_octets: 36,
        configuration_date: 0,
        configuration_time: 0,
        software_date: 0,
        software_time: 0,
        ip_address: "192.168.100.1".into(),
        host_name: "drive".into(),
    };
    let live = |operational, why: Option<&str>, identity| NodeLive {
        operational,
        nmt_state: if operational { "OPERATIONAL" } else { "OFF" }.into(),
        expected_nmt_state: "OPERATIONAL".into(),
        stage: "operational".into(),
        why: why.map(|text| Why {
            text: text.into(),
            object: None,
            expected: None,
            actual: None,
        }),
        last_fault: None,
        identity,
        errors: Vec::new(),
        errors_total: 0,
        polls: 1200,
        lost: 4,
        lost_in_row_max: 2,
        late: 1,
        refused: 0,
        response_max_us: 41.25,
        boots: 1,
        faults: 0,
    };
    view.nodes[0].live = Some(NodeLive {
        last_fault: Some("lost: 4 polls in a row without an answer, 3.0 s ago".into()),
        errors: vec!["8245h E_DLL_LOSS_SOC_TH (occurred), 3.1 s ago".into()],
        errors_total: 3,
        ..live(true, None, Some(identity.clone()))
    });
    let why = "0x1018/1 vendor id is 0x00000000, expected 0x0000012D; tried again in 2.0 s";
    view.nodes[1].live = Some(live(false, Some(why), Some(identity)));
    view.nodes[2].live = Some(live(false, Some("does not answer IdentRequests"), None));
    view
}

fn status() -> Status {
    Status {
        state: protocol::State::Booting,
        pid: 77,
        late_max_us: 12.5,
        cycles_skipped: 2,
        ..Status::default()
    }
}

fn printed(
    show: impl Fn(&NetworkView, Option<&Status>, &mut Vec<u8>) -> io::Result<()>,
    view: &NetworkView,
    status: Option<&Status>,
) -> String {
    let mut out = Vec::new();
    show(view, status, &mut out).unwrap();
    let text = String::from_utf8(out).unwrap();
    for line in text.lines() {
        assert_eq!(line, line.trim_end(), "blanks at the end");
    }
    text
}

#[test]
fn nodes_with_their_identity_and_what_is_wrong() {
    let text = printed(nodes, &view(), Some(&status()));
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(
        lines,
        [
            "mill3-demo: network PRE_OPERATIONAL_1 on plk0, machine booting, process 77",
            "",
            "id  name               device type  vendor      product     revision    serial  state",
            " 1  x-drive  is        0x00020192   0x00000000  0x00000000  0x00010002  7       OPERATIONAL",
            " 2  y-drive  is        0x00020192   0x00000000  0x00000000  0x00010002  7       OFF",
            "             expected  0x00020192   0x0000012D  any         any         any",
            " 3  z-drive  expected  0x00020192   any         any         any         any     not heard of",
            "10  io       expected  0x000F0191   any         any         any         any",
            "",
            "the network is PRE_OPERATIONAL_1: PRE_OPERATIONAL_2 waits for mandatory node 2",
            "node 2 (y-drive) not operational: 0x1018/1 vendor id is 0x00000000, expected 0x0000012D; tried again in 2.0 s ([[bus.node]] line 41)",
            "node 3 (z-drive) not operational: does not answer IdentRequests",
            "node 10 (io): nothing is known yet",
        ]
    );
}

#[test]
fn states_figures_and_history() {
    let text = printed(state, &view(), Some(&status()));
    for line in [
        "1234 cycles of 1000 us; 2 skipped, 1 cut off; 3 silent in the asynchronous slot, 1 unusable frame",
        " 1  x-drive  OPERATIONAL   1200     4       2     1     41.2 us      1         0",
        "10  io       -",
        "  node 1 (x-drive): lost: 4 polls in a row without an answer, 3.0 s ago",
        "  node 1 (x-drive): signalled 8245h E_DLL_LOSS_SOC_TH (occurred), 3.1 s ago",
        "  node 1 (x-drive): and 2 older errors",
    ] {
        assert!(text.lines().any(|own| own == line), "{line}\nis not in\n{text}");
    }
}

#[test]
fn the_mapping_is_a_table() {
    let text = printed(pdo, &view(), Some(&status()));
    let lines: Vec<&str> = text.lines().skip(1).take(5).collect();
    assert_eq!(
        lines,
        [
            "",
            "node 1 (x-drive)",
            "  PReq, to the node: 11 octets                  PRes, from the node: 17 octets",
            "     0..1 | 0x6040    | controlword                0..1 | 0x6041    | statusword",
            "        2 | 0x6060    | mode of operation             2 | 0x6061    | mode displayed",
        ]
    );
}

#[test]
fn what_a_node_sends_stands_in_its_column_beside_the_longest_name() {
    let mut view = view();
    view.nodes[0].outputs[1].index = 0x687A;
    let text = printed(pdo, &view, Some(&status()));
    let rows: Vec<&str> = text.lines().skip(3).take(3).collect();
    assert!(rows[2].contains("target position of axis 1"), "{text}");
    let columns = ["PRes, from", "   0..1 | 0x6041", "      2 | 0x6061"];
    let places: Vec<_> = rows.iter().zip(columns).map(|(row, column)| row.find(column)).collect();
    assert!(
        places[0].is_some() && places.iter().all(|place| *place == places[0]),
        "{text}"
    );
}

#[test]
fn the_budget_takes_the_latency_that_a_node_has_told() {
    let text = printed(|v, _, o| budget(v, o), &view(), Some(&status()));
    // 64 octets with preamble and gap are 6.72 us at 100 Mbit/s; node 1 tells 50 us, node 3 nothing.
    let row = |name: &str| {
        let line = text.lines().find(|line| line.trim_start().starts_with(name)).unwrap();
        line.split_whitespace()
            .skip(1)
            .take(3)
            .map(str::to_owned)
            .collect::<Vec<_>>()
    };
    assert_eq!(row("x-drive")[..2], ["13.4", "50.0"]);
    assert_eq!(row("z-drive")[..2], ["13.4", "143.3"]);
    let last = text.lines().last().unwrap();
    assert!(last.starts_with("together "), "{last}");
}

#[test]
fn without_a_control_it_says_so_and_finds_no_trouble() {
    let mut view = view();
    view.live = None;
    view.nodes.iter_mut().for_each(|node| node.live = None);
    assert!(troubles(&view, None).is_empty());
    // All that is known of a silenced network is from before.
    let silenced = Status {
        state: protocol::State::Silenced,
        ..Status::default()
    };
    let said = machine::faults::silenced(true, false).text;
    assert_eq!(troubles(&view, Some(&silenced)), [said.as_str()]);
    let mut page = Vec::new();
    report(&view, Some(&silenced), &mut page).unwrap();
    let page = String::from_utf8(page).unwrap();
    assert!(page.contains(&said) && !page.contains("no trouble"), "{page}");
    let text = printed(report, &view, None);
    assert!(
        text.contains("mill3-demo: no control is running; this is what demo.toml says\n"),
        "{text}"
    );
    assert!(!text.contains("no trouble"));
}

#[test]
fn a_report_fits_a_page() {
    let text = printed(report, &view(), Some(&status()));
    assert!(text.lines().count() <= 75, "{} lines", text.lines().count());
    let too_long: Vec<&str> = text.lines().filter(|line| line.len() > 140).collect();
    assert!(too_long.is_empty(), "{too_long:?}");
    assert!(text.contains("cycles begin up to 12.5 us late, 2 were skipped\n"));
}

/// The demo machine on EtherCAT, all of it in OP.
fn ethercat_view() -> NetworkView {
    let machine = include_str!("../../../../configs/mill3-ethercat.toml");
    let powerlink = view();
    let mut view = NetworkView::from_config(&config::parse(machine, Path::new("demo.toml")).unwrap());
    let live = powerlink.nodes[0].live.clone().unwrap();
    for node in &mut view.nodes {
        node.live = Some(NodeLive {
            nmt_state: "OP".into(),
            expected_nmt_state: "OP".into(),
            stage: "at position 1".into(),
            last_fault: None,
            errors: Vec::new(),
            errors_total: 0,
            refused: 17,
            identity: live.identity.clone().map(|identity| IdentityView {
                device_type: 0,
                ..identity
            }),
            ..live.clone()
        });
    }
    view.live = Some(NetworkLive {
        nmt_state: "OP".into(),
        why: None,
        ..powerlink.live.unwrap()
    });
    view
}

#[test]
fn ethercat_is_told_in_its_own_words_and_op_is_no_trouble() {
    let view = ethercat_view();
    assert!(
        troubles(&view, Some(&status())).is_empty(),
        "{:?}",
        troubles(&view, Some(&status()))
    );
    let text = printed(report, &view, Some(&status()));
    for word in [
        "PReq",
        "PRes",
        "SoC",
        "asynchronous",
        "managing",
        "NMT",
        "OPERATIONAL",
        "polls",
        "POWERLINK",
    ] {
        assert!(!text.contains(word), "{word} is in\n{text}");
    }
    for line in [
        "1234 cycles of 1000 us; 3 mailbox frames lost, 1 late frame",
        "no trouble: every node is operational",
        "   1  x-drive  OP          1200     4       2         17     41.2 us      1         0",
        "  RxPDO, to the SubDevice: 11 octets            TxPDO, from the SubDevice: 17 octets",
    ] {
        assert!(text.lines().any(|own| own == line), "{line}\nis not in\n{text}");
    }
    // No device type: nobody has asked for it.
    let node = [
        "1",
        "x-drive",
        "is",
        "-",
        "0x00000000",
        "0x00000000",
        "0x00010002",
        "7",
        "OP",
    ];
    assert!(text.lines().any(|own| own.split_whitespace().eq(node)), "{text}");
    let mut view = ethercat_view();
    view.live.as_mut().unwrap().nmt_state = "INIT".into();
    view.live.as_mut().unwrap().why = Some("reads EEPROMs".into());
    assert_eq!(troubles(&view, Some(&status())), ["the network is INIT: reads EEPROMs"]);
}
