//! A drive with a laser as the joint map reads it: the keyframes of a finished laser map and the
//! frames between them in the order of time, each line with the piece of wall that it lies on.

use super::{
    problem::JointError,
    survey::{CameraStated, DriveRecord, LineSeen, Motion, QuadView, Survey, Track},
};
use crate::{
    fuse::FuseParams,
    pose2::{Pose2, wrap_rad},
    segments::LaserSegment,
    slam::SlamMap,
    walls::{WallParams, local},
};
use nalgebra::{Matrix2, Matrix3, Point2};

/// A piece of wall is no longer than this, metres: real walls bow, and one line over 30 m would
/// claim a heading that is not there.
const LONGEST_PIECE_M: f64 = 7.0;
/// A line belongs to a wall within this distance (metres) and angle (radians) of it...
const NEAR_M: f64 = 0.15;
const NEAR_RAD: f64 = 0.06;
/// ...and this far beyond its ends, metres.
const BEYOND_M: f64 = 0.3;
/// So many keyframes see a wall from about the same place, and its unevenness there is one error.
pub(super) const SHARED: f64 = 2.0;
/// Standard deviation of a motion besides, for one of nothing: metres and radians.
const STILL: f64 = 1e-4;

/// When and where a frame was captured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameSeen {
    /// Capture time, ns.
    pub captured_ns: i64,
    /// Odometry of that time.
    pub odom: Pose2,
}

/// An object's quads in one drive.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ObjectSeen {
    /// Quads, each with the number of its frame in place of a keyframe.
    pub views: Vec<QuadView>,
    /// The wall of the laser map that it hangs on, and how far from its first end, metres.
    pub on_wall: Option<(usize, f64)>,
}

/// A drive: a finished laser map with the times of its scans (ns), frames and objects.
#[derive(Debug, Clone, Copy)]
pub struct LaserDrive<'a> {
    /// The laser map.
    pub map: &'a SlamMap,
    /// Capture time of each scan, ns.
    pub scans_ns: &'a [i64],
    /// Frames, in the order of time.
    pub frames: &'a [FrameSeen],
    /// Objects.
    pub objects: &'a [ObjectSeen],
}

/// A survey of one drive, with its start values.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct DriveSurvey {
    pub(super) survey: Survey,
    /// Keyframes by the laser map.
    pub(super) keyframes: Vec<Pose2>,
    /// Keyframe of each of the laser map's.
    pub(super) of_key: Vec<usize>,
    /// Keyframe of each frame.
    pub(super) of_frame: Vec<usize>,
    /// Walls of the survey: pieces of the laser map's.
    pub(super) pieces: Vec<Piece>,
}

/// A piece of a wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Piece {
    /// Number of the wall in the laser map.
    pub(super) wall: usize,
    /// From its first end on, metres.
    pub(super) along_m: [f64; 2],
}

/// Keyframes and frames of a drive in the order of time.
#[derive(Debug, Default)]
struct Keyframes {
    /// By the laser map.
    poses: Vec<Pose2>,
    motions: Vec<Motion>,
    of_key: Vec<usize>,
    of_frame: Vec<usize>,
}

