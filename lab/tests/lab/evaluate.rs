//! Claim: the figures of `waymark-lab evaluate` are what a recount by other means gives, and a
//! folder without truth is refused by name.

use crate::{LONGEST, lab};
use serde_json::Value;
use sim::{
    building::{Building, LandmarkKind},
    corridor::CorridorParams,
    export::{DataSet, QuadState},
    lesson::LessonParams,
};
use std::{ffi::OsString, fs, path::Path, sync::Arc};
use tempfile::TempDir;
use tests::{
    command::{Run, waymark},
    scenes,
};

type Quad = [[f64; 2]; 4];

fn evaluate(what: &str, folder: &Path) -> Run {
    let args = ["evaluate", what, "--json"].into_iter().map(OsString::from);
    lab(args.chain([folder.into()]))
}

/// Whether a point is inside a quad, clockwise on screen.
fn inside(quad: &Quad, x: f64, y: f64) -> bool {
    (0..4).all(|i| {
        let ([ax, ay], [bx, by]) = (quad[i], quad[(i + 1) % 4]);
        (bx - ax) * (y - ay) - (by - ay) * (x - ax) >= 0.0
    })
}

/// Areas of a, of b and of what they share, by counting points: nothing of the program's own
/// geometry.
fn areas(a: &Quad, b: &Quad) -> [f64; 3] {
    let spread = |axis: usize| {
        let values = || a.iter().chain(b).map(|c| c[axis]);
        (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max))
    };
    let ((left, right), (top, bottom)) = (spread(0), spread(1));
    let (steps, mut counts) = (400, [0_u32; 3]);
    for row in 0..steps {
        for column in 0..steps {
            let at =
                |low: f64, high: f64, i: u32| low + (high - low) * (f64::from(i) + 0.5) / f64::from(steps);
            let (x, y) = (at(left, right, column), at(top, bottom, row));
            let (in_a, in_b) = (inside(a, x, y), inside(b, x, y));
            counts[0] += u32::from(in_a);
            counts[1] += u32::from(in_b);
            counts[2] += u32::from(in_a && in_b);
        }
    }
    counts.map(|n| f64::from(n) * (right - left) * (bottom - top) / f64::from(steps * steps))
}

fn iou(a: &Quad, b: &Quad) -> f64 {
    let [a, b, shared] = areas(a, b);
    shared / (a + b - shared)
}

/// Mean distance of corresponding corners, for the best start corner.
fn corner_error_px(a: &Quad, b: &Quad) -> f64 {
    let mean = |shift: usize| {
        (0..4).map(|i| (a[i][0] - b[(i + shift) % 4][0]).hypot(a[i][1] - b[(i + shift) % 4][1])).sum::<f64>()
            / 4.0
    };
    (0..4).map(mean).fold(f64::INFINITY, f64::min)
}

/// Quads that `waymark detect` finds in every picture of a set.
fn detected(folder: &Path, set: &DataSet) -> Vec<Vec<Quad>> {
    let paths = set.images.iter().map(|i| folder.join(&i.file).into_os_string());
    let run = waymark(["detect", "--json"].into_iter().map(OsString::from).chain(paths), LONGEST);
    let quads = |line: &Value| {
        let quads = line["quads"].as_array().expect("quads").iter();
        // Sets of three sides are left out of all figures.
        quads
            .filter(|q| q["kind"] == "full")
            .map(|q| serde_json::from_value(q["corners"].clone()).expect("corners"))
            .collect()
    };
    run.json_lines().iter().map(quads).collect()
}

/// The figures as docs/EVALUATION.md defines them.
#[derive(Debug, Default)]
struct Recount {
    quads: usize,
    found: [usize; 2],
    false_quads: usize,
    errors_px: Vec<f64>,
}

