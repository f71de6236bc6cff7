//! VLAN tags, which the kernel takes off a frame before anybody sees it.
//!
//! In:  what the kernel tells of a frame. Out: the frame as it was on the wire. RT: no allocation, no locks, bounded.

/// Octets of both addresses, behind which the tag stands.
const ADDRESSES_LEN: usize = 12;
/// Octets of a tag.
const TAG_LEN: usize = 4;
/// EtherType of a tag (IEEE 802.1Q) where the kernel does not tell another one.
const CUSTOMER_TAG: u16 = 0x8100;

/// A tag that was taken off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Tag([u8; TAG_LEN]);

impl Tag {
    /// The tag of a frame, if it had one: status, EtherType of the tag and its value, as the kernel tells them.
    pub(super) fn from_status(status: u32, ether_type: u16, value: u16) -> Option<Tag> {
        let ether_type = if status & libc::TP_STATUS_VLAN_TPID_VALID != 0 {
            ether_type
        } else {
            CUSTOMER_TAG
        };
        let ([a, b], [c, d]) = (ether_type.to_be_bytes(), value.to_be_bytes());
        (status & libc::TP_STATUS_VLAN_VALID != 0).then_some(Tag([a, b, c, d]))
    }

    /// Puts the tag back into a frame of this length at the start of the buffer; returns the length with it. What finds no room
    /// is cut, as of any frame that is longer than the buffer.
    pub(super) fn put_back(self, buffer: &mut [u8], length: usize) -> usize {
        let whole = (length + TAG_LEN).min(buffer.len());
        if length < ADDRESSES_LEN || whole < ADDRESSES_LEN + TAG_LEN {
            return length;
        }
        buffer.copy_within(ADDRESSES_LEN..whole - TAG_LEN, ADDRESSES_LEN + TAG_LEN);
        buffer[ADDRESSES_LEN..ADDRESSES_LEN + TAG_LEN].copy_from_slice(&self.0);
        whole
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_frame_is_as_it_was_on_the_wire() {
        let frame = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0x88, 0xAB, 0xCC];
        let tag = Tag::from_status(0x50, 0x88A8, 0xE005).unwrap();
        let mut buffer = [0xEE; 20];
        buffer[..15].copy_from_slice(&frame);
        assert_eq!(tag.put_back(&mut buffer, 15), 19);
        assert_eq!(buffer[..12], frame[..12]);
        assert_eq!(buffer[12..], [0x88, 0xA8, 0xE0, 0x05, 0x88, 0xAB, 0xCC, 0xEE]);
        // Cut by the buffer.
        let mut short = [0xEE; 17];
        short[..15].copy_from_slice(&frame);
        assert_eq!(tag.put_back(&mut short, 15), 17);
        assert_eq!(short[12..], [0x88, 0xA8, 0xE0, 0x05, 0x88]);
        let mut none = frame;
        assert_eq!(tag.put_back(&mut none[..13], 13), 13);
    }

    #[test]
    fn only_what_the_kernel_says_is_a_tag() {
        assert_eq!(Tag::from_status(0x01, 0x8100, 5), None);
        assert_eq!(Tag::from_status(0x11, 0, 0), Some(Tag([0x81, 0, 0, 0])));
    }
}
