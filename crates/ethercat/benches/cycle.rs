//! What the main device computes in a cycle, for each drive, and what simulated drives take for its frames: `cargo bench -p
//! isocnc-ethercat --bench cycle`.

use ethercat::main::config::{ClockConfig, Config, DeviceConfig, ProcessDataConfig, Times};
use ethercat::main::{CyclicFrames, MainDevice, Member};
use ethercat::sub::{IdealMotor, Segment, SubDevice, models};
use ethercat::wire::{Command, FRAME_LEN_MAX, Frame, Mac};
use std::hint::black_box;
use std::time::Instant;

const MAC: Mac = [0x10; 6];
const CYCLES: usize = 20_000;
/// Octets of a drive to it and from it.
const OUTPUTS: u16 = 12;
const INPUTS: u16 = 16;

/// The answer to a frame, as devices in OP would make it.
fn answer(sent: &[u8], came: &mut [u8]) {
    came.copy_from_slice(sent);
    came[6] |= 0x02;
    let frame = Frame::parse(sent).expect("a frame");
    for datagram in frame.datagrams() {
        let end = datagram.data_at() + datagram.data.len();
        came[end] = if datagram.command == Command::Lrw { 3 } else { 1 };
    }
}

/// Time that simulated drives in OP take for the frames of a cycle, and for the rest of it, ns each: medians.
fn simulated(drives: u16) -> [f64; 2] {
    const CYCLE_NS: u64 = 1_000_000;
    let mut segment = Segment::new();
    for _ in 0..drives {
        let drive = models::DriveModel::default().build(vec![Box::new(IdealMotor::default())]);
        segment.push(SubDevice::new(drive.expect("a drive"), 0), 300);
    }
    let data = ProcessDataConfig { octets: 8, pdos: &[] };
    let device = |position| DeviceConfig {
        outputs: data,
        inputs: data,
        clock: Some(ClockConfig {
            activate: 0x0300,
            shift_ns: 500_000,
            sync1_ns: 0,
        }),
        ..DeviceConfig::at(position)
    };
    let devices: Vec<DeviceConfig<'_>> = (0..drives).map(device).collect();
    let config = Config {
        cycle_ns: CYCLE_NS as u32,
        devices: &devices,
        lost_max: 3,
        times: Times::default(),
    };
    let mut main = Box::new(MainDevice::<128, 4>::new(MAC, &config).expect("it fits"));
    let mut buffer = [0; FRAME_LEN_MAX];
    let (mut frames_ns, mut rest_ns) = (Vec::new(), Vec::new());
    let mut now_ns = CYCLE_NS;
    for _ in 0..4000 {
        let mut taken = 0.0;
        for number in 0..main.prepare() {
            let length = main.frame(number).len();
            buffer[..length].copy_from_slice(main.frame(number));
            let start = Instant::now();
            black_box(segment.receive(now_ns, &mut buffer[..length]));
            taken += start.elapsed().as_secs_f64() * 1e9;
            main.receive(now_ns, &buffer[..length]);
        }
        main.finish_cycle(now_ns);
        let is_up = main.is_operational();
        while !is_up
            && let Some(length) = main.service_frame(now_ns).map(|frame| {
                buffer[..frame.len()].copy_from_slice(frame);
                frame.len()
            })
        {
            segment.receive(now_ns, &mut buffer[..length]);
            main.receive(now_ns, &buffer[..length]);
            now_ns += 20_000;
            if now_ns % CYCLE_NS > CYCLE_NS * 8 / 10 {
                break;
            }
        }
        now_ns = (now_ns / CYCLE_NS + 1) * CYCLE_NS;
        let start = Instant::now();
        segment.poll(now_ns);
        if is_up {
            frames_ns.push(taken);
            rest_ns.push(start.elapsed().as_secs_f64() * 1e9);
        }
    }
    [frames_ns, rest_ns].map(|mut times_ns: Vec<f64>| {
        assert!(times_ns.len() > 1000, "all in OP");
        times_ns.sort_by(f64::total_cmp);
        times_ns[times_ns.len() / 2]
    })
}

fn main() {
    println!("{CYCLES} cycles each; outputs written, frames made ready, answers read, inputs copied; median and 99 %");
    for drives in [1_usize, 8, 32, 100] {
        let members = (0..drives as u32).map(|drive| Member::one(16 * drive, OUTPUTS, INPUTS));
        let mut cyclic = CyclicFrames::<128, 4>::new(MAC, members).expect("it fits");
        cyclic.set_reference(Some(0x1000));
        let mut came: Vec<Vec<u8>> = (0..cyclic.len()).map(|number| cyclic.frame(number).to_vec()).collect();
        let mut times_ns: Vec<f64> = (0..CYCLES)
            .map(|cycle| {
                let start = Instant::now();
                for drive in 0..drives {
                    cyclic.outputs_mut(drive)[4..8].copy_from_slice(&(cycle as u32).to_le_bytes());
                }
                cyclic.make_ready(cycle as u64);
                let made = start.elapsed();
                for (number, came) in came.iter_mut().enumerate() {
                    answer(cyclic.frame(number), came);
                }
                let start = Instant::now();
                for came in &came {
                    black_box(cyclic.receive(came));
                }
                let mut sum = 0_u32;
                for drive in 0..drives {
                    sum += u32::from(cyclic.inputs(drive)[0]) + cyclic.answered(drive).lost_in_row;
                }
                black_box(sum);
                assert_eq!(cyclic.finish(), 0);
                (made + start.elapsed()).as_secs_f64() * 1e9
            })
            .collect();
        times_ns.sort_by(f64::total_cmp);
        let (median, high) = (times_ns[CYCLES / 2], times_ns[CYCLES * 99 / 100]);
        println!(
            "{drives:>4} drives, {} frames {:>6.0} ns  {high:>6.0} ns of 99 %  {:>5.1} ns a drive",
            cyclic.len(),
            median,
            median / drives as f64
        );
    }
    println!("simulated drives in OP: frames of a cycle through all of them, then the rest of the cycle; median");
    for drives in [1, 8, 32, 100] {
        let [frames_ns, rest_ns] = simulated(drives);
        println!(
            "{drives:>4} drives {frames_ns:>8.0} ns  {:>6.0} ns a drive; {rest_ns:>8.0} ns of the rest",
            frames_ns / f64::from(drives)
        );
    }
}
