//! The patch of a quad with its margin, its keypoints, and which of them are taught.

use super::{
    landmark::Landmark,
    panels::{around, cut, explained, gray, on, ring, row, titled},
};
use anyhow::Context as _;
use cli::drawing::{BLUE, CYAN, GREEN, ORANGE, Picture, WHITE};
use vision::points::{
    patch::{MARGIN, Patch, inner_px},
    point::SeenPatch,
    taught::view_points,
    verify::MAX_PATCH_POINTS,
};

/// Enlargement of the patch.
const FACTOR: usize = 3;

pub(crate) fn draw(landmark: &Landmark) -> anyhow::Result<Picture> {
    let seen = landmark.photograph()?;
    let taught = view_points(&seen.image, &seen.corners);
    let patch = Patch::new(&seen.image, &seen.corners, inner_px(&seen.corners))
        .context("the margin reaches the horizon")?;
    let patch = SeenPatch::new(patch, MAX_PATCH_POINTS);

    let mut right = Picture::of(&gray(patch.patch.side, &patch.patch.pixels), 0.65).enlarged(FACTOR);
    let unit = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let corners = unit.map(|c| on(patch.patch.to_patch(c), FACTOR));
    for i in 0..4 {
        right.line(corners[i], corners[(i + 1) % 4], 2.0, CYAN);
    }
    let mut counts = [0; 3];
    for point in &patch.points {
        let is_inside = point.at.iter().all(|a| (0.0..=1.0).contains(a));
        let is_taught = taught.iter().any(|t| t.descriptor == point.descriptor);
        let (kind, colour) = match (is_inside, is_taught) {
            (true, true) => (0, GREEN),
            (true, false) => (1, ORANGE),
            (false, _) => (2, BLUE),
        };
        counts[kind] += 1;
        let centre = on(patch.patch.to_patch(point.at.map(f64::from)), FACTOR);
        let radius = f64::from(point.sigma) * (patch.patch.inner * FACTOR) as f64;
        ring(&mut right, centre, [radius, radius], 1.4, colour);
    }

    let margin_px = MARGIN * seen.corners.area_px2().sqrt() * 1.4;
    let box_px = around(&seen.corners, margin_px, &seen.image);
    let mut left = Picture::of(&cut(&seen.image, box_px), 0.8);
    let place = |at: [f64; 2]| {
        let at = patch.patch.to_image(at)?;
        Some([at.x - box_px[0] as f64, at.y - box_px[1] as f64])
    };
    let outer = unit.map(|c| c.map(|a| a + if a > 0.5 { MARGIN } else { -MARGIN }));
    for (corners, colour) in [(unit, CYAN), (outer, WHITE)] {
        for i in 0..4 {
            if let (Some(from), Some(to)) = (place(corners[i]), place(corners[(i + 1) % 4])) {
                left.line(from, to, 1.6, colour);
            }
        }
    }
    let [kept, plain, outside] = counts;
    let side = format!("patch of {0} x {0} px, circles: scale", patch.patch.side);
    Ok(explained(
        row(&[titled(&left, "photograph", WHITE), titled(&right, &side, WHITE)]),
        &[
            ("quad", CYAN),
            ("patch with its margin", WHITE),
            (&format!("taught: {kept}"), GREEN),
            (&format!("like a plain structure: {plain}"), ORANGE),
            (&format!("outside of the quad: {outside}"), BLUE),
        ],
    ))
}
