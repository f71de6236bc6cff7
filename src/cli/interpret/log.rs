//! Files that a program writes with `(LOGOPEN, ..)`, `(LOGAPPEND, ..)`, `(LOG, ..)` and `(LOGCLOSE)`.
//!
//! In:  the records of a program.
//! Out: files in the current directory or where the program names them.

use anyhow::Context;
use motion::canon::Record;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// The log under way, if there is one.
#[derive(Debug, Default)]
pub(super) struct Log {
    open: Option<(String, BufWriter<File>)>,
}

impl Log {
    /// Does what a record asks for. A line without an open log goes nowhere, as with LinuxCNC.
    ///
    /// # Errors
    /// A file that cannot be opened or written.
    pub(super) fn record(&mut self, record: &Record) -> anyhow::Result<()> {
        match record {
            Record::OpenLog(path) => self.open(path, files::create(Path::new(path))),
            Record::AppendLog(path) => self.open(path, files::append(Path::new(path))),
            Record::Log(text) => match &mut self.open {
                Some((path, file)) => writeln!(file, "{text}").with_context(|| path.clone()),
                None => Ok(()),
            },
            Record::CloseLog => self.close(),
            // Only a machine has points to log.
            Record::Print(_) | Record::OpenProbeLog(_) | Record::CloseProbeLog => Ok(()),
        }
    }

    fn open(&mut self, path: &str, file: std::io::Result<File>) -> anyhow::Result<()> {
        self.close()?;
        let file = file.with_context(|| path.to_owned())?;
        self.open = Some((path.to_owned(), BufWriter::new(file)));
        Ok(())
    }

    /// Ends the log under way.
    ///
    /// # Errors
    /// What could not be written.
    pub(super) fn close(&mut self) -> anyhow::Result<()> {
        let Some((path, mut file)) = self.open.take() else {
            return Ok(());
        };
        file.flush().context(path)
    }
}
