//! Cutter radius compensation: G40 to G42.1, and what is forbidden while it is on. Its geometry is in
//! the crate `compensation`.

use crate::block::{Block, Coded};
use crate::code::{Compensation, Motion, NonModal, ToolCode, integer_in};
use crate::error::ErrorKind;
use crate::scan::{Fault, Span};
use crate::state::{Calls, State};
use ::compensation::CompensationErrorKind as Kind;
use motion::canon::{Call, Cutter, Plane, Side};

/// Refuses a code if it is there.
fn refuse(span: Option<Span>, what: &'static str) -> Result<(), Fault> {
    match span {
        Some(span) => Err((span, ErrorKind::Compensation(Kind::NotAllowed { what }))),
        None => Ok(()),
    }
}

impl State {
    /// Refuses the codes that act before G40 to G42.1 of the same line while compensation is on: those that would change
    /// the tool or leave the plane, or that cannot wait for the move that is held.
    ///
    /// Cycles, curves and probes are refused where they run.
    #[inline]
    pub(super) fn check_before_compensation(&self, block: &Block) -> Result<(), Fault> {
        if self.compensation.cutter.is_none() {
            return Ok(());
        }
        let codes = &block.codes;
        if let Some(code) = codes.compensation.filter(|code| code.value != Compensation::Off) {
            return Err((code.span, ErrorKind::Compensation(Kind::AlreadyOn)));
        }
        if let Some(code) = codes.plane.filter(|code| code.value != self.modal.plane) {
            return Err((code.span, ErrorKind::Compensation(Kind::PlaneChange)));
        }
        let change = |code: &Coded<ToolCode>| code.value == ToolCode::Change;
        refuse(
            codes.input_output.map(|code| code.span),
            "an input or output (M62 to M68)",
        )?;
        refuse(codes.tool.filter(change).map(|code| code.span), "a tool change (M6)")?;
        refuse(
            codes.overrides.map(|code| code.span),
            "a change of the overrides (M48 to M53)",
        )
    }

    /// Refuses the codes that act behind G40 to G42.1 of the same line while compensation is on: those that would move the
    /// work coordinates under the contour, or leave it.
    #[inline]
    pub(super) fn check_behind_compensation(&self, block: &Block, motion: Option<Motion>) -> Result<(), Fault> {
        if self.compensation.cutter.is_none() {
            return Ok(());
        }
        let codes = &block.codes;
        refuse(
            codes.length_offset.map(|code| code.span),
            "a change of the tool length offset (G43, G49)",
        )?;
        refuse(
            codes.system.map(|code| code.span),
            "a change of the work coordinate system",
        )?;
        refuse(
            codes.path.map(|code| code.span),
            "a change of the path mode (G61, G61.1, G64)",
        )?;
        refuse(
            codes.retract.map(|code| code.span),
            "a change of the retract mode (G98, G99)",
        )?;
        if let Some(code) = codes.non_modal {
            let what = match code.value {
                NonModal::Dwell => None,
                NonModal::SetData => self
                    .sets_active_system(block)
                    .then_some("a change of the active coordinate system (G10 L2, L20)"),
                NonModal::Return(_) => Some("a move to a stored point (G28, G30)"),
                NonModal::Store(_) => Some("storing a point (G28.1, G30.1)"),
                NonModal::LocalOffset
                | NonModal::SetPosition
                | NonModal::ClearPosition
                | NonModal::SuspendPosition
                | NonModal::RestorePosition => Some("an offset by G92 or G52"),
                NonModal::MachineCoordinates => Some("a move in machine coordinates (G53)"),
            };
            refuse(what.map(|_| code.span), what.unwrap_or_default())?;
        }
        match motion {
            Some(Motion::SpindleSynchronised | Motion::RigidTap) => {
                let span = codes.motion.map_or_else(Span::default, |code| code.span);
                refuse(Some(span), "a move in step with the spindle (G33, G33.1)")
            }
            Some(_) | None => Ok(()),
        }
    }

    /// Whether G10 changes the system in use.
    fn sets_active_system(&self, block: &Block) -> bool {
        let is = |letter, number: f64| {
            block
                .word_value(letter)
                .is_some_and(|value| (value - number).abs() < 1e-4)
        };
        (is(b'L', 2.0) || is(b'L', 20.0)) && (is(b'P', 0.0) || is(b'P', f64::from(self.offsets.system)))
    }

    pub(super) fn compensation(&mut self, block: &Block, calls: &mut Calls) -> Result<(), Fault> {
        let Some(code) = block.codes.compensation else {
            return Ok(());
        };
        let (side, diameter_mm, orientation) = match code.value {
            Compensation::Off => {
                self.use_cutter(None, calls);
                return Ok(());
            }
            Compensation::Tool(side) => {
                let tool = match block.word_value(b'D') {
                    Some(number) => {
                        let letter = 'D';
                        integer_in(number, 0..=i64::from(u32::MAX))
                            .ok_or(ErrorKind::NotInteger { letter, value: number })
                            .and_then(|_| self.tool_or_spindle(number))
                            .map_err(|kind| block.span(b'D').fault(kind))?
                    }
                    None => self.tool(),
                };
                (side, tool.diameter_mm, tool.orientation)
            }
            Compensation::Dynamic(side) => {
                let missing = || (code.span, ErrorKind::DiameterMissing { code: code.name() });
                let number = block.word_value(b'D').ok_or_else(missing)?;
                let orientation = block.word_value(b'L').unwrap_or(0.0);
                let orientation = integer_in(orientation, 0..=9).ok_or_else(|| {
                    block.span(b'L').fault(ErrorKind::Orientation {
                        letter: 'L',
                        value: orientation,
                    })
                })?;
                (side, number * self.modal.unit.mm(), orientation as u8)
            }
        };
        let plane = self.modal.plane;
        if !matches!(plane, Plane::Xy | Plane::Zx) {
            return Err((code.span, ErrorKind::Compensation(Kind::Plane(plane))));
        }
        let given = matches!(code.value, Compensation::Dynamic(_)) && block.word_value(b'L').is_some();
        let turning = given || !matches!(orientation, 0 | 9);
        if turning && plane != Plane::Zx {
            return Err((code.span, ErrorKind::TurningToolPlane { code: code.name() }));
        }
        let cutter = Cutter {
            side,
            radius_mm: diameter_mm / 2.0,
            orientation,
        };
        self.use_cutter(Some(cutter), calls);
        Ok(())
    }

    /// Switches compensation on or, with `None`, off.
    pub(super) fn use_cutter(&mut self, cutter: Option<Cutter>, calls: &mut Calls) {
        let remark = match cutter {
            None => "interpreter: cutter radius compensation off",
            // A negative radius is one on the other side.
            Some(Cutter { side, radius_mm, .. }) if (side == Side::Left) == (radius_mm >= 0.0) => {
                "interpreter: cutter radius compensation on left"
            }
            Some(_) => "interpreter: cutter radius compensation on right",
        };
        calls.push_back(Call::Comment(remark.into()));
        if cutter.is_some() {
            self.compensation.from = self.at;
        }
        self.compensation.cutter = cutter;
        calls.push_back(Call::SetCutterCompensation(cutter));
    }
}
