//! What the language does, rule by rule.

use crate::common;

use common::{after, get, scan, set, start, value};
use logic::{Fault, Role, Wrong};

#[test]
fn operators_bind_as_the_table_says() {
    let cases = [
        ("2 + 3 * 4", "14"),
        ("(2 + 3) * 4", "20"),
        ("2 - 3 - 4", "-5"),
        ("7 / 2 * 2", "6"),
        ("-7 / 2", "-3"),
        ("-7 MOD 2", "-1"),
        ("7 MOD -2", "1"),
        ("- -3", "3"),
        ("+3", "3"),
        ("16#FF - 2#1", "254"),
        ("INT#5 + DINT#16#7F", "132"),
    ];
    for (expression, wanted) in cases {
        assert_eq!(value("DINT", expression), wanted, "{expression}");
    }
    let of_bool = [
        ("NOT FALSE AND FALSE", "0"),
        ("NOT (FALSE AND FALSE)", "1"),
        ("TRUE OR TRUE AND FALSE", "1"),
        ("TRUE XOR TRUE AND FALSE", "1"),
        ("TRUE OR TRUE XOR TRUE", "1"),
        ("1 < 2 = TRUE", "1"),
        ("FALSE = 1 > 2", "1"),
        ("NOT TRUE = FALSE", "1"),
        ("2 + 2 = 4 & 1 <> 2", "1"),
        ("BOOL#1 AND_THEN NOT BOOL#0", "1"),
        ("FALSE OR_ELSE FALSE", "0"),
        ("T#1s > T#999ms", "1"),
        ("'a' = 'a' AND 'a' <> 'b'", "1"),
    ];
    for (expression, wanted) in of_bool {
        assert_eq!(value("BOOL", expression), wanted, "{expression}");
    }
    let of_real = [
        ("2 ** 3 ** 2", "64"),
        ("-2.0 ** 2.0", "4"),
        ("(-2.0) ** 2", "4"),
        ("2.0 * 3 ** 2", "18"),
        ("1 / 2", "0"),
        ("1 / 2.0", "0.5"),
    ];
    for (expression, wanted) in of_real {
        assert_eq!(value("LREAL", expression), wanted, "{expression}");
    }
}

#[test]
fn values_are_the_same_in_variables_as_among_constants() {
    let declarations = "PROGRAM p VAR a : INT := -7; b : INT := 2; q, r, s : INT; w : WORD := 16#8001; v : WORD; t : TIME := T#3s; u : TIME;
        x : REAL := 0.1; y : REAL; z : LREAL; c : BOOL := TRUE; d : BOOL; END_VAR";
    let statements = "q := a / b; r := a MOD b; s := -a * b; v := ROL(w, 1) XOR NOT w; u := t * 2 - T#1s / 2 + t * 1.5;
        y := x * x; z := x; d := c AND NOT (a > b);";
    let names = ["q", "r", "s", "v", "u", "y", "z", "d"];
    let wanted = [
        "-3",
        "-1",
        "14",
        "32765",
        "10000",
        "0.010000001",
        "0.10000000149011612",
        "1",
    ];
    assert_eq!(after(declarations, statements, &names), wanted);
}

#[test]
fn arithmetic_wraps_and_is_counted() {
    let mut runtime = start(
        "PROGRAM p VAR a : SINT := 127; b : UINT; c : SINT := -128; d : TIME; END_VAR a := a + 1; b := b - 1; c := c / -1; END_PROGRAM",
    );
    scan(&mut runtime, 0);
    assert_eq!(
        [get(&runtime, "a"), get(&runtime, "b"), get(&runtime, "c")],
        ["-128", "65535", "-128"]
    );
    assert_eq!((runtime.overflows(), runtime.faults(), runtime.fault()), (3, 0, None));
}

#[test]
fn what_goes_wrong_has_a_result_and_a_place() {
    let mut runtime = start(
        "PROGRAM p\nVAR n : INT; x : INT := 5; r : REAL := 5.0; f : REAL; a : ARRAY[1..3] OF INT := [1, 2, 3]; i : INT := 4; m : INT; k : INT; e : INT; END_VAR\n\
         x := 7 / n;\nr := r / f;\na[i] := 9;\nm := a[i] + a[3];\nk := MUX(i, 1, 2);\nFOR e := 1 TO 3 BY n DO x := 1; END_FOR;\nEND_PROGRAM",
    );
    scan(&mut runtime, 0);
    let values = ["x", "r", "a[1]", "a[2]", "a[3]", "m", "k"].map(|name| get(&runtime, name));
    assert_eq!(values, ["0", "0", "1", "2", "3", "3", "0"]);
    assert_eq!(
        runtime.fault(),
        Some(Fault {
            wrong: Wrong::DivisionByZero,
            line: 3,
            column: 6
        })
    );
    assert_eq!(runtime.faults(), 6);
    runtime.clear_fault();
    set(&mut runtime, "n", "1");
    scan(&mut runtime, 10);
    assert_eq!(
        runtime.fault().map(|fault| (fault.wrong, fault.line)),
        Some((Wrong::DivisionByZero, 4))
    );
    set(&mut runtime, "f", "1");
    runtime.clear_fault();
    scan(&mut runtime, 20);
    assert_eq!(
        runtime.fault().map(|fault| fault.to_string()),
        Some("5:3: an index is out of its array: 0 is read, nothing is written".into())
    );
}

