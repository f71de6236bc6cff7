//! Cutter compensation between the calls of the lines and the events of the run.

use super::Run;
use crate::CompensatedPath;
use ::compensation::{CompensationError, Compensator, ContourFeed};
use motion::canon::{Call, Event};

impl Run<'_> {
    /// Before the first event.
    pub(super) fn use_compensator(&mut self, number_by_release: bool) {
        let settings = &self.state.settings;
        let rules = ::compensation::Settings {
            corner: settings.cutter_corner,
            gouge: settings.gouge,
            number_by_release,
        };
        self.compensated = ContourFeed::new(settings.contour_feed);
        self.compensator = match settings.compensated_path {
            CompensatedPath::Centre => Some(Compensator::with_settings(rules)),
            CompensatedPath::Programmed => None,
        };
    }

    /// Whether a call has to go through the compensator.
    #[inline]
    pub(super) fn is_compensated(&self, call: &Call) -> bool {
        self.compensator
            .as_ref()
            .is_some_and(|compensator| !compensator.is_idle() || matches!(call, Call::SetCutterCompensation(_)))
    }

    pub(super) fn compensate(&mut self, event: Event) {
        let Some(compensator) = &mut self.compensator else {
            return;
        };
        if compensator.is_idle() {
            compensator.set_position(self.state.compensation.from);
            compensator.set_plane(self.state.modal.plane);
            compensator.set_path_mode(self.state.modal.path_mode);
        }
        let switched = match event.call {
            Call::SetCutterCompensation(cutter) => cutter,
            _ => None,
        };
        let result = compensator.push(event, &mut self.compensated);
        self.state.compensation.centre = compensator.is_on().then(|| compensator.position());
        if !compensator.is_on() {
            self.compensated.end();
        } else if let Some(cutter) = switched {
            let (plane, feed) = (self.state.modal.plane, self.state.canonical_feed());
            self.compensated
                .begin(&cutter, plane, self.state.compensation.from, feed);
        }
        if let Err(error) = result {
            self.refuse(error);
        }
    }

    /// Nothing comes behind the last call: what is held goes out. `false`: this was done before.
    pub(super) fn finish_compensation(&mut self) -> bool {
        let Some(compensator) = &mut self.compensator else {
            return false;
        };
        match compensator.finish(&mut self.compensated) {
            Ok(()) => {
                self.compensated.end();
                self.compensator = None;
            }
            Err(error) => self.refuse(error),
        }
        true
    }

    /// What was made before the error goes out before it; but nothing, if the tool would cut into the contour.
    #[cold]
    pub(super) fn refuse(&mut self, error: Box<CompensationError>) {
        match &mut self.compensator {
            Some(compensator) if !error.kind.is_gouge() => {
                compensator.release(&mut self.compensated);
            }
            Some(_) | None => {}
        }
        self.compensated.end();
        self.refused = Some(self.compensation_error(&error));
    }
}
