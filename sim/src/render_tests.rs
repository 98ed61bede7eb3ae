//! The renderer against independent computations: projection by hand, an edge fitted in the
//! picture, rays cast at single pixels, a frontal texture.

use nalgebra::{Isometry3, Matrix3, Point2, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use vision::frame::{Distortion, GrayImage, Intrinsics};

use crate::builder::tests::one_rectangle;
use crate::building::{Building, Surface};
use crate::camera::Camera;
use crate::posters::poster_of_size;
use crate::render::Renderer;
use crate::sensor::SensorParams;
use crate::texture::{Edge, Texture};
use crate::truth::ViewState;

/// A level camera at a place, looking along a heading in the map.
fn camera_at(x: f64, y: f64, z: f64, heading_rad: f64) -> Isometry3<f64> {
    let optical =
        Rotation3::from_matrix_unchecked(Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0));
    let rotation = Rotation3::from_axis_angle(&Vector3::z_axis(), heading_rad) * optical;
    Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::from_rotation_matrix(&rotation))
}

fn golden_camera() -> Camera {
    let k = Intrinsics {
        fx_px: 700.0,
        fy_px: 700.0,
        cx_px: 320.0,
        cy_px: 240.0,
        distortion: Distortion::None,
        sigmas: None,
    };
    Camera::new(k, 640, 480)
}

fn white() -> Texture {
    Texture::new(8, 8, vec![200; 64], Edge::Clamp)
}

#[test]
fn the_golden_frontal_view() {
    // Method 21: camera at (3, 0, 0) of the landmark frame, poster 0.60 x 0.84 m.
    let building = one_rectangle(0.6, 0.84, white());
    let mut renderer = Renderer::new(golden_camera());
    let frame = renderer.render(
        &building,
        &camera_at(3.0, 0.0, 1.0, std::f64::consts::PI),
        &SensorParams::ideal(),
        0,
    );
    let view = frame.truth.landmark("poster-0").unwrap();
    let expected = [[250.0, 142.0], [390.0, 142.0], [390.0, 338.0], [250.0, 338.0]];
    for (corner, e) in view.corners_px.points().iter().zip(expected) {
        assert!((corner - Point2::from(e)).norm() < 1e-9, "{corner}");
    }
    let r = view.camera_from_landmark;
    assert!((r * Point3::new(1.0, 0.0, 0.0) - Point3::new(0.0, 0.0, 2.0)).norm() < 1e-9);
    assert!((view.distance_m - 3.0).abs() < 1e-9 && view.view_angle_rad.abs() < 1e-9);
    assert_eq!(view.state, ViewState::Full);
    assert!((view.visible_px2 - 140.0 * 196.0).abs() < 0.1, "{}", view.visible_px2);
    // A pixel on the edge u = 250 is half covered, pixels beside it all or not at all.
    let row = |u| frame.image.at(u, 240);
    assert_eq!([row(249), row(250), row(251), row(389), row(390), row(391)], [0, 100, 200, 200, 100, 0]);
    let column = |v| frame.image.at(320, v);
    assert_eq!([column(141), column(142), column(143)], [0, 100, 200]);
}

/// Where the picture crosses half of `white` along a line of 13 samples through `p` in direction
/// `n` (outwards): by the area under the profile, which is exact for any symmetric blur.
fn crossing(image: &GrayImage, p: Point2<f64>, n: nalgebra::Vector2<f64>, white: f64) -> f64 {
    let steps = 600;
    let reach = 6.0;
    let area: f64 = (0..steps)
        .map(|i| {
            let k = ((f64::from(i) + 0.5) / f64::from(steps) - 0.5) * 2.0 * reach;
            let q = p + n * k;
            f64::from(image.sample(q.x, q.y)) / white * 2.0 * reach / f64::from(steps)
        })
        .sum();
    area - reach
}

