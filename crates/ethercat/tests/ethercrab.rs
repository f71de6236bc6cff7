//! A main device of others brings the simulated devices to OP and moves data: ethercrab 0.7.1, on virtual time.

use embassy_time_driver::Driver;
use ethercat::sub::{ClockConfig, IdealMotor, Segment, SubDevice, SubDeviceConfig, models};
use ethercat::wire::FRAME_LEN_MAX;
use ethercat::wire::register::AlState;
use ethercat::wire::sii::Identity;
use ethercrab::subdevice_group::{CycleInfo, DcConfiguration, TxRxResponse};
use ethercrab::{DcSync, MainDevice, MainDeviceConfig, PduRx, PduStorage, PduTx, Timeouts};
use std::collections::VecDeque;
use std::pin::pin;
use std::sync::atomic::{AtomicU64, Ordering};
use std::task::{Context, Poll, Waker};
use std::time::Duration;

/// Virtual time of ethercrab and of the devices, ns.
static NOW_NS: AtomicU64 = AtomicU64::new(1_000_000);

struct VirtualTime;

impl Driver for VirtualTime {
    fn now(&self) -> u64 {
        NOW_NS.load(Ordering::Relaxed) / 1000
    }

    fn schedule_wake(&self, _: u64, _: &Waker) {
        // The loop below polls after each step of time.
    }
}

embassy_time_driver::time_driver_impl!(static DRIVER: VirtualTime = VirtualTime);

fn now_ns() -> u64 {
    NOW_NS.load(Ordering::Relaxed)
}

const CYCLE: Duration = Duration::from_millis(1);
/// Time passes in such steps while nothing else happens, ns.
const STEP_NS: u64 = 20_000;

/// The wire between ethercrab and the devices.
struct Wire<'a> {
    segment: Segment,
    tx: PduTx<'a>,
    rx: PduRx<'a>,
    on_the_way: VecDeque<(u64, Vec<u8>)>,
}

impl Wire<'_> {
    /// Runs a future to its end; time passes whenever it waits.
    fn run<T>(&mut self, future: impl Future<Output = T>) -> T {
        let mut future = pin!(future);
        let until_ns = now_ns() + 60_000_000_000;
        loop {
            if let Poll::Ready(value) = future.as_mut().poll(&mut Context::from_waker(Waker::noop())) {
                return value;
            }
            assert!(now_ns() < until_ns, "no end after a minute");
            self.step();
        }
    }

    /// Frames leave and arrive; else time passes.
    fn step(&mut self) {
        let mut sent = false;
        while let Some(frame) = self.tx.next_sendable_frame() {
            let mut octets = vec![0; FRAME_LEN_MAX];
            let mut length = 0;
            let send = |frame: &[u8]| {
                octets[..frame.len()].copy_from_slice(frame);
                length = frame.len();
                Ok(length)
            };
            frame.send_blocking(send).expect("it is sent");
            if let Some(answer) = self.segment.receive(now_ns(), &mut octets[..length]) {
                octets.truncate(length);
                self.on_the_way.push_back((answer.at_ns, octets));
            }
            sent = true;
        }
        if let Some((at_ns, octets)) = self.on_the_way.pop_front() {
            self.pass(at_ns.saturating_sub(now_ns()));
            // One that comes too late is refused.
            let _ = self.rx.receive_frame(&octets);
        } else if !sent {
            self.pass(STEP_NS);
        }
    }

    fn pass(&mut self, ns: u64) {
        let until_ns = now_ns() + ns;
        loop {
            let next_ns = self.segment.next_ns(now_ns());
            if next_ns > until_ns {
                break;
            }
            NOW_NS.store(next_ns.max(now_ns()), Ordering::Relaxed);
            self.segment.poll(now_ns());
        }
        NOW_NS.store(until_ns, Ordering::Relaxed);
    }
}

fn drive(gain_ppb: i64, start_ns: u64) -> SubDeviceConfig {
    SubDeviceConfig {
        clock: Some(ClockConfig {
            gain_ppb,
            start_ns,
            wide: true,
        }),
        ..models::DriveModel::default()
            .build(vec![Box::new(IdealMotor::default())])
            .expect("a drive")
    }
}

