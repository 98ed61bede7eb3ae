//! The rendered set for detection: corridors of all proportions by hand-held cameras, with exact
//! truth. In: a seed. Out: images with their entries; the same parameters give the same bytes. The
//! entries mark which quads count. Writes no files.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Point2, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};
use vision::frame::GrayImage;
use vision::geometry::Corners;

use crate::building::{Building, LandmarkKind, LandmarkTruth, Surface};
use crate::camera::Camera;
use crate::corridor::CorridorParams;
use crate::export::{CameraEntry, DataSet, ImageEntry, Labels, QuadEntry, QuadState};
use crate::render::Renderer;
use crate::seed;
use crate::sensor::SensorParams;

/// Most views of a set.
pub const MAX_VIEWS: usize = 10_000;
/// Views from one building before the next is built.
const VIEWS_PER_BUILDING: usize = 20;
/// Most draws of a view that shows its target; then the last one is taken.
const TRIES: usize = 2000;
/// Room between the camera and any wall.
const CLEARANCE_M: f64 = 0.2;
/// Nearest depth of a corner that is projected.
const NEAR_M: f64 = 0.05;
/// Shortest side of other quads that are listed; no detector reports smaller ones.
const MIN_OTHER_SIDE_PX: f64 = 6.0;

/// Contents of the set, and which quads count.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ViewsParams {
    /// Seed of buildings, viewpoints, sensors and noise.
    pub seed: u64,
    /// Pictures, at most [`MAX_VIEWS`].
    pub views: usize,
    /// A quad counts if each of its sides is at least this long.
    pub min_side_px: f64,
    /// And if its view angle is at most this.
    pub max_view_angle_rad: f64,
}

impl Default for ViewsParams {
    fn default() -> Self {
        Self { seed: 1, views: 300, min_side_px: 30.0, max_view_angle_rad: 70.0 / 360.0 * TAU }
    }
}

/// A picture with its entry in the set.
#[derive(Debug, Clone)]
pub struct LabelledView {
    /// The image, 640 x 480 px.
    pub image: GrayImage,
    /// Its labelled quads and other real quads.
    pub entry: ImageEntry,
}

/// The views of a set, one after the other.
#[derive(Debug)]
pub struct Views {
    params: ViewsParams,
    next: usize,
    building: Building,
    renderer: Renderer,
}

impl Views {
    /// Nothing is rendered yet.
    pub fn new(params: &ViewsParams) -> Self {
        let params = ViewsParams { views: params.views.min(MAX_VIEWS), ..params.clone() };
        let building = building(params.seed, 0);
        Self { params, next: 0, building, renderer: Renderer::new(Camera::vga()) }
    }

    /// The data set of these entries.
    pub fn data_set(images: Vec<ImageEntry>) -> DataSet {
        DataSet {
            name: "corridor".into(),
            camera: Some(CameraEntry::new(&Camera::vga())),
            sizes_m: std::collections::BTreeMap::new(),
            teach: vec![],
            same: vec![],
            images,
        }
    }

    fn render(&mut self, number: usize) -> LabelledView {
        let mut rng = seed::stream(seed::mix(self.params.seed) ^ number as u64, 91);
        let map_from_camera = pose(&self.building, self.renderer.camera(), &self.params, &mut rng);
        let (stratum, sensor) = sensor(number, &mut rng);
        let shot = self.renderer.render(&self.building, &map_from_camera, &sensor, rng.random());
        let labels = Labels { taught: &[], min_side_px: 0.0, complete: true };
        let mut entry =
            ImageEntry::new(&format!("view-{number:04}.png"), Some(stratum), &shot.truth, &labels);
        for quad in &mut entry.quads {
            quad.counted = counts(quad, &self.params);
        }
        entry.others = others(&self.building, self.renderer.camera(), &map_from_camera);
        LabelledView { image: shot.image, entry }
    }
}

impl Iterator for Views {
    type Item = LabelledView;

    fn next(&mut self) -> Option<LabelledView> {
        let number = self.next;
        if number >= self.params.views {
            return None;
        }
        self.next += 1;
        if number > 0 && number.is_multiple_of(VIEWS_PER_BUILDING) {
            self.building = building(self.params.seed, number / VIEWS_PER_BUILDING);
        }
        Some(self.render(number))
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        let left = self.params.views - self.next;
        (left, Some(left))
    }
}

/// A corridor of its own proportions, posters of its own format.
fn building(seed: u64, number: usize) -> Building {
    let mut rng = seed::stream(seed::mix(seed) ^ number as u64, 90);
    let width_m = rng.random_range(0.35..0.95);
    let params = CorridorParams {
        length_m: rng.random_range(14.0..26.0),
        width_m: rng.random_range(2.0..3.8),
        height_m: rng.random_range(2.5..3.3),
        posters: rng.random_range(5..=9),
        poster_centre_z_m: rng.random_range(1.3..1.6),
        poster_size_m: [width_m, width_m * rng.random_range(0.75..1.5)],
        first_poster: rng.random(),
        pictures: 0,
        unique_posters: 0,
        column: rng.random_bool(0.5),
    };
    Building::corridor_with(&params, rng.random())
}

