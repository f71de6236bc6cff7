//! What expressions are made of: operators and functions, and what they compute.
//!
//! In:  finite numbers, or NaN for what is not known before the program runs.
//! Out: a finite number, NaN if an argument was NaN, or the rule that is broken.

use crate::degrees;
use crate::error::{ErrorKind, ExpressionError};

/// Numbers that differ by less are equal for `EQ`, `NE`, `GE` and `LE`, as in LinuxCNC; `GT` and `LT` compare exactly.
const EQUAL_DIFFERENCE_MAX: f64 = 1e-6;

/// An operator between two values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Operator {
    Power,
    Times,
    Divide,
    Modulo,
    Plus,
    Minus,
    Equal,
    NotEqual,
    Greater,
    GreaterOrEqual,
    Less,
    LessOrEqual,
    And,
    Or,
    ExclusiveOr,
}

impl Operator {
    /// Those made of letters; none of them begins with another one.
    pub(crate) const WORDS: [Operator; 10] = [
        Operator::Modulo,
        Operator::Equal,
        Operator::NotEqual,
        Operator::Greater,
        Operator::GreaterOrEqual,
        Operator::Less,
        Operator::LessOrEqual,
        Operator::And,
        Operator::Or,
        Operator::ExclusiveOr,
    ];

    /// As it is written, in upper case.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Operator::Power => "**",
            Operator::Times => "*",
            Operator::Divide => "/",
            Operator::Modulo => "MOD",
            Operator::Plus => "+",
            Operator::Minus => "-",
            Operator::Equal => "EQ",
            Operator::NotEqual => "NE",
            Operator::Greater => "GT",
            Operator::GreaterOrEqual => "GE",
            Operator::Less => "LT",
            Operator::LessOrEqual => "LE",
            Operator::And => "AND",
            Operator::Or => "OR",
            Operator::ExclusiveOr => "XOR",
        }
    }

    /// What binds more has a higher level.
    pub(crate) fn level(self) -> u8 {
        match self {
            Operator::Power => 5,
            Operator::Times | Operator::Divide | Operator::Modulo => 4,
            Operator::Plus | Operator::Minus => 3,
            Operator::Equal
            | Operator::NotEqual
            | Operator::Greater
            | Operator::GreaterOrEqual
            | Operator::Less
            | Operator::LessOrEqual => 2,
            Operator::And | Operator::Or | Operator::ExclusiveOr => 1,
        }
    }

    /// The result, `1` and `0` for true and false.
    pub(crate) fn apply(self, left: f64, right: f64) -> Result<f64, ErrorKind> {
        let operator = self.name();
        let truth = |truth: bool| {
            if left.is_nan() || right.is_nan() {
                f64::NAN
            } else {
                f64::from(truth)
            }
        };
        let equal = (left - right).abs() < EQUAL_DIFFERENCE_MAX;
        let result = match self {
            Operator::Divide | Operator::Modulo if right == 0.0 => {
                return Err(ExpressionError::DivideByZero { operator }.into());
            }
            Operator::Power if left == 0.0 && right < 0.0 => {
                return Err(ExpressionError::DivideByZero { operator }.into());
            }
            Operator::Power if left < 0.0 && right.fract() != 0.0 && !right.is_nan() => {
                return Err(ExpressionError::PowerOfNegative {
                    base: left,
                    exponent: right,
                }
                .into());
            }
            Operator::Power => libm::pow(left, right),
            Operator::Times => left * right,
            Operator::Divide => left / right,
            Operator::Modulo => {
                let rest = left % right;
                if rest < 0.0 { rest + right.abs() } else { rest }
            }
            Operator::Plus => left + right,
            Operator::Minus => left - right,
            Operator::Equal => truth(equal),
            Operator::NotEqual => truth(!equal),
            Operator::Greater => truth(left > right),
            Operator::GreaterOrEqual => truth(equal || left > right),
            Operator::Less => truth(left < right),
            Operator::LessOrEqual => truth(equal || left < right),
            Operator::And => truth(left != 0.0 && right != 0.0),
            Operator::Or => truth(left != 0.0 || right != 0.0),
            Operator::ExclusiveOr => truth((left != 0.0) != (right != 0.0)),
        };
        finite(result, operator)
    }
}

