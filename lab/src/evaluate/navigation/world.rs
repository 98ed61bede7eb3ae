//! The corridor and its map from the first drives: walls, places and models, as in a server, in
//! memory.

use super::{
    exploration::{Explored, explore},
    server::MAP,
};
use crate::evaluate::experiment::{lesson::points_of, mixed, of_each};
use anyhow::Context as _;
use cli::{
    first_drive::{FirstView, first_drive, known_poses, place_on_walls},
    screen,
    simulated_errors::SimulatedRobotErrors,
};
use engine::snapshot::{LandmarkInfo, MapSnapshot, StoredModel, look_alike_classes};
use map::{
    laser_fix::WallIndex,
    place::{LandmarkPlace, PlaceSigmas},
    segments::LaserSegment,
    visibility::{Obstacle, PanTiltCamera, VisibilityParams, visibility},
};
use sim::{
    building::Building,
    corridor::CorridorParams,
    lesson::{LessonParams, stops},
    robot::{Robot, RobotParams},
};
use std::{collections::BTreeMap, sync::Arc};
use vision::{
    learn::{LearnRules, TrainingView, add_negatives, learn, synthesis},
    model::{LandmarkId, LandmarkModel, ModelSet, ModelStatus},
    params::{Params, preset::Preset},
    points::taught::TaughtPoint,
    pose::LandmarkSize,
    recognise::{IconFeatures, features},
};

/// Views of each landmark; those that the first drive did not photograph are generated.
const VIEWS: usize = 30;
/// Icons of each landmark that are negatives of the others.
const NEGATIVES: usize = 10;

/// A corridor and how it is taught.
#[derive(Debug, Clone, Copy)]
pub(super) struct Course {
    pub(super) length_m: f64,
    /// Posters that hang there.
    pub(super) posters: usize,
    /// Number of different pictures; 0: all differ.
    pub(super) pictures: usize,
    /// Number of last posters with a picture of their own.
    pub(super) unique: usize,
    /// The pipeline of the server.
    pub(super) preset: Preset,
    /// Doors and windows are taught, too.
    pub(super) fittings: bool,
    /// Corners of photographs and places of landmarks are exact.
    pub(super) true_lessons: bool,
    /// Photographs of each landmark.
    pub(super) views: usize,
    /// Walls are made by SLAM, the lesson's poses by laser; robots go by their own estimate, and
    /// their intrinsics and extrinsics have errors. Otherwise the truth stands for all of these.
    pub(super) closed: bool,
    pub(super) seed: u64,
}

/// The corridor and its map.
pub(super) struct World {
    pub(super) building: Arc<Building>,
    pub(super) map: MapSnapshot,
    pub(super) course: Course,
    /// Distance of each placed landmark from its true place, and the squared error along the
    /// corridor over its stated variance.
    pub(super) place_errors: Vec<(f64, f64)>,
}

/// One landmark after the first drive.
struct Lesson {
    name: String,
    place: LandmarkPlace,
    views: Vec<TrainingView>,
    icons: Vec<IconFeatures>,
    points: Vec<Vec<TaughtPoint>>,
}

impl World {
    /// Builds the corridor, surveys it and learns its landmarks.
    pub(super) fn taught(course: Course) -> anyhow::Result<Self> {
        let Course { length_m, posters, pictures, unique, preset, fittings, .. } = course;
        let Course { true_lessons, views: photographs, closed, seed, .. } = course;
        let p = preset.params();
        let corridor = CorridorParams {
            length_m,
            posters,
            pictures,
            unique_posters: unique,
            first_poster: mixed(&[seed, 11]),
            ..CorridorParams::default()
        };
        let building = Arc::new(Building::corridor_with(&corridor, seed));
        let robot = Robot::new(building.clone(), &RobotParams::default());
        let wrong = SimulatedRobotErrors::of(robot.camera().intrinsics(), !closed, mixed(&[seed, 13]));
        let camera = wrong.camera;
        let lesson = LessonParams { seed, views: photographs, fittings, ..LessonParams::default() };
        let stops = stops(&building, &lesson);
        let (walls, stops) = if closed {
            let Explored { walls, stops } = explore(&building, stops, mixed(&[seed, 16]))?;
            (Some(walls), stops)
        } else {
            (None, known_poses(stops))
        };
        let mut driven = first_drive(robot, &stops, &wrong, &p.detect)?;
        let walls = walls.unwrap_or_else(|| std::mem::take(&mut driven.walls));
        if true_lessons {
            driven.views.iter_mut().for_each(|(name, views_of_one)| take_true_corners(name, views_of_one));
        }
        let found: Vec<(&String, &Vec<FirstView>)> = driven.views.iter().collect();
        let lessons: Vec<Lesson> = of_each(&found, "views", |i, (name, views_of_one)| {
            let (mut place, agreed) = place_on_walls(views_of_one, &walls, &camera)?;
            if true_lessons {
                place = true_place(&building, name)?;
            }
            let views_of_one: Vec<&FirstView> = agreed.iter().map(|&i| &views_of_one[i]).collect();
            let views = views(&views_of_one, mixed(&[seed, 12, i as u64]), &p);
            let each = views.iter().step_by(views.len().div_ceil(NEGATIVES).max(1));
            let icons = each.map(|v| features(v.icon.clone(), &p.recognise)).collect();
            let photographs: Vec<_> =
                views_of_one.iter().map(|l| (&l.readings.frame.image, &l.quad.corners_px)).collect();
            let points = points_of(&photographs);
            Some(Lesson { name: (*name).clone(), place, views, icons, points })
        })
        .into_iter()
        .flatten()
        .collect();
        let models = of_each(&lessons, "learning", |i, lesson| {
            let alone = learn(LandmarkId(i as u64), &lesson.views, &[], &p).ok()?;
            let alone = alone.with_points(&lesson.points);
            let others = lessons.iter().enumerate().filter(|(other, _)| *other != i);
            let others: Vec<IconFeatures> = others.flat_map(|(_, l)| l.icons.iter().cloned()).collect();
            Some(add_negatives(&alone, &others, &p))
        });
        let map = snapshot(&lessons, &walls, models, (preset, p))?;
        anyhow::ensure!(!map.models.is_empty(), "no landmark passed the quality gates; try another --seed");
        let place_errors = lessons.iter().map(|l| place_error(&building, l)).collect::<Result<_, _>>()?;
        Ok(Self { building, map, course, place_errors })
    }

