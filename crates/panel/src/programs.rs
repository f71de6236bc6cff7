//! `/files/`: the folder of programs.
//!
//! In:  uploads of whatever octets. Out: files that have passed the check of the control; whole or in ranges.
//!
//! A name is one component; links are not followed; the folder is opened once. What arrives goes to a file of its own, and takes its
//! name only once it is whole, on the disk, and checked. Nothing starts by its arrival. A body that is compressed is refused: nothing
//! is ever unpacked here.

use crate::ask::{ask, connect};
use crate::guard::{Visitor, answer, refuse};
use crate::serve::Panel;
use crate::tokens::hex;
use axum::Extension;
use axum::body::{Body, Bytes};
use axum::extract::{Path, Request, State};
use axum::http::header::{
    ACCEPT_RANGES, CACHE_CONTROL, CONTENT_ENCODING, CONTENT_LENGTH, CONTENT_RANGE, CONTENT_TYPE, RANGE,
};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode};
use axum::response::{IntoResponse, Response};
use files::arrivals::makes_room;
use files::is_name;
use files::read::PROGRAM_MAX;
use futures_util::{StreamExt, stream};
use nix::errno::Errno;
use nix::fcntl::{AtFlags, OFlag, RenameFlags, openat, renameat2};
use nix::sys::stat::{Mode, SFlag, fstatat};
use nix::sys::statvfs::fstatvfs;
use nix::unistd::{UnlinkatFlags, unlinkat};
use percent_encoding::percent_decode_str;
use protocol::{Role, method, params};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use std::collections::HashMap;
use std::fs::File;
use std::io::{self, Write};
use std::os::fd::AsFd;
use std::os::unix::fs::{FileExt, MetadataExt};
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::Notify;
use tokio::task::spawn_blocking;
use tokio::time::timeout;

/// Files that arrive at the same time; one that is slow makes room for another.
const ARRIVING_MAX: usize = 4;
/// A client that sends nothing is waited for so long.
const CHUNK_WAIT: Duration = Duration::from_secs(30);
/// What stays free on the disk, octets.
const RESERVE: u64 = 64 << 20;
/// Files in a list.
const LIST_MAX: usize = 10_000;
/// Octets whose digest is computed for one list: those of files that came another way.
const DIGEST_MAX: u64 = 64 << 20;
/// Octets read at once.
const CHUNK: u64 = 64 * 1024;
/// The method that renames (RFC 4918), which `http` has no name for.
const MOVE: &str = "MOVE";
/// Files that are on their way begin so.
const ARRIVING: &str = ".arriving-";

/// What is known of a file as it was: its number, size, and time of its last change.
type Version = (u64, u64, i64, i64);

/// A file on its way.
#[derive(Debug)]
struct Arrival {
    number: u64,
    begun: Instant,
    octets: u64,
    /// Told where it has to make room for another one.
    makes_room: Arc<Notify>,
}

/// The folder.
#[derive(Debug)]
pub(crate) struct Programs {
    path: PathBuf,
    folder: File,
    arriving: Mutex<Vec<Arrival>>,
    number: AtomicU64,
    digests: Mutex<HashMap<String, (Version, String)>>,
}

impl Programs {
    /// Makes the folder where it is missing, and takes away what never arrived.
    pub(crate) fn open(path: PathBuf) -> io::Result<Programs> {
        files::make_folder(&path)?;
        let folder = File::open(&path)?;
        for entry in std::fs::read_dir(&path)?.flatten() {
            if entry
                .file_name()
                .to_str()
                .is_some_and(|name| name.starts_with(ARRIVING))
            {
                // Another control of this folder may do so as well.
                let _ = std::fs::remove_file(entry.path());
            }
        }
        Ok(Programs {
            path,
            folder,
            arriving: Mutex::default(),
            number: AtomicU64::new(0),
            digests: Mutex::default(),
        })
    }

    fn arriving(&self) -> MutexGuard<'_, Vec<Arrival>> {
        self.arriving.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn open_file(&self, name: &str) -> Result<File, Errno> {
        // Without O_NONBLOCK this would wait for a writer of a pipe.
        let flags = OFlag::O_RDONLY | OFlag::O_NOFOLLOW | OFlag::O_CLOEXEC | OFlag::O_NONBLOCK;
        let file = File::from(openat(self.folder.as_fd(), name, flags, Mode::empty())?);
        match file.metadata() {
            Ok(metadata) if metadata.is_file() => Ok(file),
            _ => Err(Errno::EINVAL),
        }
    }

