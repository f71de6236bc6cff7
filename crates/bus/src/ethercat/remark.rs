//! What the main device tells that no other bus has, in words with the names of the nodes.

use super::setup::place;
use cia402::profile::axis_of;
use config::{Config, Node};
use ethercat::main::config::Place;
use ethercat::main::{Break, Event};

/// Something that happened on an EtherCAT bus. [`Remark::text`] puts it into words.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Remark(pub(super) Event);

impl Remark {
    /// The words. Devices have their names, or their positions as people count them, from 1.
    pub fn text(&self, names: &Names) -> String {
        match self.0 {
            Event::Broken(place) => broken(names, place),
            Event::Spoilt { position, port, frames } => format!(
                "{frames} frames arrived spoilt at {}, port {port}: the cable there, or what lies at its other end",
                names.at(position)
            ),
            Event::OrderChanged {
                device,
                position,
                station,
            } => format!(
                "{} should be at position {}, where {} is: was the order of the cables changed?",
                names.of(device),
                position + 1,
                names.at(station.wrapping_sub(STATION_FIRST))
            ),
            Event::Stranger { position, identity } => {
                format!(
                    "{} is not in the machine file and left alone: {identity}",
                    names.at(position)
                )
            }
            Event::Lacks { device, object } => {
                let (index, sub) = (object.index, object.sub);
                let what = lacking(axis_of(index).1);
                format!("{} does not have 0x{index:04X}:{sub}: {what}", names.of(device))
            }
            Event::Failed { device, .. }
            | Event::Slow { device, .. }
            | Event::Left { device, .. }
            | Event::Lost { device, .. }
            | Event::Identified { device, .. }
            | Event::Up { device }
            | Event::Emergency { device, .. } => {
                let text = self.0.to_string();
                let number = format!("device {device}");
                match text.strip_prefix(&number) {
                    Some(rest) => format!("{}{rest}", names.of(device)),
                    None => text,
                }
            }
            Event::Silent { .. }
            | Event::Unsteady { .. }
            | Event::Found { .. }
            | Event::TooMany { .. }
            | Event::More { .. }
            | Event::OtherMain { .. } => self.0.to_string(),
        }
    }
}

/// What it means that a drive does not have an object.
fn lacking(index: u16) -> &'static str {
    match index {
        0x60C2 => "it interpolates over the time that it is set to, which must be the cycle",
        0x6065 => "its own watch of the following error stays as it is set; that of the control is not changed by it",
        0x605A..=0x605E => "how it stops is as it is set",
        0x6085 => "the ramp of its quick stop is as it is set",
        0x6099 | 0x609A => "how fast it homes is as it is set",
        0x607C => "its home offset is as it is set",
        _ => "nothing is written there",
    }
}

/// Station address of position 0.
const STATION_FIRST: u16 = 0x1000;

/// Names of the nodes of a machine, with their positions.
#[derive(Clone, Debug, Default)]
pub struct Names(Vec<(String, Option<u16>)>);

impl Names {
    /// Those of a machine file.
    pub fn new(config: &Config) -> Names {
        let nodes = config.bus.nodes.iter();
        let name = |node: &Node| match place(node) {
            Place::Position(position) => (format!("{} (node {})", node.name, node.id), Some(position)),
            Place::Alias(_) => (format!("{} (node {})", node.name, node.id), None),
        };
        Names(nodes.map(name).collect())
    }

    /// By the number in the configuration.
    fn of(&self, device: u16) -> String {
        let node = self.0.get(usize::from(device));
        node.map_or_else(|| format!("device {device}"), |(name, _)| name.clone())
    }

    /// By the position, 0 first.
    fn at(&self, position: u16) -> String {
        match self.0.iter().find(|(_, at)| *at == Some(position)) {
            Some((name, _)) => name.clone(),
            None => format!("position {}", position + 1),
        }
    }
}

fn broken(names: &Names, place: Break) -> String {
    let behind = names.at(place.behind);
    let text = match place.before {
        None => format!("nothing answers behind this PC: the cable to {behind}, or its power"),
        Some((before, port)) if place.link_lost => format!(
            "no link between {}, port {port}, and {behind}: the cable, or power of the latter",
            names.at(before)
        ),
        Some((before, port)) => {
            format!(
                "{behind} is silent, though {} has a link at port {port}",
                names.at(before)
            )
        }
    };
    match place.lost_links {
        0 | 1 => text,
        times => format!("{text}; this link was lost {times} times"),
    }
}
