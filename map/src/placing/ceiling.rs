//! A landmark's place under a ceiling of given height (method 11.2, A24: the laser does not see ceilings).
//!
//! In: views as for walls, the ceiling. Out: place and size with covariance, or why the thing is not up there.

use super::{
    MAX_VIEWS, PlacingError, PlacingParams, PlacingView, WallSighting, by_camera, checked, new_in_each_view,
    rays::{self, Hit, MOUNTING, WALL},
};
use crate::{
    check::{self, OutOfRange},
    place::{LandmarkPlace, MAX_HEIGHT_M},
    pose2::wrap_rad,
};
use nalgebra::{DMatrix, Matrix6, SMatrix, SVector, Vector2};
use std::f64::consts::FRAC_PI_2;
use vision::pose::{LandmarkSize, PoseError};

type Matrix5 = SMatrix<f64, 5, 5>;
type Vector5 = SVector<f64, 5>;

/// Corners TL, TR, BR, BL in widths (viewer's right) and heights (top).
const CORNERS: [(f64, f64); 4] = [(-0.5, 0.5), (0.5, 0.5), (0.5, -0.5), (-0.5, -0.5)];

/// A horizontal plane above the robots.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ceiling {
    /// Above the floor.
    pub height_m: f64,
    /// Standard deviation.
    pub sigma_m: f64,
}

impl Ceiling {
    /// Within 0 to [`MAX_HEIGHT_M`], its standard deviation 0 to 1 m.
    pub fn check(&self) -> Result<(), OutOfRange> {
        check::within("ceiling.height_m", self.height_m, 0.0, MAX_HEIGHT_M)?;
        check::within("ceiling.sigma_m", self.sigma_m, 0.0, 1.0)
    }
}

/// The rectangle that one view gives under the ceiling.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewOnCeiling {
    /// Centre x and y, direction of the top, width, height.
    pub rectangle: SVector<f64, 5>,
    /// What is new in every view: corners and robot pose.
    pub covariance: SMatrix<f64, 5, 5>,
    /// By the mounting's (rotation, translation).
    pub by_mounting: SMatrix<f64, 5, 6>,
    /// Covariance of the mounting.
    pub mounting_covariance: Matrix6<f64>,
    /// By the camera's (focal length, principal point), each in its standard deviations.
    pub by_camera: SMatrix<f64, 5, 3>,
    /// By the ceiling's height.
    pub by_height: SVector<f64, 5>,
    /// Distance of the hits from the rectangle.
    pub rms_m: f64,
}

/// The rectangle a view gives under the ceiling.
pub fn view_on_ceiling(
    view: &PlacingView<'_>,
    ceiling: &Ceiling,
    p: &PlacingParams,
) -> Result<ViewOnCeiling, PlacingError> {
    ceiling.check()?;
    let sighting = checked(view)?;
    let hits = [0, 1, 2, 3].map(|i| rays::ceiling_hit(&sighting, i, ceiling.height_m));
    let [Some(a), Some(b), Some(c), Some(d)] = hits else { return Err(PlacingError::NoWall) };
    fit(&sighting, &[a, b, c, d], p)
}

fn fit(view: &WallSighting<'_>, hits: &[Hit; 4], p: &PlacingParams) -> Result<ViewOnCeiling, PlacingError> {
    let mut seen = SVector::<f64, 8>::zeros();
    let mut by = SMatrix::<f64, 8, { rays::INPUTS }>::zeros();
    for (i, hit) in hits.iter().enumerate() {
        seen.fixed_rows_mut::<2>(2 * i).copy_from(&hit.point.xy());
        by.fixed_rows_mut::<2>(2 * i).copy_from(&hit.by.fixed_rows::<2>(0));
    }
    let independent = new_in_each_view(view, &by);
    let m = by.fixed_columns::<6>(MOUNTING);
    let weight = (independent + m * view.mounting.covariance * m.transpose())
        .cholesky()
        .ok_or(PoseError::Degenerate)?
        .inverse();
    let (q, gain) = rectangle(&seen, &weight).ok_or(PoseError::Degenerate)?;
    let rms_m = ((seen - corners_of(&q)).norm_squared() / 4.0).sqrt();
    let possible = |v: f64| (LandmarkSize::MIN_M..=LandmarkSize::MAX_M).contains(&v);
    if rms_m > p.max_rms_m || !possible(q[3]) || !possible(q[4]) {
        return Err(PlacingError::NotOnCeiling { rms_m });
    }
    Ok(ViewOnCeiling {
        rectangle: q,
        covariance: gain * independent * gain.transpose(),
        by_mounting: gain * m,
        mounting_covariance: view.mounting.covariance,
        by_camera: gain * by_camera(view, &by),
        by_height: gain * by.column(WALL),
        rms_m,
    })
}

