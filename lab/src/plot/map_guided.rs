//! Guided recognition: where a known pose expects landmarks in the image, with the search gates of their corners, and
//! which observed quad is which landmark: by a sure pose, by an unsure one, and by an unsure one with neighbours
//! (method 26.1, 26.3).

use super::{
    map_plan::{
        CHI2_2_95, ESTIMATE, FAINT, LANDMARK, ODOMETRY, Plan, Sign, TRUTH, WALL, legend, page, title,
    },
    map_scene::{CAMERA, CAMERA_HEIGHT_M, IMAGE_PX, SIGMA_PX, around, look},
};
use crate::evaluate::chart::COLOURS;
use formats::svg::{put, text};
use map::{
    extrinsics::{CameraExtrinsics, pan_tilt},
    guided::{
        AssociateParams, Association, CameraView, Candidate, ExpectParams, Expectations, KnownLandmark,
        Observation, SearchGate, associate, expect,
    },
    place::{LandmarkPlace, PlaceSigmas},
    pose2::{Pose2, Pose2Covariance},
};
use nalgebra::{Matrix2, Point2, Vector3};
use std::f64::consts::FRAC_PI_2;
use vision::{geometry::Corners, model::LandmarkId, pose::LandmarkSize, random::Random};

/// Distance of the wall from the robot's path, and its height.
const WALL_M: f64 = 3.6;
const WALL_HEIGHT_M: f64 = 2.6;
const DOORS_M: [f64; 5] = [1.0, 2.4, 5.2, 6.6, 8.0];
const POSTER_M: f64 = 3.8;
const POSTER: usize = DOORS_M.len();
const NAMES: [&str; 6] = ["door 1", "door 2", "door 3", "door 4", "door 5", "poster"];
/// Where the robot really is, and where it believes to be.
const TRUTH_POSE: Pose2 = Pose2 { x_m: 2.9, y_m: 0.0, theta_rad: 0.0 };
const SEED: u64 = 6;
/// Evidence of a picture that looks like every door, and of one that nothing looks like, nats.
const ALIKE_NATS: f64 = 8.0;
const ALONE_NATS: f64 = 30.0;
const AMBIGUOUS: &str = COLOURS[4];

/// A prior pose and the quads that were detected.
struct Case {
    title: &'static str,
    /// Error and standard deviation along the corridor, metres.
    along_m: [f64; 2],
    detected: &'static [usize],
}

const CASES: [Case; 3] = [
    Case { title: "The pose is known to 5 cm", along_m: [0.06, 0.05], detected: &[3] },
    Case { title: "Known to 45 cm: one quad alone", along_m: [0.5, 0.45], detected: &[3] },
    Case { title: "The same, with neighbours", along_m: [0.5, 0.45], detected: &[2, 3, POSTER] },
];

struct Scene {
    places: Vec<LandmarkPlace>,
    mounting: CameraExtrinsics,
    /// Corners of what is wholly in the image.
    seen: Vec<Option<Corners>>,
}

impl Scene {
    fn new() -> anyhow::Result<Self> {
        let hung = |x: f64, z: f64, width_m: f64, height_m: f64| {
            let size = LandmarkSize { width_m, height_m };
            LandmarkPlace::by_hand(Vector3::new(x, WALL_M, z), -FRAC_PI_2, size, PlaceSigmas::default())
        };
        let doors = DOORS_M.iter().map(|x| hung(*x, 1.0, 0.9, 2.0));
        let places: Vec<LandmarkPlace> =
            doors.chain([hung(POSTER_M, 1.5, 0.6, 0.84)]).collect::<Result<_, _>>()?;
        let seat = pan_tilt(55.0_f64.to_radians(), 0.0, Vector3::new(0.0, 0.0, CAMERA_HEIGHT_M));
        let mounting = CameraExtrinsics::new(seat)?;
        let mut random = Random::new(SEED);
        let seen = places
            .iter()
            .map(|place| look(&TRUTH_POSE, &mounting, place, SIGMA_PX, &mut random))
            .map(|seen| seen.map(|s| s.measured.corners_px))
            .collect();
        Ok(Self { places, mounting, seen })
    }

    fn prior(case: &Case) -> anyhow::Result<Pose2Covariance> {
        let believed = TRUTH_POSE.plus(&Vector3::new(-case.along_m[0], 0.02, 0.004));
        around(believed, [case.along_m[1], 0.05, 0.01])
    }

