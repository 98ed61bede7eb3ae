//! Which observation of an image is which expected landmark: individual gates, then joint compatibility (JCBB, Neira and
//! Tardos 2001) under one error of pose, extrinsics and intrinsics that all observations share.
//!
//! In: [`Expectations`] and observations, each with the landmarks it may be, all members of its look-alike class included.
//! Out: for each observation one landmark, several, or none. One is given only if every assignment whose score comes within
//! [`AssociateParams::margin_nats`] of the best gives it.
//!
//! The score of an assignment is the logarithm of its likelihood over that of an image without these landmarks: picture
//! evidence, prior odds, and the density of the corners. Picture evidence has a floor of its own, which neither prior odds
//! nor a good fit of the corners can make up for.
//!
//! The search is depth first with a bound on the score and visits at most [`MAX_NODES`] assignments. The order of
//! observations, candidates and landmarks does not change the result.

mod search;

use super::{
    Expectations, Expected, GuidedError,
    joint::{CommonError, CornerMatrix, CornerVector, most_log_density},
    projection::corner_vector,
};
use crate::{
    check,
    gate::{Z_999, chi2_quantile},
};
use nalgebra::{Matrix2, SMatrix};
use search::{Hypothesis, Outcome};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use vision::{
    geometry::{Corners, polygon},
    model::LandmarkId,
};

/// Most observations of one image; a longer list is refused.
pub const MAX_OBSERVATIONS: usize = 32;
/// Most candidates of one observation; a longer list is refused. As many as a look-alike class may have.
pub const MAX_CANDIDATES: usize = 512;
/// Most partial assignments that are looked at; when there are more, no observation is unique.
pub const MAX_NODES: usize = 1024;
/// Pairings with a corner this many times beyond the gate of rivals are left out before anything is computed of them. Far
/// beyond, since the distance of one corner rests on a linear prediction.
const FAR_FACTOR: f64 = 4.0;
/// Largest evidence that is told from larger, nats.
const MAX_EVIDENCE_NATS: f64 = 1e6;

/// Limits of the association.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AssociateParams {
    /// Least picture evidence of a candidate, nats: logarithm of how much likelier the picture is if it is this landmark
    /// than if it is none. ln 100.
    pub min_picture_nats: f64,
    /// Prior odds beyond this in either direction count as this, nats.
    pub max_prior_nats: f64,
    /// Two assignments whose scores differ by less are both possible, nats. 8 nats are odds of 3000, the same as a
    /// difference of 16 in chi2 (see `vision::pose::AMBIGUOUS_CHI2`).
    pub margin_nats: f64,
    /// Gates, individual and joint: standard normal quantile of the share of true pairings that pass. 3.09 is 99.9 %.
    pub gate_z: f64,
    /// Standard deviation of what a measured corner errs by beyond its covariance, px: frames that stand off their wall,
    /// lens residuals.
    pub model_sigma_px: f64,
}

impl Default for AssociateParams {
    fn default() -> Self {
        Self {
            min_picture_nats: 100.0_f64.ln(),
            max_prior_nats: 100.0_f64.ln(),
            margin_nats: 8.0,
            gate_z: Z_999,
            model_sigma_px: 0.5,
        }
    }
}

/// A landmark that an observation may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// Its number.
    pub landmark: LandmarkId,
    /// Picture evidence, nats: ln of p(picture, if it is this landmark) over p(picture, if it is none). Members of one
    /// look-alike class get the same value: what differs between them is not evidence.
    pub picture_nats: f64,
    /// Prior odds besides the predicted corners, nats; 0 where nothing is known.
    pub prior_nats: f64,
}

/// A quad observed in the image.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation {
    /// Corners in the landmark's order (TL, TR, BR, BL), px of the image as it comes. Of a landmark that the image border
    /// cuts, corners outside of the image come from alignment.
    pub corners_px: Corners,
    /// Their covariance (u, v of TL, TR, BR, BL), px^2.
    pub covariance_px2: SMatrix<f64, 8, 8>,
    /// The landmarks it may be; of two with one number the stronger counts.
    pub candidates: Vec<Candidate>,
}