fn recount(set: &DataSet, found: &[Vec<Quad>]) -> Recount {
    let mut sums = Recount::default();
    for (image, found) in set.images.iter().zip(found) {
        let labelled: Vec<Quad> = image.quads.iter().map(|q| q.corners.into()).collect();
        for (quad, truth) in image.quads.iter().zip(&labelled) {
            if quad.state != QuadState::Full {
                continue;
            }
            sums.quads += 1;
            let best = found.iter().max_by(|a, b| iou(truth, a).total_cmp(&iou(truth, b)));
            let overlap = best.map_or(0.0, |b| iou(truth, b));
            for (count, least) in sums.found.iter_mut().zip([0.7, 0.85]) {
                *count += usize::from(overlap >= least);
            }
            if overlap >= 0.7 {
                sums.errors_px.extend(best.map(|b| corner_error_px(truth, b)));
            }
        }
        let real = |quad: &&Quad| {
            labelled.iter().any(|truth| {
                let [truth, quad, shared] = areas(truth, quad);
                shared / (truth + quad - shared) >= 0.5 || (shared >= 0.97 * quad && quad >= 0.25 * truth)
            })
        };
        sums.false_quads += found.iter().filter(|q| !real(q)).count();
    }
    sums.errors_px.sort_by(f64::total_cmp);
    sums
}

fn close(report: &Value, key: &str, expected: f64) {
    let value = report[key].as_f64().unwrap_or_else(|| panic!("{key} of {report}"));
    assert!((value - expected).abs() < 1e-9, "{key}: {value}, recounted {expected}");
}

#[test]
fn detection_figures_are_what_a_recount_gives() {
    let folder = TempDir::new().expect("a temporary directory");
    let building = Arc::new(Building::corridor(6));
    let views = scenes::views(&building, &LessonParams { views: 1, ..LessonParams::default() });
    let mut set = scenes::write_set(folder.path(), &building, &views, &[], 20.0);
    // Labels that differ from the truth, so that some are missed and some quads are false.
    for (image, share) in set.images.iter_mut().zip([0.1, 0.4, 0.6]) {
        for quad in &mut image.quads {
            let corners: Quad = quad.corners.into();
            let shift_px = share * (corners[1][0] - corners[0][0]);
            let moved = corners.map(|[x, y]| [x + shift_px, y]);
            quad.corners = moved.try_into().expect("still a quad");
        }
    }
    scenes::save(folder.path(), &set);

    let run = evaluate("detection", folder.path());
    assert_eq!((run.status, run.stdout.lines().count()), (0, 1), "{run:?}");
    let report = run.last_json();
    let sums = recount(&set, &detected(folder.path(), &set));
    let [found_70, found_85] = sums.found;
    let telling = sums.quads > found_70 && found_70 > found_85 && found_85 > 0 && sums.false_quads > 0;
    assert!(telling, "some figures are trivial: {sums:?}");
    assert_eq!(report["images"].as_u64(), Some(set.images.len() as u64), "{report}");
    assert_eq!(report["quads"].as_u64(), Some(sums.quads as u64), "{report}");
    close(&report, "recall_70", sums.found[0] as f64 / sums.quads as f64);
    close(&report, "recall_85", sums.found[1] as f64 / sums.quads as f64);
    close(&report, "false_per_image", sums.false_quads as f64 / set.images.len() as f64);
    let n = sums.errors_px.len();
    close(&report, "corner_error_px", f64::midpoint(sums.errors_px[(n - 1) / 2], sums.errors_px[n / 2]));
    assert!(report["ms_per_image"].as_f64().is_some_and(|ms| ms > 0.0), "{report}");
}

#[test]
fn labels_decide_what_is_found_and_what_is_false() {
    let folder = TempDir::new().expect("a temporary directory");
    let building = Arc::new(Building::corridor(6));
    let views = scenes::views(&building, &LessonParams { views: 1, ..LessonParams::default() });
    let mut set = scenes::write_set(folder.path(), &building, &views[..3], &[], 20.0);
    // Without any label everything found is false; where labels are not complete nothing can be
    // false.
    for image in &mut set.images {
        image.quads.clear();
    }
    set.images[2].quads_complete = false;
    scenes::save(folder.path(), &set);
    let report = evaluate("detection", folder.path()).last_json();
    let found = detected(folder.path(), &set);
    let false_quads = found[0].len() + found[1].len();
    assert!(false_quads > 0, "nothing is detected: the case tests nothing");
    close(&report, "false_per_image", false_quads as f64 / 2.0);
    assert_eq!((report["quads"].as_u64(), report["images"].as_u64()), (Some(0), Some(3)), "{report}");
    assert!(report["corner_error_px"].is_null(), "{report}");
}

