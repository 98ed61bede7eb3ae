//! The room of a scene: its walls, floor and ceiling as planes, the objects on its walls, and a
//! camera aimed at one of them. Draws nothing. World frame: the main wall's top-left corner, x
//! right along it, y down, z into the wall.

use nalgebra::{Matrix3, Rotation3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::objects::SceneObject;
use super::paint::{Light, Plane, Rect};

/// Most draws of a camera that is inside the room.
const TRIES: usize = 60;
/// Most draws of a place for one object.
const PLACES: usize = 12;
/// Largest view angle of the object that the camera is aimed at.
const MAX_VIEW_RAD: f64 = 65.0 / 180.0 * std::f64::consts::PI;

/// A wall with its objects.
#[derive(Debug, Clone)]
pub(super) struct Wall {
    pub(super) width_m: f64,
    pub(super) objects: Vec<(SceneObject, Rect)>,
}

/// Sizes and contents. Walls: the main one, left, right, and the one behind the camera.
#[derive(Debug, Clone)]
pub(super) struct Room {
    pub(super) size_m: [f64; 3],
    pub(super) walls: [Wall; 4],
}

/// Pose of the camera: world to camera, and its position.
#[derive(Debug, Clone)]
pub(super) struct View {
    rotation: Matrix3<f64>,
    place: Vector3<f64>,
}

fn between(rng: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * rng.random::<f64>()
}

impl Room {
    pub(super) fn new(rng: &mut ChaCha8Rng) -> Self {
        let size_m = [between(rng, 3.0, 14.0), between(rng, 2.4, 4.5), between(rng, 2.0, 8.0)];
        let wall = |width_m| Wall { width_m, objects: vec![] };
        let walls = [wall(size_m[0]), wall(size_m[2]), wall(size_m[2]), wall(size_m[0])];
        let mut room = Self { size_m, walls };
        match rng.random_range(0..10) {
            0 | 1 => room.row(rng),
            2 => room.grid(rng),
            _ => {}
        }
        let signs = rng.random_bool(0.3);
        for _ in 0..rng.random_range(1..=6) {
            room.place(0, signs, rng);
        }
        for wall in 1..4 {
            for _ in 0..rng.random_range(0..=2) {
                room.place(wall, signs, rng);
            }
        }
        room
    }

    /// Pictures of one size side by side.
    fn row(&mut self, rng: &mut ChaCha8Rng) {
        let (w, h) = (between(rng, 0.3, 1.0), between(rng, 0.3, 1.1));
        let (gap, top) = (w * between(rng, 0.1, 0.8), (self.size_m[1] - 1.55 - 0.5 * h).max(0.2));
        let start = between(rng, 0.2, 1.0);
        let count = (((self.size_m[0] - start) / (w + gap)) as usize).min(rng.random_range(2..=6));
        let kind = if rng.random_bool(0.7) { SceneObject::Picture } else { SceneObject::Poster };
        for i in 0..count {
            let x = start + (w + gap) * i as f64;
            self.walls[0].objects.push((kind, [x, top, x + w, top + h]));
        }
    }

    /// Windows, pictures or boards in rows and columns.
    fn grid(&mut self, rng: &mut ChaCha8Rng) {
        let kind = [SceneObject::Picture, SceneObject::Window, SceneObject::Poster][rng.random_range(0..3)];
        let (w, h) = (between(rng, 0.25, 0.7), between(rng, 0.25, 0.7));
        let (gap, rows) = (between(rng, 0.06, 0.4), rng.random_range(2..=3));
        let (left, top) = (between(rng, 0.2, 1.2), between(rng, 0.25, 0.5));
        let columns = (((self.size_m[0] - left) / (w + gap)) as usize).min(rng.random_range(2..=5));
        for (i, j) in (0..columns).flat_map(|i| (0..rows).map(move |j| (i, j))) {
            let (x, y) = (left + (w + gap) * i as f64, top + (h + gap) * f64::from(j));
            if y + h < self.size_m[1] - 0.3 {
                self.walls[0].objects.push((kind, [x, y, x + w, y + h]));
            }
        }
    }

    fn place(&mut self, wall: usize, signs: bool, rng: &mut ChaCha8Rng) {
        let kind = match rng.random_range(0..20) {
            0..7 => SceneObject::Picture,
            7..11 => SceneObject::Poster,
            11..13 => SceneObject::Door,
            13..15 => SceneObject::Window,
            15 | 16 => SceneObject::Board,
            _ => SceneObject::Sign,
        };
        let kind = if signs && rng.random_bool(0.5) { SceneObject::Sign } else { kind };
        let margin = between(rng, 0.02, 0.15);
        for _ in 0..PLACES {
            let [x0, y0, x1, y1] = self.sized(wall, kind, rng);
            let free = |o: &Rect| {
                x1 + margin < o[0] || o[2] + margin < x0 || y1 + margin < o[1] || o[3] + margin < y0
            };
            if self.walls[wall].objects.iter().all(|t| free(&t.1)) {
                self.walls[wall].objects.push((kind, [x0, y0, x1, y1]));
                return;
            }
        }
    }

    fn sized(&self, wall: usize, kind: SceneObject, rng: &mut ChaCha8Rng) -> Rect {
        let high = self.size_m[1];
        let (w, h, centre) = match kind {
            SceneObject::Picture => {
                let h = 0.25 * f64::powf(7.0, rng.random());
                (h * between(rng, 0.5, 1.9), h, high - 1.55 + between(rng, -0.35, 0.35))
            }
            SceneObject::Poster => {
                let h = between(rng, 0.3, 1.3);
                (h * between(rng, 0.5, 1.5), h, high - 1.5 + between(rng, -0.4, 0.4))
            }
            SceneObject::Door => {
                let h = between(rng, 1.95, 2.3);
                let w = if rng.random_bool(0.2) { between(rng, 1.4, 1.9) } else { between(rng, 0.75, 1.1) };
                (w, h, high - 0.5 * h)
            }
            SceneObject::Window => {
                let h = between(rng, 0.5, 1.7);
                (h * between(rng, 0.5, 1.8), h, high - 1.5 + between(rng, -0.3, 0.2))
            }
            SceneObject::Board => {
                let w = between(rng, 0.6, 2.2);
                (w, w * between(rng, 0.45, 1.0), high - 1.5)
            }
            SceneObject::Sign => {
                let w = between(rng, 0.2, 0.6);
                (w, w * between(rng, 0.35, 0.7), high - between(rng, 1.6, 2.6))
            }
        };
        let (w, h) = (w.min(0.9 * self.walls[wall].width_m), h.min(high - 0.1));
        let x = between(rng, 0.05, self.walls[wall].width_m - w - 0.05);
        let bottom = if kind == SceneObject::Door { high } else { high - 0.05 };
        let y = (centre - 0.5 * h).clamp(0.05, bottom - h);
        [x, y, x + w, y + h]
    }

    /// The planes of the walls, then floor and ceiling, in the camera's frame.
    pub(super) fn planes(&self, view: &View, light: &[Light; 6]) -> [Plane; 6] {
        let [width, high, deep] = self.size_m;
        let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
        let frames: [Frame; 6] = [
            [Vector3::zeros(), x, y],
            [Vector3::new(0.0, 0.0, -deep), z, y],
            [Vector3::new(width, 0.0, 0.0), -z, y],
            [Vector3::new(width, 0.0, -deep), -x, y],
            [Vector3::new(0.0, high, 0.0), x, -z],
            [Vector3::new(0.0, 0.0, -deep), x, z],
        ];
        std::array::from_fn(|i| view.plane(&frames[i], &light[i]))
    }

    /// A camera in the room, aimed roughly at an object of the main wall.
    pub(super) fn view(&self, rng: &mut ChaCha8Rng) -> View {
        let [width, high, deep] = self.size_m;
        let objects = &self.walls[0].objects;
        let [x0, y0, x1, y1] = if objects.is_empty() {
            [0.3, 0.3, 1.0, 1.0]
        } else {
            objects[rng.random_range(0..objects.len())].1
        };
        let target = Vector3::new(0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.0);
        let size = (x1 - x0).max(y1 - y0);
        let mut place = Vector3::new(target.x, high - 1.2, -0.5 * deep);
        for _ in 0..TRIES {
            let angle = MAX_VIEW_RAD * between(rng, -1.0, 1.0);
            let distance = (size * 1.5 * f64::powf(6.0, rng.random())).max(0.6);
            let (s, c) = angle.sin_cos();
            let eye = (high - between(rng, 0.5, 1.8)).max(0.2);
            let tried = Vector3::new(target.x + distance * s, eye, -distance * c);
            if tried.x > 0.15 && tried.x < width - 0.15 && tried.z > 0.1 - deep {
                place = tried;
                break;
            }
        }
        View::new(place, target, rng)
    }
}

impl View {
    fn new(place: Vector3<f64>, target: Vector3<f64>, rng: &mut ChaCha8Rng) -> Self {
        let ahead = (target - place).normalize();
        let right = Vector3::y().cross(&ahead).normalize();
        let down = ahead.cross(&right);
        let straight = Matrix3::from_rows(&[right.transpose(), down.transpose(), ahead.transpose()]);
        let wide = if rng.random_bool(0.5) { 0.25 } else { 0.08 };
        let level = if rng.random_bool(0.2) { 0.25 } else { 0.05 };
        let turn = Rotation3::from_euler_angles(
            between(rng, -0.7 * wide, 0.7 * wide),
            between(rng, -wide, wide),
            between(rng, -level, level),
        );
        Self { rotation: turn.matrix() * straight, place }
    }

    /// A plane of the world in the camera's frame.
    pub(super) fn plane(&self, [origin, right, down]: &Frame, light: &Light) -> Plane {
        Plane {
            origin: self.rotation * (origin - self.place),
            right: self.rotation * right,
            down: self.rotation * down,
            light: light.clone(),
        }
    }

    /// Rows of `map_from_camera`, with the world frame as the map.
    pub(super) fn map_from_camera(&self) -> [[f64; 4]; 3] {
        std::array::from_fn(|row| {
            std::array::from_fn(
                |column| {
                    if column < 3 { self.rotation[(column, row)] } else { self.place[row] }
                },
            )
        })
    }
}

/// Origin, right and down of a plane in the world.
pub(super) type Frame = [Vector3<f64>; 3];
