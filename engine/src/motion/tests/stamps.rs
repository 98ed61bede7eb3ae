//! Stray stamps and clocks that are set, in odometry, scans and frames. A robot drives along x at 1
//! m/s; in the map it is 7 m further on than in its odometry.

use super::*;
use protos::CheckedFrame;

const HOUR: f64 = 3600.0;
/// Odometry messages a second.
const RATE: u64 = 20;

/// A robot that drives, from its first fix on.
struct Drive {
    motion: MotionTracker,
    r1: Name,
    /// Numbers of messages, of any kind.
    seq: u64,
}

impl Drive {
    /// It has driven for two seconds, and was fixed.
    fn new() -> Self {
        let (motion, r1) = motion();
        let mut drive = Self { motion, r1, seq: 0 };
        drive.on(0.0, 2.0);
        drive.fix(1.9, 1.9).unwrap();
        drive
    }

    /// An odometry message of second `s`, received then, whose stamp is off by `off_s`.
    fn odometry(&mut self, s: f64, off_s: f64) -> Option<v1::RobotPose> {
        self.seq += 1;
        let odom_from_robot = Some(v1::Pose2 { x_m: s, ..v1::Pose2::default() });
        let message = v1::Odometry {
            epoch: 1,
            seq: self.seq,
            captured_ns: ns(s + off_s),
            odom_from_robot,
            ..v1::Odometry::default()
        };
        self.motion.odometry(&self.r1, message.encode_to_vec().into(), time(s))
    }

    /// Odometry from one second to another, stamped right; the last pose.
    fn on(&mut self, from_s: f64, to_s: f64) -> Option<v1::RobotPose> {
        self.on_by(from_s, to_s, 0.0)
    }

    /// The same by a clock that is off.
    fn on_by(&mut self, from_s: f64, to_s: f64, off_s: f64) -> Option<v1::RobotPose> {
        let steps = ((to_s - from_s) * RATE as f64).round() as u64;
        let mut last = None;
        for i in 1..=steps {
            last = self.odometry(from_s + i as f64 / RATE as f64, off_s);
        }
        last
    }

    /// Receives a frame without odometry at second `s` with stamp `stamp_s`, and checks the stamp.
    fn frame(&mut self, s: f64, stamp_s: f64, camera: &str) -> Result<(), i64> {
        self.seq += 1;
        let wire = v1::Frame {
            epoch: 1,
            seq: self.seq,
            captured_ns: ns(stamp_s),
            encoding: v1::ImageEncoding::Gray8.into(),
            width_px: 4,
            height_px: 3,
            image: vec![0; 12].into(),
            ..v1::Frame::default()
        };
        let frame = CheckedFrame::try_from(wire).unwrap();
        let camera = Name::new(camera).unwrap();
        self.motion.frame_stamp((&self.r1, &camera), "hall", &frame, time(s))
    }

    /// A frame of second `s`, by which the robot is fixed a little later; its stamp is `stamp_s`.
    fn fix(&mut self, s: f64, stamp_s: f64) -> Option<v1::RobotPose> {
        if self.frame(s, stamp_s, "front").is_err() {
            return None;
        }
        let at = FrameStamp { odometry: None, now: time(s + 0.04), ..at(ns(stamp_s), 0.0) };
        self.motion.apply_fix(&self.r1, at, &fix(s + 7.0))
    }

    /// How far the pose at second `s` is off, and its standard deviation along x.
    fn error(&self, s: f64) -> (f64, f64) {
        let pose = self.motion.pose(&self.r1, "hall", time(s)).expect("a pose");
        ((pose.pose.x_m - 7.0 - s).abs(), pose.covariance[(0, 0)].sqrt())
    }

    /// The pose is right by its own covariance.
    fn is_right(&self, s: f64) {
        let (error, sigma) = self.error(s);
        assert!(error <= sigma, "{error} m off at {s} s, sigma {sigma} m");
    }

    fn refused(&self) -> BTreeMap<Code, u64> {
        self.motion.counts().0.rejected
    }
}

fn ns(seconds: f64) -> i64 {
    (seconds * 1e9).round() as i64
}

