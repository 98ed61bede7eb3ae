//! Template alignment: the corners of a quad that is a little off, before and after, and the icons
//! along them.

use super::{
    landmark::{Landmark, oblique},
    panels::{around, column, cut, explained, gray, icon as drawn, on, row, titled},
};
use anyhow::Context as _;
use cli::drawing::{GREEN, Picture, RED, WHITE, YELLOW};
use nalgebra::Vector2;
use vision::{
    geometry::Corners,
    icon::{Icon, icon},
    params::Params,
    recognise::{
        alignment::{
            aligner::{Aligner, Alignment, SamplingGrids, Template},
            surroundings::{Surroundings, coarse},
        },
        features,
        verification::gradient_similarity::likeness,
    },
};

/// How far each corner is moved before alignment, as shares of the mean side: as an edge of a
/// frame, a shadow or a mat that was taken for the border moves them.
const OFF: [[f64; 2]; 4] = [[0.07, -0.05], [0.09, 0.04], [-0.06, 0.08], [0.03, -0.09]];
/// Enlargement of the image.
const FACTOR: usize = 2;
/// Enlargement of the icons.
const ICON_FACTOR: usize = 3;

pub(crate) fn draw(landmark: &Landmark) -> anyhow::Result<Picture> {
    let p = Params::default();
    let taught = landmark.taught(&p)?;
    let seen = landmark.seen(&oblique())?;
    let side = seen.corners.area_px2().sqrt();
    let mut moved = *seen.corners.points();
    for (corner, off) in moved.iter_mut().zip(OFF) {
        *corner += Vector2::from(off) * side;
    }
    let before_px = Corners::new(moved)?;
    let before = icon(&seen.image, &before_px, &p.icon)?;
    let learnt = taught.nearest(&features(before.clone(), &p.recognise), &p);
    let align = &p.recognise.verdict.align;
    let grids = SamplingGrids::new(p.icon.size, &p.recognise.correlation);
    let around_px = Surroundings::new(&seen.image, &before_px, &before, align)
        .context("the quad reaches too near to the horizon")?;
    let small = coarse(&learnt, align);
    let after = Aligner::new(&grids, align)
        .align(&around_px, &Template::new(&learnt, &small))
        .context("the alignment was given up: the picture shows something else")?;

    let alike = |icon: &Icon| likeness(icon, &learnt, &p.recognise.correlation);
    let pair = |icon: &Icon, words: &str, colour| {
        let apart = difference(icon, &learnt);
        row(&[titled(&drawn(icon, ICON_FACTOR), words, colour), titled(&apart, "difference", colour)])
    };
    let icons = column(&[
        titled(&drawn(&learnt, ICON_FACTOR), "exemplar", WHITE),
        pair(&before, "before", RED),
        pair(&after.icon, "after", GREEN),
    ]);
    let farthest = |c: &Corners| c.furthest_px(&seen.corners);
    let before_words =
        format!("before: corners up to {:.1} px off, gradients {:.2}", farthest(&before_px), alike(&before));
    let after_words =
        format!("after: {:.2} px off, gradients {:.2}", farthest(&after.corners_px), alike(&after.icon));
    Ok(explained(
        row(&[titled(&quads(&seen, &before_px, &after), "the quad in the image", WHITE), icons]),
        &[
            (&before_words, RED),
            (&after_words, GREEN),
            ("white: true corners", WHITE),
            ("yellow: how far they moved", YELLOW),
        ],
    ))
}

/// The image around the quad, twice as large, with the corners before and after.
fn quads(seen: &sim::exhibit::Exhibit, before_px: &Corners, after: &Alignment) -> Picture {
    let box_px = around(before_px, 20.0, &seen.image);
    let mut picture = Picture::of(&cut(&seen.image, box_px), 0.7).enlarged(FACTOR);
    let place = |c: &nalgebra::Point2<f64>| on([c.x - box_px[0] as f64, c.y - box_px[1] as f64], FACTOR);
    for (corners, colour) in [(before_px, RED), (&after.corners_px, GREEN)] {
        let corners = corners.points().map(|c| place(&c));
        for i in 0..4 {
            picture.line(corners[i], corners[(i + 1) % 4], 1.8, colour);
        }
    }
    let pairs = before_px.points().iter().zip(after.corners_px.points());
    for (from, to) in pairs {
        picture.line(place(from), place(to), 1.6, YELLOW);
    }
    for corner in seen.corners.points() {
        picture.disc(place(corner), 3.0, WHITE);
    }
    picture
}

/// How far the grey levels of two icons of equal mean and deviation are apart: black where they
/// agree.
fn difference(a: &Icon, b: &Icon) -> Picture {
    let normal = |icon: &Icon| {
        let n = icon.pixels.len() as f32;
        let mean = icon.pixels.iter().sum::<f32>() / n;
        let deviation = (icon.pixels.iter().map(|g| (g - mean).powi(2)).sum::<f32>() / n).sqrt().max(1.0);
        icon.pixels.iter().map(|g| (g - mean) / deviation).collect::<Vec<_>>()
    };
    let apart: Vec<f32> =
        normal(a).iter().zip(normal(b)).map(|(x, y)| ((x - y).abs() * 100.0).min(255.0)).collect();
    Picture::of(&gray(a.size, &apart), 1.0).enlarged(ICON_FACTOR)
}
