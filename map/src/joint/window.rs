//! The live window: the last keyframes with their walls and tracks, solved after each keyframe.
//! What is older is a Gaussian prior over what the window shares with it.

use super::{
    build::landmark_view,
    factor::{Factor, Kernels},
    factors::{
        camera_prior::CameraPrior,
        hanging::{Level, OnWall},
        line::LineFit,
        odometry::{OdometryMotion, OdometryPrior},
        sqrt_information,
        summary::{Estimate, Summary},
    },
    params::JointParams,
    problem::{JointError, JointProblem},
    solve::Descent,
    start::landmark_by_rays,
    survey::{CameraStated, LineSeen, Motion, QuadView},
    variables::{OdometryErrors, State, Variable, WallLine},
};
use crate::{pose2::Pose2, slam::graph::scaled_weight};
use nalgebra::{DMatrix, DVector};
use std::collections::{BTreeMap, BTreeSet};

/// Steps of a solution: from the last keyframe's, little changes.
const STEPS: usize = 8;
/// Information of every parameter that is taken out besides, against a singular one.
const FLOOR: f64 = 1e-6;
/// Of the scaled information smaller eigenvalues say nothing.
const LEAST_EIGENVALUE: f64 = 1e-12;

/// What a keyframe adds. The keyframe numbers of lines and quads are not read.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct KeyframeSeen {
    /// Motion since the keyframe before; `None` for the first.
    pub motion: Option<Motion>,
    /// Lines of its scan, with wall numbers.
    pub lines: Vec<LineSeen>,
    /// Quads of its frame: number of the track, wall that it hangs on, corners.
    pub quads: Vec<(usize, Option<usize>, QuadView)>,
}

/// Views of a track in the window, and its variable once they are enough.
#[derive(Debug, Clone, PartialEq, Default)]
struct WindowTrack {
    landmark: Option<usize>,
    views: Vec<(usize, QuadView)>,
}

/// The window.
#[derive(Debug, Clone, PartialEq)]
pub struct JointWindow {
    params: JointParams,
    size: usize,
    /// All keyframes of the drive; those before the window are fixed, without factors.
    problem: JointProblem,
    wall_of: BTreeMap<usize, usize>,
    tracks: BTreeMap<usize, WindowTrack>,
    /// Number of the first keyframe of the window.
    first: usize,
}

impl JointWindow {
    /// A window of `size` keyframes, two at least; the first keyframe at `start` is the frame.
    pub fn new(start: Pose2, camera: &CameraStated, params: &JointParams, size: usize) -> Self {
        let state = State {
            keyframes: vec![start],
            cameras: vec![camera.camera],
            odometry: vec![OdometryErrors::default()],
            ..State::default()
        };
        let mut problem = JointProblem { state, factors: Vec::new(), fixed: vec![Variable::Keyframe(0)] };
        problem.factors.push(Factor::OdometryPrior(OdometryPrior {
            drive: 0,
            scale_sigma: params.scale_sigma,
            drift_sigma_rad_per_m: params.drift_sigma_rad_per_m,
        }));
        match camera.sigmas {
            Some(sigmas) => {
                problem.factors.push(Factor::Camera(CameraPrior {
                    camera: 0,
                    stated: camera.camera,
                    sigmas,
                }));
            }
            None => problem.fixed.push(Variable::Camera(0)),
        }
        let (wall_of, tracks) = (BTreeMap::new(), BTreeMap::new());
        Self { params: params.clone(), size: size.max(2), problem, wall_of, tracks, first: 0 }
    }

    /// The problem of the window.
    pub fn problem(&self) -> &JointProblem {
        &self.problem
    }

    /// Adds a keyframe, solves the window, and gives the keyframe's pose.
    pub fn add(&mut self, seen: &KeyframeSeen) -> Result<Pose2, JointError> {
        if let Some(motion) = &seen.motion {
            self.moved(motion)?;
        }
        let now = self.problem.state.keyframes.len() - 1;
        for line in &seen.lines {
            self.line(now, line)?;
        }
        for (track, wall, view) in &seen.quads {
            self.quad(now, (*track, *wall), view)?;
        }
        self.problem.solve(&Descent { steps: STEPS, ..Descent::default() })?;
        while now + 1 - self.first > self.size {
            self.leave()?;
        }
        Ok(self.problem.state.keyframes[now])
    }

