//! Jogging by pins: hand wheels, keys and sticks of a panel, a pendant or a game pad.
//!
//! In:  counts of an encoder, keys, the deflection of a stick, once a cycle.
//! Out: jog orders, as a client gives them.
//!
//! Nothing begins by a level: a wheel counts from the cycle behind the one that enables it, a key or a stick acts when it leaves
//! rest. What has been ended otherwise, by a hold, a stop or a limit, begins again only when the key has been let go.
//!
//! RT: nothing allocates but [`JogPins::new`].

use crate::joint_jog::{JogMotion, JogOrder, JointJog};
use config::Config;
use hal_pins::{Hal, HalError, Input};
use motion::canon::Axis;
use motion::kinematics::ToolFrame;

/// How far a wheel may be ahead of its axis, s at full speed; what it is turned beyond that is dropped.
const ARREARS_S: f64 = 0.5;
/// Change of a stick's velocity, as a part of it, that is passed on.
const STEP: f64 = 0.02;

/// Joints, or an axis where joints are not axes.
#[derive(Clone, Copy, Debug)]
struct What {
    joints: u64,
    axis: Option<Axis>,
    /// By which the hand knows it.
    number: usize,
    fastest_mm_s: f64,
    /// It is a joint, and need not be homed.
    is_joint: bool,
}

impl What {
    fn order(&self, motion: JogMotion) -> JogOrder {
        JogOrder {
            acceleration_share: 1.0,
            unhomed: self.is_joint,
            joints: self.joints,
            axis: self.axis,
            motion,
        }
    }
}

/// `axis.L.jog-*` or `joint.N.jog-*`: a wheel.
struct Wheel {
    what: What,
    counts: Input<i32>,
    enable: Input<bool>,
    scale: Input<f64>,
    velocity_mode: Input<bool>,
    acceleration: Input<f64>,
    counts_before: i32,
    enabled_before: bool,
    /// What is under way is what it has ordered: it goes on without a hand on it, for as long as that takes.
    leads: bool,
}

impl Wheel {
    fn new(hal: &mut Hal, name: &str, what: What) -> Result<Wheel, HalError> {
        Ok(Wheel {
            what,
            counts: hal.input(&format!("{name}.jog-counts"), 0)?,
            enable: hal.input(&format!("{name}.jog-enable"), false)?,
            scale: hal.input(&format!("{name}.jog-scale"), 1.0)?,
            velocity_mode: hal.input(&format!("{name}.jog-vel-mode"), false)?,
            acceleration: hal.input(&format!("{name}.jog-accel-fraction"), 1.0)?,
            counts_before: 0,
            enabled_before: false,
            leads: false,
        })
    }

    /// Up to two orders, the first one first; joints of `homed` know where they are (bit n: joint n).
    fn take(&mut self, hand: &JointJog, homed: u64) -> [Option<JogOrder>; 2] {
        let (counts, enabled) = (self.counts.get(), self.enable.get());
        let turned = counts.wrapping_sub(std::mem::replace(&mut self.counts_before, counts));
        let was_enabled = std::mem::replace(&mut self.enabled_before, enabled);
        match (was_enabled, enabled) {
            (true, false) => return [Some(self.what.order(JogMotion::Release)), None],
            (false, _) => return [None; 2],
            (true, true) => {}
        }
        let wanted_mm = f64::from(turned) * self.scale.get();
        if turned == 0 || !wanted_mm.is_finite() || wanted_mm == 0.0 {
            // A wheel that rests is no hand on a key: what is ordered next need not wait until it is switched off.
            self.leads &= hand.arrears(self.what.number) != 0.0;
            return [self.leads.then(|| self.what.order(JogMotion::Keep)), None];
        }
        self.leads = true;
        let mut velocity_mm_s = self.what.fastest_mm_s;
        if self.what.is_joint {
            velocity_mm_s = velocity_mm_s.min(hand.fastest_of_joint(self.what.number, homed));
        }
        if self.velocity_mode.get() {
            // From where it would come to rest: the motion ends with the wheel.
            let advance = JogMotion::Advance {
                distance_mm: wanted_mm,
                velocity_mm_s,
            };
            return [JogMotion::Release, advance].map(|motion| Some(self.order(motion)));
        }
        let ahead_mm = hand.arrears(self.what.number);
        let most_mm = ARREARS_S * velocity_mm_s;
        let distance_mm = (ahead_mm + wanted_mm).clamp(-most_mm, most_mm) - ahead_mm;
        let advance = JogMotion::Advance {
            distance_mm,
            velocity_mm_s,
        };
        [Some(self.order(advance)), None]
    }

    /// At its share of the acceleration.
    fn order(&self, motion: JogMotion) -> JogOrder {
        JogOrder {
            acceleration_share: self.acceleration.get(),
            ..self.what.order(motion)
        }
    }
}

/// `halui.axis.L.plus`, `.minus` and `.analog`.
struct Keys {
    what: What,
    plus: Input<bool>,
    minus: Input<bool>,
    analog: Input<f64>,
    increment: Input<f64>,
    increments: [Input<bool>; 2],
    increments_before: [bool; 2],
    velocity_mm_s: f64,
}

impl Keys {
    fn new(hal: &mut Hal, name: &str, what: What) -> Result<Keys, HalError> {
        Ok(Keys {
            what,
            plus: hal.input(&format!("{name}.plus"), false)?,
            minus: hal.input(&format!("{name}.minus"), false)?,
            analog: hal.input(&format!("{name}.analog"), 0.0)?,
            increment: hal.input(&format!("{name}.increment"), 0.0)?,
            increments: [
                hal.input(&format!("{name}.increment-plus"), false)?,
                hal.input(&format!("{name}.increment-minus"), false)?,
            ],
            increments_before: [false; 2],
            velocity_mm_s: 0.0,
        })
    }

