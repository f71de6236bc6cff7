//! IP over the bus: a TAP device whose frames travel in the asynchronous slot.
//!
//! In:  frames that programs of this PC send to 192.168.100.0/24. Out: the same frames through a ring to the bus thread,
//! which sends one in a slot of its own; and frames of other nodes from the wire into the device.
//!
//! The device carries the MAC of the interface, so that frames of the nodes reach it; the interface itself must have no
//! address and answer no ARP, or the PC would talk on the wire outside of its slot ([`Tap::open`] sees to ARP). Needs the right
//! to configure the network (CAP_NET_ADMIN) and `/dev/net/tun`.

use crate::EthernetFrame;
use nix::errno::Errno;
use nix::fcntl::OFlag;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::stat::Mode;
use nix::unistd::{read, write};
use powerlink::wire::{FRAME_LEN_MAX, Mac};
use rtrb::{Consumer, Producer, RingBuffer};
use std::net::Ipv4Addr;
use std::os::fd::{AsFd, AsRawFd, FromRawFd, OwnedFd};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;

/// Frames that may wait for their slot; more are dropped, as on any network that is too slow for its traffic.
const WAITING: usize = 32;
/// How long a wish to end may go unnoticed, ms.
const STOP_LOOK_MS: u16 = 50;
const ETH_P_IP: u16 = libc::ETH_P_IP as u16;
const ETH_P_ARP: u16 = libc::ETH_P_ARP as u16;

/// What could not be set up.
#[derive(Debug, thiserror::Error)]
pub enum TapError {
    /// No legal name of an interface.
    #[error("TAP device '{0}': expected a name of 1 to 15 characters")]
    Name(String),
    /// The system refused.
    #[error("TAP device '{name}': {doing}: {errno}{hint}")]
    System {
        /// Name of the device.
        name: String,
        /// What was tried.
        doing: &'static str,
        errno: Errno,
        /// What may help.
        hint: &'static str,
    },
}

/// An open TAP device, up, with its address. It is gone when this value is dropped.
#[derive(Debug)]
pub struct Tap {
    device: OwnedFd,
    /// Raw sockets of the interface, one for each EtherType that passes.
    wire: [OwnedFd; 2],
}

/// One request to the kernel about an interface.
fn interface_request(name: &str) -> Result<libc::ifreq, TapError> {
    // SAFETY: an ifreq of zeros is a valid one.
    let mut request: libc::ifreq = unsafe { std::mem::zeroed() };
    if name.is_empty() || name.len() >= request.ifr_name.len() || !name.is_ascii() {
        return Err(TapError::Name(name.to_owned()));
    }
    for (to, from) in request.ifr_name.iter_mut().zip(name.bytes()) {
        *to = from as libc::c_char;
    }
    Ok(request)
}

fn ioctl(fd: &OwnedFd, code: libc::c_ulong, request: &mut libc::ifreq) -> Result<(), Errno> {
    // SAFETY: `request` is a valid ifreq that lives through the call, and every code used here reads or writes one.
    Errno::result(unsafe { libc::ioctl(fd.as_raw_fd(), code as _, std::ptr::from_mut(request)) }).map(drop)
}

fn ipv4(address: Ipv4Addr) -> libc::sockaddr {
    let internet = libc::sockaddr_in {
        sin_family: libc::AF_INET as libc::sa_family_t,
        sin_port: 0,
        sin_addr: libc::in_addr {
            s_addr: u32::from_ne_bytes(address.octets()),
        },
        sin_zero: [0; 8],
    };
    // SAFETY: both are plain data of the same length, and the family says which of the two it is.
    unsafe { std::mem::transmute(internet) }
}

