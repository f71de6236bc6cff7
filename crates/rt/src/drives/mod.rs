//! Joints as drives on the bus: payload fields to millimetres and back.
//!
//! In:  the input image; commanded joint positions, mm.
//! Out: actual joint positions, mm; the output image.
//!
//! `motor mm = increments / ratio + zero`, where `zero` is the position at which the drive counts 0: its home point, or what
//! homing by the control has found. The motor stands beside its joint by the compensation of backlash and pitch errors, which
//! nobody outside of `drive.rs` sees.
//!
//! A drive in CSP or IP holds the position that it is told. For one in CSV or CST the control closes the position loop
//! ([`Pid`](motion::rt::Pid), `[joint.pid]`): in each cycle from the command that the drive had when it took the position that has just come.
//! The loop works in the drive's own coordinates, which homing does not shift.

mod drive;
mod touch;

pub use drive::{Drive, Effort};

use super::homing::Found;
use super::shared::JointTrace;
use bus::plan::NodePlan;
use bus::{InputImage, NodeIndex, NodeState, OutputImage};
use cia402::axis::{Axis, Request, Status};
use cia402::profile::axis_of;
use config::{Config, HomingBy, HomingIndex, JOINTS_MAX, Joint, targets};
use motion::canon::Position;
use motion::kinematics::Kinematics;
use motion::rt::{PidGains, Sample};

/// Whether the control fills an object of the drive of a joint itself; others have pins.
pub fn is_filled(joint: &Joint, (index, sub): (u16, u8)) -> bool {
    let (axis, index) = axis_of(index);
    if axis != joint.drive_axis {
        return false;
    }
    match (index, sub) {
        (0x6040 | 0x6060, 0) => true,
        (0x60B8, 0) => joint.touch_probe.is_some() || index_of(joint).is_some(),
        (0x60B1, 0) => joint.mode.is_position(),
        (0x60B2, 0) => joint.torque_per_mm_s2.is_some(),
        object => targets(joint.mode).contains(&object),
    }
}

/// Whether a drive is without power as far as can be known, and no fault reset is under way in it. RT.
pub(super) fn is_off(axis: &Axis, online: bool) -> bool {
    match axis.status() {
        Status::Disabled => true,
        Status::Faulted(_) => !axis.is_resetting(),
        // A drive that has just come on line may be under power still, from an earlier run.
        Status::Offline => !online,
        Status::Enabling | Status::Enabled | Status::Homing | Status::Disabling | Status::QuickStopping => false,
    }
}

/// The zero mark by which the control homes a joint, if it does.
fn index_of(joint: &Joint) -> Option<HomingIndex> {
    match joint.homing.by {
        HomingBy::Control(control) => control.index,
        HomingBy::Drive { .. } => None,
    }
}

/// The drives of a machine, one for each joint.
#[derive(Debug)]
pub struct Drives {
    drives: Box<[Drive]>,
}

impl Drives {
    /// One drive for each joint; the error is the joint whose payloads lack an object that every drive needs.
    pub fn new(config: &Config, plans: &[NodePlan]) -> Result<Drives, usize> {
        let cycle_s = f64::from(config.cycle_us) * 1e-6;
        let drives: Result<Box<[Drive]>, usize> = config
            .joints
            .iter()
            .enumerate()
            .map(|(index, joint)| Drive::new(joint, &plans[joint.node], cycle_s).ok_or(index))
            .collect();
        Ok(Drives { drives: drives? })
    }

    /// Takes what the drives sent; `state` tells of each node. RT.
    pub fn read(&mut self, inputs: &InputImage, state: impl Fn(NodeIndex) -> NodeState) {
        for drive in &mut self.drives {
            drive.read(inputs, state(drive.node));
        }
    }

    /// Tells the drives where to be: one position per joint, mm. RT.
    pub fn write(&mut self, now_ns: u64, command_mm: &[f64], outputs: &mut OutputImage) {
        for (drive, &command_mm) in self.drives.iter_mut().zip(command_mm) {
            drive.write(now_ns, command_mm, outputs);
        }
    }

    /// The last cycle of a joint; zeros where there is none. RT.
    pub fn trace(&self, joint: usize) -> JointTrace {
        self.drives.get(joint).map_or(JointTrace::NONE, Drive::trace)
    }

    /// So many cycles were left out. RT.
    pub fn leave_out(&mut self, cycles: u64) {
        for pid in self.drives.iter_mut().filter_map(|drive| drive.pid.as_mut()) {
            pid.leave_out(cycles);
        }
    }

