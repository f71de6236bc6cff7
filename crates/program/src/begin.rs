//! Where and how a program begins.

use config::Config;
use motion::canon::Position;
use motion::kinematics::ToolFrame;
use std::sync::Arc;

/// Where and how a program begins.
#[derive(Clone, Debug)]
pub enum Begin {
    /// At this machine position, at rest.
    Program { at: Position },
    /// The same for lines that are typed: in the modes that the ones before have left; `None`: as a program.
    Mdi {
        at: Position,
        modes: Option<Arc<gcode::Modes>>,
    },
    /// Before this line, by this way.
    FromLine {
        at: Position,
        line: u32,
        approach: gcode::Approach,
    },
    /// One of the others, but moves at feed run at this one (mm/s or degrees/s), spindles and coolant are not switched on.
    Dry { begin: Box<Begin>, feed_s: f64 },
}

impl Begin {
    /// As behind homing.
    pub fn at_home(config: &Config) -> Begin {
        Begin::Program { at: home(config) }
    }

    /// The machine position at which it begins.
    pub fn at(&self) -> Position {
        match self {
            Begin::Program { at } | Begin::Mdi { at, .. } | Begin::FromLine { at, .. } => *at,
            Begin::Dry { begin, .. } => begin.at(),
        }
    }

    /// The same from another place.
    pub fn moved_to(&self, at: Position) -> Begin {
        match self {
            Begin::Program { .. } => Begin::Program { at },
            Begin::Dry { begin, feed_s } => Begin::Dry {
                begin: Box::new(begin.moved_to(at)),
                feed_s: *feed_s,
            },
            Begin::FromLine { line, approach, .. } => Begin::FromLine {
                at,
                line: *line,
                approach: *approach,
            },
            Begin::Mdi { modes, .. } => Begin::Mdi {
                at,
                modes: modes.clone(),
            },
        }
    }
}

/// Machine position after homing.
pub fn home(config: &Config) -> Position {
    let joints: Vec<f64> = config.joints.iter().map(|joint| joint.homing.position_mm).collect();
    // Carriages of a delta may be homed where no rods could be; from there no program begins.
    config
        .kinematics()
        .forward(&ToolFrame::OFF, &joints)
        .unwrap_or_default()
}
