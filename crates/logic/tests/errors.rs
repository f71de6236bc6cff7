//! What is told about a program that is wrong or may not be meant: the place, the rule, the cure.

use crate::common;

use common::{errors, warnings};

const HEAD: &str = "PROGRAM p VAR a, b, level : INT; r : REAL; c, d : BOOL; t : TON; l : ARRAY[1..3] OF INT; w : WORD; u : TIME; s : STRING[4]; END_VAR VAR_OUTPUT q : BOOL; END_VAR VAR_INPUT i : BOOL; END_VAR\n";

/// The errors of these statements, from their second line on.
fn told(statements: &str) -> Vec<String> {
    errors(&format!("{HEAD}{statements}\nEND_PROGRAM"))
}

#[test]
#[rustfmt::skip]
fn statements() {
    let cases = [
        ("a = 5;", "2:3: = compares: write := to assign"),
        ("a := 5\nb := 6;", "2:6: ; is missing behind the statement"),
        ("IF c THEN a := 1; END_IF\nb := 2;", "2:19: ; is missing behind END_IF"),
        ("IF c a := 1; END_IF;", "2:6: THEN is expected here, not a"),
        ("a := r;", "2:6: REAL does not become INT by itself: write REAL_TO_INT(..)"),
        ("a := 1.5;", "2:6: a real number does not become INT by itself: write LREAL_TO_INT(..)"),
        ("a := 40000;", "2:6: 40000 is out of the range of INT: -32768 to 32767"),
        ("c := 2;", "2:6: 2 is no BOOL: these are 0 and 1, FALSE and TRUE"),
        ("c := d = -1;", "2:10: -1 is no BOOL: these are 0 and 1, FALSE and TRUE"),
        ("c := a AND b;", "2:6: AND does not take INT: write INT_TO_WORD(..)"),
        ("w := w + 1;", "2:6: + does not take WORD: write WORD_TO_UINT(..)"),
        ("r := a ** 2;", "2:6: ** does not take INT: write INT_TO_LREAL(..)"),
        ("r := LINT#5 * 0.5;", "2:6: * does not take LINT and a real number together: write LINT_TO_LREAL(..)"),
        ("a := b * 0.5;", "2:6: REAL does not become INT by itself: write REAL_TO_INT(..)"),
        ("u := 5;", "2:6: an integer does not become TIME by itself: write T#5ms"),
        ("c := t.ET > 500;", "2:13: an integer does not become TIME by itself: write T#500ms"),
        ("b := SHR(a, 2);", "2:10: SHR does not take INT: write INT_TO_WORD(..)"),
        ("c := a < b < 3;", "2:14: 3 is no BOOL: these are 0 and 1, FALSE and TRUE"),
        ("c := w > BYTE#1;", "2:6: > does not take WORD and BYTE together: write BYTE_TO_WORD(..)"),
        (
            "a := TON(IN := c);",
            "2:6: TON is a function block: declare an instance of it, VAR x : TON; END_VAR, and call that",
        ),
        (
            "TON(IN := c);",
            "2:1: TON is a function block: declare an instance of it, VAR x : TON; END_VAR, and call that",
        ),
        ("c := t(IN := c);", "2:6: a block is called as a statement; its outputs are read as t.Q"),
        ("SQRT(r);", "2:1: SQRT is a function: its result is used, x := SQRT(..)"),
        ("a(b := 1);", "2:1: a is no instance of a function block, and cannot be called"),
        ("r := SQTR(r);", "2:6: SQTR is no function: is SQRT meant?"),
        ("a := SEL(c, 1);", "2:6: SEL takes 3 inputs, not 2"),
        ("a := MAX(1);", "2:6: MAX takes 2 inputs or more, not 1"),
        ("a := LIMIT(MN := 0, INN := 5, MX := 9);", "2:21: LIMIT has no input INN: is IN meant?"),
        ("t(INN := c);", "2:3: TON has no input INN: is IN meant?"),
        ("t(IN := c, IN := d);", "2:12: IN is given twice"),
        ("t(IN => c);", "2:3: TON has no output IN"),
        ("t.Q := TRUE;", "2:1: t.Q is an output of a function block, and is not assigned here"),
        ("c := t.PHASE;", "2:8: PHASE of TON is not visible from outside"),
        ("c := t.ETT;", "2:8: TON has no ETT: is ET meant?"),
        ("i := TRUE;", "2:1: i is an input, and is not assigned here"),
        ("levl := 1;", "2:1: levl is not declared: is level meant?"),
        ("zebra := 1;", "2:1: zebra is not declared"),
        ("l[4] := 1;", "2:3: 4 is out of the array: 1 to 3"),
        ("a := l[0];", "2:8: 0 is out of the array: 1 to 3"),
        ("a := l[1, 2];", "2:7: ARRAY [1..3] OF INT has 1 dimensions, not 2"),
        ("a := l;", "2:6: ARRAY [1..3] OF INT does not become INT by itself"),
        ("a := a[1];", "2:7: INT has no elements"),
        ("a := a.x;", "2:8: INT has no members"),
        ("a := b / 0;", "2:10: division by zero"),
        ("a := 5 MOD (2 - 2);", "2:12: division by zero"),
        ("r := r / 0.0;", "2:10: division by zero"),
        ("FOR a := 1 TO 3 DO a := 2; END_FOR;", "2:20: a counts the loop, and is not assigned inside"),
        ("FOR a := 1 TO 3 BY 0 DO ; END_FOR;", "2:20: the step of a loop is not 0"),
        (
            "FOR r := 1 TO 3 DO ; END_FOR;",
            "2:5: the control variable of FOR is an integer variable, no element, no member and no VAR_IN_OUT",
        ),
        (
            "FOR l[1] := 1 TO 3 DO ; END_FOR;",
            "2:5: the control variable of FOR is an integer variable, no element, no member and no VAR_IN_OUT",
        ),
        ("EXIT;", "2:1: EXIT stands in a loop only"),
        ("CASE a OF 1: b := 1; 0..3: b := 2; END_CASE;", "2:22: 1 is already selected above"),
        ("CASE a OF 3..1: b := 1; END_CASE;", "2:11: a range begins with its lower value"),
        ("CASE a OF b: b := 1; END_CASE;", "2:11: a constant is needed here"),
        ("CASE c OF 1: b := 1; END_CASE;", "2:6: TRUE or FALSE are not selected here: write IF"),
        ("IF a THEN ; END_IF;", "2:4: INT does not become BOOL by itself: write INT_TO_BOOL(..)"),
        ("a := ;", "2:6: a value is expected here, not ;"),
        ("a := (1 + 2;", "2:12: ) is expected here, not ;"),
        ("END_IF;", "2:1: END_PROGRAM is expected here, not END_IF"),
        ("a := %IX0.0;", "2:6: %IX0.0 in an expression; a variable may be declared AT it is not supported"),
    ];
    for (statements, wanted) in cases {
        assert_eq!(told(statements)[0], wanted, "{statements}");
    }
}

