//! What single octets of a line are.

/// Whether a line has nothing but blanks.
pub(crate) fn is_empty(octets: &[u8]) -> bool {
    octets.iter().all(|octet| is_blank(*octet))
}

/// Ignored outside comments: blanks, and what a serial line puts between them (punched tape's 0, DC1 to DC4 of XON and XOFF).
pub(crate) fn is_blank(octet: u8) -> bool {
    matches!(octet, b' ' | b'\t' | b'\r' | 0 | 0x11..=0x14)
}

/// Second and further octets of a character in UTF-8.
pub(crate) fn is_continuation(octet: u8) -> bool {
    octet & 0xC0 == 0x80
}
