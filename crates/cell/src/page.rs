//! The page: all machines at a glance, in a browser. It shows and orders nothing.
//!
//! In:  an address; what the supervisor answers. Out: `/` and its files, `/overview` as JSON, `/journal/MACHINE`.

use crate::core::Ask;
use crate::net::host_name;
use crate::serve::Desk;
use axum::Router;
use axum::extract::{Path, Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use serde_json::{Value, json};
use std::io;
use std::net::{IpAddr, SocketAddr, TcpListener};
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpStream;
use tokio::sync::Semaphore;
use tokio::time::timeout;

const POLICY: &str = "default-src 'self'; object-src 'none'; base-uri 'none'; frame-ancestors 'none'; form-action 'none'; img-src 'self' data:";
/// Connections at the same time: files of this process are for controls.
const CONNECTIONS_MAX: usize = 64;
/// Whoever has not said by then what is wanted has gone.
const HEAD_WAIT: Duration = Duration::from_secs(10);
/// Longest head of a request, octets.
const HEAD_MAX: usize = 16 << 10;
/// Then a connection ends, between two requests: a browser makes another one.
const LONGEST: Duration = Duration::from_secs(60);
/// What `web/build.mjs` has made: path, kind, text.
const FILES: [(&str, &str, &str); 5] = [
    ("/", "text/html; charset=utf-8", include_str!("../dist/index.html")),
    (
        "/cell.js",
        "text/javascript; charset=utf-8",
        include_str!("../dist/cell.js"),
    ),
    (
        "/style.css",
        "text/css; charset=utf-8",
        include_str!("../dist/style.css"),
    ),
    ("/icon.svg", "image/svg+xml", include_str!("../dist/icon.svg")),
    (
        "/licences.txt",
        "text/plain; charset=utf-8",
        include_str!("../dist/licences.txt"),
    ),
];

/// Serves the page from a thread of its own, until the process ends.
///
/// # Errors
/// The address cannot be had.
pub(crate) fn begin(address: SocketAddr, desk: Desk) -> io::Result<()> {
    let listener = TcpListener::bind(address)?;
    listener.set_nonblocking(true)?;
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .max_blocking_threads(4)
        .build()?;
    let serve = move || {
        let served: io::Result<()> = runtime.block_on(async {
            let listener = tokio::net::TcpListener::from_std(listener)?;
            serve(listener, router(desk)).await
        });
        if let Err(cause) = served {
            tracing::error!("the page has ended: {cause}");
        }
    };
    std::thread::Builder::new().name("page".into()).spawn(serve).map(drop)
}

async fn serve(listener: tokio::net::TcpListener, router: Router) -> io::Result<()> {
    let places = Arc::new(Semaphore::new(CONNECTIONS_MAX));
    loop {
        let stream = match listener.accept().await {
            Ok((stream, _)) => stream,
            Err(cause) => {
                // Too many files, or somebody who has gone already: the next may be taken.
                tracing::warn!("a connection to the page could not be taken: {cause}");
                tokio::time::sleep(Duration::from_millis(100)).await;
                continue;
            }
        };
        let Ok(place) = Arc::clone(&places).try_acquire_owned() else {
            continue;
        };
        let router = router.clone();
        tokio::spawn(async move {
            converse(stream, router).await;
            drop(place);
        });
    }
}

/// Requests and answers of one connection, until its end.
async fn converse(stream: TcpStream, router: Router) {
    let served = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEAD_WAIT)
        .max_buf_size(HEAD_MAX)
        .serve_connection(TokioIo::new(stream), TowerToHyperService::new(router));
    let mut served = pin!(served);
    if timeout(LONGEST, served.as_mut()).await.is_err() {
        served.as_mut().graceful_shutdown();
        // Whoever does not read the last answer by then has gone.
        let _ = timeout(HEAD_WAIT, served).await;
    }
}

fn router(desk: Desk) -> Router {
    let mut router = Router::new()
        .route("/overview", get(overview))
        .route("/journal/{machine}", get(journal));
    for (path, kind, text) in FILES {
        router = router.route(path, get(move || async move { ([(header::CONTENT_TYPE, kind)], text) }));
    }
    router.layer(middleware::from_fn(guard)).with_state(desk)
}

