//! The position loop around a plant: its stability margins, gains that have enough of them, and the loop run on the model.
//!
//! In:  a [`Plant`], gains. Out: margins, gains, following errors.
//!
//! The open loop is that of sampled control: the PID as [`Pid`] computes it, its output held for a cycle, the dead time, the plant.

use super::complex::Complex;
use super::plant::Plant;
use config::{DriveMode, Joint};
use motion::rt::{Pid, PidGains};
use serde::Serialize;
use std::collections::VecDeque;
use std::f64::consts::{PI, TAU};

/// Cycles from a computed output to its effect on a place that is read, without what drive and encoder add.
pub const BUS_CYCLES: f64 = 2.0;
/// What a loop shall have at the least: what a drive that is a little different leaves of it is still enough.
pub const GAIN_MARGIN_DB: f64 = 6.0;
pub const PHASE_MARGIN_DEG: f64 = 45.0;
/// What is proposed has this much.
const PROPOSED_GAIN_DB: f64 = 9.0;
const PROPOSED_PHASE_DEG: f64 = 55.0;
/// Frequencies at which a loop is looked at: from this one to half the frequency of the cycle, so many.
const LEAST_HZ: f64 = 0.01;
const FREQUENCIES: usize = 4000;
/// Steps of the plant in one cycle.
const STEPS: usize = 40;

/// How far a loop is from ringing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Margins {
    /// By how much the gain may be other than it is, dB.
    pub gain_db: f64,
    /// By how much the phase may lag more, degrees.
    pub phase_deg: f64,
    /// Where the open loop passes 1, Hz: about the bandwidth.
    pub crossover_hz: f64,
}

impl std::fmt::Display for Margins {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.phase_deg <= 0.0 {
            return f.write_str("unstable");
        }
        write!(
            f,
            "gain margin {:.1} dB, phase margin {:.0} degrees, crossover {:.1} Hz",
            self.gain_db, self.phase_deg, self.crossover_hz
        )
    }
}

impl Margins {
    /// Whether they are what a loop shall have at the least.
    pub fn suffice(&self) -> bool {
        self.gain_db >= GAIN_MARGIN_DB && self.phase_deg >= PHASE_MARGIN_DEG
    }
}

/// Margins of the loop of a joint by what its machine file says; `None`: the drive closes it, or nothing is known of its amplifier.
/// Gains that are fed forward are taken to fit it.
pub fn margins_of_joint(joint: &Joint, cycle_s: f64) -> Option<Margins> {
    let (gains, lag_s) = (joint.pid.as_ref()?, joint.amplifier_lag_s?);
    let [_, velocity, acceleration, _] = gains.ff;
    let gain = |fed_forward: f64| (fed_forward > 0.0).then_some(1.0 / fed_forward);
    let bus_s = BUS_CYCLES * cycle_s;
    let plant = match joint.mode {
        DriveMode::Cst => Plant::Torque {
            gain: gain(acceleration + gains.d * cycle_s)?,
            damping: 0.0,
            dead_s: bus_s + lag_s,
        },
        _ => Plant::Velocity {
            gain: gain(velocity)?,
            lag_s,
            dead_s: bus_s,
        },
    };
    Some(margins(gains, &plant, cycle_s))
}

/// The feedback of a loop as a frequency response: output for an error at a frequency.
pub fn feedback(gains: &PidGains, frequency_hz: f64, cycle_s: f64) -> Complex {
    let delay = Complex::turn(-TAU * frequency_hz * cycle_s);
    let difference = Complex::ONE - delay;
    // The integral holds the error of this cycle already.
    Complex::from(gains.p) + Complex::from(gains.i * cycle_s) / difference + difference * (gains.d / cycle_s)
}

/// Place for an output at a frequency; the output is held for a cycle.
pub fn response(plant: &Plant, frequency_hz: f64, cycle_s: f64) -> Complex {
    let s = Complex::new(0.0, TAU * frequency_hz);
    let held = (Complex::ONE - Complex::turn(-TAU * frequency_hz * cycle_s)) / (s * cycle_s);
    let delay = Complex::turn(-TAU * frequency_hz * plant.dead_s());
    let moved = match *plant {
        Plant::Velocity { gain, lag_s, .. } => Complex::from(gain) / (s * (Complex::ONE + s * lag_s)),
        Plant::Torque { gain, damping, .. } => Complex::from(gain) / (s * (s + damping.into())),
    };
    held * delay * moved
}