impl LaserDrive<'_> {
    /// The survey, and where it starts. Odometry's random errors are those of `odometry`.
    pub(super) fn survey(
        &self,
        camera: CameraStated,
        odometry: &FuseParams,
    ) -> Result<DriveSurvey, JointError> {
        let wrong = |field, number| JointError::Survey { field, what: "laser map", number };
        if self.map.keys.is_empty() {
            return Err(wrong("keys", 0));
        }
        if let Some(i) = self.map.keys.iter().position(|key| key.scan >= self.scans_ns.len()) {
            return Err(wrong("scan", i));
        }
        let pieces = pieces(&self.map.walls);
        let Keyframes { poses, motions, of_key, of_frame } = self.keyframes(odometry);
        let mut lines = Vec::new();
        for (key, keyframe) in self.map.keys.iter().zip(of_key.iter().copied()) {
            let on = |line: &LaserSegment| piece_of(line, &key.pose.pose, &self.map.walls, &pieces);
            lines.extend(key.lines.iter().filter_map(|line| Some(line_seen(line, keyframe, on(line)?))));
        }
        let view = |view: &QuadView| {
            let keyframe = *of_frame.get(view.keyframe).ok_or(wrong("frame", view.keyframe))?;
            Ok::<_, JointError>(QuadView { keyframe, ..*view })
        };
        let track = |object: &ObjectSeen| {
            let views = object.views.iter().map(view).collect::<Result<_, _>>()?;
            let wall = object.on_wall.and_then(|(wall, along_m)| piece_at(wall, along_m, &pieces));
            Ok(Track { views, wall, size: None })
        };
        let tracks = self.objects.iter().map(track).collect::<Result<_, JointError>>()?;
        let survey = Survey {
            start: poses[0],
            camera,
            drives: vec![DriveRecord { motions, lines, tracks }],
            same_wall: (0..pieces.len()).collect(),
            plan: Vec::new(),
            candidates: Vec::new(),
        };
        Ok(DriveSurvey { survey, keyframes: poses, of_key, of_frame, pieces })
    }

    /// A scan and a frame of one time are one keyframe.
    fn keyframes(&self, odometry: &FuseParams) -> Keyframes {
        let keys = self.map.keys.iter().enumerate();
        let keys = keys.map(|(i, key)| (self.scans_ns[key.scan], (true, i), key.odom));
        let frames = self.frames.iter().enumerate();
        let frames = frames.map(|(i, frame)| (frame.captured_ns, (false, i), frame.odom));
        let mut events: Vec<(i64, (bool, usize), Pose2)> = keys.chain(frames).collect();
        // Stable: at one time the scan is first.
        events.sort_by_key(|event| event.0);
        let mut made = Keyframes { of_frame: vec![0; self.frames.len()], ..Keyframes::default() };
        let mut before: Option<(i64, Pose2)> = None;
        let mut key = &self.map.keys[0];
        for (at_ns, (is_key, number), odom) in events {
            if is_key {
                key = &self.map.keys[number];
            }
            if before.is_none_or(|(then_ns, _)| then_ns != at_ns) {
                if let Some((_, then)) = before {
                    let motion = then.between(&odom);
                    let still = Matrix3::identity() * (STILL * STILL);
                    let covariance = odometry.motion_noise(&motion) + still;
                    made.motions.push(Motion { motion, covariance });
                }
                made.poses.push(key.pose.pose.compose(&key.odom.between(&odom)));
                before = Some((at_ns, odom));
            }
            let keyframe = made.poses.len() - 1;
            if is_key {
                made.of_key.push(keyframe);
            } else {
                made.of_frame[number] = keyframe;
            }
        }
        made
    }
}

fn pieces(walls: &[LaserSegment]) -> Vec<Piece> {
    let cut = |(wall, segment): (usize, &LaserSegment)| {
        let count = (segment.length_m() / LONGEST_PIECE_M).ceil().max(1.0);
        let length_m = segment.length_m() / count;
        let piece = move |i: usize| [i as f64 * length_m, (i + 1) as f64 * length_m];
        (0..count as usize).map(move |i| Piece { wall, along_m: piece(i) })
    };
    walls.iter().enumerate().flat_map(cut).collect()
}

/// The piece of a wall that is nearest to a point along it.
fn piece_at(wall: usize, along_m: f64, pieces: &[Piece]) -> Option<usize> {
    let off = |i: &usize| (along_m - 0.5 * (pieces[*i].along_m[0] + pieces[*i].along_m[1])).abs();
    let of_wall = (0..pieces.len()).filter(|i| pieces[*i].wall == wall);
    of_wall.min_by(|a, b| off(a).total_cmp(&off(b)))
}

/// The piece of wall that a line of a scan from this pose lies on.
pub(super) fn piece_of(
    line: &LaserSegment,
    pose: &Pose2,
    walls: &[LaserSegment],
    pieces: &[Piece],
) -> Option<usize> {
    let middle = pose.apply(&nalgebra::center(&line.a, &line.b));
    let facing = line.facing();
    let facing_rad = wrap_rad(facing.y.atan2(facing.x) + pose.theta_rad);
    let off_m = |piece: &Piece| {
        let wall = &walls[piece.wall];
        let from = middle - wall.a;
        let (along, off) = (wall.direction().dot(&from), wall.facing().dot(&from).abs());
        let turned = wrap_rad(wall.facing().y.atan2(wall.facing().x) - facing_rad).abs();
        let [low, high] = piece.along_m;
        let is_there = (low - BEYOND_M..=high + BEYOND_M).contains(&along);
        (is_there && off <= NEAR_M && turned <= NEAR_RAD)
            .then(|| off + (low - along).max(along - high).max(0.0))
    };
    let near = pieces.iter().enumerate().filter_map(|(i, piece)| Some((i, off_m(piece)?)));
    near.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _)| i)
}

/// A line as measured from the robot, with the unevenness of walls.
pub(super) fn line_seen(line: &LaserSegment, keyframe: usize, wall: usize) -> LineSeen {
    let (at, covariance) = local(line, &Point2::origin());
    let p = WallParams::default();
    let middle = nalgebra::center(&line.a, &line.b).coords;
    let facing = line.facing();
    // About the middle of the line: an offset there and a turn are independent.
    let along = nalgebra::Vector2::new(-facing.y, facing.x).dot(&middle);
    let (turn, offset) = (SHARED * p.rough_rad.powi(2), SHARED * p.rough_m.powi(2));
    let rough = Matrix2::new(turn, along * turn, along * turn, along * along * turn + offset);
    LineSeen { keyframe, wall, facing_rad: at.x, offset_m: at.y, covariance: covariance + rough }
}
