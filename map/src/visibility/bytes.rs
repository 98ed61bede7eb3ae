//! A visibility area as bytes, and back. In: an area, or bytes with the inputs that the area was
//! computed of. Out: the bytes that name those inputs, the area's own bytes, or the same area
//! again.

use crate::{
    place::LandmarkPlace,
    visibility::{
        area::VisibilityMap,
        envelope::{Envelope, Piece},
        local_frame::LocalFrame,
        obstacle::Obstacle,
        outline::{Polygon, measure},
        quadrants::Quadrant,
        settings::VisibilitySettings,
    },
};
use nalgebra::Point2;

/// Version of the computation and of the bytes. It counts up whenever the same inputs give another
/// area.
pub const COMPUTATION: u8 = 1;

/// Bytes that are no area of this version.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("not the bytes of a visibility area")]
pub struct NotAnArea;

/// Everything that an area depends on, as bytes: equal inputs, equal bytes. `near` are the
/// obstacles within reach.
pub fn inputs(place: &LandmarkPlace, near: &[Obstacle], settings: &VisibilitySettings) -> Vec<u8> {
    let VisibilitySettings { viewer: v, seen: s } = settings;
    let place = [
        place.x_m,
        place.y_m,
        place.z_m,
        place.theta_rad,
        place.tilt_rad,
        place.size.width_m,
        place.size.height_m,
    ];
    let camera = [v.focal_px, v.width_px, v.height_px, v.camera_height_m];
    let limits = [s.max_incidence_rad, s.min_side_px, s.max_fill, s.standoff_m];
    // A wall without end is as high as none can be.
    let obstacles =
        near.iter().flat_map(|o| [o.a.x, o.a.y, o.b.x, o.b.y, o.height_m.unwrap_or(f64::INFINITY)]);
    let numbers = place.into_iter().chain(camera).chain(v.tilt_rad).chain(v.pan_rad).chain(limits);
    let mut bytes = vec![COMPUTATION];
    bytes.extend(numbers.chain(obstacles).flat_map(f64::to_le_bytes));
    bytes
}

impl VisibilityMap {
    /// What took time to compute: bounds and polygons. With the inputs it is the area again
    /// ([`Self::from_bytes`]).
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = vec![COMPUTATION];
        let mut put = |numbers: &[f64]| bytes.extend(numbers.iter().flat_map(|v| v.to_le_bytes()));
        put(&[self.reach_m]);
        for quarter in &self.quadrants {
            for envelope in [&quarter.far, &quarter.near] {
                put(&[envelope.pieces().len() as f64]);
                envelope.pieces().iter().for_each(|piece| put(&piece.numbers()));
            }
        }
        put(&[self.polygons.len() as f64]);
        for ring in self.polygons.iter().flat_map(|p| [&p.corners, &p.hole]) {
            put(&[ring.len() as f64]);
            for p in ring {
                put(&[p.x, p.y]);
            }
        }
        bytes
    }

    /// The area of these inputs, by its bytes; `near` are the obstacles within reach.
    pub fn from_bytes(
        bytes: &[u8],
        place: &LandmarkPlace,
        near: Vec<Obstacle>,
        settings: &VisibilitySettings,
    ) -> Result<Self, NotAnArea> {
        let (&[version], rest) = bytes.split_first_chunk::<1>().ok_or(NotAnArea)?;
        let (numbers, over) = rest.as_chunks::<8>();
        if version != COMPUTATION || !over.is_empty() {
            return Err(NotAnArea);
        }
        let mut rest = Numbers(numbers);
        let [reach_m] = rest.take()?;
        let mut quadrants: [Quadrant; 4] = Default::default();
        for quarter in &mut quadrants {
            quarter.far = rest.envelope()?;
            quarter.near = rest.envelope()?;
        }
        let count = rest.count(2)?;
        let polygon = |rest: &mut Numbers<'_>| Ok(Polygon { corners: rest.ring()?, hole: rest.ring()? });
        let polygons = (0..count).map(|_| polygon(&mut rest)).collect::<Result<Vec<_>, _>>()?;
        if !rest.0.is_empty() {
            return Err(NotAnArea);
        }
        let (area_m2, centroid) = if polygons.is_empty() { (0.0, None) } else { measure(&polygons) };
        Ok(Self {
            frame: LocalFrame::new(place, settings.seen.standoff_m),
            centre: Point2::new(place.x_m, place.y_m),
            pan_rad: settings.viewer.pan_rad,
            quadrants,
            polygons,
            area_m2,
            centroid,
            reach_m,
            obstacles: near,
        })
    }
}

/// What is left to read.
struct Numbers<'a>(&'a [[u8; 8]]);

