//! The application layer of a device: its state, what is asked of it, and why it refuses.

use core::fmt;

/// State of a device's state machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AlState {
    /// No mailbox, no process data.
    Init,
    /// The mailbox works.
    PreOp,
    /// Firmware can be loaded.
    Boot,
    /// Inputs are valid, outputs are ignored.
    SafeOp,
    /// Both are valid.
    Op,
    /// No state; a sum of several, where all devices were asked at once.
    Unknown(u8),
}

impl From<u8> for AlState {
    /// Of the lower four bits.
    fn from(octet: u8) -> AlState {
        match octet & 0x0F {
            1 => AlState::Init,
            2 => AlState::PreOp,
            3 => AlState::Boot,
            4 => AlState::SafeOp,
            8 => AlState::Op,
            other => AlState::Unknown(other),
        }
    }
}

impl From<AlState> for u8 {
    fn from(state: AlState) -> u8 {
        match state {
            AlState::Init => 1,
            AlState::PreOp => 2,
            AlState::Boot => 3,
            AlState::SafeOp => 4,
            AlState::Op => 8,
            AlState::Unknown(other) => other,
        }
    }
}

impl fmt::Display for AlState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            AlState::Init => f.write_str("INIT"),
            AlState::PreOp => f.write_str("PRE-OP"),
            AlState::Boot => f.write_str("BOOT"),
            AlState::SafeOp => f.write_str("SAFE-OP"),
            AlState::Op => f.write_str("OP"),
            AlState::Unknown(other) => write!(f, "unknown state {other}"),
        }
    }
}

/// What [`AL_CONTROL`](super::AL_CONTROL) asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AlControl {
    /// The state to go to.
    pub state: AlState,
    /// An error that the device shows is acknowledged.
    pub acknowledge: bool,
    /// The device shall put its identification into the status code.
    pub ask_id: bool,
}

impl From<u16> for AlControl {
    fn from(word: u16) -> AlControl {
        AlControl {
            state: AlState::from(word as u8),
            acknowledge: word & 0x10 != 0,
            ask_id: word & 0x20 != 0,
        }
    }
}

impl From<AlControl> for u16 {
    fn from(control: AlControl) -> u16 {
        u16::from(u8::from(control.state)) | u16::from(control.acknowledge) << 4 | u16::from(control.ask_id) << 5
    }
}

/// What [`AL_STATUS`](super::AL_STATUS) tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AlStatus {
    /// The state it is in.
    pub state: AlState,
    /// It refused a step or left a state by itself; [`AL_STATUS_CODE`](super::AL_STATUS_CODE) says why.
    pub error: bool,
    /// The status code is its identification.
    pub id_loaded: bool,
}

impl From<u16> for AlStatus {
    fn from(word: u16) -> AlStatus {
        AlStatus {
            state: AlState::from(word as u8),
            error: word & 0x10 != 0,
            id_loaded: word & 0x20 != 0,
        }
    }
}

impl From<AlStatus> for u16 {
    fn from(status: AlStatus) -> u16 {
        u16::from(u8::from(status.state)) | u16::from(status.error) << 4 | u16::from(status.id_loaded) << 5
    }
}

/// Why a device refused a step of its state machine, or left a state; unknown values are kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct AlStatusCode(pub u16);

macro_rules! status_codes {
    ($($name:ident = $value:literal, $text:literal;)*) => {
        impl AlStatusCode {
            $(#[doc = $text] pub const $name: AlStatusCode = AlStatusCode($value);)*

            /// Every code that has a name here.
            pub const ALL: &'static [AlStatusCode] = &[$(AlStatusCode::$name),*];

            /// A few words for people; a fixed text for codes that are not known here.
            pub const fn text(self) -> &'static str {
                match self.0 {
                    $($value => $text,)*
                    0x8000.. => "a code of the maker",
                    _ => "unknown status code",
                }
            }
        }
    };
}

