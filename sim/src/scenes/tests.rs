use super::*;
use crate::building::LandmarkKind;
use crate::texture::Edge;
use nalgebra::Vector2;

fn scenes(seed: u64, count: usize) -> Vec<LabelledScene> {
    Scenes::new(&ScenesParams { seed, scenes: count, ..ScenesParams::default() }, vec![]).collect()
}

/// Bilinear grey.
fn grey(image: &GrayImage, p: Point2<f64>) -> f64 {
    let (u, v) = (p.x.floor(), p.y.floor());
    let (a, b) = (p.x - u, p.y - v);
    let at = |du: usize, dv: usize| {
        let (u, v) = ((u as usize + du).min(image.width() - 1), (v as usize + dv).min(image.height() - 1));
        f64::from(image.at(u, v))
    };
    (at(0, 0) * (1.0 - a) + at(1, 0) * a) * (1.0 - b) + (at(0, 1) * (1.0 - a) + at(1, 1) * a) * b
}

/// Distance from a side of the greatest step of the mean grey, and its height.
fn greatest_step(image: &GrayImage, from: Point2<f64>, to: Point2<f64>) -> (f64, f64) {
    let along = to - from;
    let normal = Vector2::new(-along.y, along.x).normalize();
    let mean = |off: f64| {
        let place = |i: i32| from + along * (0.1 + 0.8 * f64::from(i) / 40.0) + normal * off;
        (0..=40).map(|i| grey(image, place(i))).sum::<f64>() / 41.0
    };
    let steps = (-6..=6).map(|i| f64::from(i) * 0.25);
    steps
        .map(|off| (off, (mean(off + 0.5) - mean(off - 0.5)).abs()))
        .fold((0.0, 0.0), |best, x| if x.1 > best.1 { x } else { best })
}

#[test]
fn truth_is_where_the_edges_are() {
    let (mut sides, mut right) = (0, 0);
    for scene in scenes(11, 60) {
        for quad in scene.entry.quads.iter().filter(|q| q.counted && q.corners.min_side_px() > 40.0) {
            let corners = quad.corners.points();
            for i in 0..4 {
                let (off, step) = greatest_step(&scene.image, corners[i], corners[(i + 1) % 4]);
                if step > 5.0 {
                    sides += 1;
                    right += usize::from(off.abs() <= 0.5);
                }
            }
        }
    }
    // The others are frames with stronger inner edges, shadows, and touching sills and lamp boxes.
    // The chance level is five of thirteen.
    assert!(sides > 100 && right * 100 >= sides * 75, "{right} of {sides}");
}

#[test]
fn the_same_seed_gives_the_same_bytes() {
    let (a, b, other) = (scenes(5, 3), scenes(5, 3), scenes(6, 3));
    for ((a, b), other) in a.iter().zip(&b).zip(&other) {
        assert_eq!((&a.image, &a.entry), (&b.image, &b.entry));
        assert_ne!(a.image, other.image);
    }
    // A scene does not depend on those before it.
    assert_eq!(scenes(5, 1)[0].image, a[0].image);
}

#[test]
fn all_kinds_of_objects_occur_and_only_whole_ones_count() {
    let all = scenes(3, 120);
    let quads = || all.iter().flat_map(|s| &s.entry.quads);
    let kinds = [
        LandmarkKind::Picture,
        LandmarkKind::Poster,
        LandmarkKind::Door,
        LandmarkKind::Window,
        LandmarkKind::Sign,
        LandmarkKind::Board,
    ];
    for kind in kinds {
        assert!(quads().any(|q| q.counted && q.kind == kind), "{kind:?}");
    }
    for state in [QuadState::Truncated, QuadState::Occluded] {
        assert!(quads().any(|q| q.state == state), "{state:?}");
        assert!(quads().all(|q| !(q.counted && q.state == state)), "{state:?}");
    }
    let p = ScenesParams::default();
    for quad in quads().filter(|q| q.counted) {
        assert!(quad.corners.min_side_px() >= p.min_side_px && quad.view_angle_rad <= p.max_view_angle_rad);
    }
    let with = all.iter().filter(|s| s.entry.quads.iter().any(|q| q.counted)).count();
    assert!(with > 80, "{with} scenes of 120 have a quad that counts");
    // Neither black nor white.
    for scene in &all {
        let mean =
            scene.image.data().iter().map(|g| f64::from(*g)).sum::<f64>() / scene.image.data().len() as f64;
        assert!((12.0..235.0).contains(&mean), "{}: {mean}", scene.entry.file);
    }
}

#[test]
fn inner_borders_are_listed_within_their_objects() {
    let within = |scene: &LabelledScene| {
        let quads = &scene.entry.quads;
        let inside = |o: &vision::geometry::Corners| {
            quads.iter().any(|q| {
                let inside = |p| vision::geometry::polygon::contains(q.corners.points(), p, 0.5);
                o.points().iter().all(inside) && o.area_px2() > 0.25 * q.corners.area_px2()
            })
        };
        scene.entry.others.iter().filter(|o| inside(o)).count()
    };
    let inner: usize = scenes(8, 40).iter().map(within).sum();
    assert!(inner > 40, "{inner}");
}

#[test]
fn numbers_of_scenes_and_pictures_are_clamped() {
    let count =
        |scenes| Scenes::new(&ScenesParams { scenes, ..ScenesParams::default() }, vec![]).size_hint().0;
    assert_eq!((count(MAX_SCENES), count(MAX_SCENES + 1)), (MAX_SCENES, MAX_SCENES));
    let white = Texture::new(1, 1, vec![255], Edge::Clamp);
    let pictures = |n: usize| Scenes::new(&ScenesParams::default(), vec![white.clone(); n]).pictures.len();
    assert_eq!((pictures(MAX_PICTURES), pictures(MAX_PICTURES + 1)), (MAX_PICTURES, MAX_PICTURES));
}

#[test]
fn given_pictures_are_hung() {
    let params = ScenesParams { seed: 3, scenes: 12, ..ScenesParams::default() };
    let stripes = (0..64 * 64).map(|i| if i / 4 % 2 == 0 { 0 } else { 255 }).collect();
    let given = Scenes::new(&params, vec![Texture::new(64, 64, stripes, Edge::Clamp)]);
    assert!(given.zip(scenes(3, 12)).any(|(a, b)| a.image != b.image));
}
