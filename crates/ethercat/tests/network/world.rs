//! A wire with devices, the main device, and an application that switches drives on and moves them.
//!
//! In:  devices and the configuration, a source of chance. Out: events, what drives have done, how cycles lie to SYNC0.

use ethercat::main::config::{
    ClockConfig, Config, DeviceConfig, Expected, PdoConfig, Place, ProcessDataConfig, StartValue, Times,
};
use ethercat::main::{Event, MainDevice, PhaseConfig, PhaseLoop, Received};
use ethercat::sub::{self, IdealMotor, Segment, SubDevice, SubDeviceConfig, models};
use ethercat::wire::register::AlState;
use ethercat::wire::sii::Identity;
use ethercat::wire::{Frame, Mac};

pub const MAC: Mac = [0x10; 6];
pub const CYCLE_NS: u64 = 1_000_000;
/// The PC puts frames on the wire so late at most.
const JITTER_NS: u64 = 5_000;
/// Cable between two devices.
const CABLE_NS: u64 = 300;

pub type Main = MainDevice<'static, 128, 4>;

/// Chance, the same each time.
pub struct Random(pub u64);

impl Random {
    pub fn below(&mut self, end: u64) -> u64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % end
    }
}

/// What the wire does to a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fate {
    Passes,
    /// It is lost before it comes to any device.
    LostOut,
    /// It is lost on its way back.
    Lost,
    /// It comes back so much later, ns.
    Late(u64),
    /// It comes back twice.
    Twice,
    /// An octet of it is another one.
    Corrupt,
    /// Data or working counters of its datagrams are others than those of the devices.
    Forged,
}

/// Decides on a frame; the flag: it is one of the cycle.
type Decide = Box<dyn FnMut(&mut Random, bool) -> Fate>;
/// Is shown an answer; further frames that come right before it.
type Forge = Box<dyn FnMut(&mut Random, &[u8]) -> Vec<Vec<u8>>>;
/// Is shown every frame, and when.
type Tap = Box<dyn FnMut(u64, &[u8])>;

pub struct World {
    pub segment: Segment,
    pub main: Box<Main>,
    pub now_ns: u64,
    pub date_ns: u64,
    pub cycle_ns: u64,
    pub phase: PhaseLoop,
    pub events: Vec<Event>,
    pub random: Random,
    /// Chance of what is forged: all else goes on as it would without.
    forger: Random,
    /// Where frames go.
    pub fate: Decide,
    /// Frames that come back later.
    on_way: Vec<(u64, Vec<u8>)>,
    pub drives: usize,
    /// What the application asks each drive to be at.
    pub targets: Vec<i32>,
    /// Drives are switched on.
    pub enable: bool,
    /// Frames of the cycle that were sent, each with its date and index: none is sent twice.
    pub sent: Vec<(u64, u8)>,
    pub cycles: u64,
    /// What the dates were behind those of the bus.
    pub late_ns: Vec<i64>,
    pub lost_last: u32,
    /// Time of the bus at the dates themselves, without the jitter of the frames.
    pub dates: Vec<u64>,
    pub tap: Tap,
    pub forge: Forge,
}

/// Identity of the drives.
pub fn drive_identity() -> Identity {
    models::DriveModel::default().identity
}

/// A drive with one axis whose clock gains so much.
pub fn drive(gain_ppb: i64, start_ns: u64) -> SubDeviceConfig {
    SubDeviceConfig {
        clock: Some(sub::ClockConfig {
            gain_ppb,
            start_ns,
            wide: true,
        }),
        ..models::DriveModel::default()
            .build(vec![Box::new(IdealMotor::default())])
            .expect("a drive")
    }
}

pub const TERMINAL: Identity = Identity {
    vendor: 2,
    product: 0x88,
    revision: 1,
    serial: 0,
};

/// What the drives map: control word, mode, a gap, target; status word, mode, a gap, position, error code.
pub const OUTPUTS: &[u32] = &[0x6040_0010, 0x6060_0008, 0x0000_0008, 0x607A_0020];
pub const INPUTS: &[u32] = &[0x6041_0010, 0x6061_0008, 0x0000_0008, 0x6064_0020, 0x603F_0010];

pub fn drive_config(position: u16) -> DeviceConfig<'static> {
    let identity = drive_identity();
    DeviceConfig {
        place: Place::Position(position),
        expected: Expected {
            vendor: Some(identity.vendor),
            product: Some(identity.product),
            ..Expected::default()
        },
        outputs: ProcessDataConfig {
            octets: 8,
            pdos: &[PdoConfig {
                index: 0x1600,
                entries: OUTPUTS,
            }],
        },
        inputs: ProcessDataConfig {
            octets: 10,
            pdos: &[PdoConfig {
                index: 0x1A00,
                entries: INPUTS,
            }],
        },
        start: &[
            StartValue {
                index: 0x6060,
                sub: 0,
                complete: false,
                optional: false,
                value: &[8],
            },
            StartValue {
                index: 0x60C2,
                sub: 1,
                complete: false,
                optional: false,
                value: &[1],
            },
        ],
        checks: &[],
        clock: Some(ClockConfig {
            activate: 0x0300,
            shift_ns: (CYCLE_NS / 2) as i32,
            sync1_ns: 0,
        }),
        watchdog_ms: None,
        goal: AlState::Op,
    }
}

