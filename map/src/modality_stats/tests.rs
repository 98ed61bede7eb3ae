//! Sums by hand, a corridor with known error models, scopes and fusion modes, limits.

use crate::{
    fuse::{FuseParams, Fuser},
    localise::{AmbiguityResolvedBy, Fix, FixSource},
    modality_stats::{
        advice::{ErrorModel, ModalityAdvice, StatsScope, map_from_aligned},
        evidence::{MIN_MEASUREMENTS, MIN_VISITS, ModalityStats, StatsByModality},
        learn::{MAX_CELLS, ReferenceRun, RunStats, learn_modality_stats},
        modality::{FusionMode, Modality},
        modality_map::ModalityMap,
        named_area::{MAX_CORNERS, MAX_NAME_BYTES, NamedArea},
        reference::{MAX_REFERENCE, ReferenceError, ReferenceTrajectory},
    },
    pose_cell::PoseCell,
    pose2::{Pose2, Pose2Covariance},
};
use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeMap;
use vision::{model::LandmarkId, random::Random};

const SECOND: i64 = 1_000_000_000;

/// A fix with `sigma` along, across, heading; in map axes, not the robot's.
fn fix(modality: FixSource, at: Pose2, sigma: [f64; 3]) -> Fix {
    let turn = map_from_aligned(if at.theta_rad.abs() > 1.5 { std::f64::consts::PI } else { 0.0 });
    let covariance = turn * Matrix3::from_diagonal(&Vector3::from(sigma).map(|s| s * s)) * turn.transpose();
    let landmarks = if modality == FixSource::Landmarks { vec![LandmarkId(1)] } else { Vec::new() };
    Fix {
        modality,
        pose: Pose2Covariance { pose: at, covariance },
        noise: covariance,
        nuisances: Vec::new(),
        landmarks,
        decided_by: AmbiguityResolvedBy::Single,
        chi2: 1.0,
        dof: 5,
    }
}

struct Recorded {
    odometry: Vec<(i64, Pose2)>,
    fixes: Vec<(i64, Fix)>,
    reference: Vec<(i64, Pose2)>,
}

/// Sigma of the laser along a corridor: undetermined.
const UNDETERMINED: f64 = 100.0;

/// 12 m along y = 2.5, there or back. Odometry measures 4 % too much, 12 % between x = 4 and 8. A
/// moved wall shifts the laser fix 0.2 m to the south everywhere, sigma 2 cm. Landmarks (sigma 5
/// cm) are observed below x = 4 only.
fn drive(random: &mut Random, back: bool) -> Recorded {
    let (start, step) = if back { (12.0, -0.05) } else { (0.0, 0.05) };
    let heading = if back { std::f64::consts::PI } else { 0.0 };
    let mut made = Recorded { odometry: Vec::new(), fixes: Vec::new(), reference: Vec::new() };
    let mut odometry = Pose2::default();
    for i in 0..=240_i64 {
        let at = i * SECOND / 10;
        let truth = Pose2::new(start + step * i as f64, 2.5, heading);
        if i > 0 {
            let bumpy = (4.0..8.0).contains(&truth.x_m);
            odometry = odometry.compose(&Pose2::new(0.05 * if bumpy { 1.12 } else { 1.04 }, 0.0, 0.0));
        }
        made.odometry.push((at, odometry));
        made.reference.push((at, truth));
        let noise = Vector3::new(random.normal(), random.normal(), random.normal());
        let laser = noise.component_mul(&Vector3::new(0.0, 0.02, 0.005));
        // At the pose by odometry, where the walls do not determine it.
        let along = Pose2::new(start, 2.5, heading).compose(&odometry).x_m;
        let seen = Pose2::new(along, 2.5 - 0.2 + laser.y, heading + laser.z);
        made.fixes.push((at, fix(FixSource::Laser, seen, [UNDETERMINED, 0.02, 0.005])));
        if truth.x_m < 4.0 {
            let noise = Vector3::new(random.normal(), random.normal(), random.normal());
            let e = noise.component_mul(&Vector3::new(0.05, 0.05, 0.01));
            made.fixes.push((at, fix(FixSource::Landmarks, truth.plus(&e), [0.05, 0.05, 0.01])));
        }
    }
    made
}

fn learnt(made: &Recorded) -> RunStats {
    let reference = ReferenceTrajectory::new(made.reference.clone(), 0.005, 0.002).unwrap();
    let run = ReferenceRun { odometry: &made.odometry, fixes: &made.fixes, reference: &reference };
    learn_modality_stats(&run, &FuseParams::default())
}