    /// Whether something has this name.
    fn has(&self, name: &str) -> bool {
        fstatat(self.folder.as_fd(), name, AtFlags::AT_SYMLINK_NOFOLLOW).is_ok()
    }

    fn free(&self) -> u64 {
        // A file system that does not tell is taken to have room.
        let free = fstatvfs(&self.folder).map(|disk| disk.blocks_available().saturating_mul(disk.fragment_size()));
        free.unwrap_or(u64::MAX).saturating_sub(RESERVE)
    }

    fn list(&self) -> io::Result<Value> {
        let mut list = Vec::new();
        let mut digest_left = DIGEST_MAX;
        for entry in std::fs::read_dir(&self.path)?.flatten().take(LIST_MAX) {
            let name = entry.file_name();
            let Some(name) = name.to_str().filter(|name| is_name(name)) else {
                continue;
            };
            let Ok(file) = self.open_file(name) else { continue };
            let Ok(metadata) = file.metadata() else { continue };
            let version = (metadata.ino(), metadata.len(), metadata.mtime(), metadata.mtime_nsec());
            let known = lock(&self.digests)
                .get(name)
                .filter(|(of, _)| *of == version)
                .map(|(_, digest)| digest.clone());
            let digest = match known {
                None if metadata.len() <= digest_left => {
                    digest_left -= metadata.len();
                    let digest = digest(&file, metadata.len()).ok();
                    if let Some(digest) = &digest {
                        lock(&self.digests).insert(name.to_owned(), (version, digest.clone()));
                    }
                    digest
                }
                known => known,
            };
            let modified = metadata.mtime() as f64 + metadata.mtime_nsec() as f64 * 1e-9;
            list.push(json!({ "name": name, "octets": metadata.len(), "modified_unix_s": modified, "sha256": digest }));
        }
        list.sort_by(|one, other| one["name"].as_str().cmp(&other["name"].as_str()));
        Ok(json!({ "files": list, "free_octets": self.free(), "octets_max": PROGRAM_MAX }))
    }
}