    fn expected(&self, prior: &Pose2Covariance) -> anyhow::Result<Expectations> {
        let view = CameraView { mounting: &self.mounting, intrinsics: &CAMERA, image_px: IMAGE_PX };
        let known: Vec<KnownLandmark<'_>> = self
            .places
            .iter()
            .enumerate()
            .map(|(i, place)| KnownLandmark { landmark: LandmarkId(i as u64), place, visible: None })
            .collect();
        Ok(expect(prior, &view, &known, &[], &ExpectParams::default())?)
    }

    /// A door may be any door, the poster is itself.
    fn observation(&self, i: usize) -> Option<Observation> {
        let candidate = |k: usize, picture_nats| Candidate {
            landmark: LandmarkId(k as u64),
            picture_nats,
            prior_nats: 0.0,
        };
        let candidates = if i == POSTER {
            vec![candidate(POSTER, ALONE_NATS)]
        } else {
            (0..POSTER).map(|k| candidate(k, ALIKE_NATS)).collect()
        };
        let covariance = [Matrix2::identity() * SIGMA_PX * SIGMA_PX; 4];
        Some(Observation::new(self.seen[i]?, &covariance, candidates))
    }
}

/// The picture.
pub(super) fn svg() -> anyhow::Result<String> {
    let scene = Scene::new()?;
    page([1140.0, 620.0], |svg| {
        for (i, case) in CASES.iter().enumerate() {
            let left = 30.0 + 368.0 * i as f64;
            title(svg, (left, 26.0), case.title);
            let prior = Scene::prior(case)?;
            image(svg, &scene, (left, i), (case, &prior))?;
            corridor(svg, &scene, left, &prior);
        }
        legend(
            svg,
            (30.0, 550.0),
            &[
                (Sign::Dashed, ODOMETRY, "expected corners"),
                (Sign::Ellipse, ODOMETRY, "search gates of its corners, 99.9 % (right: of one door)"),
                (Sign::Robot, TRUTH, "where the robot really is"),
            ],
        );
        legend(
            svg,
            (450.0, 550.0),
            &[
                (Sign::Line, LANDMARK, "detected quad that is one landmark"),
                (Sign::Line, AMBIGUOUS, "detected quad that may be several"),
                (Sign::Ellipse, ESTIMATE, "prior pose, 95 %"),
            ],
        );
        legend(svg, (770.0, 550.0), &[(Sign::Line, FAINT, "in the image, but not detected here")]);
        Ok(())
    })
}

/// The image as a plan with v upwards.
fn above(px: &Point2<f64>) -> Point2<f64> {
    Point2::new(px.x, -px.y)
}