#[test]
#[rustfmt::skip]
fn declarations() {
    let cases = [
        ("PROGRAM p VAR a : IMT; END_VAR END_PROGRAM", "1:19: IMT is no type: is INT meant?"),
        ("PROGRAM p VAR a : INT; A : INT; END_VAR END_PROGRAM", "1:24: A is already declared"),
        ("PROGRAM p VAR if : INT; END_VAR END_PROGRAM", "1:15: if is a word of the language"),
        ("PROGRAM p VAR CONSTANT a : INT; END_VAR END_PROGRAM", "1:24: a constant needs a value: write :="),
        (
            "PROGRAM p VAR CONSTANT a : INT := 1; END_VAR a := 2; END_PROGRAM",
            "1:46: a is a constant, and is not assigned here",
        ),
        (
            "PROGRAM p VAR a : ARRAY[3..1] OF INT; END_VAR END_PROGRAM",
            "1:25: bounds of an array are from -2147483648 to 2147483647, the lower one first",
        ),
        (
            "PROGRAM p VAR a : ARRAY[1..100000] OF INT; END_VAR END_PROGRAM",
            "1:19: the variables need 100000 values, and there is room for 65536",
        ),
        ("PROGRAM p VAR a : ARRAY[1..2] OF INT := [1, 2, 3]; END_VAR END_PROGRAM", "1:41: 3 values for 2"),
        ("PROGRAM p VAR a : INT := [1]; END_VAR END_PROGRAM", "1:26: this is no value of INT"),
        ("PROGRAM p VAR a AT %IW0 : BOOL; END_VAR END_PROGRAM", "1:20: %IW0 holds 16 bits, a BOOL does not"),
        (
            "PROGRAM p VAR a AT %IX0.0 : BOOL; b AT %I0.0 : BOOL; END_VAR END_PROGRAM",
            "1:35: b is at %IX0.0, as another variable is",
        ),
        (
            "PROGRAM p VAR a AT %IX0.0 : BOOL; END_VAR a := TRUE; END_PROGRAM",
            "1:43: a is an input, and is not assigned here",
        ),
        (
            "FUNCTION f : INT VAR t : TON; END_VAR f := 1; END_FUNCTION",
            "1:22: a function keeps nothing, so it has no function block and no address: t",
        ),
        (
            "FUNCTION f : INT VAR_OUTPUT x : INT; END_VAR f := 1; END_FUNCTION",
            "1:29: VAR_OUTPUT does not belong into a FUNCTION",
        ),
        ("FUNCTION f : INT f := f(); END_FUNCTION", "1:23: f contains itself"),
        ("FUNCTION f : INT f := g(); END_FUNCTION FUNCTION g : INT g := f(); END_FUNCTION", "1:63: f contains itself"),
        ("FUNCTION_BLOCK f VAR x : f; END_VAR END_FUNCTION_BLOCK", "1:26: f contains itself"),
        ("TYPE a : STRUCT x : b; END_STRUCT; b : STRUCT x : a; END_STRUCT; END_TYPE", "1:51: a contains itself"),
        (
            "FUNCTION_BLOCK f VAR_IN_OUT x : INT; END_VAR END_FUNCTION_BLOCK PROGRAM p VAR b : f; END_VAR b(); END_PROGRAM",
            "1:94: x of f is missing",
        ),
        (
            "FUNCTION_BLOCK f VAR_IN_OUT x : INT; END_VAR END_FUNCTION_BLOCK PROGRAM p VAR b : f; END_VAR b(x := 5); END_PROGRAM",
            "1:101: x is VAR_IN_OUT: it takes a variable that may be assigned",
        ),
        (
            "FUNCTION_BLOCK f VAR_IN_OUT x : INT; END_VAR FOR x := 1 TO 3 DO ; END_FOR; END_FUNCTION_BLOCK",
            "1:50: the control variable of FOR is an integer variable, no element, no member and no VAR_IN_OUT",
        ),
        (
            "VAR_GLOBAL g : INT; END_VAR FUNCTION f : INT f := g; END_FUNCTION",
            "1:51: a function sees constants only of VAR_GLOBAL: g may be given as an input",
        ),
        ("PROGRAM p VAR_EXTERNAL g : INT; END_VAR END_PROGRAM", "1:24: g is not declared"),
        (
            "VAR_GLOBAL g : INT; END_VAR PROGRAM p VAR_EXTERNAL g : DINT; END_VAR END_PROGRAM",
            "1:56: the type of g is INT where it is declared",
        ),
        (
            "TYPE a : (x, y); b : (x, z); END_TYPE PROGRAM p VAR c : INT; END_VAR IF x = x THEN ; END_IF; END_PROGRAM",
            "1:73: x belongs to several enumerations: write a#x",
        ),
        ("TYPE a : (x, y); END_TYPE PROGRAM p VAR c : a; END_VAR c := a#z; END_PROGRAM", "1:63: a has no z"),
        ("PROGRAM p VAR a : INT (0..5); END_VAR END_PROGRAM", "1:19: a subrange is not supported"),
        (
            "TYPE s : STRUCT if : INT; x : INT; END_STRUCT; t : INT; END_TYPE PROGRAM p VAR a : s; b : t; END_VAR a.x := b; END_PROGRAM",
            "1:17: if is a word of the language",
        ),
        (
            "FUNCTION_BLOCK f VAR_INPUT t : TON; END_VAR t(IN := TRUE); END_FUNCTION_BLOCK",
            "1:45: t is an input, and is not called here: what the call keeps would be lost; VAR_IN_OUT hands it over",
        ),
        (
            "FUNCTION_BLOCK f VAR_INPUT t : ARRAY[1..2] OF TON; END_VAR t[1](IN := TRUE); END_FUNCTION_BLOCK",
            "1:60: t[..] is an input, and is not called here: what the call keeps would be lost; VAR_IN_OUT hands it over",
        ),
        (
            "FUNCTION_BLOCK f VAR_INPUT t : TON; END_VAR t.IN := TRUE; END_FUNCTION_BLOCK",
            "1:45: t.IN is an input, and is not assigned here",
        ),
        (
            "FUNCTION_BLOCK f VAR_IN_OUT t : TON; END_VAR t(IN := TRUE); END_FUNCTION_BLOCK
             FUNCTION_BLOCK g VAR_INPUT t : TON; END_VAR VAR x : f; END_VAR x(t := t); END_FUNCTION_BLOCK",
            "2:84: t is an input, and is not called here: what the call keeps would be lost; VAR_IN_OUT hands it over",
        ),
        (
            "VAR_GLOBAL g : INT; END_VAR PROGRAM p VAR_EXTERNAL CONSTANT g : INT; END_VAR g := 1; END_PROGRAM",
            "1:78: g is a constant, and is not assigned here",
        ),
        (
            "VAR_GLOBAL g : INT; END_VAR FUNCTION_BLOCK f VAR_IN_OUT x : INT; END_VAR x := 1; END_FUNCTION_BLOCK
             PROGRAM p VAR_EXTERNAL CONSTANT g : INT; END_VAR VAR b : f; END_VAR b(x := g); END_PROGRAM",
            "2:89: g is a constant, and is not assigned here",
        ),
        (
            "VAR_GLOBAL g : TON; END_VAR PROGRAM p VAR_EXTERNAL CONSTANT g : TON; END_VAR g(); END_PROGRAM",
            "1:78: g is a constant, and is not called here: what the call keeps would be lost; VAR_IN_OUT hands it over",
        ),
        (
            "VAR_GLOBAL g : INT; END_VAR PROGRAM p VAR_EXTERNAL g : INT := 5; END_VAR END_PROGRAM",
            "1:63: g has its value of the start where it is declared, in VAR_GLOBAL",
        ),
        (
            "PROGRAM p VAR a : add; END_VAR END_PROGRAM FUNCTION_BLOCK add END_FUNCTION_BLOCK",
            "1:59: add is already declared",
        ),
        ("PROGRAM p VAR a : STRING[0]; END_VAR END_PROGRAM", "1:26: a STRING holds 1 to 65535 characters"),
        ("CLASS c END_CLASS", "1:1: CLASS is not supported (object orientation)"),
        ("TYPE a : INT; END_TYPE", "1:1: there is no PROGRAM in the file"),
        ("", "1:1: there is no PROGRAM in the file"),
        ("x := 5;", "1:1: PROGRAM, FUNCTION_BLOCK, FUNCTION, TYPE or VAR_GLOBAL is expected here, not x"),
    ];
    for (text, wanted) in cases {
        assert_eq!(errors(text)[0], wanted, "{text}");
    }
}

