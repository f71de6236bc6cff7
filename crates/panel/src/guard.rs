//! What stands before every request: whose page it comes from, who asks, and what the answer tells a browser.
//!
//! In:  a request, both ends of its connection. Out: the request with who asks ([`Visitor`]), or a refusal in words.
//!
//! | threat | what stands against it |
//! |---|---|
//! | a page of another site opens our WebSocket or sends our requests | `Origin` must be our own, wherever it is told, and a request across sites (`Sec-Fetch-Site`) is answered for pages alone |
//! | a name of another site that leads to this PC (DNS rebinding) | `Host` must be an address or a name of this PC |
//! | another user of this PC | the user at the far end of a connection of this PC, as the kernel knows him (`peer.rs`) |
//! | everybody else | a token (`tokens.rs`) |
//! | a script in the name of a program | no script but our own files (Content-Security-Policy) |

use crate::serve::{Connection, Panel};
use crate::tokens::{Denied, Token};
use axum::extract::{Request, State};
use axum::http::header::{AUTHORIZATION, CONTENT_TYPE, HOST, HeaderName, ORIGIN, WWW_AUTHENTICATE};
use axum::http::{HeaderMap, HeaderValue, StatusCode};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use protocol::Role;
use serde_json::{Value, json};
use std::net::IpAddr;
use std::sync::Arc;
use std::time::Instant;

/// What every answer tells a browser.
const HEADERS: [(HeaderName, &str); 6] = [
    (
        HeaderName::from_static("content-security-policy"),
        "default-src 'self'; object-src 'none'; base-uri 'none'; frame-ancestors 'none'; form-action 'self'; img-src 'self' data: blob:",
    ),
    (HeaderName::from_static("x-content-type-options"), "nosniff"),
    (HeaderName::from_static("referrer-policy"), "no-referrer"),
    (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
    (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    (HeaderName::from_static("x-frame-options"), "DENY"),
];
const FETCH_SITE: HeaderName = HeaderName::from_static("sec-fetch-site");

/// A JSON answer.
pub(crate) fn answer(status: StatusCode, value: &Value) -> Response {
    let kind = HeaderValue::from_static("application/json");
    (status, [(CONTENT_TYPE, kind)], format!("{value}\n")).into_response()
}

/// A refusal, as `{"error": "..."}`.
pub(crate) fn refuse(status: StatusCode, why: impl Into<String>) -> Response {
    let why: String = why.into();
    answer(status, &json!({ "error": why }))
}

/// Who asks.
#[derive(Clone, Debug)]
pub(crate) struct Visitor {
    pub(crate) address: IpAddr,
    pub(crate) access: Access,
}

/// What somebody may do.
#[derive(Clone, Debug)]
pub(crate) enum Access {
    /// The user of the control, at this PC.
    Owner,
    /// Whoever has this token.
    Token(Token),
    /// Nobody knows yet.
    Unknown,
}

impl Visitor {
    pub(crate) fn role(&self) -> Option<Role> {
        match &self.access {
            Access::Owner => Some(Role::SetUp),
            Access::Token(token) => Some(token.role),
            Access::Unknown => None,
        }
    }

    /// What others are told of him.
    pub(crate) fn name(&self) -> String {
        match &self.access {
            Access::Token(token) => format!("panel of {}", token.name),
            Access::Owner | Access::Unknown => "panel".into(),
        }
    }

    /// Refuses who may not do this.
    pub(crate) fn permit(&self, needed: Role) -> Result<(), Box<Response>> {
        match self.role() {
            None => Err(Box::new(log_in(
                "log in: this asks for a token, as isocnc panel token makes one",
            ))),
            Some(role) if role < needed => {
                let (needed, role) = (needed.name(), role.name());
                let why = format!("this asks for the role \"{needed}\", and this token has \"{role}\"");
                Err(Box::new(refuse(StatusCode::FORBIDDEN, why)))
            }
            Some(_) => Ok(()),
        }
    }
}

fn log_in(why: &str) -> Response {
    let mut response = refuse(StatusCode::UNAUTHORIZED, why);
    let scheme = HeaderValue::from_static("Bearer");
    response.headers_mut().insert(WWW_AUTHENTICATE, scheme);
    response
}

/// Lets a request through that may come, with who asks.
pub(crate) async fn guard(State(panel): State<Arc<Panel>>, mut request: Request, next: Next) -> Response {
    let mut response = match check(&panel, &request) {
        Ok(visitor) => {
            request.extensions_mut().insert(visitor);
            next.run(request).await
        }
        Err(refusal) => {
            crate::Counts::add(&panel.counts.refused);
            *refusal
        }
    };
    let headers = response.headers_mut();
    for (name, value) in HEADERS {
        headers.insert(name, HeaderValue::from_static(value));
    }
    response
}

fn check(panel: &Panel, request: &Request) -> Result<Visitor, Box<Response>> {
    let refused = |status, why: String| Err(Box::new(refuse(status, why)));
    let Some(connection) = request.extensions().get::<Connection>() else {
        return refused(StatusCode::INTERNAL_SERVER_ERROR, "nobody knows who asks".into());
    };
    let headers = request.headers();
    let host = text(headers, &HOST);
    let Some(host) = host.filter(|host| is_own_host(host, connection.near.ip(), &panel.settings.hosts)) else {
        let told = host.unwrap_or("nothing");
        let why = format!(
            "the address says \"{told}\", which is no name of this PC: use its address, or add the name to hosts of [panel] in the machine file"
        );
        return refused(StatusCode::MISDIRECTED_REQUEST, why);
    };
    if let Some(origin) = headers.get(ORIGIN) {
        let own = format!("{}://{host}", panel.scheme());
        if !origin.to_str().is_ok_and(|origin| origin.eq_ignore_ascii_case(&own)) {
            return refused(StatusCode::FORBIDDEN, "a page of another site must not ask this".into());
        }
    }
    let is_page = crate::pages::is_page(request.uri().path());
    let site = text(headers, &FETCH_SITE);
    if !is_page && site.is_some_and(|site| site != "same-origin" && site != "none") {
        return refused(StatusCode::FORBIDDEN, "a page of another site must not ask this".into());
    }
    let address = connection.far.ip();
    let access = match bearer(headers) {
        _ if connection.is_owner => Access::Owner,
        None => Access::Unknown,
        Some(secret) => match panel.settings.tokens.log_in(secret, address, Instant::now()) {
            Ok(token) => Access::Token(token),
            Err(denied @ Denied::Unknown) => return Err(Box::new(log_in(&denied.to_string()))),
            Err(denied @ Denied::Pause(_)) => return refused(StatusCode::TOO_MANY_REQUESTS, denied.to_string()),
        },
    };
    Ok(Visitor { address, access })
}

fn text<'h>(headers: &'h HeaderMap, name: &HeaderName) -> Option<&'h str> {
    headers.get(name)?.to_str().ok()
}