#[test]
fn conversions() {
    let cases = [
        ("INT", "REAL_TO_INT(2.5)", "2"),
        ("INT", "REAL_TO_INT(3.5)", "4"),
        ("INT", "TRUNC(-2.7)", "-2"),
        ("INT", "DINT_TO_INT(70000)", "4464"),
        ("BOOL", "INT_TO_BOOL(2)", "1"),
        ("INT", "BOOL_TO_INT(TRUE)", "1"),
        ("DINT", "TIME_TO_DINT(T#1s500ms)", "1500"),
        ("TIME", "DINT_TO_TIME(250)", "250"),
        ("LREAL", "TIME_TO_LREAL(T#1ms500us)", "1.5"),
        ("UINT", "WORD_TO_UINT(16#FFFF)", "65535"),
        ("INT", "WORD_TO_INT(16#FFFF)", "-1"),
        ("WORD", "INT_TO_WORD(-1)", "65535"),
        ("LREAL", "INT_TO_LREAL(3) / 2.0", "1.5"),
    ];
    for (ty, expression, wanted) in cases {
        assert_eq!(value(ty, expression), wanted, "{expression}");
    }
    let mut runtime = start(
        "PROGRAM p VAR x : LREAL := 1E9; END_VAR VAR_OUTPUT n : INT; END_VAR n := LREAL_TO_INT(x); END_PROGRAM"
            .replace("1E9", "1.0E9")
            .as_str(),
    );
    scan(&mut runtime, 0);
    assert_eq!((get(&runtime, "n"), runtime.overflows()), ("32767".into(), 1));
}

#[test]
fn standard_functions() {
    let cases = [
        ("INT", "ABS(-5)", "5"),
        ("LREAL", "SQRT(2.25)", "1.5"),
        ("LREAL", "LN(1.0) + LOG(100.0) + EXP(0.0)", "3"),
        (
            "LREAL",
            "SIN(0.0) + COS(0.0) + TAN(0.0) + ASIN(0.0) + ACOS(1.0) + ATAN(0.0)",
            "1",
        ),
        ("LREAL", "EXPT(2.0, 10)", "1024"),
        (
            "INT",
            "ADD(1, 2, 3) + SUB(5, 3) * MUL(2, 2, 2) - DIV(9, 2) + MOD(9, 4)",
            "19",
        ),
        (
            "BOOL",
            "GT(2, 1) AND GE(2, 2) AND EQ(1, 1) AND LE(1, 1) AND LT(1, 2) AND NE(1, 2)",
            "1",
        ),
        (
            "BOOL",
            "OR(FALSE, FALSE, TRUE) AND AND(TRUE, TRUE, TRUE) AND NOT(FALSE) AND XOR(TRUE, FALSE)",
            "1",
        ),
        ("BYTE", "SHL(BYTE#16#81, 1) OR SHR(BYTE#16#81, 7)", "3"),
        ("BYTE", "ROR(BYTE#16#81, 1)", "192"),
        ("INT", "SEL(TRUE, 1, 2) + SEL(G := FALSE, IN0 := 10, IN1 := 20)", "12"),
        ("INT", "MAX(3, 9, 4) - MIN(3, 9, 4)", "6"),
        ("INT", "LIMIT(0, 15, 10) + LIMIT(MN := 0, IN := -5, MX := 10)", "10"),
        ("INT", "MUX(2, 10, 20, 30, 40)", "30"),
        ("TIME", "MAX(T#1s, T#2s)", "2000"),
        ("STRING", "SEL(TRUE, 'off', 'on')", "on"),
        ("INT", "MOVE(7)", "7"),
    ];
    for (ty, expression, wanted) in cases {
        assert_eq!(value(ty, expression), wanted, "{expression}");
    }
}

#[test]
fn integers_become_real_beside_real_literals() {
    let declarations =
        "PROGRAM p VAR i : INT := 3; d : DINT := 16777217; r, s, m : REAL; n, o : LREAL; b, c : BOOL; END_VAR";
    let statements = "r := i * 0.5; b := i > 2.5; c := 3.5 < i; s := LIMIT(0.0, i, 9.5); m := MAX(2, 0.5, i); n := d * 0.5; o := i * 0.1;";
    assert_eq!(
        after(declarations, statements, &["r", "b", "c", "s", "m", "n", "o"]),
        ["1.5", "1", "0", "3", "3", "8388608.5", "0.30000000000000004"]
    );
}

#[test]
fn literals_and_functions_take_the_real_type_that_is_wanted() {
    let cases = [
        ("EXPT(2.0, 3.0)", "8"),
        ("10.0 ** x", "100"),
        ("2 ** 3", "8"),
        ("MUL(SQRT(4.0), x)", "4"),
        ("SQRT(i) + SIN(i - 4)", "2"),
        ("SEL(2.0 ** x > x, 0.0, 1.0)", "1"),
    ];
    for (expression, wanted) in cases {
        let declarations = "PROGRAM p VAR x : REAL := 2.0; y : REAL; i : INT := 4; END_VAR";
        assert_eq!(
            after(declarations, &format!("y := {expression};"), &["y"]),
            [wanted],
            "{expression}"
        );
    }
    assert_eq!(value("LREAL", "SQRT(DINT#9) + 2 ** 3"), "11");
}

#[test]
fn time_is_divided_alike_by_literals_and_variables() {
    let declarations = "PROGRAM p VAR t : TIME := T#11ns; n : INT := 3; a, b : TIME; END_VAR";
    assert_eq!(
        after(declarations, "a := t / 3; b := t / n;", &["a", "b"]),
        ["0.000003"; 2]
    );
}

#[test]
fn a_structure_may_end_without_a_semicolon() {
    let text = "TYPE s : STRUCT x : INT := 7; END_STRUCT END_TYPE TYPE t : STRUCT y : s; END_STRUCT u : INT; END_TYPE
        PROGRAM p VAR a : t; b : u; END_VAR";
    assert_eq!(after(text, "b := a.y.x;", &["b"]), ["7"]);
}

