//! Blocks to canonical calls, in the order in which RS274/NGC runs the words of a line.
//!
//! In:  a [`Block`] and the state left by the blocks before it.
//! Out: canonical calls, or the rule that the block breaks.
//!
//! The order: comment, feed mode, F, S, T, M6, M3-M5, M7-M9, G4, plane, units, work system, path mode, distance modes,
//! G28 and G30, motion (with G53), M0-M2 and M30. F comes before G20 and G21, so on a line that changes the units it is
//! read in the old ones.

use crate::Settings;
use crate::arc;
use crate::block::{Block, CommentKind};
use crate::error::ErrorKind;
use crate::modal::{Coolant, Distance, Feed, FeedMode, Modal, Motion, NonModal, PathCode, Stop, StoredPoint, integer};
use crate::scan::Span;
use motion::canon::{Axis, Call, PathMode, Plane, Position};

/// A broken rule and the octets of the line that break it.
pub(crate) type Fault = (Span, ErrorKind);

/// Whether the program goes on behind a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Flow {
    On,
    /// M2 or M30 was run.
    End,
}

/// Modal state, work offsets and the current point.
#[derive(Clone, Debug)]
pub(crate) struct Executor {
    settings: Settings,
    modal: Modal,
    /// Current point in the active work system; its place in the machine is `work + origin`.
    work: Position,
    /// Origin of the active work system in machine coordinates.
    origin: Position,
    /// Feed that was last told, units per second.
    told_per_second: Option<f64>,
}

impl Executor {
    pub(crate) fn new(settings: Settings) -> Executor {
        let system = settings.work_system.clamp(1, 9);
        let origin = settings.work_offsets[usize::from(system) - 1];
        Executor {
            modal: Modal::new(settings.length_unit, system, settings.path_mode),
            work: combine(settings.start, origin, |machine, origin| machine - origin),
            origin,
            told_per_second: None,
            settings,
        }
    }

    /// What a listener must know before the first block.
    pub(crate) fn start(&self, calls: &mut impl Extend<Call>) {
        calls.extend([
            Call::UseLengthUnit(self.modal.unit),
            Call::SetG5xOffset {
                system: self.modal.system,
                origin: self.origin,
            },
            Call::SelectPlane(self.modal.plane),
            Call::SetPathMode(self.modal.path_mode),
        ]);
    }

    pub(crate) fn block_delete(&self) -> bool {
        self.settings.block_delete
    }

    /// Runs a block that was read without faults. After a fault `calls` holds a part of the block.
    pub(crate) fn execute(&mut self, block: &Block, line: &[u8], calls: &mut impl Extend<Call>) -> Result<Flow, Fault> {
        block.check_use(self.modal.motion)?;
        let motion = block.motion_now(self.modal.motion);
        let mut call = |call| calls.extend([call]);

        if let Some((kind, text)) = block.comment {
            let text = String::from_utf8_lossy(text.of(line)).into_owned();
            call(match kind {
                CommentKind::Message => Call::Message(text),
                CommentKind::Plain => Call::Comment(text.into()),
            });
        }
        self.set_feed(block, &mut call);
        if let Some(rpm) = block.word(b'S') {
            call(Call::SetSpindleSpeed { spindle: 0, speed: rpm });
        }
        self.set_tools_and_switches(block, &mut call);
        self.dwell(block, &mut call)?;
        check_path_tolerances(block)?;
        self.set_modes(block, &mut call);
        if let Some(coded) = block.codes.non_modal
            && let NonModal::Return(point) = coded.value
        {
            self.return_to(point, block, &mut call);
        }
        self.check_machine_coordinates(block, motion)?;
        if let Some(coded) = block.codes.motion {
            self.modal.motion = coded.value;
        }
        if let Some(motion) = motion {
            self.run_motion(motion, block, &mut call)?;
        }
        Ok(self.stop(block, &mut call))
    }

    fn set_feed(&mut self, block: &Block, call: &mut impl FnMut(Call)) {
        if let Some(mode) = block.codes.feed_mode {
            self.modal.feed_mode = mode.value;
            self.modal.feed_cleared |= self.modal.feed.take().is_some();
        }
        let Some(number) = block.word(b'F') else { return };
        match self.modal.feed_mode {
            FeedMode::InverseTime => {} // belongs to the move of this line alone
            FeedMode::UnitsPerMinute => {
                self.modal.feed = Some(Feed {
                    number,
                    unit: self.modal.unit,
                });
                if number > 0.0 {
                    self.tell_feed(number * self.modal.unit.mm() / 60.0, call);
                }
            }
        }
    }

