//! What is told of the programmed path while a program runs.
//!
//! In:  the program thread, as it reads the program.
//! Out: to whoever judges the machine by it.

use motion::path::PackedPiece;

/// How the programmed path goes on.
#[derive(Clone, Debug)]
pub enum PathNews {
    /// Along this piece, machine coordinates, before corners are rounded.
    Way(PackedPiece),
    /// By a probing move: where it ends, and what comes behind it, is told once it is over.
    Probing,
    /// The probing move is over, and told as far as it went.
    Probed,
}
