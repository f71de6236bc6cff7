//! The panel itself as a client of the control: what it asks for pages that are no WebSocket.

use crate::serve::Panel;
use crate::{Guest, Role};
use protocol::with_tokio::Client;
use protocol::{ClientError, Method};
use std::time::Duration;

/// Longest wait for an answer: that of the check of a long program.
const WAIT: Duration = Duration::from_secs(700);

/// A client of the control that may do this.
///
/// # Errors
/// The control has ended, or serves too many.
pub(crate) fn connect(panel: &Panel, role: Role, name: &str) -> Result<Client, String> {
    let guest = Guest {
        role,
        name: name.to_owned(),
    };
    let connected = panel.control.connect(&guest).and_then(Client::new);
    connected.map_err(|cause| cause.to_string())
}

/// The answer of a method.
///
/// # Errors
/// It was refused, in the words of the control; or the control has ended.
pub(crate) async fn ask<M: Method>(client: &mut Client, params: &M::Params) -> Result<M::Answer, String> {
    client.ask::<M>(params, WAIT).await.map_err(|error| match error {
        ClientError::Refused(refused) => refused.message.text,
        _ => "the control is ending, or serves too many".into(),
    })
}