#[test]
fn edges_lie_within_a_tenth_of_a_pixel_of_the_truth() {
    let building = one_rectangle(0.6, 0.84, white());
    let cameras =
        [Distortion::None, Distortion::PlumbBob([-0.25, 0.08, 1e-3, -5e-4, 0.0])].map(|distortion| {
            Camera::new(
                Intrinsics {
                    fx_px: 520.0,
                    fy_px: 515.0,
                    cx_px: 317.3,
                    cy_px: 242.1,
                    distortion,
                    sigmas: None,
                },
                640,
                480,
            )
        });
    let tilted = UnitQuaternion::from_euler_angles(0.13, -0.06, 0.08);
    let tilted = Isometry3::from_parts(Translation3::identity(), tilted);
    let mut worst = 0.0_f64;
    for camera in cameras {
        let mut renderer = Renderer::new(camera);
        for pose in
            [camera_at(1.9, 0.4, 1.1, -2.95), camera_at(1.5, -1.4, 0.8, 2.4), camera_at(2.6, 0.2, 1.3, 3.1)]
        {
            let frame = renderer.render(&building, &(pose * tilted), &SensorParams::ideal(), 0);
            let view = frame.truth.landmark("poster-0").unwrap();
            assert_eq!(view.state, ViewState::Full);
            for side in 0..4 {
                for share in [0.2, 0.35, 0.5, 0.65, 0.8] {
                    // The true edge is a line in space, projected point by point.
                    let corners = building.landmarks()[0].corners_map();
                    let q = corners[side] + (corners[(side + 1) % 4] - corners[side]) * share;
                    let towards = corners[side] + (corners[(side + 1) % 4] - corners[side]) * (share + 0.01);
                    let project = |p: Point3<f64>| {
                        let c = frame.truth.map_from_camera.inverse() * p;
                        renderer.camera().intrinsics().project(&c.coords)
                    };
                    let (p, along) = (project(q), (project(towards) - project(q)).normalize());
                    let outwards = nalgebra::Vector2::new(along.y, -along.x);
                    let error = crossing(&frame.image, p, outwards, 200.0);
                    worst = worst.max(error.abs());
                }
            }
        }
    }
    assert!(worst < 0.1, "an edge is {worst} px off");
}

#[test]
fn a_frontal_texture_is_the_texture_averaged() {
    // 480 x 672 texels over 120 x 168 px: every pixel is the mean of 4 x 4 texels.
    let texture = poster_of_size(11, 480, 1.4);
    let building = one_rectangle(0.6, 0.84, texture.clone());
    let k = Intrinsics {
        fx_px: 400.0,
        fy_px: 400.0,
        cx_px: 99.5,
        cy_px: 119.5,
        distortion: Distortion::None,
        sigmas: None,
    };
    let mut renderer = Renderer::new(Camera::new(k, 200, 240));
    let frame = renderer.render(
        &building,
        &camera_at(2.0, 0.0, 1.0, std::f64::consts::PI),
        &SensorParams::ideal(),
        0,
    );
    let (mut sum, mut worst) = (0.0, 0.0_f64);
    for (v, u) in (0..168).flat_map(|v| (0..120).map(move |u| (v, u))) {
        let cell = (0..16).map(|i| f64::from(texture.data()[(4 * v + i / 4) * 480 + 4 * u + i % 4]));
        let expected = cell.sum::<f64>() / 16.0;
        let error = (f64::from(frame.image.at(u + 40, v + 36)) - expected).abs();
        sum += error;
        worst = worst.max(error);
    }
    assert!(sum / (120.0 * 168.0) < 0.6 && worst < 3.0, "mean {} worst {worst}", sum / (120.0 * 168.0));
}

