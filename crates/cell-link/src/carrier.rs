//! Zenoh as it is used here, and certificates.
//!
//! In:  addresses, files of certificates and keys. Out: a session, or in words why there is none.
//!
//! A star: the supervisor listens as a router, controls are its clients. No multicast, no gossip, TLS 1.3 with certificates of both
//! sides and nothing else. Only the supervisor's certificate may serve (extended key usage), so no machine can stand in its place.
//!
//! Zenoh 1.10.2 reads and writes a TLS stream in two threads at the same time, which rustls does not bear
//! (<https://github.com/eclipse-zenoh/zenoh/issues/2557>): where packets are lost, a supervisor of 256 controls ended within a minute, as it
//! asked for 140 TB of memory. So one thread serves all links of a process ([`prepare`]). What would hold it up is kept short when Zenoh is
//! compiled (`.cargo/config.toml`).

use crate::message::{MESSAGE_MAX, PROGRAM_MAX};
use serde_json::{Value, json};
use std::net::{SocketAddr, TcpStream, ToSocketAddrs};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::Duration;
use x509_parser::prelude::{FromDer, Pem, X509Certificate};
use x509_parser::time::ASN1Time;
use zenoh::{Session, Wait};

/// Longest file of a certificate or a key, octets.
const PEM_MAX: u64 = 64 << 10;
/// Longest wait for somebody who listens.
const REACH: Duration = Duration::from_secs(2);
/// A link that says nothing for so long is over.
pub const LEASE: Duration = Duration::from_secs(4);

/// What Zenoh says beside a message, octets, and more.
const BESIDE: usize = 64 << 10;

/// Where Zenoh reads how many threads it has, and what it reads there: what is sent and who connects is of the thread that receives.
const THREADS: (&str, &str) = (
    "ZENOH_RUNTIME",
    "(rx:(worker_threads:1),tx:(handover:rx),acc:(handover:rx))",
);
// Without them links hold each other up, see `.cargo/config.toml`.
const _: () = assert!(
    option_env!("TLS_ACCEPT_THROTTLE_TIME").is_some() && option_env!("TLS_LINGER_TIMEOUT").is_some(),
    "build this in the folder of isocnc, or with TLS_ACCEPT_THROTTLE_TIME=1000 and TLS_LINGER_TIMEOUT=0 in the environment"
);

/// Has Zenoh serve all links of this process by one thread. To be called first of all: the process has no second thread yet.
pub fn prepare() {
    // SAFETY: nobody else reads the environment meanwhile, as there is nobody else.
    unsafe { std::env::set_var(THREADS.0, THREADS.1) };
}

/// Files of one side.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Certificate of this side (PEM).
    pub certificate: PathBuf,
    /// Its key.
    pub key: PathBuf,
    /// The certificate of the cell's authority.
    pub ca: PathBuf,
}

/// What is wrong with the carrier.
#[derive(Debug, thiserror::Error)]
pub enum CarrierError {
    /// A file of the identity.
    #[error("{}: {what}", .file.display())]
    File {
        /// Which one.
        file: PathBuf,
        /// What is wrong with it.
        what: String,
    },
    /// Zenoh has no session.
    #[error("{0}")]
    Session(String),
}

/// The common name of a certificate, as of `mill-1.3`: the machine, and the number of its certificate.
///
/// # Errors
/// The file cannot be read, or holds no certificate with such a name.
pub fn common_name(file: &Path) -> Result<String, CarrierError> {
    let text = files::read::read(file, PEM_MAX).map_err(|cause| wrong(file, cause))?;
    common_name_of(&text).ok_or_else(|| wrong(file, "holds no certificate (PEM) with a common name"))
}

/// The common name of a certificate in PEM.
pub fn common_name_of(pem: &[u8]) -> Option<String> {
    let pem = Pem::iter_from_buffer(pem).next()?.ok()?;
    let (_, certificate) = X509Certificate::from_der(&pem.contents).ok()?;
    let name = certificate.subject().iter_common_name().next()?.as_str().ok()?;
    Some(name.to_owned())
}

/// The machine of a certificate's common name; `None`: it is none of a machine.
pub fn machine_of(common_name: &str) -> Option<&str> {
    let (machine, number) = common_name.rsplit_once('.')?;
    let is_number = !number.is_empty() && number.bytes().all(|octet| octet.is_ascii_digit());
    (is_number && crate::message::is_machine(machine)).then_some(machine)
}

