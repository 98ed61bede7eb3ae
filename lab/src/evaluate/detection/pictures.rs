//! The worst pictures, with labelled and detected quads drawn on them.

use super::{
    report::worst,
    score::{FOUND, FOUND_WELL, ImageScore},
};
use crate::evaluate::truth::{Truth, TruthImage};
use anyhow::Context as _;
use cli::{
    drawing::{BLUE, GREEN, ORANGE, Picture, RED, WHITE, YELLOW},
    pictures, screen,
};
use std::path::Path;
use vision::frame::GrayImage;

/// Shortest side of a picture that is drawn; smaller ones are enlarged.
const MIN_DRAWN_PX: usize = 400;

/// Writes the pictures of the `count` worst images into `folder`, the worst first in the order of
/// names.
pub(crate) fn draw_worst(
    folder: &Path,
    truth: &Truth,
    scores: &[ImageScore],
    count: usize,
) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let chosen = worst(scores, count);
    let progress = screen::progress(chosen.len(), "drawing");
    for (rank, i) in chosen.into_iter().enumerate() {
        progress.inc(1);
        let score = &scores[i];
        let Some(image) = truth.images.iter().find(|image| image.file == score.file) else { continue };
        let gray = pictures::read(&image.path).with_context(|| image.path.display().to_string())?;
        let stem: String =
            score.file.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
        draw(&gray, image, score).save(&folder.join(format!("{:03}-{stem}.png", rank + 1)))?;
    }
    progress.finish_and_clear();
    Ok(())
}

fn draw(gray: &GrayImage, image: &TruthImage, score: &ImageScore) -> Picture {
    let mut picture = Picture::of(gray, 0.75);
    for other in &image.others {
        picture.quad(other, 1.0, [110, 110, 160]);
    }
    for quad in image.quads.iter().filter(|q| !score.labels.iter().any(|l| l.corners == q.corners)) {
        picture.quad(&quad.corners, 1.0, YELLOW);
    }
    for label in &score.labels {
        let colour = if label.iou < FOUND {
            RED
        } else if label.iou < FOUND_WELL {
            ORANGE
        } else {
            GREEN
        };
        picture.quad(&label.corners, 3.0, colour);
    }
    for found in &score.found {
        picture.quad(found, 1.4, WHITE);
    }
    for wrong in score.false_quads.iter().flatten() {
        picture.tint(&wrong.corners, if wrong.reviewed.is_some() { BLUE } else { RED }, 0.3);
    }
    let factor = MIN_DRAWN_PX.div_ceil(picture.width().min(picture.height()).max(1)).min(8);
    picture.enlarged(factor).with_legend(&[
        ("found", GREEN),
        ("loose", ORANGE),
        ("missed", RED),
        ("not counted", YELLOW),
        ("detected", WHITE),
        ("tinted: false", RED),
        ("reviewed", BLUE),
    ])
}
