//! A client of `/rpc`: JSON-RPC 2.0 over a WebSocket, one message a text frame.
//!
//! In:  frames of a client. Out: frames of the control, which serves it as one of its clients.
//!
//! Reading and writing do not wait for each other: a stop of a client that does not read is heard. Nothing is kept for it: while it
//! does not read, the control tells it less often, of how things are then. One that reads nothing for [`SLOW`], or of which nothing is
//! heard for [`SILENT`], is dropped and counted; what it jogs comes to rest.

use crate::Guest;
use crate::counts::Counts;
use crate::guard::{Access, Visitor};
use crate::serve::Panel;
use crate::tokens::Denied;
use axum::Extension;
use axum::extract::State;
use axum::extract::ws::{CloseFrame, Message, Utf8Bytes, WebSocket, WebSocketUpgrade};
use axum::http::StatusCode;
use axum::response::Response;
use futures_util::stream::{SplitSink, SplitStream};
use futures_util::{SinkExt, StreamExt};
use serde_json::{Value, json};
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};
use tokio::io::{AsyncBufReadExt, AsyncWriteExt, BufReader};
use tokio::net::UnixStream;
use tokio::net::unix::{OwnedReadHalf, OwnedWriteHalf};
use tokio::time::{MissedTickBehavior, interval, timeout};

/// Clients at the same time.
const CLIENTS_MAX: u64 = 64;
/// Octets of a message, as of a line over the socket.
const MESSAGE_MAX: usize = 64 * 1024;
/// A client that does not read is waited for so long.
const SLOW: Duration = Duration::from_secs(5);
/// Between two signs of life that are asked for.
const PING: Duration = Duration::from_secs(5);
/// A client of which nothing is heard for so long has gone.
const SILENT: Duration = Duration::from_secs(15);
/// Somebody who has to show a token is waited for so long.
const LOG_IN_WAIT: Duration = Duration::from_secs(10);
/// Between two looks whether a token still counts.
const TOKEN_LOOK: Duration = Duration::from_secs(2);
/// Requests a second of one client, and how many at once.
const RATE: f64 = 50.0;
const BURST: f64 = 200.0;
/// Brings a part of a program: such requests are many by themselves, and slowed down where others are refused.
const PART: &str = "program.upload.append";
/// What one of them counts, requests.
const PART_COUNTS: f64 = 0.1;
/// Orders that are never too many.
const ALWAYS: [&str; 4] = ["stop", "hold", "estop", "jog.stop"];

/// Why a connection is closed, as a code of RFC 6455 or one of our own (4000 to 4999).
mod close {
    pub(super) const GOING_AWAY: u16 = 1001;
    pub(super) const TRY_LATER: u16 = 1013;
    /// No token, or one that does not count.
    pub(super) const LOG_IN: u16 = 4401;
    /// Too many wrong tokens.
    pub(super) const WAIT: u16 = 4429;
}

/// How a connection ends.
struct End(u16, String);

/// Opens `/rpc`.
pub(crate) async fn open(
    State(panel): State<Arc<Panel>>,
    Extension(visitor): Extension<Visitor>,
    upgrade: Result<WebSocketUpgrade, axum::extract::ws::rejection::WebSocketUpgradeRejection>,
) -> Response {
    let upgrade = match upgrade {
        Ok(upgrade) => upgrade,
        Err(_) => return crate::guard::refuse(StatusCode::UPGRADE_REQUIRED, "/rpc is a WebSocket"),
    };
    if panel.counts.clients() >= CLIENTS_MAX {
        return crate::guard::refuse(StatusCode::SERVICE_UNAVAILABLE, full());
    }
    upgrade
        .max_message_size(MESSAGE_MAX)
        .max_frame_size(MESSAGE_MAX)
        .write_buffer_size(0)
        .max_write_buffer_size(2 * MESSAGE_MAX)
        .on_upgrade(move |socket| serve(panel, visitor, socket))
}

fn full() -> String {
    format!("{CLIENTS_MAX} panels are open already")
}

/// A client that is counted as long as this lives.
struct Counted(Arc<Counts>);

impl Counted {
    fn new(counts: &Arc<Counts>) -> Counted {
        Counts::add(&counts.clients);
        Counted(Arc::clone(counts))
    }
}

impl Drop for Counted {
    fn drop(&mut self) {
        self.0.clients.fetch_sub(1, Relaxed);
    }
}

