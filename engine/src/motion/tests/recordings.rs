//! Recordings, and modality statistics of reference runs.

use super::*;

#[test]
fn recordings_are_one_a_robot_and_bounded() {
    let (motion, r1) = motion();
    assert_eq!(motion.recording(&r1), None);
    let begun = motion.start_recording(&r1, "hall").unwrap();
    assert!(begun.active && begun.span_ns.is_none());
    assert_eq!(motion.start_recording(&r1, "hall"), Err(RecordingError::AlreadyRecording));
    motion.odometry_of(&r1, odometry(1, 0.0));
    motion.apply_fix(&r1, at(1_000_000_000, 0.0), &fix(10.0)).unwrap();
    motion.odometry_of(&r1, odometry(2, 1.0));
    let status = motion.recording(&r1).unwrap();
    assert_eq!((status.odometry, status.landmarks, status.laser, status.active), (2, 1, 0, true));
    // A new epoch: what was recorded stays, nothing is added.
    let again = v1::Odometry {
        epoch: 2,
        seq: 1,
        captured_ns: 9_000_000_000,
        odom_from_robot: Some(v1::Pose2::default()),
        ..v1::Odometry::default()
    };
    motion.odometry(&r1, again.encode_to_vec().into(), time(9.0));
    let status = motion.recording(&r1).unwrap();
    assert_eq!((status.odometry, status.active), (2, false));
    // Lent, the recording stays until what was learnt is stored, and is lent once at a time.
    let motion = Arc::new(motion);
    let lent = motion.lend_recording(&r1).unwrap();
    assert_eq!(motion.lend_recording(&r1).err(), Some(RecordingError::Lent));
    assert_eq!((lent.recording.odometry.len(), motion.recording(&r1).unwrap().odometry), (2, 2));
    drop(lent);
    motion.lend_recording(&r1).unwrap().finish();
    assert_eq!((motion.recording(&r1), motion.lend_recording(&r1).err()), (None, Some(RecordingError::None)));
    motion.start_recording(&r1, "hall").unwrap();
    // Cancelled and started anew while it is lent: the new one stays.
    let lent = motion.lend_recording(&r1).unwrap();
    motion.take_recording(&r1).unwrap();
    motion.start_recording(&r1, "hall").unwrap();
    lent.finish();
    assert!(motion.recording(&r1).is_some());
    for i in 1..MAX_RECORDINGS {
        motion.start_recording(&Name::new(format!("r{}", i + 1)).unwrap(), "hall").unwrap();
    }
    assert_eq!(motion.start_recording(&Name::new("one-more").unwrap(), "hall"), Err(RecordingError::TooMany));
    assert!(motion.take_recording(&r1).is_some() && motion.take_recording(&r1).is_none());
    motion.start_recording(&Name::new("one-more").unwrap(), "hall").unwrap();
}

#[test]
fn a_recording_of_another_map_ends_at_once() {
    let (motion, r1) = motion();
    motion.start_recording(&r1, "attic").unwrap();
    motion.odometry_of(&r1, odometry(1, 0.0));
    let status = motion.recording(&r1).unwrap();
    assert_eq!((status.active, status.odometry), (false, 0));
}

#[test]
fn modality_statistics_apply_from_the_next_message_on() {
    use map::modality_stats::{FusionMode, ModalityMap, ModalityStats, PoseCell, StatsByModality};
    let (motion, r1) = motion();
    motion.odometry_of(&r1, odometry(1, 0.0));
    motion.apply_fix(&r1, at(1_000_000_000, 0.0), &fix(10.0)).unwrap();
    // In these cells odometry was exact and landmarks were far off: the best modality alone is
    // odometry.
    let sums = |error: f64| -> ModalityStats {
        let one = serde_json::json!({
            "steps": 100, "available": 100, "seconds": 1.0, "errors": [0.0, 0.0, 0.0],
            "products": [error, 0.0, 0.0, 0.0, 0.0, 0.0], "fixes": 0, "outliers": 0, "weights": [0.0, 0.0, 0.0],
            "weighted": [0.0, 0.0, 0.0], "normalised": [0.0, 0.0, 0.0], "visits": 0, "means": [0.0, 0.0, 0.0],
            "mean_squares": [0.0, 0.0, 0.0]
        });
        serde_json::from_value(one).unwrap()
    };
    let statistics: StatsByModality = [sums(0.0), sums(100.0), sums(100.0)];
    let cells = (10..14).map(|x| (PoseCell { x, y: 1, heading: 0 }, statistics)).collect::<BTreeMap<_, _>>();
    let mut map = MapSnapshot::empty("hall", 2);
    map.modalities = Arc::new(ModalityMap::new(FusionMode::Best, Vec::new(), [&cells]));
    motion.snapshots.publish(Arc::new(map));
    motion.odometry_of(&r1, odometry(2, 1.0));
    motion.apply_fix(&r1, at(2_000_000_000, 1.0), &fix(11.0)).unwrap();
    let log = motion.corrections(&r1);
    assert_eq!(log.totals["landmarks"], [("excluded_by_mode", 1), ("started", 1)].into());
    assert!((motion.pose(&r1, "hall", time(2.0)).unwrap().pose.x_m - 11.0).abs() < 1e-9);
}
