//! Where step pulses leave this PC.
//!
//! In:  levels of all pins, one bit each, at every tick. Out: levels on a parallel port or on GPIO lines, by one system call
//! where something has changed.

use crate::wait::{monotonic_ns, spin_until};
use anyhow::Context;
use config::{PARALLEL_PINS, StepPortKind, Steps};
use nix::errno::Errno;
use std::fs::{File, OpenOptions};
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd};
use std::path::Path;

/// Takes levels. RT, once it is open.
pub trait StepPort {
    /// Puts levels on the pins, bit n on the n-th; false: they are not there.
    fn write(&mut self, now_ns: u64, levels: u32) -> bool;

    /// The same, and the other levels on the pins of `pulses` for the first `pulse_ns` of it.
    fn pulse(&mut self, now_ns: u64, levels: u32, pulses: u32, pulse_ns: u64) -> bool {
        let begun = self.write(now_ns, levels ^ pulses);
        spin_until(monotonic_ns() + pulse_ns);
        self.write(now_ns, levels) && begun
    }

    /// Where the motor of a joint is, in steps, if the port knows.
    fn rotor(&self, _joint: usize) -> Option<f64> {
        None
    }
}

/// A port without pins.
#[derive(Clone, Copy, Debug)]
pub struct Nowhere;

impl StepPort for Nowhere {
    fn write(&mut self, _now_ns: u64, _levels: u32) -> bool {
        true
    }

    fn pulse(&mut self, _now_ns: u64, _levels: u32, _pulses: u32, _pulse_ns: u64) -> bool {
        true
    }
}

/// Opens the port of a machine file, with all pins as they are without power; `None`: it is none of this PC.
///
/// # Errors
/// What the system refuses, and how that is cured.
pub fn open(steps: &Steps) -> anyhow::Result<Option<Box<dyn StepPort + Send>>> {
    Ok(match &steps.port {
        StepPortKind::Parallel(device) => Some(Box::new(Parallel::open(device, steps)?)),
        StepPortKind::Gpio(device) => Some(Box::new(Gpio::open(device, steps)?)),
        StepPortKind::Pins | StepPortKind::Simulated => None,
    })
}

/// linux/ppdev.h
mod ppdev {
    nix::ioctl_none!(claim, b'p', 0x8b);
    nix::ioctl_none!(release, b'p', 0x8c);
    nix::ioctl_write_ptr!(write_control, b'p', 0x84, u8);
    nix::ioctl_write_ptr!(write_data, b'p', 0x86, u8);
}

/// linux/gpio.h, second version
mod gpio {
    pub(super) const LINES_MAX: usize = 64;
    pub(super) const FLAG_OUTPUT: u64 = 1 << 3;
    pub(super) const ATTRIBUTE_OUTPUT_VALUES: u32 = 2;

    #[repr(C)]
    #[derive(Clone, Copy)]
    pub(super) struct Attribute {
        pub(super) id: u32,
        pub(super) padding: u32,
        pub(super) values: u64,
        pub(super) mask: u64,
    }

    #[repr(C)]
    pub(super) struct LineRequest {
        pub(super) offsets: [u32; LINES_MAX],
        pub(super) consumer: [u8; 32],
        pub(super) flags: u64,
        pub(super) attributes_used: u32,
        pub(super) config_padding: [u32; 5],
        pub(super) attributes: [Attribute; 10],
        pub(super) lines: u32,
        pub(super) event_buffer_size: u32,
        pub(super) padding: [u32; 5],
        pub(super) fd: i32,
    }

    #[repr(C)]
    pub(super) struct LineValues {
        pub(super) bits: u64,
        pub(super) mask: u64,
    }

    nix::ioctl_readwrite!(get_line, 0xB4, 0x07, LineRequest);
    nix::ioctl_readwrite!(set_values, 0xB4, 0x0F, LineValues);
}

/// RT: the call that the thread is there to make; hidden from the RealtimeSanitizer, which would take it for a mistake.
fn in_the_kernel(call: impl FnOnce() -> Result<libc::c_int, Errno>) -> bool {
    #[cfg(feature = "rtsan")]
    let _hidden = rtsan_standalone::ScopedDisabler::default();
    call().is_ok()
}

