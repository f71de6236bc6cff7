//! Any octets: a frame that is read can be written, and is then read as the same frame.

use powerlink::wire::{FRAME_LEN_MAX, Frame, Header};

/// One run of the fuzzer.
pub fn run(octets: &[u8]) {
    let Ok(frame) = Frame::parse(octets) else { return };
    let header = Header::parse(octets).expect("the frame was read");
    let mut first = [0xA5; FRAME_LEN_MAX];
    let len = frame.emit(&header, &mut first).expect("what is read fits into a frame");
    let again = Frame::parse(&first[..len]).expect("what was written is read");
    let mut second = [0x5A; FRAME_LEN_MAX];
    assert_eq!(again.emit(&header, &mut second), Ok(len));
    assert_eq!(first[..len], second[..len]);
}
