//! Pictures that are in no map, in strata from ordinary to hard: posters, photographs, the
//! building, look-alikes. A class in, textures with the name of their stratum out.

use super::{
    Common,
    lesson::Class,
    mixed, of_each,
    pictures::{Picture, generated},
};
use sim::{
    lookalikes::{LookAlikeKind, halves, lookalikes},
    surfaces,
    texture::Texture,
};
use std::sync::Arc;

/// A picture that is no landmark of the map.
#[derive(Debug, Clone)]
pub(crate) struct Distractor {
    pub(crate) stratum: &'static str,
    /// Made from a landmark of the map on purpose.
    pub(crate) hard: bool,
    pub(crate) texture: Arc<Texture>,
}

/// Most landmarks of which look-alikes of each kind are made.
const LOOK_ALIKES: usize = 20;
/// Number of the first poster that is a distractor: no map has as many landmarks.
const FIRST_POSTER: usize = 10_000;

/// `posters` that are not taught, `photographs`, quads of the building, and look-alikes of
/// landmarks.
pub(crate) fn distractors(
    class: &Class,
    photographs: &[Picture],
    posters: u32,
    common: &Common,
) -> Vec<Distractor> {
    let numbers: Vec<usize> = (0..posters as usize).collect();
    let mut all = of_each(&numbers, "distractors", |_, i| {
        let texture = generated(common.part, common.seed, FIRST_POSTER + i).texture;
        Distractor { stratum: "posters", hard: false, texture }
    });
    let picture =
        |p: &Picture| Distractor { stratum: "photographs", hard: false, texture: p.texture.clone() };
    all.extend(photographs.iter().map(picture));
    let rooms: Vec<u64> = (0..u64::from(posters / 10).max(1)).collect();
    all.extend(
        of_each(&rooms, "distractors", |_, i| building(mixed(&[common.seed, 7, *i]))).into_iter().flatten(),
    );
    let taught: Vec<_> = class.active().take(LOOK_ALIKES).collect();
    all.extend(
        of_each(&taught, "look-alikes", |_, (id, picture)| {
            look_alikes(picture, mixed(&[common.seed, 8, id.0]))
        })
        .into_iter()
        .flatten(),
    );
    let pairs = taught.windows(2).map(|pair| Distractor {
        stratum: "halves of two landmarks",
        hard: true,
        texture: Arc::new(halves(&pair[0].1.texture, &pair[1].1.texture)),
    });
    all.extend(pairs);
    all
}

/// Doors, windows and other quads of a building.
fn building(seed: u64) -> Vec<Distractor> {
    use surfaces::{ceiling_panels, concrete, door, floor_tiles, plaster, window};
    [door(seed), window(seed), plaster(seed), floor_tiles(seed), concrete(seed), ceiling_panels(seed)]
        .map(|texture| Distractor { stratum: "the building", hard: false, texture: Arc::new(texture) })
        .into()
}

/// The look-alikes of a taught picture, of all kinds but doors, which share nothing with it.
fn look_alikes(picture: &Picture, seed: u64) -> Vec<Distractor> {
    let kinds = LookAlikeKind::ALL.into_iter().filter(|c| *c != LookAlikeKind::Doors);
    let look_alike = |change: LookAlikeKind| {
        let [_, look_alike] = lookalikes(&picture.texture, change, seed);
        Distractor { stratum: change.name(), hard: true, texture: Arc::new(look_alike) }
    };
    kinds.map(look_alike).collect()
}