/// Two drives whose clocks drift apart by 80 ppm, an analog terminal, a digital one without a clock between them.
#[test]
fn ethercrab_brings_simulated_drives_to_op_and_moves_one() {
    static STORAGE: PduStorage<16, { PduStorage::element_size(1100) }> = PduStorage::new();
    let identity = |product| Identity {
        vendor: 2,
        product,
        revision: 1,
        serial: 0,
    };
    let mut segment = Segment::new();
    for device in [
        drive(0, 55_000_000_000),
        models::digital_terminal(identity(3)),
        models::analog_terminal(identity(4)).expect("a terminal"),
        drive(-80_000, 9_000_000_000_000),
    ] {
        segment.push(SubDevice::new(device, now_ns()), 500);
    }
    let (tx, rx, pdus) = STORAGE.try_split().expect("split once");
    let mut wire = Wire {
        segment,
        tx,
        rx,
        on_the_way: VecDeque::new(),
    };
    let timeouts = Timeouts {
        pdu: Duration::from_millis(30),
        ..Timeouts::default()
    };
    let config = MainDeviceConfig {
        dc_static_sync_iterations: 1000,
        ..MainDeviceConfig::default()
    };
    let main = MainDevice::new(pdus, timeouts, config);
    let mut group = wire.run(main.init_single_group::<16, 128>(now_ns)).expect("PRE-OP");
    assert_eq!(group.len(), 4);
    let names: Vec<String> = group.iter(&main).map(|device| device.name().to_owned()).collect();
    assert_eq!(names, ["ISOCNC-SIM", "DIO-8-8", "AIO-4-4", "ISOCNC-SIM"]);

    // Objects, expedited, in one mail, and refused.
    let first = group.subdevice(&main, 0).expect("the first one");
    assert_eq!(wire.run(first.sdo_read::<u32>(0x1018, 1)), Ok(0x0A1B));
    let name = wire.run(first.sdo_read::<[u8; 21]>(0x1008, 0)).expect("its name");
    assert_eq!(&name, b"Simulated servo drive");
    assert_eq!(wire.run(first.sdo_write(0x6060, 0, 8_i8)), Ok(()));
    assert!(wire.run(first.sdo_write(0x6041, 0, 8_u16)).is_err());

    for mut device in group.iter_mut(&main) {
        if device.name() == "ISOCNC-SIM" {
            device.set_dc_sync(DcSync::Sync0);
        }
    }
    let group = wire.run(group.into_pre_op_pdi(&main)).expect("process data");
    for _ in 0..500 {
        wire.run(group.tx_rx_sync_system_time(&main))
            .expect("the clocks come together");
        wire.pass(200_000);
    }
    let dc = DcConfiguration {
        start_delay: Duration::from_millis(100),
        sync0_period: CYCLE,
        sync0_shift: CYCLE / 2,
    };
    let group = wire.run(group.configure_dc_sync(&main, dc)).expect("SYNC0");
    let group = wire.run(group.into_safe_op(&main)).expect("SAFE-OP");
    let group = wire.run(group.request_into_op(&main)).expect("OP is asked for");

    let mut cycles_to_op = 0;
    let cycle = |wire: &mut Wire<'_>| {
        let start_ns = now_ns();
        let response: TxRxResponse<16, CycleInfo> = wire.run(group.tx_rx_dc(&main)).expect("a cycle");
        let wait_ns = (response.extra.next_cycle_wait.as_nanos() as u64).min(2_000_000);
        wire.pass((start_ns + wait_ns).saturating_sub(now_ns()));
        (response.all_op(), response.working_counter)
    };
    while !cycle(&mut wire).0 {
        cycles_to_op += 1;
        assert!(cycles_to_op < 2000, "not in OP after two seconds");
    }
    for number in 0..4 {
        let device = wire.segment.device(number);
        assert_eq!(
            (device.state(), device.has_error()),
            (AlState::Op, false),
            "device {number}"
        );
    }
    // The drive is switched on, and follows.
    let mut target = 0_i32;
    for step in 0..2000 {
        let device = group.subdevice(&main, 3).expect("the drive");
        let mut data = device.io_raw_mut();
        let status = data.inputs()[0] & 0x6F;
        let control = match status {
            0x40 => 0x06,
            0x21 => 0x07,
            _ => 0x0F,
        };
        if status == 0x27 && step > 500 {
            target += 10;
        }
        data.outputs()[0] = control;
        data.outputs()[2] = 8;
        data.outputs()[4..8].copy_from_slice(&target.to_le_bytes());
        drop(data);
        // Each of the four: read 1, written 2.
        assert_eq!(cycle(&mut wire), (true, 12));
    }
    assert!(target > 10_000, "{target}");
    let device = group.subdevice(&main, 3).expect("the drive");
    let data = device.inputs_raw();
    let actual = i32::from_le_bytes([data[4], data[5], data[6], data[7]]);
    assert!((0..=50).contains(&(target - actual)), "{actual} of {target}");
    // Both clocks show the same.
    let now = now_ns();
    let [one, other] = [0, 3].map(|number| wire.segment.device(number).system_ns(now).expect("a clock"));
    assert!(one.abs_diff(other) < 1000, "{one} {other}");
}
