//! Input devices of the kernel (evdev) as pins: game pads, pendants, keyboards, hand wheels.
//!
//! In:  events of a device, as it is plugged in, used, unplugged. Out: the pins of an external component.
//!
//! Nothing moves because a device appears: what is deflected or pressed then counts only once a hand has moved or released it. Sticks
//! and buttons of a device that goes are at rest in the same turn; its wheels keep their counts, so that their axes stand.

mod device;
mod state;

pub use device::{Found, Told, list, run, watch};

/// A device and what of it is wanted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wanted {
    /// Name of the component whose pins it writes.
    pub name: String,
    /// Its path, or a part of its name.
    pub device: String,
    /// Codes by the names of their pins.
    pub codes: Vec<String>,
    /// Nobody else hears it.
    pub exclusive: bool,
}
