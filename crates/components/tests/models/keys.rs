//! Keys, switches and messages.

use super::{Past, model};

#[test]
fn keys() {
    // Each press is one click, and each group of up to four ends as one `-only`.
    let times = [
        ("max-hold-ns", 9e8, 9e8),
        ("max-space-ns", 3e6, 3e6),
        ("output-hold-ns", 1e6, 1e6),
        ("invert-input", 0.0, 0.0),
    ];
    model::<(Past, usize)>("multiclick", &[], &times, |(key, clicks), r| {
        key.push(r.bit("in"));
        let names = ["single", "double", "triple", "quadruple"];
        let told = |end: &str| -> Vec<usize> {
            let set = (1..=4).filter(|n| r.bit(&format!("{}-click{end}", names[n - 1])));
            set.collect()
        };
        // A key that is pressed at the start is a press.
        let pressed = key.rose() || key.seen.len() == 1 && key.now();
        let falls = key.fell();
        let is_over = !key.now() && key.lasts() == 5;
        match (*clicks, pressed, falls, is_over) {
            (..=3, _, true, _) => {
                *clicks += 1;
                assert_eq!((told(""), told("-only")), (vec![*clicks], vec![]));
            }
            (4, true, ..) => *clicks = 5,
            (5, _, true, _) => *clicks = 0,
            (1..=4, _, _, true) => {
                assert_eq!((told(""), told("-only")), (vec![], vec![*clicks]));
                *clicks = 0;
            }
            _ => assert_eq!((told(""), told("-only")), (vec![], vec![])),
        }
    });
    model::<(Past, f64)>(
        "message",
        &[],
        &[("force", 0.0, 0.0), ("edge", 0.0, 0.0)],
        |(trigger, times), r| {
            trigger.push(r.bit("trigger"));
            *times += f64::from(u8::from(trigger.fell() || trigger.seen.len() == 1 && !trigger.now()));
            assert_eq!((r.bit("show"), r.number("count")), (!trigger.now(), *times));
        },
    );
    for kind in ["toggle2nist", "momentary2nist"] {
        let settings = [("debounce", 1.0, 1.0), ("max-pulse-length", 4.0, 4.0)];
        model::<(Past, Option<bool>, u32)>(kind, &[], &settings, |(key, pulse, calls), r| {
            key.push(r.bit("in"));
            let is_on = r.bit("is-on");
            *calls += 1;
            if *pulse == Some(is_on) || *calls > 4 {
                *pulse = None;
            }
            let asked = match kind {
                "toggle2nist" => (key.rose() || key.fell()).then_some(key.now()),
                _ => key.rose().then_some(!is_on),
            };
            if let Some(wanted) = asked.filter(|wanted| *wanted != is_on) {
                (*pulse, *calls) = (Some(wanted), 1);
            }
            assert_eq!(
                (r.bit("on"), r.bit("off")),
                (*pulse == Some(true), *pulse == Some(false))
            );
        });
    }
}
