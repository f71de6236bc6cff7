//! What the driver of a network interface tells about itself, by the calls that `ethtool` uses.
//!
//! In:  name of an interface. Out: its settings, or why there is no answer. Only asks, sets nothing; every user may.

use crate::doctor::experiments::{Coalescing, NoAnswer, Offload, TimeStamps};
use nix::errno::Errno;
use nix::sys::socket::{AddressFamily, SockFlag, SockType, socket};
use std::os::fd::AsRawFd;

/// `linux/sockios.h`
const SIOCETHTOOL: libc::c_ulong = 0x8946;

/// Numbers of questions, as in `linux/ethtool.h`.
mod question {
    pub(super) const DRIVER: u32 = 0x03;
    pub(super) const COALESCING: u32 = 0x0E;
    pub(super) const PAUSE: u32 = 0x12;
    pub(super) const TSO: u32 = 0x1E;
    pub(super) const GSO: u32 = 0x23;
    pub(super) const FLAGS: u32 = 0x25;
    pub(super) const GRO: u32 = 0x2B;
    pub(super) const TIME_STAMPS: u32 = 0x41;
    pub(super) const EEE: u32 = 0x44;
}

/// Bits of the answer to FLAGS.
mod flag {
    pub(super) const TX_VLAN: u32 = 1 << 7;
    pub(super) const RX_VLAN: u32 = 1 << 8;
    pub(super) const LRO: u32 = 1 << 15;
}

/// SOF_TIMESTAMPING_RX_HARDWARE and SOF_TIMESTAMPING_RAW_HARDWARE: frames that come are stamped by the NIC.
const HARDWARE_STAMPS: u32 = 1 << 2 | 1 << 6;

/// Every answer is a row of 32-bit numbers, of which the first is the question.
fn ask<const WORDS: usize>(interface: &str, question: u32) -> Result<[u32; WORDS], NoAnswer> {
    let refused = |errno: Errno| match errno {
        Errno::EOPNOTSUPP | Errno::EINVAL => NoAnswer::NotSupported,
        errno => NoAnswer::Refused(format!("{interface} does not answer ({errno})")),
    };
    let socket = socket(AddressFamily::Inet, SockType::Datagram, SockFlag::SOCK_CLOEXEC, None).map_err(refused)?;
    let mut words = [0u32; WORDS];
    words[0] = question;
    // SAFETY: all members of ifreq are numbers and a pointer, for which zero is a value.
    let mut request: libc::ifreq = unsafe { std::mem::zeroed() };
    // The last octet stays zero.
    let room = request.ifr_name.len() - 1;
    for (to, from) in request.ifr_name[..room].iter_mut().zip(interface.bytes()) {
        *to = from as libc::c_char;
    }
    request.ifr_ifru.ifru_data = words.as_mut_ptr().cast();
    // SAFETY: `request` and `words` live through the call, and `words` is as long as the answer to this question.
    Errno::result(unsafe { libc::ioctl(socket.as_raw_fd(), SIOCETHTOOL as _, &mut request) }).map_err(refused)?;
    Ok(words)
}

/// Name of the driver.
pub(super) fn driver(interface: &str) -> Result<String, NoAnswer> {
    // struct ethtool_drvinfo: the question, then the name in 32 octets, ended by a zero.
    let words = ask::<49>(interface, question::DRIVER)?;
    let octets: Vec<u8> = words[1..9].iter().flat_map(|word| word.to_ne_bytes()).collect();
    let name = octets.split(|octet| *octet == 0).next().unwrap_or_default();
    Ok(name.escape_ascii().to_string())
}

/// How long interrupts wait for more frames.
pub(super) fn coalescing(interface: &str) -> Result<Coalescing, NoAnswer> {
    // struct ethtool_coalesce
    let words = ask::<23>(interface, question::COALESCING)?;
    Ok(Coalescing {
        rx_usecs: words[1],
        tx_usecs: words[5],
        adaptive: words[10] != 0 || words[11] != 0,
    })
}

/// Offloads that are on.
pub(super) fn offloads(interface: &str) -> Result<Vec<Offload>, NoAnswer> {
    // struct ethtool_value; a driver that has no such thing has not switched it on.
    let value = |question| match ask::<2>(interface, question) {
        Ok(words) => Ok(words[1]),
        Err(NoAnswer::NotSupported) => Ok(0),
        Err(refused) => Err(refused),
    };
    let flags = value(question::FLAGS)?;
    let mut on = Vec::new();
    for offload in Offload::ALL {
        let is_on = match offload {
            Offload::Gro => value(question::GRO)? != 0,
            Offload::Gso => value(question::GSO)? != 0,
            Offload::Tso => value(question::TSO)? != 0,
            Offload::Lro => flags & flag::LRO != 0,
            Offload::RxVlan => flags & flag::RX_VLAN != 0,
            Offload::TxVlan => flags & flag::TX_VLAN != 0,
        };
        if is_on {
            on.push(offload);
        }
    }
    Ok(on)
}

/// Whether Energy-Efficient Ethernet is on.
pub(super) fn energy_efficient(interface: &str) -> Result<bool, NoAnswer> {
    // struct ethtool_eee: eee_enabled
    Ok(ask::<10>(interface, question::EEE)?[5] != 0)
}

/// Whether PAUSE frames are sent or obeyed.
pub(super) fn flow_control(interface: &str) -> Result<bool, NoAnswer> {
    // struct ethtool_pauseparam: rx_pause, tx_pause
    let words = ask::<4>(interface, question::PAUSE)?;
    Ok(words[2] != 0 || words[3] != 0)
}

/// Who stamps frames.
pub(super) fn time_stamps(interface: &str) -> Result<TimeStamps, NoAnswer> {
    // struct ethtool_ts_info: so_timestamping
    let words = ask::<11>(interface, question::TIME_STAMPS)?;
    Ok(TimeStamps {
        hardware: words[1] & HARDWARE_STAMPS == HARDWARE_STAMPS,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_loopback_interface_answers_and_one_that_is_not_there_does_not() {
        // Its driver has neither a name nor anything to set but software offloads.
        assert!(matches!(driver("lo"), Ok(_) | Err(NoAnswer::NotSupported)));
        assert_eq!(coalescing("lo"), Err(NoAnswer::NotSupported));
        assert_eq!(energy_efficient("lo"), Err(NoAnswer::NotSupported));
        assert!(offloads("lo").is_ok());
        for name in ["", "no-such-one", "a-name-that-is-much-too-long"] {
            assert!(matches!(driver(name), Err(NoAnswer::Refused(_))), "{name}");
        }
    }
}
