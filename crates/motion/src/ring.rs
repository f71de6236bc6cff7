//! The border to real time: a ring of elements of which the visible part always ends at rest.
//!
//! In:  from the planner, publications: *committed* elements, final, followed by a *tail*, a planned stop at rest.
//! Out: to the cycle thread, one element after the other, without ever waiting.
//!
//! Every element carries one atomic word that says what follows it: the next slot, another slot, or nothing. A
//! publication is written behind everything else and then linked to the last committed element by one
//! compare-exchange, in place of the tail that followed it. The consumer marks an element as passed by one swap, which
//! also tells where to go. So either the consumer sees the new publication as a whole, or it is in the tail already;
//! then the planner learns so ([`Publish::TailTaken`]) and plans on from the rest at the end of that tail. Whoever is
//! slow makes the machine stop as planned; neither side waits, and nothing is ever half seen.
//!
//! A publication may also take the place of motion that was final so far, behind any element that the consumer has not
//! passed ([`Sink::publish_after`]): that is how an override changes the speed. Then either the consumer goes over to the
//! new motion at the end of that element, or it has passed it and the old plan stays ([`Publish::Passed`]).
//!
//! Slots have memory where there are elements that the consumer has not passed: the producer takes it by the chunk, and uses a
//! chunk again once the consumer is beyond it. So the room of a ring costs nothing until it is needed.
//!
//! RT: [`Consumer`] does not allocate, lock or loop. Memory is allocated by [`channel`] and [`Producer`] only.

use std::cell::UnsafeCell;
use std::mem::MaybeUninit;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// What an element is for the ring: something that takes time.
pub trait Timed: Copy {
    /// Seconds from its beginning to its end at full speed.
    fn duration_s(&self) -> f64;
}

/// Result of a publication.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Publish {
    /// The consumer will find it, or has found it already.
    Done,
    /// The ring has not enough free slots yet; nothing was taken.
    Full,
    /// The consumer runs down the last tail; nothing was taken. The next publication begins at rest at its end.
    TailTaken,
    /// The consumer has passed the element behind which it was meant; nothing was taken, and the old plan stays.
    Passed,
}

/// Where a planner hands in what it planned.
pub trait Sink<T> {
    /// Elements that a publication may have now.
    fn free(&self) -> usize;

    /// Hands in elements that are final and the planned stop behind them, which the next publication replaces. With an
    /// empty tail, the last committed element must end at rest. Not both may be empty.
    fn publish(&mut self, committed: &[T], tail: &[T]) -> Publish;

    /// Whether a publication of so many elements is to wait: there is no room for it, or the consumer has enough ahead of it. To be
    /// asked before one is put together.
    fn is_full(&self, count: usize) -> bool {
        self.free() < count
    }

    /// Number that the first element of the next publication gets; the others follow, those of the tail as well.
    fn next_number(&self) -> u64 {
        0
    }

    /// Number of the element that the consumer is at, or begins with. It may have moved on since. `None`: there is no
    /// consumer, and what was handed in is final.
    fn consumer_at(&self) -> Option<u64> {
        None
    }

    /// Seconds of final motion behind the element that the consumer is at; below 0 where it runs down a tail. `None`: there is no
    /// consumer.
    fn ahead_s(&self) -> Option<f64> {
        None
    }

    /// Seconds of everything handed in so far, without what was replaced. `None`: they are not counted.
    fn published_s(&self) -> Option<f64> {
        None
    }

    /// Hands in elements in place of all that follows the element of this number, which must be one that the consumer would
    /// come to or is at.
    fn publish_after(&mut self, _number: u64, _committed: &[T], _tail: &[T]) -> Publish {
        Publish::Passed
    }
}

/// What follows an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Next {
    /// The slot behind it.
    Sequel,
    /// Nothing yet: rest.
    End,
    /// The consumer has passed it.
    Passed,
    /// The slot of this number.
    Jump(u64),
}

