//! Look-ahead of squared speeds, on plain arrays: serial, and in overlapping buffers on several threads.
//!
//! In:  elements of the path: length, acceleration, feed, corner speed at the end; rest before the first and behind the last.
//! Out: b = v² at each node (element border) so that every element can be run with its acceleration.
//!
//! With `cap_i = min(corner, feed of both neighbours)²` and `gain_i = 2 a_i L_i`:
//!
//! ```text
//! backward   b_i     = min(cap_i,   b_i+1 + gain_i)      from the end: the machine can brake in time
//! forward    c_i+1   = min(b_i+1,   c_i   + gain_i)      from the start, the backward result as its caps
//! ```
//!
//! # Equal to the serial result, bit for bit
//!
//! [`Buffers`] run each chunk of nodes on its own, with an overlap on both sides and the boundary value 0 beyond it.
//! Why its nodes carry the same bits as in [`serial`]:
//!
//! 1. Rounding to nearest is monotone, so x <= y gives fl(x + g) <= fl(y + g), and so min(cap, fl(x + g)) is monotone, too;
//!    a pass is a composition of such maps. 0 is never more than the true boundary value, so that no b of the chunk is more
//!    than the true one.
//! 2. Where a node *m* takes its cap all the same, the true value lies between it and the cap: it is the cap. From *m* on,
//!    away from the boundary, both passes compute the same expressions on equal numbers.
//! 3. So one such node in the right overlap (or the last node of the chunk) is a certificate for the backward pass over the
//!    chunk and its left overlap; the same with left and right changed, and b for the caps, for the forward pass.
//! 4. The overlap on the left is at least what its elements ask for: b gains 2aL per element from 0, so that the cap at the
//!    border of the chunk is met where the gains of the overlap sum up to it, the braking length. On the right, where too
//!    little shows at once, this is looked for only without a certificate, and the chunk done again. Should rounding still leave no certificate, the overlap is doubled. One that reaches the end of the
//!    path needs none. Where it would become several times the chunk, the chunk is left to the caller, who does it with the
//!    boundary values of its neighbours, as the serial pass would.
//!
//! All numbers are at least +0 (what is not, counts as 0), so that neither NaN nor -0 can tell apart what compares equal. An
//! overlap of length v²/2a always has a certificate: from 0 the pass gains 2aL per element and must meet a cap before.
//!
//! The certificate is also the rule of what is final in a stream, with rest assumed behind what is known: [`settled`].

use std::cell::Cell;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::plan::workers::{JobPanicked, Workers};

/// A stretch of path with limits of its own.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Element {
    /// Length along the path, mm.
    pub length: f64,
    /// Greatest acceleration along it, mm/s².
    pub acceleration: f64,
    /// Greatest speed along it, mm/s.
    pub feed: f64,
    /// Greatest speed at its end, mm/s.
    pub corner: f64,
}

impl Element {
    /// What b can change by along it.
    fn gain(&self) -> f64 {
        positive(2.0 * self.acceleration * self.length)
    }
}

/// `x`, or 0 where it is negative or none at all.
fn positive(x: f64) -> f64 {
    if x > 0.0 { x } else { 0.0 }
}

fn least(x: f64, y: f64) -> f64 {
    if x < y { x } else { y }
}

/// Greatest b at the border of two elements.
fn cap(before: &Element, after: &Element) -> f64 {
    let speed = least(
        positive(before.corner),
        least(positive(before.feed), positive(after.feed)),
    );
    speed * speed
}

/// Where a pass over a part of the nodes begins.
#[derive(Clone, Copy, Debug)]
enum Beyond {
    /// The path ends at rest here.
    Rest,
    /// b at the next node outside.
    Node(f64),
}

/// Backward pass over `nodes`, appended to `b` in falling order. Returns the least node of `certificates` that took its cap.
fn backward(
    elements: &[Element],
    nodes: Range<usize>,
    beyond: Beyond,
    certificates: usize,
    b: &mut Vec<f64>,
) -> Option<usize> {
    let mut nodes = nodes.rev();
    let mut found = None;
    let mut next = match beyond {
        Beyond::Node(next) => next,
        Beyond::Rest => {
            b.extend(nodes.next().map(|_| 0.0));
            0.0
        }
    };
    for node in nodes {
        next = if node == 0 {
            0.0
        } else {
            let cap = cap(&elements[node - 1], &elements[node]);
            let reached = next + elements[node].gain();
            if node >= certificates && cap <= reached {
                found = Some(node);
            }
            least(cap, reached)
        };
        b.push(next);
    }
    found
}

