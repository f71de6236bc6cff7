//! Connections: taken, counted, served, ended.

use crate::backup::{self, Backup};
use crate::counts::Counts;
use crate::listen::Listener;
use crate::programs::{self, Programs};
use crate::setup::{self, Setup};
use crate::tls::Tls;
use crate::tokens::Tokens;
use crate::{Control, figures, grbl, guard, measurements, mtconnect, pages, path, rpc, shdr};
use axum::Router;
use axum::body::Body;
use axum::extract::Request;
use axum::routing::{any, get, post};
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use std::collections::HashMap;
use std::io;
use std::net::{IpAddr, SocketAddr};
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;
use tokio::time::timeout;
use tokio_rustls::TlsAcceptor;
use tower::ServiceExt;

/// Connections at the same time of all but the user of the control at this PC; one more is ended at once.
const OF_OTHERS_MAX: usize = 128;
/// The same of one address, other users of this PC among them.
const OF_ONE_MAX: usize = 64;
/// The same of the user of the control: nobody else takes his.
const OF_OWNER_MAX: usize = 128;
/// A client has this long for the head of a request, also for the next one of its connection.
const HEAD_WAIT: Duration = Duration::from_secs(10);
/// Longest head of a request, octets.
const HEAD_MAX: usize = 16 * 1024;
/// The first octet of a connection that is to be encrypted: a record of a handshake (RFC 8446, 5.1).
const HANDSHAKE: u8 = 22;
/// What the system keeps for a client that does not read, octets: what is told then is soon how it is, not how it was.
const UNREAD_MAX: usize = 64 * 1024;
/// How long clients are given to hear that the control has ended.
const FAREWELL: Duration = Duration::from_millis(500);
/// Stack of the threads that read and write files.
const STACK: usize = 512 * 1024;
/// Threads that read and write files.
const FILE_THREADS: usize = 2;

/// What the panel is told.
#[derive(Default)]
pub struct Settings {
    /// There is no control yet: what makes its machine file.
    pub setup: Option<Arc<dyn Setup>>,
    /// Names of this PC by which it may be called, beside its addresses.
    pub hosts: Vec<String>,
    /// Who may come from elsewhere.
    pub tokens: Tokens,
    /// Folder of programs.
    pub programs: Option<PathBuf>,
    /// Folder of pages of the user's own.
    pub pages: Option<PathBuf>,
    /// Folder of measurements; it may be missing.
    pub measurements: Option<PathBuf>,
    /// What connections are encrypted with; `None`: nothing.
    pub tls: Option<Tls>,
    /// What is to be kept elsewhere.
    pub backup: Backup,
    /// Where senders of Grbl connect.
    pub grbl: Option<Listener>,
    /// Where agents of MTConnect read lines of SHDR.
    pub shdr: Option<Listener>,
    /// Errors of MTConnect are told to clients that know only those from before 2.6.
    pub mtconnect_old_errors: bool,
    /// MTConnect answers at `/probe` and the like, too, not only below `/mtconnect`.
    pub mtconnect_at_root: bool,
}

/// Everything that requests can reach.
pub(crate) struct Panel {
    pub(crate) settings: Settings,
    /// Folder of programs, open.
    pub(crate) programs: Option<Arc<Programs>>,
    pub(crate) control: Arc<dyn Control>,
    pub(crate) counts: Arc<Counts>,
    pub(crate) mtconnect: mtconnect::Shared,
    /// True: the control is ending.
    pub(crate) ending: watch::Receiver<bool>,
    /// Who has it asks for the machine file.
    pub(crate) setup_turn: Arc<tokio::sync::Mutex<()>>,
}

impl Panel {
    pub(crate) fn new(
        settings: Settings,
        control: Arc<dyn Control>,
        counts: Arc<Counts>,
        ending: watch::Receiver<bool>,
    ) -> Panel {
        let programs = settings.programs.clone().and_then(|path| {
            let opened = Programs::open(path);
            opened
                .map_err(|cause| tracing::warn!(%cause, "there is no folder of programs"))
                .ok()
        });
        Panel {
            settings,
            programs: programs.map(Arc::new),
            control,
            counts,
            mtconnect: mtconnect::Shared::default(),
            ending,
            setup_turn: Arc::default(),
        }
    }

    pub(crate) fn scheme(&self) -> &'static str {
        match self.settings.tls {
            Some(_) => "https",
            None => "http",
        }
    }
}

