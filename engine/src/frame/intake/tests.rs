use super::*;
use crate::observers::live::LiveHub;
use map::{
    map_links::MapLink,
    pose2::{Pose2, Pose2Covariance},
};

fn intake() -> Intake {
    let snapshots = Arc::new(Snapshots::default());
    snapshots.publish(Arc::new(crate::snapshot::MapSnapshot::empty("hall", 3)));
    snapshots.set_robot("r1", Some("hall"));
    snapshots.set_robot("lost", Some("gone"));
    let slots = Arc::new(Slots::new(4, 1 << 20));
    let motion = Arc::new(MotionTracker::new(snapshots.clone(), Arc::new(LiveHub::default())));
    let deadline = Duration::from_millis(500);
    Intake { slots, snapshots, motion, frame_bytes: 1000, deadline, linked_maps_only: false }
}

fn key(robot: &str) -> SlotKey {
    SlotKey { robot: Name::new(robot).unwrap(), camera: Name::new("front").unwrap() }
}

fn frame(seq: u64) -> v1::Frame {
    let image = Bytes::from(vec![0; 12]);
    let encoding = v1::ImageEncoding::Gray8.into();
    v1::Frame {
        epoch: 5,
        seq,
        captured_ns: 77,
        encoding,
        width_px: 4,
        height_px: 3,
        image,
        ..v1::Frame::default()
    }
}

fn refusal(intake: &Intake, robot: &str, message: Vec<u8>) -> (String, String, u64) {
    let answer = intake.receive(key(robot), message.into()).unwrap_err();
    assert_eq!(answer.status(), v1::Status::Rejected);
    let r = answer.rejection.unwrap();
    (r.code, r.field, answer.seq)
}

#[test]
fn a_robot_with_a_certificate_names_maps_that_are_linked_with_its_own() {
    let mut intake = intake();
    for name in ["annex", "yard"] {
        intake.snapshots.publish(Arc::new(crate::snapshot::MapSnapshot::empty(name, 3)));
    }
    let covariance = nalgebra::Matrix3::identity() * 1e-4;
    let parent_from_map = Pose2Covariance { pose: Pose2::default(), covariance };
    let link = MapLink { parent: "hall".to_owned(), parent_from_map, level_m: 0.0 };
    intake.snapshots.set_links([("annex".to_owned(), link)].into());
    let mut seq = 0;
    let mut asks = |intake: &Intake, map: &str| {
        seq += 1;
        let asked = v1::Frame { map: map.into(), ..frame(seq) };
        intake.receive(key("r1"), asked.encode_to_vec().into())
    };
    assert!(["hall", "annex", "yard"].into_iter().all(|map| asks(&intake, map).is_ok()));
    intake.linked_maps_only = true;
    assert!(["hall", "annex", ""].into_iter().all(|map| asks(&intake, map).is_ok()));
    let foreign = asks(&intake, "yard").unwrap_err().rejection.unwrap();
    let missing = asks(&intake, "nowhere").unwrap_err().rejection.unwrap();
    assert_eq!((foreign.code, foreign.field), (missing.code, missing.field));
    assert_eq!(foreign.detail.replace("yard", "nowhere"), missing.detail);
}

#[test]
fn a_draft_is_no_map_to_robots() {
    let intake = intake();
    let draft =
        crate::snapshot::MapSnapshot { is_draft: true, ..crate::snapshot::MapSnapshot::empty("draft", 1) };
    intake.snapshots.publish(Arc::new(draft));
    let ask = |map: &str| {
        let asked = v1::Frame { map: map.into(), ..frame(1) };
        intake.receive(key("r1"), asked.encode_to_vec().into()).unwrap_err().rejection.unwrap()
    };
    let (named, missing) = (ask("draft"), ask("nowhere"));
    assert_eq!(
        (named.code.as_str(), named.detail.replace("draft", "nowhere")),
        ("unknown_map", missing.detail)
    );
    let mut changes = intake.snapshots.changes();
    intake.snapshots.remove_map("draft");
    assert!(changes.try_recv().unwrap().is_draft, "nobody tells robots that it is gone");
}

