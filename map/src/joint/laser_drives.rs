//! Drives with lasers through one building as one survey: each is solved alone, laid on those
//! before it by the objects that both saw, and then solved with them. Lines of a later drive that
//! lie on a wall of an earlier one are of that wall.

use super::{
    build::SurveyProblem,
    laser_drive::{DriveSurvey, LaserDrive, Piece, line_seen, piece_of},
    params::JointParams,
    problem::JointError,
    survey::{CameraStated, DriveRecord, LineSeen, Survey},
    survey_map::{CONTRADICTED, Candidates, Closure, opened_from},
};
use crate::{fuse::FuseParams, pose2::Pose2, segments::LaserSegment, slam::MapKey};
use nalgebra::{Matrix2, Point2};
use std::collections::BTreeMap;

/// Fewest objects by which a drive is laid on those before it: one may be a wrong identity.
const MIN_COMMON: usize = 2;

/// Drives of one camera through one building.
#[derive(Debug, Clone, Copy)]
pub struct LaserDrives<'a> {
    /// The drives; the first pose of the first is the frame.
    pub drives: &'a [LaserDrive<'a>],
    /// Pairs of objects that may be one, numbered through over all drives.
    pub same: &'a [[usize; 2]],
}

/// All drives as one survey.
pub(super) struct Joined<'a> {
    drives: &'a [LaserDrive<'a>],
    made: Vec<DriveSurvey>,
    survey: Survey,
    /// Of each drive, in the numbers of the survey.
    first_piece: Vec<usize>,
    /// Pieces of later drives that are walls of earlier ones.
    covered: Vec<bool>,
}

/// The solution of all drives.
pub(super) struct JoinedSolution {
    pub(super) problem: SurveyProblem,
    /// Pairs of objects that are one.
    pub(super) same: Vec<[usize; 2]>,
}

impl<'a> Joined<'a> {
    pub(super) fn new(
        of: &LaserDrives<'a>,
        camera: CameraStated,
        odometry: &FuseParams,
    ) -> Result<Self, JointError> {
        let made = of.drives.iter().map(|drive| drive.survey(camera, odometry));
        let made: Vec<DriveSurvey> = made.collect::<Result<_, _>>()?;
        let mut first_piece = Vec::new();
        let (mut pieces, mut records) = (0, Vec::new());
        for one in &made {
            first_piece.push(pieces);
            records.extend(one.survey.drives.iter().map(|record| numbered_on(record, pieces)));
            pieces += one.pieces.len();
        }
        let survey = Survey {
            start: made.first().map_or_else(Pose2::default, |first| first.survey.start),
            camera,
            drives: records,
            same_wall: (0..pieces).collect(),
            plan: Vec::new(),
            candidates: of.same.to_vec(),
        };
        Ok(Self { drives: of.drives, made, survey, first_piece, covered: vec![false; pieces] })
    }

    /// Solves all. Errors: a drive that shares too few objects with those before it.
    pub(super) fn solved(&mut self, params: &JointParams) -> Result<JoinedSolution, JointError> {
        let alone =
            |drive| opened_from(&self.survey.alone(drive), params, self.made[drive].keyframes.clone());
        let mut opened: Vec<SurveyProblem> = (0..self.made.len()).map(alone).collect::<Result<_, _>>()?;
        if opened.len() == 1 {
            return Ok(JoinedSolution { problem: opened.remove(0), same: Vec::new() });
        }
        let keyframes = opened.iter().flat_map(|one| one.problem.state.keyframes.clone()).collect();
        let laid = Candidates::new(&self.survey, &opened, params)?;
        let keyframes = laid.in_one_frame(&opened, keyframes);
        let mut joint = SurveyProblem::new(&self.survey, params, Some(keyframes))?;
        let closures = laid.settled(&self.survey, &mut joint, params)?;
        let same = self.common(&closures)?;
        self.share_walls(&joint);
        let keyframes = joint.problem.state.keyframes;
        let mut problem = SurveyProblem::new(&self.survey, params, Some(keyframes))?;
        let distances_m = vec![0.0; same.len()];
        let closures =
            Candidates::by_distance(same, &distances_m).settled(&self.survey, &mut problem, params)?;
        let same = self.common(&closures)?;
        Ok(JoinedSolution { problem, same })
    }

