//! Look-ahead in overlapping buffers on several threads.
//!
//! In:  runs, one behind the other.
//! Out: what the passes over them will compute, computed ahead: for each run the speed before it from that behind it, and its
//! motion from the speed before it.
//!
//! A buffer knows neither the speed behind it nor that before it, which its neighbours find out at the same time. So it begins at
//! rest, an overlap further out: where braking takes no longer than the overlap, it comes to the true speeds before it comes to
//! its own runs. Nobody has to rely on that. With each result stands the speed that it was computed from, and the pass takes the
//! result only where that is its own speed, bit for bit; elsewhere it computes again, from the right speed, until both agree.
//! So what comes out is what one thread computes, whatever the buffers and overlaps are.

use std::cell::Cell;
use std::ops::Range;
use std::sync::Arc;

use super::runs::Run;
use crate::element::Element;
use crate::plan::Settings;
use crate::plan::profile::{brakeable, end_speed};
use crate::plan::workers::Workers;

/// Runs, and rests between them.
pub(super) type Runs = Arc<[Option<Arc<Run>>]>;

/// Greatest speed between two runs; at a rest, 0.
pub(super) fn cap(run: Option<&Run>, next: Option<&Run>) -> f64 {
    match (run, next) {
        (Some(run), Some(next)) => run.limits.v.min(next.limits.v),
        _ => 0.0,
    }
}

/// Greatest speed between a run and the one before it if `after` is that at its end.
pub(super) fn before(last: Option<&Run>, run: Option<&Run>, after: f64) -> f64 {
    match (last, run) {
        (Some(_), Some(run)) => brakeable(after, cap(last, Some(run)), run.length, &run.limits),
        _ => 0.0,
    }
}

/// Speed before a run, and that behind it from which it was computed.
type Speeds = [f64; 2];

/// Motion along a run.
#[derive(Debug)]
pub(super) struct Motion {
    /// Speeds that it was computed from: before the run, and the greatest at its end.
    from: [f64; 2],
    /// Speed at its end.
    pub(super) after: f64,
    pub(super) elements: Vec<Element>,
}

/// What was computed ahead of the passes over one run.
#[derive(Debug, Default)]
pub(super) struct Ahead {
    speeds: Option<Speeds>,
    motion: Option<Motion>,
}

impl Ahead {
    pub(super) fn set_speeds(&mut self, speeds: Speeds) {
        self.speeds = Some(speeds);
    }

    pub(super) fn set_motion(&mut self, motion: Option<Motion>) {
        self.motion = motion;
    }

    /// Whether a speed before it, and motion along it, were computed ahead.
    pub(super) fn has(&self) -> [bool; 2] {
        [self.speeds.is_some(), self.motion.is_some()]
    }

    /// Speed before it, where it was computed from this one behind it.
    pub(super) fn before(&self, after: f64) -> Option<f64> {
        let [before, from] = self.speeds?;
        (from.to_bits() == after.to_bits()).then_some(before)
    }

    /// Motion along it, where it was computed from these speeds.
    pub(super) fn motion(&self, before: f64, end: Option<f64>) -> Option<&Motion> {
        let speeds = [before, end?].map(f64::to_bits);
        self.motion
            .as_ref()
            .filter(|motion| motion.from.map(f64::to_bits) == speeds)
    }
}

/// Computes buffers.
#[derive(Debug)]
pub(super) struct Buffers {
    workers: Workers,
    /// Pieces of a buffer, and of an overlap.
    buffer: usize,
    overlap: usize,
    /// Results that passes took, and those that they had to compute again.
    counts: Cell<[u64; 2]>,
}

impl Buffers {
    pub(super) fn new(settings: &Settings, workers: &Workers) -> Buffers {
        Buffers {
            workers: workers.clone(),
            buffer: settings.look_ahead_buffer_blocks.max(1),
            overlap: settings.look_ahead_overlap_blocks,
            counts: Cell::new([0; 2]),
        }
    }

    /// Counts a result that was computed ahead by whether a pass could take it.
    pub(super) fn counted<T>(&self, computed: bool, result: Option<T>) -> Option<T> {
        let mut counts = self.counts.get();
        counts[usize::from(result.is_none())] += u64::from(computed);
        self.counts.set(counts);
        result
    }

