//! Claiming, linking and values within one process.

use hal_pins::{AnyValue, Attached, Hal, HalError, Kind};
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::PathBuf;

fn place() -> (tempfile::TempDir, Vec<PathBuf>) {
    let dir = tempfile::tempdir().unwrap();
    let dirs = vec![dir.path().to_owned()];
    (dir, dirs)
}

#[test]
fn a_net_carries_the_value_of_its_source_to_all_targets() {
    let (_dir, dirs) = place();
    let mut hal = Hal::create_in(&dirs, "m", 16).unwrap();
    let mut command = hal.output::<f64>("joint.0.motor-pos-cmd").unwrap();
    let first = hal.input("scope.0.in", 7.5).unwrap();
    let second = hal.input("drive.0.target", -1.0).unwrap();
    let apart = hal.input("drive.1.target", 2.0).unwrap();
    assert_eq!((first.get(), second.get(), apart.get()), (7.5, -1.0, 2.0));

    hal.link("x-pos-cmd", "joint.0.motor-pos-cmd", &["scope.0.in", "drive.0.target"])
        .unwrap();
    assert_eq!((first.get(), second.get()), (0.0, 0.0));
    command.set(1.25);
    assert_eq!(
        (first.get(), second.get(), apart.get(), command.get()),
        (1.25, 1.25, 2.0, 1.25)
    );
    assert_eq!(hal.reader::<f64>("x-pos-cmd").unwrap().get(), 1.25);
    assert_eq!(hal.reader::<f64>("joint.0.motor-pos-cmd").unwrap().get(), 1.25);

    drop(hal);
    command.set(3.5);
    assert_eq!(first.get(), 3.5, "handles outlive the owner");
}

#[test]
fn every_type_keeps_its_extremes() {
    let (_dir, dirs) = place();
    let mut hal = Hal::create_in(&dirs, "m", 6).unwrap();
    let mut bit = hal.output::<bool>("t.bit").unwrap();
    let mut s32 = hal.output::<i32>("t.s32").unwrap();
    let mut u32 = hal.output::<u32>("t.u32").unwrap();
    let mut s64 = hal.output::<i64>("t.s64").unwrap();
    let mut u64 = hal.output::<u64>("t.u64").unwrap();
    let mut float = hal.output::<f64>("t.float").unwrap();
    bit.set(true);
    s32.set(i32::MIN);
    u32.set(u32::MAX);
    s64.set(i64::MIN);
    u64.set(u64::MAX);
    float.set(f64::MIN_POSITIVE);
    let far = Attached::attach_in(&dirs, "m").unwrap();
    let values: Vec<AnyValue> = far.list().unwrap().into_iter().map(|pin| pin.value).collect();
    assert_eq!(
        values,
        [
            AnyValue::Bit(true),
            AnyValue::S32(i32::MIN),
            AnyValue::U32(u32::MAX),
            AnyValue::S64(i64::MIN),
            AnyValue::U64(u64::MAX),
            AnyValue::Float(f64::MIN_POSITIVE)
        ]
    );
    let full = hal.output::<bool>("t.more").err().unwrap();
    assert_eq!(full.to_string(), "no room for 't.more': all 6 pins and nets are taken");
}

#[test]
fn what_must_not_be_linked_is_refused_and_changes_nothing() {
    let (_dir, dirs) = place();
    let mut hal = Hal::create_in(&dirs, "m", 16).unwrap();
    let mut a = hal.output::<f64>("a.out").unwrap();
    hal.output::<f64>("b.out").unwrap();
    hal.output::<bool>("flag.out").unwrap();
    let first = hal.input("first.in", 5.0).unwrap();
    hal.input("second.in", 6.0).unwrap();
    hal.input("count.in", 7i32).unwrap();

    let mut refused =
        |net: &str, source: &str, targets: &[&str]| hal.link(net, source, targets).unwrap_err().to_string();
    assert_eq!(
        refused("n", "a.uot", &[]),
        "no pin or net 'a.uot'; did you mean 'a.out'?"
    );
    assert_eq!(
        refused("n", "a.out", &["first.in", "frist.in"]),
        "no pin or net 'frist.in'; did you mean 'first.in'?"
    );
    assert_eq!(
        refused("n", "first.in", &[]),
        "net 'n': source 'first.in' is an input; the source of a net must be an output"
    );
    assert_eq!(
        refused("n", "a.out", &["b.out"]),
        "net 'n': target 'b.out' is an output and has its own writer; targets must be inputs"
    );
    assert_eq!(
        refused("n", "a.out", &["first.in", "count.in"]),
        "'count.in' is of type s32, but float is needed by net 'n' from 'a.out'"
    );
    assert_eq!(
        refused("n", "a.out", &["first.in", "first.in"]),
        "net 'n': 'first.in' is on net 'n' already"
    );
    assert_eq!(
        refused("a.out", "a.out", &["first.in"]),
        "'a.out' exists already, as an output: a pin has one writer and a name is used once"
    );
    assert!(refused("N", "a.out", &[]).starts_with("pin name 'N': must start with"));
    a.set(1.0);
    assert_eq!(first.get(), 5.0);
    assert_eq!(hal.list().len(), 6);

    hal.link("n", "a.out", &["first.in"]).unwrap();
    let mut refused =
        |net: &str, source: &str, targets: &[&str]| hal.link(net, source, targets).unwrap_err().to_string();
    assert_eq!(
        refused("o", "b.out", &["first.in"]),
        "net 'o': 'first.in' is on net 'n' already"
    );
    assert_eq!(
        refused("o", "a.out", &["second.in"]),
        "net 'o': 'a.out' is on net 'n' already"
    );
    assert_eq!(first.get(), 1.0);
}