async fn serve(panel: Arc<Panel>, mut visitor: Visitor, mut socket: WebSocket) {
    let first = match visitor.role() {
        Some(_) => None,
        None => match timeout(LOG_IN_WAIT, log_in(&panel, &mut visitor, &mut socket)).await {
            Ok(Ok(first)) => Some(first),
            Ok(Err(end)) => return say_end(&mut socket, end).await,
            Err(_) => {
                let why = "log in: the first message is client.identify with a token".to_owned();
                return say_end(&mut socket, End(close::LOG_IN, why)).await;
            }
        },
    };
    let Some(role) = visitor.role() else { return };
    // Whoever has not said yet who he is takes nobody's place.
    if panel.counts.clients() >= CLIENTS_MAX {
        return say_end(&mut socket, End(close::TRY_LATER, full())).await;
    }
    let _counted = Counted::new(&panel.counts);
    let guest = Guest {
        role,
        name: visitor.name(),
    };
    let connected = panel.control.connect(&guest).and_then(|stream| {
        stream.set_nonblocking(true)?;
        UnixStream::from_std(stream)
    });
    let stream = match connected {
        Ok(stream) => stream,
        Err(cause) => return say_end(&mut socket, End(close::TRY_LATER, cause.to_string())).await,
    };
    let (answers, mut orders) = stream.into_split();
    if let Some(first) = first
        && pass_on(&mut orders, &first).await.is_err()
    {
        return;
    }
    let (to_client, from_client) = socket.split();
    // What the panel itself answers goes to the client in the order in which it comes about.
    let (own, own_answers) = tokio::sync::mpsc::channel(16);
    let name = guest.name;
    tracing::info!(%name, address = %visitor.address, role = role.name(), "a panel is open");
    let end = tokio::select! {
        end = read(from_client, orders, own, &panel.counts) => end,
        end = write(&panel, &visitor, to_client, answers, own_answers) => end,
    };
    tracing::info!(%name, address = %visitor.address, why = end, "a panel is closed");
}

/// Tells a client why it is not served.
async fn say_end(socket: &mut WebSocket, End(code, reason): End) {
    // Whoever does not read it has gone.
    let _ = timeout(SLOW, socket.send(closing(code, &reason))).await;
}

fn closing(code: u16, reason: &str) -> Message {
    // A control frame has room for so much.
    let mut most = reason.len().min(120);
    while !reason.is_char_boundary(most) {
        most -= 1;
    }
    let reason = Utf8Bytes::from(&reason[..most]);
    Message::Close(Some(CloseFrame { code, reason }))
}

/// Waits for the first message of somebody who has to show a token; gives it without the token.
async fn log_in(panel: &Panel, visitor: &mut Visitor, socket: &mut WebSocket) -> Result<String, End> {
    let asked = || {
        End(
            close::LOG_IN,
            "log in: the first message is client.identify with a token".into(),
        )
    };
    let text = loop {
        match socket.recv().await {
            Some(Ok(Message::Text(text))) => break text,
            Some(Ok(Message::Ping(_) | Message::Pong(_))) => {}
            Some(Ok(Message::Binary(_) | Message::Close(_)) | Err(_)) | None => return Err(asked()),
        }
    };
    let (secret, first) = identify(&text).ok_or_else(asked)?;
    match panel.settings.tokens.log_in(&secret, visitor.address, Instant::now()) {
        Ok(token) => {
            visitor.access = Access::Token(token);
            Ok(first)
        }
        Err(denied) => {
            Counts::add(&panel.counts.refused);
            let code = match denied {
                Denied::Unknown => close::LOG_IN,
                Denied::Pause(_) => close::WAIT,
            };
            Err(End(code, denied.to_string()))
        }
    }
}

/// The token of a `client.identify`, and the message without it.
pub(crate) fn identify(text: &str) -> Option<(String, String)> {
    let mut message: Value = serde_json::from_str(text).ok()?;
    if message.get("method")? != "client.identify" {
        return None;
    }
    let token = message.get_mut("params")?.as_object_mut()?.remove("token")?;
    let token = token.as_str()?.to_owned();
    Some((token, message.to_string()))
}

/// A message as one line; `None`: it is no JSON and has several.
pub(crate) fn one_line(text: &str) -> Option<String> {
    if !text.contains(['\n', '\r']) {
        return Some(text.to_owned());
    }
    let value: Value = serde_json::from_str(text).ok()?;
    Some(value.to_string())
}

