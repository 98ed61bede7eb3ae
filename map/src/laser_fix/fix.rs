//! The pose by one scan with its error sources, or why there is none.

use crate::{
    localise::{AmbiguityResolvedBy, Fix, FixSource, Nuisance, NuisanceKey},
    pose2::Pose2Covariance,
};
use nalgebra::{Matrix2, Matrix3, Matrix3x2, Matrix3x6, Matrix6, SymmetricEigen};

/// Side of the squares of floor in which unnamed walls and the unevenness of all share one error,
/// metres: walls bow within a few metres.
const AREA_M: f64 = 2.0;

/// The robot's pose by one scan.
#[derive(Debug, Clone, PartialEq)]
pub struct LaserFix {
    /// `map_from_robot`, without the prior; the standard deviation is about 100 m where the walls
    /// determine nothing.
    pub pose: Pose2Covariance,
    /// The part of the covariance that is independent in every scan; the rest is the walls' own
    /// error.
    pub noise: Matrix3<f64>,
    /// The walls that affect it most.
    pub walls: Vec<WallPart>,
    /// Share of the scan's flat points with a wall, 0 to 1.
    pub matched: f64,
    /// Number of those points.
    pub points: usize,
    /// Root mean square of their distances across the walls, metres.
    pub rms_m: f64,
}

impl LaserFix {
    /// The fix for [`crate::fuse::Fuser::apply_fix`]: it rests on no landmark and cannot start or
    /// replace a pose. The errors of the most important walls are named one by one, those of all
    /// others as one for the place.
    pub fn fix(&self) -> Fix {
        let named = self.walls.iter().map(|part| {
            let mut jacobian = Matrix3x6::zeros();
            jacobian.fixed_columns_mut::<2>(0).copy_from(&part.by_wall);
            let mut covariance = Matrix6::zeros();
            covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&part.covariance);
            Nuisance { key: NuisanceKey::Wall(part.wall), jacobian, covariance }
        });
        let mut jacobian = Matrix3x6::zeros();
        jacobian.fixed_columns_mut::<3>(0).copy_from(&self.by_others());
        let mut covariance = Matrix6::zeros();
        covariance.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        let square = |v: f64| (v / AREA_M).floor() as i32;
        let key = NuisanceKey::Walls(square(self.pose.pose.x_m), square(self.pose.pose.y_m));
        let others = Nuisance { key, jacobian, covariance };
        Fix {
            modality: FixSource::Laser,
            pose: self.pose,
            noise: self.noise,
            nuisances: named.chain([others]).collect(),
            landmarks: Vec::new(),
            decided_by: AmbiguityResolvedBy::Prior,
            chi2: 0.0,
            dof: self.points.saturating_sub(3),
        }
    }

    /// Square root of the shared covariance that is not of the named walls.
    fn by_others(&self) -> Matrix3<f64> {
        let named: Matrix3<f64> = self.walls.iter().map(WallPart::spread).sum();
        let eigen = SymmetricEigen::new(self.pose.covariance - self.noise - named);
        let root = eigen.eigenvalues.map(|v| v.max(0.0).sqrt());
        eigen.eigenvectors * Matrix3::from_diagonal(&root) * eigen.eigenvectors.transpose()
    }
}

/// The effect of one wall's error on a fix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallPart {
    /// Hash of the wall's ends: the same in every scan, and in every version of a map that keeps
    /// the wall.
    pub wall: u64,
    /// Derivative of (x, y, theta) by the wall's (direction, offset) about its middle.
    pub by_wall: Matrix3x2<f64>,
    /// Covariance of (direction, offset).
    pub covariance: Matrix2<f64>,
}

impl WallPart {
    /// Its part of the fix's covariance.
    pub(super) fn spread(&self) -> Matrix3<f64> {
        let all = self.by_wall * self.covariance * self.by_wall.transpose();
        0.5 * (all + all.transpose())
    }
}

/// Why a scan gave no pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LaserRefusal {
    /// Too few returns from flat surfaces near walls.
    FewPoints {
        /// Number of such returns.
        points: usize,
    },
    /// The scan does not match the map.
    PoorMatch {
        /// Share of the points with a wall, 0 to 1.
        matched: f64,
    },
    /// The pose contradicts the prior.
    GatePrior {
        /// Squared Mahalanobis distance, 3 degrees of freedom.
        distance2: f64,
    },
    /// Several poses match.
    Ambiguous,
}
