//! The files of a measurement: `jitter.json`, `jitter-histogram.csv`, `jitter.svg`.
//!
//! In:  [`JitterReport`], a folder. Out: the files; none of an earlier measurement is left to pass for one of this.

use super::report::JitterReport;
use super::{csv, plot};
use anyhow::Context;
use operator::measurements;
use operator::report::prepare_for;
use std::path::Path;

const REPORT: &str = "jitter.json";
const HISTOGRAM: &str = "jitter-histogram.csv";
const PICTURE: &str = "jitter.svg";

/// Makes the folder ready before anything moves: it is there, can be written, and holds no file of an earlier measurement.
///
/// # Errors
/// What the file system refuses.
pub fn prepare(folder: &Path) -> anyhow::Result<()> {
    prepare_for(folder, &[REPORT, HISTOGRAM, PICTURE])
}

/// Writes the files, and keeps the figures and the picture for the panel where the machine has a folder for its `state`.
///
/// # Errors
/// What the file system refuses.
pub fn write(folder: &Path, report: &JitterReport, state: Option<&Path>, quiet: bool) -> anyhow::Result<()> {
    let put = |name: &str, text: String| {
        let path = folder.join(name);
        files::write(&path, text).with_context(|| path.display().to_string())
    };
    let (figures, picture) = (serde_json::to_string(report)?, plot::svg(report));
    measurements::keep(state, "jitter", &figures, &picture, quiet);
    put(REPORT, figures)?;
    put(HISTOGRAM, csv::histogram(report))?;
    put(PICTURE, picture)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_rid_of_an_earlier_measurement_and_of_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("a/b");
        prepare(&out).unwrap();
        for name in [REPORT, HISTOGRAM, PICTURE, "run.json"] {
            std::fs::write(out.join(name), "old").unwrap();
        }
        prepare(&out).unwrap();
        let left: Vec<_> = std::fs::read_dir(&out)
            .unwrap()
            .map(|entry| entry.unwrap().file_name())
            .collect();
        assert_eq!(left, ["run.json"]);
    }

    #[test]
    fn a_folder_that_cannot_be_written_is_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("taken");
        std::fs::write(&file, "").unwrap();
        assert!(prepare(&file).unwrap_err().to_string().contains("taken"));
    }
}
