//! The main device asks nothing of the allocator, from the first frame on: in cycles, services, set-up, faults and recovery.
#![cfg(feature = "std")]

use ethercat::main::config::{ClockConfig, Config, DeviceConfig, ProcessDataConfig, StartValue, Times};
use ethercat::main::{DeviceState, Event, MainDevice};
use ethercat::sub::{IdealMotor, Segment, SubDevice, models};
use ethercat::wire::FRAME_LEN_MAX;
use ethercat::wire::coe::Object;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    static COUNTING: Cell<bool> = const { Cell::new(false) };
    static CALLS: Cell<u64> = const { Cell::new(0) };
}

/// Counts what asks the system's allocator for something or gives it back.
struct Counting;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn count() {
    if COUNTING.get() {
        CALLS.set(CALLS.get() + 1);
    }
}

// SAFETY: every call goes to the system's allocator as it came; counting touches two cells that need no allocation.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller keeps the contract of this very method.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count();
        // SAFETY: the caller keeps the contract of this very method.
        unsafe { System.dealloc(pointer, layout) }
    }
}

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

#[test]
fn no_call_allocates() {
    let mut segment = Segment::new();
    for _ in 0..DRIVES {
        let drive = models::DriveModel::default().build(vec![Box::new(IdealMotor::default())]);
        segment.push(SubDevice::new(drive.expect("a drive"), 0), 300);
    }
    let parts: Vec<DeviceConfig<'_>> = (0..DRIVES as u16).map(part).collect();
    let config = Config {
        cycle_ns: CYCLE_NS as u32,
        devices: &parts,
        lost_max: 2,
        times: Times::default(),
    };
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
