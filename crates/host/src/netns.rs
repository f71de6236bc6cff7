//! A private wire: a network namespace of our own with a pair of virtual Ethernet ports, without the `ip` program.
//!
//! In:  two interface names.
//! Out: the process lives in a new network namespace in which frames sent on one interface arrive at the other and nobody
//!      else sends; its children inherit it, and it is gone with the last of them.
//!
//! Root needs a network namespace only and keeps all rights; an ordinary user gets a user namespace around it. Must run
//! while the process has one thread.

use nix::errno::Errno;
use nix::net::if_::if_nametoindex;
use nix::sched::{CloneFlags, unshare};
use nix::sys::socket::{AddressFamily, MsgFlags, NetlinkAddr, SockFlag, SockProtocol, SockType, recv, sendto, socket};
use std::fs::read_to_string;
use std::os::fd::{AsRawFd, OwnedFd};

/// Why there is no private wire.
#[derive(Debug, thiserror::Error)]
pub enum NetnsError {
    /// The process has threads, and a namespace is entered by one only.
    #[error("a network namespace must be made before any thread is started; there are {threads}")]
    Threads {
        /// Threads there are.
        threads: usize,
    },
    /// The system forbids it.
    #[error("{doing} is not permitted ({errno}): {fix}")]
    Forbidden {
        /// What was tried.
        doing: String,
        errno: Errno,
        /// What forbids it and how to change that.
        fix: String,
    },
    /// Anything else that failed.
    #[error("{doing} failed: {cause}")]
    System {
        /// What was tried.
        doing: String,
        cause: String,
    },
    /// No legal name of an interface.
    #[error("interface name '{name}': expected 1 to 15 characters without spaces, slashes and colons")]
    Name { name: String },
}

/// The wire that was made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wire {
    pub near: String,
    /// The other end.
    pub far: String,
    /// Whether a user namespace was needed: rights over the rest of the PC are lost in it.
    pub user_namespace: bool,
    /// What could not be done, one sentence each; frames of the PC itself may appear on the wire.
    pub notes: Vec<String>,
}

/// Moves the process into a new network namespace and makes both ends of the wire in it, up and quiet.
///
/// # Errors
/// [`NetnsError::Forbidden`] says what forbids it; the process is then where it was, unless the namespace came and the
/// wire did not.
pub fn private_wire(near: &str, far: &str) -> Result<Wire, NetnsError> {
    check_interface_name(near)?;
    check_interface_name(far)?;
    let user_namespace = enter()?;
    let notes = add_wire(near, far)?;
    Netlink::open()?.set_flags("lo", libc::IFF_UP)?;
    Ok(Wire {
        near: near.to_owned(),
        far: far.to_owned(),
        user_namespace,
        notes,
    })
}

/// Makes one more wire in the network namespace of the process, up and quiet; gives what could not be done (see
/// [`Wire::notes`]).
///
/// # Errors
/// As [`private_wire`].
pub fn add_wire(near: &str, far: &str) -> Result<Vec<String>, NetnsError> {
    check_interface_name(near)?;
    check_interface_name(far)?;
    let netlink = Netlink::open()?;
    netlink.request(
        &veth_request(near, far),
        &format!("making the interfaces {near} and {far}"),
    )?;
    let mut notes = Vec::new();
    for interface in [near, far] {
        notes.extend(disable_ipv6(interface));
        // NOARP, and no address is ever given: the PC itself has nothing to say on this wire.
        netlink.set_flags(interface, libc::IFF_UP | libc::IFF_NOARP)?;
    }
    Ok(notes)
}

/// Enters a new, empty network namespace; into it [`give_interface`] can bring one end of a wire.
///
/// # Errors
/// As [`private_wire`].
pub fn private_namespace() -> Result<(), NetnsError> {
    enter().map(drop)
}

/// Gives an interface of this namespace to the namespace of the process `pid`. It is down there until [`start_interface`].
///
/// # Errors
/// [`NetnsError::Forbidden`] or [`NetnsError::System`], with what was tried.
pub fn give_interface(interface: &str, pid: u32) -> Result<(), NetnsError> {
    check_interface_name(interface)?;
    let doing = format!("giving the interface {interface} to the namespace of process {pid}");
    let index = if_nametoindex(interface).map_err(|errno| refused(&doing, errno))?;
    let mut message = Message::new_link(0, index as i32, 0, 0);
    message.attribute(rt::IFLA_NET_NS_PID, |content| content.0.extend(pid.to_ne_bytes()));
    Netlink::open()?.request(&message.finish(), &doing)
}

