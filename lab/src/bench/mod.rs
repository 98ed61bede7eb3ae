//! `waymark-lab bench`: speed on this machine. It asserts nothing; the figures go to
//! docs/BENCHMARKS.md.

mod pipeline;
mod frames;
mod peers;
pub(crate) use peers::Python;
mod detect;
mod edits;
mod encrypted;
mod load;
mod recognise;

/// `waymark-lab bench`.
#[derive(Debug, clap::Args)]
#[command(args_conflicts_with_subcommands = true)]
pub(crate) struct Args {
    #[command(subcommand)]
    what: Option<What>,
    #[command(flatten)]
    pipeline: pipeline::PipelineArgs,
}

/// What to time other than the whole pipeline.
#[derive(Debug, clap::Subcommand)]
enum What {
    /// From frame to segments and to quads, one core, 640 x 480, beside OpenCV's segment and marker
    /// detectors.
    ///
    /// Waymark and OpenCV (through python3, one thread) process every picture in turn, once to warm
    /// up and once timed, in several rounds. Times are processor time, so other work on the machine
    /// matters little; ratios are of one run. Without OpenCV only Waymark's times are printed.
    Detect(detect::Args),
    /// From quad to verdict among many landmarks, whole frames beside OpenCV's SIFT, memory, the
    /// short list, and a lesson.
    ///
    /// Posters are drawn by the simulator. The first are taught as a server teaches them, from
    /// generated views; the others have icons and points of their own and the thresholds of the
    /// first. Frames are rendered in a corridor whose posters are among the landmarks; each is
    /// recognised globally, and guided by a known pose. SIFT (through python3, one thread, one
    /// index over 1000 landmarks, votes, a homography by RANSAC) gets the same pictures. Times are
    /// processor time.
    Recognise(recognise::Args),
    /// One change of a large map over HTTP: a landmark moved or quarantined, a lesson; and many
    /// landmarks made.
    ///
    /// A server in this program is taught a map of posters (one in twenty of them twice) with many
    /// wall segments; then single landmarks are changed and taught again, while a robot's frames
    /// are answered. Times are of the clock, until the server has acknowledged the change.
    Edits(edits::Args),
    /// A frame and its answer beside an echo of zenoh, and a GET beside a bare handler of axum, all
    /// over TLS.
    ///
    /// Server, robot and peers run in this program with certificates of one authority. Each frame
    /// is sent in turn with an echo of the same bytes; times are of the clock, from send to answer.
    /// The client of HTTP shares the cores.
    Encrypted(encrypted::Args),
    /// A server under the load of many robots, in a process of its own, while it learns.
    ///
    /// `waymark serve` is started with encryption and taught a corridor; a second process plays the
    /// robots, each with a certificate, and sends rendered frames at intended times. A second map
    /// is learnt all the time. With `--factor 5` half of the robots send so much that all together
    /// send five times as much as usual.
    Load(load::Args),
    /// Plays the robots of `load`.
    #[command(name = load::GENERATOR, hide = true)]
    LoadGenerator(load::GeneratorArgs),
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    match &args.what {
        None => pipeline::run(&args.pipeline),
        Some(What::Detect(args)) => detect::run(args),
        Some(What::Recognise(args)) => recognise::run(args),
        Some(What::Edits(args)) => edits::run(args),
        Some(What::Encrypted(args)) => encrypted::run(args),
        Some(What::Load(args)) => load::run(args),
        Some(What::LoadGenerator(args)) => load::generate(args),
    }
}
