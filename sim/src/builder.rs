//! Builds a building: walls, floors, ceilings, objects on walls, lamps; then computes the light.

use crate::{
    building::{Building, LandmarkKind, LandmarkTruth, MAX_SURFACES, Surface},
    lighting::{Lamp, LightMap, Lighting},
    texture::Texture,
    wall::WallSegment,
};
use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use std::sync::Arc;

/// An object to hang on a wall.
#[derive(Debug, Clone)]
pub(crate) struct WallObject {
    pub(crate) name: String,
    pub(crate) kind: Option<LandmarkKind>,
    pub(crate) size_m: [f64; 2],
    /// Height of its centre above the floor, metres.
    pub(crate) centre_z_m: f64,
    /// Distance of its face from the wall, metres.
    pub(crate) stand_off_m: f64,
    pub(crate) texture: Arc<Texture>,
}

/// A building under construction.
#[derive(Debug)]
pub(crate) struct Builder {
    height_m: f64,
    surfaces: Vec<Surface>,
    walls: Vec<WallSegment>,
    landmarks: Vec<LandmarkTruth>,
    lamps: Vec<Lamp>,
}

impl Builder {
    pub(crate) fn new(height_m: f64) -> Self {
        Self { height_m, surfaces: vec![], walls: vec![], landmarks: vec![], lamps: vec![] }
    }

    /// Adds a wall over the whole height; the room is on the left of a to b. The texture repeats
    /// every `texture_m`.
    pub(crate) fn wall(
        &mut self,
        a_m: [f64; 2],
        b_m: [f64; 2],
        texture: &Arc<Texture>,
        texture_m: f64,
    ) -> WallSegment {
        let wall = WallSegment { a_m: a_m.into(), b_m: b_m.into() };
        let (name, size) = (format!("wall-{}", self.walls.len()), [wall.length_m(), self.height_m]);
        let object = WallObject {
            name,
            kind: None,
            size_m: size,
            centre_z_m: 0.5 * self.height_m,
            stand_off_m: 0.0,
            texture: texture.clone(),
        };
        self.hang(&wall, 0.5 * wall.length_m(), &object);
        if let Some(surface) = self.surfaces.last_mut() {
            surface.texture_m = [texture_m, texture_m];
        }
        self.walls.push(wall);
        wall
    }

    /// Hangs an object with its centre `along_m` from the wall's end a.
    pub(crate) fn hang(&mut self, wall: &WallSegment, along_m: f64, object: &WallObject) {
        let n = wall.normal();
        let foot = wall.a_m + wall.direction() * along_m + n * object.stand_off_m;
        let map_from_surface = Isometry3::from_parts(
            Translation3::new(foot.x, foot.y, object.centre_z_m),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), n.y.atan2(n.x)),
        );
        self.add(map_from_surface, object, false);
    }

    /// Adds a floor (normal up) or a ceiling (normal down) from corner to opposite corner.
    pub(crate) fn level(
        &mut self,
        name: &str,
        [low, high]: [[f64; 2]; 2],
        z_m: f64,
        up: bool,
        texture: (&Arc<Texture>, f64),
    ) {
        let size_m = [high[1] - low[1], high[0] - low[0]];
        let centre = Vector3::new(f64::midpoint(low[0], high[0]), f64::midpoint(low[1], high[1]), z_m);
        let object = WallObject {
            name: name.into(),
            kind: None,
            size_m,
            centre_z_m: z_m,
            stand_off_m: 0.0,
            texture: texture.0.clone(),
        };
        self.add(lying(centre, up), &object, false);
        if let Some(surface) = self.surfaces.last_mut() {
            surface.texture_m = [texture.1, texture.1];
        }
    }

    /// Adds a lamp just below the ceiling, centred at (x, y), `size_m` along y and x.
    pub(crate) fn lamp(&mut self, centre_m: [f64; 2], size_m: [f64; 2], power: f64, texture: &Arc<Texture>) {
        let centre = Vector3::new(centre_m[0], centre_m[1], self.height_m - 0.01);
        let object = WallObject {
            name: format!("lamp-{}", self.lamps.len()),
            kind: Some(LandmarkKind::Lamp),
            size_m,
            centre_z_m: centre.z,
            stand_off_m: 0.0,
            texture: texture.clone(),
        };
        self.add(lying(centre, false), &object, true);
        self.lamps.push(Lamp { position_m: centre.into(), power });
    }

    fn add(&mut self, map_from_surface: Isometry3<f64>, object: &WallObject, glows: bool) {
        if self.surfaces.len() >= MAX_SURFACES {
            return;
        }
        let [width_m, height_m] = object.size_m;
        let landmark = object.kind.map(|kind| {
            let name = object.name.clone();
            self.landmarks.push(LandmarkTruth {
                name,
                kind,
                map_from_landmark: map_from_surface,
                width_m,
                height_m,
            });
            self.landmarks.len() - 1
        });
        self.surfaces.push(Surface {
            name: object.name.clone(),
            map_from_surface,
            width_m,
            height_m,
            texture: object.texture.clone(),
            texture_m: object.size_m,
            landmark,
            glows,
            light: LightMap::uniform(1.0),
        });
    }

    /// Computes the light and returns the building.
    pub(crate) fn finish(self) -> Building {
        let mut surfaces = self.surfaces;
        let lighting = Lighting::new(self.lamps);
        for surface in surfaces.iter_mut().filter(|s| !s.glows) {
            surface.light = lighting.bake(&surface.map_from_surface, surface.width_m, surface.height_m);
        }
        normalise(&mut surfaces);
        Building { surfaces, walls: self.walls, landmarks: self.landmarks }
    }
}

