//! Devices: found, opened, heard, lost.
//!
//! In:  `/dev/input`. Out: the pins of the component that a device writes; a list for people.

use crate::Wanted;
use crate::state::{Code, State, Way};
use evdev::{AbsoluteAxisCode, Device, KeyCode};
use hal_pins::{AnyValue, Claim, HalError};
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use std::io::{self, ErrorKind, Write};
use std::os::fd::AsFd;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;

/// How often a device that is not there is looked for.
const LOOK: Duration = Duration::from_secs(1);
/// How long nothing is waited for: a third of the heartbeat of the component.
const TURN: Duration = Duration::from_millis(60);
/// A press that is followed by its release at once is shown for so long: more than a cycle.
const SHOWN: Duration = Duration::from_millis(10);
/// Devices that are looked at.
const DEVICES_MAX: usize = 64;

/// A device of this PC.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// Where it is.
    pub path: PathBuf,
    /// As it calls itself, or why it cannot be opened.
    pub name: Result<String, String>,
    /// Its codes, by the names of their pins.
    pub codes: Vec<String>,
}

/// What becomes of a device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Told {
    /// It is not there, or cannot be had, for this reason; it is looked for until it is.
    Missing(String),
    /// It is heard.
    Heard(String),
    /// It lacks these codes, whose pins stay at rest.
    Lacks(Vec<String>),
    /// It has gone.
    Gone(String),
}

/// What of a device is wanted when it appears.
struct Held {
    keys: evdev::AttributeSet<KeyCode>,
    axes: Vec<(AbsoluteAxisCode, Way, i32)>,
}

impl Held {
    fn of(device: &Device) -> io::Result<Held> {
        let axes = device.get_absinfo()?.map(|(code, info)| {
            let way = Way {
                min: info.minimum(),
                max: info.maximum(),
                flat: info.flat(),
            };
            (code, way, info.value())
        });
        Ok(Held {
            axes: axes.collect(),
            keys: device.get_key_state()?,
        })
    }
}

impl crate::state::Device for Held {
    fn pressed(&self, code: KeyCode) -> bool {
        self.keys.contains(code)
    }

    fn axis(&self, code: AbsoluteAxisCode) -> Option<(Way, i32)> {
        let found = self.axes.iter().find(|(known, ..)| *known == code);
        found.map(|(_, way, value)| (*way, *value))
    }
}

/// All devices of this PC, in the order of their numbers.
pub fn list() -> Vec<Found> {
    paths().into_iter().map(|path| found(&path)).collect()
}

fn paths() -> Vec<PathBuf> {
    let entries = std::fs::read_dir("/dev/input").into_iter().flatten().flatten();
    let number = |path: &PathBuf| path.file_name()?.to_str()?.strip_prefix("event")?.parse::<u32>().ok();
    let mut paths: Vec<_> = entries
        .map(|entry| entry.path())
        .filter(|path| number(path).is_some())
        .collect();
    paths.sort_by_key(number);
    paths.truncate(DEVICES_MAX);
    paths
}

fn found(path: &Path) -> Found {
    let opened = Device::open(path);
    let codes = opened
        .as_ref()
        .map_or_else(|_| Vec::new(), |device| codes(device).collect());
    let name = match opened {
        Ok(device) => Ok(device.name().unwrap_or_default().to_owned()),
        Err(cause) => Err(why(&cause)),
    };
    Found {
        path: path.to_owned(),
        name,
        codes,
    }
}

/// Names of the pins that its codes would have.
fn codes(device: &Device) -> impl Iterator<Item = String> {
    let keys = device
        .supported_keys()
        .into_iter()
        .flat_map(|set| set.iter().map(Code::Key));
    let axes = device
        .supported_absolute_axes()
        .into_iter()
        .flat_map(|set| set.iter().map(Code::Axis));
    let wheels = device
        .supported_relative_axes()
        .into_iter()
        .flat_map(|set| set.iter().map(Code::Wheel));
    keys.chain(axes).chain(wheels).filter_map(Code::pin)
}

fn why(cause: &io::Error) -> String {
    match cause.kind() {
        ErrorKind::PermissionDenied => {
            "its user may not read it: sudo usermod -aG input USER, then log in again".to_owned()
        }
        _ => cause.to_string(),
    }
}

/// The device that is meant: by its path, or by a part of its name, the first of several.
fn open(wanted: &str) -> Result<Device, String> {
    if wanted.starts_with('/') {
        return Device::open(wanted).map_err(|cause| format!("{wanted}: {}", why(&cause)));
    }
    let mut denied = None;
    for path in paths() {
        match Device::open(&path) {
            Ok(device) if device.name().is_some_and(|name| name.contains(wanted)) => return Ok(device),
            Ok(_) => {}
            Err(cause) if cause.kind() == ErrorKind::PermissionDenied => denied = Some((path, why(&cause))),
            Err(_) => {}
        }
    }
    Err(match denied {
        Some((path, why)) => format!(
            "no device of the name {wanted:?} among those that can be read; {}: {why}",
            path.display()
        ),
        None => format!("no device of the name {wanted:?} is plugged in; isocnc input lists those that are"),
    })
}

