//! Values with their rules, one table each.

use super::*;
use crate::scan::Item;
use proptest::prelude::*;

/// #1 to #5 hold 1 to 5, #9 holds 9.5, #7 is hidden, the others hold 0; `a` and `_g` are defined, `u` is unknown.
struct Known;

impl Values for Known {
    fn numbered(&self, index: u32) -> Option<f64> {
        assert!((1..=PARAMETER_MAX).contains(&index));
        match index {
            1..=5 => Some(f64::from(index)),
            7 => None,
            9 => Some(9.5),
            8 => Some(f64::NAN),
            _ => Some(0.0),
        }
    }

    fn named(&self, name: &str) -> Option<f64> {
        match name {
            "a" => Some(10.0),
            "_g" => Some(20.0),
            "u" => Some(f64::NAN),
            _ => None,
        }
    }

    fn nearest(&self, name: &str) -> Option<String> {
        nearest(name, ["a", "_g"]).map(String::from)
    }
}

/// The value that `text` begins with, and what is left.
fn value(text: &str) -> (Result<f64, Fault>, &str) {
    let mut cursor = Cursor::new(text.as_bytes());
    let value = cursor.value(&Known);
    (value, &text[cursor.at..])
}

fn number(text: &str) -> f64 {
    match value(text) {
        (Ok(value), "") => value,
        other => panic!("{text}: {other:?}"),
    }
}

/// The message for what is wrong with `X` and `text` behind it, the octets it points at, and what is read next.
fn refused(text: &str) -> (String, String, String) {
    let line = format!("X{text}");
    let mut cursor = Cursor::new(line.as_bytes());
    assert_eq!(cursor.item(), Some(Ok(Item::Letter(b'X'))));
    let (span, kind) = cursor.value(&Known).expect_err(text);
    let marked = String::from_utf8_lossy(span.slice(line.as_bytes())).into_owned();
    (kind.to_string(), marked, line[cursor.at..].trim_start().to_string())
}

#[test]
fn forms_of_a_value() {
    for (text, expected) in [
        ("12.5", 12.5),
        ("-.5", -0.5),
        ("+-2", -2.0),
        ("--2", 2.0),
        ("- + 2", -2.0),
        ("[1+2]", 3.0),
        ("-[1+2]", -3.0),
        ("#2", 2.0),
        ("-#2", -2.0),
        ("##2", 2.0),
        ("#[1+2]", 3.0),
        ("#+2", 2.0),
        ("#SQRT[16]", 4.0),
        ("#1.00001", 1.0),
        ("#2.99999", 3.0),
        ("#5601", 0.0),
        ("#<a>", 10.0),
        ("#< A >", 10.0),
        ("#<_G>", 20.0),
        ("SIN[30]", 0.5),
        ("+sin[30]", 0.5),
        ("a b s [-1]", 1.0),
        ("ATAN[1]/[-1]", 135.0),
        ("-ATAN[-1]/[0]", 90.0),
        ("EXISTS[#<a>]", 1.0),
        ("EXISTS[#<b>]", 0.0),
        ("EXISTS[#5]", 1.0),
        ("EXISTS[#7]", 1.0),
        ("EXISTS[#[5601+1]]", 0.0),
        ("EXISTS[#-1]", 0.0),
    ] {
        assert_eq!(number(text), expected, "{text}");
    }
    assert!(number("-0").is_sign_negative());
}

#[test]
fn a_value_ends_where_the_next_word_begins() {
    assert_eq!(value("1Y2"), (Ok(1.0), "Y2"));
    assert_eq!(value("[1]2"), (Ok(1.0), "2"));
    assert_eq!(value("#1+2"), (Ok(1.0), "+2"));
    assert_eq!(value("#<a>Y"), (Ok(10.0), "Y"));
    assert_eq!(value("1e3"), (Ok(1.0), "e3"));
}

