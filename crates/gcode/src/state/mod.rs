//! Everything that lasts from line to line.
//!
//! Lengths are mm in work coordinates unless a name says otherwise; `machine = rotate_xy(work + g92) + g5x + tool`.

mod predefined;

use crate::code::{Distance, FeedUnit, Motion, Retract};
use crate::doubt::Doubts;
use crate::execute::cycle::CycleWords;
use crate::execute::turning::Turning;
use crate::machine::PinReader;
use crate::parameter::{self, Parameters};
use crate::remap;
use crate::{Settings, ToolChanger, ToolTable};
use motion::canon::{
    Axis, Call, Cutter, Input, LengthUnit, PathMode, Plane, Position, ProbeMode, SPINDLES, Source, SpindleDirection,
    SpindleMode, WaitMode,
};
use motion::kinematics::ToolFrame;
use std::collections::VecDeque;

/// Calls of a line, in their order.
pub(crate) type Calls = VecDeque<Call>;

/// Where the work coordinates lie in the machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Offsets {
    /// 1 for G54 to 9 for G59.3.
    pub(crate) system: u8,
    /// Origin of the active system, machine coordinates.
    pub(crate) g5x: Position,
    /// Rotation of the active system about Z, degrees.
    pub(crate) rotation_degrees: f64,
    /// G92 and G52, if in effect.
    pub(crate) g92: Position,
    /// G43.
    pub(crate) tool: Position,
}

/// Turns X and Y counter-clockwise.
pub(crate) fn turned(mut point: Position, degrees: f64) -> Position {
    if degrees != 0.0 {
        let (sin, cos) = libm::sincos(degrees.to_radians());
        let (x, y) = (point[Axis::X], point[Axis::Y]);
        point[Axis::X] = x * cos - y * sin;
        point[Axis::Y] = x * sin + y * cos;
    }
    point
}

/// Sum of two positions.
pub(crate) fn plus(a: Position, b: Position) -> Position {
    Position(std::array::from_fn(|axis| a.0[axis] + b.0[axis]))
}

/// Difference of two positions.
pub(crate) fn minus(a: Position, b: Position) -> Position {
    Position(std::array::from_fn(|axis| a.0[axis] - b.0[axis]))
}

impl Offsets {
    /// Those before the first block.
    pub(crate) fn at_start(settings: &Settings) -> Offsets {
        let system = settings.work_system.clamp(1, 9);
        let index = usize::from(system) - 1;
        Offsets {
            system,
            g5x: settings.work_offsets[index],
            rotation_degrees: settings.work_rotations_degrees[index],
            g92: if settings.g92_active {
                settings.g92_offset
            } else {
                Position::ZERO
            },
            tool: Position::ZERO,
        }
    }

    /// Machine coordinates of a point in work coordinates.
    pub(crate) fn machine(&self, work: Position) -> Position {
        let turned = turned(plus(work, self.g92), self.rotation_degrees);
        plus(plus(turned, self.g5x), self.tool)
    }

    /// Work coordinates of a point in machine coordinates.
    pub(crate) fn work(&self, machine: Position) -> Position {
        let turned = turned(minus(minus(machine, self.tool), self.g5x), -self.rotation_degrees);
        minus(turned, self.g92)
    }
}

/// One spindle as the program set it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Spindle {
    pub(crate) turning: Option<SpindleDirection>,
    /// Number of the S word: revolutions per minute or, with constant surface speed, length units per minute.
    pub(crate) speed: f64,
    pub(crate) mode: SpindleMode,
}

/// Which overrides act.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Overrides {
    pub(crate) feed: bool,
    pub(crate) speed: [bool; SPINDLES],
    pub(crate) adaptive: bool,
    pub(crate) hold: bool,
}

/// What M70 saves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Modal {
    /// `None`: G80.
    pub(crate) motion: Option<Motion>,
    pub(crate) plane: Plane,
    pub(crate) distance: Distance,
    pub(crate) arc_distance: Distance,
    pub(crate) feed_unit: FeedUnit,
    /// Spindle whose turns count in G95.
    pub(crate) feed_spindle: u8,
    /// Number of the F word, length units (or degrees) per minute or turn; 0: none.
    pub(crate) feed: f64,
    pub(crate) unit: LengthUnit,
    pub(crate) path_mode: PathMode,
    pub(crate) retract: Retract,
    /// G7: X words are diameters.
    pub(crate) diameter: bool,
    pub(crate) overrides: Overrides,
    pub(crate) spindles: [Spindle; SPINDLES],
    pub(crate) mist: bool,
    pub(crate) flood: bool,
}

impl Modal {
    /// Spindles and coolant are off.
    pub(crate) fn switch_off(&mut self) {
        for spindle in &mut self.spindles {
            spindle.turning = None;
        }
        self.mist = false;
        self.flood = false;
    }
}

