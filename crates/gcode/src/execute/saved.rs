//! M70 to M73: the modal state saved and restored.
//!
//! Each level of subroutine calls has one saved state. What is restored is told as if its codes were written again, and
//! only where it differs: M72 is no list of all modes.

use crate::block::Block;
use crate::code::{Distance, FeedUnit, ModalCode};
use crate::error::ErrorKind;
use crate::scan::Fault;
use crate::state::{Calls, Modal, Saved, State};
use motion::canon::Call;

impl State {
    pub(super) fn saved_modes(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let Some(code) = block.codes.modal else {
            return Ok(());
        };
        match code.value {
            ModalCode::Save => self.save(false),
            ModalCode::SaveForReturn => self.save(true),
            ModalCode::Forget => self.saved.retain(|saved| saved.level != self.call_level),
            ModalCode::Restore => {
                let own = self.saved.iter().find(|saved| saved.level == self.call_level);
                let saved = *own.ok_or((code.span, ErrorKind::NothingSaved))?;
                self.restore(&saved, calls);
            }
        }
        Ok(())
    }

    fn save(&mut self, on_return: bool) {
        let level = self.call_level;
        self.saved.retain(|saved| saved.level != level);
        self.saved.push(Saved {
            modal: self.modal,
            system: self.offsets.system,
            tool_offset: self.tools.offset_on.then_some(self.offsets.tool),
            offset_of: self.tools.offset_of,
            tool_centre_point: self.tool_centre_point,
            cutter: self.compensation.cutter,
            level,
            on_return,
        });
    }

    /// A subroutine begins.
    pub(crate) fn enter_call(&mut self) {
        self.parameters.enter();
        self.call_level += 1;
    }

    /// A subroutine ends.
    pub(crate) fn leave_call(&mut self, calls: &mut Calls) {
        self.leave_saved(calls);
        self.parameters.leave();
        self.call_level = self.call_level.saturating_sub(1);
    }

    /// What is saved on the present level of calls, as this level ends.
    fn leave_saved(&mut self, calls: &mut Calls) {
        let level = self.call_level;
        if let Some(saved) = self.saved.iter().find(|saved| saved.level == level).copied() {
            self.saved.retain(|saved| saved.level != level);
            if saved.on_return {
                self.restore(&saved, calls);
            }
        }
    }

    /// Brings back what differs, in the order in which a line would run it.
    fn restore(&mut self, saved: &Saved, calls: &mut Calls) {
        let was = self.modal;
        let Modal {
            motion: _, // M72 leaves the motion code
            plane,
            distance,
            arc_distance,
            feed_unit,
            feed_spindle,
            feed,
            unit,
            path_mode,
            retract,
            diameter,
            overrides: _,
            spindles: _,
            mist: _,
            flood: _,
        } = saved.modal;
        if unit != was.unit {
            self.use_unit(unit, calls);
        }
        self.restore_spindle_modes(&saved.modal, calls);
        if (feed_unit, feed_spindle) != (was.feed_unit, was.feed_spindle) {
            self.use_feed_unit(feed_unit, feed_spindle, calls);
        }
        if feed != was.feed || feed != self.modal.feed {
            self.modal.feed = feed;
            if feed_unit != FeedUnit::InverseTime {
                self.push_feed(calls);
            }
        }
        self.restore_spindles(&saved.modal, &was, calls);
        if plane != was.plane {
            self.use_plane(plane, calls);
        }
        self.use_diameter(diameter, calls);
        if saved.cutter.is_some() != self.compensation.cutter.is_some() {
            self.use_cutter(saved.cutter, calls);
        }
        if saved.tool_offset.is_some() != self.tools.offset_on || saved.tool_centre_point != self.tool_centre_point {
            let offset = saved.tool_offset.unwrap_or(motion::canon::Position::ZERO);
            self.use_tool_frame(offset, saved.tool_centre_point, calls);
            self.tools.offset_on = saved.tool_offset.is_some();
            self.tools.offset_of = saved.offset_of;
        }
        if saved.system != self.offsets.system {
            self.use_system(saved.system, calls);
        }
        if path_mode != was.path_mode {
            self.modal.path_mode = path_mode;
            calls.push_back(Call::SetPathMode(path_mode));
        }
        self.use_distance(distance, calls);
        self.use_arc_distance(arc_distance, calls);
        if retract != was.retract {
            self.use_retract(retract, calls);
        }
        self.restore_switches(&saved.modal, calls);
    }

    pub(super) fn use_distance(&mut self, distance: Distance, calls: &mut Calls) {
        if distance != self.modal.distance {
            calls.push_back(Call::Comment(match distance {
                Distance::Absolute => "interpreter: distance mode changed to absolute".into(),
                Distance::Incremental => "interpreter: distance mode changed to incremental".into(),
            }));
        }
        self.modal.distance = distance;
    }

    pub(super) fn use_arc_distance(&mut self, distance: Distance, calls: &mut Calls) {
        if distance != self.modal.arc_distance {
            calls.push_back(Call::Comment(match distance {
                Distance::Absolute => "interpreter: IJK distance mode changed to absolute".into(),
                Distance::Incremental => "interpreter: IJK distance mode changed to incremental".into(),
            }));
        }
        self.modal.arc_distance = distance;
    }
}