#[test]
fn a_rendered_set_gives_the_same_figures_from_its_folder() {
    let folder = TempDir::new().expect("a temporary directory");
    let folder_of_views = folder.path().join("views");
    let mut args: Vec<OsString> =
        ["evaluate", "detection", "corridor", "--views", "4", "--json", "--keep"].map(Into::into).into();
    args.push(folder_of_views.clone().into());
    let (plot, worst) = (folder.path().join("plot.svg"), folder.path().join("worst"));
    args.extend(["--compare", "relaxation", "--worst", "2", "--plot"].map(Into::into));
    args.extend([plot.clone().into(), "--draw".into(), worst.clone().into()]);
    let run = lab(args);
    let [rendered, paper] = run.json_lines().try_into().expect("a line each");
    assert_eq!((&rendered["params"], &paper["params"]), (&"default".into(), &"relaxation".into()));
    assert_eq!(rendered["worst"].as_array().map(Vec::len), Some(2), "{run:?}");
    assert!(fs::read_to_string(plot).expect("the plot").contains("relaxation"));
    for name in ["default", "relaxation"] {
        let pictures = fs::read_dir(worst.join(name)).expect("a folder each");
        let open =
            |p: std::io::Result<fs::DirEntry>| image::open(p.expect("an entry").path()).expect("a picture");
        assert_eq!(pictures.map(open).filter(|p| p.width() >= 640 && p.height() > 480).count(), 2);
    }
    let from_folder = evaluate("detection", &folder_of_views).last_json();
    for key in ["set", "images", "quads", "recall_70", "recall_85", "false_per_image", "corner_error_px"] {
        assert_eq!(rendered[key], from_folder[key], "{key}");
    }
    let text = fs::read_to_string(folder_of_views.join("truth.json")).expect("truth.json");
    let set: DataSet = serde_json::from_str(&text).expect("the evaluation format");
    let counted = set.images.iter().flat_map(|i| &i.quads).filter(|q| q.counted).count();
    assert_eq!(rendered["quads"].as_u64(), Some(counted as u64), "{rendered}");
    assert!(counted >= 3 && set.images.iter().any(|i| !i.others.is_empty()));
}

#[test]
fn trained_networks_are_parameters_that_can_be_evaluated() {
    let folder = TempDir::new().expect("a temporary directory");
    let (networks, source) = (folder.path().join("networks.json"), folder.path().join("learnt.rs"));
    let mut args: Vec<OsString> = [
        "train",
        "detector",
        "corridor",
        "--views",
        "8",
        "--scenes",
        "8",
        "--held-out-views",
        "4",
        "--steps",
        "20",
        "20",
        "--json",
        "--out",
    ]
    .map(Into::into)
    .into();
    args.extend([networks.clone().into(), "--rust".into(), source.clone().into()]);
    let run = lab(args);
    let report = run.last_json();
    assert!(report["images"].as_u64().is_some_and(|n| (12..=16).contains(&n)), "{report}");
    assert!(report["sides"].as_u64().is_some_and(|n| n > 12), "{report}");
    assert!(report["objects"].as_u64().is_some_and(|n| n > 4), "{report}");
    assert_eq!(report["results"].as_array().map(Vec::len), Some(3), "{report}");
    let sets = report["detection"].as_array().expect("figures of detection");
    let named = |name: &str| sets.iter().any(|s| s["set"] == name && s["quads"].as_u64() > Some(0));
    assert!(["corridor", "scenes", "corridor, seed 1", "scenes, seed 1"].into_iter().all(named), "{report}");
    assert!(fs::read_to_string(source).expect("the source").contains("const QUAD_CLASSIFIER_LINEAR: [f64; "));
    let mut args: Vec<OsString> =
        ["evaluate", "detection", "corridor", "--views=2", "--params"].map(Into::into).into();
    args.push(networks.into());
    let evaluated = lab(args);
    assert!(evaluated.status == 0 && evaluated.stdout.contains("networks parameters"), "{evaluated:?}");
}