    fn take(&mut self, hand: &JointJog, speed_mm_s: f64, deadband: f64) -> Option<JogOrder> {
        let pressed = [0, 1].map(|key| self.increments[key].get());
        let before = std::mem::replace(&mut self.increments_before, pressed);
        let sign = |keys: [bool; 2]| f64::from(i8::from(keys[0]) - i8::from(keys[1]));
        let risen = sign([0, 1].map(|key| pressed[key] && !before[key]));
        let deflection = match sign([self.plus.get(), self.minus.get()]) {
            0.0 => Some(self.analog.get()).filter(|value| value.abs() > deadband),
            key => Some(key),
        };
        let velocity_mm_s = deflection.map_or(0.0, |share| share.clamp(-1.0, 1.0) * speed_mm_s);
        let velocity_mm_s = if velocity_mm_s.is_finite() { velocity_mm_s } else { 0.0 };
        let before_mm_s = self.velocity_mm_s;
        let run = JogMotion::Run { velocity_mm_s };
        let motion = if velocity_mm_s == 0.0 && before_mm_s != 0.0 {
            self.velocity_mm_s = 0.0;
            JogMotion::Release
        } else if velocity_mm_s != 0.0 && before_mm_s == 0.0 {
            self.velocity_mm_s = velocity_mm_s;
            run
        } else if velocity_mm_s != 0.0 {
            let is_other = (velocity_mm_s - before_mm_s).abs() > STEP * before_mm_s.abs();
            if is_other && hand.is_held(self.what.number) {
                self.velocity_mm_s = velocity_mm_s;
                run
            } else {
                JogMotion::Keep
            }
        } else if risen != 0.0 {
            JogMotion::Advance {
                distance_mm: risen * self.increment.get(),
                velocity_mm_s: speed_mm_s,
            }
        } else if before[0] && pressed[0] || before[1] && pressed[1] {
            // A long increment goes on for as long as its key is held.
            JogMotion::Keep
        } else {
            return None;
        };
        Some(self.what.order(motion))
    }
}

/// All pins for jogging.
pub struct JogPins {
    wheels: Vec<Wheel>,
    keys: Vec<Keys>,
    inhibit: Input<bool>,
    stop: Input<bool>,
    stop_immediate: Input<bool>,
    /// mm/min, as LinuxCNC has it.
    speed: Input<f64>,
    deadband: Input<f64>,
}

impl JogPins {
    /// For each axis and each joint of a machine.
    ///
    /// # Errors
    /// Shared memory too small.
    pub fn new(hal: &mut Hal, config: &Config) -> Result<JogPins, HalError> {
        let in_world = !config.kinematics().is_trivial(&ToolFrame::OFF);
        let fastest = |joints: &[usize]| {
            let speeds = joints.iter().map(|joint| config.joints[*joint].limits.velocity_mm_s);
            speeds.fold(f64::INFINITY, f64::min)
        };
        let mut wheels = Vec::new();
        let mut keys = Vec::new();
        for map in &config.axes {
            let what = What {
                joints: match in_world {
                    true => (1 << config.joints.len()) - 1,
                    false => map.joints.iter().fold(0, |mask, joint| mask | 1 << joint),
                },
                axis: in_world.then_some(map.axis),
                number: match in_world {
                    true => map.axis as usize,
                    false => map.joints.first().copied().unwrap_or(0),
                },
                fastest_mm_s: fastest(&map.joints),
                is_joint: false,
            };
            let letter = map.axis.letter().to_ascii_lowercase();
            wheels.push(Wheel::new(hal, &format!("axis.{letter}"), what)?);
            keys.push(Keys::new(hal, &format!("halui.axis.{letter}"), what)?);
        }
        for joint in 0..config.joints.len() {
            let map = config.axes.iter().find(|map| map.joints.contains(&joint));
            let together = map.map_or(std::slice::from_ref(&joint), |map| &map.joints);
            let what = What {
                joints: 1 << joint,
                axis: None,
                number: together.first().copied().unwrap_or(joint),
                fastest_mm_s: fastest(together),
                is_joint: true,
            };
            wheels.push(Wheel::new(hal, &format!("joint.{joint}"), what)?);
        }
        Ok(JogPins {
            wheels,
            keys,
            inhibit: hal.input("motion.jog-inhibit", false)?,
            stop: hal.input("motion.jog-stop", false)?,
            stop_immediate: hal.input("motion.jog-stop-immediate", false)?,
            speed: hal.input("halui.axis.jog-speed", 0.0)?,
            deadband: hal.input("halui.axis.jog-deadband", 0.2)?,
        })
    }

    /// Whether no jog may begin.
    pub fn is_barred(&self) -> bool {
        self.inhibit.get() || self.stops() || self.stops_at_once()
    }

    /// Whether jogs come to rest.
    pub fn stops(&self) -> bool {
        self.stop.get()
    }

    /// Whether they do so within the stop limits.
    pub fn stops_at_once(&self) -> bool {
        self.stop_immediate.get()
    }

    /// How many there are that may want something.
    pub fn count(&self) -> usize {
        self.wheels.len() + self.keys.len()
    }

    /// What one of them wants, called once a cycle.
    pub fn take(&mut self, number: usize, hand: &JointJog, homed: u64) -> [Option<JogOrder>; 2] {
        if let Some(wheel) = self.wheels.get_mut(number) {
            return wheel.take(hand, homed);
        }
        let (speed_mm_s, deadband) = (self.speed.get() / 60.0, self.deadband.get());
        let keys = self.keys.get_mut(number - self.wheels.len());
        [keys.and_then(|keys| keys.take(hand, speed_mm_s, deadband)), None]
    }
}