#[test]
fn precedence_and_order() {
    for (text, expected) in [
        ("[2**3**2]", 64.0),
        ("[-2**2]", 4.0),
        ("[2**-1]", 0.5),
        ("[1+2*3]", 7.0),
        ("[2*3+1]", 7.0),
        ("[2*3**2]", 18.0),
        ("[20-5-3]", 12.0),
        ("[20-2*3-4]", 10.0),
        ("[20/2/5]", 2.0),
        ("[20/2*5]", 50.0),
        ("[2*7 MOD 3]", 2.0),
        ("[1+7 MOD 3]", 2.0),
        ("[-7 MOD 3]", 2.0),
        ("[1 OR 0 AND 0]", 0.0),
        ("[0 AND 0 OR 1]", 1.0),
        ("[1 XOR 1 OR 1]", 1.0),
        ("[10 GT 5 AND 3 LT 4]", 1.0),
        ("[1+1 EQ 2]", 1.0),
        ("[3 GT 2 GT 1]", 0.0),
        ("[1 LT 2 EQ 1]", 1.0),
        ("[1 EQ 1.0000005]", 1.0),
        ("[2--1]", 3.0),
        ("[1*-2]", -2.0),
        ("[[1+2]*[3+4]]", 21.0),
        ("[#1+2]", 3.0),
        ("[1 AND SIN[30]]", 1.0),
        ("[1ANDSIN[30]]", 1.0),
        ("[ 1 a n d 0 ]", 0.0),
        ("[1 - [2 * [3 - 4]]]", 3.0),
    ] {
        assert_eq!(number(text), expected, "{text}");
    }
}

