//! The least-squares problem of a survey: start values, factors, and which variable is what.

use super::{
    factor::Factor,
    factors::{
        camera_prior::CameraPrior,
        hanging::{Level, OnWall},
        line::LineFit,
        odometry::{OdometryMotion, OdometryPrior},
        reprojection::LandmarkView,
        same_object::SameObject,
        sqrt_information,
        wall_prior::{SizePrior, WallPrior},
    },
    params::JointParams,
    problem::{JointError, JointProblem},
    start::landmark_by_rays,
    survey::{QuadView, Survey, Track},
    variables::{OdometryErrors, State, Variable, WallLine},
};
use crate::pose2::Pose2;
use nalgebra::{Matrix2, Vector2};
use std::collections::BTreeMap;

/// The problem of a survey.
#[derive(Debug, Clone, PartialEq)]
pub struct SurveyProblem {
    /// Variables and factors.
    pub problem: JointProblem,
    /// Number of the first keyframe of each drive.
    pub first_keyframe: Vec<usize>,
    /// Wall variable by wall number.
    pub wall_of: BTreeMap<usize, usize>,
    /// Landmark variable of each track; `None` with too few views.
    pub landmark_of: Vec<Option<usize>>,
    /// Factors before those of closures.
    pub(super) without_closures: usize,
}

impl SurveyProblem {
    /// The problem without closures by landmarks. `keyframes`: start values; odometry without them.
    pub fn new(
        survey: &Survey,
        params: &JointParams,
        keyframes: Option<Vec<Pose2>>,
    ) -> Result<Self, JointError> {
        survey.check()?;
        let mut first_keyframe = Vec::new();
        let mut poses = Vec::new();
        for drive in &survey.drives {
            first_keyframe.push(poses.len());
            let mut pose = survey.start;
            poses.push(pose);
            for motion in &drive.motions {
                pose = pose.compose(&motion.motion);
                poses.push(pose);
            }
        }
        let state = State {
            keyframes: keyframes.filter(|k| k.len() == poses.len()).unwrap_or(poses),
            cameras: vec![survey.camera.camera],
            odometry: vec![OdometryErrors::default(); survey.drives.len()],
            ..State::default()
        };
        let fixed = vec![Variable::Keyframe(0)];
        let mut made = Self {
            problem: JointProblem { state, factors: Vec::new(), fixed },
            first_keyframe,
            wall_of: BTreeMap::new(),
            landmark_of: Vec::new(),
            without_closures: 0,
        };
        made.camera(survey);
        for drive in 0..survey.drives.len() {
            made.odometry(survey, params, drive)?;
            made.lines(survey, params, drive)?;
        }
        made.plan(survey, params);
        for (number, (drive, track)) in survey.tracks().enumerate() {
            made.track(survey, params, (number, drive), track)?;
        }
        made.without_closures = made.problem.factors.len();
        Ok(made)
    }

    fn camera(&mut self, survey: &Survey) {
        match survey.camera.sigmas {
            Some(sigmas) => {
                let prior = CameraPrior { camera: 0, stated: survey.camera.camera, sigmas };
                self.problem.factors.push(Factor::Camera(prior));
            }
            None => self.problem.fixed.push(Variable::Camera(0)),
        }
    }

    fn odometry(&mut self, survey: &Survey, params: &JointParams, drive: usize) -> Result<(), JointError> {
        let prior = OdometryPrior {
            drive,
            scale_sigma: params.scale_sigma,
            drift_sigma_rad_per_m: params.drift_sigma_rad_per_m,
        };
        self.problem.factors.push(Factor::OdometryPrior(prior));
        for (number, motion) in survey.drives[drive].motions.iter().enumerate() {
            let from = self.first_keyframe[drive] + number;
            let wrong = JointError::Survey { field: "covariance", what: "motion", number };
            let sqrt_information = sqrt_information(&motion.covariance).ok_or(wrong)?;
            let motion = motion.motion;
            let factor = OdometryMotion { from, to: from + 1, drive, motion, sqrt_information };
            self.problem.factors.push(Factor::Odometry(factor));
        }
        Ok(())
    }

    /// The first observation of a wall is its start value, and its middle the anchor.
    fn lines(&mut self, survey: &Survey, params: &JointParams, drive: usize) -> Result<(), JointError> {
        for (number, line) in survey.drives[drive].lines.iter().enumerate() {
            let keyframe = self.first_keyframe[drive] + line.keyframe;
            let walls = &mut self.problem.state.walls;
            let pose = self.problem.state.keyframes[keyframe];
            let wall = *self.wall_of.entry(survey.same_wall[line.wall]).or_insert_with(|| {
                walls.push(WallLine::observed(&pose, line.facing_rad, line.offset_m));
                walls.len() - 1
            });
            let wrong = JointError::Survey { field: "covariance", what: "line", number };
            let sqrt_information = sqrt_information(&line.covariance).ok_or(wrong)?;
            let (facing_rad, offset_m) = (line.facing_rad, line.offset_m);
            let doubt_chi2 = params.line_doubt_chi2;
            let factor = LineFit { keyframe, wall, facing_rad, offset_m, sqrt_information, doubt_chi2 };
            self.problem.factors.push(Factor::Line(factor));
        }
        Ok(())
    }