#[test]
fn all_errors_are_told_at_once_in_their_order() {
    let text = "a = 5;\nb := r;\nIF c THEN\n  zebra := 1;\n  c := 7;\nEND_IF\nFOR a := 1 TO q DO ; END_FOR;";
    let wanted = [
        "2:3: = compares: write := to assign",
        "3:6: REAL does not become INT by itself: write REAL_TO_INT(..)",
        "5:3: zebra is not declared",
        "6:8: 7 is no BOOL: these are 0 and 1, FALSE and TRUE",
        "7:1: ; is missing behind END_IF",
        "8:15: BOOL does not become INT by itself: write BOOL_TO_INT(..)",
    ];
    assert_eq!(told(text), wanted);
}

#[test]
fn what_may_not_be_meant_is_a_warning() {
    let of = |statements: &str| warnings(&format!("{HEAD}{statements}\nEND_PROGRAM"));
    let cases = [
        (
            "r := -r ** 2;",
            "2:6: warning: - is stronger than **: this is (-a) ** b",
        ),
        (
            "c := r = 1.5;",
            "2:6: warning: two REAL are hardly ever equal: compare their difference with a tolerance",
        ),
        (
            "q := c;\nq := d;",
            "3:1: warning: q is assigned twice; the last value counts",
        ),
        (
            "IF TRUE THEN a := 1; ELSE a := 2; END_IF;",
            "2:22: warning: this branch is never reached: the condition above is TRUE",
        ),
        ("{hint} a := 1;", "2:1: note: the pragma has no effect"),
        (
            "FOR a := 1 TO level DO level := 2; END_FOR;",
            "2:24: warning: level is altered in the loop, whose TO and BY hold as they were before the first iteration",
        ),
        (
            "FOR a := 1 TO 9 BY l[1] DO WHILE c DO l[b] := 2; END_WHILE; END_FOR;",
            "2:39: warning: l is altered in the loop, whose TO and BY hold as they were before the first iteration",
        ),
        (
            "FOR a := 1 TO TIME_TO_INT(t.ET) DO t(IN := c, PT := u); END_FOR;",
            "2:36: warning: t is altered in the loop, whose TO and BY hold as they were before the first iteration",
        ),
        (
            "s := 'ABCDEF';",
            "2:6: warning: the text is longer than STRING[4], and is cut to its first 4 characters",
        ),
        (
            "r := INT_TO_REAL(a * b);",
            "2:18: warning: this is worked out as INT, and becomes wider behind it: write INT_TO_REAL(..) of each value",
        ),
    ];
    for (statements, wanted) in cases {
        assert_eq!(of(statements), [wanted], "{statements}");
    }
    assert!(
        of("FOR a := 1 TO l[1] DO l[2] := a; END_FOR; level := 9; FOR a := level TO 3 DO level := 1; END_FOR;")
            .is_empty()
    );
    assert!(of("r := (-r) ** 2; q := FALSE; IF c THEN q := TRUE; END_IF;").is_empty());
    let of_enumeration = "TYPE e : (x, y); END_TYPE PROGRAM p VAR v : e; n : INT; END_VAR\nCASE v OF x: n := 1; y: n := 2; ELSE n := 3; END_CASE; END_PROGRAM";
    assert_eq!(
        warnings(of_enumeration),
        ["2:33: warning: ELSE is never reached: every value is selected above"]
    );
    let falling = "PROGRAM p VAR f : F_TRIG; END_VAR f(CLK := TRUE); f(CLK := FALSE); END_PROGRAM";
    assert_eq!(
        warnings(falling),
        ["1:35: note: F_TRIG gives no pulse in its first call; some controls do"]
    );
}

