//! A simulated node of inputs and outputs (CiA 401): 16 outputs to contactors, 16 inputs; 8 analog inputs 6401h and outputs 6411h;
//! counters 3000h and PWM outputs 3100h as a maker may add them.
//!
//! In:  outputs 6200h/1 and /2 from the managing node; [`Io::set_inputs`] for what is wired to the inputs.
//! Out: inputs 6000h/1, the auxiliary contacts of the contactors on 6200h/1, and 6000h/2, the wired inputs; what the signals of
//!      the machine file (`[[sim.signal]]`) have at their objects.
//!
//! Output 15 (6200h/2, bit 7) orients the spindle: it turns to its index and is held there, which input 15 (6000h/2, bit 7) tells.
//!
//! The spindle hangs on the same node: its frequency converter on the analog output 6411h/1, the counter of its encoder on
//! 3000h/1, the count at the last index on 3000h/2.
//!
//! When the bus does not lead the node the outputs fall back to zero, as the profile has it by default.

use super::SimError;
use super::amplifier::Amplifier;
use super::spindle::Spindle;
use config::{Config, Mapped, Node, NodeIndex, SimSignal};
use obd::{DataType, Dictionary, EntryDef, Handle, Key};

/// 1000h: profile 401, digital inputs and outputs.
pub(super) const DEVICE_TYPE: u32 = 0x000F_0191;

/// Objects of the node beside the communication profile.
pub(super) const IO_OBJECTS: &[EntryDef] = &[
    EntryDef::ro(0x6000, DataType::U8, "DigitalInput_00h_AU8")
        .subs(1, 2)
        .tpdo(),
    EntryDef::rw(0x6200, DataType::U8, "DigitalOutput_00h_AU8")
        .subs(1, 2)
        .rpdo(),
    EntryDef::ro(0x6401, DataType::I16, "AnalogueInput_00h_AI16")
        .subs(1, 8)
        .tpdo(),
    EntryDef::rw(0x6411, DataType::I16, "AnalogueOutput_00h_AI16")
        .subs(1, 8)
        .rpdo(),
    EntryDef::ro(0x3000, DataType::U32, "Counter_00h_AU32")
        .subs(1, 8)
        .tpdo(),
    EntryDef::rw(0x3100, DataType::U16, "PwmDuty_00h_AU16")
        .subs(1, 4)
        .rpdo(),
];

/// Bit of the output that orients the spindle, and of the input that tells that it is there.
const ORIENT: u8 = 0x80;

#[derive(Debug)]
pub(super) struct Io {
    powered: bool,
    input_keys: [Key<u8>; 2],
    output_keys: [Key<u8>; 2],
    speed_key: Key<i16>,
    encoder_keys: [Key<u32>; 2],
    wired: u8,
    spindle: Spindle,
    /// What sensors of the machine say, in addition.
    sensed: u8,
    /// Analog and PWM outputs.
    numbers_out: Vec<Handle>,
    signals: Vec<Signal>,
    amplifiers: Vec<(Amplifier, [Handle; 3])>,
    period_ns: u64,
    /// Cycles since it was switched on.
    cycles: u64,
}

/// A signal at an input.
#[derive(Clone, Copy, Debug)]
struct Signal {
    is: SimSignal,
    into: Handle,
    from: Option<Handle>,
    latch: Option<(Handle, u32)>,
}

impl Signal {
    fn new<const E: usize, const B: usize>(
        objects: &Dictionary<E, B>,
        node: &Node,
        is: SimSignal,
    ) -> Result<Signal, SimError> {
        let find = |(index, sub)| objects.find(index, sub).map_err(|error| SimError::new(node, error));
        Ok(Signal {
            is,
            into: find(is.object)?,
            from: is.from.map(find).transpose()?,
            latch: match is.latch {
                Some((object, every)) => Some((find(object)?, every)),
                None => None,
            },
        })
    }

    fn apply<const E: usize, const B: usize>(&self, objects: &mut Dictionary<E, B>, t_s: f64) {
        let is = &self.is;
        let wave = match is.amplitude {
            0.0 => 0.0,
            amplitude => amplitude * (std::f64::consts::TAU * t_s / is.period_s).sin(),
        };
        let wired = self.from.map_or(0, |from| number(objects.octets(from)));
        let value = (is.value + is.per_second * t_s + wave).round() as i64 + wired;
        set_number(objects, self.into, value);
        if let Some((latch, every)) = self.latch {
            set_number(objects, latch, value.div_euclid(every.into()) * i64::from(every));
        }
    }
}

/// The signed number in so many octets.
fn number(octets: &[u8]) -> i64 {
    let mut whole = [0; 8];
    whole[..octets.len()].copy_from_slice(octets);
    let unused = 64 - 8 * octets.len() as u32;
    (i64::from_le_bytes(whole) << unused) >> unused
}

/// Writes the low octets of a number: counters wrap.
fn set_number<const E: usize, const B: usize>(objects: &mut Dictionary<E, B>, handle: Handle, value: i64) {
    let length = objects.octets(handle).len();
    // Its length is that of the object.
    let _ = objects.set_octets(handle, &value.to_le_bytes()[..length]);
}

