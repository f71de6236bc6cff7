//! The lines of a text, one after the other, in memory that does not grow with it.
//!
//! In:  a text. Out: the number of each line, from 1 on, and its beginning.

use program::text::Reader;
use std::io::{self, BufRead, BufReader};
use std::ops::ControlFlow;

/// Hands each line, without its end, to `look`, up to `octets_max` of it, until it has seen enough.
///
/// # Errors
/// The text cannot be read any more.
pub(super) fn each_line(
    text: Reader<'_>,
    octets_max: usize,
    mut look: impl FnMut(u32, &[u8]) -> ControlFlow<()>,
) -> io::Result<()> {
    let mut text = BufReader::with_capacity(1 << 16, text);
    let (mut line, mut begun) = (Vec::new(), false);
    for number in 1.. {
        line.clear();
        loop {
            let part = text.fill_buf()?;
            let end = part.iter().position(|octet| *octet == b'\n');
            let own = &part[..end.unwrap_or(part.len())];
            let room = octets_max.saturating_sub(line.len()).min(own.len());
            line.extend_from_slice(&own[..room]);
            begun |= !part.is_empty();
            let (count, is_over) = (own.len() + usize::from(end.is_some()), end.is_some() || part.is_empty());
            text.consume(count);
            if is_over {
                if !begun {
                    return Ok(());
                }
                begun = false;
                break;
            }
        }
        if look(number, &line).is_break() {
            break;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_counted_and_cut_and_the_last_one_needs_no_end() {
        let long = "x".repeat(200_000);
        for (text, expected) in [
            ("", vec![]),
            ("a", vec![(1, "a")]),
            ("a\n\nbcdef\r\n", vec![(1, "a"), (2, ""), (3, "bcd")]),
            (&format!("{long}\ny\n"), vec![(1, "xxx"), (2, "y")]),
        ] {
            let mut found = Vec::new();
            each_line(text.into(), 3, |number, line| {
                found.push((number, String::from_utf8(line.to_vec()).unwrap()));
                ControlFlow::Continue(())
            })
            .unwrap();
            let found: Vec<(u32, &str)> = found.iter().map(|(number, line)| (*number, line.as_str())).collect();
            assert_eq!(found, expected);
        }
    }
}
