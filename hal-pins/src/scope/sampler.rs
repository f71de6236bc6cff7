//! The control's side: one call a cycle.

use super::file::OwnFile;
use super::layout::{CAPTURES, CHANNELS_MAX, RECORD_HEAD, Segment, depth, head, of};
use crate::hal::Shared;
use crate::{Hal, HalError};
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// Samples pins for all captures. Dropping it removes its file.
pub struct Sampler {
    segment: Segment,
    pins: Arc<Shared>,
    active: [Active; CAPTURES],
    cycles: u64,
    _file: OwnFile,
}

/// What is served for a capture. Nothing here is read back from the memory.
#[derive(Clone, Copy)]
struct Active {
    request: u64,
    channels: usize,
    cells: [u32; CHANNELS_MAX],
    written: u64,
    /// Where the next record begins in the ring.
    place: usize,
    lost: u64,
}

const IDLE: Active = Active {
    request: 0,
    channels: 0,
    cells: [0; CHANNELS_MAX],
    written: 0,
    place: 0,
    lost: 0,
};

impl Sampler {
    /// Makes the memory of the oscilloscope, 4 MiB; `period_ns`: time of a cycle.
    ///
    /// # Errors
    /// Whatever the system refuses: no room in memory, for one.
    pub fn new(hal: &Hal, period_ns: u64) -> Result<Sampler, HalError> {
        let (file, segment) = OwnFile::create(hal, period_ns)?;
        Ok(Sampler {
            segment,
            pins: hal.shared.clone(),
            active: [IDLE; CAPTURES],
            cycles: 0,
            _file: file,
        })
    }

    /// RT: takes the values of all channels that are asked for, as the pins have them now. `time_ns`: date of the cycle.
    pub fn sample(&mut self, time_ns: u64) {
        // Memory that is gone is left alone.
        if self.segment.is_lost() {
            return;
        }
        for (at, active) in self.active.iter_mut().enumerate() {
            let request = self.segment.of(at, of::REQUEST).load(Ordering::Acquire);
            if request != active.request {
                *active = begin(&self.segment, at, request, self.pins.words.capacity());
            }
            if active.channels == 0 {
                continue;
            }
            let read = self.segment.of(at, of::READ).load(Ordering::Acquire);
            let waiting = active.written.wrapping_sub(read);
            if waiting >= depth(active.channels) {
                active.lost += 1;
                self.segment.of(at, of::LOST).store(active.lost, Ordering::Relaxed);
                continue;
            }
            let length = RECORD_HEAD + active.channels;
            let record = self.segment.ring(at, active.place, length);
            record[0].store(self.cycles, Ordering::Relaxed);
            record[1].store(time_ns, Ordering::Relaxed);
            for (word, cell) in record[RECORD_HEAD..].iter().zip(&active.cells) {
                let value = self.pins.words.cell(*cell as usize).load(Ordering::Acquire);
                word.store(value, Ordering::Relaxed);
            }
            active.written = active.written.wrapping_add(1);
            active.place += length;
            if active.place + length > depth(active.channels) as usize * length {
                active.place = 0;
            }
            self.segment
                .of(at, of::WRITTEN)
                .store(active.written, Ordering::Release);
        }
        self.cycles += 1;
        self.segment.head(head::SAMPLED).store(self.cycles, Ordering::Relaxed);
    }
}

/// RT: takes a request over, as far as it makes sense.
fn begin(segment: &Segment, at: usize, request: u64, capacity: usize) -> Active {
    let wanted = segment.of(at, of::CHANNELS).load(Ordering::Relaxed);
    let mut active = Active { request, ..IDLE };
    let channels = match usize::try_from(wanted) {
        Ok(channels) if request != 0 && (1..=CHANNELS_MAX).contains(&channels) => channels,
        _ => 0,
    };
    let mut is_good = channels > 0 || request == 0;
    for (channel, cell) in active.cells.iter_mut().enumerate().take(channels) {
        let wanted = segment.of(at, of::CELLS + channel).load(Ordering::Relaxed);
        match u32::try_from(wanted) {
            Ok(wanted) if (wanted as usize) < capacity => *cell = wanted,
            _ => is_good = false,
        }
    }
    if is_good {
        active.channels = channels;
    }
    for (word, value) in [(of::WRITTEN, 0), (of::LOST, 0), (of::REFUSED, u64::from(!is_good))] {
        segment.of(at, word).store(value, Ordering::Relaxed);
    }
    segment.of(at, of::SERVED).store(request, Ordering::Release);
    active
}