impl Observation {
    /// With corners measured independently of one another.
    pub fn new(corners_px: Corners, covariance_px2: &[Matrix2<f64>; 4], candidates: Vec<Candidate>) -> Self {
        let mut joined = SMatrix::<f64, 8, 8>::zeros();
        for (c, covariance) in covariance_px2.iter().enumerate() {
            joined.fixed_view_mut::<2, 2>(2 * c, 2 * c).copy_from(covariance);
        }
        Self { corners_px, covariance_px2: joined, candidates }
    }
}

/// Why an observation is no expected landmark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NotAssociated {
    /// None of its candidates is expected in view.
    NotExpected,
    /// No candidate that is expected has enough picture evidence.
    WeakEvidence {
        /// The largest, nats.
        picture_nats: f64,
    },
    /// It is outside of the gate of every candidate: the prior, the map or the identity is wrong.
    OutsideGates {
        /// Squared Mahalanobis distance to the nearest, 8 degrees of freedom; infinite when all are far beyond.
        distance2: f64,
    },
    /// It is in a gate, but contradicts the other observations, or another one explains the landmark better.
    Incompatible,
}

impl NotAssociated {
    /// Whether it speaks against the prior pose.
    pub fn is_contradiction(&self) -> bool {
        matches!(self, Self::OutsideGates { .. } | Self::Incompatible)
    }
}

/// Which landmark an observation is.
#[derive(Debug, Clone, PartialEq)]
pub enum Association {
    /// This one.
    Unique {
        /// Its number.
        landmark: LandmarkId,
        /// Squared Mahalanobis distance to its prediction, 8 degrees of freedom.
        distance2: f64,
    },
    /// One of several, or one or none: the scores are too close.
    Ambiguous {
        /// The landmarks it may be, by number.
        landmarks: Vec<LandmarkId>,
        /// Whether it may also be none of them.
        or_none: bool,
    },
    /// None that is expected.
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
    /// Partial assignments that were looked at, at most [`MAX_NODES`].
    pub nodes: usize,
    /// Whether the search ended at [`MAX_NODES`].
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

    /// How many observations speak against the prior pose.
    pub fn contradictions(&self) -> usize {
        let against = |a: &&Association| matches!(a, Association::None(why) if why.is_contradiction());
        self.observations.iter().filter(against).count()
    }
}

/// An observation and a landmark that pass the individual gate of rivals.
struct Pairing {
    /// Index among the expectations.
    expected: usize,
    observed: CornerVector,
    /// Covariance of what is not common.
    own: CornerMatrix,
    /// Picture evidence and prior odds over the density of a quad that is no landmark.
    weight: f64,
    /// By itself: squared distance, score, and a bound of the score after any others.
    distance2: f64,
    score: f64,
    bound: f64,
}

/// An observation with at least one pairing.
struct Row {
    /// Index among the observations.
    observation: usize,
    /// Best score first.
    pairings: Vec<Pairing>,
}

/// Squared distances within which a pairing, or `count` of them together, is accepted, and within which it is a rival.
#[derive(Debug, Clone, Copy)]
struct Gates {
    z: f64,
    margin_nats: f64,
}

impl Gates {
    fn accept(&self, count: usize) -> f64 {
        if count == 0 { 0.0 } else { chi2_quantile(8 * count, self.z) }
    }

    /// A rival just outside of the gate is as likely as what is just inside.
    fn rival(&self, count: usize) -> f64 {
        self.accept(count) + 2.0 * self.margin_nats
    }
}

/// Assigns observations to expected landmarks, each landmark at most once.
pub fn associate(
    expectations: &Expectations,
    observations: &[Observation],
    params: &AssociateParams,
) -> Result<Assignment, GuidedError> {
    check_input(observations)?;
    let gates = Gates { z: params.gate_z, margin_nats: params.margin_nats };
    let mut answers = Vec::with_capacity(observations.len());
    let mut rows = Vec::new();
    for (observation, observed) in observations.iter().enumerate() {
        match pairings(expectations, observed, params, &gates) {
            Ok(pairings) => {
                rows.push(Row { observation, pairings });
                answers.push(Association::None(NotAssociated::Incompatible));
            }
            Err(why) => answers.push(Association::None(why)),
        }
    }
    // Few candidates first, then by what the corners are: not by the order of the list.
    rows.sort_by(|a, b| {
        let key = |r: &Row| corner_vector(observations[r.observation].corners_px.points());
        let (ka, kb) = (key(a), key(b));
        let by_corners = ka.iter().zip(kb.iter()).map(|(x, y)| x.total_cmp(y)).find(|o| o.is_ne());
        let by_score = b.pairings[0].score.total_cmp(&a.pairings[0].score);
        let by_corners = by_corners.unwrap_or(std::cmp::Ordering::Equal);
        a.pairings.len().cmp(&b.pairings.len()).then(by_corners).then(by_score)
    });
    let found = search::search(&rows, expectations, &gates);
    for (r, row) in rows.iter().enumerate() {
        answers[row.observation] = answer(r, row, &found, expectations, &gates);
    }
    let Outcome { best, nodes, is_exhausted, .. } = found;
    let dof = 8 * best.chosen.iter().flatten().count();
    Ok(Assignment { observations: answers, distance2: best.distance2, dof, nodes, is_exhausted })
}

