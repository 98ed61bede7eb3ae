//! A chosen quad in, the same with sides refitted on all samples out.

use crate::detect::{
    edge_support::{
        gradients::Gradients,
        side_support::{EdgeProbeParams, MAX_SAMPLES},
    },
    params::QuadParams,
    quad::Quad,
    refine::corners::refine,
};

/// Refits a chosen quad with all samples. A quad of a coarser scale may have no edges here: then it
/// is returned unchanged.
pub fn refit_corners(quad: Quad, g: &Gradients, p: &QuadParams) -> Quad {
    let search = EdgeProbeParams {
        reach_px: p.refit_reach_px,
        min_step: p.min_step,
        samples: MAX_SAMPLES,
        between_pixels: true,
        least_support: 0.0,
    };
    match refine(g, quad.corners_px.points(), search) {
        Some(refined) if refined.min_support() >= p.min_side_support => Quad {
            corners_px: refined.corners_px,
            corner_covariance_px2: refined.covariance_px2,
            side_support: refined.support(),
            side_clipped: refined.clipped,
            upright_ambiguous: refined.upright_ambiguous,
            ..quad
        },
        _ => quad,
    }
}
