//! The planner as a whole: calls in, publications out.
//!
//! In:  canonical calls.
//! Out: publications to a ring.

use super::optimal::{self, Override, Stream};
use super::program::{Entry, Move, Program};
use super::smooth::{Passed, Smoother, Stretch};
use super::workers::Workers;
use super::{PlanError, PlannerKind, Programmed, Settings, classic, travel};
use crate::canon::{Event, Position};
use crate::element::{Element, Synced};
use crate::kinematics::ToolFrame;
use crate::path::Piece;
use crate::ring::Sink;

/// Greatest feed override.
pub const FEED_OVERRIDE_MAX: f64 = 1.2;

/// What became of [`Planner::pump`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pumped {
    /// Everything final has been handed over; more calls, or [`Planner::finish`], are needed.
    Hungry,
    /// The sink is full: pump again later. Do not push much more before that.
    Blocked,
    /// Everything has been handed over, down to the rest at the end.
    Done,
    /// What comes behind a place of the program cannot be handed over: a joint would jump there, or pass a limit, also in a plan of
    /// another kind. The machine comes to rest before it. A defect of the planner.
    Refused {
        /// Line of the program.
        line: u32,
    },
}

impl Settings {
    /// Elements that the largest publication may have; the ring must hold as many.
    pub fn largest_publication(&self) -> usize {
        match self.planner_kind {
            PlannerKind::Optimal => optimal::largest_publication(),
            PlannerKind::Classic => classic::largest_publication(),
        }
    }
}

/// What chooses the speed.
#[derive(Debug)]
enum Engine {
    Classic(classic::Steps),
    Optimal(Stream),
}

impl Engine {
    fn push(&mut self, passed: Passed, settings: &Settings) {
        match self {
            Engine::Classic(steps) => steps.push(passed, settings),
            Engine::Optimal(stream) => stream.push(passed, settings),
        }
    }

    fn rest(&mut self, element: Option<Box<Element>>, settings: &Settings) {
        match self {
            Engine::Classic(steps) => steps.rest(element, settings),
            Engine::Optimal(stream) => stream.rest(element),
        }
    }

    fn finish(&mut self) {
        match self {
            Engine::Classic(steps) => steps.finish(),
            Engine::Optimal(stream) => stream.finish(),
        }
    }

    fn is_done(&self) -> bool {
        match self {
            Engine::Classic(steps) => steps.is_done(),
            Engine::Optimal(stream) => stream.is_done(),
        }
    }

    fn planned_anew(&self) -> u64 {
        match self {
            Engine::Classic(steps) => steps.planned_anew(),
            Engine::Optimal(stream) => stream.planned_anew(),
        }
    }

    #[cfg(test)]
    fn spoil(&mut self, spoil: fn(&mut [Element]) -> bool) {
        match self {
            Engine::Classic(steps) => steps.spoil = Some(spoil),
            Engine::Optimal(stream) => stream.spoil = Some(spoil),
        }
    }

    fn pump(&mut self, settings: &Settings, sink: &mut dyn Sink<Element>) -> Pumped {
        match self {
            Engine::Classic(steps) => steps.pump(settings, sink),
            Engine::Optimal(stream) => stream.pump(sink),
        }
    }
}

/// What a path planner hands on to a speed planner.
#[derive(Clone, Debug)]
pub struct Smoothed(What);

#[derive(Clone, Debug)]
enum What {
    /// The path goes on.
    Passed(Passed),
    /// What is known ends at rest, where this happens if there is something.
    Rest(Option<Box<Element>>),
    /// Nothing follows for now.
    Finish,
}

/// The first half of a planner: canonical calls to a smoothed path. It knows nothing of what becomes of it, so that it may run
/// ahead in a thread of its own.
#[derive(Debug)]
pub struct PathPlanner {
    settings: Settings,
    program: Program,
    smoother: Smoother,
    /// How the axes of what passes the stages are meant.
    frame: ToolFrame,
    ideal: Vec<Programmed>,
    /// A probing move that was pushed last, and its planned time, s: kept back until it is known how far it went.
    awaited: Option<(Programmed, f64)>,
    /// Planned time of the last probing move, s.
    probing_s: f64,
    /// What the smoother lets go: memory that is kept from one move to the next.
    passed: Vec<Passed>,
    smoothed: Vec<Smoothed>,
}