impl Next {
    const SEQUEL: u64 = u64::MAX;
    const END: u64 = u64::MAX - 1;
    const PASSED: u64 = u64::MAX - 2;

    const fn word(self) -> u64 {
        match self {
            Next::Sequel => Next::SEQUEL,
            Next::End => Next::END,
            Next::Passed => Next::PASSED,
            Next::Jump(slot) => slot,
        }
    }

    const fn from_word(word: u64) -> Next {
        match word {
            Next::SEQUEL => Next::Sequel,
            Next::END => Next::End,
            Next::PASSED => Next::Passed,
            slot => Next::Jump(slot),
        }
    }
}

struct Slot<T> {
    element: UnsafeCell<MaybeUninit<T>>,
    next: AtomicU64,
}

impl<T> Slot<T> {
    fn empty() -> Slot<T> {
        Slot {
            element: UnsafeCell::new(MaybeUninit::uninit()),
            next: AtomicU64::new(Next::END),
        }
    }
}

/// Slots that lie side by side.
type Chunk<T> = Box<[Slot<T>]>;

/// Slots of a chunk at the most.
const CHUNK_MAX: usize = 512;
/// Chunks of a small ring.
const CHUNKS_MIN: usize = 8;
/// Final motion behind the element that the consumer is at, s, with which it has enough ahead of it: far more than the planner
/// ever takes for what comes next. More would only take memory, as much as the program is long.
const AHEAD_S: f64 = 10.0;

struct Shared<T> {
    /// Slots that may be in use; a power of two.
    capacity: usize,
    /// Slots of a chunk; a power of two.
    chunk: u64,
    /// Memory of the chunks in use; the others are empty. Twice as many as the capacity comes to, as the first one and the last
    /// one in use need not be so as a whole.
    chunks: Box<[UnsafeCell<Chunk<T>>]>,
    /// What follows the beginning, as if it were an element.
    first: AtomicU64,
    /// Number of the slot that the consumer is at; all before it are free.
    at: AtomicU64,
    /// Seconds of everything published, tails that were replaced left out; bits of an f64.
    published_s: AtomicU64,
    /// Seconds of all that the consumer has come to, the element that it is at counted as a whole; bits of an f64.
    passed_s: AtomicU64,
}

// SAFETY: an element is written by the producer only while no `next` word leads to its slot, and read by the consumer
// only after such a word was read with Acquire that the producer had written with Release. A slot is written again only
// after the consumer has moved `at` beyond it with Release. The same holds for the chunk in which a slot lies, which the
// producer puts in its place before it writes the first slot of it, and takes away after `at` has moved beyond the last one.
unsafe impl<T: Send> Sync for Shared<T> {}

impl<T> Shared<T> {
    /// Where the memory of a chunk lies, by its number.
    fn place(&self, chunk: u64) -> &UnsafeCell<Chunk<T>> {
        &self.chunks[(chunk & (self.chunks.len() as u64 - 1)) as usize]
    }

    /// A slot in use. RT.
    fn slot(&self, number: u64) -> &Slot<T> {
        // SAFETY: the producer changes a place only while no slot of its chunk is in use.
        let slots = unsafe { &*self.place(number / self.chunk).get() };
        &slots[(number & (self.chunk - 1)) as usize]
    }

    fn next_of(&self, number: Option<u64>) -> &AtomicU64 {
        number.map_or(&self.first, |number| &self.slot(number).next)
    }
}

/// The planner's end of a ring.
pub struct Producer<T> {
    shared: Arc<Shared<T>>,
    /// Number of the next slot to be written.
    write: u64,
    /// Last committed element; `None` before the first.
    anchor: Option<u64>,
    /// What the anchor's word was last set to.
    anchor_next: Next,
    /// Last element of the tail, if there is one.
    tail_end: Option<u64>,
    committed_s: f64,
    tail_s: f64,
    /// Chunks that have memory.
    held: Range<u64>,
    /// Memory of chunks that the consumer has passed.
    spare: Vec<Chunk<T>>,
}

