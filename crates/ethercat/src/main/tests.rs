//! The phase loop on clocks that drift, frames that come late and frames that are lost; delays of a line and of a tree.

use super::*;
use crate::sub::{IdealMotor, Segment, SubDevice, models};
use crate::wire::register::{self, DlStatus};
use crate::wire::{BROADCAST, Command, FRAME_LEN_MAX, Frame, FrameWriter};
use std::boxed::Box;
use std::vec;
use std::vec::Vec;

/// Random numbers, the same each time.
struct Random(u64);

impl Random {
    fn below(&mut self, end: u64) -> u64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % end
    }
}

/// Phases of the dates themselves, without the jitter of the frames, over some cycles.
fn run(
    cycle_ns: u32,
    gain_ppm: f64,
    start_ns: f64,
    jitter_ns: u64,
    lost_of_100: u64,
    cycles: usize,
    seed: u64,
) -> (Vec<f64>, PhaseLoop) {
    let mut random = Random(seed);
    let mut leader = PhaseLoop::new(PhaseConfig::of_cycle(cycle_ns));
    let mut date = start_ns;
    let phases = (0..cycles)
        .map(|_| {
            let late = random.below(jitter_ns + 1) as f64;
            let bus = (date + late) * (1.0 + gain_ppm * 1e-6) + 1e12;
            let exact = date * (1.0 + gain_ppm * 1e-6);
            let half = f64::from(cycle_ns) / 2.0;
            let phase = (exact + half).rem_euclid(f64::from(cycle_ns)) - half;
            let moved = if random.below(100) < lost_of_100 {
                leader.hold()
            } else {
                leader.correct(phase_ns(bus as u64, cycle_ns, 0))
            };
            date += f64::from(cycle_ns) + moved as f64;
            phase
        })
        .collect();
    (phases, leader)
}

#[test]
fn it_locks_within_a_second_and_stays() {
    for seed in 0..50 {
        for gain_ppm in [-100.0, 50.0] {
            for start_ns in [4_000.0, 300_000.0, -450_000.0] {
                let (phases, leader) = run(1_000_000, gain_ppm, start_ns, 5_000, 5, 4000, seed);
                let of = std::format!("seed {seed}, {gain_ppm} ppm, from {start_ns}");
                let settled = &phases[1000..];
                let (mean, count) = (settled.iter().sum::<f64>() / 3000.0, settled.len() as f64);
                let variance = settled.iter().map(|phase| (phase - mean).powi(2)).sum::<f64>() / count;
                let range =
                    settled.iter().copied().fold(f64::MIN, f64::max) - settled.iter().copied().fold(f64::MAX, f64::min);
                assert!(leader.is_locked(), "{of}");
                assert!(
                    variance.sqrt() <= 1000.0 && range <= 8000.0,
                    "{of}: {:.0} {range:.0}",
                    variance.sqrt()
                );
                // Frames come 2.5 µs late on the mean, and so much earlier the dates are.
                assert!((mean + 2500.0).abs() < 500.0, "{of}: {mean:.0}");
                assert!(
                    (leader.drift() - gain_ppm * 1e-6).abs() < 5e-6,
                    "{of}: {:e}",
                    leader.drift()
                );
            }
        }
    }
}

#[test]
fn no_date_moves_by_more_than_the_limit() {
    let mut leader = PhaseLoop::new(PhaseConfig::of_cycle(1_000_000));
    for phase in [i64::MAX, i64::MIN, 500_000, -500_000, 0, 1] {
        for _ in 0..1000 {
            assert!(leader.correct(phase).abs() <= 2001);
        }
    }
    for _ in 0..1000 {
        assert!(leader.hold().abs() <= 501);
    }
}

#[test]
fn phases_are_folded_to_half_a_cycle() {
    for (bus_ns, expected) in [
        (0, 0),
        (1, 1),
        (500, 500),
        (501, -499),
        (999, -1),
        (1000, 0),
        (12_345_250, 250),
    ] {
        assert_eq!(phase_ns(bus_ns, 1000, 0), expected, "{bus_ns}");
    }
    assert_eq!(phase_ns(1300, 1000, 250), 50);
    assert_eq!(phase_ns(5, 0, 0), 0);
}

/// Registers of all devices as a main device reads them after BWR 0900h.
fn measure(segment: &mut Segment) -> Vec<DcDevice> {
    let mut exchange = |command: Command, address: u32, data: &[u8]| {
        let mut buffer = [0; FRAME_LEN_MAX];
        let mut writer = FrameWriter::new(&mut buffer, BROADCAST, [0x10; 6]).unwrap();
        writer.push_data(command, 0, address, data).unwrap();
        let length = writer.finish();
        segment.receive(1_000_000, &mut buffer[..length]).unwrap();
        let frame = Frame::parse(&buffer[..length]).unwrap();
        let datagram = frame.datagrams().next().unwrap();
        (datagram.data.to_vec(), datagram.working_counter)
    };
    let (_, count) = exchange(Command::Brd, 0, &[0]);
    exchange(Command::Bwr, register::station(0, register::DC_RECEIVE_TIMES), &[0; 4]);
    let device = |position| {
        let (status, _) = exchange(
            Command::Aprd,
            register::position(position, register::DL_STATUS),
            &[0; 2],
        );
        let status = DlStatus(u16::from_le_bytes([status[0], status[1]]));
        let (times, acts) = exchange(
            Command::Aprd,
            register::position(position, register::DC_RECEIVE_TIMES),
            &[0; 16],
        );
        DcDevice {
            has_clock: acts == 1,
            open: [0, 1, 2, 3].map(|port| status.is_open(port)),
            times: register::receive_times(&times).unwrap(),
        }
    };
    (0..count).map(device).collect()
}

fn device(start_ns: u64, has_clock: bool) -> SubDevice {
    let mut config = models::DriveModel::default()
        .build(vec![Box::new(IdealMotor::default())])
        .unwrap();
    config.clock = has_clock.then_some(crate::sub::ClockConfig {
        gain_ppb: 0,
        start_ns,
        wide: true,
    });
    let mut device = SubDevice::new(config, 0);
    device.faults.garbage = 0x6C72_6556;
    device
}

/// Coupler and terminals of the fact sheet: 0 145 300 1085 1240 ns.
#[test]
fn delays_of_a_line() {
    let mut segment = Segment::new();
    for (number, delay_ns) in [30, 145, 155, 785, 155].into_iter().enumerate() {
        // Clocks that differ by anything, one just before its 32 bits end.
        let start_ns = u64::from(u32::MAX) - 1_000_500 + number as u64 * 77_777;
        segment.push(device(start_ns, true), delay_ns);
    }
    assert_eq!(delays::<5>(&measure(&mut segment)), [0, 145, 300, 1085, 1240]);
}

#[test]
fn delays_of_a_tree_and_past_a_device_without_a_clock() {
    let mut segment = Segment::new();
    segment.push(device(5, true), 30);
    segment.push_at(device(6_000, true), Some((0, 3)), 145);
    segment.push_at(device(0, false), Some((1, 1)), 155);
    segment.push_at(device(9_999, true), Some((2, 1)), 100);
    segment.push_at(device(123, true), Some((0, 1)), 785);
    // Behind port 1 a frame comes after all that is behind port 3: 2 · (145 + 155 + 100).
    assert_eq!(delays::<8>(&measure(&mut segment))[..5], [0, 145, 0, 400, 800 + 785]);
}
