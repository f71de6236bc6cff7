//! Tokens: who may do what from elsewhere.
//!
//! In:  a file of the user of the control that nobody else may read; tokens as they are shown.
//! Out: the role of whoever shows one. Kept is the digest of each, so that the file gives none of them away; a token itself is shown
//! once, when it is made.

use protocol::Role;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::HashMap;
use std::fmt;
use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, Read, Write};
use std::net::IpAddr;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Octets of a token: 256 random bits.
const TOKEN_OCTETS: usize = 32;
/// Longest file of tokens, octets.
const FILE_MAX: u64 = 256 * 1024;
/// Tokens in a file.
const TOKENS_MAX: usize = 256;
/// Longest name of a token, octets.
pub(crate) const NAME_MAX: usize = 64;
/// Wrong tokens of one address before it has to wait.
pub(crate) const FAILURES_MAX: u32 = 5;
/// How long.
pub(crate) const PAUSE: Duration = Duration::from_secs(10);
/// Addresses of which failures are remembered.
const ADDRESSES_MAX: usize = 1024;

/// What is kept of a token.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Token {
    /// Whose it is: a device, a person.
    pub name: String,
    /// What whoever has it may do.
    pub role: Role,
    /// When it was made, s since 1970.
    pub made_unix_s: u64,
    /// SHA-256 of the token, hexadecimal.
    sha256: String,
}

/// Why a file of tokens is not used.
#[derive(Debug)]
pub struct FileError {
    path: PathBuf,
    what: String,
}

impl fmt::Display for FileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.path.display(), self.what)
    }
}

impl std::error::Error for FileError {}

#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Kept {
    tokens: Vec<Token>,
}

/// A file of tokens, mode 0600.
#[derive(Clone, Debug)]
pub struct TokenFile {
    path: PathBuf,
}

impl TokenFile {
    /// At this place, whether it is there or not.
    pub fn new(path: &Path) -> TokenFile {
        TokenFile { path: path.to_owned() }
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// All tokens; none where there is no file.
    ///
    /// # Errors
    /// Others may read or write it, it is another user's, or no file of tokens.
    pub fn read(&self) -> Result<Vec<Token>, FileError> {
        let failed = |what: String| FileError {
            path: self.path.clone(),
            what,
        };
        let file = match files::open(&self.path) {
            Ok(file) => file,
            Err(cause) if cause.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
            Err(cause) => return Err(failed(cause.to_string())),
        };
        let metadata = file.metadata().map_err(|cause| failed(cause.to_string()))?;
        let user = nix::unistd::geteuid().as_raw();
        if metadata.uid() != user && metadata.uid() != 0 {
            return Err(failed(format!(
                "belongs to user {}, so its tokens are not believed",
                metadata.uid()
            )));
        }
        if metadata.mode() & 0o077 != 0 {
            return Err(failed(
                "others may read or write it: chmod 600 it, and make new tokens".into(),
            ));
        }
        let mut octets = Vec::new();
        file.take(FILE_MAX + 1)
            .read_to_end(&mut octets)
            .map_err(|cause| failed(cause.to_string()))?;
        if octets.len() as u64 > FILE_MAX {
            return Err(failed(format!("is longer than {FILE_MAX} octets")));
        }
        let kept: Kept =
            serde_json::from_slice(&octets).map_err(|error| failed(format!("no file of tokens: {error}")))?;
        Ok(kept.tokens)
    }

    /// Makes a token and adds it; one of the same name goes. What is given back is shown to nobody again.
    ///
    /// # Errors
    /// As [`TokenFile::read`], of the file system, or a name that cannot be.
    pub fn add(&self, name: &str, role: Role) -> Result<String, FileError> {
        let failed = |what: String| FileError {
            path: self.path.clone(),
            what,
        };
        if name.is_empty() || name.len() > NAME_MAX || name.contains(char::is_control) {
            return Err(failed(format!("a name has 1 to {NAME_MAX} octets that can be printed")));
        }
        let mut tokens = self.read()?;
        tokens.retain(|token| token.name != name);
        if tokens.len() >= TOKENS_MAX {
            return Err(failed(format!("holds {TOKENS_MAX} tokens: revoke one first")));
        }
        let (secret, token) = make(name, role).map_err(|cause| failed(cause.to_string()))?;
        tokens.push(token);
        self.write(tokens)?;
        Ok(secret)
    }

    /// Takes a token away; false: there was none of this name.
    ///
    /// # Errors
    /// As [`TokenFile::read`], or of the file system.
    pub fn revoke(&self, name: &str) -> Result<bool, FileError> {
        let mut tokens = self.read()?;
        let before = tokens.len();
        tokens.retain(|token| token.name != name);
        let is_there = tokens.len() < before;
        if is_there {
            self.write(tokens)?;
        }
        Ok(is_there)
    }

    fn write(&self, tokens: Vec<Token>) -> Result<(), FileError> {
        let text = serde_json::to_string_pretty(&Kept { tokens }).unwrap_or_default();
        let new = self.path.with_extension(format!("new-{}", std::process::id()));
        let written = (|| {
            let mut file = OpenOptions::new().write(true).create_new(true).mode(0o600).open(&new)?;
            file.write_all(text.as_bytes())?;
            file.write_all(b"\n")?;
            file.sync_all()?;
            std::fs::rename(&new, &self.path)?;
            let folder = self.path.parent().filter(|folder| !folder.as_os_str().is_empty());
            File::open(folder.unwrap_or(Path::new(".")))?.sync_all()
        })();
        written.map_err(|cause: io::Error| {
            // What could not be written is of no use.
            let _ = std::fs::remove_file(&new);
            FileError {
                path: self.path.clone(),
                what: cause.to_string(),
            }
        })
    }
}

/// A new token, and what is kept of it.
fn make(name: &str, role: Role) -> io::Result<(String, Token)> {
    let mut octets = [0; TOKEN_OCTETS];
    getrandom::fill(&mut octets).map_err(|error| io::Error::other(error.to_string()))?;
    let secret = hex(&octets);
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    let token = Token {
        name: name.to_owned(),
        role,
        made_unix_s: since.map_or(0, |since| since.as_secs()),
        sha256: digest(&secret),
    };
    Ok((secret, token))
}

fn digest(secret: &str) -> String {
    hex(&Sha256::digest(secret))
}

pub(crate) fn hex(octets: &[u8]) -> String {
    octets.iter().map(|octet| format!("{octet:02x}")).collect()
}

#[derive(Debug, Default)]
struct Failures {
    count: u32,
    until: Option<Instant>,
}

/// All tokens that count for a control that runs.
#[derive(Debug, Default)]
pub struct Tokens {
    file: Option<TokenFile>,
    /// Those of this run alone.
    passing: Vec<Token>,
    failures: Mutex<HashMap<IpAddr, Failures>>,
}

/// Why somebody is not let in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Denied {
    /// No such token.
    Unknown,
    /// Too many wrong ones; so many seconds to wait.
    Pause(u64),
}

