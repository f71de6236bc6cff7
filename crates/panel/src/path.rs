//! `/path`: the way of the program that is loaded, as octets.
//!
//! In:  a tolerance. Out: a line of JSON (axes, octets of a record, program), then blocks: how many octets follow (u32, little end
//! first), whole records; 0 is the end, behind which a line of JSON says whether the program was wrong somewhere.

use crate::ask::{ask, connect};
use crate::guard::{Visitor, refuse};
use crate::serve::Panel;
use axum::Extension;
use axum::body::{Body, Bytes};
use axum::extract::{RawQuery, State};
use axum::http::header::{CACHE_CONTROL, CONTENT_TYPE};
use axum::http::{HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use futures_util::stream;
use protocol::{PathPart, Role, method, params};
use serde_json::json;
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
    let mut client = match connect(&panel, Role::Watch, "picture of the path") {
        Ok(client) => client,
        Err(why) => return refuse(StatusCode::SERVICE_UNAVAILABLE, why),
    };
    let begun = match ask::<method::PathBegin>(&mut client, &params).await {
        Ok(begun) => begun,
        Err(why) => return refuse(StatusCode::CONFLICT, why),
    };
    let next = params::PathNext { path: begun.path };
    let head = Bytes::from(format!("{}\n", json!(begun)));
    let state = Some((client, next, Some(head)));
    let blocks = stream::unfold(state, |state| async {
        let (mut client, next, head) = state?;
        if let Some(head) = head {
            return Some((Ok::<_, Infallible>(head), Some((client, next, None))));
        }
        let part = ask::<method::PathNext>(&mut client, &next).await;
        let (octets, is_over) = block(part);
        Some((Ok(octets), (!is_over).then_some((client, next, None))))
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
fn params(query: &str) -> Option<params::PathBegin> {
    let tolerance_mm = match query.split_once('=') {
        None if query.is_empty() => None,
        Some(("tolerance_mm", text)) => Some(text.parse().ok()?),
        _ => return None,
    };
    Some(params::PathBegin { tolerance_mm })
}

/// Octets of a part, and whether it was the last one.
fn block(part: Result<PathPart, String>) -> (Bytes, bool) {
    let (records, end) = match part {
        Ok(part) => {
            let records = STANDARD.decode(part.base64).unwrap_or_default();
            let end = part.end.then_some(part.error);
            // One that brings nothing would be asked again for ever.
            let is_nothing = records
                .is_empty()
                .then(|| Some("the control tells no more of it".to_owned()));
            (records, end.or(is_nothing))
        }
        Err(why) => (Vec::new(), Some(Some(why))),
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
        let part = |base64: &str, error: Option<&str>| PathPart {
            base64: base64.into(),
            end: error.is_some(),
            error: error.map(str::to_owned),
        };
        let (octets, is_over) = block(Ok(part("AQID", None)));
        assert_eq!((octets.as_ref(), is_over), (&[3, 0, 0, 0, 1, 2, 3][..], false));
        let (octets, is_over) = block(Ok(part("", Some("line 7"))));
        assert_eq!(
            (&octets[..4], &octets[4..], is_over),
            (&[0; 4][..], &b"{\"error\":\"line 7\"}\n"[..], true)
        );
        assert!(block(Err("gone".into())).1);
        assert!(block(Ok(part("", None))).1);
    }

    #[test]
    fn a_query_is_a_tolerance_or_nothing() {
        let given = |query| params(query).map(|params| protocol::rpc::given(&params));
        assert_eq!(given(""), Some(json!({})));
        assert_eq!(given("tolerance_mm=0.5"), Some(json!({ "tolerance_mm": 0.5 })));
        for query in ["tolerance_mm=x", "x=1", "tolerance_mm"] {
            assert_eq!(params(query), None);
        }
    }
}
