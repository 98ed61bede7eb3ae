//! The cases of the experiment, and one building in all of them.

use super::{
    building::{Building, Shape},
    drive::{CORNER_PX, SYSTEMATIC, SimulatedCamera, SimulatedDrive},
    figures::{Figures, best_tracks},
    passages::{LabelledSurvey, Setting, labelled},
    two_step::two_step,
};
use map::joint::{
    CameraState, CameraStated, JointError, JointParams, KnownMap, SurveyMap, refined, surveyed,
};
use nalgebra::SVector;
use vision::random::Random;

/// Which drives a case uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Drives {
    One,
    Two,
    /// One, through a camera whose principal point and distortion are wrong besides.
    Bent,
    /// One through the bare corridor.
    Bare,
}

/// A case: a row of the table.
pub(super) struct Case {
    pub(super) name: &'static str,
    pub(super) what: &'static str,
    drives: Drives,
    way: Way,
    setting: Setting,
}

/// How a case solves its drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Way {
    Joint,
    TwoSteps,
    /// The second drive on the summary of the first.
    Summary,
}

/// Error of the floor plan: direction (rad) and offset (m).
const PLAN: [f64; 2] = [0.3 * std::f64::consts::PI / 180.0, 0.03];
/// Share of views that show another object, where identities are wrong.
const WRONG_VIEWS: f64 = 0.02;

/// All cases, in the order of the table.
pub(super) fn all() -> Vec<Case> {
    let every = Setting::ALL;
    let apart = Setting { scan_loops: false, ..every };
    let blind = Setting { laser: false, ..every };
    let case = |name, what, drives, setting| Case { name, what, drives, way: Way::Joint, setting };
    let steps = |name, what, drives| Case { way: Way::TwoSteps, ..case(name, what, drives, every) };
    let wrong = |share| Setting { wrong: [share, WRONG_VIEWS], ..apart };
    vec![
        steps("a", "two steps", Drives::One),
        case("d", "one drive", Drives::One, every),
        case("d1", "d, centre and k1 wrong", Drives::Bent, every),
        case("d2", "d, no closure by scans", Drives::One, apart),
        case("d3", "d, no closure", Drives::One, Setting { object_loops: false, ..apart }),
        case("e", "two drives", Drives::Two, every),
        case("e1", "e, no closure by scans", Drives::Two, apart),
        Case { way: Way::Summary, ..case("f", "drive 2 on a summary of 1", Drives::Two, every) },
        case("c2", "two drives, no laser", Drives::Two, blind),
        case("c3", "c2, three sizes known", Drives::Two, Setting { sized: 3, ..blind }),
        case("c4", "one drive, no laser, plan", Drives::One, Setting { plan: Some(PLAN), ..blind }),
        steps("k", "bare corridor, two steps", Drives::Bare),
        case("k1", "bare corridor, no closure", Drives::Bare, Setting { object_loops: false, ..every }),
        case("k2", "bare corridor", Drives::Bare, every),
        case("w02", "d2, 2 % wrong", Drives::One, wrong(0.02)),
        case("w10", "d2, 10 % wrong", Drives::One, wrong(0.1)),
        case("w30", "d2, 30 % wrong", Drives::One, wrong(0.3)),
        case("v02", "e1, 2 % wrong", Drives::Two, wrong(0.02)),
        case("v10", "e1, 10 % wrong", Drives::Two, wrong(0.1)),
        case("v30", "e1, 30 % wrong", Drives::Two, wrong(0.3)),
    ]
}

/// A drawn building with its camera and its drives.
pub(super) struct World {
    seed: u64,
    camera: SimulatedCamera,
    ring: Building,
    bare: Building,
    one: SimulatedDrive,
    two: SimulatedDrive,
    bent: SimulatedDrive,
    line: SimulatedDrive,
}

