//! Icon in, the features of both distances out (method 5, 6).

use crate::{
    icon::Icon,
    recognise::{
        alignment::surroundings,
        features::{
            correlation::Buckets,
            descriptor::{self, PointSet},
            harris,
            signature::Signature,
        },
        params::RecogniseParams,
    },
};

/// An icon with the features of both distances, computed once. Depends on icon, points, descriptor
/// and bucket parameters only; not stored, since it follows from the icon.
#[derive(Debug, Clone, PartialEq)]
pub struct IconFeatures {
    /// The icon.
    pub icon: Icon,
    /// Normalised buckets for C^r.
    pub buckets: Buckets,
    /// Described points for H^r.
    pub points: PointSet,
    /// Signature for the short list.
    pub signature: Signature,
    /// Coarse level for alignment.
    pub coarse: Vec<f32>,
}

impl IconFeatures {
    /// The features of `icon.rotated(shift)`.
    #[must_use]
    pub fn rotated(&self, shift: usize, p: &RecogniseParams) -> Self {
        let icon = self.icon.rotated(shift);
        let buckets = Buckets::new(&icon, &p.correlation);
        let signature = Signature::new(&icon);
        let coarse = surroundings::coarse(&icon, &p.verdict.align);
        Self { buckets, points: self.points.rotated(shift, icon.size), signature, coarse, icon }
    }
}

/// Computes buckets, points and descriptors of `icon`.
pub fn features(icon: Icon, p: &RecogniseParams) -> IconFeatures {
    let points = descriptor::describe(&icon, &harris::harris(&icon, &p.harris), &p.descriptor);
    IconFeatures {
        buckets: Buckets::new(&icon, &p.correlation),
        points,
        signature: Signature::new(&icon),
        coarse: surroundings::coarse(&icon, &p.verdict.align),
        icon,
    }
}
