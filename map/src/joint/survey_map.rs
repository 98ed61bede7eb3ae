//! From a survey to its map: every drive alone, closures within the gate, kernels that narrow,
//! pruning, and a second chance for what was dropped.

use super::{
    build::SurveyProblem,
    closures::{agreeing, common_frame, weights},
    factor::{Kernels, SAME_CHI2},
    params::JointParams,
    problem::{JointError, JointProblem},
    solve::Descent,
    survey::Survey,
    variables::LandmarkState,
};
use crate::pose2::Pose2;
use std::collections::BTreeMap;

/// Widths of the kernels of views and identities without closures, and with them. With narrow
/// kernels from the start every closure of a long loop is refused; with none, every wrong one is
/// taken.
const OPEN: [[f64; 2]; 3] = [[100.0, 1.0], [10.0, 1.0], [1.0, 1.0]];
const CLOSED: [[f64; 2]; 7] =
    [[10.0, 1e6], [10.0, 1e5], [3.0, 1e4], [3.0, 1e3], [1.0, 100.0], [1.0, 10.0], [1.0, 1.0]];
/// Most steps at each width but the last.
const STEPS: usize = 12;
/// The gate of the open loop is this much wider than the kernel: the square of `doubt` 2 as for
/// closures by scans.
const OPEN_LOOP: f64 = 4.0;
/// Farther apart in the common frame no candidate between drives is tried, metres.
const FAR_M: f64 = 3.0;
/// Below this weight a closure, or a landmark's own views, are taken as contradicted.
pub(super) const CONTRADICTED: f64 = 0.5;

/// A candidate and what became of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Closure {
    /// Tracks.
    pub tracks: [usize; 2],
    /// Between 0 and 1; 0 where it was dropped.
    pub weight: f64,
}

/// The map of a survey.
#[derive(Debug, Clone, PartialEq)]
pub struct SurveyMap {
    /// The solution with its factors.
    pub problem: JointProblem,
    /// Number of the first keyframe of each drive.
    pub first_keyframe: Vec<usize>,
    /// Wall variable by wall number.
    pub wall_of: BTreeMap<usize, usize>,
    /// Landmark variable of each track; `None` with too few views.
    pub landmark_of: Vec<Option<usize>>,
    /// Candidates, in their order.
    pub closures: Vec<Closure>,
}

/// Solves a survey.
pub fn surveyed(survey: &Survey, params: &JointParams) -> Result<SurveyMap, JointError> {
    survey.check()?;
    let opened = (0..survey.drives.len()).map(|drive| opened(survey, drive, params));
    let opened: Vec<SurveyProblem> = opened.collect::<Result<_, _>>()?;
    let keyframes: Vec<Pose2> = opened.iter().flat_map(|o| o.problem.state.keyframes.clone()).collect();
    let plan = Candidates::new(survey, &opened, params)?;
    let keyframes = plan.in_one_frame(&opened, keyframes);
    let mut joint = SurveyProblem::new(survey, params, Some(keyframes))?;
    let closures = plan.settled(survey, &mut joint, params)?;
    Ok(SurveyMap::of(joint, closures))
}

impl SurveyMap {
    pub(super) fn of(joint: SurveyProblem, closures: Vec<Closure>) -> Self {
        let SurveyProblem { problem, first_keyframe, wall_of, landmark_of, .. } = joint;
        Self { problem, first_keyframe, wall_of, landmark_of, closures }
    }
}

/// One drive alone, solved without closures.
pub(super) fn opened(
    survey: &Survey,
    drive: usize,
    params: &JointParams,
) -> Result<SurveyProblem, JointError> {
    let mut open = SurveyProblem::new(&survey.alone(drive), params, None)?;
    narrowed(&mut open.problem, &OPEN)?;
    Ok(open)
}

/// A survey of one drive without candidates, solved from these keyframes on.
pub(super) fn opened_from(
    survey: &Survey,
    params: &JointParams,
    keyframes: Vec<Pose2>,
) -> Result<SurveyProblem, JointError> {
    let mut open = SurveyProblem::new(survey, params, Some(keyframes))?;
    narrowed(&mut open.problem, &OPEN)?;
    Ok(open)
}

fn narrowed(problem: &mut JointProblem, widths: &[[f64; 2]]) -> Result<(), JointError> {
    for &[views, identities] in widths {
        let kernels = Kernels { views, identities };
        let steps = if kernels == Kernels::NARROW { Descent::default().steps } else { STEPS };
        problem.solve(&Descent { steps, kernels, ..Descent::default() })?;
    }
    Ok(())
}

/// Candidates with the drives of their tracks, and which are tried.
pub(super) struct Candidates {
    pairs: Vec<[usize; 2]>,
    tried: Vec<bool>,
    /// Frame of each drive in that of the first.
    frames: Vec<Pose2>,
}

