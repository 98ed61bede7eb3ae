//! `waymark map fusion`: which modalities are fused in a map.

use crate::{screen::counted, session::ServerArgs};
use clap::builder::{PossibleValuesParser, TypedValueParser as _};
use client::api::{FusionModeBody, ModalityBody, ModalityMapBody, ModalityMapPatch};

/// `waymark map fusion`.
#[derive(Debug, clap::Args)]
pub(crate) struct FusionArgs {
    /// The map.
    map: String,
    /// `all`: every modality, each as sure as it proved to be; `near_best`: those nearly as good as
    /// the best; `best`: the best alone. Odometry carries the pose in any case.
    #[arg(value_parser = PossibleValuesParser::new(["all", "near_best", "best"]).map(|word| mode(&word)))]
    mode: Option<FusionModeBody>,
    #[command(flatten)]
    server: ServerArgs,
}

pub(super) async fn run(args: &FusionArgs) -> anyhow::Result<()> {
    let session = args.server.session()?;
    let maps = session.maps();
    let done = match args.mode {
        Some(mode) => {
            maps.set_modalities(&args.map, &ModalityMapPatch { fusion_mode: Some(mode), areas: None }).await
        }
        None => maps.modalities(&args.map).await,
    };
    let known = session.explained(done.map_err(Into::into)).await?;
    session.show(&known, &sentence(&known))
}

/// A mode by its word, one of the three that the argument may have.
fn mode(word: &str) -> FusionModeBody {
    match word {
        "all" => FusionModeBody::All,
        "near_best" => FusionModeBody::NearBest,
        _ => FusionModeBody::Best,
    }
}

/// The mode, and on how much of the map each modality is best.
fn sentence(known: &ModalityMapBody) -> String {
    let best = |modality| known.cells.iter().filter(|cell| cell.best == Some(modality)).count();
    let each = [ModalityBody::Odometry, ModalityBody::Laser, ModalityBody::Landmarks];
    let each = each.map(|modality| format!("{modality} {}", best(modality)));
    format!(
        "{}; best in {}: {}",
        known.fusion_mode,
        counted(known.cells.len() as u64, "pose cell"),
        each.join(", ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_word_is_a_mode() {
        for (word, expected) in [
            ("all", FusionModeBody::All),
            ("near_best", FusionModeBody::NearBest),
            ("best", FusionModeBody::Best),
        ] {
            assert_eq!((mode(word), expected.to_string().as_str()), (expected, word));
        }
    }
}