fn corners_of(q: &Vector5) -> SVector<f64, 8> {
    let (s, c) = q[2].sin_cos();
    let mut made = SVector::<f64, 8>::zeros();
    for (i, (y, z)) in CORNERS.iter().enumerate() {
        let (y, z) = (y * q[3], z * q[4]);
        (made[2 * i], made[2 * i + 1]) = (q[0] - s * y + c * z, q[1] + c * y + s * z);
    }
    made
}

/// Weighted least squares over the rectangle, with the gain from hits to it.
fn rectangle(seen: &SVector<f64, 8>, weight: &SMatrix<f64, 8, 8>) -> Option<(Vector5, SMatrix<f64, 5, 8>)> {
    /// Steps: the problem is linear but for the direction, whose start is good.
    const STEPS: usize = 8;
    let at = |i: usize| Vector2::new(seen[2 * i], seen[2 * i + 1]);
    let centre = (at(0) + at(1) + at(2) + at(3)) * 0.25;
    let (up, right) = ((at(0) + at(1) - at(2) - at(3)) * 0.5, (at(1) + at(2) - at(0) - at(3)) * 0.5);
    // A mirrored quad is no view from below.
    if up.x * right.y - up.y * right.x <= 0.0 {
        return None;
    }
    let mut q = Vector5::from([centre.x, centre.y, up.y.atan2(up.x), right.norm(), up.norm()]);
    let mut gain = SMatrix::<f64, 5, 8>::zeros();
    for _ in 0..STEPS {
        let (s, c) = q[2].sin_cos();
        let mut j = SMatrix::<f64, 8, 5>::zeros();
        for (i, (y, z)) in CORNERS.into_iter().enumerate() {
            let (wide, high) = (y * q[3], z * q[4]);
            let rows = [
                [1.0, 0.0, -c * wide - s * high, -s * y, c * z],
                [0.0, 1.0, -s * wide + c * high, c * y, s * z],
            ];
            j.row_mut(2 * i).copy_from_slice(&rows[0]);
            j.row_mut(2 * i + 1).copy_from_slice(&rows[1]);
        }
        let inverse = (j.transpose() * weight * j).cholesky()?.inverse();
        gain = inverse * j.transpose() * weight;
        q += gain * (seen - corners_of(&q));
    }
    q[2] = wrap_rad(q[2]);
    q.iter().all(|v| v.is_finite()).then_some((q, gain))
}

/// Fuses views of one thing under one ceiling; also the indices of the views that passed the gate, 99 % of chi2 with 5
/// degrees of freedom.
pub fn ceiling_placement(
    views: &[ViewOnCeiling],
    ceiling: &Ceiling,
    p: &PlacingParams,
) -> Result<super::Placement, PlacingError> {
    const CHI2_5_99: f64 = 15.086;
    ceiling.check()?;
    let views = &views[..views.len().min(MAX_VIEWS)];
    let total = |v: &ViewOnCeiling| {
        let mounting = v.by_mounting * v.mounting_covariance * v.by_mounting.transpose();
        v.covariance + mounting + v.by_camera * v.by_camera.transpose()
    };
    let agree = |a: &ViewOnCeiling, b: &ViewOnCeiling| {
        let d = apart(&a.rectangle, &b.rectangle);
        (total(a) + total(b)).cholesky().is_some_and(|s| d.dot(&s.solve(&d)) <= CHI2_5_99)
    };
    let votes = |i: usize| views.iter().filter(|v| agree(&views[i], v)).count();
    // Ties: the first.
    let seed =
        (0..views.len()).max_by_key(|&i| (votes(i), std::cmp::Reverse(i))).ok_or(PlacingError::NoView)?;
    let used: Vec<usize> = (0..views.len()).filter(|&i| agree(&views[seed], &views[i])).collect();
    let chosen: Vec<&ViewOnCeiling> = used.iter().map(|&i| &views[i]).collect();
    let place = fused(&views[seed].rectangle, &chosen, ceiling, p).ok_or(PlacingError::NoView)?;
    place.check()?;
    Ok(super::Placement { place, used })
}