impl PathPlanner {
    /// At rest at the start position.
    pub fn new(settings: Settings) -> PathPlanner {
        PathPlanner {
            program: Program::new(settings.start),
            settings,
            smoother: Smoother::default(),
            frame: ToolFrame::OFF,
            ideal: Vec::new(),
            awaited: None,
            probing_s: 0.0,
            passed: Vec::new(),
            smoothed: Vec::new(),
        }
    }

    /// Takes the next call.
    ///
    /// # Errors
    ///
    /// What cannot be planned, with its place. It concerns this call only, which is then of no effect.
    pub fn push(&mut self, event: &Event) -> Result<(), PlanError> {
        self.program.use_modes(event.source.modes);
        if let Some(action) = self.program.take_wait(&event.call, &self.settings) {
            let line = event.source.line;
            self.rest_told(Some(Element::Action { action, line }.into()));
        }
        let entry = self
            .program
            .run(event.source.line, &event.call, &self.settings)
            .map_err(|kind| PlanError {
                source: event.source,
                kind,
            })?;
        match entry {
            None => {}
            Some(Entry::Move(part)) => self.moved(part),
            Some(Entry::Curve(parts)) => parts.into_iter().for_each(|part| self.moved(part)),
            Some(Entry::Halt) => {
                self.tell();
                self.rest(None);
                self.frame = self.program.tool_frame();
            }
            Some(Entry::Rest(element)) => {
                match &*element {
                    Element::Synced(synced) => self.ideal.extend(programmed(synced)),
                    Element::Probing(probing) => {
                        self.probing_s = probing.duration_s();
                        self.ideal.push(Programmed {
                            piece: probing.piece,
                            feed: probing.feed,
                            line: probing.line,
                            rapid: false,
                        });
                    }
                    Element::Span(_) | Element::Dwell { .. } | Element::Action { .. } => {}
                }
                if let Element::Synced(_) | Element::Probing(_) = *element {
                    let line = element.line();
                    for action in self.program.take_outputs().actions() {
                        self.rest_told(Some(Element::Action { action, line }.into()));
                    }
                }
                self.rest_told(Some(element));
            }
        }
        Ok(())
    }

    /// Nothing follows for now: what is known ends at rest. More may be pushed later.
    pub fn finish(&mut self) {
        self.rest_told(None);
        self.smoothed.push(Smoothed(What::Finish));
    }

    /// What has become of the calls since this function was called last, for a [`SpeedPlanner`].
    pub fn smoothed(&mut self) -> std::vec::Drain<'_, Smoothed> {
        self.smoothed.drain(..)
    }

    /// Programmed moves since the last call of this function, in machine coordinates; a probing move as far as it went.
    pub fn ideal_path(&mut self) -> std::vec::Drain<'_, Programmed> {
        self.ideal.drain(..)
    }

    /// As [`Planner::await_contact`] says.
    pub fn await_contact(&mut self) {
        self.awaited = self.ideal.pop().map(|way| (way, self.probing_s));
    }

    /// As [`Planner::probed`] says.
    pub fn probed(&mut self, rest: Position) -> f64 {
        self.program.stands_at(rest);
        let Some((way, planned_s)) = self.awaited.take() else {
            return 0.0;
        };
        let gone = Piece::line(way.piece.position(0.0), rest).map(|piece| piece.in_frame(*way.piece.frame()));
        let gone_mm = gone.as_ref().map_or(0.0, Piece::length);
        self.ideal.extend(gone.map(|piece| Programmed { piece, ..way }));
        planned_s * (1.0 - gone_mm / way.piece.length()).max(0.0)
    }

    /// The end of a probing move is no longer waited for: it counts as programmed. Gives that move, if there was one.
    pub fn give_up_contact(&mut self) -> Option<Programmed> {
        self.awaited.take().map(|(way, _)| way)
    }

    /// Where a machine position lies in the work coordinates of the moment.
    pub fn to_work(&self, machine: &Position) -> Position {
        self.program.to_work(machine)
    }

    fn moved(&mut self, part: Box<Move>) {
        self.program.begins();
        self.ideal.push(Programmed {
            piece: part.piece,
            feed: part.feed,
            line: part.line,
            rapid: part.rapid,
        });
        self.smoother.push(part, &self.settings, &mut self.passed);
        self.pass();
    }

    /// Rest, where the program is, at which what no move has brought about is done first.
    fn rest_told(&mut self, element: Option<Box<Element>>) {
        if let Some(owed) = self.program.take_owed() {
            self.smoother.flush(&self.settings, &mut self.passed);
            self.passed.push(Passed::Stop);
            self.moved(owed);
        }
        self.tell();
        if let Some(line) = element.as_ref().map(|element| element.line())
            && let Some(action) = self.program.take_modes()
        {
            self.rest(Some(Element::Action { action, line }.into()));
        }
        self.rest(element);
    }

    fn tell(&mut self) {
        for told in self.program.take_on_the_way() {
            self.rest(Some(told.into()));
        }
    }

    /// Sends everything through; it ends at rest.
    fn rest(&mut self, element: Option<Box<Element>>) {
        self.smoother.flush(&self.settings, &mut self.passed);
        self.pass();
        self.smoothed.push(Smoothed(What::Rest(element)));
    }

    /// What the smoother lets go. Pieces that it made are meant as the moves they come from: it is empty when that changes.
    fn pass(&mut self) {
        for mut passed in self.passed.drain(..) {
            match &mut passed {
                Passed::Stretch(stretch) => meant(stretch, self.frame, &self.settings),
                Passed::Seam(seam) => {
                    for stretch in seam.rounded.iter_mut().chain(&mut seam.exact) {
                        meant(stretch, self.frame, &self.settings);
                    }
                }
                Passed::Stop => {}
            }
            self.smoothed.push(Smoothed(What::Passed(passed)));
        }
    }
}

