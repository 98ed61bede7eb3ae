//! `waymark evaluate`: the paper's experiments on labelled pictures. Tables for people, one JSON object for programs.

pub(crate) mod rendered;
pub(crate) mod reviewed;
pub(crate) mod statistics;
pub(crate) mod truth;
pub(crate) mod detection;
pub(crate) mod recognition;

/// What to evaluate.
#[derive(Debug, clap::Subcommand)]
pub(crate) enum Command {
    /// Quads against labelled corners: recall at IoU 0.7 and 0.85, false quads, corner error, time.
    ///
    /// A set is a folder in the evaluation format (docs/EVALUATION.md), or `corridor` or `scenes`: rendered pictures with
    /// exact truth, for which no data is needed. Figures come with 95 % confidence intervals, for all quads and by class, stratum,
    /// size and angle of view.
    ///
    /// For example, what the search gains over the paper's grouping, and where it fails:
    ///   waymark evaluate detection corridor --compare relaxation --plot recall.svg --worst 20 --draw worst
    #[command(verbatim_doc_comment)]
    Detection(Box<detection::Args>),
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
