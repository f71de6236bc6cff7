//! Text of the second edition of the standard that programs of other controls have: what it does.

use crate::common;

use common::{after, errors, get, scan, set, start, value};
use logic::{Role, Wrong};

#[test]
fn bit_strings_have_an_order_without_a_sign() {
    let declarations = "PROGRAM p VAR b : BYTE := 16#C8; m : BYTE := 16#64; d : DWORD := 16#8000_0001; l : LWORD := 16#8000_0000_0000_0000; x, y : BOOL; END_VAR";
    let cases = [
        ("x := b > m; y := m >= b;", "1", "0"),
        ("x := d < 2; y := l > 1;", "0", "1"),
        ("x := MAX(b, m) = 16#C8; y := MIN(l, LWORD#1) = 1;", "1", "1"),
        (
            "x := LIMIT(16#10, b, 16#80) = 16#80; y := LIMIT(16#10, BYTE#1, 16#80) = 16#10;",
            "1",
            "1",
        ),
        ("x := (b AND NOT 16#08) = 16#C0; y := GT(b, m, BYTE#1);", "1", "1"),
    ];
    for (statements, x, y) in cases {
        assert_eq!(after(declarations, statements, &["x", "y"]), [x, y], "{statements}");
    }
}

#[test]
fn zero_and_one_are_values_of_bool() {
    let declarations = "PROGRAM p VAR a : BOOL := 1; b : BOOL := 0; x, y : BOOL; END_VAR";
    let cases = [
        ("x := 1; y := 0;", "1", "0"),
        ("IF a = 1 THEN x := 1; END_IF; y := b <> 0;", "1", "0"),
        ("x := a AND 1; y := SEL(0, 1, b);", "1", "1"),
    ];
    for (statements, x, y) in cases {
        assert_eq!(after(declarations, statements, &["x", "y"]), [x, y], "{statements}");
    }
    assert_eq!(
        errors(&format!("{declarations}\nx := 2;\nx := a + 1;\nEND_PROGRAM")),
        [
            "2:6: 2 is no BOOL: these are 0 and 1, FALSE and TRUE",
            "3:6: + does not take BOOL"
        ]
    );
}

#[test]
fn literals_that_are_joined_are_bits() {
    assert_eq!(value("WORD", "16#0F00 OR 16#00F0"), "4080");
    assert_eq!(value("BYTE", "2#1010 XOR 16#F AND 16#3"), "9");
    assert_eq!(value("DWORD", "OR(16#1, 16#2, 16#8000_0000)"), "2147483651");
    assert_eq!(value("BOOL", "(WORD#16#F0 AND (16#10 OR 16#20)) = 16#30"), "1");
    assert_eq!(
        errors("PROGRAM p VAR n : INT; END_VAR n := 16#1 OR 16#2; END_PROGRAM"),
        ["1:45: OR does not take an integer"]
    );
}

#[test]
fn a_global_variable_counts_a_loop() {
    let text = "VAR_GLOBAL station : INT; END_VAR
        FUNCTION_BLOCK inner VAR_OUTPUT n : INT; END_VAR FOR station := 10 TO 12 DO n := n + 1; END_FOR; END_FUNCTION_BLOCK
        PROGRAM p VAR sum, times : INT; b : inner; END_VAR
        FOR station := 1 TO 4 DO sum := sum + station; END_FOR;
        FOR station := 1 TO 3 DO b(); times := times + 1; END_FOR;";
    assert_eq!(
        after(text, "", &["sum", "times", "b.n", "station"]),
        ["10", "3", "9", "14"]
    );
}

#[test]
fn inputs_may_be_edges() {
    let text = "FUNCTION_BLOCK pieces VAR_INPUT up : BOOL R_EDGE; down : BOOL F_EDGE := TRUE; level : BOOL; END_VAR VAR_OUTPUT n, m : INT; END_VAR
            IF up THEN n := n + 1; END_IF; IF down THEN m := m + 1; END_IF;
        END_FUNCTION_BLOCK
        PROGRAM p VAR_INPUT light : BOOL; start : BOOL R_EDGE; END_VAR VAR a : pieces; b : ARRAY[1..2] OF pieces; own : INT; seen : BOOL; END_VAR
            a(up := light, down := light); b[2](up := light); seen := a.up;
            IF start THEN own := own + 1; END_IF;
        END_PROGRAM";
    let mut runtime = start(text);
    for (call, light) in ["0", "1", "1", "0", "0", "1", "0"].into_iter().enumerate() {
        set(&mut runtime, "light", light);
        set(&mut runtime, "start", light);
        scan(&mut runtime, call as i64 * 10);
        // From outside it is what it was given.
        assert_eq!(get(&runtime, "seen"), light);
    }
    let names = ["a.n", "a.m", "b[2].n", "b[1].n", "b[2].m", "own"];
    assert_eq!(names.map(|name| get(&runtime, name)), ["2", "2", "2", "0", "0", "2"]);
    // What it remembers goes over to a changed program: no edge is seen that was none.
    set(&mut runtime, "light", "1");
    scan(&mut runtime, 100);
    let mut again = start(&text.replace("own : INT;", "own : INT; more : INT;"));
    again.take_over(&runtime, false);
    scan(&mut again, 110);
    assert_eq!(get(&again, "a.n"), "3");
    for wrong in ["VAR x : BOOL R_EDGE; END_VAR", "VAR_INPUT x : INT F_EDGE; END_VAR"] {
        assert_eq!(
            errors(&format!(
                "FUNCTION_BLOCK f {wrong} END_FUNCTION_BLOCK PROGRAM p END_PROGRAM"
            ))[0]
                .split_once(": ")
                .unwrap()
                .1,
            "R_EDGE and F_EDGE belong to inputs of type BOOL of a FUNCTION_BLOCK or PROGRAM"
        );
    }
}

