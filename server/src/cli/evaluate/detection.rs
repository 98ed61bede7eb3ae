//! `waymark evaluate detection`: the detector against labelled pictures. Recall at two overlaps, false quads, corner
//! error, time; per state and stratum. The detector runs on one thread, pictures one after the other.

use super::{
    rendered,
    truth::{QuadState, Truth, TruthImage},
};
use crate::cli::{pictures, scratch, screen};
use serde::Serialize;
use sim::views::ViewsParams;
use std::{collections::BTreeMap, path::PathBuf, time::Instant};
use vision::{
    detect::{
        detect,
        quads::{Corners, Quad, QuadKind},
    },
    geometry::polygon,
    params::DetectParams,
    trace::NoTrace,
};

/// Overlap from which a detected quad belongs to a labelled one at all.
const IOU_SAME: f64 = 0.5;
/// A detection inside a labelled quad by this share of its area, and covering at least [`INNER_AREA`] of it, is an
/// inner border of the same thing (mat, canvas).
const INNER_SHARE: f64 = 0.97;
const INNER_AREA: f64 = 0.25;

/// `waymark evaluate detection`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Folders in the evaluation format (each with a truth.json), or `corridor` for rendered views with exact truth.
    #[arg(required = true)]
    sets: Vec<PathBuf>,
    /// Keep the rendered corridor in this folder: a set like any other.
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
    /// Rendered views of the corridor.
    #[arg(long, default_value_t = 300, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    views: u32,
    /// The rendered views follow from it.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Leave out labelled quads with a side shorter than this, in pixels.
    #[arg(long, default_value_t = 0.0)]
    min_side_px: f64,
    /// End with one JSON object per set instead of a table.
    #[arg(long)]
    json: bool,
    /// Detection parameters, JSON; only what differs from the defaults, such as {"quads": {"grouping": "relaxation"}}.
    #[arg(long, value_name = "FILE")]
    params: Option<PathBuf>,
    /// Name every labelled quad that was missed and every false one.
    #[arg(long)]
    misses: bool,
}

/// Counts of one group of labelled quads.
#[derive(Debug, Default, Clone, Serialize)]
#[expect(clippy::struct_field_names, reason = "the names of the evaluation format")]
pub(crate) struct Recall {
    pub(crate) quads: usize,
    pub(crate) recall_70: f64,
    pub(crate) recall_85: f64,
    #[serde(skip)]
    found_70: usize,
    #[serde(skip)]
    found_85: usize,
}

impl Recall {
    fn count(&mut self, iou: f64) {
        self.quads += 1;
        self.found_70 += usize::from(iou >= 0.7);
        self.found_85 += usize::from(iou >= 0.85);
        self.recall_70 = self.found_70 as f64 / self.quads as f64;
        self.recall_85 = self.found_85 as f64 / self.quads as f64;
    }
}

/// The figures of one set.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Report {
    set: String,
    pub(crate) images: usize,
    pub(crate) quads: usize,
    pub(crate) recall_70: f64,
    pub(crate) recall_85: f64,
    /// Over images whose labels are complete; `null` where there is none.
    pub(crate) false_per_image: Option<f64>,
    /// Median over matched quads of the mean distance of their four corners; `null` without a match.
    pub(crate) corner_error_px: Option<f64>,
    pub(crate) ms_per_image: f64,
    false_quads: usize,
    images_complete: usize,
    unreadable: usize,
    by_group: BTreeMap<String, Recall>,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let params = pictures::detect_params(args.params.as_deref())?;
    for folder in &args.sets {
        let scratch = scratch::Folder::new("views")?;
        let rendered = folder.as_os_str() == rendered::CORRIDOR && !folder.is_dir();
        let folder = if rendered { args.keep.as_deref().unwrap_or(scratch.path()) } else { folder };
        if rendered {
            let views = args.views as usize;
            rendered::write_corridor(folder, &ViewsParams { seed: args.seed, views, ..Default::default() })?;
        }
        let truth = Truth::read(folder)?;
        let report = evaluate(&truth, args, &params);
        if args.json {
            screen::say(&serde_json::to_string(&report)?);
        } else {
            screen::say(&table(&report));
        }
    }
    Ok(())
}