#[test]
fn an_error_is_shown_with_its_line() {
    let text = "PROGRAM p\nVAR x : INT; END_VAR\n  x := 'ä' + zebra;\nEND_PROGRAM";
    let Err(errors) = logic::compile(text) else {
        panic!("it compiles")
    };
    let shown = errors[0].render("machine.st");
    assert!(shown.contains("machine.st:3:14") && shown.contains("^^^^^"), "{shown}");
}

#[test]
fn what_nests_too_deep_or_is_too_long_is_refused() {
    let nested = |open: &str, close: &str, count: usize| {
        format!(
            "PROGRAM p VAR x : INT; c : BOOL; END_VAR {}{} END_PROGRAM",
            open.repeat(count),
            close.repeat(count)
        )
    };
    for text in [
        nested("x := (", ")", 1).replace('(', &"(".repeat(10_000)),
        nested("IF c THEN ", "END_IF; ", 10_000),
        format!(
            "PROGRAM p VAR x : INT; END_VAR x := {}1; END_PROGRAM",
            "1 + ".repeat(10_000)
        ),
        format!(
            "PROGRAM p VAR x : INT; END_VAR x := {}1; END_PROGRAM",
            "-".repeat(10_000)
        ),
        format!(
            "PROGRAM p VAR x : {}INT; END_VAR END_PROGRAM",
            "ARRAY[1..1] OF ".repeat(10_000)
        ),
        format!("PROGRAM p VAR x : INT := {}1; END_VAR END_PROGRAM", "[".repeat(10_000)),
        format!(
            "PROGRAM p VAR x : INT; END_VAR x{} := 1; END_PROGRAM",
            "[1]".repeat(10_000)
        ),
    ] {
        let told = errors(&text);
        assert!(
            told.iter().any(|one| one.contains("nested deeper than")),
            "{:.100}: {told:?}",
            text
        );
    }
    let chain: String = (0..100)
        .map(|index| format!("FUNCTION f{index} : INT f{index} := f{}(); END_FUNCTION ", index + 1))
        .collect();
    assert!(errors(&chain).iter().any(|one| one.contains("nested deeper than")));
    assert_eq!(
        errors(&" ".repeat(2 << 20)),
        ["1:1: a program has at most 1048576 octets"]
    );
}

