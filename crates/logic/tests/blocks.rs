//! Standard function blocks, call by call. One column is a call; scans are 10 ms apart, PT is 30 ms.

use crate::common;

use common::{get, scan, set, start};

fn words(row: &str) -> Vec<&str> {
    row.split_whitespace().collect()
}

/// Calls a block once a column with these inputs, and compares its outputs.
fn check(block: &str, preset: &str, inputs: &[(&str, &str)], outputs: &[(&str, &str)]) {
    let sections: String = inputs.iter().map(|(name, _)| format!("{name}_ : BOOL; ")).collect();
    let arguments: Vec<String> = inputs.iter().map(|(name, _)| format!("{name} := {name}_")).collect();
    let arguments = arguments.join(", ");
    let preset = if preset.is_empty() {
        String::new()
    } else {
        format!(", {preset}")
    };
    let mut runtime = start(&format!(
        "PROGRAM p VAR_INPUT {sections} END_VAR VAR b : {block}; END_VAR b({arguments}{preset}); END_PROGRAM"
    ));
    let calls = words(inputs[0].1).len();
    for call in 0..calls {
        for (name, row) in inputs {
            set(&mut runtime, &format!("{name}_"), words(row)[call]);
        }
        scan(&mut runtime, call as i64 * 10);
        for (name, row) in outputs {
            assert_eq!(words(row).len(), calls, "{block} {name}");
            let got = get(&runtime, &format!("b.{name}"));
            assert_eq!(got, words(row)[call], "{block}({preset}): {name} in call {call}");
        }
    }
    assert_eq!((runtime.faults(), runtime.overflows()), (0, 0));
}

#[test]
fn ton_counts_exactly_pt_as_elapsed() {
    check(
        "TON",
        "PT := T#30ms",
        &[("IN", "0 1 1 1 1 1 0 1 1 0 0 1")],
        &[("Q", "0 0 0 0 1 1 0 0 0 0 0 0"), ("ET", "0 0 10 20 30 30 0 0 10 0 0 0")],
    );
    check(
        "TON",
        "PT := T#25ms",
        &[("IN", "0 1 1 1 1 0")],
        &[("Q", "0 0 0 0 1 0"), ("ET", "0 0 10 20 25 0")],
    );
}

#[test]
fn tof_goes_on_for_pt() {
    check(
        "TOF",
        "PT := T#30ms",
        &[("IN", "0 0 1 1 0 0 0 0 0 1 0 1")],
        &[("Q", "0 0 1 1 1 1 1 0 0 1 1 1"), ("ET", "0 0 0 0 0 10 20 30 30 0 0 0")],
    );
}

#[test]
fn tp_ignores_edges_in_its_pulse() {
    check(
        "TP",
        "PT := T#30ms",
        &[("IN", "0 1 1 1 1 1 0 1 0 0 0 1")],
        &[
            ("Q", "0 1 1 1 0 0 0 1 1 1 0 1"),
            ("ET", "0 0 10 20 30 30 0 0 10 20 0 0"),
        ],
    );
    check(
        "TP",
        "PT := T#30ms",
        &[("IN", "1 0 0 0 0 1 0 1 0 0 1 1")],
        &[("Q", "1 1 1 0 0 1 1 1 0 0 1 1"), ("ET", "0 10 20 0 0 0 10 20 0 0 0 10")],
    );
}

#[test]
fn without_a_time_ton_and_tof_follow_and_tp_never_pulses() {
    for preset in ["PT := T#0s", "PT := T#-1s"] {
        check(
            "TON",
            preset,
            &[("IN", "1 0 1 1 0")],
            &[("Q", "1 0 1 1 0"), ("ET", "0 0 0 0 0")],
        );
        check(
            "TOF",
            preset,
            &[("IN", "0 1 0 0 1")],
            &[("Q", "0 1 0 0 1"), ("ET", "0 0 0 0 0")],
        );
        check(
            "TP",
            preset,
            &[("IN", "0 1 1 0 1")],
            &[("Q", "0 0 0 0 0"), ("ET", "0 0 0 0 0")],
        );
    }
}

