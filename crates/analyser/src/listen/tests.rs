use super::*;
use crate::{Breaks, FrameCounts};
use host::histogram::Summary;

#[test]
fn cycles_are_told_from_the_median_period() {
    for (median_us, cycle_us) in [
        (1000.3, 1000),
        (998.0, 1000),
        (400.0, 400),
        (249.1, 250),
        (333.4, 333),
        (2049.9, 2050),
        (62.5, 63),
        (0.0, 1),
        (f64::NAN, 0),
        (1e12, 4_000_000_000),
    ] {
        assert_eq!(round_cycle(median_us), cycle_us, "{median_us}");
    }
}

fn report() -> SocReport {
    SocReport {
        interface: "eth1".into(),
        cycle_us: 1000,
        n: 600_000,
        duration_s: 600.0,
        period_mean_us: 1000.0004,
        period_range_us: 11.2,
        period_std_us: 0.64,
        deviation: Summary {
            p50_us: 0.1,
            p99_us: 1.2,
            p99_9_us: 4.0,
            p99_99_us: 6.1,
            max_us: 7.25,
            ..Summary::default()
        },
        frames: FrameCounts {
            soc: 600_001,
            preq: 3,
            ..FrameCounts::default()
        },
        why_not_hardware: Some("the interface takes none".into()),
        ..SocReport::default()
    }
}

#[test]
fn the_table_for_people() {
    let expected = "\
SoC period at eth1, µs              mean   max range     std dev           n
cycle 1000                      1000.000      11.200       0.640      600000

distance from nominal, µs            p50         p99       p99.9      p99.99         max
early or late                      0.100       1.200       4.000       6.100       7.250
at 30 m/min, µm                    0.050       0.600       2.000       3.050       3.625

measured for 600.0 s; 0 gaps of at least 1.5 cycles, 0 SoC not sent
stamps of the kernel; none of the network card: the interface takes none
frames: 600001 SoC, 3 PReq, 0 PRes, 0 SoA, 0 ASnd, 0 other POWERLINK, 0 not POWERLINK";
    assert_eq!(table(&report()), expected);
    let bad = SocReport {
        stamps: StampSource::Hardware,
        breaks: Breaks {
            overruns: 1,
            soc_missing: 2,
            ..Breaks::default()
        },
        frames_dropped: 5,
        ..report()
    };
    let text = table(&bad);
    assert!(
        text.contains("; 1 gaps of at least 1.5 cycles, 2 SoC not sent\nstamps of the network card\n"),
        "{text}"
    );
    assert!(
        text.ends_with("\n5 frames were not seen for lack of room: some periods are wrong"),
        "{text}"
    );
    assert!(text.lines().all(|line| line.chars().count() <= 100), "{text}");
}

#[test]
fn silence_is_explained() {
    let heard = |soc, soa, foreign| {
        nothing_heard(&SocReport {
            frames: FrameCounts {
                soc,
                soa,
                foreign,
                ..FrameCounts::default()
            },
            ..report()
        })
    };
    assert!(heard(0, 0, 0).starts_with("eth1: no frame at all. Listen at a network tap"));
    assert!(heard(0, 0, 7).starts_with("eth1: no frame of POWERLINK or EtherCAT, 7 others. "));
    assert!(heard(0, 4, 7).starts_with("eth1: no SoC, 4 other POWERLINK frames: the managing node"));
    assert!(heard(1, 4, 7).starts_with("eth1: 1 SoC only, too few to measure. "));
}

#[test]
fn frames_of_ethercat_are_told_in_its_words() {
    let of = |soc, preq, pres, asnd| SocReport {
        frames: FrameCounts {
            soc,
            preq,
            pres,
            asnd,
            ethercat: soc + preq + pres + asnd,
            ..FrameCounts::default()
        },
        ..report()
    };
    for (report, told) in [
        (
            of(0, 0, 5, 0),
            "eth1: 5 EtherCAT frames, all of them on their way back. ",
        ),
        (
            of(0, 4, 5, 0),
            "eth1: 4 EtherCAT frames with process data, none with the time of a reference clock",
        ),
        (
            of(0, 0, 5, 2),
            "eth1: 7 EtherCAT frames, none with process data: the main device does not run cycles yet",
        ),
        (of(1, 0, 1, 0), "eth1: 1 cycle frame only, too few to measure"),
    ] {
        let text = nothing_heard(&report);
        assert!(text.starts_with(told), "{text}");
    }
    let text = table(&of(600_001, 0, 600_001, 7));
    assert!(text.starts_with("cycle frame period at eth1, µs"), "{text}");
    let frames = "\nframes: 600001 begin a cycle, 0 more with process data, 7 of services, 0 other EtherCAT,\n  600001 on their way \
                  back, 0 not EtherCAT";
    assert!(text.ends_with(frames), "{text}");
    for word in ["SoC", "PReq", "PRes", "POWERLINK"] {
        assert!(!text.contains(word), "{text}");
    }
}

#[test]
fn orders_make_windows_and_unknown_ones_are_refused() {
    let window = Window::without_restarts(1000);
    let place = Place {
        interface: "lo",
        other_end: None,
        capture: None,
        hardware_stamps: false,
    };
    let mut analyser = match Analyser::start_at(&place, window) {
        Ok(analyser) => analyser,
        Err(error) => {
            println!("orders_make_windows ... SKIPPED: {error}");
            return;
        }
    };
    let mut take = |orders: &str| {
        let mut answers = Vec::new();
        let done = take_orders(&mut analyser, window, orders.as_bytes(), &mut answers);
        let answers = String::from_utf8(answers).unwrap();
        let mut lines = answers.lines();
        assert_eq!(lines.next(), Some(READY));
        let reports: Vec<SocReport> = lines.map(|line| serde_json::from_str(line).unwrap()).collect();
        (reports, done.map_err(|error| error.to_string()))
    };
    let (reports, done) = take("begin\nend\n  begin\nend\n");
    assert_eq!((reports.len(), done), (2, Ok(())));
    assert_eq!(
        (reports[0].interface.as_str(), reports[0].cycle_us, reports[0].n),
        ("lo", 1000, 0)
    );
    assert_eq!(reports[0].why_not_hardware.as_deref(), Some("not asked for"));
    // Closed input ends an open window.
    assert_eq!(take("begin\n").0.len(), 1);
    assert_eq!(take("").0.len(), 0);
    assert_eq!(take("end\n").1, Err("order 'end': nothing has begun".into()));
    let (reports, done) = take("begin\nstop\n");
    assert_eq!(
        (reports.len(), done),
        (0, Err("order 'stop': expected 'begin' or 'end'".into()))
    );
    let twice = take("begin\nbegin\n").1;
    assert_eq!(twice, Err("order 'begin': the last window is still open".into()));
}
