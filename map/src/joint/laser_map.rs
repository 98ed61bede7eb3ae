//! The joint map of drives with a laser: walls, and the place of each object, in the frame of the
//! first laser map.

use super::{
    build::SurveyProblem,
    closures::weights,
    datum::{Datum, DriveFrame},
    laser_drive::{LaserDrive, Piece, SHARED},
    laser_drives::{Joined, JoinedSolution, LaserDrives},
    marginals::Marginals,
    params::JointParams,
    problem::JointError,
    shared_errors::{Placed, shared_errors},
    survey::CameraStated,
    variables::{CameraState, LandmarkState, OdometryErrors, Variable, WallLine},
};
use crate::{
    check::OutOfRange,
    digest::digest,
    fuse::FuseParams,
    place::{LandmarkPlace, SharedErrors, SurveyId},
    pose2::{Pose2, Pose2Covariance},
    segments::LaserSegment,
};
use nalgebra::{DMatrix, Matrix2, Matrix3, Matrix6, Point2, SVector};
use std::collections::BTreeMap;

/// Variables whose covariance is computed at once.
const AT_ONCE: usize = 32;
/// 99.9 % of chi2 with 2 degrees of freedom: beyond it a line alone, whose covariance is not
/// widened, may be of another wall.
const LINE_CHI2: f64 = 13.8;
/// Parameters of a landmark's variable that its place has a covariance of.
const OF_PLACE: [usize; 6] = [0, 1, 2, 3, 6, 7];

/// An object of a joint map.
#[derive(Debug, Clone, PartialEq)]
pub struct MappedObject {
    /// Where it hangs.
    pub place: LandmarkPlace,
    /// How well its views agree: their mean weight, 0 to 1.
    pub agreement: f64,
}

/// A wall of a joint map: a piece of one of the laser map's.
#[derive(Debug, Clone, PartialEq)]
pub struct MappedWall {
    /// The wall, map frame.
    pub segment: LaserSegment,
    /// Number of the wall of the laser map that it is a piece of.
    pub of: usize,
    /// Where it begins there, metres from the first end.
    pub from_m: f64,
}

/// The joint map of drives; covariances are relative to the datum.
#[derive(Debug, Clone)]
pub struct JointLaserMap {
    /// Walls.
    pub walls: Vec<MappedWall>,
    /// `map_from_robot` of every frame, those of later drives after those of earlier ones.
    pub frames: Vec<Pose2Covariance>,
    /// `map_from_robot` of every scan, in the same order.
    pub path: Vec<Pose2>,
    /// Objects in their order; `None` with too few views, or at no possible place.
    pub objects: Vec<Option<MappedObject>>,
    /// Pairs of objects of different drives that are one; each has its own place still.
    pub same: Vec<[usize; 2]>,
    /// The camera as estimated.
    pub camera: CameraState,
    /// Standard deviations of its rotation (radians), translation (metres), focal length, centre
    /// (px) and k1.
    pub camera_sigmas: SVector<f64, 10>,
    /// Odometry's systematic errors as estimated, of each drive.
    pub odometry: Vec<OdometryErrors>,
}

impl LaserDrives<'_> {
    /// Solves for walls, objects, camera and odometry together.
    pub fn joint_map(
        &self,
        camera: CameraStated,
        (params, odometry): (&JointParams, &FuseParams),
        datum: Datum,
    ) -> Result<JointLaserMap, JointError> {
        let mut joined = Joined::new(self, camera, odometry)?;
        let params = JointParams { line_doubt_chi2: Some(LINE_CHI2 / SHARED), ..params.clone() };
        let JoinedSolution { problem: solved, same } = joined.solved(&params)?;
        let camera = Marginals::of(&solved.problem, &[Variable::Camera(0)])?.into_covariance();
        let frame = match datum {
            Datum::FirstPose => None,
            Datum::WholeDrive => Some(DriveFrame::of(&solved.problem)?),
        };
        let solved = Solved { solved, frame };
        Ok(JointLaserMap {
            walls: walls(&solved, &joined)?,
            frames: frames(&solved, &joined.frames(&solved))?,
            path: joined.path(&solved),
            objects: objects(&solved)?,
            same,
            camera: solved.problem.state.cameras[0],
            camera_sigmas: SVector::from_fn(|i, _| camera[(i, i)].max(0.0).sqrt()),
            odometry: solved.problem.state.odometry.clone(),
        })
    }
}

impl LaserDrive<'_> {
    /// The joint map of this drive alone.
    pub fn joint_map(
        &self,
        camera: CameraStated,
        params: (&JointParams, &FuseParams),
        datum: Datum,
    ) -> Result<JointLaserMap, JointError> {
        LaserDrives { drives: &[*self], same: &[] }.joint_map(camera, params, datum)
    }
}

/// The solution, and the frame of the drive as a whole where that is the datum.
struct Solved {
    solved: SurveyProblem,
    frame: Option<DriveFrame>,
}

impl std::ops::Deref for Solved {
    type Target = SurveyProblem;

    fn deref(&self) -> &SurveyProblem {
        &self.solved
    }
}

impl Solved {
    /// The covariance of each variable; that of a fixed one relative to the first pose is zero.
    fn covariances(&self, variables: &[Variable]) -> Result<Vec<DMatrix<f64>>, JointError> {
        let problem = &self.problem;
        let mut made = Vec::with_capacity(variables.len());
        for some in variables.chunks(AT_ONCE) {
            let free: Vec<Variable> = some.iter().copied().filter(|v| !problem.fixed.contains(v)).collect();
            let marginals = Marginals::of(problem, &free)?;
            made.extend(some.iter().map(|&variable| {
                let zeros = || DMatrix::zeros(variable.size(), variable.size());
                let covariance = marginals.block(variable, variable).unwrap_or_else(zeros);
                let relative = |frame: &DriveFrame| frame.relative(&problem.state, variable, &covariance);
                self.frame.as_ref().map_or_else(|| covariance.clone(), relative)
            }));
        }
        Ok(made)
    }
}

