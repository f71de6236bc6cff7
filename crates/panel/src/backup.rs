//! `/backup`: what the machine remembers, as one file.
//!
//! In:  the folder of the state, the machine file and what belongs to it. Out: a tar archive, as it is read. Tokens and the key of the
//! certificate stay here: whoever has the archive gets in nowhere by it.

use crate::guard::{Visitor, refuse};
use crate::serve::Panel;
use axum::Extension;
use axum::body::{Body, Bytes};
use axum::extract::State;
use axum::http::header::{CACHE_CONTROL, CONTENT_DISPOSITION, CONTENT_TYPE};
use axum::http::{HeaderValue, Method, StatusCode};
use axum::response::{IntoResponse, Response};
use futures_util::stream;
use protocol::Role;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tokio::sync::mpsc::{Sender, channel};
use tokio::task::spawn_blocking;

/// Octets that are sent at once.
const CHUNK: usize = 64 * 1024;
/// Chunks that wait for their reader.
const WAITING_MAX: usize = 4;
/// Folders within folders.
const DEPTH_MAX: usize = 4;
/// Entries of the archive.
const ENTRIES_MAX: usize = 10_000;
/// Names, or beginnings of names, that stay here: what lets somebody in, and what is on its way.
const KEPT_BACK: [&str; 3] = ["panel-tokens", "panel-key", "."];

/// What is to be kept elsewhere.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Backup {
    /// The folder of the state.
    pub folder: Option<PathBuf>,
    /// Files beside it: the machine file, tables.
    pub files: Vec<PathBuf>,
    /// Files that stay here, wherever they lie.
    pub secret: Vec<PathBuf>,
}

/// Hands chunks to whoever sends them; waits for room.
struct Chunks(Sender<io::Result<Bytes>>);

