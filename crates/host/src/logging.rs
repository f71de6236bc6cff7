//! The log of the ordinary threads. The real-time threads have none: what they notice goes through rings to the operator,
//! whose journal every command shows by itself.
//!
//! In:  events of the crate tracing; `$ISOCNC_LOG`, `$ISOCNC_LOG_FORMAT`, and `$JOURNAL_STREAM` of systemd.
//! Out: standard error, as lines or as JSON; each line with its priority where it goes to the journal of systemd (sd-daemon(3)).

use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use std::fmt;
use std::io::{self, Write, stderr};
use std::os::fd::AsFd;
use std::os::unix::fs::MetadataExt;
use tracing::level_filters::LevelFilter;
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::filter::Targets;
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::{FmtContext, FormatEvent, FormatFields};
use tracing_subscriber::layer::{Layer, SubscriberExt};
use tracing_subscriber::registry::{LookupSpan, Registry};

/// What is wanted where nobody says so: all that may need somebody, and when a supervisor is there again.
const USUAL: &str = "warn,cell_link=info";

/// The carrier of the link to a supervisor says each try again, with places in its sources; what that comes to is told by the link.
/// Its log is there for who names it.
const CARRIER: &str = "zenoh=off";

/// Begins the log of this process; to be called once. `$ISOCNC_LOG` says what of it is wanted: a level (`off`, `error`, `warn`,
/// `info`, `debug`, `trace`), or levels by module, as in `warn,isocnc::api=debug`; without it, warnings and what the link to a
/// supervisor says. With `$ISOCNC_LOG_FORMAT` `json`, every event is an object on a line.
///
/// # Errors
/// A variable that says something else.
pub fn begin() -> Result<(), String> {
    let lines = tracing_subscriber::fmt::layer()
        .with_writer(|| Heard)
        .with_ansi(files::printed::shows_colours(&stderr()));
    let lines: Box<dyn Layer<Registry> + Send + Sync> = match std::env::var("ISOCNC_LOG_FORMAT").as_deref() {
        Ok("json") => lines.json().flatten_event(true).boxed(),
        Ok("text") | Err(_) if goes_to_journal(&stderr()) => lines.event_format(WithPriority).boxed(),
        Ok("text") | Err(_) => lines.boxed(),
        Ok(other) => {
            return Err(format!(
                "ISOCNC_LOG_FORMAT: expected \"text\" or \"json\", got \"{other}\""
            ));
        }
    };
    let wanted = std::env::var("ISOCNC_LOG").unwrap_or_else(|_| USUAL.into());
    let log = tracing_subscriber::registry().with(lines.with_filter(targets(&wanted)?));
    // It fails only where another log has begun, which a second call would be.
    let _ = tracing::subscriber::set_global_default(log);
    Ok(())
}

/// Which events are wanted.
fn targets(wanted: &str) -> Result<Targets, String> {
    // A name alone would ask for all that a module of this name says.
    let is_level = |part: &str| part.contains('=') || !part.is_empty() && part.parse::<LevelFilter>().is_ok();
    // What comes later counts.
    let targets = format!("{CARRIER},{wanted}").parse::<Targets>().ok();
    targets.filter(|_| wanted.split(',').all(is_level)).ok_or_else(|| {
        format!(
            "ISOCNC_LOG: expected a level (off, error, warn, info, debug, trace), or levels by module, as in \
             \"warn,isocnc::api=debug\"; got \"{wanted}\""
        )
    })
}

/// Whether an output leads to the journal of systemd, which tells a service what it has been given.
pub fn goes_to_journal(output: &impl AsFd) -> bool {
    let Ok(stream) = std::env::var("JOURNAL_STREAM") else {
        return false;
    };
    // A service may have sent its output elsewhere; the variable stays.
    let file = output.as_fd().try_clone_to_owned().map(std::fs::File::from);
    file.and_then(|file| file.metadata())
        .is_ok_and(|file| stream == format!("{}:{}", file.dev(), file.ino()))
}

/// What a line for the journal of systemd begins with.
pub const fn priority(level: Level) -> &'static str {
    match level {
        Level::ERROR => "<3>",
        Level::WARN => "<4>",
        Level::INFO => "<6>",
        Level::DEBUG | Level::TRACE => "<7>",
    }
}

/// Lines with their priority; the journal has a time of its own.
struct WithPriority;

impl<S, N> FormatEvent<S, N> for WithPriority
where
    S: Subscriber + for<'a> LookupSpan<'a>,
    N: for<'a> FormatFields<'a> + 'static,
{
    fn format_event(&self, context: &FmtContext<'_, S, N>, mut line: Writer<'_>, event: &Event<'_>) -> fmt::Result {
        let meta = event.metadata();
        write!(line, "{}{}: ", priority(*meta.level()), meta.target())?;
        context.format_fields(line.by_ref(), event)?;
        writeln!(line)
    }
}

/// Standard error, as long as somebody takes what is written: a log must not keep a thread waiting that hears of a stop.
struct Heard;

impl Write for Heard {
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        let out = stderr();
        let mut fd = [PollFd::new(out.as_fd(), PollFlags::POLLOUT)];
        match poll(&mut fd, PollTimeout::ZERO) {
            Ok(0) => Ok(line.len()),
            _ => files::printed::stderr().write(line),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_for_all_or_by_module_and_nothing_else_is_one() {
        let api = "isocnc::api::server";
        let warn = targets("warn").unwrap();
        assert!(warn.would_enable(api, &Level::WARN) && !warn.would_enable(api, &Level::INFO));
        let by_module = targets("error,isocnc::api=debug").unwrap();
        assert!(
            by_module.would_enable(api, &Level::DEBUG) && !by_module.would_enable("isocnc::operator", &Level::WARN)
        );
        let carrier = ["zenoh::net::runtime::orchestrator", "zenoh_link_tls::unicast"];
        let usual = targets(USUAL).unwrap();
        assert!(usual.would_enable("cell_link::link", &Level::INFO) && !usual.would_enable(api, &Level::INFO));
        for target in carrier {
            assert!(!usual.would_enable(target, &Level::ERROR) && !by_module.would_enable(target, &Level::ERROR));
            assert!(!targets("trace").unwrap().would_enable(target, &Level::ERROR));
            assert!(targets("warn,zenoh=info").unwrap().would_enable(target, &Level::INFO));
        }
        assert!(
            targets("off,zenoh_link_tls=debug")
                .unwrap()
                .would_enable(carrier[1], &Level::DEBUG)
        );
        for wrong in ["loud", "", "isocnc::api", "isocnc::api=loud", "warn,loud"] {
            let error = targets(wrong).unwrap_err();
            assert!(error.contains(&format!("got \"{wrong}\"")), "{error}");
        }
    }

    #[test]
    fn a_file_is_the_journal_only_where_its_number_says_so() {
        let file = tempfile::tempfile().unwrap();
        assert!(!goes_to_journal(&file));
    }
}