#[test]
#[rustfmt::skip]
fn mistakes_are_told_at_their_place_and_passed() {
    let operators = "an expression goes on with + - * / ** MOD EQ NE GT GE LT LE AND OR XOR or ends with ]";
    let functions = "there are ABS ACOS ASIN ATAN COS EXISTS EXP FIX FUP LN ROUND SIN SQRT TAN";
    let needs = "needs a number, #parameter, function or [expression] behind it";
    let is_no_operator = |found: &str, hint: &str| format!("{found:?} is no operator: {operators}{hint}");
    for (text, message, marked, rest) in [
        (" Y1", format!("X {needs}"), "X", "Y1"),
        (" Y[1]", format!("X {needs}"), "X", "Y[1]"),
        ("", format!("X {needs}"), "X", ""),
        ("- ", format!("- {needs}"), "-", ""),
        ("[1+]Y2", format!("+ {needs}"), "+", "Y2"),
        ("[]Y2", format!("[ {needs}"), "[", "Y2"),
        ("[1 MOD ]", format!("MOD {needs}"), "MOD", ""),
        (". Y1", "a number needs at least one digit".into(), ".", "Y1"),
        ("1.2.3Y1", "a number has one decimal point at most".into(), "1.2.", "Y1"),
        ("[1+[2]", "[ without ]: the expression does not end on this line".into(), "[1+[2]", ""),
        ("[1 (a)]", "[ without ]: the expression does not end on this line".into(), "[1 (a)]", ""),
        ("[1 == 2]Y", is_no_operator("==", "; did you mean EQ?"), "==", "Y"),
        ("[1 % 2]Y", is_no_operator("%", "; did you mean MOD?"), "%", "Y"),
        ("[1 MOT 2]Y", is_no_operator("MOT", "; did you mean MOD?"), "MOT", "Y"),
        ("[1 PLUS 2]Y", is_no_operator("PLUS", ""), "PLUS", "Y"),
        ("[#1 [2]]Y", is_no_operator("[", ""), "[", "Y"),
        ("[[1] 2]Y", is_no_operator("2", ""), "2", "Y"),
        ("SQR[4]Y", format!("SQR is no function: {functions}; did you mean SQRT?"), "SQR", "Y"),
        ("WHAT[4]Y", format!("WHAT is no function: {functions}"), "WHAT", "Y"),
        ("[SIN 30]Y", "SIN needs its argument in brackets: SIN[...]".into(), "SIN", "Y"),
        ("ATAN[1] Y2", "ATAN needs two arguments: ATAN[y]/[x]".into(), "ATAN[1]", "Y2"),
        ("[ATAN[1]/2]Y", "ATAN needs two arguments: ATAN[y]/[x]".into(), "ATAN[1]/", "Y"),
        ("EXISTS[1]Y", "EXISTS asks for one parameter: EXISTS[#<name>] or EXISTS[#5]".into(), "EXISTS", "Y"),
        ("[1 / [2 - #2]]Y", "/ divides by zero here".into(), "[2 - #2]", "Y"),
        ("[1 MOD 0 + 1]Y", "MOD divides by zero here".into(), "0", "Y"),
        ("[0 ** -1]", "** divides by zero here".into(), "0 ** -1", ""),
        (
            "[[0-2] ** 0.5]",
            "-2 ** 0.5: a power of a negative number needs an integer as exponent".into(),
            "[0-2] ** 0.5",
            "",
        ),
        ("SQRT[1-2]Y", "SQRT[-1] has no value: the argument must be 0 or more".into(), "[1-2]", "Y"),
        ("ACOS[2]", "ACOS[2] has no value: the argument must be from -1 to 1".into(), "[2]", ""),
        ("LN[0]", "LN[0] has no value: the argument must be above 0".into(), "[0]", ""),
        ("[10**400]", "the result of ** is too large for a number".into(), "10**400", ""),
        ("#0Y", "#0 is no parameter: they are numbered from 1 to 5601".into(), "#0", "Y"),
        ("#5602 Y", "#5602 is no parameter: they are numbered from 1 to 5601".into(), "#5602", "Y"),
        ("#-1", "#-1 is no parameter: they are numbered from 1 to 5601".into(), "#-1", ""),
        ("##9", "#9.5 is no parameter: its number must be an integer".into(), "#9", ""),
        ("#[1/2]", "#0.5 is no parameter: its number must be an integer".into(), "[1/2]", ""),
        (
            "[#7]",
            "#7 (current position) cannot be read while cutter compensation is on: write G40 first".into(),
            "#7",
            "",
        ),
        ("#<g>Y1", "#<g> is not defined: assign it before it is read; did you mean #<_g>?".into(), "#<g>", "Y1"),
        ("[#<none> + 1]", "#<none> is not defined: assign it before it is read".into(), "#<none>", ""),
        ("#<a", "< without >: the name does not end on this line".into(), "<a", ""),
    ] {
        assert_eq!(refused(text), (message, marked.into(), rest.into()), "{text}");
    }
}

#[test]
fn octets_that_are_no_text_are_refused_in_names() {
    let mut cursor = Cursor::new(b"#<a\xFF>Y");
    let fault = cursor.value(&Known).unwrap_err();
    assert_eq!(fault, (Span::new(3, 4), ErrorKind::BadCharacter('\u{fffd}')));
    assert_eq!(cursor.peek(), Some(b'Y'));
    assert_eq!(refused("[1 \u{e4} 2]").1, "\u{e4}");
}

#[test]
fn what_is_unknown_stays_unknown_and_breaks_no_rule() {
    for text in [
        "[1/#8]",
        "SQRT[#8-100]",
        "[#<u> AND 1]",
        "#[#8]",
        "##<u>",
        "ACOS[#8]",
        "[#8 EQ 1]",
        "ATAN[#8]/[1]",
        "EXISTS[#<u>]",
    ] {
        assert!(number(text).is_nan(), "{text}");
    }
    assert_eq!(refused("[#8 + ]").1, "+");
    assert_eq!(refused("[#8 / 0]").1, "0");
}

