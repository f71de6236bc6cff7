//! Distributed clocks: delays, offsets, the loop that follows, SYNC0.

use super::*;
use crate::wire::register::{AlStatusCode, difference_ns};

fn with_clock(gain_ppb: i64, start_ns: u64) -> SubDeviceConfig {
    SubDeviceConfig {
        clock: Some(ClockConfig {
            gain_ppb,
            start_ns,
            wide: true,
        }),
        ..drive()
    }
}

fn u64_at(bench: &mut Bench, station: u16, at: u16) -> u64 {
    let data = bench.read(station, at, 8);
    u64::from_le_bytes(data.try_into().unwrap())
}

fn times(bench: &mut Bench, station: u16) -> [u32; 4] {
    register::receive_times(&bench.read(station, register::DC_RECEIVE_TIMES, 16)).unwrap()
}

#[test]
fn receive_times_tell_the_way_of_a_frame() {
    let mut bench = Bench::new(vec![
        with_clock(0, 1_000_000),
        with_clock(0, 5_000_000_000_000),
        with_clock(0, 0),
    ]);
    bench.segment.device_mut(2).faults.garbage = 0x6C72_6556;
    assert_eq!(
        bench
            .send(Command::Bwr, register::station(0, register::DC_RECEIVE_TIMES), &[0; 4])
            .1,
        3
    );
    let all: Vec<[u32; 4]> = (0x1001..=0x1003).map(|station| times(&mut bench, station)).collect();
    let round = |times: &[u32; 4]| times[1].wrapping_sub(times[0]);
    assert_eq!(
        (round(&all[0]), round(&all[1])),
        (2000, 1000),
        "500 ns a cable, there and back"
    );
    assert_eq!(all[2][1], 0x6C72_6556, "a closed port");
    let unit = u64_at(&mut bench, 0x1002, register::DC_UNIT_TIME);
    assert_eq!(unit as u32, all[1][0]);
    assert!(unit > 5_000_000_000_000);
}

/// A tree: a coupler with two terminals at port 3 and a drive at port 1; frames go to port 3 first.
#[test]
fn ports_are_passed_in_the_order_0_3_1_2() {
    let mut segment = Segment::new();
    segment.push(SubDevice::new(drive(), 0), 100);
    segment.push_at(SubDevice::new(drive(), 0), Some((0, 3)), 145);
    segment.push_at(SubDevice::new(drive(), 0), Some((1, 1)), 155);
    segment.push_at(SubDevice::new(drive(), 0), Some((0, 1)), 785);
    segment.push_at(SubDevice::new(drive(), 0), Some((3, 1)), 155);
    let mut bench = Bench {
        segment,
        now_ns: 1_000_000,
        counter: 0,
    };
    bench.address();
    bench.send(Command::Bwr, register::station(0, register::DC_RECEIVE_TIMES), &[0; 4]);
    let all: Vec<[u32; 4]> = (0x1001..=0x1005).map(|station| times(&mut bench, station)).collect();
    let start = all[0][0];
    let since: Vec<Vec<u32>> = all
        .iter()
        .map(|times| times.iter().map(|time| time.wrapping_sub(start)).collect())
        .collect();
    // All clocks started at 0 together: entries are the delays.
    let entries: Vec<u32> = since.iter().map(|times| times[0]).collect();
    assert_eq!(entries, [0, 145, 300, 600 + 785, 600 + 940]);
    assert_eq!((since[0][3], since[0][1]), (600, 600 + 1880));
}

#[test]
fn clocks_follow_the_reference_and_tell_how_far_they_are_off() {
    let mut bench = Bench::new(vec![with_clock(0, 123_456_789), with_clock(50_000, 77_000_000_000)]);
    // Offsets, so that both show the same, but for 30 µs.
    let (first, second) = (
        bench.segment.device(0).system_ns(0).unwrap(),
        bench.segment.device(1).system_ns(0).unwrap(),
    );
    let offset = first.wrapping_sub(second).wrapping_add(30_000);
    bench.write(0x1002, register::DC_OFFSET, &offset.to_le_bytes());
    bench.write(0x1002, register::DC_DELAY, &500_u32.to_le_bytes());
    bench.write(0x1002, register::DC_SPEED_START, &0x1000_u16.to_le_bytes());
    let difference = |bench: &mut Bench| {
        let data = bench.read(0x1002, register::DC_DIFFERENCE, 4);
        difference_ns(u32::from_le_bytes(data.try_into().unwrap()))
    };
    let frmw = register::station(0x1001, register::DC_SYSTEM_TIME);
    assert_eq!(bench.send(Command::Frmw, frmw, &[0; 8]).1, 2);
    assert!(
        difference(&mut bench) > 1000,
        "the second one is ahead: {}",
        difference(&mut bench)
    );
    for _ in 0..1000 {
        bench.now_ns += 1_000_000;
        bench.send(Command::Frmw, frmw, &[0; 8]);
    }
    assert!(difference(&mut bench).abs() <= 100, "{}", difference(&mut bench));
    let now_ns = bench.now_ns;
    let [one, other] = [0, 1].map(|number| bench.segment.device(number).system_ns(now_ns).unwrap());
    assert!(one.abs_diff(other) < 300, "{one} {other}");
    // A write does not set the clock.
    bench.write(0x1002, register::DC_SYSTEM_TIME, &[0; 8]);
    assert!(bench.segment.device(1).system_ns(now_ns).unwrap().abs_diff(other) <= 0x1000);
    // Four octets do, too; and by ARMW.
    let armw = register::position(0, register::DC_SYSTEM_TIME);
    assert_eq!(bench.send(Command::Armw, armw, &[0; 4]).1, 2);
}

