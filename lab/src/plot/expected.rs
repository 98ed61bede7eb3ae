//! Guided recognition: where a known pose expects landmarks in a frame, and a landmark that the image border cuts,
//! which no quad shows, found at its expected corners.

use super::{
    Target,
    landmark::Landmark,
    panels::{cut, explained, on, row, titled},
};
use anyhow::Context as _;
use cli::drawing::{BLUE, Colour, GREEN, ORANGE, Picture, WHITE};
use map::{
    extrinsics::{CameraExtrinsics, pan_tilt},
    guided::{CameraView, ExpectParams, Expected, KnownLandmark, expect},
    place::{LandmarkPlace, PlaceSigmas},
    pose2::{Pose2, Pose2Covariance},
    visibility::Obstacle,
};
use nalgebra::{Isometry3, Matrix3, Point2, SymmetricEigen, Vector3};
use sim::{
    building::{Building, LandmarkTruth},
    camera::Camera,
    corridor::CorridorParams,
    render::{Rendered, Renderer},
    sensor::SensorParams,
};
use std::{collections::BTreeMap, sync::Arc};
use vision::{
    frame::GrayImage,
    geometry::Corners,
    model::{LandmarkId, LandmarkModel, ModelSet},
    params::Params,
    pipeline::{ExpectedLandmark, FrameCamera, LandmarkDatabase, Pipeline, QuadAnalysis, expected},
    recognise::{DistanceKind, Verdict},
    trace::NoTrace,
};

/// A corridor with posters on both walls.
const SEED: u64 = 5;
/// The poster that the image border cuts.
const CUT: usize = 2;
/// Error of the prior pose, metres and radians, and its standard deviations.
const PRIOR_ERROR: [f64; 3] = [0.06, -0.05, 0.015];
const PRIOR_SIGMAS: [f64; 3] = [0.06, 0.06, 0.015];
/// The part of the frame that is shown enlarged.
const CLOSE_PX: [usize; 2] = [150, 240];
const FACTOR: usize = 2;

/// What the picture of expected landmarks is drawn of.
#[derive(Debug, clap::Args)]
pub(crate) struct ExpectedArgs {
    /// Another seed builds another corridor with other posters.
    #[arg(long, default_value_t = SEED)]
    seed: u64,
    #[command(flatten)]
    pub(super) target: Target,
}

/// The frame, and what is known of the robot and its map.
struct Frame {
    building: Building,
    rendered: Rendered,
    prior: Pose2Covariance,
    mounting: CameraExtrinsics,
    camera: Camera,
}

pub(crate) fn draw(args: &ExpectedArgs) -> anyhow::Result<Picture> {
    let p = Params::default();
    let frame = Frame::new(args.seed)?;
    let models = frame.taught(args, &p)?;
    let image = &frame.rendered.image;
    let database = LandmarkDatabase { models: &models, sizes: &BTreeMap::new(), kind: DistanceKind::Both };
    let facts = Pipeline::default().analyse(image, FrameCamera::level(None), database, &p, &mut NoTrace);
    let expectations = frame.expected()?;
    let named: Vec<(LandmarkId, &QuadAnalysis)> =
        facts.quads.iter().filter_map(|q| Some((unique(q)?, q))).collect();
    let is_named = |e: &&Expected| named.iter().any(|(id, _)| *id == e.landmark);
    let asked: Vec<(&Expected, Option<ExpectedLandmark>)> = expectations
        .iter()
        .filter(|e| !is_named(e))
        .filter_map(|e| {
            let corners = Corners::new(e.corners_px).ok()?;
            Some((e, expected(image, &corners, e.landmark, &models, &p)))
        })
        .collect();

    let mut whole = Picture::of(image, 0.7);
    let all = |picture: &mut Picture, place: &dyn Fn(&Point2<f64>) -> [f64; 2]| {
        for e in &expectations {
            gates(picture, e, place);
        }
        for (_, q) in &named {
            outline(picture, q.quad.corners_px.points(), 2.4, GREEN, place);
        }
        for found in asked.iter().filter_map(|a| a.1.as_ref()) {
            outline(picture, found.corners_px.points(), 2.4, ORANGE, place);
        }
    };
    all(&mut whole, &|c| [c.x, c.y]);
    let corner = close(image, asked.iter().find(|a| a.1.is_some()).map(|a| a.0));
    let [width, height] = CLOSE_PX;
    let mut near = Picture::of(&cut(image, [corner[0], corner[1], width, height]), 0.7).enlarged(FACTOR);
    all(&mut near, &|c| on([c.x - corner[0] as f64, c.y - corner[1] as f64], FACTOR));
    let words = asked.iter().filter_map(|a| a.1.as_ref()).filter_map(|f| f.points.as_ref()).map(|points| {
        format!(
            "found by {} of {} matches and {} of {} other points",
            points.inliers, points.matches, points.agreeing, points.checked
        )
    });
    let words: Vec<String> = words.collect();
    let found = words.first().map_or("nothing was found where it is expected", String::as_str);
    let expected = format!("expected from the known pose: {}, with gates", expectations.len());
    Ok(explained(
        row(&[titled(&whole, "the frame", WHITE), titled(&near, "the one asked for", WHITE)]),
        &[
            (&expected, BLUE),
            (&format!("named by the picture alone: {}", named.len()), GREEN),
            (&format!("cut by the image border, {found}"), ORANGE),
        ],
    ))
}

