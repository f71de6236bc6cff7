//! The pages of the panel, which are part of the program.

use crate::guard::refuse;
use crate::serve::Panel;
use axum::extract::{Path, Request, State};
use axum::http::header::{CACHE_CONTROL, CONTENT_TYPE, ETAG, IF_NONE_MATCH};
use axum::http::{HeaderValue, Method, StatusCode};
use axum::response::{IntoResponse, Response};
use nix::fcntl::OFlag;
use rust_embed::Embed;
use std::fs::OpenOptions;
use std::io::Read;
use std::os::unix::fs::OpenOptionsExt;
use std::sync::Arc;

/// What the front end was built to, and a page for a panel that has none.
#[derive(Embed)]
#[folder = "dist/"]
struct Dist;

/// The example of `docs/panel-api.md`.
#[derive(Embed)]
#[folder = "example/"]
struct Example;

/// Largest file of the user's own, bytes.
const OWN_MAX: u64 = 16 << 20;

/// Whether a path is that of a page, which holds nothing that is secret.
pub(crate) fn is_page(path: &str) -> bool {
    let own = [
        "/rpc",
        "/files",
        "/path",
        "/measurements",
        "/metrics",
        "/backup",
        "/mtconnect",
        "/init",
    ];
    !own.iter().any(|own| {
        path.strip_prefix(own)
            .is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
    })
}

/// Serves a page, a script, a picture.
pub(crate) async fn page(State(panel): State<Arc<Panel>>, request: Request) -> Response {
    if request.method() != Method::GET && request.method() != Method::HEAD {
        return refuse(StatusCode::METHOD_NOT_ALLOWED, "a page can be read and nothing else");
    }
    let path = request.uri().path().trim_start_matches('/');
    let path = match (path, &panel.settings.setup) {
        ("", None) => "index.html",
        ("", Some(_)) => "init.html",
        (path, _) => path,
    };
    let found = Dist::get(path).or_else(|| Example::get(path));
    // Built without a front end, the example is the panel.
    let found = found.or_else(|| Example::get("example.html").filter(|_| path == "index.html"));
    let Some(file) = found else {
        return refuse(StatusCode::NOT_FOUND, "there is no such page");
    };
    let tag = format!("\"{}\"", crate::tokens::hex(&file.metadata.sha256_hash()));
    let is_known = request
        .headers()
        .get(IF_NONE_MATCH)
        .is_some_and(|known| known.as_bytes() == tag.as_bytes());
    let mut response = match is_known {
        true => StatusCode::NOT_MODIFIED.into_response(),
        false => file.data.into_response(),
    };
    let headers = response.headers_mut();
    headers.insert(CONTENT_TYPE, HeaderValue::from_static(kind(path)));
    headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-cache"));
    if let Ok(tag) = HeaderValue::from_str(&tag) {
        headers.insert(ETAG, tag);
    }
    response
}

/// Serves a page of the user's own, a script, a picture: a file of the folder `pages` of `[panel]`.
pub(crate) async fn own(State(panel): State<Arc<Panel>>, Path(name): Path<String>) -> Response {
    let Some(folder) = panel.settings.pages.clone().filter(|_| files::is_name(&name)) else {
        return refuse(
            StatusCode::NOT_FOUND,
            "there is no such page: pages of [panel] names their folder",
        );
    };
    let path = folder.join(&name);
    let read = tokio::task::spawn_blocking(move || {
        // A link would lead out of the folder; without O_NONBLOCK this would wait for a writer of a pipe.
        let flags = OFlag::O_NOFOLLOW | OFlag::O_NONBLOCK;
        let file = OpenOptions::new()
            .read(true)
            .custom_flags(flags.bits())
            .open(path)
            .ok()?;
        let mut content = Vec::new();
        let is_file = file.metadata().ok()?.is_file();
        (is_file && file.take(OWN_MAX + 1).read_to_end(&mut content).is_ok()).then_some(content)
    });
    let why = match read.await.ok().flatten() {
        Some(content) if content.len() as u64 > OWN_MAX => format!("{name} is larger than {} MiB", OWN_MAX >> 20),
        Some(content) => {
            let headers = [(CONTENT_TYPE, kind(&name)), (CACHE_CONTROL, "no-cache")];
            return (headers, content).into_response();
        }
        None => format!("there is no page {name}, or it cannot be read; links are not followed here"),
    };
    refuse(StatusCode::NOT_FOUND, why)
}

/// What a file is, by the end of its name.
fn kind(path: &str) -> &'static str {
    match path.rsplit_once('.').map_or("", |(_, end)| end) {
        "html" => "text/html; charset=utf-8",
        "js" | "mjs" => "text/javascript; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "json" | "map" => "application/json",
        "webmanifest" => "application/manifest+json",
        "svg" => "image/svg+xml",
        "png" => "image/png",
        "ico" => "image/x-icon",
        "jpg" | "jpeg" => "image/jpeg",
        "webp" => "image/webp",
        "woff2" => "font/woff2",
        "txt" | "md" => "text/plain; charset=utf-8",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_page_is_known_by_its_path() {
        for path in [
            "/rpc",
            "/files",
            "/files/",
            "/files/a.ngc",
            "/path",
            "/measurements/step-0.svg",
            "/metrics",
            "/backup",
            "/init",
            "/init/scan",
        ] {
            assert!(!is_page(path), "{path}");
        }
        for path in ["/", "/index.html", "/paths.js", "/files.css", "/init.html"] {
            assert!(is_page(path), "{path}");
        }
    }
}
