//! The simulated nodes on the toy bus of tests: objects are copied from and to the one frame of each cycle.
//!
//! In:  frames of the master, the time. Out: the answer of all nodes.
//!
//! A node has from the start what its plan would have it told. Without frames its periods go by the clock, and nobody leads it.

use super::carrier::{Carrier, Device, tables};
use super::near_end::{MEMORY_MAC, VirtualBus, VirtualWire};
use super::{SimError, VirtualNet, drive, protocol};
use bus::FRAME_OCTETS_MAX;
use bus::frames::FrameKind;
use bus::toy::{ANSWER, ETHER_TYPE, KIND, PAYLOAD, Toy};
use bus::watch::Watch;
use config::{Config, Mapped, NodeIndex};
use obd::{AbortCode, DataType, Dictionary, EntryDef, Handle};
use powerlink::nmt::NmtState;
use std::sync::Arc;

/// Beside the objects of drives, those of inputs and outputs and the error register.
const ENTRIES: usize = drive::ENTRIES + 64;
const OCTETS: usize = drive::OCTETS + 512;
const COMMUNICATION: &[EntryDef] = &[EntryDef::ro(0x1001, DataType::U8, "Error register")];
/// Periods without a frame after which nobody leads the nodes.
const PATIENCE: u64 = 4;

/// How the toy bus is simulated.
pub(super) struct Simulated;

impl protocol::Simulated for Simulated {
    fn nodes(&self, config: &Config) -> Result<Box<dyn Carrier>, SimError> {
        let places = (0..config.bus.nodes.len()).map(|index| Place::new(config, index));
        Ok(Box::new(Nodes {
            places: places.collect::<Result<_, _>>()?,
            period_ns: 1000 * u64::from(config.cycle_us),
            due_ns: 0,
            led: false,
            answer: Box::new([0; FRAME_OCTETS_MAX]),
        }))
    }

    fn with_virtual(
        &self,
        config: &Config,
        link: VirtualNet,
        watch: Arc<Watch>,
        run: Box<dyn FnOnce(VirtualBus<'_>) + '_>,
    ) -> anyhow::Result<()> {
        run(Box::new(Toy::new(config, link, MEMORY_MAC, watch)));
        Ok(())
    }

    fn takes_every_frame(&self) -> bool {
        true
    }
}

impl VirtualWire for Toy<VirtualNet> {
    fn net(&mut self) -> &mut VirtualNet {
        self.link_mut()
    }
}

/// A node on the bus.
#[derive(Debug)]
struct Place {
    objects: Box<Dictionary<ENTRIES, OCTETS>>,
    device: Device,
    outputs: Vec<Handle>,
    inputs: Vec<Handle>,
    plugged: bool,
    /// Answers that are still to get lost.
    to_drop: u32,
}

impl Place {
    fn new(config: &Config, index: NodeIndex) -> Result<Place, SimError> {
        let node = &config.bus.nodes[index];
        let failed = |error: AbortCode| SimError::new(node, error);
        let mut lines = vec![COMMUNICATION];
        lines.extend(tables(config, index));
        let mut objects = Dictionary::new(&lines).map_err(|error| SimError::new(node, error))?;
        let device = Device::new(config, index, &mut objects)?;
        for write in &bus::plan(config)[index].writes {
            let told = objects.find(write.index, write.sub);
            told.and_then(|object| objects.set_default(object, &write.value))
                .map_err(failed)?;
        }
        let find = |mapped: &Mapped| objects.find(mapped.index, mapped.sub).map_err(failed);
        Ok(Place {
            outputs: node.outputs.iter().map(find).collect::<Result<_, _>>()?,
            inputs: node.inputs.iter().map(find).collect::<Result<_, _>>()?,
            objects: Box::new(objects),
            device,
            plugged: true,
            to_drop: 0,
        })
    }

    /// Whether it takes part in this cycle.
    fn is_there(&mut self) -> bool {
        let dropped = self.to_drop > 0;
        self.to_drop = self.to_drop.saturating_sub(1);
        self.plugged && self.device.is_powered() && !dropped
    }

    fn take(&mut self, mut payload: &[u8]) {
        for object in &self.outputs {
            let (value, rest) = payload.split_at(object.size());
            // Its length is that of the object.
            let _ = self.objects.set_octets(*object, value);
            payload = rest;
        }
    }

