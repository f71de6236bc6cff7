//! A managing node that never leaves PRE_OPERATIONAL_1: enough to find nodes and to read and write their parameters.
//!
//! In:  an interface on which no managing node is at work; that is made sure first by listening.
//! Out: who answers, values of objects. Frames go out by hand: SoA after SoA, never a SoC, a PReq or an NMT command, so that
//! no node is reset or starts anything.

use anyhow::{anyhow, bail};
use bus::sender::SoleSender;
use powerlink::link::{Link, LinkError};
use powerlink::mn::UnaskedAnswers;
use powerlink::nmt::NmtState;
use powerlink::sdo::{Client, SERVICE_DATA_MAX, Timing};
use powerlink::wire::{
    self, Asnd, FRAME_LEN_MAX, Frame, Header, IdentResponse, Mac, RequestedService, Soa, multicast, node,
};

const MS: u64 = 1_000_000;
/// A SoA to wake nodes (C_DLL_PREOP1_START_CYCLES of them).
const WAKE_SOAS: u32 = 10;
/// Pause behind a SoA that nobody answers.
const WAKE_PAUSE_NS: u64 = 2 * MS;
/// A node that has not sent anything in its slot by then sends nothing.
const SLOT_NS: u64 = 3 * MS;
/// A node that is asked for its identity is given up after this time.
const IDENT_GIVE_UP_NS: u64 = 2_000 * MS;
/// An SDO is given up after this time without anything new.
const SDO_GIVE_UP_NS: u64 = 5_000 * MS;
/// Pause between two invitations to a node that has nothing to send yet.
const INVITE_PAUSE_NS: u64 = MS;

/// Another managing node is at work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ForeignMaster {
    /// It was heard.
    Heard {
        /// Its address.
        mac: Mac,
    },
    /// Only a node that answers it was heard: what this PC itself sends on an interface is not heard on it.
    Answered {
        /// Id of that node.
        node: u8,
    },
}

impl std::fmt::Display for ForeignMaster {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            ForeignMaster::Heard { mac } => write!(
                f,
                "a managing node is at work on this wire ({}): nothing was sent",
                super::words::mac(*mac)
            ),
            ForeignMaster::Answered { node } => write!(
                f,
                "node {node} answers a managing node, perhaps on this very interface: nothing was sent"
            ),
        }
    }
}

impl std::error::Error for ForeignMaster {}

/// One answer to an IdentRequest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// Node id.
    pub id: u8,
    /// Its address.
    pub mac: Mac,
    /// What it says it is.
    pub ident: IdentResponse,
}

/// Listens for `span_ns`, hands every frame to `hear`; the first managing node that was heard comes back.
pub fn listen(
    link: &mut dyn Link,
    span_ns: u64,
    hear: &mut dyn FnMut(u64, &[u8]),
) -> Result<Option<ForeignMaster>, LinkError> {
    let mut buffer = [0; FRAME_LEN_MAX];
    let (mut foreign, mut unasked) = (None, UnaskedAnswers::new());
    let end_ns = link.now_ns() + span_ns;
    while link.now_ns() < end_ns {
        if let Some(received) = link.receive(&mut buffer, end_ns)? {
            let frame = &buffer[..received.length.min(FRAME_LEN_MAX)];
            let now_ns = link.now_ns();
            hear(received.stamp_ns.unwrap_or(now_ns), frame);
            foreign = match (foreign, master(frame)) {
                // Who is heard says more than who answers.
                (None | Some(ForeignMaster::Answered { .. }), Some(mac)) => Some(ForeignMaster::Heard { mac }),
                (None, None) => node_of(frame)
                    .filter(|node| unasked.is_sign(*node))
                    .map(|node| ForeignMaster::Answered { node }),
                (known @ Some(_), _) => known,
            };
        }
    }
    Ok(foreign)
}

/// The managing node that sent a frame.
fn master(frame: &[u8]) -> Option<Mac> {
    let (header, _) = wire::accept(frame).ok()?;
    header.is_from_managing_node().then_some(header.source)
}

