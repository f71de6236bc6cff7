//! How a drive differs from others of the profile: how it was built, and what is done to it from outside the network.

/// What tests and operators do to a drive from outside the network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Injected {
    /// Show a warning.
    pub warning: bool,
    /// Obey the controlword (statusword bit 9).
    pub remote: bool,
    /// Transitions that are refused, one bit per number.
    pub refused: u32,
    /// The cause of a fault stays, so that no reset helps.
    pub cause_stays: bool,
    /// The safety circuit is open (safe torque off): no torque, and no way on. Bit 3 of 60FD shows it.
    pub sto_open: bool,
    /// The safety circuit opened under power is a fault, [`ERROR_STO`](super::ERROR_STO); else the drive is SWITCH ON DISABLED.
    pub sto_faults: bool,
    /// Bits of 60FD that are shown whatever the sensors say.
    pub digital_inputs: u32,
}

impl Default for Injected {
    fn default() -> Self {
        Injected {
            warning: false,
            remote: true,
            refused: 0,
            cause_stays: false,
            sto_open: false,
            sto_faults: false,
            digital_inputs: 0,
        }
    }
}

/// How a drive was built; by default as the profile has it, with all that it leaves open.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Quirks {
    /// It takes the target of CSP and IP in 6062, and does not tell its demand there; for
    /// [`DRIVE_OBJECTS_WITH_DEMAND`](super::DRIVE_OBJECTS_WITH_DEMAND).
    pub target_in_demand: bool,
    /// At its home point it counts 607C; by the profile it counts -607C.
    pub home_offset_adds: bool,
    /// Numbers of the bits of 60FD that show its lower and its upper limit switch and its home switch.
    pub input_bits: [u8; 3],
    /// The bit of 60FD that shows its safety circuit, and its value while that is open.
    pub sto: (u8, bool),
    /// Homing methods (6098) that it has of those known here; bit n: method n.
    pub homing_methods: u64,
    /// It stays in QUICK STOP ACTIVE whatever 605A says, until its voltage is disabled.
    pub stays_in_quick_stop: bool,
    /// Its velocity and its position encoder: increments, and the turns of the motor that they are. They count where 6090 says
    /// that the speed comes from an encoder of its own.
    pub encoders: [[u32; 2]; 2],
}

impl Default for Quirks {
    fn default() -> Quirks {
        Quirks {
            target_in_demand: false,
            home_offset_adds: false,
            input_bits: [0, 1, 2],
            sto: (3, true),
            homing_methods: u64::MAX,
            stays_in_quick_stop: false,
            encoders: [[1, 1]; 2],
        }
    }
}