    fn give(&self, mut payload: &mut [u8]) {
        for object in &self.inputs {
            let (value, rest) = std::mem::take(&mut payload).split_at_mut(object.size());
            value.copy_from_slice(self.objects.octets(*object));
            payload = rest;
        }
    }
}

/// All nodes of a machine file.
#[derive(Debug)]
struct Nodes {
    places: Vec<Place>,
    period_ns: u64,
    /// When a period ends by the clock.
    due_ns: u64,
    /// Frames come.
    led: bool,
    answer: Box<[u8; FRAME_OCTETS_MAX]>,
}

impl Nodes {
    /// A period of all drives.
    fn step(&mut self) {
        for place in &mut self.places {
            let led = self.led && place.plugged;
            if let Device::Drive(drive) = &mut place.device {
                drive.step(&mut place.objects, led);
            }
        }
    }
}

impl Carrier for Nodes {
    fn receive(&mut self, now_ns: u64, frame: &[u8], send: &mut dyn FnMut(&[u8])) -> bool {
        if frame.get(12..14) != Some(&ETHER_TYPE) || FrameKind::of(frame) != FrameKind::Soc {
            return false;
        }
        let Some((head, mut outputs)) = frame.split_at_checked(PAYLOAD) else {
            return false;
        };
        self.answer[..PAYLOAD].copy_from_slice(head);
        self.answer[KIND] = ANSWER;
        let mut at = PAYLOAD;
        for place in &mut self.places {
            let size = |objects: &[Handle]| objects.iter().map(|object| object.size()).sum::<usize>();
            let end = at + 1 + size(&place.inputs);
            let Some((own, rest)) = outputs.split_at_checked(size(&place.outputs)) else {
                return false;
            };
            outputs = rest;
            let there = place.is_there();
            self.answer[at] = there.into();
            if there {
                place.take(own);
                place.give(&mut self.answer[at + 1..end]);
            }
            at = end;
        }
        send(&self.answer[..at]);
        (self.led, self.due_ns) = (true, now_ns + PATIENCE * self.period_ns);
        self.step();
        true
    }

    fn poll(&mut self, now_ns: u64, _: &mut dyn FnMut(&[u8])) -> bool {
        if now_ns < self.due_ns {
            return false;
        }
        (self.led, self.due_ns) = (false, now_ns + self.period_ns);
        self.step();
        true
    }

    fn work_io(&mut self) {
        for place in &mut self.places {
            let led = self.led && place.plugged;
            if let Device::Io(io) = &mut place.device {
                io.work(&mut place.objects, led);
            }
        }
    }

    fn next_poll_ns(&self) -> Option<u64> {
        Some(self.due_ns)
    }

    fn device(&self, place: usize) -> &Device {
        &self.places[place].device
    }

    fn device_mut(&mut self, place: usize) -> &mut Device {
        &mut self.places[place].device
    }

    fn is_operational(&self, place: usize) -> bool {
        let place = &self.places[place];
        self.led && place.plugged && place.device.is_powered()
    }

    fn outputs(&self, place: usize) -> Option<[u8; 2]> {
        match &self.places[place].device {
            Device::Io(io) if self.is_operational(place) => Some(io.outputs(&self.places[place].objects)),
            Device::Io(_) => Some([0; 2]),
            Device::Drive(_) => None,
        }
    }

    fn plug(&mut self, place: usize, plugged: bool) {
        self.places[place].plugged = plugged;
    }

    fn drop_answers(&mut self, place: usize, count: u32) {
        self.places[place].to_drop = count;
    }

    fn power_off(&mut self, place: usize) {
        self.places[place].device.power_off();
    }

    fn power_on(&mut self, place: usize, now_ns: u64) -> bool {
        self.due_ns = now_ns + self.period_ns;
        let Place { objects, device, .. } = &mut self.places[place];
        objects.restore_defaults(0x1000, 0xFFFF);
        device.power_on(objects).is_ok()
    }

    /// It has no place for them.
    fn send_ethernet(&mut self, _: usize, _: &[u8]) {}

    fn nmt_state(&self, _: usize) -> Option<NmtState> {
        None
    }
}