/// Memory that is passed is told once, with what is needed, and what depends on it is good.
#[test]
fn memory_that_is_passed_is_told_once() {
    let told = |text: &str| errors(text);
    assert_eq!(
        told("PROGRAM p VAR a, b : ARRAY[1..40000] OF INT; c, d : INT; END_VAR c := d + a[1] + b[2]; END_PROGRAM"),
        ["1:9: the variables need 80002 values, and there is room for 65536"]
    );
    assert_eq!(
        told(
            "PROGRAM p VAR a, b : ARRAY[1..70000] OF INT; c : ARRAY[1..80000] OF INT; END_VAR a[1] := c[2]; END_PROGRAM"
        ),
        ["1:22: the variables need 70000 values, and there is room for 65536"]
    );
    assert_eq!(
        told(
            "TYPE s : STRUCT a, b, c : ARRAY[1..30000] OF INT; END_STRUCT END_TYPE PROGRAM p VAR x, y : s; END_VAR x := y; END_PROGRAM"
        ),
        ["1:6: the variables need 90000 values, and there is room for 65536"]
    );
}

/// Whatever is 65,536 values long is taken, however it is put together.
#[test]
fn all_the_memory_there_is_can_be_used() {
    let members = |count: usize| (0..count).map(|n| format!("a{n} : BOOL; ")).collect::<String>();
    for (count, variables) in [(3000, 21), (1000, 65), (65_530, 1)] {
        let names: Vec<String> = (0..variables).map(|n| format!("x{n}")).collect();
        let text = format!(
            "TYPE s : STRUCT {} END_STRUCT END_TYPE PROGRAM p VAR {} : s; END_VAR x0.a7 := TRUE; END_PROGRAM",
            members(count),
            names.join(", ")
        );
        let logic = logic::compile(&text).unwrap_or_else(|told| panic!("{count}: {}", told[0]));
        assert_eq!(logic.values(), count * variables);
    }
}

