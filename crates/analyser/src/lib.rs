//! Independent judge of the cycle: measures the SoC period where the drives are, from receive stamps.
//!
//! In:  all frames on one interface, through a packet socket of its own that shares no code with the managing node's link.
//!      Frames that leave by the interface are seen where they arrive, at the other end of a veth pair: senders that bypass
//!      the queues of the kernel (`PACKET_QDISC_BYPASS`) bypass its taps too.
//! Out: [`SocReport`] of one window of time or several, and every frame in a capture file if wanted.
//!
//! Runs in an ordinary thread and looks every 2 ms: the stamps are taken by the network card or else by the kernel when a
//! frame arrives, so how late the thread reads them does not matter. What the socket could not hold is counted. Memory is
//! constant for any number of cycles.
//!
//! | to learn | file |
//! |---|---|
//! | how frames and their stamps are received | `socket.rs`, `stamps.rs` |
//! | when the network card takes the stamps | `hardware.rs` |
//! | in what order they are measured; steps of the clock | `measure.rs` |
//! | what a period, an overrun, a pause is | `tally.rs` |
//! | what is reported | `report.rs` |
//! | a PC that does nothing else | `listen.rs` |

// What is public here is so for the program and its tests, and says more than its name only where there is more to say.
#![allow(missing_docs)]

mod hardware;
pub mod listen;
mod maxima;
mod measure;
mod report;
mod socket;
mod stamps;
mod tally;

pub use maxima::INTERVALS;
pub use report::{Breaks, FrameCounts, MICROMETRES_PER_US, SocReport, StampSource};
pub use tally::Window;

use bus::frames::PcapWriter;
use measure::{Ears, Measurement, Order};
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Sender, channel};
use std::thread::JoinHandle;

/// Why nothing can be measured.
#[derive(Debug, thiserror::Error)]
pub enum AnalyserError {
    #[error("interface {interface}: {doing}: {cause}{}", rights(.cause))]
    Socket {
        interface: String,
        /// What was tried.
        doing: &'static str,
        /// The system's answer.
        cause: io::Error,
    },
    /// The capture file.
    #[error("capture file {}: {cause}", .path.display())]
    Capture {
        path: PathBuf,
        /// The system's answer.
        cause: io::Error,
    },
    #[error("the measuring thread has failed")]
    Thread,
}

fn rights(cause: &io::Error) -> &'static str {
    match cause.kind() {
        io::ErrorKind::PermissionDenied => "; run as root or grant cap_net_raw with setcap",
        _ => "",
    }
}

fn socket_error(interface: &str, doing: &'static str, cause: io::Error) -> AnalyserError {
    AnalyserError::Socket {
        interface: interface.to_owned(),
        doing,
        cause,
    }
}

/// Where and how to listen.
#[derive(Clone, Copy, Debug)]
pub struct Place<'a> {
    /// The interface at which the SoC period is measured.
    pub interface: &'a str,
    /// The other end of its veth pair, if what leaves by the interface is to be seen too.
    pub other_end: Option<&'a str>,
    /// Every frame is also written to this file.
    pub capture: Option<&'a Path>,
    /// Have the network card stamp the frames if it can.
    pub hardware_stamps: bool,
}

/// A measurement under way.
pub struct Analyser {
    /// Dropped, the measurement ends within one look.
    orders: Option<Sender<Order>>,
    thread: Option<JoinHandle<Result<(), AnalyserError>>>,
}

impl Analyser {
    /// Starts measuring at an interface, listening at the other end of its veth pair too if there is one; with a path,
    /// every frame is also written to a capture file there.
    ///
    /// # Errors
    /// No socket, no such interface, no capture file.
    pub fn start(
        interface: &str,
        other_end: Option<&str>,
        cycle_us: u32,
        capture: Option<&Path>,
    ) -> Result<Analyser, AnalyserError> {
        let place = Place {
            interface,
            other_end,
            capture,
            hardware_stamps: true,
        };
        Analyser::start_at(&place, Window::open(cycle_us))
    }

    /// Starts measuring with a first window.
    ///
    /// # Errors
    /// No socket, no such interface, no capture file.
    pub fn start_at(place: &Place<'_>, window: Window) -> Result<Analyser, AnalyserError> {
        let ears = Ears::open(place)?;
        let capture = place.capture.map(Capture::create).transpose()?;
        let (orders, received) = channel();
        let thread = std::thread::Builder::new()
            .name("soc-analyser".into())
            .spawn(move || Measurement::new(window, capture).run(&ears, &received))
            .map_err(|_| AnalyserError::Thread)?;
        Ok(Analyser {
            orders: Some(orders),
            thread: Some(thread),
        })
    }

    /// Begins a new window: measured is what is stamped from now on. Returns when it has begun.
    ///
    /// # Errors
    /// What went wrong before.
    pub fn begin(&mut self, window: Window) -> Result<(), AnalyserError> {
        let (done, answer) = channel();
        self.order(Order::Begin(window, done))?;
        answer.recv().map_err(|_| self.ended())
    }

    /// What this window has brought until now.
    ///
    /// # Errors
    /// What went wrong before.
    pub fn report(&mut self) -> Result<SocReport, AnalyserError> {
        let (done, answer) = channel();
        self.order(Order::Report(done))?;
        answer.recv().map_err(|_| self.ended())
    }

    /// Ends the measurement.
    ///
    /// # Errors
    /// What went wrong in between.
    pub fn stop(mut self) -> Result<SocReport, AnalyserError> {
        let report = self.report()?;
        self.orders = None;
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(Ok(()))) => Ok(report),
            Some(Ok(Err(error))) => Err(error),
            Some(Err(_)) | None => Err(AnalyserError::Thread),
        }
    }

    fn order(&mut self, order: Order) -> Result<(), AnalyserError> {
        match self.orders.as_ref().map(|orders| orders.send(order)) {
            Some(Ok(())) => Ok(()),
            Some(Err(_)) | None => Err(self.ended()),
        }
    }

    /// Why the thread has ended though nobody wanted it to.
    fn ended(&mut self) -> AnalyserError {
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(Err(error))) => error,
            Some(Ok(Ok(())) | Err(_)) | None => AnalyserError::Thread,
        }
    }
}

struct Capture {
    path: PathBuf,
    writer: PcapWriter<BufWriter<File>>,
}

impl Capture {
    fn create(path: &Path) -> Result<Capture, AnalyserError> {
        let failed = |cause| AnalyserError::Capture {
            path: path.to_owned(),
            cause,
        };
        let file = files::create(path).map_err(failed)?;
        let writer = PcapWriter::new(BufWriter::new(file)).map_err(failed)?;
        Ok(Capture {
            path: path.to_owned(),
            writer,
        })
    }

    fn write(&mut self, stamp_ns: u64, octets: &[u8]) -> Result<(), AnalyserError> {
        self.writer
            .write(stamp_ns, octets)
            .map_err(|cause| AnalyserError::Capture {
                path: self.path.clone(),
                cause,
            })
    }

    fn finish(self) -> Result<(), AnalyserError> {
        let Capture { path, writer } = self;
        match writer.finish() {
            Ok(_) => Ok(()),
            Err(cause) => Err(AnalyserError::Capture { path, cause }),
        }
    }
}

#[cfg(test)]
mod tests;