/// A camera that has a poster, door or window wholly in view, large enough and not too oblique to
/// count.
fn pose(building: &Building, camera: &Camera, p: &ViewsParams, rng: &mut ChaCha8Rng) -> Isometry3<f64> {
    let kind = match rng.random_range(0..10) {
        0..5 => LandmarkKind::Poster,
        5..8 => LandmarkKind::Door,
        _ => LandmarkKind::Window,
    };
    let of_kind: Vec<&LandmarkTruth> = building.landmarks().iter().filter(|l| l.kind == kind).collect();
    let targets = if of_kind.is_empty() { building.posters().collect() } else { of_kind };
    let mut last = Isometry3::identity();
    for _ in 0..TRIES {
        let target = targets[rng.random_range(0..targets.len())];
        let Some(map_from_camera) = stand(building, target, p, rng) else { continue };
        last = map_from_camera;
        let corners = project(&target.corners_map(), camera, &map_from_camera);
        let fits =
            |c: &Corners| c.min_side_px() >= p.min_side_px && c.points().iter().all(|c| within(c, camera));
        if corners.as_ref().is_some_and(fits) {
            break;
        }
    }
    last
}

/// A pose in front of the target, aimed roughly at it, with a small roll.
fn stand(
    building: &Building,
    target: &LandmarkTruth,
    p: &ViewsParams,
    rng: &mut ChaCha8Rng,
) -> Option<Isometry3<f64>> {
    let angle = p.max_view_angle_rad * rng.random_range(-1.0..1.0);
    let distance_m = 0.7 * f64::powf(14.0, rng.random_range(0.0..1.0));
    let mut place = target.map_from_landmark
        * Point3::new(distance_m * f64::cos(angle), distance_m * f64::sin(angle), 0.0);
    place.z = rng.random_range(0.4..1.75);
    let wobble = [0.0; 2].map(|_: f64| rng.random_range(-0.3..0.3));
    let tilt: f64 = StandardNormal.sample(rng);
    let face = target.map_from_landmark * Point3::new(0.03, 0.0, 0.0);
    if !building.in_sight(&place.xy(), &face.xy()) || building.clearance_m(&place.xy()) < CLEARANCE_M {
        return None;
    }
    let ahead = target.map_from_landmark.translation.vector - place.coords;
    let straight = Rotation3::face_towards(&ahead, &-Vector3::z());
    let turned = straight
        * Rotation3::from_axis_angle(&Vector3::y_axis(), wobble[0])
        * Rotation3::from_axis_angle(&Vector3::x_axis(), 0.7 * wobble[1])
        * Rotation3::from_axis_angle(&Vector3::z_axis(), 0.05 * tilt.clamp(-3.0, 3.0));
    let rotation = UnitQuaternion::from_rotation_matrix(&turned);
    Some(Isometry3::from_parts(Translation3::from(place.coords), rotation))
}

/// Three pictures of five from a decent camera in good light, one in poor light, one out of focus
/// or moving.
fn sensor(number: usize, rng: &mut ChaCha8Rng) -> (&'static str, SensorParams) {
    let usual = SensorParams {
        exposure: rng.random_range(0.75..1.1),
        vignetting: rng.random_range(0.0..0.35),
        blur_sigma_px: rng.random_range(0.4..0.7),
        read_noise: rng.random_range(0.8..1.8),
        shot_noise: rng.random_range(0.008..0.02),
        ..SensorParams::default()
    };
    let (dark, soft): (f64, f64) = (rng.random_range(0.3..0.5), rng.random_range(0.8..1.4));
    let motion_px = [0.0; 2].map(|_: f64| rng.random_range(-1.5..1.5));
    match number % 5 {
        3 => ("poor light", SensorParams { exposure: dark, read_noise: 1.6 * usual.read_noise, ..usual }),
        4 => ("soft", SensorParams { blur_sigma_px: soft, motion_px, ..usual }),
        _ => ("plain", usual),
    }
}

fn counts(quad: &QuadEntry, p: &ViewsParams) -> bool {
    quad.kind != LandmarkKind::Lamp
        && quad.state == QuadState::Full
        && quad.corners.min_side_px() >= p.min_side_px
        && quad.view_angle_rad <= p.max_view_angle_rad
}