/// `a - b`, the direction wrapped.
fn apart(a: &Vector5, b: &Vector5) -> Vector5 {
    let mut d = a - b;
    d[2] = wrap_rad(d[2]);
    d
}

/// Information form; mounting, camera and ceiling move all views alike and are added once, at the end.
fn fused(
    origin: &Vector5,
    views: &[&ViewOnCeiling],
    ceiling: &Ceiling,
    p: &PlacingParams,
) -> Option<LandmarkPlace> {
    let mut information = Matrix5::zeros();
    for v in views {
        information += v.covariance.try_inverse()?;
    }
    let mean = information.cholesky()?.inverse();
    let (mut d, mut by_mounting, mut by_height) =
        (Vector5::zeros(), SMatrix::<f64, 5, 6>::zeros(), Vector5::zeros());
    let mut by_camera = SMatrix::<f64, 5, 3>::zeros();
    for v in views {
        let share = mean * v.covariance.try_inverse()?;
        d += share * apart(&v.rectangle, origin);
        by_mounting += share * v.by_mounting;
        by_camera += share * v.by_camera;
        by_height += share * v.by_height;
    }
    let q = origin + d;
    let inflation = if views.len() > 1 { p.inflation } else { 1.0 };
    let own = mean * inflation
        + by_mounting * views[0].mounting_covariance * by_mounting.transpose()
        + by_camera * by_camera.transpose();
    // (x, y, theta, z, w, h) by (rectangle, height of the ceiling).
    let mut j = DMatrix::zeros(6, 6);
    for (row, k) in [(0, 0), (1, 1), (2, 2), (4, 3), (5, 4)] {
        j[(row, k)] = 1.0;
        j[(row, 5)] = by_height[k];
    }
    j[(3, 5)] = 1.0;
    let mut s = DMatrix::zeros(6, 6);
    s.view_mut((0, 0), (5, 5)).copy_from(&own);
    s[(5, 5)] = ceiling.sigma_m.powi(2);
    let covariance = &j * s * j.transpose();
    let covariance = Matrix6::from_iterator(covariance.iter().copied());
    Some(LandmarkPlace {
        x_m: q[0],
        y_m: q[1],
        z_m: ceiling.height_m,
        theta_rad: wrap_rad(q[2]),
        roll_rad: 0.0,
        tilt_rad: FRAC_PI_2,
        size: LandmarkSize { width_m: q[3], height_m: q[4] },
        covariance: 0.5 * (covariance + covariance.transpose()),
    })
}

