use crate::{
    place::{LandmarkPlace, PlaceSigmas},
    tracks::{
        observation::{Identity, QuadObservation, TrackOutcome},
        params::GatherParams,
        track::{MAX_ICONS, MAX_TRACK_VIEWS, StoredTrack, Track},
        tracker::{MAX_TRACKS, ViewTracker},
    },
};
use nalgebra::{Point2, Vector3};
use vision::{
    geometry::Corners,
    icon::Icon,
    model::LandmarkId,
    pose::LandmarkSize,
    recognise::{IconFeatures, RecogniseParams, features},
};

const STEP_NS: i64 = 200_000_000;

/// A quad with its left side at `u_px`, foreshortened to `width_px`.
fn corners(u_px: f64, width_px: f64) -> Corners {
    let (right, bottom) = (u_px + width_px, 300.0);
    Corners::new([[u_px, 100.0], [right, 100.0], [right, bottom], [u_px, bottom]].map(Point2::from)).unwrap()
}

/// Another picture for each seed: a sum of waves.
fn icon(seed: u64) -> IconFeatures {
    let wave = |k: u64| 0.15 + 0.07 * (seed.wrapping_mul(2_654_435_761).wrapping_add(k * 40_503) % 11) as f64;
    let grey = |i: usize| {
        let (x, y) = ((i % 75) as f64, (i / 75) as f64);
        let sum = (wave(1) * x).sin()
            + (wave(2) * y).sin()
            + (wave(3) * x + wave(4) * y).cos() * (wave(5) * x).cos();
        (120.0 + 30.0 * sum).round() as f32
    };
    features(Icon::new(75, (0..5625).map(grey).collect(), 1.5).unwrap(), &RecogniseParams::default())
}

/// On one wall.
fn at(x_m: f64) -> LandmarkPlace {
    let size = LandmarkSize { width_m: 0.6, height_m: 0.84 };
    LandmarkPlace::by_hand(Vector3::new(x_m, 0.0, 1.5), 1.5, size, PlaceSigmas::default()).unwrap()
}

fn quad(seed: u64, u_px: f64, width_px: f64, x_m: Option<f64>) -> QuadObservation {
    let (icon, place) = (icon(seed), x_m.map(at));
    QuadObservation { corners_px: corners(u_px, width_px), icon, place, identity: Identity::Stranger }
}

fn update(tracker: &mut ViewTracker, step: i64, quads: &[QuadObservation]) -> Vec<TrackOutcome> {
    let p = RecogniseParams::default();
    tracker.update((step * STEP_NS, "front"), quads, |id| id == LandmarkId(7), true, &p)
}

#[test]
fn objects_are_followed_by_their_place_over_any_gap() {
    let mut tracker = ViewTracker::default();
    let two = |width| [quad(1, 0.0, width, Some(1.0)), quad(2, 300.0, width, Some(2.0))];
    assert_eq!(update(&mut tracker, 1, &two(100.0)), [TrackOutcome::TooFewObservations; 2]);
    assert_eq!(update(&mut tracker, 2, &two(101.0)), [TrackOutcome::TooFewObservations; 2]);
    assert_eq!(update(&mut tracker, 3, &two(102.0)), [TrackOutcome::Keep(1), TrackOutcome::Keep(2)]);
    assert_eq!(update(&mut tracker, 4, &two(102.5)), [TrackOutcome::NearDuplicate; 2]);
    // A minute later, elsewhere in the image, and in the other order.
    let back: Vec<_> = two(150.0).into_iter().rev().collect();
    assert_eq!(update(&mut tracker, 300, &back), [TrackOutcome::Keep(2), TrackOutcome::Keep(1)]);
    // Another object is there now: neither joined nor a new track.
    assert_eq!(
        update(&mut tracker, 301, &[quad(3, 0.0, 190.0, Some(1.0))]),
        [TrackOutcome::AppearanceMismatch]
    );
    // The same picture elsewhere is another object; so is one of another size at the same place.
    assert_eq!(
        update(&mut tracker, 302, &[quad(1, 0.0, 190.0, Some(4.0))]),
        [TrackOutcome::TooFewObservations]
    );
    let mut larger = quad(2, 0.0, 190.0, Some(2.0));
    larger.place = larger
        .place
        .map(|place| LandmarkPlace { size: LandmarkSize { width_m: 0.9, height_m: 0.84 }, ..place });
    assert_eq!(update(&mut tracker, 303, &[larger]), [TrackOutcome::TooFewObservations]);
    let of = |t: &Track| (t.number, t.sightings, t.views());
    assert_eq!(
        tracker.tracks().iter().map(of).collect::<Vec<_>>(),
        [(1, 5, 2), (2, 5, 2), (3, 1, 0), (4, 1, 0)]
    );
}

