//! Linear delta: three carriages on upright rails hold a platform by rods of equal length.
//!
//! The joints of X, Y and Z are the heights of the carriages. A carriage's rod ends, brought together in the middle of the
//! platform, stand at the distance `radius_mm` from the platform at X0 Y0, in the direction of the tower. With (dx, dy) from
//! the platform to the tower:
//!
//! ```text
//! carriage = z + sqrt(rod² - dx² - dy²)
//! ```
//!
//! Names: LinuxCNC's `lineardeltakins` calls radius and rod R and L; its towers stand at 90, -30 and -150 degrees. In printers'
//! firmware they are delta radius and diagonal rod. Where a rod lies nearly level, its carriage moves ever faster.

use super::Why;
use super::number::Number;
use crate::canon::AXES;

/// A linear delta robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearDelta {
    /// Length of each rod, mm; greater than the radius.
    pub rod_mm: f64,
    /// Distance that a rod bridges with the platform in the middle, mm.
    pub radius_mm: f64,
    /// Directions of the towers of the joints of X, Y and Z, as unit vectors; see [`LinearDelta::tower`].
    pub towers: [[f64; 2]; 3],
}

/// Angle of a rod above the level, degrees, at less than which it counts as nearly level.
const NEARLY_DEGREES: f64 = 5.0;

pub(super) const TOO_FAR: Why = "the rod is too short for a place so far from its tower";

impl LinearDelta {
    /// Direction of a tower at an angle from X towards Y, degrees.
    pub fn tower(degrees: f64) -> [f64; 2] {
        let (sin, cos) = libm::sincos(degrees.to_radians());
        [cos, sin]
    }

    /// Joints for axes, by letters; an error names the letter. RT.
    pub(super) fn inverse<N: Number>(&self, axes: &mut [N; AXES]) -> Result<(), (usize, Why)> {
        let [x, y, z, ..] = *axes;
        let rod2 = self.rod_mm * self.rod_mm;
        let mut carriages = [z; 3];
        for (k, (carriage, tower)) in carriages.iter_mut().zip(&self.towers).enumerate() {
            let dx = x - self.radius_mm * tower[0];
            let dy = y - self.radius_mm * tower[1];
            let rise2 = -(dx * dx) - dy * dy + rod2;
            if rise2.value().is_nan() || rise2.value() < 0.0 {
                return Err((k, TOO_FAR));
            }
            *carriage = z + rise2.sqrt();
        }
        (axes[0], axes[1], axes[2]) = (carriages[0], carriages[1], carriages[2]);
        Ok(())
    }

    /// Axes for joints: the lower of the two places at a rod's length from all carriages; `None` where there is none. RT.
    ///
    /// Subtracting the spheres about the carriages pairwise leaves two planes; x and y on both are linear in z:
    /// x = x0 + x1 z, y = y0 + y1 z, and the first sphere gives the quadratic equation for z.
    pub(super) fn forward(&self, axes: &mut [f64; AXES]) -> Option<()> {
        let centres = [0, 1, 2].map(|k| {
            [
                self.radius_mm * self.towers[k][0],
                self.radius_mm * self.towers[k][1],
                axes[k],
            ]
        });
        let [first, second, third] = centres;
        let plane = |centre: [f64; 3]| {
            let to = [0, 1, 2].map(|i| centre[i] - first[i]);
            (to, 0.5 * (to[0] * to[0] + to[1] * to[1] + to[2] * to[2]))
        };
        let ((a, half_a), (b, half_b)) = (plane(second), plane(third));
        let det = a[0] * b[1] - a[1] * b[0];
        // Seen from the first carriage.
        let (x0, x1) = ((half_a * b[1] - half_b * a[1]) / det, (a[1] * b[2] - a[2] * b[1]) / det);
        let (y0, y1) = ((a[0] * half_b - b[0] * half_a) / det, (a[2] * b[0] - a[0] * b[2]) / det);
        let square = 1.0 + x1 * x1 + y1 * y1;
        let half = x0 * x1 + y0 * y1;
        let rest = x0 * x0 + y0 * y0 - self.rod_mm * self.rod_mm;
        let under_root = half * half - square * rest;
        if under_root.is_nan() || under_root < 0.0 {
            return None;
        }
        let z = (-half - under_root.sqrt()) / square;
        (axes[0], axes[1], axes[2]) = (first[0] + x0 + x1 * z, first[1] + y0 + y1 * z, first[2] + z);
        Some(())
    }

    /// What is singular near these joints and axes, both by letters.
    pub(super) fn singularity(&self, joints: &[f64; AXES], z: f64) -> Option<Why> {
        let least = self.rod_mm * libm::sin(NEARLY_DEGREES.to_radians());
        (joints[..3].iter().any(|joint| joint - z < least)).then_some("a rod is nearly level")
    }
}
