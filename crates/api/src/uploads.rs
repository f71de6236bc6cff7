//! Programs that come over the socket in parts, of any size that a program may have.
//!
//! In:  a name and a size, then octets in their order, then the sum of what was sent. Out: a text to check and to run.
//!
//! Each lies in a temporary file without a name, whose whole length is claimed at the beginning: a full disk is told before
//! anything is sent. It goes with the client that sends it, or once nothing has come for a minute.

use super::rpc::{RpcError, code};
use super::server::ClientId;
use files::arrivals::makes_room;
use files::read::PROGRAM_MAX;
use nix::errno::Errno;
use nix::fcntl::{FallocateFlags, fallocate};
use program::text::{Text, temporary_file};
use sha2::{Digest, Sha256};
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::sync::Arc;
use std::time::Duration;

/// Octets of a name.
pub const NAME_MAX: usize = 4096;
/// Programs that are coming, of all clients.
const COUNT_MAX: usize = 4;
/// Octets of all of them.
const TOTAL_MAX: u64 = 2 * PROGRAM_MAX;
/// Nothing has come for so long, s.
const IDLE_S: u64 = 60;

/// A program that has come as a whole.
#[derive(Clone, Debug)]
pub struct Uploaded {
    /// For messages, and for where its subroutines may lie.
    pub name: String,
    /// What was sent.
    pub text: Arc<Text>,
}

impl PartialEq for Uploaded {
    fn eq(&self, other: &Uploaded) -> bool {
        Arc::ptr_eq(&self.text, &other.text)
    }
}

impl Eq for Uploaded {}

#[derive(Debug)]
struct Upload {
    number: u64,
    client: ClientId,
    name: String,
    octets: u64,
    content: Content,
    begun_ns: u64,
    heard_ns: u64,
}

#[derive(Debug)]
enum Content {
    Coming { file: File, received: u64, sum: Sha256 },
    Whole(Arc<Text>),
}

/// Programs that are coming, or have come and are not run yet.
#[derive(Debug, Default)]
pub struct Uploads {
    all: Vec<Upload>,
    last: u64,
}

fn invalid(what: String) -> RpcError {
    RpcError::new(code::INVALID_PARAMS, what)
}

impl Uploads {
    /// Makes room for a program; gives its number.
    ///
    /// # Errors
    /// It is too large, there are too many, or the disk is full.
    pub fn begin(&mut self, client: ClientId, name: &str, octets: u64, now_ns: u64) -> Result<u64, RpcError> {
        self.forget_idle(now_ns);
        if name.is_empty() || name.len() > NAME_MAX || name.contains(char::is_control) {
            let what = format!("parameter \"name\": expected one to {NAME_MAX} octets that can be printed");
            return Err(invalid(what));
        }
        let limit = |what: String| Err(RpcError::new(code::REFUSED, what));
        if octets > PROGRAM_MAX {
            return limit(format!("{octets} octets: a program has {PROGRAM_MAX} at the most"));
        }
        if self.all.len() >= COUNT_MAX && !self.make_room(now_ns) {
            return limit(format!(
                "{COUNT_MAX} programs are being uploaded already: try again in a few seconds"
            ));
        }
        let held: u64 = self.all.iter().map(|upload| upload.octets).sum();
        if held + octets > TOTAL_MAX {
            return limit(format!(
                "{octets} octets: with those that are being uploaded, more than {TOTAL_MAX}"
            ));
        }
        let failed =
            |cause: std::io::Error| RpcError::new(code::REFUSED, format!("no room for {octets} octets: {cause}"));
        let file = temporary_file().map_err(failed)?;
        match fallocate(&file, FallocateFlags::empty(), 0, octets as i64) {
            // Nothing to claim, or a file system that cannot: it is told of when a part is written.
            Ok(()) | Err(Errno::EINVAL | Errno::EOPNOTSUPP | Errno::ENOSYS) => {}
            Err(errno) => return Err(failed(errno.into())),
        }
        self.last += 1;
        self.all.push(Upload {
            number: self.last,
            client,
            name: name.to_owned(),
            octets,
            content: Content::Coming {
                file,
                received: 0,
                sum: Sha256::new(),
            },
            begun_ns: now_ns,
            heard_ns: now_ns,
        });
        Ok(self.last)
    }

