//! No component asks anything of the allocator once it is made, and neither does an instance with its pins.

use components::{CATALOGUE, Instance};
use hal_pins::Hal;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    static COUNTING: Cell<bool> = const { Cell::new(false) };
    static CALLS: Cell<u64> = const { Cell::new(0) };
}

/// Counts what asks the system's allocator for something or gives it back.
struct Counting;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn count() {
    if COUNTING.get() {
        CALLS.set(CALLS.get() + 1);
    }
}

// SAFETY: every call goes to the system's allocator as it came; counting touches two cells that need no allocation. What is not
// here goes through these two.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller keeps the contract of this very method.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count();
        // SAFETY: the caller keeps the contract of this very method.
        unsafe { System.dealloc(pointer, layout) }
    }
}

/// Calls of the allocator, frees included, while `work` runs.
fn calls(work: impl FnOnce()) -> u64 {
    CALLS.set(0);
    COUNTING.set(true);
    work();
    COUNTING.set(false);
    CALLS.get()
}

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
