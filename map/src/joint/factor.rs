//! A factor: its whitened residual with the derivatives by its variables, and the width of its
//! robust kernel.

use super::{
    factors::{
        camera_prior::CameraPrior,
        hanging::{Level, OnWall, UnderCeiling},
        line::LineFit,
        odometry::{OdometryMotion, OdometryPrior},
        reprojection::LandmarkView,
        same_object::SameObject,
        scan_match,
        summary::Summary,
        wall_prior::{SizePrior, WallPrior},
    },
    variables::{State, Variable},
};
use crate::slam::graph::PoseConstraint;
use nalgebra::{DMatrix, DVector};

/// Whitened residual and derivatives of one factor.
#[derive(Debug, Clone, PartialEq)]
pub struct Linearised {
    /// Residual over its standard deviation.
    pub residual: DVector<f64>,
    /// Derivative of the residual by each variable, rows by parameters.
    pub by: Vec<(Variable, DMatrix<f64>)>,
}

/// A term of the cost.
#[derive(Debug, Clone, PartialEq)]
pub enum Factor {
    /// Measured motion between two keyframes.
    Odometry(OdometryMotion),
    /// Prior of the odometry errors of a drive.
    OdometryPrior(OdometryPrior),
    /// Relative pose of two keyframes by their scans.
    ScanMatch(PoseConstraint),
    /// A wall's line in a scan.
    Line(LineFit),
    /// A wall by a floor plan.
    WallPrior(WallPrior),
    /// The corners of a landmark in a frame.
    View(LandmarkView),
    /// A landmark hangs on a wall.
    OnWall(OnWall),
    /// A landmark hangs under a ceiling.
    UnderCeiling(UnderCeiling),
    /// A landmark hangs level.
    Level(Level),
    /// Two tracks are one object.
    Same(SameObject),
    /// Prior of a camera.
    Camera(CameraPrior),
    /// A known size.
    Size(SizePrior),
    /// What earlier drives left.
    Summary(Box<Summary>),
}

/// Factors on the width of robust kernels (graduated non-convexity).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kernels {
    /// Of views and lines.
    pub views: f64,
    /// Of identities, and of landmarks on walls.
    pub identities: f64,
}

impl Kernels {
    /// The widths that a solution ends with.
    pub const NARROW: Self = Self { views: 1.0, identities: 1.0 };
}

/// 99.9 % of chi2 with 8, 6 and 2 degrees of freedom: beyond it the weight of a view, of an
/// identity and of a landmark on its wall falls off.
const VIEW_CHI2: f64 = 26.1;
pub(super) const SAME_CHI2: f64 = 22.5;
const ON_WALL_CHI2: f64 = 13.8;

impl Factor {
    /// Variables, in the order of the derivatives.
    pub fn variables(&self) -> Vec<Variable> {
        use Variable::{Camera, Ceiling, Keyframe, Landmark, Odometry, Wall};
        match self {
            Self::Odometry(f) => vec![Keyframe(f.from), Keyframe(f.to), Odometry(f.drive)],
            Self::OdometryPrior(f) => vec![Odometry(f.drive)],
            Self::ScanMatch(f) => vec![Keyframe(f.from), Keyframe(f.to)],
            Self::Line(f) => vec![Keyframe(f.keyframe), Wall(f.wall)],
            Self::WallPrior(f) => vec![Wall(f.wall)],
            Self::View(f) => vec![Keyframe(f.keyframe), Landmark(f.landmark), Camera(f.camera)],
            Self::OnWall(f) => vec![Landmark(f.landmark), Wall(f.wall)],
            Self::UnderCeiling(f) => vec![Landmark(f.landmark), Ceiling(f.ceiling)],
            Self::Level(f) => vec![Landmark(f.landmark)],
            Self::Same(f) => vec![Landmark(f.a), Landmark(f.b)],
            Self::Camera(f) => vec![Camera(f.camera)],
            Self::Size(f) => vec![Landmark(f.landmark)],
            Self::Summary(f) => f.variables(),
        }
    }

    /// Residual and derivatives.
    pub fn linearised(&self, state: &State) -> Linearised {
        let (residual, by) = match self {
            Self::Odometry(f) => f.linearised(state),
            Self::OdometryPrior(f) => f.linearised(state),
            Self::ScanMatch(f) => scan_match::linearised(f, state),
            Self::Line(f) => f.linearised(state),
            Self::WallPrior(f) => f.linearised(state),
            Self::View(f) => f.linearised(state),
            Self::OnWall(f) => f.linearised(state),
            Self::UnderCeiling(f) => f.linearised(state),
            Self::Level(f) => f.linearised(state),
            Self::Same(f) => f.linearised(state),
            Self::Camera(f) => f.linearised(state),
            Self::Size(f) => f.linearised(state),
            Self::Summary(f) => f.linearised(state),
        };
        Linearised { residual, by: self.variables().into_iter().zip(by).collect() }
    }

    /// Beyond this chi2 the weight falls off; `None` for a factor that is believed.
    pub(super) fn doubt_chi2(&self, kernels: &Kernels) -> Option<f64> {
        match self {
            Self::View(_) => Some(VIEW_CHI2 * kernels.views),
            Self::Same(_) => Some(SAME_CHI2 * kernels.identities),
            Self::OnWall(_) => Some(ON_WALL_CHI2 * kernels.identities),
            Self::Line(f) => f.doubt_chi2.map(|chi2| chi2 * kernels.views),
            Self::ScanMatch(f) => f.doubt_chi2,
            _ => None,
        }
    }

    /// Whether all its numbers are finite and its spreads possible.
    pub(super) fn is_valid(&self) -> bool {
        match self {
            Self::Odometry(f) => f.is_valid(),
            Self::OdometryPrior(f) => f.is_valid(),
            Self::ScanMatch(f) => scan_match::is_valid(f),
            Self::Line(f) => f.is_valid(),
            Self::WallPrior(f) => f.is_valid(),
            Self::View(f) => f.is_valid(),
            Self::OnWall(f) => f.is_valid(),
            Self::UnderCeiling(f) => f.is_valid(),
            Self::Level(f) => f.is_valid(),
            Self::Same(f) => f.is_valid(),
            Self::Camera(f) => f.is_valid(),
            Self::Size(f) => f.is_valid(),
            Self::Summary(f) => f.is_valid(),
        }
    }
}