/// The cycle thread's end of a ring.
pub struct Consumer<T> {
    shared: Arc<Shared<T>>,
    at: Option<u64>,
    passed_s: f64,
}

/// A ring of at least `capacity` elements.
pub fn channel<T: Timed + Send>(capacity: usize) -> (Producer<T>, Consumer<T>) {
    let capacity = capacity.max(2).next_power_of_two();
    let chunk = (capacity / CHUNKS_MIN).clamp(1, CHUNK_MAX);
    let shared = Arc::new(Shared {
        capacity,
        chunk: chunk as u64,
        chunks: (0..2 * capacity / chunk).map(|_| UnsafeCell::default()).collect(),
        first: AtomicU64::new(Next::END),
        at: AtomicU64::new(0),
        published_s: AtomicU64::new(0),
        passed_s: AtomicU64::new(0),
    });
    let producer = Producer {
        shared: Arc::clone(&shared),
        write: 0,
        anchor: None,
        anchor_next: Next::End,
        tail_end: None,
        committed_s: 0.0,
        tail_s: 0.0,
        held: 0..0,
        spare: Vec::new(),
    };
    let consumer = Consumer {
        shared,
        at: None,
        passed_s: 0.0,
    };
    (producer, consumer)
}

impl<T: Timed> Producer<T> {
    /// Elements that a publication may have while the consumer is at a slot.
    fn room(&self, at: u64) -> usize {
        self.shared.capacity - (self.write - at) as usize
    }

    /// Sees to it that the next slot to be written has memory. The consumer is at `at` or beyond.
    fn hold(&mut self, at: u64) {
        let chunk = self.write / self.shared.chunk;
        // What was written behind an element that had been passed is written again.
        if chunk < self.held.end {
            return;
        }
        let passed = self.held.start..(at / self.shared.chunk).min(self.held.end);
        for chunk in passed.clone() {
            // SAFETY: the consumer is beyond all slots of this chunk and this thread comes to none of them either, as its
            // anchor is not before `at`.
            self.spare
                .push(std::mem::take(unsafe { &mut *self.shared.place(chunk).get() }));
        }
        let memory = self.spare.pop();
        let memory = memory.unwrap_or_else(|| (0..self.shared.chunk).map(|_| Slot::empty()).collect());
        // SAFETY: no word leads to a slot of this chunk yet; the chunk that had its place was at least the capacity before it.
        unsafe { *self.shared.place(chunk).get() = memory };
        self.held = passed.end..chunk + 1;
    }

    fn put(&mut self, element: T, next: Next) {
        let slot = self.shared.slot(self.write);
        // SAFETY: `write_all` has checked that the consumer is beyond this slot, and no word leads to it yet.
        unsafe { (*slot.element.get()).write(element) };
        slot.next.store(next.word(), Ordering::Relaxed);
        self.write += 1;
    }

    /// Writes a publication behind everything else, where no word leads to it yet; gives the number of its first element,
    /// or `None` where there is no room. The consumer is at `at` or beyond.
    fn write_all(&mut self, at: u64, committed: &[T], tail: &[T]) -> Option<u64> {
        let count = committed.len() + tail.len();
        assert!(count > 0, "a publication has elements");
        assert!(
            count <= self.shared.capacity,
            "a publication of {count} elements never fits the ring"
        );
        if count > self.room(at) {
            return None;
        }
        let begin = self.write;
        for (place, &element) in committed.iter().chain(tail).enumerate() {
            self.hold(at);
            self.put(element, if place + 1 == count { Next::End } else { Next::Sequel });
        }
        Some(begin)
    }

