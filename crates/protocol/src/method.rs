//! The methods: name, parameters, answer. What each does, and who may ask for it, says the control (`crates/api/src/methods/table.rs`).

use crate::{answers, params};
use schemars::JsonSchema;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// A method of the control socket.
pub trait Method {
    /// Its name on the wire.
    const NAME: &'static str;
    /// What it takes.
    type Params: Serialize + DeserializeOwned + JsonSchema + 'static;
    /// What it answers.
    type Answer: Serialize + DeserializeOwned + JsonSchema + 'static;
}

macro_rules! methods {
    ($($marker:ident $name:literal ($params:ident) -> $answer:ty;)*) => {
        $(
            #[doc = concat!("`", $name, "`")]
            #[derive(Debug)]
            pub enum $marker {}

            impl Method for $marker {
                const NAME: &'static str = $name;
                type Params = params::$params;
                type Answer = $answer;
            }
        )*
    };
}

methods! {
    Methods "methods" (NoParams) -> answers::Methods;
    Discover "rpc.discover" (NoParams) -> answers::OpenRpc;
    Identify "client.identify" (Identify) -> answers::Identified;
    Status "status" (NoParams) -> answers::Status;
    Subscribe "subscribe" (Subscribe) -> answers::Subscribed;
    Unsubscribe "unsubscribe" (NoParams) -> answers::Nothing;
    TakeControl "control.take" (TakeControl) -> Option<answers::Control>;
    ReleaseControl "control.release" (NoParams) -> answers::Nothing;
    Ping "ping" (NoParams) -> answers::Nothing;
    Describe "machine.describe" (NoParams) -> answers::Described;
    Metrics "metrics" (NoParams) -> answers::Metrics;
    Network "bus.network" (NoParams) -> answers::Network;
    SdoRead "bus.sdo_read" (SdoRead) -> answers::Octets;
    SdoWrite "bus.sdo_write" (SdoWrite) -> answers::Nothing;
    SimFault "sim.fault" (SimFault) -> answers::Nothing;
    On "on" (NoParams) -> answers::Nothing;
    Off "off" (NoParams) -> answers::Nothing;
    Estop "estop" (NoParams) -> answers::Nothing;
    EstopReset "estop.reset" (NoParams) -> answers::Nothing;
    Home "home" (Home) -> answers::Nothing;
    UploadBegin "program.upload.begin" (UploadBegin) -> answers::UploadBegun;
    UploadAppend "program.upload.append" (UploadAppend) -> answers::UploadGrown;
    UploadCommit "program.upload.commit" (UploadCommit) -> answers::Nothing;
    ProgramLoad "program.load" (Program) -> answers::Outlook;
    ProgramStart "program.start" (ProgramStart) -> answers::Outlook;
    ProgramCheck "program.check" (Program) -> answers::Outlook;
    ProgramRun "program.run" (Program) -> answers::Outlook;
    ProgramReport "program.report" (ProgramReport) -> answers::Report;
    ProgramText "program.text" (ProgramText) -> answers::Text;
    PathBegin "program.path.begin" (PathBegin) -> answers::PathBegun;
    PathNext "program.path.next" (PathNext) -> answers::PathPart;
    PathEnd "program.path.end" (NoParams) -> answers::Nothing;
    PinList "hal.list" (PinList) -> answers::Pins;
    ScopeBegin "scope.begin" (ScopeBegin) -> answers::ScopeBegun;
    ScopeNext "scope.next" (ScopeOf) -> answers::ScopePart;
    ScopeEnd "scope.end" (ScopeOf) -> answers::Nothing;
    Mdi "mdi" (Mdi) -> answers::Outlook;
    MdiStream "mdi.stream" (MdiStream) -> answers::Nothing;
    MdiHistory "mdi.history" (NoParams) -> answers::Lines;
    TouchOff "touch_off" (TouchOff) -> answers::Kept;
    OffsetList "offset.list" (NoParams) -> answers::Offsets;
    OffsetSet "offset.set" (OffsetSet) -> answers::Kept;
    ToolList "tool.list" (NoParams) -> answers::Tools;
    ToolSet "tool.set" (ToolSet) -> answers::Kept;
    ToolDelete "tool.delete" (ToolDelete) -> answers::Kept;
    ToolChanged "tool.changed" (NoParams) -> answers::Nothing;
    Jog "jog" (Jog) -> answers::JogOutlook;
    JogKeep "jog.keep" (Jogging) -> answers::JogOutlook;
    JogStop "jog.stop" (Jogging) -> answers::JogOutlook;
    Spindle "spindle" (Spindle) -> answers::Nothing;
    Coolant "coolant" (Coolant) -> answers::Nothing;
    Hold "hold" (NoParams) -> answers::Nothing;
    Resume "resume" (NoParams) -> answers::Resumed;
    Skip "skip" (NoParams) -> answers::Skipped;
    Reverse "reverse" (Reverse) -> answers::Nothing;
    SingleBlock "single_block" (Switch) -> answers::Nothing;
    OptionalStop "optional_stop" (Switch) -> answers::Nothing;
    BlockDelete "block_delete" (Switch) -> answers::Nothing;
    Stop "stop" (NoParams) -> answers::Nothing;
    Override "override" (Override) -> answers::Overrides;
    JournalSince "journal.since" (JournalSince) -> answers::Journal;
    PartsSet "parts.set" (PartsSet) -> answers::Kept;
    Acknowledge "alarm.acknowledge" (NoParams) -> answers::Nothing;
    LogicList "logic.list" (NoParams) -> answers::LogicTasks;
    LogicLook "logic.look" (LogicLook) -> answers::LogicVariables;
    LogicForce "logic.force" (LogicForce) -> answers::LogicForced;
    LogicRelease "logic.release" (LogicRelease) -> answers::LogicReleased;
    LogicReload "logic.reload" (LogicReload) -> answers::LogicReloaded;
    MachineFile "machine.file" (NoParams) -> answers::MachineFile;
    MachineCheck "machine.check" (MachineCheck) -> answers::Errors;
    MachineWrite "machine.write" (MachineWrite) -> answers::FileWritten;
    MachineDoctor "machine.doctor" (NoParams) -> answers::Doctor;
    PinValues "hal.values" (PinValues) -> answers::Pins;
    PinSet "hal.set" (PinSet) -> answers::Nothing;
    ButtonPress "button.press" (ButtonPress) -> answers::Pressed;
    JobKinds "job.kinds" (NoParams) -> answers::JobKinds;
    JobMake "job.make" (JobMake) -> answers::Job;
    CycleTimes "cycle.times" (NoParams) -> answers::Times;
}
