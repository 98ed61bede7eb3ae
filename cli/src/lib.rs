//! The `waymark` command line: one file per command. In: arguments, files, and a server over HTTP.
//! Out: results on standard output, everything else on standard error, and an exit status.

mod answers;
mod anywhere;
pub mod arg_parsers;
mod audit;
mod backup;
mod camera;
mod camera_arg;
pub mod clock;
mod demo;
mod detect;
pub mod drawing;
mod explain;
mod failure;
pub mod first_drive;
mod gathering;
mod history;
mod identity;
mod job;
mod landmark;
mod learning_settings;
pub mod map;
mod names;
mod notify;
pub mod parameters;
pub mod pictures;
mod recognise;
mod recording;
mod restore;
mod robot;
mod run;
mod sample;
pub mod scratch;
pub mod screen;
mod serve;
mod serve_panic;
mod server_status;
mod session;
mod shell;
pub mod simulated_errors;
mod site;
pub mod stopwatch;
pub mod survey;
mod traces;
mod validity;
mod view;

use clap::{CommandFactory as _, Parser, Subcommand};
use failure::{EXIT_STATUSES, Failure};
use std::{process::ExitCode, time::Duration};
use traces::Traces;
use tracing_subscriber::{EnvFilter, Layer as _, layer::SubscriberExt as _, util::SubscriberInitExt as _};

/// Maps and landmarks for fleets of robots: teach the pictures and doors of a building once, and
/// every robot that sends camera frames learns where it is.
#[derive(Debug, Parser)]
#[command(name = "waymark", version, propagate_version = true, after_help = EXIT_STATUSES)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// What to log, as in `info,server=debug`; default `info`.
    #[arg(long, global = true, env = "WAYMARK_LOG", value_name = "FILTER")]
    log: Option<String>,
    /// How to log: lines for people, or an object of JSON a line.
    #[arg(
        long,
        global = true,
        env = "WAYMARK_LOG_FORMAT",
        value_enum,
        default_value = "text",
        value_name = "FORMAT"
    )]
    log_format: LogFormat,
}