/// A connection, as its requests see it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Connection {
    pub(crate) near: SocketAddr,
    pub(crate) far: SocketAddr,
    /// The user of the control is at its far end, on this PC.
    pub(crate) is_owner: bool,
}

/// Serves until the other end of `until` is closed. The calling thread is the only one but those that read and write files.
///
/// # Errors
/// The system gives no runtime.
pub fn serve(
    listener: Listener,
    mut settings: Settings,
    control: Arc<dyn Control>,
    counts: Arc<Counts>,
    until: UnixStream,
) -> io::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_io()
        .enable_time()
        .max_blocking_threads(FILE_THREADS)
        .thread_name("panel-files")
        .thread_stack_size(STACK)
        .build()?;
    let served = runtime.block_on(async {
        until.set_nonblocking(true)?;
        let mut until = tokio::net::UnixStream::from_std(until)?;
        let (end, ending) = watch::channel(false);
        let (senders, agents) = (settings.grbl.take(), settings.shdr.take());
        let panel = Arc::new(Panel::new(settings, control, Arc::clone(&counts), ending));
        if let Some(senders) = senders {
            tokio::spawn(grbl::serve(senders, Arc::clone(&panel)));
        }
        if let Some(agents) = agents {
            tokio::spawn(shdr::serve(agents, Arc::clone(&panel)));
        }
        tokio::select! {
            taken = take(listener, panel) => taken?,
            // Whatever is read: nothing is ever written there.
            _ = until.read_u8() => {}
        }
        // Nobody listens any more where there are no clients.
        let _ = end.send(true);
        let gone = async {
            while counts.clients() > 0 {
                tokio::time::sleep(Duration::from_millis(10)).await;
            }
        };
        // Whoever does not listen is not waited for.
        let _ = timeout(FAREWELL, gone).await;
        Ok(())
    });
    runtime.shutdown_timeout(FAREWELL);
    served
}

pub(crate) fn router(panel: &Arc<Panel>) -> Router {
    let mut router = Router::new();
    if panel.settings.mtconnect_at_root {
        for path in ["/probe", "/current", "/sample", "/assets", "/asset/{*ids}"] {
            router = router.route(path, get(mtconnect::answer));
        }
    }
    router
        .route("/rpc", any(rpc::open))
        .route("/files/", any(programs::list))
        .route("/files/{name}", any(programs::one))
        .route("/own/{name}", get(pages::own))
        .route("/path", get(path::path))
        .route("/measurements/", get(measurements::list))
        .route("/measurements/{name}", get(measurements::one))
        .route("/mtconnect", get(mtconnect::answer))
        .route("/mtconnect/{*rest}", get(mtconnect::answer))
        .route("/metrics", get(figures::metrics))
        .route("/backup", any(backup::backup))
        .route("/init", get(setup::begin))
        .route("/init/{what}", post(setup::order))
        .fallback(pages::page)
        .layer(axum::middleware::from_fn_with_state(Arc::clone(panel), guard::guard))
        .with_state(Arc::clone(panel))
}

/// Connections of each address; `None`: of the user of the control.
#[derive(Debug, Default)]
struct Connected(Mutex<HashMap<Option<IpAddr>, usize>>);

/// A connection that is counted as long as this lives.
struct Counted {
    of: Arc<Connected>,
    who: Option<IpAddr>,
}

impl Connected {
    fn count(self: &Arc<Connected>, who: Option<IpAddr>) -> Option<Counted> {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let of_one = all.get(&who).copied().unwrap_or(0);
        let of_others: usize = (all.iter())
            .filter(|(who, _)| who.is_some())
            .map(|(_, count)| count)
            .sum();
        let is_one_too_many = match who {
            None => of_one >= OF_OWNER_MAX,
            Some(_) => of_one >= OF_ONE_MAX || of_others >= OF_OTHERS_MAX,
        };
        if is_one_too_many {
            return None;
        }
        all.insert(who, of_one + 1);
        let of = Arc::clone(self);
        Some(Counted { of, who })
    }
}

impl Drop for Counted {
    fn drop(&mut self) {
        let mut all = self.of.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(count) = all.get_mut(&self.who) {
            *count -= 1;
            if *count == 0 {
                all.remove(&self.who);
            }
        }
    }
}

