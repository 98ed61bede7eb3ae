use super::*;
use nalgebra::UnitQuaternion;

fn truth() -> State {
    let mut camera = [0.0; CAMERA];
    (camera[ALPHA], camera[PIXEL_ASPECT], camera[U0], camera[V0], camera[K1]) =
        (600.0, 1.0, 320.0, 240.0, -0.1);
    let pose = |roll: f64, pitch: f64, yaw: f64| {
        let front = UnitQuaternion::from_euler_angles(-0.5 * std::f64::consts::PI, 0.0, 0.0)
            * UnitQuaternion::from_euler_angles(0.0, 0.0, 0.5 * std::f64::consts::PI);
        let rotation = UnitQuaternion::from_euler_angles(pitch, yaw, roll) * front;
        Isometry3::from_parts(Vector3::new(0.1, -0.1, 2.0).into(), rotation)
    };
    State { camera, poses: vec![pose(0.0, 0.5, 0.1), pose(0.1, -0.3, 0.5), pose(-0.1, -0.2, -0.6)] }
}

/// A point in front of the plane by `x` metres.
fn seen(state: &State, view: usize, at: Vector3<f64>) -> Point2<f64> {
    let p = state.poses[view] * Point2::from(at.xy()).coords.push(at.z);
    let p = p + state.poses[view].translation.vector;
    let (c, x, y) = (&state.camera, p.x / p.z, p.y / p.z);
    let g = 1.0 + c[K1] * (x * x + y * y);
    Point2::new(c[ALPHA] * g * x + c[U0], c[ALPHA] * g * y + c[V0])
}

fn line(state: &State, view: usize, is_upright: bool, depth_m: f64, side_m: f64) -> Evidence {
    let end = |t: f64| {
        let at = if is_upright { [depth_m, side_m, t] } else { [depth_m, t, side_m] };
        seen(state, view, at.into())
    };
    Evidence::Line { view, ends_px: [end(-0.2), end(0.15)], sigma_px: 0.5, is_upright }
}

/// Windows on a plane, and lines at any depth: those of a frame and a shadow.
fn exact() -> Adjustment {
    let state = truth();
    let mut all = Vec::new();
    for view in 0..3 {
        for k in 0..24 {
            let at = Vector3::new(0.0, f64::from(k % 6) * 0.1 - 0.25, f64::from(k / 6) * 0.12 - 0.2);
            let (reference_px, px) = (seen(&state, 0, at), seen(&state, view, at));
            if view > 0 {
                all.push(Evidence::Window { view, reference_px, px, weight: Matrix2::identity() * 4.0 });
            }
        }
        for (depth_m, side_m) in [(0.0, 0.3), (0.03, -0.32), (-0.05, 0.35)] {
            all.push(line(&state, view, true, depth_m, side_m));
            all.push(line(&state, view, false, depth_m, side_m));
        }
    }
    let observations = all.into_iter().map(|what| Observation { what, trust: 1.0 }).collect();
    Adjustment { observations, free: free(1), reference: 0 }
}

#[test]
fn the_camera_is_found_whatever_the_depth_of_the_lines() {
    let (problem, truth) = (exact(), truth());
    assert!(problem.cost(&truth) < 1e-9, "{}", problem.cost(&truth));
    let mut start = truth.clone();
    (start.camera[ALPHA], start.camera[U0], start.camera[K1]) = (560.0, 330.0, 0.0);
    for (i, pose) in start.poses.iter_mut().enumerate() {
        *pose = moved(pose, &Vector6::from_fn(|k, _| if i > 0 || k < 3 { 0.02 } else { 0.0 }));
    }
    let found = problem.descend(start).unwrap();
    assert!((found.camera[ALPHA] - 600.0).abs() < 0.01, "{:?}", found.camera);
    assert!((found.camera[U0] - 320.0).abs() < 0.01 && (found.camera[K1] + 0.1).abs() < 1e-4);
    let sigma = problem.covariance(&found).unwrap()[(ALPHA, ALPHA)].sqrt();
    assert!((0.1..30.0).contains(&sigma), "{sigma}");
}

#[test]
fn a_line_that_is_moved_is_so_many_sigmas_off() {
    let (problem, state) = (exact(), truth());
    for is_upright in [true, false] {
        let Evidence::Line { view, ends_px: [a, b], sigma_px, .. } = line(&state, 1, is_upright, 0.04, 0.3)
        else {
            panic!("a line")
        };
        let across = Vector2::new(a.y - b.y, b.x - a.x).normalize() * sigma_px;
        let moved = Evidence::Line { view, ends_px: [a, b + across], sigma_px, is_upright };
        // One end by a sigma: of two independent ends, half of the variance.
        let off = problem.chi2(&moved, &state);
        assert!((0.25..0.8).contains(&off), "{off}");
    }
}