/// Whether a page of somebody else's name could not be behind this one: addresses, this PC's name, localhost.
fn is_own_name(headers: &HeaderMap) -> bool {
    let Some(host) = headers.get(header::HOST).and_then(|host| host.to_str().ok()) else {
        return false;
    };
    let name = match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|octet| octet.is_ascii_digit()) => name,
        _ => host,
    };
    let name = name.trim_start_matches('[').trim_end_matches(']');
    name == "localhost"
        || name.parse::<IpAddr>().is_ok()
        || host_name().is_some_and(|own| own.eq_ignore_ascii_case(name))
}

async fn guard(request: Request, next: Next) -> Response {
    let mut response = match is_own_name(request.headers()) {
        true => next.run(request).await,
        false => (StatusCode::MISDIRECTED_REQUEST, "not a name of this PC").into_response(),
    };
    let headers = response.headers_mut();
    for (name, value) in [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CACHE_CONTROL, "no-cache"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    response
}

async fn ask(desk: Desk, ask: Ask) -> Response {
    let asked = tokio::task::spawn_blocking(move || desk.ask(ask)).await;
    let answer = asked.unwrap_or_else(|_| Err("the supervisor has ended".into()));
    let json = |value: Value| ([(header::CONTENT_TYPE, "application/json")], value.to_string());
    match answer {
        Ok(value) => json(value).into_response(),
        Err(why) => (StatusCode::NOT_FOUND, json(json!({ "error": why }))).into_response(),
    }
}

async fn overview(State(desk): State<Desk>) -> Response {
    ask(desk, Ask::Overview).await
}

async fn journal(State(desk): State<Desk>, Path(machine): Path<String>) -> Response {
    ask(desk, Ask::Journal { machine, since: None }).await
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Read, Write};
    use std::time::Instant;

    /// Where it listens, without a supervisor behind it.
    fn page() -> SocketAddr {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        listener.set_nonblocking(true).unwrap();
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .unwrap();
        let hello = Router::new().route("/", get(async || "hello"));
        std::thread::spawn(move || {
            runtime.block_on(async { serve(tokio::net::TcpListener::from_std(listener).unwrap(), hello).await })
        });
        address
    }

    /// The answer to this, all of it.
    fn answer(address: SocketAddr, request: &[u8]) -> String {
        let mut stream = std::net::TcpStream::connect(address).unwrap();
        // It may have answered, or gone, before it has all.
        let _ = stream.write_all(request);
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        String::from_utf8_lossy(&answer).into_owned()
    }

    #[test]
    fn who_never_ends_is_left_and_takes_no_place_of_others_for_long() {
        let address = page();
        let hello = b"GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
        assert!(answer(address, hello).ends_with("hello"));
        let endless = [b"GET / HTTP/1.1\r\nX: ".to_vec(), vec![b'x'; 4 * HEAD_MAX]].concat();
        let refused = answer(address, &endless);
        assert!(!refused.contains("hello"), "{refused}");
        // All places are taken by some who say nothing; until they are sent away the next one is.
        let begun = Instant::now();
        let silent: Vec<_> = (0..CONNECTIONS_MAX)
            .map(|_| std::net::TcpStream::connect(address).unwrap())
            .collect();
        let told = answer(address, hello);
        if begun.elapsed() < HEAD_WAIT {
            assert_eq!(told, "");
        }
        while !answer(address, hello).ends_with("hello") {
            assert!(begun.elapsed() < Duration::from_secs(120));
            std::thread::sleep(Duration::from_millis(100));
        }
        // They are still here, and heard nothing but their end.
        for mut stream in silent {
            let mut told = String::new();
            let _ = stream.read_to_string(&mut told);
            assert!(!told.contains("hello"), "{told}");
        }
    }

    #[test]
    fn pages_of_other_names_are_not_ours() {
        let of = |host: &str| {
            let mut headers = HeaderMap::new();
            headers.insert(header::HOST, HeaderValue::from_str(host).unwrap());
            is_own_name(&headers)
        };
        for host in ["localhost:8403", "127.0.0.1", "[::1]:80", "10.0.0.7:1"] {
            assert!(of(host), "{host}");
        }
        for host in ["evil.example", "localhost.evil.example:80", ""] {
            assert!(!of(host), "{host}");
        }
        assert!(!is_own_name(&HeaderMap::new()));
    }
}
