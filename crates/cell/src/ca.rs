//! The authority of a cell: certificates of its machines.
//!
//! In:  a folder, names of machines. Out: `ca.crt`, `ca.key`, `issued.json`, and for each machine `NAME.crt` and `NAME.key`.
//!
//! A machine's certificate is called `NAME.N`, N being its number: where one is lost, it alone is revoked. Machines' certificates may
//! not serve, and the supervisor's may do nothing else.

use crate::trust;
use cell_link::message::{MACHINE_MAX, is_machine};
use rcgen::{
    BasicConstraints, CertificateParams, DistinguishedName, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair,
    KeyUsagePurpose, SanType,
};
use serde::{Deserialize, Serialize};
use std::net::IpAddr;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use time::{Duration, OffsetDateTime};

/// Days for which certificates count: of the authority, of machines.
const CA_DAYS: i64 = 365 * 20;
const MACHINE_DAYS: i64 = 365 * 5;
/// Longest file of it, octets.
const FILE_MAX: u64 = 4 << 20;

/// What is wrong with an authority.
#[derive(Debug, thiserror::Error)]
pub enum CaError {
    #[error("{}: {what}", .file.display())]
    /// A file of the authority.
    File {
        /// Which one.
        file: PathBuf,
        /// What is wrong with it.
        what: String,
    },
    #[error("{0:?} cannot name a machine: small letters, digits and '-', up to {MACHINE_MAX}")]
    /// No machine can be called so.
    Name(String),
    #[error("{0:?} has no certificate that could be revoked: isocnc-cell ca list --dir CA")]
    /// There is no such certificate.
    NotIssued(String),
    #[error("{0}: there is no authority: isocnc-cell ca init --dir {0}")]
    /// There is no authority.
    None(String),
    #[error("{0}: there is an authority already, and all its certificates would be worth nothing")]
    /// There is an authority already.
    Exists(String),
    #[error("a certificate cannot be made")]
    /// The library that makes certificates refused.
    Rcgen(#[from] rcgen::Error),
}

/// A certificate that was issued.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Issued {
    /// Name of the machine.
    pub machine: String,
    /// Number of the certificate, from 1 on.
    pub number: u64,
    /// Seconds since 1970, UTC.
    pub issued_unix_s: i64,
    /// Seconds since 1970, UTC.
    pub expires_unix_s: i64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    /// Since when it counts no more, seconds since 1970, UTC.
    pub revoked_unix_s: Option<i64>,
}

impl Issued {
    /// Its common name.
    pub fn name(&self) -> String {
        format!("{}.{}", self.machine, self.number)
    }
}

/// An authority in its folder.
#[derive(Debug)]
pub struct Ca {
    folder: PathBuf,
}

fn at(file: &Path) -> impl Fn(std::io::Error) -> CaError + '_ {
    |cause| CaError::File {
        file: file.to_owned(),
        what: cause.to_string(),
    }
}

fn read(file: &Path) -> Result<String, CaError> {
    files::read_text(file, FILE_MAX).map_err(at(file))
}

fn write(file: &Path, text: &str, is_secret: bool) -> Result<(), CaError> {
    if !is_secret || trust::secret(file).is_ok() {
        return files::write(file, text).map_err(at(file));
    }
    // Empty until only its user can read it.
    let written = files::write(file, "")
        .and_then(|()| std::fs::set_permissions(file, std::fs::Permissions::from_mode(0o600)))
        .and_then(|()| files::write(file, text));
    if written.is_err() {
        // An empty one would be taken for a key; the cause is told.
        let _ = files::remove(file);
    }
    written.map_err(at(file))
}

fn params(name: &str, days: i64) -> CertificateParams {
    let mut params = CertificateParams::default();
    params.distinguished_name = DistinguishedName::new();
    params.distinguished_name.push(DnType::CommonName, name);
    let now = OffsetDateTime::now_utc();
    // Clocks of a shop differ.
    (params.not_before, params.not_after) = (now - Duration::days(1), now + Duration::days(days));
    params
}

impl Ca {
    /// The authority of a folder.
    pub fn of(folder: &Path) -> Ca {
        Ca {
            folder: folder.to_owned(),
        }
    }

