//! Teaches a map of pictures as the server does: views of each, negatives from all others, quality
//! gates. Pictures in, the models of those that passed out.

use super::{mixed, of_each, pictures::Picture};
use serde::Serialize;
use sim::{
    exhibit::{Conditions, Extent, exhibit},
    surfaces::plaster,
    texture::Texture,
};
use std::sync::Arc;
use vision::{
    frame::GrayImage,
    geometry::Corners,
    learn::{TrainingView, add_negatives, learn, synthesis},
    model::{LandmarkId, LandmarkModel, ModelSet},
    params::{Params, preset::Preset},
    points::taught::{MAX_POINT_VIEWS, TaughtPoint, view_points},
    random::Random,
    recognise::{DistanceKind, IconFeatures, features, features::descriptor::Descriptor},
};

/// Views of each landmark, as in the server.
const VIEWS: usize = 30;
/// Negatives, about, taken evenly from the icons of all landmarks (`server/src/jobs/negatives.rs`).
const NEGATIVES: usize = 2000;
/// Widest angle that views are gathered from.
const MAX_YAW_RAD: f64 = 60.0 / 360.0 * std::f64::consts::TAU;
/// Most draws for a view of a picture.
const TRIES: u64 = 20;

/// How landmarks are taught.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub(crate) enum Taught {
    /// From 30 views, each under its own conditions.
    Views,
    /// From one view, and views generated from it.
    Photograph,
}

impl Taught {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Views => "30 views",
            Self::Photograph => "one photograph",
        }
    }
}

pub(crate) fn taught(text: &str) -> Result<Taught, String> {
    match text {
        "views" => Ok(Taught::Views),
        "photograph" => Ok(Taught::Photograph),
        _ => Err("one of: views, photograph".to_owned()),
    }
}

/// Training data of a landmark: views, and the points of its photographs.
#[derive(Default)]
struct TrainingData {
    views: Vec<TrainingView>,
    points: Vec<Vec<TaughtPoint>>,
}

/// Points of a few photographs, evenly chosen, as in a lesson of the server
/// (`server/src/jobs/learn.rs`).
pub(crate) fn points_of<'a>(photographs: &[(&'a GrayImage, &'a Corners)]) -> Vec<Vec<TaughtPoint>> {
    let chosen = photographs.len().min(MAX_POINT_VIEWS);
    let of = |i: usize| photographs[i * photographs.len() / chosen];
    (0..chosen).map(of).map(|(image, corners)| view_points(image, corners)).collect()
}

/// The landmarks of a map and the pictures that they were taught from.
pub(crate) struct Class {
    /// Landmark `LandmarkId(i)` is picture i; those that failed a quality gate are not in `models`.
    pub(crate) landmarks: Vec<Picture>,
    pub(crate) models: ModelSet,
    /// Pictures that failed a quality gate or could not be learnt.
    pub(crate) candidates: Vec<usize>,
    pub(crate) wall: Texture,
    /// The distance that decides.
    pub(crate) kind: DistanceKind,
}

impl Class {
    /// The same where the distance of `preset` decides.
    #[must_use]
    pub(crate) fn deciding_by(self, preset: Preset) -> Self {
        Self { kind: preset.distance(), ..self }
    }

    /// Teaches all `pictures` together.
    pub(crate) fn new(pictures: Vec<Picture>, how: Taught, seed: u64, p: &Params) -> anyhow::Result<Self> {
        let mut p = p.clone();
        if how == Taught::Photograph {
            // Every landmark would be refused.
            p.learn.gates.refuse_one_side = false;
        }
        let p = &p;
        let wall = plaster(seed);
        let sights = of_each(&pictures, "views", |i, picture| {
            let draw = |n: u64| mixed(&[seed, 1, i as u64, n]);
            match how {
                Taught::Views => gathered(picture, &wall, draw, p),
                Taught::Photograph => from_one(picture, &wall, draw, p),
            }
        });
        let each = (NEGATIVES / pictures.len().max(1)).clamp(3, VIEWS);
        let icons: Vec<Vec<IconFeatures>> = of_each(&sights, "icons", |_, TrainingData { views, .. }| {
            let count = each.min(views.len());
            let chosen = (0..count).map(|i| &views[i * views.len() / count]);
            chosen.map(|v| features(v.icon.clone(), &p.recognise)).collect()
        });
        let models = of_each(&sights, "learning", |i, TrainingData { views, points }| {
            let alone = learn(LandmarkId(i as u64), views, &[], p).ok()?;
            let alone = alone.with_points(points);
            let others = icons.iter().enumerate().filter(|(other, _)| *other != i).map(|(_, icons)| icons);
            let others: Vec<IconFeatures> = others.flatten().cloned().collect();
            Some(add_negatives(&alone, &others, p))
        });
        let candidates = models
            .iter()
            .enumerate()
            .filter(|(_, m)| !m.as_ref().is_some_and(LandmarkModel::is_active))
            .map(|(i, _)| i)
            .collect();
        let models = ModelSet::in_use(models.into_iter().flatten().map(Arc::new), p)?;
        Ok(Self { landmarks: pictures, models, candidates, wall, kind: DistanceKind::default() })
    }