/// Forward pass over nodes from `first` on, in place; `b` holds the backward result in rising order. Returns the greatest
/// node up to `certificates` that took its cap.
fn forward(elements: &[Element], first: usize, beyond: Beyond, certificates: usize, b: &mut [f64]) -> Option<usize> {
    let mut found = None;
    let mut last = match beyond {
        Beyond::Rest => 0.0,
        Beyond::Node(last) => last,
    };
    for (node, b) in (first..).zip(b) {
        if node > 0 {
            let reached = last + elements[node - 1].gain();
            if node <= certificates && *b <= reached {
                found = Some(node);
            }
            *b = least(*b, reached);
        }
        last = *b;
    }
    found
}

/// Puts b at all nodes, one more than elements, into `b`.
pub fn serial(elements: &[Element], b: &mut Vec<f64>) {
    let nodes = elements.len() + 1;
    b.clear();
    b.reserve(nodes);
    backward(elements, 0..nodes, Beyond::Rest, nodes, b);
    b.reverse();
    forward(elements, 0, Beyond::Rest, 0, b);
}

/// The first node whose speed may still rise when more elements follow: all before it are final. Rest is assumed behind the
/// last element, and the last node is never final.
pub fn settled(elements: &[Element]) -> usize {
    let nodes = elements.len() + 1;
    // Only as much of the backward pass as is needed to find the last node that takes its cap.
    let mut next = 0.0;
    for node in (1..nodes.saturating_sub(1)).rev() {
        let cap = cap(&elements[node - 1], &elements[node]);
        next += elements[node].gain();
        if cap <= next {
            return node + 1;
        }
    }
    // The first stands still.
    usize::from(nodes > 1)
}

/// How one chunk came to its certificates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Chunk {
    /// Nodes before the chunk up to the nearest certificate of the forward pass.
    pub left: usize,
    /// Nodes behind the chunk up to the nearest certificate of the backward pass.
    pub right: usize,
    /// How often it was done again with a larger overlap.
    pub redone: u32,
    /// Whether the overlap became too large, so that it was done with the boundary values of its neighbours.
    pub handed_back: bool,
}

/// An overlap of more than so many chunks is not worth it.
const OVERLAP_CHUNKS: usize = 4;

/// The same as [`serial`] in chunks with overlap, on all threads. Keeps its memory from call to call.
#[derive(Debug)]
pub struct Buffers {
    workers: Workers,
    chunk: usize,
    overlap: usize,
    nodes: usize,
    /// b at the nodes, and at some more from an earlier call. Jobs write to it: each to nodes of its own.
    bits: Arc<[AtomicU64]>,
    chunks: Vec<Chunk>,
}

impl Buffers {
    /// Chunks of `chunk` nodes (at least 1) with `overlap` more on both sides.
    pub fn new(chunk: usize, overlap: usize, workers: &Workers) -> Buffers {
        Buffers {
            workers: workers.clone(),
            chunk: chunk.max(1),
            overlap,
            nodes: 0,
            bits: Arc::new([]),
            chunks: Vec::new(),
        }
    }

    /// Looks ahead over a path.
    ///
    /// # Errors
    /// If a job fails by a defect.
    pub fn run(&mut self, elements: &Arc<[Element]>) -> Result<(), JobPanicked> {
        self.nodes = elements.len() + 1;
        if self.bits.len() < self.nodes {
            self.bits = (0..self.nodes).map(|_| AtomicU64::new(0)).collect();
        }
        let (nodes, chunk, overlap) = (self.nodes, self.chunk.min(self.nodes), self.overlap);
        let range = move |number: usize| number * chunk..((number + 1) * chunk).min(nodes);
        let (shared, bits) = (Arc::clone(elements), Arc::clone(&self.bits));
        let mut done = self.workers.run(nodes.div_ceil(chunk), move |number| {
            let own = range(number);
            alone(&shared, own.clone(), overlap, &bits[own])
        })?;
        self.hand_back(elements, &mut done, range);
        self.chunks = done.into_iter().map(|done| done.chunk).collect();
        Ok(())
    }

