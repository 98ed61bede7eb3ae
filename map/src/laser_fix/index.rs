//! An index of a map's walls: the wall nearest to a point, by buckets of the floor. In: segments.
//! Out: the index, made once for each version of the walls.

use crate::{digest::digest, segments::LaserSegment, walls::local};
use nalgebra::{Matrix2, Point2, Vector2};

/// Most walls of an index; later ones are left out.
pub const MAX_WALLS: usize = 1 << 17;
/// Most buckets of the index.
const MAX_BUCKETS: usize = 1 << 20;
/// Most entries of the index; a wall has one in every bucket it passes.
const MAX_ENTRIES: usize = 1 << 23;

/// The walls of a map, indexed for localisation.
#[derive(Debug, Clone)]
pub struct WallIndex {
    pub(super) walls: Vec<Ready>,
    low: Point2<f64>,
    bucket_m: f64,
    width: usize,
    height: usize,
    starts: Vec<u32>,
    entries: Vec<u32>,
}

/// A wall with the quantities that every point needs.
#[derive(Debug, Clone)]
pub(super) struct Ready {
    pub(super) a: Point2<f64>,
    pub(super) along: Vector2<f64>,
    pub(super) normal: Vector2<f64>,
    pub(super) length_m: f64,
    /// Covariance of (direction, offset) about the middle.
    pub(super) covariance: Matrix2<f64>,
    pub(super) name: u64,
}

impl WallIndex {
    /// Indexes the walls of a map.
    pub fn new<'a>(walls: impl IntoIterator<Item = &'a LaserSegment>) -> Self {
        let ready = |s: &LaserSegment| {
            let middle = nalgebra::center(&s.a, &s.b);
            let (_, covariance) = local(s, &middle);
            let (a, along, normal, length_m) = (s.a, s.direction(), s.facing(), s.length_m());
            Ready { a, along, normal, length_m, covariance, name: name(s) }
        };
        let walls: Vec<Ready> = walls.into_iter().take(MAX_WALLS).map(ready).collect();
        let (mut low, mut high) = (Point2::new(f64::MAX, f64::MAX), Point2::new(f64::MIN, f64::MIN));
        for p in walls.iter().flat_map(|w| [w.a, w.a + w.along * w.length_m]) {
            low = Point2::new(low.x.min(p.x), low.y.min(p.y));
            high = Point2::new(high.x.max(p.x), high.y.max(p.y));
        }
        if walls.is_empty() {
            (low, high) = (Point2::origin(), Point2::origin());
        }
        let length: f64 = walls.iter().map(|w| w.length_m).sum();
        let mut bucket_m = 1.0;
        let cells = |b: f64| (((high.x - low.x) / b) as usize + 1, ((high.y - low.y) / b) as usize + 1);
        while cells(bucket_m).0.saturating_mul(cells(bucket_m).1) > MAX_BUCKETS
            || 8.0 * length / bucket_m > MAX_ENTRIES as f64
        {
            bucket_m *= 2.0;
        }
        let (width, height) = cells(bucket_m);
        let mut index = Self {
            walls,
            low,
            bucket_m,
            width,
            height,
            starts: vec![0; width * height + 1],
            entries: Vec::new(),
        };
        index.fill();
        index
    }

    /// Lists the walls that pass within a bucket's size of each bucket.
    fn fill(&mut self) {
        let mut pairs: Vec<(u32, u32)> = Vec::new();
        for (i, wall) in self.walls.iter().enumerate() {
            // Points half a bucket apart, each with its neighbours: nothing nearer than a bucket is
            // missed.
            let steps = (2.0 * wall.length_m / self.bucket_m).ceil() as usize + 1;
            for k in 0..=steps {
                let p = wall.a + wall.along * (wall.length_m * k as f64 / steps as f64);
                let (x, y) = self.bucket(&p);
                for (x, y) in (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (x + dx, y + dy))) {
                    if x >= 0 && y >= 0 && x < self.width as i64 && y < self.height as i64 {
                        pairs.push(((y * self.width as i64 + x) as u32, i as u32));
                    }
                }
            }
        }
        pairs.sort_unstable();
        pairs.dedup();
        for (bucket, _) in &pairs {
            self.starts[*bucket as usize + 1] += 1;
        }
        for i in 1..self.starts.len() {
            self.starts[i] += self.starts[i - 1];
        }
        self.entries = pairs.into_iter().map(|(_, wall)| wall).collect();
    }

    fn bucket(&self, p: &Point2<f64>) -> (i64, i64) {
        let f = |v: f64| (v / self.bucket_m).floor() as i64;
        (f(p.x - self.low.x), f(p.y - self.low.y))
    }

    /// The rectangle around the walls: lower and upper corner, metres.
    pub(super) fn extent(&self) -> [Point2<f64>; 2] {
        let ends = self.walls.iter().flat_map(|w| [w.a, w.a + w.along * w.length_m]);
        [self.low, ends.fold(self.low, |high, end| high.sup(&end))]
    }

    /// Whether there are no walls.
    pub fn is_empty(&self) -> bool {
        self.walls.is_empty()
    }

    /// The wall nearest to a point within the radius whose direction differs from the surface by
    /// less than `cos_turn` says.
    pub(super) fn nearest(
        &self,
        p: &Point2<f64>,
        normal: &Vector2<f64>,
        radius_m: f64,
        cos_turn: f64,
    ) -> Option<usize> {
        // A point just outside of the walls' box belongs to its border.
        let (x, y) = self.bucket(p);
        let (w, h) = (self.width as i64, self.height as i64);
        if x < -1 || y < -1 || x > w || y > h {
            return None;
        }
        let bucket = (y.clamp(0, h - 1) * w + x.clamp(0, w - 1)) as usize;
        let (mut best, mut best2) = (None, radius_m * radius_m);
        for &i in &self.entries[self.starts[bucket] as usize..self.starts[bucket + 1] as usize] {
            let wall = &self.walls[i as usize];
            if wall.normal.dot(normal).abs() < cos_turn {
                continue;
            }
            let d = p - wall.a;
            let (along, across) = (wall.along.dot(&d), wall.normal.dot(&d));
            let beyond = (-along).max(along - wall.length_m).max(0.0);
            let d2 = across * across + beyond * beyond;
            if d2 < best2 {
                (best, best2) = (Some(i as usize), d2);
            }
        }
        best
    }
}

/// The digest of a wall's ends: its name.
fn name(wall: &LaserSegment) -> u64 {
    digest([wall.a.x, wall.a.y, wall.b.x, wall.b.y])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::slam::world::{Walls, segments};

    #[test]
    fn the_index_is_bounded() {
        let far = [[-9e4, -9e4, 9e4, 9e4], [9e4, -9e4, -9e4, 9e4]];
        let walls: Walls = far.into_iter().cycle().take(1000).collect();
        let index = WallIndex::new(&segments(&walls, 0.01, 0.01));
        assert!(index.width * index.height <= MAX_BUCKETS && index.entries.len() <= 2 * MAX_ENTRIES);
        let p = Point2::new(10.0, 10.1);
        let n = Vector2::new(-1.0, 1.0).normalize();
        assert!(index.nearest(&p, &n, 0.5, 0.8).is_some());
    }
}
