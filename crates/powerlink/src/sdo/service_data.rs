//! Lengths of the service data in an SDO frame.

use super::{command, sequence};

/// First octet of the service data in the Ethernet frame.
pub const SERVICE_DATA_OFFSET: usize = 18;

/// Longest service data this crate sends. An IP packet of the least AsyncMTU (0x1F98/8 = 300 octets), which every node must
/// accept, holds it behind the IP, UDP and POWERLINK headers; so does an ASnd frame.
pub const SERVICE_DATA_MAX: usize = 300 - 20 - 8 - 4;

const _: () = assert!(SERVICE_DATA_MAX == sequence::HEADER_LEN + command::HEADER_LEN + command::SEGMENT_MAX);

/// Longest value that fits in one frame when it is written: behind the object address.
pub const EXPEDITED_WRITE_MAX: usize = command::SEGMENT_MAX - command::ADDRESS_LEN;

/// Longest value that fits in one frame when it is read.
pub const EXPEDITED_READ_MAX: usize = command::SEGMENT_MAX;

/// Length of service data without a command: the command header is sent as zero.
pub(crate) const EMPTY_LEN: usize = sequence::HEADER_LEN + command::HEADER_LEN;
