//! SDO over UDP sockets, for tools on any computer that has an IP connection to the nodes.
//!
//! In:  one command at a time ([`UdpClient`]), or objects ([`UdpServer`]). Out: its result; answers to datagrams.
//! Both wait for the network and are not RT.

use std::boxed::Box;
use std::fmt;
use std::io;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, ToSocketAddrs, UdpSocket};
use std::time::{Duration, Instant};

use obd::Objects;

use super::client::{Client, ClientError, Timing};
use super::datagram::{DATAGRAM_MAX, Datagram};
use super::{SERVICE_DATA_MAX, Server};

/// Longest payload of a datagram that is read as a whole; what is longer cannot come through a POWERLINK network.
const RECEIVE_MAX: usize = 1500;
/// Longest wait for one datagram, so that no wake-up depends on another.
const WAIT_MAX: Duration = Duration::from_millis(100);

/// Why a command over UDP failed.
#[derive(Debug)]
pub enum UdpError {
    /// What the system refused.
    Io(io::Error),
    /// The node, or the network.
    Client(ClientError),
}

impl fmt::Display for UdpError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            UdpError::Io(error) => write!(f, "{error}"),
            UdpError::Client(error) => write!(f, "{error}"),
        }
    }
}

impl std::error::Error for UdpError {}

impl From<io::Error> for UdpError {
    fn from(error: io::Error) -> Self {
        UdpError::Io(error)
    }
}

impl From<ClientError> for UdpError {
    fn from(error: ClientError) -> Self {
        UdpError::Client(error)
    }
}

/// A client with a socket of its own, connected to one node.
#[derive(Debug)]
pub struct UdpClient {
    socket: UdpSocket,
    client: Client,
    node: u8,
    own_node: u8,
    started: Instant,
}

impl UdpClient {
    /// Gets ready to talk to `node` at `address`, usually 192.168.100.`node`, port [`UDP_PORT`](super::datagram::UDP_PORT).
    /// Nothing is sent yet.
    ///
    /// # Errors
    /// What the system refuses: the address, the socket.
    pub fn new(address: impl ToSocketAddrs, node: u8, own_node: u8, timing: Timing) -> io::Result<UdpClient> {
        let mut last = io::Error::new(io::ErrorKind::InvalidInput, "no address");
        for address in address.to_socket_addrs()? {
            let any = match address {
                SocketAddr::V4(_) => IpAddr::V4(Ipv4Addr::UNSPECIFIED),
                SocketAddr::V6(_) => IpAddr::V6(Ipv6Addr::UNSPECIFIED),
            };
            match UdpSocket::bind((any, 0)).and_then(|socket| socket.connect(address).map(|()| socket)) {
                Ok(socket) => {
                    return Ok(UdpClient {
                        socket,
                        client: Client::new(timing),
                        node,
                        own_node,
                        started: Instant::now(),
                    });
                }
                Err(error) => last = error,
            }
        }
        Err(last)
    }

    /// Reads one object into `sink`; returns its length.
    ///
    /// # Errors
    /// [`UdpError`]: the socket, or how the command failed.
    pub fn read(&mut self, index: u16, sub: u8, sink: &mut [u8]) -> Result<usize, UdpError> {
        self.client.start_read(index, sub)?;
        self.run(&[], sink)
    }

    /// Writes one object.
    ///
    /// # Errors
    /// [`UdpError`]: the socket, or how the command failed.
    pub fn write(&mut self, index: u16, sub: u8, value: &[u8]) -> Result<(), UdpError> {
        self.client.start_write(index, sub, value.len())?;
        self.run(value, &mut []).map(|_| ())
    }

    /// Closes the connection.
    ///
    /// # Errors
    /// [`UdpError`]: the socket.
    pub fn close(&mut self) -> Result<(), UdpError> {
        self.client.close();
        self.send(&[])
    }

    /// Runs the command that was started to its end. A socket that fails ends it, too.
    fn run(&mut self, value: &[u8], sink: &mut [u8]) -> Result<usize, UdpError> {
        loop {
            if let Err(error) = self.send(value).and_then(|()| self.receive(sink)) {
                self.client.close();
                return Err(error);
            }
            if let Some(result) = self.client.result() {
                // An acknowledge or an abort that is due would wait for the next command.
                self.send(&[])?;
                return Ok(result?);
            }
        }
    }

    fn now_ns(&self) -> u64 {
        u64::try_from(self.started.elapsed().as_nanos()).unwrap_or(u64::MAX)
    }

    /// Sends everything that is due.
    fn send(&mut self, value: &[u8]) -> Result<(), UdpError> {
        let (mut service_data, mut payload) = ([0; SERVICE_DATA_MAX], [0; DATAGRAM_MAX]);
        while let Some(len) = self.client.poll_transmit(self.now_ns(), value, &mut service_data) {
            let datagram = Datagram {
                destination: self.node,
                source: self.own_node,
                service_data: &service_data[..len],
            };
            if let Some(len) = datagram.emit(&mut payload) {
                self.socket.send(&payload[..len])?;
            }
        }
        Ok(())
    }

    /// Takes one datagram, or waits until something is due.
    fn receive(&mut self, sink: &mut [u8]) -> Result<(), UdpError> {
        let due_ns = self.client.next_deadline_ns().unwrap_or(u64::MAX);
        let wait = Duration::from_nanos(due_ns.saturating_sub(self.now_ns())).min(WAIT_MAX);
        let mut payload = [0; RECEIVE_MAX];
        if let Some((len, _)) = receive(&self.socket, wait, &mut payload)?
            && let Some(datagram) = Datagram::parse(&payload[..len])
        {
            let now_ns = self.now_ns();
            self.client.receive(now_ns, datagram.service_data, sink);
        }
        Ok(())
    }
}

