//! `cyclictest` of the rt-tests, run on the same core in the same round: the yardstick that everybody knows.
//!
//! In:  a core, a period, a duration; what `cyclictest` prints.
//! Out: [`Cyclictest`]: its latency as a distribution, or why there is none.

use super::distribution::Distribution;
use super::report::Cyclictest;
use host::histogram::{Bucket, Summary};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use std::io::{self, Read};
use std::ops::ControlFlow;
use std::process::{Command, Stdio};
use std::thread::JoinHandle;
use std::time::Duration;

/// Bins of 1 µs: 50 ms. What is beyond is known by number and greatest value.
const BINS: u32 = 50_000;
/// Pause between two looks whether it has ended.
const LOOK: Duration = Duration::from_millis(20);

/// Why there is no figure.
#[derive(Debug, thiserror::Error)]
pub enum CyclictestError {
    /// It is not there.
    #[error("cyclictest is not installed; it comes with the package rt-tests")]
    NotInstalled,
    /// It does not start.
    #[error("cyclictest: {0}")]
    System(#[from] io::Error),
    /// It ended with an error.
    #[error("cyclictest failed: {said}")]
    Failed {
        /// What it said last.
        said: String,
    },
    /// What it printed is not what is expected.
    #[error("cyclictest printed '{line}' where {expected} was expected")]
    Output {
        line: String,
        /// What should stand there.
        expected: &'static str,
    },
}

/// Runs `cyclictest` on a core for whole seconds, or until `look`, called every few milliseconds, wants it to end.
///
/// # Errors
/// It is not installed, may not run with SCHED_FIFO, or prints something unknown.
pub fn run(
    core: usize,
    cycle_us: u32,
    seconds: u64,
    look: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<Cyclictest, CyclictestError> {
    let arguments = format!("-q -m -t1 -p90 -i{cycle_us} -a{core} -D{seconds}s -h{BINS}");
    let mut child = command()
        .args(arguments.split(' '))
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(not_installed)?;
    // Read by threads: it may print more than a pipe holds.
    let said = read_all(child.stdout.take());
    let complaint = read_all(child.stderr.take());
    let status = loop {
        if let Some(status) = child.try_wait()? {
            break status;
        }
        if look().is_break() {
            // It prints what it has got until then. Should it have ended in this moment, that is as well.
            let _ = kill(Pid::from_raw(child.id() as i32), Signal::SIGTERM);
            break child.wait()?;
        }
        std::thread::sleep(LOOK);
    };
    let text = |reader: JoinHandle<String>| reader.join().unwrap_or_default();
    let (said, complaint) = (text(said), text(complaint));
    if !status.success() {
        let said = complaint
            .lines()
            .chain(said.lines())
            .find(|line| !line.starts_with('#'));
        return Err(CyclictestError::Failed {
            said: said.unwrap_or("it says nothing").to_owned(),
        });
    }
    let (latency, overflows) = parse(&said)?;
    Ok(Cyclictest {
        version: version()?,
        command: format!("cyclictest {arguments}"),
        latency,
        overflows,
    })
}

fn read_all(pipe: Option<impl Read + Send + 'static>) -> JoinHandle<String> {
    std::thread::spawn(move || {
        let mut octets = Vec::new();
        if let Some(mut pipe) = pipe {
            // What came before a broken pipe is what there is.
            let _ = pipe.read_to_end(&mut octets);
        }
        String::from_utf8_lossy(&octets).into_owned()
    })
}

fn command() -> Command {
    let mut command = Command::new("cyclictest");
    command.stdin(Stdio::null());
    command
}

fn not_installed(cause: io::Error) -> CyclictestError {
    match cause.kind() {
        io::ErrorKind::NotFound => CyclictestError::NotInstalled,
        _ => CyclictestError::System(cause),
    }
}

/// `cyclictest` tells its version at the head of its help only.
fn version() -> Result<String, CyclictestError> {
    let help = command().arg("--help").output().map_err(not_installed)?;
    let (said, complaint) = (
        String::from_utf8_lossy(&help.stdout),
        String::from_utf8_lossy(&help.stderr),
    );
    Ok(version_in(&said)
        .or_else(|| version_in(&complaint))
        .unwrap_or("unknown")
        .to_owned())
}

fn version_in(help: &str) -> Option<&str> {
    help.lines()
        .find_map(|line| line.strip_prefix("cyclictest V "))
        .map(str::trim)
}

/// Reads the histogram that `cyclictest -q -h` prints; also gives the number of values beyond it.
///
/// # Errors
/// The first line that is not as expected; no values.
pub fn parse(printed: &str) -> Result<(Distribution, u64), CyclictestError> {
    let mut bins: Vec<(u32, u64)> = Vec::new();
    let (mut max_us, mut overflows) = (None, 0);
    for line in printed.lines().map(str::trim) {
        let wrong = |expected| CyclictestError::Output {
            line: line.chars().take(80).collect(),
            expected,
        };
        let number = |text: &str| text.trim().parse::<u64>().map_err(|_| wrong("a number"));
        if let Some(text) = line.strip_prefix("# Max Latencies:") {
            max_us = Some(number(text)?);
        } else if let Some(text) = line.strip_prefix("# Histogram Overflows:") {
            overflows = number(text)?;
        } else if let Some((bin, count)) = line.split_once(|c: char| c.is_ascii_whitespace())
            && bin.bytes().all(|octet| octet.is_ascii_digit())
        {
            let bin = bin.parse().map_err(|_| wrong("a bin of the histogram"))?;
            if bins.last().is_some_and(|(last, _)| *last >= bin) {
                return Err(wrong("a greater bin"));
            }
            bins.push((bin, number(count)?));
        } else if !(line.is_empty() || line.starts_with('#') || line.starts_with("Thread")) {
            return Err(wrong("a line of its histogram"));
        }
    }
    bins.retain(|(_, count)| *count > 0);
    let last_us = bins.last().map_or(0, |(bin, _)| u64::from(*bin));
    if overflows > 0 {
        // Where the values beyond lie is not told, but for the greatest: all of them count as that.
        let beyond_us = max_us.unwrap_or(0).max(last_us + 1);
        let beyond_us = u32::try_from(beyond_us).unwrap_or(u32::MAX);
        bins.push((beyond_us, overflows));
    }
    if bins.is_empty() {
        return Err(CyclictestError::Output {
            line: printed.lines().last().unwrap_or("nothing").chars().take(80).collect(),
            expected: "at least one value",
        });
    }
    Ok((latency(&bins), overflows))
}

/// Figures of bins that are not empty, in order. A value counts as the whole µs below it, as `cyclictest` itself has it.
fn latency(bins: &[(u32, u64)]) -> Distribution {
    let n = bins.iter().fold(0, |n: u64, (_, count)| n.saturating_add(*count));
    let mean = |of: &dyn Fn(f64) -> f64| {
        let sum: f64 = bins.iter().map(|(us, count)| of(f64::from(*us)) * *count as f64).sum();
        sum / n as f64
    };
    let mean_us = mean(&|us| us);
    let std_us = mean(&|us| (us - mean_us).powi(2)).sqrt();
    let end_us = |bin: Option<&(u32, u64)>| bin.map_or(0.0, |(us, _)| f64::from(*us));
    let (min_us, max_us) = (end_us(bins.first()), end_us(bins.last()));
    let mut latency = Distribution {
        nominal_ns: 0,
        figures: Summary {
            n,
            mean_us,
            std_us,
            min_us,
            max_us,
            range_us: max_us - min_us,
            ..Summary::default()
        },
        histogram: bins
            .iter()
            .map(|(us, count)| Bucket {
                from_ns: i64::from(*us) * 1000,
                to_ns: i64::from(*us) * 1000,
                count: *count,
            })
            .collect(),
    };
    latency.read_quantiles();
    latency
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// As version 2.40 prints it, shortened.
    const PRINTED: &str = "\
# /dev/cpu_dma_latency set to 0us
# Histogram
000000 000000
000001 000004
000002 000003
000003 000000
000004 000002
# Total: 000000009
# Min Latencies: 00001
# Avg Latencies: 00002
# Max Latencies: 00004
# Histogram Overflows: 00000
# Histogram Overflow at cycle number:
# Thread 0:
";

    #[test]
    fn a_histogram_by_hand() {
        let (latency, overflows) = parse(PRINTED).unwrap();
        let figures = latency.figures;
        assert_eq!((figures.n, figures.min_us, figures.max_us, overflows), (9, 1.0, 4.0, 0));
        assert_eq!((figures.p50_us, figures.p90_us, figures.p99_us), (2.0, 4.0, 4.0));
        // (4 * 1 + 3 * 2 + 2 * 4) / 9 = 2; (4 * 1 + 3 * 0 + 2 * 4) / 9 = 4/3
        assert_eq!(figures.mean_us, 2.0);
        assert!((figures.std_us - (4.0_f64 / 3.0).sqrt()).abs() < 1e-12);
        let bins: Vec<_> = latency
            .histogram
            .iter()
            .map(|bucket| (bucket.from_ns, bucket.count))
            .collect();
        assert_eq!(bins, [(1000, 4), (2000, 3), (4000, 2)]);
    }

    #[test]
    fn values_beyond_the_histogram_count_as_the_greatest() {
        let printed = PRINTED
            .replace("Max Latencies: 00004", "Max Latencies: 06088")
            .replace("Overflows: 00000", "Overflows: 00003")
            .replace("# Thread 0:", "# Thread 0: 00000 00002 00005 # 00001 others");
        let (latency, overflows) = parse(&printed).unwrap();
        assert_eq!((latency.figures.n, latency.figures.max_us, overflows), (12, 6088.0, 3));
        assert_eq!((latency.figures.p50_us, latency.figures.p90_us), (2.0, 6088.0));
    }

    #[test]
    fn what_is_not_a_histogram_is_refused_with_its_line() {
        let refused = |printed: &str| parse(printed).unwrap_err().to_string();
        assert_eq!(
            refused("# Histogram\n000001 many\n"),
            "cyclictest printed '000001 many' where a number was expected"
        );
        assert_eq!(
            refused("000002 1\n000001 1\n"),
            "cyclictest printed '000001 1' where a greater bin was expected"
        );
        assert!(refused("ERROR: no root\n").contains("'ERROR: no root'"));
        assert!(refused("").contains("at least one value"));
        assert!(refused("# Total: 000000000\n").contains("at least one value"));
        assert!(refused("99999999999 1\n").contains("a bin of the histogram"));
    }

    #[test]
    fn the_version_stands_at_the_head_of_the_help() {
        assert_eq!(version_in("cyclictest V 2.40\nUsage:\n"), Some("2.40"));
        assert_eq!(version_in("Usage:\n"), None);
    }

    proptest! {
        #[test]
        fn garbage_is_refused_or_counted_and_never_panics(
            lines in prop::collection::vec("[#0-9 a-zA-Z:]{0,30}|[0-9]{6} [0-9]{1,25}|# Max Latencies: [0-9]{1,25}", 0..20),
        ) {
            if let Ok((latency, _)) = parse(&lines.join("\n")) {
                prop_assert!(latency.figures.n > 0);
                prop_assert!(latency.figures.min_us <= latency.figures.p50_us && latency.figures.p50_us <= latency.figures.max_us);
            }
        }
    }
}
