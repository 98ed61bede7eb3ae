//! What drives give to the joint map: motions, lines and tracks of quads, already associated within
//! each passage, with candidates of what is the same.

use super::{
    problem::JointError,
    variables::{CameraState, WallLine},
};
use crate::pose2::Pose2;
use nalgebra::{Isometry3, Matrix2, Matrix3, Point2, SVector};
use vision::pose::LandmarkSize;

/// A motion between consecutive keyframes by odometry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// The measured motion in the frame of the first keyframe.
    pub motion: Pose2,
    /// Covariance of (x, y, theta) by random errors alone.
    pub covariance: Matrix3<f64>,
}

/// A line of a scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LineSeen {
    /// Keyframe, within the drive.
    pub keyframe: usize,
    /// Wall, of one passage.
    pub wall: usize,
    /// Direction of the facing normal in the robot frame, radians.
    pub facing_rad: f64,
    /// Offset from the robot along the normal, metres.
    pub offset_m: f64,
    /// Covariance of (facing, offset).
    pub covariance: Matrix2<f64>,
}

/// A quad in a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QuadView {
    /// Keyframe of the frame, within the drive.
    pub keyframe: usize,
    /// The camera in its mounting, by a head that turns it; identity where it is fixed.
    pub mounting_from_camera: Isometry3<f64>,
    /// Corners TL, TR, BR, BL as measured, px.
    pub corners_px: [Point2<f64>; 4],
    /// Covariance of each corner, px^2.
    pub covariance_px2: [Matrix2<f64>; 4],
}

/// Views of one object in one passage.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Track {
    /// Views.
    pub views: Vec<QuadView>,
    /// The wall that the object hangs on.
    pub wall: Option<usize>,
    /// A size that a person gave.
    pub size: Option<LandmarkSize>,
}

/// One drive.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DriveRecord {
    /// Motion from each keyframe to the next: one fewer than the keyframes.
    pub motions: Vec<Motion>,
    /// Lines.
    pub lines: Vec<LineSeen>,
    /// Tracks, numbered through over all drives of a survey.
    pub tracks: Vec<Track>,
}

/// A camera, and how far it is believed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraStated {
    /// Mounting and intrinsics.
    pub camera: CameraState,
    /// Standard deviations of rotation (radians), translation (metres), focal length, centre (px)
    /// and k1; `None` holds the camera.
    pub sigmas: Option<SVector<f64, 10>>,
}

/// A line of a floor plan in the frame of the map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanLine {
    /// Wall.
    pub wall: usize,
    /// The line.
    pub line: WallLine,
}

/// Drives through one building.
#[derive(Debug, Clone, PartialEq)]
pub struct Survey {
    /// Pose of the first keyframe, which fixes the frame of the map.
    pub start: Pose2,
    /// The camera of all drives.
    pub camera: CameraStated,
    /// Drives.
    pub drives: Vec<DriveRecord>,
    /// The wall that each wall of a passage is, by number; itself where no closure says otherwise.
    pub same_wall: Vec<usize>,
    /// Floor plan.
    pub plan: Vec<PlanLine>,
    /// Pairs of tracks that may be one object.
    pub candidates: Vec<[usize; 2]>,
}

impl Survey {
    /// One drive alone, in a frame of its own, without closures.
    pub(super) fn alone(&self, drive: usize) -> Self {
        Self {
            start: if drive == 0 { self.start } else { Pose2::default() },
            camera: self.camera,
            drives: vec![self.drives[drive].clone()],
            same_wall: (0..self.same_wall.len()).collect(),
            plan: Vec::new(),
            candidates: Vec::new(),
        }
    }

    /// Tracks of all drives, with the number of their drive.
    pub(super) fn tracks(&self) -> impl Iterator<Item = (usize, &Track)> {
        self.drives.iter().enumerate().flat_map(|(i, d)| d.tracks.iter().map(move |t| (i, t)))
    }

    /// Numbers of keyframes, walls and tracks that exist. Measurements are checked as factors.
    pub(super) fn check(&self) -> Result<(), JointError> {
        let walls = self.same_wall.len();
        let wrong = |field, what, number| Err(JointError::Survey { field, what, number });
        if let Some(i) = self.same_wall.iter().position(|w| *w >= walls) {
            return wrong("same_wall", "wall", i);
        }
        if let Some(i) = self.plan.iter().position(|p| p.wall >= walls) {
            return wrong("wall", "line of the plan", i);
        }
        let tracks = self.tracks().count();
        if let Some(i) = self.candidates.iter().position(|[a, b]| a == b || *a.max(b) >= tracks) {
            return wrong("track", "candidate", i);
        }
        for drive in &self.drives {
            let keyframes = drive.motions.len() + 1;
            if let Some(i) = drive.lines.iter().position(|l| l.keyframe >= keyframes) {
                return wrong("keyframe", "line", i);
            }
            if let Some(i) = drive.lines.iter().position(|l| l.wall >= walls) {
                return wrong("wall", "line", i);
            }
            let strays = |t: &Track| t.views.iter().any(|v| v.keyframe >= keyframes);
            if let Some(i) = drive.tracks.iter().position(strays) {
                return wrong("keyframe", "track", i);
            }
            if let Some(i) = drive.tracks.iter().position(|t| t.wall.is_some_and(|w| w >= walls)) {
                return wrong("wall", "track", i);
            }
        }
        Ok(())
    }
}