impl Io {
    /// A node that is switched on; `objects` has [`IO_OBJECTS`].
    pub(super) fn new<const E: usize, const B: usize>(
        config: &Config,
        index: NodeIndex,
        period_ns: u64,
        objects: &Dictionary<E, B>,
    ) -> Result<Io, SimError> {
        let node = &config.bus.nodes[index];
        let key = |index, sub| objects.key(index, sub).map_err(|error| SimError::new(node, error));
        let input_keys = [key(0x6000, 1)?, key(0x6000, 2)?];
        let output_keys = [key(0x6200, 1)?, key(0x6200, 2)?];
        let speed_key = objects.key(0x6411, 1).map_err(|error| SimError::new(node, error))?;
        let encoder_key = |sub| objects.key(0x3000, sub).map_err(|error| SimError::new(node, error));
        let encoder_keys = [encoder_key(1)?, encoder_key(2)?];
        let outputs = (1..=8).map(|sub| (0x6411, sub)).chain((1..=4).map(|sub| (0x3100, sub)));
        let numbers_out = outputs
            .map(|(index, sub)| objects.find(index, sub).map_err(|error| SimError::new(node, error)))
            .collect::<Result<_, _>>()?;
        let signals = config.sim.signals.iter();
        let signals = signals
            .filter(|signal| signal.node == index)
            .map(|signal| Signal::new(objects, node, *signal))
            .collect::<Result<_, _>>()?;
        let find = |object: Mapped| {
            let found = objects.find(object.index, object.sub);
            found.map_err(|error| SimError::new(node, error))
        };
        let amplifiers = Amplifier::at_node(config, index)
            .map(|amplifier| {
                let is = amplifier.is();
                Ok((amplifier, [find(is.command)?, find(is.position)?, find(is.enable.0)?]))
            })
            .collect::<Result<_, SimError>>()?;
        Ok(Io {
            powered: true,
            input_keys,
            output_keys,
            speed_key,
            encoder_keys,
            wired: 0,
            spindle: Spindle::new(config),
            sensed: 0,
            numbers_out,
            signals,
            amplifiers,
            period_ns,
            cycles: 0,
        })
    }

    /// One cycle: contactors, inputs, spindle. `operational`: the bus leads it.
    ///
    /// RT: no allocation, no locks.
    pub(super) fn work<const E: usize, const B: usize>(&mut self, objects: &mut Dictionary<E, B>, operational: bool) {
        self.switch(objects, operational);
        self.spindle.orient = objects.get(self.output_keys[1]) & ORIENT != 0;
        self.spindle.advance(objects.get(self.speed_key));
        objects.set(self.encoder_keys[0], self.spindle.count() as u32);
        objects.set(self.encoder_keys[1], self.spindle.latched() as u32);
        self.cycles += 1;
        let t_s = self.cycles as f64 * self.period_ns as f64 * 1e-9;
        for signal in &self.signals {
            signal.apply(objects, t_s);
        }
        let period_s = self.period_ns as f64 * 1e-9;
        for (amplifier, [command, position, enable]) in &mut self.amplifiers {
            let on = number(objects.octets(*enable)) >> amplifier.is().enable.1 & 1 == 1;
            amplifier.advance(number(objects.octets(*command)), on, period_s);
            set_number(objects, *position, amplifier.count());
        }
    }

    /// Where the load of a joint is that an amplifier at this node moves, mm.
    pub(super) fn load_mm(&self, joint: usize) -> Option<f64> {
        let mut amplifiers = self.amplifiers.iter().map(|(amplifier, _)| amplifier);
        amplifiers.find_map(|amplifier| amplifier.load_mm(joint))
    }

    /// Switches the contactors and reads the inputs.
    pub(super) fn switch<const E: usize, const B: usize>(&self, objects: &mut Dictionary<E, B>, operational: bool) {
        if !operational {
            for key in self.output_keys {
                objects.set(key, 0);
            }
            for handle in &self.numbers_out {
                set_number(objects, *handle, 0);
            }
        }
        let contacts = objects.get(self.output_keys[0]);
        objects.set(self.input_keys[0], contacts);
        let oriented = if self.spindle.is_oriented() { ORIENT } else { 0 };
        objects.set(self.input_keys[1], self.wired | self.sensed | oriented);
    }

    /// Whether it has its supply.
    pub(super) fn is_powered(&self) -> bool {
        self.powered
    }

    pub(super) fn power_off(&mut self) {
        self.powered = false;
    }

    pub(super) fn power_on(&mut self) {
        for (amplifier, _) in &mut self.amplifiers {
            *amplifier = amplifier.anew();
        }
        (self.powered, self.sensed, self.cycles) = (true, 0, 0);
    }

    /// Outputs 6200h/1 and /2.
    pub(super) fn outputs<const E: usize, const B: usize>(&self, objects: &Dictionary<E, B>) -> [u8; 2] {
        self.output_keys.map(|key| objects.get(key))
    }

    /// A sensor of the machine at a bit of 6000h/2.
    pub(super) fn sense(&mut self, bit: u8, closed: bool) {
        self.sensed = self.sensed & !(1 << bit) | u8::from(closed) << bit;
    }

    /// What is wired to 6000h/2.
    pub(super) fn set_inputs(&mut self, wired: u8) {
        self.wired = wired;
    }

    /// The spindle behind this node.
    pub(super) fn spindle(&self) -> &Spindle {
        &self.spindle
    }

    /// The same, to do something to it.
    pub(super) fn spindle_mut(&mut self) -> &mut Spindle {
        &mut self.spindle
    }
}
