//! Elementary types: what they are called, what they hold, what becomes what by itself.
//!
//! In:  names of types, values of any size.
//! Out: ranges, wrapped values, types that both of two become.
//!
//! A value lies in a slot of 64 bits: integers and bit strings as a signed number (ULINT and LWORD by their bits), REAL and LREAL
//! as an `f64` (that of a REAL is always one that an `f32` holds), TIME in nanoseconds, BOOL as 0 or 1, STRING as the number of
//! its text.

/// An elementary type.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[rustfmt::skip]
#[expect(missing_docs, reason = "the names are the standard's")]
pub enum Scalar {
    Bool, Sint, Int, Dint, Lint, Usint, Uint, Udint, Ulint, Byte, Word, Dword, Lword, Real, Lreal, Time, String,
}

use Scalar::*;

impl Scalar {
    /// All of them; where two become a third one, the first that fits.
    #[rustfmt::skip]
    pub const ALL: [Scalar; 17] = [
        Bool, Sint, Usint, Int, Uint, Dint, Udint, Lint, Ulint, Byte, Word, Dword, Lword, Real, Lreal, Time, String,
    ];

    /// As it is written in a program.
    #[rustfmt::skip]
    pub fn name(self) -> &'static str {
        match self {
            Bool => "BOOL",
            Sint => "SINT", Int => "INT", Dint => "DINT", Lint => "LINT",
            Usint => "USINT", Uint => "UINT", Udint => "UDINT", Ulint => "ULINT",
            Byte => "BYTE", Word => "WORD", Dword => "DWORD", Lword => "LWORD",
            Real => "REAL", Lreal => "LREAL", Time => "TIME", String => "STRING",
        }
    }

    pub(crate) fn of_name(name: &str) -> Option<Scalar> {
        Scalar::ALL
            .into_iter()
            .find(|scalar| scalar.name().eq_ignore_ascii_case(name))
    }

    /// Width, bits; 0 for STRING.
    pub fn bits(self) -> u32 {
        match self {
            Bool => 1,
            Sint | Usint | Byte => 8,
            Int | Uint | Word => 16,
            Dint | Udint | Dword | Real => 32,
            Lint | Ulint | Lword | Lreal | Time => 64,
            String => 0,
        }
    }

    pub(crate) fn is_signed(self) -> bool {
        matches!(self, Sint | Int | Dint | Lint)
    }

    pub(crate) fn is_integer(self) -> bool {
        self.is_signed() || matches!(self, Usint | Uint | Udint | Ulint)
    }

    pub(crate) fn is_bit_string(self) -> bool {
        matches!(self, Byte | Word | Dword | Lword)
    }

    pub(crate) fn is_real(self) -> bool {
        matches!(self, Real | Lreal)
    }

    pub(crate) fn is_number(self) -> bool {
        self.is_integer() || self.is_real()
    }

    /// Least and greatest value of an integer, a bit string, a BOOL or a TIME.
    pub fn range(self) -> (i128, i128) {
        if self.is_signed() || self == Time {
            (-(1 << (self.bits() - 1)), (1 << (self.bits() - 1)) - 1)
        } else {
            (0, (1_i128 << self.bits()) - 1)
        }
    }

    /// The number that a slot holds.
    pub(crate) fn number(self, slot: i64) -> i128 {
        match self {
            Ulint | Lword => i128::from(slot as u64),
            _ => i128::from(slot),
        }
    }

    /// The low bits of a number as a slot; whether it is another number then.
    pub(crate) fn wrap(self, number: i128) -> (i64, bool) {
        let low = number as i64;
        let slot = match self {
            Bool => low & 1,
            Sint => i64::from(low as i8),
            Int => i64::from(low as i16),
            Dint => i64::from(low as i32),
            Usint | Byte => i64::from(low as u8),
            Uint | Word => i64::from(low as u16),
            Udint | Dword => i64::from(low as u32),
            Lint | Ulint | Lword | Real | Lreal | Time | String => low,
        };
        (slot, self.number(slot) != number)
    }

    /// What is assigned from this to the other needs no conversion written: no value is lost.
    pub(crate) fn widens_to(self, other: Scalar) -> bool {
        let (from, to) = (self.bits(), other.bits());
        match (self, other) {
            _ if self == other => true,
            (Real, Lreal) => true,
            _ if self.is_integer() && other == Real => from <= 16,
            _ if self.is_integer() && other == Lreal => from <= 32,
            _ if self.is_integer() && other.is_integer() => {
                (self.is_signed() == other.is_signed() || other.is_signed()) && from < to
            }
            _ => false,
        }
    }

    /// The type that both become by themselves.
    pub(crate) fn common(self, other: Scalar) -> Option<Scalar> {
        Scalar::ALL
            .into_iter()
            .find(|wide| self.widens_to(*wide) && other.widens_to(*wide))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_loses_nothing_widens() {
        for from in Scalar::ALL {
            for to in Scalar::ALL {
                if from == to || !from.is_integer() || !to.is_number() {
                    continue;
                }
                let (low, high) = from.range();
                let holds = match to {
                    Real => from.bits() <= 16, // 24 bits of a REAL would hold a number of 24 bits only
                    Lreal => from.bits() <= 32,
                    _ => to.range().0 <= low && high <= to.range().1,
                };
                assert_eq!(from.widens_to(to), holds, "{from:?} to {to:?}");
            }
        }
        assert!(!Byte.widens_to(Word) && !Byte.widens_to(Uint) && !Bool.widens_to(Int) && !Time.widens_to(Lint));
    }

    #[test]
    fn two_integers_become_the_narrowest_that_holds_both() {
        assert_eq!(Int.common(Uint), Some(Dint));
        assert_eq!(Usint.common(Sint), Some(Int));
        assert_eq!(Lint.common(Ulint), None);
        assert_eq!(Dint.common(Real), Some(Lreal));
        assert_eq!(Int.common(Real), Some(Real));
        assert_eq!(Bool.common(Int), None);
    }

    #[test]
    fn a_number_that_does_not_fit_keeps_its_low_bits() {
        assert_eq!(Int.wrap(32_768), (-32_768, true));
        assert_eq!(Usint.wrap(-1), (255, true));
        assert_eq!(Ulint.wrap(i128::from(u64::MAX)), (-1, false));
        assert_eq!(Lint.wrap(1 << 63), (i64::MIN, true));
        assert_eq!(Dint.wrap(-5), (-5, false));
    }
}