/// Starts an interface of this namespace that answers no ARP and has no IPv6; what could not be done is told.
///
/// # Errors
/// [`NetnsError::Forbidden`] or [`NetnsError::System`], with what was tried.
pub fn start_interface(interface: &str) -> Result<Option<String>, NetnsError> {
    check_interface_name(interface)?;
    let note = disable_ipv6(interface);
    Netlink::open()?.set_flags(interface, libc::IFF_UP | libc::IFF_NOARP)?;
    Ok(note)
}

/// Enters a new network namespace; true: with a user namespace around it.
fn enter() -> Result<bool, NetnsError> {
    // In a user namespace everybody is root: his folders are those of the number that he has outside.
    hal_pins::directories();
    let threads = std::fs::read_dir("/proc/self/task").map_or(1, Iterator::count);
    if threads != 1 {
        return Err(NetnsError::Threads { threads });
    }
    match unshare(CloneFlags::CLONE_NEWNET) {
        Ok(()) => return Ok(false),
        Err(Errno::EPERM) => {}
        Err(errno) => return Err(refused("a network namespace", errno)),
    }
    let (uid, gid) = (nix::unistd::geteuid(), nix::unistd::getegid());
    unshare(CloneFlags::CLONE_NEWUSER | CloneFlags::CLONE_NEWNET)
        .map_err(|errno| refused("a network namespace of an ordinary user", errno))?;
    // The kernel lets an ordinary user map groups only after it has given up setgroups.
    for (file, line) in [
        ("/proc/self/setgroups", "deny".to_owned()),
        ("/proc/self/uid_map", format!("0 {uid} 1")),
        ("/proc/self/gid_map", format!("0 {gid} 1")),
    ] {
        std::fs::write(file, line).map_err(|cause| match cause.raw_os_error().map(Errno::from_raw) {
            Some(errno) => refused(&format!("writing {file}"), errno),
            None => NetnsError::System {
                doing: format!("writing {file}"),
                cause: cause.to_string(),
            },
        })?;
    }
    Ok(true)
}

fn refused(doing: &str, errno: Errno) -> NetnsError {
    match errno {
        Errno::EPERM | Errno::EACCES | Errno::ENOSPC => {
            let sysctl = |key: &str| {
                read_to_string(format!("/proc/sys/{}", key.replace('.', "/")))
                    .ok()
                    .map(|value| value.trim().to_owned())
            };
            NetnsError::Forbidden {
                doing: doing.to_owned(),
                errno,
                fix: what_forbids(sysctl),
            }
        }
        other => NetnsError::System {
            doing: doing.to_owned(),
            cause: other.to_string(),
        },
    }
}

/// Finds the setting that forbids namespaces to ordinary users. `sysctl` reads a setting.
fn what_forbids(sysctl: impl Fn(&str) -> Option<String>) -> String {
    for (key, forbidding, allowing) in [
        ("kernel.unprivileged_userns_clone", "0", "1"),
        ("kernel.apparmor_restrict_unprivileged_userns", "1", "0"),
        ("user.max_user_namespaces", "0", "10000"),
        ("user.max_net_namespaces", "0", "10000"),
    ] {
        if sysctl(key).as_deref() == Some(forbidding) {
            return format!("{key} = {forbidding} forbids it; as root: sysctl -w {key}={allowing}, or run as root");
        }
    }
    "run as root; inside a container, start the container with the right to make namespaces (--privileged)".to_owned()
}

/// Keeps the kernel from sending neighbour discovery on the interface; gives what could not be done.
fn disable_ipv6(interface: &str) -> Option<String> {
    let file = format!("/proc/sys/net/ipv6/conf/{interface}/disable_ipv6");
    match std::fs::write(&file, "1") {
        Ok(()) => None,
        // A kernel without IPv6 has nothing to disable.
        Err(cause) if cause.kind() == std::io::ErrorKind::NotFound => None,
        Err(cause) => Some(format!("IPv6 stays on at {interface}: {file}: {cause}")),
    }
}

fn check_interface_name(name: &str) -> Result<(), NetnsError> {
    let legal = |c: u8| c.is_ascii_graphic() && c != b'/' && c != b':';
    if (1..=15).contains(&name.len()) && name.bytes().all(legal) && name != "." && name != ".." {
        return Ok(());
    }
    Err(NetnsError::Name { name: name.to_owned() })
}

