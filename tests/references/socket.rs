//! `docs/control-socket.md`: the methods, from their table.

use super::{check, code, compare, head, row, typescript};
use isocnc::api::methods::table::METHODS;
use isocnc::api::openrpc;

#[test]
fn the_methods_of_the_control_socket() {
    check("docs/control-socket.md", |_| {
        let mut table = head(&["method", "parameters", "does"]);
        for method in METHODS.iter() {
            let params: Vec<String> = method.params.iter().map(|param| code(param.name)).collect();
            table += &row(&[&code(method.name), &params.join(", "), method.does]);
        }
        table
    });
}

/// A change of what programs can ask shows here: it needs another version.
#[test]
fn the_control_socket_for_programs() {
    let document = serde_json::to_string_pretty(&openrpc::document()).unwrap();
    compare("docs/control-socket.openrpc.json", &format!("{document}\n"));
}

#[test]
fn the_types_of_the_panel() {
    compare(
        "crates/panel/web/src/types.ts",
        &typescript::of_document(&openrpc::document()),
    );
}
