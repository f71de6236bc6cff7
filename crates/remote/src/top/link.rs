//! The connection of the screen to the control: it is made again where it breaks.
//!
//! In:  requests. Out: how everything is, changes, refusals, that the control has gone. A thread waits for the control, so that the
//! screen waits for nobody.

use api::client::{self, ClientError, Followed, Sender};
use protocol::{Fields, Received, StateChange, method, params};
use serde_json::Value;
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Between two attempts to reach a control.
const PAUSE: Duration = Duration::from_millis(500);

/// What comes from the control.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum News {
    /// It is there, and everything is so.
    Is(Box<Followed>),
    /// These fields have changed.
    Changed(Fields),
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
        let mut client = client::connect(machine)?;
        let subscribed = client.ask::<method::Subscribe>(&params::Subscribe::default())?;
        let state = Followed::new(subscribed.state);
        let sender = client.sender()?;
        Ok::<_, ClientError>((state, sender, client))
    };
    let (state, asking, mut client) = match begin() {
        Ok(begun) => begun,
        Err(error) => return error.to_string(),
    };
    *lock(sender) = Some(asking);
    let mut heard = tell(News::Is(Box::new(state)));
    while heard {
        let message = match client.message() {
            Ok(message) => message,
            Err(error) => return error.to_string(),
        };
        heard = match message {
            Received::Notification(news) => match protocol::client::read::<StateChange>(news.params) {
                Ok(change) => tell(News::Changed(change.changed)),
                Err(error) => return error.to_string(),
            },
            Received::Answer { result: Err(why), .. } => tell(News::Refused(why.message.text)),
            Received::Answer { result: Ok(_), .. } => tell(News::Done),
        };
    }
    String::new()
}