    fn tell_feed(&mut self, per_second: f64, call: &mut impl FnMut(Call)) {
        self.told_per_second = Some(per_second);
        call(Call::SetFeedRate {
            linear: per_second,
            angular: per_second,
        });
    }

    fn set_tools_and_switches(&mut self, block: &Block, call: &mut impl FnMut(Call)) {
        if let Some(number) = block.word(b'T') {
            let tool = integer(number).and_then(|tool| u32::try_from(tool).ok()).unwrap_or(0); // checked by `Block::read`
            self.modal.selected_tool = tool;
            call(Call::SelectTool { tool });
        }
        if block.codes.tool_change.is_some() {
            call(Call::StopSpindle { spindle: 0 });
            call(Call::ChangeTool {
                tool: self.modal.selected_tool,
                pocket: 0,
            });
        }
        if let Some(coded) = block.codes.spindle {
            call(
                coded
                    .value
                    .map_or(Call::StopSpindle { spindle: 0 }, |direction| Call::StartSpindle {
                        spindle: 0,
                        direction,
                        wait_for_speed: true,
                    }),
            );
        }
        if let Some(coded) = block.codes.coolant {
            match coded.value {
                Coolant::Mist => call(Call::Mist(true)),
                Coolant::Flood => call(Call::Flood(true)),
                Coolant::Off => {
                    call(Call::Mist(false));
                    call(Call::Flood(false));
                }
            }
        }
    }

    fn dwell(&self, block: &Block, call: &mut impl FnMut(Call)) -> Result<(), Fault> {
        let Some(coded) = block.codes.non_modal.filter(|coded| coded.value == NonModal::Dwell) else {
            return Ok(());
        };
        let seconds = block.word(b'P').ok_or((coded.span, ErrorKind::DwellMissing))?;
        not_negative(block, b'P')?;
        call(Call::Dwell { seconds });
        Ok(())
    }

    fn set_modes(&mut self, block: &Block, call: &mut impl FnMut(Call)) {
        if let Some(coded) = block.codes.plane {
            self.modal.plane = coded.value;
            call(Call::SelectPlane(coded.value));
        }
        if let Some(coded) = block.codes.unit {
            self.modal.unit = coded.value;
            call(Call::UseLengthUnit(coded.value));
        }
        if let Some(coded) = block.codes.system
            && coded.value != self.modal.system
        {
            self.select_system(coded.value);
            call(Call::SetG5xOffset {
                system: coded.value,
                origin: self.origin,
            });
        }
        if let Some(coded) = block.codes.path {
            self.modal.path_mode = match coded.value {
                PathCode::ExactPath => PathMode::ExactPath,
                PathCode::ExactStop => PathMode::ExactStop,
                PathCode::Continuous => {
                    let tolerance_mm = block.word(b'P').map(|number| number * self.modal.unit.mm());
                    let q_mm = block.word(b'Q').map(|number| number * self.modal.unit.mm());
                    PathMode::Continuous {
                        tolerance_mm,
                        naive_cam_tolerance_mm: q_mm.or(tolerance_mm),
                    }
                }
            };
            call(Call::SetPathMode(self.modal.path_mode));
        }
        if let Some(coded) = block.codes.distance {
            self.modal.distance = coded.value;
        }
        if let Some(coded) = block.codes.arc_distance {
            self.modal.arc_distance = coded.value;
        }
    }

    /// The point in the machine stays, so its work coordinates change.
    fn select_system(&mut self, system: u8) {
        let origin = self.settings.work_offsets[usize::from(system) - 1];
        let machine = combine(self.work, self.origin, |work, origin| work + origin);
        self.work = combine(machine, origin, |machine, origin| machine - origin);
        self.origin = origin;
        self.modal.system = system;
    }

