//! The measuring thread: reads the sockets, puts frames in order, hands them to the tally.
//!
//! In:  frames of one or two sockets; orders of the analyser's owner.
//! Out: reports, and frames to the capture file.
//!
//! The kernel's stamps are CLOCK_REALTIME. Before and after each look that clock is compared with CLOCK_MONOTONIC; when it was
//! stepped in between, the frames of that look and the next are counted but not measured.

use super::hardware::{HardwareStamps, NotHardware};
use super::report::{SocReport, StampSource};
use super::socket::{self, Batch};
use super::stamps::Stamps;
use super::tally::{Tally, Window};
use super::{AnalyserError, Capture, Place, socket_error};
use bus::frames::{FrameKind, is_ethercat};
use host::wait::to_next;
use std::os::fd::OwnedFd;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::time::Duration;

/// Time between two looks at the socket.
const LOOK: Duration = Duration::from_millis(2);
/// A stamped frame is in its socket after this long at most.
const SETTLED_NS: u64 = 1_000_000;
/// More frames do not wait for each other, whatever their stamps.
const WAITING_MAX: usize = 65_536;
/// A change of the clock by more between two looks is a step: a clock is slewed by 500 ppm at most, and read to some 10 µs.
const STEP_NS: u64 = 100_000;
/// Looks whose frames are not measured after a step: the one in which it was seen, and one for frames under way.
const LOOKS_AFTER_STEP: u32 = 2;

/// What the owner wants.
pub(super) enum Order {
    /// A new window; answered when it has begun.
    Begin(Window, Sender<()>),
    /// The figures of this window.
    Report(Sender<SocReport>),
}

/// The open sockets.
pub(super) struct Ears {
    interface: String,
    hardware_wanted: bool,
    sockets: Vec<OwnedFd>,
}

impl Ears {
    pub(super) fn open(place: &Place<'_>) -> Result<Ears, AnalyserError> {
        let mut sockets = vec![socket::open(place.interface)?];
        if let Some(other_end) = place.other_end {
            sockets.push(socket::open(other_end)?);
        }
        Ok(Ears {
            interface: place.interface.to_owned(),
            hardware_wanted: place.hardware_stamps,
            sockets,
        })
    }

    /// Frames lost for lack of room since this was last asked.
    fn dropped(&self) -> u64 {
        self.sockets.iter().map(socket::dropped).sum()
    }
}

/// A frame that was read and waits until all that were stamped before it have been read too.
struct Seen {
    kind: FrameKind,
    is_ethercat: bool,
    stamps: Stamps,
    /// The kernel's stamp, or else the time of reading.
    order_ns: u64,
    incoming: bool,
    /// Read around a step of the clock.
    unmeasured: bool,
    /// Empty unless frames are recorded.
    octets: Vec<u8>,
}

pub(super) struct Measurement {
    tally: Tally,
    capture: Option<Capture>,
    batch: Batch,
    waiting: Vec<Seen>,
    clock: Clock,
}

impl Measurement {
    pub(super) fn new(window: Window, capture: Option<Capture>) -> Measurement {
        Measurement {
            tally: Tally::new(window),
            capture,
            batch: Batch::new(),
            waiting: Vec::new(),
            clock: Clock::default(),
        }
    }

    /// Measures until nobody can give orders any more.
    pub(super) fn run(mut self, ears: &Ears, orders: &Receiver<Order>) -> Result<(), AnalyserError> {
        let hardware = match ears.hardware_wanted {
            true => HardwareStamps::switch_on(&ears.sockets[0], &ears.interface),
            false => Err(NotHardware::NotAsked),
        };
        // What was dropped before is not of the first window.
        ears.dropped();
        loop {
            let order = orders.recv_timeout(to_next(LOOK));
            self.receive(ears)?;
            match order {
                Err(RecvTimeoutError::Timeout) => {}
                Ok(Order::Begin(window, done)) => {
                    self.settle(u64::MAX)?;
                    ears.dropped();
                    self.tally = Tally::new(window);
                    // An owner who has gone waits for no answer.
                    let _ = done.send(());
                }
                Ok(Order::Report(done)) => {
                    self.settle(u64::MAX)?;
                    self.tally.dropped(ears.dropped());
                    let mut report = self.tally.report(&ears.interface);
                    report.why_not_hardware = match (report.stamps, &hardware) {
                        (StampSource::Hardware, _) => None,
                        (StampSource::Kernel, Ok(_)) => Some(NotHardware::NoneCame.to_string()),
                        (StampSource::Kernel, Err(why_not)) => Some(why_not.to_string()),
                    };
                    let _ = done.send(report);
                }
                Err(RecvTimeoutError::Disconnected) => {
                    self.settle(u64::MAX)?;
                    break;
                }
            }
        }
        self.capture.map_or(Ok(()), Capture::finish)
    }