    fn moved(&mut self, motion: &Motion) -> Result<(), JointError> {
        let from = self.problem.state.keyframes.len() - 1;
        let wrong = JointError::Survey { field: "covariance", what: "motion", number: from };
        let sqrt_information = sqrt_information(&motion.covariance).ok_or(wrong)?;
        self.problem.state.keyframes.push(self.problem.state.keyframes[from].compose(&motion.motion));
        let motion = motion.motion;
        let factor = OdometryMotion { from, to: from + 1, drive: 0, motion, sqrt_information };
        self.problem.factors.push(Factor::Odometry(factor));
        Ok(())
    }

    fn line(&mut self, keyframe: usize, line: &LineSeen) -> Result<(), JointError> {
        let wrong = JointError::Survey { field: "covariance", what: "line", number: keyframe };
        let sqrt_information = sqrt_information(&line.covariance).ok_or(wrong)?;
        let pose = self.problem.state.keyframes[keyframe];
        let walls = &mut self.problem.state.walls;
        let wall = *self.wall_of.entry(line.wall).or_insert_with(|| {
            walls.push(WallLine::observed(&pose, line.facing_rad, line.offset_m));
            walls.len() - 1
        });
        let (facing_rad, offset_m) = (line.facing_rad, line.offset_m);
        self.problem.factors.push(Factor::Line(LineFit {
            keyframe,
            wall,
            facing_rad,
            offset_m,
            sqrt_information,
            doubt_chi2: None,
        }));
        Ok(())
    }

    fn quad(
        &mut self,
        keyframe: usize,
        (number, wall): (usize, Option<usize>),
        view: &QuadView,
    ) -> Result<(), JointError> {
        let track = self.tracks.entry(number).or_default();
        track.views.push((keyframe, *view));
        let mut new = vec![(keyframe, *view)];
        if track.landmark.is_none() && track.views.len() >= self.params.min_views.max(1) {
            let keyframes = &self.problem.state.keyframes;
            let posed: Vec<(Pose2, QuadView)> =
                track.views.iter().map(|(k, view)| (keyframes[*k], *view)).collect();
            let Some(start) = landmark_by_rays(&posed, &self.problem.state.cameras[0]) else { return Ok(()) };
            let landmark = self.problem.state.landmarks.len();
            self.problem.state.landmarks.push(start);
            (track.landmark, new) = (Some(landmark), track.views.clone());
            let (distance_sigma_m, sigma_rad) = (self.params.hanging_sigma_m, self.params.hanging_sigma_rad);
            self.problem.factors.push(Factor::Level(Level { landmark, sigma_rad }));
            if let Some(&wall) = wall.and_then(|wall| self.wall_of.get(&wall)) {
                let factor = OnWall { landmark, wall, distance_sigma_m, angle_sigma_rad: sigma_rad };
                self.problem.factors.push(Factor::OnWall(factor));
            }
        }
        let Some(landmark) = track.landmark else { return Ok(()) };
        for (keyframe, view) in new {
            let wrong = JointError::Survey { field: "covariance_px2", what: "track", number };
            let border_sigma_px = self.params.border_sigma_px;
            let factor = landmark_view(&view, keyframe, landmark, border_sigma_px).ok_or(wrong)?;
            self.problem.factors.push(Factor::View(factor));
        }
        Ok(())
    }

    /// Takes the oldest keyframe out, with the walls and landmarks that no other one has seen.
    fn leave(&mut self) -> Result<(), JointError> {
        let oldest = Variable::Keyframe(self.first);
        let of_window = |f: &&Factor| matches!(f, Factor::Line(_) | Factor::View(_));
        let seen = self.problem.factors.iter().filter(of_window).map(Factor::variables);
        let mut stays: BTreeSet<Variable> = seen.filter(|v| !v.contains(&oldest)).flatten().collect();
        for factor in &self.problem.factors {
            if let Factor::OnWall(f) = factor
                && stays.contains(&Variable::Landmark(f.landmark))
            {
                stays.insert(Variable::Wall(f.wall));
            }
        }
        let mut gone = BTreeSet::from([oldest]);
        gone.extend(self.wall_of.values().map(|w| Variable::Wall(*w)).filter(|v| !stays.contains(v)));
        let landmarks = self.tracks.values().filter_map(|track| track.landmark);
        gone.extend(landmarks.map(Variable::Landmark).filter(|v| !stays.contains(v)));
        self.take_out(&gone)?;
        self.problem.fixed.extend(gone.iter().filter(|v| **v != Variable::Keyframe(0)));
        self.wall_of.retain(|_, wall| !gone.contains(&Variable::Wall(*wall)));
        let first = self.first;
        self.tracks.retain(|_, track| {
            track.views.retain(|(keyframe, _)| *keyframe > first);
            let lives = track.landmark.is_none_or(|l| !gone.contains(&Variable::Landmark(l)));
            lives && !(track.landmark.is_none() && track.views.is_empty())
        });
        self.first += 1;
        Ok(())
    }