    /// G28, G30: through the programmed point to the stored one; with axis words only the named axes go there.
    fn return_to(&mut self, point: StoredPoint, block: &Block, call: &mut impl FnMut(Call)) {
        let stored = match point {
            StoredPoint::G28 => self.settings.g28,
            StoredPoint::G30 => self.settings.g30,
        };
        self.work = self.target(block);
        call(Call::StraightTraverse { to: self.work });
        for axis in Axis::ALL {
            if block.first_axis().is_none() || block.axis(axis).is_some() {
                self.work[axis] = stored[axis] - self.origin[axis];
            }
        }
        call(Call::StraightTraverse { to: self.work });
    }

    fn check_machine_coordinates(&self, block: &Block, motion: Option<Motion>) -> Result<(), Fault> {
        match block.codes.non_modal {
            Some(coded) if coded.value == NonModal::MachineCoordinates => match motion {
                Some(Motion::Traverse | Motion::Feed) if self.modal.distance == Distance::Incremental => {
                    Err((coded.span, ErrorKind::MachineCoordinatesIncremental))
                }
                Some(Motion::Traverse | Motion::Feed) => Ok(()),
                Some(Motion::ArcClockwise | Motion::ArcCounterclockwise) | None => {
                    Err((coded.span, ErrorKind::MachineCoordinatesNeedStraight))
                }
            },
            Some(_) | None => Ok(()),
        }
    }

    fn run_motion(&mut self, motion: Motion, block: &Block, call: &mut impl FnMut(Call)) -> Result<(), Fault> {
        let mut to = self.target(block);
        match motion {
            Motion::Traverse => call(Call::StraightTraverse { to }),
            Motion::Feed => {
                self.prepare_feed(motion, block, to, None, call)?;
                call(Call::StraightFeed { to });
            }
            Motion::ArcClockwise | Motion::ArcCounterclockwise => {
                let plane = self.modal.plane;
                let arc = self.arc(motion, block, &mut to)?;
                let [first, second, _] = plane.axes();
                let in_plane = |position: Position| [position[first], position[second]];
                let length_mm = arc::length_mm(arc, in_plane(self.work), in_plane(to));
                self.prepare_feed(motion, block, to, Some(length_mm), call)?;
                call(Call::ArcFeed {
                    to,
                    plane,
                    centre_mm: arc.centre_mm,
                    turns: arc.turns,
                });
            }
        }
        self.work = to;
        Ok(())
    }

    /// End of the move in work coordinates.
    fn target(&self, block: &Block) -> Position {
        let machine = block
            .codes
            .non_modal
            .is_some_and(|coded| coded.value == NonModal::MachineCoordinates);
        let mut to = self.work;
        for axis in Axis::ALL {
            let Some(number) = block.axis(axis) else { continue };
            let value = if axis.is_rotary() {
                number
            } else {
                number * self.modal.unit.mm()
            };
            to[axis] = match self.modal.distance {
                Distance::Absolute if machine => value - self.origin[axis],
                Distance::Absolute => value,
                Distance::Incremental => to[axis] + value,
            };
        }
        to
    }

    /// Tells the feed of a move to `to` if it is not the one told last. `arc_mm`: length of an arc in its plane.
    fn prepare_feed(
        &mut self,
        motion: Motion,
        block: &Block,
        to: Position,
        arc_mm: Option<f64>,
        call: &mut impl FnMut(Call),
    ) -> Result<(), Fault> {
        let path = path_of(self.work, to, self.modal.plane, arc_mm);
        let per_second = match self.modal.feed_mode {
            FeedMode::UnitsPerMinute => {
                let feed = self.modal.feed.filter(|feed| feed.number > 0.0);
                let feed = feed.ok_or_else(|| {
                    let cleared = self.modal.feed_cleared && self.modal.feed.is_none();
                    (
                        motion_span(block),
                        ErrorKind::FeedMissing {
                            motion: motion.name(),
                            cleared,
                        },
                    )
                })?;
                match path {
                    PathLength::Mm(_) => feed.number * feed.unit.mm() / 60.0,
                    PathLength::Degrees(_) => feed.number / 60.0,
                }
            }
            FeedMode::InverseTime => {
                let number = block.word(b'F').filter(|number| *number > 0.0);
                let fault = || {
                    (
                        motion_span(block),
                        ErrorKind::InverseTimeFeedMissing { motion: motion.name() },
                    )
                };
                let length = match path {
                    PathLength::Mm(length) | PathLength::Degrees(length) => length,
                };
                number.ok_or_else(fault)? * length / 60.0
            }
        };
        // A move of length 0 in G93 has no feed.
        if per_second > 0.0 && self.told_per_second != Some(per_second) {
            self.tell_feed(per_second, call);
        }
        Ok(())
    }

