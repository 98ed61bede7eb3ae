//! A camera from pictures of one flat, textured object with straight sides (method 16.6). In: the
//! pictures, and the size that the object is said to have. Out: the camera with its covariance, or
//! why there is none.
//!
//! The texture gives the maps between the pictures, the sides give two directions at right angles.
//! Neither the place of a side nor the object's size matters for the focal length: a shadow, a mat
//! and a frame are parallel to the object.

use crate::{
    camera_calibration::{
        calibrate::{CalibrateError, CameraCalibration, believable, orientations},
        camera_model::{ALPHA, K1, K2, PIXEL_ASPECT, U0, V0},
        least_squares::ViewFit,
        params::CalibrateParams,
        pictures::{
            adjustment::{Evidence, Observation},
            common_object::{Picture, common_object},
            denoise::denoised,
            robust_fit::{RobustFit, Start, robust_fit},
            side_lines::side_lines,
            tracks::{Track, tracked},
        },
    },
    detect::pyramid::reduce,
    frame::{Distortion, FrameError, GrayImage, Intrinsics},
    geometry::corners::Corners,
    pose::measurement::LandmarkSize,
};
use nalgebra::{Matrix2, Point2, SMatrix};

/// Most pictures.
pub const MAX_PICTURES: usize = 32;
/// Larger pictures are reduced by a whole factor: their points are no better in pixels of the
/// object.
const MAX_WORKING_SIDE_PX: usize = 1600;
/// Fewest lines that agree along either direction, and fewest pictures that they are of.
const MIN_LINES: usize = 4;
const MIN_LINE_VIEWS: usize = 2;
/// Smallest share of the lines that agrees.
const MIN_AGREEING: f64 = 0.6;

/// The camera, and what it rests on.
#[derive(Debug, Clone, PartialEq)]
pub struct PictureCalibration {
    /// The camera; its views are the pictures in `used`.
    pub calibration: CameraCalibration,
    /// Indices of the pictures that show the object, ascending.
    pub used: Vec<usize>,
    /// For each of `used`: windows of the texture that it shows and that agree.
    pub points: Vec<usize>,
    /// Lines along the sides that agree on the directions, and all that were found.
    pub lines: [usize; 2],
    /// A border around the object in each of `used`, px: its own, its frame's or its shadow's.
    pub borders_px: Vec<Corners>,
}

/// The camera that took `images` of one object of about `size`; all have the same size. The
/// camera's height is not used: the object's scale is only about known.
pub fn calibrate_pictures(
    images: &[GrayImage],
    size: LandmarkSize,
    p: &CalibrateParams,
) -> Result<PictureCalibration, CalibrateError> {
    let first = images.first().map_or([0, 0], |i| [i.width(), i.height()]);
    if !(2..=MAX_PICTURES).contains(&images.len()) {
        return Err(CalibrateError::OutOfRange { field: "pictures", value: images.len() as f64 });
    }
    if let Some(view) = images.iter().position(|i| [i.width(), i.height()] != first) {
        return Err(CalibrateError::View { view, reason: "its picture is not as large as the first" });
    }
    let factor = first[0].max(first[1]).div_ceil(MAX_WORKING_SIDE_PX);
    let reduced: Vec<GrayImage> =
        if factor > 1 { images.iter().map(|i| reduce(i, factor)).collect() } else { vec![] };
    let working = if factor > 1 { &reduced } else { images };
    let pictures: Vec<Picture<'_>> = working.iter().map(Picture::detected).collect();
    let found = from_candidates(&pictures, size, p)?;
    let found = if factor > 1 { enlarged(found, factor as f64)? } else { found };
    believable(&found.calibration.camera, first)?;
    Ok(found)
}

