//! The simulated nodes on EtherCAT: a line of devices, each at the position that its id says, from 1.
//!
//! In:  frames of the main device, the time. Out: the same frames as the last device sends them back.
//!
//! A position that the machine file leaves out is a coupler. A drive lives by SYNC0 or, where it is not set up, by the frames that bring
//! its outputs; without both its periods go by its own clock. Its watchdog says how long it trusts its last set-point.

use super::SimError;
use super::carrier::{Carrier, Device, tables};
use super::drive;
use ::ethercat::sub::models::{self, CoeModel};
use ::ethercat::sub::{
    Application, COMMUNICATION, ClockConfig, Cycle, ENTRIES, OCTETS, ObjectStore, PDO_ENTRIES, Segment, SubDevice,
    SubDeviceConfig, esi,
};
use ::ethercat::wire::coe::Emergency;
use ::ethercat::wire::register::{AlState, AlStatusCode};
use ::ethercat::wire::sii::{General, Identity};
use ::ethercat::wire::{Addressing, FRAME_LEN_MAX, Frame};
use ::powerlink::nmt::NmtState;
use config::{Config, Mapped, Node, NodeIndex, Pdo, StartCommand};
use obd::{AbortCode, DataType, EntryDef};
use std::any::Any;

/// Ethernet type of EtherCAT.
const ETHER_TYPE: [u8; 2] = [0x88, 0xA4];
/// Cable between two devices, there and back each, ns.
const CABLE_NS: u64 = 300;
/// Octets of each mailbox.
const MAILBOX: u16 = 256;
/// Octets of the process data of a device in each direction at most, and of their three buffers.
const PDO_OCTETS: usize = 1024;
const ROOM: u16 = 3 * PDO_OCTETS as u16;
/// Clocks gain so much, one device after the other, parts in 10⁹; they came up so much apart, ns.
const GAINS_PPB: [i64; 5] = [18_000, -12_000, 31_000, -27_000, 5_000];
const APART_NS: u64 = 1_300_007;
/// The machine goes on after so many periods in which no drive that has its supply has moved.
const PATIENCE: u64 = 4;
/// Of simulated devices whose identity the machine file leaves open: a drive, a node of inputs and outputs, a coupler.
const PRODUCTS: [u32; 3] = [0x0402_0002, 0x0401_0002, 0x0001_0001];
/// Modules that the main device expects in the slots of a device, and those that stand in them (ETG.5001).
const MODULE_LIST: u16 = 0xF030;
const MODULES_FOUND: u16 = 0xF050;
/// All objects lie in one part.
const PART: usize = 0;

const _: () = assert!(ENTRIES >= drive::ENTRIES + 2 * obd::lines_of(COMMUNICATION) + 64);
const _: () = assert!(OCTETS >= drive::OCTETS + obd::octets_of(COMMUNICATION) + 2048);

/// What a device does with its process data.
#[derive(Debug)]
struct Behind {
    device: Device,
    /// The drive has moved since the machine looked.
    moved: bool,
    /// A period of the machine is over: a cycle of inputs and outputs is due.
    due: bool,
}

impl Application for Behind {
    fn start(&mut self, objects: &mut ObjectStore, period_ns: u32) -> Result<(), AlStatusCode> {
        let list = |index: u16| -> Vec<Vec<u8>> {
            let values = (0..=u8::MAX).map_while(|sub| objects.read(index, sub).ok());
            values.map(<[u8]>::to_vec).collect()
        };
        // A main device that has told no modules means those that there are.
        let told = list(MODULE_LIST);
        if told.first().is_some_and(|count| *count != [0]) && told != list(MODULES_FOUND) {
            return Err(AlStatusCode::MODULES);
        }
        match &mut self.device {
            Device::Drive(drive) => drive
                .set_period(objects.part(PART), period_ns)
                .map_err(|_| AlStatusCode::DEVICE_SETUP),
            Device::Io(_) => Ok(()),
        }
    }

    fn cycle(&mut self, cycle: Cycle<'_>) -> Option<Emergency> {
        let objects = cycle.objects.part_mut(PART);
        match &mut self.device {
            Device::Drive(drive) => {
                self.moved = true;
                let reports = drive.step(objects, cycle.led);
                let code = reports.into_iter().find(|code| *code != 0)?;
                let register = objects.read(0x1001, 0).map_or(0, |octets| octets[0]);
                Some(Emergency {
                    code,
                    register,
                    data: [0; 5],
                })
            }
            Device::Io(io) => {
                match std::mem::take(&mut self.due) {
                    true => io.work(objects, cycle.led),
                    false => io.switch(objects, cycle.led),
                }
                None
            }
        }
    }