#[test]
fn choices() {
    let text = "PROGRAM p VAR_INPUT n : INT; END_VAR VAR_OUTPUT a, b : INT; END_VAR
        IF n < 0 THEN a := 1; ELSIF n = 0 THEN a := 2; ELSIF n < 10 THEN a := 3; ELSE a := 4; END_IF;
        CASE n OF -5..-1: b := 1; 0, 7: b := 2; 8: b := 3; ELSE b := 9; END_CASE;
        END_PROGRAM";
    let mut runtime = start(text);
    for (n, a, b) in [
        (-6, 1, 9),
        (-5, 1, 1),
        (-1, 1, 1),
        (0, 2, 2),
        (7, 3, 2),
        (8, 3, 3),
        (9, 3, 9),
        (20, 4, 9),
    ] {
        set(&mut runtime, "n", &n.to_string());
        scan(&mut runtime, 0);
        assert_eq!(
            [get(&runtime, "a"), get(&runtime, "b")],
            [a.to_string(), b.to_string()],
            "{n}"
        );
    }
}

#[test]
fn loops() {
    let count = |statements: &str| {
        after(
            "PROGRAM p VAR i, j, n, k : INT; s : SINT; u : USINT; END_VAR",
            statements,
            &["n"],
        )
        .remove(0)
    };
    let cases = [
        ("FOR i := 1 TO 5 DO n := n + i; END_FOR;", "15"),
        ("FOR i := 5 TO 1 BY -2 DO n := n * 10 + i; END_FOR;", "531"),
        ("FOR i := 5 TO 1 DO n := 9; END_FOR;", "0"),
        ("k := 3; FOR i := 1 TO k DO k := 9; n := n + 1; END_FOR;", "3"),
        ("FOR s := 125 TO 127 DO n := n + 1; END_FOR;", "3"),
        ("FOR u := 253 TO 255 DO n := n + 1; END_FOR;", "3"),
        (
            "FOR i := 1 TO 9 DO IF i = 3 THEN CONTINUE; END_IF; IF i = 6 THEN EXIT; END_IF; n := n * 10 + i; END_FOR;",
            "1245",
        ),
        (
            "FOR i := 1 TO 3 DO FOR j := 1 TO 3 DO IF j = 2 THEN EXIT; END_IF; n := n + 1; END_FOR; END_FOR;",
            "3",
        ),
        ("WHILE n < 7 DO n := n + 2; END_WHILE;", "8"),
        ("WHILE TRUE DO n := n + 1; IF n = 4 THEN EXIT; END_IF; END_WHILE;", "4"),
        (
            "WHILE i < 5 DO i := i + 1; IF i = 2 THEN CONTINUE; END_IF; n := n * 10 + i; END_WHILE;",
            "1345",
        ),
        ("REPEAT n := n + 1; UNTIL n >= 3 END_REPEAT;", "3"),
        ("REPEAT n := n + 1; UNTIL TRUE; END_REPEAT;", "1"),
        (
            "REPEAT i := i + 1; IF i = 2 THEN CONTINUE; END_IF; n := n * 10 + i; UNTIL i > 3 END_REPEAT;",
            "134",
        ),
        ("n := 1; RETURN; n := 2;", "1"),
        ("n := 1;; ;", "1"),
    ];
    for (statements, wanted) in cases {
        assert_eq!(count(statements), wanted, "{statements}");
    }
    // Behind the loop: the first value that is beyond its end, unless EXIT has left it.
    let behind = |statements: &str| {
        let declarations = "PROGRAM p VAR i, k : INT; s : SINT; u : USINT; n : DINT; END_VAR";
        after(declarations, statements, &["n"]).remove(0)
    };
    let cases = [
        ("FOR i := 1 TO 8 DO IF i = 9 THEN EXIT; END_IF; END_FOR; n := i;", "9"),
        ("FOR i := 1 TO 8 DO IF i = 3 THEN EXIT; END_IF; END_FOR; n := i;", "3"),
        ("FOR i := 1 TO 8 DO IF i = 8 THEN EXIT; END_IF; END_FOR; n := i;", "8"),
        ("k := 8; FOR i := 1 TO k DO CONTINUE; END_FOR; n := i;", "9"),
        ("FOR i := 1 TO 10 BY 3 DO ; END_FOR; n := i;", "13"),
        ("FOR i := 5 TO 1 BY -2 DO ; END_FOR; n := i;", "-1"),
        ("k := -2; FOR i := 5 TO 1 BY k DO ; END_FOR; n := i;", "-1"),
        ("FOR i := 5 TO 1 DO ; END_FOR; n := i;", "5"),
        // At the end of its type it stays where it is.
        ("FOR s := 125 TO 127 DO ; END_FOR; n := s;", "127"),
        ("FOR u := 3 TO 255 BY 100 DO ; END_FOR; n := u;", "203"),
        (
            "k := -1; FOR i := -32767 TO -32768 BY k DO ; END_FOR; n := i;",
            "-32768",
        ),
    ];
    for (statements, wanted) in cases {
        assert_eq!(behind(statements), wanted, "{statements}");
    }
    let mut up_to_the_end = start("PROGRAM p VAR s : SINT; END_VAR FOR s := 126 TO 127 DO ; END_FOR; END_PROGRAM");
    scan(&mut up_to_the_end, 0);
    assert_eq!(up_to_the_end.overflows(), 0);
}

