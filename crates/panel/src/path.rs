//! `/path`: the way of the program that is loaded, as octets.
//!
//! In:  a tolerance. Out: a line of JSON (axes, octets of a record, program), then blocks: how many octets follow (u32, little end
//! first), whole records; 0 is the end, behind which a line of JSON says whether the program was wrong somewhere.

use crate::ask::Asker;
use crate::guard::{Visitor, refuse};
use crate::serve::Panel;
use crate::tokens::Role;
use axum::Extension;
use axum::body::{Body, Bytes};
use axum::extract::{RawQuery, State};
use axum::http::header::{CACHE_CONTROL, CONTENT_TYPE};
use axum::http::{HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use futures_util::stream;
use serde_json::{Value, json};
use std::convert::Infallible;
use std::sync::Arc;

/// Serves the way, as fast as it is drawn and taken.
pub(crate) async fn path(
    State(panel): State<Arc<Panel>>,
    Extension(visitor): Extension<Visitor>,
    RawQuery(query): RawQuery,
) -> Response {
    if let Err(refusal) = visitor.permit(Role::Watch) {
        return *refusal;
    }
    let Some(params) = params(query.as_deref().unwrap_or_default()) else {
        return refuse(StatusCode::BAD_REQUEST, "expected /path or /path?tolerance_mm=0.1");
    };
    let mut asker = match Asker::new(&panel, Role::Watch, "picture of the path") {
        Ok(asker) => asker,
        Err(why) => return refuse(StatusCode::SERVICE_UNAVAILABLE, why),
    };
    let begun = match asker.ask("program.path.begin", params).await {
        Ok(begun) => begun,
        Err(why) => return refuse(StatusCode::CONFLICT, why),
    };
    let number = begun["path"].clone();
    let head = Bytes::from(format!("{begun}\n"));
    let state = Some((asker, number, Some(head)));
    let blocks = stream::unfold(state, |state| async {
        let (mut asker, number, head) = state?;
        if let Some(head) = head {
            return Some((Ok::<_, Infallible>(head), Some((asker, number, None))));
        }
        let part = asker.ask("program.path.next", json!({ "path": number })).await;
        let (octets, is_over) = block(part);
        Some((Ok(octets), (!is_over).then_some((asker, number, None))))
    });
    let kind = HeaderValue::from_static("application/octet-stream");
    let fresh = HeaderValue::from_static("no-store");
    (
        [(CONTENT_TYPE, kind), (CACHE_CONTROL, fresh)],
        Body::from_stream(blocks),
    )
        .into_response()
}

/// Parameters of the query; `None`: there are others.
fn params(query: &str) -> Option<Value> {
    match query.split_once('=') {
        None if query.is_empty() => Some(json!({})),
        Some(("tolerance_mm", text)) => Some(json!({ "tolerance_mm": text.parse::<f64>().ok()? })),
        _ => None,
    }
}

/// Octets of a part, and whether it was the last one.
fn block(part: Result<Value, String>) -> (Bytes, bool) {
    let (records, end) = match part {
        Ok(part) => {
            let records = STANDARD
                .decode(part["base64"].as_str().unwrap_or_default())
                .unwrap_or_default();
            let end = (part["end"] == true).then(|| part["error"].clone());
            // One that brings nothing would be asked again for ever.
            let is_nothing = records.is_empty().then(|| json!("the control tells no more of it"));
            (records, end.or(is_nothing))
        }
        Err(why) => (Vec::new(), Some(json!(why))),
    };
    let mut octets = Vec::with_capacity(records.len() + 64);
    if !records.is_empty() {
        octets.extend((records.len() as u32).to_le_bytes());
        octets.extend(records);
    }
    let is_over = end.is_some();
    if let Some(error) = end {
        octets.extend(0_u32.to_le_bytes());
        octets.extend(format!("{}\n", json!({ "error": error })).into_bytes());
    }
    (octets.into(), is_over)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_is_a_block_and_the_end_says_what_was_wrong() {
        let (octets, is_over) = block(Ok(json!({ "base64": "AQID", "end": false, "error": null })));
        assert_eq!((octets.as_ref(), is_over), (&[3, 0, 0, 0, 1, 2, 3][..], false));
        let (octets, is_over) = block(Ok(json!({ "base64": "", "end": true, "error": "line 7" })));
        assert_eq!(
            (&octets[..4], &octets[4..], is_over),
            (&[0; 4][..], &b"{\"error\":\"line 7\"}\n"[..], true)
        );
        assert!(block(Err("gone".into())).1);
        assert!(block(Ok(json!({ "text": "" }))).1);
    }

    #[test]
    fn a_query_is_a_tolerance_or_nothing() {
        assert_eq!(params(""), Some(json!({})));
        assert_eq!(params("tolerance_mm=0.5"), Some(json!({ "tolerance_mm": 0.5 })));
        for query in ["tolerance_mm=x", "x=1", "tolerance_mm"] {
            assert_eq!(params(query), None);
        }
    }
}