    fn power_on(&mut self, objects: &mut ObjectStore) {
        // What was built once from the same objects can be built again.
        let _ = self.device.power_on(objects.part(PART));
    }
}

/// All nodes of a machine file.
#[derive(Debug)]
pub(super) struct Ethercat {
    segment: Segment,
    /// Position of each place on the segment, from 0.
    positions: Vec<usize>,
    /// Frames of cycles that are still to get lost in front of each place.
    to_drop: Vec<u32>,
    /// Process data came since the last period of the machine.
    exchanged: bool,
    period_ns: u64,
    /// When the last period of the machine ended.
    period_end_ns: u64,
    now_ns: u64,
    buffer: Box<[u8; FRAME_LEN_MAX]>,
}

impl Ethercat {
    /// All nodes switched on at time 0 of their clock.
    pub(super) fn new(config: &Config) -> Result<Ethercat, SimError> {
        let nodes = &config.bus.nodes;
        let positions: Vec<usize> = nodes.iter().map(|node| usize::from(node.id.max(1)) - 1).collect();
        let mut segment = Segment::new();
        for position in 0..positions.iter().map(|last| last + 1).max().unwrap_or(0) {
            let place = positions.iter().position(|of| *of == position);
            let device = match place {
                Some(index) => sub_device(config, index)?,
                None => models::coupler(identity(PRODUCTS[2])),
            };
            let clock = ClockConfig {
                gain_ppb: GAINS_PPB[position % GAINS_PPB.len()],
                start_ns: APART_NS * position as u64,
                wide: true,
            };
            let device = SubDeviceConfig {
                clock: place.map(|_| clock),
                ..device
            };
            segment.push(SubDevice::new(device, 0), CABLE_NS);
        }
        Ok(Ethercat {
            segment,
            to_drop: vec![0; positions.len()],
            positions,
            exchanged: false,
            period_ns: 1000 * u64::from(config.cycle_us),
            period_end_ns: 0,
            now_ns: 0,
            buffer: Box::new([0; FRAME_LEN_MAX]),
        })
    }

    fn sub(&self, place: usize) -> &SubDevice {
        self.segment.device(self.positions[place])
    }

    fn sub_mut(&mut self, place: usize) -> &mut SubDevice {
        self.segment.device_mut(self.positions[place])
    }

    fn behind(&self, place: usize) -> &Behind {
        let application: &dyn Any = self.sub(place).application();
        application.downcast_ref().unwrap_or_else(|| unreachable!("built so"))
    }

    fn behind_mut(&mut self, place: usize) -> &mut Behind {
        let application: &mut dyn Any = self.sub_mut(place).application_mut();
        application.downcast_mut().unwrap_or_else(|| unreachable!("built so"))
    }

    fn places(&self) -> std::ops::Range<usize> {
        0..self.positions.len()
    }

    /// Whether a period of the machine is over: all drives that have their supply have moved, or where there are none, process data
    /// have come. What has no supply any more is off.
    fn ends_period(&mut self, now_ns: u64) -> bool {
        let (mut drives, mut moved) = (0, 0);
        for place in self.places() {
            let behind = self.behind(place);
            if !behind.device.is_powered() {
                if self.sub(place).is_powered() {
                    self.segment.power_off(self.positions[place]);
                }
            } else if let Device::Drive(_) = behind.device {
                drives += 1;
                moved += usize::from(behind.moved);
            }
        }
        let is_over = match drives {
            0 => self.exchanged,
            _ => moved == drives,
        };
        if !is_over && now_ns < self.patience_ns() {
            return false;
        }
        self.exchanged = false;
        self.period_end_ns = now_ns;
        for place in self.places() {
            self.behind_mut(place).moved = false;
            // The motor of a drive without supply runs out.
            if let Device::Drive(drive) = &self.behind(place).device
                && !drive.is_powered()
            {
                self.sub_mut(place).run_application();
            }
        }
        true
    }

