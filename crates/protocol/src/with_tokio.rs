//! The client for tasks of tokio.
//!
//! In:  a connection to a control. Out: answers with their types, one request after the other; or messages as they come, for whoever
//! asks for several things at a time.

use crate::client::{ClientError, read};
use crate::method::Method;
use crate::rpc::{Received, Requests};
use std::io;
use std::path::PathBuf;
use std::time::Duration;
use tokio::io::{AsyncBufReadExt, AsyncWriteExt, BufReader, Lines};
use tokio::net::UnixStream;
use tokio::net::unix::{OwnedReadHalf, OwnedWriteHalf};
use tokio::time::timeout;

/// A connection to a control.
#[derive(Debug)]
pub struct Client {
    answers: Lines<BufReader<OwnedReadHalf>>,
    wire: OwnedWriteHalf,
    requests: Requests,
    /// Requests that are to be written.
    unsent: String,
}

impl Client {
    /// Over a connection.
    ///
    /// # Errors
    /// Of the system.
    pub fn new(stream: std::os::unix::net::UnixStream) -> io::Result<Client> {
        stream.set_nonblocking(true)?;
        let (answers, wire) = UnixStream::from_std(stream)?.into_split();
        Ok(Client {
            answers: BufReader::new(answers).lines(),
            wire,
            requests: Requests::default(),
            unsent: String::new(),
        })
    }

    /// Calls a method and waits for its answer, so long at the most. What comes before it is dropped.
    ///
    /// # Errors
    /// The control has gone, refuses, or answers something else.
    pub async fn ask<M: Method>(&mut self, params: &M::Params, longest: Duration) -> Result<M::Answer, ClientError> {
        let asked = async {
            let id = self.put::<M>(params);
            self.send().await?;
            loop {
                if let Received::Answer { id: of, result } = self.message().await?
                    && (of == Some(id) || result.is_err())
                {
                    return read(result.map_err(ClientError::Refused)?);
                }
            }
        };
        let late = || broken(io::ErrorKind::WouldBlock.into());
        timeout(longest, asked).await.map_err(|_| late())?
    }

    /// Puts a request behind those that are to be sent; the number of its answer.
    pub fn put<M: Method>(&mut self, params: &M::Params) -> u64 {
        let (id, line) = self.requests.line::<M>(params);
        self.unsent.push_str(&line);
        id
    }

    /// Sends what was put.
    ///
    /// # Errors
    /// The control has gone.
    pub async fn send(&mut self) -> Result<(), ClientError> {
        let unsent = std::mem::take(&mut self.unsent);
        self.wire.write_all(unsent.as_bytes()).await.map_err(broken)
    }

    /// The next message; nothing is lost where it is waited for no longer.
    ///
    /// # Errors
    /// The control has gone.
    pub async fn message(&mut self) -> Result<Received, ClientError> {
        let line = self.answers.next_line().await.map_err(broken)?;
        let line = line.ok_or_else(|| ClientError::bad("the control has closed the connection"))?;
        Received::parse(line.as_bytes()).map_err(ClientError::bad)
    }
}

fn broken(cause: io::Error) -> ClientError {
    ClientError::Io {
        path: PathBuf::from("the control"),
        cause,
    }
}