fn lock<T>(of: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

fn digest(file: &File, octets: u64) -> io::Result<String> {
    let mut hash = Sha256::new();
    let mut chunk = vec![0; CHUNK as usize];
    let mut at = 0;
    while at < octets {
        match file.read_at(&mut chunk, at)? {
            0 => break,
            count => {
                hash.update(&chunk[..count]);
                at += count as u64;
            }
        }
    }
    Ok(hex(&hash.finalize()))
}

/// The part of a file that a `Range` asks for: first octet and how many. `Ok(None)`: all of it; an error: there is no such part.
pub(crate) fn range(text: Option<&str>, octets: u64) -> Result<Option<(u64, u64)>, ()> {
    // Several parts at once, or another unit: the whole is an answer, too.
    let Some((first, last)) = text
        .and_then(|text| text.trim().strip_prefix("bytes="))
        .and_then(|text| text.split_once('-'))
    else {
        return Ok(None);
    };
    let number = |text: &str| match text.bytes().all(|digit| digit.is_ascii_digit()) {
        true => text.parse::<u64>().ok(),
        false => None,
    };
    match (number(first), number(last)) {
        _ if first.is_empty() && last.is_empty() => Ok(None),
        (Some(first), _) if last.is_empty() => match first < octets {
            true => Ok(Some((first, octets - first))),
            false => Err(()),
        },
        (_, Some(count)) if first.is_empty() => match count.min(octets) {
            0 => Err(()),
            count => Ok(Some((octets - count, count))),
        },
        (Some(first), Some(last)) if first <= last => match first < octets {
            true => Ok(Some((first, last.min(octets - 1) - first + 1))),
            false => Err(()),
        },
        _ => Ok(None),
    }
}

/// Why a file is not taken or given.
struct Refusal(StatusCode, String);

impl From<io::Error> for Refusal {
    fn from(cause: io::Error) -> Refusal {
        match cause.raw_os_error().map(Errno::from_raw) {
            Some(Errno::ENOSPC | Errno::EDQUOT | Errno::EFBIG) => {
                Refusal(StatusCode::INSUFFICIENT_STORAGE, format!("the disk is full: {cause}"))
            }
            Some(Errno::ENOENT) => Refusal(StatusCode::NOT_FOUND, "there is no such file".into()),
            Some(Errno::ELOOP | Errno::EINVAL) => Refusal(
                StatusCode::FORBIDDEN,
                "this is no file, and links are not followed here".into(),
            ),
            _ => Refusal(StatusCode::INTERNAL_SERVER_ERROR, cause.to_string()),
        }
    }
}

impl From<Errno> for Refusal {
    fn from(errno: Errno) -> Refusal {
        io::Error::from(errno).into()
    }
}

impl IntoResponse for Refusal {
    fn into_response(self) -> Response {
        refuse(self.0, self.1)
    }
}

/// In a thread that may wait for the disk.
async fn on_disk<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, Refusal> {
    let ended = |_| Refusal(StatusCode::INTERNAL_SERVER_ERROR, "the control is ending".into());
    spawn_blocking(work).await.map_err(ended)
}

fn folder(panel: &Panel) -> Result<Arc<Programs>, Refusal> {
    let none =
        "there is no folder of programs: programs of [panel] in the machine file names one, or its state_directory";
    panel
        .programs
        .clone()
        .ok_or_else(|| Refusal(StatusCode::NOT_FOUND, none.into()))
}

/// The list.
pub(crate) async fn list(
    State(panel): State<Arc<Panel>>,
    Extension(visitor): Extension<Visitor>,
    method: Method,
) -> Response {
    if let Err(refusal) = visitor.permit(Role::Watch) {
        return *refusal;
    }
    if method != Method::GET {
        return refuse(
            StatusCode::METHOD_NOT_ALLOWED,
            "the list of programs can be read; a program is sent to /files/NAME",
        );
    }
    let listed = async {
        let programs = folder(&panel)?;
        Ok::<_, Refusal>(on_disk(move || programs.list()).await??)
    };
    match listed.await {
        Ok(list) => answer(StatusCode::OK, &list),
        Err(refusal) => refusal.into_response(),
    }
}

/// One program.
pub(crate) async fn one(
    State(panel): State<Arc<Panel>>,
    Extension(visitor): Extension<Visitor>,
    Path(name): Path<String>,
    request: Request,
) -> Response {
    let method = request.method().clone();
    let needed = match method {
        Method::GET | Method::HEAD => Role::Watch,
        _ => Role::Operate,
    };
    if let Err(refusal) = visitor.permit(needed) {
        return *refusal;
    }
    if !is_name(&name) {
        let why = "a name is one word of up to 200 octets, without a folder and not beginning with a dot";
        return refuse(StatusCode::BAD_REQUEST, why);
    }
    let programs = match folder(&panel) {
        Ok(programs) => programs,
        Err(refusal) => return refusal.into_response(),
    };
    let done = match method {
        Method::GET | Method::HEAD => give(programs, name, request.headers()).await,
        Method::PUT | Method::POST => receive(&panel, &visitor, programs, name, request).await,
        _ if method.as_str() == MOVE => rename(programs, name, request.headers()).await,
        Method::DELETE => on_disk(move || unlinkat(programs.folder.as_fd(), name.as_str(), UnlinkatFlags::NoRemoveDir))
            .await
            .and_then(|removed| Ok(removed?))
            .map(|()| StatusCode::NO_CONTENT.into_response()),
        _ => Err(Refusal(
            StatusCode::METHOD_NOT_ALLOWED,
            "a program is read by GET, sent by PUT, renamed by MOVE, removed by DELETE".into(),
        )),
    };
    done.unwrap_or_else(IntoResponse::into_response)
}

/// There is a file of this name, which was not to be replaced.
fn taken(name: &str) -> Refusal {
    let why = format!(
        "there is a program {name} already: send it under another name, or without If-None-Match to replace it"
    );
    Refusal(StatusCode::PRECONDITION_FAILED, why)
}

/// Gives a program the name of the header Destination, percent-encoded, that no other one has.
async fn rename(programs: Arc<Programs>, name: String, headers: &HeaderMap) -> Result<Response, Refusal> {
    let to = header(headers, "destination").map(|to| percent_decode_str(to).decode_utf8());
    let Some(Ok(to)) = to.filter(|to| to.as_deref().is_ok_and(is_name)) else {
        let why = "the header Destination is missing or no name: the new name alone, percent-encoded";
        return Err(Refusal(StatusCode::BAD_REQUEST, why.into()));
    };
    let to = to.into_owned();
    let renamed = on_disk(move || {
        let folder = programs.folder.as_fd();
        // Also of what is no program: a link, a folder.
        programs.open_file(&name)?;
        match renameat2(
            folder,
            name.as_str(),
            folder,
            to.as_str(),
            RenameFlags::RENAME_NOREPLACE,
        ) {
            Err(Errno::EEXIST) => return Err(taken(&to)),
            renamed => renamed?,
        }
        Ok(programs.folder.sync_all()?)
    });
    renamed.await??;
    Ok(StatusCode::NO_CONTENT.into_response())
}

async fn give(programs: Arc<Programs>, name: String, headers: &HeaderMap) -> Result<Response, Refusal> {
    let opened = on_disk(move || {
        let file = programs.open_file(&name)?;
        let octets = file.metadata().map(|metadata| metadata.len()).unwrap_or(0);
        Ok::<_, Errno>((file, octets))
    });
    let (file, octets) = opened.await??;
    let asked = range(headers.get(RANGE).and_then(|text| text.to_str().ok()), octets);
    let Ok(part) = asked else {
        let mut refusal = refuse(
            StatusCode::RANGE_NOT_SATISFIABLE,
            format!("the file has {octets} octets"),
        );
        if let Ok(value) = HeaderValue::from_str(&format!("bytes */{octets}")) {
            refusal.headers_mut().insert(CONTENT_RANGE, value);
        }
        return Ok(refusal);
    };
    let (first, count) = part.unwrap_or((0, octets));
    let chunks = stream::unfold(Some((Arc::new(file), first, count)), |state| async {
        let (file, at, left) = state?;
        if left == 0 {
            return None;
        }
        let reading = Arc::clone(&file);
        let read = spawn_blocking(move || {
            let mut chunk = vec![0; left.min(CHUNK) as usize];
            let count = reading.read_at(&mut chunk, at)?;
            chunk.truncate(count);
            // Its length was told: an end that comes too soon must not look like the end.
            if count == 0 {
                Err(io::Error::from(io::ErrorKind::UnexpectedEof))
            } else {
                Ok(Bytes::from(chunk))
            }
        });
        match read
            .await
            .unwrap_or_else(|_| Err(io::Error::other("the control is ending")))
        {
            Ok(chunk) => {
                let count = chunk.len() as u64;
                Some((Ok(chunk), Some((file, at + count, left - count))))
            }
            Err(cause) => Some((Err(cause), None)),
        }
    });
    let mut response = Body::from_stream(chunks).into_response();
    if part.is_some() {
        *response.status_mut() = StatusCode::PARTIAL_CONTENT;
        if let Ok(value) = HeaderValue::from_str(&format!("bytes {first}-{}/{octets}", first + count - 1)) {
            response.headers_mut().insert(CONTENT_RANGE, value);
        }
    }
    let headers = response.headers_mut();
    headers.insert(CONTENT_LENGTH, HeaderValue::from(count));
    // Whatever is in it, a browser takes it for text and nothing else.
    headers.insert(CONTENT_TYPE, HeaderValue::from_static("text/plain; charset=utf-8"));
    headers.insert(ACCEPT_RANGES, HeaderValue::from_static("bytes"));
    headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    Ok(response)
}

/// A file that arrives; goes with this unless it has its name. What is under way at the disk holds it, too: a client that goes
/// meanwhile leaves nothing behind.
struct Arriving {
    programs: Arc<Programs>,
    number: u64,
    name: String,
    makes_room: Arc<Notify>,
}

impl Arriving {
    /// Takes a place; where there is none, one that is slow makes room.
    fn begin(programs: &Arc<Programs>) -> Result<Arriving, Refusal> {
        let mut all = programs.arriving();
        if all.len() >= ARRIVING_MAX {
            let slow = makes_room(all.iter().map(|arrival| (arrival.begun.elapsed(), arrival.octets)));
            let Some(slow) = slow else {
                return Err(Refusal(
                    StatusCode::TOO_MANY_REQUESTS,
                    format!("{ARRIVING_MAX} programs arrive already: try again in a few seconds"),
                ));
            };
            all.remove(slow).makes_room.notify_one();
        }
        let number = programs.number.fetch_add(1, Relaxed);
        let makes_room = Arc::<Notify>::default();
        all.push(Arrival {
            number,
            begun: Instant::now(),
            octets: 0,
            makes_room: Arc::clone(&makes_room),
        });
        Ok(Arriving {
            programs: Arc::clone(programs),
            number,
            name: format!("{ARRIVING}{}-{number}", std::process::id()),
            makes_room,
        })
    }

    /// So many octets have come in all.
    fn has(&self, octets: u64) {
        if let Some(arrival) = (self.programs.arriving().iter_mut()).find(|arrival| arrival.number == self.number) {
            arrival.octets = octets;
        }
    }
}

impl Drop for Arriving {
    fn drop(&mut self) {
        self.programs.arriving().retain(|arrival| arrival.number != self.number);
        // Gone already where it has taken its name.
        let _ = unlinkat(
            self.programs.folder.as_fd(),
            self.name.as_str(),
            UnlinkatFlags::NoRemoveDir,
        );
    }
}

fn header<'h>(headers: &'h HeaderMap, name: &str) -> Option<&'h str> {
    headers.get(name).map(|value| value.to_str().unwrap_or("?").trim())
}