/// One datagram, and where it came from; `None`: none came within the time.
fn receive(socket: &UdpSocket, wait: Duration, payload: &mut [u8]) -> io::Result<Option<(usize, SocketAddr)>> {
    // A time-out of zero would mean to wait for ever.
    socket.set_read_timeout(Some(wait.max(Duration::from_micros(100))))?;
    match socket.recv_from(payload) {
        Ok(received) => Ok(Some(received)),
        Err(error)
            if matches!(
                error.kind(),
                io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut | io::ErrorKind::Interrupted
            ) =>
        {
            Ok(None)
        }
        Err(error) => Err(error),
    }
}

/// A server with a socket of its own, for up to `CLIENTS` clients at a time; they are told apart by their addresses.
#[derive(Debug)]
pub struct UdpServer<const CLIENTS: usize = 4, const STAGING: usize = 65536> {
    socket: UdpSocket,
    server: Box<Server<CLIENTS, STAGING>>,
    node: u8,
    /// Address and node id of each client; its place is its name in `server`.
    peers: [Option<(SocketAddr, u8)>; CLIENTS],
    /// Where a further client goes.
    next: usize,
}

impl<const CLIENTS: usize, const STAGING: usize> UdpServer<CLIENTS, STAGING> {
    /// Listens at `address`, for node `node`.
    ///
    /// # Errors
    /// What the system refuses: the address, the socket.
    pub fn bind(address: impl ToSocketAddrs, node: u8) -> io::Result<Self> {
        const { assert!(CLIENTS > 0 && CLIENTS <= 256) };
        Ok(UdpServer {
            socket: UdpSocket::bind(address)?,
            server: Box::new(Server::new()),
            node,
            peers: [None; CLIENTS],
            next: 0,
        })
    }

    /// Where it listens.
    ///
    /// # Errors
    /// What the system refuses.
    pub fn local_addr(&self) -> io::Result<SocketAddr> {
        self.socket.local_addr()
    }

    /// Takes one datagram, waiting for at most `wait`, and sends what is to be answered. Returns whether one came.
    ///
    /// # Errors
    /// What the system refuses; a time-out is none.
    pub fn serve(&mut self, objects: &mut impl Objects, wait: Duration) -> io::Result<bool> {
        let mut payload = [0; RECEIVE_MAX];
        let Some((len, address)) = receive(&self.socket, wait, &mut payload)? else {
            return Ok(false);
        };
        let Some(datagram) = Datagram::parse(&payload[..len]) else {
            return Ok(true);
        };
        let known = self
            .peers
            .iter()
            .position(|peer| peer.is_some_and(|peer| peer.0 == address));
        let at = known.unwrap_or_else(|| {
            let at = self.next;
            self.next = (at + 1) % CLIENTS;
            at
        });
        self.peers[at] = Some((address, datagram.source));
        self.server.receive(at as u8, datagram.service_data, objects);
        let (mut service_data, mut payload) = ([0; SERVICE_DATA_MAX], [0; DATAGRAM_MAX]);
        while let Some((at, len)) = self.server.poll_transmit(&mut service_data) {
            let Some((address, destination)) = self.peers.get(usize::from(at)).copied().flatten() else {
                continue;
            };
            let datagram = Datagram {
                destination,
                source: self.node,
                service_data: &service_data[..len],
            };
            if let Some(len) = datagram.emit(&mut payload) {
                // A client that is gone must not stop the server.
                match self.socket.send_to(&payload[..len], address) {
                    Ok(_) => {}
                    Err(error) if error.kind() == io::ErrorKind::ConnectionRefused => {}
                    Err(error) => return Err(error),
                }
            }
        }
        Ok(true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use obd::{AbortCode, DataType, Dictionary, EntryDef};
    use std::vec;
    use std::vec::Vec;

    const TABLE: &[EntryDef] = &[
        EntryDef::rws(0x1006, DataType::U32, "NMT_CycleLen_U32"),
        EntryDef::rw(0x2000, DataType::Domain, "Blob").capacity(20_000),
    ];

    #[test]
    fn two_clients_and_one_server_on_this_computer() {
        let mut server = UdpServer::<2, 20_000>::bind("127.0.0.1:0", 1).unwrap();
        let address = server.local_addr().unwrap();
        let serving = std::thread::spawn(move || {
            let mut objects = Box::new(Dictionary::<4, 20_100>::new(&[TABLE]).unwrap());
            // The value that ends it: no clock decides.
            while objects.read(0x1006, 0).unwrap() != 99_u32.to_le_bytes() {
                server.serve(&mut *objects, Duration::from_secs(1)).unwrap();
            }
            objects.read(0x2000, 0).unwrap().to_vec()
        });
        let client = || UdpClient::new(address, 1, 253, Timing::default()).unwrap();
        let (mut first, mut second) = (client(), client());
        let value: Vec<u8> = (0..20_000_u32).map(|at| (at % 251) as u8).collect();
        first.write(0x2000, 0, &value).unwrap();
        let mut sink = vec![0; 20_001];
        let len = second.read(0x2000, 0, &mut sink).unwrap();
        assert_eq!(&sink[..len], value);
        match first.read(0x3000, 0, &mut sink) {
            Err(UdpError::Client(ClientError::Aborted(AbortCode::NO_OBJECT))) => {}
            other => panic!("{other:?}"),
        }
        second.close().unwrap();
        first.write(0x1006, 0, &99_u32.to_le_bytes()).unwrap();
        assert_eq!(serving.join().unwrap(), value);
    }
}
