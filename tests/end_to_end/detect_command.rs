//! Claim: `waymark detect` prints one JSON line for every picture it can read and one error line
//! for every other.

use image::{DynamicImage, ExtendedColorType, ImageFormat, Luma, RgbImage, codecs::jpeg::JpegEncoder};
use serde_json::Value;
use sim::{building::Building, lesson::LessonParams, truth::ViewState};
use std::{
    collections::BTreeMap,
    ffi::OsString,
    fs,
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};
use tempfile::TempDir;
use tests::{
    command::{Run, waymark},
    scenes,
};
use vision::geometry::{Corners, polygon};

const LONGEST: Duration = Duration::from_mins(2);

fn detect(paths: &[PathBuf]) -> Run {
    let args = ["detect", "--json"].into_iter().map(OsString::from);
    waymark(args.chain(paths.iter().map(OsString::from)), LONGEST)
}

/// A bright rectangle on grey, to be detected in every format.
fn card(width: u32, height: u32) -> RgbImage {
    RgbImage::from_fn(width, height, |u, v| {
        let inside = u > width / 4 && u < 3 * width / 4 && v > height / 4 && v < 3 * height / 4;
        image::Rgb(if inside { [230, 220, 200] } else { [60, 70, 80] })
    })
}

/// One readable picture of each kind; width and height by file name.
fn write_pictures(folder: &Path) -> BTreeMap<PathBuf, (u64, u64)> {
    let rgb = DynamicImage::from(card(320, 240));
    let deep = rgb.to_luma16();
    assert!(deep.pixels().any(|Luma([grey])| *grey > 255));
    let pictures = [
        ("grey.png", DynamicImage::from(rgb.to_luma8()), ImageFormat::Png),
        ("grey.jpg", DynamicImage::from(rgb.to_luma8()), ImageFormat::Jpeg),
        ("rgb.png", rgb.clone(), ImageFormat::Png),
        ("rgb.jpeg", rgb.clone(), ImageFormat::Jpeg),
        ("deep.png", DynamicImage::from(deep), ImageFormat::Png),
        ("dot.png", DynamicImage::new_luma8(1, 1), ImageFormat::Png),
        ("dot.jpg", DynamicImage::new_luma8(1, 1), ImageFormat::Jpeg),
        ("large.png", DynamicImage::new_luma8(4000, 3000), ImageFormat::Png),
    ];
    let mut sizes = BTreeMap::new();
    for (name, picture, format) in pictures {
        let path = folder.join(name);
        picture.save_with_format(&path, format).expect("a picture");
        sizes.insert(path, (u64::from(picture.width()), u64::from(picture.height())));
    }
    // Flat, and larger than any frame of a robot.
    let (path, flat) = (folder.join("large.jpg"), vec![128; 4000 * 3000]);
    let file = fs::File::create(&path).expect("a file");
    JpegEncoder::new(file).encode(&flat, 4000, 3000, ExtendedColorType::L8).expect("a picture");
    sizes.insert(path, (4000, 3000));
    sizes
}

/// Files that are no pictures or are damaged, and a missing one.
fn write_bad(folder: &Path) -> Vec<PathBuf> {
    let read = |name: &str| fs::read(folder.join(name)).expect("written before");
    let (png, jpeg) = (read("rgb.png"), read("rgb.jpeg"));
    let mut flipped = png.clone();
    // In the middle of the pixels: the checksum does not fit.
    flipped[png.len() / 2] ^= 0x55;
    let mut huge = png.clone();
    huge[16..24].copy_from_slice(&[0, 0, 0xFF, 0xFF, 0, 0, 0xFF, 0xFF]);
    let files = [
        ("half.png", &png[..png.len() / 2]),
        ("half.jpg", &jpeg[..jpeg.len() / 2]),
        ("start.jpg", &jpeg[..3]),
        ("flipped.png", &flipped),
        ("huge.png", &huge),
        ("empty.png", &[]),
        ("text.txt", b"This is no picture.\nNot in its second line either.\n"),
    ];
    fs::create_dir(folder.join("no-pictures")).expect("a folder");
    let mut bad = vec![folder.join("missing.jpg"), folder.join("no-pictures")];
    for (name, bytes) in files {
        bad.push(folder.join(name));
        fs::write(folder.join(name), bytes).expect("a file");
    }
    bad
}

fn corners(quad: &Value) -> Corners {
    serde_json::from_value(quad["corners"].clone()).unwrap_or_else(|e| panic!("{e}: {quad}"))
}

fn check_line(line: &Value, (width, height): (u64, u64)) {
    assert_eq!((line["width"].as_u64(), line["height"].as_u64()), (Some(width), Some(height)), "{line}");
    for quad in line["quads"].as_array().expect("quads") {
        corners(quad);
        assert!(matches!(quad["kind"].as_str(), Some("full" | "three_sided")), "{quad}");
        assert!(quad["score"].as_f64().is_some_and(|s| (0.0..=1.0).contains(&s)), "{quad}");
    }
    let timings = line["timings_ms"].as_object().expect("timings_ms");
    let ms: Vec<f64> = timings.values().filter_map(Value::as_f64).collect();
    assert!(ms.len() == timings.len() && ms.iter().sum::<f64>() > 0.0, "{line}");
}