/// Four drives each way.
fn runs() -> Vec<BTreeMap<PoseCell, StatsByModality>> {
    let mut random = Random::new(4);
    (0..8).map(|i| learnt(&drive(&mut random, i % 2 == 1)).cells).collect()
}

#[test]
fn cells_are_squares_by_heading() {
    let cell = |x, y, theta| PoseCell::of(&Pose2::new(x, y, theta));
    assert_eq!(cell(0.2, -0.2, 0.1), PoseCell { x: 0, y: -1, heading: 0 });
    assert_eq!(cell(-3.0, 7.99, 1.6), PoseCell { x: -3, y: 7, heading: 1 });
    assert_eq!(cell(0.0, 0.0, 3.1).heading, 2);
    assert_eq!(cell(0.0, 0.0, -3.1).heading, 2);
    assert_eq!(cell(0.0, 0.0, -1.0).heading, 3);
    assert_eq!(cell(0.0, 0.0, -0.7).heading, 0);
    assert_eq!(PoseCell::try_from(<[i64; 3]>::from(cell(-3.0, 7.99, 1.6))), Ok(cell(-3.0, 7.99, 1.6)));
    assert_eq!(PoseCell::try_from([0, 0, 4]).unwrap_err().field, "cell.heading");
    assert_eq!(PoseCell::try_from([100_001, 0, 0]).unwrap_err().field, "cell.x");
    assert_eq!(PoseCell::try_from([0, i64::MIN, 0]).unwrap_err().field, "cell.y");
}

#[test]
fn areas_contain_their_points_and_are_checked() {
    // An L.
    let corners_m = vec![[0.0, 0.0], [4.0, 0.0], [4.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]];
    let area = NamedArea { name: "hall".into(), corners_m };
    area.check().unwrap();
    for (point, inside) in [([0.5, 2.5], true), ([3.5, 0.5], true), ([2.0, 2.0], false), ([-0.1, 0.5], false)]
    {
        assert_eq!(area.contains(point), inside, "{point:?}");
    }
    let bad = |name: &str, corners_m: Vec<[f64; 2]>| {
        NamedArea { name: name.into(), corners_m }.check().unwrap_err().field
    };
    assert_eq!(bad("", area.corners_m.clone()), "name");
    assert_eq!(bad(&"n".repeat(MAX_NAME_BYTES + 1), area.corners_m.clone()), "name");
    assert_eq!(bad("a", vec![[0.0, 0.0], [1.0, 0.0]]), "corners_m");
    assert_eq!(bad("a", vec![[0.0; 2]; MAX_CORNERS + 1]), "corners_m");
    assert_eq!(bad("a", vec![[0.0, 0.0], [1.0, f64::NAN], [1.0, 1.0]]), "corners_m");
}

#[test]
fn the_score_by_hand() {
    let mut evidence = ModalityStats::default();
    assert!(evidence.score().is_infinite());
    evidence.step(0.5, Some(&Vector3::new(0.3, 0.4, 0.0)));
    evidence.step(0.5, Some(&Vector3::new(0.3, -0.4, 0.1)));
    evidence.step(0.5, None);
    evidence.step(0.5, None);
    // Squares 0.25 and 0.25 + 0.01 / 0.01, mean 0.75; available on half of the path.
    assert!((evidence.score() - 1.5).abs() < 1e-12, "{}", evidence.score());
    let figures = evidence.figures();
    assert!((figures.mean[0] - 0.3).abs() < 1e-12 && figures.mean[1].abs() < 1e-12);
    assert!(figures.sigma[0] < 1e-7 && (figures.sigma[1] - 0.4).abs() < 1e-12);
    assert!((figures.availability - 0.5).abs() < 1e-12);
}