/// Keys of Zenoh's configuration that both sides have; what comes is `longest` octets at the most.
fn common(mode: &str, longest: usize, tls: Value) -> Value {
    json!({
        "mode": mode,
        "scouting": { "multicast": { "enabled": false }, "gossip": { "enabled": false } },
        "timestamping": { "enabled": false },
        "adminspace": { "enabled": false },
        "transport": {
            "link": { "protocols": ["tls"], "tx": { "lease": LEASE.as_millis() as u64 }, "rx": { "max_message_size": longest },
                      "tls": tls },
            "unicast": { "max_sessions": 600, "accept_pending": 600, "max_links": 1 },
        },
    })
}

/// What is wrong with a file.
fn wrong(file: &Path, what: impl ToString) -> CarrierError {
    CarrierError::File {
        file: file.to_owned(),
        what: what.to_string(),
    }
}

/// The path of a file, once it has been looked at: Zenoh opens it itself, and says less of what is wrong.
fn path(file: &Path) -> Result<&str, CarrierError> {
    let text = files::read::read(file, PEM_MAX).map_err(|cause| wrong(file, cause))?;
    if Pem::iter_from_buffer(&text).next().is_none_or(|pem| pem.is_err()) {
        return Err(wrong(file, "holds nothing in PEM"));
    }
    file.to_str().ok_or_else(|| wrong(file, "its path is no UTF-8"))
}

/// The same of a certificate, which must count now: encryption says less of that, and says it to the other side.
fn certificate(file: &Path) -> Result<&str, CarrierError> {
    let text = files::read::read(file, PEM_MAX).map_err(|cause| wrong(file, cause))?;
    let pem = Pem::iter_from_buffer(&text).next().and_then(Result::ok);
    if let Some(pem) = pem
        && let Ok((_, certificate)) = X509Certificate::from_der(&pem.contents)
        && let validity = certificate.validity()
        && !validity.is_valid()
    {
        return Err(wrong(
            file,
            format!(
                "counts from {} to {}, and this PC's clock says {}",
                validity.not_before,
                validity.not_after,
                ASN1Time::now()
            ),
        ));
    }
    path(file)
}

/// The same of a key.
fn secret(file: &Path) -> Result<&str, CarrierError> {
    let mode = std::fs::metadata(file).map_err(|cause| wrong(file, cause))?.mode();
    match mode & 0o007 {
        0 => path(file),
        _ => Err(wrong(
            file,
            "everybody may read or write this key: chmod 600 it, and have a new one made",
        )),
    }
}

/// What Zenoh says, without the places in its sources.
fn in_words(said: &str) -> String {
    let is_place = |word: &str| {
        word.trim_end_matches(['.', ')'])
            .rsplit_once(".rs:")
            .is_some_and(|(_, line)| !line.is_empty() && line.bytes().all(|octet| octet.is_ascii_digit()))
    };
    let mut words: Vec<&str> = Vec::new();
    for word in said.split_whitespace() {
        match is_place(word) && words.last() == Some(&"at") {
            true => _ = words.pop(),
            false => words.push(word),
        }
    }
    words.join(" ")
}

fn open(config: &Value) -> Result<Session, CarrierError> {
    if std::env::var(THREADS.0).as_deref() != Ok(THREADS.1) {
        return Err(CarrierError::Session(format!(
            "{}={} is not set, without which two threads use a link at the same time: call prepare first",
            THREADS.0, THREADS.1
        )));
    }
    let failed = |cause: zenoh::Error| CarrierError::Session(in_words(&cause.to_string()));
    let config = zenoh::Config::from_json5(&config.to_string()).map_err(failed)?;
    zenoh::open(config).wait().map_err(failed)
}

/// A session of a control with the supervisor at `address`; it is made again by itself whenever it is lost.
///
/// # Errors
/// A file is wrong, or the supervisor cannot be reached now.
pub fn connect(address: &str, identity: &Identity) -> Result<Session, CarrierError> {
    let mut config = common(
        "client",
        PROGRAM_MAX + BESIDE,
        json!({
            "root_ca_certificate": certificate(&identity.ca)?,
            "enable_mtls": true,
            "connect_certificate": certificate(&identity.certificate)?,
            "connect_private_key": secret(&identity.key)?,
            // The list of authorities of the web counts as well, which no name of a cell can have.
            "verify_name_on_connect": true,
            "close_link_on_expiration": true,
        }),
    );
    config["connect"] = json!({
        "endpoints": [format!("tls/{address}")],
        "timeout_ms": 5000,
        "exit_on_failure": true,
        "retry": { "period_init_ms": 250, "period_max_ms": 2000, "period_increase_factor": 2 },
    });
    open(&config).map_err(|cause| match cause {
        CarrierError::Session(said) => CarrierError::Session(why_not(address, &said)),
        file => file,
    })
}