#[test]
fn a_pin_is_claimed_once() {
    let (_dir, dirs) = place();
    let mut hal = Hal::create_in(&dirs, "m", 4).unwrap();
    hal.output::<f64>("a.out").unwrap();
    for again in [
        hal.output::<f64>("a.out").err(),
        hal.output::<bool>("a.out").err(),
        hal.input("a.out", 0u32).err(),
    ] {
        assert!(matches!(again, Some(HalError::Taken { .. })));
    }
    assert!(matches!(
        hal.reader::<u64>("a.out").err(),
        Some(HalError::TypeMismatch { .. })
    ));
}

#[test]
fn only_an_unlinked_input_can_be_set() {
    let (_dir, dirs) = place();
    let mut hal = Hal::create_in(&dirs, "m", 8).unwrap();
    hal.output::<u32>("a.out").unwrap();
    let free = hal.input("free.in", 1u32).unwrap();
    hal.input("bound.in", 2u32).unwrap();
    hal.link("n", "a.out", &["bound.in"]).unwrap();
    let far = Attached::attach_in(&dirs, "m").unwrap();

    far.set("free.in", AnyValue::U32(9)).unwrap();
    assert_eq!(free.get(), 9);
    hal.set("free.in", 10u32).unwrap();
    assert_eq!(far.get("free.in").unwrap().value, AnyValue::U32(10));

    let refused = |name, value| far.set(name, value).unwrap_err().to_string();
    assert_eq!(
        refused("bound.in", AnyValue::U32(3)),
        "'bound.in' cannot be set: it is on net 'n'"
    );
    assert_eq!(
        refused("a.out", AnyValue::U32(3)),
        "'a.out' cannot be set: it is an output, written by the control"
    );
    assert_eq!(
        refused("n", AnyValue::U32(3)),
        "'n' cannot be set: it is a net, written by its source"
    );
    assert_eq!(
        refused("free.in", AnyValue::S32(3)),
        "'free.in' is of type u32, but s32 is needed by the new value"
    );
    assert_eq!(
        refused("fre.in", AnyValue::U32(3)),
        "no pin or net 'fre.in'; did you mean 'free.in'?"
    );
    assert_eq!(free.get(), 10);
}

#[test]
fn both_sides_list_the_same() {
    let (_dir, dirs) = place();
    let mut hal = Hal::create_in(&dirs, "m", 8).unwrap();
    let mut out = hal.output::<bool>("spindle.0.on").unwrap();
    hal.input("io.10.out-00", false).unwrap();
    hal.link("spindle-run", "spindle.0.on", &["io.10.out-00"]).unwrap();
    out.set(true);
    let list = Attached::attach_in(&dirs, "m").unwrap().list().unwrap();
    assert_eq!(list, hal.list());
    let shown: Vec<_> = list
        .iter()
        .map(|p| (p.name.as_str(), p.kind, p.net.as_deref(), p.source.as_deref()))
        .collect();
    assert_eq!(
        shown,
        [
            ("spindle.0.on", Kind::Output, Some("spindle-run"), None),
            ("io.10.out-00", Kind::Input, Some("spindle-run"), Some("spindle.0.on")),
            ("spindle-run", Kind::Net, None, Some("spindle.0.on")),
        ]
    );
    assert!(list.iter().all(|pin| pin.value == AnyValue::Bit(true)));
}

