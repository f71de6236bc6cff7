//! `isocnc bus sdo`: objects of a node, read and written.
//!
//! In:  a node on an interface on which nobody else manages, behind an IP address, or of a running control.
//! Out: values as numbers and text. A write shows the value before and after.

mod access;

use super::Protocol;
use super::value::{self, encode, guess};
use super::words::{self, OBJECTS, counted};
use access::{Access, Failure};
use anyhow::{Context, anyhow, bail};
use clap::{Args, Subcommand};
use obd::DataType;
use obd::device::DeviceDescription;
use serde_json::json;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use terminal::refusal::Refusal;

/// Entries of an array that `list` shows when nobody names them.
const ENTRIES_SHOWN: u8 = 16;

/// Number of entries of an array with one for each node, and how many of them are shown.
const PER_NODE: u8 = 254;
const PER_NODE_SHOWN: u8 = 3;

/// Arguments of `bus sdo`.
#[derive(Clone, Debug, Args)]
pub struct SdoArgs {
    /// Node id; on EtherCAT the position, from 1
    #[arg(long, global = true, value_name = "ID", value_parser = clap::value_parser!(u8).range(1..=254))]
    node: Option<u8>,
    /// Network interface on which no other master is at work
    #[arg(long, global = true, value_name = "IF", conflicts_with_all = ["udp", "machine"])]
    interface: Option<String>,
    /// What the interface carries
    #[arg(long, global = true, value_enum, default_value_t)]
    bus: Protocol,
    /// SDO over UDP: address of the node, and port if it is not 3819
    #[arg(long, global = true, value_name = "ADDRESS", conflicts_with = "machine")]
    udp: Option<String>,
    /// Running control of this machine; without it, --interface and --udp: that of ISOCNC_MACHINE, or the only one that runs
    #[arg(long, global = true, value_name = "NAME")]
    machine: Option<String>,
    /// Device file (XDD, XDC, EDS) that knows objects and types
    #[arg(long, global = true, value_name = "FILE")]
    device: Option<PathBuf>,
    #[command(subcommand)]
    command: SdoCommand,
}

#[derive(Clone, Debug, Subcommand)]
enum SdoCommand {
    /// The objects of the device file, or of the communication profile, with their values
    #[command(after_help = "Example: isocnc bus sdo list --interface eth1 --node 3")]
    List,
    /// Read objects
    #[command(after_help = "Example: isocnc bus sdo get --node 3 0x1018:1 0x1008")]
    Get {
        /// Objects, like 0x1006 or 0x1018:1
        #[arg(required = true, value_parser = value::object)]
        objects: Vec<(u16, u8)>,
        /// Type of the values; by default that of the device file, else told by their length
        #[arg(long = "type", value_name = "TYPE", value_parser = value::data_type)]
        data_type: Option<DataType>,
    },
    /// Write an object; shows its value before and after
    #[command(after_help = "Example: isocnc bus sdo set --interface eth1 --node 3 0x1006 1000")]
    Set {
        /// Object, like 0x1006 or 0x1018:1
        #[arg(value_parser = value::object)]
        object: (u16, u8),
        /// New value: a number, text, or octets like 0a1b, as its type wants it
        #[arg(allow_hyphen_values = true)]
        value: String,
        /// Type of the value; by default that of the device file, else told by the length of the present value
        #[arg(long = "type", value_name = "TYPE", value_parser = value::data_type)]
        data_type: Option<DataType>,
    },
}

/// Runs the command. Exit code 1: the node refuses or does not answer.
///
/// # Errors
/// What keeps it from asking.
pub(super) fn sdo(args: &SdoArgs, as_json: bool, out: &mut impl Write) -> anyhow::Result<ExitCode> {
    let Some(node) = args.node else {
        return Err(Refusal::usage("which node? give its id: --node ID").into());
    };
    let device = match &args.device {
        None => None,
        Some(path) => {
            let octets = files::read(path, files::read::TEXT_MAX).with_context(|| path.display().to_string())?;
            match obd::device::parse(&path.display().to_string(), &octets) {
                Ok(device) => Some(device),
                Err(errors) => {
                    let lines: Vec<String> = errors.lines().map(|line| line.to_string()).collect();
                    return Err(Refusal::of_file(&path.display().to_string(), lines.join("\n")).into());
                }
            }
        }
    };
    let mut access = Access::open(node, args)?;
    let done = run(&args.command, &mut access, device.as_ref(), as_json, out);
    // The node would wait for its time-out; what failed before is more important.
    let closed = access.close();
    let code = done?;
    closed?;
    out.flush()?;
    Ok(code)
}

