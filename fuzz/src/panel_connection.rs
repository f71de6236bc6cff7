//! Any octets as a connection to the panel: it ends, answers HTTP or nothing, keeps to its folder, and lets nobody in who may not.
//!
//! The first octet says who it is (1: the user of the control), and whether the rest are frames of a WebSocket that is open already (2).

use panel::Settings;
use panel::play::{HOST, Played, play};
use std::path::Path;

/// What must never be told, and never be changed.
const SECRET: &str = "o78fSECRETd21";

/// One run of the fuzzer.
pub fn run(octets: &[u8]) {
    let Some((who, rest)) = octets.split_first() else {
        return;
    };
    let is_owner = who & 1 == 1;
    let mut sent = Vec::new();
    if who & 2 == 2 {
        let head = format!(
            "GET /rpc HTTP/1.1\r\nHost: {HOST}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n\
             Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
        );
        sent.extend(head.as_bytes());
    }
    sent.extend(rest);
    let root = tempfile::tempdir().expect("a folder");
    let programs = root.path().join("programs");
    std::fs::create_dir(&programs).expect("a folder");
    std::fs::write(root.path().join("secret.ngc"), SECRET).expect("a file");
    std::os::unix::fs::symlink("../secret.ngc", programs.join("link.ngc")).expect("a link");
    let measurements = root.path().join("measurements");
    std::fs::create_dir(&measurements).expect("a folder");
    std::fs::write(measurements.join("step-0.svg"), "<svg/>").expect("a file");
    let settings = Settings {
        programs: Some(programs.clone()),
        measurements: Some(measurements),
        ..Settings::default()
    };
    let Played { answer, guests, lines } = play(settings, is_owner, &sent);
    assert!(
        is_owner || guests.is_empty() && lines.is_empty(),
        "{guests:?} {lines:?}"
    );
    assert!(
        answer.is_empty() || answer.starts_with(b"HTTP/1."),
        "{}",
        answer.escape_ascii()
    );
    for line in &lines {
        // A line that is begun and not ended is that of a client that has gone.
        let text = line.strip_suffix(b"\n").unwrap_or(line);
        assert!(!text.contains(&b'\r'), "{}", text.escape_ascii());
    }
    let has_secret = |octets: &[u8]| octets.windows(SECRET.len()).any(|part| part == SECRET.as_bytes());
    // A host that is not ours is named in the answer.
    assert!(!has_secret(&answer) || has_secret(&sent), "{}", answer.escape_ascii());
    assert_eq!(names(root.path()), ["measurements", "programs", "secret.ngc"]);
    assert_eq!(
        std::fs::read_to_string(root.path().join("secret.ngc")).expect("a file"),
        SECRET
    );
    for name in names(&programs) {
        assert!(files::is_name(&name), "{name:?}");
    }
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("a folder").flatten();
    let mut names: Vec<String> = entries
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}