/// Message types, flags and attributes of rtnetlink, as in `linux/rtnetlink.h`, `linux/if_link.h`, `linux/veth.h`.
mod rt {
    pub(super) const RTM_NEWLINK: u16 = 16;
    pub(super) const NLMSG_ERROR: u16 = 2;
    pub(super) const NLM_F_REQUEST: u16 = 0x001;
    pub(super) const NLM_F_ACK: u16 = 0x004;
    pub(super) const NLM_F_EXCL: u16 = 0x200;
    pub(super) const NLM_F_CREATE: u16 = 0x400;
    pub(super) const IFLA_NET_NS_PID: u16 = 19;
    pub(super) const IFLA_IFNAME: u16 = 3;
    pub(super) const IFLA_LINKINFO: u16 = 18;
    pub(super) const IFLA_INFO_KIND: u16 = 1;
    pub(super) const IFLA_INFO_DATA: u16 = 2;
    pub(super) const VETH_INFO_PEER: u16 = 1;
}

/// A message under construction. Numbers are in native byte order, parts begin on multiples of 4.
struct Message(Vec<u8>);

impl Message {
    fn new_link(flags: u16, index: i32, interface_flags: u32, change: u32) -> Message {
        let mut message = Message(vec![0; 4]); // the length, known at the end
        message.0.extend(rt::RTM_NEWLINK.to_ne_bytes());
        message
            .0
            .extend((rt::NLM_F_REQUEST | rt::NLM_F_ACK | flags).to_ne_bytes());
        message.0.extend(1u32.to_ne_bytes()); // sequence number
        message.0.extend(0u32.to_ne_bytes()); // to the kernel
        message.interface_info(index, interface_flags, change);
        message
    }

    /// `struct ifinfomsg`
    fn interface_info(&mut self, index: i32, flags: u32, change: u32) {
        self.0.extend([libc::AF_UNSPEC as u8, 0, 0, 0]);
        self.0.extend(index.to_ne_bytes());
        self.0.extend(flags.to_ne_bytes());
        self.0.extend(change.to_ne_bytes());
    }

    /// Adds an attribute whose content is written by `content`.
    fn attribute(&mut self, kind: u16, content: impl FnOnce(&mut Message)) {
        let start = self.0.len();
        self.0.extend([0; 2]);
        self.0.extend(kind.to_ne_bytes());
        content(self);
        // Names are short, so no attribute comes near 64 KiB.
        let length = (self.0.len() - start) as u16;
        self.0[start..start + 2].copy_from_slice(&length.to_ne_bytes());
        self.0.resize(self.0.len().next_multiple_of(4), 0);
    }

    fn text(&mut self, kind: u16, text: &str) {
        self.attribute(kind, |message| {
            message.0.extend(text.as_bytes());
            message.0.push(0);
        });
    }

    fn finish(mut self) -> Vec<u8> {
        let length = (self.0.len() as u32).to_ne_bytes();
        self.0[..4].copy_from_slice(&length);
        self.0
    }
}

/// The request for a pair of connected interfaces.
fn veth_request(near: &str, far: &str) -> Vec<u8> {
    let mut message = Message::new_link(rt::NLM_F_CREATE | rt::NLM_F_EXCL, 0, 0, 0);
    message.text(rt::IFLA_IFNAME, near);
    message.attribute(rt::IFLA_LINKINFO, |info| {
        info.text(rt::IFLA_INFO_KIND, "veth");
        info.attribute(rt::IFLA_INFO_DATA, |data| {
            data.attribute(rt::VETH_INFO_PEER, |peer| {
                peer.interface_info(0, 0, 0);
                peer.text(rt::IFLA_IFNAME, far);
            });
        });
    });
    message.finish()
}

struct Netlink(OwnedFd);

impl Netlink {
    fn open() -> Result<Netlink, NetnsError> {
        let protocol = SockProtocol::NetlinkRoute;
        socket(AddressFamily::Netlink, SockType::Raw, SockFlag::SOCK_CLOEXEC, protocol)
            .map(Netlink)
            .map_err(|errno| refused("a netlink socket", errno))
    }

    /// Sends a request and waits for the kernel's answer, which comes before `sendto` returns.
    fn request(&self, message: &[u8], doing: &str) -> Result<(), NetnsError> {
        let fd = self.0.as_raw_fd();
        let failed = |errno| refused(doing, errno);
        sendto(fd, message, &NetlinkAddr::new(0, 0), MsgFlags::empty()).map_err(failed)?;
        let mut answer = [0; 8192];
        let length = recv(fd, &mut answer, MsgFlags::empty()).map_err(failed)?;
        match answer_errno(&answer[..length.min(answer.len())]) {
            Some(0) => Ok(()),
            Some(errno) => Err(failed(Errno::from_raw(errno))),
            None => Err(NetnsError::System {
                doing: doing.to_owned(),
                cause: "the kernel's answer is unknown".into(),
            }),
        }
    }