/// A long row of inputs is refused, not worked out to the end of the stack.
#[test]
fn a_function_takes_so_many_inputs_and_no_more() {
    let inputs = |count: usize| vec!["a"; count].join(", ");
    assert_eq!(
        told(&format!("a := ADD({});", inputs(100_000))),
        ["2:6: ADD takes 250 inputs at most, not 100000"]
    );
    let _ = common::after(
        "PROGRAM p VAR a : INT; END_VAR",
        &format!("a := ADD({});", inputs(250)),
        &[],
    );
}

/// All that is told about a program of these declarations and statements, one line each.
#[track_caller]
fn tells(text: &str, wanted: &[&str]) {
    assert_eq!(errors(text), wanted, "{text}");
}

#[test]
fn one_slip_in_a_head_is_one_error_and_the_rest_is_told() {
    let told_of = |statements: &str, wanted: &[&str]| {
        let mut all = wanted.to_vec();
        all.push("3:1: zebra is not declared");
        assert_eq!(told(&format!("{statements}\nzebra := 1;")), all, "{statements}");
    };
    let cases: [(&str, &[&str]); 15] = [
        (
            "IF a == b THEN zebra2 := 1; END_IF;",
            &["2:6: == is no operator: write =", "2:16: zebra2 is not declared"],
        ),
        (
            "WHILE a < b && b > 0 DO b := a; END_WHILE;",
            &["2:13: && is no operator: write AND"],
        ),
        (
            "IF c || d THEN a := 1; ELSIF a != b THEN ; END_IF;",
            &["2:6: || is no operator: write OR", "2:32: != is no operator: write <>"],
        ),
        (
            "IF a = THEN a := 1; ELSE lemon := 2; END_IF;",
            &["2:8: THEN is a word of the language", "2:26: lemon is not declared"],
        ),
        (
            "IF a := b THEN a := 1; END_IF;",
            &["2:6: THEN is expected here, not :="],
        ),
        (
            "IF (a = b THEN a := 1; END_IF;",
            &["2:11: ) is expected here, not THEN"],
        ),
        ("WHILE DO a := 1; END_WHILE;", &["2:7: DO is a word of the language"]),
        (
            "FOR a = 1 TO 3 DO b := 2; END_FOR;",
            &["2:7: = compares: write := to assign"],
        ),
        (
            "FOR a := 1 T 3 DO lemon := 2; END_FOR;",
            &["2:12: TO is expected here, not T", "2:19: lemon is not declared"],
        ),
        (
            "FOR a := 1 TO 3 BY DO EXIT; END_FOR;",
            &["2:20: DO is a word of the language"],
        ),
        (
            "FOR a := c TO r DO lemon := 2; END_FOR;",
            &[
                "2:10: BOOL does not become INT by itself: write BOOL_TO_INT(..)",
                "2:15: REAL does not become INT by itself: write REAL_TO_INT(..)",
                "2:20: lemon is not declared",
            ],
        ),
        (
            "CASE a + OF 1: b := 1; 2: lemon := 1; END_CASE;",
            &["2:10: OF is a word of the language", "2:27: lemon is not declared"],
        ),
        (
            "CASE r OF 1: b := 1; ELSE lemon := 2; END_CASE;",
            &["2:6: CASE does not take REAL", "2:27: lemon is not declared"],
        ),
        (
            "CASE a OF 1 2: b := 1; 3: lemon := 2; END_CASE;",
            &["2:13: : is expected here, not 2", "2:27: lemon is not declared"],
        ),
        (
            "REPEAT a := 1; UNTIL a == END_REPEAT;",
            &[
                "2:24: == is no operator: write =",
                "2:27: END_REPEAT is a word of the language",
            ],
        ),
    ];
    for (statements, wanted) in cases {
        told_of(statements, wanted);
    }
}

