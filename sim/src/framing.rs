//! A landmark of a building in, the same with a frame around its picture and with the shadow that
//! it casts on its wall out. The place and the outer size of the landmark stay.

use std::sync::Arc;

use nalgebra::{Point3, Translation3};

use crate::building::{Building, Surface};
use crate::lighting::LightMap;
use crate::texture::{Edge, Footprint, Texture};

/// Size of a texel of a shadow, metres.
const SHADOW_TEXEL_M: f64 = 0.002;
/// Distance of the shadow's layer from the landmark's face, metres: less than any landmark's from
/// its wall.
const BEHIND_M: f64 = 0.003;
/// Farthest wall behind a landmark, metres.
const WALL_WITHIN_M: f64 = 0.05;

/// A frame and its shadow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Framing {
    /// Width of the frame, metres; it is within the landmark's size.
    pub width_m: f64,
    /// Grey level of the frame; its inner fifth is a lip, twice as bright.
    pub grey: u8,
    /// How far the shadow falls to the right and downwards, metres.
    pub shadow_m: [f64; 2],
    /// Share of the light that the shadow takes, 0 to 1.
    pub darkness: f64,
    /// Width of the shadow's soft edge, metres.
    pub penumbra_m: f64,
}

impl Building {
    /// The building with this frame and shadow around the landmark `name`. Without such a landmark,
    /// or a wall within 5 cm behind it, it is the same.
    #[must_use]
    pub fn framed(mut self, name: &str, framing: &Framing) -> Self {
        let Some(index) = self.surfaces.iter().position(|s| s.landmark.is_some() && s.name == name) else {
            return self;
        };
        let Some(shadow) = self.shadow(&self.surfaces[index], framing) else { return self };
        let surface = &mut self.surfaces[index];
        surface.texture = Arc::new(frame(surface, framing));
        self.surfaces.push(shadow);
        self
    }

    /// The wall behind a landmark as a layer of its own, darker where the shadow is. Its light is
    /// in its texture.
    fn shadow(&self, landmark: &Surface, framing: &Framing) -> Option<Surface> {
        let reach = framing.shadow_m.map(f64::abs);
        let margin = reach[0].max(reach[1]) + framing.penumbra_m;
        let size_m = [landmark.width_m + 2.0 * margin, landmark.height_m + 2.0 * margin];
        let [columns, rows] = size_m.map(|m| (m / SHADOW_TEXEL_M).ceil().max(1.0) as usize);
        let behind = self.surfaces.iter().find(|s| s.landmark.is_none() && is_behind(s, landmark))?;
        let wall_from_landmark = behind.map_from_surface.inv_mul(&landmark.map_from_surface);
        let mut data = Vec::with_capacity(columns * rows);
        for i in 0..columns * rows {
            let y = (((i % columns) as f64 + 0.5) / columns as f64 - 0.5) * size_m[0];
            let z = (0.5 - ((i / columns) as f64 + 0.5) / rows as f64) * size_m[1];
            let on_wall = wall_from_landmark * Point3::new(0.0, y, z);
            let (s, t) = (on_wall.y / behind.width_m + 0.5, 0.5 - on_wall.z / behind.height_m);
            let repeats = [behind.width_m / behind.texture_m[0], behind.height_m / behind.texture_m[1]];
            let (u, v) = ((s * repeats[0]) as f32, (t * repeats[1]) as f32);
            let grey = behind.texture.sample(u, v, &Footprint::default());
            let lit = grey * behind.light.at(s as f32, t as f32);
            let inside = |d: f64, half: f64| ((half - d.abs()) / framing.penumbra_m + 0.5).clamp(0.0, 1.0);
            let [right, down] = framing.shadow_m;
            let shade = inside(y - right, 0.5 * landmark.width_m) * inside(z + down, 0.5 * landmark.height_m);
            data.push((f64::from(lit) * (1.0 - framing.darkness * shade)).round().clamp(0.0, 255.0) as u8);
        }
        Some(Surface {
            name: format!("shadow of {}", landmark.name),
            map_from_surface: landmark.map_from_surface * Translation3::new(-BEHIND_M, 0.0, 0.0),
            width_m: size_m[0],
            height_m: size_m[1],
            texture: Arc::new(Texture::new(columns, rows, data, Edge::Clamp)),
            texture_m: size_m,
            landmark: None,
            glows: true,
            light: LightMap::uniform(1.0),
        })
    }
}

