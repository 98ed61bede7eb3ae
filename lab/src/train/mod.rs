//! `waymark-lab train`: parameters that are learnt from labelled pictures or rendered ones, each with what it is worth on
//! pictures that were held out. Prints parameters; changes nothing.

mod confidence;
mod confidence_fit;
mod cue_fit;
mod data;
mod held_out;
mod network_training;
mod platt_scaling;
mod provenance;
mod search;
mod similarity;
mod source;

/// What to fit.
#[derive(Debug, clap::Subcommand)]
pub(crate) enum Command {
    /// The weights of the similarity of two segments, for the paper's grouping (`relaxation`).
    ///
    /// Pairs of segments on opposite sides of a labelled quad against all other candidate pairs, by logistic regression.
    /// How well the score tells them apart is given for the present weights and for images held out from the fit. Sets
    /// should be labelled completely. For example:
    ///   waymark-lab train similarity museum-paintings corridor --out weights.json
    ///   waymark-lab evaluate detection museum-paintings --params weights.json --grouping relaxation
    #[command(verbatim_doc_comment)]
    Similarity(Box<similarity::SimilarityArgs>),
    /// The two networks of the search: which line beside a side is its border, and whether a quad is a thing at all.
    ///
    /// The first learns to choose, of the lines beside each side of a found quad, the one on the labelled side; the
    /// second to tell quads on labelled things from false ones, with odds that are right on images held out. They learn
    /// from rendered scenes and from the given sets. Results are of the networks in use and of new ones; those on
    /// photographs are of networks that have not seen the half that they are judged by, those on renderings of another
    /// seed. The same sets and options give the same networks.
    ///
    /// For example:
    ///   waymark-lab train search paintings corridor --weight museum-paintings=3 --out networks.json
    ///   waymark-lab evaluate detection corridor --seed 3 --compare networks.json
    #[command(verbatim_doc_comment)]
    Search(Box<search::SearchArgs>),
    /// The weights of the confidence: the chance that an identity is right, from answers whose truth is known.
    ///
    /// Maps are taught and quads looked at as in `waymark-lab evaluate confidence`, which says how well the confidence keeps
    /// its word; fit on the set `calibrate`, judge on `test`. The same options give the same weights. For example:
    ///   waymark-lab train confidence --set calibrate --rust weights.txt
    ///   waymark-lab evaluate confidence --set test --plot reliability.svg
    #[command(verbatim_doc_comment)]
    Confidence(Box<confidence::ConfidenceArgs>),
}

/// Runs one fit.
pub(crate) fn run(command: &Command) -> anyhow::Result<()> {
    match command {
        Command::Similarity(args) => similarity::run(args),
        Command::Search(args) => search::run(args),
        Command::Confidence(args) => confidence::run(args),
    }
}
