//! The simulator's corridor, rendered: posters on walls and lamps under the ceiling, with corners
//! and covariances by the detector, from robot poses of known covariance.

use super::{Outcome, Summary};
use crate::evaluate::experiment::{mixed, of_each};
use map::{
    extrinsics::{CameraExtrinsics, pan_tilt},
    place::LandmarkPlace,
    placement::{
        Ceiling, CeilingRectangle, PlacementParams, PosedView, WallRectangle, ceiling_placement, placement,
    },
    pose2::{Pose2, Pose2Covariance},
    segments::LaserSegment,
};
use nalgebra::{Matrix2, Matrix3, Matrix6, Point2, Vector3};
use sim::{
    building::{Building, LandmarkKind, LandmarkTruth},
    camera::Camera,
    render::Renderer,
    sensor::SensorParams,
};
use std::f64::consts::{FRAC_PI_2, PI};
use vision::{
    detect::{DetectParams, Quad, detect},
    geometry::polygon::iou,
    pose::LandmarkSize,
    random::Random,
    trace::NoTrace,
};

/// Measured height of the corridor's ceiling.
const CEILING: Ceiling = Ceiling { height_m: 2.7, sigma_m: 0.01 };
/// Standard deviation of the robot's pose: metres and radians.
const ROBOT_SIGMA: [f64; 3] = [0.02, 0.02, 0.005];
/// A detected quad is the landmark if it overlaps it by this much.
const SAME_IOU: f64 = 0.8;
/// Frames rendered for each view wanted.
const TRIES: usize = 4;
/// Shortest side of a landmark that counts as visible.
const MIN_SIDE_PX: f64 = 30.0;

enum PlacedView {
    Wall(WallRectangle),
    Ceiling(CeilingRectangle),
}

pub(super) fn evaluated(corridors: usize, views: usize, seed: u64) -> Vec<Summary> {
    let mut tasks: Vec<(u64, LandmarkTruth)> = vec![];
    for corridor in 0..corridors as u64 {
        let building = Building::corridor(mixed(&[seed, corridor]));
        let wanted = |l: &&LandmarkTruth| matches!(l.kind, LandmarkKind::Poster | LandmarkKind::Lamp);
        tasks.extend(building.landmarks().iter().filter(wanted).map(|l| (corridor, l.clone())));
    }
    let placed = of_each(&tasks, "placements", |i, (corridor, object)| {
        let building = Building::corridor(mixed(&[seed, *corridor]));
        place(&building, object, views, mixed(&[seed, *corridor, i as u64]))
    });
    [
        ("rendered corridor, posters, detector", LandmarkKind::Poster),
        ("rendered corridor, lamps, detector", LandmarkKind::Lamp),
    ]
    .iter()
    .map(|(what, kind)| {
        let of: Vec<&Option<Outcome>> =
            tasks.iter().zip(&placed).filter(|((_, l), _)| l.kind == *kind).map(|(_, o)| o).collect();
        let outcomes: Vec<Outcome> = of.iter().filter_map(|o| (*o).clone()).collect();
        Summary::of(*what, &outcomes, of.len() - outcomes.len())
    })
    .collect()
}

fn place(building: &Building, object: &LandmarkTruth, views: usize, seed: u64) -> Option<Outcome> {
    let p = PlacementParams::default();
    let walls: Vec<LaserSegment> = building
        .walls()
        .iter()
        .filter_map(|w| LaserSegment::from_ends(w.a_m, w.b_m, Matrix2::new(4e-6, 0.0, 0.0, 1e-4)).ok())
        .collect();
    let mut renderer = Renderer::new(Camera::vga());
    let mut random = Random::new(seed);
    let (mut on_walls, mut on_ceiling) = (vec![], vec![]);
    for _ in 0..views * TRIES {
        match view(building, &mut renderer, object, &walls, &mut random) {
            Some(PlacedView::Wall(view)) => on_walls.push(view),
            Some(PlacedView::Ceiling(view)) => on_ceiling.push(view),
            None => {}
        }
        if on_walls.len().max(on_ceiling.len()) == views {
            break;
        }
    }
    let made = if object.kind == LandmarkKind::Lamp {
        ceiling_placement(&on_ceiling, &CEILING, &p)
    } else {
        placement(&on_walls, &walls, &p)
    };
    made.ok().map(|made| Outcome::of(&made.place, &truth(object)))
}

