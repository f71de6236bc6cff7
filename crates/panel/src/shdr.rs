//! A port for agents of somebody else: they connect and read lines of SHDR, which the crate `mtconnect` makes.
//!
//! In:  connections; what is observed for [`mtconnect`](crate::mtconnect). Out: lines, and answers to their pings.

use crate::listen::Listener;
use crate::mtconnect;
use crate::serve::Panel;
use ::mtconnect::shdr::Adapter;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::time::{MissedTickBehavior, interval, timeout};

/// Agents at the same time.
const AGENTS_MAX: usize = 8;
/// What is new is told so often.
const TICK: Duration = Duration::from_millis(100);
/// One that reads nothing for so long is gone.
const UNREAD: Duration = Duration::from_secs(5);
/// Longest line of an agent, octets.
const LINE_MAX: usize = 1024;

/// Serves agents until the panel ends.
pub(crate) async fn serve(listener: Listener, panel: Arc<Panel>) -> io::Result<()> {
    let socket = TcpListener::from_std(listener.socket)?;
    let served = Arc::new(AtomicUsize::new(0));
    loop {
        let Ok((stream, far)) = socket.accept().await else {
            tokio::time::sleep(Duration::from_millis(100)).await;
            continue;
        };
        if served.load(Ordering::Relaxed) >= AGENTS_MAX {
            tracing::warn!(%far, "an agent of MTConnect was refused: {AGENTS_MAX} are connected");
            continue;
        }
        served.fetch_add(1, Ordering::Relaxed);
        let (panel, served) = (Arc::clone(&panel), Arc::clone(&served));
        tokio::spawn(async move {
            if let Err(why) = serve_one(stream, &panel).await {
                tracing::info!(%far, why, "an agent of MTConnect has gone");
            }
            served.fetch_sub(1, Ordering::Relaxed);
        });
    }
}

async fn serve_one(mut stream: TcpStream, panel: &Arc<Panel>) -> Result<(), String> {
    let words = |cause: io::Error| cause.to_string();
    mtconnect::begin(panel).await?;
    let _ = stream.set_nodelay(true);
    let mut ending = panel.ending.clone();
    let mut ticks = interval(TICK);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut adapter = Adapter::default();
    let (mut heard, mut buffer) = (Vec::new(), [0; 256]);
    loop {
        let told;
        tokio::select! {
            read = stream.read(&mut buffer) => match read.map_err(words)? {
                0 => return Ok(()),
                count => told = answers(&mut heard, &buffer[..count])?,
            },
            _ = ticks.tick() => {
                told = panel.mtconnect.with(|agent| adapter.lines(agent)).unwrap_or_default();
            }
            _ = ending.changed() => return Ok(()),
        }
        if !told.is_empty() {
            let written = timeout(UNREAD, stream.write_all(told.as_bytes())).await;
            written.map_err(|_| "it does not read".to_owned())?.map_err(words)?;
        }
    }
}

/// Answers to the lines that are whole with these octets.
fn answers(heard: &mut Vec<u8>, octets: &[u8]) -> Result<String, String> {
    heard.extend_from_slice(octets);
    let mut told = String::new();
    while let Some(end) = heard.iter().position(|octet| *octet == b'\n') {
        let line: Vec<u8> = heard.drain(..=end).collect();
        told += &Adapter::heard(&String::from_utf8_lossy(&line)).unwrap_or_default();
    }
    match heard.len() > LINE_MAX {
        true => Err("it sends a line without an end".into()),
        false => Ok(told),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pings_are_answered_however_they_are_cut() {
        let mut heard = Vec::new();
        assert_eq!(answers(&mut heard, b"* PI"), Ok(String::new()));
        assert_eq!(
            answers(&mut heard, b"NG\r\nx\n* PING\n*"),
            Ok("* PONG 10000\n".repeat(2))
        );
        assert_eq!(heard, b"*");
        assert!(answers(&mut heard, &[b'x'; LINE_MAX]).is_err());
    }
}
