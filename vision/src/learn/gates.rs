//! Gates at the end of modelling (method 9): is the landmark salient, stable, and observed from
//! sufficiently different viewpoints?
//!
//! In: the training icons, their points and the corners they were cut from. Out: numbers with their
//! limits. The consequence of a failed gate is defined by
//! [`crate::model::landmark_model::ModelStatus`].

use crate::{model::seen_from::SeenFrom, recognise::features::descriptor::PointSet};
use nalgebra::{Matrix3, Point2, Vector2};
use serde::{Deserialize, Serialize};

/// Grey-level standard deviation to which every icon is normalised before saliency.
const NORMAL_DEVIATION: f64 = 50.0;
/// Smallest mean of ln(left side / right side) that is no view from the front: 15 to 20 degrees off
/// at 2 to 3 m.
const MIN_LEAN: f64 = 0.05;
/// Value of `v_c` where the homography's last element all but vanishes, and its upper bound.
pub const V_C_CAP: f64 = 10.0;

/// Limits of the gates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GateParams {
    /// Fewest views.
    pub min_views: usize,
    /// Least saliency F.
    pub min_saliency_f: f64,
    /// The same where at most one view was photographed; otherwise interpolated by the share of
    /// photographed views. Generated views are flat and registered by construction, so F only has
    /// to distinguish texture from a blank panel (1.1), while their corner noise and light vary
    /// more than in a robot's own views.
    pub min_saliency_f_generated: f64,
    /// Fewest stable points.
    pub min_stable_points: usize,
    /// Fewer stable points keep a landmark out of use even where one of the paper's distances has a
    /// threshold.
    pub refuse_few_points: bool,
    /// Least visibility confidence `v_c` of the photographs.
    pub min_v_c: f64,
    /// A smaller one keeps a landmark out of use; otherwise it is only said.
    pub refuse_one_side: bool,
    /// No measured gate keeps a landmark out of use: all are only said.
    pub refuse_nothing: bool,
    /// Largest displacement of a stable point, in icon pixels.
    pub stable_within_px: f64,
    /// Largest descriptor distance of a stable point.
    pub stable_within_nu: f64,
    /// Share of the training icons in which a stable point must be found again.
    pub stable_share: f64,
}

impl Default for GateParams {
    fn default() -> Self {
        Self {
            min_views: 20,
            min_saliency_f: 6.0,
            min_saliency_f_generated: 3.0,
            min_stable_points: 10,
            refuse_few_points: false,
            min_v_c: 0.5,
            refuse_one_side: false,
            refuse_nothing: false,
            stable_within_px: 1.5,
            stable_within_nu: 3.0,
            stable_share: 0.6,
        }
    }
}

/// `F = V_s / (V_t + 1)`: spatial variance of the mean icon over the variance of each pixel between
/// icons, every icon normalised to mean 0 and standard deviation 50 first. Large for a textured
/// plane with consistent views, near 0 for a blank or inconsistent one.
pub fn saliency_f(icons: &[&[f32]]) -> f64 {
    let Some(pixels) = icons.first().map(|i| i.len()).filter(|p| *p > 0) else { return 0.0 };
    let n = icons.len() as f64;
    let (mut mean, mut square) = (vec![0.0; pixels], vec![0.0; pixels]);
    for icon in icons {
        let (centre, scale) = normalisation(icon);
        for ((m, s), g) in mean.iter_mut().zip(&mut square).zip(*icon) {
            let g = (f64::from(*g) - centre) * scale;
            *m += g / n;
            *s += g * g / n;
        }
    }
    let temporal = mean.iter().zip(&square).map(|(m, s)| (s - m * m).max(0.0)).sum::<f64>() / pixels as f64;
    let spatial = variance(&mean);
    spatial / (temporal + 1.0)
}

/// `sal = min(1, n_stable / 20) F / (F + 6)` in [0, 1): one number for the choice of gaze (method
/// 14).
pub fn saliency(f: f64, stable_points: usize) -> f64 {
    (stable_points as f64 / 20.0).min(1.0) * f / (f + 6.0)
}

