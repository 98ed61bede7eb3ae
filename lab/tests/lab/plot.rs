//! Claim: every picture of a stage of recognition in docs/method is what the program draws of it
//! now, and shows something.

use crate::lab;
use image::{ImageReader, RgbImage};
use std::{collections::BTreeSet, ffi::OsString, fs, path::Path};
use tempfile::TempDir;

/// The stages; their pictures are `docs/pictures/method/{stage}.png`.
const STAGES: [&str; 8] =
    ["icon", "harris", "buckets", "exemplars", "alignment", "mismatch", "patch", "matches"];
/// Fewest colours of a picture that shows something: grey levels, and lines with smooth edges.
const MIN_COLOURS: usize = 40;
/// Widths that are legible in a page without being enlarged or reduced much.
const WIDTHS_PX: std::ops::RangeInclusive<u32> = 640..=1320;
/// Largest file.
const MAX_BYTES: u64 = 200_000;
/// Pixels that may differ, of a million: processors may round the last bit of a sine or an
/// exponential differently.
const MAX_DIFFERENT: usize = 100;

fn read(path: &Path) -> RgbImage {
    let reader = ImageReader::open(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    reader.decode().unwrap_or_else(|error| panic!("{}: {error}", path.display())).into_rgb8()
}

fn draw(stage: &str, folder: &Path) -> RgbImage {
    let path = folder.join(format!("{stage}.png"));
    let run = lab([OsString::from("plot"), stage.into(), "--out".into(), path.clone().into()]);
    assert_eq!((run.status, run.stdout.as_str()), (0, ""), "{stage}: {run:?}");
    assert!(fs::metadata(&path).expect("the picture is there").len() <= MAX_BYTES, "{stage} is too large");
    read(&path)
}

#[test]
fn the_pictures_of_the_method_are_what_the_program_draws() {
    let folder = TempDir::new().expect("a temporary directory");
    for stage in STAGES {
        let drawn = draw(stage, folder.path());
        let colours: BTreeSet<[u8; 3]> = drawn.pixels().map(|p| p.0).collect();
        assert!(colours.len() >= MIN_COLOURS, "{stage} has {} colours", colours.len());
        assert!(WIDTHS_PX.contains(&drawn.width()), "{stage} is {} px wide", drawn.width());
        let kept =
            read(&Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../docs/pictures/method/{stage}.png")));
        let again = format!("draw it again: waymark-lab plot {stage} --out docs/pictures/method/{stage}.png");
        assert_eq!(drawn.dimensions(), kept.dimensions(), "{again}");
        let different = drawn.pixels().zip(kept.pixels()).filter(|(a, b)| a != b).count();
        let most = MAX_DIFFERENT * drawn.pixels().len() / 1_000_000;
        assert!(different <= most, "{different} pixels of {stage} differ; {again}");
    }
}

#[test]
fn another_seed_and_a_picture_of_ones_own_are_drawn() {
    let folder = TempDir::new().expect("a temporary directory");
    let path = folder.path().join("out.png");
    let ours = folder.path().join("ours.png");
    let chequered = RgbImage::from_fn(320, 240, |u, v| {
        image::Rgb([if (u / 37 + v / 41) % 2 == 0 { 40 } else { 180 + (u * v % 60) as u8 }; 3])
    });
    chequered.save(&ours).expect("a picture is written");
    let plot = |stage: &str, option: &str, value: &Path| {
        let args = [OsString::from("plot"), stage.into(), option.into(), value.into()];
        let run = lab(args.into_iter().chain(["--out".into(), path.clone().into()]));
        assert_eq!(run.status, 0, "{stage} {option}: {run:?}");
        read(&path)
    };
    assert_ne!(plot("icon", "--seed", Path::new("2")), plot("icon", "--seed", Path::new("3")));
    assert_ne!(plot("patch", "--image", &ours), plot("patch", "--seed", Path::new("3")));
}