#[test]
fn a_loop_that_is_not_bound_by_itself_ends_at_its_bound() {
    let ends = |loop_text: &str, wanted: &str, fault: Option<u32>| {
        let mut runtime = start(&format!(
            "PROGRAM p VAR n, m : DINT; go : BOOL := TRUE; END_VAR\n{loop_text}\nEND_PROGRAM"
        ));
        set(&mut runtime, "m", "100000");
        scan(&mut runtime, 0);
        assert_eq!(get(&runtime, "n"), wanted, "{loop_text}");
        let told = runtime.fault().map(|fault| {
            assert_eq!(fault.wrong, Wrong::Iterations, "{loop_text}");
            fault.line
        });
        assert_eq!(told, fault, "{loop_text}");
    };
    ends("WHILE go DO n := n + 1; END_WHILE;", "1000", Some(2));
    ends("{max_iterations := 7} WHILE go DO n := n + 1; END_WHILE;", "7", Some(2));
    ends("{max_iterations := 7} WHILE n < 7 DO n := n + 1; END_WHILE;", "7", None);
    ends(
        "{max_iterations := 7} REPEAT n := n + 1; UNTIL NOT go END_REPEAT;",
        "7",
        Some(2),
    );
    ends(
        "{max_iterations := 7} REPEAT n := n + 1; UNTIL n = 7 END_REPEAT;",
        "7",
        None,
    );
    ends("FOR m := 1 TO m DO n := n + 1; END_FOR;", "1", None);
    ends("FOR n := 1 TO m DO ; END_FOR;", "1001", Some(2));
    ends(
        "{max_iterations := 2000} FOR n := 1 TO m - 98500 DO ; END_FOR;",
        "1501",
        None,
    );
    // What leaves the loop before its bound has not exceeded it.
    ends(
        "FOR n := 1 TO m DO IF n = 1000 THEN EXIT; END_IF; END_FOR;",
        "1000",
        None,
    );
    ends(
        "FOR n := 1 TO m DO IF n = 1001 THEN EXIT; END_IF; END_FOR;",
        "1001",
        Some(2),
    );
    ends("FOR n := 1 TO 5000 DO ; END_FOR;", "5001", None);
}

/// An enumeration may stand at its variables, which share it; others of the same names are others.
#[test]
fn enumerations_need_no_name() {
    let mut runtime = start(
        "FUNCTION_BLOCK lamp VAR phase : (idle, blinks); END_VAR IF phase = idle THEN phase := blinks; END_IF; END_FUNCTION_BLOCK\n\
         PROGRAM p VAR a, b : (idle, run := 5, stop) := run; c : ARRAY [1..2] OF (idle, full); l : lamp; same : BOOL; END_VAR\n\
         same := a = b; b := stop; c[2] := full; l(); CASE a OF run: a := idle; END_CASE; END_PROGRAM",
    );
    scan(&mut runtime, 0);
    for (name, value) in [
        ("same", "1"),
        ("a", "idle"),
        ("b", "stop"),
        ("c[1]", "idle"),
        ("c[2]", "full"),
        ("l.phase", "blinks"),
    ] {
        assert_eq!(get(&runtime, name), value, "{name}");
    }
    set(&mut runtime, "a", "run");
    assert_eq!(get(&runtime, "a"), "run");
}

/// What is forced or stands in a table may be written as in a program.
#[test]
fn values_are_read_as_in_a_program() {
    let runtime = start("PROGRAM p VAR b : BOOL; t : TIME; END_VAR END_PROGRAM");
    let logic = runtime.logic();
    let read = |name: &str, text: &str| {
        let variable = logic.variable(name).unwrap();
        logic
            .read(variable, text)
            .and_then(|value| logic.slot_value(variable, value))
    };
    for (text, slot) in [
        ("TRUE", Some(1)),
        ("true", Some(1)),
        ("False", Some(0)),
        ("1", Some(1)),
        ("yes", None),
    ] {
        assert_eq!(read("b", text), slot, "{text}");
    }
    for (text, milliseconds) in [
        ("T#1s500ms", Some(1500)),
        ("time#-5S", Some(-5000)),
        ("20", Some(20)),
        ("S#1", None),
        ("T#", None),
    ] {
        assert_eq!(read("t", text), milliseconds.map(|ms: i64| ms * 1_000_000), "{text}");
    }
}

/// Of loops inside each other all are told, each at its own place; constant limits and a pragma bound a loop.
#[test]
fn loops_without_a_bound_are_known_by_their_places() {
    let runtime = start(
        "PROGRAM p\nVAR n, i, j, m : DINT; END_VAR\nWHILE n < m DO\n  REPEAT\n    FOR i := 1 TO m DO\n      n := n + 1;\n    END_FOR;\n\
         \x20 UNTIL n > m END_REPEAT;\nEND_WHILE;\nFOR j := 1 TO 5 DO n := 1; END_FOR;\n\
         {max_iterations := 7}\nWHILE n < m DO n := n + 1; END_WHILE;\nEND_PROGRAM",
    );
    let logic = runtime.logic();
    let places: Vec<_> = logic.unbound().iter().map(|found| (found.line, found.column)).collect();
    assert_eq!(places, [(3, 1), (4, 3), (5, 5)]);
    let [first, second, third] = [0, 1, 2].map(|at| logic.unbound()[at].steps);
    // Each counts the one inside it a thousand times.
    assert!(first > 1000 * second && second > 1000 * third && logic.steps_max() > first);
}