/// Why nobody is reached: Zenoh says the same of a cable and of a certificate.
fn why_not(address: &str, said: &str) -> String {
    let places = address.to_socket_addrs().map(Iterator::collect::<Vec<_>>);
    let reached = places.map(|places| (places.iter()).any(|place| TcpStream::connect_timeout(place, REACH).is_ok()));
    match reached {
        Err(cause) => cause.to_string(),
        Ok(true) => format!(
            "somebody listens there, but there is no link: both certificates must be of one cell, and that of the supervisor be made for \
             this name or address ({said})"
        ),
        Ok(false) => "nobody answers there".into(),
    }
}

/// The session of the supervisor, listening; clients are those of `machines`, by the common names of their certificates, and each
/// may speak for itself alone.
///
/// # Errors
/// A file is wrong, or the address cannot be had.
pub fn listen(address: SocketAddr, identity: &Identity, machines: &[String]) -> Result<Session, CarrierError> {
    let mut config = common(
        "router",
        MESSAGE_MAX + BESIDE,
        json!({
            "root_ca_certificate": certificate(&identity.ca)?,
            "enable_mtls": true,
            "listen_certificate": certificate(&identity.certificate)?,
            "listen_private_key": secret(&identity.key)?,
            "close_link_on_expiration": true,
        }),
    );
    config["listen"] = json!({ "endpoints": [format!("tls/{address}")] });
    config["access_control"] = access(machines);
    open(&config)
}

/// Who may say what: everything that is not allowed here is refused.
fn access(machines: &[String]) -> Value {
    let named: Vec<(&String, &str)> = (machines.iter())
        .filter_map(|name| machine_of(name).map(|machine| (name, machine)))
        .collect();
    let rules: Vec<Value> = (named.iter())
        .map(|(name, machine)| {
            json!({
                "id": name,
                "permission": "allow",
                "key_exprs": [format!("cell/{machine}/**")],
                // What a control does, and what the supervisor does at it.
                "messages": ["put", "declare_subscriber", "declare_queryable", "query", "reply", "liveliness_token",
                             "declare_liveliness_subscriber", "liveliness_query"],
                "flows": ["ingress", "egress"],
            })
        })
        .collect();
    let subjects: Vec<Value> = (named.iter())
        .map(|(name, _)| json!({ "id": name, "cert_common_names": [name] }))
        .collect();
    let policies: Vec<Value> = (named.iter())
        .map(|(name, _)| json!({ "rules": [name], "subjects": [name] }))
        .collect();
    json!({
        "enabled": true,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_certificates_are_machine_and_number() {
        assert_eq!(machine_of("mill-1.12"), Some("mill-1"));
        for name in ["mill-1", "mill.", ".1", "Mill.1", "a.b", "supervisor"] {
            assert_eq!(machine_of(name), None, "{name}");
        }
        assert_eq!(common_name_of(b"-----BEGIN CERTIFICATE-----\nAA\n"), None);
    }

    #[test]
    fn words_of_zenoh_have_no_places_of_its_sources() {
        let said = "Cannot listen on 1.2.3.4:5: in use (os error 98) at /x/tcp.rs:61. at /x/unicast.rs:432.";
        assert_eq!(in_words(said), "Cannot listen on 1.2.3.4:5: in use (os error 98)");
        assert_eq!(in_words("no room at all"), "no room at all");
    }

    #[test]
    fn what_is_told_to_zenoh_is_what_it_knows() {
        let mut config = common("router", 1 << 20, json!({ "enable_mtls": true }));
        config["access_control"] = access(&["a.1".into(), "b.2".into()]);
        zenoh::Config::from_json5(&config.to_string()).unwrap();
        let gone = Identity {
            certificate: "gone.crt".into(),
            key: "gone.key".into(),
            ca: "gone.ca".into(),
        };
        assert!(why_not("127.0.0.1:1", "x").starts_with("nobody answers there"));
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let listens = listener.local_addr().unwrap().to_string();
        assert!(why_not(&listens, "x").starts_with("somebody listens there"));
        let error = connect("127.0.0.1:1", &gone).unwrap_err();
        assert!(error.to_string().starts_with("gone.ca: "), "{error}");
    }
}
