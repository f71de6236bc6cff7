//! A main device of EtherCAT whose frames come back as the octets say: devices of any kind, and none.

use ethercat::main::config::{ClockConfig, Config, DeviceConfig, PdoConfig, ProcessDataConfig, StartValue, Times};
use ethercat::main::{MainDevice, SetupError};
use ethercat::wire::coe::Object;
use ethercat::wire::{Frame, Mac};

const MAC: Mac = [0x10; 6];
const CYCLE_NS: u32 = 1_000_000;
/// What comes back as one octet: a counter, and whether other data follow.
const COUNTER: u8 = 0x07;
const DATA: u8 = 0x80;

const DEVICES: &[DeviceConfig<'static>] = &[
    DeviceConfig {
        outputs: ProcessDataConfig {
            octets: 8,
            pdos: &[PdoConfig {
                index: 0x1600,
                entries: &[0x6040_0010, 0x6060_0008, 0x0000_0008, 0x607A_0020],
            }],
        },
        inputs: ProcessDataConfig {
            octets: 8,
            pdos: &[PdoConfig {
                index: 0x1A00,
                entries: &[],
            }],
        },
        start: &[StartValue {
            index: 0x6060,
            sub: 0,
            complete: false,
            optional: false,
            value: &[8],
        }],
        clock: Some(ClockConfig {
            activate: 0x0700,
            shift_ns: -250_000,
            sync1_ns: 1000,
        }),
        watchdog_ms: Some(50),
        ..DeviceConfig::at(0)
    },
    DeviceConfig {
        inputs: ProcessDataConfig { octets: 1, pdos: &[] },
        ..DeviceConfig::at(1)
    },
];

const CONFIG: Config<'static> = Config {
    cycle_ns: CYCLE_NS,
    devices: DEVICES,
    lost_max: 2,
    times: Times {
        frame_ns: 1_000_000,
        pause_ns: 100_000,
        eeprom_ns: 10_000_000,
        mail_ns: 20_000_000,
        step_ns: 50_000_000,
        op_ns: 50_000_000,
        clock_ns: 50_000_000,
        clock_limit_ns: 1000,
        sync_start_ns: 10_000_000,
        mailbox_ns: 1_000_000,
        retry_ns: 1_000_000,
    },
};

/// Octets, one after the other.
struct Input<'a>(&'a [u8]);

impl Input<'_> {
    fn next(&mut self) -> Option<u8> {
        let (first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(*first)
    }

    /// The answer to a frame: each datagram with a counter, and with other data where the input says so.
    fn answer(&mut self, sent: &[u8]) -> Option<Vec<u8>> {
        let mut octets = sent.to_vec();
        octets[6] |= 0x02;
        let frame = Frame::parse(sent).expect("what is sent is a frame");
        for datagram in frame.datagrams() {
            let first = self.next()?;
            let end = datagram.data_at() + datagram.data.len();
            if first & DATA != 0 {
                for place in &mut octets[datagram.data_at()..end] {
                    *place = self.next()?;
                }
            }
            octets[end] = first & COUNTER;
        }
        Some(octets)
    }
}

/// One run of the fuzzer.
pub fn run(octets: &[u8]) {
    let mut main = Box::new(MainDevice::<8, 2>::new(MAC, &CONFIG).expect("it fits"));
    let mut input = Input(octets);
    let mut now_ns = 1_000_000_u64;
    let mut orders = Vec::new();
    while let Some(kind) = input.next() {
        match kind % 5 {
            0 => now_ns += 100_000 * u64::from(kind),
            1 => {
                let Some(sent) = main.service_frame(now_ns).map(<[u8]>::to_vec) else {
                    now_ns += 100_000;
                    continue;
                };
                if let Some(answer) = input.answer(&sent) {
                    main.receive(now_ns, &answer);
                }
            }
            2 => {
                for number in 0..main.prepare() {
                    let sent = main.frame(number).to_vec();
                    if let Some(answer) = input.answer(&sent) {
                        main.receive(now_ns, &answer);
                    }
                }
                let _ = main.late_ns();
                now_ns += u64::from(CYCLE_NS);
                main.finish_cycle(now_ns);
            }
            3 => {
                let length = usize::from(input.next().unwrap_or(0)).min(input.0.len());
                let (raw, rest) = input.0.split_at(length);
                input.0 = rest;
                main.receive(now_ns, raw);
            }
            _ => {
                let object = Object {
                    index: 0x1000 + u16::from(kind),
                    sub: kind,
                    complete: kind & 0x80 != 0,
                };
                let device = usize::from(kind) % DEVICES.len();
                orders.extend(if kind & 0x40 == 0 {
                    main.sdo_read(device, object)
                } else {
                    main.sdo_write(device, object, &octets[..octets.len().min(300)])
                });
            }
        }
        while let Some(event) = main.pop_event() {
            assert!(!event.to_string().is_empty());
        }
        orders.retain(|order| match main.sdo_result(*order) {
            None => true,
            Some(Ok(value)) => {
                assert!(value.len() <= ethercat::main::VALUE_MAX);
                false
            }
            Some(Err(error)) => {
                words(error);
                false
            }
        });
        for (device, expected) in DEVICES.iter().enumerate() {
            assert_eq!(main.inputs(device).len(), usize::from(expected.inputs.octets));
            let _ = (main.device_state(device), main.found(device), main.answered(device));
            let _ = main.punctuality(device).map(|punctuality| punctuality.to_string());
        }
    }
}

fn words(error: SetupError) {
    assert!(!error.to_string().is_empty());
}
