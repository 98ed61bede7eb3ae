//! Reports each step of the recognition of a quad, for timing. It does not change results.

/// The steps of recognising one quad, in their order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum RecogniseStep {
    /// Patches, points, votes, homographies, verification.
    Points,
    /// Icons and signatures of every border and rotation.
    Icons,
    /// Retrieval of the nearest landmarks: by signatures, or by one of the paper's distances.
    ShortList,
    /// Alignment with the learnt icons, and the likeness there.
    Alignment,
    /// The paper's distances after alignment.
    Distances,
    /// Thresholds, margin, probabilities.
    Decision,
}

impl RecogniseStep {
    /// Short name.
    pub fn name(self) -> &'static str {
        match self {
            RecogniseStep::Points => "points",
            RecogniseStep::Icons => "icons",
            RecogniseStep::ShortList => "short list",
            RecogniseStep::Alignment => "alignment",
            RecogniseStep::Distances => "distances",
            RecogniseStep::Decision => "decision",
        }
    }
}

/// Receives the end of every step. A step may end several times for one quad.
pub trait StepListener {
    /// `step` has just ended.
    fn finished(&mut self, step: RecogniseStep);
}

/// Ignores every step.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoListener;

impl StepListener for NoListener {
    fn finished(&mut self, _step: RecogniseStep) {}
}
