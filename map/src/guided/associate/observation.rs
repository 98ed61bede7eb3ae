//! The quads observed in one image, each with the landmarks that it may be.

use crate::{check, guided::error::GuidedError};
use nalgebra::{Matrix2, SMatrix};
use vision::{geometry::Corners, model::LandmarkId};

/// Most observations of one image; a longer list is refused.
pub const MAX_OBSERVATIONS: usize = 32;
/// Most candidates of one observation; a longer list is refused. As many as a look-alike class may
/// have.
pub const MAX_CANDIDATES: usize = 512;
/// Largest evidence, nats; larger values are clamped.
const MAX_EVIDENCE_NATS: f64 = 1e6;

/// A landmark that an observation may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// Number of the landmark.
    pub landmark: LandmarkId,
    /// Picture evidence, nats: ln of p(picture, if it is this landmark) over p(picture, if it is
    /// none). Members of one look-alike class get the same value: what differs between them is not
    /// evidence.
    pub picture_nats: f64,
    /// Prior odds besides the predicted corners, nats; 0 where nothing is known.
    pub prior_nats: f64,
}

/// A quad observed in the image.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation {
    /// Corners in the landmark's order (TL, TR, BR, BL), px of the image as it comes. Of a landmark
    /// that the image border cuts, corners outside of the image come from alignment.
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

pub(super) fn check_input(observations: &[Observation]) -> Result<(), GuidedError> {
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
