//! Look-alikes: pairs of pictures that are nearly equal, such as two editions of a poster, two
//! doors of a corridor, a mirror image. In: a picture and a kind of change. Out: the pair.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::{
    canvas::{Area, Canvas},
    posters::{poster, word},
    seed, surfaces,
    texture::{Edge, Texture},
};

/// How two look-alikes differ.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LookAlikeKind {
    /// Another line of letters in a band over the lower part: 12 % of the area.
    Text,
    /// One of 5 x 5 blocks is replaced.
    Block,
    /// A quarter of the area is replaced.
    Quarter,
    /// The right half is replaced.
    Half,
    /// The same drawing printed in other tones.
    Tone,
    /// Mirrored, left to right.
    Mirrored,
    /// Two doors of one corridor: the same but for the number on the plate.
    Doors,
}

impl LookAlikeKind {
    /// All kinds, in the order of tables.
    pub const ALL: [Self; 7] =
        [Self::Text, Self::Block, Self::Quarter, Self::Half, Self::Tone, Self::Mirrored, Self::Doors];

    /// Name for tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Text => "text",
            Self::Block => "one block",
            Self::Quarter => "a quarter",
            Self::Half => "a half",
            Self::Tone => "tones",
            Self::Mirrored => "mirrored",
            Self::Doors => "doors",
        }
    }
}

/// Two pictures that differ by `change`: `picture` (for doors a door; for text with a line of
/// letters) and its look-alike.
pub fn lookalikes(picture: &Texture, change: LookAlikeKind, draw: u64) -> [Texture; 2] {
    let mut rng = seed::stream(draw, 0x6c6f_6f6b);
    match change {
        LookAlikeKind::Text => [0, 1].map(|_| lettered(picture, &mut rng)),
        LookAlikeKind::Block => {
            let corner = [0, 1].map(|_| 0.2 * f32::from(rng.random_range(0..5_u8)));
            [
                picture.clone(),
                replaced(picture, [corner[0], corner[1], corner[0] + 0.2, corner[1] + 0.2], &mut rng),
            ]
        }
        LookAlikeKind::Quarter => {
            let corner = [0, 1].map(|_| 0.5 * f32::from(rng.random_range(0..2_u8)));
            [
                picture.clone(),
                replaced(picture, [corner[0], corner[1], corner[0] + 0.5, corner[1] + 0.5], &mut rng),
            ]
        }
        LookAlikeKind::Half => [picture.clone(), replaced(picture, [0.5, 0.0, 1.0, 1.0], &mut rng)],
        LookAlikeKind::Tone => {
            let (low, power) = (rng.random_range(0.0..0.25_f32), rng.random_range(0.45..2.2_f32));
            [picture.clone(), mapped(picture, |_, _, grey| low + (1.0 - low) * grey.powf(power))]
        }
        LookAlikeKind::Mirrored => {
            let last = picture.width() - 1;
            let mirrored = mapped_from(picture, |u, v| (last - u, v));
            [picture.clone(), mirrored]
        }
        LookAlikeKind::Doors => {
            let numbers: [u32; 2] = [0, 1].map(|_| rng.random_range(100..400));
            let door = rng.random();
            [numbers[0], numbers[1] + u32::from(numbers[0] == numbers[1])]
                .map(|number| surfaces::numbered_door(door, number))
        }
    }
}

/// A band with a line of letters over the lower part.
fn lettered(picture: &Texture, rng: &mut ChaCha8Rng) -> Texture {
    let mut canvas = Canvas::of(picture);
    let band = canvas.area().part(0.05, 0.82, 0.95, 0.95);
    canvas.rect(band, 0.92);
    let letters = rng.random_range(6..=9);
    let text = word(rng, letters);
    let height = (band.width() * 7.0 / (6.0 * letters as f32)).min(0.8 * band.height());
    canvas.text([band.x0 + 0.02, band.y0 + 0.1 * band.height()], height, &text, 0.06);
    canvas.into_texture(Edge::Clamp)
}