    /// Takes the next part; gives how many octets have come.
    ///
    /// # Errors
    /// It is not the next part, is too long, or cannot be written: then the upload is given up.
    pub fn append(
        &mut self,
        client: ClientId,
        number: u64,
        at: u64,
        part: &[u8],
        now_ns: u64,
    ) -> Result<u64, RpcError> {
        let upload = self.of(client, number)?;
        upload.heard_ns = now_ns;
        let Content::Coming { file, received, sum } = &mut upload.content else {
            return Err(invalid(format!("upload {number} has come as a whole already")));
        };
        if at != *received {
            let what = format!("parameter \"at\": expected {received}, the octets that have come, got {at}");
            return Err(invalid(what));
        }
        if upload.octets - at < part.len() as u64 {
            return Err(invalid(format!(
                "more than the {} octets that were announced",
                upload.octets
            )));
        }
        match file.write_all_at(part, at) {
            Ok(()) => {
                sum.update(part);
                *received += part.len() as u64;
                Ok(*received)
            }
            Err(cause) => {
                self.all.retain(|upload| upload.number != number);
                Err(RpcError::new(code::REFUSED, format!("the upload is given up: {cause}")))
            }
        }
    }

    /// All has come, and this is its SHA-256.
    ///
    /// # Errors
    /// Something is missing, or it is not what was sent: then the upload is given up.
    pub fn commit(&mut self, client: ClientId, number: u64, sha256: &[u8], now_ns: u64) -> Result<(), RpcError> {
        let upload = self.of(client, number)?;
        upload.heard_ns = now_ns;
        let Content::Coming { file, received, sum } = &mut upload.content else {
            return Ok(());
        };
        if *received != upload.octets {
            let what = format!("{received} of {} octets have come", upload.octets);
            return Err(invalid(what));
        }
        if sum.clone().finalize()[..] != *sha256 {
            self.all.retain(|upload| upload.number != number);
            return Err(invalid(
                "parameter \"sha256\": is not that of what has come; the upload is given up".into(),
            ));
        }
        let failed = |cause: std::io::Error| RpcError::new(code::REFUSED, cause.to_string());
        let text = Text::from(file.try_clone().map_err(failed)?);
        upload.content = Content::Whole(Arc::new(text));
        Ok(())
    }

    /// A program that has come as a whole, to be run or loaded; the client may ask for it again.
    ///
    /// # Errors
    /// It has not.
    pub fn whole(&mut self, client: ClientId, number: u64, now_ns: u64) -> Result<Uploaded, RpcError> {
        let upload = self.of(client, number)?;
        upload.heard_ns = now_ns;
        match &upload.content {
            Content::Whole(text) => Ok(Uploaded {
                name: upload.name.clone(),
                text: Arc::clone(text),
            }),
            Content::Coming { .. } => Err(invalid(format!("upload {number} is not committed"))),
        }
    }

    /// A slow one goes; whether there is one.
    fn make_room(&mut self, now_ns: u64) -> bool {
        let arriving = self.all.iter().map(|upload| {
            let octets = match &upload.content {
                Content::Coming { received, .. } => *received,
                Content::Whole(_) => upload.octets,
            };
            (Duration::from_nanos(now_ns.saturating_sub(upload.begun_ns)), octets)
        });
        let slow = makes_room(arriving);
        if let Some(at) = slow {
            let gone = self.all.remove(at);
            tracing::warn!(
                client = gone.client,
                name = gone.name,
                "an upload is slow and makes room for another"
            );
        }
        slow.is_some()
    }

    /// A client has gone.
    pub fn left(&mut self, client: ClientId) {
        self.all.retain(|upload| upload.client != client);
    }

    /// Gives up what nobody goes on with.
    pub fn forget_idle(&mut self, now_ns: u64) {
        self.all
            .retain(|upload| now_ns.saturating_sub(upload.heard_ns) < IDLE_S * 1_000_000_000);
    }

