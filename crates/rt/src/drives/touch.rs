//! Touch probes of a drive (60B8 to 60BD): edges of the machine's probe, and zero marks of its encoder.
//!
//! In:  payloads of the drive. Out: positions that were latched; the function that the drive is asked for. RT but what makes them.

use super::index_of;
use bus::layout::{Field, Layout};
use bus::plan::NodePlan;
use config::{Joint, touch_probe_objects};

/// A touch probe of a drive, which latches every zero mark of its encoder, or every edge of the machine's probe.
#[derive(Clone, Copy, Debug)]
pub(super) struct Touch {
    /// Function, status; positions of the last rising and the last falling edge.
    pub(super) fields: [Field; 4],
    /// How far the bits of this probe stand up in function and status.
    shift: u8,
    /// In the function, before they are moved up.
    bits: u64,
    /// What the positions were before.
    before: [i32; 2],
    /// No edge has been stored since: the next one that is counts, also at the very increment of the one before.
    cleared: [bool; 2],
    /// Positions of the first edges since then, as they came.
    pub(super) found: [Option<i32>; 2],
    /// It is switched off, so that the drive forgets what it has stored.
    off: bool,
}

impl Touch {
    /// On, continuously, rising and falling edges of the probe's input.
    pub(super) const FUNCTION: u64 = 0b0011_0011;
    /// On, continuously, zero marks in place of the input, which rise where they are.
    const ZERO_MARKS: u64 = 0b0001_0111;

    /// `bits`: [`Touch::FUNCTION`], or [`Touch::ZERO_MARKS`], which have no falling edge.
    pub(super) fn new(axis: u8, number: u8, bits: u64, outputs: &Layout, inputs: &Layout) -> Option<Touch> {
        let [function, status, rising, falling] = touch_probe_objects(axis, number);
        let rising = inputs.find(rising, 0)?;
        let falling = match bits {
            Touch::ZERO_MARKS => rising,
            _ => inputs.find(falling, 0)?,
        };
        Some(Touch {
            fields: [outputs.find(function, 0)?, inputs.find(status, 0)?, rising, falling],
            shift: 8 * (number - 1),
            bits,
            before: [0; 2],
            cleared: [false; 2],
            found: [None; 2],
            off: false,
        })
    }

    /// Positions of the last edges in a payload; `None`: there has been none. RT.
    fn read(&self, payload: &[u8]) -> [Option<i32>; 2] {
        let [_, status, edges @ ..] = self.fields;
        let status = status.read(payload) >> self.shift;
        [0, 1].map(|edge: usize| {
            let is_stored = status >> (edge + 1) & 1 == 1;
            is_stored.then(|| edges[edge].read_signed(payload) as i32)
        })
    }

    /// RT.
    pub(super) fn watch(&mut self, payload: &[u8]) {
        self.off &= self.fields[1].read(payload) >> self.shift & 1 == 1;
        for (edge, last) in self.read(payload).into_iter().enumerate() {
            self.cleared[edge] |= last.is_none();
            if self.found[edge].is_none() {
                self.found[edge] = last.filter(|last| self.cleared[edge] || *last != self.before[edge]);
            }
        }
    }

    /// From now on edges count that come. A drive that has stored some is switched off until it says so: positions alone would not
    /// tell a second touch at the same increment. One that forgets nothing by that is told by its positions. RT.
    pub(super) fn arm(&mut self) {
        for edge in 0..2 {
            if let Some(found) = self.found[edge].take() {
                (self.before[edge], self.cleared[edge], self.off) = (found, false, true);
            }
        }
    }

    /// 60B8, as far as it is its own. RT.
    pub(super) fn function(&self) -> u64 {
        if self.off { 0 } else { self.bits << self.shift }
    }
}

/// The touch probes of a drive that the control uses.
#[derive(Debug)]
pub(super) struct Probes {
    /// Follows the machine's probe.
    touch: Option<Touch>,
    /// Latches zero marks, for homing by the control.
    index: Option<Touch>,
    /// Where it has told of one in this cycle, increments.
    index_passed: Option<i32>,
}

impl Probes {
    pub(super) fn new(joint: &Joint, plan: &NodePlan) -> Probes {
        let touch = |number, bits| Touch::new(joint.drive_axis, number, bits, &plan.outputs, &plan.inputs);
        Probes {
            touch: joint.touch_probe.and_then(|number| touch(number, Touch::FUNCTION)),
            index: index_of(joint).and_then(|index| touch(index.probe, Touch::ZERO_MARKS)),
            index_passed: None,
        }
    }

    /// A cycle begins, in which the drive has not told of a zero mark yet. RT.
    pub(super) fn begin_cycle(&mut self) {
        self.index_passed = None;
    }

    /// RT.
    pub(super) fn watch(&mut self, payload: &[u8]) {
        if let Some(touch) = &mut self.touch {
            touch.watch(payload);
        }
        if let Some(index) = &mut self.index {
            index.watch(payload);
            self.index_passed = index.found[0];
            // A mark that is passed again, there and back, is one again.
            index.arm();
        }
    }

    /// What the machine's probe has latched so far counts no more. RT.
    pub(super) fn arm(&mut self) {
        if let Some(touch) = &mut self.touch {
            touch.arm();
        }
    }

    /// Where an edge of the machine's probe was, increments; 0 the rising one, 1 the falling one. RT.
    pub(super) fn touched(&self, edge: usize) -> Option<i32> {
        self.touch.as_ref()?.found[edge]
    }

    /// Where a zero mark was passed, if the drive has told so in this cycle, increments. RT.
    pub(super) fn index_passed(&self) -> Option<i32> {
        self.index_passed
    }

    /// RT.
    pub(super) fn write(&self, payload: &mut [u8]) {
        let probes = [&self.touch, &self.index].map(Option::as_ref);
        if let Some(probe) = probes[0].or(probes[1]) {
            let functions = probes.iter().flatten().map(|probe| probe.function());
            probe.fields[0].write(payload, functions.fold(0, |all, one| all | one));
        }
    }
}
