//! What is wrong with a value: numbers, expressions, functions and parameters.

/// Why something has no value, or a parameter cannot take one.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ExpressionError {
    /// Nothing that has a value behind a letter, sign or operator.
    #[error("{after} needs a number, #parameter, function or [expression] behind it")]
    ValueMissing {
        /// What stands before the place, in upper case.
        after: String,
    },
    /// A decimal point alone.
    #[error("a number needs at least one digit")]
    DigitMissing,
    /// Two decimal points in a number.
    #[error("a number has one decimal point at most")]
    SecondPoint,
    /// A number as programs for a computer write it.
    #[error("{written} is no number here, as there is no exponent: write {plain}")]
    Exponent {
        /// As it stands there.
        written: String,
        /// The same without exponent.
        plain: String,
    },
    /// `[` without `]`.
    #[error("[ without ]: the expression does not end on this line")]
    BracketNotClosed,
    /// Something that is no operator behind a value in brackets.
    #[error(
        "{found:?} is no operator: an expression goes on with + - * / ** MOD EQ NE GT GE LT LE AND OR XOR or ends with ]{}",
        hint(*.nearest)
    )]
    UnknownOperator {
        /// What stands there.
        found: String,
        /// Operator that was probably meant.
        nearest: Option<&'static str>,
    },
    /// No such function.
    #[error(
        "{name} is no function: there are ABS ACOS ASIN ATAN COS EXISTS EXP FIX FUP LN ROUND SIN SQRT TAN{}",
        hint(*.nearest)
    )]
    UnknownFunction {
        /// Name as written, capitals.
        name: String,
        /// Function that was probably meant.
        nearest: Option<&'static str>,
    },
    /// A function without `[`.
    #[error("{function} needs its argument in brackets: {function}[...]")]
    FunctionBracketMissing {
        /// The function.
        function: &'static str,
    },
    /// ATAN with one argument.
    #[error("ATAN needs two arguments: ATAN[y]/[x]")]
    AtanSlashMissing,
    /// EXISTS of something else than one parameter.
    #[error("EXISTS asks for one parameter: EXISTS[#<name>] or EXISTS[#5]")]
    ExistsNeedsParameter,
    /// Division by zero.
    #[error("{operator} divides by zero here")]
    DivideByZero {
        /// `/`, `MOD` or `**`
        operator: &'static str,
    },
    /// A root of a negative number.
    #[error("{base} ** {exponent}: a power of a negative number needs an integer as exponent")]
    PowerOfNegative {
        /// Left of `**`.
        base: f64,
        /// Right of `**`.
        exponent: f64,
    },
    /// An argument that a function has no value for.
    #[error("{function}[{argument}] has no value: the argument must be {rule}")]
    FunctionArgument {
        /// The function.
        function: &'static str,
        /// The argument that came.
        argument: f64,
        /// What it must be.
        rule: &'static str,
    },
    /// Beyond what a number can hold.
    #[error("the result of {operation} is too large for a number")]
    ResultTooLarge {
        /// Operator or function.
        operation: &'static str,
    },
    /// `<` without `>`.
    #[error("< without >: the name does not end on this line")]
    NameNotClosed,
    /// A parameter by a number with a fraction.
    #[error("#{value} is no parameter: its number must be an integer")]
    ParameterIndexNotInteger {
        /// The number that came.
        value: f64,
    },
    /// A parameter by a number that no parameter has.
    #[error("#{index} is no parameter: they are numbered from 1 to {max}")]
    ParameterIndexRange {
        /// The number that came.
        index: f64,
        /// Greatest value allowed.
        max: u32,
    },
    /// A parameter that may not be read in the present state.
    #[error("#{index} (current position) cannot be read while cutter compensation is on: write G40 first")]
    ParameterHidden {
        /// Number of the parameter.
        index: u32,
    },
    /// A named parameter that nothing was assigned to.
    #[error("#<{name}> {}", undefined(.name, .nearest))]
    ParameterUndefined {
        /// Its name.
        name: String,
        /// Defined name that was probably meant.
        nearest: Option<String>,
    },
    /// `#1` alone.
    #[error("a parameter at this place needs = and a value: #1 = 5")]
    AssignmentMissing,
    /// An assignment to a parameter that only tells something.
    #[error("#{name} is read-only: the control sets it")]
    ReadOnlyParameter {
        /// Number, or name with its < >.
        name: String,
    },
}

/// The probable meaning, behind a message.
fn hint(nearest: Option<&'static str>) -> String {
    nearest.map_or(String::new(), |nearest| format!("; did you mean {nearest}?"))
}

fn undefined(name: &str, nearest: &Option<String>) -> String {
    if name.starts_with("_hal[") {
        return "is not known: expected a pin that the control has, and for a check or a plan its value in program.pins of the \
                machine file"
            .into();
    }
    format!("is not defined: assign it before it is read{}", named_hint(nearest))
}

fn named_hint(nearest: &Option<String>) -> String {
    nearest
        .as_ref()
        .map_or(String::new(), |nearest| format!("; did you mean #<{nearest}>?"))
}
