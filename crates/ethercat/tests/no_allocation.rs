//! The main device asks nothing of the allocator, from the first frame on: in cycles, services, set-up, faults and recovery. Simulated
//! devices ask nothing while they are in OP and get no mails.
#![cfg(feature = "std")]

use crate::counting;

use counting::{CALLS, COUNTING};
use ethercat::main::config::{ClockConfig, Config, DeviceConfig, ProcessDataConfig, StartValue, Times};
use ethercat::main::{DeviceState, Event, MainDevice};
use ethercat::sub::{IdealMotor, Segment, SubDevice, models};
use ethercat::wire::FRAME_LEN_MAX;
use ethercat::wire::coe::Object;

fn counted<T>(work: impl FnOnce() -> T) -> T {
    COUNTING.set(true);
    let done = work();
    COUNTING.set(false);
    done
}

const CYCLE_NS: u64 = 1_000_000;
const DRIVES: usize = 4;

fn part(position: u16) -> DeviceConfig<'static> {
    let data = ProcessDataConfig { octets: 8, pdos: &[] };
    DeviceConfig {
        outputs: data,
        inputs: data,
        start: &[StartValue {
            index: 0x6060,
            sub: 0,
            complete: false,
            optional: false,
            value: &[8],
        }],
        clock: Some(ClockConfig {
            activate: 0x0300,
            shift_ns: 500_000,
            sync1_ns: 0,
        }),
        ..DeviceConfig::at(position)
    }
}

fn segment() -> Segment {
    let mut segment = Segment::new();
    for _ in 0..DRIVES {
        let drive = models::DriveModel::default().build(vec![Box::new(IdealMotor::default())]);
        segment.push(SubDevice::new(drive.expect("a drive"), 0), 300);
    }
    segment
}

fn parts() -> Vec<DeviceConfig<'static>> {
    (0..DRIVES as u16).map(part).collect()
}

fn config<'a>(devices: &'a [DeviceConfig<'a>]) -> Config<'a> {
    Config {
        cycle_ns: CYCLE_NS as u32,
        devices,
        lost_max: 2,
        times: Times::default(),
    }
}

#[test]
fn no_call_allocates() {
    let mut segment = segment();
    let parts = parts();
    let config = config(&parts);
    let mut main = Box::new(MainDevice::<16, 2>::new([0x10; 6], &config).expect("it fits"));
    let mut buffer = [0; FRAME_LEN_MAX];
    let mut now_ns = 1_000_000;
    let (mut ups, mut lost, mut values) = (0, 0, 0);
    for cycle in 0..6000_u64 {
        match cycle {
            1500 => segment.cut(2),
            2000 => segment.heal(2),
            3000 => segment.power_off(3),
            3200 => segment.power_on(3, now_ns),
            _ => {}
        }
        let frames = counted(|| {
            for drive in 0..DRIVES {
                main.outputs_mut(drive)[2] = 8;
            }
            main.prepare()
        });
        for number in 0..frames {
            let length = counted(|| {
                let frame = main.frame(number);
                buffer[..frame.len()].copy_from_slice(frame);
                frame.len()
            });
            if segment.receive(now_ns, &mut buffer[..length]).is_some() {
                counted(|| main.receive(now_ns, &buffer[..length]));
            }
        }
        for _ in 0..10 {
            now_ns += 50_000;
            segment.poll(now_ns);
            let length = counted(|| {
                main.service_frame(now_ns).map(|frame| {
                    buffer[..frame.len()].copy_from_slice(frame);
                    frame.len()
                })
            });
            if let Some(length) = length
                && segment.receive(now_ns, &mut buffer[..length]).is_some()
            {
                counted(|| main.receive(now_ns, &buffer[..length]));
            }
        }
        counted(|| {
            main.finish_cycle(now_ns);
            if cycle % 100 == 99 {
                let (index, sub, complete) = (0x1008, 0, false);
                let _ = main.sdo_read(0, Object { index, sub, complete });
            }
            for order in 0..ethercat::main::ORDERS {
                values += u32::from(main.sdo_result(order).is_some_and(|result| result.is_ok()));
            }
            while let Some(event) = main.pop_event() {
                ups += u32::from(matches!(event, Event::Up { .. }));
                lost += u32::from(matches!(event, Event::Lost { .. }));
            }
        });
        now_ns += CYCLE_NS / 2;
        segment.poll(now_ns);
    }
    assert_eq!(CALLS.get(), 0);
    // All of it has happened: the cable costs two drives, the power one.
    assert_eq!((ups, lost), (4 + 2 + 1, 3));
    assert!(values > 40, "{values}");
    assert!((0..DRIVES).all(|drive| main.device_state(drive) == DeviceState::Operational));
}

#[test]
fn simulated_devices_take_no_memory_in_op() {
    let mut segment = segment();
    let parts = parts();
    let config = config(&parts);
    let mut main = Box::new(MainDevice::<16, 2>::new([0x10; 6], &config).expect("it fits"));
    let mut buffer = [0; FRAME_LEN_MAX];
    let (mut now_ns, mut in_op, mut moved) = (CYCLE_NS, 0, 0);
    for cycle in 0..4000_u32 {
        if in_op == 200 {
            break;
        }
        in_op += u32::from(main.is_operational());
        // In the first cycles there it takes the memory that it keeps.
        let counts = in_op > 10;
        for drive in 0..DRIVES {
            let controlword: u8 = [6, 7, 15][in_op as usize % 60 / 20];
            let outputs = main.outputs_mut(drive);
            outputs[..3].copy_from_slice(&[controlword, 0, 8]);
            outputs[4..8].copy_from_slice(&cycle.to_le_bytes());
        }
        let pass = |segment: &mut Segment, now_ns: u64, frame: &mut [u8]| {
            COUNTING.set(counts);
            let came = segment.receive(now_ns, frame).is_some();
            COUNTING.set(false);
            came
        };
        for number in 0..main.prepare() {
            let length = main.frame(number).len();
            buffer[..length].copy_from_slice(main.frame(number));
            assert!(pass(&mut segment, now_ns, &mut buffer[..length]));
            main.receive(now_ns, &buffer[..length]);
        }
        while now_ns % CYCLE_NS < CYCLE_NS * 8 / 10 {
            now_ns += 50_000;
            COUNTING.set(counts);
            segment.poll(now_ns);
            COUNTING.set(false);
            let Some(frame) = main.service_frame(now_ns) else {
                continue;
            };
            let length = frame.len();
            buffer[..length].copy_from_slice(frame);
            assert!(pass(&mut segment, now_ns, &mut buffer[..length]));
            main.receive(now_ns, &buffer[..length]);
        }
        main.finish_cycle(now_ns);
        now_ns = (now_ns / CYCLE_NS + 1) * CYCLE_NS;
        moved += u32::from(main.inputs(0)[1] & 0x02 != 0 || main.inputs(0)[0] & 0x6F == 0x27);
    }
    assert_eq!(in_op, 200);
    assert!(moved > 0, "operation is enabled at times");
    assert_eq!(CALLS.get(), 0);
}
