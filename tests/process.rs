//! What starts the program itself and looks at it from outside, in one program that is linked once.

mod common;
#[path = "common/toy_machine.rs"]
mod toy_machine;

mod bus_tool;
mod commands_on_another_bus;
mod configs;
mod day_page;
mod doctor;
mod endless;
mod external_components;
mod faults_on_demand;
mod full_disk;
#[cfg(feature = "panel")]
mod grbl;
mod init;
mod interpret;
mod io_channels;
mod jitter;
mod logic;
mod logic_online;
mod machine_page;
mod memory;
mod odd_files;
mod on_the_wire;
mod own_component;
#[cfg(feature = "panel")]
mod panel;
mod probing_cycles;
mod readme;
mod scope;
mod shown;
mod socket;
mod stand_by;
mod state_folder;
mod systemd;
mod threading;
mod tool_life;
mod top;
mod working_day;
