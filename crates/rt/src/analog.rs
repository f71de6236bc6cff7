//! Joints whose amplifier has an analog input, behind an I/O node: drives in CSV or CST of this process.
//!
//! In:  the payloads of such drives in the output image; counter and fault input in the payload of the I/O node.
//! Out: their payloads in the input image; command and enable output in the payload of the I/O node.
//!
//! At a quick stop a speed goes to 0 by the ramp of stops, and a torque at once; then the enable output falls. RT but for
//! [`AnalogDrives::new`].

use super::counter::Counter;
use super::local_drive::Power;
use bus::layout::{Field, Layout};
use bus::plan::NodePlan;
use bus::{InputImage, NodeIndex, OutputImage};
use cia402::State;
use config::{Config, DriveMode, Mapped};

/// 603F: the fault input of the amplifier (external error).
const ERROR_AMPLIFIER: u16 = 0x9000;

#[derive(Debug)]
struct AnalogDrive {
    power: Power,
    /// Its own place in the images, and that of the I/O node.
    own: NodeIndex,
    node: NodeIndex,
    command: Field,
    position: Field,
    enable: (Field, u8),
    fault: Option<(Field, u8, bool)>,
    counter: Counter,
    cycle: u64,
    /// Greatest value of the command, and what 60FF (or 6071) is then.
    greatest: f64,
    full: f64,
    /// What was commanded last, and how much less that becomes in a cycle of a quick stop.
    value: f64,
    stop: f64,
    faulted: bool,
}

impl AnalogDrive {
    /// Takes what the I/O node sent.
    fn read(&mut self, inputs: &mut InputImage) {
        let fresh = inputs.fresh[self.node];
        if fresh {
            let payload = inputs.payload.node(self.node);
            self.counter.update(self.cycle, self.position.read(payload), None);
            self.faulted = self
                .fault
                .is_some_and(|(field, bit, active)| (field.read(payload) >> bit & 1 == 1) == active);
        }
        self.cycle += 1;
        if self.faulted {
            self.power.state = State::Fault;
        }
        let error = if self.faulted { ERROR_AMPLIFIER } else { 0 };
        let payload = inputs.payload.node_mut(self.own);
        self.power.tell(self.counter.counts(), error, payload);
        inputs.fresh[self.own] = fresh;
        inputs.lost_in_row[self.own] = inputs.lost_in_row[self.node];
    }

    /// Does what it is told.
    fn write(&mut self, outputs: &mut OutputImage) {
        let target = self.power.obey(self.counter.counts(), outputs.node(self.own));
        self.value = match self.power.state {
            State::OperationEnabled if !self.power.is_homing() => target as f64,
            State::QuickStopActive => self.value - self.value.signum() * self.stop.min(self.value.abs()),
            _ => 0.0,
        };
        if self.power.state == State::QuickStopActive && self.value == 0.0 {
            self.power.state = State::SwitchOnDisabled;
        }
        let on = self.power.is_on();
        let payload = outputs.node_mut(self.node);
        let share = (self.value / self.full).clamp(-1.0, 1.0);
        self.command
            .write(payload, (share * self.greatest).round() as i64 as u64);
        let (field, bit) = self.enable;
        let others = field.read(payload) & !(1 << bit);
        field.write(payload, others | u64::from(on) << bit);
    }
}

/// All of them.
#[derive(Debug)]
pub struct AnalogDrives(Box<[AnalogDrive]>);

impl AnalogDrives {
    /// `plans`: of the nodes.
    pub fn new(config: &Config, plans: &[NodePlan]) -> AnalogDrives {
        let cycle_s = f64::from(config.cycle_us) * 1e-6;
        let drives = config.joints.iter().filter_map(|joint| {
            let analog = joint.analog?;
            let plan = plans.get(analog.node)?;
            let find = |object: Mapped, layout: &Layout| layout.find(object.index, object.sub);
            let [counts, units] = joint.counts_per_unit.map(f64::from);
            let per_mm = counts / units;
            // In the unit of the target: increments/s, or thousandths of the rated torque.
            let (full, stop) = match joint.mode {
                DriveMode::Cst => (1000.0 * analog.full, f64::INFINITY),
                _ => (analog.full * per_mm, joint.stop.acceleration_mm_s2 * per_mm * cycle_s),
            };
            Some(AnalogDrive {
                power: Power::new(joint),
                own: joint.node,
                node: analog.node,
                command: find(analog.command, &plan.outputs)?,
                position: find(analog.position, &plan.inputs)?,
                enable: (find(analog.enable.0, &plan.outputs)?, analog.enable.1),
                fault: match analog.fault {
                    None => None,
                    Some((object, bit, active)) => Some((find(object, &plan.inputs)?, bit, active)),
                },
                counter: Counter::new(analog.position.bits),
                cycle: 0,
                greatest: ((1_u64 << (analog.command.bits - 1)) - 1) as f64,
                full,
                value: 0.0,
                stop,
                faulted: false,
            })
        });
        AnalogDrives(drives.collect())
    }

    /// What the drives tell, behind the exchange of the bus. RT.
    pub fn read(&mut self, inputs: &mut InputImage) {
        for drive in &mut self.0 {
            drive.read(inputs);
        }
    }

    /// What they are told, behind all that writes outputs of I/O nodes. RT.
    pub fn write(&mut self, outputs: &mut OutputImage) {
        for drive in &mut self.0 {
            drive.write(outputs);
        }
    }

    /// Whether an output of a node is the command of one of them, so that nothing else sets it.
    pub fn uses(config: &Config, node: NodeIndex, field: &Field) -> bool {
        let mut all = config.joints.iter().filter_map(|joint| joint.analog);
        all.any(|analog| (analog.node, analog.command) == (node, field.object))
    }

    /// The node on the bus by which a drive of this process lives; `None`: it is none of these. RT.
    pub fn node_of(&self, drive: NodeIndex) -> Option<NodeIndex> {
        let found = self.0.iter().find(|own| own.own == drive);
        found.map(|own| own.node)
    }
}
