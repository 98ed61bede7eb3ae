//! Placing a landmark: posed views, the rays of their corners, the rectangle of each view on the wall, their fusion
//! (method 11).

use super::{
    map_plan::{ESTIMATE, FAINT, LANDMARK, Plan, Sign, TRUTH, legend, page, title},
    map_scene::{CAMERA, SIGMA_PX, aimed, around, centre, look, poster},
};
use crate::evaluate::chart::COLOURS;
use anyhow::Context as _;
use formats::svg::text;
use map::{
    extrinsics::CameraExtrinsics,
    place::LandmarkPlace,
    placement::{Placement, PlacementParams, PosedView, WallRectangle, placement, view_on_wall},
    pose2::{Pose2, Pose2Covariance},
    segments::LaserSegment,
};
use nalgebra::{Matrix2, Point2, Point3, Vector3};
use std::f64::consts::FRAC_PI_2;
use vision::{geometry::Corners, random::Random};

/// Poses that the robot believes, and by how much it errs along x beyond what it states, metres.
const VIEWS: [(Pose2, f64); 4] = [
    (Pose2 { x_m: 2.0, y_m: 1.6, theta_rad: 0.9 }, 0.0),
    (Pose2 { x_m: 3.9, y_m: 0.6, theta_rad: 1.7 }, 0.0),
    (Pose2 { x_m: 6.3, y_m: 1.3, theta_rad: 2.4 }, 0.0),
    (Pose2 { x_m: 5.1, y_m: 1.9, theta_rad: 1.9 }, 0.35),
];
/// Standard deviations of the robot's pose: metres and radians.
const ROBOT_SIGMAS: [f64; 3] = [0.02, 0.02, 0.005];
const SEED: u64 = 3;
const COLOUR: [&str; 4] = [COLOURS[0], COLOURS[3], COLOURS[4], FAINT];

/// One view as the robot states it.
struct StatedView {
    map_from_robot: Pose2Covariance,
    mounting: CameraExtrinsics,
    corners: Corners,
    covariance_px2: [Matrix2<f64>; 4],
}

struct Scene {
    walls: Vec<LaserSegment>,
    truth: LandmarkPlace,
    views: Vec<StatedView>,
    rectangles: Vec<WallRectangle>,
    made: Placement,
}

impl Scene {
    fn new() -> anyhow::Result<Self> {
        // Free sides on the left: a room below the wall y = 4.
        let walls = [[8.0, 4.0, 0.0, 4.0], [0.0, 4.0, 0.0, 0.0], [8.0, 0.0, 8.0, 4.0]];
        let walls: Vec<LaserSegment> = walls.iter().map(LaserSegment::by_hand).collect::<Result<_, _>>()?;
        let truth = poster(4.2, 4.0, -FRAC_PI_2)?;
        let mut random = Random::new(SEED);
        let (mut views, mut rectangles) = (Vec::new(), Vec::new());
        for (believed, off_m) in VIEWS {
            let error = Vector3::from(ROBOT_SIGMAS).map(|s| s * random.normal());
            let real = believed.plus(&(error + Vector3::new(off_m, 0.0, 0.0)));
            let mounting = aimed(&believed, &centre(&truth))?;
            let seen = look(&real, &mounting, &truth, SIGMA_PX, &mut random).context("in the image")?;
            let map_from_robot = around(believed, ROBOT_SIGMAS)?;
            let (corners, covariance_px2) = (seen.measured.corners_px, seen.measured.covariance_px2.blocks());
            let view = StatedView { map_from_robot, mounting, corners, covariance_px2 };
            rectangles.push(view.rectangle(&walls)?);
            views.push(view);
        }
        let made = placement(&rectangles, &walls, &PlacementParams::default())?;
        Ok(Self { walls, truth, views, rectangles, made })
    }
}

impl StatedView {
    fn rectangle(&self, walls: &[LaserSegment]) -> anyhow::Result<WallRectangle> {
        let view = PosedView {
            corners: &self.corners,
            covariance_px2: &self.covariance_px2,
            camera: &CAMERA,
            map_from_robot: &self.map_from_robot,
            mounting: &self.mounting,
        };
        Ok(view_on_wall(&view, walls, &PlacementParams::default())?)
    }

    /// Where the rays of the corners meet the wall's plane.
    fn hits(&self, wall: &LaserSegment) -> [Point3<f64>; 4] {
        let map_from_camera = self.map_from_robot.pose.to_isometry3() * self.mounting.robot_from_camera;
        let from = map_from_camera.translation.vector;
        let facing = Vector3::new(wall.facing().x, wall.facing().y, 0.0);
        let offset_m = facing.xy().dot(&wall.a.coords);
        self.corners.points().map(|px| {
            let ray =
                Vector3::new((px.x - CAMERA.cx_px) / CAMERA.fx_px, (px.y - CAMERA.cy_px) / CAMERA.fy_px, 1.0);
            let ray = map_from_camera.rotation * ray;
            Point3::from(from + ray * ((offset_m - facing.dot(&from)) / facing.dot(&ray)))
        })
    }
}

/// The picture.
pub(super) fn svg() -> anyhow::Result<String> {
    let scene = Scene::new()?;
    page([1180.0, 520.0], |svg| {
        from_above(svg, &scene);
        on_the_wall(svg, &scene);
        centres(svg, &scene);
        legend(
            svg,
            (40.0, 425.0),
            &[
                (Sign::Robot, COLOUR[0], "robots where they say they are (to 2 cm), rays of the corners"),
                (Sign::Line, COLOUR[0], "rectangle that one view gives; ellipse: its centre"),
                (
                    Sign::Dashed,
                    COLOUR[3],
                    "a view that the gate leaves out: that robot was 0.35 m from its stated pose",
                ),
                (Sign::Line, ESTIMATE, "the place by all views that agree; ellipse: its centre, 95 %"),
                (Sign::Dashed, TRUTH, "where the poster really hangs"),
            ],
        );
        Ok(())
    })
}

