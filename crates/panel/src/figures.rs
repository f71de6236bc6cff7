//! `/metrics`: figures of the control, and those of the panel behind them.

use crate::ask::{ask, connect};
use crate::guard::{Visitor, refuse};
use crate::serve::Panel;
use axum::Extension;
use axum::extract::State;
use axum::http::header::CONTENT_TYPE;
use axum::http::{HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use protocol::params::NoParams;
use protocol::{Role, method};
use std::fmt::Write;
use std::sync::Arc;

/// Text exposition format 0.0.4.
pub(crate) async fn metrics(State(panel): State<Arc<Panel>>, Extension(visitor): Extension<Visitor>) -> Response {
    if let Err(refusal) = visitor.permit(Role::Watch) {
        return *refusal;
    }
    let told = match connect(&panel, Role::Watch, "metrics") {
        Ok(mut client) => ask::<method::Metrics>(&mut client, &NoParams {}).await,
        Err(why) => Err(why),
    };
    let mut text = match told {
        Ok(told) => told.text,
        Err(why) => return refuse(StatusCode::SERVICE_UNAVAILABLE, why),
    };
    let counts = &panel.counts;
    for (name, kind, help, value) in [
        ("api_clients", "gauge", "Panels that are open.", counts.clients()),
        (
            "panel_slow_dropped_total",
            "counter",
            "Panels dropped as they did not read.",
            counts.slow_dropped(),
        ),
        (
            "panel_silent_dropped_total",
            "counter",
            "Panels dropped as nothing was heard of them.",
            counts.silent_dropped(),
        ),
        (
            "panel_refused_total",
            "counter",
            "Requests refused for who asked, or for whose page.",
            counts.refused(),
        ),
    ] {
        // Writing to a text cannot fail.
        let _ = write!(
            text,
            "# HELP isocnc_{name} {help}\n# TYPE isocnc_{name} {kind}\nisocnc_{name} {value}\n"
        );
    }
    let kind = HeaderValue::from_static("text/plain; version=0.0.4");
    ([(CONTENT_TYPE, kind)], text).into_response()
}
