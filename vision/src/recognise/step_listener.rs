//! Reports each step of the recognition of a quad, for timing. It does not change results.

/// The steps of recognising one quad, in their order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum RecogniseStep {
    /// Patches, points, votes, homographies, verification.
    Points,
    /// Icons of every border and rotation, with what the short list needs of them.
    Icons,
    /// The landmarks that it may be: by signatures, or by one of the paper's distances.
    ShortList,
    /// The picture laid on the learnt icons, and how alike they are there.
    Alignment,
    /// Distances where the picture came to lie.
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

/// Is told of every step. A step may end several times for one quad.
pub trait StepListener {
    /// `step` has just ended.
    fn finished(&mut self, step: RecogniseStep);
}

/// Nobody.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoListener;

impl StepListener for NoListener {
    fn finished(&mut self, _step: RecogniseStep) {}
}