#[test]
fn without_a_place_objects_are_followed_by_the_image_only() {
    let mut tracker = ViewTracker::default();
    let one = |u_px, width_px| [quad(1, u_px, width_px, None)];
    for (step, u_px) in [(1, 0.0), (2, 20.0)] {
        assert_eq!(update(&mut tracker, step, &one(u_px, 100.0)), [TrackOutcome::TooFewObservations]);
    }
    assert_eq!(update(&mut tracker, 3, &one(40.0, 100.0)), [TrackOutcome::Keep(1)]);
    // A different appearance at the same position in the image is not joined.
    assert_eq!(update(&mut tracker, 4, &[quad(2, 40.0, 140.0, None)]), [TrackOutcome::AppearanceMismatch]);
    // Too far in the image, too long ago, another camera: each starts a new track.
    assert_eq!(update(&mut tracker, 5, &one(300.0, 100.0)), [TrackOutcome::TooFewObservations]);
    assert_eq!(update(&mut tracker, 12, &one(40.0, 100.0)), [TrackOutcome::TooFewObservations]);
    let p = RecogniseParams::default();
    let other = tracker.update((13 * STEP_NS, "back"), &one(40.0, 100.0), |_| false, true, &p);
    assert_eq!((other, tracker.tracks().len()), (vec![TrackOutcome::TooFewObservations], 4));
}

#[test]
fn views_of_doubtful_identity_are_not_stored() {
    let mut tracker = ViewTracker::default();
    let with = |identity, width_px| [QuadObservation { identity, ..quad(1, 0.0, width_px, Some(1.0)) }];
    for step in 0..5 {
        let width_px = 100.0 + 20.0 * step as f64;
        assert_eq!(
            update(&mut tracker, step, &with(Identity::Doubtful, width_px)),
            [TrackOutcome::KnownLandmark]
        );
        let unwanted = with(Identity::Landmark(LandmarkId(8)), width_px);
        assert_eq!(update(&mut tracker, step, &unwanted), [TrackOutcome::KnownLandmark]);
    }
    assert!(tracker.tracks().is_empty());
    // Views of the requested landmark are stored at once, in its own track, whatever their place.
    let wanted = |width_px| with(Identity::Landmark(LandmarkId(7)), width_px);
    assert_eq!(update(&mut tracker, 6, &wanted(100.0)), [TrackOutcome::Keep(1)]);
    assert_eq!(update(&mut tracker, 6, &wanted(101.0)), [TrackOutcome::NearDuplicate]);
    assert_eq!(update(&mut tracker, 7, &with(Identity::Doubtful, 150.0)), [TrackOutcome::KnownLandmark]);
    assert_eq!(tracker.tracks()[0].landmark, Some(LandmarkId(7)));
    // An object that is later recognised as a landmark is marked as known.
    for step in 8..12 {
        update(&mut tracker, step, &[quad(2, 300.0, 100.0, Some(3.0))]);
    }
    let doubtful = QuadObservation { identity: Identity::Doubtful, ..quad(2, 300.0, 140.0, Some(3.0)) };
    assert_eq!(update(&mut tracker, 12, &[doubtful]), [TrackOutcome::KnownLandmark]);
    assert_eq!((tracker.tracks()[1].known, tracker.tracks()[1].views()), (1, 1));
    // If only landmarks are requested, distractors are not followed.
    let p = RecogniseParams::default();
    let alone =
        tracker.update((13 * STEP_NS, "front"), &[quad(3, 0.0, 90.0, Some(6.0))], |_| true, false, &p);
    assert_eq!(alone, [TrackOutcome::NotRequested]);
}