    fn plan(&mut self, survey: &Survey, params: &JointParams) {
        for plan in &survey.plan {
            let walls = &mut self.problem.state.walls;
            let wall = *self.wall_of.entry(survey.same_wall[plan.wall]).or_insert_with(|| {
                walls.push(plan.line);
                walls.len() - 1
            });
            self.problem.factors.push(Factor::WallPrior(WallPrior {
                wall,
                line: plan.line,
                angle_sigma_rad: params.plan_sigma_rad,
                offset_sigma_m: params.plan_sigma_m,
            }));
        }
    }

    fn track(
        &mut self,
        survey: &Survey,
        params: &JointParams,
        (number, drive): (usize, usize),
        track: &Track,
    ) -> Result<(), JointError> {
        let start = (track.views.len() >= params.min_views.max(1))
            .then(|| landmark_by_rays(&self.posed(drive, track), &survey.camera.camera))
            .flatten();
        let Some(start) = start else {
            self.landmark_of.push(None);
            return Ok(());
        };
        let landmark = self.problem.state.landmarks.len();
        self.landmark_of.push(Some(landmark));
        self.problem.state.landmarks.push(start);
        for view in &track.views {
            let keyframe = self.first_keyframe[drive] + view.keyframe;
            let wrong = JointError::Survey { field: "covariance_px2", what: "track", number };
            let factor = landmark_view(view, keyframe, landmark, params.border_sigma_px).ok_or(wrong)?;
            self.problem.factors.push(Factor::View(factor));
        }
        let (distance_sigma_m, sigma_rad) = (params.hanging_sigma_m, params.hanging_sigma_rad);
        self.problem.factors.push(Factor::Level(Level { landmark, sigma_rad }));
        let wall = track.wall.and_then(|wall| self.wall_of.get(&survey.same_wall[wall]).copied());
        if let Some(wall) = wall {
            let factor = OnWall { landmark, wall, distance_sigma_m, angle_sigma_rad: sigma_rad };
            self.problem.factors.push(Factor::OnWall(factor));
        }
        if let Some(size) = track.size {
            let log_size = Vector2::new(size.width_m.ln(), size.height_m.ln());
            let factor = SizePrior { landmark, log_size, sigma: params.size_sigma };
            self.problem.factors.push(Factor::Size(factor));
        }
        Ok(())
    }

    /// A track's views with their poses, by the state as it is.
    fn posed(&self, drive: usize, track: &Track) -> Vec<(Pose2, QuadView)> {
        let first = self.first_keyframe[drive];
        let pose = |view: &QuadView| self.problem.state.keyframes[first + view.keyframe];
        track.views.iter().map(|view| (pose(view), *view)).collect()
    }

    /// Starts the landmark of a track again from its rays.
    pub(super) fn restart(&mut self, survey: &Survey, number: usize) {
        let Some((drive, track)) = survey.tracks().nth(number) else { return };
        let Some(landmark) = self.landmark_of[number] else { return };
        if let Some(again) = landmark_by_rays(&self.posed(drive, track), &self.problem.state.cameras[0]) {
            self.problem.state.landmarks[landmark] = again;
        }
    }

    /// The landmarks of a candidate; `None` where a track has none.
    pub(super) fn pair(&self, [a, b]: [usize; 2]) -> Option<[usize; 2]> {
        Some([self.landmark_of[a]?, self.landmark_of[b]?])
    }

    /// Takes these pairs of landmarks as one object each, and no others.
    pub(super) fn close(&mut self, pairs: impl Iterator<Item = [usize; 2]>, params: &JointParams) {
        self.problem.factors.truncate(self.without_closures);
        let sigmas = params.same_sigmas();
        let factor = |[a, b]: [usize; 2]| Factor::Same(SameObject { a, b, sigmas });
        self.problem.factors.extend(pairs.map(factor));
    }
}

/// A quad of the only camera as a factor.
pub(super) fn landmark_view(
    view: &QuadView,
    keyframe: usize,
    landmark: usize,
    border_sigma_px: f64,
) -> Option<LandmarkView> {
    let QuadView { mounting_from_camera, corners_px, .. } = *view;
    let sqrt_information = corner_roots(view, border_sigma_px)?;
    Some(LandmarkView { keyframe, landmark, camera: 0, mounting_from_camera, corners_px, sqrt_information })
}

fn corner_roots(view: &QuadView, border_sigma_px: f64) -> Option<[Matrix2<f64>; 4]> {
    let border = Matrix2::identity() * border_sigma_px.powi(2);
    let [a, b, c, d] = view.covariance_px2.map(|covariance| sqrt_information(&(covariance + border)));
    Some([a?, b?, c?, d?])
}