    /// The drive of an object.
    fn drive_of(&self, object: usize) -> usize {
        let mut end = 0;
        let of = self.survey.drives.iter().position(|drive| {
            end += drive.tracks.len();
            object < end
        });
        of.unwrap_or_default()
    }

    /// The pairs that nothing contradicts. Errors: a drive with too few of them.
    fn common(&self, closures: &[Closure]) -> Result<Vec<[usize; 2]>, JointError> {
        let kept = closures.iter().filter(|closure| closure.weight > CONTRADICTED);
        let same: Vec<[usize; 2]> = kept.map(|closure| closure.tracks).collect();
        for drive in 1..self.made.len() {
            let of = |pair: &&[usize; 2]| {
                let [a, b] = pair.map(|object| self.drive_of(object));
                a.max(b) == drive && a != b
            };
            let common = same.iter().filter(of).count();
            if common < MIN_COMMON {
                return Err(JointError::Apart { drive: drive + 1, common });
            }
        }
        Ok(same)
    }

    /// Gives lines of later drives to the walls of earlier ones that they lie on. A piece most of
    /// whose lines went is no wall of its own any more.
    fn share_walls(&mut self, joint: &SurveyProblem) {
        let (mut segments, mut numbers) = (Vec::new(), Vec::new());
        for drive in 0..self.made.len() {
            if drive > 0 {
                self.lines_on(drive, joint, (&segments, &numbers));
            }
            let own = self.first_piece[drive]..self.first_piece[drive] + self.made[drive].pieces.len();
            for piece in own.filter(|piece| !self.covered[*piece]) {
                let ends = self.ends(joint, piece);
                if let Ok(segment) = LaserSegment::about_middle(ends[0], ends[1], &Matrix2::identity()) {
                    segments.push(segment);
                    numbers.push(piece);
                }
            }
        }
    }

