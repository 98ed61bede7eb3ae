//! Paints flat shapes in space onto a picture of light, one over the other. Pixels are filled by
//! the share that the projected shape covers. There is no depth buffer: later shapes are in front.

use nalgebra::{Matrix3, Point2, Vector3};
use vision::geometry::Corners;

use crate::texture::Footprint;

/// Points nearer to the camera are neither painted nor projected.
const NEAR_M: f64 = 0.05;
/// Light of full white, in grey levels at exposure 1.
const WHITE: f32 = 255.0;

/// Light on a plane: linear over it, and round spots.
#[derive(Debug, Clone, Default)]
pub(crate) struct Light {
    /// Light at the origin.
    pub(crate) base: f32,
    /// Change per metre to the right and down.
    pub(crate) slope: [f32; 2],
    /// Centre, radius, and added light of each spot.
    pub(crate) spots: Vec<([f32; 2], f32, f32)>,
}

impl Light {
    fn at(&self, [x, y]: [f32; 2]) -> f32 {
        let even = self.base + self.slope[0] * x + self.slope[1] * y;
        let spot = |(p, radius, gain): &([f32; 2], f32, f32)| {
            let r2 = ((x - p[0]).powi(2) + (y - p[1]).powi(2)) / (radius * radius).max(1e-6);
            gain / (1.0 + r2 * r2)
        };
        (even + self.spots.iter().map(spot).sum::<f32>()).clamp(0.05, 2.0)
    }
}

/// A plane in the camera's frame (x right, y down, z ahead), with coordinates in metres to the
/// right and down.
#[derive(Debug, Clone)]
pub(crate) struct Plane {
    pub(crate) origin: Vector3<f64>,
    pub(crate) right: Vector3<f64>,
    pub(crate) down: Vector3<f64>,
    pub(crate) light: Light,
}

impl Plane {
    /// Position of a point of the plane.
    pub(crate) fn at(&self, [x, y]: [f64; 2]) -> Vector3<f64> {
        self.origin + self.right * x + self.down * y
    }

    /// Whether its front (from which right is right) is towards the camera.
    pub(crate) fn faces_camera(&self) -> bool {
        self.right.cross(&self.down).dot(&self.origin) > 1e-6
    }

    /// The plane moved by `by_m` towards its front.
    pub(crate) fn raised(&self, by_m: f64) -> Self {
        Self { origin: self.origin - self.right.cross(&self.down) * by_m, ..self.clone() }
    }
}

/// A rectangle of a plane: left, top, right, bottom, m.
pub(crate) type Rect = [f64; 4];

/// Its corners, clockwise from the top-left.
pub(crate) fn corners([x0, y0, x1, y1]: Rect) -> [[f64; 2]; 4] {
    [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]
}

/// The rectangle smaller by `by` on every side.
pub(crate) fn inset([x0, y0, x1, y1]: Rect, by: f64) -> Rect {
    [x0 + by, y0 + by, x1 - by, y1 - by]
}

/// The part of a rectangle between relative positions.
pub(crate) fn part([x0, y0, x1, y1]: Rect, [a, b, c, d]: [f64; 4]) -> Rect {
    let (w, h) = (x1 - x0, y1 - y0);
    [x0 + a * w, y0 + b * h, x0 + c * w, y0 + d * h]
}

/// A picture during painting.
pub(crate) struct Painter {
    pub(crate) light: Vec<f32>,
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) focal_px: f64,
    /// The layer that last covered each pixel.
    layers: Vec<u16>,
    layer: u16,
}

impl Painter {
    pub(crate) fn new(width: usize, height: usize, focal_px: f64) -> Self {
        let n = width * height;
        Self { light: vec![110.0; n], width, height, focal_px, layers: vec![0; n], layer: 0 }
    }

    /// Begins a layer that hides all before.
    pub(crate) fn next_layer(&mut self) -> u16 {
        self.layer = self.layer.saturating_add(1);
        self.layer
    }

    /// The present layer.
    pub(crate) fn layer(&self) -> u16 {
        self.layer
    }

