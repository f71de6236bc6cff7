//! What makes interfaces of its own, or needs other rights than a test: each subject in a process of its own, which enters a network
//! namespace and may have one thread only.
//!
//! Arguments: names of subjects, or parts of them; none: all.

mod analyser_listens;
mod bus_on_the_wire;
mod ip_over_the_bus;
mod private_wire;
mod rights;
mod system_calls;

/// Names the subject in the process that looks at it, and in those that it starts.
const SUBJECT: &str = "ISOCNC_TEST_SUBJECT";
const SUBJECTS: &[(&str, fn())] = &[
    ("analyser_listens", analyser_listens::main),
    ("bus_on_the_wire", bus_on_the_wire::main),
    ("ip_over_the_bus", ip_over_the_bus::main),
    ("private_wire", private_wire::main),
    ("rights", rights::main),
    ("system_calls", system_calls::main),
];

fn main() {
    if let Ok(subject) = std::env::var(SUBJECT) {
        let (_, main) = SUBJECTS.iter().find(|(name, _)| *name == subject).expect("a subject");
        return main();
    }
    let wanted: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with('-')).collect();
    let is_wanted = |name: &str| wanted.is_empty() || wanted.iter().any(|word| name.contains(word.as_str()));
    let failed: Vec<&str> = (SUBJECTS.iter().map(|(name, _)| *name))
        .filter(|name| is_wanted(name))
        .filter(|name| {
            let mut command = testing::command(std::env::current_exe().expect("this program"));
            !command.env(SUBJECT, name).status().is_ok_and(|status| status.success())
        })
        .collect();
    assert!(failed.is_empty(), "failed: {}", failed.join(", "));
}
