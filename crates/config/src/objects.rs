//! Objects of a node and what they are known by.

/// Profile of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Profile {
    Cia402,
    /// Digital inputs and outputs (CiA 401).
    Io,
}

/// One object in a PDO: `"0x60FE:1/32"`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mapped {
    pub index: u16,
    pub sub: u8,
    /// Length in bits: 8, 16, 32 or 64.
    pub bits: u8,
}

impl Mapped {
    /// As it stands in a mapping object of EtherCAT: index << 16 | sub-index << 8 | bits.
    pub fn entry(&self) -> u32 {
        u32::from(self.index) << 16 | u32::from(self.sub) << 8 | u32::from(self.bits)
    }
}

/// As it is written in a machine file.
impl std::fmt::Display for Mapped {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.sub {
            0 => write!(f, "0x{:04X}/{}", self.index, self.bits),
            sub => write!(f, "0x{:04X}:{sub}/{}", self.index, self.bits),
        }
    }
}

/// `0x60FE:1`; the sub-index is decimal and may be left out.
pub(super) fn parse_object(text: &str) -> Option<(u16, u8)> {
    let (index, sub) = text.split_once(':').unwrap_or((text, "0"));
    let index = index.strip_prefix("0x").or(index.strip_prefix("0X"))?;
    if !digits(index) || !digits(sub) {
        return None;
    }
    Some((u16::from_str_radix(index, 16).ok()?, sub.parse().ok()?))
}

pub(super) fn digits(text: &str) -> bool {
    text.bytes().next().is_some_and(|octet| octet.is_ascii_hexdigit())
}

/// Expected values of the IdentResponse; `None`: not checked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// 1000.
    pub device_type: Option<u32>,
    /// 1018:1.
    pub vendor_id: Option<u32>,
    /// 1018:2.
    pub product_code: Option<u32>,
    /// 1018:3.
    pub revision: Option<u32>,
    /// 1018:4.
    pub serial: Option<u32>,
}

impl Identity {
    /// Whether a device that reports `found` is the one that is wanted.
    pub fn fits(&self, found: &Identity) -> bool {
        let fits = |wanted: Option<u32>, found: Option<u32>| wanted.is_none() || wanted == found;
        fits(self.device_type, found.device_type)
            && fits(self.vendor_id, found.vendor_id)
            && fits(self.product_code, found.product_code)
            && fits(self.revision, found.revision)
            && fits(self.serial, found.serial)
    }

    /// What is known of a device by one of its objects; `None`: the object is no part of an identity.
    pub fn of_object(object: (u16, u8), value: u32) -> Option<Identity> {
        let mut known = Identity::default();
        let part = match object {
            (0x1000, 0) => &mut known.device_type,
            (0x1018, 1) => &mut known.vendor_id,
            (0x1018, 2) => &mut known.product_code,
            (0x1018, 3) => &mut known.revision,
            (0x1018, 4) => &mut known.serial,
            _ => return None,
        };
        *part = Some(value);
        Some(known)
    }

    /// Whether something is wanted of the device.
    pub fn is_checked(&self) -> bool {
        *self != Identity::default()
    }
}

/// What is known, in words; "any device" where nothing is.
impl std::fmt::Display for Identity {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let hex = [
            ("device type", self.device_type),
            ("vendor", self.vendor_id),
            ("product", self.product_code),
            ("revision", self.revision),
        ];
        let hex = hex
            .iter()
            .filter_map(|(name, value)| Some(format!("{name} {:#010X}", (*value)?)));
        let serial = self.serial.map(|serial| format!("serial {serial}"));
        let words: Vec<String> = hex.chain(serial).collect();
        match words.is_empty() {
            true => f.write_str("any device"),
            false => f.write_str(&words.join(", ")),
        }
    }
}