impl Candidates {
    pub(super) fn new(
        survey: &Survey,
        opened: &[SurveyProblem],
        params: &JointParams,
    ) -> Result<Self, JointError> {
        let pairs = survey.candidates.clone();
        // Drive and landmark of each track, in the problem of its drive alone.
        let of: Vec<(usize, Option<usize>)> = opened
            .iter()
            .enumerate()
            .flat_map(|(drive, o)| o.landmark_of.iter().map(move |landmark| (drive, *landmark)))
            .collect();
        let mut tried = vec![false; pairs.len()];
        let mut frames = vec![Pose2::default(); opened.len()];
        for (drive, open) in opened.iter().enumerate() {
            let inside: Vec<usize> =
                (0..pairs.len()).filter(|&i| pairs[i].iter().all(|t| of[*t].0 == drive)).collect();
            let landmarks = inside.iter().map(|&i| Some([of[pairs[i][0]].1?, of[pairs[i][1]].1?]));
            let known: Vec<(usize, [usize; 2])> =
                inside.iter().zip(landmarks).filter_map(|(i, pair)| Some((*i, pair?))).collect();
            let both: Vec<[usize; 2]> = known.iter().map(|(_, pair)| *pair).collect();
            let agree = agreeing(open, &both, OPEN_LOOP * SAME_CHI2, params)?;
            known.iter().zip(agree).for_each(|((i, _), agrees)| tried[*i] = agrees);
        }
        // Each further drive is laid on those before it.
        for drive in 1..opened.len() {
            let mut across = Vec::new();
            for (i, pair) in pairs.iter().enumerate() {
                let mut ends = pair.map(|track| of[track]);
                ends.sort_unstable();
                let [(first, Some(a)), (second, Some(b))] = ends else { continue };
                if second == drive && first < drive {
                    let state = |d: usize, l: usize| opened[d].problem.state.landmarks[l];
                    across.push((i, (moved(&state(first, a), &frames[first]), state(second, b))));
                }
            }
            let both: Vec<(LandmarkState, LandmarkState)> = across.iter().map(|(_, pair)| *pair).collect();
            let (frame, distances) = common_frame(&both);
            frames[drive] = frame;
            across.iter().zip(distances).for_each(|((i, _), d)| tried[*i] = d <= FAR_M);
        }
        Ok(Self { pairs, tried, frames })
    }

    /// Candidates whose landmarks are not far apart in a common frame.
    pub(super) fn by_distance(pairs: Vec<[usize; 2]>, distances_m: &[f64]) -> Self {
        Self { tried: distances_m.iter().map(|d| *d <= FAR_M).collect(), pairs, frames: Vec::new() }
    }

    pub(super) fn in_one_frame(&self, opened: &[SurveyProblem], keyframes: Vec<Pose2>) -> Vec<Pose2> {
        let counts = opened.iter().map(|o| o.problem.state.keyframes.len());
        let frames = self.frames.iter().zip(counts).flat_map(|(frame, n)| std::iter::repeat_n(frame, n));
        frames.zip(keyframes).map(|(frame, pose)| frame.compose(&pose)).collect()
    }

    /// Solves with the candidates that are tried, drops what contradicts, starts again the
    /// landmarks that a wrong one pulled away, and tries all that were dropped once more.
    pub(super) fn settled(
        mut self,
        survey: &Survey,
        joint: &mut SurveyProblem,
        params: &JointParams,
    ) -> Result<Vec<Closure>, JointError> {
        if self.pairs.is_empty() {
            narrowed(&mut joint.problem, &OPEN)?;
            return Ok(Vec::new());
        }
        for (pair, tried) in self.pairs.iter().zip(&mut self.tried) {
            *tried &= joint.pair(*pair).is_some();
        }
        joint.close(self.active(joint), params);
        narrowed(&mut joint.problem, &CLOSED)?;
        let own = self.drop_contradicted(joint);
        for (track, landmark) in joint.landmark_of.clone().into_iter().enumerate() {
            if landmark.is_some_and(|l| own[l] < CONTRADICTED) {
                joint.restart(survey, track);
            }
        }
        joint.close(self.active(joint), params);
        narrowed(&mut joint.problem, &[[1.0, 1.0]])?;
        let (numbers, all): (Vec<usize>, Vec<[usize; 2]>) =
            self.pairs.iter().enumerate().filter_map(|(i, pair)| Some((i, joint.pair(*pair)?))).unzip();
        let agree = agreeing(joint, &all, SAME_CHI2, params)?;
        numbers.iter().zip(agree).for_each(|(i, agrees)| self.tried[*i] |= agrees);
        joint.close(self.active(joint), params);
        narrowed(&mut joint.problem, &[[1.0, 1.0]])?;
        let (_, by_factor) = weights(joint);
        let mut by_factor = by_factor.into_iter();
        let closure = |(tracks, tried): (&[usize; 2], &bool)| {
            let weight = if *tried { by_factor.next().unwrap_or(0.0) } else { 0.0 };
            Closure { tracks: *tracks, weight }
        };
        Ok(self.pairs.iter().zip(&self.tried).map(closure).collect())
    }

    /// Landmarks of the candidates that are tried, in their order.
    fn active(&self, joint: &SurveyProblem) -> std::vec::IntoIter<[usize; 2]> {
        let tried = self.pairs.iter().zip(&self.tried).filter(|(_, tried)| **tried);
        tried.filter_map(|(pair, _)| joint.pair(*pair)).collect::<Vec<_>>().into_iter()
    }

    /// Drops closures of low weight, and those of a landmark that lost half of its views; gives the
    /// weight of each landmark's views.
    fn drop_contradicted(&mut self, joint: &SurveyProblem) -> Vec<f64> {
        let (own, by_factor) = weights(joint);
        let mut by_factor = by_factor.into_iter();
        for (pair, tried) in self.pairs.iter().zip(&mut self.tried) {
            if let (true, Some(pair)) = (*tried, joint.pair(*pair)) {
                let weight = by_factor.next().unwrap_or(0.0);
                *tried = weight > CONTRADICTED && pair.iter().all(|l| own[*l] > CONTRADICTED);
            }
        }
        own
    }
}

/// A landmark in another frame.
fn moved(landmark: &LandmarkState, frame: &Pose2) -> LandmarkState {
    let centre = frame.to_isometry3() * nalgebra::Point3::from(landmark.centre);
    LandmarkState { centre: centre.coords, theta_rad: landmark.theta_rad + frame.theta_rad, ..*landmark }
}