#[test]
fn a_bias_needs_several_passages_and_right_covariances_give_none() {
    let mut random = Random::new(5);
    let variances = Vector3::new(0.01, 0.04, 1e-4);
    let visit = |offset: f64, n: u32, random: &mut Random| {
        let mut evidence = ModalityStats::default();
        for _ in 0..n {
            let e = variances.map(|v: f64| v.sqrt() * random.normal()) + Vector3::new(0.0, offset, 0.0);
            evidence.measure(&e, &variances);
        }
        evidence.end_visit();
        evidence
    };
    // One passage gives no bias, only variance inflation.
    let once = visit(1.0, 100, &mut random);
    assert_eq!(once.fault(Some(1)).bias, Vector3::zeros());
    assert!(once.fault(Some(1)).excess.y > 15.0, "{:?}", once.fault(Some(1)));
    let mut several = ModalityStats::default();
    for _ in 0..MIN_VISITS {
        assert_eq!(several.fault(Some(1)).bias, Vector3::zeros());
        several.add(&visit(1.0, 30, &mut random));
    }
    let fault = several.fault(Some(1));
    assert!((fault.bias.y - 1.0).abs() < 0.1 && fault.excess.y < 0.5, "{fault:?}");
    assert_eq!(several.fault(None).bias, Vector3::zeros());
    // Measurements with right covariances: an inflation of a few percent, by chance.
    let mut honest = ModalityStats::default();
    for _ in 0..40 {
        honest.add(&visit(0.0, 30, &mut random));
    }
    let fault = honest.fault(Some(1));
    assert!(fault.excess.max() < 0.15 && fault.bias.y.abs() < 0.03, "{fault:?}");
    // Too few measurements give nothing.
    assert_eq!(visit(5.0, MIN_MEASUREMENTS as u32 - 1, &mut random).fault(Some(1)), ErrorModel::default());
}

#[test]
fn a_corridor_gives_the_best_modality_and_error_models_by_cell() {
    let runs = runs();
    let areas = ModalityMap::new(FusionMode::NearBest, Vec::new(), &runs);
    // Landmarks where they are observed; the laser is undetermined along and 0.2 m off across.
    let near = areas.advice(&Pose2::new(2.5, 2.5, 0.0));
    assert_eq!((near.best, near.level), (Some(Modality::Landmarks), StatsScope::Cell));
    assert!(near.uses(FixSource::Landmarks) && !near.uses(FixSource::Laser), "{near:?}");
    // Driven east, south is right of the robot; driven west, left.
    for (heading, sign) in [(0.0, -1.0), (std::f64::consts::PI, 1.0)] {
        for x in [2.5, 6.5, 10.5] {
            let fault = *areas.advice(&Pose2::new(x, 2.5, heading)).fault(Modality::Laser);
            assert!((fault.bias.y - sign * 0.2).abs() < 0.01, "{x} {heading}: {fault:?}");
            assert!(fault.excess.y < 1.0 && fault.excess.x < 1e-9, "{x} {heading}: {fault:?}");
        }
        // The floor: learnt as a bias, not as noise.
        let bumpy = *areas.advice(&Pose2::new(6.5, 2.5, heading)).fault(Modality::Odometry);
        assert!((bumpy.bias.x - 0.12).abs() < 0.01, "{bumpy:?}");
        let even = *areas.advice(&Pose2::new(10.5, 2.5, heading)).fault(Modality::Odometry);
        assert!((even.bias.x - 0.04).abs() < 1e-6, "{even:?}");
    }
    let honest = areas.advice(&Pose2::new(2.5, 2.5, 0.0));
    let landmarks = honest.fault(Modality::Landmarks);
    assert!(landmarks.bias.norm() < 0.03 && landmarks.excess.max() < 0.6, "{landmarks:?}");
    // In cells without runs: no bias from elsewhere, but an inflated variance of the laser.
    let away = areas.advice(&Pose2::new(40.5, 2.5, 0.0));
    assert_eq!((away.best, away.used), (None, [true; 3]));
    let fault = away.fault(Modality::Laser);
    assert!(fault.bias == Vector3::zeros() && fault.excess.y > 50.0, "{fault:?}");
}

#[test]
fn modes_choose_modalities_and_without_statistics_all_are_used() {
    let runs = runs();
    let at = Pose2::new(2.5, 2.5, 0.0);
    let used = |mode| ModalityMap::new(mode, Vec::new(), &runs).advice(&at).used;
    assert_eq!(used(FusionMode::All), [true; 3]);
    assert_eq!(used(FusionMode::Best), [false, false, true]);
    assert!(!used(FusionMode::NearBest)[1] && used(FusionMode::NearBest)[2]);
    assert_eq!(ModalityMap::new(FusionMode::Best, Vec::new(), &[]).advice(&at), ModalityAdvice::default());
}

#[test]
fn a_cell_with_few_measurements_takes_its_neighbours_statistics() {
    let mut runs = runs();
    for run in &mut runs {
        run.remove(&PoseCell { x: 10, y: 2, heading: 0 });
    }
    let areas = ModalityMap::new(FusionMode::All, Vec::new(), &runs);
    let (here, beside) =
        (areas.advice(&Pose2::new(10.5, 2.5, 0.0)), areas.advice(&Pose2::new(10.5, 3.5, 0.0)));
    assert_eq!((here.level, beside.level), (StatsScope::Neighbourhood, StatsScope::Neighbourhood));
    // Passages through two or three cells are as many as through one: enough for a bias all the
    // same.
    assert!((here.fault(Modality::Laser).bias.y + 0.2).abs() < 0.01, "{here:?}");
    let once = learnt(&drive(&mut Random::new(3), false)).cells;
    let advice = ModalityMap::new(FusionMode::All, Vec::new(), [&once]).advice(&Pose2::new(9.5, 3.5, 0.0));
    assert_eq!(advice.level, StatsScope::Neighbourhood);
    assert_eq!(advice.fault(Modality::Laser).bias, Vector3::zeros(), "one passage through three cells");
    assert_eq!(areas.advice(&Pose2::new(10.5, 4.5, 0.0)).level, StatsScope::Map);
}

