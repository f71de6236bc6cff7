//! Independent judge of the cycle: measures the SoC period where the drives are, from the kernel's receive stamps.
//!
//! In:  all frames on one interface, through a packet socket of its own that shares no code with the managing node's link.
//!      Frames that leave by the interface are seen where they arrive, at the other end of a veth pair: senders that bypass
//!      the queues of the kernel (`PACKET_QDISC_BYPASS`) bypass its taps too.
//! Out: [`SocReport`], and every frame in a capture file if wanted.
//!
//! Runs in an ordinary thread and looks every 2 ms: the stamps are taken by the kernel when a frame arrives, so how late the
//! thread reads them does not matter. What the socket could not hold is counted. The stamps are CLOCK_REALTIME: a step of
//! the clock during a measurement shows as one wild period.

use crate::rt::jitter::{Bucket, Jitter};
use nix::errno::Errno;
use powerlink::link::pcap::PcapWriter;
use powerlink::wire::{ETHER_TYPE, FRAME_LEN_MAX, message};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::fs::File;
use std::io::{self, BufWriter};
use std::mem::{size_of, zeroed};
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Time between two looks at the socket.
const LOOK: Duration = Duration::from_millis(2);
/// Room of the socket: more than a second of frames.
const RECEIVE_BUFFER: libc::c_int = 8 * 1024 * 1024;
/// Frames taken with one system call.
const BATCH: usize = 64;
/// A stamped frame is in its socket after this long at most.
const SETTLED_NS: u64 = 1_000_000;
/// A gap of more cycles is a network that was stopped and started, and no period.
const RESTART_CYCLES: u64 = 10;

/// Why nothing can be measured.
#[derive(Debug, thiserror::Error)]
pub enum AnalyserError {
    /// The socket.
    #[error("interface {interface}: {doing}: {cause}{}", rights(.cause))]
    Socket {
        /// The interface.
        interface: String,
        /// What was tried.
        doing: &'static str,
        /// The system's answer.
        cause: io::Error,
    },
    /// The capture file.
    #[error("capture file {}: {cause}", .path.display())]
    Capture {
        /// The file.
        path: PathBuf,
        /// The system's answer.
        cause: io::Error,
    },
    /// The thread.
    #[error("the measuring thread has failed")]
    Thread,
}

fn rights(cause: &io::Error) -> &'static str {
    match cause.kind() {
        io::ErrorKind::PermissionDenied => "; run as root or grant cap_net_raw with setcap",
        _ => "",
    }
}

/// Frames by type of message.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FrameCounts {
    /// Start of cycle.
    pub soc: u64,
    /// Poll requests.
    pub preq: u64,
    /// Poll responses.
    pub pres: u64,
    /// Start of the asynchronous phase.
    pub soa: u64,
    /// Asynchronous frames.
    pub asnd: u64,
    /// POWERLINK frames of other types.
    pub other: u64,
    /// Frames that are not POWERLINK; on a wire of its own there are none.
    pub foreign: u64,
}

/// What was measured. Times in µs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SocReport {
    /// Where.
    pub interface: String,
    /// Nominal period.
    pub cycle_us: u32,
    /// Number of periods.
    pub n: u64,
    /// Mean period.
    pub period_mean_us: f64,
    /// Standard deviation.
    pub period_std_us: f64,
    /// Shortest period.
    pub period_min_us: f64,
    /// Longest period.
    pub period_max_us: f64,
    /// Longest minus shortest.
    pub period_range_us: f64,
    /// Half of the periods are no longer.
    pub period_p50_us: f64,
    /// 99 % are no longer.
    pub period_p99_us: f64,
    /// 99.9 % are no longer.
    pub period_p99_9_us: f64,
    /// 99.99 % are no longer.
    pub period_p99_99_us: f64,
    /// Gaps of more than ten cycles, which are not among the periods.
    pub restarts: u64,
    /// Frames seen, both directions.
    pub frames: FrameCounts,
    /// Frames that the socket could not hold; above 0 some periods are wrong.
    pub frames_dropped: u64,
    /// Frames without a receive stamp, which the kernel leaves out for a moment after the start; measured are the others.
    pub frames_unstamped: u64,
    /// Longest period of each second since the first SoC; 0 where there was none.
    pub second_maxima_us: Vec<f64>,
    /// Periods as deviations from nominal.
    pub histogram: Vec<Bucket>,
}