#[test]
fn left_side_of_an_assignment() {
    let target = |line: &str| {
        let mut cursor = Cursor::new(line.as_bytes());
        assert_eq!(cursor.item(), Some(Ok(Item::Parameter)));
        let target = cursor.parameter_target(&Known).map_err(|(span, kind)| {
            let marked = String::from_utf8_lossy(span.slice(line.as_bytes())).into_owned();
            (marked, kind.to_string())
        });
        let target = target.map(|target| match target {
            Assigned::Numbered(index) => format!("#{index}"),
            Assigned::Named(name) => format!("<{name}>"),
            Assigned::Unknown => "?".into(),
        });
        (target, line[cursor.at..].trim_start().to_string())
    };
    let found = |what: &str, rest: &str| (Ok(what.to_string()), rest.to_string());
    assert_eq!(target("#1=2"), found("#1", "2"));
    assert_eq!(target(" # [1 + 2] = 2"), found("#3", "2"));
    assert_eq!(target("##2=2"), found("#2", "2"));
    assert_eq!(target("#< New Name >=2"), found("<newname>", "2"));
    assert_eq!(target("##8=2"), found("?", "2"));

    let refused =
        |marked: &str, message: &str, rest: &str| (Err((marked.to_string(), message.to_string())), rest.to_string());
    let assignment = "a parameter at this place needs = and a value: #1 = 5";
    assert_eq!(target("#1 X2"), refused("#1", assignment, "X2"));
    assert_eq!(target("#<a>"), refused("#<a>", assignment, ""));
    assert_eq!(
        target("#0=[1] X2"),
        refused("#0", "#0 is no parameter: they are numbered from 1 to 5601", "X2")
    );
    assert_eq!(
        target("#1.5=[1]X2"),
        refused("1.5", "#1.5 is no parameter: its number must be an integer", "X2")
    );
}

#[test]
fn line_numbers_take_digits_only() {
    let unsigned = |line: &str| {
        let mut cursor = Cursor::new(line.as_bytes());
        cursor.item();
        let number = cursor.unsigned().map_err(|(span, _)| span);
        (number, line[cursor.at..].trim_start().to_string())
    };
    assert_eq!(unsigned("N1.7 G0"), (Ok(1.7), "G0".into()));
    assert_eq!(unsigned("N-5 G0"), (Err(Span::new(0, 1)), "G0".into()));
    assert_eq!(unsigned("N#1 G0"), (Err(Span::new(0, 1)), "G0".into()));
}

/// An expression and its value, each part in brackets.
fn bracketed() -> impl Strategy<Value = (String, f64)> {
    let leaf = (0_u16..1000).prop_map(|number| (format!("{number}"), f64::from(number)));
    leaf.prop_recursive(5, 20, 2, |inner| {
        (
            inner.clone(),
            prop::sample::select(vec!["+", "-", "*", "LT", "XOR"]),
            inner,
        )
            .prop_map(|((left_text, left), operator, (right_text, right))| {
                let value = match operator {
                    "+" => left + right,
                    "-" => left - right,
                    "*" => left * right,
                    "LT" => f64::from(left < right),
                    _ => f64::from((left != 0.0) != (right != 0.0)),
                };
                (format!("[{left_text} {operator} {right_text}]"), value)
            })
    })
}

proptest! {
    #[test]
    fn brackets_fix_the_order((text, expected) in bracketed()) {
        prop_assume!(text.len() <= crate::LINE_OCTETS_MAX);
        prop_assert_eq!(number(&text), expected);
    }

    #[test]
    fn any_octets_are_read_without_panic(
        line in prop::collection::vec(
            prop_oneof![any::<u8>(), prop::sample::select(b"[]#<>+-*/.0123456789 SINATANEXISTSMODa".to_vec())],
            0..crate::LINE_OCTETS_MAX,
        ),
        assignment in any::<bool>(),
    ) {
        let mut cursor = Cursor::new(&line);
        let fault = if assignment && cursor.consume(b'#') {
            cursor.parameter_target(&Known).err()
        } else {
            cursor.value(&Known).inspect(|value| assert!(!value.is_infinite())).err()
        };
        prop_assert!(cursor.at <= line.len());
        if let Some((span, _)) = fault {
            prop_assert!(usize::from(span.end) <= line.len() && span.start <= span.end);
        }
    }
}