/// Points of icon `reference` that are found in at least the given share of the icons, itself
/// included: within `stable_within_px` and with a descriptor distance below `stable_within_nu`.
pub fn stable_points(reference: usize, icons: &[&PointSet], p: &GateParams) -> usize {
    let Some(points) = icons.get(reference) else { return 0 };
    let needed = p.stable_share * icons.len() as f64;
    let within = |x: &[f32], y: &[f32], limit: f64| {
        f64::from(x.iter().zip(y).map(|(x, y)| (x - y) * (x - y)).sum::<f32>()).sqrt() < limit
    };
    let comes_back = |i: usize, icon: &PointSet| {
        icon.xy_px().iter().zip(icon.descriptors()).any(|(xy, nu)| {
            within(xy, &points.xy_px()[i], p.stable_within_px)
                && within(nu, &points.descriptors()[i], p.stable_within_nu)
        })
    };
    (0..points.len())
        .filter(|i| icons.iter().filter(|icon| comes_back(*i, icon)).count() as f64 >= needed)
        .count()
}

/// Visibility confidence `v_c`: the largest Frobenius distance from the identity of the
/// homographies between any two views, in image coordinates centred and divided by half the
/// diagonal, `H(3,3) = 1`. 0 with fewer than two views or with identical ones, at most [`V_C_CAP`].
/// `views` are (corners, width and height of the image), all in pixels.
pub fn v_c(views: &[([Point2<f64>; 4], [f64; 2])]) -> f64 {
    let planes: Vec<(Matrix3<f64>, Matrix3<f64>)> = views
        .iter()
        .filter_map(|(corners, [width, height])| {
            let centre = Vector2::new(width - 1.0, height - 1.0) * 0.5;
            let half_diagonal = 0.5 * width.hypot(*height);
            let view_from_unit =
                quad_from_unit(&corners.map(|c| Point2::from((c.coords - centre) / half_diagonal)));
            view_from_unit.try_inverse().map(|inverse| (view_from_unit, inverse))
        })
        .collect();
    let mut largest = 0.0f64;
    for (i, (_, unit_from_i)) in planes.iter().enumerate() {
        for (j, (j_from_unit, _)) in planes.iter().enumerate() {
            if i != j {
                largest = largest.max(departure(&(j_from_unit * unit_from_i)));
            }
        }
    }
    largest
}

/// From where photographs with these corners (TL, TR, BR, BL, px) show a landmark, in the mean: the
/// nearer side is the longer one.
pub(crate) fn seen_from<'a>(views: impl Iterator<Item = &'a [Point2<f64>; 4]>) -> SeenFrom {
    let leans: Vec<f64> = views.map(|[tl, tr, br, bl]| ((tl - bl).norm() / (tr - br).norm()).ln()).collect();
    let mean = leans.iter().sum::<f64>() / leans.len().max(1) as f64;
    match mean {
        left if left > MIN_LEAN => SeenFrom::Left,
        right if right < -MIN_LEAN => SeenFrom::Right,
        _ => SeenFrom::Front,
    }
}

/// `||H / H(3,3) - I||`, capped.
fn departure(h: &Matrix3<f64>) -> f64 {
    let last = h[(2, 2)];
    if last.abs() < 0.05 * h.norm() {
        return V_C_CAP;
    }
    let departure = (h / last - Matrix3::identity()).norm();
    if departure < V_C_CAP { departure } else { V_C_CAP }
}

/// Homography from the unit square to a convex quad, in closed form.
pub(crate) fn quad_from_unit(corners: &[Point2<f64>; 4]) -> Matrix3<f64> {
    let [p0, p1, p2, p3] = corners.map(|c| c.coords);
    let (d1, d2, sum) = (p1 - p2, p3 - p2, p0 - p1 + p2 - p3);
    let det = d1.perp(&d2);
    let (g, h) = (sum.perp(&d2) / det, d1.perp(&sum) / det);
    let (a, b) = (p1 - p0 + g * p1, p3 - p0 + h * p3);
    Matrix3::new(a.x, b.x, p0.x, a.y, b.y, p0.y, g, h, 1.0)
}

/// Mean, and the factor that brings the deviation to [`NORMAL_DEVIATION`] (0 for a constant icon).
fn normalisation(icon: &[f32]) -> (f64, f64) {
    let grey: Vec<f64> = icon.iter().map(|g| f64::from(*g)).collect();
    let deviation = variance(&grey).sqrt();
    let mean = grey.iter().sum::<f64>() / grey.len() as f64;
    (mean, if deviation > 1e-6 { NORMAL_DEVIATION / deviation } else { 0.0 })
}

