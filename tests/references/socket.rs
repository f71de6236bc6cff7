//! `docs/control-socket.md`: the methods, from their table.

use super::{check, code, head, row};
use isocnc::api::methods::METHODS;

#[test]
fn the_methods_of_the_control_socket() {
    check("docs/control-socket.md", |_| {
        let mut table = head(&["method", "parameters", "does"]);
        for method in METHODS {
            let params: Vec<String> = method.params.iter().map(|name| code(name)).collect();
            table += &row(&[&code(method.name), &params.join(", "), method.does]);
        }
        table
    });
}
