use crate::{
    place::{LandmarkPlace, PlaceSigmas},
    pose2::Pose2,
    relocalise::{
        grid_belief::GridBelief,
        observation::{MAX_MEMBERS, PossibleLandmark, RelativeObservation},
        params::GridBeliefParams,
    },
    visibility::{PanTiltCamera, VisibilityParams, visibility},
};
use nalgebra::{Matrix3, Point2, Vector3};
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use vision::pose::LandmarkSize;

fn door(x: f64, y: f64, theta: f64) -> LandmarkPlace {
    let size = LandmarkSize { width_m: 0.9, height_m: 2.0 };
    LandmarkPlace::by_hand(Vector3::new(x, y, 1.0), theta, size, PlaceSigmas::default()).unwrap()
}

fn sharp() -> GridBeliefParams {
    GridBeliefParams { along_m: 0.0, turn_rad: 0.0, ..GridBeliefParams::default() }
}

/// A door on the left, 1 m away, facing the robot.
fn beside() -> RelativeObservation {
    let covariance = Matrix3::from_diagonal(&Vector3::new(0.01, 0.01, 0.01));
    RelativeObservation { robot_from_landmark: Pose2::new(0.0, 1.0, -FRAC_PI_2), covariance }
}

/// A corridor one cell wide, 20 m long, the robot heading east, with identical doors on its left.
const DOORS: [f64; 3] = [2.1, 6.1, 14.1];

fn corridor(p: &GridBeliefParams) -> GridBelief {
    let east = |pose: &Pose2| f64::from(pose.theta_rad.abs() < 0.01);
    GridBelief::new([Point2::new(0.0, 0.0), Point2::new(20.0, 0.2)], east, p).unwrap()
}

fn doors() -> Vec<LandmarkPlace> {
    DOORS.iter().map(|x| door(*x, 1.1, -FRAC_PI_2)).collect()
}

fn members(places: &[LandmarkPlace], clutter: f64) -> Vec<PossibleLandmark<'_>> {
    let probability = (1.0 - clutter) / places.len() as f64;
    places.iter().map(|place| PossibleLandmark { place, visible: None, probability }).collect()
}

/// The same by hand: a hundred cells in a row, Bayes' rule written out.
struct ByHand([f64; 100]);

impl ByHand {
    fn new() -> Self {
        Self([0.01; 100])
    }

    fn observe(&mut self) {
        // Variances of the observation and of a cell: 0.01 + 0.04 / 12, and of a heading: 0.01 +
        // (10 deg)^2 / 12.
        let (v, t) = (0.01 + 0.04 / 12.0, 0.01 + (TAU / 36.0).powi(2) / 12.0);
        let peak = 1.0 / ((TAU * v) * (TAU * t).sqrt());
        for (i, belief) in self.0.iter_mut().enumerate() {
            let x = 0.2 * (i as f64 + 0.5);
            // Beyond 4.5 standard deviations of the position an observation is cut off.
            let reach = 4.5 * (2.0 * v).sqrt();
            let doors = DOORS.map(|door| {
                let off = door - x;
                if off.abs() > reach + 0.2 { 0.0 } else { 0.3 * peak * (-0.5 * off * off / v).exp() }
            });
            *belief *= 0.1 / (PI * 64.0 * TAU) + doors.iter().sum::<f64>();
        }
        self.normalise();
    }

    fn moved(&mut self, cells: usize) {
        let before = self.0;
        for (i, belief) in self.0.iter_mut().enumerate() {
            *belief = if i >= cells { before[i - cells] } else { 0.0 };
        }
        self.normalise();
        for belief in &mut self.0 {
            *belief = 0.99 * *belief + 0.01 * 0.01;
        }
    }

    fn normalise(&mut self) {
        let total: f64 = self.0.iter().sum();
        for belief in &mut self.0 {
            *belief /= total;
        }
    }
}

#[test]
fn three_doors_by_hand() {
    let p = sharp();
    let (mut belief, mut by_hand) = (corridor(&p), ByHand::new());
    let places = doors();
    let compare = |belief: &GridBelief, by_hand: &ByHand, when: &str| {
        for (i, expected) in by_hand.0.iter().enumerate() {
            let got = belief.belief(&Pose2::new(0.2 * (i as f64 + 0.5), 0.1, 0.0));
            assert!((got - expected).abs() < 1e-6, "{when}, cell {i}: {got} for {expected}");
        }
    };
    compare(&belief, &by_hand, "at first");
    belief.update(&beside(), &members(&places, 0.1)).unwrap();
    by_hand.observe();
    compare(&belief, &by_hand, "one door");
    let modes = belief.modes();
    assert_eq!(modes.len(), 3, "{modes:?}");
    for mode in &modes {
        assert!((mode.mass - 1.0 / 3.0).abs() < 0.01, "{modes:?}");
    }
    assert_eq!(belief.resolved(), None);
    // After 4 m there is a door again: only the second is 4 m behind another.
    belief.predict(&Pose2::new(4.0, 0.0, 0.0)).unwrap();
    by_hand.moved(20);
    compare(&belief, &by_hand, "4 m on");
    assert_eq!(belief.resolved(), None);
    belief.update(&beside(), &members(&places, 0.1)).unwrap();
    by_hand.observe();
    compare(&belief, &by_hand, "the second door");
    let mode = belief.resolved().unwrap();
    assert!(
        (mode.pose.pose.x_m - DOORS[1]).abs() < 0.05 && mode.pose.pose.theta_rad.abs() < 0.05,
        "{mode:?}"
    );
}