    /// Makes an authority.
    ///
    /// # Errors
    /// There is one, or the folder cannot be written.
    pub fn init(folder: &Path) -> Result<Ca, CaError> {
        let ca = Ca::of(folder);
        files::make_folder(folder).map_err(at(folder))?;
        trust::folder(folder).map_err(at(folder))?;
        for file in [ca.certificate(), ca.key()] {
            if file.symlink_metadata().is_ok() {
                return Err(CaError::Exists(file.display().to_string()));
            }
        }
        let key = KeyPair::generate()?;
        let mut params = params("isocnc cell", CA_DAYS);
        params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
        params.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign];
        let made = params.self_signed(&key)?;
        let written = write(&ca.key(), &key.serialize_pem(), true)
            .and_then(|()| ca.write_issued(&[]))
            .and_then(|()| write(&ca.certificate(), &made.pem(), false));
        if written.is_err() {
            // Half an authority would be in the way of another try; the cause is told.
            let _ = files::remove(&ca.key());
        }
        written.map(|()| ca)
    }

    /// Its certificate, which every control has beside its own.
    pub fn certificate(&self) -> PathBuf {
        self.folder.join("ca.crt")
    }

    fn key(&self) -> PathBuf {
        self.folder.join("ca.key")
    }

    /// The list of what was issued and revoked.
    pub fn list(&self) -> PathBuf {
        self.folder.join("issued.json")
    }

    /// What was issued.
    ///
    /// # Errors
    /// The list cannot be read.
    pub fn issued(&self) -> Result<Vec<Issued>, CaError> {
        self.is_there()?;
        let file = self.list();
        serde_json::from_str(&read(&file)?).map_err(|error| CaError::File {
            what: error.to_string(),
            file,
        })
    }

    fn write_issued(&self, issued: &[Issued]) -> Result<(), CaError> {
        // Names and numbers only.
        let text = serde_json::to_string_pretty(issued).unwrap_or_default();
        write(&self.list(), &(text + "\n"), false)
    }

    /// Names of certificates that count, and of those that were revoked.
    ///
    /// # Errors
    /// The list cannot be read.
    pub fn valid(&self) -> Result<(Vec<String>, Vec<String>), CaError> {
        let (revoked, valid): (Vec<Issued>, Vec<Issued>) =
            self.issued()?.into_iter().partition(|one| one.revoked_unix_s.is_some());
        let names = |all: Vec<Issued>| all.iter().map(Issued::name).collect();
        Ok((names(valid), names(revoked)))
    }

    /// That there is one.
    fn is_there(&self) -> Result<(), CaError> {
        match self.certificate().try_exists() {
            Ok(false) => Err(CaError::None(self.folder.display().to_string())),
            _ => Ok(()),
        }
    }

    fn issuer(&self) -> Result<Issuer<'static, KeyPair>, CaError> {
        let key = self.key();
        self.is_there()?;
        trust::folder(&self.folder).map_err(at(&self.folder))?;
        trust::secret(&key).map_err(at(&key))?;
        let pair = KeyPair::from_pem(&read(&key)?).map_err(|error| CaError::File {
            file: key,
            what: format!("holds no key: {error}"),
        })?;
        let file = self.certificate();
        Issuer::from_ca_cert_pem(&read(&file)?, pair).map_err(|error| CaError::File {
            file,
            what: format!("holds no certificate of an authority: {error}"),
        })
    }

    /// Makes the certificate of a machine.
    ///
    /// # Errors
    /// The name cannot name a machine, or the folder cannot be read or written.
    pub fn issue(&self, machine: &str) -> Result<Issued, CaError> {
        if !is_machine(machine) || machine == "ca" {
            return Err(CaError::Name(machine.to_owned()));
        }
        let issuer = self.issuer()?;
        let mut issued = self.issued()?;
        let now = OffsetDateTime::now_utc().unix_timestamp();
        let one = Issued {
            machine: machine.to_owned(),
            number: 1 + issued.iter().map(|one| one.number).max().unwrap_or(0),
            issued_unix_s: now,
            expires_unix_s: now + MACHINE_DAYS * 86_400,
            revoked_unix_s: None,
        };
        let key = KeyPair::generate()?;
        let mut params = params(&one.name(), MACHINE_DAYS);
        params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ClientAuth];
        params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
        let made = params.signed_by(&key, &issuer)?;
        write(&self.folder.join(format!("{machine}.key")), &key.serialize_pem(), true)?;
        write(&self.folder.join(format!("{machine}.crt")), &made.pem(), false)?;
        // Only now it counts.
        issued.push(one.clone());
        self.write_issued(&issued)?;
        Ok(one)
    }

    /// Revokes all certificates of a machine (`NAME`), or one of them (`NAME.N`); gives how many.
    ///
    /// # Errors
    /// There is none, or the list cannot be written.
    pub fn revoke(&self, name: &str) -> Result<usize, CaError> {
        let mut issued = self.issued()?;
        let mut count = 0;
        for one in &mut issued {
            if one.revoked_unix_s.is_none() && (one.machine == name || one.name() == name) {
                one.revoked_unix_s = Some(OffsetDateTime::now_utc().unix_timestamp());
                count += 1;
            }
        }
        match count {
            0 => Err(CaError::NotIssued(name.to_owned())),
            _ => self.write_issued(&issued).map(|()| count),
        }
    }

    /// Makes the certificate of the supervisor for these names and addresses, in this folder.
    ///
    /// # Errors
    /// As [`Ca::issue`].
    pub fn issue_server(&self, folder: &Path, names: &[String]) -> Result<(PathBuf, PathBuf), CaError> {
        let key = KeyPair::generate()?;
        let mut params = params("supervisor", MACHINE_DAYS);
        params.subject_alt_names = names
            .iter()
            .map(|name| match name.parse::<IpAddr>() {
                Ok(address) => Ok(SanType::IpAddress(address)),
                Err(_) => name.as_str().try_into().map(SanType::DnsName),
            })
            .collect::<Result<_, _>>()?;
        params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ServerAuth];
        params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
        let made = params.signed_by(&key, &self.issuer()?)?;
        let (certificate, secret) = (folder.join("supervisor.crt"), folder.join("supervisor.key"));
        write(&secret, &key.serialize_pem(), true)?;
        write(&certificate, &made.pem(), false)?;
        Ok((certificate, secret))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cell_link::carrier::common_name;

    #[test]
    fn what_is_issued_is_known_until_it_is_revoked() {
        let folder = tempfile::tempdir().unwrap();
        let ca = Ca::init(folder.path()).unwrap();
        assert!(matches!(Ca::init(folder.path()), Err(CaError::Exists(_))));
        for name in ["", "Mill", "../x", "ca", "a.b"] {
            assert!(ca.issue(name).is_err(), "{name}");
        }
        for _ in 0..2 {
            ca.issue("mill-1").unwrap();
        }
        ca.issue("lathe").unwrap();
        assert_eq!(common_name(&folder.path().join("mill-1.crt")).unwrap(), "mill-1.2");
        let mode = |name: &str| {
            std::fs::metadata(folder.path().join(name))
                .unwrap()
                .permissions()
                .mode()
                & 0o777
        };
        assert_eq!([mode("ca.key"), mode("mill-1.key")], [0o600; 2]);
        assert_eq!(ca.revoke("mill-1.1").unwrap(), 1);
        let (valid, revoked) = ca.valid().unwrap();
        assert_eq!(
            (valid, revoked),
            (vec!["mill-1.2".into(), "lathe.3".into()], vec!["mill-1.1".to_owned()])
        );
        assert_eq!(ca.revoke("mill-1").unwrap(), 1);
        assert!(ca.revoke("mill-1").is_err());
        std::fs::write(ca.list(), "[{}]").unwrap();
        let error = ca.issue("mill-2").unwrap_err().to_string();
        assert!(error.contains("issued.json: missing field"), "{error}");
    }

    #[test]
    fn a_certificate_that_does_not_count_at_this_time_is_told_with_its_file_and_the_clock() {
        use cell_link::carrier::{Identity, connect};
        let folder = tempfile::tempdir().unwrap();
        let ca = Ca::init(folder.path()).unwrap();
        ca.issue("mill").unwrap();
        let at = |name: &str| folder.path().join(name);
        let identity = Identity {
            certificate: at("mill.crt"),
            key: at("mill.key"),
            ca: at("ca.crt"),
        };
        let told = || connect("127.0.0.1:1", &identity).unwrap_err().to_string();
        assert!(told().starts_with("nobody answers there"));
        let (key, now) = (KeyPair::generate().unwrap(), OffsetDateTime::now_utc());
        for (from, to) in [(-9, -2), (2, 9)] {
            let mut params = params("mill.1", 1);
            (params.not_before, params.not_after) = (now + Duration::days(from), now + Duration::days(to));
            let made = params.signed_by(&key, &ca.issuer().unwrap()).unwrap();
            std::fs::write(at("mill.crt"), made.pem()).unwrap();
            let told = told();
            assert!(
                told.contains("mill.crt: counts from") && told.contains("this PC's clock says"),
                "{told}"
            );
        }
        std::fs::write(at("ca.crt"), "x").unwrap();
        let told = ca.issue("mill").unwrap_err().to_string();
        assert!(told.contains("ca.crt: holds no certificate"), "{told}");
        std::fs::write(at("ca.key"), "x").unwrap();
        let told = ca.issue("mill").unwrap_err().to_string();
        assert!(told.contains("ca.key: holds no key"), "{told}");
    }
}
