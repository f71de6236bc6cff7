//! The control that this crate builds knows its component.

use std::process::{Command, Output};

fn check(component: &str) -> Output {
    let folder = std::env::temp_dir().join(format!("own-component-{}-{}", std::process::id(), component.len()));
    std::fs::create_dir_all(&folder).unwrap();
    let machine = folder.join("machine.toml");
    let text = include_str!("../../../configs/io-only.toml");
    std::fs::write(&machine, format!("{text}\n[[hal.component]]\nname = \"coolant-tank\"\n{component}\n")).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_own-component")).arg("check").arg(&machine).output().unwrap();
    std::fs::remove_dir_all(folder).unwrap();
    output
}

#[test]
fn a_machine_file_may_ask_for_it() {
    let good = check("type = \"tank\"\nset = { low = 15.0 }");
    let said = String::from_utf8_lossy(&good.stdout).into_owned();
    assert!(good.status.success(), "{}", String::from_utf8_lossy(&good.stderr));
    assert!(said.contains("coolant-tank: tank, before motion"), "{said}");
    for (wrong, expected) in [
        ("type = \"tnak\"", "did you mean \"tank\"?"),
        ("type = \"tank\"\nset = { lwo = 15.0 }", "did you mean \"low\"?"),
    ] {
        let refused = check(wrong);
        let said = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert!(!refused.status.success() && said.contains(expected), "{said}");
    }
}
