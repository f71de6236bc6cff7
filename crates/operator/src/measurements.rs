//! Measurements of a machine that its panel shows: the last of each kind, in the folder of its state.
//!
//! In:  the figures (JSON) and the picture (SVG) of a measurement. Out: `measurements/NAME.json` and `.svg` in the state folder.

use host::terminal::say;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Where they are, in the folder of the state.
pub fn folder(state: &Path) -> PathBuf {
    state.join("measurements")
}

/// Keeps a measurement beside what was written for its user; `state` is the folder of the state, where there is one. A disk that takes
/// no more keeps nobody from what was measured: it is warned of.
pub fn keep(state: Option<&Path>, name: &str, figures: &str, picture: &str, quiet: bool) {
    let Some(folder) = state.map(folder) else {
        return;
    };
    let put = |ending: &str, text: &str| files::write(&folder.join(format!("{name}.{ending}")), text);
    let kept = files::make_folder(&folder)
        .and_then(|()| put("json", figures))
        .and_then(|()| put("svg", picture));
    match kept {
        Ok(()) if quiet => {}
        Ok(()) => say(&format!(
            "for the panel {}\n",
            folder.join(format!("{name}.svg")).display()
        )),
        // Nobody can be told of a warning that cannot be written.
        Err(cause) => _ = warn(&folder, &cause),
    }
}

fn warn(folder: &Path, cause: &io::Error) -> io::Result<()> {
    let folder = folder.display();
    writeln!(
        files::printed::stderr(),
        "warning: {folder}: {cause}: the panel will not show this measurement"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_of_a_kind_is_kept_where_there_is_a_state() {
        let state = tempfile::tempdir().unwrap();
        for figures in ["{\"old\": 1}", "{}"] {
            keep(Some(state.path()), "step-0", figures, "<svg/>", true);
        }
        let read = |name: &str| std::fs::read_to_string(folder(state.path()).join(name)).unwrap();
        assert_eq!(
            (read("step-0.json"), read("step-0.svg")),
            ("{}".into(), "<svg/>".into())
        );
        keep(None, "step-0", "{}", "<svg/>", true);
    }
}
