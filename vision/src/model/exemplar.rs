//! An icon of a model: whole grey levels as bytes, shared by the copies of the model. Features are
//! computed on demand; those for the paper's distances are cached.

use crate::{
    icon::Icon,
    recognise::{
        alignment::{align_params::AlignParams, surroundings::coarse},
        features::{
            correlation::Buckets,
            descriptor::{PointSet, describe},
            harris::harris,
            icon_features::{IconFeatures, features},
            signature::Signature,
        },
        params::RecogniseParams,
    },
};
use std::sync::{Arc, OnceLock};

/// A learnt icon.
#[derive(Debug, Clone)]
pub struct Exemplar {
    size: usize,
    source_scale: f64,
    pixels: Arc<[u8]>,
    /// Signature for the short list.
    pub(crate) signature: Signature,
    buckets: Arc<OnceLock<Buckets>>,
    points: Arc<OnceLock<PointSet>>,
}

/// Cached features are not compared.
impl PartialEq for Exemplar {
    fn eq(&self, other: &Self) -> bool {
        let scales = self.source_scale.to_bits() == other.source_scale.to_bits();
        scales && self.size == other.size && self.pixels == other.pixels
    }
}

impl Exemplar {
    /// Stores `icon`, whose grey levels are whole numbers.
    pub fn new(icon: &Icon) -> Self {
        let pixels = icon.pixels.iter().map(|g| g.round() as u8).collect();
        let (buckets, points) = (Arc::default(), Arc::default());
        let signature = Signature::new(icon);
        Self { size: icon.size, source_scale: icon.source_scale, pixels, signature, buckets, points }
    }

    /// The icon.
    pub fn icon(&self) -> Icon {
        let pixels = self.pixels.iter().map(|g| f32::from(*g)).collect();
        Icon { size: self.size, pixels, source_scale: self.source_scale }
    }

    /// Its side, in pixels.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Mean number of source pixels along a pixel's side.
    pub fn source_scale(&self) -> f64 {
        self.source_scale
    }

    /// Its grey levels, row by row.
    pub fn pixels(&self) -> &[u8] {
        &self.pixels
    }

    /// The icon and its coarse level for alignment.
    pub(crate) fn template(&self, p: &AlignParams) -> (Icon, Vec<f32>) {
        let icon = self.icon();
        let coarse = coarse(&icon, p);
        (icon, coarse)
    }

    /// All features.
    pub fn features(&self, p: &RecogniseParams) -> IconFeatures {
        features(self.icon(), p)
    }

    /// Its buckets for C^r; cached. `p` must be the parameters of training.
    pub(crate) fn buckets(&self, p: &RecogniseParams) -> &Buckets {
        self.buckets.get_or_init(|| Buckets::new(&self.icon(), &p.correlation))
    }

    /// Its points for H^r; cached.
    pub(crate) fn points(&self, p: &RecogniseParams) -> &PointSet {
        self.points.get_or_init(|| {
            let icon = self.icon();
            describe(&icon, &harris(&icon, &p.harris), &p.descriptor)
        })
    }

    /// Its memory by purpose, bytes.
    pub(crate) fn memory_parts(&self) -> [(&'static str, usize); 4] {
        let buckets = self.buckets.get().map_or(0, |b| size_of_val(b.values()));
        [
            ("icons", self.pixels.len()),
            ("buckets", buckets),
            ("corner points", self.points.get().map_or(0, PointSet::memory_bytes)),
            ("other", size_of::<Self>() + size_of::<OnceLock<Buckets>>() + size_of::<OnceLock<PointSet>>()),
        ]
    }
}
