//! A bus that notes when its exchange was over, so that what follows in the cycle can be timed.

use isocnc::bus::{
    BusEvent, BusState, CycleReport, CyclicBus, InputImage, NodeIndex, NodeState, NodeStatistics, OutputImage,
};
use std::time::{Duration, Instant};

/// Any bus, and the times of its last cycle.
pub(crate) struct Timed<B> {
    /// The bus.
    pub(crate) bus: B,
    /// How long it took to make the last cycle ready.
    pub(crate) prepared: Duration,
    /// When the last exchange was over.
    pub(crate) exchanged: Instant,
}

impl<B> Timed<B> {
    /// A bus that has exchanged nothing yet.
    pub(crate) fn new(bus: B) -> Timed<B> {
        Timed {
            bus,
            prepared: Duration::ZERO,
            exchanged: Instant::now(),
        }
    }
}

impl<B: CyclicBus> CyclicBus for Timed<B> {
    fn prepare(&mut self, begin_ns: u64, outputs: &OutputImage) {
        let began = Instant::now();
        self.bus.prepare(begin_ns, outputs);
        self.prepared = began.elapsed();
    }

    fn exchange(&mut self, deadline_ns: u64, inputs: &mut InputImage) -> CycleReport {
        let report = self.bus.exchange(deadline_ns, inputs);
        self.exchanged = Instant::now();
        report
    }

    fn serve(&mut self, until_ns: u64) {
        self.bus.serve(until_ns);
    }

    fn now_ns(&mut self) -> u64 {
        self.bus.now_ns()
    }

    fn node_state(&self, node: NodeIndex) -> NodeState {
        self.bus.node_state(node)
    }

    fn state(&self) -> BusState {
        self.bus.state()
    }

    fn pop_event(&mut self) -> Option<BusEvent> {
        self.bus.pop_event()
    }

    fn shut_down(&mut self) {
        self.bus.shut_down();
    }

    fn statistics(&self, node: NodeIndex) -> NodeStatistics {
        self.bus.statistics(node)
    }

    fn publish(&mut self, cycle: u64) {
        self.bus.publish(cycle);
    }
}
