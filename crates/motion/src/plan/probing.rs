//! How a probing move may be run, whatever its timing: where it stops, the contact decides.
//!
//! In:  its line and the limits of the machine.
//! Out: limits along the line such that any motion within them keeps those of every joint.
//!
//! Where joints are no linear function of the axes, the line is looked at in many places, and each limit is shared out: with
//! q', q'' and q''' the derivatives of a joint by the place on the line,
//!
//! ```text
//! |q'| v <= V,   |q''| v^2 <= A/3,  |q'| a <= 2A/3,   |q'''| v^3 <= J/4,  3 |q''| v a <= J/4,  |q'| j <= J/2
//! ```

use super::limits::Bounds;
use super::{PlanErrorKind, Settings};
use crate::kinematics::{JOINTS, Jet3};
use crate::path::Piece;
use crate::rt::MotionLimits;

/// Places looked at on a line whose joints are no linear function of the axes.
const PLACES: u32 = 400;
/// What derivatives may grow by between two places.
const CREST: f64 = 1.02;

/// Limits along a straight piece.
pub(super) fn limits_along(piece: &Piece, settings: &Settings) -> Result<MotionLimits, PlanErrorKind> {
    let joints = settings
        .joints
        .as_ref()
        .filter(|joints| !joints.kinematics.is_linear(piece.frame()));
    let Some(space) = joints else {
        let limits = Bounds::new(piece).limits(f64::INFINITY, settings);
        return Ok(MotionLimits {
            velocity: limits.v,
            acceleration: limits.a,
            jerk: limits.j,
        });
    };
    let count = space.count();
    let mut most = [[0.0_f64; 3]; JOINTS];
    for place in 0..=PLACES {
        let jet = piece.jet(piece.length() * f64::from(place) / f64::from(PLACES));
        let mut joints = [Jet3::ZERO; JOINTS];
        space
            .kinematics
            .jets(piece.frame(), &jet, &mut joints[..count])
            .map_err(|unreachable| PlanErrorKind::Unreachable {
                unreachable,
                place: Box::new(crate::canon::Position(jet.q)),
            })?;
        for (most, joint) in most.iter_mut().zip(&joints) {
            for (most, now) in most.iter_mut().zip([joint.d1, joint.d2, joint.d3]) {
                *most = most.max(CREST * now.abs());
            }
        }
    }
    let all = || most.iter().zip(&space.limits).take(count);
    let least = |of: &dyn Fn(&[f64; 3], &super::AxisLimits) -> f64| {
        all()
            .map(|(most, limits)| of(most, limits))
            .fold(f64::INFINITY, f64::min)
    };
    let velocity = least(&|[d1, d2, d3], limits| {
        (limits.velocity / d1)
            .min((limits.acceleration / (3.0 * d2)).sqrt())
            .min(libm::cbrt(limits.jerk / (4.0 * d3)))
    });
    let acceleration =
        least(&|[d1, d2, _], limits| (limits.acceleration / (1.5 * d1)).min(limits.jerk / (12.0 * d2 * velocity)));
    let jerk = least(&|[d1, ..], limits| limits.jerk / (2.0 * d1));
    Ok(MotionLimits {
        velocity,
        acceleration,
        jerk,
    })
}
