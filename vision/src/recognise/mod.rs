//! From icon to verdict (method 5, 6, 10). The modules are listed in the order of the data flow.

pub mod distance_kind;
pub mod params;
pub mod features;
pub mod alignment;
pub mod retrieval;
pub mod verification;
pub mod decision;
pub mod step_listener;
#[cfg(test)]
pub(crate) mod fixture;

pub use decision::{
    by_points::{DOUBTFUL_PARTS, LOG10_EPSILON, log10_false_alarms},
    result::{
        Evidence, IconEvidence, MAX_CANDIDATES, MatchCandidate, MatchRefusal, RecognitionResult, Verdict,
    },
    verdict::{recognise, recognise_watched},
};
pub use distance_kind::DistanceKind;
pub use features::icon_features::{IconFeatures, features};
pub use params::{RecogniseParams, TextureParams, VerdictParams};
pub use step_listener::{NoListener, RecogniseStep, StepListener};