impl fmt::Display for SocReport {
    /// The table in the form in which such measurements are published.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let title = format!("SoC period at {}, µs", self.interface);
        writeln!(
            f,
            "{title:<28} {:>12} {:>12} {:>12} {:>12}",
            "mean", "max range", "std dev", "n"
        )?;
        write!(
            f,
            "{:<28} {:>12.3} {:>12.3} {:>12.3} {:>12}",
            format!("cycle {}", self.cycle_us),
            self.period_mean_us,
            self.period_range_us,
            self.period_std_us,
            self.n
        )?;
        if self.restarts > 0 {
            write!(
                f,
                "\nthe SoC paused {} times for more than {RESTART_CYCLES} cycles",
                self.restarts
            )?;
        }
        if self.frames_dropped > 0 {
            write!(
                f,
                "\n{} frames were not seen for lack of room: some periods are wrong",
                self.frames_dropped
            )?;
        }
        Ok(())
    }
}

/// A measurement under way.
pub struct Analyser {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<Result<SocReport, AnalyserError>>>,
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
        let mut sockets = vec![open_socket(interface)?];
        if let Some(other_end) = other_end {
            sockets.push(open_socket(other_end)?);
        }
        let capture = capture.map(Capture::create).transpose()?;
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = stop.clone();
        let interface = interface.to_owned();
        let thread = std::thread::Builder::new()
            .name("soc-analyser".into())
            .spawn(move || measure(&sockets, interface, cycle_us, capture, &stopped))
            .map_err(|_| AnalyserError::Thread)?;
        Ok(Analyser {
            stop,
            thread: Some(thread),
        })
    }

    /// Ends the measurement.
    ///
    /// # Errors
    /// What went wrong in between.
    pub fn stop(mut self) -> Result<SocReport, AnalyserError> {
        self.stop.store(true, Ordering::Release);
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(report)) => report,
            Some(Err(_)) | None => Err(AnalyserError::Thread),
        }
    }
}

impl Drop for Analyser {
    fn drop(&mut self) {
        // Ends the thread of a measurement that nobody wants any more; it stops by itself within one look.
        self.stop.store(true, Ordering::Release);
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
        let file = File::create(path).map_err(failed)?;
        let writer = PcapWriter::new(BufWriter::new(file)).map_err(failed)?;
        Ok(Capture {
            path: path.to_owned(),
            writer,
        })
    }
}

/// A frame that was read and waits until all that were stamped before it have been read too.
struct Seen {
    stamp_ns: Option<u64>,
    /// The stamp, or else the time of reading.
    order_ns: u64,
    incoming: bool,
    octets: Vec<u8>,
}

fn measure(
    sockets: &[OwnedFd],
    interface: String,
    cycle_us: u32,
    mut capture: Option<Capture>,
    stop: &AtomicBool,
) -> Result<SocReport, AnalyserError> {
    let mut tally = Tally::new(cycle_us);
    let mut batch = Batch::new();
    let mut waiting: Vec<Seen> = Vec::new();
    loop {
        // Asked before the look, so that what came before the end is still taken.
        let last = stop.load(Ordering::Acquire);
        let look_ns = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .map_or(0, |since| since.as_nanos() as u64);
        for (end, socket) in sockets.iter().enumerate() {
            batch
                .drain(socket, |frame| {
                    // What arrives at the other end has left at this one; with both ends heard, one look at each frame is enough.
                    if sockets.len() == 1 || frame.incoming {
                        let incoming = frame.incoming && end == 0;
                        waiting.push(Seen {
                            stamp_ns: frame.stamp_ns,
                            order_ns: frame.stamp_ns.unwrap_or(look_ns),
                            incoming,
                            octets: frame.octets.to_vec(),
                        });
                    }
                })
                .map_err(|cause| AnalyserError::Socket {
                    interface: interface.clone(),
                    doing: "receive",
                    cause,
                })?;
        }
        // A frame that came while this look went from one socket to the next must wait for those before it.
        let settled_ns = if last {
            u64::MAX
        } else {
            look_ns.saturating_sub(SETTLED_NS)
        };
        waiting.sort_by_key(|seen| seen.order_ns);
        let settled = waiting.partition_point(|seen| seen.order_ns <= settled_ns);
        for seen in waiting.drain(..settled) {
            tally.add(seen.stamp_ns, seen.incoming, &seen.octets);
            if let Some(Capture { path, writer }) = &mut capture {
                let failed = |cause| AnalyserError::Capture {
                    path: path.clone(),
                    cause,
                };
                writer.write(seen.order_ns, &seen.octets).map_err(failed)?;
            }
        }
        if last {
            break;
        }
        std::thread::sleep(LOOK);
    }
    if let Some(Capture { path, writer }) = capture {
        writer
            .finish()
            .map_err(|cause| AnalyserError::Capture { path, cause })?;
    }
    Ok(tally.report(interface, sockets.iter().map(dropped).sum()))
}