#[test]
fn the_longest_scan_is_counted_and_is_reached() {
    let reach = |body: &str, go: &str| {
        let mut runtime = start(&format!(
            "PROGRAM p VAR_INPUT go : BOOL; END_VAR VAR n, i, j : DINT; END_VAR {body} END_PROGRAM"
        ));
        set(&mut runtime, "go", go);
        let steps = runtime.scan(0);
        (steps, runtime.logic().steps_max())
    };
    for body in [
        "n := n + 1;",
        "FOR i := 1 TO 100 DO n := n + i; END_FOR;",
        "FOR i := 1 TO 10 DO FOR j := 1 TO 10 DO n := n + 1; END_FOR; END_FOR;",
    ] {
        let (steps, most) = reach(body, "1");
        assert!(steps <= most && most <= steps + 200, "{body}: {steps} of {most}");
    }
    let longer = "IF go THEN n := 1; n := 2; n := 3; ELSE n := 1; END_IF;";
    let (long, most) = reach(longer, "1");
    let (short, _) = reach(longer, "0");
    assert!(
        short < long && long <= most && most <= long + 1,
        "{short} {long} {most}"
    );
    let case = "CASE n OF 0: i := 1; i := 2; i := 3; 1: i := 1; ELSE i := 1; END_CASE;";
    let (steps, most) = reach(case, "1");
    assert_eq!(steps, most);
}

#[test]
fn functions_and_blocks() {
    let text = "
        FUNCTION mean : REAL
            VAR_INPUT a, b : REAL; weight : REAL := 0.5; END_VAR
            VAR sum : REAL; END_VAR
            sum := sum + a * weight + b * (1.0 - weight);
            mean := sum;
        END_FUNCTION
        FUNCTION total : INT
            VAR_INPUT list : ARRAY[1..3] OF INT; END_VAR
            VAR i : INT; END_VAR
            FOR i := 1 TO 3 DO total := total + list[i]; END_FOR;
        END_FUNCTION
        FUNCTION_BLOCK Counter
            VAR_INPUT step : INT := 1; END_VAR
            VAR_OUTPUT n : INT; END_VAR
            VAR_IN_OUT shared : INT; END_VAR
            VAR_TEMP fresh : INT := 5; END_VAR
            VAR t : R_TRIG; END_VAR
            fresh := fresh + 1;
            n := n + step;
            shared := shared + fresh;
        END_FUNCTION_BLOCK
        PROGRAM p
            VAR c, d : Counter; all : INT; m, k, w : REAL; list : ARRAY[1..3] OF INT := [1, 2, 3]; sum, read : INT;
                many : ARRAY[0..2] OF Counter; i : INT; out : DINT; END_VAR
            m := mean(mean(0.0, 2.0, 0.5), mean(a := 4.0, b := 8.0), 0.5);
            w := mean(b := 10.0, a := 0.0);
            sum := total(list) + total(list := list);
            c(shared := all);
            d(step := 3, shared := all, n => out);
            read := d.n;
            i := 2;
            many[i](step := 7, shared := all);
            many[0](shared := list[i]);
        END_PROGRAM";
    let mut runtime = start(text);
    scan(&mut runtime, 0);
    scan(&mut runtime, 10);
    let names = [
        "m",
        "w",
        "sum",
        "c.n",
        "d.n",
        "out",
        "read",
        "all",
        "many[2].n",
        "many[0].n",
        "list[2]",
    ];
    let wanted = ["3.5", "5", "24", "2", "6", "6", "6", "36", "14", "2", "14"];
    assert_eq!(names.map(|name| get(&runtime, name)), wanted);
}

#[test]
fn inputs_that_are_left_out_keep_their_last_value() {
    let mut runtime = start(
        "PROGRAM p VAR_INPUT go : BOOL; END_VAR VAR t : TON := (PT := T#20ms); q : BOOL; END_VAR
         IF go THEN t(IN := TRUE); ELSE t(); END_IF; q := t.Q; t.PT := T#20ms; END_PROGRAM",
    );
    set(&mut runtime, "go", "1");
    scan(&mut runtime, 0);
    set(&mut runtime, "go", "0");
    scan(&mut runtime, 10);
    assert_eq!(get(&runtime, "q"), "0");
    scan(&mut runtime, 20);
    assert_eq!(
        [get(&runtime, "q"), get(&runtime, "t.IN"), get(&runtime, "t.ET")],
        ["1", "1", "20"]
    );
}

#[test]
fn structures_arrays_and_enumerations() {
    let text = "
        TYPE
            Colour : (red, green := 5, blue) := green;
            Point : STRUCT x, y : REAL := 1.5; END_STRUCT;
            Tool : STRUCT number : INT; spot : Point := (y := 2.5); names : ARRAY[1..2] OF INT := [2(7)]; END_STRUCT;
            Length : LREAL := 100.0;
            Grid : ARRAY[-1..1, 0..2] OF INT;
        END_TYPE
        VAR_GLOBAL CONSTANT size : INT := 4; END_VAR
        PROGRAM p
            VAR c, e, f : Colour; t, u : Tool; many : ARRAY[1..size] OF Tool := [(number := 3), 2((number := 4))]; l : Length;
                g : Grid := [1, 2, 3, 3(4), 7]; i : INT := 1; n : INT; s : STRING := 'idle'; in_blue : BOOL; END_VAR
            t.spot.x := 9.0; t.names[i + 1] := 8; u := t; many[i + 1] := t; many[4].spot.y := 3.0;
            e := blue; f := Colour#red; in_blue := e = blue;
            FOR i := -1 TO 1 DO n := n + g[i, 2]; END_FOR;
            g[1, i - 2] := 42;
            CASE e OF red: s := 'red'; Colour#blue: s := 'blue'; ELSE ; END_CASE;
            i := 1;
        END_PROGRAM";
    let mut runtime = start(text);
    let at_start = [
        "c",
        "t.spot.x",
        "t.spot.y",
        "t.names[2]",
        "many[1].number",
        "many[3].number",
        "many[4].number",
        "many[4].names[1]",
        "l",
        "g[0,2]",
        "g[1,0]",
        "g[1,2]",
        "s",
    ];
    let wanted = [
        "green", "1.5", "2.5", "7", "3", "4", "0", "7", "100", "4", "7", "0", "idle",
    ];
    assert_eq!(at_start.map(|name| get(&runtime, name)), wanted);
    scan(&mut runtime, 0);
    let names = [
        "u.spot.x",
        "u.names[2]",
        "many[2].spot.x",
        "many[2].names[2]",
        "many[4].spot.y",
        "e",
        "f",
        "in_blue",
        "n",
        "g[1,0]",
        "s",
    ];
    let wanted = ["9", "8", "9", "8", "3", "blue", "red", "1", "7", "42", "blue"];
    assert_eq!(names.map(|name| get(&runtime, name)), wanted);
}