/// Margins of a loop around a plant.
pub fn margins(gains: &PidGains, plant: &Plant, cycle_s: f64) -> Margins {
    let most_hz = 0.5 / cycle_s;
    let ratio = (most_hz / LEAST_HZ).ln() / FREQUENCIES as f64;
    let frequencies = (0..FREQUENCIES).map(|step| LEAST_HZ * (ratio * step as f64).exp());
    let open = frequencies.map(|hz| (hz, feedback(gains, hz, cycle_s) * response(plant, hz, cycle_s)));
    margins_of(&open.collect::<Vec<_>>())
}

/// Margins by an open loop at some frequencies, in their order; what they do not reach is not known: not a number.
pub fn margins_of(open: &[(f64, Complex)]) -> Margins {
    let mut margins = Margins {
        gain_db: f64::NAN,
        phase_deg: f64::NAN,
        crossover_hz: f64::NAN,
    };
    for pair in open.windows(2) {
        let [(hz, one), (next_hz, other)] = [pair[0], pair[1]];
        // Passing the negative real axis from above to below or back.
        let passes = one.im.signum() != other.im.signum() && one.re.min(other.re) < 0.0;
        if passes {
            let share = one.im / (one.im - other.im);
            let at = one.re + share * (other.re - one.re);
            if at < 0.0 {
                let away_db = (20.0 * at.abs().log10()).abs();
                margins.gain_db = margins.gain_db.min(away_db);
            }
        }
        let [a, b] = [one.size().ln(), other.size().ln()];
        if (a > 0.0) != (b > 0.0) {
            let share = a / (a - b);
            let mut turn = (other / one).angle();
            if turn > PI {
                turn -= TAU;
            }
            let phase = one.angle() + share * turn;
            // Distance from -180 degrees: below 0 where the phase has passed it.
            let lag = if phase > 0.0 { phase - PI } else { phase + PI };
            margins.phase_deg = margins.phase_deg.min(lag.to_degrees());
            margins.crossover_hz = hz * (next_hz / hz).powf(share);
        }
    }
    margins
}

/// Gains that suit a plant: as much of `p` as leaves enough margin, and what belongs to it; limits stay as they are.
pub fn propose(plant: &Plant, now: &PidGains, cycle_s: f64) -> PidGains {
    let at = |speed: f64| with_speed(plant, now, speed, cycle_s);
    let suffices = |speed: f64| {
        let margins = margins(&at(speed), plant, cycle_s);
        margins.gain_db >= PROPOSED_GAIN_DB && margins.phase_deg >= PROPOSED_PHASE_DEG
    };
    // From slow to fast, in steps of 1 %: the last one with enough margin before the first one without.
    let speeds = (0..1000).map(|step| 1.01_f64.powi(step));
    let speed = speeds.take_while(|&speed| suffices(speed)).last().unwrap_or(1.0);
    at(speed)
}

/// Gains of a loop that is so fast, 1/s.
fn with_speed(plant: &Plant, now: &PidGains, speed: f64, cycle_s: f64) -> PidGains {
    match *plant {
        Plant::Velocity { gain, .. } => PidGains {
            p: speed / gain,
            i: speed * speed / 10.0 / gain,
            d: 0.0,
            ff: feed_forward(plant, 0.0, now, cycle_s),
            ..*now
        },
        Plant::Torque { gain, damping, .. } => {
            let d = (2.0 * speed - damping).max(0.0) / gain;
            PidGains {
                p: speed * speed / gain,
                i: speed * speed * speed / 10.0 / gain,
                d,
                ff: feed_forward(plant, d, now, cycle_s),
                ..*now
            }
        }
    }
}

/// What is to be fed forward of velocity and acceleration, beside what is fed forward already of place and jerk.
pub fn feed_forward(plant: &Plant, d: f64, now: &PidGains, cycle_s: f64) -> [f64; 4] {
    let [ff0, _, _, ff3] = now.ff;
    match *plant {
        Plant::Velocity { gain, lag_s, dead_s } => [ff0, 1.0 / gain, (lag_s + dead_s) / gain, ff3],
        Plant::Torque { gain, damping, dead_s } => {
            // The derivative of the error takes the new command, the error itself the one before: a cycle of acceleration too much.
            let acceleration = (1.0 + damping * dead_s) / gain - d * cycle_s;
            [ff0, damping / gain, acceleration, ff3]
        }
    }
}

