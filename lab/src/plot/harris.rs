//! Harris points of an icon and of an exemplar, and the counterparts that the partial Hausdorff
//! distance rests on.

use super::{
    landmark::{Landmark, oblique},
    panels::{GAP_PX, explained, icon as drawn, on, ring},
};
use cli::drawing::{CYAN, GREEN, ORANGE, Picture, WHITE};
use vision::{
    icon::icon,
    params::Params,
    recognise::{
        IconFeatures, features,
        features::hausdorff::{counterparts, hausdorff, rank},
    },
};

/// Enlargement of the icons.
const FACTOR: usize = 6;

pub(crate) fn draw(landmark: &Landmark) -> anyhow::Result<Picture> {
    let p = Params::default();
    let taught = landmark.taught(&p)?;
    let seen = landmark.seen(&oblique())?;
    let own = features(icon(&seen.image, &seen.corners, &p.icon)?, &p.recognise);
    let learnt = features(taught.nearest(&own, &p), &p.recognise);

    let side = p.icon.size * FACTOR;
    let mut picture = Picture::black(2 * side + GAP_PX, side);
    picture.paste(&drawn(&own.icon, FACTOR), [0, 0]);
    picture.paste(&drawn(&learnt.icon, FACTOR), [side + GAP_PX, 0]);
    let at = |features: &IconFeatures, i: usize, right: bool| {
        let [x, y] = on(features.points.xy_px()[i].map(f64::from), FACTOR);
        [x + if right { (side + GAP_PX) as f64 } else { 0.0 }, y]
    };
    let mut nearest: Vec<_> = counterparts(&own.points, &learnt.points).into_iter().enumerate().collect();
    nearest.sort_by(|a, b| a.1.distance.total_cmp(&b.1.distance));
    let smaller = own.points.len().min(learnt.points.len());
    let k = rank(smaller.max(1), p.recognise.hausdorff.inlier_fraction);
    for (i, counterpart) in nearest.iter().take(k) {
        picture.line(at(&own, *i, false), at(&learnt, counterpart.index, true), 1.0, GREEN);
    }
    let counts: Vec<usize> = nearest.iter().take(k).map(|n| n.0).collect();
    for (features, right) in [(&own, false), (&learnt, true)] {
        for i in 0..features.points.len() {
            let centre = at(features, i, right);
            let is_counted = !right && counts.contains(&i);
            ring(&mut picture, centre, [5.0, 5.0], 1.4, if is_counted { GREEN } else { ORANGE });
            picture.disc(centre, 1.2, WHITE);
        }
    }
    let counted = format!("the {k} nearest of {} points of the icon", own.points.len());
    let greatest = nearest.get(k.saturating_sub(1)).map_or(0.0, |n| n.1.distance);
    let measured = hausdorff(&own.points, &learnt.points, &p.recognise.hausdorff);
    let distance =
        format!("farthest of these: {greatest:.2}, Hr = {measured:.2} (the larger of both directions)");
    Ok(explained(
        picture,
        &[
            ("left: icon of the quad, right: exemplar", WHITE),
            ("Harris points", ORANGE),
            (&counted, GREEN),
            (&distance, CYAN),
        ],
    ))
}