/// One rendered frame with the detector's quad of the object.
fn view(
    building: &Building,
    renderer: &mut Renderer,
    object: &LandmarkTruth,
    walls: &[LaserSegment],
    random: &mut Random,
) -> Option<PlacedView> {
    let at = object.map_from_landmark.translation.vector;
    let normal = object.map_from_landmark.rotation * Vector3::x();
    let is_up = object.kind == LandmarkKind::Lamp;
    let (d, psi) = (random.range(1.2, 3.0), random.range(-0.9, 0.9));
    let a = if is_up { random.range(-PI, PI) } else { normal.y.atan2(normal.x) + psi };
    let (x, y) = (at.x + d * a.cos(), at.y + d * a.sin());
    if building.clearance_m(&Point2::new(x, y)) < 0.25
        || !building
            .in_sight(&Point2::new(x, y), &Point2::new(at.x + 0.05 * normal.x, at.y + 0.05 * normal.y))
    {
        return None;
    }
    let tilt = (at.z - 1.2).atan2(d);
    let mounting = CameraExtrinsics::new(pan_tilt(0.0, tilt, Vector3::new(0.1, 0.0, 1.2))).ok()?;
    let stood = Pose2::new(x, y, a + PI + random.range(-0.1, 0.1));
    let rendered = renderer.render(
        building,
        &(stood.to_isometry3() * mounting.robot_from_camera),
        &SensorParams::default(),
        random.next_u64(),
    );
    let truth = rendered.truth.landmark(&object.name).filter(|l| l.min_side_px() > MIN_SIDE_PX)?;
    let quads = detect(&rendered.image, &DetectParams::default(), &mut NoTrace);
    let quad: &Quad =
        quads.iter().find(|q| iou(q.corners_px.points(), truth.corners_px.points()) > SAME_IOU)?;
    // As in recognition: the landmark's own top-left corner first.
    let turn = (0..4).min_by(|&a, &b| {
        let off = |k: usize| {
            let p = quad.corners_px.rotated(k);
            p.points().iter().zip(truth.corners_px.points()).map(|(p, q)| (p - q).norm()).sum::<f64>()
        };
        off(a).total_cmp(&off(b))
    })?;
    let corners = quad.corners_px.rotated(turn);
    let mut covariance = quad.believed_covariance_px2();
    covariance.rotate_left(turn);
    let e = Vector3::from(ROBOT_SIGMA).map(|s| s * random.normal());
    let spread = Matrix3::from_diagonal(&Vector3::from(ROBOT_SIGMA.map(|s| s * s)));
    let robot = Pose2Covariance { pose: stood.plus(&e), covariance: spread };
    let view = PosedView {
        corners: &corners,
        covariance_px2: &covariance,
        camera: renderer.camera().intrinsics(),
        map_from_robot: &robot,
        mounting: &mounting,
    };
    let p = PlacementParams::default();
    if is_up {
        map::placement::view_on_ceiling(&view, &CEILING, &p).ok().map(PlacedView::Ceiling)
    } else {
        map::placement::view_on_wall(&view, walls, &p).ok().map(PlacedView::Wall)
    }
}

fn truth(object: &LandmarkTruth) -> LandmarkPlace {
    let (at, turn) = (object.map_from_landmark.translation.vector, object.map_from_landmark.rotation);
    let normal = turn * Vector3::x();
    let up = turn * Vector3::z();
    let is_up = object.kind == LandmarkKind::Lamp;
    LandmarkPlace {
        x_m: at.x,
        y_m: at.y,
        z_m: at.z,
        theta_rad: if is_up { up.y.atan2(up.x) } else { normal.y.atan2(normal.x) },
        roll_rad: 0.0,
        tilt_rad: if is_up { FRAC_PI_2 } else { 0.0 },
        size: LandmarkSize { width_m: object.width_m, height_m: object.height_m },
        covariance: Matrix6::zeros(),
        shared: None,
    }
}
