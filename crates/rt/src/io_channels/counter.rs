//! Pins of an encoder that a counter of an I/O node reads, named as LinuxCNC names them.
//!
//! In:  the counter, and its count at the last index. Out: position, speed. Made at start-up, then RT.

use super::objects::Place;
use crate::counter::Counter;
use bus::layout::Field;
use config::Follow;
use hal_pins::{Hal, HalError, Input, Output};

/// LinuxCNC's pins of an encoder. A pin has one writer here: `index-enable` stays as it is, and `indexed` says that it was found.
pub(super) struct CounterPins {
    pub(super) place: Place,
    follow: Follow,
    latch: Option<Field>,
    counter: Counter,
    /// Last cycle in which a value came.
    seen: u64,
    cycle_s: f64,
    out_of_sight_s: f64,
    counts: Output<i32>,
    position: Output<f64>,
    velocity: Output<f64>,
    reset: Input<bool>,
    index: Option<IndexPins>,
}

struct IndexPins {
    enable: Input<bool>,
    indexed: Output<bool>,
    counts_latched: Output<i32>,
    position_latched: Output<f64>,
    enabled_before: bool,
    zero_wanted: bool,
}

impl CounterPins {
    pub(super) fn new(
        hal: &mut Hal,
        name: &str,
        place: Place,
        follow: Follow,
        latch: Option<Field>,
        [cycle_s, out_of_sight_s]: [f64; 2],
    ) -> Result<CounterPins, HalError> {
        let pin = |name: &str, pin: &str| format!("{name}.{pin}");
        let index = match latch {
            None => None,
            Some(_) => Some(IndexPins {
                enable: hal.input(&pin(name, "index-enable"), false)?,
                indexed: hal.output(&pin(name, "indexed"))?,
                counts_latched: hal.output(&pin(name, "counts-latched"))?,
                position_latched: hal.output(&pin(name, "position-latched"))?,
                enabled_before: false,
                zero_wanted: false,
            }),
        };
        Ok(CounterPins {
            place,
            follow,
            latch,
            counter: Counter::new(place.field.object.bits),
            seen: 0,
            cycle_s,
            out_of_sight_s,
            counts: hal.output(&pin(name, "counts"))?,
            position: hal.output(&pin(name, "position"))?,
            velocity: hal.output(&pin(name, "velocity"))?,
            reset: hal.input(&pin(name, "reset"), false)?,
            index,
        })
    }

    pub(super) fn show(&mut self, payload: &[u8], cycle: u64) {
        if let Some(index) = &mut self.index {
            let enabled = index.enable.get();
            match (enabled, std::mem::replace(&mut index.enabled_before, enabled)) {
                (true, false) => {
                    self.counter.arm();
                    index.zero_wanted = true;
                    index.indexed.set(false);
                }
                (false, true) => {
                    self.counter.disarm();
                    index.zero_wanted = false;
                }
                _ => {}
            }
        }
        let latch = self.latch.map(|latch| latch.read(payload));
        if (cycle - std::mem::replace(&mut self.seen, cycle)) as f64 * self.cycle_s > self.out_of_sight_s {
            self.counter.lose_sight();
        }
        self.counter.update(cycle, self.place.read(payload), latch);
        if self.reset.get() {
            self.counter.reset();
        }
        let per_count = 1.0 / self.follow.counts_per_unit;
        let counts = self.counter.counts();
        // LinuxCNC's pin has 32 bits, which wrap; the position goes on.
        self.counts.set(counts as i32);
        self.position.set(counts as f64 * per_count);
        self.velocity
            .set(self.counter.counts_per_cycle() * per_count / self.cycle_s);
        if let Some(index) = &mut self.index
            && let Some(latched) = self.counter.latched()
        {
            index.counts_latched.set(latched as i32);
            index.position_latched.set(latched as f64 * per_count);
            if index.zero_wanted && !self.counter.is_armed() {
                index.zero_wanted = false;
                index.indexed.set(true);
            }
        }
    }
}
