//! Rectangular rooms with a poster on a wall and a lamp under the ceiling: all that is uncertain
//! (corners, robot pose, extrinsics, wall, ceiling) is drawn from its stated covariance.

use super::{Outcome, Strays, Summary};
use crate::evaluate::statistics::median;
use map::{
    extrinsics::{CameraExtrinsics, pan_tilt},
    place::LandmarkPlace,
    placement::{
        Ceiling, PlacementError, PlacementParams, PosedView, ceiling_placement, placement, view_on_ceiling,
        view_on_wall,
    },
    pose2::{Pose2, Pose2Covariance},
    segments::LaserSegment,
};
use nalgebra::{Matrix2, Matrix3, Matrix6, Point2, Vector2, Vector3};
use std::f64::consts::{FRAC_PI_2, PI};
use vision::{
    frame::{Distortion, Intrinsics},
    geometry::Corners,
    pose::{
        LandmarkSize,
        reprojection::{corner_points, perturbed, pixel},
    },
    random::Random,
};

const CAMERA: Intrinsics = Intrinsics {
    fx_px: 520.0,
    fy_px: 520.0,
    cx_px: 319.5,
    cy_px: 239.5,
    distortion: Distortion::None,
    sigmas: None,
};
/// Standard deviation of a corner.
const SIGMA_PX: f64 = 0.5;
/// Of the robot's pose: metres and radians.
const ROBOT_SIGMA: [f64; 3] = [0.02, 0.02, 0.005];
/// Of a wall's angle and distance.
const WALL_SIGMA: [f64; 2] = [0.002, 0.01];
/// Of the ceiling's height.
const CEILING_SIGMA_M: f64 = 0.01;
/// Most draws of a robot pose from which the object is wholly visible.
const MAX_TRIES: usize = 200;

/// A room, measured and true, with the errors that all views share.
struct Room {
    size: [f64; 2],
    walls: Vec<LaserSegment>,
    ceiling: Ceiling,
    true_walls: Vec<LaserSegment>,
    true_ceiling_m: f64,
    mounting_error: nalgebra::Vector6<f64>,
}

fn room(random: &mut Random) -> Option<Room> {
    let size = [random.range(4.0, 10.0), random.range(3.0, 8.0)];
    let c = [[0.0, 0.0], [size[0], 0.0], size, [0.0, size[1]]].map(Point2::from);
    let (mut walls, mut true_walls) = (vec![], vec![]);
    for i in 0..4 {
        let (a, b) = (c[i], c[(i + 1) % 4]);
        let length = (b - a).norm();
        let (turn, shift) = (WALL_SIGMA[0] * random.normal(), WALL_SIGMA[1] * random.normal());
        let d = (b - a) / length;
        let n = Vector2::new(-d.y, d.x);
        // The true wall: turned about its middle and shifted.
        let middle = nalgebra::center(&a, &b);
        let turned = |p: &Point2<f64>| p + n * (shift + turn * d.dot(&(p - middle)));
        let normal = if n.dot(&middle.coords) < 0.0 { -n } else { n };
        // Covariance of (alpha, rho) of a line known by its turn about its middle and by its shift
        // there.
        let lever = Vector2::new(-normal.y, normal.x).dot(&middle.coords);
        let (va, vs) = (WALL_SIGMA[0].powi(2), WALL_SIGMA[1].powi(2));
        let covariance = Matrix2::new(va, lever * va, lever * va, vs + lever * lever * va);
        walls.push(LaserSegment::from_ends(a, b, covariance).ok()?);
        true_walls.push(LaserSegment::from_ends(turned(&a), turned(&b), covariance).ok()?);
    }
    let ceiling = Ceiling { height_m: random.range(2.4, 3.2), sigma_m: CEILING_SIGMA_M };
    let true_ceiling_m = ceiling.height_m + CEILING_SIGMA_M * random.normal();
    let covariance = mounting(0.0, 0.0)?.covariance;
    let mounting_error = covariance.map_diagonal(f64::sqrt).map(|s| s * random.normal());
    Some(Room { size, walls, ceiling, true_walls, true_ceiling_m, mounting_error })
}

fn mounting(pan: f64, tilt: f64) -> Option<CameraExtrinsics> {
    CameraExtrinsics::new(pan_tilt(pan, tilt, Vector3::new(0.1, 0.02, 1.2))).ok()
}

/// A poster on a random wall, by the true walls.
fn poster(room: &Room, random: &mut Random) -> LandmarkPlace {
    let wall = &room.true_walls[(random.unit() * 4.0) as usize % 4];
    let size = LandmarkSize { width_m: random.range(0.3, 1.0), height_m: random.range(0.3, 1.2) };
    let reach = 0.5 * size.width_m + 0.1;
    let at = wall.a + wall.direction() * random.range(reach, wall.length_m() - reach);
    let f = wall.facing();
    LandmarkPlace {
        x_m: at.x,
        y_m: at.y,
        z_m: random.range(1.2, 1.8),
        theta_rad: f.y.atan2(f.x),
        roll_rad: 0.5_f64.to_radians() * random.normal(),
        tilt_rad: 0.0,
        size,
        covariance: Matrix6::zeros(),
        shared: None,
    }
}