    /// b at all nodes, one more than elements.
    pub fn b(&self) -> impl ExactSizeIterator<Item = f64> + '_ {
        self.bits[..self.nodes].iter().map(load)
    }

    /// What each chunk needed.
    pub fn chunks(&self) -> &[Chunk] {
        &self.chunks
    }

    /// Does what no reasonable overlap was enough for, from the values of the neighbours.
    fn hand_back(&self, elements: &[Element], done: &mut [Done], range: impl Fn(usize) -> Range<usize>) {
        let mut b = Vec::new();
        for number in (0..done.len()).rev() {
            if !done[number].chunk.handed_back {
                continue;
            }
            let after = done.get(number + 1);
            let beyond = after.map_or(Beyond::Rest, |after| Beyond::Node(after.first));
            b.clear();
            backward(elements, range(number), beyond, usize::MAX, &mut b);
            b.reverse();
            store(&b, &self.bits[range(number)]);
            done[number].first = b[0];
        }
        for number in (0..done.len()).filter(|number| done[*number].chunk.handed_back) {
            let own = range(number);
            b.clear();
            b.extend(self.bits[own.clone()].iter().map(load));
            let beyond = match own.start {
                0 => Beyond::Rest,
                start => Beyond::Node(load(&self.bits[start - 1])),
            };
            forward(elements, own.start, beyond, 0, &mut b);
            store(&b, &self.bits[own]);
        }
    }
}

fn load(bits: &AtomicU64) -> f64 {
    f64::from_bits(bits.load(Ordering::Relaxed))
}

fn store(b: &[f64], bits: &[AtomicU64]) {
    for (b, bits) in b.iter().zip(bits) {
        bits.store(b.to_bits(), Ordering::Relaxed);
    }
}

/// What is left to tell of a chunk.
#[derive(Clone, Copy, Debug)]
struct Done {
    chunk: Chunk,
    /// Backward result at its first node.
    first: f64,
}

/// How many of these elements b needs to gain what it may be at node `node`.
fn needed<'a>(elements: &[Element], node: usize, mut beyond: impl Iterator<Item = &'a Element>, most: usize) -> usize {
    let (Some(before), Some(after)) = (node.checked_sub(1).and_then(|k| elements.get(k)), elements.get(node)) else {
        return 0;
    };
    let cap = cap(before, after);
    let mut gained = 0.0;
    let mut count = 0;
    while gained < cap && count < most {
        let Some(element) = beyond.next() else { break };
        gained += element.gain();
        count += 1;
    }
    // One more for rounding.
    (count + 1).min(most)
}

thread_local! {
    /// b of the chunk that a thread is at: memory that is kept from chunk to chunk.
    static B: Cell<Vec<f64>> = const { Cell::new(Vec::new()) };
}

/// Does a chunk without knowing its neighbours.
fn alone(elements: &[Element], own: Range<usize>, overlap: usize, bits: &[AtomicU64]) -> Done {
    let nodes = elements.len() + 1;
    let mut chunk = Chunk::default();
    let mut b = B.take();
    let most = OVERLAP_CHUNKS.saturating_mul(own.len()).max(overlap);
    // Too little on the left would show only after all of the work, and too little on the right at once.
    let before = elements[..own.start].iter().rev();
    let (mut left, mut right) = (needed(elements, own.start, before, most).max(overlap), overlap);
    while left <= most && right <= most {
        let outer = own.start.saturating_sub(left)..own.end.saturating_add(right).min(nodes);
        b.clear();
        b.reserve(outer.len());
        // The overlap first: without a certificate in it, the rest would be in vain.
        let last = own.end - 1;
        let beyond = match outer.end == nodes {
            true => Beyond::Rest,
            false => Beyond::Node(0.0),
        };
        let found = backward(elements, last..outer.end, beyond, last, &mut b);
        if outer.end < nodes && found.is_none() {
            let twice = right.saturating_mul(2).max(1);
            right = needed(elements, last, elements[last..].iter(), most).max(twice);
            chunk.redone += 1;
            continue;
        }
        chunk.right = found.unwrap_or(nodes - 1) - last;
        let next = Beyond::Node(b.last().copied().unwrap_or(0.0));
        backward(elements, outer.start..last, next, nodes, &mut b);
        b.reverse();
        let first = b[own.start - outer.start];
        b.truncate(own.end - outer.start);
        let beyond = match outer.start == 0 {
            true => Beyond::Rest,
            false => Beyond::Node(0.0),
        };
        let found = forward(elements, outer.start, beyond, own.start, &mut b);
        if outer.start > 0 && found.is_none() {
            left = left.saturating_mul(2).max(1);
            chunk.redone += 1;
            continue;
        }
        chunk.left = own.start - found.unwrap_or(0);
        store(&b[own.start - outer.start..], bits);
        B.set(b);
        return Done { chunk, first };
    }
    B.set(b);
    chunk.handed_back = true;
    Done { chunk, first: 0.0 }
}

#[cfg(test)]
mod tests;
