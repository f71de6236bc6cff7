//! The motor and load behind a simulated drive, with the drive's position loop.
//!
//! In:  the [`Demand`] of one period and, once, the machine's [`Track`].
//! Out: the [`Sensors`] at the end of the period: encoder, switches, zero mark.
//!
//! A second-order system, in counts and seconds:
//!
//! `x'' = w² (r - x) + 2 d w (f r' - x') + w³ i ∫(r - x) dt`
//!
//! with natural frequency `w`, damping `d`, velocity feed-forward `f` and, at standstill only, an integral part `i`.
//! A ramp of velocity `v` therefore lags by `2 d (1 - f) v / w`, as on a real machine. Led by a velocity `v` it is
//! `x'' = 2 d w (v - x')`, led by a torque `x'' = t`, without friction. Steps are fixed and nothing is random, so that equal
//! demands make equal motion.

use super::track::Track;
use cia402::device::{Control, Demand, Sensors, Switch};

/// Steps of integration in one period.
const STEPS: u32 = 20;
/// Share of the velocity that is fed forward.
const FEED_FORWARD: f64 = 0.9;
/// Weight of the integral part at standstill, per period of the natural frequency in radians.
const INTEGRAL: f64 = 0.1;
/// Deceleration without torque (friction, brake), as a share of the greatest acceleration.
const COAST: f64 = 0.25;
/// Greatest torque as a multiple of the rated one.
const PEAK: f64 = 3.0;

/// What the motor and its load are like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct MotorConfig {
    /// Natural frequency of the closed position loop, rad/s.
    pub(super) natural_frequency_rad_s: f64,
    pub(super) damping: f64,
    /// Greatest acceleration of the motor, counts/s².
    pub(super) acceleration_max: f64,
}

/// Motor, load and position loop.
#[derive(Clone, Debug)]
pub(super) struct Motor {
    config: MotorConfig,
    track: Track,
    /// Machine position at power-on, counts: where the encoder counts from.
    origin: i64,
    /// Machine position, counts.
    position: f64,
    /// counts/s
    velocity: f64,
    /// Mean of the last period, counts/s².
    acceleration: f64,
    /// ∫(r - x) dt, counts · s
    integral: f64,
    /// Demand at the end of the last period, machine counts; `None` without torque.
    demand: Option<f64>,
    /// Where the motor was before the last period, machine counts.
    before: f64,
    /// What its touch probes saw of the last period but one, of which it is told late; encoder counts.
    touched: [Switch; 2],
    /// It stands, whatever it is told.
    pub(super) jammed: bool,
    /// Nobody sees its zero mark.
    pub(super) index_missing: bool,
}

impl Motor {
    /// A motor at rest at the track's start.
    pub(super) fn new(config: MotorConfig, track: Track) -> Motor {
        let origin = track.start;
        Motor {
            config,
            track,
            origin,
            position: origin as f64,
            velocity: 0.0,
            acceleration: 0.0,
            integral: 0.0,
            demand: None,
            before: origin as f64,
            touched: [Switch::default(); 2],
            jammed: false,
            index_missing: false,
        }
    }

    /// Where the load is, machine counts: what a rule on the machine would show, whatever drive and control believe.
    pub(super) fn machine_position(&self) -> f64 {
        self.position
    }

    /// The encoder starts again from zero, as after power-on.
    pub(super) fn power_on(&mut self) {
        self.origin = self.position.round() as i64;
    }

    /// One period with this demand.
    pub(super) fn advance(&mut self, demand: &Demand, period_s: f64) -> Sensors {
        let from = self.position.round() as i64;
        let jammed_at = self.jammed.then_some(self.position);
        self.before = self.position;
        let before = self.velocity;
        let torque = demand.torque / 1000.0 * self.config.acceleration_max / PEAK;
        match demand.control {
            _ if !demand.powered || demand.brake => self.coast(period_s),
            Control::Position => {
                let target = demand.position + self.origin as f64;
                self.control(target, demand.feed_forward, torque, period_s);
            }
            Control::Velocity => {
                let gain = 2.0 * self.config.damping * self.config.natural_frequency_rad_s;
                self.accelerate(period_s, |velocity| gain * (demand.velocity - velocity) + torque);
            }
            Control::Torque => self.accelerate(period_s, |_| torque),
        }
        self.acceleration = (self.velocity - before) / period_s;
        let (low, high) = (self.track.stop_low as f64, self.track.stop_high as f64);
        if self.position < low || self.position > high {
            self.position = self.position.clamp(low, high);
            self.velocity = 0.0;
        }
        if let Some(position) = jammed_at {
            (self.position, self.velocity) = (position, 0.0);
        }
        let sensors = self.sensors(from);
        for probe in &mut self.touched {
            probe.edge = None;
        }
        sensors
    }