/// The measurement itself, on frames that come from anywhere.
struct Tally {
    cycle_us: u32,
    periods: Jitter,
    frames: FrameCounts,
    frames_unstamped: u64,
    restarts: u64,
    first_soc_ns: Option<u64>,
    last_soc_ns: Option<u64>,
    second_maxima_ns: Vec<u64>,
}

impl Tally {
    fn new(cycle_us: u32) -> Tally {
        Tally {
            cycle_us,
            periods: Jitter::new(u64::from(cycle_us) * 1000),
            frames: FrameCounts::default(),
            frames_unstamped: 0,
            restarts: 0,
            first_soc_ns: None,
            last_soc_ns: None,
            second_maxima_ns: Vec::new(),
        }
    }

    fn add(&mut self, stamp_ns: Option<u64>, incoming: bool, frame: &[u8]) {
        self.frames_unstamped += u64::from(stamp_ns.is_none());
        let counts = &mut self.frames;
        let (Some(ether_type), Some(message_type)) = (frame.get(12..14), frame.get(14)) else {
            counts.foreign += 1;
            return;
        };
        if ether_type != ETHER_TYPE.to_be_bytes() {
            counts.foreign += 1;
            return;
        }
        // Bit 7 is no part of the type.
        match message_type & 0x7F {
            message::SOC => {
                counts.soc += 1;
                // Sent ones were not yet on the wire when they got their stamp.
                match stamp_ns {
                    Some(stamp_ns) if incoming => self.soc(stamp_ns),
                    Some(_) => {}
                    None => self.last_soc_ns = None,
                }
            }
            message::PREQ => counts.preq += 1,
            message::PRES => counts.pres += 1,
            message::SOA => counts.soa += 1,
            message::ASND => counts.asnd += 1,
            _ => counts.other += 1,
        }
    }

    fn soc(&mut self, stamp_ns: u64) {
        let first_ns = *self.first_soc_ns.get_or_insert(stamp_ns);
        let Some(last_ns) = self.last_soc_ns.replace(stamp_ns) else {
            return;
        };
        let period_ns = stamp_ns.saturating_sub(last_ns);
        if period_ns > RESTART_CYCLES * u64::from(self.cycle_us) * 1000 {
            self.restarts += 1;
            return;
        }
        self.periods.record(period_ns);
        // A clock that was stepped by years must not make a list of years.
        let second = (stamp_ns.saturating_sub(first_ns) / 1_000_000_000).min(86_400 * 30) as usize;
        if self.second_maxima_ns.len() <= second {
            self.second_maxima_ns.resize(second + 1, 0);
        }
        self.second_maxima_ns[second] = self.second_maxima_ns[second].max(period_ns);
    }

    fn report(self, interface: String, frames_dropped: u64) -> SocReport {
        let figures = self.periods.summary();
        SocReport {
            interface,
            cycle_us: self.cycle_us,
            n: figures.n,
            period_mean_us: figures.mean_us,
            period_std_us: figures.std_us,
            period_min_us: figures.min_us,
            period_max_us: figures.max_us,
            period_range_us: figures.range_us,
            period_p50_us: figures.p50_us,
            period_p99_us: figures.p99_us,
            period_p99_9_us: figures.p99_9_us,
            period_p99_99_us: figures.p99_99_us,
            restarts: self.restarts,
            frames: self.frames,
            frames_dropped,
            frames_unstamped: self.frames_unstamped,
            second_maxima_us: self.second_maxima_ns.iter().map(|ns| *ns as f64 / 1000.0).collect(),
            histogram: self.periods.buckets().collect(),
        }
    }
}