fn run(
    command: &SdoCommand,
    access: &mut Access,
    device: Option<&DeviceDescription>,
    as_json: bool,
    out: &mut impl Write,
) -> anyhow::Result<ExitCode> {
    match command {
        SdoCommand::List => list(access, device, as_json, out),
        SdoCommand::Get { objects, data_type } => {
            let mut code = ExitCode::SUCCESS;
            for (index, sub) in objects {
                let data_type = data_type.or_else(|| typed(device, *index, *sub));
                match access.read(*index, *sub) {
                    Ok(value) => print(*index, *sub, &value, data_type, as_json, out)?,
                    Err(Failure::NoObject(why) | Failure::Refused(why)) => {
                        code = ExitCode::FAILURE;
                        refused(*index, *sub, &why, as_json, out)?;
                    }
                    Err(Failure::Broken(error)) => return Err(error),
                }
            }
            Ok(code)
        }
        SdoCommand::Set {
            object: (index, sub),
            value,
            data_type,
        } => set(
            access,
            (*index, *sub),
            value,
            data_type.or_else(|| typed(device, *index, *sub)),
            as_json,
            out,
        ),
    }
}

/// Type of an object by the device file, else by the communication profile.
fn typed(device: Option<&DeviceDescription>, index: u16, sub: u8) -> Option<DataType> {
    let object = device.and_then(|device| device.object(index, sub));
    let in_file = object.and_then(|object| object.data_type?.known());
    in_file.or_else(|| words::object_type(index, sub))
}

fn print(
    index: u16,
    sub: u8,
    value: &[u8],
    data_type: Option<DataType>,
    as_json: bool,
    out: &mut impl Write,
) -> anyhow::Result<()> {
    if as_json {
        let mut json = value::to_json(value, data_type);
        json["object"] = words::object(index, sub).into();
        json["name"] = name(index).into();
        writeln!(out, "{json}")?;
    } else {
        let length = counted(value.len() as u64, "octet");
        let row = format!(
            "{:10}  {length:>9}  {:40}  {}",
            words::object(index, sub),
            value::show(value, data_type),
            name(index)
        );
        writeln!(out, "{}", row.trim_end())?;
    }
    Ok(())
}

fn name(index: u16) -> String {
    match words::object_name(index) {
        "" => words::profile_object_name(index),
        name => name.to_owned(),
    }
}

fn refused(index: u16, sub: u8, why: &str, as_json: bool, out: &mut impl Write) -> anyhow::Result<()> {
    let object = words::object(index, sub);
    match as_json {
        true => writeln!(out, "{}", json!({ "object": object, "refused": why }))?,
        false => writeln!(out, "{object:10}  refused: {why}")?,
    }
    Ok(())
}

fn set(
    access: &mut Access,
    (index, sub): (u16, u8),
    text: &str,
    data_type: Option<DataType>,
    as_json: bool,
    out: &mut impl Write,
) -> anyhow::Result<ExitCode> {
    let object = words::object(index, sub);
    let before = match access.read(index, sub) {
        Ok(value) => Some(value),
        // Some objects can only be written.
        Err(Failure::NoObject(_) | Failure::Refused(_)) => None,
        Err(Failure::Broken(error)) => return Err(error),
    };
    let data_type = match (data_type, &before) {
        (Some(data_type), _) => data_type,
        (None, Some(before)) => signed_if_negative(guess(before.len()), text),
        (None, None) => bail!("{object} cannot be read, so its type is not known: give it, like --type u32"),
    };
    let octets = encode(text, data_type).map_err(|what| anyhow!("{object}: {what}"))?;
    if let Err(failure) = access.write(index, sub, &octets) {
        return match failure {
            Failure::NoObject(why) | Failure::Refused(why) => {
                refused(index, sub, &why, as_json, out)?;
                Ok(ExitCode::FAILURE)
            }
            Failure::Broken(error) => Err(error),
        };
    }
    let after = access.read(index, sub).ok();
    let shown = |value: &Option<Vec<u8>>| match value {
        Some(value) => value::show(value, Some(data_type)),
        None => "cannot be read".into(),
    };
    if as_json {
        let json = |value: &Option<Vec<u8>>| value.as_ref().map(|value| value::to_json(value, Some(data_type)));
        let (before, after) = (json(&before), json(&after));
        writeln!(out, "{}", json!({ "object": object, "before": before, "after": after }))?;
    } else {
        writeln!(out, "{object} before: {}", shown(&before))?;
        writeln!(out, "{object} after:  {}", shown(&after))?;
    }
    // A node may take a value and keep another, such as a command that is carried out at once.
    if after.is_some_and(|after| after != octets) && !as_json {
        writeln!(out, "the node has taken the value and shows another one")?;
    }
    Ok(ExitCode::SUCCESS)
}