/// How the log is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum LogFormat {
    /// Lines for people.
    Text,
    /// An object a line: `timestamp`, `level`, `target`, `fields` with the event as `message`, and
    /// the `span` of a request or a frame.
    Json,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// A server, a simulated corridor and robots that drive and are localised, all in this program.
    ///
    /// A first drive teaches the posters, then robots drive and send frames over zenoh. Watch it at
    /// the printed address. Ends with a summary; exit status 1 if there was a false match.
    Demo(demo::Args),
    /// Write the files that the guides name: photographs of an office, a laser log, floor plans
    ///
    /// With them the guides can be followed without a poster, a camera or a robot. For example:
    ///   waymark sample office
    #[command(verbatim_doc_comment)]
    Sample(sample::Args),
    Serve(serve::Serve),
    /// Whether a server does its work: status.
    Server(server_status::Args),
    /// Who may do what on a server: create, list, revoke tokens.
    Token(identity::token::Args),
    /// Keep a token for a server: that of --token, or the first line of standard input
    ///
    /// On the server's own machine nobody needs one. For example:
    ///   waymark login < kim.token
    #[command(verbatim_doc_comment)]
    Login(identity::login::Args),
    /// Forget the token of a server.
    Logout(identity::login::Args),
    /// A link that opens the page once, with your rights, within ten minutes.
    Open(identity::open::Args),
    /// Who changed what on a server: list, verify.
    Audit(audit::Args),
    /// Write the whole state of a running server to one file
    ///
    /// Maps, pictures, models, robots and jobs, as they were at one moment; the server goes on
    /// meanwhile. The file is verified before it gets its name. For example:
    ///   waymark backup office.waymark
    #[command(verbatim_doc_comment)]
    Backup(backup::Args),
    /// Put a backup in the place of the data of a stopped server
    ///
    /// The backup is verified first: digests, integrity, schema. What was there stays in a folder
    /// beside it. For example:
    ///   waymark restore office.waymark --dry-run
    ///   waymark restore office.waymark --data /var/lib/waymark
    #[command(verbatim_doc_comment)]
    Restore(restore::Args),
    /// Maps: create, list, show, locate, delete; walls from laser logs, grids and plans.
    Map(map::Args),
    /// Sites: places and passages of their maps, routes.
    Site(site::Args),
    /// Landmarks: teach, list, show, place, size, rename, delete, accept.
    Landmark(landmark::Args),
    /// Changes of a map: list, diff; the way back: rollback, undo; drafts: draft, publish
    ///
    /// Every change of a map is a commit. For example:
    ///   waymark history list
    ///   waymark history diff 12
    ///   waymark history rollback 12 --why "wrong poster"
    #[command(verbatim_doc_comment)]
    History(history::Args),
    /// Training views of a landmark: list, show, image, delete.
    View(view::Args),
    /// Robots that may send frames: add, list, show, remove.
    Robot(robot::Args),
    /// Cameras of robots: list, last frame; and calibration from pictures.
    Camera(camera::Args),
    /// Let a robot gather training views while it drives past
    ///
    /// For example:
    ///   waymark gathering start r1 --map office
    ///   waymark gathering stop 1
    ///   waymark gathering show 1 --pictures tracks
    ///   waymark landmark accept 1 3=poster 5=fire-plan
    #[command(verbatim_doc_comment)]
    Gathering(gathering::Args),
    /// Record a robot's run beside a reference: the map learns which modality to trust where
    ///
    /// For example:
    ///   waymark run start r1
    ///   waymark run learn r1 survey.tum
    ///   waymark map fusion office best
    #[command(verbatim_doc_comment)]
    Run(run::Args),
    /// Record what robots and the server send, as an MCAP file that Foxglove shows.
    ///
    /// Frames, odometry, scans, answers and poses, with the walls and landmarks of the robots'
    /// maps. For example:
    ///   waymark record drive.mcap
    ///   waymark record drive.mcap --robot r1 --seconds 60
    #[command(verbatim_doc_comment)]
    Record(recording::record::Args),
    /// Play a recording or a bag of ROS 2 into a server as a robot, and compare the answers.
    ///
    /// The robot must be registered, or --map given. Two builds or two versions of a map are
    /// compared by playing the same file into both. Exit status 1 if --compare finds a difference.
    /// For example:
    ///   waymark replay drive.mcap --compare
    ///   waymark replay drive.mcap --answers before.mcap
    ///   waymark replay drive.mcap --compare before.mcap --json
    ///   waymark replay bag/drive.mcap --robot r1 --map office --image front=/camera/image
    #[command(verbatim_doc_comment)]
    Replay(recording::replay::Args),
    /// The map of a building from one drive: walls, landmarks with places, and the camera
    ///
    /// Reads a recording with scans, odometry and frames. Nobody measures and nobody clicks: quads
    /// that lie on walls and are seen again become landmarks. For example:
    ///   waymark record drive.mcap --robot r1
    ///   waymark survey drive.mcap
    ///   waymark survey drive.mcap --into office
    #[command(verbatim_doc_comment)]
    Survey(survey::Args),
    /// Jobs of a server: show, wait, cancel.
    Job(job::Args),
    /// What a server recognises in photographs
    ///
    /// For example:
    ///   waymark recognise hall1.jpg hall2.jpg --map office
    #[command(verbatim_doc_comment)]
    Recognise(recognise::Args),
    /// The quads of pictures; no server needed
    ///
    /// Prints the corners of every quad, best first. With --draw, pictures show what each stage
    /// made of the image, and so where a quad was lost: no edges (lower --edge-steps), edges but no
    /// segments (lower --min-segment), segments but no quad proposal, or a proposal with a lower
    /// score than others (see the scores). A picture that cannot be read is one line on standard
    /// error and exit status 1; the others are still done.
    ///
    /// For example:
    ///   waymark detect hall.jpg --draw stages
    ///   waymark detect photographs/ --json --min-score 0.8 > quads.jsonl
    #[command(verbatim_doc_comment)]
    Detect(detect::Args),
    /// Completions for a shell, on standard output
    ///
    /// For example:
    ///   waymark completions bash > waymark.bash
    #[command(verbatim_doc_comment)]
    Completions(shell::CompletionArgs),
    /// The version of this program, and what it was built for.
    Version,
    /// Manual pages, into a folder
    ///
    /// For example:
    ///   waymark man /usr/local/share/man/man1
    #[command(verbatim_doc_comment)]
    Man(shell::ManArgs),
}

/// Longest wait for work that blocks a thread when a command is done.
const RUNTIME_ENDS: Duration = Duration::from_secs(1);

