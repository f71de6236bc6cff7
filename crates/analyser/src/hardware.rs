//! Receive stamps taken by the network card itself: whether it can, switching them on, and putting them back as they were.
//!
//! In:  an interface and any socket.
//! Out: the card stamping every frame for as long as [`HardwareStamps`] lives, or the reason why not.
//!
//! Such a stamp is taken where the frame comes off the wire. The kernel's own is taken after the interrupt, and carries
//! whatever delays that.

use std::fmt;
use std::io;
use std::mem::zeroed;
use std::os::fd::{AsRawFd, OwnedFd};

/// From linux/ethtool.h, which `libc` does not have.
const ETHTOOL_GET_TS_INFO: u32 = 0x41;

/// `struct ethtool_ts_info` of linux/ethtool.h.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
struct TsInfo {
    cmd: u32,
    so_timestamping: u32,
    phc_index: i32,
    tx_types: u32,
    tx_reserved: [u32; 3],
    /// One bit per `HWTSTAMP_FILTER_...`.
    rx_filters: u32,
    rx_reserved: [u32; 3],
}

/// Why the stamps are the kernel's and not the network card's.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum NotHardware {
    /// Nobody wanted them.
    NotAsked,
    /// The driver does not say what it can.
    Unknown(String),
    /// The card or its driver cannot.
    NotOffered,
    /// It can, but not for frames of our kind.
    OnlySomeFrames,
    /// Switching them on was refused.
    Refused(String),
    /// Switched on, and yet most frames came without.
    NoneCame,
}

impl fmt::Display for NotHardware {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            NotHardware::NotAsked => write!(f, "not asked for"),
            NotHardware::Unknown(cause) => write!(f, "the driver does not say whether the card can ({cause})"),
            NotHardware::NotOffered => write!(f, "the interface takes none (ethtool -T shows what it can)"),
            NotHardware::OnlySomeFrames => {
                write!(f, "the card stamps clock synchronisation frames only, not all frames")
            }
            NotHardware::Refused(cause) => write!(f, "switching them on was refused: {cause}"),
            NotHardware::NoneCame => write!(f, "switched on, but the card stamped hardly any frame"),
        }
    }
}

/// Keeps the card stamping; dropped, the card is set as it was.
pub(super) struct HardwareStamps<'a> {
    socket: &'a OwnedFd,
    interface: String,
    before: Option<libc::hwtstamp_config>,
}

impl<'a> HardwareStamps<'a> {
    /// Has the card of an interface stamp every frame it receives.
    ///
    /// # Errors
    /// Why it does not.
    pub(super) fn switch_on(socket: &'a OwnedFd, interface: &str) -> Result<HardwareStamps<'a>, NotHardware> {
        let mut info = TsInfo {
            cmd: ETHTOOL_GET_TS_INFO,
            ..TsInfo::default()
        };
        request(socket, interface, libc::SIOCETHTOOL as _, &mut info)
            .map_err(|cause| NotHardware::Unknown(cause.to_string()))?;
        offered(&info)?;
        // SAFETY: all zeros is an hwtstamp_config.
        let mut config: libc::hwtstamp_config = unsafe { zeroed() };
        // Old drivers cannot tell how they are set. Then nothing can be put back: they stay on, which costs nobody anything.
        let before = request(socket, interface, libc::SIOCGHWTSTAMP as _, &mut config)
            .is_ok()
            .then_some(config);
        let all = libc::HWTSTAMP_FILTER_ALL as libc::c_int;
        let on = |before| HardwareStamps {
            socket,
            interface: interface.to_owned(),
            before,
        };
        if before.is_some_and(|before| before.rx_filter == all) {
            return Ok(on(None));
        }
        config.rx_filter = all;
        request(socket, interface, libc::SIOCSHWTSTAMP as _, &mut config).map_err(|cause| {
            NotHardware::Refused(match cause.kind() {
                io::ErrorKind::PermissionDenied => format!("{cause}; run as root or grant cap_net_admin with setcap"),
                _ => cause.to_string(),
            })
        })?;
        let stamps = on(before);
        // A driver may grant less than was asked; dropping `stamps` takes that back.
        if config.rx_filter == all {
            Ok(stamps)
        } else {
            Err(NotHardware::OnlySomeFrames)
        }
    }
}

impl Drop for HardwareStamps<'_> {
    fn drop(&mut self) {
        if let Some(mut before) = self.before {
            // The interface may be gone by now; then there is nothing to put back.
            let _ = request(self.socket, &self.interface, libc::SIOCSHWTSTAMP as _, &mut before);
        }
    }
}

