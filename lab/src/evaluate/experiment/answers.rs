//! Answers with their truth, to which a confidence is fitted and on which it is evaluated: maps of
//! several sizes, landmarks under conditions from easy to hopeless, distractors, and a few
//! look-alikes, in stated shares.

use super::{
    Common,
    distractors::{Distractor, distractors},
    lesson::{Class, Taught, noisy},
    mixed, of_each,
    pictures::{self, Picture, generated},
    view_outcome::quad,
};
use sim::{
    exhibit::{Conditions, Extent, Shadow, exhibit},
    texture::Texture,
};
use std::f64::consts::TAU;
use vision::{
    geometry::Corners,
    model::LandmarkId,
    params::Params,
    random::Random,
    recognise::{
        DistanceKind, RecognitionResult, Verdict,
        decision::measures::{MEASURES, measures},
        recognise,
    },
};

/// Landmarks of the maps, and how they are taught.
const MAPS: [(usize, Taught); 3] = [(12, Taught::Views), (40, Taught::Photograph), (100, Taught::Views)];
/// Posters among the distractors of each map.
const DISTRACTORS: u32 = 60;
/// Shares of the quads that are landmarks, and look-alikes; the rest are other distractors.
pub(crate) const MATED: f64 = 0.6;
pub(crate) const LOOK_ALIKES: f64 = 0.01;
/// Most draws of a view that does not lie in the image.
const TRIES: u64 = 10;

/// One answer that names a landmark.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Named {
    pub(crate) measures: [f64; MEASURES],
    pub(crate) confidence: f64,
    pub(crate) is_right: bool,
}

/// Answers by one distance, and the number of quads.
#[derive(Debug, Default)]
pub(crate) struct Answers {
    pub(crate) quads: usize,
    pub(crate) named: Vec<Named>,
}

pub(crate) const KINDS: [DistanceKind; 3] =
    [DistanceKind::Both, DistanceKind::Correlation, DistanceKind::Hausdorff];

/// Answers to `quads` quads by each of [`KINDS`], over all maps.
pub(crate) fn answers(common: &Common, quads: u32, p: &Params) -> anyhow::Result<[Answers; 3]> {
    let photographs = pictures::photographs(&common.photographs, common.part)?;
    let deal = |odd: usize| photographs.iter().skip(odd).step_by(2).cloned().collect::<Vec<Picture>>();
    let (to_teach, unknown) = (deal(0), deal(1));
    let mut all: [Answers; 3] = Default::default();
    let mut first = 0;
    for (m, (landmarks, how)) in MAPS.into_iter().enumerate() {
        // Every map has its own posters.
        let pictures =
            pictures::mixed(&to_teach, 0.5, landmarks, |i| generated(common.part, common.seed, first + i));
        first += landmarks;
        let seed = mixed(&[common.seed, 20, m as u64]);
        let class = Class::new(pictures, how, seed, p)?;
        anyhow::ensure!(!class.models.is_empty(), "no landmark passed its gates");
        let distractors = distractors(&class, &unknown, DISTRACTORS, common);
        let numbers: Vec<u64> = (0..u64::from(quads).div_ceil(MAPS.len() as u64)).collect();
        let by_quad =
            of_each(&numbers, "answers", |_, n| quad_of(&class, &distractors, mixed(&[seed, 21, *n]), p));
        for by_kind in by_quad.into_iter().flatten() {
            for (answers, named) in all.iter_mut().zip(by_kind) {
                answers.quads += 1;
                answers.named.extend(named);
            }
        }
    }
    Ok(all)
}

/// Answers to one quad, by distance.
fn quad_of(class: &Class, distractors: &[Distractor], draw: u64, p: &Params) -> Option<[Option<Named>; 3]> {
    let mut random = Random::new(draw);
    let chosen = random.unit();
    let pick =
        |random: &mut Random, of: usize| ((random.unit() * of as f64) as usize).min(of.saturating_sub(1));
    let (texture, id) = if chosen < MATED {
        let n = pick(&mut random, class.models.len());
        let (id, picture) = class.active().nth(n)?;
        (&picture.texture, Some(id))
    } else {
        let of: Vec<&Distractor> =
            distractors.iter().filter(|s| s.hard == (chosen < MATED + LOOK_ALIKES)).collect();
        (&of.get(pick(&mut random, of.len()))?.texture, None)
    };
    let (rendered, corners) = (0..TRIES).find_map(|n| view(class, texture, mixed(&[draw, n])))?;
    Some(KINDS.map(|kind| named(&recognise(&rendered.image, &quad(corners), &class.models, kind, p), id)))
}

fn view(class: &Class, texture: &Texture, draw: u64) -> Option<(sim::exhibit::Exhibit, Corners)> {
    let mut random = Random::new(draw);
    let conditions = hard(draw, &mut random);
    let rendered = exhibit(texture, &class.wall, &conditions, Extent::Around, draw)?;
    let mut corners = noisy(&rendered.corners, random.range(0.3, 2.0), &mut random)?;
    // Sometimes the detector finds another border than the taught one.
    if random.unit() < 0.15 {
        let by = random.range(0.88, 1.1);
        let centre = corners.points().iter().fold(nalgebra::Vector2::zeros(), |m, c| m + c.coords * 0.25);
        corners = Corners::new(corners.points().map(|c| (centre + by * (c.coords - centre)).into())).ok()?;
    }
    Some((rendered, corners))
}

/// Conditions from easy to hopeless.
fn hard(draw: u64, random: &mut Random) -> Conditions {
    let mut c = Conditions::realistic(draw);
    c.yaw_rad = random.range(-1.35, 1.35);
    c.size_px = random.range(46f64.ln(), 260f64.ln()).exp();
    let mut often = |share: f64| random.unit() < share;
    let (light, cover, side, shadow) = (often(0.4), often(0.4), often(0.3), often(0.2));
    if light {
        c.sensor.exposure = random.range(-1.2, 1.1).exp();
        c.sensor.offset = random.range(-40.0, 100.0);
    }
    if cover {
        c.cover = random.range(0.0, 0.65);
    }
    if side {
        (c.side_light, c.side_light_rad) = (random.range(0.2, 0.95), random.range(0.0, TAU));
    }
    if shadow {
        let (depth, offset) = (random.range(0.2, 0.9), random.range(-0.4, 0.4));
        c.shadow = Some(Shadow { depth, direction_rad: random.range(0.0, TAU), offset });
    }
    c
}

/// The name that a verdict gives, if any, with its truth.
fn named(verdict: &RecognitionResult, truth: Option<LandmarkId>) -> Option<Named> {
    let Verdict::Unique(id) = verdict.verdict else { return None };
    let best = verdict.candidates.iter().position(|c| c.landmark == id)?;
    Some(Named {
        measures: measures(&verdict.candidates, best, verdict.landmarks)?,
        confidence: verdict.confidence,
        is_right: truth == Some(id),
    })
}
