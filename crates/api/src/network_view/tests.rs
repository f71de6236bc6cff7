use super::*;
use std::path::Path;

const MACHINE: &str = include_str!("../../../../configs/mill3-demo.toml");

#[test]
fn nodes_are_found_in_the_machine_file() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/mill3-demo.toml");
    let config = config::read(&path).unwrap();
    let view = NetworkView::from_config(&config);
    let lines: Vec<&str> = MACHINE.lines().collect();
    for node in &view.nodes {
        let line = node.line.unwrap();
        assert_eq!(lines[line - 1], "[[bus.node]]", "{}", node.name);
        assert_eq!(lines[line], format!("id = {}", node.id));
    }
    assert_eq!(view.nodes.len(), config.bus.nodes.len());
    // Objects lie side by side.
    let drive = &view.nodes[0];
    assert_eq!(drive.outputs[0].offset_bits, 0);
    assert_eq!(drive.outputs[1].offset_bits, u32::from(drive.outputs[0].bits));
    // A file that is gone takes the lines with it and nothing else.
    let gone = config::parse(MACHINE, Path::new("/nowhere.toml")).unwrap();
    assert!(
        NetworkView::from_config(&gone)
            .nodes
            .iter()
            .all(|node| node.line.is_none())
    );
}

#[test]
fn a_view_goes_through_json_unchanged() {
    let mut view = NetworkView::from_config(&config::parse(MACHINE, Path::new("demo.toml")).unwrap());
    view.live = Some(NetworkLive {
        nmt_state: "NOT_ACTIVE".into(),
        why: Some("another managing node is on the wire".into()),
        ..NetworkLive::default()
    });
    let text = serde_json::to_string(&view).unwrap();
    assert_eq!(serde_json::from_str::<NetworkView>(&text).unwrap(), view);
}
