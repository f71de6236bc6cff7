//! What there is in the shared memory: kinds of entries and types of their values.

/// Type of a pin or net.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Type {
    /// Off or on.
    Bit = 1,
    /// 32-bit signed integer.
    S32 = 2,
    /// 32-bit unsigned integer.
    U32 = 3,
    /// 64-bit signed integer.
    S64 = 4,
    /// 64-bit unsigned integer.
    U64 = 5,
    /// IEEE 754 double.
    Float = 6,
}

impl Type {
    /// All types, once each.
    pub const ALL: [Type; 6] = [Type::Bit, Type::S32, Type::U32, Type::S64, Type::U64, Type::Float];

    /// Name as printed and as in LinuxCNC.
    pub const fn name(self) -> &'static str {
        match self {
            Type::Bit => "bit",
            Type::S32 => "s32",
            Type::U32 => "u32",
            Type::S64 => "s64",
            Type::U64 => "u64",
            Type::Float => "float",
        }
    }

    pub(crate) fn from_octet(octet: u8) -> Option<Type> {
        Type::ALL.into_iter().find(|kind| *kind as u8 == octet)
    }
}

impl std::fmt::Display for Type {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(self.name())
    }
}

/// What an entry is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// Pin that a component writes.
    Output = 1,
    /// Pin that a component reads.
    Input = 2,
    /// Net: connection of one output with inputs.
    Net = 3,
}

impl Kind {
    /// `out`, `in` or `net`.
    pub const fn short(self) -> &'static str {
        match self {
            Kind::Output => "out",
            Kind::Input => "in",
            Kind::Net => "net",
        }
    }

    pub(crate) fn from_octet(octet: u8) -> Option<Kind> {
        [Kind::Output, Kind::Input, Kind::Net]
            .into_iter()
            .find(|kind| *kind as u8 == octet)
    }
}

impl std::fmt::Display for Kind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(match self {
            Kind::Output => "an output",
            Kind::Input => "an input",
            Kind::Net => "a net",
        })
    }
}