    /// Pixel of a point in the camera's frame; none close to the camera or behind it.
    pub(crate) fn project(&self, p: &Vector3<f64>) -> Option<Point2<f64>> {
        let centre = self.centre();
        let scale = self.focal_px / p.z;
        (p.z > NEAR_M).then(|| Point2::new(centre[0] + scale * p.x, centre[1] + scale * p.y))
    }

    /// Corners of a rectangle of a plane, if all are in front of the camera and it faces the
    /// camera.
    pub(crate) fn corners(&self, plane: &Plane, rect: Rect) -> Option<Corners> {
        let [a, b, c, d] = corners(rect).map(|p| self.project(&plane.at(p)));
        Corners::new([a?, b?, c?, d?]).ok()
    }

    /// Share of a quad within the picture that was covered after layer `layer`.
    pub(crate) fn hidden_share(&self, quad: &Corners, layer: u16) -> f64 {
        const STEPS: usize = 24;
        let [a, b, c, d] = quad.points().map(|p| p.coords);
        let (mut inside, mut hidden) = (0, 0);
        for (i, j) in (0..STEPS).flat_map(|i| (0..STEPS).map(move |j| (i, j))) {
            let (s, t) = ((i as f64 + 0.5) / STEPS as f64, (j as f64 + 0.5) / STEPS as f64);
            let p = (a * (1.0 - s) + b * s) * (1.0 - t) + (d * (1.0 - s) + c * s) * t;
            let (u, v) = (p.x.round(), p.y.round());
            if u >= 0.0 && v >= 0.0 && u < self.width as f64 && v < self.height as f64 {
                inside += 1;
                hidden += usize::from(self.layers[v as usize * self.width + u as usize] > layer);
            }
        }
        f64::from(hidden as u32) / f64::from((inside as u32).max(1))
    }

    /// Fills a convex polygon of a plane with `ink(point)`: reflectance, 0 to 1.
    pub(crate) fn paint(
        &mut self,
        plane: &Plane,
        polygon: &[[f64; 2]],
        ink: impl Fn([f32; 2], &Footprint) -> f32,
    ) {
        let layer = self.layer;
        self.cover(plane, polygon, |light, covered_by, share, at, footprint| {
            let grey = WHITE * plane.light.at(at) * ink(at, footprint);
            *light += share * (grey - *light);
            if share > 0.5 {
                *covered_by = layer;
            }
        });
    }

    /// The same for a surface that emits light.
    pub(crate) fn glow(
        &mut self,
        plane: &Plane,
        polygon: &[[f64; 2]],
        ink: impl Fn([f32; 2], &Footprint) -> f32,
    ) {
        let layer = self.layer;
        self.cover(plane, polygon, |light, covered_by, share, at, footprint| {
            *light += share * (WHITE * ink(at, footprint) - *light);
            if share > 0.5 {
                *covered_by = layer;
            }
        });
    }

    /// Adds `ink(point)` to the present reflectance.
    pub(crate) fn tint(
        &mut self,
        plane: &Plane,
        polygon: &[[f64; 2]],
        ink: impl Fn([f32; 2], &Footprint) -> f32,
    ) {
        self.cover(plane, polygon, |light, _, share, at, footprint| {
            *light = (*light + share * WHITE * plane.light.at(at) * ink(at, footprint)).max(0.0);
        });
    }

    pub(crate) fn fill(&mut self, plane: &Plane, polygon: &[[f64; 2]], grey: f32) {
        self.paint(plane, polygon, |_, _| grey);
    }

    /// Multiplies the light in a convex polygon by `factor`, with edges that are `soft_m` wide on
    /// either side.
    pub(crate) fn shade(&mut self, plane: &Plane, polygon: &[[f64; 2]], soft_m: f64, factor: f32) {
        let soft = soft_m.max(1e-4);
        let Some(lines) = inward(polygon) else { return };
        let range = |i: usize, f: fn(f64, f64) -> f64| polygon.iter().map(|p| p[i]).reduce(f).unwrap_or(0.0);
        let bounds = [range(0, f64::min), range(1, f64::min), range(0, f64::max), range(1, f64::max)];
        self.cover(plane, &corners(inset(bounds, -soft)), |light, _, share, [x, y], _| {
            let depth = lines.iter().fold(1.0, |all, [a, b, c]| {
                let d = a * f64::from(x) + b * f64::from(y) + c;
                let k = (0.5 + 0.5 * d / soft).clamp(0.0, 1.0);
                all * k * k * (3.0 - 2.0 * k)
            });
            *light *= 1.0 - share * depth as f32 * (1.0 - factor);
        });
    }