/// Whether a card can stamp every frame it receives.
fn offered(info: &TsInfo) -> Result<(), NotHardware> {
    let needed = libc::SOF_TIMESTAMPING_RX_HARDWARE | libc::SOF_TIMESTAMPING_RAW_HARDWARE;
    if info.so_timestamping & needed != needed {
        Err(NotHardware::NotOffered)
    } else if info.rx_filters & (1 << libc::HWTSTAMP_FILTER_ALL) == 0 {
        Err(NotHardware::OnlySomeFrames)
    } else {
        Ok(())
    }
}

/// A request to the driver of an interface, with what it needs and answers in `data`.
fn request<T>(socket: &OwnedFd, interface: &str, request: libc::Ioctl, data: &mut T) -> io::Result<()> {
    // SAFETY: all zeros is an ifreq.
    let mut ifreq: libc::ifreq = unsafe { zeroed() };
    // The last octet stays zero: it ends the name.
    if interface.len() >= ifreq.ifr_name.len() {
        return Err(io::ErrorKind::InvalidInput.into());
    }
    for (to, from) in ifreq.ifr_name.iter_mut().zip(interface.bytes()) {
        *to = from as libc::c_char;
    }
    ifreq.ifr_ifru.ifru_data = (data as *mut T).cast();
    // SAFETY: `ifreq` and `data`, which is what these requests point to, live through the call and may be written.
    match unsafe { libc::ioctl(socket.as_raw_fd(), request, &raw mut ifreq) } {
        0.. => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::fd::FromRawFd;

    fn info(so_timestamping: u32, rx_filters: u32) -> TsInfo {
        TsInfo {
            so_timestamping,
            rx_filters,
            ..TsInfo::default()
        }
    }

    #[test]
    fn what_cards_offer() {
        // As `ethtool -T` shows them: an i210; a veth pair; a card that stamps PTP frames only; one that stamps for sending only.
        assert_eq!(offered(&info(0x5F, 0b11)), Ok(()));
        assert_eq!(offered(&info(0x1A, 0)), Err(NotHardware::NotOffered));
        assert_eq!(offered(&info(0x5F, 1 << 12 | 1)), Err(NotHardware::OnlySomeFrames));
        assert_eq!(offered(&info(0x5B, 0b11)), Err(NotHardware::NotOffered));
    }

    #[test]
    fn the_structure_is_as_the_kernel_has_it() {
        assert_eq!(size_of::<TsInfo>(), 44);
        assert_eq!(std::mem::offset_of!(TsInfo, rx_filters), 28);
    }

    #[test]
    fn the_loopback_interface_says_why_not() {
        // SAFETY: no memory is touched; the descriptor is checked and nobody else's.
        let socket = unsafe {
            let fd = libc::socket(libc::AF_INET, libc::SOCK_DGRAM, 0);
            assert!(fd >= 0);
            OwnedFd::from_raw_fd(fd)
        };
        let why_not = |interface| HardwareStamps::switch_on(&socket, interface).err();
        assert_eq!(why_not("lo"), Some(NotHardware::NotOffered));
        for interface in ["no-such-if", "a-name-that-is-too-long"] {
            assert!(
                matches!(why_not(interface), Some(NotHardware::Unknown(_))),
                "{interface}"
            );
        }
    }
}