async fn pass_on(orders: &mut OwnedWriteHalf, line: &str) -> std::io::Result<()> {
    orders.write_all(line.as_bytes()).await?;
    orders.write_all(b"\n").await
}

/// How many requests somebody may still send.
pub(crate) struct Allowance {
    left: f64,
    at: Instant,
}

impl Allowance {
    pub(crate) fn new(now: Instant) -> Allowance {
        Allowance { left: BURST, at: now }
    }

    /// Whether there is one left, of which this much is taken then.
    pub(crate) fn take(&mut self, now: Instant, counts: f64) -> bool {
        let since_s = now.saturating_duration_since(self.at).as_secs_f64();
        self.left = (self.left + since_s * RATE).min(BURST);
        self.at = now;
        let is_one = self.left >= 1.0;
        if is_one {
            self.left -= counts;
        }
        is_one
    }
}

/// Whether a request brings a part of a program.
fn is_part(text: &str) -> bool {
    #[derive(serde::Deserialize)]
    struct Called<'a> {
        #[serde(borrow)]
        method: std::borrow::Cow<'a, str>,
    }
    text.contains(PART) && serde_json::from_str::<Called<'_>>(text).is_ok_and(|called| called.method == PART)
}

/// The answer to a request that is one too many, or to none; `None`: to be passed on all the same.
pub(crate) fn too_many(text: &str) -> Option<String> {
    let message: Value = serde_json::from_str(text).unwrap_or_default();
    let method = message.get("method").and_then(Value::as_str).unwrap_or_default();
    if ALWAYS.contains(&method) {
        return None;
    }
    let what = format!("more than {RATE} requests a second: this one was not carried out");
    Some(error(message.get("id").unwrap_or(&Value::Null), -32000, &what))
}

fn error(id: &Value, code: i32, message: &str) -> String {
    json!({ "jsonrpc": "2.0", "id": id, "error": { "code": code, "message": message } }).to_string()
}

/// Passes on what a client says; says how it ended.
async fn read(
    mut from_client: SplitStream<WebSocket>,
    mut orders: OwnedWriteHalf,
    own: tokio::sync::mpsc::Sender<Message>,
    counts: &Counts,
) -> &'static str {
    let mut allowance = Allowance::new(Instant::now());
    loop {
        let message = match timeout(SILENT, from_client.next()).await {
            Err(_) => {
                Counts::add(&counts.silent_dropped);
                return "nothing was heard of it";
            }
            Ok(None | Some(Ok(Message::Close(_)))) => return "it has gone",
            Ok(Some(Err(_))) => return "its connection is broken, or a message was too long",
            Ok(Some(Ok(message))) => message,
        };
        let answer = match &message {
            Message::Text(text) if is_part(text) => {
                while !allowance.take(Instant::now(), PART_COUNTS) {
                    tokio::time::sleep(Duration::from_millis(2)).await;
                }
                None
            }
            Message::Text(text) if !allowance.take(Instant::now(), 1.0) => too_many(text),
            Message::Text(_) => None,
            Message::Binary(_) => Some(error(&Value::Null, -32600, "a message is a text frame")),
            Message::Ping(_) | Message::Pong(_) | Message::Close(_) => continue,
        };
        let answer = match (answer, &message) {
            (None, Message::Text(text)) => match one_line(text) {
                Some(line) => {
                    if pass_on(&mut orders, &line).await.is_err() {
                        return "the control has ended its connection";
                    }
                    continue;
                }
                None => error(&Value::Null, -32700, "no JSON"),
            },
            (Some(answer), _) => answer,
            (None, _) => continue,
        };
        // One that sends too much and reads nothing has to wait.
        if own.send(Message::Text(answer.into())).await.is_err() {
            return "it has gone";
        }
    }
}

