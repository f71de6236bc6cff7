//! Programs that are compiled and run scan by scan.

#![allow(dead_code, reason = "each test takes what it needs")]

use logic::{Diagnostic, Logic, Runtime, compile};
use std::sync::Arc;

const MILLISECOND_NS: i64 = 1_000_000;

/// A compiled program at its start; what is wrong with it fails the test.
pub(crate) fn start(text: &str) -> Runtime {
    let told = |told: Vec<Diagnostic>| {
        told.iter()
            .map(|one| one.render("test.st"))
            .collect::<Vec<_>>()
            .join("\n")
    };
    Runtime::new(Arc::new(
        compile(text).unwrap_or_else(|errors| panic!("{}", told(errors))),
    ))
}

/// What is told about a program that does not compile, one line each.
pub(crate) fn errors(text: &str) -> Vec<String> {
    match compile(text) {
        Ok(_) => panic!("it compiles:\n{text}"),
        Err(told) => told.iter().map(ToString::to_string).collect(),
    }
}

/// What is told about a program that compiles.
pub(crate) fn warnings(text: &str) -> Vec<String> {
    start(text).logic().warnings().iter().map(ToString::to_string).collect()
}

pub(crate) fn set(runtime: &mut Runtime, name: &str, value: &str) {
    let logic: Arc<Logic> = runtime.logic().clone();
    let variable = logic.variable(name).unwrap_or_else(|| panic!("no {name}"));
    let read = logic
        .read(variable, value)
        .unwrap_or_else(|| panic!("{name}: {value} is none of its values"));
    assert!(runtime.set(variable, read));
}

pub(crate) fn get(runtime: &Runtime, name: &str) -> String {
    let logic = runtime.logic();
    let variable = logic.variable(name).unwrap_or_else(|| panic!("no {name}"));
    runtime.get(variable).to_string()
}

/// One scan, within the steps that were counted.
pub(crate) fn scan(runtime: &mut Runtime, now_ms: i64) {
    let steps = runtime.scan(now_ms * MILLISECOND_NS);
    let most = runtime.logic().steps_max();
    assert!(steps <= most, "{steps} steps, {most} were counted");
}

/// Values of variables behind one scan of a program with these declarations and statements.
pub(crate) fn after(declarations: &str, statements: &str, names: &[&str]) -> Vec<String> {
    let mut runtime = start(&format!("{declarations}\n{statements}\nEND_PROGRAM"));
    scan(&mut runtime, 0);
    names.iter().map(|name| get(&runtime, name)).collect()
}

/// The value of an expression of this type.
pub(crate) fn value(ty: &str, expression: &str) -> String {
    after(
        &format!("PROGRAM p VAR x : {ty}; END_VAR"),
        &format!("x := {expression};"),
        &["x"],
    )
    .remove(0)
}
