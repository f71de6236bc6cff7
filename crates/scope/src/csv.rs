//! Samples as a table for other programs: `t_s,name..`, a line for each cycle.
//!
//! In:  channels, cycles. Out: text; integers are exact, bits are 0 or 1, floats as short as they are exact.

use hal_pins::AnyValue;
use hal_pins::scope::Channel;
use std::fmt::Write;

/// The first line.
pub fn header(channels: &[Channel]) -> String {
    let names = channels.iter().map(|channel| format!(",{}", channel.name));
    format!("t_s{}\n", names.collect::<String>())
}

/// Appends a cycle; `time_ns`: on the time of the record.
pub fn push_line(text: &mut String, time_ns: i64, channels: &[Channel], words: &[u64]) {
    let sign = if time_ns < 0 { "-" } else { "" };
    let us = (time_ns.unsigned_abs() + 500) / 1000;
    // Writing to a text does not fail.
    let _ = write!(text, "{sign}{}.{:06}", us / 1_000_000, us % 1_000_000);
    for (channel, word) in channels.iter().zip(words) {
        let _ = match channel.value(*word) {
            AnyValue::Bit(on) => write!(text, ",{}", u8::from(on)),
            value => write!(text, ",{value}"),
        };
    }
    text.push('\n');
}