/// Takes connections for ever.
async fn take(listener: Listener, panel: Arc<Panel>) -> io::Result<()> {
    let (is_loopback, peers) = (listener.is_loopback(), listener.peers);
    let socket = TcpListener::from_std(listener.socket)?;
    let router = router(&panel);
    let tls = panel.settings.tls.as_ref().map(Tls::acceptor);
    let connected = Arc::new(Connected::default());
    loop {
        let (stream, far) = match socket.accept().await {
            Ok(connection) => connection,
            Err(cause) => {
                // Too many files, or somebody who has gone already: the next may be taken.
                tracing::warn!(%cause, "a connection could not be taken");
                tokio::time::sleep(Duration::from_millis(100)).await;
                continue;
            }
        };
        let Ok(near) = stream.local_addr() else { continue };
        let is_owner = is_loopback && peers.is_own(near, far);
        let Some(counted) = connected.count((!is_owner).then(|| far.ip())) else {
            tracing::warn!(%far, "disconnected: too many connections");
            continue;
        };
        let connection = Connection { near, far, is_owner };
        let (router, tls) = (router.clone(), tls.clone());
        tokio::spawn(async move {
            let _counted = counted;
            serve_one(stream, tls, connection, router).await;
        });
    }
}

async fn serve_one(stream: TcpStream, tls: Option<TlsAcceptor>, connection: Connection, router: Router) {
    // Without them it is served a little worse.
    let _ = stream.set_nodelay(true);
    let _ = nix::sys::socket::setsockopt(&stream, nix::sys::socket::sockopt::SndBuf, &UNREAD_MAX);
    let Some(tls) = tls else {
        return converse(stream, connection, router).await;
    };
    let mut first = [0];
    match timeout(HEAD_WAIT, stream.peek(&mut first)).await {
        Ok(Ok(1)) if first[0] == HANDSHAKE => {}
        Ok(Ok(1)) => return say_encrypted(stream).await,
        _ => return,
    }
    match timeout(HEAD_WAIT, tls.accept(stream)).await {
        Ok(Ok(stream)) => converse(stream, connection, router).await,
        Ok(Err(cause)) => tracing::debug!(far = %connection.far, %cause, "disconnected"),
        Err(_) => tracing::debug!(far = %connection.far, "disconnected: no handshake"),
    }
}

/// Answers somebody who has come without encryption.
async fn say_encrypted(mut stream: TcpStream) {
    let body = "{\"error\": \"this panel is encrypted: its address begins with https://\"}\n";
    let answer = format!(
        "HTTP/1.1 400 Bad Request\r\nContent-Type: application/json\r\nContent-Length: {}\r\nConnection: close\r\n\r\n{body}",
        body.len()
    );
    let said = async {
        // What he sends is read as far as a head goes: else the system takes the answer back.
        let _ = stream.read(&mut vec![0; HEAD_MAX]).await?;
        stream.write_all(answer.as_bytes()).await?;
        stream.shutdown().await
    };
    // Whoever does not read it has gone.
    let _ = timeout(HEAD_WAIT, said).await;
}

/// Requests and answers of one connection, until its end.
pub(crate) async fn converse<S>(stream: S, connection: Connection, router: Router)
where
    S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
{
    let service = hyper::service::service_fn(move |request: hyper::Request<Incoming>| {
        let mut request: Request = request.map(Body::new);
        request.extensions_mut().insert(connection);
        router.clone().oneshot(request)
    });
    let served = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEAD_WAIT)
        .max_buf_size(HEAD_MAX)
        .serve_connection(TokioIo::new(stream), service)
        .with_upgrades();
    if let Err(cause) = served.await {
        tracing::debug!(far = %connection.far, %cause, "disconnected");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nobody_takes_the_connections_of_the_user_of_the_control() {
        let connected = Arc::new(Connected::default());
        let take = |who: Option<[u8; 4]>, wanted: usize| -> Vec<Counted> {
            let who = who.map(IpAddr::from);
            (0..wanted).map_while(|_| connected.count(who)).collect()
        };
        // Another user of this PC has all addresses of the loopback.
        let all: Vec<Vec<Counted>> = (1..=5).map(|last| take(Some([127, 0, 0, last]), 1000)).collect();
        assert_eq!(all.iter().map(Vec::len).collect::<Vec<_>>(), [64, 64, 0, 0, 0]);
        let own = take(None, 1000);
        assert_eq!(own.len(), OF_OWNER_MAX);
        drop(all);
        assert_eq!(take(Some([192, 0, 2, 7]), 1000).len(), OF_ONE_MAX);
        drop(own);
        assert!(connected.0.lock().unwrap().is_empty());
    }
}
