use super::*;
use crate::{
    points::taught::{TaughtPoint, view_points},
    recognise::fixture::{poster, whole},
};

/// The taught points of a poster as a frame would show them, the landmark at `corner_px` with the
/// size `size_px`.
fn shown(taught: &[TaughtPoint], corner_px: [f32; 2], size_px: [f32; 2]) -> Vec<FramePoint> {
    let of = |t: &TaughtPoint| {
        let p = t.point();
        FramePoint {
            at_px: std::array::from_fn(|i| corner_px[i] + p.at[i] * size_px[i]),
            sigma_px: size_px.map(|size| p.sigma * size),
            descriptor: p.descriptor,
        }
    };
    taught.iter().map(of).collect()
}

fn index(all: &[Vec<TaughtPoint>]) -> PointIndex {
    PointIndex::new(all.iter().map(Vec::as_slice))
}

#[test]
fn points_that_agree_give_the_place_of_their_landmark() {
    let all: Vec<Vec<TaughtPoint>> = (1..=6).map(|seed| view_points(&poster(seed), &whole())).collect();
    let index = index(&all);
    let (corner, size) = ([220.0, 90.0], [80.0, 130.0]);
    let mut points = shown(&all[3][..40], corner, size);
    // A few of another landmark, nowhere in particular.
    for (i, mut point) in shown(&all[1][..20], [0.0, 0.0], [60.0, 60.0]).into_iter().enumerate() {
        point.at_px = [(i * 97 % 640) as f32, (i * 61 % 480) as f32];
        points.push(point);
    }
    let places = frame_places(&points, &index, 6);
    assert_eq!(places[0].model, 3);
    assert!(places[0].support >= 20, "{places:?}");
    let wanted = [[220.0, 90.0], [300.0, 90.0], [300.0, 220.0], [220.0, 220.0]];
    for (corner, wanted) in places[0].corners_px.iter().zip(wanted) {
        let off = (corner[0] - wanted[0]).hypot(corner[1] - wanted[1]);
        assert!(off < 2.0, "{corner:?} for {wanted:?}");
    }
    assert!(places.iter().skip(1).all(|p| p.support < places[0].support / 2), "{places:?}");
    // The last of the index are rivals: they have no places.
    assert!(frame_places(&points, &index, 3).iter().all(|p| p.model < 3));
}

#[test]
fn fewer_votes_than_the_least_are_no_place() {
    let all = [view_points(&poster(1), &whole()), view_points(&poster(2), &whole())];
    let index = index(&all);
    // Points that lie apart, so that each counts.
    let mut apart: Vec<TaughtPoint> = Vec::new();
    for t in &all[0] {
        let (a, far) = (t.point().at, 2.0 * APART);
        let is_far = |o: &TaughtPoint| {
            let b = o.point().at;
            (a[0] - b[0]).abs() > far || (a[1] - b[1]).abs() > far
        };
        if apart.iter().all(is_far) {
            apart.push(*t);
        }
    }
    let place = |count: usize| {
        let points = shown(&apart[..count], [100.0, 100.0], [120.0, 120.0]);
        frame_places(&points, &index, 2).into_iter().find(|p| p.model == 0)
    };
    let (count, first) = (1..30).find_map(|count| Some((count, place(count)?))).unwrap();
    assert_eq!(first.support, MIN_SUPPORT);
    assert!((MIN_SUPPORT..2 * MIN_SUPPORT).contains(&count), "{count}");
}
