//! The example of a control with a component of its own.

use std::path::Path;
use std::process::Command;

#[test]
fn a_control_with_a_component_of_its_own_knows_it_in_machine_files() {
    let program = Path::new(env!("CARGO_BIN_EXE_isocnc"))
        .with_file_name("examples")
        .join("own-component");
    let machine = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/own-component/machine.toml");
    let said = |program: &Path| {
        let output = Command::new(program).args(["check", machine]).output();
        // One program of tests alone is built without examples.
        let output = output
            .unwrap_or_else(|cause| panic!("{}: {cause}: cargo build --example own-component", program.display()));
        let said = [output.stdout, output.stderr].concat();
        (output.status.success(), String::from_utf8(said).unwrap())
    };
    let (good, text) = said(&program);
    assert!(good && text.contains("coolant-tank: tank, before motion"), "{text}");
    // The control that ships has no such component.
    let (good, text) = said(Path::new(env!("CARGO_BIN_EXE_isocnc")));
    assert!(!good && text.contains("tank"), "{text}");
}
