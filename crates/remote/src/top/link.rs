//! The connection of the screen to the control: it is made again where it breaks.
//!
//! In:  requests. Out: how everything is, changes, refusals, that the control has gone. A thread waits for the control, so that the
//! screen waits for nobody.

use api::client::{Client, Sender};
use serde_json::{Map, Value, json};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Between two attempts to reach a control.
const PAUSE: Duration = Duration::from_millis(500);

/// What comes from the control.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum News {
    /// It is there, and everything is so.
    Is(Map<String, Value>),
    /// These fields have changed.
    Changed(Map<String, Value>),
    /// It has done what was asked for.
    Done,
    /// It does not do what was asked for.
    Refused(String),
    /// It is not there, or not any more.
    Lost(String),
}

/// A connection, or the attempt to have one.
pub(super) struct Link {
    pub(super) news: Receiver<News>,
    sender: Arc<Mutex<Option<Sender>>>,
}

impl Link {
    /// To the control of a machine, or to the only one.
    pub(super) fn open(machine: Option<String>) -> std::io::Result<Link> {
        let sender = Arc::new(Mutex::new(None));
        let (tell, news) = channel();
        let shared = Arc::clone(&sender);
        std::thread::Builder::new().name("link".into()).spawn(move || {
            loop {
                let ended = follow(machine.as_deref(), &shared, &mut |news| tell.send(news).is_ok());
                *lock(&shared) = None;
                if tell.send(News::Lost(ended)).is_err() {
                    return;
                }
                std::thread::sleep(PAUSE);
            }
        })?;
        Ok(Link { news, sender })
    }

    /// Asks for something, and waits for nothing.
    ///
    /// # Errors
    /// No control is there, or it does not read.
    pub(super) fn send(&self, method: &str, params: &Value) -> Result<(), String> {
        match lock(&self.sender).as_mut() {
            Some(sender) => sender
                .send(method, params)
                .map_err(|cause| format!("{method}: {cause}")),
            None => Err("no control is there".into()),
        }
    }
}

fn lock(sender: &Mutex<Option<Sender>>) -> MutexGuard<'_, Option<Sender>> {
    sender.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Passes news on until the control has gone; gives why.
fn follow(machine: Option<&str>, sender: &Mutex<Option<Sender>>, tell: &mut dyn FnMut(News) -> bool) -> String {
    let begin = || {
        let mut client = Client::connect(machine)?;
        let mut answer = client.call("subscribe", json!({}))?;
        let sender = client.sender()?;
        Ok::<_, api::client::ClientError>((fields(answer["state"].take()), sender, client))
    };
    let (state, asking, mut client) = match begin() {
        Ok(begun) => begun,
        Err(error) => return error.to_string(),
    };
    *lock(sender) = Some(asking);
    let mut heard = tell(News::Is(state));
    while heard {
        let mut message = match client.message() {
            Ok(message) => message,
            Err(error) => return error.to_string(),
        };
        heard = match (message.get("method"), message["error"]["message"].as_str()) {
            (Some(_), _) => tell(News::Changed(fields(message["params"]["changed"].take()))),
            (None, Some(why)) => tell(News::Refused(why.to_owned())),
            (None, None) => tell(News::Done),
        };
    }
    String::new()
}

fn fields(value: Value) -> Map<String, Value> {
    match value {
        Value::Object(fields) => fields,
        _ => Map::new(),
    }
}
