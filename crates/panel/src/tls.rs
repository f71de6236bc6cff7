//! Encryption: whoever listens on the network hears neither tokens nor orders.
//!
//! In:  a certificate and its key, as files of an authority of the user's own; or nothing: then a certificate is made that nobody has
//! signed, and kept. Out: what a connection is encrypted with, and the fingerprint by which a browser's user knows it.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use rcgen::{CertificateParams, DistinguishedName, DnType, KeyPair, date_time_ymd};
use rustls::ServerConfig;
use rustls::crypto::ring::default_provider;
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer, PrivatePkcs8KeyDer};
use sha2::{Digest, Sha256};
use std::fmt;
use std::io::{ErrorKind, Read};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tokio_rustls::TlsAcceptor;

/// Longest file of a certificate or a key, octets.
const FILE_MAX: u64 = 256 * 1024;
/// Years in which a certificate of our own counts. A browser that does not know its authority asks its user anyway.
const YEARS: [i32; 2] = [2025, 2055];
/// Octets of a line of PEM (RFC 7468).
const PEM_LINE: usize = 64;

/// Why nothing can be encrypted.
#[derive(Debug)]
pub struct TlsError {
    /// Which file; `None`: none.
    path: Option<PathBuf>,
    what: String,
}

impl fmt::Display for TlsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.path {
            Some(path) => write!(f, "{}: {}", path.display(), self.what),
            None => f.write_str(&self.what),
        }
    }
}

impl std::error::Error for TlsError {}

fn failed(path: &Path, what: impl fmt::Display) -> TlsError {
    TlsError {
        path: Some(path.to_owned()),
        what: what.to_string(),
    }
}

/// What connections are encrypted with.
#[derive(Clone, Debug)]
pub struct Tls {
    config: Arc<ServerConfig>,
    fingerprint: String,
}

impl Tls {
    /// A certificate, with those that have signed it behind it, and its key; both PEM.
    ///
    /// # Errors
    /// One of them cannot be read, is none, or they do not belong together; everybody may read the key.
    pub fn of_files(certificate: &Path, key: &Path) -> Result<Tls, TlsError> {
        let chain: Result<Vec<_>, _> =
            CertificateDer::pem_slice_iter(&read(certificate, "certificate", false)?).collect();
        let chain = chain.map_err(|error| failed(certificate, format!("no certificate (PEM): {error}")))?;
        if chain.is_empty() {
            return Err(failed(certificate, "holds no certificate (PEM)"));
        }
        let secret = PrivateKeyDer::from_pem_slice(&read(key, "key", true)?)
            .map_err(|error| failed(key, format!("no private key (PEM): {error}")))?;
        Tls::new(chain, secret).map_err(|error| {
            let what = format!("cannot be used with the key {}: {error}", key.display());
            failed(certificate, what)
        })
    }

    /// The certificate that was made here before, or a new one for these names and addresses of this PC; kept in `folder`, without
    /// which the next start makes another one.
    ///
    /// # Errors
    /// As [`Tls::of_files`]; the folder cannot be written.
    pub fn own(folder: Option<&Path>, names: &[String]) -> Result<Tls, TlsError> {
        let files = folder.map(|folder| (folder.join("panel-certificate.pem"), folder.join("panel-key.pem")));
        if let Some((certificate, key)) = &files
            && (certificate.exists() || key.exists())
        {
            return Tls::of_files(certificate, key);
        }
        let unmade = |error: rcgen::Error| TlsError {
            path: None,
            what: format!("a certificate cannot be made: {error}"),
        };
        let secret = KeyPair::generate().map_err(unmade)?;
        let mut params = CertificateParams::new(names).map_err(unmade)?;
        params.distinguished_name = DistinguishedName::new();
        params.distinguished_name.push(DnType::CommonName, "isocnc panel");
        [params.not_before, params.not_after] = YEARS.map(|year| date_time_ymd(year, 1, 1));
        let made = params.self_signed(&secret).map_err(unmade)?;
        if let (Some(folder), Some((certificate, key))) = (folder, &files) {
            files::make_folder(folder).map_err(|cause| failed(folder, cause))?;
            keep(key, &pem("PRIVATE KEY", secret.serialized_der()))?;
            keep(certificate, &pem("CERTIFICATE", made.der()))?;
        }
        let key = PrivateKeyDer::Pkcs8(PrivatePkcs8KeyDer::from(secret.serialize_der()));
        Tls::new(vec![made.der().clone()], key).map_err(|error| TlsError {
            path: None,
            what: format!("a certificate that was just made cannot be used: {error}"),
        })
    }