/// The tool and its neighbours.
#[derive(Clone, Debug)]
pub(crate) struct Tools {
    pub(crate) table: ToolTable,
    /// Number of the tool in the spindle, 0: none.
    pub(crate) in_spindle: u32,
    /// Line of the table, from 1 on, that the tool in the spindle came from. Before the first change LinuxCNC takes the
    /// first one for it.
    pub(crate) line: Option<u32>,
    /// Number of the T word; `None`: there was none.
    pub(crate) selected: Option<u32>,
    /// G43 to G43.4 is in effect, not G49.
    pub(crate) offset_on: bool,
    /// The tool whose offset that is, as the table had it; `None`: it is of no tool, or not of one alone (G43.1, G43.2, G49).
    pub(crate) offset_of: Option<u32>,
}

impl Tools {
    /// The line, from 1 on, on which the table has a tool.
    pub(crate) fn line_of(&self, number: u32) -> Option<u32> {
        (1..)
            .zip(self.table.tools())
            .find_map(|(line, tool)| (tool.number == number).then_some(line))
    }

    /// P of a line, of a random tool changer the line itself; -1 without one.
    pub(crate) fn pocket_of(&self, line: Option<u32>) -> f64 {
        if let (Some(line), ToolChanger::Random) = (line, self.table.changer()) {
            return f64::from(line);
        }
        let tool = line.and_then(|line| self.table.tools().nth(line as usize - 1));
        tool.map_or(-1.0, |tool| f64::from(tool.pocket))
    }
}

/// Compensation of the cutter's radius.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Compensation {
    /// `None`: it is off, G40.
    pub(crate) cutter: Option<Cutter>,
    /// Where the tool's centre is while it is on and the events are the moves of the centre.
    pub(crate) centre: Option<Position>,
    /// The current point when it was switched on.
    pub(crate) from: Position,
}

/// Something that only the machine knows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Question {
    /// How a probing move ended.
    Probe {
        from: Position,
        to: Position,
        mode: ProbeMode,
    },
    /// What M66 read.
    Input {
        input: Input,
        mode: WaitMode,
        timeout_s: f64,
    },
    /// How a code of the user ended.
    UserCode { number: u8, p: f64, q: f64 },
    /// Which tool M6 brought, and where the axes stand.
    Tool {
        tool: u32,
        /// What the place of the axes read before the length offset changed on the same line.
        before: Option<Position>,
    },
}

/// A NURBS that is being read.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Nurbs {
    pub(crate) order: u32,
    /// Plane in which it was begun.
    pub(crate) plane: Plane,
    /// Knots of G6.2; `None`: G5.2.
    pub(crate) knots: Option<Vec<f64>>,
    /// Control points on the first and second axis of the plane, mm, each with its weight.
    pub(crate) points: Vec<([f64; 2], f64)>,
}

/// A state that M70 or M73 saved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Saved {
    pub(crate) modal: Modal,
    pub(crate) system: u8,
    /// `None`: G49.
    pub(crate) tool_offset: Option<Position>,
    /// As [`Tools::offset_of`].
    pub(crate) offset_of: Option<u32>,
    /// G43.4.
    pub(crate) tool_centre_point: bool,
    /// `None`: G40.
    pub(crate) cutter: Option<Cutter>,
    /// Level of calls in which it was saved.
    pub(crate) level: u32,
    /// M73: the return from the subroutine restores it.
    pub(crate) on_return: bool,
}

/// Everything that lasts from line to line.
#[derive(Clone, Debug)]
pub(crate) struct State {
    pub(crate) settings: Settings,
    /// The current point.
    pub(crate) at: Position,
    pub(crate) offsets: Offsets,
    pub(crate) modal: Modal,
    pub(crate) tools: Tools,
    /// G43.4: X Y Z are those of the tool's tip on the work.
    pub(crate) tool_centre_point: bool,
    pub(crate) compensation: Compensation,
    pub(crate) parameters: Parameters,
    /// What the machine is asked before the next line is read, in the order of the calls of this one.
    pub(crate) questions: Vec<Question>,
    /// Pins of a running control.
    pub(crate) pins: Option<PinReader>,
    /// Control points of a NURBS since its G5.2.
    pub(crate) nurbs: Option<Nurbs>,
    /// A lathe cycle whose profile is being read.
    pub(crate) turning: Option<Turning>,
    /// Way from the start of a G5 without I and J to its first control point: mirrors P and Q of the last G5, mm.
    pub(crate) spline_leaves: [f64; 2],
    /// States that M70 and M73 saved, the newest last, each with the level of calls it belongs to.
    pub(crate) saved: Vec<Saved>,
    /// What the words of a canned cycle said on the lines before.
    pub(crate) cycle: CycleWords,
    /// The spindle with which threads and cycles go: the one that `$` named last with a code that goes with one.
    pub(crate) spindle: u8,
    /// A feed was set and then cleared by a change of the feed mode.
    pub(crate) feed_cleared: bool,
    /// The line that set the feed to 0, while it is.
    pub(crate) feed_zero_line: Option<u32>,
    /// The line that is being run.
    pub(crate) source: Source,
    /// Where the calls of the line stand in the text that are not of the line itself: those of a lathe cycle, in their order.
    pub(crate) sources: VecDeque<Source>,
    /// Subroutine calls under way.
    pub(crate) call_level: u32,
    pub(crate) doubts: Doubts,
    /// The remapped codes.
    pub(crate) remaps: Vec<remap::Entry>,
    /// Which of them are under way.
    pub(crate) remapping: Vec<usize>,
}

