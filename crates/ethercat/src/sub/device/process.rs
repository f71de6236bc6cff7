//! The process data of a simulated device: outputs to its application, inputs from it.

use super::SubDevice;
use crate::sub::application::Cycle;
use crate::wire::register::AlState;
use crate::wire::sii::Usage;

impl SubDevice {
    /// A cycle of its application beside those of its own, for whatever has changed around it.
    pub fn run_application(&mut self) {
        self.application_cycle(self.powered && self.state == AlState::Op);
    }

    pub(super) fn cycle(&mut self, now_ns: u64) {
        self.cycle_ns = now_ns;
        self.application_cycle(self.state == AlState::Op);
    }

    fn area_of(&self, usage: Usage) -> (u16, u16) {
        let number = self.process_manager(usage);
        number.map_or((0, 0), |number| {
            let manager = self.esc.sync_manager(number);
            if manager.is_active() {
                (manager.start, manager.length)
            } else {
                (0, 0)
            }
        })
    }

    /// Outputs to the application, inputs from it.
    pub(super) fn application_cycle(&mut self, led: bool) {
        let [mut outputs, mut inputs] = core::mem::take(&mut self.process_data);
        let (start, length) = self.area_of(Usage::Outputs);
        outputs.clear();
        outputs.extend_from_slice(self.esc.area(start, length));
        if led && self.mailbox.exists {
            self.objects.scatter(&self.outputs, &outputs);
        }
        let (start, length) = self.area_of(Usage::Inputs);
        inputs.clear();
        inputs.resize(usize::from(length), 0);
        let emergency = self.config.application.cycle(Cycle {
            objects: &mut self.objects,
            outputs: &outputs,
            inputs: &mut inputs,
            led,
            powered: self.powered,
        });
        if self.mailbox.exists {
            self.objects.gather(&self.inputs, &mut inputs);
        }
        if self.state != AlState::Init && !(self.mailbox.exists && self.state == AlState::PreOp) {
            let area = self.esc.area_mut(start, length);
            let octets = area.len().min(inputs.len());
            area[..octets].copy_from_slice(&inputs[..octets]);
        }
        self.process_data = [outputs, inputs];
        if let Some(emergency) = emergency {
            self.report(emergency);
        }
    }

    pub(super) fn clear_outputs(&mut self) {
        let (start, length) = self.area_of(Usage::Outputs);
        self.esc.area_mut(start, length).fill(0);
        self.application_cycle(false);
    }
}
