//! Errors of a map against the truth, in the frame of the first keyframe.

use super::{
    building::{Building, NAMED},
    drive::SimulatedDrive,
    passages::LabelledSurvey,
};
use map::{
    joint::{CameraState, JointError, LandmarkState, Marginals, SAME_PARAMETERS, SurveyMap, Variable},
    pose2::{Pose2, wrap_rad},
};
use nalgebra::{Matrix6, Rotation2, SVector, Vector2, Vector6};
use std::collections::BTreeMap;

/// Keyframes before the end that are no end of a loop.
const NOT_A_LOOP: usize = 20;

/// An object's landmark.
#[derive(Debug, Clone)]
pub(super) struct Placed {
    pub(super) object: usize,
    /// Its variable.
    pub(super) variable: usize,
    pub(super) landmark: LandmarkState,
    /// Over x, y, theta, z, log width, log height.
    pub(super) covariance: Option<Matrix6<f64>>,
}

/// Errors of one map, or of many together.
#[derive(Debug, Clone, Default)]
pub(super) struct Figures {
    /// Landmarks on the floor, metres: in the frame of the first keyframe, after rigid alignment,
    /// with scale.
    pub(super) landmark_m: Vec<f64>,
    pub(super) aligned_m: Vec<f64>,
    pub(super) scaled_m: Vec<f64>,
    /// Signed errors of the sides, %.
    pub(super) size_percent: Vec<f64>,
    pub(super) facing_deg: Vec<f64>,
    pub(super) wall_m: Vec<f64>,
    pub(super) loop_m: Vec<f64>,
    /// Distances of landmarks from those of all drives at once.
    pub(super) apart_m: Vec<f64>,
    /// Mounting: rotation; translation on the floor; focal length.
    pub(super) mounting_deg: Vec<f64>,
    pub(super) mounting_m: Vec<f64>,
    pub(super) focal_percent: Vec<f64>,
    /// Normalised estimation error squared by degree of freedom.
    pub(super) landmark_nees: Vec<f64>,
    pub(super) wall_nees: Vec<f64>,
    pub(super) camera_nees: Vec<f64>,
    /// Wrong candidates and those kept; right ones and those lost.
    pub(super) wrong: usize,
    pub(super) wrong_kept: usize,
    pub(super) right: usize,
    pub(super) right_lost: usize,
    /// Maps that could not be solved.
    pub(super) failed: usize,
}

impl Figures {
    pub(super) fn add(&mut self, other: Self) {
        for (all, more) in [
            (&mut self.landmark_m, other.landmark_m),
            (&mut self.aligned_m, other.aligned_m),
            (&mut self.scaled_m, other.scaled_m),
            (&mut self.size_percent, other.size_percent),
            (&mut self.facing_deg, other.facing_deg),
            (&mut self.wall_m, other.wall_m),
            (&mut self.loop_m, other.loop_m),
            (&mut self.apart_m, other.apart_m),
            (&mut self.mounting_deg, other.mounting_deg),
            (&mut self.mounting_m, other.mounting_m),
            (&mut self.focal_percent, other.focal_percent),
            (&mut self.landmark_nees, other.landmark_nees),
            (&mut self.wall_nees, other.wall_nees),
            (&mut self.camera_nees, other.camera_nees),
        ] {
            all.extend(more);
        }
        self.wrong += other.wrong;
        self.wrong_kept += other.wrong_kept;
        self.right += other.right;
        self.right_lost += other.right_lost;
        self.failed += other.failed;
    }

    /// Errors of landmarks.
    pub(super) fn of_landmarks(&mut self, building: &Building, placed: &[Placed]) {
        let (mut here, mut there) = (Vec::new(), Vec::new());
        for p in placed {
            let truth = &building.objects[p.object];
            let d = p.landmark.minus(truth);
            self.landmark_m.push(d[0].hypot(d[1]));
            self.facing_deg.push(d[2].abs().to_degrees());
            self.size_percent.extend([d[6], d[7]].map(|log| 100.0 * log.exp_m1()));
            here.push(p.landmark.centre.xy());
            there.push(truth.centre.xy());
            let e = Vector6::from(SAME_PARAMETERS.map(|k| d[k]));
            if let Some(cholesky) = p.covariance.and_then(nalgebra::SMatrix::cholesky) {
                self.landmark_nees.push(e.dot(&cholesky.solve(&e)) / 6.0);
            }
        }
        self.aligned_m.extend(aligned(&here, &there, false));
        self.scaled_m.extend(aligned(&here, &there, true));
    }