    /// A touch probe has changed after this share of the last period.
    pub(super) fn touch(&mut self, probe: usize, share: f64, closed: bool) {
        let at = self.before + share * (self.position - self.before);
        self.touched[probe] = Switch {
            active: closed,
            edge: Some(at.round() as i64 - self.origin),
        };
    }

    /// What the sensors show now; `from` is the machine position, counts, at the start of the period.
    fn sensors(&self, from: i64) -> Sensors {
        let to = self.position.round() as i64;
        let track = &self.track;
        let switch = |active: &dyn Fn(i64) -> bool, low: i64, high: i64| Switch {
            active: active(to),
            // The boundary between the two positions at which the level changed.
            edge: (active(from) != active(to)).then(|| {
                let boundary = if active(from.min(to)) { high } else { low };
                boundary.clamp(from.min(to), from.max(to)) - self.origin
            }),
        };
        Sensors {
            position: to - self.origin,
            velocity: self.velocity.round() as i64,
            torque: (1000.0 * PEAK * self.acceleration / self.config.acceleration_max).round() as i16,
            negative_limit: switch(
                &|position| position <= track.negative_limit,
                i64::MIN,
                track.negative_limit,
            ),
            positive_limit: switch(
                &|position| position >= track.positive_limit,
                track.positive_limit,
                i64::MAX,
            ),
            home: switch(
                &|position| (track.home.0..=track.home.1).contains(&position),
                track.home.0,
                track.home.1,
            ),
            probes: self.touched,
            index: (track.mark_between(from, to))
                .filter(|_| !self.index_missing)
                .map(|mark| mark - self.origin),
        }
    }

    /// One period of `wanted` acceleration for a velocity; no position is held.
    fn accelerate(&mut self, period_s: f64, wanted: impl Fn(f64) -> f64) {
        (self.demand, self.integral) = (None, 0.0);
        let limit = self.config.acceleration_max;
        let step_s = period_s / f64::from(STEPS);
        for _ in 0..STEPS {
            self.velocity += wanted(self.velocity).clamp(-limit, limit) * step_s;
            self.position += self.velocity * step_s;
        }
    }

    /// The demand runs straight from its last value to `target` over the period; a velocity that is fed
    /// forward takes the place of the loop's own share, `torque` is an acceleration beside it.
    fn control(&mut self, target: f64, feed_forward: f64, torque: f64, period_s: f64) {
        let w = self.config.natural_frequency_rad_s;
        let (p, d) = (w * w, 2.0 * self.config.damping * w);
        let i = INTEGRAL * w * w * w;
        let start = self.demand.unwrap_or(self.position);
        let velocity = (target - start) / period_s;
        if self.demand.is_none() || velocity != 0.0 {
            self.integral = 0.0;
        }
        let forward = if feed_forward == 0.0 {
            FEED_FORWARD * velocity
        } else {
            feed_forward
        };
        let step_s = period_s / f64::from(STEPS);
        for step in 1..=STEPS {
            let demand = start + (target - start) * f64::from(step) / f64::from(STEPS);
            let error = demand - self.position;
            let limit = self.config.acceleration_max;
            let wanted = p * error + d * (forward - self.velocity) + i * self.integral + torque;
            // A motor at its limit must not wind the integral up.
            if velocity == 0.0 && wanted.abs() < limit {
                self.integral += error * step_s;
            }
            self.velocity += wanted.clamp(-limit, limit) * step_s;
            self.position += self.velocity * step_s;
        }
        self.demand = Some(target);
    }

