//! External components: pins whose outputs other processes write.
//!
//! In:  records of the processes, in files of their own; what inputs read.
//! Out: outputs, or their safe values; what has become of each component.
//!
//! A cycle takes what they have written where inputs of nodes are taken, and shows them their inputs once everything has been made, so a
//! process sees the values of one cycle and acts in the next.
//!
//! RT: nothing allocates but [`ExternalPins::new`].

use config::{Config, OnLoss};
use hal_pins::{Change, External, Hal, HalError};
use machine::faults::Fault;

/// Changes of a component that stop nothing are told no more often, s: processes may come and go as they like.
const TOLD_S: f64 = 1.0;

/// All of a machine.
pub struct ExternalPins {
    components: Box<[Component]>,
    /// Cycles of [`TOLD_S`].
    told_cycles: u64,
}

struct Component {
    shared: External,
    on_loss: OnLoss,
    /// What has happened last, if nobody has heard of it.
    untold: Option<Change>,
    /// Cycles until the next one may be told.
    quiet: u64,
}

/// What has become of an external component.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Told {
    /// Something is wrong.
    Fault(Fault),
    /// Something is to be noted.
    Change {
        /// By its place in the machine file.
        component: usize,
        change: Change,
        /// Process that says it has it.
        pid: u32,
    },
}

impl ExternalPins {
    /// Claims the pins of all of them.
    ///
    /// # Errors
    /// Number of the component whose pins cannot be had, and why: names that are taken, shared memory too small, no file for it.
    pub fn new(hal: &mut Hal, config: &Config) -> Result<ExternalPins, (usize, HalError)> {
        let mut components = Vec::new();
        for (number, component) in config.external.iter().enumerate() {
            let heartbeat_ms = u64::from(component.heartbeat_ms);
            let cycles = (heartbeat_ms * 1000).div_ceil(u64::from(config.cycle_us.max(1)));
            let shared = External::create(hal, &component.name, &component.pins, heartbeat_ms, cycles)
                .map_err(|error| (number, error))?;
            components.push(Component {
                shared,
                on_loss: component.on_loss,
                untold: None,
                quiet: 0,
            });
        }
        Ok(ExternalPins {
            components: components.into(),
            told_cycles: (TOLD_S * 1e6 / f64::from(config.cycle_us.max(1))) as u64,
        })
    }

    /// Takes what processes have written; `skipped`: cycles that were left out since the last call. RT.
    pub fn take(&mut self, skipped: u64) {
        for component in &mut self.components {
            component.quiet = component.quiet.saturating_sub(1 + skipped);
            if let Some(change) = component.shared.take(1 + skipped) {
                component.untold = Some(change);
            }
        }
    }

    /// Shows processes what their inputs read. RT.
    pub fn give(&mut self) {
        for component in &mut self.components {
            component.shared.give();
        }
    }

    /// What has become of one of them, one a call; what stops the machine at once, other things at the latest in a second. RT.
    pub fn take_told(&mut self) -> Option<Told> {
        let told_cycles = self.told_cycles;
        self.components.iter_mut().enumerate().find_map(|(number, component)| {
            let change = component.untold?;
            let is_loss = matches!(change, Change::Lost | Change::CutShort);
            let stops = is_loss && component.on_loss == OnLoss::Stop;
            if component.quiet > 0 && !stops {
                return None;
            }
            component.untold = None;
            component.quiet = told_cycles;
            Some(match is_loss && component.on_loss != OnLoss::Journal {
                true => Told::Fault(Fault::ExternalLost {
                    component: number,
                    cut_short: change == Change::CutShort,
                    stops,
                }),
                false => Told::Change {
                    component: number,
                    change,
                    pid: component.shared.holder(),
                },
            })
        })
    }
}

/// Pins of all of them, for the size of the shared memory.
pub fn count_pins(config: &Config) -> usize {
    config.external.iter().map(|component| component.pins.len() + 2).sum()
}