/// The node that sent a frame.
fn node_of(frame: &[u8]) -> Option<u8> {
    wire::accept(frame).ok().map(|(header, _)| header.source_node)
}

/// The station.
pub struct Station {
    link: Box<dyn Link>,
    mac: Mac,
    /// `None`: the wire is no interface of this PC.
    _sole: Option<SoleSender>,
    buffer: [u8; FRAME_LEN_MAX],
}

impl Station {
    /// Takes the wire over after listening for `listen_ns`, and wakes the nodes. `interface`: that of the link, if it is one of
    /// this PC.
    ///
    /// # Errors
    /// A managing node is there, or another sender of this PC; the link fails.
    pub fn take_over(
        mut link: Box<dyn Link>,
        mac: Mac,
        interface: Option<&str>,
        listen_ns: u64,
    ) -> anyhow::Result<Station> {
        if let Some(foreign) = listen(&mut *link, listen_ns, &mut |_, _| {})? {
            return Err(foreign.into());
        }
        let mut station = Station {
            _sole: interface.map(SoleSender::claim).transpose()?,
            link,
            mac,
            buffer: [0; FRAME_LEN_MAX],
        };
        for _ in 0..WAKE_SOAS {
            station.soa(RequestedService::NoService, node::INVALID)?;
            station.hear(WAKE_PAUSE_NS, &mut |_, _| false)?;
        }
        Ok(station)
    }

    fn send(&mut self, header: &Header, frame: &Frame<'_>) -> anyhow::Result<()> {
        let mut buffer = [0; FRAME_LEN_MAX];
        let length = frame.emit(header, &mut buffer).map_err(|error| anyhow!("{error}"))?;
        Ok(self.link.send(&buffer[..length])?)
    }

    fn soa(&mut self, service: RequestedService, target: u8) -> anyhow::Result<()> {
        let header = Header::multicast(multicast::SOA, self.mac, node::MN);
        self.send(
            &header,
            &Frame::Soa(Soa::new(NmtState::PreOperational1, service, target)),
        )
    }

    /// Receives for `span_ns`, or until `take` has what it waits for. Another managing node ends everything.
    fn hear(&mut self, span_ns: u64, take: &mut dyn FnMut(&Header, &Asnd<'_>) -> bool) -> anyhow::Result<bool> {
        let end_ns = self.link.now_ns() + span_ns;
        loop {
            let Some(received) = self.link.receive(&mut self.buffer, end_ns)? else {
                return Ok(false);
            };
            let frame = &self.buffer[..received.length.min(FRAME_LEN_MAX)];
            let Ok((header, parsed)) = wire::accept(frame) else {
                continue;
            };
            if let Some(foreign) = master(frame).filter(|foreign| *foreign != self.mac) {
                bail!(
                    "another managing node began to send ({}): stopped at once",
                    super::words::mac(foreign)
                );
            }
            if let Frame::Asnd(asnd) = parsed
                && take(&header, &asnd)
            {
                return Ok(true);
            }
            if self.link.now_ns() >= end_ns {
                return Ok(false);
            }
        }
    }

    /// Asks all node ids who they are, twice; every different answer counts. `progress` is told each id.
    ///
    /// # Errors
    /// The link fails, another managing node begins to send.
    pub fn scan(&mut self, answer_ns: u64, progress: &mut dyn FnMut(u8)) -> anyhow::Result<Vec<Found>> {
        let mut found: Vec<Found> = Vec::new();
        for _round in 0..2 {
            for id in (1..=node::CN_MAX).chain([node::DIAGNOSTIC]) {
                progress(id);
                self.soa(RequestedService::IdentRequest, id)?;
                // Two nodes with the same id answer at once: the slot is never left before its time.
                self.hear(answer_ns, &mut |header, asnd| {
                    if let Asnd::IdentResponse(ident) = asnd {
                        let answer = Found {
                            id: header.source_node,
                            mac: header.source,
                            ident: *ident,
                        };
                        match found
                            .iter_mut()
                            .find(|known| (known.id, known.mac) == (answer.id, answer.mac))
                        {
                            Some(known) => *known = answer,
                            None => found.push(answer),
                        }
                    }
                    false
                })?;
            }
        }
        found.sort_by_key(|found| (found.id, found.mac));
        Ok(found)
    }

    /// Finds one node.
    ///
    /// # Errors
    /// It does not answer; the link fails.
    pub fn find(&mut self, id: u8) -> anyhow::Result<Found> {
        let give_up_ns = self.link.now_ns() + IDENT_GIVE_UP_NS;
        while self.link.now_ns() < give_up_ns {
            self.soa(RequestedService::IdentRequest, id)?;
            let mut found = None;
            self.hear(SLOT_NS, &mut |header, asnd| {
                if let (true, Asnd::IdentResponse(ident)) = (header.source_node == id, asnd) {
                    found = Some(Found {
                        id,
                        mac: header.source,
                        ident: *ident,
                    });
                }
                found.is_some()
            })?;
            if let Some(found) = found {
                return Ok(found);
            }
        }
        bail!(
            "node {id} does not answer: is it on, connected to this interface, and set to this id? ('isocnc bus scan' asks all)"
        )
    }
}

/// Parameters of one node through a [`Station`].
pub struct Parameters {
    station: Station,
    target: Found,
    client: Client,
}

impl Parameters {
    /// Parameters of a node that was found.
    pub fn new(station: Station, target: Found) -> Parameters {
        let timing = Timing {
            first_timeout_ns: 50 * MS,
            give_up_ns: SDO_GIVE_UP_NS,
            acknowledge_delay_ns: 2 * MS,
            ..Timing::default()
        };
        Parameters {
            station,
            target,
            client: Client::new(timing),
        }
    }

