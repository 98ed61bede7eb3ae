//! Frames of a corridor whose posters are among the landmarks.

use cli::screen;
use sim::{
    building::{Building, LandmarkKind},
    corridor::CorridorParams,
    drive::Step,
    lesson::{LessonParams, stops},
    robot::{Robot, RobotParams},
    truth::{LandmarkView, ViewState},
};
use std::sync::Arc;
use vision::frame::{GrayImage, Intrinsics};

/// Posters in the corridor: the first landmarks.
pub(super) const POSTERS: usize = 24;
/// A poster counts as visible when each side is at least this long and the view angle is at most
/// this.
const MIN_SIDE_PX: f64 = 40.0;
const MAX_ANGLE_RAD: f64 = 1.22;

/// Frames with the numbers of the landmarks in them, from 0.
pub(super) struct Scenes {
    pub(super) frames: Vec<GrayImage>,
    /// True poses of the robot.
    pub(super) steps: Vec<Step>,
    pub(super) building: Arc<Building>,
    pub(super) camera: Intrinsics,
    /// Wholly visible and large enough: naming one is expected.
    pub(super) wanted: Vec<Vec<usize>>,
    /// In view at all: naming one is no error.
    pub(super) present: Vec<Vec<usize>>,
}

impl Scenes {
    /// `count` frames of a corridor with the posters `first`, `first + 1`, ...
    pub(super) fn new(first: u64, count: usize, seed: u64) -> Self {
        let corridor = CorridorParams {
            posters: POSTERS,
            length_m: 40.0,
            first_poster: first,
            ..CorridorParams::default()
        };
        let building = Arc::new(Building::corridor_with(&corridor, seed));
        let mut robot = Robot::new(building.clone(), &RobotParams::default());
        let lesson = LessonParams { seed, views: count.div_ceil(POSTERS), ..LessonParams::default() };
        let camera = *robot.camera().intrinsics();
        let (frames, steps) = (vec![], vec![]);
        let (wanted, present) = (vec![], vec![]);
        let mut scenes = Self { frames, steps, building: building.clone(), camera, wanted, present };
        let all = stops(&building, &lesson);
        let progress = screen::progress(count, "rendering");
        // Evenly over the posters.
        for i in 0..count.min(all.len()) {
            let step = all[i * all.len() / count].step.clone();
            let shot = robot.look(&step).frame;
            let numbers = |keep: &dyn Fn(&LandmarkView) -> bool| {
                let posters = shot.truth.landmarks.iter().filter(|l| l.kind == LandmarkKind::Poster);
                posters.filter(|l| keep(l)).filter_map(|l| number(&l.name)).collect::<Vec<usize>>()
            };
            scenes.wanted.push(numbers(&|l| {
                l.state == ViewState::Full
                    && l.min_side_px() >= MIN_SIDE_PX
                    && l.view_angle_rad <= MAX_ANGLE_RAD
            }));
            scenes.present.push(numbers(&|_| true));
            scenes.frames.push(shot.image);
            scenes.steps.push(step);
            progress.inc(1);
        }
        progress.finish_and_clear();
        scenes
    }
}

/// `poster-3` is landmark 3.
pub(super) fn number(name: &str) -> Option<usize> {
    name.strip_prefix("poster-")?.parse().ok()
}
