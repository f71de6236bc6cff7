//! What a session serves beside its own socket; the program lists what there is: a panel, a link to a supervisor.
//!
//! In:  a way into the service of the session, as one of its clients; the end of the session.
//! Out: a thread of its own.

use api::server::door::Door;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// One of them.
pub trait Service: Send + Sync {
    /// Name of its thread.
    fn name(&self) -> &'static str;

    /// What the journal says of it as the session begins.
    fn note(&self) -> Option<&str> {
        None
    }

    /// Folder of the programs that its clients load.
    fn programs(&self) -> Option<&Path>;

    /// Serves until the session ends. Not RT.
    fn serve(&self, door: Door, until: Until<'_>);
}

/// The end of a session.
pub struct Until<'a> {
    /// Set then: for a service that looks.
    pub stop: &'a AtomicBool,
    /// Its other end is closed then, however the session ends: for a service that waits.
    pub closed: UnixStream,
}
