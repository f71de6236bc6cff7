//! The two bit fields by which a managing node is told how to start: NMT_StartUp (0x1F80) and NMT_NodeAssignment (0x1F81).
//!
//! In:  the values as they stand in an object dictionary or a concise DCF.
//! Out: plain switches. Every bit is honoured or refused by name: nothing is silently left out.

use core::fmt;

/// A bit that this managing node does not serve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RefusedBit {
    /// 0x1F80 or 0x1F81.
    pub index: u16,
    /// Sub-index: the node id, 0 for 0x1F80.
    pub sub: u8,
    /// Number of the bit, 0..=31.
    pub bit: u8,
    /// What it asks for.
    pub meaning: &'static str,
}

impl fmt::Display for RefusedBit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let RefusedBit {
            index,
            sub,
            bit,
            meaning,
        } = self;
        write!(f, "{index:04X}h/{sub:02X}h bit {bit} ({meaning}) is not served")
    }
}

impl core::error::Error for RefusedBit {}

const RESERVED: &str = "reserved";

/// First set bit of `value` that stands in no place of `served`, with its name.
fn refused(value: u32, served: u32, names: &[(u8, &'static str)]) -> Option<(u8, &'static str)> {
    let rest = value & !served;
    (rest != 0).then(|| {
        let bit = rest.trailing_zeros() as u8;
        let name = names.iter().find(|(named, _)| *named == bit);
        (bit, name.map_or(RESERVED, |(_, name)| *name))
    })
}

/// NMT_StartUp (0x1F80): how the network as a whole is started, and what the loss of a mandatory node means to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StartUp {
    /// Bit 1: StartNode by one broadcast when all mandatory nodes are ready, instead of one by one.
    pub broadcast_start: bool,
    /// Bit 2: OPERATIONAL is entered only when the application says so.
    pub application_enters_operational: bool,
    /// Bit 4: an error of a mandatory node resets all nodes.
    pub reset_all_on_error: bool,
    /// Bit 6: an error of a mandatory node stops all nodes. Bit 4 goes before it.
    pub stop_all_on_error: bool,
    /// Bit 7: PRE_OPERATIONAL_2 is entered only when the application says so.
    pub application_enters_pre_operational_2: bool,
    /// Bit 8: READY_TO_OPERATE is entered only when the application says so.
    pub application_enters_ready_to_operate: bool,
    /// Bit 9: vendor, product, revision and serial number are checked, not only the device type.
    pub check_identity: bool,
    /// Bit 10: date and time of the nodes' software are checked (0x1F53, 0x1F54) where bit 5 of the assignment says so.
    pub check_software: bool,
    /// Bit 11: a node that reports the expected date and time of its configuration (0x1F26, 0x1F27) is not configured again.
    pub check_configuration: bool,
    /// Bit 12: the network goes on in OPERATIONAL when a mandatory node is lost, instead of starting again from
    /// PRE_OPERATIONAL_1.
    pub stay_operational: bool,
    /// Bit 13: after NOT_ACTIVE the managing node goes to BASIC_ETHERNET.
    pub basic_ethernet: bool,
}

impl Default for StartUp {
    /// Full identity check, configuration check, and a network that no lost node takes down.
    fn default() -> Self {
        StartUp {
            check_identity: true,
            check_software: true,
            check_configuration: true,
            stay_operational: true,
            ..StartUp::NONE
        }
    }
}

impl StartUp {
    /// All bits zero.
    pub const NONE: StartUp = StartUp {
        broadcast_start: false,
        application_enters_operational: false,
        reset_all_on_error: false,
        stop_all_on_error: false,
        application_enters_pre_operational_2: false,
        application_enters_ready_to_operate: false,
        check_identity: false,
        check_software: false,
        check_configuration: false,
        stay_operational: false,
        basic_ethernet: false,
    };

    const REFUSED: [(u8, &'static str); 2] = [
        (3, "start of the nodes by the application"),
        (14, "managing node redundancy"),
    ];

    fn bits(&mut self) -> [(u8, &mut bool); 11] {
        [
            (1, &mut self.broadcast_start),
            (2, &mut self.application_enters_operational),
            (4, &mut self.reset_all_on_error),
            (6, &mut self.stop_all_on_error),
            (7, &mut self.application_enters_pre_operational_2),
            (8, &mut self.application_enters_ready_to_operate),
            (9, &mut self.check_identity),
            (10, &mut self.check_software),
            (11, &mut self.check_configuration),
            (12, &mut self.stay_operational),
            (13, &mut self.basic_ethernet),
        ]
    }

    /// Reads the value of the object.
    ///
    /// # Errors
    /// [`RefusedBit`]: the lowest bit that is not served.
    pub fn from_bits(value: u32) -> Result<StartUp, RefusedBit> {
        let mut startup = StartUp::NONE;
        let mut served = 0;
        for (bit, switch) in startup.bits() {
            served |= 1 << bit;
            *switch = value & (1 << bit) != 0;
        }
        match refused(value, served, &StartUp::REFUSED) {
            None => Ok(startup),
            Some((bit, meaning)) => Err(RefusedBit {
                index: 0x1F80,
                sub: 0,
                bit,
                meaning,
            }),
        }
    }

    /// Value of the object.
    pub fn to_bits(mut self) -> u32 {
        let set = self.bits().into_iter().filter(|(_, switch)| **switch);
        set.fold(0, |value, (bit, _)| value | 1 << bit)
    }
}

/// NMT_NodeAssignment (0x1F81/node): what one node is to the managing node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Assignment {
    /// Bit 2: the managing node configures and starts the node by itself when it appears.
    pub automatic_start: bool,
    /// Bit 3: the network waits for the node.
    pub mandatory: bool,
    /// Bit 4: the node is not reset when it is found in OPERATIONAL at the start; it is taken over as it is.
    pub keep_alive: bool,
    /// Bit 5: its software has to be the expected one.
    pub check_software: bool,
    /// Bit 8: the node takes part in asynchronous traffic only; it is never polled.
    pub async_only: bool,
    /// Bit 9: the node is polled in one cycle of a round only (0x1F9B says in which).
    pub multiplexed: bool,
    /// Bit 14: the node sends its PRes at a time of its own after the PRes of the managing node (PRes chaining).
    pub chained: bool,
}

impl Default for Assignment {
    fn default() -> Self {
        Assignment {
            automatic_start: true,
            mandatory: true,
            ..Assignment::NONE
        }
    }
}

impl Assignment {
    /// A node without any further property.
    pub const NONE: Assignment = Assignment {
        automatic_start: false,
        mandatory: false,
        keep_alive: false,
        check_software: false,
        async_only: false,
        multiplexed: false,
        chained: false,
    };

    /// Bits 0 and 1: the node exists and is a controlled node.
    const EXISTS: u32 = 0x0000_0003;
    /// Bit 31: the entry is valid.
    pub const VALID: u32 = 0x8000_0000;
    const REFUSED: [(u8, &'static str); 4] = [
        (6, "automatic update of the software"),
        (10, "router of type 1"),
        (11, "router of type 2"),
        (12, "PRes of the managing node, for node 240 only"),
    ];

    fn bits(&mut self) -> [(u8, &mut bool); 7] {
        [
            (2, &mut self.automatic_start),
            (3, &mut self.mandatory),
            (4, &mut self.keep_alive),
            (5, &mut self.check_software),
            (8, &mut self.async_only),
            (9, &mut self.multiplexed),
            (14, &mut self.chained),
        ]
    }

    /// Reads the value of the object for controlled node `node`; `None`: there is no such node (bit 0, 1 or 31 is missing).
    ///
    /// # Errors
    /// [`RefusedBit`]: the lowest bit that is not served.
    pub fn from_bits(node: u8, value: u32) -> Result<Option<Assignment>, RefusedBit> {
        let must = Assignment::EXISTS | Assignment::VALID;
        if value & must != must {
            return Ok(None);
        }
        let mut assignment = Assignment::NONE;
        let mut served = must;
        for (bit, switch) in assignment.bits() {
            served |= 1 << bit;
            *switch = value & (1 << bit) != 0;
        }
        match refused(value, served, &Assignment::REFUSED) {
            None => Ok(Some(assignment)),
            Some((bit, meaning)) => Err(RefusedBit {
                index: 0x1F81,
                sub: node,
                bit,
                meaning,
            }),
        }
    }

    /// Value of the object, valid.
    pub fn to_bits(mut self) -> u32 {
        let must = Assignment::EXISTS | Assignment::VALID;
        let set = self.bits().into_iter().filter(|(_, switch)| **switch);
        set.fold(must, |value, (bit, _)| value | 1 << bit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn every_bit_of_start_up_is_served_or_refused_by_name() {
        for bit in 0..32 {
            let value = 1 << bit;
            match StartUp::from_bits(value) {
                Ok(startup) => assert_eq!(startup.to_bits(), value),
                Err(error) => assert_eq!((error.index, u32::from(error.bit)), (0x1F80, bit)),
            }
        }
        let served = (0..32).filter(|bit| StartUp::from_bits(1 << bit).is_ok());
        assert!(served.eq([1, 2, 4, 6, 7, 8, 9, 10, 11, 12, 13]));
        assert_eq!(
            StartUp::from_bits(0x4800).unwrap_err().to_string(),
            "1F80h/00h bit 14 (managing node redundancy) is not served"
        );
    }

    #[test]
    fn every_bit_of_an_assignment_is_served_or_refused_by_name() {
        let exists = 0x8000_0003;
        for bit in 0..32 {
            let value = exists | 1 << bit;
            match Assignment::from_bits(9, value) {
                Ok(assignment) => assert_eq!(assignment.unwrap().to_bits(), value),
                Err(error) => assert_eq!((error.index, error.sub, u32::from(error.bit)), (0x1F81, 9, bit)),
            }
        }
        let served = (2..31).filter(|bit| Assignment::from_bits(9, exists | 1 << bit).is_ok());
        assert!(served.eq([2, 3, 4, 5, 8, 9, 14]));
        for missing in [0, 1, 31] {
            assert_eq!(Assignment::from_bits(9, exists & !(1 << missing)), Ok(None));
        }
        assert_eq!(
            Assignment::from_bits(9, 7),
            Ok(None),
            "the first write of a concise DCF"
        );
    }

    #[test]
    fn the_defaults_as_numbers() {
        assert_eq!(StartUp::default().to_bits(), 0x1E00);
        assert_eq!(Assignment::default().to_bits(), 0x8000_000F);
    }
}
