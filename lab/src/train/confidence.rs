//! `waymark-lab train confidence`: fits the weights of the confidence to answers whose truth is
//! known: those of `waymark-lab evaluate confidence`, on another set. Answers in, a source file
//! out.

use super::confidence_fit::{Answer, fit};
use super::provenance::Provenance;
use crate::evaluate::experiment::{
    Common,
    answers::{Answers, KINDS, answers},
    confidence::{line, reliabilities},
};
use anyhow::Context as _;
use cli::screen;
use std::{fmt::Write as _, path::PathBuf};
use vision::{
    params::Params,
    recognise::{
        DistanceKind,
        decision::{confidence::chance, measures::MEASURES},
    },
};

/// `waymark-lab train confidence`.
#[derive(Debug, clap::Args)]
pub(crate) struct ConfidenceArgs {
    /// Quads, of which about four in ten are named.
    #[arg(long, default_value_t = 12_000, value_parser = clap::value_parser!(u32).range(1000..=1_000_000))]
    quads: u32,
    /// Write the weights as the source file `vision/src/recognise/decision/confidence_weights.rs`
    /// here.
    #[arg(long, value_name = "FILE")]
    rust: Option<PathBuf>,
    #[command(flatten)]
    common: Common,
}

pub(super) fn run(args: &ConfidenceArgs) -> anyhow::Result<()> {
    anyhow::ensure!(
        !args.common.detector && args.common.plot.is_none() && !args.common.json,
        "there is no --detector, --plot or --json here"
    );
    let mut found = answers(&args.common, args.quads, &Params::default())?;
    let before = reliabilities(&found);
    let mut weights = Vec::new();
    for (kind, answers) in KINDS.into_iter().zip(&mut found) {
        let learnt = fitted(answers).with_context(|| format!("{kind:?}"))?;
        for named in &mut answers.named {
            named.confidence = chance(&learnt, &named.measures);
        }
        weights.push((kind, learnt));
    }
    if let Some(path) = &args.rust {
        let from = Provenance::of_this_run(&args.common.photographs)?;
        std::fs::write(path, source(&weights, &from))
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    let mut lines = vec![format!("set {}, {} quads; in use:", args.common.part.name(), found[0].quads)];
    lines.extend(before.iter().map(line));
    lines.push("fitted, on the answers they were fitted to:".into());
    lines.extend(reliabilities(&found).iter().map(line));
    lines.extend(weights.iter().map(|(kind, w)| format!("  {kind:?} {w:?}")));
    screen::say(&lines.join("\n"));
    Ok(())
}

fn fitted(answers: &Answers) -> anyhow::Result<[f64; MEASURES + 1]> {
    let answer = |n: &crate::evaluate::experiment::answers::Named| Answer {
        measures: n.measures,
        is_right: n.is_right,
    };
    Ok(fit(&answers.named.iter().map(answer).collect::<Vec<_>>())?)
}

/// `vision/src/recognise/decision/confidence_weights.rs` with these weights.
fn source(weights: &[(DistanceKind, [f64; MEASURES + 1])], from: &Provenance) -> String {
    let mut text = String::from(
        "//! The weights of the confidence, by the distance that decides. Not for editing: this command writes the file, byte\n\
         //! for byte:\n//!\n",
    );
    text.push_str(&from.lines());
    text.push_str("\nuse super::measures::MEASURES;\n");
    for (kind, weights) in weights {
        let (name, what) = match kind {
            DistanceKind::Both => ("BOTH", "Where slopes decide."),
            DistanceKind::Correlation => ("CORRELATION", "Where C^r decides."),
            DistanceKind::Hausdorff => ("HAUSDORFF", "Where H^r decides."),
        };
        // Writing to a String cannot fail.
        write!(text, "\n/// {what}\npub(super) const {name}: [f64; MEASURES + 1] =\n    {weights:?};\n").ok();
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_source_has_the_weights_exactly() {
        let from = Provenance::of_this_run(&[]).unwrap();
        let text = source(&[(DistanceKind::Both, [-1.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 6.25])], &from);
        let constant =
            "pub(super) const BOTH: [f64; MEASURES + 1] =\n    [-1.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 6.25];";
        assert!(text.contains(constant), "{text}");
    }
}
