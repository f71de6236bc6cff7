//! A connection whose octets are played, for fuzzing: the whole way from what arrives to what is answered, without a socket.
//!
//! In:  what somebody sends who then goes. Out: what he is answered, and what the control heard of him.

use crate::serve::{Connection, Panel, converse, router};
use crate::{Control, Guest, Settings};
use std::io;
use std::net::SocketAddr;
use std::os::unix::net::UnixStream;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::io::{AsyncBufReadExt, AsyncReadExt, AsyncWriteExt, BufReader, duplex};
use tokio::time::timeout;

/// Octets on their way in either direction.
const WINDOW: usize = 16 * 1024;
/// Nothing was answered for so long: he goes.
const QUIET: Duration = Duration::from_millis(3);
/// A connection of which one end has gone is over after this.
const END: Duration = Duration::from_secs(20);

/// Whom the far end is taken for.
pub const FAR: &str = "192.0.2.7:50000";
/// By which name the panel is called: that of the near end of the connection.
pub const HOST: &str = "192.0.2.1:8402";

/// What came of it.
#[derive(Debug, Default)]
pub struct Played {
    /// Octets that were answered.
    pub answer: Vec<u8>,
    /// Who became a client of the control.
    pub guests: Vec<Guest>,
    /// Lines that the control heard of them.
    pub lines: Vec<Vec<u8>>,
}

/// A control that hears everything and answers each line.
#[derive(Debug, Default)]
struct Ear(Mutex<Played>);

impl Ear {
    fn heard(&self, change: impl FnOnce(&mut Played)) {
        change(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner));
    }
}

/// The ear that a client speaks into.
struct Ears(Arc<Ear>);

impl Control for Ears {
    fn connect(&self, guest: &Guest) -> io::Result<UnixStream> {
        let (inside, outside) = UnixStream::pair()?;
        inside.set_nonblocking(true)?;
        let (lines, mut answers) = tokio::net::UnixStream::from_std(inside)?.into_split();
        self.0.heard(|heard| heard.guests.push(guest.clone()));
        let ear = Arc::clone(&self.0);
        tokio::spawn(async move {
            let mut lines = BufReader::new(lines);
            let mut line = Vec::new();
            while lines.read_until(b'\n', &mut line).await.is_ok_and(|count| count > 0) {
                ear.heard(|heard| heard.lines.push(std::mem::take(&mut line)));
                let answer = b"{\"jsonrpc\":\"2.0\",\"id\":1,\"result\":{\"text\":\"\"}}\n";
                if answers.write_all(answer).await.is_err() {
                    return;
                }
            }
        });
        Ok(outside)
    }
}

/// Plays a connection; `is_owner`: of the user of the control at this PC.
///
/// He goes where nothing is answered for a moment. For whoever wants a whole answer: [`play_to_end`].
///
/// # Panics
/// The connection does not end although its other end has gone.
pub fn play(settings: Settings, is_owner: bool, octets: &[u8]) -> Played {
    play_until(settings, is_owner, octets, QUIET)
}

/// As [`play`], of a request after which the panel ends the connection.
///
/// # Panics
/// As [`play`].
pub fn play_to_end(settings: Settings, is_owner: bool, octets: &[u8]) -> Played {
    play_until(settings, is_owner, octets, END)
}

fn play_until(settings: Settings, is_owner: bool, octets: &[u8], quiet: Duration) -> Played {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let ear = Arc::new(Ear::default());
    let answer = runtime.expect("a runtime").block_on(async {
        // The far end of it lives until this is over.
        let (_end, ending) = tokio::sync::watch::channel(false);
        let panel = Panel::new(settings, Arc::new(Ears(Arc::clone(&ear))), Arc::default(), ending);
        let address = |text: &str| text.parse::<SocketAddr>().expect("an address");
        let connection = Connection {
            near: address(HOST),
            far: address(FAR),
            is_owner,
        };
        let (near, far) = duplex(WINDOW);
        let serving = tokio::spawn(converse(near, connection, router(&Arc::new(panel))));
        let (mut from_panel, mut to_panel) = tokio::io::split(far);
        let mut answer = Vec::new();
        let writing = async {
            // A panel that has ended the connection takes no more.
            let _ = to_panel.write_all(octets).await;
            std::future::pending::<()>().await;
        };
        let reading = async {
            while timeout(quiet, from_panel.read_buf(&mut answer))
                .await
                .is_ok_and(|read| read.is_ok_and(|count| count > 0))
            {}
        };
        tokio::select! {
            () = writing => {}
            () = reading => {}
        }
        drop((from_panel, to_panel));
        timeout(END, serving)
            .await
            .expect("it ends")
            .expect("it does not panic");
        // Whoever came in over a WebSocket is served by a task of its own.
        let gone = async {
            while tokio::runtime::Handle::current().metrics().num_alive_tasks() > 0 {
                tokio::time::sleep(Duration::from_micros(100)).await;
            }
        };
        timeout(END, gone).await.expect("its client is gone, too");
        answer
    });
    let mut played = std::mem::take(&mut *ear.0.lock().unwrap_or_else(PoisonError::into_inner));
    played.answer = answer;
    played
}
