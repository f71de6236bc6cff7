//! Any octets as `state.json`: read and written back equal, or refused in words.

use isocnc::machine::state_file::{Remembered, framed, parse, write};

/// One run of the fuzzer. Octets that begin with `{` are the content of a file whose first line fits.
pub fn run(octets: &[u8]) {
    let text = match octets.first() {
        Some(b'{') => framed(octets),
        _ => octets.to_vec(),
    };
    match parse(&text) {
        Ok(remembered) => {
            let again = write(&remembered).expect("what was read has only numbers that JSON has");
            assert_eq!(parse(&again).as_ref(), Ok(&remembered));
            // Cut short, it is never believed in part.
            assert!(parse(&again[..again.len() - 1]).is_err());
        }
        Err(why) => assert!(why.len() > 10, "{why}"),
    }
    let _: Result<Remembered, String> = parse(octets);
}
