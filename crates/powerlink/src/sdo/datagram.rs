//! SDO over UDP: the four octets that stand in front of the service data in a datagram.
//!
//! In and out: the payload of UDP datagrams to and from port [`UDP_PORT`]: message type ASnd, node id of the receiver, node id
//! of the sender, service id SDO; then the service data as in an ASnd frame.

use super::service_data::SERVICE_DATA_MAX;
use crate::wire::{ServiceId, message};

/// Port of SDO servers.
pub const UDP_PORT: u16 = 3819;
/// Octets in front of the service data.
pub const HEADER_LEN: usize = 4;
/// Longest payload this crate sends.
pub const DATAGRAM_MAX: usize = HEADER_LEN + SERVICE_DATA_MAX;

/// Payload of one datagram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Datagram<'a> {
    /// Node id of the receiver; 0 where the sender does not know it.
    pub destination: u8,
    /// Node id of the sender; 0 where it has none. The answer goes to the address the datagram came from.
    pub source: u8,
    /// From the sequence layer on.
    pub service_data: &'a [u8],
}

impl<'a> Datagram<'a> {
    /// Reads an untrusted payload; `None`: it is no SDO. Never panics.
    pub fn parse(payload: &'a [u8]) -> Option<Datagram<'a>> {
        let ([kind, destination, source, service], service_data) = payload.split_first_chunk::<HEADER_LEN>()?;
        // Bit 7 is no part of the message type.
        let is_sdo = kind & 0x7F == message::ASND && ServiceId::from(*service) == ServiceId::Sdo;
        is_sdo.then_some(Datagram {
            destination: *destination,
            source: *source,
            service_data,
        })
    }

    /// Writes the payload and returns its length; `None`: `out` is too short.
    pub fn emit(&self, out: &mut [u8]) -> Option<usize> {
        let len = HEADER_LEN + self.service_data.len();
        let (header, rest) = out.get_mut(..len)?.split_first_chunk_mut::<HEADER_LEN>()?;
        *header = [message::ASND, self.destination, self.source, ServiceId::Sdo.into()];
        rest.copy_from_slice(self.service_data);
        Some(len)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_datagram_there_and_back() {
        // Decoded by tshark 4.0.17 (udp.port 3819): ASnd from 253 to 1, service SDO, initialisation of a connection.
        let octets = [0x06, 1, 253, 0x05, 0x00, 0x01, 0, 0];
        let datagram = Datagram {
            destination: 1,
            source: 253,
            service_data: &[0x00, 0x01, 0, 0],
        };
        let mut out = [0xA5; 10];
        assert_eq!(datagram.emit(&mut out), Some(8));
        assert_eq!(out, [0x06, 1, 253, 0x05, 0x00, 0x01, 0, 0, 0xA5, 0xA5]);
        assert_eq!(Datagram::parse(&octets), Some(datagram));
        assert_eq!(datagram.emit(&mut out[..7]), None);
        for len in 0..HEADER_LEN {
            assert_eq!(Datagram::parse(&octets[..len]), None, "{len} octets");
        }
        for (at, wrong) in [(0, 0x03), (3, 0x04)] {
            let mut other = octets;
            other[at] = wrong;
            assert_eq!(Datagram::parse(&other), None);
        }
    }
}
