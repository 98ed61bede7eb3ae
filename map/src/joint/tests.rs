//! The joint map against an independent prototype, dense least squares and its own symmetries.
//!
//! `tests/golden.json`: a drive of 40 keyframes with the solution and its covariance, computed by a
//! prototype in Python (numpy, scipy) that shares no code with this crate.

mod bounds;
mod closures;
mod datum;
mod golden;
mod laser_drive;
mod shared_errors;
mod window;

use super::*;
use crate::pose2::{Pose2, wrap_rad};
use golden::Golden;
use nalgebra::{DMatrix, DVector};

fn tight() -> Descent {
    Descent { steps: 300, gain: 1e-16, ..Descent::default() }
}

/// The problem of the golden drive, solved.
fn solved(golden: &Golden) -> SurveyProblem {
    let mut made = SurveyProblem::new(&golden.survey(), &golden.params(), None).unwrap();
    made.problem.solve(&Descent::default()).unwrap();
    made.problem.solve(&tight()).unwrap();
    made
}

#[test]
fn the_solution_and_its_covariance_are_those_of_the_prototype() {
    let golden = Golden::read();
    let made = solved(&golden);
    let (state, wanted) = (&made.problem.state, &golden.solution);
    for (pose, [x, y, theta]) in state.keyframes.iter().zip(&wanted.keyframes) {
        assert!(pose.minus(&Pose2::new(*x, *y, *theta)).amax() < 1e-6, "{pose:?}");
    }
    for (landmark, values) in state.landmarks.iter().zip(&wanted.landmarks) {
        let d = landmark.parameters() - nalgebra::SVector::<f64, 8>::from(*values);
        assert!(d.amax() < 1e-6, "{d}");
    }
    assert_eq!(made.wall_of.len(), wanted.walls.len());
    for (number, [x, y, facing, offset]) in &wanted.walls {
        let wall = &state.walls[made.wall_of[number]];
        let there = wall.offset_m - wall.normal().dot(&(nalgebra::Point2::new(*x, *y) - wall.anchor));
        let turn = wrap_rad(wall.facing_rad - facing);
        assert!(turn.abs() < 1e-6 && (there - offset).abs() < 1e-6, "{number}: {turn} {there} {offset}");
    }
    let camera = state.cameras[0].minus(&golden.solution.camera.state());
    assert!(camera.fixed_rows::<6>(0).amax() < 1e-6 && camera.amax() < 1e-4, "{camera}");
    let odometry = state.odometry[0];
    assert!((odometry.scale - wanted.odometry[0]).abs() < 1e-6);
    assert!((odometry.drift_rad_per_m - wanted.odometry[1]).abs() < 1e-6);
    let mut chosen: Vec<Variable> = (0..wanted.landmarks.len()).map(Variable::Landmark).collect();
    chosen.push(Variable::Camera(0));
    let marginals = Marginals::of(&made.problem, &chosen).unwrap();
    let variances = |v| marginals.block(v, v).unwrap().diagonal();
    let near = |a: f64, b: f64| (a - b).abs() < 1e-4 * b.abs() + 1e-12;
    for (i, wanted) in wanted.landmark_variances.iter().enumerate() {
        let found = variances(Variable::Landmark(i));
        assert!(found.iter().zip(wanted).all(|(a, b)| near(*a, *b)), "{i}: {found} {wanted:?}");
    }
    let found = variances(Variable::Camera(0));
    assert!(found.iter().zip(&wanted.camera_variances).all(|(a, b)| near(*a, *b)), "{found}");
    let last = Variable::Landmark(wanted.landmarks.len() - 1);
    let cross = marginals.block(Variable::Landmark(0), last).unwrap();
    for (r, row) in wanted.first_last_landmark.iter().enumerate() {
        assert!(
            row.iter().enumerate().all(|(c, b)| (cross[(r, c)] - b).abs() < 1e-4 * cross.amax()),
            "{cross}"
        );
    }
}