/// Says how the axes of a stretch are meant.
fn meant(stretch: &mut Stretch, frame: ToolFrame, settings: &Settings) {
    stretch.piece.set_frame(frame);
    debug_assert_eq!(travel::check(&stretch.piece, settings), Ok(()));
}

/// The second half of a planner: the smoothed path to a plan in time.
#[derive(Debug)]
pub struct SpeedPlanner<S> {
    settings: Settings,
    sink: S,
    engine: Engine,
}

impl<S: Sink<Element>> SpeedPlanner<S> {
    /// At rest at the start position, with threads to help. What comes out does not depend on how many there are.
    pub fn new(settings: Settings, sink: S, workers: &Workers) -> SpeedPlanner<S> {
        let engine = match settings.planner_kind {
            PlannerKind::Classic => Engine::Classic(classic::Steps::new(&settings, workers)),
            PlannerKind::Optimal => Engine::Optimal(Stream::new(&settings, workers)),
        };
        SpeedPlanner { settings, sink, engine }
    }

    /// The path goes on, or ends.
    pub fn push(&mut self, smoothed: Smoothed) {
        match smoothed.0 {
            What::Passed(passed) => self.engine.push(passed, &self.settings),
            What::Rest(element) => self.engine.rest(element, &self.settings),
            What::Finish => self.engine.finish(),
        }
    }

    /// Hands over what is final.
    pub fn pump(&mut self) -> Pumped {
        self.engine.pump(&self.settings, &mut self.sink)
    }

    /// Whether everything has been handed over behind the end of the path.
    pub fn is_done(&self) -> bool {
        self.engine.is_done()
    }

    /// Of the runs that the passes of [`PlannerKind::Classic`] went over: how often what threads had computed ahead was from the
    /// right speed, and how often it was computed again. Without threads and with [`PlannerKind::Optimal`], 0.
    pub fn computed_ahead(&self) -> [u64; 2] {
        match &self.engine {
            Engine::Classic(steps) => steps.computed_ahead(),
            Engine::Optimal(_) => [0; 2],
        }
    }

    /// Publications that were planned anew, as a joint would have jumped in them or passed a limit: defects of the planner that were
    /// kept from the machine.
    pub fn planned_anew(&self) -> u64 {
        self.engine.planned_anew()
    }

    /// Where publications go.
    pub fn sink(&mut self) -> &mut S {
        &mut self.sink
    }

    /// As [`Planner::set_override`] says. Of the moves at feed and the rapid ones, those that are `held` are so by the
    /// interpolation: what goes before them is planned to come to rest where they begin.
    pub fn set_override(&mut self, feed: f64, rapid: f64, held: [bool; 2]) {
        // Not `clamp`, which lets NaN pass.
        #[allow(clippy::manual_clamp, reason = "max and min turn NaN into 0")]
        let within = |share: f64, most: f64| share.max(0.0).min(most);
        match &mut self.engine {
            Engine::Classic(_) => {}
            Engine::Optimal(stream) => stream.set_override(Override {
                feed: within(feed, FEED_OVERRIDE_MAX),
                rapid: within(rapid, 1.0),
                held,
            }),
        }
    }
}

