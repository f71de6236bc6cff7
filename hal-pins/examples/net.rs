//! A net carries a value from its source to its target, and another reader sees both: `cargo run -p isocnc-hal-pins
//! --example net`.

use hal_pins::{Attached, Hal, HalError};

fn main() -> Result<(), HalError> {
    let machine = format!("example-{}", std::process::id());
    let mut hal = Hal::create(&machine, 8)?;
    let mut command = hal.output::<f64>("joint.0.motor-pos-cmd")?;
    let target = hal.input("drive.0.target", 0.0)?;
    hal.link("x-pos-cmd", "joint.0.motor-pos-cmd", &["drive.0.target"])?;
    command.set(12.5);
    println!("the drive reads {}", target.get());
    // As another process does it.
    for pin in Attached::attach(&machine)?.list()? {
        println!("{} = {}", pin.name, pin.value);
    }
    assert_eq!(target.get(), 12.5);
    Ok(())
}
