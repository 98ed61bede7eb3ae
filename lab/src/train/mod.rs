//! `waymark-lab train`: parameters learnt from labelled or rendered pictures, with their figures on
//! held-out pictures. Prints or writes parameters.

mod confidence;
mod confidence_fit;
mod cue_fit;
mod data;
mod held_out;
mod network_training;
mod platt_scaling;
mod provenance;
mod detector;
mod similarity;
mod source;

/// What to fit.
#[derive(Debug, clap::Subcommand)]
pub(crate) enum Command {
    /// The weights of the similarity of two segments, for the paper's grouping (`relaxation`).
    ///
    /// Pairs of segments on opposite sides of a labelled quad against all other candidate pairs, by
    /// logistic regression. The separation by the score is given for the present weights and for
    /// images held out from the fit. Sets should be labelled completely. For example:
    ///   waymark-lab train similarity museum-paintings corridor --out weights.json
    ///   waymark-lab evaluate detection museum-paintings --params weights.json --grouping relaxation
    #[command(verbatim_doc_comment)]
    Similarity(Box<similarity::SimilarityArgs>),
    /// The networks of the default detector: border model (which line) and quad classifier.
    ///
    /// The border model learns to choose, of the lines beside each side of a detected quad, the one
    /// on the labelled side. The classifier learns to separate quads on labelled objects from false
    /// ones, with probabilities calibrated on held-out images. Both learn from rendered scenes and
    /// from the given sets. Figures are of the networks in use and of the new ones: on photographs
    /// by networks from which their part was held out, on renderings of another seed by the final
    /// networks. The same sets and options give the same networks.
    ///
    /// For example:
    ///   waymark-lab train detector paintings corridor --weight museum-paintings=3 --out networks.json
    ///   waymark-lab evaluate detection corridor --seed 3 --compare networks.json
    #[command(verbatim_doc_comment)]
    Detector(Box<detector::DetectorArgs>),
    /// The weights of the confidence, from answers whose truth is known.
    ///
    /// Maps are taught and quads recognised as in `waymark-lab evaluate confidence`, which
    /// evaluates the calibration. Fit on the set `calibrate`, evaluate on `test`. The same options
    /// give the same weights. For example:
    ///   waymark-lab train confidence --set calibrate --rust weights.txt
    ///   waymark-lab evaluate confidence --set test --plot reliability.svg
    #[command(verbatim_doc_comment)]
    Confidence(Box<confidence::ConfidenceArgs>),
}

/// Runs one fit.
pub(crate) fn run(command: &Command) -> anyhow::Result<()> {
    match command {
        Command::Similarity(args) => similarity::run(args),
        Command::Detector(args) => detector::run(args),
        Command::Confidence(args) => confidence::run(args),
    }
}
