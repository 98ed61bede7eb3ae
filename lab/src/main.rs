//! The `waymark-lab` command line: evaluation, benchmarks and training of Waymark.
//!
//! Not part of the product: `server` does not depend on this crate.

mod bench;
mod evaluate;
mod plot;
mod reproduce;
mod train;

use clap::{Parser, Subcommand};
use cli::screen;
use std::process::ExitCode;

/// That of the product.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Experiments on labelled pictures and in simulated buildings, benchmarks beside peers, and
/// training.
#[derive(Debug, Parser)]
#[command(name = "waymark-lab", version, propagate_version = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// What to log, as in `info,server=debug`; default `warn`.
    #[arg(long, global = true, env = "WAYMARK_LOG", value_name = "FILTER")]
    log: Option<String>,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// The paper's experiments on labelled pictures: tables for people, JSON for programs.
    #[command(subcommand)]
    Evaluate(evaluate::Command),
    /// Time of each stage of the pipeline on this machine.
    ///
    /// Without a subcommand: a whole frame, recognition and poses included, on rendered frames of a
    /// corridor. `waymark-lab bench detect`: from frame to quads beside OpenCV on the same
    /// pictures.
    Bench(bench::Args),
    /// Fit parameters of detector and confidence to labelled or rendered pictures.
    #[command(subcommand)]
    Train(train::Command),
    /// A picture of a stage of recognition, drawn from what the program itself works out there.
    ///
    /// Without an option: the picture of its page in docs/method, the same bytes on every machine.
    /// The stages of the detector are drawn by `waymark detect --draw`. For example, with a picture
    /// of your own on the wall:
    ///   waymark-lab plot icon --image painting.jpg --out icon.png
    #[command(verbatim_doc_comment)]
    Plot(plot::Args),
    /// Every figure of accuracy, measured again by both presets, as one table.
    ///
    /// Runs the paper's experiments E1 to E14, the sets made by others (S) where they are, and what
    /// goes beyond the paper (B), each by the command that is printed beside its figures. Takes at
    /// most two hours on two idle cores; what an interrupted run has done is kept. For example:
    ///   waymark-lab reproduce --quick --out smoke
    ///   waymark-lab reproduce --only E1,E5 --preset paper
    ///   waymark-lab reproduce && waymark-lab reproduce --render reproduced/figures.json
    #[command(verbatim_doc_comment)]
    Reproduce(reproduce::Args),
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    cli::start_log(cli.log.as_deref(), "warn,zenoh=error", cli::LogFormat::Text);
    let done = match &cli.command {
        Command::Evaluate(command) => evaluate::run(command),
        Command::Bench(args) => bench::run(args),
        Command::Train(command) => train::run(command),
        Command::Plot(args) => plot::run(args),
        Command::Reproduce(args) => reproduce::run(args),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            screen::complain(&format!("waymark-lab: {error:#}"));
            ExitCode::FAILURE
        }
    }
}