fn open_socket(interface: &str) -> Result<OwnedFd, AnalyserError> {
    let failed = |doing| {
        move |cause| AnalyserError::Socket {
            interface: interface.to_owned(),
            doing,
            cause,
        }
    };
    let index = nix::net::if_::if_nametoindex(interface)
        .map_err(io::Error::from)
        .map_err(failed("find"))?;
    // Protocol 0 hears nothing until it is bound to the interface, so no frame of another one slips in.
    // SAFETY: no memory is touched; the descriptor is checked below.
    let fd = unsafe {
        libc::socket(
            libc::AF_PACKET,
            libc::SOCK_RAW | libc::SOCK_NONBLOCK | libc::SOCK_CLOEXEC,
            0,
        )
    };
    if fd < 0 {
        return Err(failed("open a packet socket")(io::Error::last_os_error()));
    }
    // SAFETY: the descriptor is open and nobody else's.
    let socket = unsafe { OwnedFd::from_raw_fd(fd) };
    // Not SO_TIMESTAMPNS: that gives a frame without a stamp the time of reading, which looks like one. The kernel begins to
    // stamp only some time after the first socket asks for it.
    let stamps = (libc::SOF_TIMESTAMPING_RX_SOFTWARE | libc::SOF_TIMESTAMPING_SOFTWARE) as libc::c_int;
    set_option(&socket, libc::SOL_SOCKET, libc::SO_TIMESTAMPING, stamps).map_err(failed("ask for receive stamps"))?;
    if set_option(&socket, libc::SOL_SOCKET, libc::SO_RCVBUFFORCE, RECEIVE_BUFFER).is_err() {
        // Without the right to more, as much as the system allows; what does not fit is counted.
        set_option(&socket, libc::SOL_SOCKET, libc::SO_RCVBUF, RECEIVE_BUFFER).map_err(failed("ask for room"))?;
    }
    // SAFETY: all zeros is a sockaddr_ll.
    let mut address: libc::sockaddr_ll = unsafe { zeroed() };
    address.sll_family = libc::AF_PACKET as u16;
    address.sll_protocol = (libc::ETH_P_ALL as u16).to_be();
    address.sll_ifindex = index as i32;
    let length = size_of::<libc::sockaddr_ll>() as libc::socklen_t;
    // SAFETY: `address` is a sockaddr_ll of that length and lives through the call.
    if unsafe { libc::bind(socket.as_raw_fd(), (&raw const address).cast(), length) } != 0 {
        return Err(failed("listen")(io::Error::last_os_error()));
    }
    Ok(socket)
}

fn set_option(socket: &OwnedFd, level: libc::c_int, option: libc::c_int, value: libc::c_int) -> io::Result<()> {
    let length = size_of::<libc::c_int>() as libc::socklen_t;
    // SAFETY: `value` is of that length and lives through the call.
    match unsafe { libc::setsockopt(socket.as_raw_fd(), level, option, (&raw const value).cast(), length) } {
        0 => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}

/// Frames that the socket had to drop since it was opened.
fn dropped(socket: &OwnedFd) -> u64 {
    // SAFETY: all zeros is a tpacket_stats.
    let mut stats: libc::tpacket_stats = unsafe { zeroed() };
    let mut length = size_of::<libc::tpacket_stats>() as libc::socklen_t;
    let fd = socket.as_raw_fd();
    // SAFETY: `stats` is of that length and may be written; both live through the call.
    let answer = unsafe {
        libc::getsockopt(
            fd,
            libc::SOL_PACKET,
            libc::PACKET_STATISTICS,
            (&raw mut stats).cast(),
            &raw mut length,
        )
    };
    if answer == 0 { u64::from(stats.tp_drops) } else { 0 }
}

/// Room for a control message with a time stamp, aligned as the kernel wants it.
type Control = [u64; 8];

/// Buffers for many frames at once.
struct Batch {
    octets: Vec<[u8; FRAME_LEN_MAX]>,
    senders: Vec<libc::sockaddr_ll>,
    controls: Vec<Control>,
    slices: Vec<libc::iovec>,
    headers: Vec<libc::mmsghdr>,
}

struct Frame<'a> {
    stamp_ns: Option<u64>,
    incoming: bool,
    octets: &'a [u8],
}

