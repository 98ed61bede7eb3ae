//! The result of data association.

use vision::model::LandmarkId;

/// Why an observation is not associated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NotAssociated {
    /// None of its candidates is expected in view.
    NotExpected,
    /// No candidate that is expected has enough picture evidence.
    WeakEvidence {
        /// The largest picture evidence, nats.
        picture_nats: f64,
    },
    /// It is outside of the gate of every candidate: the prior, the map or the identity is wrong.
    OutsideGates {
        /// Squared Mahalanobis distance to the nearest, 8 degrees of freedom; infinite when all are
        /// far beyond.
        distance2: f64,
    },
    /// It is in a gate, but contradicts the other observations, or another one explains the
    /// landmark better.
    Incompatible,
}

impl NotAssociated {
    /// Whether it contradicts the prior pose.
    pub fn is_contradiction(&self) -> bool {
        matches!(self, Self::OutsideGates { .. } | Self::Incompatible)
    }
}

/// The association of one observation.
#[derive(Debug, Clone, PartialEq)]
pub enum Association {
    /// It is this landmark.
    Unique {
        /// Number of the landmark.
        landmark: LandmarkId,
        /// Squared Mahalanobis distance to its prediction, 8 degrees of freedom.
        distance2: f64,
    },
    /// Ambiguous: the scores are too close.
    Ambiguous {
        /// The landmarks it may be, by number.
        landmarks: Vec<LandmarkId>,
        /// Whether it may also be none of them.
        or_none: bool,
    },
    /// No expected landmark.
    None(NotAssociated),
}

/// The association of one image.
#[derive(Debug, Clone, PartialEq)]
pub struct Assignment {
    /// For each observation, in the order given.
    pub observations: Vec<Association>,
    /// Joint squared Mahalanobis distance of the best assignment.
    pub distance2: f64,
    /// Its degrees of freedom: 8 for each observation that it gives a landmark.
    pub dof: usize,
    /// Partial assignments that were visited, at most [`super::MAX_NODES`].
    pub nodes: usize,
    /// Whether the search ended at [`super::MAX_NODES`].
    pub is_exhausted: bool,
}

impl Assignment {
    /// Observations that are one landmark: index and landmark.
    pub fn unique(&self) -> impl Iterator<Item = (usize, LandmarkId)> {
        self.observations.iter().enumerate().filter_map(|(i, a)| match a {
            Association::Unique { landmark, .. } => Some((i, *landmark)),
            Association::Ambiguous { .. } | Association::None(_) => None,
        })
    }

    /// Number of observations that contradict the prior pose.
    pub fn contradictions(&self) -> usize {
        let against = |a: &&Association| matches!(a, Association::None(why) if why.is_contradiction());
        self.observations.iter().filter(against).count()
    }
}