#[test]
fn small_motions_add_up_without_blur() {
    let p = GridBeliefParams { carried: 0.0, ..sharp() };
    let at = Pose2::new(3.1, 3.1, 0.0);
    let prior = |pose: &Pose2| f64::from(pose.minus(&at).norm() < 0.05);
    let mut belief = GridBelief::new([Point2::origin(), Point2::new(10.0, 10.0)], prior, &p).unwrap();
    let mut pose = at;
    for _ in 0..50 {
        let motion = Pose2::new(0.05, 0.01, 0.03);
        belief.predict(&motion).unwrap();
        pose = pose.compose(&motion);
    }
    let mode = belief.resolved().unwrap();
    assert!((mode.mass - 1.0).abs() < 1e-9 && mode.pose.pose.minus(&pose).norm() < 0.1, "{mode:?} {pose:?}");
    assert!(belief.entropy_nats() < 1e-9, "still one cell");
}

#[test]
fn motion_spreads_by_its_variance() {
    let p = GridBeliefParams { carried: 0.0, along_m: 0.1, turn_rad: 0.05, ..GridBeliefParams::default() };
    let at = Pose2::new(5.1, 5.1, 0.0);
    let prior = |pose: &Pose2| f64::from(pose.minus(&at).norm() < 0.05);
    let mut belief = GridBelief::new([Point2::origin(), Point2::new(30.0, 10.0)], prior, &p).unwrap();
    for _ in 0..160 {
        belief.predict(&Pose2::new(0.1, 0.0, 0.0)).unwrap();
    }
    // 16 m: 0.4 m and 0.2 rad, and what the turns have moved across.
    assert!(belief.entropy_nats() > 2.0);
    let wide = GridBelief { p: GridBeliefParams { mode_m: 5.0, mode_rad: 3.0, ..p.clone() }, ..belief };
    let c = wide.modes()[0].pose.covariance;
    assert!((c[(2, 2)].sqrt() - 0.2).abs() < 0.05, "{c}");
    assert!(c[(0, 0)].sqrt() > 0.3 && c[(0, 0)].sqrt() < 0.6, "{c}");
}

#[test]
fn a_kidnapped_robot_is_localised_again() {
    let p = sharp();
    let mut belief = corridor(&p);
    let unique = [door(4.1, 1.1, -FRAC_PI_2)];
    for _ in 0..5 {
        belief.update(&beside(), &members(&unique, 0.1)).unwrap();
        belief.predict(&Pose2::default()).unwrap();
    }
    assert!((belief.resolved().unwrap().pose.pose.x_m - 4.1).abs() < 0.05);
    let other = [door(16.1, 1.1, -FRAC_PI_2)];
    let mut observations = 0;
    while belief.resolved().is_none_or(|m| (m.pose.pose.x_m - 16.1).abs() > 0.1) {
        belief.update(&beside(), &members(&other, 0.1)).unwrap();
        belief.predict(&Pose2::default()).unwrap();
        observations += 1;
        assert!(observations <= 3, "{:?}", belief.modes());
    }
}

#[test]
fn a_landmark_is_not_observed_from_outside_its_area() {
    let p = sharp();
    let mut belief = corridor(&p);
    let places = [door(4.1, 1.1, -FRAC_PI_2), door(14.1, 1.1, -FRAC_PI_2)];
    let wall =
        crate::visibility::Obstacle { a: Point2::new(13.0, 0.6), b: Point2::new(15.0, 0.6), height_m: None };
    let viewer = PanTiltCamera { height_px: 4000.0, tilt_rad: [-1.2, 1.2], ..PanTiltCamera::default() };
    let area =
        |place: &LandmarkPlace| visibility(place, &[wall], &viewer, &VisibilityParams::default()).unwrap();
    let areas: Vec<_> = places.iter().map(area).collect();
    let members: Vec<_> = places
        .iter()
        .zip(&areas)
        .map(|(place, visible)| PossibleLandmark { place, visible: Some(visible), probability: 0.45 })
        .collect();
    belief.update(&beside(), &members).unwrap();
    assert!((belief.resolved().unwrap().pose.pose.x_m - 4.1).abs() < 0.1);
}

#[test]
fn values_out_of_range_are_refused_with_their_field() {
    let new = |side: f64, p: &GridBeliefParams| {
        GridBelief::new([Point2::origin(), Point2::new(side, side)], |_| 1.0, p)
            .map(|_| ())
            .map_err(|e| e.field)
    };
    let p = GridBeliefParams::default();
    assert_eq!(new(10.0, &p), Ok(()));
    assert_eq!(new(101.0, &p), Err("cells"));
    assert_eq!(new(1.0, &GridBeliefParams { cell_m: 0.0, ..p.clone() }), Err("cell_m"));
    assert_eq!(new(1.0, &GridBeliefParams { clutter: 1.1, ..p.clone() }), Err("clutter"));
    let nowhere = GridBelief::new([Point2::origin(), Point2::new(1.0, 1.0)], |_| f64::NAN, &p);
    assert_eq!(nowhere.unwrap_err().field, "belief");
    let mut belief = corridor(&p);
    assert!(belief.predict(&Pose2::new(f64::NAN, 0.0, 0.0)).is_err());
    let places = vec![door(1.0, 1.0, 0.0); MAX_MEMBERS + 1];
    assert_eq!(belief.update(&beside(), &members(&places, 0.1)).unwrap_err().field, "members");
    // After leaving the grid, the belief is the prior again.
    belief.predict(&Pose2::new(500.0, 0.0, 0.0)).unwrap();
    assert!(belief.entropy_nats() > 4.0);
}