    fn set_flags(&self, interface: &str, flags: i32) -> Result<(), NetnsError> {
        let doing = format!("starting the interface {interface}");
        let index = if_nametoindex(interface).map_err(|errno| refused(&doing, errno))?;
        let message = Message::new_link(0, index as i32, flags as u32, flags as u32).finish();
        self.request(&message, &doing)
    }
}

/// The error number in an answer, 0 for success; `None` if it is no such answer.
fn answer_errno(answer: &[u8]) -> Option<i32> {
    let kind = u16::from_ne_bytes(answer.get(4..6)?.try_into().ok()?);
    let errno = i32::from_ne_bytes(answer.get(16..20)?.try_into().ok()?);
    (kind == rt::NLMSG_ERROR).then(|| errno.saturating_neg())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_endian = "little")]
    fn the_request_for_a_pair_octet_by_octet() {
        #[rustfmt::skip]
        let expected: [u8; 96] = [
            96, 0, 0, 0,  16, 0,  5, 6,  1, 0, 0, 0,  0, 0, 0, 0,          // length, RTM_NEWLINK, flags, sequence, port
            0, 0, 0, 0,  0, 0, 0, 0,  0, 0, 0, 0,  0, 0, 0, 0,             // ifinfomsg
            9, 0, 3, 0, b'p', b'l', b'k', b'0', 0, 0, 0, 0,                // IFLA_IFNAME
            52, 0, 18, 0,                                                  // IFLA_LINKINFO
            9, 0, 1, 0, b'v', b'e', b't', b'h', 0, 0, 0, 0,                // IFLA_INFO_KIND
            36, 0, 2, 0,                                                   // IFLA_INFO_DATA
            32, 0, 1, 0,                                                   // VETH_INFO_PEER
            0, 0, 0, 0,  0, 0, 0, 0,  0, 0, 0, 0,  0, 0, 0, 0,             // ifinfomsg of the peer
            9, 0, 3, 0, b'p', b'l', b'k', b'1', 0, 0, 0, 0,                // IFLA_IFNAME
        ];
        assert_eq!(veth_request("plk0", "plk1"), expected);
    }

    #[test]
    fn answers_of_the_kernel() {
        let answer = |kind: u16, errno: i32| {
            let mut octets = vec![0; 36];
            octets[4..6].copy_from_slice(&kind.to_ne_bytes());
            octets[16..20].copy_from_slice(&errno.to_ne_bytes());
            octets
        };
        assert_eq!(answer_errno(&answer(2, 0)), Some(0));
        assert_eq!(answer_errno(&answer(2, -17)), Some(17));
        assert_eq!(answer_errno(&answer(2, i32::MIN)), Some(i32::MAX));
        assert_eq!(answer_errno(&answer(16, 0)), None);
        for length in 0..20 {
            assert_eq!(answer_errno(&answer(2, -1)[..length]), None);
        }
    }

    #[test]
    fn the_setting_that_forbids_is_named() {
        let with = |key: &'static str, value: &'static str| {
            what_forbids(move |asked| (asked == key).then(|| value.to_owned()))
        };
        assert_eq!(
            with("kernel.apparmor_restrict_unprivileged_userns", "1"),
            "kernel.apparmor_restrict_unprivileged_userns = 1 forbids it; as root: \
             sysctl -w kernel.apparmor_restrict_unprivileged_userns=0, or run as root"
        );
        assert!(with("kernel.unprivileged_userns_clone", "0").contains("kernel.unprivileged_userns_clone=1"));
        assert!(with("user.max_user_namespaces", "0").contains("user.max_user_namespaces=10000"));
        assert!(with("user.max_user_namespaces", "100").starts_with("run as root"));
    }

    #[test]
    fn illegal_names_are_refused_before_anything_happens() {
        for name in ["", "a/b", "a b", "a:1", "..", "sixteen-letters-"] {
            assert!(
                matches!(private_wire("plk0", name), Err(NetnsError::Name { .. })),
                "{name:?}"
            );
        }
        assert!(check_interface_name("fifteen-letters").is_ok());
    }
}
