//! Pins of I/O nodes: single bits and whole numbers of their payloads, and channels with a name and a unit.
//!
//! In:  payloads of the nodes; pins that others drive.
//! Out: pins that others read; payloads; inputs that go out of their range.
//!
//! `IoPins::new` and what it calls are for start-up; the rest is RT.

mod counter;
mod objects;

use crate::analog::AnalogDrives;
use crate::spindle::Spindle;
use bus::layout::Field;
use bus::plan::NodePlan;
use bus::{InputImage, OutputImage};
use config::{Channel, ChannelKind, Config, Mapped, Node, ObjectKind, Profile};
use counter::CounterPins;
use hal_pins::{Hal, HalError, Input, Output};
use machine::faults::Fault;
use objects::{Driven, Place, Shown};

struct BitIn {
    place: Place,
    bit: u32,
    pin: Output<bool>,
}

struct BitOut {
    place: Place,
    bit: u32,
    pin: Input<bool>,
}

struct AnalogIn {
    place: Place,
    scale: f64,
    offset: f64,
    /// Share of the way to a new value in one cycle; 1: no filter.
    gain: f64,
    range: [i64; 2],
    value: Output<f64>,
    fault: Option<Output<bool>>,
    /// The filter has a value.
    begun: bool,
    filtered: f64,
    was_beyond: bool,
    /// Raw value and limit, until it is told.
    untold: Option<(i64, i64)>,
}

/// Number of the first bit of an object among the numbered inputs or outputs of its node; `None`: its bits have names only. What
/// channels make of an object does not move the numbers of others.
fn numbered(node: &Node, object: Mapped, number: &mut u32) -> Option<u32> {
    let first = *number;
    node.is_of_bits(object).then(|| {
        *number += u32::from(object.bits);
        first
    })
}

impl AnalogIn {
    fn show(&mut self, payload: &[u8]) {
        let now = self.place.number(payload) * self.scale + self.offset;
        if std::mem::replace(&mut self.begun, true) && self.gain < 1.0 && self.filtered.is_finite() {
            self.filtered += self.gain * (now - self.filtered);
        } else {
            self.filtered = now;
        }
        self.value.set(self.filtered);
        let Some(fault) = &mut self.fault else { return };
        let raw = self.place.whole(payload);
        let [least, most] = self.range;
        let beyond = !now.is_finite() || !(least..=most).contains(&raw);
        fault.set(beyond);
        if beyond && !self.was_beyond {
            self.untold = Some((raw, if raw < least { least } else { most }));
        }
        self.was_beyond = beyond;
    }
}

struct AnalogOut {
    place: Place,
    scale: f64,
    offset: f64,
    range: [f64; 2],
    pin: Input<f64>,
}

struct PwmOut {
    place: Place,
    scale: f64,
    full: f64,
    pin: Input<f64>,
}

struct Relay {
    place: Place,
    bit: u32,
    on: bool,
    switchings: Output<u32>,
}

/// A node that has been silent for so long, s, and for three of its rounds, may have been restarted meanwhile.
const OUT_OF_SIGHT_S: f64 = 0.1;

/// Pins of a counter, and the name of its channel: more than any other channel has.
const CHANNEL_PINS: usize = 9;

/// Pins that the nodes have at the most, and other names of these.
pub fn count_pins(config: &Config) -> usize {
    let of_node = |node: &Node| {
        let of_object = |object: &Mapped| match (node.profile, node.object_kind(*object)) {
            // A bit goes by its number and by the name of its channel.
            (Profile::Io, ObjectKind::Bits) => 2 * usize::from(object.bits),
            _ => 1,
        };
        let objects = node.inputs.iter().chain(&node.outputs).map(of_object);
        let is_made = |channel: &&Channel| !matches!(channel.kind, ChannelKind::Bit { .. });
        let channels = node.channels.iter().filter(is_made).count();
        // What it is like, and how many of its answers were lost.
        2 + objects.sum::<usize>() + CHANNEL_PINS * channels
    };
    config.bus.nodes.iter().map(of_node).sum()
}

/// All pins of I/O nodes.
#[derive(Default)]
pub struct IoPins {
    bits_in: Vec<BitIn>,
    bits_out: Vec<BitOut>,
    shown_in: Vec<Shown>,
    shown_out: Vec<Shown>,
    driven: Vec<Driven>,
    analogs_in: Vec<AnalogIn>,
    analogs_out: Vec<AnalogOut>,
    pwms: Vec<PwmOut>,
    relays: Vec<Relay>,
    counters: Vec<CounterPins>,
    out_of_sight_s: f64,
    cycle: u64,
}