#[test]
fn a_time_that_changes_while_it_runs_counts_at_once() {
    let mut runtime = start(
        "PROGRAM p VAR_INPUT on : BOOL; pt : TIME; END_VAR VAR a : TON; b : TOF; c : TP; END_VAR
         a(IN := on, PT := pt); b(IN := on, PT := pt); c(IN := on, PT := pt); END_PROGRAM",
    );
    let call = |runtime: &mut _, now: i64, on: &str, pt: &str, wanted: &str| {
        set(runtime, "on", on);
        set(runtime, "pt", pt);
        scan(runtime, now);
        let shown = ["a", "b", "c"].map(|name| {
            format!(
                "{} {}",
                get(runtime, &format!("{name}.Q")),
                get(runtime, &format!("{name}.ET"))
            )
        });
        assert_eq!(shown.join(" / "), wanted, "at {now} ms");
    };
    call(&mut runtime, 0, "1", "100", "0 0 / 1 0 / 1 0");
    call(&mut runtime, 10, "1", "100", "0 10 / 1 0 / 1 10");
    call(&mut runtime, 20, "1", "15", "1 15 / 1 0 / 0 15");
    // What has elapsed stays so until the input changes.
    call(&mut runtime, 30, "1", "100", "1 15 / 1 0 / 0 15");
    call(&mut runtime, 40, "0", "100", "0 0 / 1 0 / 0 0");
    call(&mut runtime, 50, "0", "5", "0 0 / 0 5 / 0 0");
    call(&mut runtime, 60, "0", "100", "0 0 / 0 5 / 0 0");
}

#[test]
fn edges() {
    check("R_TRIG", "", &[("CLK", "1 1 0 1")], &[("Q", "1 0 0 1")]);
    check("F_TRIG", "", &[("CLK", "0 0 1 0 0")], &[("Q", "0 0 0 1 0")]);
}

#[test]
fn in_sr_set_wins_and_in_rs_reset() {
    check(
        "SR",
        "",
        &[("S1", "0 1 0 1 0 0"), ("R", "0 0 0 1 1 0")],
        &[("Q1", "0 1 1 1 0 0")],
    );
    check(
        "RS",
        "",
        &[("S", "0 1 0 1 0 0"), ("R1", "0 0 0 1 1 0")],
        &[("Q1", "0 1 1 0 0 0")],
    );
}

#[test]
fn counters() {
    for kind in ["", "_INT", "_DINT", "_LINT", "_UDINT", "_ULINT"] {
        check(
            &format!("CTU{kind}"),
            "PV := 2",
            &[("CU", "0 1 1 0 1 0 1 1 1 0 1"), ("R", "0 0 0 0 0 0 0 1 0 0 0")],
            &[("Q", "0 0 0 0 1 1 1 0 0 0 0"), ("CV", "0 1 1 1 2 2 3 0 0 0 1")],
        );
        let below_zero = if kind.starts_with("_U") { "0" } else { "-1" };
        check(
            &format!("CTD{kind}"),
            "PV := 2",
            &[("CD", "0 0 1 0 1 0 1 0 1 1 0 1"), ("LD", "0 1 0 0 0 0 0 1 1 0 0 0")],
            &[
                ("Q", "1 0 0 0 1 1 1 0 0 0 0 0"),
                ("CV", &format!("0 2 1 1 0 0 {below_zero} 2 2 2 2 1")),
            ],
        );
        check(
            &format!("CTUD{kind}"),
            "PV := 2",
            &[
                ("CU", "0 1 0 1 0 0 1 0 0 0 1 1 0"),
                ("CD", "0 0 0 0 1 0 1 0 1 0 0 0 1"),
                ("R", "0 0 0 0 0 0 0 0 0 1 1 0 0"),
                ("LD", "0 0 0 0 0 0 0 1 0 1 0 0 0"),
            ],
            &[
                ("QU", "0 0 0 1 0 0 0 1 0 0 0 0 0"),
                ("QD", "1 0 0 0 0 0 0 0 0 1 1 1 1"),
                ("CV", &format!("0 1 1 2 1 1 1 2 1 0 0 0 {below_zero}")),
            ],
        );
    }
}

#[test]
fn counters_stop_at_the_ends_of_their_type() {
    let mut runtime = start(
        "PROGRAM p VAR_INPUT clock : BOOL; END_VAR VAR up : CTUD; down : CTD; n : INT; END_VAR
         up(CU := clock, LD := n = 0, PV := 32766);
         down(CD := clock, LD := n = 0, PV := -32767);
         n := n + 1; END_PROGRAM",
    );
    for call in 0..8 {
        set(&mut runtime, "clock", if call % 2 == 1 { "1" } else { "0" });
        scan(&mut runtime, call);
    }
    assert_eq!([get(&runtime, "up.CV"), get(&runtime, "down.CV")], ["32767", "-32768"]);
}