    /// Circle of a G2 or G3 that ends at `to`; sets its plane coordinates to those of the start if they differ from
    /// them by rounding only, so that a full circle stays one.
    fn arc(&self, motion: Motion, block: &Block, to: &mut Position) -> Result<arc::Arc, Fault> {
        let plane = self.modal.plane;
        let words = ArcWords::of(plane);
        let unit = self.modal.unit;
        let count = match block.word(b'P') {
            Some(p) => arc::turns_of(p).map_err(|kind| (block.span(b'P'), kind))?,
            None => 1,
        };
        let turns = arc::signed_turns(motion == Motion::ArcClockwise, count);
        if block.word(words.other).is_some() {
            let kind = ErrorKind::ArcOffsetOfOtherPlane {
                letter: words.other.into(),
                plane: words.plane,
                offsets: words.offset_names,
            };
            return Err((block.span(words.other), kind));
        }
        let [first, second, _] = plane.axes();
        let start_mm = [self.work[first], self.work[second]];
        let offset = words
            .offsets
            .map(|letter| block.word(letter).map(|number| number * unit.mm()));
        let given = words.offsets.into_iter().find(|letter| block.word(*letter).is_some());

        if let Some(radius) = block.word(b'R') {
            if let Some(letter) = given {
                return Err((block.span(letter), ErrorKind::ArcMixed { letter: letter.into() }));
            }
            if block.axis(first).is_none() && block.axis(second).is_none() {
                return Err((block.span(b'R'), ErrorKind::ArcEndMissing { axes: words.axis_names }));
            }
            let end_mm = [to[first], to[second]];
            if is_same_point(start_mm, end_mm) {
                return Err((
                    block.span(b'R'),
                    ErrorKind::ArcEndIsStart {
                        offsets: words.offset_names,
                    },
                ));
            }
            return arc::by_radius(start_mm, end_mm, radius * unit.mm(), turns, unit)
                .map_err(|kind| (block.span(b'R'), kind));
        }

        let Some(given) = given else {
            let kind = ErrorKind::ArcCentreMissing {
                motion: motion.name(),
                offsets: words.offset_names,
            };
            return Err((motion_span(block), kind));
        };
        let centre_mm = match self.modal.arc_distance {
            Distance::Incremental => [
                start_mm[0] + offset[0].unwrap_or(0.0),
                start_mm[1] + offset[1].unwrap_or(0.0),
            ],
            Distance::Absolute => {
                let missing = |letter: u8| {
                    (
                        block.span(given),
                        ErrorKind::ArcAbsoluteCentreIncomplete { missing: letter.into() },
                    )
                };
                [
                    offset[0].ok_or_else(|| missing(words.offsets[0]))?,
                    offset[1].ok_or_else(|| missing(words.offsets[1]))?,
                ]
            }
        };
        if is_same_point(start_mm, [to[first], to[second]]) {
            to[first] = start_mm[0];
            to[second] = start_mm[1];
        }
        arc::by_centre(start_mm, [to[first], to[second]], centre_mm, turns, unit)
            .map_err(|kind| (block.span(given), kind))
    }

    fn stop(&mut self, block: &Block, call: &mut impl FnMut(Call)) -> Flow {
        let Some(coded) = block.codes.stop else { return Flow::On };
        match coded.value {
            Stop::Program => call(Call::ProgramStop),
            Stop::Optional => call(Call::OptionalProgramStop),
            Stop::End => {
                self.select_system(1);
                call(Call::SetG5xOffset {
                    system: 1,
                    origin: self.origin,
                });
                if self.modal.plane != Plane::Xy {
                    call(Call::SelectPlane(Plane::Xy));
                }
                call(Call::StopSpindle { spindle: 0 });
                call(Call::Mist(false));
                call(Call::Flood(false));
                call(Call::ProgramEnd);
                return Flow::End;
            }
        }
        Flow::On
    }

