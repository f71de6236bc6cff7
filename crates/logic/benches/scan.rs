//! Time of a scan, for programs of 1000 equations: `cargo bench -p isocnc-logic --bench scan`.

use logic::{Runtime, compile};
use std::sync::Arc;
use std::time::Instant;

const EQUATIONS: usize = 1000;
const SCANS: usize = 2000;

/// A program of so many statements, with declarations before them.
fn program(declarations: &str, statement: impl Fn(usize) -> String) -> String {
    let statements: String = (0..EQUATIONS).map(statement).collect();
    format!("PROGRAM p {declarations} {statements} END_PROGRAM")
}

fn measure(name: &str, text: &str) {
    let logic = Arc::new(compile(text).unwrap_or_else(|errors| panic!("{name}: {}", errors[0])));
    let mut runtime = Runtime::new(logic.clone());
    let mut times_us: Vec<f64> = (0..SCANS as i64)
        .map(|scan| {
            let start = Instant::now();
            runtime.scan(scan * 10_000_000);
            start.elapsed().as_secs_f64() * 1e6
        })
        .collect();
    times_us.sort_by(f64::total_cmp);
    let (median, high) = (times_us[SCANS / 2], times_us[SCANS * 99 / 100]);
    println!(
        "{name:<32} {:>7} steps  {median:>8.1} us  {high:>8.1} us of 99 %",
        logic.steps_max()
    );
}

fn main() {
    println!("{EQUATIONS} equations, {SCANS} scans; median, and 99 % of the scans are within");
    let bits = format!("VAR b : ARRAY[0..{EQUATIONS}] OF BOOL; x, y, z : BOOL; END_VAR");
    let of_bits = program(&bits, |n| format!("b[{n}] := (x OR b[{}]) AND NOT y AND z;\n", n + 1));
    measure("BOOL: (a OR b) AND NOT c AND d", &of_bits);
    let numbers = format!("VAR a : ARRAY[0..{EQUATIONS}] OF LREAL; x : LREAL := 1.5; END_VAR");
    let of_numbers = program(&numbers, |n| format!("a[{n}] := a[{}] * x + 0.25 - x / 3.0;\n", n + 1));
    measure("LREAL: a * x + b - x / c", &of_numbers);
    let whole = format!("VAR a : ARRAY[0..{EQUATIONS}] OF DINT; i : INT := 3; END_VAR");
    let of_whole = program(&whole, |n| format!("a[i] := a[i + 1] * {n} + LIMIT(0, a[{n}], 500);\n"));
    measure("DINT with indices", &of_whole);
    let timers = format!("VAR t : ARRAY[0..{EQUATIONS}] OF TON; b : BOOL; END_VAR");
    let of_timers = program(&timers, |n| {
        format!("t[{n}](IN := NOT b, PT := T#{}ms);\n", n % 90 + 10)
    });
    measure("TON", &of_timers);
}