#[test]
fn numbers_of_tracks_and_views_are_bounded() {
    let p = GatherParams { memory_s: 1e6, ..GatherParams::default() };
    let mut tracker = ViewTracker::new(p);
    for i in 0..MAX_TRACKS {
        assert_eq!(
            update(&mut tracker, 1, &[quad(1, 0.0, 100.0, Some(i as f64))]),
            [TrackOutcome::TooFewObservations],
            "{i}"
        );
    }
    assert_eq!(update(&mut tracker, 1, &[quad(1, 0.0, 100.0, Some(-9.0))]), [TrackOutcome::TrackLimit]);
    assert_eq!(tracker.tracks().len(), MAX_TRACKS);

    let mut tracker = ViewTracker::default();
    let mut outcomes = vec![];
    for step in 0..200 {
        // Ever larger in the image, by more than any limit needs.
        let width_px = 40.0 * 1.5_f64.powi(step as i32);
        outcomes.extend(update(&mut tracker, step, &[quad(1, 0.0, width_px.min(1e12), Some(1.0))]));
        if tracker.tracks()[0].views() == MAX_TRACK_VIEWS {
            break;
        }
    }
    assert_eq!(update(&mut tracker, 201, &[quad(1, 0.0, 1.0, Some(1.0))]), [TrackOutcome::Full]);
    assert_eq!(outcomes.iter().filter(|o| matches!(o, TrackOutcome::Keep(1))).count(), MAX_TRACK_VIEWS);
    assert_eq!(tracker.tracks()[0].icons.len(), MAX_ICONS);
}

#[test]
fn old_tracks_without_views_are_dropped_and_stored_ones_resumed() {
    let mut tracker = ViewTracker::default();
    for step in 0..3 {
        update(&mut tracker, step, &[quad(1, 0.0, 100.0, Some(1.0))]);
    }
    update(&mut tracker, 3, &[quad(2, 0.0, 100.0, Some(5.0))]);
    update(&mut tracker, 100, &[]);
    let numbers = |t: &ViewTracker| t.tracks().iter().map(|t| t.number).collect::<Vec<u32>>();
    assert_eq!(numbers(&tracker), [1], "tracks with stored views stay");
    tracker.close(1);
    assert_eq!(update(&mut tracker, 101, &[quad(1, 0.0, 150.0, Some(1.0))]), [TrackOutcome::Decided]);
    update(&mut tracker, 102, &[quad(2, 0.0, 100.0, Some(5.0))]);
    assert_eq!(numbers(&tracker), [1, 3], "no number is used twice");

    let mut resumed = ViewTracker::default();
    let stored = StoredTrack { number: 4, landmark: None, sightings: 9, known: 2, place: Some(at(1.0)) };
    resumed.resume(stored, [(corners(0.0, 100.0), icon(1)), (corners(0.0, 150.0), icon(1))]);
    resumed.resume(stored, []);
    assert_eq!((resumed.tracks().len(), resumed.tracks()[0].views()), (1, 2));
    assert_eq!(update(&mut resumed, 200, &[quad(1, 0.0, 101.0, Some(1.0))]), [TrackOutcome::NearDuplicate]);
    assert_eq!(update(&mut resumed, 201, &[quad(1, 0.0, 240.0, Some(1.0))]), [TrackOutcome::Keep(4)]);
    assert_eq!(
        update(&mut resumed, 202, &[quad(5, 0.0, 240.0, Some(8.0))]),
        [TrackOutcome::TooFewObservations]
    );
    resumed.number_after(8);
    update(&mut resumed, 203, &[quad(6, 0.0, 240.0, Some(12.0))]);
    assert_eq!(numbers(&resumed), [4, 5, 9]);
}

#[test]
fn the_order_of_quads_does_not_change_the_tracks() {
    let quads = [quad(1, 0.0, 100.0, Some(1.0)), quad(2, 300.0, 100.0, Some(2.0))];
    let (mut a, mut b) = (ViewTracker::default(), ViewTracker::default());
    for tracker in [&mut a, &mut b] {
        for step in 0..3 {
            update(tracker, step, &quads);
        }
    }
    let (larger, reversed) = ([150.0, 160.0], [160.0, 150.0]);
    let made = |widths: [f64; 2], order: [u64; 2]| {
        [0, 1].map(|i| quad(order[i], 0.0, widths[i], Some(order[i] as f64)))
    };
    let first = update(&mut a, 4, &made(larger, [1, 2]));
    let mut second = update(&mut b, 4, &made(reversed, [2, 1]));
    second.reverse();
    assert_eq!(first, second);
}
