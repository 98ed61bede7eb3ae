//! The mismatch map: which windows of an aligned picture show something else than the learnt icon,
//! and which cells show nothing. For a quarter that was replaced, and for one that is occluded by
//! something plain.

use super::{
    landmark::{Landmark, Taught, oblique, plain},
    panels::{column, explained, icon as drawn, row, titled},
};
use anyhow::Context as _;
use cli::drawing::{BLUE, GREEN, Picture, RED, WHITE, YELLOW};
use sim::{
    exhibit::Conditions,
    lookalikes::{LookAlikeKind, lookalikes},
};
use vision::{
    icon::icon,
    params::Params,
    recognise::{
        alignment::{
            aligner::{Aligner, SamplingGrids, Template},
            surroundings::{Surroundings, coarse},
        },
        features,
        verification::{
            gradient_similarity::Smoothed,
            mismatch::{CELLS, MIN_DIFFERING, MismatchMap, WINDOWS},
        },
    },
};

/// Which quarter is replaced, and by what.
const LOOK_ALIKE_SEED: u64 = 11;
/// Enlargement of the icons.
const FACTOR: usize = 4;

pub(crate) fn draw(landmark: &Landmark) -> anyhow::Result<Picture> {
    let p = Params::default();
    let taught = landmark.taught(&p)?;
    let [_, double] = lookalikes(&landmark.texture, LookAlikeKind::Quarter, LOOK_ALIKE_SEED);
    let covered = Conditions { cover: 0.2, cover_grey: 90.0, ..plain() };
    let rows = [
        mapped(&landmark.with(double), &oblique(), &taught, "a quarter replaced", &p)?,
        mapped(landmark, &covered, &taught, "something plain before it", &p)?,
    ];
    let least = format!("in doubt from {MIN_DIFFERING} of a block of 4 x 4 windows on");
    Ok(explained(
        column(&rows),
        &[
            ("dot: middle of a window,", WHITE),
            ("it shows something else", RED),
            ("or not", GREEN),
            ("blue: a cell shows nothing where the exemplar does", BLUE),
            (&least, YELLOW),
        ],
    ))
}

fn mapped(
    landmark: &Landmark,
    conditions: &Conditions,
    taught: &Taught,
    title: &str,
    p: &Params,
) -> anyhow::Result<Picture> {
    let seen = landmark.seen(conditions)?;
    let own = icon(&seen.image, &seen.corners, &p.icon)?;
    let learnt = taught.nearest(&features(own.clone(), &p.recognise), p);
    let align = &p.recognise.verdict.align;
    let grids = SamplingGrids::new(p.icon.size, &p.recognise.correlation);
    let around = Surroundings::new(&seen.image, &seen.corners, &own, align)
        .context("the quad reaches too near to the horizon")?;
    let small = coarse(&learnt, align);
    let laid = Aligner::new(&grids, align)
        .align(&around, &Template::new(&learnt, &small))
        .context("the alignment was given up: the picture shows something else")?;
    let mismatches = MismatchMap::new(&Smoothed::new(&laid.icon), &Smoothed::new(&learnt))
        .context("the icons are cut differently")?;

    let count = mismatches.is_mismatch().iter().flatten().filter(|m| **m).count();
    let verdict = if mismatches.has_mismatched_part() { "in doubt" } else { "no doubt" };
    let words = format!("{count} mismatches: {verdict}");
    Ok(row(&[
        titled(&drawn(&learnt, FACTOR), "exemplar", WHITE),
        titled(&drawn(&laid.icon, FACTOR), title, WHITE),
        titled(&map(&laid.icon, &mismatches), &words, YELLOW),
    ]))
}

fn map(seen: &vision::icon::Icon, mismatches: &MismatchMap) -> Picture {
    let mut picture = drawn(seen, FACTOR);
    let cell = (seen.size * FACTOR) as f64 / CELLS as f64;
    let tinted = |picture: &mut Picture, [x, y]: [usize; 2], colour, share| {
        let range = |i: usize| (i as f64 * cell) as i64..((i + 1) as f64 * cell) as i64;
        for (u, v) in range(x).flat_map(|u| range(y).map(move |v| (u, v))) {
            picture.blend(u, v, colour, share);
        }
    };
    for (x, y) in (0..CELLS * CELLS).map(|i| (i % CELLS, i / CELLS)) {
        if mismatches.is_hidden()[y][x] {
            tinted(&mut picture, [x, y], BLUE, 0.45);
        }
    }
    for (x, y) in (0..WINDOWS * WINDOWS).map(|i| (i % WINDOWS, i / WINDOWS)) {
        let (centre, is_mismatch) =
            ([x, y].map(|i| (i + 1) as f64 * cell - 0.5), mismatches.is_mismatch()[y][x]);
        picture.disc(centre, if is_mismatch { 6.0 } else { 2.5 }, if is_mismatch { RED } else { GREEN });
    }
    picture
}