#[test]
fn a_cell_with_few_measurements_takes_its_named_areas_statistics() {
    let mut runs = runs();
    // One cell was passed once, too few measurements of its own.
    let cell = PoseCell { x: 2, y: 2, heading: 0 };
    let mut once = learnt(&drive(&mut Random::new(9), false)).cells;
    once.retain(|c, _| *c == cell);
    for run in &mut runs {
        run.retain(|c, _| (c.x - 2).abs() > 1 || c.heading != 0);
    }
    runs.push(once);
    let at = Pose2::new(2.5, 2.5, 0.0);
    assert_eq!(ModalityMap::new(FusionMode::NearBest, Vec::new(), &runs).advice(&at).best, None);
    let west =
        NamedArea { name: "west".into(), corners_m: vec![[0.0, 0.0], [4.0, 0.0], [4.0, 5.0], [0.0, 5.0]] };
    let areas = ModalityMap::new(FusionMode::NearBest, vec![west], &runs);
    let advice = areas.advice(&at);
    assert_eq!((advice.best, advice.level), (Some(Modality::Landmarks), StatsScope::Area));
    // The same in a cell of the area without runs, and not outside.
    assert_eq!(areas.advice(&Pose2::new(2.5, 4.5, 0.0)).best, Some(Modality::Landmarks));
    assert_eq!(areas.advice(&Pose2::new(2.5, 5.5, 0.0)).best, None);
    let (area, by_heading) = areas.named().next().unwrap();
    assert_eq!((area.name.as_str(), by_heading[1].0[0].available()), ("west", 0));
    assert!(by_heading[0].0[0].available() > 3 * MIN_MEASUREMENTS);
}

#[test]
fn runs_add_up_in_any_order() {
    let runs = runs();
    let forth = ModalityMap::new(FusionMode::All, Vec::new(), &runs);
    let back = ModalityMap::new(FusionMode::All, Vec::new(), runs.iter().rev());
    for ((cell, a, _), (other, b, _)) in forth.cells().zip(back.cells()) {
        assert_eq!(cell, other);
        for k in 0..3 {
            assert_eq!((a[k].steps, a[k].fixes, a[k].visits), (b[k].steps, b[k].fixes, b[k].visits));
            assert!((a[k].normalised[1] - b[k].normalised[1]).abs() <= 1e-9 * a[k].normalised[1].abs());
            a[k].check().unwrap();
        }
    }
    let text = serde_json::to_string(&runs[0].iter().collect::<Vec<_>>()).unwrap();
    let read: Vec<(PoseCell, StatsByModality)> = serde_json::from_str(&text).unwrap();
    assert_eq!(read.len(), runs[0].len());
    for ((cell, read), (other, original)) in read.iter().zip(&runs[0]) {
        assert_eq!((cell, read[1].fixes, read[1].visits), (other, original[1].fixes, original[1].visits));
        assert!(
            (read[1].normalised[1] - original[1].normalised[1]).abs() <= 1e-12 * original[1].normalised[1]
        );
    }
}

