//! Which candidates agree: by the joint covariance without them, by a common frame, and by the
//! weights that they and their views end with.

use super::{
    build::SurveyProblem,
    factor::Factor,
    factors::same_object::difference,
    marginals::Marginals,
    params::JointParams,
    problem::JointError,
    variables::{LandmarkState, Variable},
};
use crate::pose2::{Pose2, wrap_rad};
use nalgebra::{Matrix6, Vector2};

/// Two landmarks of different drives agree with a transform within this distance, metres.
const AGREE_M: f64 = 1.5;

/// Whether each pair of landmarks may be one object by the joint covariance of the problem as it
/// is: chi2 of the difference at most `gate`.
pub(super) fn agreeing(
    survey: &SurveyProblem,
    pairs: &[[usize; 2]],
    gate: f64,
    params: &JointParams,
) -> Result<Vec<bool>, JointError> {
    let mut chosen: Vec<Variable> = pairs.iter().flatten().map(|i| Variable::Landmark(*i)).collect();
    chosen.sort_unstable();
    chosen.dedup();
    let marginals = Marginals::of(&survey.problem, &chosen)?;
    let landmarks = &survey.problem.state.landmarks;
    let same = Matrix6::from_diagonal(&params.same_sigmas().map(|s| s * s));
    let agrees = |&[a, b]: &[usize; 2]| {
        let block = |i, j| marginals.same_block(Variable::Landmark(i), Variable::Landmark(j));
        let d = difference(&landmarks[a], &landmarks[b]);
        let spread = block(a, a)? + block(b, b)? - block(a, b)? - block(b, a)? + same;
        Some(d.dot(&spread.cholesky()?.solve(&d)) <= gate)
    };
    Ok(pairs.iter().map(|pair| agrees(pair).unwrap_or(false)).collect())
}

/// The transform that lays the second landmarks of pairs on the first where most of them agree, and
/// the distance of each pair then, metres.
pub(super) fn common_frame(pairs: &[(LandmarkState, LandmarkState)]) -> (Pose2, Vec<f64>) {
    let transform = |(a, b): &(LandmarkState, LandmarkState)| {
        let turn = Pose2::new(0.0, 0.0, wrap_rad(a.theta_rad - b.theta_rad));
        let turned = turn.apply(&b.centre.xy().into());
        let shift: Vector2<f64> = a.centre.xy() - turned.coords;
        Pose2::new(shift.x, shift.y, turn.theta_rad)
    };
    let distances = |frame: &Pose2| -> Vec<f64> {
        let distance = |(a, b): &(LandmarkState, LandmarkState)| {
            (frame.apply(&b.centre.xy().into()).coords - a.centre.xy()).norm()
        };
        pairs.iter().map(distance).collect()
    };
    let mut best = (Pose2::default(), distances(&Pose2::default()));
    let support = |all: &[f64]| all.iter().filter(|d| **d < AGREE_M).count();
    for frame in pairs.iter().map(transform) {
        let all = distances(&frame);
        if support(&all) > support(&best.1) {
            best = (frame, all);
        }
    }
    best
}

/// Mean weight of the views of each landmark (1 without views), and the weight of each closure in
/// their order.
pub(super) fn weights(survey: &SurveyProblem) -> (Vec<f64>, Vec<f64>) {
    let mut views = vec![(0.0, 0.0); survey.problem.state.landmarks.len()];
    let mut closures = Vec::new();
    for (factor, weight) in survey.problem.factors.iter().zip(survey.problem.weights()) {
        match factor {
            Factor::View(view) => {
                let (sum, count) = &mut views[view.landmark];
                (*sum, *count) = (*sum + weight, *count + 1.0);
            }
            Factor::Same(_) => closures.push(weight),
            _ => {}
        }
    }
    let mean = |&(sum, count): &(f64, f64)| if count > 0.0 { sum / count } else { 1.0 };
    (views.iter().map(mean).collect(), closures)
}