fn bearer(headers: &HeaderMap) -> Option<&str> {
    let (scheme, secret) = text(headers, &AUTHORIZATION)?.split_once(' ')?;
    scheme.eq_ignore_ascii_case("bearer").then(|| secret.trim())
}

/// Whether a `Host` is one of this PC: the address that was connected to, a name of the loopback for a connection of this PC, or a name
/// that was given. Its port is not looked at: it may be forwarded.
pub(crate) fn is_own_host(host: &str, near: IpAddr, names: &[String]) -> bool {
    let name = match host.strip_prefix('[') {
        Some(rest) => match rest.split_once(']') {
            Some((name, "")) => name,
            Some((name, port)) if is_port(port) => name,
            _ => return false,
        },
        None => match host.split_once(':') {
            None => host,
            Some((name, port)) if is_port(&format!(":{port}")) => name,
            Some(_) => return false,
        },
    };
    let near = near.to_canonical();
    if let Ok(address) = name.parse::<IpAddr>() {
        return address.to_canonical() == near || address.is_loopback() && near.is_loopback();
    }
    let name = name.strip_suffix('.').unwrap_or(name);
    near.is_loopback() && name.eq_ignore_ascii_case("localhost")
        || names.iter().any(|own| own.eq_ignore_ascii_case(name))
}

fn is_port(text: &str) -> bool {
    let digits = text.strip_prefix(':').unwrap_or("x");
    (1..=5).contains(&digits.len()) && digits.bytes().all(|digit| digit.is_ascii_digit())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn hosts_of_this_pc_and_no_others() {
        let names = ["mill.local".to_owned()];
        let is = |host: &str, near: &str| is_own_host(host, near.parse().unwrap(), &names);
        for host in [
            "127.0.0.1:8402",
            "localhost:9000",
            "LocalHost",
            "127.0.0.1",
            "[::1]:8402",
            "localhost.:1",
            "mill.local",
        ] {
            assert!(is(host, "127.0.0.1"), "{host}");
        }
        for host in [
            "evil.example:8402",
            "localhost.evil.example",
            "192.0.2.5",
            "",
            ":8402",
            "[::1",
            "[::1]x",
            "a:b:c",
            "localhost:port",
        ] {
            assert!(!is(host, "127.0.0.1"), "{host}");
        }
        assert!(
            is("192.0.2.5:8402", "192.0.2.5")
                && is("MILL.local:8402", "192.0.2.5")
                && is("[2001:db8::1]", "2001:db8::1")
        );
        assert!(is("192.0.2.5", "::ffff:192.0.2.5"));
        // From elsewhere, localhost is another PC.
        assert!(!is("localhost", "192.0.2.5") && !is("127.0.0.1", "192.0.2.5"));
    }

    proptest! {
        #[test]
        fn no_host_panics(host in "\\PC{0,40}", odd in "[\\[\\]:.0-9a-z]{0,20}") {
            let near = IpAddr::V4(std::net::Ipv4Addr::LOCALHOST);
            let _ = is_own_host(&host, near, &[]);
            let _ = is_own_host(&odd, near, &[]);
        }
    }
}
