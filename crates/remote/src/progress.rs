//! How far a program is, in words: for `status` and `top`.

use protocol::Status;

/// Elapsed time, time to go and share done of the program under way.
pub(super) fn words(status: &Status) -> String {
    let mut words = vec![time(status.elapsed_s)];
    if let Some(left_s) = status.remaining_s {
        words.push(format!("{} to go", time(left_s)));
    }
    if let Some(done) = status.done_percent {
        // Nothing is done before it is.
        words.push(format!("{} % done", done.floor()));
    }
    if let Some(note) = &status.remaining_note {
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

    #[test]
    fn what_is_not_known_is_not_shown_as_a_number() {
        let mut status = Status {
            elapsed_s: 61.2,
            remaining_s: Some(3_599.6),
            done_percent: Some(99.9),
            ..Status::default()
        };
        assert_eq!(words(&status), "1:01, 1:00:00 to go, 99 % done");
        (status.elapsed_s, status.remaining_s, status.done_percent) = (2.0, None, Some(10.0));
        status.remaining_note = Some("not known".into());
        assert_eq!(words(&status), "2 s, 10 % done, time to go: not known");
    }
}
