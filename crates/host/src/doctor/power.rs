//! How fast the core runs, and how fast it wakes up.

use super::{Look, Pc};
use crate::doctor::fixes;

/// A state that takes longer to leave is a deep one, us.
const LATENCY_US_MAX: i64 = 2;

/// What sets the clock frequency.
pub(super) fn governor(pc: &Pc<'_>) -> Option<Look> {
    let folder = format!("/sys/devices/system/cpu/cpu{}/cpufreq", pc.cpu());
    if !pc.exists(&folder) {
        return Some(Look::ok("no frequency to set (fixed, or the host's)"));
    }
    let file = |name: &str| format!("{folder}/{name}");
    let governor = match pc.word(&file("scaling_governor")) {
        Ok(governor) => governor,
        Err(why) => return Some(Look::unknown(why.to_string())),
    };
    let fixed = match (
        pc.number(&file("scaling_min_freq")),
        pc.number(&file("scaling_max_freq")),
    ) {
        (Ok(lowest), Ok(highest)) if lowest == highest => Some(highest / 1000),
        _ => None,
    };
    Some(match fixed {
        Some(mhz) => Look::ok(format!("{governor}, fixed at {mhz} MHz")),
        None => Look::judge(governor == "performance", governor.clone(), fixes::apply(pc)),
    })
}

/// Whether the core sleeps so deeply that waking takes time, or the control can forbid it.
pub(super) fn idle_states(pc: &Pc<'_>) -> Option<Look> {
    let driver = pc
        .text("/sys/devices/system/cpu/cpuidle/current_driver")
        .unwrap_or_default();
    if matches!(driver.as_str(), "" | "none") {
        return Some(Look::ok("no idle driver: none deeper than HLT"));
    }
    if pc.boot_value("idle").ok().flatten().as_deref() == Some("poll") {
        return Some(Look::ok("idle=poll: never sleeps"));
    }
    let limit = format!("/sys/devices/system/cpu/cpu{}/power/pm_qos_resume_latency_us", pc.cpu());
    // "n/a": no latency at all is tolerated; 0 would be no restriction.
    if pc.text(&limit).as_deref() == Ok("n/a") {
        return Some(Look::ok("forbidden for this core"));
    }
    let folder = format!("/sys/devices/system/cpu/cpu{}/cpuidle", pc.cpu());
    let states = match pc.names(&folder) {
        Ok(names) => names,
        Err(why) => return Some(Look::unknown(why.to_string())),
    };
    let deepest = states
        .iter()
        .filter(|state| pc.number(&format!("{folder}/{state}/disable")).unwrap_or(0) == 0)
        .filter_map(|state| Some((pc.number(&format!("{folder}/{state}/latency")).ok()?, state)))
        .filter(|(latency_us, _)| *latency_us > LATENCY_US_MAX)
        .max();
    let Some((latency_us, state)) = deepest else {
        return Some(Look::ok(format!("none above {LATENCY_US_MAX} us ({driver})")));
    };
    let name = pc.text(&format!("{folder}/{state}/name")).unwrap_or_default();
    Some(match pc.tries.dma_latency() {
        Ok(()) => Look::ok(format!("{name} {latency_us} us; the control can forbid it")),
        Err(why) => {
            let found = format!("{name} {latency_us} us; /dev/cpu_dma_latency: {why}");
            Look::missing(found, format!("{} --no-deep-idle", fixes::apply(pc)))
        }
    })
}
