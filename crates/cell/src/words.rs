//! What the supervisor answers, for a terminal.
//!
//! In:  answers as JSON. Out: lines; what others wrote in them does nothing to a terminal.

use serde_json::Value;
use std::fmt::Write as _;

/// Text of others, which may be meant for a terminal.
pub(super) fn plain(text: &str) -> String {
    let plain = |letter: char| if letter.is_control() { ' ' } else { letter };
    text.chars().map(plain).collect()
}

pub(super) fn word(value: &Value) -> String {
    plain(value.as_str().unwrap_or_default())
}

/// How wide a column must be.
fn width<'v>(values: impl Iterator<Item = &'v Value>) -> usize {
    values.filter_map(Value::as_str).map(str::len).max().unwrap_or(0)
}

fn all<'v>(value: &'v Value, key: &str) -> impl Iterator<Item = &'v Value> {
    value[key].as_array().into_iter().flatten()
}

pub(super) fn machines(answer: &Value) -> String {
    let mut text = String::new();
    if all(answer, "machines").next().is_none() {
        return "no machine has spoken yet: isocnc-cell ca issue NAME --dir CA\n".into();
    }
    let names = width(all(answer, "machines").map(|machine| &machine["name"]));
    let classes = width(all(answer, "machines").map(|machine| &machine["class"]));
    for machine in all(answer, "machines") {
        let state = &machine["state"];
        let how = match machine["alive"] == true {
            true => state["alarm"].as_str().or(state["why_not"].as_str()).unwrap_or("ready"),
            false => "not reached; it works on alone",
        };
        // Writing to a string does not fail.
        let _ = writeln!(
            text,
            "{:names$} {:classes$} {:8} {}",
            word(&machine["name"]),
            word(&machine["class"]),
            word(&machine["use"]),
            plain(how)
        );
    }
    text
}

pub(super) fn journal(answer: &Value) -> String {
    all(answer, "entries")
        .map(|entry| {
            format!(
                "{:>6} {:8} {}\n",
                entry["seq"].to_string(),
                word(&entry["kind"]),
                word(&entry["text"])
            )
        })
        .collect()
}

pub(super) fn ports(answer: &Value) -> String {
    if all(answer, "ports").next().is_none() {
        return "no machine that has spoken names its inputs and outputs\n".into();
    }
    let [machines, names, channels] =
        ["machine", "name", "channel"].map(|key| width(all(answer, "ports").map(|port| &port[key])));
    let line = |port: &Value| {
        let [machine, name, channel, kind, unit, net] =
            ["machine", "name", "channel", "type", "unit", "net"].map(|key| word(&port[key]));
        let way = if port["direction"] == "out" { "input" } else { "output" };
        let line = format!("{machine:machines$} {name:names$} {channel:channels$} {way:6} {kind:5} {unit} {net}");
        line.trim_end().to_owned() + "\n"
    };
    all(answer, "ports").map(line).collect()
}

/// How something is, and why, where that says more.
fn with_note(is: &Value, note: &Value) -> String {
    match (word(is), word(note)) {
        (is, note) if note.is_empty() || note == is => is,
        (is, note) => format!("{is}: {note}"),
    }
}

pub(super) fn queue(answer: &Value) -> String {
    let mut text = String::new();
    if all(answer, "orders").chain(all(answer, "attempts")).next().is_none() {
        return "no orders yet\n".into();
    }
    for order in all(answer, "orders") {
        let (done, count, under_way) = (&order["completed"], &order["count"], &order["under_way"]);
        let _ = writeln!(
            text,
            "order {} {} {done} of {count} parts, {under_way} under way, {} failed: {}",
            order["id"],
            word(&order["program"]),
            order["failed"],
            with_note(&order["state"], &order["note"]),
        );
        for unfit in all(order, "unfit").filter(|_| order["state"] == "open") {
            let _ = writeln!(
                text,
                "           not on {}: {}",
                word(&unfit["machine"]),
                word(&unfit["why"])
            );
        }
    }
    let names = width(all(answer, "attempts").map(|attempt| &attempt["machine"]));
    let programs = width(all(answer, "attempts").map(|attempt| &attempt["program"]));
    for attempt in all(answer, "attempts") {
        let _ = writeln!(
            text,
            "{:names$} {:programs$} {}",
            word(&attempt["machine"]),
            word(&attempt["program"]),
            with_note(&attempt["phase"], &attempt["note"]),
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_list_fits_the_terminal_and_tells_it_nothing() {
        let machine = |name: &str, alarm: &str| json!({ "name": name, "class": "", "use": "alarm", "alive": true, "state": { "alarm": alarm } });
        let told = json!({ "machines": [machine("mill-1", "hot\u{1b}[2J\nmill-9 ready"), machine("b", "cold")] });
        assert_eq!(
            machines(&told),
            "mill-1  alarm    hot [2J mill-9 ready\nb       alarm    cold\n"
        );
        let entry = json!({ "entries": [{ "seq": 1, "kind": "note", "text": "a\rb" }] });
        assert_eq!(journal(&entry), "     1 note     a b\n");
        let attempt = |phase: &str, note: &str| json!({ "machine": "m", "program": "p", "phase": phase, "note": note });
        let attempts = json!({ "attempts": [attempt("completed", "completed"), attempt("failed", "stopped"), attempt("running", "")] });
        assert_eq!(queue(&attempts), "m p completed\nm p failed: stopped\nm p running\n");
    }
}
