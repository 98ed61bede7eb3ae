//! The placement that several views on one wall agree on.

use crate::{
    place::LandmarkPlace,
    placement::{
        params::{PlacementError, PlacementParams},
        rays,
        view::{MAX_VIEWS, Placement},
        wall::WallRectangle,
    },
    segments::LaserSegment,
};
use nalgebra::{DMatrix, Matrix2, Matrix4, Matrix4x2, Matrix4x3, Matrix6, SMatrix, Vector2, Vector4};
use vision::pose::LandmarkSize;

/// Fuses views of one object on one wall. The seed is the view that most others agree with; views
/// outside of its gate are left out.
pub fn placement(
    views: &[WallRectangle],
    walls: &[LaserSegment],
    p: &PlacementParams,
) -> Result<Placement, PlacementError> {
    let views = &views[..views.len().min(MAX_VIEWS)];
    let agree = |a: &WallRectangle, b: &WallRectangle| {
        let d = a.rectangle - b.rectangle;
        let s = (total(a) + total(b)).cholesky();
        a.wall == b.wall && s.is_some_and(|s| d.dot(&s.solve(&d)) <= p.gate_chi2)
    };
    let votes = |i: usize| views.iter().filter(|v| agree(&views[i], v)).count();
    // Ties: the first view.
    let seed =
        (0..views.len()).max_by_key(|&i| (votes(i), std::cmp::Reverse(i))).ok_or(PlacementError::NoView)?;
    let wall = walls.get(views[seed].wall).ok_or(PlacementError::NoView)?;
    let used: Vec<usize> = (0..views.len()).filter(|&i| agree(&views[seed], &views[i])).collect();
    let chosen: Vec<&WallRectangle> = used.iter().map(|&i| &views[i]).collect();
    let place = fused(&chosen, wall, p).ok_or(PlacementError::NoView)?;
    place.check()?;
    Ok(Placement { place, used })
}

/// Covariance of a view with the wall fixed.
fn total(v: &WallRectangle) -> Matrix4<f64> {
    let mounting = v.by_mounting * v.mounting_covariance * v.by_mounting.transpose();
    v.covariance + mounting + v.by_camera * v.by_camera.transpose()
}

/// Fusion in information form with the wall fixed. The errors of extrinsics, intrinsics and wall
/// are common to all views and added once; so are those of the robot's pose: a robot that goes by
/// laser and odometry errs alike for metres.
fn fused(views: &[&WallRectangle], wall: &LaserSegment, p: &PlacementParams) -> Option<LandmarkPlace> {
    let mut information = Matrix4::zeros();
    for v in views {
        information += v.covariance.try_inverse()?;
    }
    let mean = information.cholesky()?.inverse();
    let (mut rectangle, mut by_mounting, mut by_wall) =
        (Vector4::zeros(), SMatrix::<f64, 4, 6>::zeros(), Matrix4x2::zeros());
    let (mut by_camera, mut by_robot) = (Matrix4x3::zeros(), Matrix4x3::zeros());
    let (mut own, mut roll_rad, n) = (Matrix4::zeros(), 0.0, views.len() as f64);
    for v in views {
        let share = mean * v.covariance.try_inverse()?;
        rectangle += share * v.rectangle;
        by_mounting += share * v.by_mounting;
        by_camera += share * v.by_camera;
        by_robot += share * v.by_robot;
        own += share * (v.covariance - v.by_robot * v.by_robot.transpose()) * share.transpose();
        by_wall += share * v.by_wall;
        roll_rad += v.roll_rad / n;
    }
    let inflation = if views.len() > 1 { p.inflation } else { 1.0 };
    let shared = by_mounting * views[0].mounting_covariance * by_mounting.transpose()
        + by_camera * by_camera.transpose()
        + by_robot * by_robot.transpose();
    let (theta, r) = rays::plane(wall);
    let (facing, side) = (Vector2::new(theta.cos(), theta.sin()), Vector2::new(-theta.sin(), theta.cos()));
    // (x, y) = r facing + along side, by (rectangle, wall).
    let mut j = DMatrix::zeros(6, 6);
    j.view_mut((0, 0), (2, 1)).copy_from(&side);
    for (row, k) in [(3, 1), (4, 2), (5, 3)] {
        j[(row, k)] = 1.0;
    }
    j.view_mut((0, 4), (2, 1)).copy_from(&(side * r - facing * rectangle[0]));
    j.view_mut((0, 5), (2, 1)).copy_from(&facing);
    j[(2, 4)] = 1.0;
    let moved = j.columns(0, 4) * by_wall;
    let mut wall_part = j.columns_mut(4, 2);
    wall_part += moved;
    let mut s = DMatrix::zeros(6, 6);
    s.view_mut((0, 0), (4, 4)).copy_from(&(own * inflation + shared));
    s.view_mut((4, 4), (2, 2)).copy_from(&facing_covariance(wall));
    let covariance = &j * s * j.transpose();
    let covariance = Matrix6::from_iterator(covariance.iter().copied());
    let at = facing * r + side * rectangle[0];
    Some(LandmarkPlace {
        x_m: at.x,
        y_m: at.y,
        z_m: rectangle[1],
        theta_rad: theta,
        roll_rad,
        tilt_rad: 0.0,
        size: LandmarkSize { width_m: rectangle[2], height_m: rectangle[3] },
        covariance: 0.5 * (covariance + covariance.transpose()),
        shared: None,
    })
}

/// Covariance of (facing angle, signed distance) from that of (alpha, rho).
fn facing_covariance(wall: &LaserSegment) -> Matrix2<f64> {
    let n = Vector2::new(wall.alpha_rad.cos(), wall.alpha_rad.sin());
    let sign = if n.dot(&wall.facing()) < 0.0 { -1.0 } else { 1.0 };
    let flip = Matrix2::new(1.0, 0.0, 0.0, sign);
    flip * wall.covariance * flip
}
