//! Puts the cycle together from a machine file, before real time begins.
//!
//! In:  the checked machine description, a bus.
//! Out: a [`MotionController`] for the cycle thread and the other ends of its rings for the operator.

use super::analog::AnalogDrives;
use super::cycle::{CycleParts, MotionController, RtEndpoints};
use super::drives::Drives;
use super::homing::Homer;
use super::local_drive;
use super::overrides::Overrides;
use super::pins::Pins;
use super::shared::{OperatorEndpoints, RtStatus};
use super::steps::StepDrives;
use crate::joint_jog::JointJog;
use crate::way_back::WayBack;
use anyhow::{Context, anyhow};
use bus::plan::NodePlan;
use bus::{CyclicBus, InputImage, OutputImage};
use config::{Config, Joint};
use hal_pins::Hal;
use machine::overruns::Overruns;
use motion::rt::{Monitor, MonitorLimits};
use std::sync::Arc;

/// Orders that can wait; the operator gives a few in a second.
const COMMANDS: usize = 32;
/// Notices that can wait: hundreds of them only while a network boots.
const NOTICES: usize = 4096;
/// Trace records that can wait: four seconds at 1 ms.
const TRACES: usize = 4096;
/// Programs on their way back.
const PROGRAMS: usize = 32;

/// The cycle of a machine, and the operator's ends of its rings.
pub fn assemble<B: CyclicBus>(
    config: &Config,
    plans: &[NodePlan],
    bus: B,
    hal: &mut Hal,
) -> anyhow::Result<(MotionController<B>, OperatorEndpoints)> {
    let (commands, commands_out) = rtrb::RingBuffer::new(COMMANDS);
    let (notices_in, notices) = rtrb::RingBuffer::new(NOTICES);
    let (trace_in, trace) = rtrb::RingBuffer::new(TRACES);
    let (finished_in, finished) = rtrb::RingBuffer::new(PROGRAMS);
    let live = Arc::new(RtStatus::new(Overrides::new(config.program.planner)));
    let plans: Vec<NodePlan> = plans.iter().cloned().chain(local_drive::plans(config)).collect();
    let plans = plans.as_slice();
    let steps = StepDrives::new(config);
    let drives = Drives::new(config, plans).map_err(|joint| {
        anyhow!(
            "joint {joint}: its drive needs 6040h and the target of its mode in `outputs`, 6041h and 6064h in `inputs`"
        )
    })?;
    let cycle_s = f64::from(config.cycle_us) * 1e-6;
    let pins = Pins::new(hal, config, plans, &steps).context("pins")?;
    let logic = pins.plc.logic.desk();
    let parts = CycleParts {
        outputs: OutputImage::new(plans.iter().map(|plan| plan.outputs.octets)),
        inputs: InputImage::new(plans.iter().map(|plan| plan.inputs.octets)),
        nodes: pins.nodes,
        drives,
        steps,
        analog: AnalogDrives::new(config, plans),
        kinematics: config.kinematics(),
        monitor: Monitor::new(&config.joints.iter().map(monitor_limits).collect::<Vec<_>>(), cycle_s),
        hand: JointJog::new(config),
        jog: pins.jog,
        way_back: WayBack::new(config),
        homer: Homer::new(config),
        probe: pins.probe,
        spindles: pins.spindles,
        changer: pins.changer,
        program_inputs: pins.program_inputs,
        program_outputs: pins.program_outputs,
        feed: pins.feed,
        desk: pins.desk,
        estop: pins.estop,
        plc: pins.plc,
        pins: pins.machine,
        overruns: Overruns::new(config.rt.overruns_warn, config.rt.overruns_stop),
        cycle_s,
    };
    let outlets = RtEndpoints {
        commands: commands_out,
        notices: notices_in,
        trace: trace_in,
        finished: finished_in,
        live: live.clone(),
        notices_lost: 0,
        trace_lost: 0,
    };
    let control = MotionController::new(bus, parts, outlets);
    Ok((
        control,
        OperatorEndpoints {
            commands,
            notices,
            trace,
            finished,
            live,
            logic,
        },
    ))
}

fn monitor_limits(joint: &Joint) -> MonitorLimits {
    let limits = &joint.limits;
    MonitorLimits {
        of_order: [limits.velocity_mm_s, limits.acceleration_mm_s2, limits.jerk_mm_s3],
        scaling: [
            limits.velocity_mm_s,
            joint.stop.acceleration_mm_s2,
            joint.stop.jerk_mm_s3,
        ],
        travel: joint.travel_mm,
    }
}