impl Frame {
    fn new(seed: u64) -> anyhow::Result<Self> {
        let params = CorridorParams { first_poster: seed, ..CorridorParams::default() };
        let building = Building::corridor_with(&params, seed);
        let target = building.posters().nth(CUT).context("the corridor has too few posters")?;
        let at = target.map_from_landmark.translation.vector;
        let pose = Pose2::new(at.x - 1.3, -0.35 * at.y, 0.0);
        let bearing = (at.y - pose.y_m).atan2(at.x - pose.x_m);
        // The optical axis beside the poster, so that the image border cuts it.
        let pan = bearing - 0.52 * bearing.signum();
        let robot_from_camera: Isometry3<f64> = pan_tilt(pan, 0.05, Vector3::new(0.0, 0.0, 1.2));
        let camera = Camera::vga();
        let map_from_camera = pose.to_isometry3() * robot_from_camera;
        let rendered =
            Renderer::new(camera.clone()).render(&building, &map_from_camera, &SensorParams::default(), seed);
        let covariance = Matrix3::from_diagonal(&Vector3::from(PRIOR_SIGMAS.map(|s| s * s)));
        let prior = Pose2Covariance { pose: pose.plus(&Vector3::from(PRIOR_ERROR)), covariance };
        let mounting = CameraExtrinsics::new(robot_from_camera)?;
        Ok(Self { building, rendered, prior, mounting, camera })
    }

    /// Every poster, taught from a photograph of its own.
    fn taught(&self, args: &ExpectedArgs, p: &Params) -> anyhow::Result<ModelSet> {
        let seed = args.seed;
        let posters: Vec<Landmark> =
            (0..self.building.posters().count() as u64).map(|i| Landmark::poster(seed + i)).collect();
        let models: Vec<LandmarkModel> = Landmark::together(&posters, p)?;
        Ok(ModelSet::new(models.into_iter().map(Arc::new).collect(), p)?)
    }

    /// Where the posters are expected, those that are worth a look.
    fn expected(&self) -> anyhow::Result<Vec<Expected>> {
        let places: Vec<LandmarkPlace> = self.building.posters().map(place).collect::<anyhow::Result<_>>()?;
        let known: Vec<KnownLandmark<'_>> = (0..)
            .zip(&places)
            .map(|(i, place)| KnownLandmark { landmark: LandmarkId(i), place, visible: None })
            .collect();
        let walls = self.building.walls().iter();
        let obstacles: Vec<Obstacle> = walls
            .map(|w| {
                let covariance = nalgebra::Matrix2::identity() * 1e-4;
                map::segments::LaserSegment::from_ends(w.a_m, w.b_m, covariance).map(|s| Obstacle::from(&s))
            })
            .collect::<Result<_, _>>()?;
        let image_px = [self.rendered.image.width() as f64, self.rendered.image.height() as f64];
        let view = CameraView { mounting: &self.mounting, intrinsics: self.camera.intrinsics(), image_px };
        let all = expect(&self.prior, &view, &known, &obstacles, &ExpectParams::default())?;
        Ok(all.searchable().cloned().collect())
    }
}

fn place(poster: &LandmarkTruth) -> anyhow::Result<LandmarkPlace> {
    let (at, normal) =
        (poster.map_from_landmark.translation.vector, poster.map_from_landmark.rotation * Vector3::x());
    let size = vision::pose::LandmarkSize { width_m: poster.width_m, height_m: poster.height_m };
    Ok(LandmarkPlace::by_hand(at, normal.y.atan2(normal.x), size, PlaceSigmas::default())?)
}

fn unique(quad: &QuadAnalysis) -> Option<LandmarkId> {
    match quad.recognition.as_ref()?.verdict {
        Verdict::Unique(id) => Some(id),
        _ => None,
    }
}

/// Top-left pixel of the part that is shown enlarged.
fn close(image: &GrayImage, expected: Option<&Expected>) -> [usize; 2] {
    let centre = expected.map_or([0.0; 2], |e| {
        let sum = e.corners_px.iter().fold(Vector3::zeros(), |s, c| s + Vector3::new(c.x, c.y, 0.0));
        [sum.x / 4.0, sum.y / 4.0]
    });
    let size = [image.width(), image.height()];
    [0, 1].map(|i| {
        let low = (centre[i] - 0.5 * CLOSE_PX[i] as f64).max(0.0) as usize;
        low.min(size[i].saturating_sub(CLOSE_PX[i]))
    })
}

fn outline(
    picture: &mut Picture,
    corners: &[Point2<f64>; 4],
    width_px: f64,
    colour: Colour,
    place: &dyn Fn(&Point2<f64>) -> [f64; 2],
) {
    for i in 0..4 {
        picture.line(place(&corners[i]), place(&corners[(i + 1) % 4]), width_px, colour);
    }
}

/// The expected corners with the ellipses in which each is searched.
fn gates(picture: &mut Picture, e: &Expected, place: &dyn Fn(&Point2<f64>) -> [f64; 2]) {
    outline(picture, &e.corners_px, 1.2, BLUE, place);
    for gate in &e.gates {
        let eigen = SymmetricEigen::new(gate.covariance_px2);
        let half = eigen.eigenvalues.map(|v| (gate.chi2 * v.max(0.0)).sqrt());
        let at = |i: usize| {
            let (sin, cos) = (std::f64::consts::TAU * i as f64 / 48.0).sin_cos();
            let off = eigen.eigenvectors * nalgebra::Vector2::new(half.x * cos, half.y * sin);
            place(&(gate.center_px + off))
        };
        for i in 0..48 {
            picture.line(at(i), at(i + 1), 1.0, BLUE);
        }
    }
}
