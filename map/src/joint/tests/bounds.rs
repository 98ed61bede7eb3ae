//! What is too large, out of range or does not determine a map.

use super::{super::*, golden::Golden};
use crate::{pose2::Pose2, slam::graph::MAX_POSES};
use nalgebra::{UnitQuaternion, Vector3};

/// A fault of a survey.
type Change = fn(&mut Survey);

fn level(landmark: usize) -> Factor {
    Factor::Level(Level { landmark, sigma_rad: 0.01 })
}

#[test]
fn too_many_variables_and_factors_are_refused() {
    let state = State { keyframes: vec![Pose2::default(); MAX_POSES + 1], ..State::default() };
    let mut problem = JointProblem { state, ..JointProblem::default() };
    assert_eq!(problem.solve(&Descent::default()), Err(JointError::TooLarge(MAX_POSES + 1, 0)));
    problem.state.keyframes.truncate(1);
    problem.factors = vec![level(0); MAX_FACTORS + 1];
    assert_eq!(problem.solve(&Descent::default()), Err(JointError::TooLarge(1, MAX_FACTORS + 1)));
}

#[test]
fn factors_of_missing_variables_and_surveys_of_missing_numbers_are_refused() {
    let mut problem = JointProblem { factors: vec![level(0)], ..JointProblem::default() };
    assert_eq!(problem.solve(&Descent::default()), Err(JointError::Factor(0)));
    let golden = Golden::read();
    let cases: [(Change, &str); 7] = [
        (|s| s.drives[0].lines[3].keyframe = 40, "keyframe of line 3"),
        (|s| s.drives[0].lines[3].wall = 99, "wall of line 3"),
        (|s| s.drives[0].tracks[1].views[0].keyframe = 40, "keyframe of track 1"),
        (|s| s.drives[0].tracks[2].wall = Some(99), "wall of track 2"),
        (|s| s.candidates = vec![[0, 99]], "track of candidate 0"),
        (|s| s.same_wall[0] = 99, "same_wall of wall 0"),
        (|s| s.drives[0].motions[5].covariance.fill(0.0), "covariance of motion 5"),
    ];
    for (change, what) in cases {
        let mut survey = golden.survey();
        change(&mut survey);
        let error = surveyed(&survey, &golden.params()).unwrap_err().to_string();
        assert_eq!(error, format!("{what} is out of range"));
    }
}

#[test]
fn a_variable_that_is_fixed_or_missing_has_no_covariance() {
    let golden = Golden::read();
    let map = surveyed(&golden.survey(), &golden.params()).unwrap();
    for variable in [Variable::Keyframe(0), Variable::Wall(99)] {
        assert_eq!(Marginals::of(&map.problem, &[variable]), Err(JointError::Variable(variable)));
    }
}

/// Whatever is missing, the rest is a map of finite numbers.
#[test]
fn a_poor_drive_gives_the_rest_of_the_map() {
    let golden = Golden::read();
    let cases: [Change; 6] = [
        |s| s.drives[0].tracks.clear(),
        |s| s.drives[0].tracks.truncate(1),
        |s| s.drives[0].lines.clear(),
        |s| s.drives[0].tracks.iter_mut().for_each(|t| t.views.truncate(1)),
        |s| s.drives[0].motions.iter_mut().for_each(|m| m.motion = Pose2::default()),
        |s| {
            let upside_down = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
            let mounting = &mut s.camera.camera.robot_from_camera;
            mounting.rotation = upside_down * mounting.rotation;
        },
    ];
    for (i, change) in cases.into_iter().enumerate() {
        let mut survey = golden.survey();
        change(&mut survey);
        let map = surveyed(&survey, &golden.params()).unwrap_or_else(|e| panic!("{i}: {e}"));
        let state = &map.problem.state;
        assert_eq!(state.keyframes.len(), 40);
        assert!(state.keyframes.iter().all(|p| p.check().is_ok()), "{i}");
        assert!(state.landmarks.iter().all(|m| m.parameters().iter().all(|v| v.is_finite())), "{i}");
    }
}
