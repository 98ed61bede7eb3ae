//! The `waymark` command line: one file per command.

mod serve;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Maps and landmarks for fleets of robots: teach the pictures and doors of a building once, and every robot that
/// sends camera frames learns where it is.
#[derive(Debug, Parser)]
#[command(name = "waymark", version, propagate_version = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// What to log, as in `info,server=debug`; default `info`.
    #[arg(long, global = true, env = "WAYMARK_LOG", value_name = "FILTER")]
    log: Option<String>,
}

#[derive(Debug, Subcommand)]
enum Command {
    Serve(serve::Serve),
}

/// Runs the program.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    start_log(cli.log.as_deref());
    let done = match cli.command {
        Command::Serve(serve) => run(serve.run()),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("waymark: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run<T>(work: impl Future<Output = anyhow::Result<T>>) -> anyhow::Result<T> {
    tokio::runtime::Builder::new_multi_thread().enable_all().build()?.block_on(work)
}

/// Logs go to stderr: stdout belongs to results.
fn start_log(filter: Option<&str>) {
    let filter = tracing_subscriber::EnvFilter::builder().parse_lossy(filter.unwrap_or("info,zenoh=warn"));
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).init();
}