    /// Keeps in mind what has been linked to the anchor.
    fn linked(&mut self, begin: u64, committed: &[T], tail: &[T]) {
        self.committed_s += committed.iter().map(Timed::duration_s).sum::<f64>();
        self.tail_s = tail.iter().map(Timed::duration_s).sum();
        self.shared
            .published_s
            .store((self.committed_s + self.tail_s).to_bits(), Ordering::Relaxed);
        if committed.is_empty() {
            self.anchor_next = Next::Jump(begin);
        } else {
            self.anchor = Some(begin + committed.len() as u64 - 1);
            self.anchor_next = if tail.is_empty() { Next::End } else { Next::Sequel };
        }
        self.tail_end = (!tail.is_empty()).then_some(self.write - 1);
    }

    /// The consumer has passed the anchor into the tail, so that the tail is what happens.
    fn tail_taken(&mut self) -> Publish {
        self.anchor = self.tail_end.take();
        self.anchor_next = Next::End;
        self.committed_s += std::mem::take(&mut self.tail_s);
        Publish::TailTaken
    }

    /// Seconds of all that would follow an element.
    fn seconds_behind(&self, mut number: u64) -> f64 {
        let mut seconds = 0.0;
        for _ in 0..self.shared.capacity {
            number = match Next::from_word(self.shared.slot(number).next.load(Ordering::Relaxed)) {
                Next::Sequel => number + 1,
                Next::Jump(to) => to,
                Next::End | Next::Passed => break,
            };
            // SAFETY: this thread has written the element, and no other thread ever writes one.
            let element = unsafe { (*self.shared.slot(number).element.get()).assume_init() };
            seconds += element.duration_s();
        }
        seconds
    }
}

impl<T: Timed> Sink<T> for Producer<T> {
    fn free(&self) -> usize {
        self.room(self.shared.at.load(Ordering::Acquire))
    }

    fn is_full(&self, count: usize) -> bool {
        let at = self.shared.at.load(Ordering::Acquire);
        // Where the tail has been taken, a publication is to hear of it.
        self.anchor.is_none_or(|anchor| anchor >= at) && (self.room(at) < count || self.ahead_s() > Some(AHEAD_S))
    }

    fn publish(&mut self, committed: &[T], tail: &[T]) -> Publish {
        let at = self.shared.at.load(Ordering::Acquire);
        if self.anchor.is_some_and(|anchor| anchor < at) {
            return self.tail_taken();
        }
        let Some(begin) = self.write_all(at, committed, tail) else {
            return Publish::Full;
        };
        let link = self.shared.next_of(self.anchor).compare_exchange(
            self.anchor_next.word(),
            Next::Jump(begin).word(),
            Ordering::Release,
            Ordering::Relaxed,
        );
        if link.is_err() {
            self.write = begin;
            return self.tail_taken();
        }
        self.linked(begin, committed, tail);
        Publish::Done
    }

    fn next_number(&self) -> u64 {
        self.write
    }

    fn consumer_at(&self) -> Option<u64> {
        Some(self.shared.at.load(Ordering::Acquire))
    }

    fn ahead_s(&self) -> Option<f64> {
        Some(self.committed_s - f64::from_bits(self.shared.passed_s.load(Ordering::Relaxed)))
    }

    fn published_s(&self) -> Option<f64> {
        Some(self.committed_s + self.tail_s)
    }

    fn publish_after(&mut self, number: u64, committed: &[T], tail: &[T]) -> Publish {
        assert!(number < self.write, "element {number} has never been published");
        let at = self.shared.at.load(Ordering::Acquire);
        if number < at {
            return Publish::Passed;
        }
        // Only this thread writes a word that is not `Passed`, so what is read here is what the exchange finds.
        let before = self.shared.slot(number).next.load(Ordering::Relaxed);
        if Next::from_word(before) == Next::Passed {
            return Publish::Passed;
        }
        let replaced_s = self.seconds_behind(number);
        let Some(begin) = self.write_all(at, committed, tail) else {
            return Publish::Full;
        };
        let link = self.shared.slot(number).next.compare_exchange(
            before,
            Next::Jump(begin).word(),
            Ordering::Release,
            Ordering::Relaxed,
        );
        if link.is_err() {
            self.write = begin;
            return Publish::Passed;
        }
        self.committed_s += std::mem::take(&mut self.tail_s) - replaced_s;
        self.anchor = Some(number);
        self.linked(begin, committed, tail);
        Publish::Done
    }
}