impl State {
    pub(crate) fn new(settings: Settings) -> State {
        let parameters = Parameters::new(&settings);
        let offsets = Offsets::at_start(&settings);
        let at = offsets.work(settings.start);
        let mut tools = Tools {
            table: settings.tools.clone(),
            in_spindle: settings.tool_in_spindle,
            line: Some(1),
            selected: None,
            offset_on: false,
            offset_of: None,
        };
        if settings.tool_in_spindle != 0 {
            tools.line = tools.line_of(settings.tool_in_spindle);
        }
        State {
            at,
            offsets,
            modal: Modal {
                motion: None,
                plane: Plane::Xy,
                distance: Distance::Absolute,
                arc_distance: Distance::Incremental,
                feed_unit: FeedUnit::UnitsPerMinute,
                feed_spindle: 0,
                feed: 0.0,
                unit: settings.length_unit,
                path_mode: settings.path_mode,
                retract: Retract::R,
                diameter: settings.diameter_mode,
                overrides: Overrides {
                    feed: true,
                    speed: [true; SPINDLES],
                    adaptive: false,
                    hold: true,
                },
                spindles: [Spindle {
                    turning: None,
                    speed: 0.0,
                    mode: SpindleMode::Rpm,
                }; SPINDLES],
                mist: false,
                flood: false,
            },
            tools,
            tool_centre_point: false,
            compensation: Compensation::default(),
            parameters,
            questions: Vec::new(),
            pins: None,
            nurbs: None,
            turning: None,
            spline_leaves: [0.0; 2],
            saved: Vec::new(),
            cycle: CycleWords::default(),
            spindle: 0,
            feed_cleared: false,
            feed_zero_line: None,
            source: Source::default(),
            sources: VecDeque::new(),
            call_level: 0,
            doubts: Doubts::default(),
            remaps: settings.remaps.iter().map(remap::Entry::new).collect(),
            remapping: Vec::new(),
            settings,
        }
    }

    /// The current point in machine coordinates.
    pub(crate) fn machine(&self) -> Position {
        self.offsets.machine(self.at)
    }

    /// Changes where the work coordinates lie; the axes stay where they are.
    pub(crate) fn set_offsets(&mut self, offsets: Offsets) {
        let machine = self.machine();
        self.offsets = offsets;
        self.at = offsets.work(machine);
        // #5220 outlasts the program: whoever reads it there goes on in the system in force here.
        let system = f64::from(offsets.system);
        self.parameters.set(parameter::ACTIVE_SYSTEM, system);
    }

    /// How the axes are meant.
    pub(crate) fn tool_frame(&self) -> ToolFrame {
        if self.tool_centre_point {
            ToolFrame {
                tcp: true,
                length_mm: self.offsets.tool[Axis::Z],
            }
        } else {
            ToolFrame::OFF
        }
    }

    /// Where the axes stand if tool-centre-point control is off, machine coordinates.
    pub(crate) fn joints_place(&self) -> Position {
        let machine = self.machine();
        let kinematics = &self.settings.kinematics;
        kinematics
            .reframe(&machine, &self.tool_frame(), &ToolFrame::OFF)
            .unwrap_or(machine)
    }

    /// Millimetres of a program length, or degrees as they are.
    pub(crate) fn length(&self, axis: Axis, number: f64) -> f64 {
        if axis.is_rotary() {
            number
        } else {
            number * self.modal.unit.mm()
        }
    }

    /// Settings with which a new program would go on from here.
    pub(crate) fn snapshot(&self) -> Settings {
        let unit = self.settings.machine_unit;
        let parameters = &self.parameters;
        let mut settings = self.settings.clone();
        settings.start = self.joints_place();
        for (system, (origin, degrees)) in (1..).zip(
            settings
                .work_offsets
                .iter_mut()
                .zip(&mut settings.work_rotations_degrees),
        ) {
            *origin = parameters.position(parameter::system_origin(system), unit);
            *degrees = parameters.get(parameter::system_rotation(system));
        }
        settings.work_system = self.offsets.system;
        settings.g92_offset = parameters.position(parameter::G92_OFFSET, unit);
        settings.g92_active = parameters.get(parameter::G92_ACTIVE) != 0.0;
        settings.g28 = parameters.position(parameter::G28_POINT, unit);
        settings.g30 = parameters.position(parameter::G30_POINT, unit);
        settings.length_unit = self.modal.unit;
        settings.path_mode = self.modal.path_mode;
        settings.diameter_mode = self.modal.diameter;
        settings.parameters = parameters.kept().collect();
        settings.tools = self.tools.table.clone();
        settings.tool_in_spindle = self.tools.in_spindle;
        settings
    }
}