#[test]
fn each_fault_is_answered_with_its_code_and_field() {
    let intake = intake();
    let good = |seq| frame(seq).encode_to_vec();
    intake.receive(key("r1"), good(5).into()).unwrap();
    let is = |code: &str, field: &str, seq: u64| (code.to_owned(), field.to_owned(), seq);
    assert_eq!(refusal(&intake, "nobody", good(6)), is("unknown_robot", "robot", 6));
    assert_eq!(refusal(&intake, "r1", b"\xff\xff".to_vec()), is("bad_message", "frame", 0));
    let camera = v1::Intrinsics { fx_px: f64::NAN, ..v1::Intrinsics::default() };
    let nan = v1::Frame { intrinsics: Some(camera), ..frame(6) };
    assert_eq!(refusal(&intake, "r1", nan.encode_to_vec()), is("not_finite", "intrinsics.fx_px", 6));
    let wrong = v1::Frame { width_px: 5, ..frame(6) };
    assert_eq!(refusal(&intake, "r1", wrong.encode_to_vec()), is("size_mismatch", "image", 6));
    let elsewhere = v1::Frame { map: "cellar".into(), ..frame(6) };
    assert_eq!(refusal(&intake, "r1", elsewhere.encode_to_vec()), is("unknown_map", "map", 6));
    assert_eq!(refusal(&intake, "lost", good(6)), is("unknown_map", "map", 6));
    assert_eq!(refusal(&intake, "r1", good(5)), is("not_newer", "seq", 5));
    let counts = intake.slots.counts();
    assert_eq!((counts.received, counts.rejected_total(), counts.waiting), (8, 7, 1));
    assert_eq!(counts.missing(), 0);
}

/// A frame of another epoch must not end the live epoch of the robot.
#[test]
fn a_frame_of_another_epoch_is_refused_while_one_is_live() {
    let intake = intake();
    intake.receive(key("r1"), frame(5).encode_to_vec().into()).unwrap();
    let forged = v1::Frame { epoch: 6, ..frame(1) };
    let refused = refusal(&intake, "r1", forged.encode_to_vec());
    assert_eq!(refused, ("epoch_conflict".into(), "epoch".into(), 1));
    intake.receive(key("r1"), frame(6).encode_to_vec().into()).unwrap();
}

/// Such a frame is answered; its capture time is not used.
#[test]
fn a_stray_capture_time_is_marked() {
    let intake = intake();
    for (seq, captured_ns, is_stray) in
        [(1, 77, false), (2, 78, false), (3, 3_600_000_000_000, true), (4, 79, false)]
    {
        intake.receive(key("r1"), v1::Frame { captured_ns, ..frame(seq) }.encode_to_vec().into()).unwrap();
        let (k, job) = intake.slots.try_take().unwrap();
        assert_eq!(job.stamp_instead_ns.is_some(), is_stray, "{seq}");
        assert!(job.stamp_instead_ns.is_none_or(|ns| ns < 1_000_000_000));
        intake.slots.finish(&k, crate::frame::slots::FrameOutcome::Processed);
    }
    let counts = intake.motion.frame_stamps();
    assert_eq!((counts.accepted, counts.rejected), (3, [(protos::Code::ClockAhead, 1)].into()));
}

#[test]
fn messages_at_the_bound() {
    let mut intake = intake();
    let message = frame(1).encode_to_vec();
    intake.frame_bytes = message.len() - 1;
    let refused = intake.receive(key("r1"), message.clone().into()).unwrap_err();
    assert_eq!(refused.rejection.as_ref().map(|r| r.code.as_str()), Some("too_large"));
    assert_eq!((refused.epoch, refused.seq), (frame(1).epoch, 1), "the sender knows its frame again");
    intake.frame_bytes = message.len();
    assert!(intake.receive(key("r1"), message.into()).is_ok());
}

#[test]
fn an_image_that_was_not_sent_is_refused_as_too_large() {
    let intake = intake();
    let withheld = v1::Frame { image: Vec::new().into(), withheld_bytes: 6_912_000, ..frame(1) };
    let refused = intake.receive(key("r1"), withheld.encode_to_vec().into()).unwrap_err();
    let rejection = refused.rejection.clone().unwrap();
    assert_eq!((rejection.code.as_str(), rejection.field.as_str()), ("too_large", "image"));
    assert!(rejection.detail.contains("6912000") && rejection.detail.contains("limits.frame_bytes"));
    assert_eq!(refused.seq, 1);
}

#[test]
fn a_frame_may_ask_for_its_own_deadline() {
    let intake = intake();
    intake.receive(key("r1"), frame(1).encode_to_vec().into()).unwrap();
    let (k, job) = intake.slots.try_take().unwrap();
    assert_eq!(job.deadline - job.received, Duration::from_millis(500));
    assert!(job.clock_suspect, "captured in 1970");
    intake.slots.finish(&k, crate::frame::slots::FrameOutcome::Processed);
    let hasty = v1::Frame { deadline_ms: 40, ..frame(2) };
    intake.receive(key("r1"), hasty.encode_to_vec().into()).unwrap();
    let (_, job) = intake.slots.try_take().unwrap();
    assert_eq!(job.deadline - job.received, Duration::from_millis(40));
}

#[test]
fn clocks_within_two_seconds_are_fine() {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_nanos() as i64;
    assert!(!clock_suspect(now) && !clock_suspect(now - 1_900_000_000));
    assert!(clock_suspect(now - 2_100_000_000) && clock_suspect(now + 2_100_000_000));
    assert!(clock_suspect(i64::MIN) && clock_suspect(i64::MAX));
}