/// Errors of a place in the order of its covariance: x, y, theta, z, width, height.
#[cfg(test)]
pub(crate) fn error_of(made: &LandmarkPlace, truth: &LandmarkPlace) -> nalgebra::Vector6<f64> {
    nalgebra::Vector6::new(
        made.x_m - truth.x_m,
        made.y_m - truth.y_m,
        wrap_rad(made.theta_rad - truth.theta_rad),
        made.z_m - truth.z_m,
        made.size.width_m - truth.size.width_m,
        made.size.height_m - truth.size.height_m,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        mounting::{Mounting, pan_tilt},
        pose2::{Pose2, Pose2Covariance},
    };
    use nalgebra::{Matrix2, Matrix3, Point2, Vector3};
    use vision::{
        frame::{Distortion, Intrinsics, IntrinsicsSigmas},
        geometry::Corners,
        pose::reprojection::{corner_points, perturbed, pixel},
        random::Random,
    };

    const SIZE: LandmarkSize = LandmarkSize { width_m: 1.2, height_m: 0.8 };
    const CEILING: Ceiling = Ceiling { height_m: 2.6, sigma_m: 0.01 };

    fn camera() -> Intrinsics {
        Intrinsics::new(500.0, 490.0, 320.0, 240.0, Distortion::None).unwrap()
    }

    fn mounting() -> Mounting {
        Mounting::new(pan_tilt(0.1, 0.8, Vector3::new(0.1, 0.02, 1.2))).unwrap()
    }

    fn truth(height_m: f64) -> LandmarkPlace {
        LandmarkPlace {
            x_m: 4.0,
            y_m: 3.0,
            z_m: height_m,
            theta_rad: 2.8,
            roll_rad: 0.0,
            tilt_rad: FRAC_PI_2,
            size: SIZE,
            covariance: Matrix6::zeros(),
        }
    }

    fn robot(direction: f64) -> Pose2Covariance {
        let (d, v) = (1.5, Vector3::new(4e-4, 4e-4, 3e-5));
        let pose = Pose2::new(4.0 - d * direction.cos(), 3.0 - d * direction.sin(), direction - 0.1);
        Pose2Covariance { pose, covariance: Matrix3::from_diagonal(&v) }
    }

    fn project(place: &LandmarkPlace, robot: &Pose2, mounting: &Mounting) -> [Point2<f64>; 4] {
        projected(&camera(), place, robot, mounting)
    }

    fn projected(
        camera: &Intrinsics,
        place: &LandmarkPlace,
        robot: &Pose2,
        mounting: &Mounting,
    ) -> [Point2<f64>; 4] {
        let camera_from_landmark =
            mounting.robot_from_camera.inverse() * robot.to_isometry3().inverse() * place.map_from_landmark();
        corner_points(&place.size).map(|p| pixel(&camera_from_landmark, &p, camera).unwrap())
    }

    /// As it is said to be: focal length to 0.8 %, principal point to 3 px.
    fn stated() -> Intrinsics {
        camera().with_sigmas(IntrinsicsSigmas { focal_px: 4.0, center_px: 3.0 }).unwrap()
    }

    fn look(points: [Point2<f64>; 4], robot: &Pose2Covariance) -> Result<ViewOnCeiling, PlacingError> {
        let view = PlacingView {
            corners: &Corners::new(points).unwrap(),
            covariance_px2: &[Matrix2::identity() * 0.25; 4],
            camera: &stated(),
            map_from_robot: robot,
            mounting: &mounting(),
        };
        view_on_ceiling(&view, &CEILING, &PlacingParams::default())
    }

    #[test]
    fn exact_views_give_the_exact_place() {
        let views: Vec<_> = [0.0, 1.0, -2.0]
            .map(|direction| {
                let robot = robot(direction);
                look(project(&truth(2.6), &robot.pose, &mounting()), &robot).unwrap()
            })
            .into();
        let made = ceiling_placement(&views, &CEILING, &PlacingParams::default()).unwrap();
        let (a, b) = (made.place.map_from_landmark(), truth(2.6).map_from_landmark());
        assert!((a.to_homogeneous() - b.to_homogeneous()).norm() < 1e-9, "{a} {b}");
        assert!((made.place.size.width_m - 1.2).abs() < 1e-9 && made.used == [0, 1, 2]);
    }

    #[test]
    fn the_covariance_is_honest() {
        // Oracle: Monte Carlo with corners, robot, mounting, camera and ceiling drawn anew.
        let mut random = Random::new(7);
        for directions in [vec![0.4], vec![0.4, 2.0, -1.5]] {
            let (mut sum, mut n, mut beyond) = (0.0, 0.0, 0);
            for _ in 0..400 {
                let hung = truth(2.6 + 0.01 * random.normal());
                let m = mounting();
                let e = m.covariance.map_diagonal(f64::sqrt).map(|s| s * random.normal());
                let (turn, shift) = (e.fixed_rows::<3>(0).into(), e.fixed_rows::<3>(3).into());
                let real =
                    Mounting { robot_from_camera: perturbed(&m.robot_from_camera, &turn, &shift), ..m };
                let k = camera();
                let share = 1.0 + 0.008 * random.normal();
                let (cx_px, cy_px) = (k.cx_px + 3.0 * random.normal(), k.cy_px + 3.0 * random.normal());
                let taken_by =
                    Intrinsics { fx_px: k.fx_px * share, fy_px: k.fy_px * share, cx_px, cy_px, ..k };
                let views: Vec<_> = directions
                    .iter()
                    .map(|direction| {
                        let believed = robot(*direction);
                        let e = believed.covariance.map_diagonal(f64::sqrt).map(|s| s * random.normal());
                        let stood = believed.pose.plus(&e);
                        let noise =
                            |p: Point2<f64>, r: &mut Random| p + Vector2::new(r.normal(), r.normal()) * 0.5;
                        let points =
                            projected(&taken_by, &hung, &stood, &real).map(|p| noise(p, &mut random));
                        look(points, &believed).unwrap()
                    })
                    .collect();
                let made = ceiling_placement(&views, &CEILING, &PlacingParams::default()).unwrap();
                let e = error_of(&made.place, &hung);
                let value = e.dot(&made.place.covariance.cholesky().unwrap().solve(&e));
                (sum, n) = (sum + value, n + 1.0);
                beyond += usize::from((0..6).any(|k| e[k].powi(2) > 9.0 * made.place.covariance[(k, k)]));
            }
            // chi2 with 6 degrees of freedom; several views are inflated by 2.
            let range = if directions.len() == 1 { 5.4..6.7 } else { 2.5..6.3 };
            assert!(range.contains(&(sum / n)), "{directions:?}: {}", sum / n);
            assert!(beyond <= 12, "{beyond} of 400 beyond 3 sigma");
        }
    }

    #[test]
    fn what_is_not_up_there_is_refused() {
        let robot = robot(0.4);
        // A poster on a wall, seen by the same camera.
        let wall =
            LandmarkPlace { tilt_rad: 0.0, theta_rad: 0.4 + std::f64::consts::PI, z_m: 2.2, ..truth(2.6) };
        let refused = look(project(&wall, &robot.pose, &mounting()), &robot);
        assert!(
            matches!(refused, Err(PlacingError::NotOnCeiling { .. } | PlacingError::NoWall)),
            "{refused:?}"
        );
        let bad = Ceiling { height_m: MAX_HEIGHT_M + 0.1, ..CEILING };
        assert_eq!(bad.check().unwrap_err().field, "ceiling.height_m");
        assert!(Ceiling { sigma_m: f64::NAN, ..CEILING }.check().is_err());
        assert!(Ceiling { height_m: MAX_HEIGHT_M, sigma_m: 1.0 }.check().is_ok());
        assert_eq!(ceiling_placement(&[], &CEILING, &PlacingParams::default()), Err(PlacingError::NoView));
    }

    #[test]
    fn the_derivative_by_the_height_is_the_finite_difference() {
        let robot = robot(0.4);
        let points = project(&truth(2.6), &robot.pose, &mounting());
        let view = PlacingView {
            corners: &Corners::new(points).unwrap(),
            covariance_px2: &[Matrix2::identity() * 0.25; 4],
            camera: &camera(),
            map_from_robot: &robot,
            mounting: &mounting(),
        };
        let at = |h: f64| {
            let ceiling = Ceiling { height_m: h, ..CEILING };
            view_on_ceiling(&view, &ceiling, &PlacingParams::default()).unwrap()
        };
        let numeric = (at(2.6 + 1e-5).rectangle - at(2.6 - 1e-5).rectangle) / 2e-5;
        assert!((numeric - at(2.6).by_height).norm() < 1e-5, "{numeric}");
    }
}
