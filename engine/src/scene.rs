//! For tests: a rendered corridor, two of its posters taught, and a robot in front of them.

use crate::{
    frame::{
        decode::ImageLimits,
        slots::Slots,
        workers::{Engine, SearchPolicy},
    },
    motion::MotionTracker,
    observers::{Observers, answer_records::answer_records, findings::findings},
    snapshot::{LandmarkInfo, MapSnapshot, Snapshots},
};
use map::place::{LandmarkPlace, PlaceSigmas};
use nalgebra::Vector3;
use sim::{
    building::Building,
    drive::Step,
    lesson::{self, LessonParams},
    robot::{Robot, RobotParams, SensorReadings},
};
use std::{collections::BTreeMap, sync::Arc};
use vision::{
    learn::{learn, synthesis},
    model::{LandmarkId, ModelSet},
    params::Params,
    points::taught::view_points,
    pose::LandmarkSize,
};

/// Name of the map that is taught.
pub const MAP: &str = "corridor";

/// The corridor with a robot.
pub struct Scene {
    building: Arc<Building>,
    robot: Robot,
}

impl Scene {
    /// The corridor, not taught yet.
    #[expect(clippy::new_without_default, reason = "it renders a corridor: that is no default")]
    pub fn new() -> Self {
        let building = Arc::new(Building::corridor(7));
        let robot = Robot::new(building.clone(), &RobotParams::default());
        Self { building, robot }
    }

    /// The robot's readings at stops in front of the first two posters, with the poster's name;
    /// another seed gives other stops.
    pub fn stops(&mut self, seed: u64, views: usize) -> Vec<(String, SensorReadings)> {
        let near = LessonParams {
            seed,
            views,
            distance_m: [1.3, 2.5],
            max_view_angle_rad: 0.6,
            ..LessonParams::default()
        };
        let names: Vec<_> = self.building.posters().take(2).map(|l| l.name.clone()).collect();
        let stops = lesson::stops(&self.building, &near).into_iter().filter(|s| names.contains(&s.landmark));
        stops.map(|stop| (stop.landmark, self.robot.look(&stop.step))).collect()
    }

    /// The robot's readings at a step.
    pub fn look(&mut self, step: &Step) -> SensorReadings {
        self.robot.look(step)
    }

    /// The camera of its robot.
    pub fn intrinsics(&self) -> vision::frame::Intrinsics {
        *self.robot.camera().intrinsics()
    }

    /// The first two posters, each learnt from warped views of one photograph, at their true
    /// places.
    pub fn taught(&mut self) -> Arc<MapSnapshot> {
        let params = Arc::new(Params::default());
        let mut models = Vec::new();
        let (mut landmarks, mut sizes) = (BTreeMap::new(), BTreeMap::new());
        for (name, readings) in self.stops(1, 1) {
            let id = LandmarkId(models.len() as u64 + 1);
            let seen = readings.frame.truth.landmark(&name).expect("the scene is made so");
            let views = synthesis::views(&readings.frame.image, &seen.corners_px, 24, &params, id.0);
            let points = view_points(&readings.frame.image, &seen.corners_px);
            let model = learn(id, &views, &[], &params).expect("the scene is made so").with_points(&[points]);
            models.push(Arc::new(model));
            let truth = self.building.landmark(&name).expect("the scene is made so");
            let size = LandmarkSize { width_m: truth.width_m, height_m: truth.height_m };
            let (at, normal) =
                (truth.map_from_landmark.translation.vector, truth.map_from_landmark.rotation * Vector3::x());
            let sigmas = PlaceSigmas::default();
            let place = LandmarkPlace::by_hand(at, normal.y.atan2(normal.x), size, sigmas)
                .expect("the scene is made so");
            sizes.insert(id, size);
            landmarks.insert(
                id,
                LandmarkInfo { name, size: Some(size), place: Some(place), ..LandmarkInfo::default() },
            );
        }
        let models = ModelSet::new(models, &params).expect("the scene is made so");
        Arc::new(MapSnapshot { landmarks, sizes, models, params, ..MapSnapshot::empty(MAP, 3) })
    }
}

/// An engine with these maps, and what watches its frames; robot `r1` is on the first map.
pub fn engine(maps: &[Arc<MapSnapshot>]) -> (Engine, Observers) {
    let snapshots = Arc::new(Snapshots::default());
    for map in maps {
        snapshots.publish(map.clone());
    }
    snapshots.set_robot("r1", Some(&maps[0].name));
    let observers = Observers::new(1 << 20);
    let records = answer_records(observers.kept_frames.clone()).0;
    let engine = Engine {
        slots: Arc::new(Slots::new(8, 256 << 20)),
        motion: Arc::new(MotionTracker::new(snapshots.clone(), observers.live.clone())),
        snapshots,
        limits: ImageLimits::FRAME,
        vitals: Arc::default(),
        relocalisers: Arc::default(),
        search: SearchPolicy::Every,
        observers: vec![
            Arc::new(records),
            observers.live.clone(),
            observers.times.clone(),
            Arc::new(findings().0),
        ],
    };
    (engine, observers)
}