    fn centre(&self) -> [f64; 2] {
        [0.5 * (self.width as f64 - 1.0), 0.5 * (self.height as f64 - 1.0)]
    }

    /// Calls `f(light, layer, share covered, place on the plane, footprint)` for every pixel of the
    /// polygon.
    fn cover(
        &mut self,
        plane: &Plane,
        polygon: &[[f64; 2]],
        mut f: impl FnMut(&mut f32, &mut u16, f32, [f32; 2], &Footprint),
    ) {
        let visible = clipped(plane, polygon);
        let points: Vec<[f64; 2]> =
            visible.iter().filter_map(|p| self.project(&plane.at(*p))).map(|p| [p.x, p.y]).collect();
        let (Some(lines), Some(inverse)) = (inward(&points), self.plane_from_pixel(plane)) else { return };
        let range = |i: usize, size: usize| {
            let low = points.iter().map(|p| p[i]).fold(f64::INFINITY, f64::min) - 1.0;
            let high = points.iter().map(|p| p[i]).fold(f64::NEG_INFINITY, f64::max) + 2.0;
            low.clamp(0.0, size as f64) as usize..high.clamp(0.0, size as f64) as usize
        };
        let (columns, rows) = (range(0, self.width), range(1, self.height));
        for v in rows {
            for u in columns.clone() {
                let (x, y) = (u as f64, v as f64);
                let share: f64 =
                    lines.iter().map(|[a, b, c]| (0.5 + a * x + b * y + c).clamp(0.0, 1.0)).product();
                if share <= 0.0 {
                    continue;
                }
                let n = inverse * Vector3::new(x, y, 1.0);
                let (s, t) = (n.x / n.z, n.y / n.z);
                let slope = |column: usize| {
                    let d = inverse.column(column);
                    [((d[0] - s * d[2]) / n.z) as f32, ((d[1] - t * d[2]) / n.z) as f32]
                };
                let footprint = Footprint { du: slope(0), dv: slope(1) };
                let pixel = v * self.width + u;
                let at = [s as f32, t as f32];
                f(&mut self.light[pixel], &mut self.layers[pixel], share as f32, at, &footprint);
            }
        }
    }

    fn plane_from_pixel(&self, plane: &Plane) -> Option<Matrix3<f64>> {
        let [cx, cy] = self.centre();
        let k = Matrix3::new(self.focal_px, 0.0, cx, 0.0, self.focal_px, cy, 0.0, 0.0, 1.0);
        (k * Matrix3::from_columns(&[plane.right, plane.down, plane.origin])).try_inverse()
    }
}

/// The part of a polygon of a plane that is in front of the camera.
fn clipped(plane: &Plane, polygon: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let depth = |p: &[f64; 2]| plane.at(*p).z - 2.0 * NEAR_M;
    let mut in_front = Vec::with_capacity(polygon.len() + 1);
    for (i, p) in polygon.iter().enumerate() {
        let q = &polygon[(i + 1) % polygon.len()];
        let (a, b) = (depth(p), depth(q));
        if a >= 0.0 {
            in_front.push(*p);
        }
        if (a >= 0.0) != (b >= 0.0) {
            let k = a / (a - b);
            in_front.push([p[0] + k * (q[0] - p[0]), p[1] + k * (q[1] - p[1])]);
        }
    }
    in_front
}