fn start_sync0(bench: &mut Bench, ahead_ns: u64, cycle_ns: u32) -> u64 {
    let start = u64_at(bench, 0x1001, register::DC_SYSTEM_TIME) + ahead_ns;
    bench.write(0x1001, register::DC_SYNC0_START, &start.to_le_bytes());
    bench.write(0x1001, register::DC_SYNC0_CYCLE, &cycle_ns.to_le_bytes());
    bench.write(0x1001, register::DC_SYNC_ACTIVATION, &[3]);
    start
}

#[test]
fn sync0_runs_over_the_end_of_32_bits() {
    let end = u64::from(u32::MAX) + 1;
    for wide in [true, false] {
        let clock = ClockConfig {
            gain_ppb: 0,
            start_ns: end - 10_000_000,
            wide,
        };
        let mut bench = Bench::new(vec![SubDeviceConfig {
            clock: Some(clock),
            ..drive()
        }]);
        let start = start_sync0(&mut bench, 2_000_000, 1_000_000);
        assert_eq!(bench.segment.device(0).pulses(), 0);
        bench.wait(1_900_000);
        assert_eq!(bench.segment.device(0).pulses(), 0);
        bench.wait(20_000_000);
        let pulses = bench.segment.device(0).pulses();
        assert!((19..=21).contains(&pulses), "{wide}: {pulses}");
        let next = u64_at(&mut bench, 0x1001, register::DC_SYNC0_START);
        let expected = start + u64::from(pulses) * 1_000_000;
        assert_eq!(next, if wide { expected } else { expected & 0xFFFF_FFFF });
    }
}

#[test]
fn sync0_in_the_past_gives_no_pulse_and_a_cycle_of_0_gives_one() {
    let mut bench = Bench::new(vec![with_clock(0, 1_000_000_000)]);
    start_sync0(&mut bench, 0, 1_000_000);
    bench.wait(50_000_000);
    assert_eq!(bench.segment.device(0).pulses(), 0);
    start_sync0(&mut bench, 1_000_000, 0);
    bench.wait(50_000_000);
    assert_eq!(bench.segment.device(0).pulses(), 1);
}

/// OP wants pulses, and clocks that are together.
#[test]
fn op_with_sync0_waits_for_pulses() {
    for no_sync0 in [false, true] {
        let mut bench = Bench::new(vec![with_clock(0, 0)]);
        bench.pre_op(0x1001);
        bench.map(0x1001, 0);
        start_sync0(&mut bench, 10_000_000, 1_000_000);
        assert_eq!(bench.ask(0x1001, 4), (ok(AlState::SafeOp), 0));
        bench.segment.device_mut(0).faults.no_sync0 = no_sync0;
        bench.write(0x1001, register::AL_CONTROL, &[8, 0]);
        let mut cycles = 0;
        while bench.status(0x1001) == (ok(AlState::SafeOp), 0) {
            bench.wait(900_000);
            bench.send(Command::Lrw, 0, &[0; 8]);
            cycles += 1;
            assert!(cycles < 2000);
        }
        if no_sync0 {
            assert_eq!(
                bench.status(0x1001),
                (refused(AlState::SafeOp), AlStatusCode::NO_SYNC0.0)
            );
        } else {
            assert_eq!(bench.status(0x1001), (ok(AlState::Op), 0));
            assert!((20..60).contains(&cycles), "{cycles}");
            assert_eq!(bench.segment.device(0).period_ns(), 1_000_000);
        }
    }
}

#[test]
fn a_clock_that_is_centuries_off_says_that_it_is_far_off() {
    for (offset, speed_limit) in [
        (u64::MAX / 2, u16::MAX),
        (u64::MAX / 2 + 1, 0x1000),
        (u64::MAX / 2 + 2, 1),
    ] {
        let mut bench = Bench::new(vec![with_clock(0, 0), with_clock(0, 0)]);
        bench.write(0x1002, register::DC_OFFSET, &offset.to_le_bytes());
        bench.write(0x1002, register::DC_SPEED_START, &speed_limit.to_le_bytes());
        for _ in 0..100 {
            bench.now_ns += 1_000_000;
            bench.send(
                Command::Frmw,
                register::station(0x1001, register::DC_SYSTEM_TIME),
                &[0; 8],
            );
        }
        let data = bench.read(0x1002, register::DC_DIFFERENCE, 4);
        let difference = difference_ns(u32::from_le_bytes(data.try_into().unwrap()));
        assert_eq!(difference.unsigned_abs(), i32::MAX as u32, "offset {offset}");
    }
}

/// A device that nobody has looked at for a while makes up for some pulses, and keeps the phase; one whose time is set past its next
/// pulse makes none any more.
#[test]
fn pulses_of_a_pause_are_left_out_and_a_time_that_jumps_ends_them() {
    let mut bench = Bench::new(vec![with_clock(0, 0)]);
    let start = start_sync0(&mut bench, 1_000_000, 250_000);
    bench.wait(2_000_000);
    let before = bench.segment.device(0).pulses();
    bench.now_ns += 10_000_000_000;
    bench.segment.poll(bench.now_ns);
    let made_up = bench.segment.device(0).pulses() - before;
    assert!((1..=25).contains(&made_up), "{made_up}");
    let next = u64_at(&mut bench, 0x1001, register::DC_SYNC0_START);
    assert_eq!((next - start) % 250_000, 0);
    let before = bench.segment.device(0).pulses();
    bench.wait(2_500_000);
    assert_eq!(bench.segment.device(0).pulses() - before, 10);
    bench.write(0x1001, register::DC_OFFSET, &1_000_000_000_000_u64.to_le_bytes());
    let before = bench.segment.device(0).pulses();
    bench.wait(10_000_000);
    assert_eq!(bench.segment.device(0).pulses(), before);
}