impl IoPins {
    /// The pins of all I/O nodes.
    ///
    /// # Errors
    /// Shared memory too small.
    pub fn new(hal: &mut Hal, config: &Config, plans: &[NodePlan]) -> Result<IoPins, HalError> {
        let cycle_s = f64::from(config.cycle_us) * 1e-6;
        let round_s = f64::from(config.bus.multiplex_cycles.max(1)) * cycle_s;
        let mut pins = IoPins {
            out_of_sight_s: OUT_OF_SIGHT_S.max(3.0 * round_s),
            ..IoPins::default()
        };
        for (index, (node, plan)) in config.bus.nodes.iter().zip(plans).enumerate() {
            if node.profile != Profile::Io {
                continue;
            }
            let place = |field: Field| Place {
                node: index,
                field,
                kind: node.object_kind(field.object),
            };
            // What the spindle and amplifiers use has pins only where a channel shows it, too.
            let has_pins = |field: &&Field| {
                !(Spindle::uses(config, index, field) || AnalogDrives::uses(config, index, field))
                    || node.channels.iter().any(|channel| channel.object == field.object)
            };
            let inputs = plan.inputs.fields.iter().filter(has_pins);
            pins.objects_in(hal, node, inputs.map(|field| place(*field)))?;
            let outputs = plan.outputs.fields.iter().filter(has_pins);
            pins.objects_out(hal, node, outputs.map(|field| place(*field)))?;
            for channel in &node.channels {
                let payload = if channel.output { &plan.outputs } else { &plan.inputs };
                let Some(field) = payload.find(channel.object.index, channel.object.sub) else {
                    continue;
                };
                let latch = match channel.kind {
                    ChannelKind::Counter { follow } => follow.latch,
                    _ => None,
                };
                let latch = latch.and_then(|latch| plan.inputs.find(latch.index, latch.sub));
                pins.channel(hal, node, channel, place(field), latch, cycle_s)?;
            }
        }
        Ok(pins)
    }

    fn objects_in(&mut self, hal: &mut Hal, node: &Node, places: impl Iterator<Item = Place>) -> Result<(), HalError> {
        let mut number = 0;
        for place in places {
            let object = place.field.object;
            let first = numbered(node, object, &mut number);
            if place.kind != ObjectKind::Bits {
                self.shown_in.push(Shown::new(hal, &object_name(node, object), place)?);
                continue;
            }
            for bit in 0..u32::from(object.bits) {
                let channel = channel_of_bit(node, object, bit, false).map(|channel| channel_name(node, channel));
                let plain = first.map(|first| format!("io.{}.in-{:02}", node.id, first + bit));
                let Some(name) = plain.as_ref().or(channel.as_ref()) else {
                    continue;
                };
                let pin = hal.output(name)?;
                self.bits_in.push(BitIn { place, bit, pin });
                if let (Some(plain), Some(channel)) = (&plain, &channel) {
                    hal.alias(channel, plain)?;
                }
            }
        }
        Ok(())
    }

    fn objects_out(&mut self, hal: &mut Hal, node: &Node, places: impl Iterator<Item = Place>) -> Result<(), HalError> {
        let mut number = 0;
        for place in places {
            let object = place.field.object;
            let first = numbered(node, object, &mut number);
            if place.kind != ObjectKind::Bits {
                let name = object_name(node, object);
                let is_made = |channel: &Channel| {
                    channel.output
                        && channel.object == place.field.object
                        && matches!(channel.kind, ChannelKind::Analog { .. } | ChannelKind::Pwm { .. })
                };
                if node.channels.iter().any(is_made) {
                    self.shown_out.push(Shown::new(hal, &name, place)?);
                } else {
                    self.driven.push(Driven::new(hal, &name, place)?);
                }
                continue;
            }
            for bit in 0..u32::from(object.bits) {
                let channel = channel_of_bit(node, object, bit, true).map(|channel| channel_name(node, channel));
                let plain = first.map(|first| format!("io.{}.out-{:02}", node.id, first + bit));
                let Some(name) = plain.as_ref().or(channel.as_ref()) else {
                    continue;
                };
                let pin = hal.input(name, false)?;
                self.bits_out.push(BitOut { place, bit, pin });
                if let (Some(plain), Some(channel)) = (&plain, &channel) {
                    hal.alias(channel, plain)?;
                }
            }
        }
        Ok(())
    }

