//! The machine of the demo on the toy bus of tests.

/// Keys that are POWERLINK's.
const OF_POWERLINK: [&str; 4] = [
    "async_slot_timeout_us",
    "pres_lost_max",
    "pres_timeout_us",
    "soc_lost_max",
];

/// Its machine file.
pub(crate) fn text() -> String {
    let demo = include_str!("../../configs/mill3-demo.toml");
    let lines = demo
        .lines()
        .filter(|line| !OF_POWERLINK.iter().any(|key| line.starts_with(key)));
    let text: String = lines.map(|line| format!("{line}\n")).collect();
    text.replacen("kind = \"powerlink\"", "kind = \"toy\"", 1)
}