/// Lines of a convex polygon's sides, `a x + b y + c` the distance inwards; `None` without area.
fn inward(points: &[[f64; 2]]) -> Option<Vec<[f64; 3]>> {
    let next = |i: usize| points[(i + 1) % points.len()];
    let area: f64 = (0..points.len()).map(|i| points[i][0] * next(i)[1] - next(i)[0] * points[i][1]).sum();
    if points.len() < 3 || !area.is_finite() || area.abs() < 1e-12 {
        return None;
    }
    let side = |i: usize| {
        let (p, q) = (points[i], next(i));
        let (dx, dy) = (q[0] - p[0], q[1] - p[1]);
        let length = dx.hypot(dy) * area.signum();
        let (a, b) = (-dy / length, dx / length);
        [a, b, -a * p[0] - b * p[1]]
    };
    Some((0..points.len()).map(side).filter(|l| l.iter().all(|x| x.is_finite())).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plane `z` metres ahead, parallel to the picture.
    fn wall(z: f64) -> Plane {
        let light = Light { base: 1.0, ..Light::default() };
        Plane { origin: Vector3::new(0.0, 0.0, z), right: Vector3::x(), down: Vector3::y(), light }
    }

    #[test]
    fn a_filled_rectangle_has_its_projected_area_and_corners() {
        let mut painter = Painter::new(101, 81, 100.0);
        painter.light.fill(0.0);
        let rect = [-0.203, -0.151, 0.304, 0.107];
        painter.fill(&wall(1.0), &corners(rect), 1.0);
        let sum: f64 = painter.light.iter().map(|l| f64::from(*l) / 255.0).sum();
        assert!((sum - 50.7 * 25.8).abs() < 0.01, "{sum}");
        let projected = painter.corners(&wall(1.0), rect).unwrap();
        let (tl, br) = (projected.points()[0], projected.points()[2]);
        assert!((tl - Point2::new(50.0 - 20.3, 40.0 - 15.1)).norm() < 1e-9);
        assert!((br - Point2::new(50.0 + 30.4, 40.0 + 10.7)).norm() < 1e-9);
        let column: f64 = (0..101).map(|u| f64::from(painter.light[40 * 101 + u]) / 255.0).sum();
        assert!((column - 50.7).abs() < 1e-3, "{column}");
    }

    #[test]
    fn parts_behind_the_camera_are_cut_off() {
        let mut painter = Painter::new(64, 48, 50.0);
        // A floor that reaches behind the camera.
        let floor = Plane {
            origin: Vector3::new(0.0, 1.0, 0.0),
            right: Vector3::x(),
            down: -Vector3::z(),
            light: Light { base: 1.0, ..Light::default() },
        };
        painter.fill(&floor, &corners([-9.0, -50.0, 9.0, 50.0]), 0.2);
        assert!(painter.corners(&floor, [-9.0, -50.0, 9.0, 50.0]).is_none());
        let at = |v: usize| painter.light[v * 64 + 32];
        assert!((at(47) - 51.0).abs() < 0.1 && (at(5) - 110.0).abs() < 0.1, "{} {}", at(47), at(5));
    }

    #[test]
    fn later_layers_hide_and_shadows_do_not() {
        let mut painter = Painter::new(64, 48, 50.0);
        let plane = wall(1.0);
        painter.fill(&plane, &corners([-0.4, -0.4, 0.4, 0.4]), 0.5);
        let quad = painter.corners(&plane, [-0.4, -0.4, 0.4, 0.4]).unwrap();
        painter.next_layer();
        painter.shade(&plane, &corners([-0.4, -0.4, 0.0, 0.4]), 0.02, 0.5);
        assert!(painter.hidden_share(&quad, 0) < 1e-9);
        let left = painter.light[24 * 64 + 20];
        assert!((left - 0.5 * 127.5).abs() < 0.5, "{left}");
        painter.fill(&plane, &corners([-0.4, -0.4, 0.0, 0.4]), 0.1);
        assert!((painter.hidden_share(&quad, 0) - 0.5).abs() < 0.05);
    }

    #[test]
    fn shapes_without_area_or_with_huge_numbers_paint_nothing() {
        let mut painter = Painter::new(16, 16, 20.0);
        let before = painter.light.clone();
        for shape in [vec![], vec![[0.0, 0.0]], vec![[0.0; 2]; 4], vec![[f64::NAN, 0.0]; 4]] {
            painter.fill(&wall(1.0), &shape, 1.0);
            painter.shade(&wall(1.0), &shape, 0.1, 0.0);
        }
        assert_eq!(painter.light, before);
    }
}
