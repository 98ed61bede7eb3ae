//! The `waymark` command line: one file per command. In: arguments, files, and a server over HTTP. Out: results on standard
//! output, everything else on standard error, and an exit status.

mod answers;
pub mod arg_parsers;
mod calibrate;
pub mod clock;
mod demo;
mod detect;
pub mod drawing;
mod gather;
pub mod mapping;
pub mod parameters;
pub mod simulated_errors;
pub mod pictures;
mod record;
mod recording;
pub mod scratch;
pub mod screen;
mod serve;
pub mod stopwatch;
mod visibility_settings;
pub mod survey;
mod teach;

use clap::{Parser, Subcommand};
use std::{io::IsTerminal as _, process::ExitCode};

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
    /// A server, a simulated corridor and robots that drive and are localised, all in this program.
    ///
    /// A first drive teaches the posters, then robots drive and send frames over zenoh. Watch it at the printed
    /// address. Ends with a summary; exit status 1 if there was a false match.
    Demo(demo::Args),
    Serve(serve::Serve),
    /// The quads of pictures; no server needed.
    ///
    /// Prints the corners of every quad, best first. With --draw, pictures show what each stage made of the image, and
    /// so where a quad was lost: no edges (lower --edge-steps), edges but no segments (lower --min-segment), segments
    /// but no quad proposal, or a proposal with a lower score than others (see the scores). A picture that cannot be read is one
    /// line on standard error and exit status 1; the others are still done.
    ///
    /// For example:
    ///   waymark detect hall.jpg --draw stages
    ///   waymark detect photographs/ --json --min-score 0.8 > quads.jsonl
    #[command(verbatim_doc_comment)]
    Detect(detect::Args),
    /// A camera's focal length, principal point and distortion from pictures of one flat object; no server needed.
    ///
    /// Five to ten pictures of one poster or board from different sides, each of which shows it as its largest quad; at
    /// least three of the sides must differ by more than 15 degrees. Pictures that do not fit the others are left out
    /// and named. For example:
    ///   waymark calibrate pictures/ --size 0.60x0.84
    ///   waymark calibrate --corners corners.json --size 1x1 --radial 0 --json
    #[command(verbatim_doc_comment)]
    Calibrate(calibrate::Args),
    /// Maps: of a running server, and of walls built from laser recordings or other programs' files.
    #[command(subcommand)]
    Map(teach::MapCommand),
    /// Make robots known to a running server.
    #[command(subcommand)]
    Robot(teach::RobotCommand),
    /// Teach a landmark to a running server from photographs.
    ///
    /// The server finds the one dominant quad in each photograph (or takes the whole picture), learns, and says
    /// whether the landmark is in use or which gate it failed.
    Learn(teach::LearnArgs),
    /// Let a robot gather views while it drives past, then accept or discard its tracks.
    ///
    /// For example:
    ///   waymark gather start --map office --robot r1
    ///   waymark gather stop --map office 1
    ///   waymark gather show --map office 1 --pictures candidates
    ///   waymark gather accept --map office 1 3=poster 5=fire-plan
    #[command(subcommand, verbatim_doc_comment)]
    Gather(gather::Command),
    /// Record a robot's drive and give its reference trajectory, so that the map learns which modality to trust where.
    ///
    /// For example:
    ///   waymark run start r1
    ///   waymark run learn r1 --path survey.tum
    ///   waymark run mode --map office fuse
    #[command(subcommand, verbatim_doc_comment)]
    Run(record::Command),
    /// Record what robots and the server send, as an MCAP file that Foxglove shows.
    ///
    /// Frames, odometry, scans, answers and poses, with the walls and landmarks of the robots' maps. For example:
    ///   waymark record drive.mcap
    ///   waymark record drive.mcap --robot r1 --seconds 60
    #[command(verbatim_doc_comment)]
    Record(recording::record::Args),
    /// Play a recording, or a bag of ROS 2, into a running server as a robot, and compare the answers.
    ///
    /// The robot must be registered, or --map given. Two builds or two versions of a map are compared by playing the same
    /// file into both. Exit status 1 if --compare finds a difference. For example:
    ///   waymark replay drive.mcap --compare
    ///   waymark replay drive.mcap --answers before.mcap
    ///   waymark replay drive.mcap --compare before.mcap --json
    ///   waymark replay bag/drive.mcap --robot r1 --map office --image front=/camera/image
    #[command(verbatim_doc_comment)]
    Replay(recording::replay::Args),
    /// Ask a running server what is in photographs.
    Recognise(teach::RecogniseArgs),
}

/// Runs the program.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    // A running server logs what it does; the other commands print results.
    let default =
        if matches!(cli.command, Command::Serve(_)) { "info,zenoh=warn" } else { "warn,zenoh=error" };
    start_log(cli.log.as_deref(), default);
    let done = match &cli.command {
        Command::Demo(args) => run(demo::run(args)),
        Command::Serve(serve) => run(serve.clone().run()).map(|()| ExitCode::SUCCESS),
        Command::Detect(args) => detect::run(args),
        Command::Calibrate(args) => calibrate::run(args).map(|()| ExitCode::SUCCESS),
        Command::Map(command) => run(teach::map(command)).map(|()| ExitCode::SUCCESS),
        Command::Robot(command) => run(teach::robot(command)).map(|()| ExitCode::SUCCESS),
        Command::Learn(args) => run(teach::learn(args)),
        Command::Gather(command) => run(gather::run(command)).map(|()| ExitCode::SUCCESS),
        Command::Run(command) => run(record::run(command)).map(|()| ExitCode::SUCCESS),
        Command::Record(args) => run(recording::record::run(args)).map(|()| ExitCode::SUCCESS),
        Command::Replay(args) => run(recording::replay::run(args)),
        Command::Recognise(args) => run(teach::recognise(args)),
    };
    match done {
        Ok(code) => code,
        Err(error) => {
            screen::complain(&format!("waymark: {error:#}"));
            ExitCode::FAILURE
        }
    }
}

fn run<T>(work: impl Future<Output = anyhow::Result<T>>) -> anyhow::Result<T> {
    tokio::runtime::Builder::new_multi_thread().enable_all().build()?.block_on(work)
}

/// Starts the log on standard error (standard output belongs to results), with `filter` or else with `default`.
pub fn start_log(filter: Option<&str>, default: &str) {
    let filter = tracing_subscriber::EnvFilter::builder().parse_lossy(filter.unwrap_or(default));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .init();
}