impl Write for Chunks {
    fn write(&mut self, octets: &[u8]) -> io::Result<usize> {
        let gone = |_| io::Error::from(io::ErrorKind::BrokenPipe);
        self.0.blocking_send(Ok(Bytes::copy_from_slice(octets))).map_err(gone)?;
        Ok(octets.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Gives the archive.
pub(crate) async fn backup(
    State(panel): State<Arc<Panel>>,
    Extension(visitor): Extension<Visitor>,
    method: Method,
) -> Response {
    if let Err(refusal) = visitor.permit(Role::SetUp) {
        return *refusal;
    }
    if method != Method::GET {
        return refuse(
            StatusCode::METHOD_NOT_ALLOWED,
            "a backup can be read; it is put back at the PC",
        );
    }
    let wanted = panel.settings.backup.clone();
    let (to, mut chunks) = channel(WAITING_MAX);
    spawn_blocking(move || {
        let failed = to.clone();
        if let Err(cause) = write(&wanted, BufWriter::with_capacity(CHUNK, Chunks(to))) {
            tracing::warn!(%cause, "a backup was given up");
            // The end that comes too soon is no end: the reader is told.
            let _ = failed.blocking_send(Err(cause));
        }
    });
    let body = stream::poll_fn(move |context| chunks.poll_recv(context));
    let headers = [
        (CONTENT_TYPE, HeaderValue::from_static("application/x-tar")),
        (
            CONTENT_DISPOSITION,
            HeaderValue::from_static("attachment; filename=\"isocnc-backup.tar\""),
        ),
        (CACHE_CONTROL, HeaderValue::from_static("no-store")),
    ];
    (headers, Body::from_stream(body)).into_response()
}

/// Writes the archive: files as `files/NAME`, the folder as `state/...`.
fn write(wanted: &Backup, to: impl Write) -> io::Result<()> {
    let mut archive = tar::Builder::new(to);
    archive.mode(tar::HeaderMode::Deterministic);
    let mut left = ENTRIES_MAX;
    for path in &wanted.files {
        if let Some(name) = path.file_name() {
            add(&mut archive, path, &Path::new("files").join(name), &mut left)?;
        }
    }
    if let Some(folder) = &wanted.folder {
        add_folder(&mut archive, wanted, folder, Path::new("state"), DEPTH_MAX, &mut left)?;
    }
    archive.into_inner()?.flush()
}

fn add_folder(
    archive: &mut tar::Builder<impl Write>,
    wanted: &Backup,
    folder: &Path,
    name: &Path,
    depth: usize,
    left: &mut usize,
) -> io::Result<()> {
    let mut entries: Vec<_> = std::fs::read_dir(folder)?.collect::<io::Result<_>>()?;
    entries.sort_by_key(std::fs::DirEntry::file_name);
    for entry in entries {
        let (path, own_name) = (entry.path(), entry.file_name());
        let is_secret = wanted.secret.contains(&path)
            || KEPT_BACK
                .iter()
                .any(|begin| own_name.to_string_lossy().starts_with(begin));
        if is_secret {
            continue;
        }
        let name = name.join(&own_name);
        match entry.file_type() {
            Ok(kind) if kind.is_file() => add(archive, &path, &name, left)?,
            Ok(kind) if kind.is_dir() && depth > 0 => add_folder(archive, wanted, &path, &name, depth - 1, left)?,
            // Links lead elsewhere.
            _ => {}
        }
    }
    Ok(())
}

fn add(archive: &mut tar::Builder<impl Write>, path: &Path, name: &Path, left: &mut usize) -> io::Result<()> {
    let Some(rest) = left.checked_sub(1) else {
        return Err(io::Error::other(format!("there are more than {ENTRIES_MAX} files")));
    };
    *left = rest;
    let of = |cause: io::Error| io::Error::new(cause.kind(), format!("{}: {cause}", path.display()));
    match files::open(path) {
        Ok(mut file) => append(archive, &mut file, name).map_err(of),
        // It has gone since the folder was read.
        Err(cause) if cause.kind() == io::ErrorKind::NotFound => Ok(()),
        Err(cause) => Err(of(cause)),
    }
}

/// A file as it was when it was opened: whatever grows meanwhile is cut there.
fn append(archive: &mut tar::Builder<impl Write>, file: &mut File, name: &Path) -> io::Result<()> {
    use io::Read;
    let metadata = file.metadata()?;
    let mut header = tar::Header::new_gnu();
    header.set_size(metadata.len());
    header.set_mode(0o600);
    let modified = metadata.modified()?.duration_since(std::time::UNIX_EPOCH);
    header.set_mtime(modified.map_or(0, |since| since.as_secs()));
    archive.append_data(&mut header, name, file.take(metadata.len()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;
    use std::io::Read;

    #[test]
    fn all_is_there_but_what_lets_somebody_in() {
        let root = tempfile::tempdir().unwrap();
        let state = root.path().join("state");
        std::fs::create_dir_all(state.join("programs")).unwrap();
        let long = "x".repeat(150);
        for (name, text) in [
            ("journal.jsonl", "entries"),
            ("programs/a.ngc", "M2"),
            (&format!("programs/{long}.ngc"), "M30"),
            ("panel-tokens.json", "secret"),
            ("panel-key.pem", "secret"),
            ("tokens-of-mine", "secret"),
            ("programs/.arriving-1", "secret"),
        ] {
            std::fs::write(state.join(name), text).unwrap();
        }
        let machine = root.path().join("machine.toml");
        std::fs::write(&machine, "[machine]").unwrap();
        std::os::unix::fs::symlink(&machine, state.join("link")).unwrap();
        let wanted = Backup {
            folder: Some(state.clone()),
            files: vec![machine, root.path().join("none.tbl")],
            secret: vec![state.join("tokens-of-mine")],
        };
        let mut octets = Vec::new();
        write(&wanted, &mut octets).unwrap();
        let mut found = BTreeMap::new();
        for entry in tar::Archive::new(octets.as_slice()).entries().unwrap() {
            let mut entry = entry.unwrap();
            let mut text = String::new();
            entry.read_to_string(&mut text).unwrap();
            found.insert(entry.path().unwrap().display().to_string(), text);
        }
        let long = format!("state/programs/{long}.ngc");
        let wanted = [
            ("files/machine.toml", "[machine]"),
            ("state/journal.jsonl", "entries"),
            ("state/programs/a.ngc", "M2"),
            (long.as_str(), "M30"),
        ];
        let wanted: BTreeMap<_, _> = wanted
            .iter()
            .map(|(name, text)| ((*name).to_owned(), (*text).to_owned()))
            .collect();
        assert_eq!(found, wanted);
    }
}
