//! What single octets of a line are.

/// Whether a line has nothing but blanks.
pub(crate) fn is_empty(octets: &[u8]) -> bool {
    octets.iter().all(|octet| is_blank(*octet))
}

/// Ignored outside comments.
pub(crate) fn is_blank(octet: u8) -> bool {
    matches!(octet, b' ' | b'\t' | b'\r')
}

/// Second and further octets of a character in UTF-8.
pub(crate) fn is_continuation(octet: u8) -> bool {
    octet & 0xC0 == 0x80
}