/// A message an hour ahead must not hold the pose at its place for an hour.
#[test]
fn one_stray_stamp_of_odometry_changes_nothing() {
    for (off_s, code) in [
        (HOUR, Some(Code::ClockAhead)),
        (0.15, None),
        (-1.0, Some(Code::ClockBehind)),
        (-30.0, Some(Code::ClockBehind)),
        (-HOUR, Some(Code::ClockBehind)),
    ] {
        let mut drive = Drive::new();
        drive.on(2.0, 3.0).unwrap();
        drive.odometry(3.05, off_s);
        // Nothing is held back: the next message moves the pose.
        let pose = drive.odometry(3.1, 0.0).unwrap_or_else(|| panic!("no pose after {off_s} s"));
        assert_eq!(pose.captured_ns, ns(3.1), "{off_s}");
        drive.is_right(3.1);
        drive.on(3.1, 4.0).unwrap();
        drive.is_right(4.0);
        // Corrections go on, too.
        let before = drive.error(4.0).1;
        let fixed = drive.fix(4.0, 4.0).unwrap();
        assert_eq!(fixed.corrections, 2, "{off_s}");
        assert!(drive.error(4.0).1 < before, "{off_s}");
        drive.is_right(4.0);
        assert_eq!(drive.refused(), code.map(|code| (code, 1)).into_iter().collect(), "{off_s}");
    }
}

#[test]
fn one_stray_stamp_of_slow_odometry_is_no_jump() {
    // Once a second, at 2 m/s: stamped 50 ms after the reading before it would be a jump.
    let (motion, r1) = motion();
    let send = |seq: u64, stamp_s: f64| {
        let odom_from_robot = Some(v1::Pose2 { x_m: 2.0 * seq as f64, ..v1::Pose2::default() });
        let message = v1::Odometry {
            epoch: 1,
            seq,
            captured_ns: ns(stamp_s),
            odom_from_robot,
            ..v1::Odometry::default()
        };
        motion.odometry(&r1, message.encode_to_vec().into(), time(seq as f64))
    };
    send(1, 1.0);
    let there = FrameStamp { odometry: None, ..at(ns(1.0), 0.0) };
    motion.apply_fix(&r1, there, &fix(10.0)).unwrap();
    send(2, 2.0).unwrap();
    send(3, 2.05).unwrap();
    let pose = send(4, 4.0).unwrap();
    assert!((pose.map_from_robot.unwrap().pose.unwrap().x_m - 16.0).abs() < 1e-9);
}

#[test]
fn one_stray_stamp_of_a_frame_changes_nothing() {
    for off_s in [HOUR, 0.15, -1.0, -30.0, -HOUR] {
        let mut drive = Drive::new();
        drive.on(2.0, 3.0).unwrap();
        let refused = drive.frame(3.0, 3.0 + off_s, "front");
        // A stamp one second behind may be a delay. Its fix contradicts the pose of that time and
        // is gated.
        assert_eq!(refused.is_err(), !(-2.0..=0.2).contains(&off_s), "{off_s}");
        if let Err(instead_ns) = refused {
            assert!((instead_ns - ns(3.0)).abs() < 1_000_000, "{off_s}: {instead_ns}");
        } else {
            drive.fix(3.0, 3.0 + off_s);
        }
        drive.on(3.0, 4.0).unwrap();
        let (error, sigma) = drive.error(4.0);
        assert!(error <= sigma.max(0.03), "{off_s}: {error} m off, sigma {sigma} m");
        // The fix waits for odometry of its time.
        drive.fix(4.1, 4.1);
        let corrections = drive.on(4.0, 4.5).unwrap().corrections;
        assert!(corrections >= 2, "{off_s}");
        drive.is_right(4.5);
    }
}