    /// Errors of walls, and of the way from an early keyframe of the first drive to its last.
    pub(super) fn of_path_and_walls(
        &mut self,
        building: &Building,
        labelled: &LabelledSurvey,
        map: &SurveyMap,
        first: &SimulatedDrive,
    ) -> Result<(), JointError> {
        let walls: Vec<Variable> = map.wall_of.values().map(|w| Variable::Wall(*w)).collect();
        let marginals = Marginals::of(&map.problem, &walls)?;
        for (number, &wall) in &map.wall_of {
            let truth = building.sections[labelled.section_of[*number]].line();
            let line = &map.problem.state.walls[wall];
            let (turn, middle) = (wrap_rad(line.facing_rad - truth.facing_rad), truth.anchor - line.anchor);
            self.wall_m.push((line.offset_m - line.normal().dot(&middle)).abs());
            let e = Vector2::new(turn, line.offset_m - truth.normal().dot(&middle));
            let covariance = marginals.block(Variable::Wall(wall), Variable::Wall(wall));
            if let Some(cholesky) = covariance.and_then(nalgebra::DMatrix::cholesky) {
                self.wall_nees.push(e.dot(&cholesky.solve(&e)) / 2.0);
            }
        }
        let last = first.truth.len() - 1;
        let distance = |i: &usize| (first.truth[*i].position() - first.truth[last].position()).norm();
        let near = (0..last.saturating_sub(NOT_A_LOOP)).min_by(|a, b| distance(a).total_cmp(&distance(b)));
        if let Some(near) = near {
            let between = |poses: &[Pose2]| poses[near].between(&poses[last]).position();
            let error = between(&map.problem.state.keyframes) - between(&first.truth);
            self.loop_m.push(error.norm());
        }
        Ok(())
    }

    /// Errors of the camera, with the NEES of mounting and focal length.
    pub(super) fn of_camera(&mut self, map: &SurveyMap, truth: &CameraState) -> Result<(), JointError> {
        let d = map.problem.state.cameras[0].minus(truth);
        self.mounting_deg.push(d.fixed_rows::<3>(0).norm().to_degrees());
        self.mounting_m.push(d[3].hypot(d[4]));
        self.focal_percent.push(100.0 * d[6].abs() / truth.focal_px);
        let camera = Variable::Camera(0);
        let covariance = Marginals::of(&map.problem, &[camera])?.block(camera, camera);
        let e = SVector::<f64, 7>::from_iterator(d.iter().copied());
        let known = covariance.map(|c| c.fixed_view::<7, 7>(0, 0).into_owned());
        if let Some(cholesky) = known.and_then(nalgebra::SMatrix::cholesky) {
            self.camera_nees.push(e.dot(&cholesky.solve(&e)) / 7.0);
        }
        Ok(())
    }

    /// Landmarks by one way against those by another.
    pub(super) fn apart(&mut self, placed: &[Placed], others: &[Placed]) {
        for p in placed {
            if let Some(other) = others.iter().find(|other| other.object == p.object) {
                self.apart_m.push((p.landmark.centre - other.landmark.centre).xy().norm());
            }
        }
    }

    /// What became of the candidates.
    pub(super) fn of_closures(&mut self, labelled: &LabelledSurvey, map: &SurveyMap) {
        for (closure, wrong) in map.closures.iter().zip(&labelled.wrong) {
            if *wrong {
                (self.wrong, self.wrong_kept) =
                    (self.wrong + 1, self.wrong_kept + usize::from(closure.weight > 0.5));
            } else {
                (self.right, self.right_lost) =
                    (self.right + 1, self.right_lost + usize::from(closure.weight < 0.5));
            }
        }
    }
}

/// Of each object with an appearance of its own the track with most views.
pub(super) fn best_tracks(labelled: &LabelledSurvey, map: &SurveyMap) -> Result<Vec<Placed>, JointError> {
    let mut best: BTreeMap<usize, (usize, usize)> = BTreeMap::new();
    let tracks = labelled.survey.drives.iter().flat_map(|drive| &drive.tracks);
    for ((track, landmark), object) in tracks.zip(&map.landmark_of).zip(&labelled.object_of) {
        if let Some(landmark) = landmark.filter(|_| *object < NAMED) {
            let entry = best.entry(*object).or_insert((0, landmark));
            if track.views.len() > entry.0 {
                *entry = (track.views.len(), landmark);
            }
        }
    }
    let chosen: Vec<Variable> = best.values().map(|(_, l)| Variable::Landmark(*l)).collect();
    let marginals = Marginals::of(&map.problem, &chosen)?;
    let placed = |(&object, &(_, l)): (&usize, &(usize, usize))| Placed {
        object,
        variable: l,
        landmark: map.problem.state.landmarks[l],
        covariance: marginals.same_block(Variable::Landmark(l), Variable::Landmark(l)),
    };
    Ok(best.iter().map(placed).collect())
}

/// Distances of points after the motion, and where asked the scale, that fits them best.
fn aligned(here: &[Vector2<f64>], there: &[Vector2<f64>], with_scale: bool) -> Vec<f64> {
    let mean = |points: &[Vector2<f64>]| points.iter().sum::<Vector2<f64>>() / points.len().max(1) as f64;
    let (from, to) = (mean(here), mean(there));
    let pairs: Vec<_> = here.iter().zip(there).map(|(a, b)| (a - from, b - to)).collect();
    let dot: f64 = pairs.iter().map(|(a, b)| a.dot(b)).sum();
    let perp: f64 = pairs.iter().map(|(a, b)| a.perp(b)).sum();
    let spread: f64 = pairs.iter().map(|(a, _)| a.norm_squared()).sum();
    let turn = Rotation2::new(perp.atan2(dot));
    let scale = if with_scale && spread > 0.0 { dot.hypot(perp) / spread } else { 1.0 };
    pairs.iter().map(|(a, b)| (scale * (turn * a) - b).norm()).collect()
}