    /// Results that passes took, and those that they had to compute again.
    pub(super) fn counts(&self) -> [u64; 2] {
        self.counts.get()
    }

    /// Pieces whose motion is computed at once: some buffers for every thread, as it takes memory until it is handed over.
    pub(super) fn pieces_at_once(&self) -> usize {
        self.buffer.saturating_mul(2 * (self.workers.threads() + 1))
    }

    /// Whether runs of so many pieces are more than one buffer, and there are threads to compute them.
    pub(super) fn are_worth_it(&self, pieces: &mut dyn Iterator<Item = usize>) -> bool {
        self.workers.threads() > 0 && pieces.sum::<usize>() > self.buffer
    }

    /// The speeds of the backward pass over a path that ends at rest.
    pub(super) fn speeds(&self, path: &Runs) -> Vec<Speeds> {
        self.in_buffers(path, |path, own, overlap| {
            let end = reach(path, own.end, overlap);
            let mut after = 0.0;
            let mut speeds = Vec::with_capacity(own.len());
            for i in (own.start..end).rev() {
                let last = i.checked_sub(1).and_then(|i| path[i].as_deref());
                let before = before(last, path[i].as_deref(), after);
                if i < own.end {
                    speeds.push([before, after]);
                }
                after = before;
            }
            speeds.reverse();
            speeds
        })
    }

    /// The motion along a path that begins with `speed`; `ends`: greatest speeds at the ends of the runs.
    pub(super) fn motion(&self, path: &Runs, ends: Arc<[f64]>, speed: f64) -> Vec<Option<Motion>> {
        self.in_buffers(path, move |path, own, overlap| {
            let start = reach_back(path, own.start, overlap);
            let mut before = if start == 0 { speed } else { 0.0 };
            let mut motion = Vec::with_capacity(own.len());
            for i in start..own.end {
                let Some(run) = &path[i] else {
                    before = 0.0;
                    if i >= own.start {
                        motion.push(None);
                    }
                    continue;
                };
                let after = end_speed(before, ends[i], run.length, &run.limits);
                if i >= own.start {
                    let mut elements = Vec::new();
                    run.spans(before, after, &mut elements);
                    motion.push(Some(Motion {
                        from: [before, ends[i]],
                        after,
                        elements,
                    }));
                }
                before = after;
            }
            motion
        })
    }

    /// Does `job` for each buffer; nothing comes of those that fail by a defect, and of what is behind them.
    fn in_buffers<Out: Send + 'static>(
        &self,
        path: &Runs,
        job: impl Fn(&Runs, Range<usize>, usize) -> Vec<Out> + Send + Sync + 'static,
    ) -> Vec<Out> {
        let mut borders = vec![0];
        let mut pieces = 0;
        for (i, run) in path.iter().enumerate() {
            pieces += pieces_of(run.as_ref());
            if pieces >= self.buffer {
                borders.push(i + 1);
                pieces = 0;
            }
        }
        if borders.last() != Some(&path.len()) {
            borders.push(path.len());
        }
        let (count, path, overlap) = (borders.len() - 1, Arc::clone(path), self.overlap);
        let buffers = self.workers.run(count, move |number| {
            job(&path, borders[number]..borders[number + 1], overlap)
        });
        buffers.unwrap_or_default().into_iter().flatten().collect()
    }
}

fn pieces_of(run: Option<&Arc<Run>>) -> usize {
    run.map_or(0, |run| run.pieces())
}

/// Where an overlap of so many pieces ends that begins at `from`.
fn reach(path: &Runs, from: usize, overlap: usize) -> usize {
    let mut pieces = 0;
    let within = path[from..].iter().take_while(|run| {
        let within = pieces < overlap;
        pieces += pieces_of(run.as_ref());
        within
    });
    from + within.count()
}

/// Where an overlap of so many pieces begins that ends at `to`.
fn reach_back(path: &Runs, to: usize, overlap: usize) -> usize {
    let mut pieces = 0;
    let within = path[..to].iter().rev().take_while(|run| {
        let within = pieces < overlap;
        pieces += pieces_of(run.as_ref());
        within
    });
    to - within.count()
}

#[cfg(test)]
mod tests;