/// Whether a surface is the wall that a landmark hangs on.
fn is_behind(surface: &Surface, landmark: &Surface) -> bool {
    let centre =
        surface.map_from_surface.inverse() * Point3::from(landmark.map_from_surface.translation.vector);
    let turned = surface.map_from_surface.rotation.angle_to(&landmark.map_from_surface.rotation);
    turned < 1e-6
        && (BEHIND_M..WALL_WITHIN_M).contains(&centre.x)
        && centre.y.abs() < 0.5 * surface.width_m
        && centre.z.abs() < 0.5 * surface.height_m
}

/// The landmark's picture, made smaller, within a frame.
fn frame(landmark: &Surface, framing: &Framing) -> Texture {
    let (width, height) = (landmark.texture.width(), landmark.texture.height());
    let share = [framing.width_m / landmark.width_m, framing.width_m / landmark.height_m];
    let mut data = Vec::with_capacity(width * height);
    let footprint = Footprint { du: [1.0 / width as f32, 0.0], dv: [0.0, 1.0 / height as f32] };
    for i in 0..width * height {
        let at = [(i % width) as f64 + 0.5, (i / width) as f64 + 0.5];
        let at = [at[0] / width as f64, at[1] / height as f64];
        // Into the frame from its outer edge, 1 at the picture.
        let depth = (0..2).map(|k| at[k].min(1.0 - at[k]) / share[k]).fold(f64::INFINITY, f64::min);
        data.push(if depth < 0.8 {
            framing.grey
        } else if depth < 1.0 {
            framing.grey.saturating_mul(2)
        } else {
            let inner = [0, 1].map(|k| ((at[k] - share[k]) / (1.0 - 2.0 * share[k])) as f32);
            landmark.texture.sample(inner[0], inner[1], &footprint).round() as u8
        });
    }
    Texture::new(width, height, data, Edge::Clamp)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::corridor::CorridorParams;
    use crate::{camera::Camera, render::Renderer, sensor::SensorParams};
    use map::extrinsics::pan_tilt;

    const FRAMING: Framing =
        Framing { width_m: 0.04, grey: 50, shadow_m: [0.02, 0.03], darkness: 0.5, penumbra_m: 0.004 };

    #[test]
    fn a_frame_is_around_the_picture_and_its_shadow_beside_it() {
        let plain = Building::corridor_with(&CorridorParams { width_m: 5.0, ..Default::default() }, 7);
        let framed = plain.clone().framed("poster-0", &FRAMING);
        assert_eq!(framed.landmarks(), plain.landmarks(), "its place and size stay");
        let place = plain.landmark("poster-0").expect("a poster").map_from_landmark;
        let stand = place * Point3::new(1.5, 0.0, 0.0);
        let ahead = -(place.rotation * nalgebra::Vector3::x());
        let camera = pan_tilt(ahead.y.atan2(ahead.x), 0.0, stand.coords);
        let mut renderer = Renderer::new(Camera::vga());
        let mut look = |building: &Building, [y, z]: [f64; 2]| {
            let image = renderer.render(building, &camera, &SensorParams::ideal(), 0).image;
            let p = camera.inverse() * (place * Point3::new(0.0, y, z));
            let at = renderer.camera().intrinsics().project(&p.coords);
            f64::from(image.data()[at.y.round() as usize * image.width() + at.x.round() as usize])
        };
        let ratio =
            |look: &mut dyn FnMut(&Building, [f64; 2]) -> f64, at| look(&framed, at) / look(&plain, at);
        // The poster is 0.60 x 0.84 m: the frame, the shadow on the right and below, the wall on
        // the left and above.
        assert!(look(&framed, [-0.28, 0.0]) < 0.3 * 255.0);
        assert!((ratio(&mut look, [0.31, 0.0]) - 0.5).abs() < 0.05);
        assert!((ratio(&mut look, [0.0, -0.435]) - 0.5).abs() < 0.05);
        assert!((ratio(&mut look, [-0.31, 0.0]) - 1.0).abs() < 0.02);
        assert!((ratio(&mut look, [0.0, 0.43]) - 1.0).abs() < 0.02);
    }

    #[test]
    fn without_such_a_landmark_nothing_changes() {
        let plain = Building::corridor(7);
        assert_eq!(plain.clone().framed("poster-99", &FRAMING).surfaces().len(), plain.surfaces().len());
    }
}
