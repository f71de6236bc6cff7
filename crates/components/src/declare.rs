//! `component!`: a struct whose fields are pins, its defaults, the list of its pins, and its kind.

/// Declares a component: kind, inputs with defaults, outputs, and state that no pin shows.
///
/// ```text
/// component! {
///     /// What it does.
///     And2 = "and2";
///     options { personality: 2, 1..=16, [], "number of inputs"; }
///     in { in0: bool = false, "one operand"; }
///     out { out: bool = false, "result"; }
///     state { before: bool = false; }
/// }
/// ```
///
/// A pin has the name of its field, or the pattern behind `as`; fields of a `Vec` have as many pins as items.
#[macro_export]
macro_rules! component {
    (
        $(#[doc = $doc:literal])+
        $Name:ident = $kind:literal;
        $(options { $($option:ident: $option_default:expr, $least:literal..=$most:literal, $words:expr, $option_doc:literal;)* })?
        $(in { $($input:ident $(as $input_pattern:literal)?: $input_type:ty = $input_default:expr, $input_doc:literal;)* })?
        $(out { $($output:ident $(as $output_pattern:literal)?: $output_type:ty = $output_default:expr, $output_doc:literal;)* })?
        $(state { $($state:ident: $state_type:ty = $state_default:expr;)* })?
    ) => {
        $(#[doc = $doc])+
        #[derive(Debug)]
        pub(crate) struct $Name {
            $($($input: $input_type,)*)?
            $($($output: $output_type,)*)?
            $($($state: $state_type,)*)?
        }

        impl $Name {
            pub(crate) const KIND: $crate::Kind = $crate::Kind {
                name: $kind,
                doc: concat!($($doc),+),
                options: &[$($($crate::OptionSpec {
                    name: stringify!($option),
                    doc: $option_doc,
                    default: $option_default,
                    range: [$least, $most],
                    words: &$words,
                },)*)?],
                new: || Box::new($Name {
                    $($($input: $input_default,)*)?
                    $($($output: $output_default,)*)?
                    $($($state: $state_default,)*)?
                }),
            };
        }

        impl $crate::Pins for $Name {
            fn visit(
                &mut self,
                direction: $crate::Direction,
                visitor: &mut dyn FnMut($crate::Pin<'_>),
            ) {
                use $crate::{Direction, Field};
                match direction {
                    Direction::In => {
                        $($(self.$input.visit($crate::pattern!($input $(as $input_pattern)?), $input_doc, visitor);)*)?
                    }
                    Direction::Out => {
                        $($(self.$output.visit($crate::pattern!($output $(as $output_pattern)?), $output_doc, visitor);)*)?
                    }
                }
            }
        }
    };
}

/// Name of a pin as `component!` takes it.
#[doc(hidden)]
#[macro_export]
macro_rules! pattern {
    ($field:ident) => {
        stringify!($field)
    };
    ($field:ident as $pattern:literal) => {
        $pattern
    };
}

pub(crate) use component;