/// A function of one argument in brackets, but for [`Function::Atan`] and [`Function::Exists`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Function {
    Abs,
    Acos,
    Asin,
    Atan,
    Cos,
    Exists,
    Exp,
    Fix,
    Fup,
    Ln,
    Round,
    Sin,
    Sqrt,
    Tan,
}

impl Function {
    pub(crate) const ALL: [Function; 14] = [
        Function::Abs,
        Function::Acos,
        Function::Asin,
        Function::Atan,
        Function::Cos,
        Function::Exists,
        Function::Exp,
        Function::Fix,
        Function::Fup,
        Function::Ln,
        Function::Round,
        Function::Sin,
        Function::Sqrt,
        Function::Tan,
    ];

    /// As it is written, in upper case.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Function::Abs => "ABS",
            Function::Acos => "ACOS",
            Function::Asin => "ASIN",
            Function::Atan => "ATAN",
            Function::Cos => "COS",
            Function::Exists => "EXISTS",
            Function::Exp => "EXP",
            Function::Fix => "FIX",
            Function::Fup => "FUP",
            Function::Ln => "LN",
            Function::Round => "ROUND",
            Function::Sin => "SIN",
            Function::Sqrt => "SQRT",
            Function::Tan => "TAN",
        }
    }

    /// The result for one argument; ATAN takes it as a slope.
    pub(crate) fn apply(self, argument: f64) -> Result<f64, ErrorKind> {
        let function = self.name();
        let outside = |rule| {
            Err(ExpressionError::FunctionArgument {
                function,
                argument,
                rule,
            }
            .into())
        };
        let result = match self {
            Function::Asin | Function::Acos if argument.abs() > 1.0 => return outside("from -1 to 1"),
            Function::Sqrt if argument < 0.0 => return outside("0 or more"),
            Function::Ln if argument <= 0.0 => return outside("above 0"),
            Function::Abs => argument.abs(),
            Function::Acos => degrees::acos(argument),
            Function::Asin => degrees::asin(argument),
            Function::Atan => degrees::atan2(argument, 1.0),
            Function::Cos => degrees::cos(argument),
            Function::Exists => argument,
            Function::Exp => libm::exp(argument),
            Function::Fix => argument.floor(),
            Function::Fup => argument.ceil(),
            Function::Ln => libm::log(argument),
            // Zero without sign, as from an integer.
            Function::Round => argument.round() + 0.0,
            Function::Sin => degrees::sin(argument),
            Function::Sqrt => argument.sqrt(),
            Function::Tan => degrees::tan(argument),
        };
        finite(result, function)
    }
}

