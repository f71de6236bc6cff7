//! `apply --interface`: the fieldbus interface, its interrupts, queues and what ethtool sets.

use super::pc::Pc;
use std::fs;
use std::os::unix::fs::symlink;

/// What the fake ethtool shows at first, by its option for reading.
const COALESCE: &str = "Coalesce parameters for enp2s0:
Adaptive RX: on  TX: n/a
rx-usecs: 3
rx-frames: n/a
tx-usecs: 0
rx-usecs-irq: 5
";
const FEATURES: &str = "Features for enp2s0:
rx-checksumming: on
tcp-segmentation-offload: on
\ttx-tcp-segmentation: on
\ttx-tcp-ecn-segmentation: off [fixed]
\ttx-tcp6-segmentation: off
generic-segmentation-offload: on
generic-receive-offload: on
large-receive-offload: off [fixed]
rx-vlan-offload: on
tx-vlan-offload: on [fixed]
rx-gro-hw: on
";
const PAUSE: &str = "Pause parameters for enp2s0:
Autonegotiate:\ton
RX:\t\ton
TX:\t\toff
";
const EEE: &str = "EEE settings for enp2s0:
\tEEE status: enabled - active
\tTx LPI: disabled
";

/// Shows and changes the files in the folder ethtool; refuses to change rx-usecs as some drivers do.
const ETHTOOL: &str = r#"cd ethtool
case $1 in
-c | -k | -a) cat "./$1" ;;
--show-eee) cat ./eee ;;
-C) case $3 in
    adaptive-rx) sed -i "s/^Adaptive RX: [a-z]*/Adaptive RX: $4/" ./-c ;;
    *) echo "netlink error: Operation not supported" >&2; exit 1 ;;
    esac ;;
-K) case $3 in
    gro) name=generic-receive-offload ;;
    gso) name=generic-segmentation-offload ;;
    rxvlan) name=rx-vlan-offload ;;
    *) name=$3 ;;
    esac
    grep -q "$name: " ./-k && sed -i "s/\($name\): .*/\1: $4/" ./-k ;;
-A) case $3 in autoneg) name=Autonegotiate ;; rx) name=RX ;; tx) name=TX ;; esac
    sed -i "s/^\($name:[[:space:]]*\).*/\1$4/" ./-a ;;
--set-eee) case $4 in on) word="enabled - active" ;; off) word=disabled ;; esac
    sed -i "s/EEE status: .*/EEE status: $word/" ./eee ;;
*) exit 1 ;;
esac"#;

fn pc() -> Pc {
    let pc = Pc::new();
    for number in [30, 31, 32, 33] {
        pc.write(&format!("proc/irq/{number}/smp_affinity_list"), "0-3\n");
    }
    // One vector is known by the device, one by its name; the third is another interface's of a similar name.
    pc.write("sys/class/net/enp2s0/device/msi_irqs/30", "msix\n");
    fs::create_dir_all(pc.path("proc/irq/31/enp2s0-TxRx-0")).unwrap();
    fs::create_dir_all(pc.path("proc/irq/32/enp2s0f1")).unwrap();
    pc.write("sys/class/net/enp2s0/queues/rx-0/rps_cpus", "f\n");
    pc.write("sys/class/net/enp2s0/queues/rx-0/rps_flow_cnt", "4096\n");
    pc.write("sys/class/net/enp2s0/queues/tx-0/xps_cpus", "1\n");
    pc.write("proc/sys/net/ipv6/conf/enp2s0/disable_ipv6", "0\n");
    pc.write("ethtool/-c", COALESCE);
    pc.write("ethtool/-k", FEATURES);
    pc.write("ethtool/-a", PAUSE);
    pc.write("ethtool/eee", EEE);
    pc.tool("ethtool", ETHTOOL);
    pc
}

fn irq(pc: &Pc, number: u32) -> String {
    pc.read(&format!("proc/irq/{number}/smp_affinity_list"))
}