fn image(
    svg: &mut String,
    scene: &Scene,
    (left, number): (f64, usize),
    (case, prior): (&Case, &Pose2Covariance),
) -> anyhow::Result<()> {
    let expectations = scene.expected(prior)?;
    let plan = Plan::new((left, 40.0), [[-0.5, 0.5 - IMAGE_PX[1]], [IMAGE_PX[0] - 0.5, 0.5]], 0.53);
    let (right, bottom) = plan.end_px();
    let frame =
        format!(r#"<rect x="{left}" y="40" width="{:.1}" height="{:.1}""#, right - left, bottom - 40.0);
    put(svg, &format!(r#"<clipPath id="image{number}">{frame}/></clipPath>"#));
    put(svg, &format!(r##"{frame} fill="#f4f4f4" stroke="#777"/>"##));
    put(svg, &format!(r#"<g clip-path="url(#image{number})">"#));
    wall_edges(svg, scene, &plan);
    for (i, corners) in scene.seen.iter().enumerate() {
        let Some(corners) = corners else { continue };
        if !case.detected.contains(&i) {
            let style = format!(r#"fill="none" stroke="{FAINT}""#);
            plan.area(svg, corners.points().iter().map(above), &style);
        }
    }
    for expected in &expectations.landmarks {
        let style = format!(r#"fill="none" stroke="{ODOMETRY}" stroke-dasharray="5 3""#);
        plan.area(svg, expected.corners_px.iter().map(above), &style);
        // An unsure pose has wide gates: those of one landmark are enough to see.
        let is_drawn = number == 0 || expected.landmark.0 as usize == case.detected[case.detected.len() / 2];
        for gate in expected.gates.iter().filter(|_| is_drawn) {
            draw_gate(svg, &plan, gate);
        }
        let names =
            expected.corners_px.map(|c| above(&c).coords).iter().sum::<nalgebra::Vector2<f64>>() / 4.0;
        put(svg, &format!(r#"<g fill="{ODOMETRY}">"#));
        let name = NAMES[expected.landmark.0 as usize].trim_start_matches("door ");
        plan.label(svg, &names.into(), ("middle", [0.0, 0.0]), name);
        put(svg, "</g>");
    }
    let observations: Vec<Observation> = case.detected.iter().filter_map(|i| scene.observation(*i)).collect();
    let found = associate(&expectations, &observations, &AssociateParams::default())?;
    let mut said = Vec::new();
    for (observation, association) in observations.iter().zip(&found.observations) {
        let (colour, words) = verdict(association);
        let style = format!(r#"fill="{colour}" fill-opacity="0.12" stroke="{colour}" stroke-width="2.5""#);
        plan.area(svg, observation.corners_px.points().iter().map(above), &style);
        said.push(words);
    }
    put(svg, "</g>");
    text(svg, (left, bottom + 18.0), "start", &format!("detected: {}", said.join("; ")));
    Ok(())
}

fn verdict(association: &Association) -> (&'static str, String) {
    let name = |id: &LandmarkId| NAMES[id.0 as usize];
    match association {
        Association::Unique { landmark, .. } => (LANDMARK, name(landmark).to_owned()),
        Association::Ambiguous { landmarks, or_none } => {
            let mut all: Vec<&str> = landmarks.iter().map(name).collect();
            if *or_none {
                all.push("none");
            }
            (AMBIGUOUS, all.join(" or "))
        }
        Association::None(_) => (ESTIMATE, "none that is expected".to_owned()),
    }
}

fn draw_gate(svg: &mut String, plan: &Plan, gate: &SearchGate) {
    // The plan's ellipses are of 95 %; v is upwards there.
    let flip = Matrix2::new(1.0, 0.0, 0.0, -1.0);
    let covariance = flip * gate.covariance_px2 * flip * (gate.chi2 / CHI2_2_95);
    let style = format!(r#"fill="{ODOMETRY}" fill-opacity="0.08" stroke="{ODOMETRY}" stroke-width="0.8""#);
    plan.ellipse(svg, (&above(&gate.center_px), &covariance), &style);
}

/// Where the wall meets floor and ceiling in the image.
fn wall_edges(svg: &mut String, scene: &Scene, plan: &Plan) {
    let camera_from_map = (TRUTH_POSE.to_isometry3() * scene.mounting.robot_from_camera).inverse();
    for z in [0.0, WALL_HEIGHT_M] {
        let ends = [2.5, 16.0].map(|x| {
            let p = camera_from_map * nalgebra::Point3::new(x, WALL_M, z);
            above(&CAMERA.project(&p.coords))
        });
        plan.line(svg, ends, &format!(r#"stroke="{FAINT}""#));
    }
}

/// The prior from above.
fn corridor(svg: &mut String, scene: &Scene, left: f64, prior: &Pose2Covariance) {
    let plan = Plan::new((left, 340.0), [[0.2, -0.5], [8.8, 3.9]], 36.0);
    let ends = [Point2::new(0.2, WALL_M), Point2::new(8.8, WALL_M)];
    plan.line(svg, ends, &format!(r#"stroke="{WALL}" stroke-width="2.5""#));
    for (i, place) in scene.places.iter().enumerate() {
        plan.landmark(svg, place, if i == POSTER { COLOURS[3] } else { LANDMARK });
        let number = NAMES[i].trim_start_matches("door ");
        plan.label(svg, &Point2::new(place.x_m, WALL_M), ("middle", [0.0, 20.0]), number);
    }
    // What the image covers, by the prior.
    let half = (0.5 * IMAGE_PX[0] / CAMERA.fx_px).atan();
    let robot = Point2::from(prior.pose.position());
    let edge = |a: f64| {
        let heading = prior.pose.theta_rad + 55.0_f64.to_radians() + a;
        robot + nalgebra::Vector2::new(heading.cos(), heading.sin()) * 1.6
    };
    plan.line(svg, [edge(-half), robot, edge(half)], &format!(r#"stroke="{ESTIMATE}""#));
    plan.pose_ellipse(svg, prior, ESTIMATE);
    plan.robot(svg, &prior.pose, ESTIMATE);
    plan.robot(svg, &TRUTH_POSE, TRUTH);
    plan.scale_bar(svg, 1.0);
}