    /// Replaces the factors of some variables by the Gaussian that they leave on the others.
    fn take_out(&mut self, gone: &BTreeSet<Variable>) -> Result<(), JointError> {
        let touches = |f: &Factor| f.variables().iter().any(|v| gone.contains(v));
        let (taken, kept): (Vec<Factor>, Vec<Factor>) =
            std::mem::take(&mut self.problem.factors).into_iter().partition(touches);
        self.problem.factors = kept;
        let state = &self.problem.state;
        let all: BTreeSet<Variable> = taken.iter().flat_map(Factor::variables).collect();
        let free = all.into_iter().filter(|v| !self.problem.fixed.contains(v));
        let (mut order, rest): (Vec<Variable>, Vec<Variable>) = free.partition(|v| gone.contains(v));
        let out: usize = order.iter().map(|v| v.size()).sum();
        order.extend(&rest);
        let mut first = BTreeMap::new();
        let mut n = 0;
        for variable in &order {
            first.insert(*variable, n);
            n += variable.size();
        }
        let (mut h, mut g) = (DMatrix::zeros(n, n), DVector::zeros(n));
        for factor in &taken {
            let term = factor.linearised(state);
            let chi2 = term.residual.norm_squared();
            let doubt = factor.doubt_chi2(&Kernels::NARROW);
            let weight = doubt.map_or(1.0, |phi| scaled_weight(phi, chi2));
            for (a, by_a) in &term.by {
                let Some(&row) = first.get(a) else { continue };
                let mut down = g.rows_mut(row, a.size());
                down += by_a.tr_mul(&term.residual) * weight;
                for (b, by_b) in &term.by {
                    let Some(&column) = first.get(b) else { continue };
                    let mut block = h.view_mut((row, column), (a.size(), b.size()));
                    block += by_a.tr_mul(by_b) * weight;
                }
            }
        }
        let left = n - out;
        let hidden = h.view((0, 0), (out, out)) + DMatrix::identity(out, out) * FLOOR;
        let across = h.view((0, out), (out, left)).into_owned();
        let solver = hidden.cholesky().ok_or(JointError::Loose)?;
        let information = h.view((out, out), (left, left)) - across.tr_mul(&solver.solve(&across));
        let down = g.rows(out, left) - across.tr_mul(&solver.solve(&g.rows(0, out).into_owned()));
        let estimates = rest.iter().filter_map(|v| Estimate::of(*v, state)).collect();
        self.problem.factors.push(Factor::Summary(Box::new(gaussian(estimates, &information, &down))));
        Ok(())
    }
}

/// The Gaussian of an information matrix, which may be singular, and a gradient.
fn gaussian(estimates: Vec<Estimate>, information: &DMatrix<f64>, down: &DVector<f64>) -> Summary {
    let scale = information.diagonal().map(|d| if d > 0.0 { d.sqrt() } else { 1.0 });
    let n = scale.len();
    let scaled = DMatrix::from_fn(n, n, |r, c| {
        0.5 * (information[(r, c)] + information[(c, r)]) / (scale[r] * scale[c])
    });
    let eigen = scaled.symmetric_eigen();
    let root = eigen.eigenvalues.map(|v| if v > LEAST_EIGENVALUE { v.sqrt() } else { 0.0 });
    let turned = eigen.eigenvectors.tr_mul(&down.component_div(&scale));
    let sqrt_information = DMatrix::from_fn(n, n, |r, c| root[r] * eigen.eigenvectors[(c, r)] * scale[c]);
    let offset = DVector::from_fn(n, |r, _| if root[r] > 0.0 { turned[r] / root[r] } else { 0.0 });
    Summary { estimates, sqrt_information, offset }
}