    fn patience_ns(&self) -> u64 {
        self.period_end_ns + PATIENCE * self.period_ns
    }

    /// Frames of cycles that are to get lost do so in front of their place.
    fn spoil(&mut self) {
        for place in self.places() {
            if self.to_drop[place] > 0 {
                self.to_drop[place] -= 1;
                self.segment.spoil_next(self.positions[place]);
            }
        }
    }
}

impl Carrier for Ethercat {
    fn receive(&mut self, now_ns: u64, frame: &[u8], send: &mut dyn FnMut(&[u8])) -> bool {
        if frame.len() <= FRAME_LEN_MAX && frame.get(12..14) == Some(&ETHER_TYPE) {
            if has_process_data(frame) {
                self.exchanged = true;
                self.spoil();
            }
            let octets = &mut self.buffer[..frame.len()];
            octets.copy_from_slice(frame);
            if self.segment.receive(now_ns, octets).is_some() {
                send(octets);
            }
        }
        self.now_ns = now_ns;
        self.ends_period(now_ns)
    }

    fn poll(&mut self, now_ns: u64, _: &mut dyn FnMut(&[u8])) -> bool {
        self.segment.poll(now_ns);
        self.now_ns = now_ns;
        self.ends_period(now_ns)
    }

    fn work_io(&mut self) {
        for place in self.places() {
            if let Device::Io(_) = self.behind(place).device {
                self.behind_mut(place).due = true;
                self.sub_mut(place).run_application();
            }
        }
    }

    fn next_poll_ns(&self) -> Option<u64> {
        Some(self.segment.next_ns(self.now_ns).min(self.patience_ns()))
    }

    fn device(&self, place: usize) -> &Device {
        &self.behind(place).device
    }

    fn device_mut(&mut self, place: usize) -> &mut Device {
        &mut self.behind_mut(place).device
    }

    fn is_operational(&self, place: usize) -> bool {
        let sub = self.sub(place);
        sub.is_powered() && sub.state() == AlState::Op
    }

    fn outputs(&self, place: usize) -> Option<[u8; 2]> {
        match &self.behind(place).device {
            Device::Io(io) if self.is_operational(place) => Some(io.outputs(self.sub(place).objects().part(PART))),
            Device::Io(_) => Some([0; 2]),
            Device::Drive(_) => None,
        }
    }

    fn plug(&mut self, place: usize, plugged: bool) {
        match plugged {
            true => self.segment.heal(self.positions[place]),
            false => self.segment.cut(self.positions[place]),
        }
    }

    fn drop_answers(&mut self, place: usize, count: u32) {
        self.to_drop[place] = count;
    }

    fn power_off(&mut self, place: usize) {
        self.behind_mut(place).device.power_off();
        self.segment.power_off(self.positions[place]);
    }

    fn power_on(&mut self, place: usize, now_ns: u64) -> bool {
        self.segment.power_on(self.positions[place], now_ns);
        (self.now_ns, self.period_end_ns) = (now_ns, now_ns);
        self.behind(place).device.is_powered()
    }

    /// EtherCAT has no place for them without EoE.
    fn send_ethernet(&mut self, _: usize, _: &[u8]) {}

    fn nmt_state(&self, _: usize) -> Option<NmtState> {
        None
    }
}

/// Whether a frame exchanges process data, which have logical addresses.
fn has_process_data(frame: &[u8]) -> bool {
    Frame::parse(frame).is_ok_and(|frame| {
        let mut datagrams = frame.datagrams();
        datagrams.any(|datagram| datagram.command.addressing() == Addressing::Logical)
    })
}

fn identity(product: u32) -> Identity {
    Identity {
        product,
        revision: 1,
        ..esi::TERMINAL
    }
}