#[test]
fn a_reference_is_checked_and_has_gaps() {
    let pose = |x: f64| Pose2::new(x, 0.0, 3.1);
    let poses = vec![(0, pose(0.0)), (SECOND, Pose2::new(1.0, 0.0, -3.1)), (3 * SECOND, pose(2.0))];
    let reference = ReferenceTrajectory::new(poses.clone(), 0.01, 0.01).unwrap();
    let half = reference.at(SECOND / 2).unwrap();
    // Half way over the seam of the circle.
    assert!((half.x_m - 0.5).abs() < 1e-12 && (half.theta_rad.abs() - std::f64::consts::PI).abs() < 1e-9);
    assert_eq!(reference.at(SECOND), Some(poses[1].1));
    assert_eq!([-1, 2 * SECOND, 3 * SECOND + 1].map(|t| reference.at(t)), [None; 3]);
    assert_eq!(
        ReferenceTrajectory::new(vec![poses[1], poses[0]], 0.0, 0.0),
        Err(ReferenceError::Order { index: 1 })
    );
    let error =
        |poses: Vec<(i64, Pose2)>, m, rad| ReferenceTrajectory::new(poses, m, rad).unwrap_err().to_string();
    assert!(error(poses[..1].to_vec(), 0.0, 0.0).contains("poses"));
    assert!(error(poses.clone(), 1.1, 0.0).contains("sigma_m"));
    assert!(error(poses.clone(), 0.0, f64::NAN).contains("sigma_rad"));
    assert!(error(vec![(0, pose(0.0)), (1, pose(1e6))], 0.0, 0.0).contains("pose 1"));
    let many = |n: usize| (0..n as i64).map(|t| (t, pose(0.0))).collect::<Vec<_>>();
    assert!(ReferenceTrajectory::new(many(MAX_REFERENCE), 0.0, 0.0).is_ok());
    assert!(error(many(MAX_REFERENCE + 1), 0.0, 0.0).contains("poses"));
}

#[test]
fn cells_of_a_run_are_bounded_and_a_run_without_overlap_is_empty() {
    // A diagonal through more cells than a run may have.
    let n = MAX_CELLS as i64 + 10;
    let at =
        |i: i64| (i * SECOND / 10, Pose2::new(i as f64 + 0.5, i as f64 + 0.5, std::f64::consts::FRAC_PI_4));
    let path: Vec<_> = (0..n).map(at).collect();
    let reference = ReferenceTrajectory::new(path.clone(), 0.0, 0.0).unwrap();
    let learnt = learn_modality_stats(
        &ReferenceRun { odometry: &path, fixes: &[], reference: &reference },
        &FuseParams::default(),
    );
    assert_eq!(learnt.cells.len(), MAX_CELLS);
    assert!(learnt.beyond >= 10, "{}", learnt.beyond);
    // Another time: nothing in common.
    let later: Vec<_> = path.iter().map(|(t, pose)| (t + 10_000 * SECOND, *pose)).collect();
    let seen = [(later[3].0, fix(FixSource::Landmarks, later[3].1, [0.1; 3]))];
    let learnt = learn_modality_stats(
        &ReferenceRun { odometry: &later, fixes: &seen, reference: &reference },
        &FuseParams::default(),
    );
    assert_eq!((learnt.cells.len(), learnt.unknown_fixes), (0, 1));
    let none = learn_modality_stats(
        &ReferenceRun { odometry: &[], fixes: &[], reference: &reference },
        &FuseParams::default(),
    );
    assert_eq!(none, RunStats::default());
}

/// Drives the corridor with these statistics; mean squared error past the landmarks, and the last
/// normalised squared error.
fn driven(random: &mut Random, areas: &ModalityMap) -> (f64, f64) {
    let made = drive(random, true);
    let mut fuser = Fuser::new(FuseParams::default());
    fuser.set_modality_map(std::sync::Arc::new(areas.clone()));
    fuser.apply_odometry(made.odometry[0].0, made.odometry[0].1).unwrap();
    let start = made.reference[0].1;
    fuser.start(&fix(FixSource::Landmarks, start, [0.02, 0.02, 0.01]).pose).unwrap();
    let (mut squares, mut nees) = (0.0, 0.0);
    for ((at, odometry), (_, truth)) in made.odometry.iter().zip(&made.reference) {
        fuser.apply_odometry(*at, *odometry).unwrap();
        for (_, seen) in made.fixes.iter().filter(|(t, _)| t == at) {
            fuser.apply_fix(*at, seen).unwrap();
        }
        let fused = fuser.pose().unwrap();
        let e = fused.pose.pose.minus(truth);
        squares += e.xy().norm_squared() / made.odometry.len() as f64;
        nees = e.dot(&fused.pose.covariance.cholesky().unwrap().solve(&e));
    }
    (squares, nees)
}

#[test]
fn learnt_statistics_reduce_the_error_of_drives() {
    let runs = runs();
    let mut random = Random::new(77);
    let untaught = driven(&mut random, &ModalityMap::default());
    for mode in [FusionMode::All, FusionMode::NearBest, FusionMode::Best] {
        let taught = driven(&mut random, &ModalityMap::new(mode, Vec::new(), &runs));
        assert!(taught.0 < 0.1 * untaught.0, "{mode:?}: {taught:?}, untaught {untaught:?}");
        assert!(taught.1 < 11.3, "{mode:?}: {taught:?}, untaught {untaught:?}");
    }
    assert!(untaught.1 > 50.0, "{untaught:?}");
}
