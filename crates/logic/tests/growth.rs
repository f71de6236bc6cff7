//! What a program costs to be compiled grows with its length and no faster: counted in calls of the allocator, for twice the text.

use crate::counting;

use counting::calls;

/// Twice as many parts take about twice as many calls.
#[track_caller]
fn grows_in_proportion(text: impl Fn(usize) -> String) {
    let of = |parts: usize| {
        let text = text(parts);
        calls(|| drop(logic::compile(&text))) as f64
    };
    let (short, long) = (of(2000), of(4000));
    assert!(
        long < 2.2 * short,
        "{short} calls of the allocator, {long} for twice the text"
    );
}

fn lines(parts: usize, line: impl Fn(usize) -> String) -> String {
    (0..parts).map(|part| line(part) + "\n").collect()
}

#[test]
fn unknown_names_and_hints() {
    grows_in_proportion(|parts| {
        let declared = lines(parts, |n| format!("station_output_{n:05} : BOOL;"));
        let used = lines(parts, |n| format!("q_other_thing_{n:05} := TRUE;"));
        format!("PROGRAM p VAR {declared} END_VAR {used} END_PROGRAM")
    });
}

#[test]
fn refused_declarations_that_are_used() {
    grows_in_proportion(|parts| {
        let declared = lines(parts, |n| format!("a{n} : INT := TRUE;"));
        let used = lines(parts, |n| format!("a{n} := 1;"));
        format!("PROGRAM p VAR {declared} END_VAR {used} END_PROGRAM")
    });
}

#[test]
fn values_of_an_enumeration() {
    grows_in_proportion(|parts| {
        let values: Vec<String> = (0..parts).map(|n| format!("v{n}")).collect();
        let used = lines(parts, |n| format!("v{n}: n := {n}; x := e#v{n};"));
        format!(
            "TYPE e : ({}); END_TYPE PROGRAM p VAR x : e; n : INT; END_VAR CASE x OF {used} END_CASE; END_PROGRAM",
            values.join(", ")
        )
    });
}

#[test]
fn members_of_a_structure() {
    grows_in_proportion(|parts| {
        let members = lines(parts, |n| format!("m{n} : INT;"));
        let used = lines(parts, |n| format!("x.m{n} := {};", n % 100));
        let initial: Vec<String> = (0..parts).map(|n| format!("m{n} := 1")).collect();
        format!(
            "TYPE s : STRUCT {members} END_STRUCT END_TYPE PROGRAM p VAR x : s := ({}); END_VAR {used} END_PROGRAM",
            initial.join(", ")
        )
    });
}

#[test]
fn inputs_of_blocks_and_functions() {
    grows_in_proportion(|parts| {
        let inputs = lines(parts, |n| format!("i{n} : INT;"));
        let given: Vec<String> = (0..parts).map(|n| format!("i{n} := 1")).collect();
        let given = given.join(", ");
        format!(
            "FUNCTION_BLOCK b VAR_INPUT {inputs} END_VAR END_FUNCTION_BLOCK FUNCTION f : INT VAR_INPUT {inputs} END_VAR f := 1; END_FUNCTION
             PROGRAM p VAR x : b; n : INT; END_VAR x({given}); n := f({given}); END_PROGRAM"
        )
    });
}
