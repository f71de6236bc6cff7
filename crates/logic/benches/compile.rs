//! Time to compile 1 MB of text of many kinds, good and wrong: `cargo bench -p isocnc-logic --bench compile`.

use std::time::Instant;

const OCTETS: usize = (1 << 20) - 200;

/// A text of this beginning and end, with so many parts that it is as long as a program may be.
fn text(
    begin: &str,
    part: impl Fn(usize) -> String,
    middle: &str,
    other: impl Fn(usize) -> String,
    end: &str,
) -> String {
    let (mut first, mut second) = (String::from(begin), String::from(middle));
    for n in 0.. {
        let parts = (part(n), other(n));
        if first.len() + second.len() + parts.0.len() + parts.1.len() + end.len() > OCTETS {
            break;
        }
        first += &parts.0;
        second += &parts.1;
    }
    first + &second + end
}

fn measure(name: &str, text: &str) {
    let start = Instant::now();
    let told = match logic::compile(text) {
        Ok(logic) => format!("{} instructions", logic.instructions()),
        Err(told) => format!("{} messages, {}", told.len(), told[0].kind)
            .chars()
            .take(80)
            .collect(),
    };
    println!("{name:<28} {:>6.0} ms  {told}", start.elapsed().as_secs_f64() * 1e3);
}

#[rustfmt::skip]
fn main() {
    let none = |_: usize| String::new();
    let end = "END_PROGRAM";
    println!("{OCTETS} octets each");
    let many = |n: usize| format!("station_output_{n:05} : BOOL;\n");
    measure("unknown names", &text(
        "PROGRAM p VAR ", many, "END_VAR ", |n| format!("q_other_thing_{n:05} := TRUE;\n"), end));
    measure("names that are nearly right", &text(
        "PROGRAM p VAR ", many, "END_VAR ", |n| format!("station_output_{n:05}xyz := TRUE;\n"), end));
    let long = "x".repeat(60);
    let alike = |n: usize| format!("{n:05}{long} : BOOL;\n");
    measure("long names that are alike", &text(
        "PROGRAM p VAR ", |n| format!("a{}", alike(n)), "END_VAR ", |n| format!("b{n:05}{long}c := TRUE;\n"), end));
    measure("one line", &text("PROGRAM p VAR n : INT; END_VAR ", |_| "n := n + 1; ".into(), "", none, end));
    measure("one line of errors", &text("PROGRAM p VAR n : INT; END_VAR ", |_| "n := m + 1; ".into(), "", none, end));
    measure("an enumeration", &text(
        "TYPE e : (a", |n| format!(", v{n}"), "); END_TYPE PROGRAM p VAR x : e; END_VAR ",
        |n| format!("x := e#v{n}; "), end));
    measure("a CASE of all its values", &text(
        "TYPE e : (a", |n| format!(", v{n}"), "); END_TYPE PROGRAM p VAR x : e; END_VAR CASE x OF ",
        |n| format!("v{n}:; "), "ELSE ; END_CASE; END_PROGRAM"));
    measure("labels downwards", &text(
        "PROGRAM p VAR n : DINT; END_VAR CASE n OF ", |n| format!("{}:;\n", 1_000_000 - n), "", none,
        "END_CASE; END_PROGRAM"));
    measure("members", &text(
        "TYPE s : STRUCT ", |n| format!("m{n} : INT; "), "END_STRUCT END_TYPE PROGRAM p VAR x : s; END_VAR ",
        |n| format!("x.m{n} := 1; "), end));
    measure("members that there are not", &text(
        "TYPE s : STRUCT ", |n| format!("m{n} : INT; "), "END_STRUCT END_TYPE PROGRAM p VAR x : s; END_VAR ",
        |n| format!("x.n{n} := 1; "), end));
    measure("inputs of a block", &text(
        "FUNCTION_BLOCK b VAR_INPUT ", |n| format!("i{n} : INT; "),
        "END_VAR END_FUNCTION_BLOCK PROGRAM p VAR x : b; END_VAR x(i0 := 1", |n| format!(", i{} := 1", n + 1),
        "); END_PROGRAM"));
    measure("inputs of a function", &text(
        "FUNCTION f : INT VAR_INPUT ", |n| format!("i{n} : INT; "),
        "END_VAR f := 1; END_FUNCTION PROGRAM p VAR x : INT; END_VAR ", |_| "x := f(i0 := 1); ".into(), end));
    measure("arrays of many shapes", &text(
        "PROGRAM p VAR ", |n| format!("a{n} : ARRAY[{n}..{n}] OF INT; "), "END_VAR ", none, end));
    measure("structures", &text(
        "TYPE ", |n| format!("s{n} : STRUCT a : INT; END_STRUCT; "), "END_TYPE PROGRAM p VAR ",
        |n| format!("x{n} : s{n}; "), "END_VAR END_PROGRAM"));
    measure("an array given often", &text(
        "TYPE t : ARRAY[1..60000] OF INT := [60000(1)]; END_TYPE PROGRAM p VAR ", |n| format!("x{n} : t; "),
        "END_VAR ", none, end));
    let name = "x".repeat(100_000);
    measure("a long name of an array", &format!("PROGRAM p VAR {name} : ARRAY[1..60000] OF INT; END_VAR END_PROGRAM"));
    measure("a long unnamed enumeration", &text(
        "PROGRAM p VAR x : ARRAY[1..60000] OF (a", |n| format!(", v{n}"), "); END_VAR ", none, end));
    measure("texts cut", &text(
        "PROGRAM p VAR ", |n| format!("s{n} : STRING[{}]; ", n % 300 + 1), "x : STRING; END_VAR ",
        |n| format!("x := 'text number {n:06}'; s{n} := x; "), end));
    let letters = "ab".repeat(250_000);
    measure("a long text cut", &text(
        &format!("PROGRAM p VAR t : STRING := '{letters}'; "), |n| format!("s{n} : STRING[{}]; ", n + 1), "END_VAR ",
        |n| format!("s{n} := t; "), end));
    measure("characters that are nothing", &"?".repeat(OCTETS));
    measure("brackets", &"(".repeat(OCTETS));
    measure("one sum", &text(
        "PROGRAM p VAR n : INT; END_VAR n := ADD(n", |_| ", n".into(), "", none, "); END_PROGRAM"));
    measure("units", &text(
        "", |n| format!("FUNCTION f{n} : INT f{n} := 1; END_FUNCTION\n"), "PROGRAM p VAR x : INT; END_VAR ",
        |n| format!("x := f{n}(); "), end));
    measure("instances", &text(
        "PROGRAM p VAR ", |n| format!("t{n} : TON; "), "END_VAR ", |n| format!("t{n}(IN := TRUE, PT := T#1s); "),
        end));
    measure("IF without an end", &text("PROGRAM p VAR b : BOOL; END_VAR ", |_| "IF b THEN ".into(), "", none, end));
    measure("slips", &text(
        "PROGRAM p VAR b : BOOL; END_VAR ", |_| "IF b == THEN b := := 1; END_IF; ".into(), "", none, end));
}
