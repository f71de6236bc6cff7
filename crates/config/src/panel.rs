//! `[panel]`: the operator panel in the browser.
//!
//! In:  the table of the machine file. Out: where it listens, and who may come.

use super::bus::is_name;
use super::document::Section;
use super::program;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};

/// Its port if nobody says another one.
pub const PANEL_PORT: u16 = 8402;
/// Names of this PC at the most.
const HOSTS_MAX: usize = 16;

/// `[panel]`
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// Where it listens; port 0: any.
    pub address: SocketAddr,
    /// Names of this PC by which it may be called, beside its addresses.
    pub hosts: Vec<String>,
    /// File of tokens; `None`: a token that is made at each start.
    pub tokens: Option<PathBuf>,
    /// Folder of programs; `None`: none can be sent.
    pub programs: Option<PathBuf>,
    /// What a program does whose client had taken control and is lost.
    pub on_lost_control: OnLostControl,
    /// How what goes over the network is encrypted.
    pub encryption: Encryption,
    /// Where senders of Grbl connect, an address of this PC alone; `None`: nowhere.
    pub grbl: Option<SocketAddr>,
    /// Where agents of MTConnect read lines of SHDR; `None`: nowhere.
    pub shdr: Option<SocketAddr>,
    /// Errors of MTConnect are told as before 2.6.
    pub mtconnect_old_errors: bool,
    /// MTConnect answers at `/probe` and the like, too, not only below `/mtconnect`.
    pub mtconnect_at_root: bool,
}

/// What connections of the panel are encrypted with.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Encryption {
    /// Nothing.
    #[default]
    None,
    /// A certificate of the panel's own, kept in this folder; `None`: made at each start.
    Own(Option<PathBuf>),
    /// A certificate of an authority of the user's, and its key.
    Files { certificate: PathBuf, key: PathBuf },
}

/// What becomes of a program whose client is lost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OnLostControl {
    /// It goes on.
    #[default]
    GoOn,
    /// It is held.
    Hold,
}

impl Panel {
    /// At this address, with what lies in the state folder.
    pub fn at(address: SocketAddr, state_directory: Option<&Path>) -> Panel {
        Panel {
            address,
            hosts: Vec::new(),
            tokens: state_directory.map(|folder| folder.join("panel-tokens.json")),
            programs: state_directory.map(|folder| folder.join("programs")),
            on_lost_control: OnLostControl::default(),
            encryption: Encryption::None,
            grbl: None,
            shdr: None,
            mtconnect_old_errors: false,
            mtconnect_at_root: false,
        }
    }

    /// The address of a panel that only this PC reaches.
    pub const fn loopback() -> SocketAddr {
        SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), PANEL_PORT)
    }
}

