//! `waymark fit`: parameters of the detector that are learnt from labelled pictures, each with what it is worth on
//! pictures that were held out. Prints parameters; changes nothing.

mod similarity;

/// What to fit.
#[derive(Debug, clap::Subcommand)]
pub(crate) enum Command {
    /// The weights of the similarity of two segments, for the paper's grouping (`relaxation`).
    ///
    /// Pairs of segments on opposite sides of a labelled quad against all other candidate pairs, by logistic regression.
    /// How well the score tells them apart is given for the present weights and for images held out from the fit. Sets
    /// should be labelled completely. For example:
    ///   waymark fit similarity museum-paintings corridor --out weights.json
    ///   waymark evaluate detection museum-paintings --params weights.json --grouping relaxation
    #[command(verbatim_doc_comment)]
    Similarity(Box<similarity::SimilarityArgs>),
}

/// Runs one fit.
pub(crate) fn run(command: &Command) -> anyhow::Result<()> {
    match command {
        Command::Similarity(args) => similarity::run(args),
    }
}
