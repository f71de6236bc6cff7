//! What the parts of a cycle take, where somebody asks (`isocnc bench-servo`, `isocnc check`).
//!
//! In:  the end of each part. Out: the time spent in each, of all cycles.
//!
//! RT: where nobody asks, a comparison a part. Else the clock is read, which is no system call.

use std::time::{Duration, Instant};

/// A part of a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Frames are built, sent, awaited and read; payloads copied.
    Bus,
    /// Payload fields to positions and back, power state machines, compensation, position loops.
    Drives,
    /// Shared memory, inputs and outputs, figures.
    Pins,
    /// Faults, orders, the state of the machine.
    Orders,
    /// The next place on the path.
    Interpolation,
    /// From axes to joints.
    Kinematics,
    /// What leaves is looked at: numbers, limits, travel.
    Monitor,
}

impl Part {
    /// All, in the order of a cycle.
    pub const ALL: [Part; 7] = [
        Part::Bus,
        Part::Drives,
        Part::Pins,
        Part::Orders,
        Part::Interpolation,
        Part::Kinematics,
        Part::Monitor,
    ];
}

/// Times of the parts.
#[derive(Clone, Copy, Debug, Default)]
pub struct Laps {
    /// When the part under way began; `None`: nobody asks.
    began: Option<Instant>,
    spent: [Duration; Part::ALL.len()],
}

impl Laps {
    /// From now on all parts count.
    pub fn timed() -> Laps {
        Laps {
            began: Some(Instant::now()),
            ..Laps::default()
        }
    }

    /// What comes before does not count. RT.
    pub fn begin(&mut self) {
        if let Some(began) = &mut self.began {
            *began = Instant::now();
        }
    }

    /// All since the part before was this one. RT.
    pub fn end(&mut self, part: Part) {
        if let Some(began) = &mut self.began {
            let now = Instant::now();
            self.spent[part as usize] += now - *began;
            *began = now;
        }
    }

    /// Time spent in a part so far.
    pub fn spent(&self, part: Part) -> Duration {
        self.spent[part as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_add_up_and_pauses_do_not_count() {
        let began = Instant::now();
        let mut laps = Laps::timed();
        std::thread::sleep(Duration::from_millis(3));
        laps.end(Part::Drives);
        std::thread::sleep(Duration::from_millis(20));
        laps.begin();
        laps.end(Part::Monitor);
        std::thread::sleep(Duration::from_millis(3));
        laps.end(Part::Drives);
        let all: Duration = Part::ALL.iter().map(|part| laps.spent(*part)).sum();
        assert!(laps.spent(Part::Drives) >= Duration::from_millis(6), "{laps:?}");
        assert!(all + Duration::from_millis(20) <= began.elapsed(), "{laps:?}");
    }

    #[test]
    fn nothing_is_timed_where_nobody_asks() {
        let mut laps = Laps::default();
        laps.begin();
        std::thread::sleep(Duration::from_millis(1));
        laps.end(Part::Bus);
        assert!(Part::ALL.iter().all(|part| laps.spent(*part).is_zero()));
    }
}
