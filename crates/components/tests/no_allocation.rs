//! No component asks anything of the allocator once it is made, and neither does an instance with its pins.

use crate::counting;

use components::{CATALOGUE, Instance};
use counting::calls;
use hal_pins::Hal;

#[test]
fn the_counter_counts() {
    assert_eq!(calls(|| drop(std::hint::black_box(Box::new(1)))), 2);
}

#[test]
fn an_update_of_any_component_allocates_nothing() {
    let name = format!("components-{}", std::process::id());
    let mut hal = Hal::create_in(&[std::env::temp_dir()], &name, 4096).unwrap();
    for kind in &CATALOGUE {
        let name = format!("{}.0", kind.name.replace('_', "-"));
        let mut instance = Instance::claim(&mut hal, &name, kind.make(&[]).unwrap()).unwrap();
        let bits: Vec<String> = hal
            .list()
            .into_iter()
            .filter(|pin| pin.name.starts_with(&name) && pin.kind == hal_pins::Kind::Input)
            .filter(|pin| pin.value_type() == hal_pins::Type::Bit)
            .map(|pin| pin.name)
            .collect();
        for call in 0..8 {
            for (at, pin) in bits.iter().enumerate() {
                hal.set(pin, call >> (at % 3) & 1 != 0).unwrap();
            }
            let used = calls(|| instance.update(0.001));
            assert_eq!(used, 0, "{}, call {call}", kind.name);
        }
    }
}
