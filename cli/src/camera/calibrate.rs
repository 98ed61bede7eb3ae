//! `waymark camera calibrate`: a camera's intrinsics from pictures of one flat object of known
//! shape, no server needed.

use crate::{
    camera_arg::{Lens, LensDifference},
    detect, pictures, screen,
};
use anyhow::Context as _;
use protos::api::CalibrationReport;
use serde::{Deserialize, Serialize};
use server::calibrating::{
    CORNER_SIGMA_PX, CalibratedPictures, CalibrationConstraints, calibrated, calibrated_from_pictures,
};
use std::path::{Path, PathBuf};
use vision::{
    camera_calibration::{MAX_PICTURES, PlanarView},
    frame::GrayImage,
    geometry::Corners,
    pose::LandmarkSize,
};

/// `waymark camera calibrate`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Pictures by one camera (PNG, JPEG, or folders of them) of one flat, textured rectangle: 2 to
    /// 32, better 3 or more, from sides that differ by more than 15 degrees. The report has their
    /// lens, where their EXIF says it.
    #[arg(required_unless_present = "corners")]
    images: Vec<PathBuf>,
    /// Width and height of the object in metres, such as 0.60x0.84. With corners only their ratio
    /// matters for the camera; with pictures they only set the distances.
    #[arg(long, value_parser = size)]
    size: LandmarkSize,
    /// Corners instead of pictures: JSON
    /// `{"width": px, "height": px, "views": [[[x,y],[x,y],[x,y],[x,y]], ...]}`, each view
    /// top-left, top-right, bottom-right, bottom-left.
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
    /// Radial coefficients (k1, k2) that may be fitted, 0 to 2; only those are that the views ask
    /// for.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u8).range(0..=2))]
    radial: u8,
    /// The camera does not roll (C2).
    #[arg(long)]
    zero_roll: bool,
    /// With corners: the camera is this high over the landmark's centre in all views, metres;
    /// negative below (C3).
    #[arg(long, value_name = "METRES", allow_negative_numbers = true, requires = "corners")]
    height_m: Option<f64>,
    /// With corners: the ratio of the landmark's sides is not what its size says, and is found with
    /// the camera.
    #[arg(long, requires = "corners")]
    unknown_aspect: bool,
}

impl Constraints {
    fn given(&self) -> CalibrationConstraints {
        let &Self { radial, zero_roll, height_m, unknown_aspect } = self;
        CalibrationConstraints { radial, zero_roll, height_m, unknown_aspect }
    }
}

/// A report with the lens of its pictures: photographs by another one are told, or refused.
#[derive(Serialize)]
struct WithLens<'a> {
    #[serde(flatten)]
    report: &'a CalibrationReport,
    #[serde(skip_serializing_if = "Option::is_none")]
    lens: Option<&'a Lens>,
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
    let known = args.constraints.given();
    let (names, report, mut evidence, lens) = if let Some(file) = &args.corners {
        let (names, views, image_px) = views_of_file(file, args.size)?;
        (names, calibrated(&views, image_px, &known)?, vec![], None)
    } else {
        let (names, images, lens) = read(&args.images)?;
        let found = calibrated_from_pictures(&images, args.size, &known)?;
        let evidence = evidence(&found);
        (names, found.report, evidence, lens)
    };
    evidence.extend(lens.as_ref().map(|lens| format!("lens: {lens}")));
    screen::say(&if args.json {
        serde_json::to_string(&WithLens { report: &report, lens: lens.as_ref() })?
    } else {
        table(&report, &names, &evidence)
    });
    Ok(())
}

/// What a camera from pictures rests on.
fn evidence(found: &CalibratedPictures) -> Vec<String> {
    let points: Vec<String> =
        found.points.iter().map(|n| n.map_or_else(|| "none".to_owned(), |n| n.to_string())).collect();
    let [agreeing, all] = found.lines;
    vec![format!(
        "windows of texture by picture: {}; {agreeing} of {all} side lines agree",
        points.join(", ")
    )]
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

/// Names and pictures, and the lens that they are by, where their files say it. Error: they are by
/// several.
fn read(images: &[PathBuf]) -> anyhow::Result<(Vec<String>, Vec<GrayImage>, Option<Lens>)> {
    let (mut names, mut read, mut lens) = (vec![], vec![], None);
    let files = detect::files(images)?;
    anyhow::ensure!(
        (2..=MAX_PICTURES).contains(&files.len()),
        "{} pictures given, 3 to {MAX_PICTURES} are needed",
        files.len()
    );
    for path in files {
        let name = path.display().to_string();
        let image = pictures::read(&path).with_context(|| name.clone())?;
        let first = read.first().unwrap_or(&image);
        anyhow::ensure!(
            [image.width(), image.height()] == [first.width(), first.height()],
            "{name}: not as large as the first picture"
        );
        if let Some(taken) = pictures::photograph(&path).with_context(|| name.clone())?.lens {
            let first = lens.get_or_insert_with(|| taken.clone());
            anyhow::ensure!(
                first.difference(&taken) != Some(LensDifference::Focal),
                "{name}: it is by {taken}, and the pictures before by {first}: a calibration is of one lens"
            );
        }
        names.push(name);
        read.push(image);
    }
    Ok((names, read, lens))
}

fn table(r: &CalibrationReport, names: &[String], evidence: &[String]) -> String {
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
    lines.extend(evidence.iter().cloned());
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera_arg::lens::tests::photograph;

    #[test]
    fn a_calibration_is_of_one_lens() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, focal_35mm| {
            let path = folder.path().join(name);
            std::fs::write(&path, photograph("iPhone 13", focal_35mm)).unwrap();
            path
        };
        let (first, same, other) = (file("a.jpg", 26), file("b.jpg", 26), file("c.jpg", 13));
        let (_, images, lens) = read(&[first.clone(), same]).unwrap();
        assert_eq!(
            (images.len(), lens.unwrap().to_string()),
            (2, "iPhone 13, 26 mm (35 mm equivalent)".to_owned())
        );
        let refused = read(&[first, other]).unwrap_err().to_string();
        assert!(
            refused.contains("c.jpg") && refused.contains("13 mm") && refused.contains("26 mm"),
            "{refused}"
        );
    }
}