fn too_long() -> String {
    format!("a program has up to {PROGRAM_MAX} octets")
}

/// Whether a program can be taken, as far as its headers say.
fn can_be_taken(headers: &HeaderMap, programs: &Programs) -> Result<(), Refusal> {
    if headers
        .get(CONTENT_ENCODING)
        .is_some_and(|encoding| encoding != "identity")
    {
        return Err(Refusal(
            StatusCode::UNSUPPORTED_MEDIA_TYPE,
            "a compressed body is not taken: send the program as it is".into(),
        ));
    }
    let length = header(headers, CONTENT_LENGTH.as_str()).and_then(|length| length.parse::<u64>().ok());
    let octets = length.unwrap_or(0);
    if octets > PROGRAM_MAX {
        return Err(Refusal(StatusCode::PAYLOAD_TOO_LARGE, too_long()));
    }
    let free = programs.free();
    if octets > free {
        return Err(Refusal(
            StatusCode::INSUFFICIENT_STORAGE,
            format!("the disk is full: {free} octets are free for programs"),
        ));
    }
    Ok(())
}

async fn receive(
    panel: &Panel,
    visitor: &Visitor,
    programs: Arc<Programs>,
    name: String,
    request: Request,
) -> Result<Response, Refusal> {
    let refused = |status, why: String| Err(Refusal(status, why));
    let headers = request.headers();
    can_be_taken(headers, &programs)?;
    let is_new = header(headers, "if-none-match") == Some("*");
    if is_new && programs.has(&name) {
        return Err(taken(&name));
    }
    let wanted = header(headers, "x-sha256").map(str::to_ascii_lowercase);
    let arriving = Arc::new(Arriving::begin(&programs)?);
    let making = Arc::clone(&arriving);
    let flags = OFlag::O_WRONLY | OFlag::O_CREAT | OFlag::O_EXCL | OFlag::O_NOFOLLOW | OFlag::O_CLOEXEC;
    let made = on_disk(move || {
        openat(
            making.programs.folder.as_fd(),
            making.name.as_str(),
            flags,
            Mode::from_bits_truncate(0o600),
        )
    });
    let mut file = File::from(made.await??);
    let (mut hash, mut octets) = (Sha256::new(), 0);
    let mut body = request.into_body().into_data_stream();
    loop {
        let next = tokio::select! {
            next = timeout(CHUNK_WAIT, body.next()) => next,
            () = arriving.makes_room.notified() => {
                let why = "it came slowly, and another program needed the place: send it again";
                return refused(StatusCode::REQUEST_TIMEOUT, why.into());
            }
        };
        let chunk = match next {
            Err(_) => {
                return refused(
                    StatusCode::REQUEST_TIMEOUT,
                    "nothing came for 30 s: the program is given up".into(),
                );
            }
            Ok(None) => break,
            Ok(Some(Err(cause))) => {
                return refused(StatusCode::BAD_REQUEST, format!("the program did not arrive: {cause}"));
            }
            Ok(Some(Ok(chunk))) => chunk,
        };
        octets += chunk.len() as u64;
        arriving.has(octets);
        if octets > PROGRAM_MAX {
            return refused(StatusCode::PAYLOAD_TOO_LARGE, too_long());
        }
        let written = on_disk(move || {
            file.write_all(&chunk)?;
            hash.update(&chunk);
            Ok::<_, io::Error>((file, hash))
        });
        (file, hash) = written.await??;
    }
    let digest = hex(&hash.finalize());
    if wanted.is_some_and(|wanted| wanted != digest) {
        return refused(
            StatusCode::UNPROCESSABLE_ENTITY,
            "its SHA-256 is another one: it was changed on its way".into(),
        );
    }
    on_disk(move || file.sync_all()).await??;
    let path = programs.path.join(&arriving.name);
    let path = std::path::absolute(&path).unwrap_or(path);
    let checked = async {
        // Whoever may send a program may have it checked; by its path as it has no name yet.
        let mut client = connect(panel, Role::SetUp, &visitor.name())?;
        let program = params::Program {
            path: Some(path.display().to_string()),
            ..Default::default()
        };
        ask::<method::ProgramCheck>(&mut client, &program).await
    };
    let own = path.display().to_string();
    let outlook = checked
        .await
        .map_err(|why| Refusal(StatusCode::UNPROCESSABLE_ENTITY, why.replace(&own, &name)))?;
    let (renaming, to) = (Arc::clone(&arriving), name.clone());
    let renamed = on_disk(move || {
        let folder = renaming.programs.folder.as_fd();
        // A link in its place is replaced, a folder is not.
        if let Ok(found) = fstatat(folder, to.as_str(), AtFlags::AT_SYMLINK_NOFOLLOW)
            && SFlag::from_bits_truncate(found.st_mode & SFlag::S_IFMT.bits()) == SFlag::S_IFDIR
        {
            return Err(io::Error::from(Errno::EISDIR));
        }
        let how = if is_new {
            RenameFlags::RENAME_NOREPLACE
        } else {
            RenameFlags::empty()
        };
        renameat2(folder, renaming.name.as_str(), folder, to.as_str(), how)?;
        renaming.programs.folder.sync_all()
    });
    match renamed.await? {
        Err(cause) if is_new && cause.raw_os_error() == Some(Errno::EEXIST as i32) => return Err(taken(&name)),
        renamed => renamed?,
    }
    tracing::info!(%name, octets, "a program has arrived");
    let told = json!({
        "name": name,
        "octets": octets,
        "sha256": digest,
        "lines": outlook.lines,
        "planned_time_s": outlook.planned_time_s,
        "warning": outlook.warning,
    });
    Ok(answer(StatusCode::CREATED, &told))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn ranges_are_those_of_rfc_9110() {
        let of = |text| range(Some(text), 100);
        assert_eq!(range(None, 100), Ok(None));
        assert_eq!(of("bytes=0-9"), Ok(Some((0, 10))));
        assert_eq!(of("bytes=90-"), Ok(Some((90, 10))));
        assert_eq!(of("bytes=90-500"), Ok(Some((90, 10))));
        assert_eq!(of("bytes=-7"), Ok(Some((93, 7))));
        assert_eq!(of("bytes=-700"), Ok(Some((0, 100))));
        for none in ["bytes=100-", "bytes=100-200", "bytes=-0"] {
            assert_eq!(of(none), Err(()), "{none}");
        }
        for whole in [
            "bytes=5-2",
            "bytes=1-2,4-5",
            "lines=1-2",
            "bytes=x-",
            "bytes=-",
            "bytes=+1-2",
        ] {
            assert_eq!(of(whole), Ok(None), "{whole}");
        }
    }

    proptest! {
        #[test]
        fn a_range_lies_within_the_file(text in "bytes=[-0-9,a]{0,24}|\\PC*", octets in 0_u64..1000) {
            if let Ok(Some((first, count))) = range(Some(&text), octets) {
                prop_assert!(count > 0 && first + count <= octets, "{first} {count}");
            }
        }
    }

    #[test]
    fn a_list_has_files_and_neither_links_nor_pipes_nor_what_arrives() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("programs");
        std::fs::create_dir(&path).unwrap();
        std::fs::write(path.join(".arriving-1-0"), "x").unwrap();
        let programs = Programs::open(path.clone()).unwrap();
        assert!(!path.join(".arriving-1-0").exists());
        std::fs::write(path.join("b.ngc"), "abc").unwrap();
        std::fs::write(path.join("a.ngc"), "").unwrap();
        std::fs::write(root.path().join("secret"), "s").unwrap();
        std::os::unix::fs::symlink(root.path().join("secret"), path.join("link.ngc")).unwrap();
        nix::unistd::mkfifo(&path.join("pipe.ngc"), Mode::S_IRWXU).unwrap();
        std::fs::create_dir(path.join("folder")).unwrap();
        let list = programs.list().unwrap();
        let names: Vec<&str> = list["files"]
            .as_array()
            .unwrap()
            .iter()
            .map(|file| file["name"].as_str().unwrap())
            .collect();
        assert_eq!(names, ["a.ngc", "b.ngc"]);
        // Of FIPS 180-4.
        let abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(
            (&list["files"][1]["sha256"], &list["files"][1]["octets"]),
            (&json!(abc), &json!(3))
        );
        assert!(programs.open_file("link.ngc").is_err() && programs.open_file("pipe.ngc").is_err());
    }
}