impl<T: Timed> Consumer<T> {
    /// Moves on to what follows and returns it; `None` where nothing follows yet, which is only ever at rest. RT.
    pub fn advance(&mut self) -> Option<T> {
        let word = self.shared.next_of(self.at);
        if Next::from_word(word.load(Ordering::Acquire)) == Next::End {
            return None;
        }
        let number = match Next::from_word(word.swap(Next::Passed.word(), Ordering::AcqRel)) {
            Next::Jump(number) => number,
            // Only a slot has a sequel, so there is a number; and no other thread passes an element.
            Next::Sequel | Next::Passed | Next::End => self.at.map_or(0, |at| at + 1),
        };
        self.at = Some(number);
        // SAFETY: a word that was written with Release after the element led here, and the producer leaves the slot
        // alone until `at` is beyond it.
        let element = unsafe { (*self.shared.slot(number).element.get()).assume_init() };
        self.passed_s += element.duration_s();
        self.shared.passed_s.store(self.passed_s.to_bits(), Ordering::Relaxed);
        self.shared.at.store(number, Ordering::Release);
        Some(element)
    }

    /// What follows, as things are now, without moving on: all of it may be replaced before it is reached. RT.
    pub fn ahead(&self) -> Ahead<'_, T> {
        Ahead {
            consumer: self,
            at: self.at,
        }
    }

    /// Seconds of everything published so far, tails that were replaced left out. RT.
    pub fn published_s(&self) -> f64 {
        f64::from_bits(self.shared.published_s.load(Ordering::Relaxed))
    }
}

/// A look at what a consumer would come to; see [`Consumer::ahead`].
#[derive(Debug)]
pub struct Ahead<'a, T> {
    consumer: &'a Consumer<T>,
    at: Option<u64>,
}

impl<'a, T> Iterator for Ahead<'a, T> {
    type Item = &'a T;

    fn next(&mut self) -> Option<&'a T> {
        let shared = &self.consumer.shared;
        let number = match Next::from_word(shared.next_of(self.at).load(Ordering::Acquire)) {
            Next::Jump(number) => number,
            Next::Sequel => self.at.map_or(0, |at| at + 1),
            // Only what lies before the consumer has been passed.
            Next::End | Next::Passed => return None,
        };
        self.at = Some(number);
        // SAFETY: a word that was written with Release after the element led here. The producer leaves the slot alone until the
        // consumer is beyond it, and that is borrowed; a slot that was replaced keeps its element until then as well.
        Some(unsafe { (*shared.slot(number).element.get()).assume_init_ref() })
    }
}

impl<T> std::fmt::Debug for Producer<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Producer")
            .field("write", &self.write)
            .field("anchor", &self.anchor)
            .finish_non_exhaustive()
    }
}

