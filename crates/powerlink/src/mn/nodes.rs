//! The controlled nodes of a managing node: found by their position in the configuration, or by node id.

use super::config::NodeConfig;
use super::node::Node;

/// Marks a node id that no node has.
const NO_NODE: u8 = u8::MAX;

/// Room for `NODES` controlled nodes, in the order of the configuration.
#[derive(Debug)]
pub(super) struct Nodes<'a, const NODES: usize> {
    list: [Option<Node<'a>>; NODES],
    /// Position of a node id in the list.
    position_of: [u8; 256],
}

impl<'a, const NODES: usize> Nodes<'a, NODES> {
    /// `configs` is checked: at most 239 nodes and `NODES`, each with an id of its own.
    pub(super) fn new(configs: &[NodeConfig<'a>]) -> Self {
        let mut position_of = [NO_NODE; 256];
        for (position, config) in (0..).zip(configs) {
            position_of[usize::from(config.id)] = position;
        }
        Nodes {
            list: core::array::from_fn(|position| configs.get(position).map(|config| Node::new(*config))),
            position_of,
        }
    }

    pub(super) fn get(&self, position: usize) -> Option<&Node<'a>> {
        self.list.get(position)?.as_ref()
    }

    pub(super) fn get_mut(&mut self, position: usize) -> Option<&mut Node<'a>> {
        self.list.get_mut(position)?.as_mut()
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &Node<'a>> {
        self.list.iter().flatten()
    }

    pub(super) fn iter_mut(&mut self) -> impl Iterator<Item = &mut Node<'a>> {
        self.list.iter_mut().flatten()
    }

    /// Position of the node with this id.
    pub(super) fn index_of(&self, id: u8) -> Option<usize> {
        let position = self.position_of[usize::from(id)];
        (position != NO_NODE).then_some(usize::from(position))
    }

    pub(super) fn with_id(&self, id: u8) -> Option<&Node<'a>> {
        self.get(self.index_of(id)?)
    }

    pub(super) fn with_id_mut(&mut self, id: u8) -> Option<&mut Node<'a>> {
        self.get_mut(self.index_of(id)?)
    }

    /// Position of the next node from `start` on, in a circle, for which `wants` holds.
    pub(super) fn find_from(&self, start: usize, wants: impl Fn(&Node<'a>) -> bool) -> Option<usize> {
        let start = start % NODES.max(1);
        (start..NODES)
            .chain(0..start)
            .find(|position| self.get(*position).is_some_and(&wants))
    }
}
