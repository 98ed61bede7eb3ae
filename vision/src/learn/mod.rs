//! From views of one landmark to its model (method 7 to 9).

pub mod params;
pub mod training_view;
pub(crate) mod texture;
pub mod synthesis;
pub mod near_duplicates;
pub mod reference_border;
pub mod aspect;
pub mod pca;
pub mod threshold;
pub mod gates;
pub mod threshold_fit;
pub mod rules;
pub mod lesson;

pub use lesson::{LearnError, learn};
pub use params::{LearnParams, SynthesisParams};
pub use rules::LearnRules;
pub use threshold_fit::{add_negatives, refit_thresholds, unlikeness_of};
pub use training_view::TrainingView;
