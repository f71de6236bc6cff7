//! `isocnc simulate`: the simulated machine as controlled nodes on an interface.

use crate::config;
use crate::rt::setup;
use crate::service::analyser;
use crate::sim::{SimMachine, serve};
use anyhow::Context;
use clap::Args;
use powerlink::link::raw::RawLink;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Arguments of `simulate`.
#[derive(Debug, Args)]
pub struct SimulateArgs {
    /// Machine file.
    machine: PathBuf,
    /// Network interface on which the managing node is.
    #[arg(long)]
    interface: String,
    /// Measure the SoC period at this end from kernel receive stamps and write it to this file at the end.
    #[arg(long, value_name = "FILE")]
    analyse: Option<PathBuf>,
    /// Record every frame to this file (pcap with nanoseconds).
    #[arg(long, value_name = "FILE")]
    capture: Option<PathBuf>,
    /// End when the process that started this one does.
    #[arg(long, hide = true)]
    with_parent: bool,
}