/// Turns canonical calls into a plan and hands it over: both halves, one after the other.
#[derive(Debug)]
pub struct Planner<S> {
    path: PathPlanner,
    speed: SpeedPlanner<S>,
}

impl<S: Sink<Element>> Planner<S> {
    /// A planner at rest at the start position, which does everything in the thread that calls it.
    pub fn new(settings: Settings, sink: S) -> Planner<S> {
        Planner::with_workers(settings, sink, &Workers::none())
    }

    /// The same with threads to help it. What comes out does not depend on how many there are.
    pub fn with_workers(settings: Settings, sink: S, workers: &Workers) -> Planner<S> {
        Planner {
            path: PathPlanner::new(settings),
            speed: SpeedPlanner::new(settings, sink, workers),
        }
    }

    /// Takes the next call.
    ///
    /// # Errors
    ///
    /// What cannot be planned, with its place. It concerns this call only, which is then of no effect.
    pub fn push(&mut self, event: &Event) -> Result<(), PlanError> {
        let result = self.path.push(event);
        self.pass();
        result
    }

    /// The last call was a probing move, and a contact may end it before its end: [`Planner::probed`] is to tell where it did.
    /// Until then it is no part of [`Planner::ideal_path`]. Without this, it goes its whole way.
    pub fn await_contact(&mut self) {
        self.path.await_contact();
    }

    /// The last call was a probing move, and it came to rest here, machine position: what follows begins there. It may go to
    /// the ring only once the move is over. Gives the planned time of the way that was left, s.
    pub fn probed(&mut self, rest: Position) -> f64 {
        self.path.probed(rest)
    }

    /// Where a machine position lies in the work coordinates of the moment.
    pub fn to_work(&self, machine: &Position) -> Position {
        self.path.to_work(machine)
    }

    /// Nothing follows for now: what is known is planned to its end, at rest. More may be pushed later.
    pub fn finish(&mut self) {
        self.path.finish();
        self.pass();
    }

    /// Whether everything has been handed over after [`Planner::finish`].
    pub fn is_done(&self) -> bool {
        self.speed.is_done()
    }

    /// Programmed moves since the last call of this function, in machine coordinates; a probing move as far as it went.
    pub fn ideal_path(&mut self) -> std::vec::Drain<'_, Programmed> {
        self.path.ideal_path()
    }

    /// Where publications go.
    pub fn sink(&mut self) -> &mut S {
        self.speed.sink()
    }

    /// As [`SpeedPlanner::planned_anew`] says.
    pub fn planned_anew(&self) -> u64 {
        self.speed.planned_anew()
    }

    /// What is planned is spoiled before the gate sees it, once `spoil` finds something that it can spoil.
    #[cfg(test)]
    pub(super) fn spoil(&mut self, spoil: fn(&mut [Element]) -> bool) {
        self.speed.engine.spoil(spoil);
    }

    /// From now on feed moves run at `feed` times the programmed feed (0 to 1.2) and rapid moves with `rapid` times the speed
    /// limits of the joints (0 to 1); NaN counts as 0. With 0, the machine comes to rest on the path and waits.
    ///
    /// What is in the ring already is planned again from a place a few hundredths of a second ahead of the machine, by the
    /// next [`Planner::pump`]. Into a sink without a consumer it counts from the next rest on. With [`PlannerKind::Classic`] it is
    /// without effect: there, the interpolation scales time.
    pub fn set_override(&mut self, feed: f64, rapid: f64) {
        self.speed.set_override(feed, rapid, [false; 2]);
    }

    /// Hands over what is final.
    pub fn pump(&mut self) -> Pumped {
        self.speed.pump()
    }

    fn pass(&mut self) {
        for smoothed in self.path.smoothed() {
            self.speed.push(smoothed);
        }
    }
}

/// What a move in step with the spindle was programmed as; a tap goes there and back.
fn programmed(synced: &Synced) -> impl Iterator<Item = Programmed> {
    let depth = synced.tap.map_or(synced.piece.length(), |tap| tap.depth_mm);
    let there = synced.piece.cut(0.0, depth);
    let back = synced.tap.and_then(|_| {
        let back = Piece::line(synced.piece.position(depth), synced.piece.position(0.0))?;
        Some(back.in_frame(*synced.piece.frame()))
    });
    let feed = synced.pitch_mm * synced.turns_s;
    let line = synced.line;
    [there, back].into_iter().flatten().map(move |piece| Programmed {
        piece,
        feed,
        line,
        rapid: false,
    })
}
