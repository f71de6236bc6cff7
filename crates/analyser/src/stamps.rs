//! Receive stamps of a frame, out of the control messages that the kernel puts beside it.
//!
//! In:  the octets of a control buffer as `recvmmsg` filled it.
//! Out: the kernel's own stamp and the network card's, each if it is there.

use std::mem::size_of;

/// When a frame came in, by each clock that stamped it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Stamps {
    /// The kernel's stamp, CLOCK_REALTIME, ns.
    pub(super) kernel_ns: Option<u64>,
    /// The stamp of the network card by its own clock, ns.
    pub(super) hardware_ns: Option<u64>,
}

/// Octets of a length, a level and a type.
const HEADER: usize = size_of::<libc::cmsghdr>();
/// Control messages begin and end at multiples of this.
const ALIGN: usize = size_of::<usize>();
const TIME: usize = size_of::<libc::timespec>();

/// The stamps in a control buffer; none where it holds none or is cut off.
pub(super) fn parse(control: &[u8]) -> Stamps {
    let mut stamps = Stamps::default();
    let mut rest = control;
    while let Some((level, kind, data, next)) = message(rest) {
        if level == libc::SOL_SOCKET && kind == libc::SCM_TIMESTAMPING {
            // Three times: the kernel's, one no longer used, the network card's. Zero is a stamp that was not taken.
            stamps.kernel_ns = time_ns(data, 0).or(stamps.kernel_ns);
            stamps.hardware_ns = time_ns(data, 2).or(stamps.hardware_ns);
        }
        rest = next;
    }
    stamps
}

/// Level, type and data of the first message, and what follows it.
fn message(control: &[u8]) -> Option<(libc::c_int, libc::c_int, &[u8], &[u8])> {
    let header = control.get(..HEADER)?;
    let number = |at: usize| {
        header
            .get(at..at + 4)
            .and_then(|octets| octets.try_into().ok())
            .map(i32::from_ne_bytes)
    };
    let length = usize::from_ne_bytes(header.get(..size_of::<usize>())?.try_into().ok()?);
    // The length counts the header; a smaller one would lead nowhere.
    let data = control.get(HEADER..length)?;
    let next = length
        .checked_next_multiple_of(ALIGN)
        .and_then(|next| control.get(next..));
    let (level, kind) = (number(HEADER - 8)?, number(HEADER - 4)?);
    Some((level, kind, data, next.unwrap_or(&[])))
}

fn time_ns(data: &[u8], index: usize) -> Option<u64> {
    let octets = data.get(index * TIME..(index + 1) * TIME)?;
    let (seconds, nanoseconds) = octets.split_at(TIME / 2);
    let seconds = u64::try_from(signed(seconds)?).ok()?;
    let nanoseconds = u64::try_from(signed(nanoseconds)?).ok()?;
    let stamp_ns = seconds.checked_mul(1_000_000_000)?.checked_add(nanoseconds)?;
    (stamp_ns > 0).then_some(stamp_ns)
}

/// A number of four or eight octets, as the machine's `time_t` is.
fn signed(octets: &[u8]) -> Option<i64> {
    match octets.len() {
        4 => octets.try_into().ok().map(i32::from_ne_bytes).map(i64::from),
        _ => octets.try_into().ok().map(i64::from_ne_bytes),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A control message as the kernel would write it.
    fn made_up(level: libc::c_int, kind: libc::c_int, data: &[u8]) -> Vec<u8> {
        let mut octets = (HEADER + data.len()).to_ne_bytes().to_vec();
        octets.resize(HEADER - 8, 0);
        octets.extend(level.to_ne_bytes());
        octets.extend(kind.to_ne_bytes());
        octets.extend(data);
        octets.resize(octets.len().next_multiple_of(ALIGN), 0);
        octets
    }

    fn times(times: [(i64, i64); 3]) -> Vec<u8> {
        let number = |value: i64| match TIME {
            8 => (value as i32).to_ne_bytes().to_vec(),
            _ => value.to_ne_bytes().to_vec(),
        };
        times
            .iter()
            .flat_map(|(s, ns)| [number(*s), number(*ns)])
            .flatten()
            .collect()
    }

    fn timestamping(stamps: [(i64, i64); 3]) -> Vec<u8> {
        made_up(libc::SOL_SOCKET, libc::SCM_TIMESTAMPING, &times(stamps))
    }

    #[test]
    fn each_stamp_is_found_where_it_stands() {
        let kernel = Stamps {
            kernel_ns: Some(1_700_000_000_000_000_123),
            hardware_ns: None,
        };
        assert_eq!(parse(&timestamping([(1_700_000_000, 123), (0, 0), (0, 0)])), kernel);
        let both = Stamps {
            kernel_ns: Some(5_000_000_006),
            hardware_ns: Some(7_000_000_008),
        };
        assert_eq!(parse(&timestamping([(5, 6), (9, 9), (7, 8)])), both);
        let hardware = Stamps {
            kernel_ns: None,
            hardware_ns: Some(8),
        };
        assert_eq!(parse(&timestamping([(0, 0), (0, 0), (0, 8)])), hardware);
    }

    #[test]
    fn other_messages_are_passed_over() {
        let mut control = made_up(libc::SOL_SOCKET, libc::SCM_RIGHTS, &[1, 2, 3, 4]);
        control.extend(made_up(libc::SOL_PACKET, libc::SCM_TIMESTAMPING, &times([(9, 9); 3])));
        assert_eq!(parse(&control), Stamps::default());
        control.extend(timestamping([(1, 2), (0, 0), (3, 4)]));
        assert_eq!(parse(&control).hardware_ns, Some(3_000_000_004));
        // A second message of the kind, with the other stamp only.
        control.extend(timestamping([(7, 0), (0, 0), (0, 0)]));
        assert_eq!(
            (parse(&control).kernel_ns, parse(&control).hardware_ns),
            (Some(7_000_000_000), Some(3_000_000_004))
        );
    }

    #[test]
    fn what_is_cut_off_or_absurd_is_no_stamp() {
        let whole = timestamping([(1, 2), (0, 0), (3, 4)]);
        for length in 0..whole.len() {
            assert_eq!(parse(&whole[..length]), Stamps::default(), "{length} octets");
        }
        for length in [0, 1, HEADER - 1, usize::MAX] {
            let mut lying = whole.clone();
            lying[..size_of::<usize>()].copy_from_slice(&length.to_ne_bytes());
            assert_eq!(parse(&lying), Stamps::default(), "length {length}");
        }
        assert_eq!(parse(&timestamping([(-1, 0), (0, 0), (0, -1)])), Stamps::default());
        if TIME == 16 {
            assert_eq!(parse(&timestamping([(i64::MAX, 0), (0, 0), (0, 0)])), Stamps::default());
        }
    }

    proptest! {
        #[test]
        fn no_octets_panic(octets in prop::collection::vec(any::<u8>(), 0..200), length in 0usize..200) {
            parse(&octets);
            let mut control = made_up(libc::SOL_SOCKET, libc::SCM_TIMESTAMPING, &octets);
            parse(&control);
            control[..size_of::<usize>()].copy_from_slice(&length.to_ne_bytes());
            parse(&control);
        }
    }
}