#[test]
fn elsif_is_one_word() {
    let text = "IF a = 1 THEN\n  b := 1;\nELSE IF a = 2 THEN\n  b := 2;\nEND_IF;\nb := b + 1;";
    assert_eq!(
        told(text),
        ["4:1: this IF has no END_IF of its own: ELSIF in one word goes on with the IF above"]
    );
    let _ = common::after(
        "PROGRAM p VAR a : INT; END_VAR",
        "IF a = 1 THEN ; ELSE IF a = 2 THEN a := 3; END_IF; END_IF;",
        &[],
    );
    for word in ["ELSEIF", "ELSE_IF", "elif"] {
        assert_eq!(
            told(&format!(
                "IF a = 1 THEN b := 1; {word} a = 2 THEN lemon := 2; ELSE b := 3; END_IF;"
            )),
            [
                format!("2:23: {word} is one word, ELSIF"),
                format!("2:{}: lemon is not declared", 37 + word.len() - 2)
            ]
        );
    }
}

#[test]
fn what_is_not_supported_is_named_once_and_not_taken_for_something_else() {
    tells(
        "PROGRAM p VAR l : ARRAY[0..9] OF REAL; p : POINTER TO REAL; q : REF_TO INT; k : INT; END_VAR
         p := ADR(l); FOR k := 0 TO 9 DO p^ := 0.0; END_FOR; q := REF(k); END_PROGRAM",
        &["1:44: POINTER is not supported (pointers and references)"],
    );
    tells(
        "PROGRAM p VAR w : WORD; c : BOOL; END_VAR\nc := w.3;\nIF w.0 THEN\n  w.15 := FALSE;\nEND_IF;\nEND_PROGRAM",
        &[
            "2:6: bits of words are not supported: write (SHR(w, 3) AND 1) <> 0",
            "3:4: bits of words are not supported: write (SHR(w, 0) AND 1) <> 0",
            "4:3: bits of words are not supported: write w := w OR 16#8000, or w AND NOT 16#8000",
        ],
    );
    tells(
        "PROGRAM p VAR s : STRING; b : TOD; d : DATE; n : INT; e : WSTRING[5]; END_VAR n := LEN(s) + FIND(s, 'x'); d := D#2020-01-31; e := \"x\"; END_PROGRAM",
        &[
            "1:31: TOD is not supported (dates)",
            "1:59: WSTRING is not supported",
            "1:84: LEN is not supported (functions of strings)",
            "1:131: WSTRING is not supported (texts of 16 bits)",
        ],
    );
    tells(
        "PROGRAM p VAR go, there : BOOL; END_VAR INITIAL_STEP wait: END_STEP TRANSITION FROM wait TO move := go; END_TRANSITION
         STEP move: feed(N); END_STEP ACTION feed: there := TRUE; END_ACTION END_PROGRAM",
        &["1:41: INITIAL_STEP is not supported (SFC, sequential function charts)"],
    );
    tells(
        "FUNCTION_BLOCK base VAR_OUTPUT on : BOOL; END_VAR METHOD m : INT VAR x : INT; END_VAR m := 1; END_METHOD on := TRUE; END_FUNCTION_BLOCK
         FUNCTION_BLOCK lamp EXTENDS base VAR_OUTPUT bright : INT; END_VAR bright := 5; on := TRUE; END_FUNCTION_BLOCK
         PROGRAM p VAR l : lamp; c : BOOL; END_VAR l(other := 1); c := l.on; zebra := 1; END_PROGRAM",
        &["1:51: METHOD is not supported (object orientation)", "3:78: zebra is not declared"],
    );
    tells(
        "FUNCTION_BLOCK b VAR n : INT; END_VAR METHOD PUBLIC go : INT THIS^.n := 1; END_METHOD ACTION stop: n := 0; END_ACTION stop(); THIS^.n := 2; END_FUNCTION_BLOCK
         PROGRAM p VAR x : b; n : INT; END_VAR x.go(); x.stop(); n := x.go(1); x.halt(); END_PROGRAM",
        &[
            "1:39: METHOD is not supported (object orientation)",
            "1:87: ACTION is not supported (actions)",
            "2:82: b has no halt",
        ],
    );
    tells(
        "PROGRAM p VAR t : TON; n : INT; END_VAR t(EN := TRUE, IN := TRUE); n := ADD(EN := TRUE, IN1 := 1, IN2 := 2); END_PROGRAM",
        &["1:43: EN is not supported (EN and ENO)"],
    );
    tells(
        "PROGRAM p VAR n : INT; END_VAR ACTION a: n := 1; END_ACTION lemon := 2; END_PROGRAM TYPE u : UNION a : INT; END_UNION; END_TYPE",
        &[
            "1:32: ACTION is not supported (actions)",
            "1:61: lemon is not declared",
            "1:94: UNION is not supported",
        ],
    );
    // What is called like a word of another tool is nobody else's.
    let _ = common::after(
        "PROGRAM p VAR step, action, transition, elsif2, len : INT; END_VAR",
        "step := 1; action := step; transition := action; len := transition;",
        &[],
    );
}

