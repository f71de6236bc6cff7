//! Where in the dictionary the objects lie that the node itself uses: looked up once, when the node is built.

use obd::{Dictionary, Key, Scalar};

use super::config::CnError;
use super::objects::{MAPPING_ENTRIES, RPDOS};

/// Handles of the objects that the node itself uses.
#[derive(Clone, Copy, Debug)]
pub(super) struct Keys {
    pub(super) device_type: Key<u32>,
    pub(super) error_register: Key<u8>,
    pub(super) history_count: Key<u8>,
    pub(super) cycle_us: Key<u32>,
    pub(super) identity: [Key<u32>; 4],
    pub(super) configuration: StampKeys,
    pub(super) software: StampKeys,
    pub(super) telegrams: TelegramKeys,
    pub(super) statistics: StatisticsKeys,
    pub(super) receive: [PdoKeys; RPDOS],
    pub(super) transmit: PdoKeys,
    pub(super) losses: LossKeys,
    pub(super) ip: IpKeys,
    pub(super) feature_flags: Key<u32>,
    pub(super) nmt_state: Key<u8>,
    pub(super) timing: TimingKeys,
    pub(super) chaining: ChainingKeys,
    pub(super) basic_ethernet_us: Key<u32>,
}

/// Date and time of a configuration (0x1020) or of the software (0x1F52).
#[derive(Clone, Copy, Debug)]
pub(super) struct StampKeys {
    pub(super) date: Key<u32>,
    pub(super) time: Key<u32>,
}

/// Objects of one PDO.
#[derive(Clone, Copy, Debug)]
pub(super) struct PdoKeys {
    pub(super) node: Key<u8>,
    pub(super) version: Key<u8>,
    pub(super) count: Key<u8>,
    pub(super) entries: [Key<u64>; MAPPING_ENTRIES],
}

/// Sub-indices 1..3 of a threshold counter.
#[derive(Clone, Copy, Debug)]
pub(super) struct CounterKeys {
    pub(super) cumulative: Key<u32>,
    pub(super) count: Key<u32>,
    pub(super) threshold: Key<u32>,
}

/// 0x1C0A..0x1C14: the watch over the cycle.
#[derive(Clone, Copy, Debug)]
pub(super) struct LossKeys {
    pub(super) collision: CounterKeys,
    pub(super) soc: CounterKeys,
    pub(super) soa: CounterKeys,
    pub(super) preq: CounterKeys,
    pub(super) crc: CounterKeys,
    pub(super) soc_tolerance_ns: Key<u32>,
}

/// 0x1E40: the node in an IP network.
#[derive(Clone, Copy, Debug)]
pub(super) struct IpKeys {
    pub(super) address: Key<u32>,
    pub(super) subnet_mask: Key<u32>,
    pub(super) default_gateway: Key<u32>,
}

/// 0x1F98/3..8: lengths and times of a cycle.
#[derive(Clone, Copy, Debug)]
pub(super) struct TimingKeys {
    pub(super) pres_max_latency_ns: Key<u32>,
    pub(super) preq_limit: Key<u16>,
    pub(super) pres_limit: Key<u16>,
    pub(super) multiplexed_cycles: Key<u8>,
    pub(super) async_mtu: Key<u16>,
}

/// 0x1101: what came and what was sent.
#[derive(Clone, Copy, Debug)]
pub(super) struct TelegramKeys {
    pub(super) cycles: Key<u32>,
    pub(super) isochronous_received: Key<u32>,
    pub(super) isochronous_sent: Key<u32>,
    pub(super) asynchronous_received: Key<u32>,
    pub(super) asynchronous_sent: Key<u32>,
    pub(super) sdo_received: Key<u32>,
    pub(super) sdo_sent: Key<u32>,
    pub(super) status_requests: Key<u32>,
}

/// 0x1102: what happened in error signalling.
#[derive(Clone, Copy, Debug)]
pub(super) struct StatisticsKeys {
    pub(super) history_writes: Key<u32>,
    pub(super) queue_writes: Key<u32>,
    pub(super) queue_overflows: Key<u32>,
    pub(super) static_changes: Key<u32>,
    pub(super) reset_edges: Key<u32>,
    pub(super) new_edges: Key<u32>,
}

/// 0x1F98/10..14.
#[derive(Clone, Copy, Debug)]
pub(super) struct ChainingKeys {
    pub(super) mode: Key<u8>,
    pub(super) pres_time_first_ns: Key<u32>,
    pub(super) pres_time_second_ns: Key<u32>,
    pub(super) mn_delay_first_ns: Key<u32>,
    pub(super) mn_delay_second_ns: Key<u32>,
}

