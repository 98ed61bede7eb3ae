//! All ways to read the edges beside a landmark's sides: each side is at one of its edges or at
//! none, and the picture lies in the plane of the border or behind it. In: the texture's corners
//! with covariance, the edges of each side, the pose that they are linearised about. Out: every
//! reading with its pose, covariance and likelihood.

use crate::{
    border::side_edges::{SideEdge, outward},
    geometry::{corner_covariance::CornerCovariance, corners::Corners},
};
use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

/// Left perturbation of the pose (rotation, translation) and the depth of the picture behind the
/// border, metres.
const STATE: usize = 7;
/// Index of the depth.
const RECESS: usize = 6;
/// Probability that the picture lies in the plane of its border.
const FLAT: f64 = 0.5;
/// Standard deviation of the depth of such a picture, metres.
const FLAT_SIGMA_M: f64 = 1e-4;
/// Mean and standard deviation of the depth of others: frames are 1 to 4 cm deep.
const RECESS_M: [f64; 2] = [0.015, 0.015];
/// Probability that none of a side's edges is the border: hidden, without contrast, or not
/// straight.
const NO_EDGE: f64 = 0.3;
/// Standard deviation of the border beside its own edge, pixels.
const BORDER_SIGMA_PX: f64 = 0.25;

/// What all readings share: the problem linearised about a pose.
pub(super) struct Linear<'a> {
    pub(super) texture_px: &'a Corners,
    pub(super) texture_covariance_px2: &'a CornerCovariance,
    /// The border's corners at the pose.
    pub(super) predicted_px: SVector<f64, 8>,
    /// Their derivative by the pose, and that of the texture's corners by the depth.
    pub(super) by_pose: SMatrix<f64, 8, 6>,
    pub(super) by_recess: SVector<f64, 8>,
    /// How far from the texture's sides edges were searched, pixels.
    pub(super) reach_px: f64,
}

#[derive(Debug, Clone)]
pub(super) struct Reading {
    /// The perturbation of the pose, and the depth.
    pub(super) state: SVector<f64, STATE>,
    pub(super) covariance: SMatrix<f64, STATE, STATE>,
    /// -2 ln of its likelihood and prior, up to a constant.
    pub(super) cost: f64,
    /// Squared residuals of texture and edges in standard deviations; two degrees of freedom and
    /// two for each edge.
    pub(super) chi2: f64,
    /// Number of sides at an edge.
    pub(super) edges: usize,
    /// Information about the corners without the pose: by texture and edges, px^-2.
    pub(super) information: SMatrix<f64, 8, 8>,
    /// It times the offset of the corners from those by texture, px^-1.
    pub(super) pull: SVector<f64, 8>,
}

/// Every reading, the likeliest first; empty where the texture does not determine a pose.
pub(super) fn readings(problem: &Linear<'_>, edges: &[Vec<SideEdge>; 4]) -> Vec<Reading> {
    let mut found = Vec::new();
    for (prior, mean_m, sigma_m) in [(FLAT, 0.0, FLAT_SIGMA_M), (1.0 - FLAT, RECESS_M[0], RECESS_M[1])] {
        let Some(mut start) = by_texture(problem, mean_m, sigma_m) else { continue };
        start.cost -= 2.0 * prior.ln();
        let mut open = vec![start];
        for (side, edges) in edges.iter().enumerate() {
            let total: f64 = edges.iter().map(|e| e.support).sum();
            let none = |r: &Reading| Reading { cost: r.cost - 2.0 * NO_EDGE.ln(), ..r.clone() };
            let mut next: Vec<Reading> = open.iter().map(none).collect();
            for edge in edges {
                let prior = (1.0 - NO_EDGE) * edge.support / total;
                let at = open.iter().filter_map(|r| at_edge(problem, r, side, edge));
                next.extend(at.map(|r| Reading { cost: r.cost - 2.0 * prior.ln(), ..r }));
            }
            open = next;
        }
        found.extend(open);
    }
    found.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    found
}

