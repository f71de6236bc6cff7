//! SCARA: two arms that swing in the plane XY, a slide along Z and a wrist about it.
//!
//! | joint of | is | zero | counts |
//! |---|---|---|---|
//! | X | shoulder, degrees | inner arm along X | counter-clockwise |
//! | Y | elbow, degrees | outer arm in line with the inner one | counter-clockwise |
//! | Z | slide, mm | where Z is zero | upwards, as Z |
//! | C | wrist, degrees; may be left out | tool offset in line with the outer arm | counter-clockwise |
//!
//! C of a program is the direction of the tool offset in the machine: `C = shoulder + elbow + wrist`. The shoulder stands at
//! X0 Y0 of the machine. Angles as in LinuxCNC's `scarakins` (D2, D4: the arms, D6: tool offset), whose slide counts downwards.
//!
//! With r the distance from shoulder to wrist, a and b the arms, e the elbow:
//!
//! ```text
//! tan(e/2) = ± sqrt((a + b)² - r²) / sqrt(r² - (a - b)²)         sharp where the arms are in line, too
//! shoulder = atan2(y, x) - atan2(b sin e, a + b cos e)
//! ```
//!
//! The sign is that of [`Scara::elbow`] and stays: changing it would take a move of the joints through the line.
//! Near the line (r near a + b or |a - b|) joints turn ever faster for the same motion of the tool.

use super::Why;
use super::number::Number;
use crate::canon::AXES;

/// Which way the elbow is bent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Elbow {
    /// Elbow angles above zero: the outer arm is bent counter-clockwise.
    #[default]
    Positive,
    /// Elbow angles below zero.
    Negative,
}

/// A SCARA robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scara {
    /// From shoulder to elbow, mm.
    pub inner_arm_mm: f64,
    /// From elbow to wrist, mm.
    pub outer_arm_mm: f64,
    /// From the wrist's axis to the tool, mm.
    pub tool_offset_mm: f64,
    /// Which of the two ways to a place the arms take.
    pub elbow: Elbow,
    /// Shoulder angles are those within half a turn of this one, degrees: the middle of the shoulder's travel, so that the
    /// jump of a full turn lies where the arm never is.
    pub shoulder_middle_degrees: f64,
}

/// Elbow angle, degrees, at less than which the arms count as nearly in line.
const NEARLY_DEGREES: f64 = 5.0;

/// Rounding of a squared distance, relative to the square of both arms.
const SLACK: f64 = 1e-12;

pub(super) const TOO_FAR: Why = "the place is farther away than both arms reach";
pub(super) const TOO_NEAR: Why = "the place is nearer to the shoulder than folded arms reach";

impl Scara {
    /// Joints for axes, by letters; an error names the letter. RT.
    pub(super) fn inverse<N: Number>(&self, axes: &mut [N; AXES]) -> Result<(), (usize, Why)> {
        let (a, b) = (self.inner_arm_mm, self.outer_arm_mm);
        let (sin_c, cos_c) = axes[5].to_radians().sin_cos();
        let x = axes[0] - cos_c * self.tool_offset_mm;
        let y = axes[1] - sin_c * self.tool_offset_mm;
        let r2 = x * x + y * y;
        let slack = SLACK * (a + b) * (a + b);
        let outer = not_negative(-r2 + (a + b) * (a + b), slack).ok_or((1, TOO_FAR))?;
        let inner = not_negative(r2 - (a - b) * (a - b), slack).ok_or((1, TOO_NEAR))?;
        let half = outer.sqrt().atan2(inner.sqrt());
        let elbow = match self.elbow {
            Elbow::Positive => half * 2.0,
            Elbow::Negative => half * -2.0,
        };
        let (sin_e, cos_e) = elbow.sin_cos();
        let shoulder = (y.atan2(x) - (sin_e * b).atan2(cos_e * b + a)).to_degrees();
        let turns = ((shoulder.value() - self.shoulder_middle_degrees) / 360.0).round();
        let shoulder = shoulder - 360.0 * turns;
        let elbow = elbow.to_degrees();
        (axes[0], axes[1]) = (shoulder, elbow);
        axes[5] = axes[5] - shoulder - elbow;
        Ok(())
    }

    /// Axes for joints. RT.
    pub(super) fn forward(&self, axes: &mut [f64; AXES]) {
        let (shoulder, elbow, wrist) = (axes[0], axes[1], axes[5]);
        let along = |degrees: f64| libm::sincos(degrees.to_radians());
        let (sin_s, cos_s) = along(shoulder);
        let (sin_e, cos_e) = along(shoulder + elbow);
        let (sin_w, cos_w) = along(shoulder + elbow + wrist);
        axes[0] = self.inner_arm_mm * cos_s + self.outer_arm_mm * cos_e + self.tool_offset_mm * cos_w;
        axes[1] = self.inner_arm_mm * sin_s + self.outer_arm_mm * sin_e + self.tool_offset_mm * sin_w;
        axes[5] = shoulder + elbow + wrist;
    }

    /// What is singular near these joints, which stand by letters.
    pub(super) fn singularity(&self, joints: &[f64; AXES]) -> Option<Why> {
        let elbow = joints[1].abs();
        if elbow < NEARLY_DEGREES {
            Some("the arms are nearly stretched")
        } else if elbow > 180.0 - NEARLY_DEGREES {
            Some("the arms are nearly folded")
        } else {
            None
        }
    }
}

/// A number that may not be negative: rounding below zero is zero, more is nothing.
fn not_negative<N: Number>(number: N, slack: f64) -> Option<N> {
    let value = number.value();
    if value >= 0.0 {
        Some(number)
    } else if value >= -slack {
        Some(number - value)
    } else {
        None
    }
}
