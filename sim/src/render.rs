//! The camera's view of a building: visibility, textures filtered over each pixel's footprint,
//! light, sensor; and the exact truth of the picture. Same building, camera, pose, parameters and
//! seed: same bytes.

use nalgebra::Isometry3;
use vision::frame::GrayImage;

use crate::building::{Building, Surface};
use crate::camera::Camera;
use crate::raster::{self, Raster, View};
use crate::sensor::{self, SensorParams};
use crate::texture::Footprint;
use crate::truth::{self, FrameTruth};

/// A picture with its truth.
#[derive(Debug, Clone, PartialEq)]
pub struct Rendered {
    /// The rendered image.
    pub image: GrayImage,
    /// Camera pose, landmarks and corners.
    pub truth: FrameTruth,
}

/// Renders for one camera; it keeps buffers from frame to frame and no other state.
#[derive(Debug, Clone)]
pub struct Renderer {
    camera: Camera,
    raster: Raster,
    light: Vec<f32>,
}

impl Renderer {
    /// A renderer for one camera, with its buffers.
    pub fn new(camera: Camera) -> Self {
        let pixels = camera.width_px() * camera.height_px();
        Self { camera, raster: Raster::new(pixels), light: vec![0.0; pixels] }
    }

    /// The camera of the renderer.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The picture from a pose (camera frame: x right, y down, z forward). `seed` is for the noise
    /// alone.
    pub fn render(
        &mut self,
        building: &Building,
        map_from_camera: &Isometry3<f64>,
        sensor: &SensorParams,
        seed: u64,
    ) -> Rendered {
        self.raster.draw(building.surfaces(), &self.camera, map_from_camera);
        let views = std::mem::take(&mut self.raster.views);
        let shaders: Vec<Shader> = views.iter().map(|v| Shader::new(v, building)).collect();
        self.raster.views = views;
        self.light.resize(self.camera.width_px() * self.camera.height_px(), 0.0);
        for pixel in 0..self.light.len() {
            let (ray, jacobian) = (self.camera.undistorted(pixel), self.camera.jacobian(pixel));
            let mut sum = 0.0;
            self.raster.resolve(pixel, &self.camera, |view, share| {
                sum += share * shaders[view].light(ray, &jacobian);
            });
            self.light[pixel] = sum;
        }
        let truth = self.truth(building, map_from_camera);
        Rendered { image: sensor::expose(&mut self.light, self.camera.width_px(), sensor, seed), truth }
    }

    fn truth(&self, building: &Building, map_from_camera: &Isometry3<f64>) -> FrameTruth {
        let mut areas = vec![[0.0; 2]; building.landmarks().len()];
        for (i, view) in self.raster.views.iter().enumerate() {
            if let Some(landmark) = building.surfaces()[usize::from(view.index)].landmark {
                areas[landmark] = [self.raster.covered_px[i], self.raster.visible_px[i]];
            }
        }
        let view = |(l, areas)| truth::landmark_view(l, &self.camera, map_from_camera, areas);
        let landmarks = building.landmarks().iter().zip(areas).filter_map(view).collect();
        FrameTruth { map_from_camera: *map_from_camera, landmarks }
    }
}

/// A view with its texture and light.
struct Shader<'a> {
    view: View,
    surface: &'a Surface,
    /// Repetitions of the texture over the surface, across and down.
    repeats: [f32; 2],
}

impl<'a> Shader<'a> {
    fn new(view: &View, building: &'a Building) -> Self {
        let surface = &building.surfaces()[usize::from(view.index)];
        let repeats = [
            (surface.width_m / surface.texture_m[0]) as f32,
            (surface.height_m / surface.texture_m[1]) as f32,
        ];
        Self { view: view.clone(), surface, repeats }
    }

    /// Light from this surface into a pixel, in grey levels.
    fn light(&self, ray: [f32; 2], j: &[[f32; 2]; 2]) -> f32 {
        let View { s: fs, t: ft, w: fw, .. } = &self.view;
        let depth = 1.0 / raster::at(fw, ray).max(1e-9);
        // On an edge the pixel's centre may lie beyond the surface.
        let (s, t) = (raster::at(fs, ray) * depth, raster::at(ft, ray) * depth);
        let (s, t) = (s.clamp(0.0, 1.0), t.clamp(0.0, 1.0));
        let slope = |f: &[f32; 3], value: f32, i: usize| (f[i] - value * fw[i]) * depth;
        let (su, sv) = (slope(fs, s, 0) * self.repeats[0], slope(fs, s, 1) * self.repeats[0]);
        let (tu, tv) = (slope(ft, t, 0) * self.repeats[1], slope(ft, t, 1) * self.repeats[1]);
        let footprint = Footprint {
            du: [su * j[0][0] + sv * j[1][0], tu * j[0][0] + tv * j[1][0]],
            dv: [su * j[0][1] + sv * j[1][1], tu * j[0][1] + tv * j[1][1]],
        };
        let grey = self.surface.texture.sample(s * self.repeats[0], t * self.repeats[1], &footprint);
        grey * self.surface.light.at(s, t)
    }
}
