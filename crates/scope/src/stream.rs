//! A capture and its trigger.
//!
//! In:  what somebody wants to see. Out: steps of records, from the ring of a running control.

use super::record::{Mode, Plan, Recorder, Step};
use super::trigger::Trigger;
use hal_pins::scope::{CHANNELS_MAX, Capture, Channel};
use hal_pins::{Attached, HalError};

/// Longest record, s.
pub const SECONDS_MAX: f64 = 1e7;
/// Values that are kept before a trigger, at the most: 32 MiB.
const KEPT_MAX: u64 = 4 << 20;

/// What somebody wants to see.
#[derive(Clone, Debug, Default)]
pub struct Wanted {
    /// Pins and nets, in their order.
    pub pins: Vec<String>,
    pub trigger: Option<Trigger>,
    /// Without it: one record where there is a trigger or a length, else one without an end.
    pub mode: Option<Mode>,
    /// Length of a record, s.
    pub seconds: Option<f64>,
    /// Share of it before the trigger, %.
    pub before_percent: f64,
}

/// Why there is nothing to see.
#[derive(Debug, thiserror::Error)]
pub enum ScopeError {
    /// No such pin, no room, no control.
    #[error(transparent)]
    Hal(#[from] HalError),
    /// What is wanted makes no sense; says why.
    #[error("{0}")]
    Wanted(String),
}

/// Records as they come.
pub struct Stream {
    capture: Capture,
    recorder: Recorder,
    shown: usize,
    trigger_at: usize,
}

impl Stream {
    /// Asks for the pins, that of the trigger beside them.
    ///
    /// # Errors
    /// As [`Capture::begin`]; lengths that make no sense.
    pub fn begin(pins: &Attached, wanted: &Wanted) -> Result<Stream, ScopeError> {
        let refuse = |what: String| Err(ScopeError::Wanted(what));
        let length_s = wanted.seconds;
        if let Some(length_s) = length_s.filter(|length_s| !(*length_s > 0.0 && *length_s <= SECONDS_MAX)) {
            return refuse(format!(
                "expected a length above 0 and up to {SECONDS_MAX} s, got {length_s}"
            ));
        }
        if !(0.0..=100.0).contains(&wanted.before_percent) {
            let what = wanted.before_percent;
            return refuse(format!(
                "expected 0 to 100 % of a record before the trigger, got {what}"
            ));
        }
        let mode = match (wanted.mode, &wanted.trigger, length_s) {
            (Some(mode), ..) => mode,
            (None, None, None) => Mode::Roll,
            (None, ..) => Mode::Single,
        };
        if wanted.trigger.is_none() && matches!(mode, Mode::Auto | Mode::Normal) {
            return refuse("expected a trigger with the modes auto and normal".into());
        }
        let mut names = wanted.pins.clone();
        let trigger_at = match &wanted.trigger {
            None => 0,
            Some(trigger) => names.iter().position(|name| *name == trigger.pin).unwrap_or_else(|| {
                names.push(trigger.pin.clone());
                names.len() - 1
            }),
        };
        if names.len() > CHANNELS_MAX && wanted.pins.len() <= CHANNELS_MAX {
            return refuse(format!(
                "{} pins and that of the trigger: {CHANNELS_MAX} in all at the most",
                wanted.pins.len()
            ));
        }
        // Where no length is given, a record around a trigger lasts this long.
        let length_s = match (mode, &wanted.trigger) {
            (Mode::Roll, _) => None,
            (_, Some(_)) => Some(length_s.unwrap_or(1.0)),
            (_, None) => length_s,
        };
        let capture = Capture::begin(pins, &names)?;
        let period_ns = capture.period_ns();
        let ns = |seconds: f64| (seconds * 1e9).round() as u64;
        let before_ns = match &wanted.trigger {
            Some(_) => ns(length_s.unwrap_or(0.0) * wanted.before_percent / 100.0),
            None => 0,
        };
        let kept = before_ns / period_ns * names.len() as u64;
        if kept > KEPT_MAX {
            return refuse(format!(
                "{kept} values would have to be kept before a trigger, {KEPT_MAX} is the most: expected a shorter record, \
                 fewer pins or less of it before the trigger"
            ));
        }
        let plan = Plan {
            mode,
            trigger: wanted.trigger.clone().map(|trigger| (trigger_at, trigger)),
            length_ns: length_s.map(ns),
            before_ns,
            period_ns,
        };
        Ok(Stream {
            capture,
            recorder: Recorder::new(plan),
            shown: wanted.pins.len(),
            trigger_at,
        })
    }

    /// What is shown.
    pub fn channels(&self) -> &[Channel] {
        &self.capture.channels()[..self.shown]
    }

    /// The ring behind it.
    pub fn capture(&self) -> &Capture {
        &self.capture
    }

    /// What becomes of the cycles.
    pub fn recorder(&self) -> &Recorder {
        &self.recorder
    }

    /// Takes in up to `most` cycles that have come; gives their number. Never waits.
    ///
    /// # Errors
    /// As [`Capture::read`].
    pub fn read(&mut self, most: usize, mut step: impl FnMut(&[Channel], Step<'_>)) -> Result<usize, HalError> {
        let Stream {
            capture,
            recorder,
            shown,
            trigger_at,
        } = self;
        let channels = capture.channels().to_vec();
        let (shown, trigger) = (&channels[..*shown], &channels[*trigger_at]);
        capture.read(most, |record| {
            let value = record
                .words
                .get(*trigger_at)
                .map_or(f64::NAN, |word| trigger.value(*word).to_f64());
            recorder.take(record.time_ns, record.words, value, |part| {
                let part = match part {
                    Step::Sample { time_ns, words } => Step::Sample {
                        time_ns,
                        words: &words[..shown.len()],
                    },
                    part => part,
                };
                step(shown, part);
            });
        })
    }
}