    fn new(chain: Vec<CertificateDer<'static>>, key: PrivateKeyDer<'static>) -> Result<Tls, rustls::Error> {
        let fingerprint = chain.first().map(|first| fingerprint(first)).unwrap_or_default();
        let mut config = ServerConfig::builder_with_provider(Arc::new(default_provider()))
            .with_safe_default_protocol_versions()?
            .with_no_client_auth()
            .with_single_cert(chain, key)?;
        config.alpn_protocols = vec![b"http/1.1".to_vec()];
        Ok(Tls {
            config: Arc::new(config),
            fingerprint,
        })
    }

    /// SHA-256 of the certificate, as browsers show it: pairs of digits and colons.
    pub fn fingerprint(&self) -> &str {
        &self.fingerprint
    }

    pub(crate) fn acceptor(&self) -> TlsAcceptor {
        TlsAcceptor::from(Arc::clone(&self.config))
    }
}

fn fingerprint(certificate: &[u8]) -> String {
    let pairs: Vec<String> = Sha256::digest(certificate)
        .iter()
        .map(|octet| format!("{octet:02X}"))
        .collect();
    pairs.join(":")
}

fn read(path: &Path, what: &str, is_secret: bool) -> Result<Vec<u8>, TlsError> {
    let unread = |cause: std::io::Error| match cause.kind() {
        ErrorKind::NotFound => failed(
            path,
            format!("there is no such file: the {what} of [panel] in the machine file"),
        ),
        _ => failed(path, format!("the {what} of [panel] cannot be read: {cause}")),
    };
    let file = files::open(path).map_err(unread)?;
    let mode = file.metadata().map_err(unread)?.mode();
    if is_secret && mode & 0o007 != 0 {
        return Err(failed(
            path,
            "everybody may read or write this key: chmod 600 it, and have a new one made",
        ));
    }
    let mut octets = Vec::new();
    file.take(FILE_MAX + 1).read_to_end(&mut octets).map_err(unread)?;
    if octets.len() as u64 > FILE_MAX {
        return Err(failed(path, format!("is longer than {FILE_MAX} octets")));
    }
    Ok(octets)
}

/// Writes a file that is its user's alone from its beginning.
fn keep(path: &Path, text: &str) -> Result<(), TlsError> {
    use std::io::Write;
    use std::os::unix::fs::OpenOptionsExt;
    let opened = std::fs::OpenOptions::new()
        .write(true)
        .create_new(true)
        .mode(0o600)
        .open(path);
    opened
        .and_then(|mut file| {
            file.write_all(text.as_bytes())?;
            file.sync_all()
        })
        .map_err(|cause| failed(path, cause))
}

/// RFC 7468.
fn pem(kind: &str, octets: &[u8]) -> String {
    let text = STANDARD.encode(octets);
    let lines: Vec<&str> = (0..text.len())
        .step_by(PEM_LINE)
        .map(|at| &text[at..text.len().min(at + PEM_LINE)])
        .collect();
    format!("-----BEGIN {kind}-----\n{}\n-----END {kind}-----\n", lines.join("\n"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn a_certificate_is_made_once_and_known_again() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path().join("state");
        let names = ["localhost".to_owned(), "192.0.2.7".to_owned()];
        let first = Tls::own(Some(&folder), &names).unwrap();
        assert_eq!(first.fingerprint().len(), 32 * 3 - 1);
        assert_eq!(
            Tls::own(Some(&folder), &names).unwrap().fingerprint(),
            first.fingerprint()
        );
        assert_ne!(Tls::own(None, &names).unwrap().fingerprint(), first.fingerprint());
        let key = folder.join("panel-key.pem");
        assert_eq!(fs::metadata(&key).unwrap().permissions().mode() & 0o777, 0o600);
    }

    #[test]
    fn what_cannot_be_read_or_used_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let [one, other] = ["one", "other"].map(|name| folder.path().join(name));
        for place in [&one, &other] {
            Tls::own(Some(place), &["localhost".into()]).unwrap();
        }
        let [certificate, key] = ["panel-certificate.pem", "panel-key.pem"].map(|name| one.join(name));
        let told = |certificate: &Path, key: &Path| Tls::of_files(certificate, key).unwrap_err().to_string();
        assert!(told(&folder.path().join("none.pem"), &key).contains("none.pem: there is no such file"));
        assert!(told(&key, &key).contains("holds no certificate"));
        assert!(told(&certificate, &certificate).contains("no private key"));
        assert!(told(&certificate, &other.join("panel-key.pem")).contains("cannot be used with the key"));
        fs::write(one.join("long"), vec![b'x'; FILE_MAX as usize + 1]).unwrap();
        assert!(told(&one.join("long"), &key).contains("longer than"));
        fs::set_permissions(&key, fs::Permissions::from_mode(0o644)).unwrap();
        assert!(told(&certificate, &key).contains("everybody may read"));
        // A key alone is not replaced: it may be what others know the machine by.
        fs::remove_file(other.join("panel-certificate.pem")).unwrap();
        assert!(
            Tls::own(Some(&other), &[])
                .unwrap_err()
                .to_string()
                .contains("there is no such file")
        );
    }
}