/// The reading by texture alone, with a prior of the depth.
fn by_texture(problem: &Linear<'_>, mean_m: f64, sigma_m: f64) -> Option<Reading> {
    let whitening = problem.texture_covariance_px2.whitening()?;
    let mut by_state = SMatrix::<f64, 8, STATE>::zeros();
    by_state.fixed_columns_mut::<6>(0).copy_from(&problem.by_pose);
    by_state.set_column(RECESS, &problem.by_recess);
    let (j, r) = (whitening * by_state, whitening * (flat(problem.texture_px) - problem.predicted_px));
    let mut information = j.transpose() * j;
    let weight = sigma_m.powi(-2);
    information[(RECESS, RECESS)] += weight;
    let mut towards = j.transpose() * r;
    towards[RECESS] += weight * mean_m;
    let factor = information.cholesky()?;
    let state = factor.solve(&towards);
    let chi2 = (r - j * state).norm_squared() + weight * (state[RECESS] - mean_m).powi(2);
    let log_determinant: f64 = 2.0 * factor.l().diagonal().map(f64::ln).sum();
    let cost = chi2 + log_determinant - weight.ln();
    let depth = problem.by_recess * problem.by_recess.transpose() * sigma_m.powi(2);
    let information = (problem.texture_covariance_px2.matrix() + depth).cholesky()?.inverse();
    let pull = -information * problem.by_recess * mean_m;
    Some(Reading { state, covariance: factor.inverse(), cost, chi2, edges: 0, information, pull })
}

/// `reading` with the border's side at `edge`.
fn at_edge(problem: &Linear<'_>, reading: &Reading, side: usize, edge: &SideEdge) -> Option<Reading> {
    let ends = [side, (side + 1) % 4];
    let points = problem.texture_px.points();
    let normal = outward(&points[ends[0]], &points[ends[1]]);
    let mut rows = SMatrix::<f64, 2, STATE>::zeros();
    let mut by_corners = SMatrix::<f64, 2, 8>::zeros();
    let mut measured = Vector2::zeros();
    for (i, corner) in ends.into_iter().enumerate() {
        let by_pose = normal.transpose() * problem.by_pose.fixed_rows::<2>(2 * corner);
        rows.fixed_view_mut::<1, 6>(i, 0).copy_from(&by_pose);
        by_corners.fixed_view_mut::<1, 2>(i, 2 * corner).copy_from(&normal.transpose());
        let off = points[corner].coords - problem.predicted_px.fixed_rows::<2>(2 * corner);
        measured[i] = normal.dot(&off) + edge.offsets_px[i];
    }
    let noise = edge.covariance_px2 + Matrix2::identity() * BORDER_SIGMA_PX.powi(2);
    let innovation = rows * reading.covariance * rows.transpose() + noise;
    let inverse = innovation.try_inverse()?;
    let residual = measured - rows * reading.state;
    let gain = reading.covariance * rows.transpose() * inverse;
    let chi2 = (residual.transpose() * inverse * residual)[0];
    let covariance = reading.covariance - gain * rows * reading.covariance;
    let on_corners = by_corners.transpose() * noise.try_inverse()?;
    // The density of the edge's two offsets against that of an edge anywhere in reach.
    let density = chi2 + innovation.determinant().ln() + 2.0 * std::f64::consts::TAU.ln();
    let anywhere = 2.0 * (2.0 * problem.reach_px).ln();
    Some(Reading {
        state: reading.state + gain * residual,
        covariance: 0.5 * (covariance + covariance.transpose()),
        cost: reading.cost + density - anywhere,
        chi2: reading.chi2 + chi2,
        edges: reading.edges + 1,
        information: reading.information + on_corners * by_corners,
        pull: reading.pull + on_corners * edge.offsets_px,
    })
}

/// The coordinates of corners, one after the other.
pub(super) fn flat(corners: &Corners) -> SVector<f64, 8> {
    SVector::from_fn(|i, _| corners.points()[i / 2][i % 2])
}
