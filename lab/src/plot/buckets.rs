//! The distances of an icon bucket by bucket: correlation of grey levels (C^r) and of gradients,
//! for the landmark, for the landmark behind something plain, and for another picture.

use super::{
    landmark::{Landmark, Taught, oblique, plain},
    panels::{column, explained, icon as drawn, row, scale, titled},
};
use cli::drawing::{GREEN, Picture, RED, WHITE, YELLOW};
use sim::exhibit::Conditions;
use vision::{
    icon::icon,
    params::Params,
    recognise::{
        features,
        features::correlation::{bucket_correlations, correlation},
        verification::gradient_similarity::{bucket_similarities, compare_gradients},
    },
};

/// Enlargement of the icons.
const FACTOR: usize = 3;
/// The colours of correlations -1, 0 and 1.
const COLOURS: [[u8; 3]; 3] = [RED, [60, 60, 60], GREEN];

pub(crate) fn draw(landmark: &Landmark) -> anyhow::Result<Picture> {
    let p = Params::default();
    let taught = landmark.taught(&p)?;
    let covered = Conditions { cover: 0.25, cover_grey: 90.0, ..plain() };
    let rows = [
        compared(landmark, &oblique(), &taught, "the landmark", &p)?,
        compared(landmark, &covered, &taught, "a quarter covered", &p)?,
        compared(&landmark.other(1), &oblique(), &taught, "another picture", &p)?,
    ];
    Ok(explained(
        column(&rows),
        &[
            ("numbers: correlation in %", YELLOW),
            ("100", GREEN),
            ("0", [150, 150, 150]),
            ("-100", RED),
            ("framed: the one that counts for Cr", WHITE),
        ],
    ))
}

fn compared(
    landmark: &Landmark,
    conditions: &Conditions,
    taught: &Taught,
    title: &str,
    p: &Params,
) -> anyhow::Result<Picture> {
    let seen = landmark.seen(conditions)?;
    let own = features(icon(&seen.image, &seen.corners, &p.icon)?, &p.recognise);
    let learnt = features(taught.nearest(&own, p), &p.recognise);
    let c = &p.recognise.correlation;
    let grey = bucket_correlations(&own.buckets, &learnt.buckets).unwrap_or_default();
    let gradient = bucket_similarities(&own.icon, &learnt.icon, c).unwrap_or_default();
    let distance = correlation(&own.buckets, &learnt.buckets, c);
    let likeness = compare_gradients(&own.icon, &learnt.icon, c).likeness;
    let rank = ranked(&grey, c.rank());
    Ok(row(&[
        titled(&drawn(&own.icon, FACTOR), title, WHITE),
        titled(&drawn(&learnt.icon, FACTOR), "exemplar", WHITE),
        titled(&map(&grey, p, rank), &format!("grey: Cr {distance:.2}"), WHITE),
        titled(&map(&gradient, p, None), &format!("gradients: {likeness:.2}"), WHITE),
    ]))
}

/// Index of the k-th greatest.
fn ranked(values: &[f32], k: usize) -> Option<usize> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*b].total_cmp(&values[*a]));
    order.get(k.checked_sub(1)?).copied()
}

/// The buckets in their places, each with its correlation.
fn map(values: &[f32], p: &Params, marked: Option<usize>) -> Picture {
    let (side, per_side) = (p.icon.size * FACTOR, p.recognise.correlation.per_side());
    let mut picture = Picture::black(side, side);
    let cell = side / per_side;
    for (i, value) in values.iter().enumerate() {
        let (left, top) = (i % per_side * cell, i / per_side * cell);
        let colour = scale(0.5 + 0.5 * f64::from(*value), COLOURS).map(|c| (f64::from(c) * 0.75) as u8);
        for (u, v) in (0..cell - 1).flat_map(|v| (0..cell - 1).map(move |u| (u, v))) {
            picture.blend((left + u) as i64, (top + v) as i64, colour, 1.0);
        }
        let words = ((100.0 * value).round() as i32).to_string();
        let x = left + (cell - 12 * words.len().min(3)) / 2;
        picture.text([x, top + cell / 2 - 7], 2, &words, YELLOW);
        if marked == Some(i) {
            let (l, t, e) = (left as f64 + 1.0, top as f64 + 1.0, cell as f64 - 4.0);
            for [from, to] in [
                [[l, t], [l + e, t]],
                [[l + e, t], [l + e, t + e]],
                [[l + e, t + e], [l, t + e]],
                [[l, t + e], [l, t]],
            ] {
                picture.line(from, to, 2.0, WHITE);
            }
        }
    }
    picture
}