/// The same from pictures whose candidate borders are known.
fn from_candidates(
    pictures: &[Picture<'_>],
    size: LandmarkSize,
    p: &CalibrateParams,
) -> Result<PictureCalibration, CalibrateError> {
    let nothing = |shown| CalibrateError::NoCommonObject { shown, of: pictures.len() };
    let object = common_object(pictures, size.width_m / size.height_m).ok_or(nothing(0))?;
    let (tracks, maps) = tracked(pictures, &object);
    let used: Vec<usize> = (0..pictures.len()).filter(|i| maps[*i].is_some()).collect();
    if used.len() < p.min_orientations.max(2) {
        return Err(nothing(used.len()));
    }
    let mut borders_px = Vec::new();
    for map in maps.iter().flatten() {
        let corners = Corners::new(object.border_px.points().map(|c| map.apply(&c)));
        borders_px.push(corners.map_err(|_not_convex| nothing(used.len()))?);
    }
    let image = pictures[used[0]].image;
    let image_px = [image.width() as f64, image.height() as f64];
    let start = Start {
        evidence: evidence(pictures, &tracks, (&used, &borders_px), image_px, p),
        borders_px: &borders_px,
        reference: used.iter().position(|u| *u == object.reference).unwrap_or(0),
        size,
        image_px,
    };
    let fit = robust_fit(&start, p.radial)?;
    let lines = clear(&fit)?;
    let (calibration, points) = finished(&fit, p)?;
    if calibration.orientations < p.min_orientations {
        let (orientations, wanted) = (calibration.orientations, p.min_orientations);
        let step_deg = p.orientation_step_rad.to_degrees();
        return Err(CalibrateError::Orientations { orientations, wanted, step_deg });
    }
    Ok(PictureCalibration { calibration, used, points, lines, borders_px })
}

/// All that the fit rests on.
fn evidence(
    pictures: &[Picture<'_>],
    tracks: &[Track],
    (used, borders_px): (&[usize], &[Corners]),
    [w, h]: [f64; 2],
    p: &CalibrateParams,
) -> Vec<Evidence> {
    let window = |t: &Track| {
        let view = used.iter().position(|u| *u == t.picture)?;
        let weight = t.covariance_px2.cholesky()?.l().try_inverse()?;
        Some(Evidence::Window { view, reference_px: t.reference_px, px: t.px, weight })
    };
    let mut all: Vec<Evidence> = tracks.iter().filter_map(window).collect();
    for (view, (i, border)) in used.iter().zip(borders_px).enumerate() {
        let lines = side_lines(&denoised(pictures[*i].image), border).into_iter();
        all.extend(lines.map(|l| Evidence::Line {
            view,
            ends_px: l.ends_px,
            sigma_px: l.sigma_px,
            is_upright: l.is_upright,
        }));
        if p.roll_sigma_rad > 0.0 {
            all.push(Evidence::Level { view, sigma_rad: p.roll_sigma_rad });
        }
    }
    let sigma_px = if p.centre_sigma > 0.0 { p.centre_sigma * w } else { w };
    all.push(Evidence::Centre { px: Point2::new(0.5 * (w - 1.0), 0.5 * (h - 1.0)), sigma_px });
    all
}

/// Lines that agree and lines found; refuses a fit that most of them contradict.
fn clear(fit: &RobustFit) -> Result<[usize; 2], CalibrateError> {
    let lines: Vec<(usize, bool, bool)> = fit
        .problem
        .observations
        .iter()
        .filter_map(|o| match o.what {
            Evidence::Line { view, is_upright, .. } => Some((view, is_upright, o.trust > 0.0)),
            _ => None,
        })
        .collect();
    let agreeing = lines.iter().filter(|l| l.2).count();
    let is_seen = |is_upright: bool| {
        let own: Vec<usize> = lines.iter().filter(|l| l.2 && l.1 == is_upright).map(|l| l.0).collect();
        let views = (0..fit.state.poses.len()).filter(|v| own.contains(v)).count();
        own.len() >= MIN_LINES && views >= MIN_LINE_VIEWS
    };
    let is_most = agreeing as f64 >= MIN_AGREEING * lines.len() as f64;
    if is_seen(true) && is_seen(false) && is_most {
        Ok([agreeing, lines.len()])
    } else {
        Err(CalibrateError::BorderUnclear { agreeing, found: lines.len() })
    }
}

/// The camera of a fit, and the number of windows that each view shows.
fn finished(fit: &RobustFit, p: &CalibrateParams) -> Result<(CameraCalibration, Vec<usize>), CalibrateError> {
    let RobustFit { problem, state, chi2, dof, covariance } = fit;
    let c = &state.camera;
    let distortion =
        if problem.free[K1] { Distortion::PlumbBob([c[K1], c[K2], 0.0, 0.0, 0.0]) } else { Distortion::None };
    let camera = Intrinsics::new(c[ALPHA], c[ALPHA] * c[PIXEL_ASPECT], c[U0], c[V0], distortion)?;
    let order = [ALPHA, U0, V0, K1, K2, PIXEL_ASPECT];
    let (mut views, mut points) = (vec![], vec![]);
    let (mut all_px2, mut all) = (0.0, 0);
    for (view, pose) in state.poses.iter().enumerate() {
        let (mut chi2, mut square_px2, mut n) = (0.0, 0.0, 0);
        for Observation { what, .. } in problem.observations.iter().filter(|o| o.trust > 0.0) {
            let Evidence::Window { view: own, reference_px, px, .. } = *what else { continue };
            if own == view {
                let plain = Evidence::Window { view, reference_px, px, weight: Matrix2::identity() };
                (chi2, n) = (chi2 + problem.chi2(what, state), n + 1);
                square_px2 += problem.chi2(&plain, state);
            }
        }
        let rms_px = (square_px2 / (2 * n).max(1) as f64).sqrt();
        views.push(ViewFit { camera_from_plane: *pose, chi2, rms_px });
        points.push(n);
        (all_px2, all) = (all_px2 + square_px2, all + 2 * n);
    }
    // The reference picture shows all.
    points[problem.reference] = points.iter().copied().max().unwrap_or(0);
    let calibration = CameraCalibration {
        camera,
        covariance: Some(SMatrix::from_fn(|i, j| covariance[(order[i], order[j])])),
        linear_fx_px: None,
        aspect_ratio: 1.0,
        height_m: None,
        views,
        rms_px: (all_px2 / all.max(1) as f64).sqrt(),
        chi2: *chi2,
        dof: *dof,
        orientations: orientations(&state.poses, p.orientation_step_rad),
        sigma_ratio: 0.0,
    };
    Ok((calibration, points))
}

/// The result in pixels of pictures that are `factor` times as large. Pixel centres are integers.
fn enlarged(found: PictureCalibration, factor: f64) -> Result<PictureCalibration, FrameError> {
    let place = |x: f64| (x + 0.5) * factor - 0.5;
    let mut all = found;
    let c = &mut all.calibration;
    let k = c.camera;
    let (cx, cy) = (place(k.cx_px), place(k.cy_px));
    c.camera = Intrinsics::new(k.fx_px * factor, k.fy_px * factor, cx, cy, k.distortion)?;
    // Focal length and centre are lengths, the others are ratios.
    let scale = |i: usize| if i < 3 { factor } else { 1.0 };
    c.covariance = c.covariance.map(|m| SMatrix::from_fn(|i, j| m[(i, j)] * scale(i) * scale(j)));
    c.rms_px *= factor;
    for view in &mut c.views {
        view.rms_px *= factor;
    }
    for border in &mut all.borders_px {
        *border = Corners::new(border.points().map(|p| p.map(place))).unwrap_or(*border);
    }
    Ok(all)
}
