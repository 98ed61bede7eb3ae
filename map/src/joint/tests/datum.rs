//! Covariances relative to the whole drive, against dense algebra with motions by finite
//! differences.

use super::*;
use crate::joint::datum::DriveFrame;
use nalgebra::{Matrix3, Point2};

/// All variables after a motion of the floor about a point; only what the motion changes.
fn moved(state: &State, centre: Point2<f64>, g: [f64; 3]) -> State {
    let turn = Pose2::new(0.0, 0.0, g[2]);
    let point = |p: Point2<f64>| {
        centre + turn.apply(&(p - centre).into()).coords + nalgebra::Vector2::new(g[0], g[1])
    };
    let mut made = state.clone();
    for keyframe in &mut made.keyframes {
        let at = point(keyframe.position().into());
        *keyframe = Pose2::new(at.x, at.y, keyframe.theta_rad + g[2]);
    }
    for landmark in &mut made.landmarks {
        let at = point(landmark.centre.xy().into());
        (landmark.centre.x, landmark.centre.y) = (at.x, at.y);
        landmark.theta_rad = wrap_rad(landmark.theta_rad + g[2]);
    }
    for wall in &mut made.walls {
        // A point of the wall far from its anchor.
        let on = wall.anchor + wall.normal() * wall.offset_m + wall.along() * 3.0;
        wall.facing_rad = wrap_rad(wall.facing_rad + g[2]);
        wall.offset_m = wall.normal().dot(&(point(on) - wall.anchor));
    }
    made
}

/// Parameters of a variable in `b` minus those in `a`.
fn difference(a: &State, b: &State, variable: Variable) -> DVector<f64> {
    let all = match variable {
        Variable::Keyframe(i) => b.keyframes[i].minus(&a.keyframes[i]).as_slice().to_vec(),
        Variable::Landmark(i) => b.landmarks[i].minus(&a.landmarks[i]).as_slice().to_vec(),
        Variable::Wall(i) => {
            let (a, b) = (&a.walls[i], &b.walls[i]);
            vec![wrap_rad(b.facing_rad - a.facing_rad), b.offset_m - a.offset_m]
        }
        other => vec![0.0; other.size()],
    };
    DVector::from_vec(all)
}

#[test]
fn relative_to_the_drive_its_own_shift_and_turn_are_no_error() {
    let made = solved(&Golden::read());
    let problem = &made.problem;
    let state = &problem.state;
    let (first, j, _) = dense(problem);
    let root = j.qr().r().try_inverse().unwrap();
    let covariance = &root * root.transpose();
    let count = state.keyframes.len() as f64;
    let centre =
        Point2::from(state.keyframes.iter().map(Pose2::position).sum::<nalgebra::Vector2<f64>>() / count);
    let step = 1e-6;
    let moves = |variable: Variable| {
        let column = |k: usize| {
            let mut g = [0.0; 3];
            g[k] = step;
            let up = moved(state, centre, g);
            g[k] = -step;
            difference(&moved(state, centre, g), &up, variable) / (2.0 * step)
        };
        DMatrix::from_columns(&[column(0), column(1), column(2)])
    };
    // Least squares of a motion over x, y and heading of all keyframes.
    let mut normal = Matrix3::zeros();
    let mut by_all = DMatrix::zeros(3, covariance.nrows());
    for i in 0..state.keyframes.len() {
        let by = moves(Variable::Keyframe(i));
        normal += by.transpose() * &by;
        if let Some((_, row)) = first.iter().find(|(v, _)| *v == Variable::Keyframe(i)) {
            by_all.view_mut((0, *row), (3, 3)).copy_from(&by.transpose());
        }
    }
    let by_all = normal.try_inverse().unwrap() * by_all;
    let frame = DriveFrame::of(problem).unwrap();
    for variable in [
        Variable::Keyframe(0),
        Variable::Keyframe(39),
        Variable::Landmark(2),
        Variable::Wall(1),
        Variable::Camera(0),
    ] {
        let size = variable.size();
        let mut by = -moves(variable) * &by_all;
        let mut alone = DMatrix::zeros(size, size);
        if let Some((_, row)) = first.iter().find(|(v, _)| *v == variable) {
            let mut own = by.columns_mut(*row, size);
            own += DMatrix::<f64>::identity(size, size);
            alone.copy_from(&covariance.view((*row, *row), (size, size)));
        }
        let wanted = &by * &covariance * by.transpose();
        let found = frame.relative(state, variable, &alone);
        let off = (&found - &wanted).amax();
        assert!(off < 2e-3 * wanted.amax() + 1e-10, "{variable:?}: {off} {found} {wanted}");
    }
    // The last pose is better known so, the first worse.
    let of = |variable, alone: DMatrix<f64>| frame.relative(state, variable, &alone)[(1, 1)];
    let marginals = Marginals::of(problem, &[Variable::Keyframe(39)]).unwrap();
    let last = marginals.block(Variable::Keyframe(39), Variable::Keyframe(39)).unwrap();
    assert!(of(Variable::Keyframe(39), last.clone()) < last[(1, 1)]);
    assert!(of(Variable::Keyframe(0), DMatrix::zeros(3, 3)) > 0.0);
}
