//! `/measurements/`: pictures and figures of what was last measured of the machine.
//!
//! In:  a folder of files `NAME.svg` and `NAME.json`, which commands like `isocnc tune` write. Out: their list, and each of them.

use crate::guard::{Visitor, answer, refuse};
use crate::serve::Panel;
use axum::Extension;
use axum::extract::{Path, State};
use axum::http::header::{CACHE_CONTROL, CONTENT_TYPE};
use axum::http::{HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use files::is_name;
use protocol::Role;
use serde_json::{Value, json};
use std::sync::Arc;
use std::time::UNIX_EPOCH;
use tokio::task::spawn_blocking;

/// Measurements in a list.
const LIST_MAX: usize = 200;
/// Octets of a file.
const FILE_MAX: u64 = 16 << 20;

/// Those that there are, the latest first.
pub(crate) async fn list(State(panel): State<Arc<Panel>>, Extension(visitor): Extension<Visitor>) -> Response {
    if let Err(refusal) = visitor.permit(Role::Watch) {
        return *refusal;
    }
    let folder = panel.settings.measurements.clone();
    let found = spawn_blocking(move || folder.map(|folder| read(&folder)).unwrap_or_default());
    answer(
        StatusCode::OK,
        &json!({ "measurements": found.await.unwrap_or_default() }),
    )
}

fn read(folder: &std::path::Path) -> Vec<Value> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let pictures = entries.filter_map(|entry| {
        let file = entry.file_name();
        let name = file
            .to_str()
            .filter(|name| is_name(name))?
            .strip_suffix(".svg")?
            .to_owned();
        let modified = entry.metadata().ok()?.modified().ok()?;
        let unix_s = modified.duration_since(UNIX_EPOCH).ok()?.as_secs_f64();
        Some((unix_s, name))
    });
    let mut all: Vec<(f64, String)> = pictures.take(LIST_MAX).collect();
    all.sort_by(|one, other| other.0.total_cmp(&one.0));
    let told = all
        .into_iter()
        .map(|(unix_s, name)| json!({ "name": name, "unix_s": unix_s }));
    told.collect()
}

/// A picture, or figures.
pub(crate) async fn one(
    State(panel): State<Arc<Panel>>,
    Extension(visitor): Extension<Visitor>,
    Path(name): Path<String>,
) -> Response {
    if let Err(refusal) = visitor.permit(Role::Watch) {
        return *refusal;
    }
    let kind = match name.rsplit_once('.') {
        Some((_, "svg")) if is_name(&name) => "image/svg+xml",
        Some((_, "json")) if is_name(&name) => "application/json",
        _ => return refuse(StatusCode::BAD_REQUEST, "a measurement is NAME.svg or NAME.json"),
    };
    let missing = || refuse(StatusCode::NOT_FOUND, "there is no such measurement");
    let Some(folder) = &panel.settings.measurements else {
        return missing();
    };
    let path = folder.join(name);
    match spawn_blocking(move || files::read(&path, FILE_MAX)).await {
        Ok(Ok(octets)) => {
            let kind = (CONTENT_TYPE, HeaderValue::from_static(kind));
            ([kind, (CACHE_CONTROL, HeaderValue::from_static("no-store"))], octets).into_response()
        }
        Ok(Err(_)) | Err(_) => missing(),
    }
}
