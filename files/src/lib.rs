//! Files that a user names: what may be read and how much of it, and where something may be written.
//!
//! In:  a path, which may name anything, in a folder that another user may write in.
//! Out: the content of a file, never that of a pipe, device or folder; a new file in the place of an old one.
//!
//! [`read`](mod@read) asks what a path names and how long that is before it reads. [`write`](mod@write) follows no link that
//! another user has put there, and gives a file its new content as a whole or not at all.

mod place;
pub mod read;
pub mod write;

pub use read::{open, read, read_text};
pub use write::{append, create, hold, make_folder, remove, write};
