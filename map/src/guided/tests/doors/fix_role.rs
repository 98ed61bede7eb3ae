//! What a guided fix may do to the fused pose.

use super::*;

#[test]
fn a_guided_fix_starts_no_pose_and_ends_no_contradiction() {
    let drive = Drive::new(2.0, 4.0, 0.0, 61);
    let mut random = Random::new(3);
    let at = |x: f64, random: &mut Random| {
        let shown: Vec<_> =
            full_views(&Pose2::new(x, 0.0, 0.0), &drive.map, &mounting(), random).into_iter().collect();
        let Some(FixResult::Fixed(fix)) = drive.fix(&shown, None) else { panic!("{shown:?}") };
        *fix
    };
    let mut fuser = Fuser::new(FuseParams::default());
    fuser.apply_odometry(0, Pose2::default()).unwrap();
    let (here, away) = (at(4.0, &mut random), at(8.0, &mut random));
    assert_eq!(fuser.apply_fix_as(0, &here, FixRole::Guided).unwrap(), FixOutcome::NoPose);
    assert_eq!(fuser.pose(), None);
    assert_eq!(fuser.apply_fix(0, &here).unwrap(), FixOutcome::Started);
    let step = |fuser: &mut Fuser, i: i64| {
        fuser.apply_odometry(i * SECOND / 10, Pose2::new(0.1 * i as f64, 0.0, 0.0)).unwrap()
    };
    step(&mut fuser, 1);
    assert!(matches!(fuser.apply_fix(SECOND / 10, &away).unwrap(), FixOutcome::GatedOut { in_a_row: 1, .. }));
    // Guided: it corrects, and the contradiction stays.
    let next = at(4.1, &mut random);
    assert!(matches!(
        fuser.apply_fix_as(SECOND / 10, &next, FixRole::Guided).unwrap(),
        FixOutcome::Applied { .. }
    ));
    assert_eq!(fuser.pose().unwrap().contradictions, 1);
    // Guided and far off: left out, not counted.
    assert!(matches!(
        fuser.apply_fix_as(SECOND / 10, &away, FixRole::Guided).unwrap(),
        FixOutcome::GatedOut { in_a_row: 1, .. }
    ));
    assert_eq!(fuser.pose().unwrap().contradictions, 1);
    // An independent one that agrees ends it.
    step(&mut fuser, 2);
    assert!(matches!(
        fuser.apply_fix(SECOND / 5, &at(4.2, &mut random)).unwrap(),
        FixOutcome::Applied { .. }
    ));
    assert_eq!(fuser.pose().unwrap().contradictions, 0);
    // A replacing fix needs no earlier contradictions, may be late, and starts a pose, too.
    assert_eq!(fuser.apply_fix_as(SECOND / 10, &away, FixRole::Replacing).unwrap(), FixOutcome::Reset);
    assert!((fuser.pose().unwrap().pose.pose.x_m - 8.1).abs() < 0.2, "{:?}", fuser.pose());
    let mut empty = Fuser::new(FuseParams::default());
    empty.apply_odometry(0, Pose2::default()).unwrap();
    assert_eq!(empty.apply_fix_as(0, &away, FixRole::Replacing).unwrap(), FixOutcome::Started);
}
