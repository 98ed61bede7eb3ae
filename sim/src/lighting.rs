//! Light: lamps under the ceiling, falling off with the square of the distance, and the diffuse
//! rest. Baked once per surface into a coarse grid; no shadows.

use nalgebra::{Isometry3, Point3};

/// Spacing of the baked grid.
const CELL_M: f64 = 0.25;
/// Most grid cells a side.
const MAX_CELLS: usize = 512;
/// Share of light that comes from everywhere.
const DIFFUSE: f64 = 0.5;

/// A lamp that shines downwards.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lamp {
    /// Position, map frame.
    pub(crate) position_m: Point3<f64>,
    /// Strength; 1 is usual.
    pub(crate) power: f64,
}

/// Light over a surface, bilinear between grid points; 1 shows a texture as it is.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LightMap {
    columns: usize,
    rows: usize,
    pub(super) light: Vec<f32>,
}

impl LightMap {
    pub(crate) fn uniform(light: f32) -> Self {
        Self { columns: 1, rows: 1, light: vec![light] }
    }

    /// Light at the relative position (0 to 1, right and down).
    pub(crate) fn at(&self, s: f32, t: f32) -> f32 {
        if self.light.len() == 1 {
            return self.light[0];
        }
        let x = (s * self.columns as f32 - 0.5).clamp(0.0, (self.columns - 1) as f32);
        let y = (t * self.rows as f32 - 0.5).clamp(0.0, (self.rows - 1) as f32);
        let (u, v) = (x as usize, y as usize);
        let (u1, v1) = ((u + 1).min(self.columns - 1), (v + 1).min(self.rows - 1));
        let (a, b) = (x - u as f32, y - v as f32);
        let at = |u: usize, v: usize| self.light[v * self.columns + u];
        (at(u, v) * (1.0 - a) + at(u1, v) * a) * (1.0 - b) + (at(u, v1) * (1.0 - a) + at(u1, v1) * a) * b
    }
}

/// All lamps of a building.
pub(crate) struct Lighting {
    lamps: Vec<Lamp>,
}

impl Lighting {
    pub(crate) fn new(lamps: Vec<Lamp>) -> Self {
        Self { lamps }
    }

    pub(crate) fn bake(&self, map_from_surface: &Isometry3<f64>, width_m: f64, height_m: f64) -> LightMap {
        if self.lamps.is_empty() {
            return LightMap::uniform(1.0);
        }
        let cells = |size: f64| ((size / CELL_M).ceil() as usize).clamp(1, MAX_CELLS);
        let (columns, rows) = (cells(width_m), cells(height_m));
        let normal = map_from_surface.rotation * nalgebra::Vector3::x();
        let light = |i: usize| {
            let s = ((i % columns) as f64 + 0.5) / columns as f64 - 0.5;
            let t = 0.5 - ((i / columns) as f64 + 0.5) / rows as f64;
            let p = map_from_surface * Point3::new(0.0, s * width_m, t * height_m);
            (DIFFUSE + self.lamps.iter().map(|l| direct(l, &p, &normal)).sum::<f64>()) as f32
        };
        LightMap { columns, rows, light: (0..columns * rows).map(light).collect() }
    }
}

fn direct(lamp: &Lamp, p: &Point3<f64>, normal: &nalgebra::Vector3<f64>) -> f64 {
    let to_lamp = lamp.position_m - p;
    let d2 = to_lamp.norm_squared().max(0.25);
    let d = d2.sqrt();
    let (received, emitted) = (normal.dot(&to_lamp) / d, to_lamp.z / d);
    lamp.power * received.max(0.0) * emitted.max(0.0) / d2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_falls_off_with_the_square_of_the_distance() {
        let up = nalgebra::Vector3::z();
        let lamp = Lamp { position_m: Point3::new(0.0, 0.0, 4.0), power: 1.0 };
        let near = direct(&lamp, &Point3::new(0.0, 0.0, 3.0), &up);
        let far = direct(&lamp, &Point3::new(0.0, 0.0, 2.0), &up);
        assert!((near / far - 4.0).abs() < 1e-12);
        assert!(direct(&lamp, &Point3::new(0.0, 0.0, 2.0), &-up).abs() < 1e-12, "lit from behind");
    }

    #[test]
    fn the_baked_grid_equals_the_formula_at_its_points() {
        let lighting = Lighting::new(vec![Lamp { position_m: Point3::new(1.0, 0.5, 2.0), power: 1.0 }]);
        let map = lighting.bake(&Isometry3::identity(), 1.0, 1.0);
        let p = Point3::new(0.0, -0.125, 0.375);
        let expected = DIFFUSE + direct(&lighting.lamps[0], &p, &nalgebra::Vector3::x());
        assert!((f64::from(map.at(1.5 / 4.0, 0.5 / 4.0)) - expected).abs() < 1e-6);
    }
}
