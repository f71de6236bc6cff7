//! The ways to the objects of a node.

use super::super::scan::open;
use super::super::station::{Parameters, Station};
use super::super::{Protocol, ethercat};
use super::SdoArgs;
use ::ethercat::main::SetupError;
use anyhow::{Context, anyhow};
use api::client::{self, Client, ClientError};
use api::rpc::{RpcError, code};
use obd::AbortCode;
use powerlink::link::Link;
use powerlink::sdo;
use powerlink::sdo::datagram::UDP_PORT;
use powerlink::sdo::udp::{UdpClient, UdpError};
use powerlink::wire::node;
use protocol::params::Hex;
use protocol::{method, params};

/// Longest value that is read.
const VALUE_MAX: usize = 1024 * 1024;
/// Listen this long for a managing node, ns: one with a cycle of half a second is heard twice.
const LISTEN_NS: u64 = 1_000_000_000;

/// Why an object was not read or written.
#[derive(Debug)]
pub(super) enum Failure {
    /// The node does not have the object.
    NoObject(String),
    /// The node refuses for another reason, and says which.
    Refused(String),
    /// Nothing more can be asked.
    Broken(anyhow::Error),
}

/// The way to one node.
pub(super) enum Access {
    /// As the only managing node on an interface.
    Wire(Box<Parameters>),
    /// As the only main device of EtherCAT on an interface.
    Ethercat(Box<ethercat::sdo::Wire>),
    /// Over UDP.
    Udp(Box<UdpClient>),
    /// Through a running control.
    Control {
        /// Its socket.
        client: Client,
        /// The node.
        node: u8,
    },
}

impl Access {
    /// The way that the arguments ask for.
    pub(super) fn open(id: u8, args: &SdoArgs) -> anyhow::Result<Access> {
        if let Some(interface) = &args.interface {
            let link = open(interface, args.bus)?;
            let mac = link.mac();
            if args.bus == Protocol::Ethercat {
                let mut link: Box<dyn Link> = Box::new(link);
                ethercat::refuse_other(&mut *link, LISTEN_NS)?;
                let wire = ethercat::sdo::Wire::open(link, mac, Some(interface), id)?;
                return Ok(Access::Ethercat(Box::new(wire)));
            }
            return Access::on(Box::new(link), mac, Some(interface), id, LISTEN_NS).map_err(|error| {
                match error.downcast_ref::<super::super::station::ForeignMaster>() {
                    Some(_) => {
                        error.context("leave out --interface to ask through the control of this PC, or use --udp")
                    }
                    None => error,
                }
            });
        }
        if let Some(address) = &args.udp {
            let address = match address.contains(':') {
                true => address.clone(),
                false => format!("{address}:{UDP_PORT}"),
            };
            let timing = sdo::Timing {
                give_up_ns: 5_000_000_000,
                ..sdo::Timing::default()
            };
            let client = UdpClient::new(&address, id, node::DIAGNOSTIC, timing).with_context(|| address.clone())?;
            return Ok(Access::Udp(Box::new(client)));
        }
        let client = client::connect(args.machine.as_deref()).map_err(|error| match error {
            ClientError::NotRunning { .. } => anyhow!("{error}; or give --interface IF or --udp ADDRESS"),
            error => error.into(),
        })?;
        Ok(Access::Control { client, node: id })
    }

    /// As the only managing node on a link.
    pub(super) fn on(
        link: Box<dyn Link>,
        mac: [u8; 6],
        interface: Option<&str>,
        id: u8,
        listen_ns: u64,
    ) -> anyhow::Result<Access> {
        let mut station = Station::take_over(link, mac, interface, listen_ns)?;
        let target = station.find(id)?;
        Ok(Access::Wire(Box::new(Parameters::new(station, target))))
    }

    /// Reads an object.
    pub(super) fn read(&mut self, index: u16, sub: u8) -> Result<Vec<u8>, Failure> {
        match self {
            Access::Wire(parameters) => {
                let mut sink = vec![0; VALUE_MAX];
                parameters.client().start_read(index, sub).map_err(client_failure)?;
                let length = wire_result(parameters.run(&[], &mut sink))?;
                sink.truncate(length);
                Ok(sink)
            }
            Access::Ethercat(wire) => device_result(wire.ask((index, sub), None)),
            Access::Udp(client) => {
                let mut sink = vec![0; VALUE_MAX];
                let length = client.read(index, sub, &mut sink).map_err(udp_failure)?;
                sink.truncate(length);
                Ok(sink)
            }
            Access::Control { client, node } => {
                let object = params::SdoRead {
                    node: *node,
                    index,
                    sub,
                };
                let read = client.ask::<method::SdoRead>(&object).map_err(control_failure)?;
                Ok(read.value.0)
            }
        }
    }

    /// Writes an object.
    pub(super) fn write(&mut self, index: u16, sub: u8, value: &[u8]) -> Result<(), Failure> {
        match self {
            Access::Wire(parameters) => {
                let started = parameters.client().start_write(index, sub, value.len());
                started.map_err(client_failure)?;
                wire_result(parameters.run(value, &mut [])).map(|_| ())
            }
            Access::Ethercat(wire) => device_result(wire.ask((index, sub), Some(value))).map(|_| ()),
            Access::Udp(client) => client.write(index, sub, value).map_err(udp_failure),
            Access::Control { client, node } => {
                let object = params::SdoWrite {
                    node: *node,
                    index,
                    sub,
                    value: Hex(value.to_vec()),
                };
                let written = client.ask::<method::SdoWrite>(&object);
                written.map_err(control_failure).map(drop)
            }
        }
    }

    /// Ends the connection.
    pub(super) fn close(&mut self) -> anyhow::Result<()> {
        match self {
            Access::Wire(parameters) => parameters.close(),
            Access::Udp(client) => Ok(client.close()?),
            Access::Control { .. } | Access::Ethercat(..) => Ok(()),
        }
    }
}

fn device_result(done: anyhow::Result<Result<Vec<u8>, SetupError>>) -> Result<Vec<u8>, Failure> {
    done.map_err(Failure::Broken)?.map_err(|error| match error {
        SetupError::Sdo { code, .. } => aborted(code),
        error => Failure::Broken(error.into()),
    })
}

fn wire_result(done: anyhow::Result<Result<usize, sdo::ClientError>>) -> Result<usize, Failure> {
    done.map_err(Failure::Broken)?.map_err(client_failure)
}

fn client_failure(error: sdo::ClientError) -> Failure {
    match error {
        sdo::ClientError::Aborted(code) => aborted(code),
        error => Failure::Broken(error.into()),
    }
}

fn aborted(code: AbortCode) -> Failure {
    let why = format!("{} (0x{:08X})", code.text(), code.0);
    match code {
        AbortCode::NO_OBJECT => Failure::NoObject(why),
        _ => Failure::Refused(why),
    }
}

fn udp_failure(error: UdpError) -> Failure {
    match error {
        UdpError::Client(error) => client_failure(error),
        error @ UdpError::Io(_) => Failure::Broken(error.into()),
    }
}

fn control_failure(error: ClientError) -> Failure {
    match error {
        ClientError::Refused(RpcError {
            code: code::NODE_ABORT,
            message,
            ..
        }) => Failure::Refused(message.text),
        ClientError::Refused(RpcError {
            code: code::NODE_NO_OBJECT,
            message,
            ..
        }) => Failure::NoObject(message.text),
        error => Failure::Broken(error.into()),
    }
}