/// A negative number for an object whose length alone is known.
fn signed_if_negative(guessed: DataType, text: &str) -> DataType {
    match guessed {
        _ if !text.starts_with('-') => guessed,
        DataType::U8 => DataType::I8,
        DataType::U16 => DataType::I16,
        DataType::U32 => DataType::I32,
        DataType::U64 => DataType::I64,
        other => other,
    }
}

/// Every object of the device file; without one, those of the communication profile that the node has.
fn list(
    access: &mut Access,
    device: Option<&DeviceDescription>,
    as_json: bool,
    out: &mut impl Write,
) -> anyhow::Result<ExitCode> {
    let mut shown = 0;
    if let Some(device) = device {
        // A node without an object has none of its entries: the first answer is enough.
        let mut missing = None;
        for object in &device.objects {
            if missing == Some(object.index) {
                continue;
            }
            match access.read(object.index, object.sub) {
                Ok(value) => print(
                    object.index,
                    object.sub,
                    &value,
                    typed(Some(device), object.index, object.sub),
                    as_json,
                    out,
                )?,
                Err(Failure::NoObject(why)) => {
                    missing = Some(object.index);
                    refused(object.index, object.sub, &why, as_json, out)?;
                }
                Err(Failure::Refused(why)) => refused(object.index, object.sub, &why, as_json, out)?,
                Err(Failure::Broken(error)) => return Err(error),
            }
            shown += 1;
        }
    } else {
        for index in standard_indices() {
            shown += list_object(access, index, as_json, out)?;
        }
    }
    if shown == 0 {
        bail!("the node has none of the objects that were asked for");
    }
    Ok(ExitCode::SUCCESS)
}

/// Objects of the communication profile, and the first PDOs.
fn standard_indices() -> Vec<u16> {
    let mut indices: Vec<u16> = OBJECTS.iter().map(|(index, _)| *index).collect();
    for first in [0x1400, 0x1600, 0x1800, 0x1A00] {
        indices.extend(first..first + 4);
    }
    indices.sort_unstable();
    indices
}

/// One object with its entries; returns how many values there were.
fn list_object(access: &mut Access, index: u16, as_json: bool, out: &mut impl Write) -> anyhow::Result<u32> {
    let mut read = |sub: u8| match access.read(index, sub) {
        Ok(value) => Ok(Some(value)),
        Err(Failure::NoObject(_) | Failure::Refused(_)) => Ok(None),
        Err(Failure::Broken(error)) => Err(error),
    };
    let Some(first) = read(0)? else {
        return Ok(0);
    };
    print(index, 0, &first, words::object_type(index, 0), as_json, out)?;
    // Only a number of entries is followed by entries.
    let [entries] = first[..] else {
        return Ok(1);
    };
    let mut shown = 1;
    // An array with an entry for each node is mostly empty.
    let most = if entries == PER_NODE {
        PER_NODE_SHOWN
    } else {
        ENTRIES_SHOWN
    };
    for sub in 1..=entries.min(most) {
        let Some(value) = read(sub)? else {
            // A number of entries that is none, or an array with holes: the first hole ends it.
            break;
        };
        print(index, sub, &value, words::object_type(index, sub), as_json, out)?;
        shown += 1;
    }
    if entries > most && shown > u32::from(most) && !as_json {
        writeln!(out, "{:10}  ... up to entry {entries}: 'sdo get' reads them", "")?;
    }
    Ok(shown)
}

#[cfg(test)]
mod tests;