impl Numbers<'_> {
    fn take<const N: usize>(&mut self) -> Result<[f64; N], NotAnArea> {
        let (first, rest) = self.0.split_first_chunk::<N>().ok_or(NotAnArea)?;
        self.0 = rest;
        let numbers = first.map(f64::from_le_bytes);
        if numbers.iter().all(|v| v.is_finite()) { Ok(numbers) } else { Err(NotAnArea) }
    }

    /// How many of what takes at least `least` numbers follow.
    fn count(&mut self, least: usize) -> Result<usize, NotAnArea> {
        let [count] = self.take()?;
        let most = self.0.len() / least;
        if count.fract() == 0.0 && (0.0..=most as f64).contains(&count) {
            Ok(count as usize)
        } else {
            Err(NotAnArea)
        }
    }

    fn envelope(&mut self) -> Result<Envelope, NotAnArea> {
        let count = self.count(5)?;
        let pieces = (0..count).map(|_| Ok(Piece::of_numbers(self.take()?)));
        Ok(Envelope::of_pieces(pieces.collect::<Result<_, _>>()?))
    }

    fn ring(&mut self) -> Result<Vec<Point2<f64>>, NotAnArea> {
        let count = self.count(2)?;
        (0..count).map(|_| Ok(Point2::from(self.take::<2>()?))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        place::PlaceSigmas,
        visibility::area::{visibility, within_reach},
    };
    use nalgebra::Vector3;
    use vision::{pose::LandmarkSize, random::Random};

    fn place(x_m: f64, z_m: f64, tilt_rad: f64) -> LandmarkPlace {
        let size = LandmarkSize { width_m: 0.6, height_m: 0.84 };
        let made = LandmarkPlace::by_hand(Vector3::new(x_m, 0.0, z_m), 0.3, size, PlaceSigmas::default());
        LandmarkPlace { tilt_rad, ..made.unwrap() }
    }

    fn wall(ax: f64, ay: f64, bx: f64, by: f64) -> Obstacle {
        Obstacle { a: Point2::new(ax, ay), b: Point2::new(bx, by), height_m: None }
    }

    #[test]
    fn an_area_goes_through_its_bytes_bit_for_bit() {
        let mut settings = VisibilitySettings::default();
        settings.viewer.tilt_rad = [-1.2, 1.2];
        let mut random = Random::new(8);
        let (mut some, mut holes) = (0, 0);
        // On a wall, and under a ceiling, whose area has a hole.
        for place in [place(0.0, 1.5, 0.0), place(1.0, 2.2, std::f64::consts::FRAC_PI_2)] {
            for count in [0, 1, 3, 60] {
                let mut at = || random.range(-6.0, 6.0);
                let all: Vec<_> = (0..count).map(|_| wall(at(), at(), at(), at())).collect();
                let near = within_reach(&place, &all, &settings.viewer, &settings.seen);
                let made = visibility(&place, &all, &settings.viewer, &settings.seen).unwrap();
                let again = VisibilityMap::from_bytes(&made.to_bytes(), &place, near, &settings).unwrap();
                assert_eq!(made, again);
                some += usize::from(made.area_m2() > 0.1);
                holes += made.polygons.iter().filter(|p| !p.hole.is_empty()).count();
            }
        }
        assert!(some >= 4 && holes >= 1, "{some} areas are not empty, {holes} holes");
    }

    #[test]
    fn bytes_that_are_no_area_are_refused() {
        let settings = VisibilitySettings::default();
        let place = place(0.0, 1.5, 0.0);
        let made =
            visibility(&place, &[wall(2.0, -1.0, 2.0, 1.0)], &settings.viewer, &settings.seen).unwrap();
        let bytes = made.to_bytes();
        let read = |bytes: &[u8]| VisibilityMap::from_bytes(bytes, &place, vec![], &settings);
        assert!(read(&bytes).is_ok());
        for end in 0..bytes.len() {
            assert_eq!(read(&bytes[..end]), Err(NotAnArea), "cut at {end}");
        }
        let mut older = bytes.clone();
        older[0] = COMPUTATION - 1;
        assert_eq!(read(&older), Err(NotAnArea));
        // A count beyond what follows, and one that is no number.
        for count in [1e18, -1.0, 0.5, f64::NAN] {
            let mut wrong = bytes.clone();
            wrong[9..17].copy_from_slice(&f64::to_le_bytes(count));
            assert_eq!(read(&wrong), Err(NotAnArea), "{count}");
        }
    }

    #[test]
    fn every_input_is_in_the_bytes_that_name_them() {
        let settings = VisibilitySettings::default();
        let (at, near) = (place(0.0, 1.5, 0.0), [wall(2.0, -1.0, 2.0, 1.0)]);
        let usual = inputs(&at, &near, &settings);
        assert_eq!(usual, inputs(&at, &near, &settings));
        let mut other = settings.clone();
        other.viewer.pan_rad[1] = 1.0;
        assert_ne!(usual, inputs(&at, &near, &other), "the camera");
        let mut other = settings.clone();
        other.seen.max_fill = 0.8;
        assert_ne!(usual, inputs(&at, &near, &other), "the limits");
        assert_ne!(usual, inputs(&place(0.0, 1.6, 0.0), &near, &settings), "the place");
        let mut larger = at;
        larger.size.width_m += 0.1;
        assert_ne!(usual, inputs(&larger, &near, &settings), "the size");
        assert_ne!(usual, inputs(&at, &[wall(2.0, -1.0, 2.0, 1.1)], &settings), "a wall");
        let low = Obstacle { height_m: Some(1.4), ..near[0] };
        assert_ne!(usual, inputs(&at, &[low], &settings), "its height");
    }
}