fn from_above(svg: &mut String, scene: &Scene) {
    let plan = Plan::new((40.0, 60.0), [[0.0, 0.0], [8.0, 4.3]], 62.0);
    title(svg, (40.0, 30.0), "From above: four posed views of one poster");
    plan.walls(svg, scene.walls.iter().map(|w| (&w.a, &w.b)));
    for (i, view) in scene.views.iter().enumerate() {
        let dash = if scene.made.used.contains(&i) { "" } else { r#"stroke-dasharray="5 3""# };
        let camera = Point2::from(view.map_from_robot.pose.position());
        for hit in view.hits(&scene.walls[0]) {
            plan.line(svg, [camera, hit.xy()], &format!(r#"stroke="{}" {dash}"#, COLOUR[i]));
        }
        plan.pose_ellipse(svg, &view.map_from_robot, COLOUR[i]);
        plan.robot(svg, &view.map_from_robot.pose, COLOUR[i]);
    }
    plan.landmark(svg, &scene.made.place, LANDMARK);
    plan.label(svg, &Point2::new(0.1, 4.0), ("start", [0.0, -8.0]), "wall of the laser map");
    plan.label(svg, &Point2::new(4.2, 4.0), ("middle", [0.0, -12.0]), "poster");
    plan.scale_bar(svg, 1.0);
}

fn on_the_wall(svg: &mut String, scene: &Scene) {
    // Along the wall towards the viewer's right, and up.
    let plan = Plan::new((580.0, 60.0), [[3.45, 0.95], [4.65, 2.05]], 255.0);
    title(svg, (580.0, 30.0), "On the wall, as a viewer sees it");
    let (_, bottom) = plan.end_px();
    let rectangle = |[along, up, wide, high]: [f64; 4]| {
        let corner = move |k: f64, l: f64| Point2::new(along + k * wide, up + l * high);
        [corner(-0.5, 0.5), corner(0.5, 0.5), corner(0.5, -0.5), corner(-0.5, -0.5)]
    };
    for (i, (view, found)) in scene.views.iter().zip(&scene.rectangles).enumerate() {
        let is_used = scene.made.used.contains(&i);
        let dash = if is_used { "" } else { r#"stroke-dasharray="5 3""# };
        let style = format!(r#"fill="none" stroke="{}" {dash}"#, COLOUR[i]);
        let q = found.rectangle;
        plan.area(svg, rectangle([q[0], q[1], q[2], q[3]]), &style);
        let hits = view.hits(&scene.walls[found.wall]);
        plan.dots(svg, hits.map(|h| Point2::new(h.x, h.z)), (2.5, COLOUR[i]));
    }
    let outline =
        |place: &LandmarkPlace| rectangle([place.x_m, place.z_m, place.size.width_m, place.size.height_m]);
    let truth = format!(r#"fill="none" stroke="{TRUTH}" stroke-dasharray="5 3""#);
    plan.area(svg, outline(&scene.truth), &truth);
    plan.cross(svg, &Point2::new(scene.truth.x_m, scene.truth.z_m), TRUTH);
    let place = &scene.made.place;
    let style = format!(r#"fill="none" stroke="{ESTIMATE}" stroke-width="2""#);
    plan.area(svg, outline(place), &style);
    let c = &place.covariance;
    plan.scale_bar(svg, 0.2);
    let sigma_mm = |k: usize| 1000.0 * c[(k, k)].sqrt();
    let centre_mm = 1000.0 * (place.x_m - scene.truth.x_m).hypot(place.z_m - scene.truth.z_m);
    let size = format!(
        "size {:.3} x {:.3} m (true {:.2} x {:.2}), standard deviations {:.0} and {:.0} mm",
        place.size.width_m,
        place.size.height_m,
        scene.truth.size.width_m,
        scene.truth.size.height_m,
        sigma_mm(4),
        sigma_mm(5)
    );
    let off = format!(
        "centre {centre_mm:.0} mm from the truth, standard deviations {:.0} mm along and {:.0} mm up",
        sigma_mm(0),
        sigma_mm(3)
    );
    text(svg, (580.0, bottom + 52.0), "start", &size);
    text(svg, (580.0, bottom + 71.0), "start", &off);
}

/// The centres with their ellipses, enlarged.
fn centres(svg: &mut String, scene: &Scene) {
    title(svg, (910.0, 30.0), "Its centre, enlarged (95 % ellipses)");
    let (x, z) = (scene.truth.x_m, scene.truth.z_m);
    let plan = Plan::new((910.0, 60.0), [[x - 0.09, z - 0.06], [x + 0.09, z + 0.06]], 1300.0);
    for i in scene.made.used.iter().copied() {
        let found = &scene.rectangles[i];
        let spread = found.covariance.fixed_view::<2, 2>(0, 0).into_owned();
        let style = format!(r#"fill="none" stroke="{}" stroke-width="1.5""#, COLOUR[i]);
        plan.ellipse(svg, (&Point2::new(found.rectangle[0], found.rectangle[1]), &spread), &style);
    }
    let place = &scene.made.place;
    let c = &place.covariance;
    let spread = Matrix2::new(c[(0, 0)], c[(0, 3)], c[(3, 0)], c[(3, 3)]);
    let style = format!(r#"fill="{ESTIMATE}" fill-opacity="0.15" stroke="{ESTIMATE}" stroke-width="2""#);
    plan.ellipse(svg, (&Point2::new(place.x_m, place.z_m), &spread), &style);
    plan.cross(svg, &Point2::new(x, z), TRUTH);
    plan.scale_bar(svg, 0.05);
}