impl Tap {
    /// Makes the device `name` with the address 192.168.100.`node` and connects it with `interface`, whose MAC it takes.
    /// `mtu`: the longest IP packet, octets (AsyncMTU, 0x1F98/8).
    pub fn open(name: &str, interface: &str, mac: Mac, node: u8, mtu: u16) -> Result<Tap, TapError> {
        let refused = |doing: &'static str| {
            let name = name.to_owned();
            move |errno| TapError::System {
                name: name.clone(),
                doing,
                errno,
                hint: match errno {
                    Errno::EPERM | Errno::EACCES => "; it needs root or CAP_NET_ADMIN",
                    Errno::ENOENT | Errno::ENODEV => "; load the kernel module tun",
                    Errno::EBUSY => "; another program has it",
                    _ => "",
                },
            }
        };
        let flags = OFlag::O_RDWR | OFlag::O_NONBLOCK | OFlag::O_CLOEXEC;
        let device = nix::fcntl::open("/dev/net/tun", flags, Mode::empty()).map_err(refused("opening /dev/net/tun"))?;
        let mut request = interface_request(name)?;
        request.ifr_ifru.ifru_flags = (libc::IFF_TAP | libc::IFF_NO_PI) as libc::c_short;
        ioctl(&device, libc::TUNSETIFF as libc::c_ulong, &mut request).map_err(refused("making the device"))?;
        // The device works without it: IPv6 would only send advertisements that cost slots.
        let _ = std::fs::write(format!("/proc/sys/net/ipv6/conf/{name}/disable_ipv6"), "1");

        let control = socket(libc::AF_INET, libc::SOCK_DGRAM, 0).map_err(refused("a socket"))?;
        let mut request = interface_request(name)?;
        // SAFETY: plain data; the kernel reads the family and six octets of address.
        let mut hardware: libc::sockaddr = unsafe { std::mem::zeroed() };
        hardware.sa_family = libc::ARPHRD_ETHER;
        for (to, from) in hardware.sa_data.iter_mut().zip(mac) {
            *to = from as libc::c_char;
        }
        request.ifr_ifru.ifru_hwaddr = hardware;
        ioctl(&control, libc::SIOCSIFHWADDR as libc::c_ulong, &mut request).map_err(refused("setting its MAC"))?;
        request.ifr_ifru.ifru_mtu = i32::from(mtu);
        ioctl(&control, libc::SIOCSIFMTU as libc::c_ulong, &mut request).map_err(refused("setting its MTU"))?;
        request.ifr_ifru.ifru_addr = ipv4(Ipv4Addr::new(192, 168, 100, node));
        ioctl(&control, libc::SIOCSIFADDR as libc::c_ulong, &mut request).map_err(refused("setting its address"))?;
        request.ifr_ifru.ifru_netmask = ipv4(Ipv4Addr::new(255, 255, 255, 0));
        ioctl(&control, libc::SIOCSIFNETMASK as libc::c_ulong, &mut request).map_err(refused("setting its mask"))?;
        add_flags(&control, name, libc::IFF_UP).map_err(refused("switching it on"))?;
        // The interface itself says nothing: Linux answers ARP for every address of the PC on every interface.
        add_flags(&control, interface, libc::IFF_NOARP).map_err(refused("switching ARP of the interface off"))?;
        let wire = [
            wire_socket(interface, ETH_P_IP).map_err(refused("a raw socket"))?,
            wire_socket(interface, ETH_P_ARP).map_err(refused("a raw socket"))?,
        ];
        Ok(Tap { device, wire })
    }

    /// Runs the device in a thread of its own, which first calls `enter`. The other end of the ring belongs to the bus thread.
    pub fn start(self, enter: fn()) -> std::io::Result<(TapBridge, Consumer<EthernetFrame>)> {
        let (producer, consumer) = RingBuffer::new(WAITING);
        let shared = Arc::new(Shared::default());
        let inside = Arc::clone(&shared);
        let thread = std::thread::Builder::new().name("tap".into()).spawn(move || {
            enter();
            self.run(producer, &inside);
        })?;
        let thread = Some(thread);
        Ok((TapBridge { shared, thread }, consumer))
    }

    fn run(self, mut outgoing: Producer<EthernetFrame>, shared: &Shared) {
        let mut buffer = [0; FRAME_LEN_MAX];
        while !shared.stop.load(Ordering::Relaxed) {
            let [ip, arp] = &self.wire;
            let mut ready = [&self.device, ip, arp].map(|fd| PollFd::new(fd.as_fd(), PollFlags::POLLIN));
            if poll(&mut ready, PollTimeout::from(STOP_LOOK_MS)).unwrap_or(0) == 0 {
                continue;
            }
            let gone = PollFlags::POLLERR | PollFlags::POLLHUP | PollFlags::POLLNVAL;
            if ready[0].revents().is_some_and(|events| events.intersects(gone)) {
                tracing::warn!("the TAP device has been deleted: IP frames of other programs are not carried any more");
                return;
            }
            while let Ok(length) = read(&self.device, &mut buffer) {
                shared.enqueue(&mut outgoing, &buffer[..length]);
            }
            for wire in &self.wire {
                while let Ok(length) = read(wire, &mut buffer) {
                    // A device that is switched off takes nothing; the frame is lost, as on any network.
                    let _ = write(&self.device, &buffer[..length]);
                    shared.received.fetch_add(1, Ordering::Relaxed);
                }
            }
        }
    }
}

