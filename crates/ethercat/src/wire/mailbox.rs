//! Mails: what both mailboxes of a device carry.

use super::{WireError, cleared, put, slice, u16_at};

/// Octets in front of the data of a mail.
pub const HEADER_LEN: usize = 6;
/// Highest counter; 1 follows. 0 is not used.
pub const COUNTER_MAX: u8 = 7;

/// Protocol of a mail.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Protocol {
    /// The mail before was wrong; see [`MailError`].
    Error,
    /// ADS over EtherCAT.
    AoE,
    /// Ethernet over EtherCAT.
    EoE,
    /// CANopen over EtherCAT.
    CoE,
    /// Files over EtherCAT.
    FoE,
    /// Servo drive profile over EtherCAT.
    SoE,
    /// Anything else.
    Unknown(u8),
}

impl From<u8> for Protocol {
    fn from(octet: u8) -> Protocol {
        match octet & 0x0F {
            0 => Protocol::Error,
            1 => Protocol::AoE,
            2 => Protocol::EoE,
            3 => Protocol::CoE,
            4 => Protocol::FoE,
            5 => Protocol::SoE,
            other => Protocol::Unknown(other),
        }
    }
}

impl From<Protocol> for u8 {
    fn from(protocol: Protocol) -> u8 {
        match protocol {
            Protocol::Error => 0,
            Protocol::AoE => 1,
            Protocol::EoE => 2,
            Protocol::CoE => 3,
            Protocol::FoE => 4,
            Protocol::SoE => 5,
            Protocol::Unknown(other) => other,
        }
    }
}

/// A mail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mail<'a> {
    /// Station address of the sender, where mails are passed on; else 0.
    pub address: u16,
    /// Channel and priority.
    pub channel: u8,
    /// What it carries.
    pub protocol: Protocol,
    /// 1 to 7, then 1 again; a mail with the counter of the one before is a repetition. 0: not used.
    pub counter: u8,
    /// Its data.
    pub data: &'a [u8],
}

impl<'a> Mail<'a> {
    /// Reads an untrusted mailbox; what lies behind the mail is left alone. Never panics.
    ///
    /// # Errors
    /// [`WireError`]: why it holds no mail.
    pub fn parse(octets: &'a [u8]) -> Result<Mail<'a>, WireError> {
        slice(octets, 0, HEADER_LEN)?;
        let length = usize::from(u16_at(octets, 0)?);
        let data = octets.get(HEADER_LEN..HEADER_LEN + length);
        let data = data.ok_or(WireError::Overrun {
            need: length,
            got: octets.len() - HEADER_LEN,
        })?;
        Ok(Mail {
            address: u16_at(octets, 2)?,
            channel: octets[4],
            protocol: Protocol::from(octets[5]),
            counter: octets[5] >> 4 & 7,
            data,
        })
    }

    /// Writes the mail into a dirty mailbox, zeros behind it.
    ///
    /// # Errors
    /// [`WireError::NoRoom`].
    pub fn emit(&self, mailbox: &mut [u8]) -> Result<(), WireError> {
        let data = start(mailbox, self.protocol, self.counter, self.data.len())?;
        data.copy_from_slice(self.data);
        put(mailbox, 2, self.address.to_le_bytes());
        mailbox[4] = self.channel;
        Ok(())
    }
}

/// Writes the header of a mail and zeros behind it; the octets of its data.
///
/// # Errors
/// [`WireError::NoRoom`].
pub fn start(mailbox: &mut [u8], protocol: Protocol, counter: u8, length: usize) -> Result<&mut [u8], WireError> {
    let got = mailbox.len();
    let need = HEADER_LEN + length;
    if need > got || length > usize::from(u16::MAX) {
        return Err(WireError::NoRoom { need, got });
    }
    let out = cleared(mailbox, got)?;
    put(out, 0, (length as u16).to_le_bytes());
    out[5] = u8::from(protocol) & 0x0F | (counter & 7) << 4;
    Ok(&mut out[HEADER_LEN..need])
}

/// The counter of the next mail.
pub const fn next_counter(counter: u8) -> u8 {
    if counter >= COUNTER_MAX { 1 } else { counter + 1 }
}

/// What a mail of [`Protocol::Error`] says of the mail that it answers; unknown values are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MailError(pub u16);

impl MailError {
    /// Its header is wrong.
    pub const SYNTAX: MailError = MailError(1);
    /// The device does not know the protocol.
    pub const PROTOCOL: MailError = MailError(2);
    /// The channel is wrong.
    pub const CHANNEL: MailError = MailError(3);
    /// The device does not know the service.
    pub const SERVICE: MailError = MailError(4);
    /// The header of its protocol is wrong.
    pub const HEADER: MailError = MailError(5);
    /// It is too short.
    pub const SHORT: MailError = MailError(6);
    /// The device has no memory for it.
    pub const MEMORY: MailError = MailError(7);
    /// Its size is wrong.
    pub const SIZE: MailError = MailError(8);

    /// Reads the data of such a mail; never panics.
    ///
    /// # Errors
    /// [`WireError::TooShort`], [`WireError::Service`].
    pub fn parse(data: &[u8]) -> Result<MailError, WireError> {
        match u16_at(data, 0)? {
            1 => u16_at(data, 2).map(MailError),
            other => Err(WireError::Service { got: other as u8 }),
        }
    }

    /// Writes a whole mail.
    ///
    /// # Errors
    /// [`WireError::NoRoom`].
    pub fn emit(self, counter: u8, mailbox: &mut [u8]) -> Result<(), WireError> {
        let data = start(mailbox, Protocol::Error, counter, 4)?;
        put(data, 0, 1_u16.to_le_bytes());
        put(data, 2, self.0.to_le_bytes());
        Ok(())
    }

    /// A few words for people.
    pub const fn text(self) -> &'static str {
        match self.0 {
            1 => "mailbox header is wrong",
            2 => "protocol is not supported",
            3 => "channel is wrong",
            4 => "service is not supported",
            5 => "header of the protocol is wrong",
            6 => "mail is too short",
            7 => "no memory for the mail",
            8 => "size of the mail is wrong",
            _ => "unknown mailbox error",
        }
    }
}

impl core::fmt::Display for MailError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.text())
    }
}