/// The device of a node of the machine file: it shows the identity that the file expects, and exchanges what the file maps as it comes
/// out of the box.
fn sub_device(config: &Config, index: NodeIndex) -> Result<SubDeviceConfig, SimError> {
    let node = &config.bus.nodes[index];
    let failed = |error: AbortCode| SimError::new(node, error);
    let mut lines = vec![COMMUNICATION, pdo_lines(node)?];
    lines.extend(tables(config, index));
    lines.push(file_lines(node, &lines)?);
    let mut objects = ObjectStore::new();
    objects
        .add(0x1000..=0xFFFF, 0, &lines)
        .map_err(|error| SimError::new(node, error))?;
    let device = Device::new(config, index, objects.part_mut(PART))?;
    if let Device::Drive(_) = device {
        objects.set_write_check(drive::check_write);
    }
    assign(&mut objects, node).map_err(failed)?;
    find_modules(&mut objects, node).map_err(failed)?;
    let usual = identity(match device {
        Device::Drive(_) => PRODUCTS[0],
        Device::Io(_) => PRODUCTS[1],
    });
    let (wanted, own) = (&node.identity, node.ethercat.as_ref());
    // Names beyond the length of the object are cut; they are for people.
    let end = node.name.char_indices().map(|(at, char)| at + char.len_utf8());
    let end = end.take_while(|end| *end <= 64).last().unwrap_or(0);
    let model = CoeModel {
        identity: Identity {
            vendor: wanted.vendor_id.unwrap_or(usual.vendor),
            product: wanted.product_code.unwrap_or(usual.product),
            revision: wanted.revision.unwrap_or(usual.revision),
            serial: wanted.serial.unwrap_or(u32::from(node.id)),
        },
        device_type: wanted.device_type.unwrap_or(device.device_type()),
        names: ["ISOCNC-SIM", &node.name[..end]],
        alias: own.and_then(|own| own.alias).unwrap_or(0),
        mailbox: MAILBOX,
        octets: [&node.outputs, &node.inputs].map(|mapped| octets(mapped) as u16),
        room: ROOM,
        coe: 0x0F | General::COMPLETE_ACCESS,
        ports: 0x0011,
    };
    let behind = Behind {
        device,
        moved: false,
        due: false,
    };
    let built = model.build(objects, Box::new(behind)).map_err(failed)?;
    Ok(SubDeviceConfig {
        period_ns: config.cycle_us.saturating_mul(1000),
        ..built
    })
}

fn octets(mapped: &[Mapped]) -> usize {
    mapped.iter().map(|object| usize::from(object.bits) / 8).sum()
}

/// PDOs of a node, at least one, each with what it maps, and the object that assigns them: outputs, inputs. What the machine file does
/// not tell apart, as a device file has it, lies in the first.
fn pdos(node: &Node) -> [(Vec<Pdo>, u16); 2] {
    let own = node.ethercat.as_ref();
    let parts = |pdos: Option<&Vec<Pdo>>, usual: u16, mapped: &[Mapped]| {
        let mut pdos = pdos.cloned().unwrap_or_default();
        if pdos.is_empty() {
            pdos.push(Pdo {
                index: usual,
                entries: Vec::new(),
            });
        }
        let told: usize = pdos.iter().map(|pdo| pdo.entries.len()).sum();
        if told != mapped.len() {
            pdos.iter_mut().for_each(|pdo| pdo.entries.clear());
            pdos[0].entries = mapped.iter().map(Mapped::entry).collect();
        }
        pdos
    };
    [
        (parts(own.map(|own| &own.outputs), 0x1600, &node.outputs), 0x1C12),
        (parts(own.map(|own| &own.inputs), 0x1A00, &node.inputs), 0x1C13),
    ]
}

/// Lines of the PDOs. They are kept as long as the process lives, once for each device.
fn pdo_lines(node: &Node) -> Result<&'static [EntryDef], SimError> {
    let mut lines = Vec::new();
    for ((pdos, _), mapped) in pdos(node).into_iter().zip([&node.outputs, &node.inputs]) {
        let octets = octets(mapped);
        if octets > PDO_OCTETS || mapped.len() > usize::from(u8::MAX) {
            let cause = format!("{octets} octets in one direction: a simulated device has room for {PDO_OCTETS}");
            return Err(SimError::new(node, cause));
        }
        let entries = PDO_ENTRIES.max(mapped.len() as u8);
        for Pdo { index, .. } in pdos {
            let count = EntryDef::rw(index, DataType::U8, "PDO mapping").limits(0, entries.into());
            let of_entries = EntryDef::rw(index, DataType::U32, "PDO mapping").subs(1, entries);
            lines.extend([count, of_entries]);
        }
    }
    Ok(lines.leak())
}