    fn channel(
        &mut self,
        hal: &mut Hal,
        node: &Node,
        channel: &Channel,
        place: Place,
        latch: Option<Field>,
        cycle_s: f64,
    ) -> Result<(), HalError> {
        let name = channel_name(node, channel);
        let object = object_name(node, channel.object);
        match channel.kind {
            // Its pin has been given its name where it was made.
            ChannelKind::Bit { .. } => {}
            ChannelKind::Relay { bit } => self.relays.push(Relay {
                place,
                bit: bit.into(),
                on: false,
                switchings: hal.output(&format!("{name}-switchings"))?,
            }),
            ChannelKind::Integer { .. } => hal.alias(&name, &object)?,
            ChannelKind::Analog {
                scale,
                offset,
                filter_hz,
                raw_min,
                raw_max,
                ..
            } => {
                hal.alias(&format!("{name}-raw"), &object)?;
                if channel.output {
                    let [least, most] = place.range();
                    self.analogs_out.push(AnalogOut {
                        place,
                        scale,
                        offset,
                        range: [
                            raw_min.map_or(least, |raw| least.max(raw as f64)),
                            raw_max.map_or(most, |raw| most.min(raw as f64)),
                        ],
                        pin: hal.input(&name, 0.0)?,
                    });
                } else {
                    let watched = raw_min.is_some() || raw_max.is_some();
                    let fault = match watched {
                        true => Some(hal.output(&format!("{name}-fault"))?),
                        false => None,
                    };
                    self.analogs_in.push(AnalogIn {
                        place,
                        scale,
                        offset,
                        gain: filter_hz.map_or(1.0, |hz| 1.0 - (-std::f64::consts::TAU * hz * cycle_s).exp()),
                        range: [raw_min.unwrap_or(i64::MIN), raw_max.unwrap_or(i64::MAX)],
                        value: hal.output(&name)?,
                        fault,
                        begun: false,
                        filtered: 0.0,
                        was_beyond: false,
                        untold: None,
                    });
                }
            }
            ChannelKind::Counter { follow } => {
                let times_s = [cycle_s, self.out_of_sight_s];
                let pins = CounterPins::new(hal, &name, place, follow, latch, times_s)?;
                self.counters.push(pins);
                hal.alias(&name, &format!("{name}.position"))?;
            }
            ChannelKind::Pwm { scale, full } => {
                hal.alias(&format!("{name}-raw"), &object)?;
                self.pwms.push(PwmOut {
                    place,
                    scale,
                    full: full as f64,
                    pin: hal.input(&name, 0.0)?,
                });
            }
        }
        if !channel.unit.is_empty() {
            hal.set_unit(&name, &channel.unit)?;
        }
        Ok(())
    }

    /// Shows what the nodes sent. Where an answer got lost, everything stays as it was. RT.
    pub fn show(&mut self, inputs: &InputImage) {
        self.cycle += 1;
        for bit in &mut self.bits_in {
            let payload = inputs.payload.node(bit.place.node);
            bit.pin.set(bit.place.read(payload) >> bit.bit & 1 == 1);
        }
        for shown in &mut self.shown_in {
            shown.show(inputs.payload.node(shown.place.node));
        }
        for analog in &mut self.analogs_in {
            if inputs.fresh[analog.place.node] {
                analog.show(inputs.payload.node(analog.place.node));
            }
        }
        for counter in &mut self.counters {
            if inputs.fresh[counter.place.node] {
                counter.show(inputs.payload.node(counter.place.node), self.cycle);
            }
        }
    }