    /// Other gains of the position loop of a joint, if the control closes it. RT.
    pub fn set_gains(&mut self, joint: usize, gains: PidGains) {
        if let Some(pid) = self.drives.get_mut(joint).and_then(|drive| drive.pid.as_mut()) {
            pid.set_gains(gains);
        }
    }

    /// Asks the joints of `which` (bit n: joint n) for something. RT.
    pub fn request(&mut self, which: u64, request: Request) {
        for (index, drive) in self.drives.iter_mut().enumerate() {
            if which >> index & 1 == 1 {
                drive.axis.request(request);
            }
        }
    }

    /// Asks the drives that home themselves now for something. RT.
    pub fn request_of_homing(&mut self, request: Request) {
        for drive in &mut self.drives {
            if drive.status() == Status::Homing {
                drive.axis.request(request);
            }
        }
    }

    /// Joints whose drives home themselves now (bit n: joint n). RT.
    pub fn homing(&self) -> u64 {
        let drives = self.drives.iter().enumerate();
        drives.fold(0, |mask, (joint, drive)| {
            mask | u64::from(drive.status() == Status::Homing) << joint
        })
    }

    /// The first joint whose drive says that its safety circuit is open. RT.
    pub fn sto_open(&self) -> Option<usize> {
        self.drives.iter().position(Drive::is_sto_open)
    }

    /// Joints of whose lower, and of whose upper limit switch drives say that it is closed (bit n: joint n). RT.
    pub fn limit_switches(&self) -> [u64; 2] {
        let mut closed = [0; 2];
        for (joint, drive) in self.drives.iter().enumerate() {
            for (closed, switch) in closed.iter_mut().zip(drive.limit_switches()) {
                *closed |= u64::from(switch) << joint;
            }
        }
        closed
    }

    /// Whether every drive shows a status that `wanted` accepts. RT.
    pub fn all(&self, wanted: impl Fn(&Drive) -> bool) -> bool {
        self.drives.iter().all(wanted)
    }

    /// Where the axes were measured, as the tool of `sample` is held; where no place of the axes is known, that of `sample`. RT.
    pub fn measured(&self, kinematics: &Kinematics, sample: &Sample) -> Position {
        let mut actual_mm = [0.0; JOINTS_MAX];
        for (actual_mm, drive) in actual_mm.iter_mut().zip(&self.drives) {
            *actual_mm = drive.actual_mm();
        }
        kinematics
            .forward(&sample.frame, &actual_mm[..self.drives.len()])
            .unwrap_or(sample.position)
    }

    /// What the touch probes have latched so far counts no more. RT.
    pub fn arm_touch_probes(&mut self) {
        for drive in &mut self.drives {
            drive.probes.arm();
        }
    }

    /// Where the drives have latched since then that the probe closed, and that it opened, as the tool of `sample` is held; each
    /// once all of them have. RT.
    pub fn touched(&self, kinematics: &Kinematics, sample: &Sample) -> [Option<Position>; 2] {
        [0, 1].map(|edge| {
            let mut places_mm = [0.0; JOINTS_MAX];
            for (place_mm, drive) in places_mm.iter_mut().zip(&self.drives) {
                *place_mm = drive.touched_mm(edge)?;
            }
            kinematics.forward(&sample.frame, &places_mm[..self.drives.len()])
        })
    }

    /// Homing of the joints of `which` (bit n: joint n) by the control begins. RT.
    pub fn begin_homing(&mut self, which: u64) {
        for (index, drive) in self.drives.iter_mut().enumerate() {
            if which >> index & 1 == 1 {
                drive.begin_homing();
            }
        }
    }

    /// A drive still counts from where it was homed in an earlier session. RT.
    pub fn take_home(&mut self, joint: usize, zero_mm: f64) {
        if let Some(drive) = self.drives.get_mut(joint) {
            drive.take_home(zero_mm);
        }
    }

    /// A joint has been homed by the control. RT.
    pub fn home_at(&mut self, joint: usize, found: &Found) {
        if let Some(drive) = self.drives.get_mut(joint) {
            drive.home_at(found);
        }
    }

    /// The drives in the order of the joints.
    pub fn iter(&self) -> std::slice::Iter<'_, Drive> {
        self.drives.iter()
    }
}

#[cfg(test)]
mod tests;