fn socket(domain: i32, kind: i32, protocol: i32) -> Result<OwnedFd, Errno> {
    // SAFETY: takes three numbers and touches no memory.
    let fd = Errno::result(unsafe { libc::socket(domain, kind | libc::SOCK_CLOEXEC, protocol) })?;
    // SAFETY: the descriptor has just been made and belongs to nobody else.
    Ok(unsafe { OwnedFd::from_raw_fd(fd) })
}

fn add_flags(control: &OwnedFd, name: &str, flags: i32) -> Result<(), Errno> {
    let mut request = interface_request(name).map_err(|_| Errno::EINVAL)?;
    ioctl(control, libc::SIOCGIFFLAGS as libc::c_ulong, &mut request)?;
    // SAFETY: SIOCGIFFLAGS has filled in this member.
    let present = unsafe { request.ifr_ifru.ifru_flags };
    request.ifr_ifru.ifru_flags = present | flags as libc::c_short;
    ioctl(control, libc::SIOCSIFFLAGS as libc::c_ulong, &mut request)
}

/// A raw socket that receives the frames of one EtherType that arrive at the interface.
fn wire_socket(interface: &str, ether_type: u16) -> Result<OwnedFd, Errno> {
    let index = nix::net::if_::if_nametoindex(interface)?;
    let protocol = ether_type.to_be();
    // Without a protocol it receives nothing before it is bound.
    let fd = socket(libc::AF_PACKET, libc::SOCK_RAW | libc::SOCK_NONBLOCK, 0)?;
    // SAFETY: a sockaddr_ll of zeros is a valid one.
    let mut address: libc::sockaddr_ll = unsafe { std::mem::zeroed() };
    address.sll_family = libc::AF_PACKET as u16;
    address.sll_protocol = protocol;
    address.sll_ifindex = index as i32;
    let one: libc::c_int = 1;
    // SAFETY: the option is an int that lives through the call.
    Errno::result(unsafe {
        libc::setsockopt(
            fd.as_raw_fd(),
            libc::SOL_PACKET,
            libc::PACKET_IGNORE_OUTGOING,
            (&raw const one).cast(),
            size_of::<libc::c_int>() as libc::socklen_t,
        )
    })?;
    // SAFETY: the address and its length describe one sockaddr_ll that lives through the call.
    Errno::result(unsafe {
        libc::bind(
            fd.as_raw_fd(),
            (&raw const address).cast(),
            size_of::<libc::sockaddr_ll>() as libc::socklen_t,
        )
    })?;
    Ok(fd)
}

#[derive(Debug, Default)]
struct Shared {
    stop: AtomicBool,
    queued: AtomicU64,
    dropped: AtomicU64,
    received: AtomicU64,
}

impl Shared {
    fn enqueue(&self, outgoing: &mut Producer<EthernetFrame>, frame: &[u8]) {
        let counter = match outgoing.push(EthernetFrame::new(frame)) {
            Ok(()) => &self.queued,
            Err(_) => &self.dropped,
        };
        counter.fetch_add(1, Ordering::Relaxed);
    }
}

/// The running device; ends with this value.
#[derive(Debug)]
pub struct TapBridge {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

/// What passed a [`TapBridge`], in frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TapCounters {
    /// Handed to the bus thread.
    pub queued: u64,
    /// Dropped because the slots were too few.
    pub dropped: u64,
    /// From the wire into the device.
    pub received: u64,
}

impl TapBridge {
    /// What has passed so far.
    pub fn counters(&self) -> TapCounters {
        TapCounters {
            queued: self.shared.queued.load(Ordering::Relaxed),
            dropped: self.shared.dropped.load(Ordering::Relaxed),
            received: self.shared.received.load(Ordering::Relaxed),
        }
    }
}

impl Drop for TapBridge {
    fn drop(&mut self) {
        self.shared.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A thread that panicked has said so already.
            let _ = thread.join();
        }
    }
}