    fn of(&mut self, client: ClientId, number: u64) -> Result<&mut Upload, RpcError> {
        let found = (self.all.iter_mut()).find(|upload| upload.number == number && upload.client == client);
        found.ok_or_else(|| {
            invalid(format!(
                "no upload {number} of this client; one that stays away for {IDLE_S} s, or is slow while others wait, is given up: begin it again"
            ))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use program::text::Reader;
    use std::io::Read;

    const SUM: [u8; 32] = [
        0xba, 0x78, 0x16, 0xbf, 0x8f, 0x01, 0xcf, 0xea, 0x41, 0x41, 0x40, 0xde, 0x5d, 0xae, 0x22, 0x23, 0xb0, 0x03,
        0x61, 0xa3, 0x96, 0x17, 0x7a, 0x9c, 0xb4, 0x10, 0xff, 0x61, 0xf2, 0x00, 0x15, 0xad,
    ];

    #[test]
    fn what_comes_in_parts_is_whole_once_its_sum_is_right() {
        let mut uploads = Uploads::default();
        let number = uploads.begin(1, "part.ngc", 3, 0).unwrap();
        assert_eq!(uploads.append(1, number, 0, b"a", 0), Ok(1));
        // Twice the same, beyond, too much, another's, too early: it stays as it is.
        for (client, at, part) in [(1, 0, &b"a"[..]), (1, 2, b"c"), (1, 1, b"bcd"), (2, 1, b"b")] {
            assert_eq!(
                uploads.append(client, number, at, part, 0).unwrap_err().code,
                code::INVALID_PARAMS
            );
        }
        assert!(
            uploads
                .commit(1, number, &SUM, 0)
                .unwrap_err()
                .message
                .text
                .contains("1 of 3 octets")
        );
        assert!(uploads.whole(1, number, 0).is_err());
        assert_eq!(uploads.append(1, number, 1, b"bc", 0), Ok(3));
        uploads.commit(1, number, &SUM, 0).unwrap();
        uploads.commit(1, number, &SUM, 0).unwrap();
        assert!(uploads.append(1, number, 3, b"", 0).is_err());
        assert!(uploads.whole(2, number, 0).is_err());
        let uploaded = uploads.whole(1, number, 0).unwrap();
        let mut read = String::new();
        Reader::from(&*uploaded.text).read_to_string(&mut read).unwrap();
        assert_eq!((uploaded.name.as_str(), read.as_str()), ("part.ngc", "abc"));
        let number = uploads.begin(1, "part.ngc", 3, 0).unwrap();
        uploads.append(1, number, 0, b"abd", 0).unwrap();
        assert!(
            uploads
                .commit(1, number, &SUM, 0)
                .unwrap_err()
                .message
                .text
                .contains("sha256")
        );
        assert!(uploads.append(1, number, 3, b"", 0).is_err(), "given up");
        let empty = uploads.begin(1, "empty.ngc", 0, 0).unwrap();
        uploads.commit(1, empty, &Sha256::digest(b""), 0).unwrap();
    }

    #[test]
    fn size_and_number_are_limited_and_what_nobody_goes_on_with_goes() {
        let mut uploads = Uploads::default();
        let refused = |answer: Result<u64, RpcError>| answer.unwrap_err().message.text;
        assert!(refused(uploads.begin(1, "huge", PROGRAM_MAX + 1, 0)).contains("at the most"));
        for name in ["", "a\nb", &"n".repeat(NAME_MAX + 1)] {
            assert!(refused(uploads.begin(1, name, 1, 0)).contains("\"name\""));
        }
        for client in 1..=COUNT_MAX as u64 {
            uploads.begin(client, "part", 10, client).unwrap();
        }
        assert!(refused(uploads.begin(9, "part", 10, 0)).contains("4 programs"));
        uploads.left(2);
        let number = uploads.begin(9, "part", 10, 0).unwrap();
        uploads.append(9, number, 0, b"12", 50_000_000_000).unwrap();
        uploads.forget_idle(60_000_000_002);
        let left: Vec<ClientId> = uploads.all.iter().map(|upload| upload.client).collect();
        assert_eq!(left, [3, 4, 9]);
        uploads.all[0].octets = PROGRAM_MAX;
        uploads.all[1].octets = PROGRAM_MAX - 9;
        assert!(refused(uploads.begin(1, "part", 10, 60_000_000_002)).contains("more than"));
    }

    #[test]
    fn slow_ones_keep_nobody_out() {
        let mut uploads = Uploads::default();
        let slow: Vec<u64> = (1..=COUNT_MAX as u64)
            .map(|client| uploads.begin(client, "slow", 1000, 0).unwrap())
            .collect();
        for (client, number) in (1..).zip(&slow) {
            uploads
                .append(client, *number, 0, &vec![b'x'; client as usize], 9_000_000_000)
                .unwrap();
        }
        let number = uploads.begin(9, "part", 3, 10_000_000_000).unwrap();
        assert_eq!(uploads.append(9, number, 0, b"abc", 10_000_000_000), Ok(3));
        let told = uploads
            .append(1, slow[0], 1, b"x", 10_000_000_000)
            .unwrap_err()
            .message
            .text;
        assert!(told.contains("begin it again"), "{told}");
        assert_eq!(uploads.append(2, slow[1], 2, b"x", 10_000_000_000), Ok(3));
    }
}