/// Passes on what the control says; says how it ended.
async fn write(
    panel: &Panel,
    visitor: &Visitor,
    mut to_client: SplitSink<WebSocket, Message>,
    answers: OwnedReadHalf,
    mut own: tokio::sync::mpsc::Receiver<Message>,
) -> &'static str {
    let mut answers = BufReader::new(answers);
    let mut line = Vec::new();
    let mut ending = panel.ending.clone();
    let (mut pings, mut looks) = (interval(PING), interval(TOKEN_LOOK));
    pings.set_missed_tick_behavior(MissedTickBehavior::Delay);
    looks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        let (message, end) = tokio::select! {
            // What has been read of a line stays there where another branch is taken.
            read = answers.read_until(b'\n', &mut line) => match read {
                Ok(count) if count > 0 && line.last() == Some(&b'\n') => {
                    line.pop();
                    let text = String::from_utf8(std::mem::take(&mut line)).unwrap_or_default();
                    (Message::Text(text.into()), None)
                }
                // It ends its clients when it ends, and those that are too many.
                Ok(_) | Err(_) => {
                    let why = "the control has ended this connection: it is ending, or serves too many";
                    (closing(close::GOING_AWAY, why), Some("the control has ended its connection"))
                }
            },
            Some(message) = own.recv() => (message, None),
            _ = pings.tick() => (Message::Ping(Default::default()), None),
            _ = looks.tick() => match &visitor.access {
                Access::Token(token) if !panel.settings.tokens.is_valid(token) => {
                    (closing(close::LOG_IN, "this token was revoked"), Some("its token was revoked"))
                }
                _ => continue,
            },
            _ = ending.changed() => (closing(close::GOING_AWAY, "the control is ending"), Some("the control is ending")),
        };
        match timeout(SLOW, to_client.send(message)).await {
            Ok(Ok(())) => {}
            Ok(Err(_)) => return "it has gone",
            Err(_) => {
                Counts::add(&panel.counts.slow_dropped);
                return "it does not read what it has asked for";
            }
        }
        if let Some(end) = end {
            return end;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_token_is_taken_out_of_the_message_that_brings_it() {
        let text = r#"{"jsonrpc":"2.0","id":1,"method":"client.identify","params":{"token":"s3","name":"x"}}"#;
        let (token, rest) = identify(text).unwrap();
        assert_eq!(token, "s3");
        assert!(!rest.contains("s3") && rest.contains("\"name\":\"x\""), "{rest}");
        for text in [
            "",
            "{}",
            r#"{"method":"status"}"#,
            r#"{"method":"client.identify","params":{"token":5}}"#,
        ] {
            assert_eq!(identify(text), None);
        }
    }

    #[test]
    fn a_message_of_several_lines_is_one_and_no_other_is_made_of_it() {
        assert_eq!(one_line("{\"a\":\n1}").unwrap(), "{\"a\":1}");
        assert_eq!(one_line("{\"a\": 1}").unwrap(), "{\"a\": 1}");
        // The first of two messages, and a string with a line break in it.
        assert_eq!(one_line("{}\n{}"), None);
        assert_eq!(one_line("{\"a\":\"x\ny\"}"), None);
    }

    #[test]
    fn so_many_at_once_and_a_second_and_a_stop_always() {
        let begin = Instant::now();
        let mut allowance = Allowance::new(begin);
        assert_eq!((0..1000).filter(|_| allowance.take(begin, 1.0)).count(), BURST as usize);
        let later = begin + Duration::from_secs(2);
        assert_eq!((0..1000).filter(|_| allowance.take(later, 1.0)).count(), 100);
        let parts = later + Duration::from_secs(1);
        let taken = (0..1000).filter(|_| allowance.take(parts, PART_COUNTS)).count();
        assert!((490..=492).contains(&taken), "{taken}");
        assert!(is_part(
            r#"{"id":7,"params":{"value":"00"},"method":"program.upload.append"}"#
        ));
        assert!(!is_part(
            r#"{"id":7,"method":"home","params":{"x":"program.upload.append"}}"#
        ));
        assert_eq!(too_many(r#"{"id":7,"method":"stop"}"#), None);
        let refused: Value = serde_json::from_str(&too_many(r#"{"id":7,"method":"home"}"#).unwrap()).unwrap();
        assert_eq!(refused["id"], 7);
        assert!(too_many("no JSON").is_some());
    }

    #[test]
    fn a_reason_is_cut_where_a_letter_ends() {
        let Message::Close(Some(frame)) = closing(1000, &"ü".repeat(100)) else {
            panic!()
        };
        assert_eq!(frame.reason.len(), 120);
        let Message::Close(Some(frame)) = closing(1000, &format!("x{}", "ü".repeat(100))) else {
            panic!()
        };
        assert_eq!(frame.reason.len(), 119);
    }

    proptest! {
        #[test]
        fn no_text_panics_and_no_line_has_two(text in "\\PC*", json in "[{}\\[\\]\":,a\n\r0-9]{0,40}") {
            for text in [text, json] {
                let _ = identify(&text);
                let _ = too_many(&text);
                prop_assert!(one_line(&text).is_none_or(|line| !line.contains(['\n', '\r'])));
            }
        }
    }
}
