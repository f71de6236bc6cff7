//! How far each device is from the reference clock, by the times at which a frame passed its ports.

/// What is known of a device, in the order of positions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DcDevice {
    /// It has a clock; without one its times say nothing.
    pub has_clock: bool,
    /// Which of its ports are open ([`DlStatus`](crate::wire::register::DlStatus)); port 0 is where frames come in.
    pub open: [bool; 4],
    /// Receive times of the ports, local ns; those of closed ports hold anything.
    pub times: [u32; 4],
}

/// The order in which a frame passes the ports.
const PORT_ORDER: [usize; 4] = [0, 3, 1, 2];

impl DcDevice {
    /// When the frame passed an open port, since it came in.
    fn since_entry(&self, port: usize) -> u32 {
        self.times[port].wrapping_sub(self.times[0])
    }

    /// How long the frame was behind this device: from its entry to its return at the last open port.
    fn loop_ns(&self) -> u32 {
        let last = PORT_ORDER.into_iter().skip(1).rfind(|port| self.open[*port]);
        last.map_or(0, |port| self.since_entry(port))
    }
}

/// The device and its port before each device, by the open ports: the first one has none.
///
/// Devices are found in the order in which a frame passes them: one with a further open port has what follows behind it.
pub(super) fn parents<const N: usize>(devices: &[DcDevice]) -> [Option<(usize, usize)>; N] {
    let mut parents = [None; N];
    let mut used = [0_u8; N];
    for (number, parent) in parents.iter_mut().enumerate().take(devices.len()).skip(1) {
        // The nearest device before that has a port left.
        for before in (0..number).rev() {
            let mut ports = PORT_ORDER
                .into_iter()
                .skip(1)
                .filter(|port| devices[before].open[*port]);
            if let Some(port) = ports.nth(usize::from(used[before])) {
                used[before] += 1;
                *parent = Some((before, port));
                break;
            }
        }
    }
    parents
}

/// Delay of each device from the first one with a clock, ns, of up to `N` devices; 0 for devices without a clock.
///
/// Of a child behind port p of a device, with q the open port before p: delay = delay of the device
/// + (t(p) - t(q) - loop of the child) / 2 + t(q) - t(entry). A device without a clock between two others counts as cable.
pub fn delays<const N: usize>(devices: &[DcDevice]) -> [u32; N] {
    let parents = parents::<N>(devices);
    let mut delays = [0_u32; N];
    for number in 1..devices.len().min(N) {
        let child = &devices[number];
        if !child.has_clock {
            continue;
        }
        // Up to a device that knows the time, by the port that leads here.
        let mut way = parents[number];
        while let Some((before, _)) = way
            && !devices[before].has_clock
        {
            way = parents[before];
        }
        let Some((before, port)) = way else { continue };
        let parent = &devices[before];
        let at = PORT_ORDER.iter().position(|known| *known == port).unwrap_or(0);
        let previous = PORT_ORDER[..at]
            .iter()
            .rev()
            .copied()
            .find(|port| *port == 0 || parent.open[*port]);
        let before_ns = parent.since_entry(previous.unwrap_or(0));
        let round = parent
            .since_entry(port)
            .wrapping_sub(before_ns)
            .wrapping_sub(child.loop_ns());
        delays[number] = delays[before].wrapping_add(round / 2).wrapping_add(before_ns);
    }
    delays
}
