//! The cycle follows the clock of the bus.
//!
//! In:  by how much a cycle came behind its date there. Out: by how much the next date moves.

/// How a [`PhaseLoop`] corrects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseConfig {
    /// Length of a cycle, ns.
    pub cycle_ns: u32,
    /// Share of the phase that is taken back at once.
    pub proportional: f64,
    /// Share that is added up.
    pub integral: f64,
    /// Most that a date moves, as a share of the cycle.
    pub step_max: f64,
    /// Most that the clocks may run apart, as a share of the cycle.
    pub drift_max: f64,
}

impl PhaseConfig {
    /// Gains that lock within a second at 1 ms and leave the jitter of frames out.
    pub const fn of_cycle(cycle_ns: u32) -> PhaseConfig {
        PhaseConfig {
            cycle_ns,
            proportional: 0.02,
            integral: 1e-4,
            step_max: 1.0 / 500.0,
            drift_max: 500e-6,
        }
    }
}

/// By how much a time of the bus lies behind the nearest date, ns; within half a cycle. Dates are whole cycles, moved by `shift_ns`.
pub const fn phase_ns(bus_ns: u64, cycle_ns: u32, shift_ns: u32) -> i64 {
    let cycle = cycle_ns as i64;
    if cycle == 0 {
        return 0;
    }
    let behind = (bus_ns.wrapping_sub(shift_ns as u64) % cycle_ns as u64) as i64;
    if behind > cycle / 2 { behind - cycle } else { behind }
}

/// Moves the dates of cycles so that their phase to the clock of the bus goes to 0.
#[derive(Clone, Copy, Debug)]
pub struct PhaseLoop {
    config: PhaseConfig,
    /// What the clocks run apart in a cycle, ns.
    drift_ns: f64,
    /// What was not moved by yet, as dates are whole nanoseconds.
    rest_ns: f64,
    in_row: u32,
}

/// Cycles in a row within a hundredth of the cycle that make it locked.
const LOCKED_IN_ROW: u32 = 50;

impl PhaseLoop {
    /// Before the first frame.
    pub const fn new(config: PhaseConfig) -> PhaseLoop {
        PhaseLoop {
            config,
            drift_ns: 0.0,
            rest_ns: 0.0,
            in_row: 0,
        }
    }

    /// A cycle came so far behind its date by the clock of the bus; how far the next date moves beside a whole cycle, ns.
    pub fn correct(&mut self, phase_ns: i64) -> i64 {
        let cycle = f64::from(self.config.cycle_ns);
        let phase = phase_ns as f64;
        let (drift_max, step_max) = (self.config.drift_max * cycle, self.config.step_max * cycle);
        let wanted = -self.config.proportional * phase + self.drift_ns;
        // Where the step is at its limit, the phase says nothing of the drift.
        if wanted > -step_max && wanted < step_max {
            self.drift_ns = (self.drift_ns - self.config.integral * phase).clamp(-drift_max, drift_max);
        }
        self.in_row = if phase > -cycle / 100.0 && phase < cycle / 100.0 {
            self.in_row.saturating_add(1)
        } else {
            0
        };
        self.move_by(-self.config.proportional * phase + self.drift_ns, step_max)
    }

    /// No frame came: the dates go on as the clocks have run apart so far.
    pub fn hold(&mut self) -> i64 {
        self.move_by(self.drift_ns, self.config.step_max * f64::from(self.config.cycle_ns))
    }

    fn move_by(&mut self, wanted_ns: f64, step_max: f64) -> i64 {
        let exact = wanted_ns.clamp(-step_max, step_max) + self.rest_ns;
        // Casts cut towards 0; what is cut off is kept.
        let whole = exact as i64;
        self.rest_ns = exact - whole as f64;
        whole
    }

    /// The phase has been small for some time.
    pub const fn is_locked(&self) -> bool {
        self.in_row >= LOCKED_IN_ROW
    }

    /// What the clock of the bus gains on ours, as a share.
    pub fn drift(&self) -> f64 {
        -self.drift_ns / f64::from(self.config.cycle_ns)
    }
}
