//! Pictures of single quads with their corners as a detector would give them: a poster under a
//! random viewpoint, light and noise.

use super::landmarks::{picture, whole};
use nalgebra::{Matrix2, Point2};
use vision::{
    detect::{Quad, QuadKind},
    frame::GrayImage,
    geometry::{Corners, homography::Homography},
    random::Random,
};

/// Side of the pictures.
const SIDE_PX: usize = 300;
/// Shortest and longest height of a poster in them.
const HEIGHT_PX: [f64; 2] = [90.0, 250.0];
/// Largest view angle, to either side.
const MAX_ANGLE_RAD: f64 = 1.0;
/// Largest error of a corner along each axis, evenly spread.
const CORNER_PX: f64 = 1.5;
/// Largest noise of a pixel, in grey levels, evenly spread.
const NOISE: f64 = 8.0;

/// One quad to recognise.
#[derive(Debug, Clone)]
pub(super) struct Query {
    pub(super) image: GrayImage,
    pub(super) quad: Quad,
}

/// Poster `index` under conditions drawn from `seed`.
pub(super) fn query(first: u64, index: usize, seed: u64) -> anyhow::Result<Query> {
    let poster = picture(first, index)?;
    let mut random = Random::new(seed ^ (index as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    let corners = projected_corners(&mut random)?;
    let poster_from_image = Homography::from_points(corners.points(), whole(&poster)?.points())?;
    let (gain, offset) = (random.range(0.5, 1.4), random.range(-30.0, 30.0));
    let wall: f64 = random.range(60.0, 220.0);
    let (right, bottom) = (poster.width() as f64 - 0.5, poster.height() as f64 - 0.5);
    let image = GrayImage::from_fn(SIDE_PX, SIDE_PX, |u, v| {
        let on = poster_from_image.apply(&Point2::new(u as f64, v as f64));
        let inside = on.x > -0.5 && on.y > -0.5 && on.x < right && on.y < bottom;
        let grey = if inside { f64::from(poster.sample(on.x, on.y)) } else { wall };
        let noise = random.range(-NOISE, NOISE);
        (gain * (grey - 128.0) + 128.0 + offset + noise).clamp(0.0, 255.0) as u8
    });
    let found = corners.points().map(|c| {
        Point2::new(c.x + random.range(-CORNER_PX, CORNER_PX), c.y + random.range(-CORNER_PX, CORNER_PX))
    });
    Ok(Query { image, quad: quad(Corners::new(found)?) })
}

/// Corners (px) of a poster of 5 : 7 in the middle of the picture, from a random view angle.
fn projected_corners(random: &mut Random) -> anyhow::Result<Corners> {
    let height = HEIGHT_PX[0] * (HEIGHT_PX[1] / HEIGHT_PX[0]).powf(random.range(0.0, 1.0));
    let width = height / 1.4;
    let (sin, cos) = f64::sin_cos(MAX_ANGLE_RAD * random.range(-1.0, 1.0));
    let middle = SIDE_PX as f64 / 2.0;
    // The camera stands three heights away.
    let corners = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)].map(|(x, y)| {
        let scale = 3.0 * height / (3.0 * height + x * width * sin);
        Point2::new(middle + x * width * cos * scale, middle + y * height * scale)
    });
    Ok(Corners::new(corners)?)
}

fn quad(corners_px: Corners) -> Quad {
    Quad {
        corners_px,
        corner_covariance_px2: [Matrix2::identity(); 4],
        side_support: [1.0; 4],
        side_clipped: [false; 4],
        score: 1.0,
        kind: QuadKind::Full,
        upright_ambiguous: false,
        alternates: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_query_shows_the_poster_between_its_corners() {
        let query = query(7, 3, 1).unwrap();
        let poster = picture(7, 3).unwrap();
        let poster_from_image =
            Homography::from_points(query.quad.corners_px.points(), whole(&poster).unwrap().points())
                .unwrap();
        let (mut both, mut one, mut other) = (0.0, 0.0, 0.0);
        for v in 0..SIDE_PX {
            for u in 0..SIDE_PX {
                let on = poster_from_image.apply(&Point2::new(u as f64, v as f64));
                if on.x > 0.0 && on.y > 0.0 && on.x < poster.width() as f64 && on.y < poster.height() as f64 {
                    let a = f64::from(query.image.at(u, v)) - 128.0;
                    let b = f64::from(poster.sample(on.x, on.y)) - 128.0;
                    (both, one, other) = (both + a * b, one + a * a, other + b * b);
                }
            }
        }
        assert!(both / f64::sqrt(one * other) > 0.8, "{}", both / f64::sqrt(one * other));
    }
}