    fn coast(&mut self, period_s: f64) {
        self.demand = None;
        let step = COAST * self.config.acceleration_max * period_s;
        let before = self.velocity;
        self.velocity -= before.clamp(-step, step);
        self.position += (before + self.velocity) / 2.0 * period_s;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const PERIOD_S: f64 = 0.001;

    fn motor(start: i64) -> Motor {
        let config = MotorConfig {
            natural_frequency_rad_s: 400.0,
            damping: 0.8,
            acceleration_max: 100_000_000.0,
        };
        let track = Track {
            start,
            negative_limit: -50_000,
            positive_limit: 3_050_000,
            home: (-80_000, 0),
            mark: 25_000,
            mark_distance: 50_000,
            stop_low: -80_000,
            stop_high: 3_080_000,
        };
        Motor::new(config, track)
    }

    fn at(position: f64) -> Demand {
        Demand {
            powered: true,
            position,
            ..Demand::default()
        }
    }

    #[test]
    fn a_ramp_lags_by_the_part_of_the_velocity_that_is_not_fed_forward() {
        let mut motor = motor(0);
        let velocity = 1_000_000.0;
        let mut demand = 0.0;
        let mut sensors = Sensors::default();
        for _ in 0..500 {
            demand += velocity * PERIOD_S;
            sensors = motor.advance(&at(demand), PERIOD_S);
        }
        // 2 · 0.8 · 0.1 · 1e6 / 400 = 400 counts: 0.04 mm at 100 mm/s and 10,000 counts per mm. The steps of the
        // integration add up to one step of 50 µs at this velocity.
        let lag = demand - sensors.position as f64;
        assert!((lag - 400.0).abs() <= 50.0, "{lag}");
        assert!((sensors.velocity - 1_000_000).abs() < 100, "{}", sensors.velocity);
    }

    #[test]
    fn it_comes_to_rest_exactly_at_the_demand() {
        let mut motor = motor(1000);
        let mut sensors = Sensors::default();
        for _ in 0..1000 {
            sensors = motor.advance(&at(20_000.0), PERIOD_S);
        }
        assert_eq!((sensors.position, sensors.velocity), (20_000, 0));
        assert_eq!(
            motor.machine_position().round(),
            21_000.0,
            "the encoder counts from power-on"
        );
        motor.power_on();
        assert_eq!(motor.advance(&at(0.0), PERIOD_S).position, 0);
    }

    #[test]
    fn without_torque_it_stops_by_friction() {
        let mut motor = motor(0);
        for step in 1..=100 {
            motor.advance(&at(f64::from(step) * 1000.0), PERIOD_S);
        }
        let moving = motor.machine_position();
        let periods = (0..200)
            .take_while(|_| motor.advance(&Demand::default(), PERIOD_S).velocity != 0)
            .count();
        assert_eq!(
            periods, 39,
            "1e6 counts/s at 2.5e7 counts/s² take 40 ms, at 0 in the last of them"
        );
        assert!((motor.machine_position() - moving - 20_000.0).abs() < 1000.0);
    }

    #[test]
    fn switches_and_marks_show_where_they_were_passed() {
        let mut motor = motor(1000);
        let mut home = Vec::new();
        let mut marks = Vec::new();
        let mut limit = Vec::new();
        let mut go = |motor: &mut Motor, path: &mut dyn Iterator<Item = i32>| {
            for position in path {
                let sensors = motor.advance(&at(f64::from(position)), PERIOD_S);
                home.extend(sensors.home.edge.map(|edge| (edge, sensors.home.active)));
                limit.extend(
                    sensors
                        .negative_limit
                        .edge
                        .map(|edge| (edge, sensors.negative_limit.active)),
                );
                marks.extend(sensors.index);
            }
        };
        // Encoder counts are machine counts less 1000.
        go(&mut motor, &mut (0..=100).map(|step| -1000 * step));
        go(&mut motor, &mut std::iter::repeat_n(-100_000, 100));
        go(&mut motor, &mut (0..=200).map(|step| -100_000 + 1000 * step));
        go(&mut motor, &mut std::iter::repeat_n(100_000, 100));
        assert_eq!(home, [(-1000, true), (-1000, false)]);
        assert_eq!(limit, [(-51_000, true), (-51_000, false)]);
        assert_eq!(marks, [-26_000, -76_000, -76_000, -26_000, 24_000, 74_000]);
    }

    #[test]
    fn a_velocity_is_reached_and_a_torque_adds_up() {
        let mut motor = motor(0);
        let run = |motor: &mut Motor, control, velocity, torque| {
            let demand = Demand {
                powered: true,
                control,
                velocity,
                torque,
                ..Demand::default()
            };
            (0..20).map(|_| motor.advance(&demand, PERIOD_S)).last().unwrap()
        };
        let sensors = run(&mut motor, Control::Velocity, 200_000.0, 0.0);
        assert_eq!((sensors.velocity, sensors.torque), (200_000, 0));
        // A tenth of the rated torque: 100e6 / 3 / 10 counts/s² for 20 ms, 66,667 counts/s.
        let sensors = run(&mut motor, Control::Torque, 0.0, 100.0);
        assert_eq!((sensors.velocity, sensors.torque), (266_666, 100));
        // Held against a torque beside it, a velocity loop without integral part lags: 3.33e6 / (2 · 0.8 · 400).
        let sensors = run(&mut motor, Control::Velocity, 0.0, 100.0);
        assert!((sensors.velocity - 5208).abs() < 10, "{}", sensors.velocity);
    }

    #[test]
    fn the_track_ends_at_hard_stops() {
        let mut motor = motor(0);
        for _ in 0..1000 {
            motor.advance(&at(-500_000.0), PERIOD_S);
        }
        assert_eq!(motor.machine_position(), -80_000.0);
    }

    proptest! {
        /// Whatever the demands, the motor stays on its track and its numbers stay finite.
        #[test]
        fn it_never_leaves_the_track(demands in prop::collection::vec((any::<bool>(), 0..3_usize, -1e10..1e10f64), 1..100)) {
            let mut motor = motor(0);
            for (powered, control, position) in demands {
                let control = [Control::Position, Control::Velocity, Control::Torque][control];
                let demand = Demand { powered, control, position, velocity: position, torque: position, ..Demand::default() };
                motor.advance(&demand, PERIOD_S);
                prop_assert!((-80_000.0..=3_080_000.0).contains(&motor.machine_position()));
                prop_assert!(motor.velocity.is_finite());
            }
        }
    }
}
