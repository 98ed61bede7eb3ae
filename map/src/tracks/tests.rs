use crate::{
    place::{LandmarkPlace, PlaceSigmas},
    tracks::{
        observation::{Identity, QuadObservation, TrackOutcome},
        params::GatherParams,
        track::{LOOKS_KEPT, MAX_TRACK_VIEWS, StoredTrack, Track},
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

fn glimpse(seed: u64, u_px: f64, width_px: f64, x_m: Option<f64>) -> QuadObservation {
    let (icon, place) = (icon(seed), x_m.map(at));
    QuadObservation { corners_px: corners(u_px, width_px), icon, place, identity: Identity::Stranger }
}

fn seen(tracker: &mut ViewTracker, step: i64, glimpses: &[QuadObservation]) -> Vec<TrackOutcome> {
    let p = RecogniseParams::default();
    tracker.update((step * STEP_NS, "front"), glimpses, |id| id == LandmarkId(7), true, &p)
}

#[test]
fn things_are_followed_by_their_place_over_any_gap() {
    let mut tracker = ViewTracker::default();
    let two = |width| [glimpse(1, 0.0, width, Some(1.0)), glimpse(2, 300.0, width, Some(2.0))];
    assert_eq!(seen(&mut tracker, 1, &two(100.0)), [TrackOutcome::TooFewObservations; 2]);
    assert_eq!(seen(&mut tracker, 2, &two(101.0)), [TrackOutcome::TooFewObservations; 2]);
    assert_eq!(seen(&mut tracker, 3, &two(102.0)), [TrackOutcome::Keep(1), TrackOutcome::Keep(2)]);
    assert_eq!(seen(&mut tracker, 4, &two(102.5)), [TrackOutcome::NearDuplicate; 2]);
    // A minute later, elsewhere in the picture, and the other way round.
    let back: Vec<_> = two(150.0).into_iter().rev().collect();
    assert_eq!(seen(&mut tracker, 300, &back), [TrackOutcome::Keep(2), TrackOutcome::Keep(1)]);
    // Something else hangs there now: neither joined nor begun anew.
    assert_eq!(
        seen(&mut tracker, 301, &[glimpse(3, 0.0, 190.0, Some(1.0))]),
        [TrackOutcome::AppearanceMismatch]
    );
    // The same picture elsewhere is another thing; so is one of another size at the same place.
    assert_eq!(
        seen(&mut tracker, 302, &[glimpse(1, 0.0, 190.0, Some(4.0))]),
        [TrackOutcome::TooFewObservations]
    );
    let mut larger = glimpse(2, 0.0, 190.0, Some(2.0));
    larger.place = larger
        .place
        .map(|place| LandmarkPlace { size: LandmarkSize { width_m: 0.9, height_m: 0.84 }, ..place });
    assert_eq!(seen(&mut tracker, 303, &[larger]), [TrackOutcome::TooFewObservations]);
    let of = |t: &Track| (t.number, t.sightings, t.views());
    assert_eq!(
        tracker.tracks().iter().map(of).collect::<Vec<_>>(),
        [(1, 5, 2), (2, 5, 2), (3, 1, 0), (4, 1, 0)]
    );
}

#[test]
fn without_a_place_things_are_followed_from_picture_to_picture_only() {
    let mut tracker = ViewTracker::default();
    let one = |u_px, width_px| [glimpse(1, u_px, width_px, None)];
    for (step, u_px) in [(1, 0.0), (2, 20.0)] {
        assert_eq!(seen(&mut tracker, step, &one(u_px, 100.0)), [TrackOutcome::TooFewObservations]);
    }
    assert_eq!(seen(&mut tracker, 3, &one(40.0, 100.0)), [TrackOutcome::Keep(1)]);
    // What is in the same place of the picture next and looks different is not joined.
    assert_eq!(seen(&mut tracker, 4, &[glimpse(2, 40.0, 140.0, None)]), [TrackOutcome::AppearanceMismatch]);
    // Too far in the picture, too long ago, another camera: each begins anew.
    assert_eq!(seen(&mut tracker, 5, &one(300.0, 100.0)), [TrackOutcome::TooFewObservations]);
    assert_eq!(seen(&mut tracker, 12, &one(40.0, 100.0)), [TrackOutcome::TooFewObservations]);
    let p = RecogniseParams::default();
    let other = tracker.update((13 * STEP_NS, "back"), &one(40.0, 100.0), |_| false, true, &p);
    assert_eq!((other, tracker.tracks().len()), (vec![TrackOutcome::TooFewObservations], 4));
}

#[test]
fn nothing_of_a_doubtful_identity_is_kept() {
    let mut tracker = ViewTracker::default();
    let with = |identity, width_px| [QuadObservation { identity, ..glimpse(1, 0.0, width_px, Some(1.0)) }];
    for step in 0..5 {
        let width_px = 100.0 + 20.0 * step as f64;
        assert_eq!(
            seen(&mut tracker, step, &with(Identity::Doubtful, width_px)),
            [TrackOutcome::KnownLandmark]
        );
        let unwanted = with(Identity::Landmark(LandmarkId(8)), width_px);
        assert_eq!(seen(&mut tracker, step, &unwanted), [TrackOutcome::KnownLandmark]);
    }
    assert!(tracker.tracks().is_empty());
    // Views of the landmark that is wanted are kept at once, in a track of its own, wherever it seems to be.
    let wanted = |width_px| with(Identity::Landmark(LandmarkId(7)), width_px);
    assert_eq!(seen(&mut tracker, 6, &wanted(100.0)), [TrackOutcome::Keep(1)]);
    assert_eq!(seen(&mut tracker, 6, &wanted(101.0)), [TrackOutcome::NearDuplicate]);
    assert_eq!(seen(&mut tracker, 7, &with(Identity::Doubtful, 150.0)), [TrackOutcome::KnownLandmark]);
    assert_eq!(tracker.tracks()[0].landmark, Some(LandmarkId(7)));
    // A thing that is taken for a landmark later is remembered for that.
    for step in 8..12 {
        seen(&mut tracker, step, &[glimpse(2, 300.0, 100.0, Some(3.0))]);
    }
    let doubtful = QuadObservation { identity: Identity::Doubtful, ..glimpse(2, 300.0, 140.0, Some(3.0)) };
    assert_eq!(seen(&mut tracker, 12, &[doubtful]), [TrackOutcome::KnownLandmark]);
    assert_eq!((tracker.tracks()[1].known, tracker.tracks()[1].views()), (1, 1));
    // Where only landmarks are wanted, a stranger is not even followed.
    let p = RecogniseParams::default();
    let alone =
        tracker.update((13 * STEP_NS, "front"), &[glimpse(3, 0.0, 90.0, Some(6.0))], |_| true, false, &p);
    assert_eq!(alone, [TrackOutcome::NotRequested]);
}

#[test]
fn both_bounds_hold() {
    let p = GatherParams { memory_s: 1e6, ..GatherParams::default() };
    let mut tracker = ViewTracker::new(p);
    for i in 0..MAX_TRACKS {
        assert_eq!(
            seen(&mut tracker, 1, &[glimpse(1, 0.0, 100.0, Some(i as f64))]),
            [TrackOutcome::TooFewObservations],
            "{i}"
        );
    }
    assert_eq!(seen(&mut tracker, 1, &[glimpse(1, 0.0, 100.0, Some(-9.0))]), [TrackOutcome::TrackLimit]);
    assert_eq!(tracker.tracks().len(), MAX_TRACKS);

    let mut tracker = ViewTracker::default();
    let mut outcomes = vec![];
    for step in 0..200 {
        // Ever larger in the picture, by more than any limit asks for.
        let width_px = 40.0 * 1.5_f64.powi(step as i32);
        outcomes.extend(seen(&mut tracker, step, &[glimpse(1, 0.0, width_px.min(1e12), Some(1.0))]));
        if tracker.tracks()[0].views() == MAX_TRACK_VIEWS {
            break;
        }
    }
    assert_eq!(seen(&mut tracker, 201, &[glimpse(1, 0.0, 1.0, Some(1.0))]), [TrackOutcome::Full]);
    assert_eq!(outcomes.iter().filter(|o| matches!(o, TrackOutcome::Keep(1))).count(), MAX_TRACK_VIEWS);
    assert_eq!(tracker.tracks()[0].looks.len(), LOOKS_KEPT);
}

#[test]
fn glimpses_are_forgotten_and_tracks_taken_up_again() {
    let mut tracker = ViewTracker::default();
    for step in 0..3 {
        seen(&mut tracker, step, &[glimpse(1, 0.0, 100.0, Some(1.0))]);
    }
    seen(&mut tracker, 3, &[glimpse(2, 0.0, 100.0, Some(5.0))]);
    seen(&mut tracker, 100, &[]);
    let numbers = |t: &ViewTracker| t.tracks().iter().map(|t| t.number).collect::<Vec<u32>>();
    assert_eq!(numbers(&tracker), [1], "kept views stay");
    tracker.close(1);
    assert_eq!(seen(&mut tracker, 101, &[glimpse(1, 0.0, 150.0, Some(1.0))]), [TrackOutcome::Decided]);
    seen(&mut tracker, 102, &[glimpse(2, 0.0, 100.0, Some(5.0))]);
    assert_eq!(numbers(&tracker), [1, 3], "no number is used twice");

    let mut resumed = ViewTracker::default();
    let kept = StoredTrack { number: 4, landmark: None, sightings: 9, known: 2, place: Some(at(1.0)) };
    resumed.resume(kept, [(corners(0.0, 100.0), icon(1)), (corners(0.0, 150.0), icon(1))]);
    resumed.resume(kept, []);
    assert_eq!((resumed.tracks().len(), resumed.tracks()[0].views()), (1, 2));
    assert_eq!(seen(&mut resumed, 200, &[glimpse(1, 0.0, 101.0, Some(1.0))]), [TrackOutcome::NearDuplicate]);
    assert_eq!(seen(&mut resumed, 201, &[glimpse(1, 0.0, 240.0, Some(1.0))]), [TrackOutcome::Keep(4)]);
    assert_eq!(
        seen(&mut resumed, 202, &[glimpse(5, 0.0, 240.0, Some(8.0))]),
        [TrackOutcome::TooFewObservations]
    );
    resumed.number_after(8);
    seen(&mut resumed, 203, &[glimpse(6, 0.0, 240.0, Some(12.0))]);
    assert_eq!(numbers(&resumed), [4, 5, 9]);
}

#[test]
fn the_same_glimpses_in_another_order_end_in_the_same_tracks() {
    let glimpses = [glimpse(1, 0.0, 100.0, Some(1.0)), glimpse(2, 300.0, 100.0, Some(2.0))];
    let (mut a, mut b) = (ViewTracker::default(), ViewTracker::default());
    for tracker in [&mut a, &mut b] {
        for step in 0..3 {
            seen(tracker, step, &glimpses);
        }
    }
    let (larger, reversed) = ([150.0, 160.0], [160.0, 150.0]);
    let made = |widths: [f64; 2], order: [u64; 2]| {
        [0, 1].map(|i| glimpse(order[i], 0.0, widths[i], Some(order[i] as f64)))
    };
    let first = seen(&mut a, 4, &made(larger, [1, 2]));
    let mut second = seen(&mut b, 4, &made(reversed, [2, 1]));
    second.reverse();
    assert_eq!(first, second);
}