impl Batch {
    fn new() -> Batch {
        // SAFETY: all zeros is a sockaddr_ll, an iovec and an mmsghdr.
        let (sender, slice, header) = unsafe { (zeroed(), zeroed(), zeroed()) };
        Batch {
            octets: vec![[0; FRAME_LEN_MAX]; BATCH],
            senders: vec![sender; BATCH],
            controls: vec![[0; 8]; BATCH],
            slices: vec![slice; BATCH],
            headers: vec![header; BATCH],
        }
    }

    /// Takes what is there, at most [`BATCH`] frames; 0: nothing.
    fn receive(&mut self, socket: &OwnedFd) -> io::Result<usize> {
        for i in 0..BATCH {
            self.slices[i] = libc::iovec {
                iov_base: self.octets[i].as_mut_ptr().cast(),
                iov_len: FRAME_LEN_MAX,
            };
            let header = &mut self.headers[i].msg_hdr;
            header.msg_name = (&raw mut self.senders[i]).cast();
            header.msg_namelen = size_of::<libc::sockaddr_ll>() as libc::socklen_t;
            header.msg_iov = &raw mut self.slices[i];
            header.msg_iovlen = 1;
            header.msg_control = self.controls[i].as_mut_ptr().cast();
            header.msg_controllen = size_of::<Control>() as _;
            header.msg_flags = 0;
        }
        let (fd, headers) = (socket.as_raw_fd(), self.headers.as_mut_ptr());
        // SAFETY: all BATCH headers point to buffers of this batch of the lengths they state; nothing moves during the call.
        let received =
            unsafe { libc::recvmmsg(fd, headers, BATCH as _, libc::MSG_DONTWAIT as _, std::ptr::null_mut()) };
        match usize::try_from(received) {
            Ok(received) => Ok(received.min(BATCH)),
            Err(_) => match Errno::last() {
                // ENETDOWN: the interface went down under us; it may come again, and the frames so far count.
                Errno::EAGAIN | Errno::EINTR | Errno::ENETDOWN => Ok(0),
                errno => Err(errno.into()),
            },
        }
    }

    /// Gives everything that is there to `take`.
    fn drain(&mut self, socket: &OwnedFd, mut take: impl FnMut(Frame<'_>)) -> io::Result<()> {
        loop {
            let received = self.receive(socket)?;
            self.frames(received).for_each(&mut take);
            if received < BATCH {
                return Ok(());
            }
        }
    }

    fn frames(&self, received: usize) -> impl Iterator<Item = Frame<'_>> {
        (0..received).map(|i| {
            let header = &self.headers[i];
            Frame {
                stamp_ns: stamp_ns(&header.msg_hdr),
                incoming: self.senders[i].sll_pkttype != libc::PACKET_OUTGOING,
                octets: &self.octets[i][..(header.msg_len as usize).min(FRAME_LEN_MAX)],
            }
        })
    }
}

