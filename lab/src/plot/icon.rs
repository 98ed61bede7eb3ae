//! From the quad to the icon: the square of grey levels that is compared, and the exemplar that it
//! is compared with.

use super::{
    landmark::{Landmark, oblique},
    panels::{around, cut, explained, icon as drawn, on, row, titled},
};
use cli::drawing::{CYAN, GREEN, ORANGE, Picture, WHITE, YELLOW};
use nalgebra::Point2;
use vision::{geometry::homography::Homography, icon::icon, params::Params, recognise::features};

/// Enlargement of the icons.
const FACTOR: usize = 4;

pub(crate) fn draw(landmark: &Landmark) -> anyhow::Result<Picture> {
    let p = Params::default();
    let taught = landmark.taught(&p)?;
    let seen = landmark.seen(&oblique())?;
    let cut_out = icon(&seen.image, &seen.corners, &p.icon)?;
    let nearest = taught.nearest(&features(cut_out.clone(), &p.recognise), &p);

    let box_px = around(&seen.corners, 34.0, &seen.image);
    let mut left = Picture::of(&cut(&seen.image, box_px), 0.9);
    let place = |at: &Point2<f64>| [at.x - box_px[0] as f64, at.y - box_px[1] as f64];
    let buckets = p.recognise.correlation.per_side();
    let image_from_icon = Homography::square_to_quad(p.icon.size, &seen.corners)?;
    let line = |at: usize| at as f64 * p.icon.size as f64 / buckets as f64 - 0.5;
    for i in 1..buckets {
        for [from, to] in
            [[(line(i), line(0)), (line(i), line(buckets))], [(line(0), line(i)), (line(buckets), line(i))]]
        {
            let ends = [from, to].map(|(x, y)| place(&image_from_icon.apply(&Point2::new(x, y))));
            left.line(ends[0], ends[1], 0.8, CYAN);
        }
    }
    let corners = seen.corners.points().map(|c| place(&c));
    for i in 0..4 {
        left.line(corners[i], corners[(i + 1) % 4], 2.0, GREEN);
    }
    for (corner, name) in corners.into_iter().zip(["TL", "TR", "BR", "BL"]) {
        left.disc(corner, 3.5, ORANGE);
        let x = if name.ends_with('L') { corner[0] - 27.0 } else { corner[0] + 5.0 };
        left.text([x.max(0.0) as usize, (corner[1] - 7.0).max(0.0) as usize], 2, name, ORANGE);
    }
    let mut middle = drawn(&cut_out, FACTOR);
    for i in 1..buckets {
        let at = on([line(i), line(i)], FACTOR)[0];
        let last = (p.icon.size * FACTOR) as f64;
        middle.line([at, 0.0], [at, last], 0.8, CYAN);
        middle.line([0.0, at], [last, at], 0.8, CYAN);
    }
    let pictures = [
        titled(&left, "in the image", WHITE),
        titled(&middle, "its icon", WHITE),
        titled(&drawn(&nearest, FACTOR), "nearest exemplar", WHITE),
    ];
    let size = format!("icon: {0} x {0} grey levels, enlarged {FACTOR} times", p.icon.size);
    Ok(explained(
        row(&pictures),
        &[("quad", GREEN), ("the corners say which way is up", ORANGE), ("buckets", CYAN), (&size, YELLOW)],
    ))
}