    /// Fills the outputs. RT.
    pub fn write(&mut self, outputs: &mut OutputImage) {
        for bit in &self.bits_out {
            let payload = outputs.node_mut(bit.place.node);
            let word = bit.place.read(payload) & !(1 << bit.bit) | u64::from(bit.pin.get()) << bit.bit;
            bit.place.field.write(payload, word);
        }
        for driven in &self.driven {
            driven.write(outputs.node_mut(driven.place.node));
        }
        for analog in &self.analogs_out {
            let [least, most] = analog.range;
            let value = analog.pin.get();
            let value = if value.is_nan() { 0.0 } else { value };
            // Not `clamp`, which has no answer where a range of the machine file lies beyond that of the object.
            let raw = ((value - analog.offset) / analog.scale).max(least).min(most);
            analog.place.write_number(outputs.node_mut(analog.place.node), raw);
        }
        for pwm in &self.pwms {
            // NaN is no duty.
            #[allow(clippy::manual_clamp, reason = "max and min turn NaN into 0")]
            let duty = (pwm.pin.get() / pwm.scale).max(0.0).min(1.0);
            pwm.place
                .write_number(outputs.node_mut(pwm.place.node), duty * pwm.full);
        }
        for relay in &mut self.relays {
            let on = relay.place.read(outputs.node(relay.place.node)) >> relay.bit & 1 == 1;
            if on != std::mem::replace(&mut relay.on, on) {
                relay.switchings.set(relay.switchings.get().wrapping_add(1));
            }
        }
        for shown in &mut self.shown_out {
            shown.show(outputs.node(shown.place.node));
        }
    }

    /// An input that went out of its range, one a call; each once as it does. RT.
    pub fn take_fault(&mut self) -> Option<Fault> {
        self.analogs_in.iter_mut().find_map(|analog| {
            let (raw, limit) = analog.untold.take()?;
            let object = analog.place.field.object;
            Some(Fault::InputRange {
                node: analog.place.node,
                object: (object.index, object.sub),
                raw,
                limit,
            })
        })
    }
}

fn channel_name(node: &Node, channel: &Channel) -> String {
    format!("io.{}.{}", node.id, channel.name)
}

/// Name of the pin of a whole object.
fn object_name(node: &Node, object: Mapped) -> String {
    format!("io.{}.object-{:04x}-{:02x}", node.id, object.index, object.sub)
}