impl<T> std::fmt::Debug for Consumer<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Consumer").field("at", &self.at).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::VecDeque;

    /// Moves from one number to the next; a tail ends in an element marked as rest.
    #[derive(Clone, Copy, Debug, PartialEq)]
    struct Step {
        from: u64,
        to: u64,
        rests: bool,
    }

    impl Timed for Step {
        fn duration_s(&self) -> f64 {
            1.0
        }
    }

    const fn step(from: u64, rests: bool) -> Step {
        Step {
            from,
            to: from + 1,
            rests,
        }
    }

    #[test]
    fn a_new_publication_takes_the_place_of_the_tail() {
        let (mut producer, mut consumer) = channel(8);
        assert_eq!(consumer.advance(), None);
        assert_eq!(producer.publish(&[step(0, false)], &[step(1, true)]), Publish::Done);
        assert_eq!(consumer.advance(), Some(step(0, false)));
        assert_eq!(producer.publish(&[step(1, false)], &[step(2, true)]), Publish::Done);
        assert_eq!(consumer.advance(), Some(step(1, false)));
        assert_eq!(consumer.advance(), Some(step(2, true)));
        assert_eq!(consumer.advance(), None);
    }

    #[test]
    fn what_lies_ahead_can_be_seen_and_replaced() {
        let (mut producer, mut consumer) = channel(16);
        let seen = |consumer: &Consumer<Step>| consumer.ahead().copied().collect::<Vec<_>>();
        assert_eq!(seen(&consumer), []);
        producer.publish(&[step(0, false), step(1, false)], &[step(2, true)]);
        assert_eq!(seen(&consumer), [step(0, false), step(1, false), step(2, true)]);
        consumer.advance();
        producer.publish(&[step(2, false)], &[step(3, true)]);
        assert_eq!(seen(&consumer), [step(1, false), step(2, false), step(3, true)]);
        assert_eq!(producer.publish_after(1, &[step(2, true)], &[]), Publish::Done);
        assert_eq!(seen(&consumer), [step(1, false), step(2, true)]);
        consumer.advance();
        consumer.advance();
        assert_eq!(seen(&consumer), []);
    }

    #[test]
    fn too_late_is_told_and_the_way_goes_on_from_the_rest() {
        let (mut producer, mut consumer) = channel(8);
        producer.publish(&[step(0, false)], &[step(1, true)]);
        consumer.advance();
        consumer.advance();
        assert_eq!(
            producer.publish(&[step(1, false)], &[step(2, true)]),
            Publish::TailTaken
        );
        assert_eq!(consumer.advance(), None);
        assert_eq!(producer.publish(&[step(2, true)], &[]), Publish::Done);
        assert_eq!(consumer.advance(), Some(step(2, true)));
        assert_eq!(consumer.advance(), None);
    }

    #[test]
    fn a_tail_may_be_replaced_by_a_tail() {
        let (mut producer, mut consumer) = channel(8);
        producer.publish(&[step(0, false)], &[step(1, true)]);
        producer.publish(&[], &[step(1, false), step(2, true)]);
        producer.publish(&[], &[step(1, false), step(2, false), step(3, true)]);
        let seen: Vec<_> = std::iter::from_fn(|| consumer.advance()).collect();
        assert_eq!(seen, [step(0, false), step(1, false), step(2, false), step(3, true)]);
    }

    #[test]
    fn a_full_ring_takes_nothing_and_takes_it_later() {
        let (mut producer, mut consumer) = channel(4);
        producer.publish(&[step(0, false), step(1, false)], &[step(2, true)]);
        assert_eq!(producer.publish(&[step(2, false)], &[step(3, true)]), Publish::Full);
        consumer.advance();
        consumer.advance();
        assert_eq!(producer.publish(&[step(2, false)], &[step(3, true)]), Publish::Done);
        assert_eq!(consumer.advance(), Some(step(2, false)));
    }

    #[test]
    fn memory_is_taken_for_what_lies_ahead_and_used_again() {
        let (mut producer, mut consumer) = channel(1 << 16);
        let chunks =
            |producer: &Producer<Step>| (producer.held.end - producer.held.start) as usize + producer.spare.len();
        assert_eq!(chunks(&producer), 0);
        let steps = |from: u64, count: u64| (from..from + count).map(|from| step(from, false)).collect::<Vec<_>>();
        let mut number = 0;
        for _ in 0..1000 {
            producer.publish(&steps(number, 300), &[step(number + 300, true)]);
            number += 300;
            while consumer.at.is_none_or(|at| at + 2 < producer.write) {
                consumer.advance().unwrap();
            }
        }
        // Elements ahead lie in one chunk or in two.
        assert_eq!(chunks(&producer), 2);
        assert_eq!(
            producer.publish(&steps(number, 60_000), &[step(number, true)]),
            Publish::Done
        );
        assert_eq!(chunks(&producer), 60_000_usize.div_ceil(CHUNK_MAX) + 1);
    }

    #[test]
    fn a_consumer_that_has_enough_ahead_of_it_gets_no_more() {
        let (mut producer, mut consumer) = channel(64);
        let steps: Vec<_> = (0..11).map(|from| step(from, false)).collect();
        // The tail does not count: it may take any time to stop.
        producer.publish(&steps[..10], &[step(10, false), step(11, false), step(12, true)]);
        assert!(!producer.is_full(1));
        producer.publish(&steps[10..], &[step(11, true)]);
        assert!(producer.is_full(1));
        consumer.advance();
        assert!(!producer.is_full(1));
        assert!(producer.is_full(64));
        // A publication in place of final motion counts for what is left.
        producer.publish_after(4, &[step(5, true)], &[]);
        let steps: Vec<_> = (6..11).map(|from| step(from, true)).collect();
        producer.publish(&steps, &[]);
        assert!(!producer.is_full(1));
        producer.publish(&[step(11, true)], &[]);
        assert!(producer.is_full(1));
    }

    /// What a planner does: goes on from the last committed number, or from the rest if it came too late.
    struct Planner {
        producer: Producer<Step>,
        committed: u64,
        tail: u64,
    }

    impl Planner {
        fn offer(&mut self, count: u64) -> Publish {
            let committed: Vec<_> = (self.committed..self.committed + count)
                .map(|from| step(from, false))
                .collect();
            let tail = [
                step(self.committed + count, false),
                step(self.committed + count + 1, true),
            ];
            let result = self.producer.publish(&committed, &tail);
            match result {
                Publish::Done => {
                    self.committed += count;
                    self.tail = self.committed + 2;
                }
                Publish::TailTaken => self.committed = self.tail,
                Publish::Full | Publish::Passed => {}
            }
            result
        }
    }

    proptest! {
        /// Any order of offers and steps: the consumer walks without a gap and stops only at rest.
        #[test]
        fn the_way_has_no_gap(moves in prop::collection::vec((prop::bool::ANY, 0_u64..4), 1..200)) {
            let (producer, mut consumer) = channel(16);
            let mut planner = Planner { producer, committed: 0, tail: 0 };
            let (mut at, mut resting) = (0, true);
            for (offer, count) in moves {
                if offer {
                    planner.offer(count);
                } else {
                    match consumer.advance() {
                        Some(step) => {
                            prop_assert_eq!(step.from, at);
                            (at, resting) = (step.to, step.rests);
                        }
                        None => prop_assert!(resting),
                    }
                }
            }
        }
    }

    #[test]
    fn final_motion_can_be_replaced_behind_any_element_that_is_not_passed() {
        let (mut producer, mut consumer) = channel(16);
        producer.publish(&[step(0, false), step(1, false), step(2, false)], &[step(3, true)]);
        assert_eq!(consumer.advance(), Some(step(0, false)));
        assert_eq!(producer.consumer_at(), Some(0));
        assert_eq!((producer.next_number(), consumer.published_s()), (4, 4.0));
        assert_eq!(producer.publish_after(1, &[step(2, true)], &[]), Publish::Done);
        assert_eq!(consumer.published_s(), 3.0);
        assert_eq!(consumer.advance(), Some(step(1, false)));
        assert_eq!(consumer.advance(), Some(step(2, true)));
        assert_eq!(producer.publish_after(1, &[step(2, true)], &[]), Publish::Passed);
        assert_eq!(consumer.advance(), None);
        // At rest at the end of the last element, it is still behind that element that motion goes on.
        assert_eq!(producer.publish_after(4, &[step(3, true)], &[]), Publish::Done);
        assert_eq!(consumer.advance(), Some(step(3, true)));
    }

    proptest! {
        /// Any order of publications, replacements and steps, against what the consumer should find.
        #[test]
        fn replacements_leave_no_gap(
            moves in prop::collection::vec((0_u32..4, 0_u64..4, 0_usize..12), 1..300),
        ) {
            let (mut producer, mut consumer) = channel(32);
            // Numbers and steps that the consumer has not begun; how many of them are tail.
            let mut chain = VecDeque::<(u64, Step)>::new();
            let (mut tail, mut seen, mut at) = (0, 0.0, None::<(u64, Step)>);
            for (what, count, behind) in moves {
                let planned = |from: u64| -> (Vec<Step>, [Step; 2]) {
                    let end = from + count;
                    ((from..end).map(|from| step(from, false)).collect(), [step(end, false), step(end + 1, true)])
                };
                let begin = producer.next_number();
                let (kept, result, from) = match what {
                    0 => {
                        let Some(next) = consumer.advance() else {
                            prop_assert!(chain.is_empty() && at.is_none_or(|(_, step)| step.rests));
                            continue;
                        };
                        at = chain.pop_front();
                        prop_assert_eq!(Some(next), at.map(|(_, step)| step));
                        prop_assert_eq!(producer.consumer_at(), at.map(|(number, _)| number));
                        (tail, seen) = (tail.min(chain.len()), seen + 1.0);
                        continue;
                    }
                    // Behind one of those to come, the one that the consumer is at, or one that it has passed.
                    1 | 2 if at.is_some() => {
                        let known: Vec<_> = at.iter().chain(&chain).copied().collect();
                        let Some(&(number, before)) = known.get(behind) else {
                            let number = known[0].0;
                            if number > 0 {
                                prop_assert_eq!(producer.publish_after(number - 1, &[step(0, true)], &[]), Publish::Passed);
                            }
                            continue;
                        };
                        let (committed, stop) = planned(before.to);
                        (behind, producer.publish_after(number, &committed, &stop), before.to)
                    }
                    _ => {
                        let before = chain.len() - tail;
                        let from = if before > 0 { chain[before - 1].1.to } else { at.map_or(0, |(_, step)| step.to) };
                        let in_tail = tail < 2 && at.is_some();
                        let (committed, stop) = planned(from);
                        let result = producer.publish(&committed, &stop);
                        if result == Publish::TailTaken {
                            prop_assert!(in_tail);
                            tail = 0;
                            continue;
                        }
                        (before, result, from)
                    }
                };
                if result == Publish::Full {
                    continue;
                }
                prop_assert_eq!(result, Publish::Done);
                chain.truncate(kept);
                let (committed, stop) = planned(from);
                let new = committed.into_iter().chain(stop).enumerate();
                chain.extend(new.map(|(k, step)| (begin + k as u64, step)));
                tail = 2;
                prop_assert_eq!(consumer.published_s(), seen + chain.len() as f64);
                prop_assert!(consumer.ahead().eq(chain.iter().map(|(_, step)| step)));
            }
        }
    }

    #[test]
    fn two_threads_see_no_gap() {
        // Each of the two waits for the other again and again, which is slow where others want the cores, too.
        const STEPS: u64 = 40_000;
        let (producer, mut consumer) = channel(64);
        let planner = std::thread::spawn(move || {
            let mut planner = Planner {
                producer,
                committed: 0,
                tail: 0,
            };
            let mut pace = 1_u64;
            while planner.committed < STEPS {
                pace = pace.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                if planner.offer(pace >> 62) == Publish::Full || pace >> 58 & 7 == 0 {
                    std::thread::yield_now();
                }
            }
        });
        let (mut at, mut resting) = (0, true);
        while at < STEPS {
            match consumer.advance() {
                Some(step) => {
                    assert_eq!(step.from, at);
                    (at, resting) = (step.to, step.rests);
                }
                None => {
                    assert!(resting, "stopped in motion at {at}");
                    std::thread::yield_now();
                }
            }
        }
        planner.join().unwrap();
    }
}