#[test]
fn a_folder_that_is_no_data_set_is_refused_by_name() {
    let folder = TempDir::new().expect("a temporary directory");
    let refused = |what: &str| {
        let run = evaluate(what, folder.path());
        let named = run.stderr.contains(&folder.path().display().to_string());
        assert_eq!((run.status, run.stdout.as_str(), named), (1, "", true), "{what}: {run:?}");
        assert_eq!(run.stderr.lines().count(), 1, "{what}: {run:?}");
        run.stderr
    };
    for what in ["detection", "recognition"] {
        assert!(refused(what).contains("cannot read"), "{what}");
    }
    fs::write(folder.path().join("truth.json"), r#"{"name": "x", "images": [{}]}"#).expect("a file");
    for what in ["detection", "recognition"] {
        assert!(refused(what).contains("missing field `file`"), "{what}: says what is wrong");
    }
    fs::write(folder.path().join("truth.json"), r#"{"name": "x", "images": []}"#).expect("a file");
    assert!(refused("recognition").contains("nothing to teach"));
}

#[test]
fn recognition_names_the_taught_and_no_distractor() {
    let folder = TempDir::new().expect("a temporary directory");
    let params = CorridorParams { posters: 10, first_poster: 500, ..CorridorParams::default() };
    let building = Arc::new(Building::corridor_with(&params, 8));
    let taught: Vec<String> = building.posters().take(6).map(|p| p.name.clone()).collect();
    let views =
        LessonParams { views: 2, max_view_angle_rad: 0.7, distance_m: [1.3, 2.6], ..LessonParams::default() };
    let set = scenes::write_set(folder.path(), &building, &scenes::views(&building, &views), &taught, 40.0);
    let quads = || set.images.iter().flat_map(|i| &i.quads);
    let known = quads().filter(|q| q.landmark.is_some()).count() as u64;
    let distractors = quads().filter(|q| q.landmark.is_none()).count() as u64;
    let posters = quads().filter(|q| q.landmark.is_none() && q.kind == LandmarkKind::Poster).count();
    assert!(known >= 8 && posters >= 4, "{known} known, {posters} unknown posters: too few");

    let run = evaluate("recognition", folder.path());
    assert_eq!((run.status, run.stdout.lines().count()), (0, 1), "{run:?}");
    let report = run.last_json();
    let count = |key: &str| report[key].as_u64().unwrap_or_else(|| panic!("{key} of {report}"));
    assert_eq!((count("taught"), count("images")), (6, set.images.len() as u64), "{report}");
    assert_eq!(
        (count("wrong"), count("distractors_accepted"), count("unlabelled_accepted")),
        (0, 0, 0),
        "{report}"
    );
    assert_eq!(count("right") + count("missed"), known, "{report}");
    assert_eq!(count("distractors_refused"), distractors, "{report}");
    assert!(3 * count("right") >= known, "{report}");
    assert!(report["ms_per_image"].as_f64().is_some_and(|ms| ms > 0.0), "{report}");
}

/// The robots drive by their estimate in a map of their own.
#[test]
fn robots_drive_by_their_own_estimate_from_an_unknown_start() {
    let folder = TempDir::new().expect("a temporary directory");
    let plot = folder.path().join("drive.svg");
    let mut args: Vec<OsString> = [
        "evaluate",
        "navigation",
        "--drives=2",
        "--length-m=10",
        "--posters=3",
        "--rate-hz=2",
        "--json",
        "--plot",
    ]
    .map(Into::into)
    .into();
    args.push(plot.clone().into());
    let run = lab(args);
    assert_eq!((run.status, run.stdout.lines().count()), (0, 1), "{run:?}");
    let report = run.last_json();
    let number = |path: &str| {
        report.pointer(path).and_then(Value::as_f64).unwrap_or_else(|| panic!("{path} of {report}"))
    };
    let whole = ["/drives", "/arrived", "/never_fixed", "/false_matches"].map(number);
    assert_eq!(whole.map(|x| x as i64), [2, 2, 0, 0], "{report}");
    assert!(number("/corrections_fewest") >= 6.0 && number("/recognised") >= 6.0, "{report}");
    // Odometry alone drifts; the fused pose does not.
    assert!(number("/along_m/p95") < 0.15, "{report}");
    assert!(number("/along_m/median") < 0.5 * number("/odometry_along_m/median"), "{report}");
    assert!(number("/off_path_m/worst") < 0.2, "{report}");
    let svg = fs::read_to_string(plot).expect("the plot");
    assert_eq!(svg.matches("<polyline").count(), 4, "three trajectories and an error");
}