fn channel_of_bit(node: &Node, object: Mapped, number: u32, output: bool) -> Option<&Channel> {
    node.channels.iter().find(|channel| {
        let is_bit = match channel.kind {
            ChannelKind::Bit { bit } | ChannelKind::Relay { bit } => u32::from(bit) == number,
            _ => false,
        };
        is_bit && channel.object == object && channel.output == output
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    use std::path::Path;

    /// A module of these payloads and channels; its pins.
    fn module(keys: &str) -> (Hal, IoPins, OutputImage, InputImage, tempfile::TempDir) {
        let text = format!(
            "schema = 1\n[machine]\nname = \"m\"\nkinematics = \"none\"\n[bus]\nkind = \"memory\"\n[[bus.node]]\nid = 5\nprofile = \"io\"\n{keys}"
        );
        let config = config::parse(&text, Path::new("m.toml")).unwrap_or_else(|errors| panic!("{errors}"));
        let plans = bus::plan(&config);
        let folder = tempfile::tempdir().unwrap();
        let mut hal = Hal::create_in(&[folder.path().to_owned()], "io", 256).unwrap();
        let pins = IoPins::new(&mut hal, &config, &plans).unwrap();
        let outputs = OutputImage::new(plans.iter().map(|plan| plan.outputs.octets));
        let mut inputs = InputImage::new(plans.iter().map(|plan| plan.inputs.octets));
        inputs.fresh[0] = true;
        (hal, pins, outputs, inputs, folder)
    }

    #[test]
    fn a_channel_does_not_move_the_numbers_of_other_bits() {
        let payloads = "outputs = [\"0x2000:1/16\", \"0x6200:1/8\", \"0x6200:2/8\"]\ninputs = []\n";
        for (channels, lamp) in [
            ("", None),
            (
                "channel = [{ name = \"lamp\", object = \"0x2000:1\", bit = 3 }]\n",
                Some(0x08),
            ),
        ] {
            let (hal, mut pins, mut outputs, ..) = module(&format!("{payloads}{channels}"));
            hal.set("io.5.out-00", true).unwrap();
            hal.set("io.5.out-15", true).unwrap();
            if lamp.is_some() {
                hal.set("io.5.lamp", true).unwrap();
            }
            pins.write(&mut outputs);
            assert_eq!(outputs.node(0), [lamp.unwrap_or(0), 0, 0x01, 0x80], "{channels}");
            assert!(hal.reader::<bool>("io.5.out-16").is_err());
        }
        // An object of bits that is one number keeps its numbers, too.
        let channels = "channel = [{ name = \"n\", object = \"0x6200:1\", type = \"integer\" }]\n";
        let (hal, mut pins, mut outputs, ..) = module(&format!("{payloads}{channels}"));
        hal.set("io.5.out-08", true).unwrap();
        pins.write(&mut outputs);
        assert_eq!(outputs.node(0), [0, 0, 0, 0x01]);
        assert!(hal.reader::<bool>("io.5.out-00").is_err());
    }

    #[test]
    fn a_value_that_is_no_number_is_a_fault_and_gone_with_the_next_one() {
        for filter in ["", ", filter_hz = 5.0"] {
            let (hal, mut pins, _, mut inputs, _folder) = module(&format!(
                "inputs = [\"0x6403:1/32\"]\noutputs = []\nchannel = [{{ name = \"t\", object = \"0x6403:1\", raw_min = -10, raw_max = 90{filter} }}]\n"
            ));
            for (sent, shown) in [
                (20.0, Some(20.0)),
                (f32::NAN, None),
                (f32::INFINITY, None),
                (30.0, Some(30.0)),
            ] {
                inputs.payload.node_mut(0).copy_from_slice(&sent.to_le_bytes());
                pins.show(&inputs);
                assert_eq!(
                    hal.reader::<bool>("io.5.t-fault").unwrap().get(),
                    shown.is_none(),
                    "{sent}"
                );
                if let Some(shown) = shown {
                    assert_eq!(hal.reader::<f64>("io.5.t").unwrap().get(), shown, "{filter}");
                }
            }
        }
    }

    #[test]
    fn a_device_never_gets_what_is_no_number() {
        let (hal, mut pins, mut outputs, ..) = module("inputs = []\noutputs = [\"0x6413:1/32\"]\n");
        let sent = |outputs: &OutputImage| f32::from_le_bytes(outputs.node(0).try_into().unwrap());
        for (wanted, expected) in [(1.5, 1.5), (f64::NAN, 0.0), (1e300, f32::MAX), (-1e300, f32::MIN)] {
            hal.set("io.5.object-6413-01", wanted).unwrap();
            pins.write(&mut outputs);
            assert_eq!(sent(&outputs), expected, "{wanted}");
        }
    }

    /// As many nodes as a bus has, and stations full of modules: the room for their pins comes from the machine file.
    #[test]
    fn there_is_room_for_the_pins_of_every_node_that_a_bus_can_have() {
        let digital = |octets: u32| -> String {
            let objects = |index: u32| {
                (1..=octets)
                    .map(move |sub| format!("\"0x{index:04X}:{sub}/8\""))
                    .collect::<Vec<_>>()
                    .join(", ")
            };
            format!("inputs = [{}]\noutputs = [{}]\n", objects(0x6000), objects(0x6200))
        };
        let channels = |octets: u32| -> String {
            let of = |(index, word): (u32, &'static str)| {
                (0..8 * octets).map(move |bit| {
                    let (sub, place) = (1 + bit / 8, bit % 8);
                    format!("[[bus.node.channel]]\nname = \"{word}-{bit}\"\nobject = \"0x{index:04X}:{sub}\"\nbit = {place}\n")
                })
            };
            [(0x6000, "sensor"), (0x6200, "valve")]
                .into_iter()
                .flat_map(of)
                .collect()
        };
        // 239 nodes of 8 inputs and 8 outputs; 64 stations of 8 modules, each with 16 inputs and 16 outputs that have names.
        for (nodes, keys, pins) in [
            (239, digital(1), 239 * (2 + 16)),
            (64, digital(16) + &channels(16), 64 * (2 + 2 * 256)),
        ] {
            let mut text =
                "schema = 1\n[machine]\nname = \"m\"\nkinematics = \"none\"\n[bus]\nkind = \"memory\"\n".to_owned();
            for id in 1..=nodes {
                text += &format!("[[bus.node]]\nid = {id}\nname = \"n{id}\"\nprofile = \"io\"\n{keys}");
            }
            let config = config::parse(&text, Path::new("m.toml")).unwrap_or_else(|errors| panic!("{errors}"));
            let folder = tempfile::tempdir().unwrap();
            let room = crate::pins::capacity(&config);
            let mut hal = Hal::create_in(&[folder.path().to_owned()], "many", room).unwrap();
            let steps = crate::steps::StepDrives::new(&config);
            crate::pins::Pins::new(&mut hal, &config, &bus::plan(&config), &steps).unwrap();
            let made = hal.list().len();
            assert!(made > pins && made <= room, "{nodes} nodes: {made} of {room}");
        }
    }
}
