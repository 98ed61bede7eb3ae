//! The corridor and its map from the first drives: walls, places and models, as in a server, in
//! memory.

use super::{
    exploration::{Explored, MAP, explore},
    surveying::{FirstMap, Photographed, survey},
};
use crate::evaluate::experiment::{lesson::points_of, mixed, of_each};
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
    building::{Building, LandmarkKind, LandmarkTruth},
    corridor::CorridorParams,
    lesson::{LessonParams, stops},
    robot::{Robot, RobotParams},
};
use std::{collections::BTreeMap, sync::Arc};
use vision::{
    frame::{GrayImage, Intrinsics},
    geometry::Corners,
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

/// Where walls and landmarks come from, and with it how robots go.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum FirstMapBy {
    /// The truth; robots go their true path with exact intrinsics and extrinsics.
    Truth,
    /// SLAM, then a lesson with poses by laser. Robots go by their own estimate, with errors.
    Lesson,
    /// Drives of a robot that knew neither. Robots go as with a lesson.
    Survey {
        /// Number of drives, there and back each.
        drives: usize,
    },
}

impl FirstMapBy {
    pub(super) fn survey_drives(self) -> Option<usize> {
        if let Self::Survey { drives } = self { Some(drives) } else { None }
    }

    pub(super) fn is_survey(self) -> bool {
        self.survey_drives().is_some()
    }
}

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
    pub(super) first_map: FirstMapBy,
    pub(super) seed: u64,
}

/// The corridor and its map.
pub(super) struct World {
    pub(super) building: Arc<Building>,
    pub(super) map: MapSnapshot,
    pub(super) course: Course,
    /// Of the robots, exact.
    pub(super) camera: Intrinsics,
    /// Distance of each placed landmark from its true place, and the squared error along the
    /// corridor over its stated variance.
    pub(super) place_errors: Vec<(f64, f64)>,
}

/// What is learnt of one landmark.
struct Lesson {
    name: String,
    place: LandmarkPlace,
    views: Vec<TrainingView>,
    icons: Vec<IconFeatures>,
    points: Vec<Vec<TaughtPoint>>,
}

impl World {
    /// Builds the corridor, has it mapped, and learns its landmarks.
    pub(super) fn taught(course: Course) -> anyhow::Result<Self> {
        let Course { length_m, posters, pictures, unique, preset, seed, .. } = course;
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
        let (walls, photographed) = if let FirstMapBy::Survey { drives } = course.first_map {
            survey(&building, (drives, course.views), mixed(&[seed, 16]))?
        } else {
            taught_by_hand(&building, &course, &p)?
        };
        let lessons = of_each(&photographed, "views", |i, one| lesson(one, mixed(&[seed, 12, i as u64]), &p));
        let models = of_each(&lessons, "learning", |i, lesson| {
            let alone = learn(LandmarkId(i as u64), &lesson.views, &[], &p).ok()?;
            let alone = alone.with_points(&lesson.points);
            let others = lessons.iter().enumerate().filter(|(other, _)| *other != i);
            let others: Vec<IconFeatures> = others.flat_map(|(_, l)| l.icons.iter().cloned()).collect();
            Some(add_negatives(&alone, &others, &p))
        });
        let map = snapshot(&lessons, &walls, models, (preset, p))?;
        anyhow::ensure!(!map.models.is_empty(), "no landmark passed the quality gates; try another --seed");
        let place_errors = lessons.iter().filter_map(|l| place_error(&building, l, &course)).collect();
        let camera = *Robot::new(building.clone(), &RobotParams::default()).camera().intrinsics();
        Ok(Self { building, map, course, camera, place_errors })
    }

    /// The landmark's name.
    pub(super) fn name(&self, id: LandmarkId) -> &str {
        self.map.landmarks.get(&id).map_or("", |info| &info.name)
    }
}

/// Walls, and the landmarks that a person taught.
fn taught_by_hand(building: &Arc<Building>, course: &Course, p: &Params) -> anyhow::Result<FirstMap> {
    let Course { true_lessons, views: photographs, first_map, fittings, seed, .. } = *course;
    let closed = first_map != FirstMapBy::Truth;
    let robot = Robot::new(building.clone(), &RobotParams::default());
    let wrong = SimulatedRobotErrors::of(robot.camera().intrinsics(), !closed, mixed(&[seed, 13]));
    let camera = wrong.camera;
    let lesson = LessonParams { seed, views: photographs, fittings, ..LessonParams::default() };
    let stops = stops(building, &lesson);
    let (walls, stops) = if closed {
        let Explored { walls, stops } = explore(building, stops, mixed(&[seed, 16]))?;
        (Some(walls), stops)
    } else {
        (None, known_poses(stops))
    };
    let mut driven = first_drive(robot, &stops, &wrong, &p.detect)?;
    let walls = walls.unwrap_or_else(|| std::mem::take(&mut driven.walls));
    if true_lessons {
        driven.views.iter_mut().for_each(|(name, views_of_one)| take_true_corners(name, views_of_one));
    }
    let photographed = |(name, views_of_one): (String, Vec<FirstView>)| {
        let (mut place, agreed) = place_on_walls(&views_of_one, &walls, &camera)?;
        if true_lessons {
            place = true_place(building, &name)?;
        }
        let views = agreed.iter().map(|&i| &views_of_one[i]);
        let pictures = views.map(|view| (view.readings.frame.image.clone(), view.quad.corners_px)).collect();
        Some(Photographed { name, place, pictures })
    };
    let photographed = driven.views.into_iter().filter_map(photographed).collect();
    Ok((walls, photographed))
}

fn lesson(one: &Photographed, seed: u64, p: &Params) -> Lesson {
    let Photographed { name, place, pictures } = one;
    let views = views(pictures, seed, p);
    let each = views.iter().step_by(views.len().div_ceil(NEGATIVES).max(1));
    let icons = each.map(|v| features(v.icon.clone(), &p.recognise)).collect();
    let photographs: Vec<_> = pictures.iter().map(|(image, corners)| (image, corners)).collect();
    Lesson { name: name.clone(), place: *place, views, icons, points: points_of(&photographs) }
}

fn views(pictures: &[(GrayImage, Corners)], seed: u64, p: &Params) -> Vec<TrainingView> {
    let photographed =
        pictures.iter().filter_map(|(image, corners)| TrainingView::photographed(image, corners, p).ok());
    let mut views: Vec<TrainingView> = photographed.collect();
    let wanted = VIEWS.saturating_sub(views.len());
    for (i, (image, corners)) in pictures.iter().enumerate() {
        let count = (wanted + pictures.len() - 1 - i) / pictures.len();
        views.extend(synthesis::views(image, corners, count, p, mixed(&[seed, i as u64])));
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

/// `None` of a landmark that is nothing of the building, or perhaps a part of a door or window.
fn place_error(building: &Building, lesson: &Lesson, course: &Course) -> Option<(f64, f64)> {
    let is_whole =
        |truth: &&LandmarkTruth| !course.first_map.is_survey() || truth.kind == LandmarkKind::Poster;
    let truth = building.landmark(&lesson.name).filter(is_whole)?;
    let place = &lesson.place;
    let error =
        truth.map_from_landmark.translation.vector - nalgebra::Vector3::new(place.x_m, place.y_m, place.z_m);
    Some((error.norm(), error.x * error.x / place.covariance[(0, 0)]))
}