pub(super) fn panel(mut section: Section<'_, '_>, base: &Path, state_directory: Option<&Path>) -> Option<Panel> {
    let address = match section.or("address", || Panel::loopback().to_string().into()) {
        None => Some(Panel::loopback()),
        Some(item) => item.text("panel.address").and_then(|text| {
            let address = text.parse().ok();
            if address.is_none() {
                section.wrong(
                    "address",
                    "must be an address and a port, like \"127.0.0.1:8402\" or \"[::1]:8402\"",
                );
            }
            address
        }),
    };
    let hosts = match section.optional("hosts") {
        None => Some(Vec::new()),
        Some(item) => item.items("panel.hosts").and_then(|items| {
            if items.len() > HOSTS_MAX {
                section.wrong("hosts", format!("must not be more than {HOSTS_MAX} names"));
                return None;
            }
            let texts: Vec<_> = items
                .iter()
                .enumerate()
                .map(|(at, item)| item.text(&format!("panel.hosts[{at}]")))
                .collect();
            let texts: Option<Vec<&str>> = texts.into_iter().collect();
            let texts = texts?;
            let is_host = |text: &&str| !text.is_empty() && text.split('.').all(is_name);
            if let Some(at) = texts.iter().position(|text| !is_host(text)) {
                let rule = format!("{:?} is no name of a PC: without address, port or http://", texts[at]);
                section.wrong("hosts", rule);
                return None;
            }
            Some(texts.into_iter().map(str::to_owned).collect())
        }),
    };
    let tokens = program::path(&mut section, "tokens", base);
    let programs = program::new_folder(&mut section, "programs", base);
    let lost = [("go-on", OnLostControl::GoOn), ("hold", OnLostControl::Hold)];
    let on_lost_control = section.word("on_lost_control", &lost, OnLostControl::GoOn);
    let encryption = encryption(&mut section, base, state_directory);
    let grbl = match section.optional_section("grbl") {
        None => Some(None),
        Some(table) => grbl(table).map(Some),
    };
    let mtconnect = match section.optional_section("mtconnect") {
        None => Some(MtConnect::default()),
        Some(table) => mtconnect(table),
    };
    section.done();
    let default = Panel::at(address?, state_directory);
    let mtconnect = mtconnect?;
    Some(Panel {
        hosts: hosts?,
        tokens: tokens?.or(default.tokens),
        programs: programs?.or(default.programs),
        on_lost_control: on_lost_control?,
        encryption: encryption?,
        grbl: grbl?,
        shdr: mtconnect.shdr,
        mtconnect_old_errors: mtconnect.old_errors,
        mtconnect_at_root: mtconnect.at_root,
        ..default
    })
}

fn encryption(section: &mut Section<'_, '_>, base: &Path, state_directory: Option<&Path>) -> Option<Encryption> {
    let is_off = section.has("tls");
    let tls = section.flag("tls", false)?;
    let certificate = program::path(section, "certificate", base)?;
    let key = program::path(section, "key", base)?;
    match (certificate, key) {
        (None, None) if tls => Some(Encryption::Own(state_directory.map(Path::to_owned))),
        (None, None) => Some(Encryption::None),
        (Some(certificate), Some(key)) if tls || !is_off => Some(Encryption::Files { certificate, key }),
        (Some(_), Some(_)) => {
            section.wrong("tls", "must be true, or left out, with a certificate");
            None
        }
        (Some(_), None) => {
            section.wrong("certificate", "needs its key: key = \"FILE\"");
            None
        }
        (None, Some(_)) => {
            section.wrong("key", "needs its certificate: certificate = \"FILE\"");
            None
        }
    }
}

#[derive(Default)]
struct MtConnect {
    at_root: bool,
    old_errors: bool,
    shdr: Option<SocketAddr>,
}

/// `[panel.mtconnect]`
fn mtconnect(mut section: Section<'_, '_>) -> Option<MtConnect> {
    let at_root = section.flag("at_root", false);
    let old_errors = section.word("errors", &[("2.7", false), ("2.2", true)], false);
    let shdr = match section.optional("shdr") {
        None => Some(None),
        Some(item) => item.text("panel.mtconnect.shdr").and_then(|text| {
            let address = text.parse().ok();
            if address.is_none() {
                section.wrong("shdr", "must be an address and a port, like \"127.0.0.1:7878\"");
            }
            address.map(Some)
        }),
    };
    section.done();
    Some(MtConnect {
        at_root: at_root?,
        old_errors: old_errors?,
        shdr: shdr?,
    })
}