#[test]
fn the_file_is_private_and_goes_with_its_owner() {
    let (dir, dirs) = place();
    let hal = Hal::create_in(&dirs, "m", 8).unwrap();
    let path = hal.path().to_owned();
    let meta = std::fs::metadata(&path).unwrap();
    assert_eq!(meta.permissions().mode() & 0o777, 0o600);
    assert_eq!(meta.uid(), nix::unistd::geteuid().as_raw());
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1, "no draft is left");

    let again = Hal::create_in(&dirs, "m", 8).err().unwrap();
    assert!(
        matches!(again, HalError::Running { pid, .. } if pid == std::process::id()),
        "{again}"
    );
    let far = Attached::attach_in(&dirs, "m").unwrap();
    assert_eq!((far.is_running(), far.pid()), (true, std::process::id()));
    let near = Attached::attach_in(&dirs, "mm").err().unwrap();
    assert_eq!(
        near.to_string(),
        "no control for machine 'mm' is running; did you mean 'm'?"
    );

    drop(hal);
    assert!(!path.exists());
    assert!(!far.is_running());
    Hal::create_in(&dirs, "m", 8).unwrap();
}

#[test]
fn without_a_directory_there_is_a_clear_error() {
    let (dir, _) = place();
    assert!(matches!(Hal::create_in(&[], "m", 8), Err(HalError::NoDirectory)));
    let missing = [dir.path().join("missing")];
    assert!(matches!(
        Hal::create_in(&missing, "m", 8),
        Err(HalError::System { doing: "create", .. })
    ));
    let both = [missing[0].clone(), dir.path().to_owned()];
    assert!(Hal::create_in(&both, "m", 8).unwrap().path().starts_with(dir.path()));
    for capacity in [0, hal_pins::CAPACITY_MAX + 1] {
        assert!(matches!(
            Hal::create_in(&both, "m", capacity),
            Err(HalError::Capacity { .. })
        ));
    }
}

#[test]
fn an_alias_is_the_pin_itself_under_another_name() {
    let (_dir, dirs) = place();
    let mut hal = Hal::create_in(&dirs, "m", 8).unwrap();
    let pump = hal.input("io.10.out-03", false).unwrap();
    let mut level = hal.output::<f64>("io.10.object-6401-01").unwrap();
    hal.output::<bool>("spindle.0.on").unwrap().set(true);
    hal.alias("io.10.coolant-pump", "io.10.out-03").unwrap();
    // One name more of a name means the pin, too.
    hal.alias("io.10.pump", "io.10.coolant-pump").unwrap();
    hal.alias("io.10.level", "io.10.object-6401-01").unwrap();
    hal.set_unit("io.10.level", "l/min, at most").unwrap();
    level.set(2.5);

    let far = Attached::attach_in(&dirs, "m").unwrap();
    far.set("io.10.coolant-pump", AnyValue::Bit(true)).unwrap();
    assert!(pump.get() && hal.reader::<bool>("io.10.pump").unwrap().get());
    let seen = far.get("io.10.level").unwrap();
    assert_eq!((seen.value, seen.kind), (AnyValue::Float(2.5), Kind::Output));
    assert_eq!(
        (seen.unit.as_str(), seen.alias_of.as_deref()),
        ("l/min, a", Some("io.10.object-6401-01"))
    );
    assert_eq!(far.get("io.10.object-6401-01").unwrap().unit, "l/min, a");
    assert_eq!(hal.list(), far.list().unwrap());
    assert_eq!(hal.view().value("io.10.level"), Some(AnyValue::Float(2.5)));

    hal.set("io.10.out-03", false).unwrap();
    hal.link("run", "spindle.0.on", &["io.10.pump"]).unwrap();
    assert!(pump.get());
    assert_eq!(far.get("io.10.coolant-pump").unwrap().net.as_deref(), Some("run"));
    // The pin has its writer, by whichever name.
    let refused = far.set("io.10.coolant-pump", AnyValue::Bit(false)).unwrap_err();
    assert_eq!(refused.to_string(), "'io.10.out-03' cannot be set: it is on net 'run'");
    assert!(matches!(
        hal.alias("io.10.pump", "spindle.0.on"),
        Err(HalError::Taken { .. })
    ));
    assert!(matches!(hal.alias("x", "io.10.no-pin"), Err(HalError::Unknown { .. })));
}