impl Keys {
    pub(super) fn find<const E: usize, const B: usize>(dictionary: &Dictionary<E, B>) -> Result<Keys, CnError> {
        let d = dictionary;
        Ok(Keys {
            device_type: key(d, 0x1000, 0)?,
            error_register: key(d, 0x1001, 0)?,
            history_count: key(d, 0x1003, 0)?,
            cycle_us: key(d, 0x1006, 0)?,
            identity: [
                key(d, 0x1018, 1)?,
                key(d, 0x1018, 2)?,
                key(d, 0x1018, 3)?,
                key(d, 0x1018, 4)?,
            ],
            configuration: StampKeys::find(d, 0x1020)?,
            software: StampKeys::find(d, 0x1F52)?,
            telegrams: TelegramKeys {
                cycles: key(d, 0x1101, 1)?,
                isochronous_received: key(d, 0x1101, 2)?,
                isochronous_sent: key(d, 0x1101, 3)?,
                asynchronous_received: key(d, 0x1101, 4)?,
                asynchronous_sent: key(d, 0x1101, 5)?,
                sdo_received: key(d, 0x1101, 6)?,
                sdo_sent: key(d, 0x1101, 7)?,
                status_requests: key(d, 0x1101, 8)?,
            },
            statistics: StatisticsKeys {
                history_writes: key(d, 0x1102, 1)?,
                queue_writes: key(d, 0x1102, 2)?,
                queue_overflows: key(d, 0x1102, 3)?,
                static_changes: key(d, 0x1102, 5)?,
                reset_edges: key(d, 0x1102, 6)?,
                new_edges: key(d, 0x1102, 7)?,
            },
            receive: PdoKeys::find_receive(d)?,
            transmit: PdoKeys::find(d, 0x1800, 0x1A00)?,
            losses: LossKeys {
                collision: CounterKeys::find(d, 0x1C0A)?,
                soc: CounterKeys::find(d, 0x1C0B)?,
                soa: CounterKeys::find(d, 0x1C0C)?,
                preq: CounterKeys::find(d, 0x1C0D)?,
                crc: CounterKeys::find(d, 0x1C0F)?,
                soc_tolerance_ns: key(d, 0x1C14, 0)?,
            },
            ip: IpKeys {
                address: key(d, 0x1E40, 2)?,
                subnet_mask: key(d, 0x1E40, 3)?,
                default_gateway: key(d, 0x1E40, 5)?,
            },
            feature_flags: key(d, 0x1F82, 0)?,
            nmt_state: key(d, 0x1F8C, 0)?,
            timing: TimingKeys {
                pres_max_latency_ns: key(d, 0x1F98, 3)?,
                preq_limit: key(d, 0x1F98, 4)?,
                pres_limit: key(d, 0x1F98, 5)?,
                multiplexed_cycles: key(d, 0x1F98, 7)?,
                async_mtu: key(d, 0x1F98, 8)?,
            },
            chaining: ChainingKeys {
                mode: key(d, 0x1F98, 10)?,
                pres_time_first_ns: key(d, 0x1F98, 11)?,
                pres_time_second_ns: key(d, 0x1F98, 12)?,
                mn_delay_first_ns: key(d, 0x1F98, 13)?,
                mn_delay_second_ns: key(d, 0x1F98, 14)?,
            },
            basic_ethernet_us: key(d, 0x1F99, 0)?,
        })
    }
}

impl PdoKeys {
    fn find<const E: usize, const B: usize>(
        dictionary: &Dictionary<E, B>,
        communication: u16,
        mapping: u16,
    ) -> Result<PdoKeys, CnError> {
        let first = key(dictionary, mapping, 1)?;
        let mut entries = [first; MAPPING_ENTRIES];
        for (sub, entry) in (1..).zip(&mut entries) {
            *entry = key(dictionary, mapping, sub)?;
        }
        Ok(PdoKeys {
            node: key(dictionary, communication, 1)?,
            version: key(dictionary, communication, 2)?,
            count: key(dictionary, mapping, 0)?,
            entries,
        })
    }

    fn find_receive<const E: usize, const B: usize>(
        dictionary: &Dictionary<E, B>,
    ) -> Result<[PdoKeys; RPDOS], CnError> {
        let first = PdoKeys::find(dictionary, 0x1400, 0x1600)?;
        let mut receive = [first; RPDOS];
        for (number, keys) in (0..).zip(&mut receive) {
            *keys = PdoKeys::find(dictionary, 0x1400 + number, 0x1600 + number)?;
        }
        Ok(receive)
    }
}

impl StampKeys {
    fn find<const E: usize, const B: usize>(dictionary: &Dictionary<E, B>, index: u16) -> Result<StampKeys, CnError> {
        Ok(StampKeys {
            date: key(dictionary, index, 1)?,
            time: key(dictionary, index, 2)?,
        })
    }
}

impl CounterKeys {
    fn find<const E: usize, const B: usize>(dictionary: &Dictionary<E, B>, index: u16) -> Result<CounterKeys, CnError> {
        Ok(CounterKeys {
            cumulative: key(dictionary, index, 1)?,
            count: key(dictionary, index, 2)?,
            threshold: key(dictionary, index, 3)?,
        })
    }
}

fn key<T: Scalar, const E: usize, const B: usize>(
    dictionary: &Dictionary<E, B>,
    index: u16,
    sub: u8,
) -> Result<Key<T>, CnError> {
    dictionary
        .key(index, sub)
        .map_err(|code| CnError::Object { index, sub, code })
}
