//! What is wrong with a probing move.

/// Why a probing move (G38.2 to G38.5) cannot be run, or failed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ProbeError {
    /// A probing move whose end is its start.
    #[error("the probing move ends where it begins: its end must be another place")]
    Nowhere,
    /// A probing move with a time for its whole way (G93).
    #[error(
        "a probing move may end anywhere on its way, so it takes no time for the whole of it (G93): write G94 and F"
    )]
    InverseTime,
    /// A probing move with a feed per turn (G95).
    #[error("a probing move has a speed of its own, not one per turn of the spindle (G95): write G94 and F")]
    PerTurn,
    /// A probing move while cutter compensation is on.
    #[error("a probing move while cutter compensation is on would touch beside the point: write G40 first")]
    Compensated,
    /// G38.2: nothing was touched.
    #[error(
        "G38.2 came to its end without contact: move the end further into the part, or write G38.3 where that is no mistake"
    )]
    NoContact,
    /// G38.4: contact all the way.
    #[error(
        "G38.4 came to its end still in contact: move the end further off the part, or write G38.5 where that is no mistake"
    )]
    ContactStays,
    /// G38.2: the probe touched something before it moved.
    #[error(
        "G38.2 began in contact, where it is to find one: move off the part first, look at the probe and its wire, or write G38.3 \
         where that is no mistake"
    )]
    InContact,
    /// G38.4: the probe touched nothing before it moved.
    #[error(
        "G38.4 began without contact, which it is to leave: touch the part first (G38.2), or write G38.5 where that is no mistake"
    )]
    OffContact,
    /// The operator ended it.
    #[error("the probing move was ended by the operator")]
    Aborted,
}
