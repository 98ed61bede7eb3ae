//! The rendered landmark that a stage of recognition is drawn on: a poster on a plastered wall,
//! taught from one photograph, and other views of it. With the exact corners: what detection adds
//! is drawn elsewhere.

use super::Args;
use crate::evaluate::experiment::lesson::points_of;
use anyhow::Context as _;
use cli::pictures;
use sim::{
    exhibit::{Conditions, Exhibit, Extent, exhibit},
    posters::poster,
    surfaces::plaster,
    texture::{Edge, Texture},
};
use vision::{
    detect::pyramid::{reduce, working_factor},
    icon::Icon,
    learn::{TrainingView, learn, synthesis},
    model::{LandmarkId, LandmarkModel},
    params::Params,
    recognise::{IconFeatures, features},
};

/// Views that a landmark is learnt from, as the server wants them.
const VIEWS: usize = 30;
/// Other posters of the map, which the landmark must be told from.
const OTHERS: u64 = 3;
/// Pictures of one's own are reduced to about this longer side: as fine as rendered posters.
const SIDE_PX: usize = 640;

impl Args {
    /// The landmark that is drawn.
    pub(super) fn landmark(&self) -> anyhow::Result<Landmark> {
        let poster = Landmark::poster(self.seed);
        match &self.image {
            Some(path) => {
                let texture = texture(path).with_context(|| path.display().to_string())?;
                Ok(Landmark { texture, ..poster })
            }
            None => Ok(poster),
        }
    }
}

fn texture(path: &std::path::Path) -> anyhow::Result<Texture> {
    let gray = pictures::read(path)?;
    let small = reduce(&gray, working_factor(&gray, SIDE_PX).max(1));
    Ok(Texture::new(small.width(), small.height(), small.data().to_vec(), Edge::Clamp))
}

/// A picture and the wall that it hangs on.
#[derive(Clone)]
pub(crate) struct Landmark {
    pub(crate) texture: Texture,
    wall: Texture,
    seed: u64,
}

/// What was learnt of a landmark.
pub(crate) struct Taught {
    pub(crate) photograph: Exhibit,
    /// The photograph and the views generated from it.
    pub(crate) views: Vec<TrainingView>,
    pub(crate) model: LandmarkModel,
}

impl Landmark {
    /// The poster of a seed.
    pub(crate) fn poster(seed: u64) -> Self {
        Self { texture: poster(seed), wall: plaster(seed), seed }
    }

    /// Another picture on the same wall, with other noise.
    pub(crate) fn with(&self, texture: Texture) -> Self {
        Self { texture, wall: self.wall.clone(), seed: self.seed + 1 }
    }

    /// The poster of another seed on the same wall.
    pub(crate) fn other(&self, number: u64) -> Self {
        self.with(poster(self.seed + 1000 * number))
    }

    /// Seen under `conditions`.
    pub(crate) fn seen(&self, conditions: &Conditions) -> anyhow::Result<Exhibit> {
        exhibit(&self.texture, &self.wall, conditions, Extent::Around, self.seed)
            .context("the picture does not lie within the camera's image")
    }

    /// A photograph nearly from the front, as a person takes it to teach.
    pub(crate) fn photograph(&self) -> anyhow::Result<Exhibit> {
        self.seen(&Conditions { size_px: 230.0, yaw_rad: 0.1, ..plain() })
    }

    /// Learns it from its photograph, beside other posters.
    pub(crate) fn taught(&self, p: &Params) -> anyhow::Result<Taught> {
        let mut all = vec![self.clone()];
        all.extend((1..=OTHERS).map(|number| self.other(number)));
        let mut models = Self::together(&all, p)?;
        let photograph = self.photograph()?;
        let views = self.views(&photograph, p)?;
        Ok(Taught { photograph, views, model: models.swap_remove(0) })
    }

    /// Learns each of `all` from its photograph, number i is landmark i; the others are what it
    /// must be told from.
    pub(crate) fn together(all: &[Self], p: &Params) -> anyhow::Result<Vec<LandmarkModel>> {
        let photographs = all.iter().map(Self::photograph).collect::<anyhow::Result<Vec<_>>>()?;
        let views = all.iter().zip(&photographs).map(|(l, seen)| l.views(seen, p));
        let views = views.collect::<anyhow::Result<Vec<_>>>()?;
        let of = |views: &Vec<TrainingView>| -> Vec<IconFeatures> {
            views.iter().map(|v| features(v.icon.clone(), &p.recognise)).collect()
        };
        let icons: Vec<Vec<IconFeatures>> = views.iter().map(of).collect();
        let learnt = (0..all.len()).map(|i| {
            let others = icons.iter().enumerate().filter(|(other, _)| *other != i);
            let negatives: Vec<IconFeatures> = others.flat_map(|(_, icons)| icons.clone()).collect();
            let seen = &photographs[i];
            let model = learn(LandmarkId(i as u64), &views[i], &negatives, p)?;
            Ok(model.with_points(&points_of(&[(&seen.image, &seen.corners)])))
        });
        learnt.collect()
    }

    fn views(&self, photograph: &Exhibit, p: &Params) -> anyhow::Result<Vec<TrainingView>> {
        let first = TrainingView::photographed(&photograph.image, &photograph.corners, p)?;
        let generated = synthesis::views(&photograph.image, &photograph.corners, VIEWS - 1, p, self.seed);
        Ok(std::iter::once(first).chain(generated).collect())
    }
}

impl Taught {
    /// The exemplar that is nearest to an icon by C^r.
    pub(crate) fn nearest(&self, seen: &IconFeatures, p: &Params) -> Icon {
        let of = |i: &usize| {
            let own = self.model.exemplars[*i].features(&p.recognise);
            vision::recognise::features::correlation::correlation(
                &seen.buckets,
                &own.buckets,
                &p.recognise.correlation,
            )
        };
        let nearest = (0..self.model.exemplars.len()).min_by(|a, b| of(a).total_cmp(&of(b)));
        self.model.exemplars[nearest.unwrap_or(0)].icon()
    }
}

/// A camera as robots have them, in even light.
pub(crate) fn plain() -> Conditions {
    Conditions {
        sensor: sim::sensor::SensorParams {
            blur_sigma_px: 0.5,
            read_noise: 1.5,
            shot_noise: 0.012,
            ..sim::sensor::SensorParams::ideal()
        },
        wall: 0.9,
        ..Conditions::default()
    }
}

/// The view that most pictures are drawn of: from the side, darker, lit unevenly.
pub(crate) fn oblique() -> Conditions {
    let base = plain();
    Conditions {
        yaw_rad: -0.55,
        pitch_rad: 0.08,
        roll_rad: 0.03,
        size_px: 210.0,
        side_light: 0.35,
        sensor: sim::sensor::SensorParams { exposure: 1.15, ..base.sensor.clone() },
        ..base
    }
}
