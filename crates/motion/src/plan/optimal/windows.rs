//! Cuts a section into windows that are solved on their own, on any thread.
//!
//! In:  spans between knots, in order; how the section begins and ends.
//! Out: jobs, and from their results the states at all knots.
//!
//! Borders lie where the estimated time since the border before is long enough; so they depend on the path alone. Around
//! each border a small window is solved first, from the feasible profile to the feasible profile. Far from its ends its solution is that of the whole
//! section, so it gives the state at the border. Then every window is solved between the states at its two borders. It
//! starts from the halves of the border solutions and the feasible profile between them: a profile that keeps all limits, so that every
//! step of the solver does. No window waits for another, and a join needs no smoothing.

use std::cell::RefCell;

use super::knots::Knotted;
use super::solver::{
    Grid, Infeasible, Knotting, Options, State, Workspace, feasible_profile, first_braking, initial_guess, solve,
};

/// How the path is cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Times {
    pub(super) knotting: Knotting,
    /// Estimated time around a border, on each side, s: several times what braking to rest takes.
    pub(super) overlap_s: f64,
    /// Estimated time from border to border, s.
    pub(super) window_s: f64,
    /// From where a new plan takes over to the first border: several times what braking to the feasible profile takes.
    pub(super) first_s: f64,
}

/// Spans of a window at the most, which bounds a publication. A quarter of them lies behind a border and must be enough to stop
/// in: where blocks are so short that it is not, no way is found and the machine creeps. 4 um at 100 mm/s are long enough.
pub(super) const WINDOW_SPANS: usize = 8192;

/// Spans on each side of a border and between two of them at the least: where motion takes hours, one takes longer than a
/// window of others.
const BORDER_SPANS: usize = 8;

/// Part of the time by which a window may be slower than it could be.
const WINDOW_GAP: f64 = 1e-3;
/// The same at a border: its window improves it all but for the state at the border, and sooner from well within the limits.
const BORDER_GAP: f64 = 0.1;

/// Profile of some spans: one state per knot.
pub(super) type States = Vec<State>;

/// A job: pure computation.
#[derive(Debug)]
pub(super) struct Job {
    /// Part of the time to which it is solved.
    gap: f64,
    grid: Grid,
    start: States,
}

/// What a job gives: states at all its knots, and whether they have converged.
pub(super) type Answer = Result<States, Infeasible>;

thread_local! {
    /// Memory of the solver, which is cleared for every job: to take it from the system each time takes as long as some of
    /// the iterations.
    static WORKSPACE: RefCell<Workspace> = RefCell::default();
}

impl Job {
    pub(super) fn run(mut self) -> Answer {
        let spans = 0..self.grid.spans();
        let options = Options {
            gap: self.gap,
            ..Options::default()
        };
        WORKSPACE.with_borrow_mut(|workspace| solve(&self.grid, spans, &mut self.start, &options, workspace))?;
        Ok(self.start)
    }
}

/// One end of a window.
#[derive(Clone, Debug)]
enum End {
    /// The section begins or ends there.
    Section(State),
    /// The section takes over from another plan there, as fast as that plan is.
    TakenOver(State),
    /// A border, with the half of its solution that lies in the window, once it is known.
    Border { spans: usize, states: Option<States> },
}

/// Between two borders.
#[derive(Debug)]
pub(super) struct Window {
    grid: Grid,
    pub(super) sources: Vec<Knotted>,
    /// The feasible profile at all its knots.
    feasible: States,
    left: End,
    right: End,
}

impl Window {
    /// The job, as soon as both ends are known.
    pub(super) fn job(&mut self) -> Option<Result<Job, Infeasible>> {
        let known = |end: &End| match end {
            End::Section(_) | End::TakenOver(_) | End::Border { states: Some(_), .. } => true,
            End::Border { states: None, .. } => false,
        };
        (known(&self.left) && known(&self.right)).then(|| {
            self.start().map(|start| Job {
                gap: WINDOW_GAP,
                grid: std::mem::take(&mut self.grid),
                start,
            })
        })
    }

    /// A feasible profile between its ends.
    fn start(&self) -> Result<States, Infeasible> {
        let count = self.grid.spans();
        let (from, begin) = match &self.left {
            End::Section(state) | End::TakenOver(state) => (0, *state),
            End::Border { spans, .. } => (*spans, self.feasible[*spans]),
        };
        let (to, end) = match &self.right {
            End::Section(state) | End::TakenOver(state) => (count, *state),
            End::Border { spans, .. } => (count - spans, self.feasible[count - spans]),
        };
        let middle = match (&self.left, &self.right) {
            (End::Border { .. }, End::Border { .. }) => self.feasible[from..=to].to_vec(),
            (End::TakenOver(_), _) => first_braking(&self.grid, from..to, begin, end, &self.feasible[from..=to])?,
            (End::Section(_), _) | (_, End::Section(_) | End::TakenOver(_)) => {
                initial_guess(&self.grid, from..to, begin, end, &self.feasible[from..=to])?
            }
        };
        let mut start = Vec::with_capacity(count + 1);
        if let End::Border {
            states: Some(states), ..
        } = &self.left
        {
            start.extend_from_slice(&states[..states.len() - 1]);
        }
        start.extend_from_slice(&middle);
        if let End::Border {
            states: Some(states), ..
        } = &self.right
        {
            start.extend_from_slice(&states[1..]);
        }
        Ok(start)
    }