impl fmt::Display for Denied {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Denied::Unknown => {
                f.write_str("this token is not known, or was revoked: isocnc panel token makes a new one")
            }
            Denied::Pause(seconds) => write!(f, "too many wrong tokens from this address: wait {seconds} s"),
        }
    }
}

impl Tokens {
    /// Those of a file, which is read again at each login.
    pub fn of_file(file: TokenFile) -> Tokens {
        Tokens {
            file: Some(file),
            ..Tokens::default()
        }
    }

    /// Makes a token that counts as long as this lives, and is written nowhere.
    ///
    /// # Errors
    /// The system gives no random numbers.
    pub fn add_passing(&mut self, name: &str, role: Role) -> io::Result<String> {
        let (secret, token) = make(name, role)?;
        self.passing.push(token);
        Ok(secret)
    }

    /// Lets somebody in who shows a token.
    pub(crate) fn log_in(&self, secret: &str, from: IpAddr, now: Instant) -> Result<Token, Denied> {
        let mut failures = self.failures.lock().unwrap_or_else(PoisonError::into_inner);
        let before = failures.get(&of_host(from));
        let until = before.and_then(|failures| failures.until).filter(|until| *until > now);
        if let Some(until) = until {
            return Err(Denied::Pause(until.duration_since(now).as_secs() + 1));
        }
        // What is compared is no secret: how long it takes tells nothing of the token.
        let wanted = digest(secret);
        let found = self.all().into_iter().find(|token| token.sha256 == wanted);
        if let Some(token) = found {
            failures.remove(&of_host(from));
            return Ok(token);
        }
        if failures.len() >= ADDRESSES_MAX && !failures.contains_key(&of_host(from)) {
            failures.retain(|_, failures| failures.until.is_some_and(|until| until > now));
        }
        if failures.len() < ADDRESSES_MAX || failures.contains_key(&of_host(from)) {
            let failures = failures.entry(of_host(from)).or_default();
            failures.count += 1;
            if failures.count >= FAILURES_MAX {
                *failures = Failures {
                    count: 0,
                    until: Some(now + PAUSE),
                };
            }
        }
        Err(Denied::Unknown)
    }

    /// Whether a token that was let in still is.
    pub(crate) fn is_valid(&self, token: &Token) -> bool {
        self.all().contains(token)
    }