    /// Reads what there is.
    fn receive(&mut self, ears: &Ears) -> Result<(), AnalyserError> {
        let look_ns = now_ns(libc::CLOCK_REALTIME);
        let fresh = self.waiting.len();
        let recording = self.capture.is_some();
        let Measurement { waiting, batch, .. } = self;
        for (end, socket) in ears.sockets.iter().enumerate() {
            batch
                .drain(socket, |frame| {
                    // What arrives at the other end has left at this one; with both ends heard, one look at each frame is enough.
                    if ears.sockets.len() == 1 || frame.incoming {
                        let incoming = frame.incoming && end == 0;
                        waiting.push(Seen {
                            kind: FrameKind::of(frame.octets),
                            is_ethercat: is_ethercat(frame.octets),
                            stamps: frame.stamps,
                            order_ns: frame.stamps.kernel_ns.unwrap_or(look_ns),
                            incoming,
                            unmeasured: false,
                            octets: if recording { frame.octets.to_vec() } else { Vec::new() },
                        });
                    }
                })
                .map_err(|cause| socket_error(&ears.interface, "receive", cause))?;
        }
        let (stepped, unmeasured) = self.clock.check(offset_ns());
        if stepped {
            // What was read before keeps its order; what was read now bears stamps of either time.
            let fresh = self.waiting.split_off(fresh);
            self.settle(u64::MAX)?;
            self.waiting = fresh;
            self.tally.clock_stepped();
        }
        if unmeasured {
            self.waiting[if stepped { 0 } else { fresh }..]
                .iter_mut()
                .for_each(|seen| seen.unmeasured = true);
            return self.settle(u64::MAX);
        }
        // A frame that came while this look went from one socket to the next must wait for those before it.
        self.settle(look_ns.saturating_sub(SETTLED_NS))
    }

    /// Measures what was stamped until then, in the order of the stamps.
    fn settle(&mut self, until_ns: u64) -> Result<(), AnalyserError> {
        self.waiting.sort_by_key(|seen| seen.order_ns);
        let settled = self.waiting.partition_point(|seen| seen.order_ns <= until_ns);
        let settled = settled.max(self.waiting.len().saturating_sub(WAITING_MAX));
        for seen in self.waiting.drain(..settled) {
            self.tally.is_of(seen.is_ethercat);
            match seen.unmeasured {
                true => self.tally.add_unmeasured(seen.kind),
                false => self.tally.add(seen.kind, seen.stamps, seen.incoming),
            }
            if let Some(capture) = &mut self.capture {
                capture.write(seen.order_ns, &seen.octets)?;
            }
        }
        Ok(())
    }
}

/// Watches CLOCK_REALTIME for steps.
#[derive(Debug, Default)]
struct Clock {
    offset_ns: Option<i64>,
    unmeasured_looks: u32,
}

impl Clock {
    /// Takes the distance of the clocks after a look: whether the clock was stepped since the look before, and whether the
    /// frames of this look are not to be measured.
    fn check(&mut self, offset_ns: i64) -> (bool, bool) {
        let before = self.offset_ns.replace(offset_ns);
        let stepped = before.is_some_and(|before| before.abs_diff(offset_ns) > STEP_NS);
        if stepped {
            self.unmeasured_looks = LOOKS_AFTER_STEP;
        }
        let unmeasured = self.unmeasured_looks > 0;
        self.unmeasured_looks = self.unmeasured_looks.saturating_sub(1);
        (stepped, unmeasured)
    }
}

