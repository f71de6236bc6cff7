//! What runs on virtual time: machines, buses, programs and plans within this process, in one program that is linked once.

#[path = "common/counting.rs"]
mod counting;
mod proof_programs;
#[path = "common/segment_wire.rs"]
mod segment_wire;
#[path = "common/toy_machine.rs"]
mod toy_machine;

mod another_bus;
mod back_and_forth;
mod both_buses;
mod drive_profiles;
mod drives;
mod ethercat_bus;
mod fuzz_corpus;
mod hal_components;
mod homing;
mod input_output;
mod jobs;
mod logic_machine;
mod modules_at_start;
mod no_allocation;
mod overrides;
mod plan_proof;
mod probing;
mod program_codes;
mod programs;
mod progress;
mod safety;
mod seams;
mod spindle_drives;
mod terminals;
mod tool_centre_point;
mod wheels;
#[path = "whole_path/main.rs"]
mod whole_path;

// By this name the fuzzers know it.
use fuzz_corpus::program_grammar;