/// `[panel.grbl]`
fn grbl(mut section: Section<'_, '_>) -> Option<SocketAddr> {
    let item = section.required("listen", "an address and a port");
    let text = item.and_then(|item| item.text("panel.grbl.listen"));
    let address: Option<SocketAddr> = text.and_then(|text| text.parse().ok());
    // It knows no tokens: whoever connects is known by the system, which it is on this PC alone.
    let address = address.filter(|address| address.ip().is_loopback());
    if text.is_some() && address.is_none() {
        section.wrong(
            "listen",
            "must be an address of this PC alone and a port, like \"127.0.0.1:8403\"",
        );
    }
    section.done();
    address
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parse;

    const DEMO: &str = include_str!("../../../configs/mill3-demo.toml");

    fn read(table: &str) -> Result<Option<Panel>, String> {
        let text = format!("{DEMO}\n{table}");
        match parse(&text, Path::new("m.toml")) {
            Ok(config) => Ok(config.panel),
            Err(errors) => Err(errors.to_string()),
        }
    }

    #[test]
    fn a_table_without_keys_is_a_panel_of_this_pc() {
        assert_eq!(read("").unwrap(), None);
        assert_eq!(read("[panel]").unwrap(), Some(Panel::at(Panel::loopback(), None)));
        let panel = read(
            "[panel]\naddress = \"[::]:80\"\nhosts = [\"mill.local\"]\ntokens = \"t.json\"\non_lost_control = \"hold\"",
        );
        let panel = panel.unwrap().unwrap();
        assert_eq!(panel.address, "[::]:80".parse().unwrap());
        assert_eq!(
            (panel.hosts, panel.tokens),
            (vec!["mill.local".to_owned()], Some("t.json".into()))
        );
        assert_eq!(panel.on_lost_control, OnLostControl::Hold);
        let panel = read("[panel.grbl]\nlisten = \"127.0.0.1:8403\"\n[panel.mtconnect]\nat_root = true")
            .unwrap()
            .unwrap();
        assert_eq!(
            (panel.grbl, panel.mtconnect_at_root),
            (Some("127.0.0.1:8403".parse().unwrap()), true)
        );
        let panel = read("[panel.mtconnect]\nerrors = \"2.2\"\nshdr = \"0.0.0.0:7878\"")
            .unwrap()
            .unwrap();
        assert_eq!(
            (panel.shdr, panel.mtconnect_old_errors, panel.mtconnect_at_root),
            (Some("0.0.0.0:7878".parse().unwrap()), true, false)
        );
        let of_folder = Panel::at(Panel::loopback(), Some(Path::new("/s")));
        assert_eq!(of_folder.programs, Some("/s/programs".into()));
    }

    #[test]
    fn what_is_encrypted_and_with_what() {
        let of = |keys: &str| read(&format!("[panel]\n{keys}")).map(|panel| panel.unwrap().encryption);
        assert_eq!(of("tls = false"), Ok(Encryption::None));
        assert_eq!(of("tls = true"), Ok(Encryption::Own(None)));
        let files = Encryption::Files {
            certificate: "c.pem".into(),
            key: "k.pem".into(),
        };
        assert_eq!(of("certificate = \"c.pem\"\nkey = \"k.pem\""), Ok(files));
        for (keys, told) in [
            ("certificate = \"c.pem\"", "needs its key"),
            ("tls = true\nkey = \"k.pem\"", "needs its certificate"),
            ("tls = false\ncertificate = \"c.pem\"\nkey = \"k.pem\"", "panel.tls"),
        ] {
            let errors = of(keys).unwrap_err();
            assert!(errors.contains(told), "{errors}");
        }
    }

    #[test]
    fn what_is_no_address_and_no_name_is_refused() {
        for (table, told) in [
            (
                "[panel]\naddress = \"localhost\"",
                "panel.address = \"localhost\": must be an address and a port",
            ),
            ("[panel]\nhosts = [\"http://x\"]", "is no name of a PC"),
            ("[panel]\nport = 1", "panel.port: unknown key"),
            ("[panel]\non_lost_control = \"stop\"", "panel.on_lost_control"),
            (
                "[panel.grbl]\nlisten = \"0.0.0.0:8403\"",
                "must be an address of this PC alone",
            ),
            ("[panel.grbl]", "panel.grbl.listen"),
            ("[panel.mtconnect]\nerrors = \"1.8\"", "panel.mtconnect.errors"),
            ("[panel.mtconnect]\nshdr = \"7878\"", "must be an address and a port"),
            ("[panel.mtconnect]\nroot = true", "panel.mtconnect.root: unknown key"),
        ] {
            let errors = read(table).unwrap_err();
            assert!(errors.contains(told), "{errors}");
        }
    }
}