/// Hears a device until `stop` is set, and writes the pins of its component in the control of this machine; `tell` hears what becomes
/// of it.
pub fn run(machine: &str, wanted: &Wanted, stop: &AtomicBool, mut tell: impl FnMut(Told)) {
    let codes: Vec<_> = wanted.codes.iter().map(|pin| (pin, Code::of_pin(pin))).collect();
    let known: Vec<_> = codes
        .iter()
        .filter_map(|(pin, code)| Some((pin.as_str(), (*code)?)))
        .collect();
    let mut last_missing = None;
    while !stop.load(Relaxed) {
        let missing = match open(&wanted.device) {
            Err(why) => why,
            Ok(device) => match Claim::of(machine, &wanted.name) {
                // Another one may write them: a test, say.
                Err(why) => why.to_string(),
                Ok(claim) => {
                    last_missing = None;
                    hear(device, claim, wanted, &known, stop, &mut tell);
                    continue;
                }
            },
        };
        if last_missing.as_ref() != Some(&missing) {
            tell(Told::Missing(missing.clone()));
            last_missing = Some(missing);
        }
        pause(LOOK, stop);
    }
}

/// Waits so long, or until the end.
fn pause(how_long: Duration, stop: &AtomicBool) {
    let mut left = how_long;
    while !left.is_zero() && !stop.load(Relaxed) {
        let now = left.min(TURN);
        std::thread::sleep(now);
        left -= now;
    }
}

/// Hears one device until it goes.
fn hear(
    mut device: Device,
    mut claim: Claim,
    wanted: &Wanted,
    codes: &[(&str, Code)],
    stop: &AtomicBool,
    tell: &mut impl FnMut(Told),
) {
    let name = device.name().unwrap_or_default().to_owned();
    let mut state = State::new(codes.iter().map(|(_, code)| *code));
    let begun = (|| {
        if wanted.exclusive {
            device.grab()?;
        }
        device.set_nonblocking(true)?;
        Held::of(&device)
    })();
    let held = match begun {
        Ok(held) => held,
        Err(cause) => {
            tell(Told::Missing(format!("{name}: {}", why(&cause))));
            return pause(LOOK, stop);
        }
    };
    state.appears(&held, |place| match claim.get(codes[place].0) {
        Ok(AnyValue::S32(count)) => count,
        _ => 0,
    });
    let has: Vec<String> = self::codes(&device).collect();
    let is_there = |pin: &String| {
        Code::of_pin(pin)
            .and_then(Code::pin)
            .is_some_and(|own| has.contains(&own))
    };
    let lacks: Vec<_> = wanted.codes.iter().filter(|pin| !is_there(pin)).cloned().collect();
    tell(Told::Heard(name.clone()));
    if !lacks.is_empty() {
        tell(Told::Lacks(lacks));
    }
    let mut write = |state: &mut State, connected| -> Result<(), HalError> {
        for ((pin, _), value) in codes.iter().zip(state.values()) {
            claim.set(pin, value)?;
        }
        claim.set("connected", connected)?;
        if claim.update().is_err() {
            // This thread was late: outputs were at rest meanwhile.
            claim.begin()?;
            claim.update().ok();
        }
        state.taken();
        Ok(())
    };
    let gone = loop {
        if stop.load(Relaxed) || write(&mut state, true).is_err() {
            return;
        }
        let mut fds = [PollFd::new(device.as_fd(), PollFlags::POLLIN)];
        let timeout = PollTimeout::try_from(TURN).unwrap_or(PollTimeout::NONE);
        // An interrupted wait is a short one.
        let _ = poll(&mut fds, timeout);
        let events: Vec<_> = match device.fetch_events() {
            Ok(events) => events.collect(),
            Err(cause) if cause.kind() == ErrorKind::WouldBlock => continue,
            Err(cause) => break cause,
        };
        for event in events {
            while !state.take(event) {
                if write(&mut state, true).is_err() {
                    return;
                }
                std::thread::sleep(SHOWN);
            }
        }
    };
    state.goes();
    if write(&mut state, false).is_err() {
        return;
    }
    tell(Told::Gone(format!("{name}: {gone}")));
    // The component is not given up but falls silent: its loss is told as the machine file says.
    pause(2 * claim.heartbeat(), stop);
}

/// Shows what a device says, a line each, until the reader or the device goes.
///
/// # Errors
/// There is no such device, or it goes; `out` takes no more.
pub fn watch(wanted: &str, out: &mut dyn Write) -> Result<(), String> {
    let mut device = open(wanted)?;
    let name = device.name().unwrap_or_default().to_owned();
    let codes: Vec<Code> = codes(&device).filter_map(|pin| Code::of_pin(&pin)).collect();
    let held = Held::of(&device).map_err(|cause| why(&cause))?;
    let mut state = State::new(codes.iter().copied());
    state.appears(&held, |_| 0);
    let pins: Vec<String> = codes.iter().filter_map(|code| code.pin()).collect();
    let told = |cause: io::Error| format!("{name}: {}", why(&cause));
    let mut before: Vec<AnyValue> = state.values().collect();
    writeln!(out, "{name}: move its sticks and press its buttons; Ctrl-C ends").map_err(told)?;
    loop {
        let events: Vec<_> = device.fetch_events().map_err(told)?.collect();
        for event in events {
            state.take(event);
            state.taken();
            for (place, value) in state.values().enumerate() {
                if before[place] != value {
                    before[place] = value;
                    writeln!(out, "{:<24} {value}", pins[place]).map_err(told)?;
                    out.flush().map_err(told)?;
                }
            }
        }
    }
}