    /// The half of the solution at its right border that lies before it.
    pub(super) fn set_right(&mut self, before: States) {
        if let End::Border { states, .. } = &mut self.right {
            *states = Some(before);
        }
    }

    /// The half of the solution at its left border that lies behind it.
    pub(super) fn set_left(&mut self, behind: States) {
        if let End::Border { states, .. } = &mut self.left {
            *states = Some(behind);
        }
    }
}

/// A border, with the small window around it.
#[derive(Debug)]
pub(super) struct Border {
    pub(super) job: Job,
    /// Spans of the small window before the border.
    pub(super) before: usize,
    /// Its spans behind the border, for the stop there, and one more of the feasible profile to end in.
    pub(super) behind: Vec<Knotted>,
}

/// The part of a section that has not been cut into windows.
#[derive(Debug)]
pub(super) struct Uncut {
    times: Times,
    grid: Grid,
    sources: Vec<Knotted>,
    /// Estimated time up to each knot.
    at_s: Vec<f64>,
    /// Knot of the last border, or where the section begins.
    first: usize,
    /// Time from there to the next one.
    next_s: f64,
    left: End,
}

impl Uncut {
    /// A section that begins with this state.
    pub(super) fn new(state: State, grid: Grid, times: Times) -> Uncut {
        Uncut {
            times,
            grid,
            sources: Vec::new(),
            at_s: vec![0.0],
            first: 0,
            next_s: times.window_s,
            left: End::Section(state),
        }
    }

    /// A section that takes over from another plan in this state, its first window short, so that it is there soon.
    pub(super) fn taken_over(state: State, grid: Grid, times: Times) -> Uncut {
        Uncut {
            next_s: times.first_s,
            left: End::TakenOver(state),
            ..Uncut::new(state, grid, times)
        }
    }

    /// The grid, to which the caller adds the span that it adds here.
    pub(super) fn push(&mut self, source: Knotted) -> &mut Grid {
        self.sources.push(source);
        self.at_s.push(self.now_s() + source.time_s);
        &mut self.grid
    }

    /// Estimated time at the end of what is known.
    fn now_s(&self) -> f64 {
        self.at_s.last().copied().unwrap_or(0.0)
    }

    /// The next window and the border at its end, if there is a border that stays whatever comes; `ended`: nothing comes.
    pub(super) fn cut(&mut self, ended: bool) -> Option<(Window, Border)> {
        let begin_s = self.at_s[self.first];
        let overlap_s = self.times.overlap_s;
        let due = self.at_s[self.first..].partition_point(|s| s - begin_s < self.next_s);
        // Border windows of one window do not touch.
        let taken = match &self.left {
            End::Section(_) | End::TakenOver(_) => 2,
            End::Border { spans, .. } => *spans,
        };
        let border = self.first + due.max(taken + 2 * BORDER_SPANS).min(WINDOW_SPANS);
        let border_s = *self.at_s.get(border)?;
        // Enough behind it for its own window, and not for nothing.
        let knots = self.at_s.len() - 1;
        let behind_s = self.now_s() - border_s;
        if behind_s < 1.5 * overlap_s || knots < border + BORDER_SPANS + 2 {
            return None;
        }
        let low = self.at_s[..border].partition_point(|s| border_s - s > overlap_s);
        let low = low.min(border - BORDER_SPANS).max(self.first + taken + 1);
        let high = border + self.at_s[border..].partition_point(|s| s - border_s < overlap_s);
        let high = high
            .min(knots - 1)
            .min(border + WINDOW_SPANS / 4)
            .max(border + BORDER_SPANS);
        if !ended && knots < high + self.times.knotting.reach + 2 {
            return None;
        }
        let window = Window {
            grid: self.grid.part(self.first..border),
            sources: self.sources[self.first..border].to_vec(),
            feasible: feasible_profile(&self.grid, self.first..border, &self.times.knotting),
            left: std::mem::replace(
                &mut self.left,
                End::Border {
                    spans: high - border,
                    states: None,
                },
            ),
            right: End::Border {
                spans: border - low,
                states: None,
            },
        };
        let around = Border {
            job: Job {
                gap: BORDER_GAP,
                grid: self.grid.part(low..high),
                start: feasible_profile(&self.grid, low..high, &self.times.knotting),
            },
            before: border - low,
            behind: self.sources[border..high].to_vec(),
        };
        self.first = border;
        // What is before the border matters for the feasible profile only. What is left moves to the front, which is worth it only
        // where it is the smaller part.
        let drop = border.saturating_sub(self.times.knotting.reach + 2);
        if 2 * drop > knots {
            self.grid.drop_front(drop);
            self.sources.drain(..drop);
            self.at_s.drain(..drop);
            self.first -= drop;
        }
        self.next_s = self.times.window_s;
        Some((window, around))
    }

    /// The last window, which ends in this state. The section has ended, and [`Uncut::cut`] finds no more borders.
    pub(super) fn last(self, end: State) -> Window {
        let knots = self.sources.len();
        Window {
            grid: self.grid.part(self.first..knots),
            feasible: feasible_profile(&self.grid, self.first..knots, &self.times.knotting),
            sources: self.sources[self.first..].to_vec(),
            left: self.left,
            right: End::Section(end),
        }
    }
}
