//! The part of a session that is measured: from the first move of the program until enough cycles have run.
//!
//! In:  a running control, looked at every few milliseconds; the analyser at the far end.
//! Out: the same stretch of time from all: the control's figures, the analyser's, what else the PC did.

use super::pc::{Facts, LoadWatch};
use super::processes::FarAnalyser;
use super::report::Load;
use host::signals::StopSignal;
use machine::state::State;
use operator::operator_loop::{LoopTask, Running};
use rt::cycle_stats::CycleFigures;

/// Where the measurement is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// The network boots, the machine homes.
    Before,
    /// The program runs. The figures before it, cut off at its beginning, are on their way here.
    Begun { at_cycle: u64 },
    /// As `Begun`; what comes now are figures of the program.
    Open { at_cycle: u64 },
    /// Its figures are on their way.
    Closing,
    /// Its figures are here.
    Closed,
}

/// Watches for the stretch that is measured, and ends the session after it.
pub(super) struct Window<'a> {
    cycles_wanted: u64,
    signal: StopSignal,
    /// Shows how many cycles have run.
    progress: &'a mut dyn FnMut(u64),
    pub(super) analyser: Option<FarAnalyser>,
    stage: Stage,
    pub(super) figures: Option<Box<CycleFigures>>,
    pub(super) programs: u64,
    load_watch: Option<LoadWatch>,
    pub(super) load: Load,
    /// What went wrong with the analyser.
    pub(super) error: Option<anyhow::Error>,
}

impl<'a> Window<'a> {
    pub(super) fn new(
        cycles_wanted: u64,
        analyser: Option<FarAnalyser>,
        signal: StopSignal,
        progress: &'a mut dyn FnMut(u64),
    ) -> Window<'a> {
        Window {
            cycles_wanted,
            signal,
            progress,
            analyser,
            stage: Stage::Before,
            figures: None,
            programs: 0,
            load_watch: None,
            load: Load::default(),
            error: None,
        }
    }

    /// Whether the program was measured at all.
    pub(super) fn was_open(&self) -> bool {
        match self.stage {
            Stage::Before => false,
            Stage::Begun { .. } | Stage::Open { .. } | Stage::Closing | Stage::Closed => true,
        }
    }

    fn tell_analyser(&mut self, order: fn(&mut FarAnalyser) -> anyhow::Result<()>) {
        if let Some(analyser) = &mut self.analyser
            && let Err(error) = order(analyser)
        {
            self.error.get_or_insert(error);
        }
    }

    /// Whether the stretch is over: enough cycles, a signal, or the machine does not go on by itself.
    fn is_over(&self, at_cycle: u64, running: &Running) -> bool {
        let live = running.operator.live();
        let goes_on = match live.state {
            State::Running | State::Held | State::Ready => true,
            State::Booting
            | State::Disabled
            | State::Enabling
            | State::Homing
            | State::Jogging
            | State::Away
            | State::Returning
            | State::Stopping
            | State::Disabling
            | State::Faulted
            | State::Estop
            | State::ShuttingDown
            | State::Down
            | State::Silenced => false,
        };
        let enough = live.cycles.saturating_sub(at_cycle) >= self.cycles_wanted;
        enough
            || !goes_on
            || self.signal.caught().is_some()
            || self.error.is_some()
            || running.operator.outcome().is_some()
    }
}

impl LoopTask for Window<'_> {
    fn tick(&mut self, running: &mut Running, now_ns: u64) {
        let cut_off = running.windows.last();
        match self.stage {
            Stage::Before => {
                if running.operator.live().state == State::Running && running.windows.cut() {
                    self.tell_analyser(FarAnalyser::begin);
                    self.load_watch = Some(Facts::below("/").watch());
                    self.stage = Stage::Begun {
                        at_cycle: running.operator.live().cycles,
                    };
                }
            }
            Stage::Begun { at_cycle } => {
                if cut_off.is_some() {
                    self.stage = Stage::Open { at_cycle };
                } else if running.operator.outcome().is_some() {
                    self.stage = Stage::Closing;
                }
            }
            Stage::Open { at_cycle } => {
                (self.progress)(running.operator.live().cycles.saturating_sub(at_cycle));
                if self.is_over(at_cycle, running) {
                    running.windows.cut();
                    self.tell_analyser(FarAnalyser::end);
                    self.programs = running.operator.programs();
                    if let Some(watch) = &self.load_watch {
                        self.load = watch.end(running.cpu);
                    }
                    self.stage = Stage::Closing;
                    running.operator.stop(now_ns);
                }
            }
            Stage::Closing => {
                if cut_off.is_some() {
                    self.figures = cut_off;
                    self.stage = Stage::Closed;
                }
            }
            Stage::Closed => {}
        }
    }
}
