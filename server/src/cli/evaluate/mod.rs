//! `waymark evaluate`: the paper's experiments on labelled pictures. Tables for people, one JSON object for programs.

mod rendered;
pub(crate) mod truth;
pub(crate) mod detection;
pub(crate) mod recognition;

/// What to evaluate.
#[derive(Debug, clap::Subcommand)]
pub(crate) enum Command {
    /// Quads against labelled corners: recall at IoU 0.7 and 0.85, false quads, corner error, time.
    ///
    /// The folder is in the evaluation format, described in the folder docs.
    Detection(detection::Args),
    /// Teach a server from the set's pictures, then have it recognise the others over zenoh.
    ///
    /// Starts a server of its own in a temporary folder. A landmark taught from one picture is learnt from views
    /// generated from it (warped, dimmed, blurred).
    Recognition(recognition::Args),
}

/// Runs one evaluation.
pub(crate) fn run(command: &Command) -> anyhow::Result<()> {
    match command {
        Command::Detection(args) => detection::run(args),
        Command::Recognition(args) => recognition::run(args),
    }
}
