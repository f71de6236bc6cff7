//! How far a program is, in words: for `status` and `top`.

use serde_json::Value;

/// Elapsed time, time to go and share done of the program under way; `at`: fields of the state.
pub(super) fn words<'v>(at: impl Fn(&str) -> &'v Value) -> String {
    let mut words = vec![time(at("elapsed_s").as_f64().unwrap_or(0.0))];
    if let Some(left_s) = at("remaining_s").as_f64() {
        words.push(format!("{} to go", time(left_s)));
    }
    if let Some(done) = at("done_percent").as_f64() {
        // Nothing is done before it is.
        words.push(format!("{} % done", done.floor()));
    }
    if let Some(note) = at("remaining_note").as_str() {
        words.push(format!("time to go: {note}"));
    }
    words.join(", ")
}

/// Seconds; from a minute on, m:ss or h:mm:ss.
fn time(s: f64) -> String {
    let all = s.round() as u64;
    let (hours, minutes, seconds) = (all / 3600, all / 60 % 60, all % 60);
    match (hours, minutes) {
        (0, 0) => format!("{seconds} s"),
        (0, minutes) => format!("{minutes}:{seconds:02}"),
        (hours, minutes) => format!("{hours}:{minutes:02}:{seconds:02}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn what_is_not_known_is_not_shown_as_a_number() {
        let told = |state: Value| words(|name| state.get(name).unwrap_or(&Value::Null));
        let state = json!({ "elapsed_s": 61.2, "remaining_s": 3_599.6, "done_percent": 99.9, "remaining_note": null });
        assert_eq!(told(state), "1:01, 1:00:00 to go, 99 % done");
        let state = json!({ "elapsed_s": 2, "remaining_s": null, "done_percent": 10, "remaining_note": "not known" });
        assert_eq!(told(state), "2 s, 10 % done, time to go: not known");
    }
}
