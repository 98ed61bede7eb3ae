//! Auto-calibration from one quad of a real board (its four outermost points), compared with the
//! calibration from all its points and with the calibration that the set states: pinhole with
//! pinhole, lens with lens.

use super::sets::{Set, Stated};
use crate::evaluate::{experiment::mixed, statistics::median};
use serde::Serialize;
use vision::{
    camera_calibration::{CalibrateError, CalibrateParams, CameraCalibration, PlanarView, calibrate},
    random::Random,
};

/// Standard deviation of the principal point about the image's centre, as a share of the width.
const CENTRE_SIGMA: f64 = 0.1;
/// Subsets of views drawn for each point of the curve.
const SUBSETS: usize = 40;

/// Result of one calibration.
#[derive(Debug, Clone, Serialize)]
pub(super) struct CalibrationFigures {
    fx_px: f64,
    fx_sigma_px: Option<f64>,
    cx_px: f64,
    cy_px: f64,
    radial: Vec<f64>,
    rms_px: f64,
    orientations: usize,
}

/// Error over the number of views.
#[derive(Debug, Clone, Serialize)]
pub(super) struct OfViews {
    pub(super) views: usize,
    pub(super) median: f64,
}

#[derive(Debug, Clone, Serialize)]
pub(super) struct RealSet {
    pub(super) name: String,
    views: usize,
    points: usize,
    stated: Vec<Stated>,
    /// From all points: pinhole, and with two radial coefficients.
    all_pinhole: Result<CalibrationFigures, String>,
    all_lens: Result<CalibrationFigures, String>,
    /// From the outermost quad: pinhole, and with one.
    quad_pinhole: Result<CalibrationFigures, String>,
    quad_lens: Result<CalibrationFigures, String>,
    /// The quad with a lens against all points with a lens, over the number of views.
    pub(super) by_views: Vec<OfViews>,
}

pub(super) fn evaluated(set: &Set, seed: u64) -> RealSet {
    let quads = set.quads();
    let of = |views: &[PlanarView], radial| run(views, set.image_px, radial);
    let all_lens = of(&set.views, 2);
    let by_views = match &all_lens {
        Ok(reference) => curve(&quads, set.image_px, reference.camera.fx_px, seed),
        Err(_) => vec![],
    };
    let figures = |result: Result<CameraCalibration, CalibrateError>| {
        result.map(|c| found(&c)).map_err(|error| error.to_string())
    };
    RealSet {
        name: set.name.clone(),
        views: set.views.len(),
        points: set.views.first().map_or(0, |v| v.plane_m.len()),
        stated: set.stated.clone(),
        all_pinhole: figures(of(&set.views, 0)),
        all_lens: figures(all_lens),
        quad_pinhole: figures(of(&quads, 0)),
        quad_lens: figures(of(&quads, 1)),
        by_views,
    }
}

fn run(
    views: &[PlanarView],
    image_px: [usize; 2],
    radial: usize,
) -> Result<CameraCalibration, CalibrateError> {
    calibrate(
        views,
        image_px,
        &CalibrateParams { radial, centre_sigma: CENTRE_SIGMA, ..CalibrateParams::default() },
    )
}

fn found(c: &CameraCalibration) -> CalibrationFigures {
    CalibrationFigures {
        fx_px: c.camera.fx_px,
        fx_sigma_px: c.fx_sigma_px(),
        cx_px: c.camera.cx_px,
        cy_px: c.camera.cy_px,
        radial: c.camera.distortion.coefficients().iter().take(2).copied().collect(),
        rms_px: c.rms_px,
        orientations: c.orientations,
    }
}

/// Median error over random subsets of the views.
fn curve(quads: &[PlanarView], image_px: [usize; 2], reference_px: f64, seed: u64) -> Vec<OfViews> {
    let mut made = vec![];
    for n in [4, 5, 6, 8, 10, 12, 15, 20].into_iter().filter(|n| *n <= quads.len()) {
        let mut errors = vec![];
        for draw in 0..SUBSETS {
            let mut random = Random::new(mixed(&[seed, n as u64, draw as u64]));
            let mut order: Vec<usize> = (0..quads.len()).collect();
            for i in 0..n {
                let j = i + (random.unit() * (order.len() - i) as f64) as usize;
                order.swap(i, j.min(quads.len() - 1));
            }
            let views: Vec<PlanarView> = order[..n].iter().map(|&i| quads[i].clone()).collect();
            errors.extend(run(&views, image_px, 1).ok().map(|c| (c.camera.fx_px / reference_px - 1.0).abs()));
        }
        made.extend(median(&mut errors).map(|median| OfViews { views: n, median }));
    }
    made
}