fn frames(solved: &Solved, of_frame: &[usize]) -> Result<Vec<Pose2Covariance>, JointError> {
    let chosen: Vec<Variable> = of_frame.iter().map(|k| Variable::Keyframe(*k)).collect();
    let pose = |(keyframe, covariance): (&usize, DMatrix<f64>)| Pose2Covariance {
        pose: solved.problem.state.keyframes[*keyframe],
        covariance: Matrix3::from_fn(|r, c| covariance[(r, c)]),
    };
    Ok(of_frame.iter().zip(solved.covariances(&chosen)?).map(pose).collect())
}

fn objects(solved: &Solved) -> Result<Vec<Option<MappedObject>>, JointError> {
    let (agreements, _) = weights(solved);
    let known: Vec<usize> = solved.landmark_of.iter().flatten().copied().collect();
    let chosen: Vec<Variable> = known.iter().map(|landmark| Variable::Landmark(*landmark)).collect();
    let mut covariances = vec![Matrix6::zeros(); solved.problem.state.landmarks.len()];
    for (landmark, block) in known.iter().zip(solved.covariances(&chosen)?) {
        covariances[*landmark] = Matrix6::from_fn(|r, c| block[(OF_PLACE[r], OF_PLACE[c])]);
    }
    let sigma_m = |landmark: usize| (0.5 * covariances[landmark].fixed_view::<2, 2>(0, 0).trace()).sqrt();
    let placed: Vec<Placed> = known.iter().map(|landmark| (*landmark, sigma_m(*landmark))).collect();
    let shared = shared_errors(&solved.problem, solved.frame.as_ref(), &placed, &OF_PLACE)?;
    let centres = solved.problem.state.landmarks.iter().map(|landmark| landmark.centre);
    let survey = SurveyId(digest(centres.flat_map(|centre| [centre.x, centre.y, centre.z])));
    let shared_by: BTreeMap<usize, Matrix6<f64>> =
        known.iter().copied().zip(shared.into_iter().flatten()).collect();
    let made = |landmark: usize| {
        let shared = shared_by.get(&landmark).map(|by| SharedErrors { survey, by: *by });
        let place = place(&solved.problem.state.landmarks[landmark], &covariances[landmark], shared.as_ref());
        place.check().ok()?;
        Some(MappedObject { place, agreement: agreements[landmark] })
    };
    Ok(solved.landmark_of.iter().map(|landmark| landmark.and_then(made)).collect())
}

/// A landmark's place; `covariance` and `shared` are over x, y, theta, z, log width and log height.
fn place(
    landmark: &LandmarkState,
    covariance: &Matrix6<f64>,
    shared: Option<&SharedErrors>,
) -> LandmarkPlace {
    let size = landmark.size();
    let mut by = Matrix6::identity();
    (by[(4, 4)], by[(5, 5)]) = (size.width_m, size.height_m);
    let centre = landmark.centre;
    LandmarkPlace {
        x_m: centre.x,
        y_m: centre.y,
        z_m: centre.z,
        theta_rad: landmark.theta_rad,
        roll_rad: landmark.roll_rad,
        tilt_rad: 0.0,
        size,
        covariance: by * covariance * by,
        shared: shared.map(|shared| SharedErrors { by: by * shared.by, ..*shared }),
    }
}

/// The pieces of walls, each on its line; one that no line of a scan lies on moves with the nearest
/// keyframe.
fn walls(solved: &Solved, joined: &Joined<'_>) -> Result<Vec<MappedWall>, JointError> {
    let chosen: Vec<Variable> = solved.wall_of.values().map(|wall| Variable::Wall(*wall)).collect();
    let covariances: BTreeMap<usize, Matrix2<f64>> = solved
        .wall_of
        .keys()
        .zip(solved.covariances(&chosen)?)
        .map(|(piece, block)| (*piece, Matrix2::from_fn(|r, c| block[(r, c)])))
        .collect();
    let segment = |(number, drive, piece): (usize, usize, &Piece)| {
        let wall = joined.wall(drive, piece);
        let ends = joined.ends(solved, number);
        let segment = match (solved.wall_of.get(&number), covariances.get(&number)) {
            (Some(line), Some(covariance)) => on_line(&solved.problem.state.walls[*line], covariance, ends),
            _ => LaserSegment::about_middle(ends[0], ends[1], &wall.covariance_about_middle()),
        };
        let segment = LaserSegment { hits: wall.hits, ..segment.ok()? };
        Some(MappedWall { segment, of: joined.first_wall(drive) + piece.wall, from_m: piece.along_m[0] })
    };
    Ok(joined.pieces().filter_map(segment).collect())
}

/// The piece of a line between the feet of two points; `covariance` is that of the line.
fn on_line(
    line: &WallLine,
    covariance: &Matrix2<f64>,
    ends: [Point2<f64>; 2],
) -> Result<LaserSegment, OutOfRange> {
    let n = line.normal();
    let [a, b] = ends.map(|end| end - n * (n.dot(&(end - line.anchor)) - line.offset_m));
    // Offset about the middle of the piece, from that about the anchor.
    let by = Matrix2::new(1.0, 0.0, -line.along().dot(&(nalgebra::center(&a, &b) - line.anchor)), 1.0);
    let covariance = by * covariance * by.transpose();
    LaserSegment::about_middle(a, b, &(0.5 * (covariance + covariance.transpose())))
}