fn finite(result: f64, operation: &'static str) -> Result<f64, ErrorKind> {
    if result.is_infinite() {
        Err(ExpressionError::ResultTooLarge { operation }.into())
    } else {
        Ok(result)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_of_operators() {
        use Operator::*;
        for (left, operator, right, expected) in [
            (2.0, Power, 3.0, 8.0),
            (-2.0, Power, 2.0, 4.0),
            (2.0, Power, -1.0, 0.5),
            (7.0, Modulo, 3.0, 1.0),
            (-7.0, Modulo, 3.0, 2.0),
            (-7.0, Modulo, -3.0, 2.0),
            (1.0, Modulo, -3.0, 1.0),
            (1.0, Equal, 1.0000009, 1.0),
            (1.0, Equal, 1.0000011, 0.0),
            (1.0, NotEqual, 1.0000009, 0.0),
            (1.0, NotEqual, 1.0000011, 1.0),
            (1.0, Less, 1.0000009, 1.0),
            (1.0, GreaterOrEqual, 1.0, 1.0),
            (1.0, GreaterOrEqual, 1.0000009, 1.0),
            (1.0, GreaterOrEqual, 1.0000011, 0.0),
            (1.0, Greater, 1.0, 0.0),
            (1.0000009, Greater, 1.0, 1.0),
            (1.0, LessOrEqual, 0.5, 0.0),
            (1.0000009, LessOrEqual, 1.0, 1.0),
            (1.0000011, LessOrEqual, 1.0, 0.0),
            (2.0, And, -0.1, 1.0),
            (2.0, And, 0.0, 0.0),
            (0.0, Or, 0.1, 1.0),
            (0.0, Or, 0.0, 0.0),
            (3.0, ExclusiveOr, 2.0, 0.0),
            (3.0, ExclusiveOr, 0.0, 1.0),
        ] {
            assert_eq!(operator.apply(left, right), Ok(expected), "{left} {operator:?} {right}");
        }
    }

    #[test]
    fn results_of_functions() {
        use Function::*;
        for (function, argument, expected) in [
            (Abs, -2.5, 2.5),
            (Acos, 0.5, 60.0),
            (Asin, -1.0, -90.0),
            (Cos, 60.0, 0.5),
            (Exp, 0.0, 1.0),
            (Fix, -2.8, -3.0),
            (Fix, 2.8, 2.0),
            (Fup, 2.1, 3.0),
            (Fup, -2.8, -2.0),
            (Ln, 1.0, 0.0),
            (Round, 2.5, 3.0),
            (Round, -2.5, -3.0),
            (Round, 2.4, 2.0),
            (Sin, 30.0, 0.5),
            (Sqrt, 9.0, 3.0),
            (Tan, 45.0, 1.0),
        ] {
            assert_eq!(function.apply(argument), Ok(expected), "{function:?}[{argument}]");
        }
        assert!(Function::Round.apply(-0.2).is_ok_and(f64::is_sign_positive));
    }

    #[test]
    fn what_has_no_result_is_refused() {
        let divided = |operator| Err(ExpressionError::DivideByZero { operator }.into());
        assert_eq!(Operator::Divide.apply(1.0, 0.0), divided("/"));
        assert_eq!(Operator::Modulo.apply(1.0, -0.0), divided("MOD"));
        assert_eq!(Operator::Power.apply(0.0, -1.0), divided("**"));
        assert!(Operator::Power.apply(-1.0, 0.5).is_err());
        assert!(Function::Sqrt.apply(-1e-9).is_err());
        assert!(Function::Ln.apply(0.0).is_err());
        assert!(Function::Acos.apply(1.1).is_err());
        assert!(Function::Asin.apply(-1.1).is_err());
        for result in [
            Operator::Times.apply(1e200, 1e200),
            Operator::Plus.apply(1.7e308, 1.7e308),
            Operator::Power.apply(10.0, 400.0),
            Operator::Divide.apply(1e300, 1e-300),
            Function::Exp.apply(1000.0),
            Function::Tan.apply(90.0),
        ] {
            assert!(
                matches!(
                    result,
                    Err(ErrorKind::Expression(ExpressionError::ResultTooLarge { .. }))
                ),
                "{result:?}"
            );
        }
    }

    #[test]
    fn what_is_unknown_breaks_no_rule() {
        for operator in Operator::WORDS {
            assert!(operator.apply(f64::NAN, 1.0).unwrap().is_nan(), "{operator:?}");
            assert!(operator.apply(1.0, f64::NAN).unwrap().is_nan(), "{operator:?}");
        }
        assert!(Operator::Power.apply(-1.0, f64::NAN).is_ok());
        for function in Function::ALL {
            assert!(function.apply(f64::NAN).unwrap().is_nan(), "{function:?}");
        }
    }
}
