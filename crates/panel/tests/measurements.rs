//! Measurements over HTTP: their list, a picture, and no other file.

use panel::Settings;
use panel::play::{HOST, play_to_end};
use std::path::Path;

fn get(folder: Option<&Path>, is_owner: bool, path: &str) -> String {
    let settings = Settings {
        measurements: folder.map(Path::to_owned),
        ..Settings::default()
    };
    let request = format!("GET {path} HTTP/1.1\r\nHost: {HOST}\r\nConnection: close\r\n\r\n");
    String::from_utf8(play_to_end(settings, is_owner, request.as_bytes()).answer).unwrap()
}

#[test]
fn pictures_are_listed_and_given_and_nothing_else_is() {
    let state = tempfile::tempdir().unwrap();
    std::fs::write(state.path().join("state.json"), "secret").unwrap();
    let folder = state.path().join("measurements");
    std::fs::create_dir(&folder).unwrap();
    std::fs::write(folder.join("step-0.svg"), "<svg/>").unwrap();
    std::fs::write(folder.join("step-0.json"), "{}").unwrap();
    std::fs::write(folder.join("notes.txt"), "secret").unwrap();
    let at = |path: &str| get(Some(&folder), true, path);

    let list = at("/measurements/");
    assert!(
        list.starts_with("HTTP/1.1 200") && list.contains("\"name\":\"step-0\""),
        "{list}"
    );
    assert!(!list.contains("notes"), "{list}");
    let picture = at("/measurements/step-0.svg");
    assert!(
        picture.contains("image/svg+xml") && picture.ends_with("<svg/>"),
        "{picture}"
    );
    assert!(at("/measurements/step-0.json").ends_with("{}"));
    for (path, status) in [
        ("/measurements/sweep-0.svg", "404"),
        ("/measurements/notes.txt", "400"),
        ("/measurements/..%2Fstate.json", "400"),
        ("/measurements/%2Fetc%2Fpasswd.json", "400"),
    ] {
        let refused = at(path);
        assert!(refused.starts_with(&format!("HTTP/1.1 {status}")), "{path}: {refused}");
        assert!(!refused.contains("secret"), "{path}: {refused}");
    }
    for path in ["/measurements/", "/measurements/step-0.svg"] {
        let refused = get(Some(&folder), false, path);
        assert!(refused.starts_with("HTTP/1.1 401"), "{path}: {refused}");
    }
    assert!(get(None, true, "/measurements/").ends_with("{\"measurements\":[]}\n"));
    assert!(get(Some(Path::new("/nowhere")), true, "/measurements/").starts_with("HTTP/1.1 200"));
    assert!(get(None, true, "/measurements/step-0.svg").starts_with("HTTP/1.1 404"));
}