fn stamp_ns(header: &libc::msghdr) -> Option<u64> {
    // SAFETY: the kernel has filled the header and its control buffer, which are part of a living batch.
    let mut message = unsafe { libc::CMSG_FIRSTHDR(header) };
    while !message.is_null() {
        // SAFETY: CMSG_FIRSTHDR and CMSG_NXTHDR give null or a message inside the control buffer.
        let (level, kind) = unsafe { ((*message).cmsg_level, (*message).cmsg_type) };
        if level == libc::SOL_SOCKET && kind == libc::SCM_TIMESTAMPING {
            // SAFETY: the data of this message are three timespecs, perhaps not aligned; the first is the kernel's own stamp.
            let time: libc::timespec = unsafe { libc::CMSG_DATA(message).cast::<libc::timespec>().read_unaligned() };
            let stamp_ns = u64::try_from(time.tv_sec).ok()? * 1_000_000_000 + u64::try_from(time.tv_nsec).ok()?;
            return (stamp_ns > 0).then_some(stamp_ns);
        }
        // SAFETY: as above.
        message = unsafe { libc::CMSG_NXTHDR(header, message) };
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn frame(message_type: u8) -> [u8; 60] {
        let mut frame = [0; 60];
        frame[12..15].copy_from_slice(&[0x88, 0xAB, message_type]);
        frame
    }

    #[test]
    fn periods_by_hand() {
        let mut tally = Tally::new(1000);
        let base_ns = 1_700_000_000_000_000_000;
        for at_us in [0, 999, 2_001, 3_000, 20_000, 21_000, 1_000_000, 1_001_004] {
            tally.add(Some(base_ns + at_us * 1000), true, &frame(0x01));
        }
        // Sent frames, frames without a stamp and other frames are no periods.
        tally.add(Some(base_ns + 1_001_500_000), false, &frame(0x01));
        tally.add(None, true, &frame(0x01));
        tally.add(Some(base_ns + 1_001_900_000), true, &frame(0x01));
        for message_type in [0x03, 0x83, 0x04, 0x05, 0x06, 0x0D] {
            tally.add(Some(base_ns), true, &frame(message_type));
        }
        tally.add(Some(base_ns), true, &[0xFF; 60]);
        tally.add(Some(base_ns), true, &[]);
        let report = tally.report("plk1".into(), 0);
        // 999, 1002, 999, (17000), 1000, (979000), 1004
        assert_eq!((report.n, report.restarts, report.frames_unstamped), (5, 2, 1));
        assert!((report.period_mean_us - 1000.8).abs() < 1e-9);
        assert!((report.period_std_us - 3.76f64.sqrt()).abs() < 1e-9);
        assert_eq!((report.period_min_us, report.period_max_us), (999.0, 1004.0));
        assert!((report.period_range_us - 5.0).abs() < 1e-9);
        assert_eq!(report.second_maxima_us, [1002.0, 1004.0]);
        let frames = FrameCounts {
            soc: 11,
            preq: 2,
            pres: 1,
            soa: 1,
            asnd: 1,
            other: 1,
            foreign: 2,
        };
        assert_eq!(report.frames, frames);
        assert_eq!(report.histogram.iter().map(|bucket| bucket.count).sum::<u64>(), 5);
        let table = "\
SoC period at plk1, µs               mean    max range      std dev            n
cycle 1000                       1000.800        5.000        1.939            5
the SoC paused 2 times for more than 10 cycles";
        assert_eq!(report.to_string(), table);
        let json = serde_json::to_value(&report).unwrap();
        for key in [
            "n",
            "period_mean_us",
            "period_std_us",
            "period_range_us",
            "period_max_us",
            "frames",
        ] {
            assert!(!json[key].is_null(), "{key}");
        }
    }

    #[test]
    fn an_empty_measurement_is_a_report_of_zeros() {
        let report = Tally::new(1000).report("plk1".into(), 3);
        assert_eq!((report.n, report.period_mean_us, report.period_range_us), (0, 0.0, 0.0));
        assert!(
            report
                .to_string()
                .ends_with("3 frames were not seen for lack of room: some periods are wrong")
        );
    }

    #[test]
    fn an_unknown_interface_is_an_error_that_names_it() {
        let error = Analyser::start("no-such-if", None, 1000, None)
            .err()
            .unwrap()
            .to_string();
        assert!(error.starts_with("interface no-such-if: find: "), "{error}");
    }

    proptest! {
        #[test]
        fn no_frame_and_no_stamp_panics(frames in prop::collection::vec(
            (any::<Option<u64>>(), any::<bool>(), prop::collection::vec(any::<u8>(), 0..20)), 0..20,
        )) {
            let mut tally = Tally::new(1000);
            for (stamp_ns, incoming, octets) in &frames {
                tally.add(*stamp_ns, *incoming, octets);
                tally.add(*stamp_ns, *incoming, &frame(0x01));
            }
            let total = tally.report("x".into(), 0).frames;
            let sum = total.soc + total.preq + total.pres + total.soa + total.asnd + total.other + total.foreign;
            prop_assert_eq!(sum, 2 * frames.len() as u64);
        }
    }
}
