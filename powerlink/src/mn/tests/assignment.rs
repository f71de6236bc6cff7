//! NMT_NodeAssignment (0x1F81), bit by bit. Bit 3 (mandatory) is in `boot`, bit 5 (software) in `startup`.

use super::*;
use std::string::{String, ToString};

/// Why a managing node with this one node is refused.
fn refused(change: impl FnOnce(&mut MnConfig<'_>, &mut NodeConfig<'_>)) -> String {
    let configuration = configuration();
    let mut node = node_config(1, &configuration);
    let mut config = mn_config(&[]);
    change(&mut config, &mut node);
    let nodes = [node];
    let config = MnConfig {
        nodes: &nodes,
        ..config
    };
    Mn::<NODES>::new(config).expect_err("must be refused").to_string()
}

#[test]
fn bits_that_cannot_go_together_are_refused_by_name() {
    assert_eq!(
        refused(|_, node| node.assignment.async_only = true),
        "node 1: a node that is never polled (1F81h bit 8) has no process data"
    );
    assert_eq!(
        refused(|_, node| node.assignment.keep_alive = true),
        "node 1: a node that is kept alive (1F81h bit 4) needs date and time of its configuration (1F26h, 1F27h)"
    );
    assert_eq!(
        refused(|config, node| {
            config.startup.check_configuration = false;
            node.assignment.keep_alive = true;
        }),
        "node 1: a node that is kept alive (1F81h bit 4) needs the configuration check (1F80h bit 11)"
    );
}
