//! How long a request over the control socket takes: alone, and while ten subscribers are told of changes 20 times a second.
//!
//! A control in memory runs as a process of its own; both cases take turns, so that whatever else this PC does is in both. Printed
//! are quantiles of single requests, how many notifications came, what the service cost, what a cycle took and the load.

use hdrhistogram::Histogram;
use isocnc::api::client::{self, Client};
use serde_json::{Value, json};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

const SUBSCRIBERS: usize = 10;
const ROUNDS: usize = 10;
const REQUESTS: usize = 200;
const MACHINE: &str = include_str!("../configs/mill3-demo.toml");

struct Killed(Child);

impl Drop for Killed {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Requests of `method`, one every few milliseconds, as a screen asks; answers of orders that are refused count as well.
fn ask(client: &mut Client, method: &str, times_us: &mut Histogram<u64>) {
    for _ in 0..REQUESTS {
        let begin = Instant::now();
        let _ = client.call(method, json!({}));
        times_us.saturating_record(begin.elapsed().as_micros() as u64);
        std::thread::sleep(Duration::from_millis(3));
    }
}

/// Figures of the cycle over the last second, ns.
const CYCLE: [&str; 4] = [
    "rt.compute-mean-ns",
    "rt.compute-p99-ns",
    "rt.exchange-p99-ns",
    "rt.period-std-ns",
];

fn pin(machine: &str, name: &str) -> f64 {
    let output = Command::new(env!("CARGO_BIN_EXE_isocnc"))
        .args(["hal", "get", name, "--json", "--machine", machine])
        .output()
        .expect("the binary runs");
    let pin: Value = serde_json::from_slice(&output.stdout).expect("a pin");
    pin["value"].as_f64().expect("a number")
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Processor time of the service thread of a control, ticks of 10 ms.
fn service_ticks(process: u32) -> u64 {
    let tasks = std::fs::read_dir(format!("/proc/{process}/task")).expect("threads");
    let stats = tasks
        .flatten()
        .filter_map(|task| std::fs::read_to_string(task.path().join("stat")).ok());
    let mut ticks = 0;
    for stat in stats.filter(|stat| stat.contains("(service)")) {
        let (_, fields) = stat.rsplit_once(") ").expect("a state");
        let fields = fields.split(' ').skip(11).take(2);
        ticks += fields.map(|field| field.parse::<u64>().expect("ticks")).sum::<u64>();
    }
    ticks
}

fn main() {
    let folder = tempfile::tempdir().expect("a folder");
    let machine = format!("bench-socket-{}", std::process::id());
    let text = MACHINE
        .replace("\"mill3-demo\"", &format!("\"{machine}\""))
        .replace("\nlock_memory = true", "\noverruns_stop = 0\nlock_memory = true")
        .replace("pres_lost_max = 20", "pres_lost_max = 1000")
        .replacen("kind = \"powerlink\"", "kind = \"memory\"", 1);
    let file = folder.path().join("machine.toml");
    std::fs::write(&file, text).expect("a machine file");
    let control = Command::new(env!("CARGO_BIN_EXE_isocnc"))
        .arg("run")
        .arg(&file)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    let control = Killed(control.expect("a control"));
    let mut client = loop {
        match client::connect(Some(&machine)) {
            Ok(client) => break client,
            Err(_) => std::thread::sleep(Duration::from_millis(50)),
        }
    };
    let ready = |status: &Value| status["power"] == "off";
    while !ready(&client.call("status", json!({})).expect("a status")) {
        std::thread::sleep(Duration::from_millis(50));
    }
    // Positions change all the time.
    let part = "G21 G90 G94 G54\no1 repeat [2000]\nG1 X50 Y20 F3000\nX5 Y5\no1 endrepeat\nM2\n";
    client
        .call("program.run", json!({ "name": "part", "text": part }))
        .expect("a program");
    while client.call("status", json!({})).expect("a status")["state"] != "running" {
        std::thread::sleep(Duration::from_millis(50));
    }
    let histogram = || Histogram::<u64>::new_with_bounds(1, 10_000_000, 3).expect("bounds");
    let mut times_us = [[histogram(), histogram()], [histogram(), histogram()]];
    let told = AtomicU64::new(0);
    let (mut skipped, mut cpu_ticks) = ([0.0; 2], [0; 2]);
    let mut cycle = CYCLE.map(|_| [Vec::new(), Vec::new()]);
    for round in 0..2 * ROUNDS {
        let subscribed = round % 2;
        let stop = AtomicBool::new(false);
        let before = client.call("status", json!({})).expect("a status");
        let cpu_before = service_ticks(control.0.id());
        std::thread::scope(|scope| {
            for _ in 0..subscribed * SUBSCRIBERS {
                let mut subscriber = client::connect(Some(&machine)).expect("a connection");
                subscriber.call("subscribe", json!({})).expect("a subscription");
                let (stop, told) = (&stop, &told);
                scope.spawn(move || {
                    while !stop.load(Ordering::Relaxed) && subscriber.notification().is_ok() {
                        told.fetch_add(1, Ordering::Relaxed);
                    }
                });
            }
            for (method, times_us) in ["status", "resume"].into_iter().zip(&mut times_us[subscribed]) {
                ask(&mut client, method, times_us);
            }
            for (name, values) in CYCLE.into_iter().zip(&mut cycle) {
                values[subscribed].push(pin(&machine, name));
            }
            stop.store(true, Ordering::Relaxed);
        });
        cpu_ticks[subscribed] += service_ticks(control.0.id()) - cpu_before;
        let after = client.call("status", json!({})).expect("a status");
        skipped[subscribed] +=
            after["cycles_skipped"].as_f64().unwrap_or(0.0) - before["cycles_skipped"].as_f64().unwrap_or(0.0);
    }
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    println!("load {}", load.trim_end());
    println!("notifications {}", told.load(Ordering::Relaxed));
    println!("cycles left out: alone {}, with subscribers {}", skipped[0], skipped[1]);
    println!(
        "processor time of the service thread: alone {} ms, with subscribers {} ms",
        10 * cpu_ticks[0],
        10 * cpu_ticks[1]
    );
    for (name, values) in CYCLE.into_iter().zip(&mut cycle) {
        let [alone, with] = values.each_mut().map(|values| median(values));
        println!(
            "{name:>18}: alone {alone:.0}, with subscribers {with:.0}, ratio {:.3}",
            with / alone
        );
    }
    for (who, times_us) in ["alone", "10 subscribers"].into_iter().zip(&times_us) {
        for (method, times_us) in ["status", "an order"].into_iter().zip(times_us) {
            println!(
                "{who:>15}, {method:>8}: p50 {:.2} ms, p99 {:.2} ms, most {:.2} ms",
                times_us.value_at_quantile(0.5) as f64 * 1e-3,
                times_us.value_at_quantile(0.99) as f64 * 1e-3,
                times_us.max() as f64 * 1e-3,
            );
        }
    }
    drop(control);
}