/// Walls, levels, baseboards as a whole, and the rectangles drawn on doors, windows, lamps and
/// posters, if all corners lie in front of the camera. Floor tiles and ceiling panels are not
/// listed: a pattern is no object.
fn others(building: &Building, camera: &Camera, map_from_camera: &Isometry3<f64>) -> Vec<Corners> {
    let mut found = vec![];
    for surface in building.surfaces() {
        let behind = (surface.map_from_surface.inverse() * map_from_camera).translation.x <= 0.0;
        if behind {
            continue;
        }
        let mut add = |part: [f64; 4]| {
            let projected = project(&corners_map(surface, part), camera, map_from_camera);
            let meets = |c: &Corners| {
                let p = c.points();
                let range = |f: fn(&Point2<f64>) -> f64| {
                    p.iter().map(f).fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(x), h.max(x)))
                };
                let (u, v) = (range(|p| p.x), range(|p| p.y));
                u.1 > 0.0 && v.1 > 0.0 && u.0 < camera.width_px() as f64 && v.0 < camera.height_px() as f64
            };
            found.extend(projected.filter(|c| c.min_side_px() >= MIN_OTHER_SIDE_PX && meets(c)));
        };
        if surface.landmark.is_none() {
            add([0.0, 0.0, 1.0, 1.0]);
        } else {
            surface.texture.parts().iter().for_each(|p| add(p.map(f64::from)));
        }
    }
    found
}

/// Corners of a part (left, top, right, bottom, 0 to 1) of a surface, clockwise from the top-left.
fn corners_map(s: &Surface, [x0, y0, x1, y1]: [f64; 4]) -> [Point3<f64>; 4] {
    [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
        .map(|(x, y)| s.map_from_surface * Point3::new(0.0, (x - 0.5) * s.width_m, (0.5 - y) * s.height_m))
}

fn project(corners: &[Point3<f64>; 4], camera: &Camera, map_from_camera: &Isometry3<f64>) -> Option<Corners> {
    let in_camera = corners.map(|c| map_from_camera.inverse_transform_point(&c));
    if in_camera.iter().any(|c| c.z < NEAR_M) {
        return None;
    }
    Corners::new(in_camera.map(|c| camera.intrinsics().project(&c.coords))).ok()
}

fn within(p: &Point2<f64>, camera: &Camera) -> bool {
    let (w, h) = (camera.width_px() as f64, camera.height_px() as f64);
    p.x >= 1.0 && p.y >= 1.0 && p.x <= w - 2.0 && p.y <= h - 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn views(seed: u64, count: usize) -> Vec<LabelledView> {
        Views::new(&ViewsParams { seed, views: count, ..ViewsParams::default() }).collect()
    }

    #[test]
    fn nearly_every_view_has_a_quad_that_counts() {
        let all = views(3, 2 * VIEWS_PER_BUILDING + 1);
        assert_eq!(all.len(), 2 * VIEWS_PER_BUILDING + 1);
        let p = ViewsParams::default();
        let counted = |v: &LabelledView| v.entry.quads.iter().filter(|q| q.counted).count();
        assert!(all.iter().filter(|v| counted(v) == 0).count() <= 2);
        for quad in all.iter().flat_map(|v| &v.entry.quads) {
            let must = quad.state == QuadState::Full
                && quad.kind != LandmarkKind::Lamp
                && quad.corners.min_side_px() >= p.min_side_px
                && quad.view_angle_rad.to_degrees() <= 70.0 + 1e-9;
            assert_eq!(quad.counted, must, "{quad:?}");
        }
        // There are quads that do not count, too.
        for state in [QuadState::Full, QuadState::Truncated] {
            let spared = |q: &&QuadEntry| !q.counted && q.state == state;
            assert!(all.iter().flat_map(|v| &v.entry.quads).any(|q| spared(&q)), "{state:?}");
        }
        for kind in [LandmarkKind::Poster, LandmarkKind::Door, LandmarkKind::Window] {
            let some = all.iter().flat_map(|v| &v.entry.quads).any(|q| q.counted && q.kind == kind);
            assert!(some, "{kind:?}");
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_bytes() {
        let (a, b, other) = (views(5, 2), views(5, 2), views(6, 1));
        for (a, b) in a.iter().zip(&b) {
            assert_eq!((&a.image, &a.entry), (&b.image, &b.entry));
        }
        assert_ne!(a[0].image, other[0].image);
    }

    #[test]
    fn a_windows_panes_are_listed_and_lie_within_it() {
        let all = views(3, VIEWS_PER_BUILDING);
        let mut panes = 0;
        for view in &all {
            for window in view.entry.quads.iter().filter(|q| q.kind == LandmarkKind::Window) {
                let area_px2 = window.corners.area_px2();
                panes += view
                    .entry
                    .others
                    .iter()
                    .filter(|o| {
                        let inside =
                            |p| vision::geometry::polygon::contains(window.corners.points(), p, 1e-6);
                        o.points().iter().all(inside) && (0.1..0.3).contains(&(o.area_px2() / area_px2))
                    })
                    .count();
            }
        }
        assert!(panes >= 4, "{panes}");
    }

    #[test]
    fn the_number_of_views_is_clamped() {
        let count = |views| Views::new(&ViewsParams { views, ..ViewsParams::default() }).size_hint().0;
        assert_eq!((count(MAX_VIEWS), count(MAX_VIEWS + 1)), (MAX_VIEWS, MAX_VIEWS));
    }
}