    /// Takes over what can be understood of a block with mistakes, so that the lines behind it are judged as if it were
    /// mended.
    pub(crate) fn recover(&mut self, block: &Block, faults: &[Fault]) {
        self.set_feed(block, &mut |_| ());
        self.set_modes(block, &mut |_| ());
        if let Some(coded) = block.codes.motion {
            self.modal.motion = coded.value;
        }
        for (_, kind) in faults {
            match kind {
                ErrorKind::FeedMissing { .. } | ErrorKind::Negative { letter: 'F', .. } => {
                    self.modal.feed = Some(Feed {
                        number: 1.0,
                        unit: self.modal.unit,
                    });
                }
                ErrorKind::NoMotion { .. } => self.modal.motion = Some(Motion::Traverse),
                _ => {} // nothing that later lines need is missing
            }
        }
        self.work = self.target(block);
    }
}

/// Names of the words of an arc in a plane.
struct ArcWords {
    plane: &'static str,
    /// Centre letters of the first and second axis.
    offsets: [u8; 2],
    /// Centre letter of the normal.
    other: u8,
    offset_names: &'static str,
    axis_names: &'static str,
}

impl ArcWords {
    fn of(plane: Plane) -> ArcWords {
        let (plane, offsets, other, offset_names, axis_names) = match plane {
            Plane::Xy => ("G17", *b"IJ", b'K', "I, J", "X and Y"),
            Plane::Zx => ("G18", *b"KI", b'J', "I, K", "X and Z"),
            Plane::Uv => ("G17.1", *b"IJ", b'K', "I, J", "U and V"),
            Plane::Wu => ("G18.1", *b"KI", b'J', "I, K", "U and W"),
            Plane::Vw => ("G19.1", *b"JK", b'I', "J, K", "V and W"),
            Plane::Yz => ("G19", *b"JK", b'I', "J, K", "Y and Z"),
        };
        ArcWords {
            plane,
            offsets,
            other,
            offset_names,
            axis_names,
        }
    }
}

/// Length along which F counts.
enum PathLength {
    /// Of XYZ if one of them moves, else of UVW.
    Mm(f64),
    /// Of ABC: nothing else moves.
    Degrees(f64),
}

fn path_of(from: Position, to: Position, plane: Plane, arc_mm: Option<f64>) -> PathLength {
    let length = |axes: [Axis; 3]| {
        axes.into_iter()
            .fold(0.0, |sum: f64, axis| sum.hypot(to[axis] - from[axis]))
    };
    if let Some(arc_mm) = arc_mm {
        let [_, _, normal] = plane.axes();
        return PathLength::Mm(arc_mm.hypot(to[normal] - from[normal]));
    }
    let xyz = length([Axis::X, Axis::Y, Axis::Z]);
    let uvw = length([Axis::U, Axis::V, Axis::W]);
    let abc = length([Axis::A, Axis::B, Axis::C]);
    if xyz > 0.0 {
        PathLength::Mm(xyz)
    } else if uvw > 0.0 || abc == 0.0 {
        PathLength::Mm(uvw)
    } else {
        PathLength::Degrees(abc)
    }
}

/// Points closer than this are one, mm: far below any resolution, far above rounding errors.
const SAME_POINT_MM: f64 = 1e-9;

fn is_same_point(a: [f64; 2], b: [f64; 2]) -> bool {
    (a[0] - b[0]).hypot(a[1] - b[1]) < SAME_POINT_MM
}

/// Place of the motion code, or of the first axis word where the code is modal.
fn motion_span(block: &Block) -> Span {
    let axis = || block.first_axis().map(|letter| block.span(letter));
    block
        .codes
        .motion
        .map(|coded| coded.span)
        .or_else(axis)
        .unwrap_or_default()
}

/// G64 takes no negative P and Q.
fn check_path_tolerances(block: &Block) -> Result<(), Fault> {
    match block.codes.path {
        Some(coded) if coded.value == PathCode::Continuous => {
            not_negative(block, b'P')?;
            not_negative(block, b'Q')
        }
        Some(_) | None => Ok(()),
    }
}

fn not_negative(block: &Block, letter: u8) -> Result<(), Fault> {
    match block.word(letter) {
        Some(value) if value < 0.0 => Err((
            block.span(letter),
            ErrorKind::Negative {
                letter: letter.into(),
                value,
            },
        )),
        Some(_) | None => Ok(()),
    }
}

fn combine(a: Position, b: Position, join: impl Fn(f64, f64) -> f64) -> Position {
    Position(std::array::from_fn(|index| join(a.0[index], b.0[index])))
}
