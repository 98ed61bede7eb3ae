//! The training views of a landmark in the plane of their two leading modes, and the icons that
//! stand for them.

use super::{
    landmark::Landmark,
    panels::{column, explained, icon as drawn, ring, row, titled},
};
use anyhow::Context as _;
use cli::drawing::{BLUE, Colour, GREEN, ORANGE, Picture, WHITE, YELLOW};
use vision::{
    icon::Icon,
    learn::{
        TrainingView,
        pca::{Modes, Role, exemplars, modes},
    },
    params::Params,
};

/// Enlargement of the exemplars and of the modes.
const FACTOR: usize = 2;
/// Side of the plane of the modes.
const PLANE_PX: usize = 350;
/// Views in a row.
const PER_ROW: usize = 11;
/// Colours of mean, first and second mode.
const COLOURS: [Colour; 3] = [GREEN, ORANGE, BLUE];

pub(crate) fn draw(landmark: &Landmark) -> anyhow::Result<Picture> {
    let p = Params::default();
    let taught = landmark.taught(&p)?;
    let pixels: Vec<&[f32]> = taught.views.iter().map(|v| v.icon.pixels.as_slice()).collect();
    let modes = modes(&pixels).context("the views have no principal components")?;
    let chosen: Vec<(usize, Colour)> = exemplars(&modes)
        .iter()
        .map(|e| match e.role {
            Role::Mean => (e.index, COLOURS[0]),
            Role::Mode { mode, .. } => (e.index, COLOURS[1 + mode.min(1)]),
        })
        .collect();
    let top = row(&[
        titled(&plane(&modes, &chosen), "modes 1 (across), 2 (up)", WHITE),
        column(&[
            means(&modes, &p),
            stand_ins(&taught.model.exemplars.iter().map(vision::model::Exemplar::icon).collect::<Vec<_>>()),
        ]),
    ]);
    let explained_share = 100.0 * modes.eigenvalues.iter().sum::<f64>() / modes.total_variance.max(1e-9);
    let share = format!("both modes: {explained_share:.0} % of the variance");
    let views =
        titled(&sheet(&taught.views, &chosen), "the training views: a photograph and generated ones", WHITE);
    Ok(explained(
        column(&[top, views]),
        &[
            ("exemplar of the mean", COLOURS[0]),
            ("of mode 1", COLOURS[1]),
            ("of mode 2", COLOURS[2]),
            (&share, YELLOW),
        ],
    ))
}

/// Every view at its coordinates, exemplars ringed.
fn plane(modes: &Modes, chosen: &[(usize, Colour)]) -> Picture {
    let mut picture = Picture::black(PLANE_PX, PLANE_PX);
    let middle = 0.5 * PLANE_PX as f64;
    picture.line([0.0, middle], [2.0 * middle, middle], 1.0, [90, 90, 90]);
    picture.line([middle, 0.0], [middle, 2.0 * middle], 1.0, [90, 90, 90]);
    let none = Vec::new();
    let of = |mode: usize| modes.coordinates().get(mode).unwrap_or(&none);
    let furthest = of(0).iter().chain(of(1)).fold(1.0_f64, |m, c| m.max(c.abs()));
    let at = |i: usize| {
        let coordinate = |mode: usize| of(mode).get(i).copied().unwrap_or(0.0) / furthest * (middle - 14.0);
        [middle + coordinate(0), middle - coordinate(1)]
    };
    for i in 0..of(0).len() {
        picture.disc(at(i), 3.0, WHITE);
    }
    for (i, colour) in chosen {
        ring(&mut picture, at(*i), [8.0, 8.0], 2.4, *colour);
    }
    picture
}

/// The mean icon and the modes: grey is no change.
fn means(modes: &Modes, p: &Params) -> Picture {
    let as_icon = |pixels: Vec<f32>| drawn(&Icon { size: p.icon.size, pixels, source_scale: 1.0 }, FACTOR);
    let mean = as_icon(modes.mean.iter().map(|g| *g as f32).collect());
    let mut pictures = vec![titled(&mean, "mean", WHITE)];
    for (i, mode) in modes.modes.iter().enumerate() {
        let largest = mode.iter().fold(1e-9_f64, |m, c| m.max(c.abs()));
        let picture = as_icon(mode.iter().map(|m| (127.5 + 127.5 * m / largest) as f32).collect());
        pictures.push(titled(&picture, &format!("mode {}", i + 1), WHITE));
    }
    row(&pictures)
}

fn stand_ins(icons: &[Icon]) -> Picture {
    let of = |(i, icon): (usize, &Icon)| {
        titled(&drawn(icon, FACTOR), &format!("exemplar {}", i + 1), COLOURS[i.min(2)])
    };
    row(&icons.iter().enumerate().map(of).collect::<Vec<_>>())
}

/// All views in rows, exemplars underlined.
fn sheet(views: &[TrainingView], chosen: &[(usize, Colour)]) -> Picture {
    let side = views.first().map_or(1, |v| v.icon.size);
    let (step, rows) = (side + 6, views.len().div_ceil(PER_ROW));
    let mut picture = Picture::black(PER_ROW * step, rows * (step + 2));
    for (i, view) in views.iter().enumerate() {
        let (left, top) = (i % PER_ROW * step, i / PER_ROW * (step + 2));
        picture.paste(&drawn(&view.icon, 1), [left, top]);
        if let Some((_, colour)) = chosen.iter().find(|(index, _)| *index == i) {
            let y = (top + side + 2) as f64;
            picture.line([left as f64 + 2.0, y], [(left + side) as f64 - 2.0, y], 4.0, *colour);
        }
    }
    picture
}