/// Scans along the corridor, whose walls keep the robot off them; one is stamped wrongly.
#[test]
fn one_stray_stamp_of_a_scan_changes_nothing() {
    for (off_s, is_refused) in [(HOUR, true), (0.15, false), (-1.0, true), (-30.0, true), (-HOUR, true)] {
        let (motion, r1, building) = walled();
        let truth = |s: f64| Pose2::new(12.0 + s, 0.1, 0.0);
        let odometry = |seq: u64, s: f64| {
            let odom_from_robot = Some(v1::Pose2 { x_m: 7.0 + s, y_m: 0.1, theta_rad: 0.0 });
            let message = v1::Odometry {
                epoch: 1,
                seq,
                captured_ns: ns(s),
                odom_from_robot,
                ..v1::Odometry::default()
            };
            motion.odometry(&r1, message.encode_to_vec().into(), time(s))
        };
        let scan = |seq: u64, s: f64, off_s: f64| {
            let bytes = scan_at(&building, seq, &truth(s));
            let wire = v1::Scan { captured_ns: ns(s + off_s), ..v1::Scan::decode(bytes).unwrap() };
            let before = motion.counts().1.accepted;
            motion.scan(&r1, wire.encode_to_vec().into(), time(s));
            if motion.counts().1.accepted > before {
                let (robot, job) = motion.scans().take().unwrap();
                motion.fix_by_scan(&robot, &job, time(s));
            }
        };
        let mut seq = 0;
        let mut on = |from: u64, to: u64| {
            let mut last = None;
            for i in from..to {
                let s = i as f64 * 0.1;
                seq += 1;
                last = odometry(seq, s);
                let off_s = if i == 25 { off_s } else { 0.0 };
                scan(seq, s, off_s);
            }
            last
        };
        on(0, 10);
        let pose = Pose2Covariance { pose: truth(0.9), covariance: Matrix3::identity() * 1e-4 };
        let first = FrameStamp { odometry: None, ..at(ns(0.9), 0.0) };
        motion.apply_fix(&r1, first, &Fix { pose, ..fix(0.0) }).unwrap();
        on(10, 26);
        let next = on(26, 27).expect("a pose after the stray scan");
        assert_eq!(next.captured_ns, ns(2.6), "{off_s}");
        let corrected = next.laser_corrections;
        let last = on(27, 40).unwrap();
        assert!(last.laser_corrections > corrected, "{off_s}: scans go on correcting");
        let (at, truth) = (last.map_from_robot.unwrap(), truth(3.9));
        let off = at.pose.unwrap();
        assert!((off.x_m - truth.x_m).abs() <= at.covariance[0].sqrt(), "{off_s}: {at:?}");
        assert!((off.y_m - truth.y_m).abs() <= 3.0 * at.covariance[4].sqrt(), "{off_s}: {at:?}");
        let refused: u64 = motion.counts().1.rejected.values().sum();
        assert_eq!(refused, u64::from(is_refused), "{off_s}");
    }
}

#[test]
fn a_clock_that_was_set_is_accepted_after_a_second() {
    for off_s in [HOUR, -HOUR, 5.0] {
        let mut drive = Drive::new();
        drive.on(2.0, 3.0).unwrap();
        assert_eq!(drive.on_by(3.0, 4.0, off_s), None, "{off_s}: not yet");
        let pose = drive.on_by(4.0, 4.5, off_s).unwrap_or_else(|| panic!("{off_s}: no pose"));
        assert_eq!(pose.captured_ns, ns(4.5 + off_s));
        assert!(pose.age_ms < 1.0, "{}", pose.age_ms);
        drive.is_right(4.5);
        // The cameras have the same clock.
        drive.frame(4.5, 4.5 + off_s, "front").unwrap();
        let captured_ns = ns(4.5 + off_s);
        let at = FrameStamp { captured_ns, odometry: None, now: time(4.5), ..at(0, 0.0) };
        assert_eq!(drive.motion.apply_fix(&drive.r1, at, &fix(11.5)).unwrap().corrections, 2);
        let refused: u64 = drive.refused().values().sum();
        assert_eq!(refused, RATE, "{off_s}");
    }
}

#[test]
fn odometry_that_jumped_with_the_clock_loses_the_pose() {
    let mut drive = Drive::new();
    drive.on(2.0, 3.0).unwrap();
    for i in 0..30_u64 {
        drive.seq += 1;
        let odom_from_robot = Some(v1::Pose2 { x_m: 500.0, ..v1::Pose2::default() });
        let s = 3.0 + i as f64 / RATE as f64;
        let message = v1::Odometry {
            epoch: 1,
            seq: drive.seq,
            captured_ns: ns(s + HOUR),
            odom_from_robot,
            ..v1::Odometry::default()
        };
        drive.motion.odometry(&drive.r1, message.encode_to_vec().into(), time(s));
    }
    assert_eq!(drive.motion.pose(&drive.r1, "hall", time(4.5)), None);
}

