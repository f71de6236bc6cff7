//! `[cell]`: the link to the supervisor of a cell of machines.
//!
//! In:  the table of the machine file. Out: where the supervisor is, with which certificate, what it may do.

use super::section::{Section, keys};
use std::path::{Path, PathBuf};

const REMOTES: [(&str, Remote); 3] = [("off", Remote::Off), ("upload", Remote::Upload), ("run", Remote::Run)];

keys! {
    /// `[cell]`; `base`: folder of the machine file, `has_state`: the control may write by itself.
    #[derive(Clone, Debug, PartialEq, Eq)]
    pub struct Cell(section, base: &Path, has_state: bool) {
        /// Name or address, and port.
        pub supervisor: String = supervisor(section),
        /// Certificate of this machine, and its key.
        pub certificate: PathBuf = file(section, "certificate", "file with the certificate of this machine", base),
        pub key: PathBuf = file(section, "key", "file with the key of the certificate", base),
        /// Certificate of the authority of the cell.
        pub ca: PathBuf = file(section, "ca", "file with the certificate of the cell's authority", base),
        /// What the supervisor may do.
        pub remote: Remote = section.word("remote", &REMOTES, Remote::Off),
    }
    rules {
        if !has_state {
            let rule = "needs machine.state_directory: numbers of the journal and orders are known there after a restart";
            section.wrong("supervisor", rule);
        }
    }
}

pub use protocol::Remote;

/// Whether this is an address or a name, and a port.
fn is_place(text: &str) -> bool {
    let Some((host, port)) = text.rsplit_once(':') else {
        return false;
    };
    let is_bare = !host.is_empty() && !host.contains([':', '/', '[', ']']) && !host.contains(char::is_whitespace);
    let is_v6 = host.starts_with('[') && host.ends_with(']') && text.parse::<std::net::SocketAddr>().is_ok();
    (is_bare || is_v6) && port.parse::<u16>().is_ok_and(|port| port > 0)
}

fn supervisor(section: &mut Section<'_, '_>) -> Option<String> {
    let text = section.text("supervisor", "address and port of the supervisor")?;
    let is_right = is_place(text);
    if !is_right {
        let rule = "must be an address or a name, and a port, like \"192.168.1.10:7447\"";
        section.wrong("supervisor", rule);
    }
    is_right.then(|| text.to_owned())
}

fn file(section: &mut Section<'_, '_>, key: &'static str, what: &str, base: &Path) -> Option<PathBuf> {
    let text = section.text(key, what)?;
    if text.is_empty() {
        return section.refused(key, "must be a path");
    }
    Some(base.join(text))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parse;

    const DEMO: &str = include_str!("../../../configs/mill3-demo.toml");

    #[test]
    fn places_are_a_host_and_a_port() {
        for text in ["192.168.1.10:7447", "cell.local:1", "[::1]:7447"] {
            assert!(is_place(text), "{text}");
        }
        for text in [
            "",
            "host",
            ":1",
            "host:",
            "host:0",
            "host:70000",
            "::1:7",
            "tls/host:1",
            "a b:1",
        ] {
            assert!(!is_place(text), "{text}");
        }
    }

    #[test]
    fn every_key_is_asked_for_and_wrong_ones_are_told() {
        let read = |table: &str, state: bool| {
            let state = if state {
                "[machine]\nstate_directory = \"/tmp\""
            } else {
                "[machine]"
            };
            let text = DEMO.replacen("[machine]", state, 1);
            match parse(&format!("{text}\n{table}"), Path::new("m.toml")) {
                Ok(config) => Ok(config.cell),
                Err(errors) => Err(errors.to_string()),
            }
        };
        let whole = "[cell]\nsupervisor = \"h:1\"\ncertificate = \"m.crt\"\nkey = \"m.key\"\nca = \"ca.crt\"\n";
        let cell = read(&format!("{whole}remote = \"run\"\n"), true).unwrap().unwrap();
        assert_eq!((cell.remote, cell.ca), (Remote::Run, PathBuf::from("ca.crt")));
        assert_eq!(read(whole, true).unwrap().unwrap().remote, Remote::Off);
        for (text, state, expected) in [
            ("[cell]\n", true, "cell.certificate"),
            (whole, false, "needs machine.state_directory"),
            (&whole.replace("h:1", "h"), true, "and a port"),
            (&format!("{whole}remote = \"all\"\n"), true, "cell.remote"),
            (&format!("{whole}port = 1\n"), true, "cell.port: unknown key"),
        ] {
            let error = read(text, state).unwrap_err();
            assert!(error.contains(expected), "{error}");
        }
    }
}