#[test]
fn values_of_enumerations_are_found_though_they_are_written_otherwise() {
    tells(
        "TYPE Phase : (idle, moving); END_TYPE PROGRAM p VAR phase : Phase; x : Phase; n : INT; END_VAR\n\
         CASE phase OF\nPhase.idle: n := 1;\nPhase.moving: n := 2;\nEND_CASE; x := Phase.moving; END_PROGRAM",
        &[
            "3:1: a value of an enumeration stands behind #: write Phase#idle",
            "4:1: a value of an enumeration stands behind #: write Phase#moving",
            "5:16: a value of an enumeration stands behind #: write Phase#moving",
        ],
    );
    tells(
        "TYPE Phase : (idle, moving); END_TYPE PROGRAM p VAR x : Phase; END_VAR x := Phase.moving; END_PROGRAM",
        &["1:77: a value of an enumeration stands behind #: write Phase#moving"],
    );
    tells(
        "TYPE Door : (OPEN, CLOSED); END_TYPE PROGRAM p VAR door : Door; open : BOOL; END_VAR\n\
         CASE door OF OPEN: open := TRUE; CLOSED: open := FALSE; END_CASE; END_PROGRAM",
        &["2:14: OPEN is the variable open here, for names are read without their case: write Door#OPEN"],
    );
}

#[test]
fn a_declaration_that_is_refused_is_told_once() {
    let uses = "x := 5; n := x; IF x > 3 THEN x := x + 1; END_IF;";
    for (declaration, wanted) in [
        ("x : INT (0..120);", "a subrange is not supported"),
        ("x : IMT;", "IMT is no type: is INT meant?"),
        (
            "x : INT := TRUE;",
            "BOOL does not become INT by itself: write BOOL_TO_INT(..)",
        ),
        (
            "x : STRUCT a : INT; END_STRUCT;",
            "a structure without a name of its own (one may be declared in TYPE) is not supported",
        ),
    ] {
        let told = errors(&format!(
            "PROGRAM p VAR n : INT; {declaration} END_VAR {uses} END_PROGRAM"
        ));
        assert_eq!(told.len(), 1, "{told:?}");
        assert!(told[0].ends_with(wanted), "{told:?}");
    }
    tells(
        "TYPE s : STRUCT a : INT (0..5); b : INT; END_STRUCT END_TYPE VAR_GLOBAL g : INT (0..5); END_VAR PROGRAM p VAR x : s; END_VAR VAR_EXTERNAL g : INT; END_VAR x.b := 1; g := x.a; END_PROGRAM",
        &["1:21: a subrange is not supported", "1:77: a subrange is not supported"],
    );
}

#[test]
fn xml_is_no_program() {
    for text in ["<?xml version=\"1.0\"?><a/>", "\u{feff}\r\n <project>", "<!-- x -->"] {
        assert_eq!(
            errors(text),
            [
                "1:1: this is XML, of another tool: its program stands in CDATA or comes from its export as text, and goes into a file of its own"
            ]
        );
    }
}