/// CLOCK_REALTIME less CLOCK_MONOTONIC, by the quickest of a few readings: this thread may be held up between two of them.
fn offset_ns() -> i64 {
    let reading = || {
        let before_ns = now_ns(libc::CLOCK_MONOTONIC);
        let real_ns = now_ns(libc::CLOCK_REALTIME);
        let after_ns = now_ns(libc::CLOCK_MONOTONIC);
        let took_ns = after_ns.saturating_sub(before_ns);
        (took_ns, real_ns.wrapping_sub(before_ns + took_ns / 2) as i64)
    };
    let mut best = reading();
    for _ in 0..8 {
        if best.0 <= STEP_NS / 10 {
            break;
        }
        best = best.min(reading());
    }
    best.1
}

fn now_ns(clock: libc::clockid_t) -> u64 {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `time` may be written and lives through the call, which cannot fail for these clocks.
    unsafe { libc::clock_gettime(clock, &raw mut time) };
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_steps_of_the_clock_are_steps() {
        let mut clock = Clock::default();
        let mut check = |offset_ns| clock.check(offset_ns);
        assert_eq!(check(1_700_000_000_000_000_000), (false, false));
        // A reading that was held up; a clock that is slewed for a second.
        assert_eq!(check(1_700_000_000_000_060_000), (false, false));
        assert_eq!(check(1_700_000_000_000_000_000), (false, false));
        for i in 0..500 {
            assert_eq!(check(1_700_000_000_000_000_000 + i * 1000), (false, false));
        }
        // Back by an hour, and on.
        assert_eq!(check(1_699_996_400_000_000_000), (true, true));
        assert_eq!(check(1_699_996_400_000_000_000), (false, true));
        assert_eq!(check(1_699_996_400_000_000_000), (false, false));
        assert_eq!(check(1_700_000_000_000_000_000), (true, true));
        assert_eq!(check(1_700_000_000_001_000_000), (true, true));
        assert_eq!(check(1_700_000_000_001_000_000), (false, true));
        assert_eq!(check(1_700_000_000_001_000_000), (false, false));
    }

    fn seen(order_ns: u64, unmeasured: bool) -> Seen {
        Seen {
            kind: FrameKind::Soc,
            is_ethercat: false,
            stamps: Stamps {
                kernel_ns: Some(order_ns),
                hardware_ns: None,
            },
            order_ns,
            incoming: true,
            unmeasured,
            octets: Vec::new(),
        }
    }

    #[test]
    fn frames_are_measured_in_the_order_of_their_stamps() {
        let mut measurement = Measurement::new(Window::open(1000), None);
        measurement.waiting = [3_000_000, 1_000_000, 2_000_000, 4_100_000]
            .map(|at_ns| seen(at_ns, false))
            .into();
        measurement.settle(3_500_000).unwrap();
        assert_eq!(measurement.waiting.len(), 1);
        assert_eq!(measurement.tally.report("x").n, 2);
        measurement.settle(u64::MAX).unwrap();
        let report = measurement.tally.report("x");
        assert_eq!((report.n, report.period_max_us), (3, 1100.0));
    }

    #[test]
    fn frames_around_a_step_are_counted_and_not_measured() {
        let mut measurement = Measurement::new(Window::open(1000), None);
        let frames = [
            (1_000_000, false),
            (2_000_000, false),
            (9_000_000, true),
            (500_000, true),
        ];
        for (at_ns, unmeasured) in frames {
            if at_ns == 9_000_000 {
                measurement.tally.clock_stepped();
            }
            measurement.waiting.push(seen(at_ns, unmeasured));
            measurement.settle(u64::MAX).unwrap();
        }
        for at_ns in [700_000, 1_700_000] {
            measurement.waiting.push(seen(at_ns, false));
            measurement.settle(u64::MAX).unwrap();
        }
        let report = measurement.tally.report("x");
        assert_eq!((report.frames.soc, report.n, report.breaks.clock_steps), (6, 2, 1));
        assert_eq!((report.period_min_us, report.period_max_us), (1000.0, 1000.0));
        assert_eq!(report.frames_unstamped, 0);
    }

    #[test]
    fn a_flood_of_frames_from_the_future_does_not_wait_for_ever() {
        let mut measurement = Measurement::new(Window::open(1000), None);
        let future_ns = u64::MAX / 2;
        measurement
            .waiting
            .extend((0..WAITING_MAX as u64 + 10).map(|i| seen(future_ns + i, false)));
        measurement.settle(1).unwrap();
        assert_eq!(measurement.waiting.len(), WAITING_MAX);
        assert_eq!(measurement.tally.report("x").frames.soc, 10);
    }
}