#[test]
fn the_interface_gets_its_interrupts_queues_and_settings_and_gives_them_back() {
    let pc = pc();
    let before = pc.tree();
    let said = pc.good(&["apply", "--cpus", "3", "--interface", "enp2s0"]);
    assert_eq!(
        [30, 31, 32, 33].map(|number| irq(&pc, number)),
        ["3\n", "3\n", "0-2\n", "0-2\n"]
    );
    assert_eq!(pc.read("sys/class/net/enp2s0/queues/rx-0/rps_cpus"), "0\n");
    assert_eq!(pc.read("sys/class/net/enp2s0/queues/rx-0/rps_flow_cnt"), "0\n");
    assert_eq!(pc.read("sys/class/net/enp2s0/queues/tx-0/xps_cpus"), "8\n");
    assert_eq!(pc.read("proc/sys/net/ipv6/conf/enp2s0/disable_ipv6"), "1\n");

    assert_eq!(pc.read("ethtool/-c"), COALESCE.replace("RX: on", "RX: off"));
    assert!(
        said.contains("skipped ethtool enp2s0 coalesce rx-usecs: Operation not supported\n"),
        "{said}"
    );
    let mut features = FEATURES.to_owned();
    for name in [
        "tx-tcp-segmentation",
        "generic-segmentation-offload",
        "generic-receive-offload",
        "rx-vlan-offload",
    ] {
        features = features.replace(&format!("{name}: on\n"), &format!("{name}: off\n"));
    }
    assert_eq!(pc.read("ethtool/-k"), features);
    assert_eq!(pc.read("ethtool/-a"), PAUSE.replace("\ton", "\toff"));
    assert_eq!(pc.read("ethtool/eee"), EEE.replace("enabled - active", "disabled"));

    pc.good(&["undo"]);
    assert_eq!(pc.tree(), before);
}

#[test]
fn the_interrupts_go_to_the_housekeeping_cpus_when_asked_for() {
    let pc = pc();
    pc.good(&[
        "apply",
        "--cpus",
        "3",
        "--interface",
        "enp2s0",
        "--nic-irq",
        "housekeeping",
    ]);
    assert_eq!([30, 31, 32, 33].map(|number| irq(&pc, number)), ["0-2\n"; 4]);
    // Without an interface nothing of it is touched.
    let pc = self::pc();
    pc.good(&["apply", "--cpus", "3"]);
    assert_eq!(irq(&pc, 30), "0-2\n");
    assert_eq!(pc.read("ethtool/-k"), FEATURES);
    assert_eq!(pc.read("proc/sys/net/ipv6/conf/enp2s0/disable_ipv6"), "0\n");
}

#[test]
fn the_interrupts_of_a_virtio_interface_are_those_of_its_pci_device() {
    let pc = pc();
    fs::remove_dir_all(pc.path("sys/class/net/enp2s0/device")).unwrap();
    pc.write("sys/devices/pci/msi_irqs/33", "msix\n");
    fs::create_dir_all(pc.path("sys/devices/pci/virtio0")).unwrap();
    fs::create_dir_all(pc.path("sys/bus/virtio")).unwrap();
    symlink("../../../bus/virtio", pc.path("sys/devices/pci/virtio0/subsystem")).unwrap();
    symlink("../../../devices/pci/virtio0", pc.path("sys/class/net/enp2s0/device")).unwrap();
    pc.good(&["apply", "--cpus", "3", "--interface", "enp2s0"]);
    assert_eq!(
        [30, 31, 32, 33].map(|number| irq(&pc, number)),
        ["0-2\n", "3\n", "0-2\n", "3\n"]
    );
}

#[test]
fn without_ethtool_the_rest_is_done() {
    let pc = pc();
    pc.remove("usr/bin/ethtool");
    pc.good(&["apply", "--cpus", "3", "--interface", "enp2s0"]);
    assert_eq!(irq(&pc, 30), "3\n");
    assert_eq!(pc.read("ethtool/-k"), FEATURES);
}

#[test]
fn an_interface_that_is_not_there_is_named_and_the_rest_is_applied() {
    let pc = pc();
    let output = pc.run(&["apply", "--cpus", "3", "--interface", "eth9"]);
    assert_eq!(output.status.code(), Some(1));
    let said = super::pc::text(&output.stderr);
    assert!(said.contains("no interface eth9; there are: enp2s0"), "{said}");
    assert_eq!(irq(&pc, 33), "0-2\n");
    let (code, _) = pc.bad(&["persist", "--interface", "eth9"]);
    assert_eq!(code, Some(1));
}

#[test]
fn an_interface_that_is_gone_does_not_hinder_undo() {
    let pc = pc();
    pc.good(&["apply", "--cpus", "3", "--interface", "enp2s0"]);
    fs::remove_dir_all(pc.path("sys/class/net/enp2s0")).unwrap();
    let said = pc.good(&["undo"]);
    assert!(said.contains("gone    ethtool enp2s0 eee eee\n"), "{said}");
    assert_eq!(irq(&pc, 33), "0-3\n");
}