#[test]
fn detect_reads_every_format_and_names_every_other_file() {
    let folder = TempDir::new().expect("a temporary directory");
    let sizes = write_pictures(folder.path());
    let bad = write_bad(folder.path());

    // Good and bad in turn: a bad one must not stop the next.
    let mut asked: Vec<PathBuf> = sizes.keys().cloned().collect();
    for (place, path) in (0..).step_by(2).zip(&bad) {
        asked.insert(place, path.clone());
    }
    let run = detect(&asked);
    assert_eq!(run.status, 1, "{run:?}");
    let complaints: Vec<&str> = run.stderr.lines().collect();
    assert_eq!(complaints.len(), bad.len(), "{complaints:#?}");
    for (path, complaint) in bad.iter().zip(&complaints) {
        let start = format!("waymark: {}: ", path.display());
        assert!(complaint.starts_with(&start), "`{complaint}` does not begin with `{start}`");
    }
    let lines = run.json_lines();
    assert_eq!(lines.len(), sizes.len(), "{run:?}");
    for (line, (path, size)) in lines.iter().zip(&sizes) {
        assert_eq!(line["image"].as_str(), path.to_str(), "in the order asked");
        check_line(line, *size);
        // The same card in all formats, nothing in the flat ones.
        let quads = line["quads"].as_array().expect("quads");
        if size.0 == 320 {
            let card = [[80.5, 60.5], [239.5, 60.5], [239.5, 179.5], [80.5, 179.5]];
            let card = Corners::try_from(card).expect("corners");
            let best = quads.iter().map(|q| polygon::iou(corners(q).points(), card.points()));
            assert!(best.fold(0.0, f64::max) > 0.95, "{line}");
        } else {
            assert!(quads.is_empty(), "{line}");
        }
    }

    let fine = detect(&[asked[1].clone(), asked[3].clone()]);
    assert_eq!((fine.status, fine.stderr.as_str()), (0, ""), "{fine:?}");
    assert_eq!(fine.json_lines().len(), 2);
}

#[test]
fn detect_finds_a_rendered_poster() {
    let folder = TempDir::new().expect("a temporary directory");
    let building = Arc::new(Building::corridor(5));
    let params = LessonParams { views: 1, max_view_angle_rad: 0.6, ..LessonParams::default() };
    let views = scenes::views(&building, &params);
    let (mut paths, mut truths) = (Vec::new(), Vec::new());
    for (number, (poster, readings)) in views.iter().enumerate() {
        let Some(view) = readings.frame.truth.landmark(poster).filter(|v| v.state == ViewState::Full) else {
            continue;
        };
        paths.push(folder.path().join(format!("{number}.png")));
        fs::write(&paths[truths.len()], scenes::png(&readings.frame.image)).expect("a picture");
        truths.push(view.corners_px);
    }
    assert!(truths.len() >= 3, "too few whole posters");
    let run = detect(&paths);
    assert_eq!(run.status, 0, "{run:?}");
    for (line, truth) in run.json_lines().iter().zip(&truths) {
        let quads = line["quads"].as_array().expect("quads");
        let best = quads.iter().map(|q| polygon::iou(corners(q).points(), truth.points()));
        let best = best.fold(0.0, f64::max);
        assert!(best >= 0.85, "IoU {best} at best in {line}");
    }
}

#[test]
fn every_stage_is_drawn_for_every_picture_of_a_folder() {
    let folder = TempDir::new().expect("a temporary directory");
    let (pictures, drawings) = (folder.path().join("pictures"), folder.path().join("drawings"));
    fs::create_dir_all(pictures.join("more")).expect("folders");
    let card = DynamicImage::from(card(320, 240));
    card.save(pictures.join("a.png")).expect("a picture");
    card.save(pictures.join("b.JPG")).expect("a picture");
    card.save(pictures.join("more/a.png")).expect("a picture");
    fs::write(pictures.join("notes.txt"), "no picture").expect("a file");
    let args: [OsString; 5] = [
        "detect".into(),
        pictures.clone().into(),
        pictures.join("more/a.png").into(),
        "--draw".into(),
        drawings.clone().into(),
    ];
    let run = waymark(args, LONGEST);
    assert_eq!((run.status, run.stdout.matches("1 quads").count()), (0, 3), "{run:?}");
    let mut expected = Vec::new();
    for stem in ["a", "a_2", "b"] {
        for stage in ["1-edges", "2-chains", "3-segments", "4-pairs", "5-quads", "overview"] {
            expected.push(format!("{stem}-{stage}.png"));
        }
    }
    let mut written: Vec<String> = fs::read_dir(&drawings)
        .expect("the folder of drawings")
        .map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned())
        .collect();
    written.sort();
    expected.sort();
    assert_eq!(written, expected);
    // The card's upper side is drawn in colour where the grey picture has none.
    for stage in &expected[..5] {
        let picture = image::open(drawings.join(stage)).expect("a picture").into_rgb8();
        let scale = picture.width() / 320;
        let near =
            (-2_i32..=2).map(|d| picture.get_pixel(160 * scale, (61 * scale).saturating_add_signed(d)).0);
        let spread = near.map(|p| p.iter().max().unwrap_or(&0) - p.iter().min().unwrap_or(&0)).max();
        assert!(spread > Some(60), "{stage}: {spread:?}");
    }
}

#[test]
fn parameters_are_shown_applied_and_checked() {
    let shown = waymark(["detect", "--show-params", "--scales", "1", "--set", "edges.high=9"], LONGEST);
    let all: Value = serde_json::from_str(&shown.stdout).expect("JSON");
    assert_eq!((&all["quads"]["scales"], &all["edges"]["high"]), (&1.into(), &9.0.into()), "{all}");
    for (wrong, word) in [("quads.scale=1", "no scale"), ("quads.scales=-1", "quads.scales")] {
        let run = waymark(["detect", "--show-params", "--set", wrong], LONGEST);
        assert!(run.status == 1 && run.stderr.contains(word), "{run:?}");
    }
}