#[test]
fn addresses_may_be_given_later() {
    let text = "FUNCTION_BLOCK valve VAR open AT %Q* : BOOL; shut AT %I* : BOOL; END_VAR open := NOT shut; END_FUNCTION_BLOCK
        PROGRAM io VAR start AT %I* : BOOL; motor AT %Q* : BOOL; n AT %I* : INT; kept AT %M* : INT; v : valve; w : ARRAY[1..2] OF valve; END_VAR
            motor := start; v(); w[1]();
        END_PROGRAM
        CONFIGURATION c
            RESOURCE pc ON linux TASK t(INTERVAL := T#10ms, PRIORITY := 1); PROGRAM main WITH t : io; END_RESOURCE
            VAR_CONFIG pc.main.start AT %IX0.1 : BOOL; main.v.open AT 'io.5.out-01' : BOOL; io.n AT %IW4 : INT; END_VAR
        END_CONFIGURATION";
    let runtime = start(text);
    let logic = runtime.logic();
    let of = |name: &str| {
        let variable = logic.variable(name).unwrap();
        (variable.role, variable.address.as_deref())
    };
    assert_eq!(of("start"), (Role::Input, Some("%IX0.1")));
    assert_eq!(of("motor"), (Role::Output, None));
    assert_eq!(of("n"), (Role::Input, Some("%IW4")));
    assert_eq!(of("kept"), (Role::Internal, None));
    assert_eq!(of("v.open"), (Role::Output, Some("io.5.out-01")));
    assert_eq!(of("v.shut"), (Role::Input, None));
    assert_eq!(of("w[1].open"), (Role::Output, None));
    for (placed, wanted) in [
        (
            "io.motor AT %IX0.1 : BOOL;",
            "io.motor is no variable AT %I* of a program",
        ),
        (
            "io.motr AT %QX0.1 : BOOL;",
            "io.motr is no variable AT %Q* of a program",
        ),
        (
            "io.motor AT %QX0.1 : INT;",
            "io.motor is no variable AT %Q* of a program",
        ),
        ("io.n AT %IX0.2 : INT;", "%IX0.2 holds 1 bits, a INT does not"),
        (
            "io.v.shut AT %IX0.1 : BOOL;",
            "v.shut is at %IX0.1, as another variable is",
        ),
    ] {
        let told = errors(&text.replace("io.n AT %IW4 : INT;", placed));
        assert!(told.iter().any(|one| one.ends_with(wanted)), "{placed}: {told:?}");
    }
}

#[test]
fn functions_may_be_called_with_the_type_in_their_name() {
    let cases = [
        ("INT", "ADD_INT(2, 3)", "5"),
        ("INT", "LIMIT_INT(0, 120, 100)", "100"),
        ("REAL", "SQRT_REAL(2.25)", "1.5"),
        ("DINT", "MUL_DINT(INT#300, 300)", "90000"),
        (
            "BOOL",
            "GT_INT(3, 2, 1) AND EQ_WORD(16#F, 15) AND NE_TIME(T#1s, T#2s)",
            "1",
        ),
        (
            "WORD",
            "SHL_WORD(16#1, 4) OR AND_WORD(16#F, 16#3) OR NOT_WORD(16#FFF0)",
            "31",
        ),
        (
            "INT",
            "SEL_INT(TRUE, 1, 2) + MUX_INT(1, 10, 20) + ABS_INT(-3) + MOVE_INT(4) + MAX_INT(1, 5, 2)",
            "34",
        ),
        ("LREAL", "EXPT_LREAL(2.0, 3)", "8"),
        ("INT", "DIV_INT(7, 2) + MOD_INT(7, 4) - SUB_INT(5, 4)", "5"),
        ("TIME", "ADD_TIME(T#1s, T#500ms)", "1500"),
        ("TIME", "SUB_TIME(T#1s, T#400ms)", "600"),
        ("TIME", "MULTIME(T#250ms, 3)", "750"),
        (
            "TIME",
            "MUL_TIME(T#250ms, 0.5) + DIVTIME(T#1s, 4) + DIV_TIME(T#1s, 2.0)",
            "875",
        ),
        ("SINT", "SINT_TO_SINT(5)", "5"),
        ("INT", "REAL_TRUNC_INT(2.7) + LREAL_TRUNC_SINT(-1.9)", "1"),
        ("INT", "TRUNC_INT(-2.7)", "-2"),
        // What is worked out is of the type of the name.
        ("BOOL", "ADD_UINT(1, 2) = UINT#3", "1"),
    ];
    for (ty, expression, wanted) in cases {
        assert_eq!(value(ty, expression), wanted, "{expression}");
    }
    // Whoever has a function of this name uses that.
    let own = "FUNCTION MAX_INT : INT VAR_INPUT a, b : INT; END_VAR MAX_INT := 42; END_FUNCTION
        FUNCTION_BLOCK SEMA VAR_OUTPUT n : INT; END_VAR n := 7; END_FUNCTION_BLOCK
        PROGRAM p VAR x, y : INT; s : SEMA; END_VAR";
    assert_eq!(
        after(own, "x := MAX_INT(1, 2); s(); y := s.n;", &["x", "y"]),
        ["42", "7"]
    );
    assert_eq!(
        errors("PROGRAM p VAR r : REAL; n : INT; END_VAR n := ADD_INT(n, r); END_PROGRAM"),
        ["1:58: REAL does not become INT by itself: write REAL_TO_INT(..)"]
    );
}

#[test]
fn rows_of_more_than_two_are_compared_each_with_the_next() {
    let declarations = "PROGRAM p VAR a : INT := 9; b : INT := 5; c : INT := 2; r : REAL := 5.5; x, y : BOOL; END_VAR";
    let cases = [
        ("x := GT(a, b, c); y := GT(a, c, b);", "1", "0"),
        ("x := GE(a, 9, r, b, 2); y := LE(c, c, b, a, 8);", "1", "0"),
        ("x := LT(1, 2, 3); y := EQ(b, 5, 5, c);", "1", "0"),
        ("x := EQ(TRUE, a > b, b > c); y := LT(T#1s, T#2s, T#2s);", "1", "0"),
        (
            "x := LT('A', 'B', 'C') AND GT(a * a * a, a, 0); y := GT(b, a / 0, c);",
            "1",
            "0",
        ),
    ];
    for (statements, x, y) in cases {
        let statements = &statements.replace("a / 0", "c / c");
        assert_eq!(after(declarations, statements, &["x", "y"]), [x, y], "{statements}");
    }
}

#[test]
fn texts_and_bools_have_an_order() {
    let declarations = "PROGRAM p VAR a : STRING := 'M8'; b : STRING := 'M10'; t : STRING[1] := 'Z'; x : BOOL := TRUE; y, p1, p2 : BOOL; END_VAR";
    let cases = [
        ("p1 := a > b; p2 := b >= a;", "1", "0"),
        ("p1 := x > y; p2 := x < y;", "1", "0"),
        ("p1 := a <= 'M8'; p2 := t < a;", "1", "0"),
        ("p1 := 'a' > 'Z'; p2 := 'ab' < 'a';", "1", "0"),
        ("p1 := MAX(y, x); p2 := MIN(x, y);", "1", "0"),
    ];
    for (statements, first, second) in cases {
        assert_eq!(
            after(declarations, statements, &["p1", "p2"]),
            [first, second],
            "{statements}"
        );
    }
}

#[test]
fn decimal_digits_become_numbers_and_back() {
    let cases = [
        ("UINT", "WORD_BCD_TO_UINT(16#0472)", "472"),
        ("USINT", "BYTE_BCD_TO_USINT(16#99)", "99"),
        (
            "ULINT",
            "LWORD_BCD_TO_ULINT(16#9999_9999_9999_9999)",
            "9999999999999999",
        ),
        ("WORD", "UINT_TO_BCD_WORD(9876)", "39030"),
        ("DWORD", "UDINT_TO_BCD_DWORD(12)", "18"),
        ("LWORD", "ULINT_TO_BCD_LWORD(9999999999999999)", "11068046444225730969"),
    ];
    for (ty, expression, wanted) in cases {
        assert_eq!(value(ty, expression), wanted, "{expression}");
    }
    for statement in [
        "w := UINT_TO_BCD_WORD(n);",
        "n := WORD_BCD_TO_UINT(v);",
        "w := INT_TO_BCD_WORD(i);",
    ] {
        let mut runtime = start(&format!(
            "PROGRAM p VAR n : UINT := 10000; w, v : WORD := 16#12A4; i : INT := -1; END_VAR {statement} END_PROGRAM"
        ));
        scan(&mut runtime, 0);
        assert_eq!(
            runtime.fault().map(|fault| fault.wrong),
            Some(Wrong::Bcd),
            "{statement}"
        );
        assert!(
            [get(&runtime, "n"), get(&runtime, "w")].contains(&"0".to_owned()),
            "{statement}"
        );
    }
}

#[test]
fn inputs_of_blocks_may_be_given_by_place_and_outputs_be_inverted() {
    let text = "FUNCTION_BLOCK Sums VAR_INPUT a, b : INT := 3; END_VAR VAR_IN_OUT sum : INT; END_VAR VAR_OUTPUT mask : WORD; END_VAR sum := sum + a * b; mask := 16#F; END_FUNCTION_BLOCK
        PROGRAM p VAR t : TON; s : SR; x : Sums; n : INT; late, blocked : BOOL; w : WORD; k : INT := 5; END_VAR
            t(TRUE, T#20ms); late := t.Q; x(k, 2, n); s(S1 := TRUE, R := FALSE, NOT Q1 => blocked); x(a := 0, sum := n, NOT mask => w);
        END_PROGRAM";
    let mut runtime = start(text);
    for now in [0, 10] {
        scan(&mut runtime, now);
        assert_eq!(get(&runtime, "late"), "0");
    }
    scan(&mut runtime, 20);
    assert_eq!(
        ["late", "n", "blocked", "w"].map(|name| get(&runtime, name)),
        ["1", "30", "0", "65520"]
    );
    let wrong = |call: &str| {
        errors(&format!(
            "PROGRAM p VAR t : TON; n : INT; c : CTU; END_VAR {call} END_PROGRAM"
        ))
    };
    assert_eq!(wrong("t(TRUE, T#1s, 5);"), ["1:50: TON takes 2 inputs, not 3"]);
    assert_eq!(
        wrong("t(TRUE, PT := T#1s);"),
        ["1:50: arguments are given all by name or all by place"]
    );
    assert_eq!(
        wrong("c(CU := TRUE, NOT CV => n);"),
        ["1:68: NOT does not take INT: write INT_TO_WORD(..)"]
    );
}

#[test]
fn what_is_repeated_without_a_value_keeps_its_own() {
    let text = "TYPE s : STRUCT x : INT := 4; END_STRUCT; END_TYPE
        PROGRAM p VAR a : ARRAY[1..5] OF INT := [7, 3(), 9]; b : ARRAY[1..3] OF s := [2(), (x := 5)]; END_VAR";
    assert_eq!(
        after(text, "", &["a[1]", "a[2]", "a[4]", "a[5]", "b[2].x", "b[3].x"]),
        ["7", "0", "0", "9", "4", "5"]
    );
}

#[test]
fn a_program_may_have_in_outs() {
    let runtime = start("PROGRAM p VAR_IN_OUT a, b : INT := 3; END_VAR b := a + 1; END_PROGRAM");
    let role = |name: &str| runtime.logic().variable(name).unwrap().role;
    assert_eq!((role("a"), role("b")), (Role::Input, Role::Output));
    assert_eq!(
        after(
            "PROGRAM p VAR_IN_OUT a, b : INT := 3; END_VAR",
            "b := a + 1;",
            &["a", "b"]
        ),
        ["3", "4"]
    );
}

#[test]
fn a_semaphore_is_busy_until_it_is_released() {
    let mut runtime = start(
        "PROGRAM p VAR_INPUT c, r : BOOL; END_VAR VAR s : SEMA; END_VAR s(CLAIM := c, RELEASE := r); END_PROGRAM",
    );
    let mut busy = String::new();
    for (claim, release) in [
        ("0", "0"),
        ("1", "0"),
        ("1", "1"),
        ("0", "0"),
        ("0", "1"),
        ("0", "0"),
        ("1", "0"),
    ] {
        set(&mut runtime, "c", claim);
        set(&mut runtime, "r", release);
        scan(&mut runtime, 0);
        busy += &get(&runtime, "s.BUSY");
    }
    assert_eq!(busy, "0011000");
}

/// The seed of the fuzzer uses all of it.
#[test]
fn the_seed_of_the_fuzzer_compiles() {
    let seed = include_bytes!("../../../fuzz/corpus/structured_text/second_edition");
    let text = seed.split(|octet| *octet == 0).next().unwrap();
    let _ = start(std::str::from_utf8(text).unwrap());
}