#[test]
fn an_oblique_texture_is_the_texture_averaged_over_each_pixel() {
    // At 60 degrees, against 24 x 24 rays per pixel.
    let texture = poster_of_size(3, 480, 1.4);
    let building = one_rectangle(0.6, 0.84, texture.clone());
    let k = Intrinsics {
        fx_px: 400.0,
        fy_px: 400.0,
        cx_px: 99.5,
        cy_px: 99.5,
        distortion: Distortion::None,
        sigmas: None,
    };
    let mut renderer = Renderer::new(Camera::new(k, 200, 200));
    let angle = 60.0_f64.to_radians();
    let pose = camera_at(2.5 * angle.cos(), 2.5 * angle.sin(), 1.0, angle + std::f64::consts::PI);
    let frame = renderer.render(&building, &pose, &SensorParams::ideal(), 0);
    let surface = &building.surfaces()[0];
    let (mut error2, mut spread2, mut count) = (0.0_f64, 0.0_f64, 0.0);
    for (v, u) in (50..150).step_by(3).flat_map(|v| (70..130).step_by(3).map(move |u| (v, u))) {
        let rays = (0..576).map(|i| {
            let (du, dv) = ((f64::from(i % 24) + 0.5) / 24.0 - 0.5, (f64::from(i / 24) + 0.5) / 24.0 - 0.5);
            let d = Vector3::new((f64::from(u) + du - 99.5) / 400.0, (f64::from(v) + dv - 99.5) / 400.0, 1.0);
            hit(surface, &pose, &d).map_or(0.0, |(_, s, t)| {
                let texel = |x: f64, n: usize| ((x * n as f64) as usize).min(n - 1);
                f64::from(texture.data()[texel(t, 672) * 480 + texel(s, 480)])
            })
        });
        let expected = rays.sum::<f64>() / 576.0;
        error2 += (f64::from(frame.image.at(u as usize, v as usize)) - expected).powi(2);
        spread2 += (expected - 128.0).powi(2);
        count += 1.0;
    }
    let (error, spread) = ((error2 / count).sqrt(), (spread2 / count).sqrt());
    assert!(spread > 25.0 && error < 6.0, "root mean square error {error} at contrast {spread}");
}

/// Depth and relative position at which the ray `d` of a camera meets the front of a surface.
fn hit(surface: &Surface, map_from_camera: &Isometry3<f64>, d: &Vector3<f64>) -> Option<(f64, f64, f64)> {
    let surface_from_camera = surface.map_from_surface.inverse() * map_from_camera;
    let (origin, ray) = (surface_from_camera.translation.vector, surface_from_camera.rotation * d);
    let depth = -origin.x / ray.x;
    let p = origin + ray * depth;
    let (s, t) = (p.y / surface.width_m + 0.5, 0.5 - p.z / surface.height_m);
    let inside = origin.x > 0.0 && depth > 0.0 && (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t);
    inside.then_some((depth, s, t))
}

#[test]
fn shares_agree_with_rays_cast_by_brute_force() {
    let building = Building::corridor(1);
    let k = Intrinsics {
        fx_px: 256.0,
        fy_px: 256.0,
        cx_px: 159.5,
        cy_px: 119.5,
        distortion: Distortion::None,
        sigmas: None,
    };
    let mut renderer = Renderer::new(Camera::new(k, 320, 240));
    // Towards the column and what it hides.
    let mut hidden = 0;
    for (x, y, heading) in [(13.5, -0.6, -0.2), (3.0, 0.2, 0.1), (22.5, -0.7, 3.1), (16.2, -0.8, -0.3)] {
        let pose = camera_at(x, y, 1.2, heading);
        let frame = renderer.render(&building, &pose, &SensorParams::ideal(), 0);
        let (mut covered, mut visible) =
            (vec![0.0; building.landmarks().len()], vec![0.0; building.landmarks().len()]);
        for (v, u) in (0..480).flat_map(|v| (0..640).map(move |u| (v, u))) {
            // Jittered within its quarter of the pixel: upright edges must not meet a lattice.
            let jitter = |k: u64| {
                let key = crate::seed::mix(k ^ u64::from(v as u32) << 20 ^ u64::from(u as u32) << 40);
                (key >> 11) as f64 / (1_u64 << 53) as f64
            };
            let (x, y) = (0.5 * (f64::from(u) + jitter(1)) - 0.5, 0.5 * (f64::from(v) + jitter(2)) - 0.5);
            let d = Vector3::new((x - 159.5) / 256.0, (y - 119.5) / 256.0, 1.0);
            let hits = building.surfaces().iter().filter_map(|s| Some((s, hit(s, &pose, &d)?.0)));
            let nearest = hits.clone().min_by(|a, b| a.1.total_cmp(&b.1));
            for (surface, _) in hits {
                surface.landmark.into_iter().for_each(|l| covered[l] += 0.25);
            }
            nearest.and_then(|n| n.0.landmark).into_iter().for_each(|l| visible[l] += 0.25);
        }
        for (i, l) in building.landmarks().iter().enumerate().filter(|(i, _)| covered[*i] > 60.0) {
            let share = 1.0 - visible[i] / covered[i];
            match frame.truth.landmark(&l.name) {
                Some(view) => {
                    let tolerance = 0.02 + 0.3 / f64::sqrt(covered[i]);
                    assert!(
                        (view.occluded_share - share).abs() < tolerance,
                        "{}: {} {share}",
                        l.name,
                        view.occluded_share
                    );
                    assert!(
                        (view.visible_px2 - visible[i]).abs() < 3.0 + 0.03 * visible[i],
                        "{}: {} {}",
                        l.name,
                        view.visible_px2,
                        visible[i]
                    );
                    hidden += usize::from(share > 0.1);
                }
                None => {
                    assert!(
                        visible[i] < 1.0 || l.corners_map().iter().any(|c| (pose.inverse() * c).z < 0.01)
                    );
                }
            }
        }
    }
    assert!(hidden > 0, "nothing was hidden: the test is void");
}

