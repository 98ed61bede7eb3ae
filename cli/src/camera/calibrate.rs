//! `waymark camera calibrate`: a camera's intrinsics from pictures of one flat object of known shape, no server needed.

use crate::{detect, pictures, screen};
use anyhow::Context as _;
use engine::dominant::dominant;
use protos::api::CalibrationReport;
use serde::Deserialize;
use server::calibrating::{CORNER_SIGMA_PX, CalibrationConstraints, calibrated};
use std::path::{Path, PathBuf};
use vision::{
    camera_calibration::PlanarView,
    detect::{DetectParams, Quad, QuadKind, detect},
    geometry::Corners,
    pose::LandmarkSize,
    trace::NoTrace,
};

/// `waymark camera calibrate`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Pictures by one camera (PNG, JPEG, or folders of them), each of which shows the object as its largest quad.
    #[arg(required_unless_present = "corners")]
    images: Vec<PathBuf>,
    /// Width and height of the object in metres, such as 0.60x0.84; only their ratio matters for the camera.
    #[arg(long, value_parser = size)]
    size: LandmarkSize,
    /// Corners instead of pictures: JSON `{"width": px, "height": px, "views": [[[x,y],[x,y],[x,y],[x,y]], ...]}`, each
    /// view top-left, top-right, bottom-right, bottom-left.
    #[arg(long, value_name = "FILE", conflicts_with = "images")]
    corners: Option<PathBuf>,
    #[command(flatten)]
    constraints: Constraints,
    /// The report as JSON.
    #[arg(long)]
    json: bool,
}

/// What is known of the camera beside the views.
#[derive(Debug, clap::Args)]
struct Constraints {
    /// Radial coefficients (k1, k2) that may be fitted, 0 to 2; only those are that the views ask for.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u8).range(0..=2))]
    radial: u8,
    /// The camera does not roll (C2).
    #[arg(long)]
    zero_roll: bool,
    /// The camera is this high over the landmark's centre in all views, metres; negative below (C3).
    #[arg(long, value_name = "METRES", allow_negative_numbers = true)]
    height_m: Option<f64>,
    /// The ratio of the landmark's sides is not what its size says, and is found with the camera.
    #[arg(long)]
    unknown_aspect: bool,
}

impl Constraints {
    fn given(&self) -> CalibrationConstraints {
        let &Self { radial, zero_roll, height_m, unknown_aspect } = self;
        CalibrationConstraints { radial, zero_roll, height_m, unknown_aspect }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CornersFile {
    width: usize,
    height: usize,
    views: Vec<[[f64; 2]; 4]>,
}

fn size(text: &str) -> Result<LandmarkSize, String> {
    let part =
        |t: &str| t.trim().parse().ok().filter(|v| (LandmarkSize::MIN_M..=LandmarkSize::MAX_M).contains(v));
    text.split_once('x')
        .and_then(|(w, h)| Some(LandmarkSize { width_m: part(w)?, height_m: part(h)? }))
        .ok_or_else(|| "width and height in metres, such as 0.60x0.84".to_owned())
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let (names, views, image_px) = match &args.corners {
        Some(file) => views_of_file(file, args.size)?,
        None => views_of_images(&args.images, args.size)?,
    };
    let report = calibrated(&views, image_px, &args.constraints.given())?;
    screen::say(&if args.json { serde_json::to_string(&report)? } else { table(&report, &names) });
    Ok(())
}

type Views = (Vec<String>, Vec<PlanarView>, [usize; 2]);

fn views_of_file(file: &Path, size: LandmarkSize) -> anyhow::Result<Views> {
    let text = std::fs::read(file).with_context(|| format!("cannot read {}", file.display()))?;
    let given: CornersFile =
        serde_json::from_slice(&text).with_context(|| format!("{} holds no corners", file.display()))?;
    let covariance = [nalgebra::Matrix2::identity() * CORNER_SIGMA_PX.powi(2); 4];
    let mut views = vec![];
    for (i, corners) in given.views.iter().enumerate() {
        let corners = Corners::try_from(*corners).with_context(|| format!("view {i}"))?;
        views.push(PlanarView::of_quad(&corners, &covariance, size));
    }
    Ok(((0..views.len()).map(|i| format!("view {i}")).collect(), views, [given.width, given.height]))
}

/// The largest quad of every picture.
fn views_of_images(images: &[PathBuf], size: LandmarkSize) -> anyhow::Result<Views> {
    let (mut names, mut views) = (vec![], vec![]);
    let mut image_px = None;
    for path in detect::files(images)? {
        let name = path.display().to_string();
        let image = pictures::read_picture(&path).with_context(|| name.clone())?;
        let here = [image.width(), image.height()];
        anyhow::ensure!(*image_px.get_or_insert(here) == here, "{name}: not as large as the first picture");
        match largest(&detect(&image, &DetectParams::default(), &mut NoTrace)) {
            Some(quad) => {
                views.push(PlanarView::of_quad(&quad.corners_px, &quad.corner_covariance_px2, size));
                names.push(name);
            }
            None => screen::complain(&format!("waymark: {name}: no quad stands out")),
        }
    }
    Ok((names, views, image_px.context("no pictures")?))
}

/// The dominant whole quad; without one the largest.
fn largest(quads: &[Quad]) -> Option<&Quad> {
    let mut whole: Vec<&Quad> =
        quads.iter().filter(|q| q.kind == QuadKind::Full && !q.side_clipped.contains(&true)).collect();
    whole.sort_by(|a, b| b.corners_px.area_px2().total_cmp(&a.corners_px.area_px2()));
    let corners: Vec<Corners> = whole.iter().map(|q| q.corners_px).collect();
    let dominant = dominant(&corners).and_then(|c| whole.iter().find(|q| q.corners_px == *c));
    dominant.or(whole.first()).copied()
}

fn table(r: &CalibrationReport, names: &[String]) -> String {
    let k = &r.intrinsics;
    let mut lines = vec![
        format!(
            "fx {:.2} +- {:.2} px, fy {:.2}, centre ({:.1} +- {:.1}, {:.1} +- {:.1})",
            k.fx_px, r.fx_sigma_px, k.fy_px, k.cx_px, r.cx_sigma_px, k.cy_px, r.cy_sigma_px
        ),
        match k.plumb_bob.as_slice() {
            [] => "no lens distortion that the views show".to_owned(),
            lens => format!("plumb_bob {lens:?}"),
        },
        format!(
            "{} of {} views, {} orientations, rms {:.2} px, chi2 {:.2} a degree of freedom",
            r.views.iter().filter(|v| v.used).count(),
            r.views.len(),
            r.orientations,
            r.rms_px,
            r.reduced_chi2
        ),
    ];
    lines.extend(r.linear_fx_px.map(|fx| format!("linear solution: fx {fx:.2}")));
    lines.extend(r.warnings.iter().map(|warning| format!("caution: {warning}")));
    for (view, name) in r.views.iter().zip(names) {
        lines.push(match (view.rms_px, view.distance_m) {
            (Some(rms), Some(distance)) => format!("  {name}: rms {rms:.2} px, {distance:.2} m"),
            _ => format!("  {name}: left out, it does not fit the others"),
        });
    }
    lines.join("\n")
}
