//! Pictures with what was missed: labels by outcome, quads that the detector shows, names, and why
//! a label has none.

use super::{
    recognise::Recognised,
    score::{FOUND, LabelScore, PictureScore, View},
};
use anyhow::Context as _;
use cli::drawing::{BLUE, CYAN, Colour, GREEN, MAGENTA, ORANGE, Picture, RED, WHITE};
use std::path::Path;
use vision::geometry::Corners;

/// Factor by which pictures are enlarged, so that words fit.
const FACTOR: usize = 2;
/// Pixels a dot of the words.
const DOT_PX: usize = 1;
/// Lines of words start so far inside of a quad.
const INSET_PX: usize = 4;
/// Height of a line of words.
const LINE_PX: usize = 10;

/// Draws the picture into `folder` if a full view has no name, a name is wrong or a quad false.
pub(super) fn draw(folder: &Path, score: &PictureScore, recognised: &Recognised) -> anyhow::Result<()> {
    let is_missed = score.labels.iter().any(|l| l.view == View::Full && !l.is_named());
    let is_false = score.false_quads.as_ref().is_some_and(|quads| !quads.is_empty());
    if !is_missed && !is_false && score.wrong.is_empty() {
        return Ok(());
    }
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let name = format!("{}-{}", score.world, score.file);
    let stem: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    drawn(score, recognised).save(&folder.join(format!("{stem}.png")))
}

fn drawn(score: &PictureScore, recognised: &Recognised) -> Picture {
    let mut picture = Picture::of(recognised.image.grey(), 0.75);
    for quad in score.false_quads.iter().flatten() {
        picture.tint(quad, RED, 0.3);
    }
    for label in &score.labels {
        picture.quad(&label.corners, 3.0, colour(label));
    }
    for quad in &recognised.analysis.quads {
        picture.quad(&quad.quad.corners_px, 1.0, CYAN);
    }
    for quad in &recognised.shown {
        picture.quad(&quad.corners_px, 1.0, WHITE);
    }
    let mut picture = picture.enlarged(FACTOR);
    for label in &score.labels {
        let name = label.landmark.as_deref().unwrap_or("distractor");
        let lines = [name, &label.miss.reason, &label.miss.detail];
        words(&mut picture, &label.corners, &lines, colour(label));
    }
    for wrong in &score.wrong {
        words(&mut picture, &wrong.corners, &["", "", "", &format!("WRONG {}", wrong.named)], MAGENTA);
    }
    picture.with_legend(&[
        ("named", GREEN),
        ("quad, no name", ORANGE),
        ("no quad", RED),
        ("cut or hidden, no name", BLUE),
        ("wrong name", MAGENTA),
        ("shown", WHITE),
        ("asked", CYAN),
        ("tinted: false", RED),
    ])
}

fn colour(label: &LabelScore) -> Colour {
    match label.view {
        _ if label.is_named() => GREEN,
        View::Partial => BLUE,
        View::Full if label.asked_iou >= FOUND => ORANGE,
        View::Full => RED,
    }
}

/// Lines of words at the top left of a quad, inside the picture.
fn words(picture: &mut Picture, corners: &Corners, lines: &[&str], colour: Colour) {
    let least = |of: fn(&nalgebra::Point2<f64>) -> f64, size: usize| {
        let low = corners.points().iter().map(of).fold(f64::INFINITY, f64::min).max(0.0) as usize;
        (low * FACTOR).min(size.saturating_sub(20 * LINE_PX)) + INSET_PX
    };
    let (u, v) = (least(|p| p.x, picture.width()), least(|p| p.y, picture.height()));
    for (i, line) in lines.iter().enumerate() {
        picture.text([u, v + i * LINE_PX], DOT_PX, line, colour);
    }
}
