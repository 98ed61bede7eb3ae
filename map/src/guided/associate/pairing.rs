//! Pairings of one observation with one expected landmark: individual gates and scores.

use crate::{
    gate::chi2_quantile,
    guided::{
        associate::{
            assignment::NotAssociated,
            observation::{Candidate, Observation},
            params::AssociateParams,
        },
        expect::{Expectations, Expected},
        joint::{CommonError, CornerMatrix, CornerVector, most_log_density},
        projection::corner_vector,
    },
};
use nalgebra::{Matrix2, SMatrix};
use vision::geometry::polygon;

/// Pairings with a corner this many times beyond the gate of rivals are left out before anything is
/// computed of them. Far beyond, since the distance of one corner rests on a linear prediction.
const FAR_FACTOR: f64 = 4.0;

/// An observation and a landmark that pass the individual gate of rivals.
pub(super) struct Pairing {
    /// Index among the expectations.
    pub(super) expected: usize,
    pub(super) observed: CornerVector,
    /// Covariance of the errors that are not shared.
    pub(super) own: CornerMatrix,
    /// Picture evidence and prior odds over the density of a quad that is no landmark.
    pub(super) weight: f64,
    /// Alone: squared distance, score, and a bound of the score after any others.
    pub(super) distance2: f64,
    pub(super) score: f64,
    pub(super) bound: f64,
}

/// An observation with at least one pairing.
pub(super) struct Row {
    /// Index among the observations.
    pub(super) observation: usize,
    /// Best score first.
    pub(super) pairings: Vec<Pairing>,
}

/// Squared distances within which a pairing, or `count` of them together, is accepted, and within
/// which it is a rival.
#[derive(Debug, Clone, Copy)]
pub(super) struct Gates {
    pub(super) z: f64,
    pub(super) margin_nats: f64,
}

impl Gates {
    pub(super) fn accept(&self, count: usize) -> f64 {
        if count == 0 { 0.0 } else { chi2_quantile(8 * count, self.z) }
    }

    /// Wider: a rival just outside of the gate is as likely as a pairing just inside.
    pub(super) fn rival(&self, count: usize) -> f64 {
        self.accept(count) + 2.0 * self.margin_nats
    }
}

/// The pairings of one observation alone, best score first; at least one is within the gate.
pub(super) fn pairings(
    expectations: &Expectations,
    observed: &Observation,
    params: &AssociateParams,
    gates: &Gates,
) -> Result<Vec<Pairing>, NotAssociated> {
    let mut candidates = observed.candidates.clone();
    candidates.sort_by(|a, b| {
        let strength = |c: &Candidate| c.picture_nats + c.prior_nats;
        a.landmark.cmp(&b.landmark).then(strength(b).total_cmp(&strength(a)))
    });
    candidates.dedup_by_key(|c| c.landmark);
    let expected: Vec<(usize, Candidate)> = candidates
        .into_iter()
        .filter_map(|c| {
            let at = expectations.landmarks.binary_search_by_key(&c.landmark, |e| e.landmark).ok()?;
            (!expectations.landmarks[at].is_hidden).then_some((at, c))
        })
        .collect();
    if expected.is_empty() {
        return Err(NotAssociated::NotExpected);
    }
    let picture_nats = expected.iter().map(|(_, c)| c.picture_nats).fold(f64::NEG_INFINITY, f64::max);
    let strong = expected.iter().filter(|(_, c)| c.picture_nats >= params.min_picture_nats);
    if picture_nats < params.min_picture_nats {
        return Err(NotAssociated::WeakEvidence { picture_nats });
    }
    let alone = CommonError::new(&expectations.common);
    let mut made: Vec<Pairing> = strong
        .filter_map(|(at, c)| pairing(expectations, *at, observed, c, (params, gates.rival(1)), &alone))
        .collect();
    let distance2 = made.iter().map(|p| p.distance2).fold(f64::INFINITY, f64::min);
    made.retain(|p| p.distance2 <= gates.rival(1));
    if distance2.is_nan() || distance2 > gates.accept(1) {
        return Err(NotAssociated::OutsideGates { distance2 });
    }
    made.sort_by(|a, b| b.score.total_cmp(&a.score).then(a.expected.cmp(&b.expected)));
    Ok(made)
}

fn pairing(
    expectations: &Expectations,
    at: usize,
    observed: &Observation,
    candidate: &Candidate,
    (params, rival_chi2): (&AssociateParams, f64),
    alone: &CommonError,
) -> Option<Pairing> {
    let expected: &Expected = &expectations.landmarks[at];
    let corners = corner_vector(observed.corners_px.points());
    if is_far_off(expected, observed, FAR_FACTOR * rival_chi2) {
        return None;
    }
    let model = CornerMatrix::identity() * params.model_sigma_px.powi(2);
    let own = expected.by_place_px2 + observed.covariance_px2 + model;
    let prior_nats = candidate.prior_nats.clamp(-params.max_prior_nats, params.max_prior_nats);
    let weight = candidate.picture_nats + prior_nats - log_clutter(expectations, observed);
    let updated = alone.update(&expectations.predicted(at), &own, &corners)?;
    Some(Pairing {
        expected: at,
        observed: corners,
        weight,
        distance2: updated.distance2,
        score: weight + updated.log_density,
        bound: weight + most_log_density(&own)?,
        own,
    })
}

/// Whether one corner alone is beyond a squared Mahalanobis distance. That of all eight coordinates
/// is larger still.
fn is_far_off(expected: &Expected, observed: &Observation, chi2: f64) -> bool {
    (0..4).any(|c| {
        let block = |m: &SMatrix<f64, 8, 8>| Matrix2::from(m.fixed_view::<2, 2>(2 * c, 2 * c));
        let s = block(&expected.covariance_px2) + block(&observed.covariance_px2);
        let d = observed.corners_px.points()[c] - expected.corners_px[c];
        s.cholesky().is_some_and(|factor| d.dot(&factor.solve(&d)) > chi2)
    })
}

/// Logarithm of the density, per px^8, of the corners of a quad that is on no map: its middle
/// anywhere in the image, the other six coordinates anywhere within its own size.
fn log_clutter(expectations: &Expectations, observed: &Observation) -> f64 {
    let [width, height] = expectations.image_px;
    let size_px = polygon::area(observed.corners_px.points()).sqrt().max(1.0);
    -(width * height).ln() - 6.0 * size_px.ln()
}
