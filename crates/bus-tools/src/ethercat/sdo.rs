//! Objects of a device of EtherCAT on an interface where no control is at work.
//!
//! In:  the position of the device. Out: values. Each object is asked on its own; this device alone is led to PRE-OP, and all are left
//! in INIT.

use super::{asked, lead};
use anyhow::ensure;
use bus::sender::SoleSender;
use ethercat::main::SetupError;
use powerlink::link::Link;

/// The way to one device.
pub(crate) struct Wire {
    /// `None`: the wire is no interface of this PC.
    _sole: Option<SoleSender>,
    link: Box<dyn Link>,
    mac: [u8; 6],
    position: u8,
}

impl Wire {
    /// Finds the device at a position, from 1. `interface`: that of the link, if it is one of this PC.
    ///
    /// # Errors
    /// There is none; the link.
    pub(crate) fn open(
        mut link: Box<dyn Link>,
        mac: [u8; 6],
        interface: Option<&str>,
        position: u8,
    ) -> anyhow::Result<Wire> {
        let sole = interface.map(SoleSender::claim).transpose()?;
        let found = lead(&mut *link, mac, &[], |lead| lead.find())?;
        let count = found.len();
        ensure!(
            (1..=count).contains(&usize::from(position)),
            "nothing is at position {position}: {count} devices answer ('isocnc bus scan --bus ethercat' shows them)"
        );
        Ok(Wire {
            _sole: sole,
            link,
            mac,
            position,
        })
    }

    /// Reads or writes an object.
    ///
    /// # Errors
    /// The outer one: the link, or the device does not come to PRE-OP; the inner one: it refuses.
    pub(crate) fn ask(
        &mut self,
        object: (u16, u8),
        write: Option<&[u8]>,
    ) -> anyhow::Result<Result<Vec<u8>, SetupError>> {
        let position = self.position;
        lead(&mut *self.link, self.mac, &[asked(position)], |lead| {
            if let Some((_, error)) = lead.led(1)?.first() {
                anyhow::bail!("the device at position {position}: {error}");
            }
            ensure!(
                lead.has_objects(0),
                "the device at position {position} has no mailbox, and so no objects"
            );
            let result = lead.sdo(0, object, write)?;
            lead.end()?;
            Ok(result)
        })
    }
}