/// Runs the program.
pub fn main() -> ExitCode {
    let cli = match Cli::try_parse_from(anywhere::behind_the_command(std::env::args_os())) {
        Ok(cli) => cli,
        Err(error) if error.use_stderr() && wants_json() => return report(&wrong_use(&error)),
        Err(error) => error.exit(),
    };
    // A running server logs what it does; the other commands print results.
    let default =
        if matches!(cli.command, Command::Serve(_)) { "info,zenoh=warn" } else { "warn,zenoh=error" };
    let traces = match &cli.command {
        Command::Serve(_) | Command::Demo(_) => match Traces::from_environment() {
            Ok(traces) => traces,
            Err(failure) => return report(&failure),
        },
        _ => None,
    };
    start_log_and(cli.log.as_deref(), default, cli.log_format, traces.as_ref());
    let done = |()| ExitCode::SUCCESS;
    let result = match &cli.command {
        Command::Demo(args) => run(demo::run(args)),
        Command::Sample(args) => sample::run(args).map(done),
        Command::Serve(serve) => run(serve.clone().run()).map(done),
        Command::Server(args) => run(server_status::run(args)).map(done),
        Command::Token(args) => run(identity::token::run(args)).map(done),
        Command::Login(args) => run(identity::login::login(args)).map(done),
        Command::Logout(args) => identity::login::logout(args).map(done),
        Command::Open(args) => run(identity::open::run(args)).map(done),
        Command::Audit(args) => run(audit::run(args)).map(done),
        Command::Backup(args) => run(backup::run(args)).map(done),
        Command::Restore(args) => run(restore::run(args)).map(done),
        Command::Map(args) => run(map::run(args)).map(done),
        Command::Site(args) => run(site::run(args)).map(done),
        Command::Landmark(args) => run(landmark::run(args)).map(done),
        Command::History(args) => run(history::run(args)).map(done),
        Command::View(args) => run(view::run(args)).map(done),
        Command::Robot(args) => run(robot::run(args)).map(done),
        Command::Camera(args) => run(camera::run(args)).map(done),
        Command::Gathering(args) => run(gathering::run(args)).map(done),
        Command::Run(args) => run(run::run(args)).map(done),
        Command::Record(args) => run(recording::record::run(args)).map(done),
        Command::Replay(args) => run(recording::replay::run(args)),
        Command::Survey(args) => run(survey::run(args)).map(done),
        Command::Job(args) => run(job::run(args)).map(done),
        Command::Recognise(args) => run(recognise::run(args)).map(done),
        Command::Detect(args) => detect::run(args),
        Command::Completions(args) => {
            shell::completions(args, Cli::command());
            Ok(ExitCode::SUCCESS)
        }
        Command::Version => {
            let (version, system) = (env!("CARGO_PKG_VERSION"), std::env::consts::OS);
            screen::say(&format!("waymark {version} ({system} {})", std::env::consts::ARCH));
            Ok(ExitCode::SUCCESS)
        }
        Command::Man(args) => shell::man(args, Cli::command()).map(done),
    };
    result.unwrap_or_else(|error| report(&Failure::of(&error)))
}

/// Reports a failure on standard error: as JSON where results are JSON.
fn report(failure: &Failure) -> ExitCode {
    if wants_json() {
        screen::complain(&failure.to_json().to_string());
    } else {
        screen::complain(&format!("waymark: {failure}"));
    }
    failure.class.exit_code()
}

/// Also known before the command line is parsed, and where it cannot be.
fn wants_json() -> bool {
    std::env::args_os().any(|arg| arg == "--json")
}

/// What clap says of a wrong command line, as a failure: its first line without the label.
fn wrong_use(error: &clap::Error) -> Failure {
    let text = error.to_string();
    let mut lines = text.lines().filter(|line| !line.trim().is_empty());
    let first = lines.next().unwrap_or_default();
    let mut sentence = first.strip_prefix("error: ").unwrap_or(first).to_owned();
    let mut lines = lines.map(str::trim).peekable();
    // What is missing is listed below the sentence.
    while sentence.ends_with([':', ','])
        && let Some(named) = lines.next_if(|line| !line.starts_with("Usage"))
    {
        sentence = format!("{sentence} {named}");
        if lines.peek().is_some_and(|next| next.starts_with(['<', '-'])) {
            sentence.push(',');
        }
    }
    Failure::usage(sentence).advise(lines.collect::<Vec<_>>().join("\n"))
}

fn run<T>(work: impl Future<Output = anyhow::Result<T>>) -> anyhow::Result<T> {
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    let done = runtime.block_on(work);
    // A part of a server that has stalled does not end: the program ends all the same.
    runtime.shutdown_timeout(RUNTIME_ENDS);
    done
}

/// Starts the log on standard error (standard output belongs to results), with `filter` or else
/// with `default`.
pub fn start_log(filter: Option<&str>, default: &str, format: LogFormat) {
    start_log_and(filter, default, format, None);
}

/// The same, with traces.
fn start_log_and(filter: Option<&str>, default: &str, format: LogFormat, traces: Option<&Traces>) {
    let filter = EnvFilter::builder().parse_lossy(filter.unwrap_or(default));
    let log = tracing_subscriber::fmt::layer().with_writer(std::io::stderr);
    let log = match format {
        LogFormat::Text => log.with_ansi(screen::has_colour(&std::io::stderr())).boxed(),
        LogFormat::Json => log.json().with_span_list(false).boxed(),
    };
    match traces {
        Some(traces) => {
            let log = log.with_filter(filter);
            tracing_subscriber::registry().with(log).with(traces.layer()).init();
        }
        // One filter before everything costs less than one of each layer.
        None => tracing_subscriber::registry().with(log).with(filter).init(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_definition_of_the_command_line_holds() {
        Cli::command().debug_assert();
    }

    #[test]
    fn a_wrong_command_line_is_a_failure_of_use() {
        let error = Cli::try_parse_from(["waymark", "landmark", "sho"]).unwrap_err();
        let failure = wrong_use(&error);
        assert!(failure.sentence.contains("'sho'") && failure.advice.contains("show"), "{failure:?}");
        assert_eq!(failure.to_json()["error"]["exit_status"], 2);
        let missing = wrong_use(&Cli::try_parse_from(["waymark", "robot", "add"]).unwrap_err());
        assert!(
            missing.sentence.ends_with(": --map <MAP>, <ROBOT>") && missing.advice.starts_with("Usage"),
            "{missing:?}"
        );
    }
}