fn lamp(room: &Room, random: &mut Random) -> LandmarkPlace {
    LandmarkPlace {
        x_m: random.range(1.0, room.size[0] - 1.0),
        y_m: random.range(1.0, room.size[1] - 1.0),
        z_m: room.true_ceiling_m,
        theta_rad: random.range(-PI, PI),
        roll_rad: 0.0,
        tilt_rad: FRAC_PI_2,
        size: LandmarkSize { width_m: random.range(0.4, 1.2), height_m: random.range(0.3, 0.8) },
        covariance: Matrix6::zeros(),
        shared: None,
    }
}

/// One view: corners, measured robot pose, stated extrinsics.
struct SimulatedView {
    corners: Corners,
    robot: Pose2Covariance,
    mounting: CameraExtrinsics,
}

impl SimulatedView {
    fn posed<'a>(&'a self, covariance: &'a [Matrix2<f64>; 4]) -> PosedView<'a> {
        PosedView {
            corners: &self.corners,
            covariance_px2: covariance,
            camera: &CAMERA,
            map_from_robot: &self.robot,
            mounting: &self.mounting,
        }
    }
}

/// A view of the object from 1 to 3.5 m, the camera aimed at it; drawn again until it is wholly in
/// the image.
fn simulated_view(room: &Room, object: &LandmarkPlace, random: &mut Random) -> Option<SimulatedView> {
    let covariance = Matrix3::from_diagonal(&Vector3::from(ROBOT_SIGMA.map(|s| s * s)));
    for _ in 0..MAX_TRIES {
        let (d, psi) = (random.range(1.0, 3.5), random.range(-60.0, 60.0).to_radians());
        let a = if object.tilt_rad > 0.0 { random.range(-PI, PI) } else { object.theta_rad + psi };
        let (x, y) = (object.x_m + d * a.cos(), object.y_m + d * a.sin());
        if !(0.3..room.size[0] - 0.3).contains(&x) || !(0.3..room.size[1] - 0.3).contains(&y) {
            continue;
        }
        let tilt = (object.z_m - 1.2).atan2(d) + random.range(-0.1, 0.1);
        let pan = random.range(-0.5, 0.5);
        let believed = Pose2::new(x, y, a + PI - pan + random.range(-0.2, 0.2));
        let mounting = mounting(pan, tilt)?;
        let e = Vector3::from(ROBOT_SIGMA).map(|s| s * random.normal());
        let truth = believed.plus(&e);
        let m = &room.mounting_error;
        let real = perturbed(
            &mounting.robot_from_camera,
            &m.fixed_rows::<3>(0).into(),
            &m.fixed_rows::<3>(3).into(),
        );
        let camera_from_landmark =
            real.inverse() * truth.to_isometry3().inverse() * object.map_from_landmark();
        // From its front side only.
        let normal = camera_from_landmark.rotation * Vector3::x();
        if normal.dot(&camera_from_landmark.translation.vector) >= 0.0 {
            continue;
        }
        let points = corner_points(&object.size).map(|p| {
            let noise = Vector2::new(random.normal(), random.normal()) * SIGMA_PX;
            pixel(&camera_from_landmark, &p, &CAMERA).map(|px| px + noise)
        });
        let [Some(p), Some(q), Some(r), Some(s)] = points else { continue };
        let inside = |p: &Point2<f64>| (0.0..639.0).contains(&p.x) && (0.0..479.0).contains(&p.y);
        if let (true, Ok(corners)) = ([p, q, r, s].iter().all(inside), Corners::new([p, q, r, s])) {
            let robot = Pose2Covariance { pose: believed, covariance };
            return Some(SimulatedView { corners, robot, mounting });
        }
    }
    None
}

fn on_walls(
    room: &Room,
    object: &LandmarkPlace,
    views: usize,
    random: &mut Random,
) -> Option<Result<LandmarkPlace, PlacementError>> {
    let covariance = [Matrix2::identity() * SIGMA_PX * SIGMA_PX; 4];
    let p = PlacementParams::default();
    let views: Option<Vec<SimulatedView>> =
        (0..views).map(|_| simulated_view(room, object, random)).collect();
    let (mut on_plane, mut why) = (vec![], None);
    for view in views? {
        match view_on_wall(&view.posed(&covariance), &room.walls, &p) {
            Ok(view) => on_plane.push(view),
            Err(error) => why = Some(error),
        }
    }
    Some(match why {
        Some(why) if on_plane.is_empty() => Err(why),
        _ => placement(&on_plane, &room.walls, &p).map(|made| made.place),
    })
}