status_codes! {
    NONE = 0x0000, "no error";
    UNSPECIFIED = 0x0001, "unspecified error";
    NO_MEMORY = 0x0002, "no memory";
    DEVICE_SETUP = 0x0003, "invalid set-up of the device";
    EEPROM_FIRMWARE = 0x0006, "EEPROM does not fit the firmware";
    STEP = 0x0011, "step not allowed";
    UNKNOWN_STATE = 0x0012, "unknown state";
    NO_BOOT = 0x0013, "there is no bootstrap";
    NO_FIRMWARE = 0x0014, "there is no valid firmware";
    MAILBOX_BOOT = 0x0015, "mailbox set-up for BOOT is wrong";
    MAILBOX = 0x0016, "mailbox set-up is wrong";
    SYNC_MANAGER = 0x0017, "set-up of the process data SyncManagers is wrong";
    NO_INPUTS = 0x0018, "no valid inputs";
    NO_OUTPUTS = 0x0019, "no valid outputs";
    SYNCHRONISATION = 0x001A, "synchronisation failed";
    WATCHDOG = 0x001B, "no outputs came in time (SyncManager watchdog)";
    SM_TYPES = 0x001C, "types of the SyncManagers are wrong";
    OUTPUT_SM = 0x001D, "SyncManager of the outputs does not fit the mapping";
    INPUT_SM = 0x001E, "SyncManager of the inputs does not fit the mapping";
    WATCHDOG_SETUP = 0x001F, "set-up of the watchdog is wrong";
    NEEDS_COLD_START = 0x0020, "power must be switched off and on";
    NEEDS_INIT = 0x0021, "must go to INIT first";
    NEEDS_PRE_OP = 0x0022, "must go to PRE-OP first";
    NEEDS_SAFE_OP = 0x0023, "must go to SAFE-OP first";
    INPUT_MAPPING = 0x0024, "input mapping is wrong";
    OUTPUT_MAPPING = 0x0025, "output mapping is wrong";
    INCONSISTENT = 0x0026, "settings contradict each other";
    NO_FREE_RUN = 0x0027, "free run is not supported";
    NO_SYNC_MODE = 0x0028, "synchronous mode is not supported";
    THREE_BUFFERS = 0x0029, "free run needs three buffers";
    BACKGROUND_WATCHDOG = 0x002A, "watchdog of the background";
    NO_INPUTS_AND_OUTPUTS = 0x002B, "no valid inputs and outputs";
    FATAL_SYNC = 0x002C, "fatal error of synchronisation";
    NO_SYNC0 = 0x002D, "no SYNC0 was seen";
    CYCLE_TOO_SHORT = 0x002E, "cycle time too short";
    DC_SETUP = 0x0030, "set-up of distributed clocks is wrong";
    LATCH = 0x0031, "set-up of the latch is wrong";
    PLL = 0x0032, "clocks do not come together (PLL)";
    SYNC_IO = 0x0033, "inputs and outputs are not synchronous";
    SYNC_TIMEOUT = 0x0034, "time-out of synchronisation";
    CYCLE_TIME = 0x0035, "synchronous cycle time is wrong";
    SYNC0_CYCLE = 0x0036, "cycle of SYNC0 is wrong";
    SYNC1_CYCLE = 0x0037, "cycle of SYNC1 is wrong";
    MAILBOX_AOE = 0x0041, "mailbox: AoE";
    MAILBOX_EOE = 0x0042, "mailbox: EoE";
    MAILBOX_COE = 0x0043, "mailbox: CoE";
    MAILBOX_FOE = 0x0044, "mailbox: FoE";
    MAILBOX_SOE = 0x0045, "mailbox: SoE";
    MAILBOX_VOE = 0x004F, "mailbox: VoE";
    EEPROM_ACCESS = 0x0050, "no access to the EEPROM";
    EEPROM_ERROR = 0x0051, "error of the EEPROM";
    HARDWARE = 0x0052, "hardware not ready";
    RESTARTED = 0x0060, "it has restarted by itself";
    ID_CHANGED = 0x0061, "its identification has changed";
    MODULES = 0x0070, "modules differ from those configured";
    APPLICATION = 0x00F0, "its loader runs, not its firmware";
}

impl fmt::Display for AlStatusCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X}h ({})", self.0, self.text())
    }
}