    /// The landmark's name.
    pub(super) fn name(&self, id: LandmarkId) -> &str {
        self.map.landmarks.get(&id).map_or("", |info| &info.name)
    }
}

fn views(views_of_one: &[&FirstView], seed: u64, p: &Params) -> Vec<TrainingView> {
    let image = |view: &FirstView| view.readings.frame.image.clone();
    let photographed =
        views_of_one.iter().filter_map(|l| TrainingView::photographed(&image(l), &l.quad.corners_px, p).ok());
    let mut views: Vec<TrainingView> = photographed.collect();
    let wanted = VIEWS.saturating_sub(views.len());
    for (i, view) in views_of_one.iter().enumerate() {
        let count = (wanted + views_of_one.len() - 1 - i) / views_of_one.len();
        let seed = mixed(&[seed, i as u64]);
        views.extend(synthesis::views(&image(view), &view.quad.corners_px, count, p, seed));
    }
    views
}

/// Prints why landmarks are inactive or could not be learnt.
fn complain(lessons: &[Lesson], models: &[Option<LandmarkModel>]) {
    for (lesson, model) in lessons.iter().zip(models) {
        match model.as_ref().map(|m| &m.status) {
            Some(ModelStatus::Active) => {}
            Some(ModelStatus::Candidate(failures)) => {
                let reasons: Vec<String> = failures.iter().map(ToString::to_string).collect();
                screen::complain(&format!("{} is inactive: {}", lesson.name, reasons.join("; ")));
            }
            None => screen::complain(&format!("{} could not be learnt", lesson.name)),
        }
    }
}

fn snapshot(
    lessons: &[Lesson],
    walls: &[LaserSegment],
    models: Vec<Option<LandmarkModel>>,
    (preset, params): (Preset, Params),
) -> anyhow::Result<MapSnapshot> {
    complain(lessons, &models);
    let learnt: BTreeMap<LandmarkId, StoredModel> = models
        .into_iter()
        .flatten()
        .map(|model| {
            (model.id, StoredModel { digest: [0; 32], rules: LearnRules::default(), model: Arc::new(model) })
        })
        .collect();
    let models = ModelSet::in_use(learnt.values().map(|l| l.model.clone()), &params)?;
    let look_alikes = Arc::new(look_alike_classes(&learnt, preset.distance(), &params));
    let numbered = || lessons.iter().enumerate().map(|(i, l)| (LandmarkId(i as u64), l));
    let sizes: BTreeMap<LandmarkId, LandmarkSize> = numbered().map(|(id, l)| (id, l.place.size)).collect();
    let landmarks: BTreeMap<LandmarkId, LandmarkInfo> = numbered()
        .map(|(id, l)| {
            let (size, place) = (Some(l.place.size), Some(l.place));
            (id, LandmarkInfo { name: l.name.clone(), size, place, ..LandmarkInfo::default() })
        })
        .collect();
    // Visibility areas, as in the publication, so that a landmark can be missed.
    let obstacles: Vec<Obstacle> = walls.iter().map(Obstacle::from).collect();
    let area = |l: &Lesson| {
        visibility(&l.place, &obstacles, &PanTiltCamera::default(), &VisibilityParams::default())
    };
    let visibility = numbered().filter_map(|(id, l)| Some((id, Arc::new(area(l).ok()?)))).collect();
    let (params, wall_index) = (Arc::new(params), Arc::new(WallIndex::new(walls)));
    let walls = walls.to_vec();
    let mut map = MapSnapshot { distance: preset.distance(), ..MapSnapshot::empty(MAP, 1) };
    (map.landmarks, map.sizes, map.models, map.learnt) = (landmarks, sizes, models, learnt);
    (map.look_alikes, map.visibility, map.params) = (look_alikes, visibility, params);
    (map.walls, map.wall_index) = (Arc::new(walls), wall_index);
    Ok(map)
}

fn take_true_corners(name: &str, views_of_one: &mut [FirstView]) {
    for view in views_of_one {
        if let Some(truth) = view.readings.frame.truth.landmark(name) {
            view.quad.corners_px = truth.corners_px;
        }
    }
}

fn true_place(building: &Building, name: &str) -> Option<LandmarkPlace> {
    let truth = building.landmark(name)?;
    let size = LandmarkSize { width_m: truth.width_m, height_m: truth.height_m };
    let normal = truth.map_from_landmark.rotation * nalgebra::Vector3::x();
    let (at, theta_rad) = (truth.map_from_landmark.translation.vector, normal.y.atan2(normal.x));
    LandmarkPlace::by_hand(at, theta_rad, size, PlaceSigmas::default()).ok()
}

fn place_error(building: &Building, lesson: &Lesson) -> anyhow::Result<(f64, f64)> {
    let truth = building.landmark(&lesson.name).context("a taught poster that the building lacks")?;
    let place = &lesson.place;
    let error =
        truth.map_from_landmark.translation.vector - nalgebra::Vector3::new(place.x_m, place.y_m, place.z_m);
    Ok((error.norm(), error.x * error.x / place.covariance[(0, 0)]))
}
