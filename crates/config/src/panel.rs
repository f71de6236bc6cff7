//! `[panel]`: the operator panel in the browser.
//!
//! In:  the table of the machine file. Out: where it listens, and who may come.

use super::panel_items::{PanelButton, PanelValue, buttons, values};
use super::section::{Section, keys, left_out};
use super::values::is_name;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};

/// Its port if nobody says another one.
pub const PANEL_PORT: u16 = 8402;
/// Names of this PC at the most.
const HOSTS_MAX: usize = 16;
const LOST: [(&str, OnLostControl); 2] = [("go-on", OnLostControl::GoOn), ("hold", OnLostControl::Hold)];

keys! {
    /// `[panel]`; `base`: folder of the machine file, `state_directory`: what the control writes by itself.
    #[derive(Clone, Debug, PartialEq)]
    pub struct Panel(section, base: &Path, state_directory: Option<&Path>) {
        /// Where it listens; port 0: any.
        pub address: SocketAddr = match section.or("address", || Panel::loopback().to_string().into()) {
            None => Some(Panel::loopback()),
            Some(_) => section.address("address", "\"127.0.0.1:8402\" or \"[::1]:8402\"").flatten(),
        },
        /// Names of this PC by which it may be called, beside its addresses.
        pub hosts: Vec<String> = hosts(section),
        /// File of tokens; `None`: a token that is made at each start.
        pub tokens: Option<PathBuf> = {
            let usual = state_directory.map(|folder| folder.join("panel-tokens.json"));
            section.path("tokens", base).map(|given| given.or(usual))
        },
        /// Folder of programs; `None`: none can be sent.
        pub programs: Option<PathBuf> = {
            let usual = state_directory.map(|folder| folder.join("programs"));
            section.new_folder("programs", base).map(|given| given.or(usual))
        },
        /// What a program does whose client had taken control and is lost.
        pub on_lost_control: OnLostControl = section.word("on_lost_control", &LOST, OnLostControl::GoOn),
        /// How what goes over the network is encrypted.
        pub encryption: Encryption = encryption(section, base, state_directory),
        /// Where senders of Grbl connect, an address of this PC alone; `None`: nowhere.
        pub grbl: Option<SocketAddr> = section.optional_table("grbl", grbl),
        /// Buttons of the user.
        pub buttons: Vec<PanelButton> = buttons(section),
        /// Pins that it shows.
        pub values: Vec<PanelValue> = values(section),
        /// Folder of pages of the user, served at `/own/`.
        pub pages: Option<PathBuf> = match section.path("pages", base) {
            Some(Some(path)) if !path.is_dir() => section.refused("pages", format!("{} is no folder", path.display())),
            path => path,
        },
        pub mtconnect: MtConnect = section.optional_table("mtconnect", MtConnect::read).map(Option::unwrap_or_default),
    }
}

keys! {
    /// `[panel.mtconnect]`
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct MtConnect(section) {
        /// It answers at `/probe` and the like, too, not only below `/mtconnect`.
        pub at_root: bool = section.flag("at_root", false),
        /// Errors are told as before 2.6.
        pub old_errors: bool = section.word("errors", &[("2.7", false), ("2.2", true)], false),
        /// Where agents read lines of SHDR; `None`: nowhere.
        pub shdr: Option<SocketAddr> = section.address("shdr", "\"127.0.0.1:7878\""),
    }
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
            ..left_out(|section| Panel::read(section, Path::new(""), state_directory))
        }
    }

    /// The address of a panel that only this PC reaches.
    pub const fn loopback() -> SocketAddr {
        SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), PANEL_PORT)
    }
}

impl Section<'_, '_> {
    /// An address and a port, like `example`; left out: `Some(None)`.
    fn address(&mut self, key: &'static str, example: &str) -> Option<Option<SocketAddr>> {
        let Some(text) = self.optional_text(key)? else {
            return Some(None);
        };
        let address = text.parse().ok();
        if address.is_none() {
            self.wrong(key, format!("must be an address and a port, like {example}"));
        }
        address.map(Some)
    }
}

fn hosts(section: &mut Section<'_, '_>) -> Option<Vec<String>> {
    let Some(item) = section.optional("hosts") else {
        return Some(Vec::new());
    };
    let path = section.key("hosts");
    if item.items(&path)?.len() > HOSTS_MAX {
        return section.refused("hosts", format!("must not be more than {HOSTS_MAX} names"));
    }
    let texts = item.list(&path, |item, path| item.text(path))?;
    let is_host = |text: &&str| !text.is_empty() && text.split('.').all(is_name);
    if let Some(text) = texts.iter().find(|text| !is_host(text)) {
        let rule = format!("{text:?} is no name of a PC: without address, port or http://");
        return section.refused("hosts", rule);
    }
    Some(texts.into_iter().map(str::to_owned).collect())
}

fn encryption(section: &mut Section<'_, '_>, base: &Path, state_directory: Option<&Path>) -> Option<Encryption> {
    let is_off = section.has("tls");
    let tls = section.flag("tls", false)?;
    let certificate = section.path("certificate", base)?;
    let key = section.path("key", base)?;
    match (certificate, key) {
        (None, None) if tls => Some(Encryption::Own(state_directory.map(Path::to_owned))),
        (None, None) => Some(Encryption::None),
        (Some(certificate), Some(key)) if tls || !is_off => Some(Encryption::Files { certificate, key }),
        (Some(_), Some(_)) => section.refused("tls", "must be true, or left out, with a certificate"),
        (Some(_), None) => section.refused("certificate", "needs its key: key = \"FILE\""),
        (None, Some(_)) => section.refused("key", "needs its certificate: certificate = \"FILE\""),
    }
}

/// `[panel.grbl]`
fn grbl(section: &mut Section<'_, '_>) -> Option<SocketAddr> {
    let text = section.text("listen", "an address and a port")?;
    // It knows no tokens: whoever connects is known by the system, which it is on this PC alone.
    let address = text
        .parse()
        .ok()
        .filter(|address: &SocketAddr| address.ip().is_loopback());
    if address.is_none() {
        let rule = "must be an address of this PC alone and a port, like \"127.0.0.1:8403\"";
        section.wrong("listen", rule);
    }
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
            (panel.grbl, panel.mtconnect.at_root),
            (Some("127.0.0.1:8403".parse().unwrap()), true)
        );
        let panel = read("[panel.mtconnect]\nerrors = \"2.2\"\nshdr = \"0.0.0.0:7878\"")
            .unwrap()
            .unwrap();
        assert_eq!(
            (
                panel.mtconnect.shdr,
                panel.mtconnect.old_errors,
                panel.mtconnect.at_root
            ),
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
