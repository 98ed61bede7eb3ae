//! Readings of one quad (borders times rotations) and a set of landmarks in, the nearest landmarks
//! out, by the smallest distance over readings and exemplars (method 7.5). `decision` decides.

use crate::{
    detect::quad::Quad,
    frame::GrayImage,
    geometry::corners::Corners,
    icon::{Icon, icon},
    model::{
        landmark_model::LandmarkModel,
        model_set::{Listed, ModelSet},
    },
    params::Params,
    recognise::{
        distance_kind::DistanceKind,
        features::{
            correlation::{Buckets, correlation_within},
            descriptor::{PointSet, describe},
            harris::harris,
            hausdorff::hausdorff,
            signature::Signature,
        },
    },
};
use std::{cell::OnceCell, sync::Arc};

/// Most borders of one quad, the outermost first.
pub const MAX_BORDERS: usize = 6;

/// One reading of a quad: a border and a choice of the top-left corner.
#[derive(Debug, Clone)]
pub(crate) struct QuadReading {
    /// 0 for the quad's corners, i for alternate i - 1.
    pub(crate) border: usize,
    /// Which corner of the quad is the icon's top-left.
    pub(crate) rotation: usize,
    /// The corners in that order.
    pub(crate) corners_px: Corners,
    /// The icon of these corners.
    pub(crate) icon: Icon,
    /// The icon's signature.
    pub(crate) signature: Signature,
    buckets: OnceCell<Buckets>,
    points: OnceCell<PointSet>,
}

impl QuadReading {
    fn new(border: usize, rotation: usize, corners_px: Corners, icon: Icon) -> Self {
        let signature = Signature::new(&icon);
        let (buckets, points) = (OnceCell::new(), OnceCell::new());
        Self { border, rotation, corners_px, icon, signature, buckets, points }
    }

    /// The icon's buckets, computed on first use.
    pub(crate) fn buckets(&self, p: &Params) -> &Buckets {
        self.buckets.get_or_init(|| Buckets::new(&self.icon, &p.recognise.correlation))
    }

    /// The icon's points, computed on first use: most quads are rejected by C^r alone.
    pub(crate) fn points(&self, p: &Params) -> &PointSet {
        let r = &p.recognise;
        self.points.get_or_init(|| describe(&self.icon, &harris(&self.icon, &r.harris), &r.descriptor))
    }
}

/// Every reading of `quad` whose icon can be cut: all borders, and all four rotations where the
/// orientation is ambiguous.
pub(crate) fn quad_readings(image: &GrayImage, quad: &Quad, p: &Params) -> Vec<QuadReading> {
    let borders = std::iter::once(&quad.corners_px).chain(&quad.alternates).take(MAX_BORDERS);
    let rotations = if quad.upright_ambiguous { 4 } else { 1 };
    let mut all = Vec::new();
    for (border, corners_px) in borders.enumerate() {
        let Ok(upright) = icon(image, corners_px, &p.icon) else { continue };
        for rotation in 0..rotations {
            let corners_px = corners_px.rotated(rotation);
            all.push(QuadReading::new(border, rotation, corners_px, upright.rotated(rotation)));
        }
    }
    all
}

/// A landmark near one reading.
#[derive(Debug, Clone)]
pub(crate) struct NearLandmark {
    pub(crate) model: Arc<LandmarkModel>,
    /// Index of the reading.
    pub(crate) reading: usize,
    /// Index of the nearest exemplar.
    pub(crate) exemplar: usize,
    pub(crate) correlation: f64,
    pub(crate) hausdorff: f64,
    /// Likeness after alignment, if aligned.
    pub(crate) likeness: Option<f64>,
    /// Likeness of the signatures; 0 where they were not compared.
    pub(crate) signature: f32,
}

impl NearLandmark {
    /// C^r over its tau.
    pub(crate) fn correlation_ratio(&self) -> f64 {
        ratio(self.correlation, self.model.correlation.tau)
    }

    /// H^r over its tau.
    pub(crate) fn hausdorff_ratio(&self) -> f64 {
        ratio(self.hausdorff, self.model.hausdorff.tau)
    }

    /// The ratio that orders candidates.
    pub(crate) fn ratio(&self, kind: DistanceKind) -> f64 {
        match kind {
            DistanceKind::Hausdorff => self.hausdorff_ratio(),
            DistanceKind::Correlation => self.correlation_ratio(),
            DistanceKind::Both => {
                self.likeness.map_or(f64::INFINITY, |l| ratio(1.0 - l, self.model.likeness.tau))
            }
        }
    }
}

/// A landmark without a threshold accepts nothing.
fn ratio(distance: f64, tau: f64) -> f64 {
    if tau > 0.0 { distance / tau } else { f64::INFINITY }
}

/// The `count` landmarks whose signatures are most like one of the readings', best first, each with
/// its best reading; of equal ones the lower id. Distances are initialised to their largest values.
pub(crate) fn short_list(readings: &[QuadReading], models: &ModelSet, count: usize) -> Vec<NearLandmark> {
    let mut found: Vec<(usize, Listed)> = Vec::new();
    for (i, reading) in readings.iter().enumerate() {
        found.extend(models.short_list(&reading.signature, count).into_iter().map(|l| (i, l)));
    }
    found.sort_by(|a, b| b.1.likeness.total_cmp(&a.1.likeness).then((a.1.model, a.0).cmp(&(b.1.model, b.0))));
    let mut near: Vec<NearLandmark> = Vec::new();
    for (reading, listed) in found {
        let Some(model) = models.at(listed.model) else { continue };
        if near.len() == count || near.iter().any(|n| n.model.id == model.id) {
            continue;
        }
        near.push(NearLandmark {
            model: Arc::clone(model),
            reading,
            exemplar: listed.exemplar,
            correlation: WORST_CORRELATION,
            hausdorff: f64::INFINITY,
            likeness: None,
            signature: listed.likeness,
        });
    }
    near
}

/// Largest C^r.
const WORST_CORRELATION: f64 = 2.0;

/// C^r at the detected corners, to the exemplar nearest by its signature.
pub(crate) fn correlation_as_found(near: &NearLandmark, readings: &[QuadReading], p: &Params) -> f64 {
    let (Some(reading), Some(exemplar)) =
        (readings.get(near.reading), near.model.exemplars.get(near.exemplar))
    else {
        return WORST_CORRELATION;
    };
    let rank = p.recognise.correlation.rank();
    let buckets = Buckets::new(&exemplar.icon(), &p.recognise.correlation);
    correlation_within(reading.buckets(p), &buckets, rank, WORST_CORRELATION).unwrap_or(WORST_CORRELATION)
}

/// Least H^r over the exemplars, and which has it.
pub(crate) fn least_hausdorff(points: &PointSet, model: &LandmarkModel, p: &Params) -> (f64, usize) {
    let mut best = (f64::INFINITY, 0);
    for (i, exemplar) in model.exemplars.iter().enumerate() {
        let d = hausdorff(points, exemplar.points(&p.recognise), &p.recognise.hausdorff);
        if d < best.0 {
            best = (d, i);
        }
    }
    best
}