fn check_input(observations: &[Observation]) -> Result<(), GuidedError> {
    let too_many = |field, count, limit| {
        if count > limit { Err(GuidedError::TooMany { field, count, limit }) } else { Ok(()) }
    };
    too_many("observations", observations.len(), MAX_OBSERVATIONS)?;
    for observed in observations {
        too_many("candidates", observed.candidates.len(), MAX_CANDIDATES)?;
        check::covariance("covariance_px2", &observed.covariance_px2)?;
        for candidate in &observed.candidates {
            check::within("picture_nats", candidate.picture_nats, -MAX_EVIDENCE_NATS, MAX_EVIDENCE_NATS)?;
            check::within("prior_nats", candidate.prior_nats, -MAX_EVIDENCE_NATS, MAX_EVIDENCE_NATS)?;
        }
    }
    Ok(())
}

/// What an observation may be by itself, best score first; at least one of them within the gate.
fn pairings(
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

/// Whether one corner alone is beyond a squared Mahalanobis distance. That of all eight coordinates is larger still.
fn is_far_off(expected: &Expected, observed: &Observation, chi2: f64) -> bool {
    (0..4).any(|c| {
        let block = |m: &SMatrix<f64, 8, 8>| Matrix2::from(m.fixed_view::<2, 2>(2 * c, 2 * c));
        let s = block(&expected.covariance_px2) + block(&observed.covariance_px2);
        let d = observed.corners_px.points()[c] - expected.corners_px[c];
        s.cholesky().is_some_and(|factor| d.dot(&factor.solve(&d)) > chi2)
    })
}

/// Logarithm of the density, per px^8, of the corners of a quad that is on no map: its middle anywhere in the image, the
/// other six coordinates anywhere within its own size.
fn log_clutter(expectations: &Expectations, observed: &Observation) -> f64 {
    let [width, height] = expectations.image_px;
    let size_px = polygon::area(observed.corners_px.points()).sqrt().max(1.0);
    -(width * height).ln() - 6.0 * size_px.ln()
}

/// What the hypotheses within the margin of the best say of one row.
fn answer(r: usize, row: &Row, found: &Outcome, expectations: &Expectations, gates: &Gates) -> Association {
    let number = |pairing: usize| expectations.landmarks[row.pairings[pairing].expected].landmark;
    let best = found.best.chosen.get(r).copied().flatten();
    let mut landmarks: BTreeSet<LandmarkId> = BTreeSet::new();
    let mut or_none = best.is_none();
    for Hypothesis { chosen, .. } in &found.rivals {
        match chosen.get(r).copied().flatten() {
            Some(pairing) => {
                landmarks.insert(number(pairing));
            }
            None => or_none = true,
        }
    }
    landmarks.extend(best.map(number));
    if found.is_exhausted {
        // What was not looked at may be as good: all that the gates allow is possible.
        landmarks.extend((0..row.pairings.len()).map(number));
        or_none = true;
    }
    match best {
        Some(pairing) if landmarks.len() == 1 && !or_none => {
            let distance2 = row.pairings[pairing].distance2;
            if distance2 <= gates.accept(1) {
                Association::Unique { landmark: number(pairing), distance2 }
            } else {
                Association::None(NotAssociated::OutsideGates { distance2 })
            }
        }
        None if landmarks.is_empty() => Association::None(NotAssociated::Incompatible),
        _ => Association::Ambiguous { landmarks: landmarks.into_iter().collect(), or_none },
    }
}