fn evaluate(truth: &Truth, args: &Args, params: &DetectParams) -> Report {
    let mut report = Report { set: truth.name.clone(), ..Report::default() };
    let mut full = Recall::default();
    let mut corner_errors_px = Vec::new();
    let mut work_ms = 0.0;
    let progress = screen::progress(truth.images.len(), "detecting");
    for image in &truth.images {
        progress.inc(1);
        if image.whole_image {
            continue; // a crop has no border to find
        }
        let gray = match pictures::read(&image.path) {
            Ok(gray) => gray,
            Err(error) => {
                report.unreadable += 1;
                screen::complain(&format!("{}: {error}", image.path.display()));
                continue;
            }
        };
        let start = Instant::now();
        let mut found = detect(&gray, params, &mut NoTrace);
        work_ms += start.elapsed().as_secs_f64() * 1e3;
        // Three-sided sets are for topology only: they neither find nor falsify a quad.
        found.retain(|quad| quad.kind == QuadKind::Full);
        report.images += 1;
        for labelled in &image.quads {
            if !labelled.counted || labelled.corners.min_side_px() < args.min_side_px {
                continue;
            }
            let (iou, nearest) = best(&labelled.corners, &found);
            let group =
                report.by_group.entry(format!("{} / {}", labelled.state.name(), image.stratum)).or_default();
            group.count(iou);
            if let Some(class) = &labelled.class {
                report.by_group.entry(format!("{} / {class}", labelled.state.name())).or_default().count(iou);
            }
            if labelled.state == QuadState::Full {
                full.count(iou);
                if let (true, Some(quad)) = (iou >= 0.7, nearest) {
                    corner_errors_px.push(corner_error_px(&labelled.corners, &quad.corners_px));
                }
            }
            if args.misses && iou < 0.7 {
                screen::complain(&format!(
                    "missed {} {:?} best IoU {iou:.2}",
                    image.file,
                    labelled.corners.points()
                ));
            }
        }
        if image.quads_complete {
            report.images_complete += 1;
            for quad in false_quads(image, &found) {
                report.false_quads += 1;
                if args.misses {
                    screen::complain(&format!("false {} {:?}", image.file, quad.corners_px.points()));
                }
            }
        }
    }
    progress.finish_and_clear();
    report.quads = full.quads;
    report.recall_70 = full.recall_70;
    report.recall_85 = full.recall_85;
    report.ms_per_image = work_ms / (report.images.max(1)) as f64;
    report.false_per_image =
        (report.images_complete > 0).then(|| report.false_quads as f64 / report.images_complete as f64);
    report.corner_error_px = median(&mut corner_errors_px);
    report
}

/// The detection that overlaps most, with its overlap.
pub(crate) fn best<'a>(labelled: &Corners, found: &'a [Quad]) -> (f64, Option<&'a Quad>) {
    found
        .iter()
        .map(|quad| (polygon::iou(labelled.points(), quad.corners_px.points()), Some(quad)))
        .fold((0.0, None), |best, next| if next.0 > best.0 { next } else { best })
}

fn false_quads<'a>(image: &TruthImage, found: &'a [Quad]) -> Vec<&'a Quad> {
    found
        .iter()
        .filter(|quad| {
            let other = |o: &Corners| polygon::iou(o.points(), quad.corners_px.points()) >= IOU_SAME;
            !image.others.iter().any(other)
                && !image.quads.iter().any(|labelled| {
                    let (a, b) = (labelled.corners.points(), quad.corners_px.points());
                    let shared = polygon::intersection_area(a, b);
                    let area = quad.corners_px.area_px2();
                    polygon::iou(a, b) >= IOU_SAME
                        || (shared >= INNER_SHARE * area && area >= INNER_AREA * labelled.corners.area_px2())
                })
        })
        .collect()
}

/// Mean distance of the four corners, for the best of the four start corners.
fn corner_error_px(labelled: &Corners, found: &Corners) -> f64 {
    (0..4)
        .map(|shift| {
            let pairs = labelled.points().iter().zip(found.rotated(shift).points().to_owned());
            pairs.map(|(a, b)| (a - b).norm()).sum::<f64>() / 4.0
        })
        .fold(f64::INFINITY, f64::min)
}

pub(crate) fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    (n > 0).then(|| f64::midpoint(values[(n - 1) / 2], values[n / 2]))
}

fn table(report: &Report) -> String {
    use std::fmt::Write as _;
    let mut text = format!(
        "{}: {} images, {} quads fully in view\n  recall at IoU 0.7   {:.3}\n  recall at IoU 0.85  {:.3}\n",
        report.set, report.images, report.quads, report.recall_70, report.recall_85
    );
    let number = |value: Option<f64>| value.map_or("not labelled".to_owned(), |v| format!("{v:.2}"));
    // Writing to a String cannot fail.
    writeln!(text, "  false per image     {}", number(report.false_per_image)).ok();
    writeln!(text, "  corner error        {} px (median)", number(report.corner_error_px)).ok();
    writeln!(text, "  time                {:.1} ms an image, one thread", report.ms_per_image).ok();
    for (group, recall) in &report.by_group {
        writeln!(
            text,
            "  {group}: {} quads, {:.3} / {:.3}",
            recall.quads, recall.recall_70, recall.recall_85
        )
        .ok();
    }
    text.trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corners(x: f64, y: f64, w: f64, h: f64) -> Corners {
        Corners::try_from([[x, y], [x + w, y], [x + w, y + h], [x, y + h]]).unwrap()
    }

    #[test]
    fn corner_error_does_not_depend_on_the_start_corner() {
        let a = corners(0.0, 0.0, 100.0, 50.0);
        let b = corners(3.0, 4.0, 100.0, 50.0).rotated(2);
        assert!((corner_error_px(&a, &b) - 5.0).abs() < 1e-12);
    }

    #[test]
    fn median_of_even_and_odd() {
        assert_eq!(median(&mut []), None);
        assert!((median(&mut [3.0, 1.0, 2.0]).unwrap() - 2.0).abs() < 1e-12);
        assert!((median(&mut [4.0, 1.0, 2.0, 3.0]).unwrap() - 2.5).abs() < 1e-12);
    }
}