/// Frame of a horizontal surface: z (the picture's up) along map x; y along -map y on a floor, +map
/// y on a ceiling.
fn lying(centre_m: Vector3<f64>, up: bool) -> Isometry3<f64> {
    let x = Vector3::new(0.0, 0.0, if up { 1.0 } else { -1.0 });
    let z = Vector3::x();
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, z.cross(&x), z]));
    Isometry3::from_parts(centre_m.into(), UnitQuaternion::from_rotation_matrix(&rotation))
}

/// Mean light over the surfaces that are no lamps, after normalisation: keeps white plaster below
/// saturation.
const MEAN_LIGHT: f32 = 0.9;

/// Scales all light so that its mean over the area of lit surfaces is [`MEAN_LIGHT`]. Without lamps
/// all stays 1.
pub(crate) fn normalise(surfaces: &mut [Surface]) {
    let lit = |s: &&Surface| !s.glows && s.light.light.len() > 1;
    let (mut sum, mut area) = (0.0, 0.0);
    for s in surfaces.iter().filter(lit) {
        let size = (s.width_m * s.height_m) as f32;
        sum += size * s.light.light.iter().sum::<f32>() / s.light.light.len() as f32;
        area += size;
    }
    if area <= 0.0 || sum <= 0.0 {
        return;
    }
    let scale = MEAN_LIGHT * area / sum;
    for s in surfaces.iter_mut().filter(|s| !s.glows) {
        s.light.light.iter_mut().for_each(|l| *l *= scale);
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::building::rectangle;
    use crate::texture::Edge;
    use nalgebra::{Point2, Point3, Vector2};

    /// One rectangle `width_m` x `height_m` of a texture in the plane x = 0, lit evenly, facing +x,
    /// centre at z = 1.
    pub(crate) fn one_rectangle(width_m: f64, height_m: f64, texture: Texture) -> Building {
        let mut builder = Builder::new(4.0);
        let wall = WallSegment { a_m: Point2::new(0.0, 5.0), b_m: Point2::new(0.0, -5.0) };
        let object = WallObject {
            name: "poster-0".into(),
            kind: Some(LandmarkKind::Poster),
            size_m: [width_m, height_m],
            centre_z_m: 1.0,
            stand_off_m: 0.0,
            texture: Arc::new(texture),
        };
        builder.hang(&wall, 5.0, &object);
        builder.finish()
    }

    #[test]
    fn coordinate_frames_are_those_of_the_method() {
        let mut builder = Builder::new(3.0);
        let texture = Arc::new(Texture::new(1, 1, vec![100], Edge::Repeat));
        // A room on the left of a -> b: the wall y = 2, viewed from smaller y.
        let wall = builder.wall([4.0, 2.0], [0.0, 2.0], &texture, 1.0);
        assert!((wall.normal() - Vector2::new(0.0, -1.0)).norm() < 1e-12);
        builder.level("floor", [[0.0, 0.0], [4.0, 2.0]], 0.0, true, (&texture, 1.0));
        builder.level("ceiling", [[0.0, 0.0], [4.0, 2.0]], 3.0, false, (&texture, 1.0));
        let building = builder.finish();
        let corners = |i: usize| {
            let s = &building.surfaces()[i];
            rectangle(s.width_m, s.height_m).map(|p| s.map_from_surface * p)
        };
        // Looking along +y at the wall, x is to the right.
        let tl = corners(0)[0];
        assert!((tl - Point3::new(0.0, 2.0, 3.0)).norm() < 1e-12, "{tl}");
        for (i, z) in [(1, 0.0), (2, 3.0)] {
            let c = corners(i);
            assert!(c.iter().all(|p| (p.z - z).abs() < 1e-12));
            // Clockwise from the top-left, viewed from the room: the normal points into it.
            let outward = (c[3] - c[0]).cross(&(c[1] - c[0]));
            assert!(outward.z * if i == 1 { 1.0 } else { -1.0 } > 7.9);
        }
    }

    #[test]
    fn walls_block_sight_and_limit_clearance() {
        let building = Building::corridor(1);
        let (a, b) = (Point2::new(2.0, 0.0), Point2::new(20.0, 0.3));
        assert!(building.in_sight(&a, &b));
        assert!(!building.in_sight(&a, &Point2::new(2.0, 9.0)));
        assert!(building.clearance_m(&a) > 1.0 && building.clearance_m(&a) < 1.6);
    }
}
