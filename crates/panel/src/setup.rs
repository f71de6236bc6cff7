//! `/init`: makes a machine file where there is no control yet.
//!
//! In:  what somebody types into a page. Out: what the network has, the machine file as text or on the disk; then the control begins.

use crate::guard::{Visitor, answer, refuse};
use crate::serve::Panel;
use axum::Extension;
use axum::body::Bytes;
use axum::extract::{Path, State};
use axum::http::StatusCode;
use axum::response::Response;
use protocol::Role;
use serde_json::{Value, json};
use std::sync::Arc;
use tokio::sync::oneshot;

/// Stack of the thread that scans a network, as that of a program.
const STACK: usize = 8 << 20;

/// Who knows how a machine file is made. Each of these may take seconds, and is called one at a time.
pub trait Setup: Send + Sync {
    /// What the page begins with.
    fn begin(&self) -> Value;

    /// Who answers on a network interface.
    ///
    /// # Errors
    /// Nobody does, or nothing can be asked, in words.
    fn scan(&self, interface: &str) -> Result<Value, String>;

    /// The machine file that answers make.
    ///
    /// # Errors
    /// Why they make none, in words.
    fn check(&self, answers: &Value) -> Result<String, String>;

    /// Writes it; where it is, or `None`: a file is there, and is not to be replaced.
    ///
    /// # Errors
    /// Why it is not written, in words.
    fn write(&self, answers: &Value, replace: bool) -> Result<Option<String>, String>;

    /// The control is to begin: the panel ends for it.
    ///
    /// # Errors
    /// Nothing was written yet.
    fn start(&self) -> Result<(), String>;
}

/// Answers `GET /init`.
pub(crate) async fn begin(State(panel): State<Arc<Panel>>, Extension(visitor): Extension<Visitor>) -> Response {
    asked(panel, visitor, |setup| Ok((StatusCode::OK, setup.begin()))).await
}

/// Answers `POST /init/WHAT`.
pub(crate) async fn order(
    State(panel): State<Arc<Panel>>,
    Extension(visitor): Extension<Visitor>,
    Path(what): Path<String>,
    body: Bytes,
) -> Response {
    asked(panel, visitor, move |setup| {
        let wrong = |why: String| (StatusCode::UNPROCESSABLE_ENTITY, why);
        let mut asked: Value = serde_json::from_slice(&body).map_err(|error| wrong(error.to_string()))?;
        match &*what {
            "scan" => {
                let interface = asked["interface"].as_str().unwrap_or_default();
                let found = setup.scan(interface).map_err(|why| (StatusCode::BAD_GATEWAY, why))?;
                Ok((StatusCode::OK, found))
            }
            "check" => {
                let text = setup.check(&asked).map_err(wrong)?;
                Ok((StatusCode::OK, json!({ "text": text })))
            }
            "write" => {
                let replace = asked.as_object_mut().and_then(|asked| asked.remove("replace"));
                let replace = replace.is_some_and(|replace| replace == true);
                match setup.write(&asked, replace).map_err(wrong)? {
                    Some(file) => Ok((StatusCode::OK, json!({ "written": file }))),
                    None => Err((StatusCode::CONFLICT, "the file is there already".into())),
                }
            }
            "start" => {
                setup.start().map_err(|why| (StatusCode::CONFLICT, why))?;
                Ok((StatusCode::ACCEPTED, json!({})))
            }
            _ => Err((StatusCode::NOT_FOUND, format!("/init knows no {what}"))),
        }
    })
    .await
}

/// What a thread that may wait says to it.
async fn asked(
    panel: Arc<Panel>,
    visitor: Visitor,
    ask: impl FnOnce(&dyn Setup) -> Result<(StatusCode, Value), (StatusCode, String)> + Send + 'static,
) -> Response {
    if let Err(refusal) = visitor.permit(Role::SetUp) {
        return *refusal;
    }
    let Some(setup) = panel.settings.setup.clone() else {
        return refuse(
            StatusCode::NOT_FOUND,
            "a control runs here: isocnc init FILE --panel makes a machine file",
        );
    };
    let turn = Arc::clone(&panel.setup_turn).lock_owned().await;
    let (tell, told) = oneshot::channel();
    // A thread of its own: those that read and write files have too small a stack to scan a network.
    let spawned = std::thread::Builder::new()
        .name("setup".into())
        .stack_size(STACK)
        .spawn(move || {
            let _turn = turn;
            let _ = tell.send(ask(&*setup)); // nobody may wait any more
        });
    if let Err(cause) = spawned {
        return refuse(
            StatusCode::SERVICE_UNAVAILABLE,
            format!("no thread can be had: {cause}"),
        );
    }
    match told.await {
        Ok(Ok((status, value))) => answer(status, &value),
        Ok(Err((status, why))) => refuse(status, why),
        Err(_) => refuse(StatusCode::INTERNAL_SERVER_ERROR, "this could not be done"),
    }
}