impl World {
    pub(super) fn drawn(seed: u64) -> Self {
        let mut random = Random::new(seed);
        let camera = SimulatedCamera::drawn(&mut random);
        let ring = Building::drawn(Shape::Ring, &mut random);
        let bare = Building::drawn(Shape::Bare, &mut random);
        let mut drive = |building, camera: &CameraState, way, back| {
            SimulatedDrive::drawn(building, camera, way, back, &mut random)
        };
        let one = drive(&ring, &camera.truth, (5.0, 117.0), false);
        let two = drive(&ring, &camera.truth, (31.0, 117.0), true);
        let bent = drive(&ring, &camera.bent, (5.0, 117.0), false);
        let line = drive(&bare, &camera.truth, (0.5, 110.0), false);
        Self { seed, camera, ring, bare, one, two, bent, line }
    }

    /// Figures of a case in this building.
    pub(super) fn figures(&self, case: &Case) -> Figures {
        self.solved(case).unwrap_or_else(|_| Figures { failed: 1, ..Figures::default() })
    }

    fn solved(&self, case: &Case) -> Result<Figures, JointError> {
        let camera = &self.camera;
        let (building, drives, truth): (_, Vec<&SimulatedDrive>, _) = match case.drives {
            Drives::One => (&self.ring, vec![&self.one], &camera.truth),
            Drives::Two => (&self.ring, vec![&self.one, &self.two], &camera.truth),
            Drives::Bent => (&self.ring, vec![&self.bent], &camera.bent),
            Drives::Bare => (&self.bare, vec![&self.line], &camera.truth),
        };
        let sigmas: SVector<f64, 10> =
            if case.drives == Drives::Bent { camera.bent_sigmas } else { camera.sigmas };
        let stated = CameraStated { camera: camera.stated, sigmas: Some(sigmas) };
        let mut random = Random::new(self.seed ^ 0x6a6f_696e_7400);
        let survey = labelled(building, &drives, stated, &case.setting, &mut random);
        let params = JointParams {
            drift_sigma_rad_per_m: SYSTEMATIC[1],
            // The simulated corners have no border of their own.
            border_sigma_px: 0.0,
            ..JointParams::default()
        };
        let mut figures = Figures::default();
        match case.way {
            Way::TwoSteps => {
                let (map, placed) = two_step(&survey, &params, CORNER_PX)?;
                figures.of_landmarks(building, &placed);
                figures.of_path_and_walls(building, &survey, &map, drives[0])?;
            }
            Way::Joint => {
                let map = surveyed(&survey.survey, &params)?;
                figures.of_landmarks(building, &best_tracks(&survey, &map)?);
                figures.of_path_and_walls(building, &survey, &map, drives[0])?;
                figures.of_camera(&map, truth)?;
                figures.of_closures(&survey, &map);
            }
            Way::Summary => {
                let batch = best_tracks(&survey, &surveyed(&survey.survey, &params)?)?;
                let of =
                    |drive| labelled(building, &[drive], stated, &case.setting, &mut Random::new(self.seed));
                let (one, two) = (of(drives[0]), of(drives[1]));
                let map = on_summary(&one, &two, &params)?;
                let placed = best_tracks(&two, &map)?;
                figures.of_landmarks(building, &placed);
                figures.of_camera(&map, truth)?;
                figures.apart(&placed, &batch);
            }
        }
        Ok(figures)
    }
}

/// The second drive on what the first one left: its walls, camera, and the best track of each
/// object with an appearance of its own.
fn on_summary(
    one: &LabelledSurvey,
    two: &LabelledSurvey,
    params: &JointParams,
) -> Result<SurveyMap, JointError> {
    let first = surveyed(&one.survey, params)?;
    let known = best_tracks(one, &first)?;
    let landmarks: Vec<usize> = known.iter().map(|placed| placed.variable).collect();
    let summary = KnownMap::of(&first, &landmarks)?;
    let number = |object: usize| known.iter().position(|placed| placed.object == object);
    let tracks = two.object_of.iter().enumerate();
    let same: Vec<[usize; 2]> = tracks.filter_map(|(t, object)| Some([t, number(*object)?])).collect();
    refined(&two.survey, &summary, &same, params)
}
