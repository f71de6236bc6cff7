//! What a node is told of its part of the machine, whatever its bus: its drives, what its spindle needs, what the machine file adds.
//!
//! In:  the checked machine description. Out: writes, one for each object, and what is read behind them. Of two writes of one
//! object the later counts.

use super::plan::{LeftOut, LeftOutReason};
use cia402::profile::{axis_of, object_of};
use config::{
    Bus, Config, ConfigurationWrite, DeviceDescription, DriveMode, DriveProfile, Exchange, FactorGroup, HomingBy,
    Joint, Node, SpindleAxis,
};
use obd::device::EsiDictionary;
use obd::{Access, Expected, Scalar};

/// Configuration writes of one node.
pub(super) struct Configuration<'a> {
    pub(super) device: Option<&'a DeviceDescription>,
    /// The same of EtherCAT, where the file tells objects.
    dictionary: Option<&'a EsiDictionary>,
    /// Objects that the drive profile says there are not.
    without: &'a [(u16, u8)],
    /// The axis whose objects of the drive profile are meant by [`Configuration::set`].
    axis: u8,
    pub(super) writes: Vec<ConfigurationWrite>,
    pub(super) left_out: Vec<LeftOut>,
}

impl<'a> Configuration<'a> {
    pub(super) fn new(device: Option<&'a DeviceDescription>, drive: Option<&'a DriveProfile>) -> Configuration<'a> {
        Configuration {
            device,
            dictionary: None,
            without: drive.map_or(&[], |drive| &drive.without),
            axis: 0,
            writes: Vec::new(),
            left_out: Vec::new(),
        }
    }

    /// With the objects that an ESI file tells.
    pub(super) fn with_dictionary(self, dictionary: Option<&'a EsiDictionary>) -> Configuration<'a> {
        Configuration { dictionary, ..self }
    }

    /// A value that every node must take.
    pub(super) fn write<T: Scalar>(&mut self, index: u16, sub: u8, value: T) {
        let mut octets = [0; 8];
        value.store(&mut octets[..T::SIZE]);
        let value = octets[..T::SIZE].to_vec();
        self.writes.push(ConfigurationWrite { index, sub, value });
    }

    /// Whether a device that is described has an object that may be written; a device without file is believed to have all.
    pub(super) fn has(&self, index: u16, sub: u8) -> bool {
        let is_in_file = self.device.is_none_or(|device| {
            let object = device.object(index, sub);
            object.is_some_and(|object| object.access.is_none_or(Access::writable))
        });
        let is_in_file = is_in_file && self.dictionary.is_none_or(|objects| objects.can_write(index, sub));
        is_in_file && !self.without.contains(&(axis_of(index).1, sub))
    }

    /// A value for devices that have the object.
    pub(super) fn set<T: Scalar>(&mut self, index: u16, sub: u8, value: T) {
        let index = object_of(self.axis, index);
        if self.has(index, sub) {
            self.forget(index, sub);
            self.write(index, sub, value);
        } else {
            let reason = LeftOutReason::NotInDevice;
            self.left_out.push(LeftOut { index, sub, reason });
        }
    }

    /// A value in the place of any before.
    pub(super) fn push(&mut self, write: ConfigurationWrite) {
        self.forget(write.index, write.sub);
        self.writes.push(write);
    }

    pub(super) fn forget(&mut self, index: u16, sub: u8) {
        self.writes.retain(|write| (write.index, write.sub) != (index, sub));
    }

    /// What the node at `index` is there for, and what the machine file adds.
    pub(super) fn application(&mut self, config: &Config, index: usize) {
        let node = &config.bus.nodes[index];
        for joint in config.joints.iter().filter(|joint| joint.node == index) {
            self.drive(joint, node, config.cycle_us);
        }
        if let Some(spindle) = config.spindle.axis.filter(|spindle| spindle.node == index) {
            self.spindle(&spindle, node, &config.bus, config.cycle_us);
        }
        for write in &node.writes {
            self.push(write.clone());
        }
    }

    /// What a drive must say of itself: its factor group, and with a profile its modes (6502) and the interpolation time (60C2) that
    /// was written.
    pub(super) fn expected(&self, config: &Config, index: usize) -> Vec<Expected> {
        let node = &config.bus.nodes[index];
        let joints = config.joints.iter().filter(|joint| joint.node == index);
        let spindle = config.spindle.axis.filter(|spindle| spindle.node == index);
        let axes = joints
            .map(|joint| (joint.drive_axis, joint.factor_group))
            .chain(spindle.map(|spindle| (spindle.drive_axis, spindle.factor_group)));
        let factors = axes.clone().flat_map(|(axis, group)| {
            let objects = group.objects().map(move |(index, sub, value)| Expected {
                index: object_of(axis, index),
                sub,
                mask: u32::MAX,
                value,
            });
            objects.collect::<Vec<_>>()
        });
        let factors = factors.filter(|it| !self.without.contains(&(axis_of(it.index).1, it.sub)));
        let Some(drive) = &node.drive else {
            return factors.collect();
        };
        let modes = drive.modes.into_iter();
        let modes = axes.flat_map(|(axis, _)| {
            modes.clone().map(move |modes| Expected {
                index: object_of(axis, 0x6502),
                sub: 0,
                mask: modes,
                value: modes,
            })
        });
        let times = self.writes.iter().filter(|write| axis_of(write.index).1 == 0x60C2);
        let times = times.filter_map(|write| {
            Some(Expected {
                index: write.index,
                sub: write.sub,
                mask: 0xFF,
                value: u32::from(*write.value.first()?),
            })
        });
        modes.chain(times).chain(factors).collect()
    }

    /// 608F to 6096, unless the drive keeps them by itself. Before all that is in the units that they make.
    fn factor_group(&mut self, group: &FactorGroup) {
        if group.compare_only {
            return;
        }
        for (index, sub, value) in group.objects() {
            self.set(index, sub, value);
        }
    }

    /// 60C2: digits * 10^exponent s, digits in an octet. A machine's cycle is such a time; of several cycles the nearest one is.
    fn interpolation_time(&mut self, time_us: u32) {
        const UNITS_US: [(u32, i8); 4] = [(1, -6), (10, -5), (100, -4), (1000, -3)];
        let is_told = |(unit_us, _): &(u32, i8)| time_us.is_multiple_of(*unit_us) && time_us / unit_us <= 255;
        let fits = |(unit_us, _): &(u32, i8)| (time_us + unit_us / 2) / unit_us <= 255;
        let (unit_us, exponent) = (UNITS_US.into_iter().rev().find(is_told))
            .or_else(|| UNITS_US.into_iter().find(fits))
            .unwrap_or((1000, -3));
        self.set(0x60C2, 1, ((time_us + unit_us / 2) / unit_us).min(255) as u8);
        self.set(0x60C2, 2, exponent);
    }

    /// What the drive of the spindle must know: how it stops, its mode where it is not told that in each cycle.
    fn spindle(&mut self, spindle: &SpindleAxis, node: &Node, bus: &Bus, cycle_us: u32) {
        self.axis = spindle.drive_axis;
        self.factor_group(&spindle.factor_group);
        if spindle.mode == DriveMode::Csv {
            // It hears a set-point each time that it is polled.
            let cycles = match node.exchange {
                Exchange::Multiplexed(_) => bus.multiplex_cycles.into(),
                Exchange::Polled | Exchange::Chained | Exchange::AsyncOnly => 1,
            };
            self.interpolation_time(cycles * cycle_us);
        }
        for (index, value) in spindle.reactions.writes() {
            self.set(index, 0, value);
        }
        self.mode(node, spindle.mode);
        self.axis = 0;
    }

    /// 6060 of a drive that cannot be told its mode in each cycle.
    fn mode(&mut self, node: &Node, mode: DriveMode) {
        let object = object_of(self.axis, 0x6060);
        if node.outputs.iter().all(|mapped| mapped.index != object) {
            self.set(0x6060, 0, mode.code());
        }
    }

    /// What a servo drive must know: interpolation time, following error, ramps, homing.
    fn drive(&mut self, joint: &Joint, node: &Node, cycle_us: u32) {
        self.axis = joint.drive_axis;
        let [counts, units] = joint.counts_per_unit.map(f64::from);
        let increments = |mm: f64| (mm * counts / units).round().clamp(0.0, f64::from(u32::MAX)) as u32;
        let [velocity, per] = joint.factor_group.velocity_ratio().map(f64::from);
        // Speeds and ramps.
        let velocity_units = |mm: f64| increments(mm * velocity / per);
        self.factor_group(&joint.factor_group);
        self.interpolation_time(cycle_us);
        // The drive's own watch is wider than ours: it is the second line of defence.
        self.set(0x6065, 0, increments(2.0 * joint.following_error_mm));
        for (index, value) in joint.reactions.writes() {
            self.set(index, 0, value);
        }
        self.set(0x6085, 0, velocity_units(joint.stop.acceleration_mm_s2));
        if let HomingBy::Drive {
            method,
            acceleration_mm_s2,
        } = joint.homing.by
        {
            self.set(0x6098, 0, method);
            self.set(0x6099, 1, velocity_units(joint.homing.search_mm_s));
            self.set(0x6099, 2, velocity_units(joint.homing.latch_mm_s));
            self.set(0x609A, 0, velocity_units(acceleration_mm_s2));
        }
        self.set(0x607C, 0, 0_i32);
        self.mode(node, joint.mode);
        self.axis = 0;
    }
}
