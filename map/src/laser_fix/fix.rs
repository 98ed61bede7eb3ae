//! The pose by one scan with its error sources, or why there is none.

use crate::{
    localise::{AmbiguityResolvedBy, Fix, FixSource, Nuisance, NuisanceKey},
    pose2::Pose2Covariance,
};
use nalgebra::{Matrix2, Matrix3, Matrix3x2, Matrix3x6, Matrix6, SymmetricEigen};

/// Side of the squares of floor in which all other walls err alike.
const AREA_M: f64 = 10.0;

/// The robot's pose by one scan.
#[derive(Debug, Clone, PartialEq)]
pub struct LaserFix {
    /// `map_from_robot`, without the prior: along what the walls do not tell its variance is some 100 m.
    pub pose: Pose2Covariance,
    /// The part of its covariance that is new in every scan; the rest is the walls' own and lasts.
    pub noise: Matrix3<f64>,
    /// The walls that move it most.
    pub walls: Vec<WallPart>,
    /// Share of the scan's flat points on a wall.
    pub matched: f64,
    /// How many points that are.
    pub points: usize,
    /// Root mean square of their distances across the walls.
    pub rms_m: f64,
}

impl LaserFix {
    /// For [`crate::fuse::Fuser::fix`]: rests on no landmark, and cannot start or replace a pose by itself. What walls
    /// are wrong by lasts: each of the most important is named, the others count as one about a place.
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

    /// The root of what lasts of the covariance and is not of the named walls.
    fn by_others(&self) -> Matrix3<f64> {
        let named: Matrix3<f64> = self.walls.iter().map(WallPart::spread).sum();
        let eigen = SymmetricEigen::new(self.pose.covariance - self.noise - named);
        let root = eigen.eigenvalues.map(|v| v.max(0.0).sqrt());
        eigen.eigenvectors * Matrix3::from_diagonal(&root) * eigen.eigenvectors.transpose()
    }
}

/// What the error of one wall does to a fix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallPart {
    /// Names the wall by its place: the same in every scan and in every version of a map that keeps it.
    pub wall: u64,
    /// Derivative of (x, y, theta) by the wall's (direction, offset) about its middle.
    pub by_wall: Matrix3x2<f64>,
    /// Covariance of those.
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
        /// How many there were.
        points: usize,
    },
    /// The scan shows something else than the map.
    Unlike {
        /// Share of the points that have a wall.
        matched: f64,
    },
    /// The pose contradicts the prior.
    Prior {
        /// Squared Mahalanobis distance.
        distance2: f64,
    },
    /// Several poses fit.
    Ambiguous,
}
