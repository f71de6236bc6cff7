//! The process image of the managing node as other tools know it: arrays of octets, and how the channels of process data map them.
//!
//! In:  the configuration. Out: mapping entries (0x1600.., 0x1A00..) and the place of each octet. One channel behind the other
//! in its order, each octet an entry of its own: other managing nodes map a whole object or nothing of it.

use obd::mapping::MappingEntry;

use super::config::MnConfig;

/// First array of octets that the managing node sends (0xA040..=0xA04F).
pub const IMAGE_OUT: u16 = 0xA040;
/// First array of octets that it receives (0xA4C0..=0xA4CF).
pub const IMAGE_IN: u16 = 0xA4C0;
/// Arrays in each direction.
pub(super) const ARRAYS: u16 = 16;
/// Entries of each array; as many as openPOWERLINK's have.
pub(super) const ENTRIES: u8 = 252;
/// Octets in each direction.
pub const IMAGE_OCTETS_MAX: usize = ARRAYS as usize * ENTRIES as usize;
/// Octets of a channel: entries of a mapping.
pub const CHANNEL_OCTETS_MAX: usize = 254;

/// Object and sub-index of an octet of the image; `None`: the arrays end before it.
fn place(first: u16, octet: usize) -> Option<(u16, u8)> {
    let entries = usize::from(ENTRIES);
    // Below 16, and at most 252.
    (octet < IMAGE_OCTETS_MAX).then(|| (first + (octet / entries) as u16, (octet % entries) as u8 + 1))
}

/// The octet of an object of the image, `array` counted from its first one.
pub(super) fn octet_at(array: usize, sub: u8) -> usize {
    array * usize::from(ENTRIES) + usize::from(sub) - 1
}

impl MnConfig<'_> {
    /// Octets of a channel. Channel 0 is the managing node's own PRes, channel k the node at place k of the configuration, counted
    /// from 1. `image`: [`IMAGE_OUT`] or [`IMAGE_IN`].
    pub fn channel_octets(&self, image: u16, channel: usize) -> usize {
        let octets = match (channel.checked_sub(1), image) {
            (None, IMAGE_OUT) => self.pres_mn_bytes.unwrap_or(0),
            (None, _) => 0,
            (Some(at), image) => self.nodes.get(at).map_or(0, |node| match image {
                // What is for a chained node stands in the PRes of the managing node.
                IMAGE_OUT if node.assignment.chained => 0,
                IMAGE_OUT => node.preq_bytes,
                _ => node.pres_bytes,
            }),
        };
        usize::from(octets)
    }

    /// Entry `sub`, from 1, of the mapping of a channel; `None`: it has fewer octets, or the image has.
    pub fn mapping_entry(&self, image: u16, channel: usize, sub: u8) -> Option<u64> {
        let octet = usize::from(sub.checked_sub(1)?);
        if octet >= self.channel_octets(image, channel) {
            return None;
        }
        let first: usize = (0..channel).map(|before| self.channel_octets(image, before)).sum();
        let (index, sub) = place(image, first + octet)?;
        let entry = MappingEntry {
            index,
            sub,
            // At most 253 octets.
            bit_offset: 8 * octet as u16,
            bit_length: 8,
        };
        Some(entry.to_u64())
    }

    /// Channel of an octet of the image, and the place of the octet in it.
    pub(super) fn channel_of(&self, image: u16, octet: usize) -> Option<(usize, usize)> {
        let mut first = 0;
        for channel in 0..=self.nodes.len() {
            let end = first + self.channel_octets(image, channel);
            if octet < end {
                return Some((channel, octet - first));
            }
            first = end;
        }
        None
    }
}
