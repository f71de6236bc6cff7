use super::stamps::Stamps;
use super::tally::Tally;
use super::*;
use bus::frames::FrameKind;
use proptest::prelude::*;

const BASE_NS: u64 = 1_700_000_000_000_000_000;

fn frame(message_type: u8) -> [u8; 60] {
    let mut frame = [0; 60];
    frame[12..15].copy_from_slice(&[0x88, 0xAB, message_type]);
    frame
}

fn kernel(at_us: u64) -> Stamps {
    Stamps {
        kernel_ns: Some(BASE_NS + at_us * 1000),
        hardware_ns: None,
    }
}

fn both(kernel_us: u64, hardware_ns: u64) -> Stamps {
    Stamps {
        hardware_ns: Some(hardware_ns),
        ..kernel(kernel_us)
    }
}

fn add(tally: &mut Tally, stamps: Stamps, incoming: bool, frame: &[u8]) {
    tally.add(FrameKind::of(frame), stamps, incoming);
}

#[test]
fn periods_by_hand() {
    let mut tally = Tally::new(Window::open(1000));
    for at_us in [0, 999, 2_001, 3_000, 20_000, 21_000, 1_000_000, 1_001_004] {
        add(&mut tally, kernel(at_us), true, &frame(0x01));
    }
    // Sent frames, frames without a stamp and other frames are no periods.
    add(&mut tally, kernel(1_001_500), false, &frame(0x01));
    add(&mut tally, Stamps::default(), true, &frame(0x01));
    add(&mut tally, kernel(1_001_900), true, &frame(0x01));
    for message_type in [0x03, 0x83, 0x04, 0x05, 0x06, 0x0D] {
        add(&mut tally, kernel(0), true, &frame(message_type));
    }
    add(&mut tally, kernel(0), true, &[0xFF; 60]);
    add(&mut tally, kernel(0), true, &[]);
    let report = tally.report("plk1");
    // 999, 1002, 999, (17000), 1000, (979000), 1004
    assert_eq!((report.n, report.breaks.restarts, report.frames_unstamped), (5, 2, 1));
    assert_eq!(
        (report.breaks.restart_longest_us, report.duration_s),
        (979_000.0, 1.001_004)
    );
    assert!((report.period_mean_us - 1000.8).abs() < 1e-9);
    assert!((report.period_std_us - 3.76f64.sqrt()).abs() < 1e-9);
    assert_eq!((report.period_min_us, report.period_max_us), (999.0, 1004.0));
    assert!((report.period_range_us - 5.0).abs() < 1e-9);
    // To either side: 1, 2, 1, 0, 4.
    let deviation = report.deviation;
    assert_eq!((deviation.n, deviation.min_us, deviation.max_us), (5, 0.0, 4.0));
    assert!((deviation.mean_us - 1.6).abs() < 1e-12);
    assert!((1.0..1.0 + 1.0 / 32.0).contains(&deviation.p50_us), "{deviation:?}");
    assert_eq!(deviation.p99_us, 4.0);
    // 50 ms each: the first holds the four periods up to 21 ms, the last the one after 1 s.
    assert_eq!((report.interval_s, report.interval_maxima_us.len()), (0.05, 21));
    assert_eq!(report.interval_maxima_us[0], 1002.0);
    assert_eq!(report.interval_maxima_us[1..20], [0.0; 19]);
    assert_eq!(report.interval_maxima_us[20], 1004.0);
    let frames = FrameCounts {
        soc: 11,
        preq: 2,
        pres: 1,
        soa: 1,
        asnd: 1,
        other: 1,
        foreign: 2,
        ethercat: 0,
    };
    assert_eq!((report.frames, report.frames.of_bus()), (frames, 17));
    assert_eq!(report.histogram.iter().map(|bucket| bucket.count).sum::<u64>(), 5);
    let table = "\
SoC period at plk1, µs               mean    max range      std dev            n
cycle 1000                       1000.800        5.000        1.939            5
the SoC paused 2 times, 0.979 s at most: not among the periods";
    assert_eq!(report.to_string(), table);
    let json = serde_json::to_value(&report).unwrap();
    for key in [
        "n",
        "period_mean_us",
        "period_std_us",
        "period_range_us",
        "period_max_us",
        "frames",
    ] {
        assert!(!json[key].is_null(), "{key}");
    }
    assert_eq!(serde_json::from_value::<SocReport>(json).unwrap(), report);
}

#[test]
fn socs_left_out_are_counted_from_one_and_a_half_cycles() {
    let mut tally = Tally::new(Window::without_restarts(1000));
    let mut at_us = 0;
    add(&mut tally, kernel(at_us), true, &frame(0x01));
    for period_us in [1000, 1499, 1500, 2499, 2500, 500, 60_000] {
        at_us += period_us;
        add(&mut tally, kernel(at_us), true, &frame(0x01));
    }
    let report = tally.report("plk1");
    // 1 each for 1.5 and 2.499 cycles, 2 for 2.5, 59 for 60. Nothing is a pause where the network is known to run.
    assert_eq!((report.n, report.breaks.restarts), (7, 0));
    assert_eq!((report.breaks.overruns, report.breaks.soc_missing), (4, 63));
    assert_eq!(report.remarks(), ["4 gaps of at least 1.5 cycles: 63 SoC not sent"]);
}