#[test]
fn no_pixel_of_a_closed_corridor_is_empty() {
    let building = Building::corridor(9);
    let mut renderer = Renderer::new(golden_camera());
    for i in 0..6 {
        let pose = camera_at(2.0 + 3.5 * f64::from(i), 0.1, 1.2, 1.1 * f64::from(i));
        let frame = renderer.render(&building, &pose, &SensorParams::ideal(), 0);
        let darkest = frame.image.data().iter().min();
        assert!(darkest > Some(&4), "a gap at {i}: {darkest:?}");
    }
}

#[test]
fn a_mirrored_world_gives_a_mirrored_picture() {
    let texture = |flip: bool| {
        let at = |i: usize| if flip { 15 - i % 16 } else { i % 16 };
        Texture::new(16, 16, (0..256).map(|i| (at(i) * 9 + i / 16 * 5) as u8).collect(), Edge::Clamp)
    };
    let k = Intrinsics {
        fx_px: 300.0,
        fy_px: 300.0,
        cx_px: 79.5,
        cy_px: 59.5,
        distortion: Distortion::None,
        sigmas: None,
    };
    let mut renderer = Renderer::new(Camera::new(k, 160, 120));
    let left = renderer.render(
        &one_rectangle(0.5, 0.4, texture(false)),
        &camera_at(1.6, 0.5, 1.1, 3.4),
        &SensorParams::ideal(),
        0,
    );
    let right = renderer.render(
        &one_rectangle(0.5, 0.4, texture(true)),
        &camera_at(1.6, -0.5, 1.1, -3.4),
        &SensorParams::ideal(),
        0,
    );
    for (v, u) in (0..120).flat_map(|v| (0..160).map(move |u| (v, u))) {
        let (a, b) = (left.image.at(u, v), right.image.at(159 - u, v));
        // The samples within an edge pixel are not symmetric: an edge may differ by a few parts
        // in 64.
        assert!(a.abs_diff(b) <= 6, "({u}, {v}): {a} {b}");
    }
}

#[test]
fn surfaces_behind_the_camera_are_invisible() {
    let building = one_rectangle(0.6, 0.84, white());
    let mut renderer = Renderer::new(golden_camera());
    let from_behind = renderer.render(&building, &camera_at(-3.0, 0.0, 1.0, 0.0), &SensorParams::ideal(), 0);
    assert!(from_behind.truth.landmarks.is_empty());
    let looking_away = renderer.render(&building, &camera_at(3.0, 0.0, 1.0, 0.0), &SensorParams::ideal(), 0);
    assert!(looking_away.truth.landmarks.is_empty());
    assert!(looking_away.image.data().iter().all(|g| *g == 0));
}