    /// `numbers`: those of the pieces that `segments` are.
    fn lines_on(
        &mut self,
        drive: usize,
        joint: &SurveyProblem,
        (segments, numbers): (&[LaserSegment], &[usize]),
    ) {
        let whole =
            |(wall, segment): (usize, &LaserSegment)| Piece { wall, along_m: [0.0, segment.length_m()] };
        let pieces: Vec<Piece> = segments.iter().enumerate().map(whole).collect();
        let (made, first) = (&self.made[drive], self.first_piece[drive]);
        let map = self.drives[drive].map;
        let mut found: Vec<(&LaserSegment, usize, usize, Option<usize>)> = Vec::new();
        for (key, &keyframe) in map.keys.iter().zip(&made.of_key) {
            let pose = joint.problem.state.keyframes[joint.first_keyframe[drive] + keyframe];
            let on = |line: &'_ LaserSegment| {
                let MapKey { pose: before, .. } = key;
                let own = first + piece_of(line, &before.pose, &map.walls, &made.pieces)?;
                Some((own, piece_of(line, &pose, segments, &pieces).map(|i| numbers[i])))
            };
            found.extend(key.lines.iter().filter_map(|line| {
                let (own, common) = on(line)?;
                Some((line, keyframe, own, common))
            }));
        }
        let mut gone: BTreeMap<usize, (usize, BTreeMap<usize, usize>)> = BTreeMap::new();
        for (_, _, own, common) in &found {
            let (all, to) = gone.entry(*own).or_default();
            *all += 1;
            if let Some(wall) = common {
                *to.entry(*wall).or_default() += 1;
            }
        }
        let mut instead = BTreeMap::new();
        for (own, (all, to)) in gone {
            if 2 * to.values().sum::<usize>() > all {
                self.covered[own] = true;
                instead.extend(to.into_iter().max_by_key(|(_, count)| *count).map(|(wall, _)| (own, wall)));
            }
        }
        let line = |(line, keyframe, own, common): &(&LaserSegment, usize, usize, Option<usize>)| {
            let stays = (!self.covered[*own]).then_some(*own);
            Some(line_seen(line, *keyframe, common.or(stays)?))
        };
        let lines: Vec<LineSeen> = found.iter().filter_map(line).collect();
        let record = &mut self.survey.drives[drive];
        record.lines = lines;
        for track in &mut record.tracks {
            track.wall = track.wall.map(|wall| instead.get(&wall).copied().unwrap_or(wall));
        }
    }

    /// Pieces that are walls, with what they are a piece of: drive, and wall in its laser map.
    pub(super) fn pieces(&self) -> impl Iterator<Item = (usize, usize, &Piece)> {
        let of_drive = |(drive, made): (usize, &'_ DriveSurvey)| {
            let first = self.first_piece[drive];
            (first..first + made.pieces.len()).map(move |number| (number, drive))
        };
        let all = self.made.iter().enumerate().flat_map(of_drive);
        let walls = all.filter(|(number, _)| !self.covered[*number]);
        walls.map(|(number, drive)| {
            (number, drive, &self.made[drive].pieces[number - self.first_piece[drive]])
        })
    }

    /// The wall of a laser map that a piece is of.
    pub(super) fn wall(&self, drive: usize, piece: &Piece) -> &'a LaserSegment {
        &self.drives[drive].map.walls[piece.wall]
    }

    /// Number of the first wall of a drive, numbered through.
    pub(super) fn first_wall(&self, drive: usize) -> usize {
        self.drives[..drive].iter().map(|drive| drive.map.walls.len()).sum()
    }

    /// Ends of a piece as the solution moved them, each with the keyframe that was nearest.
    pub(super) fn ends(&self, joint: &SurveyProblem, number: usize) -> [Point2<f64>; 2] {
        let drive = self.first_piece.partition_point(|first| *first <= number).saturating_sub(1);
        let made = &self.made[drive];
        let piece = &made.pieces[number - self.first_piece[drive]];
        let wall = self.wall(drive, piece);
        let after = &joint.problem.state.keyframes[joint.first_keyframe[drive]..];
        let moved = |along: f64| {
            let at = wall.a + wall.direction() * along;
            let away = |i: &usize| (made.keyframes[*i].position() - at.coords).norm_squared();
            let nearest = (0..made.keyframes.len()).min_by(|a, b| away(a).total_cmp(&away(b)));
            nearest.map_or(at, |i| after[i].apply(&made.keyframes[i].inverse().apply(&at)))
        };
        piece.along_m.map(moved)
    }

    /// Keyframe of each frame of all drives.
    pub(super) fn frames(&self, joint: &SurveyProblem) -> Vec<usize> {
        let of = |(drive, first): (&DriveSurvey, &usize)| {
            let first = *first;
            drive.of_frame.iter().map(move |keyframe| first + keyframe).collect::<Vec<_>>()
        };
        self.made.iter().zip(&joint.first_keyframe).flat_map(of).collect()
    }

    /// Pose of each scan of all drives: every scan moves with the keyframe before it.
    pub(super) fn path(&self, joint: &SurveyProblem) -> Vec<Pose2> {
        let mut path = Vec::new();
        for ((drive, made), first) in self.drives.iter().zip(&self.made).zip(&joint.first_keyframe) {
            let map = drive.map;
            path.extend(map.path.iter().enumerate().map(|(scan, pose)| {
                let key = map.keys.partition_point(|key| key.scan <= scan).saturating_sub(1);
                let keyframe = joint.problem.state.keyframes[first + made.of_key[key]];
                keyframe.compose(&map.keys[key].pose.pose.between(pose))
            }));
        }
        path
    }
}

/// A record whose walls are numbered from this on.
fn numbered_on(record: &DriveRecord, first: usize) -> DriveRecord {
    let mut record = record.clone();
    record.lines.iter_mut().for_each(|line| line.wall += first);
    record.tracks.iter_mut().for_each(|track| track.wall = track.wall.map(|wall| wall + first));
    record
}