/// A parallel port by ppdev.
#[derive(Debug)]
struct Parallel {
    file: File,
    /// Which octet (0 data, 1 control) and which bit of it each pin is.
    pins: Vec<(usize, u8)>,
    /// Bits of the control octet that the hardware inverts, and data and control as they were written last.
    inverted: u8,
    last: [Option<u8>; 2],
}

/// Control bits 0, 1 and 3 (pins 1, 14 and 17) come out inverted.
const CONTROL_INVERTED: u8 = 0b1011;

impl Parallel {
    fn open(device: &Path, steps: &Steps) -> anyhow::Result<Parallel> {
        let cure = "for a parallel port: modprobe ppdev; be a member of the group lp; no other program may hold it";
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .open(device)
            .with_context(|| format!("step port {}: {cure}", device.display()))?;
        // SAFETY: the descriptor is open; the call takes no argument.
        unsafe { ppdev::claim(file.as_raw_fd()) }
            .with_context(|| format!("step port {}: cannot be claimed: {cure}", device.display()))?;
        let mut port = Parallel {
            file,
            pins: octets_and_bits(&steps.pins),
            inverted: CONTROL_INVERTED,
            last: [None; 2],
        };
        anyhow::ensure!(
            port.write(0, steps.inverted),
            "step port {}: takes no levels: {cure}",
            device.display()
        );
        Ok(port)
    }

    /// Data and control for these levels.
    fn octets(&self, levels: u32) -> [u8; 2] {
        let mut octets = [0, self.inverted];
        for (number, (octet, bit)) in self.pins.iter().enumerate() {
            octets[*octet] ^= u8::from(levels >> number & 1 == 1) << bit;
        }
        octets
    }
}

fn octets_and_bits(pins: &[u8]) -> Vec<(usize, u8)> {
    let place = |pin: &u8| PARALLEL_PINS.iter().position(|own| own == pin).unwrap_or(0) as u8;
    pins.iter()
        .map(place)
        .map(|place| (usize::from(place / 8), place % 8))
        .collect()
}

impl StepPort for Parallel {
    fn write(&mut self, _now_ns: u64, levels: u32) -> bool {
        let [data, control] = self.octets(levels);
        let fd = self.file.as_raw_fd();
        let mut taken = true;
        // The direction may be a line of control: it stands before the pulse begins.
        if self.last[1] != Some(control) {
            // SAFETY: the descriptor is open; the kernel reads one octet.
            taken &= in_the_kernel(|| unsafe { ppdev::write_control(fd, &control) });
        }
        if self.last[0] != Some(data) {
            // SAFETY: as above.
            taken &= in_the_kernel(|| unsafe { ppdev::write_data(fd, &data) });
        }
        self.last = [Some(data), Some(control)];
        taken
    }
}

impl Drop for Parallel {
    fn drop(&mut self) {
        // SAFETY: the descriptor is open; the call takes no argument. What it says changes nothing any more.
        let _ = unsafe { ppdev::release(self.file.as_raw_fd()) };
    }
}

/// Lines of a GPIO character device.
#[derive(Debug)]
struct Gpio {
    lines: OwnedFd,
    mask: u64,
    last: Option<u32>,
}

impl Gpio {
    fn open(device: &Path, steps: &Steps) -> anyhow::Result<Gpio> {
        let name = device.display();
        let cure =
            "for GPIO lines: be a member of the group gpio; gpioinfo shows which lines there are and who has them";
        let chip = File::open(device).with_context(|| format!("step port {name}: {cure}"))?;
        let mut request = line_request(steps);
        // SAFETY: the descriptor is open; the request has the shape that linux/gpio.h gives it, which a test asserts.
        unsafe { gpio::get_line(chip.as_raw_fd(), &raw mut request) }
            .with_context(|| format!("step port {name}: lines {:?} cannot be had: {cure}", steps.pins))?;
        Ok(Gpio {
            // SAFETY: the call has just given this descriptor, and nobody else has it.
            lines: unsafe { OwnedFd::from_raw_fd(request.fd) },
            mask: mask(steps),
            last: Some(steps.inverted),
        })
    }
}

