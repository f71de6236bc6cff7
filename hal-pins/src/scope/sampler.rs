//! The control's side: one call a cycle.

use super::file::OwnFile;
use super::layout::{CAPTURES, Segment, head};
use super::ring::Server;
use crate::hal::Shared;
use crate::{Hal, HalError};
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// Samples pins for all captures. Dropping it removes its file.
pub struct Sampler {
    segment: Segment,
    pins: Arc<Shared>,
    servers: [Server; CAPTURES],
    cycles: u64,
    _file: OwnFile,
}

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
            servers: [Server::IDLE; CAPTURES],
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
        let words = &self.pins.words;
        let value = |cell| words.cell(cell).load(Ordering::Acquire);
        for (at, server) in self.servers.iter_mut().enumerate() {
            let (capture, ring) = (self.segment.capture(at), self.segment.ring(at));
            server.serve(capture, ring, [self.cycles, time_ns], words.capacity(), value);
        }
        self.cycles += 1;
        self.segment.head(head::SAMPLED).store(self.cycles, Ordering::Relaxed);
    }
}