    /// Pictures that are active landmarks.
    pub(crate) fn active(&self) -> impl Iterator<Item = (LandmarkId, &Picture)> {
        self.models.iter().map(|m| (m.id, &self.landmarks[m.id.0 as usize]))
    }

    /// Mean size of a model as it is stored; 0 without any.
    pub(crate) fn bytes_per_model(&self) -> usize {
        let all: usize = self.models.iter().map(|m| m.to_bytes().len()).sum();
        all / self.models.len().max(1)
    }

    /// Mean size of what each distance of the paper needs of a model: icons at one byte a pixel for
    /// C^r, points with positions and descriptors for H^r.
    pub(crate) fn distance_bytes_per_model(&self, p: &Params) -> [usize; 2] {
        let icons = |m: &LandmarkModel| m.exemplars.iter().map(|e| e.pixels().len()).sum::<usize>();
        let point = size_of::<[f32; 2]>() + size_of::<Descriptor>();
        let points = |m: &LandmarkModel| {
            point * m.features(&p.recognise).iter().map(|f| f.points.len()).sum::<usize>()
        };
        let mean = |of: &dyn Fn(&LandmarkModel) -> usize| {
            self.models.iter().map(|m| of(m)).sum::<usize>() / self.models.len().max(1)
        };
        [mean(&icons), mean(&points)]
    }
}

/// Views as a robot would gather them by driving past.
fn gathered(picture: &Picture, wall: &Texture, draw: impl Fn(u64) -> u64, p: &Params) -> TrainingData {
    let view = |n: u64| {
        let (noise, mut random) = (draw(2 * n), Random::new(draw(2 * n + 1)));
        let mut conditions = Conditions::realistic(noise);
        conditions.yaw_rad = random.range(-MAX_YAW_RAD, MAX_YAW_RAD);
        let rendered = exhibit(&picture.texture, wall, &conditions, Extent::Around, noise)?;
        let corners = noisy(&rendered.corners, 1.0, &mut random)?;
        let view = TrainingView::photographed(&rendered.image, &corners, p).ok()?;
        Some((view, rendered.image, corners))
    };
    let all: Vec<_> = (0..TRIES * VIEWS as u64).filter_map(view).take(VIEWS).collect();
    let photographs: Vec<_> = all.iter().map(|(_, image, corners)| (image, corners)).collect();
    let points = points_of(&photographs);
    TrainingData { views: all.into_iter().map(|(view, _, _)| view).collect(), points }
}

/// One view nearly from the front, and views generated from it.
fn from_one(picture: &Picture, wall: &Texture, draw: impl Fn(u64) -> u64, p: &Params) -> TrainingData {
    let one = |n: u64| {
        let (noise, mut random) = (draw(2 * n), Random::new(draw(2 * n + 1)));
        let conditions = Conditions {
            yaw_rad: random.range(-0.2, 0.2),
            size_px: random.range(200.0, 280.0),
            ..Conditions::realistic(noise)
        };
        let rendered = exhibit(&picture.texture, wall, &conditions, Extent::Around, noise)?;
        let corners = noisy(&rendered.corners, 1.0, &mut random)?;
        let view = TrainingView::photographed(&rendered.image, &corners, p).ok()?;
        let generated = synthesis::views(&rendered.image, &corners, VIEWS, p, noise);
        let points = points_of(&[(&rendered.image, &corners)]);
        Some(TrainingData { views: std::iter::once(view).chain(generated).collect(), points })
    };
    (0..TRIES).find_map(one).unwrap_or_default()
}

/// Corners with normal noise of `sigma_px` on each coordinate, like those of a detector.
pub(crate) fn noisy(corners: &Corners, sigma_px: f64, random: &mut Random) -> Option<Corners> {
    let off = corners
        .points()
        .map(|c| nalgebra::Point2::new(c.x + sigma_px * random.normal(), c.y + sigma_px * random.normal()));
    Corners::new(off).ok()
}