#[test]
fn a_window_takes_no_more_periods_than_wanted() {
    let mut tally = Tally::new(Window {
        periods_max: 3,
        ..Window::open(1000)
    });
    for cycle in 0..10 {
        add(&mut tally, kernel(cycle * 1000), true, &frame(0x01));
    }
    let report = tally.report("plk1");
    assert_eq!((report.n, report.frames.soc, report.duration_s), (3, 10, 0.003));
}

#[test]
fn the_stamps_of_the_card_are_used_where_it_stamps() {
    // The kernel's stamps vary by 40 µs, the card's by 1 µs.
    let mut tally = Tally::new(Window::open(1000));
    for cycle in 0..100 {
        let stamps = both(
            cycle * 1000 + cycle % 2 * 40,
            5_000 + cycle * 1_000_000 + cycle % 2 * 1000,
        );
        add(&mut tally, stamps, true, &frame(0x01));
    }
    let report = tally.report("eth1");
    assert_eq!((report.stamps, report.n), (StampSource::Hardware, 99));
    assert_eq!((report.period_min_us, report.period_max_us), (999.0, 1001.0));
    // A card that stamps one frame in four does not serve.
    let mut tally = Tally::new(Window::open(1000));
    for cycle in 0..100 {
        let stamps = match cycle % 4 {
            0 => both(cycle * 1000, cycle * 1_000_000 + 7),
            _ => kernel(cycle * 1000),
        };
        add(&mut tally, stamps, true, &frame(0x01));
    }
    let report = tally.report("eth1");
    assert_eq!(
        (report.stamps, report.n, report.frames_unstamped),
        (StampSource::Kernel, 99, 0)
    );
}

#[test]
fn a_clock_that_goes_back_makes_no_period() {
    let mut tally = Tally::new(Window::open(1000));
    for cycle in 0..10 {
        let at_ns = if cycle < 5 { 9_000_000_000 } else { 1_000_000_000 } + cycle * 1_000_000;
        add(&mut tally, both(cycle * 1000, at_ns), true, &frame(0x01));
    }
    let report = tally.report("eth1");
    assert_eq!(
        (report.stamps, report.n, report.breaks.clock_steps),
        (StampSource::Hardware, 8, 1)
    );
    assert_eq!((report.period_min_us, report.period_max_us), (1000.0, 1000.0));
}

#[test]
fn an_empty_measurement_is_a_report_of_zeros() {
    let mut tally = Tally::new(Window::open(1000));
    tally.dropped(3);
    let report = tally.report("plk1");
    assert_eq!((report.n, report.period_mean_us, report.period_range_us), (0, 0.0, 0.0));
    assert!(
        report
            .to_string()
            .ends_with("3 frames were not seen for lack of room: some periods are wrong")
    );
}

#[test]
fn a_month_of_cycles_needs_no_more_memory_than_a_minute() {
    let mut tally = Tally::new(Window::without_restarts(1_000_000));
    for second in 0..2_600_000 {
        tally.add(FrameKind::Soc, kernel(second * 1_000_000), true);
    }
    let report = tally.report("plk1");
    assert_eq!((report.n, report.breaks.overruns), (2_599_999, 0));
    assert!((INTERVALS / 2..=INTERVALS).contains(&report.interval_maxima_us.len()));
    assert_eq!(report.histogram.len(), 1);
}

#[test]
fn an_unknown_interface_is_an_error_that_names_it() {
    let error = Analyser::start("no-such-if", None, 1000, None)
        .err()
        .unwrap()
        .to_string();
    assert!(error.starts_with("interface no-such-if: find: "), "{error}");
}

proptest! {
    #[test]
    fn no_frame_and_no_stamp_panics(
        cycle_us in any::<u32>(),
        restart_ns in any::<u64>(),
        frames in prop::collection::vec(
            (any::<Option<u64>>(), any::<Option<u64>>(), any::<bool>(), prop::collection::vec(any::<u8>(), 0..20)), 0..20,
        ),
    ) {
        let mut tally = Tally::new(Window { restart_ns, ..Window::open(cycle_us) });
        for (kernel_ns, hardware_ns, incoming, octets) in &frames {
            let stamps = Stamps { kernel_ns: *kernel_ns, hardware_ns: *hardware_ns };
            add(&mut tally, stamps, *incoming, octets);
            add(&mut tally, stamps, *incoming, &frame(0x01));
        }
        let report = tally.report("x");
        prop_assert!(!report.to_string().is_empty());
        let total = report.frames;
        prop_assert_eq!(total.of_bus() + total.foreign, 2 * frames.len() as u64);
    }
}