fn mask(steps: &Steps) -> u64 {
    (1_u64 << steps.pins.len()) - 1
}

/// All lines as outputs, as they are without power.
fn line_request(steps: &Steps) -> gpio::LineRequest {
    let mut offsets = [0; gpio::LINES_MAX];
    for (offset, pin) in offsets.iter_mut().zip(&steps.pins) {
        *offset = u32::from(*pin);
    }
    let mut consumer = [0; 32];
    consumer[..6].copy_from_slice(b"isocnc");
    let nothing = gpio::Attribute {
        id: 0,
        padding: 0,
        values: 0,
        mask: 0,
    };
    let mut attributes = [nothing; 10];
    attributes[0] = gpio::Attribute {
        id: gpio::ATTRIBUTE_OUTPUT_VALUES,
        values: steps.inverted.into(),
        mask: mask(steps),
        ..nothing
    };
    gpio::LineRequest {
        offsets,
        consumer,
        flags: gpio::FLAG_OUTPUT,
        attributes_used: 1,
        config_padding: [0; 5],
        attributes,
        lines: steps.pins.len() as u32,
        event_buffer_size: 0,
        padding: [0; 5],
        fd: -1,
    }
}

impl StepPort for Gpio {
    fn write(&mut self, _now_ns: u64, levels: u32) -> bool {
        if self.last == Some(levels) {
            return true;
        }
        self.last = Some(levels);
        let mut values = gpio::LineValues {
            bits: levels.into(),
            mask: self.mask,
        };
        // SAFETY: the descriptor is open; the kernel reads the two words.
        in_the_kernel(|| unsafe { gpio::set_values(self.lines.as_raw_fd(), &raw mut values) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::mem::{offset_of, size_of};

    /// Sizes and places of linux/gpio.h and the numbers of its calls, as a C compiler gives them.
    #[test]
    fn requests_have_the_shape_that_the_kernel_expects() {
        assert_eq!(
            (size_of::<gpio::LineRequest>(), size_of::<gpio::Attribute>()),
            (592, 24)
        );
        assert_eq!(size_of::<gpio::LineValues>(), 16);
        assert_eq!(offset_of!(gpio::LineRequest, flags), 288);
        assert_eq!(offset_of!(gpio::LineRequest, attributes), 320);
        assert_eq!(offset_of!(gpio::LineRequest, lines), 560);
        assert_eq!(offset_of!(gpio::LineRequest, fd), 588);
    }

    #[test]
    fn pins_of_a_parallel_port_are_bits_of_data_and_control() {
        let port = Parallel {
            file: File::open("/dev/null").unwrap(),
            pins: octets_and_bits(&[2, 9, 1, 16]),
            inverted: CONTROL_INVERTED,
            last: [None; 2],
        };
        // Pins 1, 14 and 17 are high where their bit is 0; pin 16 is as its bit is.
        assert_eq!(port.octets(0b0000), [0, 0b1011]);
        assert_eq!(port.octets(0b0011), [0b1000_0001, 0b1011]);
        assert_eq!(port.octets(0b1100), [0, 0b1110]);
    }

    #[test]
    fn a_device_that_is_none_is_refused_with_its_cure() {
        for kind in [
            StepPortKind::Parallel("/dev/null".into()),
            StepPortKind::Gpio("/dev/null".into()),
        ] {
            let steps = Steps {
                port: kind,
                pulse_ns: 1000,
                tick_ns: 50_000,
                pins: vec![2, 3],
                inverted: 0b10,
                motor: config::SimStepper {
                    microsteps: 1,
                    acceleration: 1.0,
                    speed: 1.0,
                },
            };
            let error = open(&steps).err().unwrap();
            assert!(format!("{error:#}").starts_with("step port /dev/null: "), "{error:#}");
        }
    }
}