/// Two clocks in one robot: odometry wins, whichever came first.
#[test]
fn a_camera_by_another_clock_is_never_fused() {
    let mut drive = Drive::new();
    for i in 0..100 {
        let s = 2.0 + f64::from(i) / 10.0;
        drive.on(s, s + 0.1).unwrap();
        assert!(drive.frame(s + 0.1, s + 0.1 + HOUR, "other").is_err());
    }
    drive.is_right(12.0);
    let stamps = drive.motion.frame_stamps();
    assert_eq!(stamps.rejected, [(Code::ClockAhead, 100)].into());

    let (motion, r1) = motion();
    let mut late = Drive { motion, r1, seq: 0 };
    for i in 0..20 {
        let s = f64::from(i) / 10.0;
        late.frame(s, s + HOUR, "other").unwrap();
    }
    // Frames go on while odometry begins.
    for i in 0..20 {
        let s = 2.0 + f64::from(i) / 10.0;
        late.on(s, s + 0.1);
        let taken = late.frame(s + 0.1, s + 0.1 + HOUR, "other").is_ok();
        assert_eq!(taken, i < 10, "{i}");
    }
}

#[test]
fn a_robot_that_falls_silent_has_no_pose_after_the_named_time() {
    let mut drive = Drive::new();
    let pose = drive.on(2.0, 3.0).unwrap();
    assert!(pose.age_ms.abs() < 1.0, "{}", pose.age_ms);
    let max_s = MAX_POSE_AGE.as_secs_f64();
    let known = drive.motion.known_pose(&drive.r1, time(3.0 + max_s - 0.01)).unwrap();
    assert!((known.age.as_secs_f64() - max_s + 0.01).abs() < 1e-3);
    assert_eq!(drive.motion.known_pose(&drive.r1, time(3.0 + max_s + 0.01)), None);
    assert_eq!(drive.motion.pose(&drive.r1, "hall", time(3.0 + max_s + 0.01)), None);
    // A frame that took too long gives a past pose, not the present one.
    drive.frame(3.0, 3.0, "front").unwrap();
    let late = FrameStamp { odometry: None, now: time(3.0 + max_s + 0.01), ..at(ns(3.0), 0.0) };
    assert!(drive.motion.apply_fix(&drive.r1, late, &fix(10.0)).is_none());
    // Odometry carries the pose on.
    assert!(drive.odometry(8.0, 0.0).is_some());
    drive.is_right(8.0);
}

#[test]
fn odometry_once_a_second_has_a_pose_all_the_time() {
    let (motion, r1) = motion();
    let mut drive = Drive { motion, r1, seq: 0 };
    drive.odometry(1.0, 0.0);
    let there = FrameStamp { odometry: None, ..at(ns(1.0), 0.0) };
    drive.motion.apply_fix(&drive.r1, there, &fix(8.0)).unwrap();
    for i in 2..20 {
        assert!(drive.motion.known_pose(&drive.r1, time(f64::from(i) - 0.001)).is_some());
        assert!(drive.odometry(f64::from(i), 0.0).is_some());
    }
}

#[test]
fn messages_that_come_late_are_no_stray_ones() {
    let mut drive = Drive::new();
    // The link stalls for a second and a half; then everything comes at once.
    let mut taken = 0;
    for i in 1..=30 {
        drive.seq += 1;
        let s = 2.0 + f64::from(i) * 0.05;
        let odom_from_robot = Some(v1::Pose2 { x_m: s, ..v1::Pose2::default() });
        let message = v1::Odometry {
            epoch: 1,
            seq: drive.seq,
            captured_ns: ns(s),
            odom_from_robot,
            ..v1::Odometry::default()
        };
        let pose = drive.motion.odometry(&drive.r1, message.encode_to_vec().into(), time(3.5));
        taken += u32::from(pose.is_some());
    }
    assert_eq!(taken, 30);
    drive.is_right(3.5);
    assert_eq!(drive.refused(), BTreeMap::new());
}