pub fn terminal_config(position: u16) -> DeviceConfig<'static> {
    DeviceConfig {
        outputs: ProcessDataConfig { octets: 1, pdos: &[] },
        inputs: ProcessDataConfig { octets: 1, pdos: &[] },
        expected: Expected {
            vendor: Some(TERMINAL.vendor),
            product: Some(TERMINAL.product),
            ..Expected::default()
        },
        ..DeviceConfig::at(position)
    }
}

impl World {
    /// A line of devices.
    pub fn new(devices: Vec<SubDeviceConfig>, parts: Vec<DeviceConfig<'static>>, seed: u64) -> World {
        let mut segment = Segment::new();
        for device in devices {
            segment.push(SubDevice::new(device, 0), CABLE_NS);
        }
        World::with(segment, parts, seed, Times::default(), CYCLE_NS)
    }

    pub fn with(segment: Segment, parts: Vec<DeviceConfig<'static>>, seed: u64, times: Times, cycle_ns: u64) -> World {
        let drives = parts.iter().take_while(|part| part.outputs.octets >= 8).count();
        let config = Box::leak(Box::new(Config {
            cycle_ns: cycle_ns as u32,
            devices: Vec::leak(parts),
            lost_max: 2,
            times,
        }));
        World {
            segment,
            main: Box::new(MainDevice::new(MAC, config).expect("it fits")),
            now_ns: 1_000_000,
            date_ns: 2_000_000,
            cycle_ns,
            phase: PhaseLoop::new(PhaseConfig::of_cycle(cycle_ns as u32)),
            events: Vec::new(),
            random: Random(seed),
            forger: Random(!seed),
            fate: Box::new(|_, _| Fate::Passes),
            on_way: Vec::new(),
            drives,
            targets: vec![0; drives],
            enable: false,
            sent: Vec::new(),
            cycles: 0,
            late_ns: Vec::new(),
            lost_last: 0,
            dates: Vec::new(),
            tap: Box::new(|_, _| {}),
            forge: Box::new(|_, _| Vec::new()),
        }
    }

    /// Drives whose clocks drift, and a terminal without a clock behind them.
    pub fn drives(count: u16, seed: u64) -> World {
        let mut devices: Vec<SubDeviceConfig> = (0..i64::from(count))
            .map(|number| drive(10_000 * (number % 9) - 40_000, 7_777_777_777 * number as u64))
            .collect();
        devices.push(models::digital_terminal(TERMINAL));
        let mut parts: Vec<DeviceConfig<'static>> = (0..count).map(drive_config).collect();
        parts.push(terminal_config(count));
        World::new(devices, parts, seed)
    }

    /// Time passes; devices do what they do by themselves, and what is on its way comes.
    fn pass_until(&mut self, until_ns: u64) {
        while self.now_ns < until_ns {
            let next_ns = self.segment.next_ns(self.now_ns).max(self.now_ns + 1);
            let comes_ns = self.on_way.iter().map(|(at_ns, _)| *at_ns).min().unwrap_or(u64::MAX);
            self.now_ns = next_ns.min(comes_ns).min(until_ns).max(self.now_ns);
            self.segment.poll(self.now_ns);
            self.deliver();
        }
    }

    fn deliver(&mut self) {
        let now_ns = self.now_ns;
        while let Some(at) = self.on_way.iter().position(|(at_ns, _)| *at_ns <= now_ns) {
            let (_, octets) = self.on_way.remove(at);
            self.main.receive(now_ns, &octets);
        }
    }

