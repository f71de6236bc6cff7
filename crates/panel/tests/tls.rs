//! A panel whose connections are encrypted, and clients of it: with the certificate, with another one, and without any.

use panel::{Control, Counts, Guest, Listener, Settings, Tls, serve};
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, ServerName};
use rustls::{ClientConfig, ClientConnection, RootCertStore, StreamOwned};
use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

/// A control that serves nobody.
struct Deaf;

impl Control for Deaf {
    fn connect(&self, _guest: &Guest) -> io::Result<UnixStream> {
        Err(ErrorKind::WouldBlock.into())
    }
}

fn connect(address: SocketAddr) -> TcpStream {
    let stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    stream
}

/// What is answered to a request by somebody who believes the certificate of this folder.
fn ask(address: SocketAddr, believed: &Path, request: &str) -> io::Result<String> {
    let mut roots = RootCertStore::empty();
    let file = believed.join("panel-certificate.pem");
    roots.add(CertificateDer::from_pem_file(file).unwrap()).unwrap();
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = ClientConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .unwrap()
        .with_root_certificates(roots)
        .with_no_client_auth();
    let name = ServerName::try_from("localhost").unwrap();
    let connection = ClientConnection::new(Arc::new(config), name).unwrap();
    let mut stream = StreamOwned::new(connection, connect(address));
    stream.write_all(request.as_bytes())?;
    let mut answer = Vec::new();
    match stream.read_to_end(&mut answer) {
        // It closes the connection without a farewell.
        Err(error) if error.kind() != ErrorKind::UnexpectedEof => return Err(error),
        _ => {}
    }
    Ok(String::from_utf8_lossy(&answer).into_owned())
}

#[test]
fn pages_are_read_by_whoever_believes_the_certificate_and_by_nobody_in_the_open() {
    let root = tempfile::tempdir().unwrap();
    let [own, other] = ["own", "other"].map(|name| root.path().join(name));
    let [tls, _] = [&own, &other].map(|folder| Tls::own(Some(folder), &["localhost".into()]).unwrap());
    let settings = Settings {
        tls: Some(tls),
        ..Settings::default()
    };
    let listener = Listener::bind("127.0.0.1:0".parse().unwrap()).unwrap();
    let address = listener.address();
    let (stays, until) = UnixStream::pair().unwrap();
    let serving =
        std::thread::spawn(move || serve(listener, settings, Arc::new(Deaf), Arc::<Counts>::default(), until));
    let request =
        |path: &str, head: &str| format!("GET {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n{head}\r\n");

    let page = ask(address, &own, &request("/", "")).unwrap();
    assert!(page.starts_with("HTTP/1.1 200") && page.contains("<title>"), "{page}");
    let refused = ask(address, &other, &request("/", "")).unwrap_err();
    assert_eq!(refused.kind(), ErrorKind::InvalidData, "{refused}");

    // Its own pages are those of https.
    let origin = |scheme: &str| format!("Origin: {scheme}://{address}\r\n");
    let same = ask(address, &own, &request("/files/", &origin("https"))).unwrap();
    assert!(
        same.starts_with("HTTP/1.1 404") && same.contains("folder of programs"),
        "{same}"
    );
    let foreign = ask(address, &own, &request("/files/", &origin("http"))).unwrap();
    assert!(foreign.starts_with("HTTP/1.1 403"), "{foreign}");

    let mut open = connect(address);
    open.write_all(request("/", "").as_bytes()).unwrap();
    let mut told = String::new();
    open.read_to_string(&mut told).unwrap();
    assert!(told.starts_with("HTTP/1.1 400") && told.contains("https://"), "{told}");

    drop(stays);
    serving.join().unwrap().unwrap();
}