    /// Carries a command out that was started: what is due goes out, then the node is invited, in turn.
    pub fn run(&mut self, value: &[u8], sink: &mut [u8]) -> anyhow::Result<Result<usize, powerlink::sdo::ClientError>> {
        loop {
            if let Some(result) = self.client.result() {
                return Ok(result);
            }
            self.exchange(value, sink)?;
        }
    }

    fn exchange(&mut self, value: &[u8], sink: &mut [u8]) -> anyhow::Result<()> {
        let mut out = [0; SERVICE_DATA_MAX];
        let now_ns = self.station.link.now_ns();
        if let Some(length) = self.client.poll_transmit(now_ns, value, &mut out) {
            let header = Header {
                destination: self.target.mac,
                source: self.station.mac,
                destination_node: self.target.id,
                source_node: node::MN,
            };
            self.station.soa(RequestedService::UnspecifiedInvite, node::MN)?;
            self.station.send(&header, &Frame::Asnd(Asnd::Sdo(&out[..length])))?;
        }
        self.station.soa(RequestedService::UnspecifiedInvite, self.target.id)?;
        let id = self.target.id;
        let mut came: Option<Vec<u8>> = None;
        self.station.hear(SLOT_NS, &mut |header, asnd| {
            if let (true, Asnd::Sdo(data)) = (header.source_node == id && header.destination_node == node::MN, asnd) {
                came = Some(data.to_vec());
            }
            came.is_some()
        })?;
        match came {
            Some(data) => {
                let now_ns = self.station.link.now_ns();
                self.client.receive(now_ns, &data, sink);
            }
            None => _ = self.station.hear(INVITE_PAUSE_NS, &mut |_, _| false)?,
        }
        Ok(())
    }

    /// The station, for other nodes.
    pub fn into_station(self) -> Station {
        self.station
    }

    /// The client, to start a command.
    pub fn client(&mut self) -> &mut Client {
        &mut self.client
    }

    /// Closes the connection, so that the node need not wait for its time-out.
    pub fn close(&mut self) -> anyhow::Result<()> {
        self.client.close();
        while self.client.wants_to_transmit(self.station.link.now_ns()) {
            self.exchange(&[], &mut [])?;
        }
        Ok(())
    }
}
