//! What all of it comes to: two short measurements on the core of the real-time threads.
//!
//! A few seconds show what is wrong, not that all is right: for a maximum take hours, with load on the other cores.

use super::{Look, Pc};
use crate::doctor::experiments::Latency;

/// What a greatest value is worth, us, as LinuxCNC's page on latency has it: up to 20 is very good, up to 50 usable, above
/// 100 not for pulses made by software, above 1000 of no use.
const WORTH: [(f64, &str); 3] = [(20.0, "very good"), (MAX_US, "usable"), (1000.0, "poor")];
const MAX_US: f64 = 50.0;

/// How late a thread wakes up.
pub(super) fn wake_up(pc: &Pc<'_>) -> Option<Look> {
    const WHEN: &str = "(when nothing above is missing: for hours, with load on the other cores)";
    let time = pc.target.test_time?;
    let fix = format!("sudo cyclictest -q -m -p90 -i1000 -a{} -t1 -D 1h {WHEN}", pc.cpu());
    Some(judge(pc.tries.wake_up(pc.cpu(), pc.target.priority, time), fix))
}

/// What takes the core from a thread that runs.
pub(super) fn gaps(pc: &Pc<'_>) -> Option<Look> {
    const FIX: &str = "sudo hwlatdetect --duration=600 --threshold=5 (what stays when nothing above is missing is the \
                       firmware, or the host of a virtual machine)";
    let time = pc.target.test_time?;
    Some(judge(pc.tries.gaps(pc.cpu(), pc.target.priority, time), FIX.to_owned()))
}

fn judge(measured: Result<Latency, String>, fix: String) -> Look {
    let look = match &measured {
        Ok(latency) if latency.n == 0 => Look::ok("nothing"),
        Ok(latency) => {
            let worth = WORTH.iter().find(|(max_us, _)| latency.max_us <= *max_us);
            let worth = worth.map_or("of no use", |(_, worth)| worth);
            Look::judge(latency.max_us <= MAX_US, format!("{worth}: {latency}"), fix)
        }
        Err(why) => Look::unknown(why),
    };
    Look {
        latency: measured.ok(),
        ..look
    }
}
