//! Data association of the observations of an image with expected landmarks: individual gates, then
//! joint compatibility (JCBB, Neira and Tardos 2001) under one error of pose, extrinsics and
//! intrinsics that all observations share.
//!
//! In: [`Expectations`] and observations, each with its candidate landmarks, all members of its
//! look-alike class included. Out: for each observation one landmark, several, or none. One is
//! given only if every assignment whose score comes within [`AssociateParams::margin_nats`] of the
//! best gives it.
//!
//! The score of an assignment is the logarithm of its likelihood over that of an image without
//! these landmarks: picture evidence, prior odds, and the density of the corners. Picture evidence
//! has a floor of its own, which neither prior odds nor a good fit of the corners can make up for.
//!
//! The search is depth first with a bound on the score and visits at most [`MAX_NODES`]
//! assignments. The order of observations, candidates and landmarks does not change the result.

mod params;
mod observation;
mod assignment;
mod pairing;
mod search;

pub use assignment::{Assignment, Association, NotAssociated};
pub use observation::{Candidate, MAX_CANDIDATES, MAX_OBSERVATIONS, Observation};
pub use params::AssociateParams;
pub use search::MAX_NODES;

use crate::guided::{
    associate::{
        observation::check_input,
        pairing::{Gates, Row, pairings},
        search::{Hypothesis, Outcome},
    },
    error::GuidedError,
    expect::Expectations,
    projection::corner_vector,
};
use std::collections::BTreeSet;
use vision::model::LandmarkId;

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
    // Few candidates first, then by the corners: the order of the list has no effect.
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

/// The association of one row by the hypotheses within the margin of the best.
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
        // An assignment that was not visited may be as good: all that the gates allow is possible.
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