/// Runs the loop on the model along commands, mm; gives the error of each cycle as the loop sees it, mm.
pub fn run(gains: &PidGains, plant: &Plant, cycle_s: f64, commands_mm: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let step_s = cycle_s / STEPS as f64;
    let delay = (plant.dead_s() / step_s).round() as usize;
    let mut told: VecDeque<f64> = std::iter::repeat_n(0.0, delay).collect();
    let mut pid = Pid::new(*gains, cycle_s);
    let (mut place_mm, mut speed_mm_s) = (0.0, 0.0);
    let one = |command_mm| {
        let output = pid.step(command_mm, place_mm);
        for _ in 0..STEPS {
            told.push_back(output);
            let output = told.pop_front().unwrap_or(output);
            let acceleration = match *plant {
                Plant::Velocity { gain, lag_s, .. } => {
                    // A lag that is shorter than a step is none.
                    (gain * output - speed_mm_s) / lag_s.max(step_s)
                }
                Plant::Torque { gain, damping, .. } => gain * output - damping * speed_mm_s,
            };
            speed_mm_s += acceleration * step_s;
            place_mm += speed_mm_s * step_s;
        }
        pid.error()
    };
    commands_mm.into_iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const CYCLE_S: f64 = 0.001;
    const VELOCITY: Plant = Plant::Velocity {
        gain: 0.9,
        lag_s: 0.003,
        dead_s: 0.0025,
    };
    const TORQUE: Plant = Plant::Torque {
        gain: 2000.0,
        damping: 5.0,
        dead_s: 0.0022,
    };

    /// Whether an error of 1 um dies away.
    fn is_stable(gains: &PidGains, plant: &Plant) -> bool {
        let gains = PidGains { ff: [0.0; 4], ..*gains };
        let errors = run(&gains, plant, CYCLE_S, std::iter::repeat_n(0.001, 6000));
        errors[5000..].iter().all(|error| error.abs() < 1e-4)
    }

    #[test]
    fn a_loop_rings_where_its_gain_margin_ends() {
        for plant in [VELOCITY, TORQUE] {
            let gains = propose(&plant, &PidGains::default(), CYCLE_S);
            let margins = margins(&gains, &plant, CYCLE_S);
            assert!(margins.suffice(), "{plant:?}: {margins:?}");
            let times = |share_db: f64| {
                let more = 10_f64.powf(share_db / 20.0);
                PidGains {
                    p: gains.p * more,
                    i: gains.i * more,
                    d: gains.d * more,
                    ..gains
                }
            };
            assert!(
                is_stable(&times(margins.gain_db - 0.5), &plant),
                "{plant:?}: {margins:?}"
            );
            assert!(
                !is_stable(&times(margins.gain_db + 0.5), &plant),
                "{plant:?}: {margins:?}"
            );
        }
    }

    #[test]
    fn a_loop_rings_where_its_phase_margin_ends() {
        let gains = propose(&VELOCITY, &PidGains::default(), CYCLE_S);
        let margins = margins(&gains, &VELOCITY, CYCLE_S);
        let later = |degrees: f64| Plant::Velocity {
            gain: 0.9,
            lag_s: 0.003,
            dead_s: 0.0025 + degrees / 360.0 / margins.crossover_hz,
        };
        assert!(is_stable(&gains, &later(margins.phase_deg - 3.0)), "{margins:?}");
        assert!(!is_stable(&gains, &later(margins.phase_deg + 3.0)), "{margins:?}");
    }

    #[test]
    fn what_is_fed_forward_leaves_little_while_the_joint_speeds_up() {
        for plant in [VELOCITY, TORQUE] {
            let gains = propose(&plant, &PidGains::default(), CYCLE_S);
            let without = PidGains { ff: [0.0; 4], ..gains };
            // Half a wave of acceleration each way: 20 mm in 0.4 s.
            let command = |cycle: u32| {
                let share = f64::from(cycle.min(400)) / 400.0;
                20.0 * (share - (TAU * share).sin() / TAU)
            };
            let greatest = |gains: &PidGains| {
                let errors = run(gains, &plant, CYCLE_S, (0..600).map(command));
                errors.into_iter().map(f64::abs).fold(0.0, f64::max)
            };
            let (with, without) = (greatest(&gains), greatest(&without));
            // What is left goes with jerk.
            assert!(with < 0.06 * without, "{plant:?}: {with} mm, {without} mm without");
        }
    }

    #[test]
    fn a_gain_that_is_too_much_has_no_margin() {
        let gains = PidGains {
            p: 600.0,
            ..PidGains::default()
        };
        let margins = margins(&gains, &VELOCITY, CYCLE_S);
        assert!(!margins.suffice() && margins.phase_deg < 0.0, "{margins:?}");
    }
}