#[test]
fn programs_share_global_variables_and_run_in_the_order_of_the_file() {
    let text = "
        CONFIGURATION machine
            VAR_GLOBAL shared : INT; END_VAR
            RESOURCE pc ON linux
                TASK fast(INTERVAL := T#10ms, PRIORITY := 1);
                PROGRAM one WITH fast : first;
            END_RESOURCE
        END_CONFIGURATION
        PROGRAM first VAR_OUTPUT seen : INT; END_VAR VAR_EXTERNAL shared : INT; END_VAR shared := shared + 1; seen := shared; END_PROGRAM
        VAR_GLOBAL last AT %QX0.0 : BOOL; END_VAR
        PROGRAM second VAR_OUTPUT seen : INT; END_VAR shared := shared * 10; seen := shared; END_PROGRAM";
    let mut runtime = start(text);
    scan(&mut runtime, 0);
    scan(&mut runtime, 10);
    assert_eq!(
        ["shared", "first.seen", "second.seen"].map(|name| get(&runtime, name)),
        ["110", "11", "110"]
    );
    let logic = runtime.logic();
    let told: Vec<String> = logic.warnings().iter().map(ToString::to_string).collect();
    assert_eq!(
        told,
        [
            "5:22: note: task fast: INTERVAL T#10ms; the period is set where the file is run",
            "6:17: note: this has no effect: all programs run in the order of the file, once a scan",
        ]
    );
    let outputs: Vec<String> = logic.outputs().map(|variable| logic.name(variable)).collect();
    assert_eq!(outputs, ["first.seen", "last", "second.seen"]);
    assert!(logic.variable("seen").is_none());
}

#[test]
fn addresses_and_sections_say_what_is_an_input_and_what_an_output() {
    let text = "PROGRAM p
        VAR_INPUT a : BOOL; END_VAR VAR_OUTPUT b : BOOL; END_VAR
        VAR c AT %IX0.0 : BOOL; d AT %QW2 : INT; e AT %MD4 : REAL; f AT 'io.5.in-03' : BOOL; g AT 'io.5.out-01' : BOOL; h : BOOL; END_VAR
        VAR RETAIN k : INT; END_VAR
        b := a AND c AND f; d := 5; g := h; END_PROGRAM";
    let runtime = start(text);
    let logic = runtime.logic();
    let role = |name: &str| logic.variable(name).unwrap().role;
    for (name, wanted) in [
        ("a", Role::Input),
        ("b", Role::Output),
        ("c", Role::Input),
        ("d", Role::Output),
        ("e", Role::Internal),
        ("f", Role::Input),
        ("g", Role::Output),
        ("h", Role::Internal),
    ] {
        assert_eq!(role(name), wanted, "{name}");
    }
    let g = logic.variable("G").unwrap();
    assert_eq!(
        (g.address.as_deref(), g.ty.as_str(), g.line, g.retain),
        (Some("io.5.out-01"), "BOOL", 3, false)
    );
    assert!(logic.variable("k").unwrap().retain);
}

#[test]
fn a_program_that_replaces_another_takes_over_what_has_the_same_name_and_type() {
    let mut old = start(
        "PROGRAM p VAR RETAIN parts : DINT; END_VAR VAR n : INT; other : INT; edge : R_TRIG; t : TON; END_VAR
         parts := parts + 5; n := n + 1; edge(CLK := TRUE); t(IN := TRUE, PT := T#30ms); END_PROGRAM",
    );
    scan(&mut old, 0);
    scan(&mut old, 10);
    let text = "PROGRAM p VAR n : INT; other : DINT := 7; new : INT := 3; edge : R_TRIG; t : TON; pulse : BOOL; END_VAR
         VAR RETAIN parts : DINT; END_VAR edge(CLK := TRUE); pulse := edge.Q; t(IN := TRUE, PT := T#30ms); END_PROGRAM";
    let mut new = start(text);
    assert!(new.take_over(&old, false) > 3);
    scan(&mut new, 30);
    let names = ["parts", "n", "other", "new", "pulse", "t.Q"];
    assert_eq!(names.map(|name| get(&new, name)), ["10", "2", "7", "3", "0", "1"]);
    let mut after_a_restart = start(text);
    assert_eq!(after_a_restart.take_over(&old, true), 1);
    assert_eq!(["parts", "n"].map(|name| get(&after_a_restart, name)), ["10", "0"]);
}

#[test]
fn a_changed_program_has_its_own_constants_and_a_retained_timer_goes_on() {
    let mut old = start(
        "TYPE e : (one, two); f : (a, b); END_TYPE
         PROGRAM p VAR CONSTANT most : INT := 3; END_VAR VAR RETAIN t : TON; k : e := two; l : f := b; END_VAR VAR n : INT; END_VAR
         t(IN := TRUE, PT := T#1s); n := most; END_PROGRAM",
    );
    scan(&mut old, 5_000);
    scan(&mut old, 5_600);
    let changed = "TYPE e : (one, two); f : (b, a); END_TYPE
         PROGRAM p VAR CONSTANT most : INT := 4; END_VAR VAR RETAIN t : TON; k : e; l : f; END_VAR VAR n : INT; END_VAR
         t(IN := TRUE, PT := T#1s); n := most; END_PROGRAM";
    for only_retained in [false, true] {
        let mut new = start(changed);
        new.take_over(&old, only_retained);
        assert_eq!(new.time_ns(), 0);
        assert_eq!(old.time_ns(), 5_600_000_000);
        // Values of an enumeration that was changed are none of it.
        assert_eq!(["k", "l"].map(|name| get(&new, name)), ["two", "b"]);
        assert_eq!(
            new.get(new.logic().variable("l").unwrap()),
            new.logic().initial(new.logic().variable("l").unwrap())
        );
        scan(&mut new, 5_990);
        assert_eq!(["n", "t.Q", "t.ET"].map(|name| get(&new, name)), ["4", "0", "990"]);
        scan(&mut new, 6_000);
        assert_eq!(get(&new, "t.Q"), "1");
    }
}

#[test]
fn a_program_that_begins_anew_keeps_what_is_retained_alone() {
    let mut runtime = start(
        "PROGRAM p VAR_INPUT go : BOOL; END_VAR VAR n : INT := 2; edge : R_TRIG; hit : BOOL; END_VAR VAR RETAIN parts : INT := 7; END_VAR
         edge(CLK := go); hit := edge.Q; n := n + 1; parts := parts + 1; n := n / BOOL_TO_INT(go); END_PROGRAM",
    );
    scan(&mut runtime, 0);
    assert!(runtime.fault().is_some());
    runtime.restart();
    assert_eq!(runtime.fault(), None);
    assert_eq!(["n", "parts", "hit"].map(|name| get(&runtime, name)), ["2", "8", "0"]);
}

#[test]
fn a_variable_is_found_by_its_own_name_where_only_one_has_it_else_by_that_of_its_program() {
    let text = "VAR_GLOBAL g : INT; END_VAR
        PROGRAM a VAR n, m : INT; END_VAR n := 1; m := 2; END_PROGRAM
        PROGRAM b VAR n : INT; END_VAR n := g; END_PROGRAM";
    let logic = logic::compile(text).expect("a program");
    let found = |name: &str| {
        let variable = logic.variable(name)?;
        Some(format!("{}.{}", variable.program, variable.name))
    };
    let names = ["n", "A.N", "b.n", "M", "a.m", "g", "c.n", ""].map(found);
    let wanted = [
        None,
        Some("a.n"),
        Some("b.n"),
        Some("a.m"),
        Some("a.m"),
        Some(".g"),
        None,
        None,
    ];
    assert_eq!(names, wanted.map(|name| name.map(str::to_owned)));
    let shortest: Vec<String> = logic.all_variables().map(|variable| logic.name(variable)).collect();
    assert_eq!(shortest, ["g", "a.n", "m", "b.n"]);
}

/// What becomes wider by itself is worked out wide: nothing is lost before.
#[test]
fn what_becomes_wider_is_worked_out_wide() {
    let declarations = "
        FUNCTION whole : DINT VAR_INPUT x : DINT; END_VAR whole := x; END_FUNCTION
        FUNCTION_BLOCK keep VAR_INPUT x : DINT; END_VAR VAR_OUTPUT y : DINT; END_VAR y := x; END_FUNCTION_BLOCK
        PROGRAM p VAR CONSTANT k : INT := 300; END_VAR
        VAR mm : INT := 250; pieces : USINT; s : SINT := 100; d : DINT := 2_000_000_000; r : REAL := 16777216.0; u : UDINT := 1;
            low : INT := -32768; n : DINT; l : LINT; f : REAL; g : LREAL; b : BOOL; t : TIME; c : keep; a : ARRAY[-1..300] OF INT;
            begun : DINT := 300 * k * 10; END_VAR";
    let cases = [
        ("n := mm * 1000;", "n", "250000"),
        ("n := pieces - 1;", "n", "-1"),
        ("n := mm * mm / 2 * (mm + 1);", "n", "7843750"),
        ("n := s * 1000;", "n", "100000"),
        ("n := -low;", "n", "32768"),
        ("n := ABS(low);", "n", "32768"),
        ("n := low / -1;", "n", "32768"),
        ("n := SEL(TRUE, 0, mm * mm);", "n", "62500"),
        ("n := MUX(1, 0, mm * mm);", "n", "62500"),
        ("n := MAX(mm * mm, 5);", "n", "62500"),
        ("n := LIMIT(0, mm * mm, 100000);", "n", "62500"),
        ("n := ADD(mm, MUL(mm, 1000));", "n", "250250"),
        ("n := d / 1000 + mm * 1000;", "n", "2250000"),
        ("n := whole(mm * 1000);", "n", "250000"),
        ("c(x := mm * 1000); n := c.y;", "n", "250000"),
        ("l := d * 2;", "l", "4000000000"),
        ("l := u - 2;", "l", "-1"),
        ("n := begun;", "n", "900000"),
        // Below a real number the division is that of integers.
        ("f := mm * 1000;", "f", "250000"),
        ("f := mm / 100;", "f", "2"),
        ("f := pieces - 1;", "f", "-1"),
        ("f := r * 0.0 + mm * 400;", "f", "100000"),
        ("f := s * 100;", "f", "10000"),
        ("g := d * 3;", "g", "6000000000"),
        ("g := (r + 1.0) - r;", "g", "1"),
        ("g := r * 0.1;", "g", "1677721.6"),
        (
            "g := 2.0 ** (s + 100);",
            "g",
            "1606938044258990300000000000000000000000000000000000000000000",
        ),
        ("t := T#1ms * (mm * mm);", "t", "62500"),
        ("a[s * 3] := 7; n := a[300];", "n", "7"),
        ("a[pieces - 1] := 7; n := a[-1];", "n", "7"),
        // In comparisons, too.
        ("b := mm * 1000 > d / 10000;", "b", "1"),
        ("b := mm * 1000 > 200000;", "b", "1"),
        ("b := mm * mm > mm;", "b", "1"),
        ("b := pieces - 1 < 0;", "b", "1"),
        ("b := GT(mm * mm, 60000);", "b", "1"),
        // Differences of counters of 32 bits stay what they are, across the end of their range as well.
        ("b := u - UDINT#4294967295 = 2;", "b", "1"),
        // What keeps its width wraps, and a conversion that is written takes what goes into it.
        ("mm := mm * mm; n := mm;", "n", "-3036"),
        ("n := INT_TO_DINT(mm * mm);", "n", "-3036"),
        ("l := SEL(TRUE, 0, INT_TO_DINT(mm * mm));", "l", "-3036"),
    ];
    for (statements, name, wanted) in cases {
        assert_eq!(after(declarations, statements, &[name]), [wanted], "{statements}");
    }
}

/// No variable ever holds what is no number: there is an error with its place, and a number.
#[test]
fn what_is_no_number_is_an_error_and_a_number() {
    let mut runtime = start(
        "PROGRAM p\nVAR x : REAL := -0.25; y, kept, low, wide : REAL; d : LREAL := 1.0E300; n : INT; END_VAR\n\
         y := 12.0 * SQRT(x);\nkept := LIMIT(1.0, SQRT(x), 40.0);\nlow := LIMIT(0.0, LN(x + 0.25), 40.0);\nwide := LREAL_TO_REAL(d);\n\
         d := d * d;\nn := LREAL_TO_INT(d);\nEND_PROGRAM",
    );
    scan(&mut runtime, 0);
    let values = ["y", "kept", "low", "wide", "n"].map(|name| get(&runtime, name));
    let most = f32::MAX.to_string();
    assert_eq!(values, ["0", "1", "0", &most, "32767"]);
    assert_eq!(get(&runtime, "d"), f64::MAX.to_string());
    assert_eq!(runtime.faults(), 5);
    assert_eq!(
        runtime.fault().map(|fault| fault.to_string()),
        Some("3:13: SQRT, LN, LOG, ASIN, ACOS or ** has no result for this: it is 0".into())
    );
    let logic = runtime.logic().clone();
    for (name, values) in [
        ("x", [f64::NAN, f64::INFINITY, 1e300]),
        ("d", [f64::NAN, f64::INFINITY, f64::NEG_INFINITY]),
    ] {
        for value in values {
            let variable = logic.variable(name).unwrap();
            assert!(!runtime.set(variable, logic::Value::Lreal(value)), "{name} {value}");
        }
    }
}

/// A STRING[n] holds n characters, whatever it is given, wherever it stands.
#[test]
fn a_text_is_cut_to_the_length_of_its_variable() {
    let declarations = "
        TYPE Label : STRUCT code : STRING[3]; END_STRUCT; Short : STRING(2) := 'xyz'; END_TYPE
        FUNCTION first : STRING[1] VAR_INPUT x : STRING; END_VAR first := x; END_FUNCTION
        FUNCTION_BLOCK keep VAR_INPUT x : STRING[2]; END_VAR VAR_OUTPUT y : STRING; END_VAR y := x; END_FUNCTION_BLOCK
        PROGRAM p VAR CONSTANT n : INT := 4; END_VAR
        VAR code : STRING[n]; three : STRING[3]; all : STRING := 'ABCDEF'; other : STRING[20]; l : Label; s : Short; k : keep;
            a : ARRAY[1..2] OF STRING[2] := ['ABC', 'ÄÖÜ']; i : INT := 2; b, c : BOOL; r : STRING; END_VAR";
    let cases = [
        (
            "code := 'ABCDEF'; b := code = 'ABCD'; c := code <> 'ABCDEF';",
            ["b", "c", "code"],
            ["1", "1", "ABCD"],
        ),
        (
            "code := all; three := code; r := three;",
            ["code", "three", "r"],
            ["ABCD", "ABC", "ABC"],
        ),
        (
            "all := 'AB'; code := all; other := code;",
            ["code", "other", "all"],
            ["AB", "AB", "AB"],
        ),
        (
            "code := SEL(TRUE, 'A', all); l.code := code; r := first(all);",
            ["code", "l.code", "r"],
            ["ABCD", "ABC", "A"],
        ),
        (
            "k(x := all); r := k.y; s := all;",
            ["r", "s", "k.x"],
            ["AB", "AB", "AB"],
        ),
        (
            "r := a[2]; a[i] := all; b := a[i] = 'AB';",
            ["r", "a[2]", "b"],
            ["ÄÖ", "AB", "1"],
        ),
        ("r := a[1]; all := s;", ["r", "all", "s"], ["AB", "xy", "xy"]),
        (
            "b := code = ''; three := 'ABC'; c := three = all;",
            ["b", "c", "three"],
            ["1", "0", "ABC"],
        ),
    ];
    for (statements, names, wanted) in cases {
        assert_eq!(after(declarations, statements, &names), wanted, "{statements}");
    }
    let runtime = start("PROGRAM p VAR s : STRING[2]; t : STRING := 'long'; u : STRING := 'ok'; END_VAR END_PROGRAM");
    let logic = runtime.logic();
    let s = logic.variable("s").unwrap();
    assert!(logic.slot_value(s, logic::Value::Text("ok")).is_some());
    assert_eq!(logic.slot_value(s, logic::Value::Text("long")), None);
    assert_eq!(s.ty, "STRING[2]");
}
