//! Files that a user names: what may be read and how much of it, and where something may be written.
//!
//! In:  a path, which may name anything, in a folder that another user may write in.
//! Out: the content of a file, never that of a pipe, device or folder; a new file in the place of an old one.
//!
//! [`read`](mod@read) asks what a path names and how long that is before it reads. [`write`](mod@write) follows no link that
//! another user has put there, and gives a file its new content as a whole or not at all. [`arrivals`] keeps files that arrive slowly from
//! keeping others out. [`printed`] is the way of all text to a terminal.

pub mod arrivals;
mod place;
pub mod printed;
pub mod read;
pub mod write;

pub use read::{open, read, read_text, without_mark};
pub use write::{append, check, create, hold, make_folder, remove, write};

/// Longest name of a file that somebody elsewhere may give it, octets.
pub const NAME_MAX: usize = 200;

/// Whether a text is the name of a file in a folder: one component of a path, and no hidden one.
pub fn is_name(text: &str) -> bool {
    let is_plain = !text.contains(|letter: char| letter == '/' || letter == '\\' || letter.is_control());
    (1..=NAME_MAX).contains(&text.len()) && is_plain && !text.starts_with('.')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_one_component() {
        for name in ["a.ngc", "Teil 7 (ü).ngc", "a..b", &"x".repeat(NAME_MAX)] {
            assert!(is_name(name), "{name}");
        }
        let long = "x".repeat(NAME_MAX + 1);
        for name in ["", ".", "..", ".hidden", "a/b", "../a", "a\\b", "a\0", "a\nb", &long] {
            assert!(!is_name(name), "{name:?}");
        }
    }
}