fn on_ceiling(
    room: &Room,
    object: &LandmarkPlace,
    views: usize,
    random: &mut Random,
) -> Option<Result<LandmarkPlace, PlacementError>> {
    let covariance = [Matrix2::identity() * SIGMA_PX * SIGMA_PX; 4];
    let p = PlacementParams::default();
    let views: Option<Vec<SimulatedView>> =
        (0..views).map(|_| simulated_view(room, object, random)).collect();
    let on_plane: Result<Vec<_>, _> =
        views?.iter().map(|view| view_on_ceiling(&view.posed(&covariance), &room.ceiling, &p)).collect();
    Some(on_plane.and_then(|on_plane| ceiling_placement(&on_plane, &room.ceiling, &p)).map(|made| made.place))
}

/// Summaries of places by one and by several views, on walls and ceilings; and objects on no wall.
pub(super) fn evaluated(rooms: usize, views: usize, seed: u64) -> (Vec<Summary>, Vec<Strays>) {
    let mut random = Random::new(seed);
    let mut summaries = vec![];
    for (what, ceiling, n) in [
        ("rooms, walls, one view", false, 1),
        ("rooms, walls, several views", false, views),
        ("rooms, ceilings, one view", true, 1),
        ("rooms, ceilings, several views", true, views),
    ] {
        let (mut outcomes, mut refused) = (vec![], 0);
        for _ in 0..4 * rooms {
            let Some(room) = room(&mut random) else { continue };
            let object = if ceiling { lamp(&room, &mut random) } else { poster(&room, &mut random) };
            let place = if ceiling { on_ceiling } else { on_walls };
            match place(&room, &object, n, &mut random) {
                Some(Ok(made)) => outcomes.push(Outcome::of(&made, &object)),
                Some(Err(_)) => refused += 1,
                // No pose from which it is wholly visible.
                None => {}
            }
        }
        summaries.push(Summary::of(what, &outcomes, refused));
    }
    (summaries, strays(rooms, &mut random))
}

/// Doors ajar and boards that lean or hang askew, observed once.
fn strays(rooms: usize, random: &mut Random) -> Vec<Strays> {
    type Change = fn(&mut LandmarkPlace, f64);
    let open: Change = |object, angle| {
        // Hinged at its left side.
        let half = 0.5 * object.size.width_m;
        let side = |t: f64| Vector2::new(-t.sin(), t.cos());
        let hinge = Vector2::new(object.x_m, object.y_m) - side(object.theta_rad) * half;
        object.theta_rad += angle;
        let centre = hinge + side(object.theta_rad) * half;
        (object.x_m, object.y_m) = (centre.x, centre.y);
    };
    let askew: Change = |object, angle| object.roll_rad = angle;
    let mut all = vec![];
    for (what, change, angle_deg) in [
        ("opened by 10 degrees", open, 10.0_f64),
        ("opened by 30 degrees", open, 30.0),
        ("opened by 60 degrees", open, 60.0),
        ("hung askew by 8 degrees", askew, 8.0),
        ("hung askew by 15 degrees", askew, 15.0),
    ] {
        let mut made = Strays { what: what.into(), shown: 0, refused: 0, rms_m: 0.0, roll_deg: 0.0 };
        let (mut residuals, mut rolls) = (vec![], vec![]);
        for _ in 0..rooms {
            let Some(room) = room(random) else { continue };
            let mut object = poster(&room, random);
            change(&mut object, angle_deg.to_radians());
            match on_walls(&room, &object, 1, random) {
                Some(Ok(_)) => made.shown += 1,
                Some(Err(error)) => {
                    (made.shown, made.refused) = (made.shown + 1, made.refused + 1);
                    if let PlacementError::NotOnWall { rms_m, roll_rad } = error {
                        residuals.push(rms_m);
                        rolls.push(roll_rad.abs().to_degrees());
                    }
                }
                None => {}
            }
        }
        made.rms_m = median(&mut residuals).unwrap_or(f64::NAN);
        made.roll_deg = median(&mut rolls).unwrap_or(f64::NAN);
        all.push(made);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_within_three_sigma_and_open_doors_are_not_placed() {
        let (summaries, strays) = evaluated(40, 4, 3);
        for s in &summaries {
            assert!(s.placed > 80 && s.within_3_sigma > 0.985, "{s:?}");
            assert!((2.0..7.5).contains(&s.nees), "{s:?}");
        }
        assert!(summaries[1].median_m < summaries[0].median_m, "{summaries:?}");
        let (wide, little) = (&strays[2], &strays[0]);
        assert!(wide.refused * 10 > wide.shown * 7 && wide.refused >= little.refused, "{strays:?}");
    }
}