    /// A frame leaves, now.
    fn send(&mut self, mut octets: Vec<u8>, cyclic: bool) {
        (self.tap)(self.now_ns, &octets);
        let fate = (self.fate)(&mut self.random, cyclic);
        if fate == Fate::LostOut {
            return;
        }
        let Some(answer) = self.segment.receive(self.now_ns, &mut octets) else {
            return;
        };
        let at_ns = answer.at_ns;
        (self.tap)(at_ns, &octets);
        let forged = (self.forge)(&mut self.forger, &octets);
        self.on_way.extend(forged.into_iter().map(|octets| (at_ns - 1, octets)));
        match fate {
            Fate::Passes => self.on_way.push((at_ns, octets)),
            Fate::LostOut | Fate::Lost => {}
            Fate::Late(ns) => self.on_way.push((at_ns + ns, octets)),
            Fate::Twice => {
                self.on_way.push((at_ns, octets.clone()));
                self.on_way.push((at_ns + 2000, octets));
            }
            Fate::Forged => {
                let places: Vec<(usize, usize)> = Frame::parse(&octets).map_or(Vec::new(), |frame| {
                    let datagrams = frame.datagrams();
                    datagrams
                        .map(|datagram| (datagram.data_at(), datagram.data.len() + 2))
                        .collect()
                });
                for (at, length) in places {
                    // The beginning tells what the rest is: of mails their length, type, number, service, toggle.
                    let span = [16, length as u64][self.random.below(2) as usize].min(length as u64);
                    for _ in 0..self.random.below(4) {
                        let octet = at + self.random.below(span) as usize;
                        octets[octet] =
                            [octets[octet] ^ 1 << self.random.below(8), 0, 0xFF][self.random.below(3) as usize];
                    }
                    if self.random.below(4) == 0 {
                        octets[at + length - 2] = self.random.below(5) as u8;
                    }
                }
                self.on_way.push((at_ns, octets));
            }
            Fate::Corrupt => {
                // Headers only: behind them nothing tells wrong data from right, which is what the FCS is for.
                let at = self.random.below(18) as usize;
                octets[at] ^= 1 << self.random.below(8);
                self.on_way.push((at_ns, octets));
            }
        }
    }

    /// Octets that somebody else has sent.
    pub fn intrude(&mut self, octets: &[u8]) -> Received {
        self.main.receive(self.now_ns, octets)
    }

    /// One cycle, with services in the time that is left.
    pub fn cycle(&mut self) {
        self.application();
        let frames = self.main.prepare();
        let late_ns = self.random.below(JITTER_NS + 1);
        self.dates.extend(self.segment.device(0).system_ns(self.date_ns));
        self.pass_until(self.date_ns + late_ns);
        for number in 0..frames {
            let octets = self.main.frame(number).to_vec();
            self.sent.push((self.cycles, octets[17]));
            self.send(octets, true);
        }
        let ends_ns = self.date_ns + self.cycle_ns * 9 / 10;
        while frames > 0 && !self.main.cycle_is_whole() && self.now_ns < self.date_ns + self.cycle_ns / 2 {
            self.pass_until(self.now_ns + 5_000);
        }
        while self.now_ns < ends_ns {
            let frame = self.main.service_frame(self.now_ns).map(<[u8]>::to_vec);
            if let Some(octets) = frame {
                self.send(octets, false);
            }
            self.pass_until((self.now_ns + 20_000).min(ends_ns));
        }
        let moved = self.main.late_ns();
        self.lost_last = self.main.finish_cycle(self.now_ns);
        let moved = match moved {
            Some(late_ns) => {
                self.late_ns.push(late_ns);
                self.phase.correct(late_ns)
            }
            None => self.phase.hold(),
        };
        while let Some(event) = self.main.pop_event() {
            self.events.push(event);
        }
        self.date_ns = (self.date_ns + self.cycle_ns).wrapping_add_signed(moved);
        self.cycles += 1;
    }

    /// Switches drives on and moves them.
    fn application(&mut self) {
        for drive in 0..self.drives {
            let inputs = self.main.inputs(drive);
            let status = u16::from_le_bytes([inputs[0], inputs[1]]);
            let actual = i32::from_le_bytes([inputs[4], inputs[5], inputs[6], inputs[7]]);
            let is_on = status & 0x6F == 0x27;
            let control: u16 = match status & 0x6F {
                _ if !self.enable => 0,
                _ if status & 0x4F == 0x08 => 0x80,
                0x40 | 0x60 => 0x06,
                0x21 => 0x07,
                _ => 0x0F,
            };
            if is_on {
                self.targets[drive] += 10;
            } else {
                self.targets[drive] = actual;
            }
            let target = self.targets[drive];
            let outputs = self.main.outputs_mut(drive);
            outputs[..2].copy_from_slice(&control.to_le_bytes());
            outputs[2] = 8;
            outputs[4..8].copy_from_slice(&target.to_le_bytes());
        }
    }

    pub fn run(&mut self, cycles: u64) {
        for _ in 0..cycles {
            self.cycle();
        }
    }

    /// Until all are in OP; ns since the start.
    pub fn run_to_op(&mut self, cycles_max: u64) -> u64 {
        for _ in 0..cycles_max {
            self.cycle();
            if self.main.is_operational() {
                return self.now_ns;
            }
        }
        panic!("not in OP after {cycles_max} cycles: {:?}", self.events);
    }

    /// Whether a drive is switched on, by what it says.
    pub fn is_on(&self, drive: usize) -> bool {
        self.main.inputs(drive)[0] & 0x6F == 0x27
    }

    /// Position that a drive says it is at.
    pub fn actual(&self, drive: usize) -> i32 {
        let inputs = self.main.inputs(drive);
        i32::from_le_bytes([inputs[4], inputs[5], inputs[6], inputs[7]])
    }

    /// Events since the last call.
    pub fn take_events(&mut self) -> Vec<Event> {
        std::mem::take(&mut self.events)
    }
}
