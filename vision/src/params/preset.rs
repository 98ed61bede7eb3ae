//! Presets: a word in, all parameters and the deciding distance out.

use crate::{paper::preset, params::Params, recognise::distance_kind::DistanceKind};
use serde::{Deserialize, Serialize};
use std::str::FromStr;

/// A whole pipeline by its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Preset {
    /// The product: search of quads, points, then icons.
    #[default]
    Default,
    /// The paper: relaxation, icons alone.
    Paper,
}

impl Preset {
    /// All presets, by their words.
    pub const WORDS: [&str; 2] = ["default", "paper"];

    /// Its word.
    pub fn word(self) -> &'static str {
        Self::WORDS[self as usize]
    }

    /// Its parameters.
    pub fn params(self) -> Params {
        match self {
            Self::Default => Params::default(),
            Self::Paper => preset::params(),
        }
    }

    /// `p` with this preset's choice of detector and decision; bounds, icons and distances stay,
    /// and so do the models learnt under them.
    #[must_use]
    pub fn over(self, p: &Params) -> Params {
        let mut chosen = p.clone();
        preset::choose(&mut chosen, self.params());
        chosen
    }

    /// The distance that decides. A map may have its own.
    pub fn distance(self) -> DistanceKind {
        match self {
            Self::Default => DistanceKind::Both,
            Self::Paper => DistanceKind::Hausdorff,
        }
    }
}

impl FromStr for Preset {
    type Err = String;

    fn from_str(word: &str) -> Result<Self, String> {
        match word {
            "default" => Ok(Self::Default),
            "paper" => Ok(Self::Paper),
            _ => Err(format!("no preset {word}, but {}", Self::WORDS.join(", "))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::params::Grouping;

    #[test]
    fn a_preset_is_the_same_by_its_word_and_in_a_file() {
        for word in Preset::WORDS {
            let preset: Preset = word.parse().unwrap();
            assert_eq!((serde_json::to_value(preset).unwrap(), preset.word()), (word.into(), word));
        }
        assert_eq!(Preset::Default.params(), Params::default());
        assert!("papers".parse::<Preset>().unwrap_err().contains("default, paper"));
    }

    /// Every choice of the paper that has a parameter; thresholds stay valid between the two.
    #[test]
    fn the_papers_preset_is_the_papers_pipeline() {
        let paper = Preset::Paper.params();
        assert_eq!(paper.detect.quads.grouping, Grouping::Relaxation);
        assert!(paper.detect.similarity.weights.iter().all(|w| *w > 0.1));
        assert!(paper.detect.tiling.remove && paper.detect.relaxation.linear_weight.abs() < 1e-15);
        assert!(!paper.recognise.verdict.points && paper.recognise.verdict.verify_reach.abs() < 1e-15);
        assert!(paper.learn.gates.refuse_one_side && paper.learn.gates.refuse_few_points);
        assert_eq!(Preset::Paper.distance(), DistanceKind::Hausdorff);
        assert_eq!(paper.distance_hash(), Params::default().distance_hash());
    }

    /// A preset over other settings changes what presets differ in, all of it and nothing else.
    #[test]
    fn a_preset_goes_over_other_settings() {
        let [default, paper] = [Preset::Default, Preset::Paper].map(Preset::params);
        assert_eq!(Preset::Paper.over(&default), paper);
        assert_eq!(Preset::Default.over(&paper), default);
        let mut own = Params::default();
        own.detect.edges.high *= 2.0;
        let over = Preset::Paper.over(&own);
        assert_ne!(over, paper);
        assert_eq!(Preset::Default.over(&over), own);
    }
}
