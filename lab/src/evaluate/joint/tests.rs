//! One simulated building in the cases that hold the method together.

use super::{
    building::{Building, NAMED, OBJECTS, Shape},
    cases, evaluated,
    report::{Report, Row},
};
use vision::random::Random;

/// A building that took no part in the figures of the documents.
const SEED: u64 = 77;

fn report(names: &[&str]) -> Report {
    let mut all = cases::all();
    all.retain(|case| names.contains(&case.name));
    assert_eq!(all.len(), names.len());
    evaluated(1, SEED, &all)
}

fn row<'a>(report: &'a Report, case: &str) -> &'a Row {
    report.rows.iter().find(|row| row.case == case).unwrap()
}

#[test]
fn one_drive_surveys_its_building_and_calibrates_its_camera() {
    let report = report(&["a", "d", "d3"]);
    let (steps, joint, open) = (row(&report, "a"), row(&report, "d"), row(&report, "d3"));
    assert_eq!([steps.failed, joint.failed, open.failed], [0; 3]);
    assert!(joint.landmarks >= NAMED * 3 / 4, "{joint:?}");
    let median = |row: &Row| row.aligned_mm.unwrap().median;
    assert!(median(joint) < 45.0 && median(joint) < 0.7 * median(steps), "{report:?}");
    // The camera was stated wrong by 1 deg, 2 cm and 0.5 %.
    assert!(joint.mounting_deg.unwrap().p95 < 0.05 && joint.mounting_mm.unwrap().p95 < 10.0, "{joint:?}");
    assert!(joint.loop_mm.unwrap().p95 < 10.0 && open.loop_mm.unwrap().p95 > 10.0, "{report:?}");
    let nees = [joint.landmark_nees, joint.wall_nees, joint.camera_nees].map(Option::unwrap);
    assert!(nees.iter().all(|n| (0.3..2.5).contains(n)), "{nees:?}");
}

#[test]
fn wrong_identities_are_not_kept() {
    let report = report(&["w30"]);
    let row = row(&report, "w30");
    assert!(row.wrong > 0 && row.wrong_kept == 0, "{row:?}");
    assert!(row.right > row.wrong && row.right_lost == 0, "{row:?}");
}

#[test]
fn the_same_seed_gives_the_same_report() {
    let text = || serde_json::to_string(&report(&["d2"])).unwrap();
    assert_eq!(text(), text());
}

#[test]
fn objects_hang_apart_on_walls_that_face_them() {
    for shape in [Shape::Ring, Shape::Bare] {
        let building = Building::drawn(shape, &mut Random::new(SEED));
        assert_eq!(building.objects.len(), OBJECTS);
        let (path, way) = building.path((0.5, 60.0), false, &mut Random::new(1));
        assert_eq!(path.len(), way.len());
        for pair in path.windows(2) {
            let step = pair[0].between(&pair[1]);
            assert!((0.2..0.8).contains(&step.position().norm()) && step.x_m > 0.0, "{step:?}");
        }
        for (object, on) in building.objects.iter().zip(&building.hangs_on) {
            let line = building.sections[*on].line();
            let off = line.normal().dot(&(object.centre.xy() - line.anchor.coords));
            assert!(off.abs() < 0.05, "{off}");
        }
    }
}
