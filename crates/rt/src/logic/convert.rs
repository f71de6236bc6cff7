//! Values of pins and of variables.
//!
//! | variable | pin |
//! |---|---|
//! | BOOL | bit |
//! | SINT, INT, DINT | s32, at most to the end of the type |
//! | USINT, UINT, UDINT, BYTE, WORD, DWORD | u32, the same |
//! | LINT; ULINT, LWORD | s64; u64 |
//! | REAL, LREAL | float, REAL rounded; at most to the end of the type, and what is no number is not taken |
//! | TIME | float, seconds |
//! | an enumeration | s32; a number that it does not have is not taken |
//!
//! RT: no allocation, no locks, bounded.

use hal_pins::Value as _;
use logic::{Logic, Scalar, Value, Variable};

/// What a variable holds where its pin has this cell; `None`: it keeps what it has.
pub(super) fn slot_of(logic: &Logic, variable: &Variable, cell: u64) -> Option<i64> {
    let clamped = |scalar: Scalar, number: i64| {
        let (low, high) = scalar.range();
        i128::from(number).clamp(low, high) as i64
    };
    Some(match variable.scalar() {
        Some(Scalar::Bool) => i64::from(bool::from_cell(cell)),
        Some(scalar @ (Scalar::Sint | Scalar::Int | Scalar::Dint)) => clamped(scalar, i64::from(i32::from_cell(cell))),
        Some(scalar @ (Scalar::Usint | Scalar::Uint | Scalar::Udint | Scalar::Byte | Scalar::Word | Scalar::Dword)) => {
            clamped(scalar, i64::from(u32::from_cell(cell)))
        }
        Some(Scalar::Lint | Scalar::Ulint | Scalar::Lword) => cell as i64,
        Some(scalar @ (Scalar::Real | Scalar::Lreal)) => {
            let most = match scalar {
                Scalar::Real => f64::from(f32::MAX),
                _ => f64::MAX,
            };
            // `None` for what is no number.
            return logic.slot_value(variable, Value::Lreal(f64::from_cell(cell).clamp(-most, most)));
        }
        Some(Scalar::Time) => match f64::from_cell(cell) {
            seconds if seconds.is_nan() => return None,
            seconds => (seconds * 1e9).round() as i64,
        },
        Some(Scalar::String) => return None,
        None => return logic.slot_value(variable, Value::Integer(i128::from(i32::from_cell(cell)))),
    })
}

/// What a pin shows of a variable.
pub(super) fn cell_of(scalar: Option<Scalar>, slot: i64) -> u64 {
    match scalar {
        Some(Scalar::Bool) => (slot != 0).to_cell(),
        Some(Scalar::Sint | Scalar::Int | Scalar::Dint) | None => (slot as i32).to_cell(),
        Some(Scalar::Usint | Scalar::Uint | Scalar::Udint | Scalar::Byte | Scalar::Word | Scalar::Dword) => {
            (slot as u32).to_cell()
        }
        Some(Scalar::Lint | Scalar::Ulint | Scalar::Lword | Scalar::Real | Scalar::Lreal | Scalar::String) => {
            slot as u64
        }
        Some(Scalar::Time) => (slot as f64 / 1e9).to_cell(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_comes_as_near_as_the_type_of_the_variable_lets_it() {
        let logic = logic::compile(
            "TYPE colour : (red, green := 5); END_TYPE
             PROGRAM p VAR_INPUT b : BOOL; i : INT; u : USINT; w : DWORD; l : LINT; m : ULINT; r : REAL; d : LREAL; t : TIME;
             e : colour; s : STRING; END_VAR END_PROGRAM",
        )
        .unwrap();
        let of = |name: &str, cell: u64| slot_of(&logic, logic.variable(name).unwrap(), cell);
        let back = |name: &str, slot: i64| cell_of(logic.variable(name).unwrap().scalar(), slot);
        assert_eq!((of("b", 1), back("b", 1)), (Some(1), 1));
        assert_eq!(
            (of("i", (-5_i32).to_cell()), back("i", -5)),
            (Some(-5), (-5_i32).to_cell())
        );
        assert_eq!(
            [40_000, -40_000].map(|much: i32| of("i", much.to_cell())),
            [Some(32_767), Some(-32_768)]
        );
        assert_eq!(
            (of("u", 300_u32.to_cell()), of("w", u32::MAX.to_cell())),
            (Some(255), Some(0xFFFF_FFFF))
        );
        assert_eq!((of("l", (-1_i64).to_cell()), of("m", u64::MAX)), (Some(-1), Some(-1)));
        assert_eq!(back("m", -1), u64::MAX);
        assert_eq!(of("r", 0.1_f64.to_cell()), Some(f64::from(0.1_f32).to_bits() as i64));
        assert_eq!(
            of("d", 0.1_f64.to_cell()).map(|slot| back("d", slot)),
            Some(0.1_f64.to_bits())
        );
        for name in ["r", "d"] {
            assert_eq!(of(name, f64::NAN.to_cell()), None, "{name}");
        }
        let ends = [f64::INFINITY, f64::NEG_INFINITY].map(|value| [of("r", value.to_cell()), of("d", value.to_cell())]);
        let slot = |value: f64| Some(value.to_bits() as i64);
        let most = f64::from(f32::MAX);
        assert_eq!(ends, [[slot(most), slot(f64::MAX)], [slot(-most), slot(f64::MIN)]]);
        assert_eq!(of("t", 1.5_f64.to_cell()), Some(1_500_000_000));
        assert_eq!(back("t", 1_500_000_000), 1.5_f64.to_cell());
        assert_eq!(
            [f64::NAN, f64::INFINITY].map(|time| of("t", time.to_cell())),
            [None, Some(i64::MAX)]
        );
        assert_eq!([5, 1].map(|number: i32| of("e", number.to_cell())), [Some(5), None]);
        assert_eq!(of("s", 0), None);
    }
}