impl RealSet {
    /// Lines for people.
    pub(super) fn lines(&self) -> Vec<String> {
        let mut lines = vec![format!("  {}: {} views of {} points", self.name, self.views, self.points)];
        let ways = [
            ("all points, pinhole", &self.all_pinhole, false),
            ("all points, lens", &self.all_lens, true),
            ("one quad, pinhole", &self.quad_pinhole, false),
            ("one quad, lens", &self.quad_lens, true),
        ];
        for (what, result, lens) in ways {
            lines.push(match result {
                Ok(f) => format!("    {what:<20} {}{}", words(f), self.against(f.fx_px, lens)),
                Err(why) => format!("    {what:<20} {why}"),
            });
        }
        let of = |p: &OfViews| format!("{}: {:.2}", p.views, 100.0 * p.median);
        let points: Vec<String> = self.by_views.iter().map(of).collect();
        if !points.is_empty() {
            lines
                .push(format!("    one quad, lens, by views: median error in percent {}", points.join("  ")));
        }
        lines
    }

    /// Difference from all points and from the stated calibration of the same camera model, in
    /// percent.
    fn against(&self, fx_px: f64, lens: bool) -> String {
        let all = if lens { &self.all_lens } else { &self.all_pinhole };
        let off = |reference: f64| 100.0 * (fx_px / reference - 1.0);
        let own = all.iter().map(|all| format!("; {:+.2} % of all points", off(all.fx_px)));
        let stated = self.stated.iter().filter(|s| s.lens == lens);
        let stated = stated.map(|s| format!(", {:+.2} % of {} ({:.1})", off(s.fx_px), s.file, s.fx_px));
        own.chain(stated).collect()
    }
}

fn words(f: &CalibrationFigures) -> String {
    let sigma = f.fx_sigma_px.map_or(String::new(), |s| format!(" +- {s:.1}"));
    let radial: Vec<String> = f.radial.iter().map(|k| format!(" {k:.3}")).collect();
    format!(
        "fx {:.1}{sigma}, centre ({:.1}, {:.1}),{} rms {:.2} px, {} orientations",
        f.fx_px,
        f.cx_px,
        f.cy_px,
        if radial.is_empty() { String::new() } else { format!(" k{},", radial.concat()) },
        f.rms_px,
        f.orientations
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point2;

    #[test]
    fn a_board_without_noise_is_calibrated_exactly_by_its_quad() {
        // Oracle: synthetic views of a 2 x 2 board that is the poster's quad alone: all points are
        // the quad.
        let mut random = Random::new(5);
        let camera = vision::frame::Intrinsics {
            fx_px: 800.0,
            fy_px: 800.0,
            cx_px: 630.0,
            cy_px: 470.0,
            distortion: vision::frame::Distortion::None,
            sigmas: None,
        };
        let views: Vec<_> =
            (0..12).map(|_| super::super::synthetic::view(&camera, 0.0, &mut random)).collect();
        assert_eq!(views[0].plane_m[0], Point2::new(-0.42, 0.595));
        let stated = vec![Stated { file: "own".into(), fx_px: 808.0, lens: false }];
        let set = Set { name: "board".into(), image_px: [1280, 960], views, corners: [0, 1, 2, 3], stated };
        let board = evaluated(&set, 1);
        let found = board.quad_pinhole.as_ref().unwrap();
        assert!((found.fx_px - 800.0).abs() < 0.01, "{found:?}");
        assert!(board.by_views.iter().all(|p| p.median < 1e-3), "{:?}", board.by_views);
        let lines = board.lines().join("\n");
        assert!(
            lines.contains("-0.99 % of own (808.0)") && lines.contains("+0.00 % of all points"),
            "{lines}"
        );
    }
}
