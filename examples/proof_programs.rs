//! Writes the programs by which the planner is judged to a folder: `cargo run --example proof_programs -- DIR [--small]`.
//! With `DIR --random SEED BLOCKS`, just the random program that a failing test has named.
//!
//! Prints one line a program: file name, tolerance in mm.

use anyhow::Context;
use proof_programs::{CASES, Random, Size};
use std::path::PathBuf;

#[path = "../tests/proof_programs/mod.rs"]
mod proof_programs;

/// Programs by chance that are written beside the others, by their seeds.
const SEEDS: [u64; 4] = [1, 2, 3, 4];

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let folder = PathBuf::from(arguments.next().context("expected a folder for the programs")?);
    let size = match arguments.next().as_deref() {
        None => Size::Full,
        Some("--small") => Size::Small,
        Some("--random") => {
            let mut number = |what| arguments.next().context(what)?.parse().context(what);
            let (seed, blocks): (u64, u64) = (number("seed")?, number("number of blocks")?);
            let file = folder.join(format!("random_{seed}.ngc"));
            std::fs::create_dir_all(&folder)?;
            std::fs::write(&file, Random(seed).program(blocks as usize))?;
            println!("{}", file.display());
            return Ok(());
        }
        Some(other) => anyhow::bail!("{other}: expected --small, --random SEED BLOCKS or nothing"),
    };
    std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
    let write = |name: &str, text: String, tolerance_mm: f64| -> anyhow::Result<()> {
        let file = folder.join(format!("{name}.ngc"));
        std::fs::write(&file, text).with_context(|| file.display().to_string())?;
        println!("{name}.ngc {tolerance_mm:e}");
        Ok(())
    };
    for case in CASES {
        write(case.name, case.text(size), case.mode.tolerance_mm())?;
    }
    for seed in SEEDS {
        let blocks = if size == Size::Small { 60 } else { 2000 };
        let tolerance_mm = proof_programs::Mode::BlendCoarse.tolerance_mm();
        write(&format!("random_{seed}"), Random(seed).program(blocks), tolerance_mm)?;
    }
    Ok(())
}
