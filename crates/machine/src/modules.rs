//! Modules that are not as the machine file has them: missing, moved to another node id, swapped for another device.
//!
//! In:  the nodes of the machine file; what is told of the network while it starts, or what a scan found.
//! Out: sentences with what was expected and what was found.

use config::{Config, Identity};

/// A node of the machine file.
#[derive(Clone, Debug)]
struct Module {
    /// As messages name it.
    label: String,
    id: u8,
    wanted: Identity,
}

/// The nodes of a machine file, and which of them are missing.
#[derive(Clone, Debug)]
pub struct Modules {
    modules: Vec<Module>,
    missing: Vec<usize>,
    /// Ids are positions along the cable, which nobody sets.
    by_position: bool,
}

impl Modules {
    /// None of them is missing yet.
    pub fn new(config: &Config) -> Modules {
        let module = |node: &config::Node| Module {
            label: format!("{} (node {})", node.name, node.id),
            id: node.id,
            wanted: node.identity,
        };
        Modules {
            modules: config.bus.nodes.iter().map(module).collect(),
            missing: Vec::new(),
            by_position: config.bus.kind.protocol().ids_are_positions(),
        }
    }

    /// A node does not answer at its id.
    pub fn missing(&mut self, node: usize) -> String {
        self.present(node);
        self.missing.push(node);
        let Module { label, wanted, .. } = &self.modules[node];
        format!("{label} is missing: expected {wanted}; nobody answers there")
    }

    /// A node answers at its id, again or at last.
    pub fn present(&mut self, node: usize) {
        self.missing.retain(|missing| *missing != node);
    }

    /// A node that the machine file does not have is on the network.
    pub fn stranger(&self, id: u8, found: &Identity) -> String {
        let moved = self.missing.iter().map(|node| &self.modules[*node]);
        let moved = moved
            .filter(|module| module.wanted.is_checked())
            .find(|module| module.wanted.fits(found));
        match moved {
            Some(Module { label, wanted, .. }) => self.moved(label, wanted, id),
            None => Modules::strange(id, found),
        }
    }

    /// Another device is where a node should be; `found`: what is known of it.
    pub fn swapped(&self, node: usize, found: &Identity) -> String {
        let Module { label, wanted, id } = &self.modules[node];
        // What is not known of it says nothing against another one; something must be known that speaks for it.
        let known = |wanted: &Identity| Identity {
            device_type: wanted.device_type.filter(|_| found.device_type.is_some()),
            vendor_id: wanted.vendor_id.filter(|_| found.vendor_id.is_some()),
            product_code: wanted.product_code.filter(|_| found.product_code.is_some()),
            revision: wanted.revision.filter(|_| found.revision.is_some()),
            serial: wanted.serial.filter(|_| found.serial.is_some()),
        };
        let other = self.modules.iter().find(|other| {
            let wanted = known(&other.wanted);
            other.id != *id && wanted.is_checked() && wanted.fits(found)
        });
        let whose = other.map_or(String::new(), |other| {
            format!(", as {} should be: swapped?", other.label)
        });
        format!("{label} is another device: expected {wanted}; found {found}{whose}")
    }

    /// All that is otherwise than the machine file says, in the order of its nodes. What has moved is told once: it is neither missing nor
    /// strange where it is.
    pub fn differences(mut self, found: &[(u8, Identity)]) -> Vec<Difference> {
        let at = |id: u8| {
            found
                .iter()
                .find(|(found, _)| *found == id)
                .map(|(_, identity)| *identity)
        };
        let is_strange = |id: u8| self.modules.iter().all(|module| module.id != id);
        let mut strangers: Vec<(u8, Identity)> = found.iter().filter(|(id, _)| is_strange(*id)).copied().collect();
        let mut told = Vec::new();
        for node in 0..self.modules.len() {
            let Module { label, id, wanted } = self.modules[node].clone();
            let there = at(id);
            if there.is_some_and(|identity| wanted.fits(&identity)) {
                continue;
            }
            let moved = strangers
                .iter()
                .position(|(_, identity)| wanted.is_checked() && wanted.fits(identity));
            let (text, place) = match (moved, there) {
                (Some(moved), _) => {
                    let (to, _) = strangers.remove(moved);
                    let in_its_place = there.map_or(String::new(), |other| format!("; in its place {other}"));
                    let text = self.moved(&label, &wanted, to) + &in_its_place;
                    (text, Some(to))
                }
                (None, Some(identity)) => (self.swapped(node, &identity), None),
                (None, None) => (self.missing(node), None),
            };
            told.push(Difference {
                text,
                moved_to: place,
                stranger: None,
            });
        }
        told.extend(strangers.into_iter().map(|(id, identity)| Difference {
            text: Modules::strange(id, &identity),
            moved_to: None,
            stranger: Some(id),
        }));
        told
    }

    fn moved(&self, label: &str, wanted: &Identity, to: u8) -> String {
        let cure = match self.by_position {
            true => format!("plug it in where it was, or write id = {to} into the file"),
            false => format!("set its id back, or write {to} into the file"),
        };
        format!("{label} has moved: expected {wanted}; found at node {to}: {cure}")
    }

    fn strange(id: u8, found: &Identity) -> String {
        format!("node {id} is on the network and not in the machine file: found {found}")
    }
}