fn variance(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use nalgebra::{Isometry3, Point3, Rotation3, Translation3, Vector3};

    /// Corners of the golden poster (0.60 x 0.84 m) for a level camera (f = 700, 640 x 480) 0.3 m
    /// below its centre, at `bearing_deg` and `distance_m` in plan view, turned towards it.
    fn view_from(bearing_deg: f64, distance_m: f64) -> ([Point2<f64>; 4], [f64; 2]) {
        let bearing = bearing_deg.to_radians();
        let centre = Vector3::new(distance_m * bearing.cos(), distance_m * bearing.sin(), -0.3);
        // Camera z looks back at the poster's axis, y down, x to the right.
        let z = -Vector3::new(bearing.cos(), bearing.sin(), 0.0);
        let y = -Vector3::z();
        let landmark_from_camera = Isometry3::from_parts(
            Translation3::from(centre),
            Rotation3::from_basis_unchecked(&[y.cross(&z), y, z]).into(),
        );
        let corners = [(-0.3, 0.42), (0.3, 0.42), (0.3, -0.42), (-0.3, -0.42)].map(|(y, z)| {
            let p = landmark_from_camera.inverse_transform_point(&Point3::new(0.0, y, z));
            Point2::new(700.0 * p.x / p.z + 319.5, 700.0 * p.y / p.z + 239.5)
        });
        (corners, [640.0, 480.0])
    }

    /// Golden values of method 9.
    #[test]
    fn v_c_of_the_golden_views() {
        let v = |views: &[(f64, f64)]| v_c(&views.iter().map(|(b, d)| view_from(*b, *d)).collect::<Vec<_>>());
        assert!(v(&[(0.0, 3.0)]).abs() < 1e-12);
        assert!(v(&[(20.0, 3.0), (20.0, 3.0)]).abs() < 1e-9);
        assert!((v(&[(30.0, 3.0), (-30.0, 3.0)]) - 0.66).abs() < 5e-3, "{}", v(&[(30.0, 3.0), (-30.0, 3.0)]));
        assert!((v(&[(60.0, 3.0), (-60.0, 3.0)]) - 1.98).abs() < 5e-3);
        assert!((v(&[(0.0, 2.0), (0.0, 6.0)]) - 8.0f64.sqrt()).abs() < 1e-9);
        // Independent of the order of the views.
        assert!((v(&[(0.0, 6.0), (0.0, 2.0)]) - 8.0f64.sqrt()).abs() < 1e-9);
    }

    /// The side at +y is the right one of who faces the landmark. 40 degrees pass the gate, 30
    /// fail.
    #[test]
    fn the_side_of_the_views_is_that_of_the_longer_side() {
        let from = |bearings: &[f64]| {
            let views: Vec<_> = bearings.iter().map(|b| view_from(*b, 3.0).0).collect();
            seen_from(views.iter())
        };
        assert_eq!(from(&[40.0]), SeenFrom::Right);
        assert_eq!(from(&[-40.0, -30.0, 5.0]), SeenFrom::Left);
        for front in [&[][..], &[0.0], &[9.0], &[40.0, -40.0]] {
            assert_eq!(from(front), SeenFrom::Front, "{front:?}");
        }
        let limit = GateParams::default().min_v_c;
        let beside_front = |bearing| v_c(&[view_from(0.0, 3.0), view_from(bearing, 3.0)]);
        assert!(beside_front(40.0) > limit && beside_front(30.0) < limit);
    }

    /// In-plane turn by `a` about the image centre: ||R - I|| = sqrt(8) sin(a / 2).
    #[test]
    fn v_c_of_a_turn_in_the_plane() {
        let (corners, size) = view_from(0.0, 3.0);
        let centre = Vector2::new(319.5, 239.5);
        let turned =
            corners.map(|c| Point2::from(nalgebra::Rotation2::new(0.4) * (c.coords - centre) + centre));
        let expected = 8.0f64.sqrt() * 0.2f64.sin();
        assert!((v_c(&[(corners, size), (turned, size)]) - expected).abs() < 1e-9);
    }

    #[test]
    fn v_c_is_capped() {
        let square =
            |s: f64| [(0.0, 0.0), (s, 0.0), (s, s), (0.0, s)].map(|(u, v)| Point2::new(300.0 + u, 200.0 + v));
        let views = [(square(1.0), [640.0, 480.0]), (square(200.0), [640.0, 480.0])];
        assert!((v_c(&views) - V_C_CAP).abs() < 1e-12);
    }

    fn textured(noise: f64, seed: u64, n: usize) -> Vec<Vec<f32>> {
        let mut random = Random::new(seed);
        let base: Vec<f64> = (0..400).map(|_| 128.0 + 40.0 * random.normal()).collect();
        (0..n)
            .map(|_| {
                let (gain, offset) = (random.range(0.6, 1.4), random.range(-20.0, 20.0));
                base.iter().map(|b| (gain * (b + noise * random.normal()) + offset) as f32).collect()
            })
            .collect()
    }

    fn f_of(icons: &[Vec<f32>]) -> f64 {
        saliency_f(&icons.iter().map(Vec::as_slice).collect::<Vec<_>>())
    }

    /// Oracle: with noise of deviation s on a texture of deviation 40, after normalisation `V_s` =
    /// 2500 w (up to the noise left in the mean) and `V_t` = 2500 (1 - w), w = 40^2 / (40^2 + s^2).
    #[test]
    fn saliency_is_signal_over_noise() {
        for noise in [4.0, 10.0, 20.0] {
            let w = 1600.0 / (1600.0 + noise * noise);
            let expected = 2500.0 * w / (2500.0 * (1.0 - w) + 1.0);
            let found = f_of(&textured(noise, 3, 200));
            assert!((found / expected - 1.0).abs() < 0.12, "noise {noise}: {found}, expected {expected}");
        }
    }

    #[test]
    fn saliency_ignores_gain_and_offset_and_refuses_noise() {
        // Without noise only the 1 in the denominator is left: F = 50^2.
        assert!((f_of(&textured(0.0, 4, 20)) - 2500.0).abs() < 1.0);
        let blank: Vec<Vec<f32>> = (0..30)
            .map(|seed| {
                let mut random = Random::new(seed);
                (0..400).map(|_| (100.0 + 2.0 * random.normal()) as f32).collect()
            })
            .collect();
        assert!(f_of(&blank) < 0.1);
        assert!(f_of(&[vec![7.0; 100], vec![9.0; 100]]).abs() < 1e-12);
        assert!(saliency_f(&[]).abs() < 1e-12);
    }

    fn points(at: &[([f32; 2], f32)]) -> PointSet {
        let descriptor = |nu: f32| [nu, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        PointSet::new(
            at.iter().map(|(xy, _)| *xy).collect(),
            at.iter().map(|(_, nu)| descriptor(*nu)).collect(),
            vec![1.0; at.len()],
        )
        .unwrap()
    }

    #[test]
    fn points_found_in_enough_icons_are_stable() {
        // Of five icons: the first point comes back in all, the second in 3 of 5 (the limit), the
        // third in 2, the fourth at the right place with another texture, the fifth just too far
        // away.
        let reference = points(&[
            ([10.0, 10.0], 0.0),
            ([30.0, 10.0], 0.0),
            ([50.0, 10.0], 0.0),
            ([10.0, 40.0], 0.0),
            ([30.0, 40.0], 0.0),
        ]);
        let both =
            points(&[([11.0, 11.0], 1.0), ([30.0, 10.0], 2.9), ([10.0, 40.0], 3.1), ([31.5, 40.0], 0.0)]);
        let third = points(&[([10.0, 9.0], 0.0), ([50.0, 10.0], 0.0), ([10.0, 40.0], -3.1)]);
        let none = points(&[([10.0, 10.0], 0.0)]);
        let icons = [&both, &reference, &both, &third, &none];
        assert_eq!(stable_points(1, &icons, &GateParams::default()), 2);
        assert_eq!(stable_points(9, &icons, &GateParams::default()), 0);
        assert_eq!(stable_points(0, &[&points(&[])], &GateParams::default()), 0);
    }

    #[test]
    fn scalar_saliency() {
        assert!((saliency(6.0, 20) - 0.5).abs() < 1e-12);
        assert!((saliency(6.0, 10) - 0.25).abs() < 1e-12);
        assert!((saliency(6.0, 400) - 0.5).abs() < 1e-12);
        assert!(saliency(0.0, 20).abs() < 1e-12);
    }
}
