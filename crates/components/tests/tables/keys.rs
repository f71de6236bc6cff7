//! Keys, switches and messages.

use crate::rig::{T, table};

#[test]
fn keys() {
    let settings = "max-hold-ns 2000000\n max-space-ns 2000000\n output-hold-ns 1000000\n";
    table(
        "multiclick",
        &[],
        T,
        &format!(
            "{settings} in 0 1 0 0 1 0 0 0 0 0 0\n > single-click 0 0 1 0 0 0 0 0 0 0 0\n > double-click 0 0 0 0 0 1 0 0 0 0 0
             > single-click-only 0\n > double-click-only 0 0 0 0 0 0 0 0 1 0 0\n > state 0 1 2 2 3 4 4 4 0 0 0"
        ),
    );
    // Held for too long it is no click; a fifth one ends all.
    table(
        "multiclick",
        &[],
        T,
        &format!("{settings} in 0 1 1 1 1 0 0 1\n > single-click 0\n > state 0 1 1 1 9 0 0 1"),
    );
    table(
        "multiclick",
        &[],
        T,
        &format!(
            "{settings} invert-input 1\n in 1 0 1 0 1 0 1 0 1 0 1\n > quadruple-click 0 0 0 0 0 0 0 0 1 0 0
             > triple-click 0 0 0 0 0 0 1 0 0 0 0\n > quadruple-click-only 0\n > state 0 1 2 3 4 5 6 7 8 9 0"
        ),
    );
    table(
        "message",
        &[],
        0.05,
        "trigger 1 1 1 1 1 0 1\n force 1 0 1 1 1 1 1\n > show 1 1 0 0 1 0 1\n > count 1 1 2 2 2 2 3",
    );
    table(
        "message",
        &[],
        T,
        "trigger 0 1 0\n edge 0\n > show 1 0 1\n > count 1 1 2",
    );
    // A pulse that the device answers, one that it does not, and a switch that asks for what it is.
    table(
        "toggle2nist",
        &[],
        T,
        "in 0 1 0 1 1 1 1 0 0 0 0 0 0 1 1\n is-on 0 0 0 0 0 0 1 1 1 1 1 1 1 1 1\n max-pulse-length 3
         > on 0 0 0 0 1 1 0 0 0 0 0 0 0 0 0\n > off 0 0 0 0 0 0 0 0 1 1 1 0 0 0 0",
    );
    table(
        "momentary2nist",
        &[],
        T,
        "in 1 1 0 0 1 1 0 0 1 1 1\n is-on 0 0 0 0 0 0 1 1 1 1 0
         > on 0 0 0 0 0 1 0 0 0 0 0\n > off 0 0 0 0 0 0 0 0 0 1 0",
    );
}
