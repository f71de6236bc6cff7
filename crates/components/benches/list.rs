//! What a list of components takes a cycle: 500 of them with 2000 pins, in chains of nets, as one list.
//!
//! Prints mean, 99.9 % and greatest time of a run through the list, in us. Budget: 60 us on average.

use components::{CATALOGUE, Instance};
use hal_pins::Hal;
use std::time::Instant;

const RUNS: usize = 20_000;

fn main() {
    let name = format!("components-bench-{}", std::process::id());
    let mut hal = Hal::create_in(&[std::env::temp_dir()], &name, 8192).expect("pins");
    // What a machine has most of, four pins each on average; and a few of everything.
    let often = [
        "and2",
        "or2",
        "timedelay",
        "mux2",
        "sum2",
        "comp",
        "not",
        "limit1",
        "near",
        "edge",
    ];
    let mut instances = Vec::new();
    let mut pins = 0;
    let mut outputs: Vec<String> = Vec::new();
    let kinds = CATALOGUE
        .iter()
        .map(|kind| kind.name)
        .chain(often.iter().copied().cycle());
    for (number, kind) in kinds.enumerate() {
        if instances.len() == 500 {
            break;
        }
        let kind = components::find(kind).expect("a kind");
        let mut component = kind.make(&[]).expect("no options");
        let own = component.pins();
        // Room for the rest of the 500 with their four pins each.
        if number < CATALOGUE.len() && own.len() > 8 {
            continue;
        }
        pins += own.len();
        let name = format!("{}.{number}", kind.name.replace('_', "-"));
        instances.push(Instance::claim(&mut hal, &name, component).expect("pins"));
        // A chain: the first bit that it reads is the last one that was written.
        let bit = |pin: &&components::PinSpec| pin.default.kind() == hal_pins::Type::Bit;
        let input = own
            .iter()
            .filter(bit)
            .find(|pin| pin.direction == components::Direction::In);
        if let (Some(source), Some(input)) = (outputs.pop(), input) {
            let target = format!("{name}.{}", input.name);
            hal.link(&format!("n-{number}"), &source, &[target]).expect("a net");
        }
        let output = own
            .iter()
            .filter(bit)
            .find(|pin| pin.direction == components::Direction::Out);
        outputs.extend(output.map(|pin| format!("{name}.{}", pin.name)));
    }
    let mut times_us: Vec<f64> = (0..RUNS)
        .map(|_| {
            let start = Instant::now();
            for instance in &mut instances {
                instance.update(0.001);
            }
            start.elapsed().as_secs_f64() * 1e6
        })
        .collect();
    times_us.sort_by(f64::total_cmp);
    println!(
        "{} components, {pins} pins: mean {:.1} us, 99.9 % {:.1} us, greatest {:.1} us",
        instances.len(),
        times_us.iter().sum::<f64>() / RUNS as f64,
        times_us[RUNS * 999 / 1000],
        times_us[RUNS - 1],
    );
}