/// The part left, top, right, bottom (0 to 1) from another poster.
fn replaced(picture: &Texture, [left, top, right, bottom]: [f32; 4], rng: &mut ChaCha8Rng) -> Texture {
    let other = poster(rng.random());
    let inside = |s: f32, t: f32| s >= left && s < right && t >= top && t < bottom;
    let other = Canvas::of(&other);
    mapped(picture, |s, t, grey| if inside(s, t) { other.grey_at(s, t) } else { grey })
}

/// A texture of `f(s, t, grey)`: position 0 to 1, right and down; grey 0 to 1.
fn mapped(picture: &Texture, f: impl Fn(f32, f32, f32) -> f32) -> Texture {
    let (width, height) = (picture.width(), picture.height());
    let texel = |i: usize| {
        let (s, t) = (((i % width) as f32 + 0.5) / width as f32, ((i / width) as f32 + 0.5) / height as f32);
        (f(s, t, f32::from(picture.data()[i]) / 255.0).clamp(0.0, 1.0) * 255.0 + 0.5) as u8
    };
    Texture::new(width, height, (0..width * height).map(texel).collect(), Edge::Clamp)
}

/// A texture with every texel taken from another position.
fn mapped_from(picture: &Texture, from: impl Fn(usize, usize) -> (usize, usize)) -> Texture {
    let (width, height) = (picture.width(), picture.height());
    let texel = |i: usize| {
        let (u, v) = from(i % width, i / width);
        picture.data()[v * width + u]
    };
    Texture::new(width, height, (0..width * height).map(texel).collect(), Edge::Clamp)
}

/// A picture made of the left half of one and the right half of another: what a quad over two
/// neighbours shows.
pub fn halves(left: &Texture, right: &Texture) -> Texture {
    let other = Canvas::of(right);
    mapped(left, |s, t, grey| if s < 0.5 { grey } else { other.grey_at(s, t) })
}

/// The rectangle that covers a picture less its outer part, as a share of its sides: as for a quad
/// detected too far inside.
pub fn part(picture: &Texture, [left, top, right, bottom]: [f32; 4]) -> Texture {
    let canvas = Canvas::of(picture);
    let area =
        Area::new(left.clamp(0.0, 0.9), top.clamp(0.0, 0.9), right.clamp(0.1, 1.0), bottom.clamp(0.1, 1.0));
    mapped(picture, |s, t, _| {
        canvas.grey_at(area.x0 + s * (area.x1 - area.x0), area.y0 + t * (area.y1 - area.y0))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Share of the texels that differ by more than a grey level or two.
    fn differs([a, b]: &[Texture; 2]) -> f64 {
        let off = a.data().iter().zip(b.data()).filter(|(a, b)| a.abs_diff(**b) > 2).count();
        off as f64 / a.data().len() as f64
    }

    #[test]
    fn every_change_has_its_stated_area() {
        let picture = poster(7);
        for (change, low, high) in [
            (LookAlikeKind::Text, 0.01, 0.12),
            (LookAlikeKind::Block, 0.01, 0.041),
            (LookAlikeKind::Quarter, 0.08, 0.251),
            (LookAlikeKind::Half, 0.2, 0.501),
            (LookAlikeKind::Tone, 0.3, 1.0),
            (LookAlikeKind::Mirrored, 0.2, 1.0),
            (LookAlikeKind::Doors, 0.0001, 0.02),
        ] {
            let pair = lookalikes(&picture, change, 3);
            let share = differs(&pair);
            assert!(share >= low && share <= high, "{change:?}: {share}");
            assert_eq!(pair, lookalikes(&picture, change, 3));
        }
        let mirrored = lookalikes(&picture, LookAlikeKind::Mirrored, 1);
        assert_eq!(
            mirrored[0].data()[..480].iter().rev().copied().collect::<Vec<_>>(),
            mirrored[1].data()[..480]
        );
    }

    #[test]
    fn halves_and_parts_have_the_stated_texels() {
        let [dark, light] = [20_u8, 220].map(|g| Texture::new(40, 40, vec![g; 1600], Edge::Clamp));
        let both = halves(&dark, &light);
        assert!(both.data()[5] == 20 && both.data()[35] == 220);
        let right = part(&both, [0.5, 0.0, 1.0, 1.0]);
        assert!(right.data()[3..].iter().take(30).all(|g| *g == 220), "{:?}", &right.data()[..40]);
    }
}