/// Rows of all free variables by QR, without the sparse matrix and its order.
fn dense(problem: &JointProblem) -> (Vec<(Variable, usize)>, DMatrix<f64>, DVector<f64>) {
    let mut first = Vec::new();
    let mut columns = 0;
    for variable in problem.state.variables().filter(|v| !problem.fixed.contains(v)) {
        first.push((variable, columns));
        columns += variable.size();
    }
    let terms: Vec<_> = problem.factors.iter().map(|f| f.linearised(&problem.state)).collect();
    let rows = terms.iter().map(|t| t.residual.len()).sum();
    let (mut j, mut r, mut at) = (DMatrix::zeros(rows, columns), DVector::zeros(rows), 0);
    for (term, weight) in terms.iter().zip(problem.weights()) {
        let root = weight.sqrt();
        r.rows_mut(at, term.residual.len()).copy_from(&(&term.residual * root));
        for (variable, by) in &term.by {
            if let Some((_, column)) = first.iter().find(|(v, _)| v == variable) {
                j.view_mut((at, *column), by.shape()).copy_from(&(by * root));
            }
        }
        at += term.residual.len();
    }
    (first, j, r)
}

#[test]
fn the_solution_and_its_covariance_are_those_of_dense_least_squares() {
    let made = solved(&Golden::read());
    let mut other = made.problem.clone();
    for _ in 0..5 {
        let (first, j, r) = dense(&other);
        let qr = j.qr();
        let step = qr.r().solve_upper_triangular(&(qr.q().transpose() * -r)).unwrap();
        for (variable, row) in first {
            other.state.step(variable, step.rows(row, variable.size()).as_slice());
        }
    }
    for (a, b) in made.problem.state.landmarks.iter().zip(&other.state.landmarks) {
        assert!(a.minus(b).amax() < 1e-8, "{}", a.minus(b));
    }
    for (a, b) in made.problem.state.keyframes.iter().zip(&other.state.keyframes) {
        assert!(a.minus(b).amax() < 1e-8);
    }
    let (first, j, _) = dense(&other);
    let root = j.qr().r().try_inverse().unwrap();
    let covariance = &root * root.transpose();
    let chosen = [Variable::Landmark(2), Variable::Wall(1), Variable::Keyframe(39), Variable::Camera(0)];
    let marginals = Marginals::of(&other, &chosen).unwrap();
    for a in chosen {
        for b in chosen {
            let row = |v| first.iter().find(|(w, _)| *w == v).unwrap().1;
            let wanted = covariance.view((row(a), row(b)), (a.size(), b.size()));
            let found = marginals.block(a, b).unwrap();
            assert!((&found - wanted).amax() < 1e-4 * wanted.amax() + 1e-10, "{a:?} {b:?}: {found} {wanted}");
        }
    }
}

/// The frame and the order of factors are conventions.
#[test]
fn another_frame_and_another_order_give_the_same_map() {
    let golden = Golden::read();
    let made = solved(&golden);
    let moved = Pose2::new(31.0, -12.0, 2.5);
    let survey = golden.survey();
    let there = Survey { start: moved.compose(&survey.start), ..survey.clone() };
    let mut other = SurveyProblem::new(&there, &golden.params(), None).unwrap();
    other.problem.factors.reverse();
    other.problem.solve(&Descent::default()).unwrap();
    other.problem.solve(&tight()).unwrap();
    for (a, b) in made.problem.state.keyframes.iter().zip(&other.problem.state.keyframes) {
        assert!(moved.compose(a).minus(b).amax() < 1e-6);
    }
    for (a, b) in made.problem.state.landmarks.iter().zip(&other.problem.state.landmarks) {
        let centre = moved.to_isometry3() * nalgebra::Point3::from(a.centre);
        assert!((centre.coords - b.centre).amax() < 1e-6 && (a.log_size - b.log_size).amax() < 1e-6);
    }
}

#[test]
fn the_same_survey_gives_the_same_bits() {
    let golden = Golden::read();
    let map = || surveyed(&golden.survey(), &golden.params()).unwrap();
    assert_eq!(map(), map());
}