/// Something that is otherwise than the machine file says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// In words.
    pub text: String,
    /// Where a module that has moved is now.
    pub moved_to: Option<u8>,
    /// Where a device is that the file does not have.
    pub stranger: Option<u8>,
}

#[cfg(test)]
mod tests {
    use super::*;

    const NODES: &str = "schema = 1\n[machine]\nname = \"m\"\nkinematics = \"none\"\n[bus]\nkind = \"memory\"\n\
                         [[bus.node]]\nid = 1\nname = \"a\"\nprofile = \"io\"\nvendor_id = 7\nproduct_code = 1\n\
                         [[bus.node]]\nid = 2\nname = \"b\"\nprofile = \"io\"\nvendor_id = 7\nproduct_code = 2\nserial = 99\n\
                         [[bus.node]]\nid = 3\nname = \"c\"\nprofile = \"io\"\n";

    fn modules() -> Modules {
        let config = config::parse(NODES, std::path::Path::new("m.toml")).unwrap();
        Modules::new(&config)
    }

    fn device(product: u32, serial: u32) -> Identity {
        Identity {
            device_type: Some(0x191),
            vendor_id: Some(7),
            product_code: Some(product),
            revision: Some(1),
            serial: Some(serial),
        }
    }

    fn told(found: &[(u8, Identity)]) -> Vec<String> {
        let differences = modules().differences(found).into_iter();
        differences.map(|difference| difference.text).collect()
    }

    /// Another device in the place of one that has moved; two of one type, of which one has.
    #[test]
    fn what_has_moved_is_told_once_and_truly() {
        let a = "expected vendor 0x00000007, product 0x00000001";
        let moved = told(&[
            (1, device(4, 4)),
            (2, device(2, 99)),
            (3, device(8, 8)),
            (9, device(1, 5)),
        ]);
        assert_eq!(moved.len(), 1, "{moved:?}");
        let expected = format!(
            "a (node 1) has moved: {a}; found at node 9: set its id back, or write 9 into the file; in its place "
        );
        assert!(
            moved[0].starts_with(&expected) && moved[0].ends_with("serial 4"),
            "{moved:?}"
        );
        let twice = [
            (2, device(2, 99)),
            (3, device(8, 8)),
            (9, device(1, 5)),
            (10, device(1, 6)),
        ];
        let differences = modules().differences(&twice);
        let places: Vec<_> = differences.iter().map(|it| (it.moved_to, it.stranger)).collect();
        assert_eq!(places, [(Some(9), None), (None, Some(10))]);
        // On EtherCAT an id is a position, which nobody sets.
        let mut modules = modules();
        modules.by_position = true;
        let differences = modules.differences(&twice);
        assert!(
            differences[0]
                .text
                .ends_with("found at node 9: plug it in where it was, or write id = 9 into the file"),
            "{differences:?}"
        );
    }

    #[test]
    fn what_is_right_is_not_told() {
        let found = [(1, device(1, 5)), (2, device(2, 99)), (3, device(8, 8))];
        assert_eq!(told(&found), [""; 0]);
    }

    #[test]
    fn missing_moved_swapped_and_strange_modules_are_told_with_what_was_expected_and_found() {
        let a = "expected vendor 0x00000007, product 0x00000001";
        let b = "expected vendor 0x00000007, product 0x00000002, serial 99";
        let found = |product, serial| {
            format!(
                "found device type 0x00000191, vendor 0x00000007, product {product:#010X}, revision 0x00000001, serial {serial}"
            )
        };
        // Swapped against each other; the third one is not there, and nothing is wanted of it.
        assert_eq!(
            told(&[(1, device(2, 99)), (2, device(1, 5))]),
            [
                format!(
                    "a (node 1) is another device: {a}; {}, as b (node 2) should be: swapped?",
                    found(2, 99)
                ),
                format!(
                    "b (node 2) is another device: {b}; {}, as a (node 1) should be: swapped?",
                    found(1, 5)
                ),
                "c (node 3) is missing: expected any device; nobody answers there".to_owned(),
            ]
        );
        // Another one of its type; one at another id; one that nobody knows.
        let changed = [
            (2, device(2, 98)),
            (3, device(8, 8)),
            (9, device(1, 5)),
            (10, device(4, 4)),
        ];
        assert_eq!(
            told(&changed),
            [
                format!("a (node 1) has moved: {a}; found at node 9: set its id back, or write 9 into the file"),
                format!("b (node 2) is another device: {b}; {}", found(2, 98)),
                format!("node 10 is on the network and not in the machine file: {}", found(4, 4)),
            ]
        );
    }

    #[test]
    fn a_module_that_is_back_has_not_moved() {
        let mut modules = modules();
        modules.missing(0);
        assert!(modules.stranger(200, &device(1, 5)).starts_with("a (node 1) has moved"));
        modules.present(0);
        assert!(
            modules
                .stranger(200, &device(1, 5))
                .starts_with("node 200 is on the network")
        );
    }

    #[test]
    fn one_value_is_enough_to_know_whose_it_is() {
        let product = Identity {
            product_code: Some(2),
            ..Identity::default()
        };
        let told = modules().swapped(0, &product);
        assert!(
            told.ends_with("found product 0x00000002, as b (node 2) should be: swapped?"),
            "{told}"
        );
    }
}