/// Lines of objects that no simulated device has, but this node by its ESI file: what it exchanges, and what it is told at its start. They
/// are kept as those of PDOs.
fn file_lines(node: &Node, others: &[&[EntryDef]]) -> Result<&'static [EntryDef], SimError> {
    let line = |index, sub, octets| {
        let line = |data_type| EntryDef::rw(index, data_type, "By its ESI file").sub(sub);
        match octets {
            1 => line(DataType::U8),
            2 => line(DataType::U16),
            4 => line(DataType::U32),
            8 => line(DataType::U64),
            octets => line(DataType::OctetString).capacity(octets as u16),
        }
    };
    let Some(own) = &node.ethercat else { return Ok(&[]) };
    let exchanged = |pdos: &[Pdo], mapped: &[Mapped]| -> Vec<EntryDef> {
        // What the machine file alone says of a device has to be there.
        let is_of_file = pdos.iter().all(|pdo| pdo.entries.is_empty());
        let mapped = mapped.iter().filter(|_| is_of_file);
        mapped
            .map(|it| line(it.index, it.sub, usize::from(it.bits / 8)))
            .collect()
    };
    let outputs = exchanged(&own.outputs, &node.outputs).into_iter().map(EntryDef::rpdo);
    let inputs = exchanged(&own.inputs, &node.inputs).into_iter().map(EntryDef::tpdo);
    let mut wanted: Vec<EntryDef> = outputs.chain(inputs).collect();
    for StartCommand { index, sub, value, .. } in own.start.iter().filter(|command| !command.complete) {
        wanted.push(line(*index, *sub, value.len()));
        if *index == MODULE_LIST {
            wanted.push(line(MODULES_FOUND, *sub, value.len()));
        }
    }
    for StartCommand { index, value, .. } in own.start.iter().filter(|command| command.complete) {
        let parts = parts(value).ok_or_else(|| {
            let cause = format!("complete access of 0x{index:04X}: lengths of its entries are not known");
            SimError::new(node, cause)
        })?;
        wanted.extend(parts.into_iter().map(|(sub, octets)| line(*index, sub, octets)));
    }
    let mut lines: Vec<EntryDef> = Vec::new();
    for wanted in wanted {
        let is_it = |line: &EntryDef| {
            line.index == wanted.index && (line.sub_first..=line.sub_last).contains(&wanted.sub_first)
        };
        if !others.iter().copied().flatten().chain(&lines).any(is_it) {
            lines.push(wanted);
        }
    }
    lines.sort_by_key(|line| (line.index, line.sub_first));
    Ok(lines.leak())
}

/// Sub-indices of a value of complete access and their octets: their number, an octet that fills, and values of one length.
fn parts(value: &[u8]) -> Option<Vec<(u8, usize)>> {
    let (count, octets) = (*value.first()?, value.len().saturating_sub(2));
    let each = octets.checked_div(count.into())?;
    (each * usize::from(count) == octets && matches!(each, 1 | 2 | 4 | 8)).then(|| {
        std::iter::once((0, 1))
            .chain((1..=count).map(|sub| (sub, each)))
            .collect()
    })
}

/// The modules that stand in the slots of a device that is told them: those of the machine file.
fn find_modules(objects: &mut ObjectStore, node: &Node) -> Result<(), AbortCode> {
    let start = node.ethercat.as_ref().map_or(&[][..], |own| &own.start);
    let list = start
        .iter()
        .filter(|command| command.index == MODULE_LIST && !command.complete);
    list.into_iter()
        .try_for_each(|command| objects.preset(MODULES_FOUND, command.sub, &command.value))
}

/// Assigns and maps what the machine file has.
fn assign(objects: &mut ObjectStore, node: &Node) -> Result<(), AbortCode> {
    for (pdos, assignment) in pdos(node) {
        let is_empty = pdos.iter().all(|pdo| pdo.entries.is_empty());
        let count = if is_empty { 0 } else { pdos.len() as u8 };
        objects.preset(assignment, 0, &[count])?;
        for (sub, pdo) in (1..).zip(pdos.iter().take(count.into())) {
            objects.preset(assignment, sub, &pdo.index.to_le_bytes())?;
        }
        for pdo in &pdos {
            objects.preset(pdo.index, 0, &[pdo.entries.len() as u8])?;
            for (sub, entry) in (1..).zip(&pdo.entries) {
                objects.preset(pdo.index, sub, &entry.to_le_bytes())?;
            }
        }
    }
    Ok(())
}
