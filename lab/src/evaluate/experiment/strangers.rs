//! Pictures that are in no map: what a robot sees besides its landmarks, in strata from the ordinary to the nasty. A
//! class in, textures with the name of their stratum out.

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

/// A stranger.
#[derive(Debug, Clone)]
pub(crate) struct Stranger {
    pub(crate) stratum: &'static str,
    /// Made from a landmark of the map on purpose.
    pub(crate) hard: bool,
    pub(crate) texture: Arc<Texture>,
}

/// Landmarks of which each kind of look-alike is made, at most.
const DOUBLES: usize = 20;
/// Posters of strangers are numbered from here on: no map has as many landmarks.
const FIRST_POSTER: usize = 10_000;

/// As many posters that are not taught, `photographs`, things of the building itself, and look-alikes of landmarks.
pub(crate) fn strangers(
    class: &Class,
    photographs: &[Picture],
    posters: u32,
    common: &Common,
) -> Vec<Stranger> {
    let numbers: Vec<usize> = (0..posters as usize).collect();
    let mut all = of_each(&numbers, "strangers", |_, i| {
        let texture = generated(common.part, common.seed, FIRST_POSTER + i).texture;
        Stranger { stratum: "posters", hard: false, texture }
    });
    let picture = |p: &Picture| Stranger { stratum: "photographs", hard: false, texture: p.texture.clone() };
    all.extend(photographs.iter().map(picture));
    let rooms: Vec<u64> = (0..u64::from(posters / 10).max(1)).collect();
    all.extend(
        of_each(&rooms, "strangers", |_, i| building(mixed(&[common.seed, 7, *i]))).into_iter().flatten(),
    );
    let taught: Vec<_> = class.active().take(DOUBLES).collect();
    all.extend(
        of_each(&taught, "look-alikes", |_, (id, picture)| doubles(picture, mixed(&[common.seed, 8, id.0])))
            .into_iter()
            .flatten(),
    );
    let pairs = taught.windows(2).map(|pair| Stranger {
        stratum: "halves of two landmarks",
        hard: true,
        texture: Arc::new(halves(&pair[0].1.texture, &pair[1].1.texture)),
    });
    all.extend(pairs);
    all
}

/// What else is four-sided in a building.
fn building(seed: u64) -> Vec<Stranger> {
    use surfaces::{ceiling_panels, concrete, door, floor_tiles, plaster, window};
    [door(seed), window(seed), plaster(seed), floor_tiles(seed), concrete(seed), ceiling_panels(seed)]
        .map(|texture| Stranger { stratum: "the building", hard: false, texture: Arc::new(texture) })
        .into()
}

/// The doubles of a taught picture, of all kinds but doors, which have nothing of it.
fn doubles(picture: &Picture, seed: u64) -> Vec<Stranger> {
    let kinds = LookAlikeKind::ALL.into_iter().filter(|c| *c != LookAlikeKind::Doors);
    let double = |change: LookAlikeKind| {
        let [_, double] = lookalikes(&picture.texture, change, seed);
        Stranger { stratum: change.name(), hard: true, texture: Arc::new(double) }
    };
    kinds.map(double).collect()
}
