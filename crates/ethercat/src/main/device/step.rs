//! The steps of a device from its station address to OP, and those by which it is looked for again.

/// Where a device is on its way; those from [`Step::Clock`] on are in the order in which they are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::main) enum Step {
    /// Gets its station address by its position.
    Address,
    Features,
    Ports,
    /// Whether it has firmware.
    Pdi,
    EepromForce,
    EepromOwner,
    Eeprom,
    /// What it is is known; the network goes on with it.
    Identified,
    /// Nobody asks for it.
    Stranger,
    /// The network measures its clock.
    Clock,
    ToInit,
    ClearFmmus,
    ClearManagers,
    SyncOff,
    MailOut,
    MailIn,
    EepromLend,
    ToPreOp,
    /// Its shortest cycle is read; one that does not tell it is taken as quick.
    Quickest,
    StartValues,
    MapOutputs,
    MapInputs,
    /// What it says of itself is compared.
    Checks,
    Watchdog,
    ManagerOut,
    ManagerIn,
    FmmuOut,
    FmmuIn,
    Near,
    SyncCycle,
    SyncStart,
    SyncOn,
    ToSafeOp,
    Settle,
    ToOp,
    /// It is in OP.
    Run,
    /// It was in OP; where is it now?
    Look,
    /// It is left alone until the network tries it again.
    Away,
    /// Does it answer at its station address?
    Find,
    /// What is at its position?
    FindPosition,
    /// It shows an error, which is acknowledged before it is asked for anything.
    Acknowledge,
}

impl Step {
    /// The steps that follow each other.
    pub(super) const ORDER: [Step; 26] = [
        Step::Clock,
        Step::ToInit,
        Step::ClearFmmus,
        Step::ClearManagers,
        Step::SyncOff,
        Step::MailOut,
        Step::MailIn,
        Step::EepromLend,
        Step::ToPreOp,
        Step::Quickest,
        Step::StartValues,
        Step::MapOutputs,
        Step::MapInputs,
        Step::Checks,
        Step::Watchdog,
        Step::ManagerOut,
        Step::ManagerIn,
        Step::FmmuOut,
        Step::FmmuIn,
        Step::Near,
        Step::SyncCycle,
        Step::SyncStart,
        Step::SyncOn,
        Step::ToSafeOp,
        Step::Settle,
        Step::ToOp,
    ];

    /// Its datagrams are mails.
    pub(super) fn has_mails(self) -> bool {
        matches!(
            self,
            Step::Quickest | Step::StartValues | Step::MapOutputs | Step::MapInputs | Step::Checks | Step::Run
        )
    }
}