    fn all(&self) -> Vec<Token> {
        let mut all = self.passing.clone();
        if let Some(file) = &self.file {
            match file.read() {
                Ok(tokens) => all.extend(tokens),
                Err(error) => tracing::warn!(%error, "tokens are not believed"),
            }
        }
        all
    }
}

/// Whoever has one IPv6 address has 2^64 of them.
fn of_host(address: IpAddr) -> IpAddr {
    match address {
        IpAddr::V6(address) => match address.to_ipv4_mapped() {
            Some(address) => IpAddr::V4(address),
            None => IpAddr::V6((u128::from(address) >> 64 << 64).into()),
        },
        address => address,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    const HERE: IpAddr = IpAddr::V4(std::net::Ipv4Addr::LOCALHOST);

    fn file() -> (tempfile::TempDir, TokenFile) {
        let folder = tempfile::tempdir().unwrap();
        let file = TokenFile::new(&folder.path().join("panel-tokens.json"));
        (folder, file)
    }

    #[test]
    fn a_token_is_shown_once_and_kept_as_a_digest_that_only_its_user_reads() {
        let (_folder, file) = file();
        let secret = file.add("tablet", Role::Operate).unwrap();
        assert_eq!(secret.len(), 64);
        let text = std::fs::read_to_string(file.path()).unwrap();
        assert!(!text.contains(&secret), "{text}");
        assert_eq!(std::fs::metadata(file.path()).unwrap().mode() & 0o777, 0o600);
        let tokens = Tokens::of_file(file.clone());
        let now = Instant::now();
        let token = tokens.log_in(&secret, HERE, now).unwrap();
        assert_eq!((token.name.as_str(), token.role), ("tablet", Role::Operate));
        // Another of the same name is another one, and the first is gone.
        let other = file.add("tablet", Role::Watch).unwrap();
        assert_eq!(tokens.log_in(&secret, HERE, now), Err(Denied::Unknown));
        assert!(!tokens.is_valid(&token));
        assert_eq!(tokens.log_in(&other, HERE, now).unwrap().role, Role::Watch);
        assert!(file.revoke("tablet").unwrap() && !file.revoke("tablet").unwrap());
        assert_eq!(tokens.log_in(&other, HERE, now), Err(Denied::Unknown));
        assert!(file.add("", Role::Watch).is_err() && file.add("a\nb", Role::Watch).is_err());
    }

    #[test]
    fn a_file_that_others_may_read_is_not_believed() {
        let (_folder, file) = file();
        let secret = file.add("tablet", Role::SetUp).unwrap();
        std::fs::set_permissions(file.path(), std::fs::Permissions::from_mode(0o640)).unwrap();
        assert!(file.read().unwrap_err().to_string().contains("others may read"));
        let tokens = Tokens::of_file(file.clone());
        assert_eq!(tokens.log_in(&secret, HERE, Instant::now()), Err(Denied::Unknown));
        std::fs::set_permissions(file.path(), std::fs::Permissions::from_mode(0o600)).unwrap();
        std::fs::write(file.path(), "{\"tokens\":5}").unwrap();
        assert!(file.read().unwrap_err().to_string().contains("no file of tokens"));
        std::fs::write(file.path(), vec![b' '; FILE_MAX as usize + 1]).unwrap();
        assert!(file.read().unwrap_err().to_string().contains("longer than"));
    }

    #[test]
    fn five_wrong_ones_make_an_address_wait_even_with_the_right_one() {
        let mut tokens = Tokens::default();
        let secret = tokens.add_passing("this run", Role::SetUp).unwrap();
        let begin = Instant::now();
        for _ in 0..FAILURES_MAX {
            assert_eq!(tokens.log_in("x", HERE, begin), Err(Denied::Unknown));
        }
        assert_eq!(tokens.log_in(&secret, HERE, begin), Err(Denied::Pause(11)));
        let other = "192.0.2.7".parse().unwrap();
        assert!(tokens.log_in(&secret, other, begin).is_ok());
        assert!(tokens.log_in(&secret, HERE, begin + PAUSE).is_ok());
        // Four, and then the right one: forgiven.
        for _ in 0..2 {
            for _ in 1..FAILURES_MAX {
                assert_eq!(tokens.log_in("x", HERE, begin + PAUSE), Err(Denied::Unknown));
            }
            assert!(tokens.log_in(&secret, HERE, begin + PAUSE).is_ok());
        }
    }

    #[test]
    fn all_addresses_of_a_host_are_one() {
        let of = |text: &str| of_host(text.parse().unwrap());
        assert_eq!(of("2001:db8::1"), of("2001:db8::ffff"));
        assert_ne!(of("2001:db8:0:1::1"), of("2001:db8::1"));
        assert_eq!(of("::ffff:192.0.2.1"), of("192.0.2.1"));
    }
}
