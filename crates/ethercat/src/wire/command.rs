//! What a datagram asks of the devices that it passes.

/// Command of a datagram.
///
/// The first letters are the way of addressing: AP position, FP station address, B all, L logical.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Command {
    /// Nobody acts.
    Nop,
    /// Reads of the device at this position.
    Aprd,
    /// Writes to the device at this position.
    Apwr,
    /// Both.
    Aprw,
    /// Reads of the device with this station address or alias.
    Fprd,
    /// Writes to it.
    Fpwr,
    /// Both.
    Fprw,
    /// Reads of all devices, what they hold ORed.
    Brd,
    /// Writes to all.
    Bwr,
    /// Both.
    Brw,
    /// Reads of all devices that map a part of the logical range.
    Lrd,
    /// Writes to them.
    Lwr,
    /// Both.
    Lrw,
    /// Reads of the device at this position, writes to all others.
    Armw,
    /// Reads of the device with this station address, writes to all others.
    Frmw,
    /// Any other number; nobody acts.
    Unknown(u8),
}

/// What the address of a command means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Addressing {
    /// None: nobody is addressed.
    None,
    /// Upper half: who sees 0 there is meant; lower half: offset.
    Position,
    /// Upper half: station address; lower half: offset.
    Station,
    /// Everybody.
    Broadcast,
    /// A place in the logical image of 4 GiB.
    Logical,
}

impl Command {
    const ALL: [Command; 15] = [
        Command::Nop,
        Command::Aprd,
        Command::Apwr,
        Command::Aprw,
        Command::Fprd,
        Command::Fpwr,
        Command::Fprw,
        Command::Brd,
        Command::Bwr,
        Command::Brw,
        Command::Lrd,
        Command::Lwr,
        Command::Lrw,
        Command::Armw,
        Command::Frmw,
    ];

    /// How it is addressed.
    pub const fn addressing(self) -> Addressing {
        match self {
            Command::Aprd | Command::Apwr | Command::Aprw | Command::Armw => Addressing::Position,
            Command::Fprd | Command::Fpwr | Command::Fprw | Command::Frmw => Addressing::Station,
            Command::Brd | Command::Bwr | Command::Brw => Addressing::Broadcast,
            Command::Lrd | Command::Lwr | Command::Lrw => Addressing::Logical,
            Command::Nop | Command::Unknown(_) => Addressing::None,
        }
    }

    /// Whether an addressed device puts data into the frame.
    pub const fn reads(self) -> bool {
        match self {
            Command::Aprd | Command::Aprw | Command::Fprd | Command::Fprw | Command::Brd | Command::Brw => true,
            Command::Lrd | Command::Lrw | Command::Armw | Command::Frmw => true,
            Command::Nop | Command::Apwr | Command::Fpwr | Command::Bwr | Command::Lwr | Command::Unknown(_) => false,
        }
    }

    /// Whether an addressed device takes data from the frame.
    pub const fn writes(self) -> bool {
        match self {
            Command::Apwr | Command::Aprw | Command::Fpwr | Command::Fprw | Command::Bwr | Command::Brw => true,
            Command::Lwr | Command::Lrw => true,
            Command::Nop | Command::Aprd | Command::Fprd | Command::Brd | Command::Lrd => false,
            Command::Armw | Command::Frmw | Command::Unknown(_) => false,
        }
    }
}

impl From<u8> for Command {
    fn from(octet: u8) -> Command {
        let known = Command::ALL.get(usize::from(octet)).copied();
        known.unwrap_or(Command::Unknown(octet))
    }
}

impl From<Command> for u8 {
    fn from(command: Command) -> u8 {
        match command {
            Command::Nop => 0,
            Command::Aprd => 1,
            Command::Apwr => 2,
            Command::Aprw => 3,
            Command::Fprd => 4,
            Command::Fpwr => 5,
            Command::Fprw => 6,
            Command::Brd => 7,
            Command::Bwr => 8,
            Command::Brw => 9,
            Command::Lrd => 10,
            Command::Lwr => 11,
            Command::Lrw => 12,
            Command::Armw => 13,
            Command::Frmw => 14,
            Command::Unknown(octet) => octet,
        }
    }
}
