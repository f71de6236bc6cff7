//! A main device's end of a wire on virtual time, with devices of `ethercat::sub` at the other end.

use ethercat::sub::{Segment, SubDevice, SubDeviceConfig};
use powerlink::link::{Link, LinkError, Received};

/// Devices on a wire, and the time.
pub(crate) struct Wire {
    pub(crate) segment: Segment,
    pub(crate) now_ns: u64,
    pub(crate) answers: Vec<(u64, Vec<u8>)>,
    /// So many frames get lost.
    pub(crate) lose: u32,
    pub(crate) sent: u32,
}

impl Wire {
    /// A line of devices.
    pub(crate) fn new(devices: impl IntoIterator<Item = SubDeviceConfig>) -> Wire {
        let mut segment = Segment::new();
        for device in devices {
            segment.push(SubDevice::new(device, 0), 300);
        }
        Wire {
            segment,
            now_ns: 1_000_000,
            answers: Vec::new(),
            lose: 0,
            sent: 0,
        }
    }
}

impl Link for Wire {
    fn now_ns(&mut self) -> u64 {
        self.now_ns
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        self.sent += 1;
        if self.lose > 0 {
            self.lose -= 1;
            return Ok(());
        }
        let mut octets = frame.to_vec();
        if let Some(answer) = self.segment.receive(self.now_ns, &mut octets) {
            self.answers.push((answer.at_ns, octets));
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], deadline_ns: u64) -> Result<Option<Received>, LinkError> {
        let first = (0..self.answers.len()).min_by_key(|at| self.answers[*at].0);
        match first.filter(|at| self.answers[*at].0 <= deadline_ns.max(self.now_ns)) {
            Some(at) => {
                let (at_ns, octets) = self.answers.swap_remove(at);
                self.now_ns = self.now_ns.max(at_ns);
                buffer[..octets.len()].copy_from_slice(&octets);
                Ok(Some(Received {
                    length: octets.len(),
                    stamp_ns: None,
                }))
            }
            None => {
                self.now_ns = self.now_ns.max(deadline_ns);
                self.segment.poll(self.now_ns);
                Ok(None)
            }
        }
    }
}
