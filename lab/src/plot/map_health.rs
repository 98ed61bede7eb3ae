//! Landmark health: a drive past posters of which one was moved and one taken down; what each frame says of them, and
//! what becomes of it (method 27).

use super::{
    map_plan::{ESTIMATE, FAINT, LANDMARK, Plan, Sign, TRUTH, WALL, legend, page, title},
    map_scene::{CAMERA, CAMERA_HEIGHT_M, IMAGE_PX, SIGMA_PX, around, fixes, look, poster},
};
use crate::evaluate::chart::COLOURS;
use formats::svg::{put, text};
use map::{
    extrinsics::{CameraExtrinsics, pan_tilt},
    fuse::{FixOutcome, FuseParams, Fuser},
    landmark_health::{
        ExpectedLandmark, Finding, HealthChange, HealthMonitor, HealthParams, LandmarkHealth, MountedCamera,
        PlaceCheck, PlaceVerdict, check_place, drop_unreliable, expected,
    },
    localise::LandmarkObservation,
    place::LandmarkPlace,
    pose2::Pose2,
    visibility::{PanTiltCamera, VisibilityMap, VisibilityParams, visibility},
};
use nalgebra::{Point2, Vector3};
use sim::odometry::{Odometry, OdometryParams};
use std::{
    collections::{BTreeMap, BTreeSet},
    f64::consts::FRAC_PI_2,
};
use vision::{model::LandmarkId, pose::LandmarkPose, random::Random};

/// Places along the wall y = `WALL_M`, by the map.
const POSTERS_M: [f64; 6] = [2.2, 4.0, 5.8, 7.6, 9.4, 11.2];
const NAMES: [&str; 6] = ["A", "B", "C", "D", "E", "F"];
const MOVED: usize = 2;
const MOVED_BY_M: f64 = 0.7;
const GONE: usize = 4;
const WALL_M: f64 = 3.3;
const STEP_M: f64 = 0.1;
const STEPS: i64 = 110;
const STEP_NS: i64 = 200_000_000;
const SEED: u64 = 2;
const MISSED: &str = COLOURS[0];

/// What one frame says of one landmark.
enum Word {
    InPlace,
    Elsewhere(Pose2),
    Open,
    Missed,
}

struct Drive {
    mapped: Vec<LandmarkPlace>,
    /// As they hang; none for the one that is gone.
    real: Vec<Option<LandmarkPlace>>,
    path: Vec<Pose2>,
    /// Position of the robot along the wall, landmark, word.
    words: Vec<(f64, usize, Word)>,
    changes: Vec<(f64, HealthChange)>,
}

/// The drive while it lasts.
struct Robot {
    fuser: Fuser,
    monitor: HealthMonitor,
    supporters: BTreeSet<LandmarkId>,
    health: BTreeMap<LandmarkId, LandmarkHealth>,
    mounting: CameraExtrinsics,
    p: HealthParams,
}

impl Drive {
    fn new() -> anyhow::Result<Self> {
        let hung = |x: f64| poster(x, WALL_M, -FRAC_PI_2);
        let mapped: Vec<LandmarkPlace> = POSTERS_M.iter().map(|x| hung(*x)).collect::<Result<_, _>>()?;
        let mut real: Vec<Option<LandmarkPlace>> = mapped.iter().copied().map(Some).collect();
        real[MOVED] = Some(hung(POSTERS_M[MOVED] + MOVED_BY_M)?);
        real[GONE] = None;
        let areas: Vec<VisibilityMap> = mapped
            .iter()
            .map(|place| visibility(place, &[], &PanTiltCamera::default(), &VisibilityParams::default()))
            .collect::<Result<_, _>>()?;
        let start = Pose2::new(0.3, 0.0, 0.0);
        let mut robot = Robot::new(&start)?;
        let (mut odometry, mut random) =
            (Odometry::new(OdometryParams::default(), start, SEED), Random::new(SEED));
        let mut drive = Self { mapped, real, path: vec![start], words: Vec::new(), changes: Vec::new() };
        let mut truth = start;
        for i in 1..=STEPS {
            let motion = Pose2::new(STEP_M, 0.0, 0.0);
            truth = truth.compose(&motion);
            robot.fuser.apply_odometry(i * STEP_NS, odometry.advance(&motion))?;
            drive.path.push(truth);
            robot.frame(i * STEP_NS, &truth, (&areas, &mut drive), &mut random)?;
        }
        Ok(drive)
    }
}

impl Robot {
    fn new(start: &Pose2) -> anyhow::Result<Self> {
        // To the left, at the wall.
        let seat = pan_tilt(FRAC_PI_2, 0.05, Vector3::new(0.0, 0.0, CAMERA_HEIGHT_M));
        let mut fuser = Fuser::new(FuseParams::default());
        fuser.apply_odometry(0, *start)?;
        fuser.start(&around(*start, [0.05, 0.05, 0.01])?)?;
        let p = HealthParams::default();
        Ok(Self {
            fuser,
            monitor: HealthMonitor::new(p.clone()),
            supporters: BTreeSet::new(),
            health: BTreeMap::new(),
            mounting: CameraExtrinsics::new(seat)?,
            p,
        })
    }

    /// One frame: places are checked by the pose without it, what is in place corrects the pose.
    fn frame(
        &mut self,
        at_ns: i64,
        truth: &Pose2,
        (areas, drive): (&[VisibilityMap], &mut Drive),
        random: &mut Random,
    ) -> anyhow::Result<()> {
        let Some(pose) = self.fuser.pose().map(|p| p.pose) else { return Ok(()) };
        let seen: Vec<(usize, LandmarkPose)> = drive
            .real
            .iter()
            .enumerate()
            .filter_map(|(i, place)| {
                Some((i, look(truth, &self.mounting, place.as_ref()?, SIGMA_PX, random)?))
            })
            .collect();
        let mapped = drive.mapped.clone();
        let observed: Vec<LandmarkObservation<'_>> = seen
            .iter()
            .map(|(i, seen)| LandmarkObservation {
                landmark: LandmarkId(*i as u64),
                seen,
                place: &mapped[*i],
            })
            .collect();
        let supporters: Vec<LandmarkId> = self.supporters.iter().copied().collect();
        let checks: Vec<PlaceCheck> = observed
            .iter()
            .map(|o| check_place(o, &self.mounting, &pose, &supporters, &self.p))
            .collect::<Result<_, _>>()?;
        let eye = MountedCamera { mounting: &self.mounting, camera: &CAMERA, image_px: IMAGE_PX };
        let candidates: Vec<ExpectedLandmark<'_>> = mapped
            .iter()
            .zip(areas)
            .enumerate()
            .map(|(i, (place, visible))| ExpectedLandmark { landmark: LandmarkId(i as u64), place, visible })
            .collect();
        let mut missed = expected(&pose, &eye, &candidates, &self.p);
        missed.retain(|id| observed.iter().all(|o| o.landmark != *id));
        let sound: Vec<LandmarkObservation<'_>> = drop_unreliable(&observed, &checks)
            .into_iter()
            .filter(|o| self.health.get(&o.landmark) != Some(&LandmarkHealth::Quarantined))
            .collect();
        if let Some(fix) = self.fix(&sound, &pose)?
            && let FixOutcome::Applied { .. } = self.fuser.apply_fix(at_ns, &fix)?
        {
            self.supporters.extend(fix.landmarks);
        }
        let from = Point2::from(pose.pose.position());
        let health = self.health.clone();
        let now = |id: LandmarkId| health.get(&id).copied().unwrap_or_default();
        for change in self.monitor.frame(from, &checks, &missed, now) {
            self.health.insert(change.landmark, change.health);
            drive.changes.push((truth.x_m, change));
        }
        let said = checks.iter().map(|c| (c.landmark, word(&c.verdict)));
        let said = said.chain(missed.iter().map(|id| (*id, Word::Missed)));
        drive.words.extend(said.map(|(id, word)| (truth.x_m, id.0 as usize, word)));
        Ok(())
    }

    fn fix(
        &self,
        sound: &[LandmarkObservation<'_>],
        prior: &map::pose2::Pose2Covariance,
    ) -> anyhow::Result<Option<map::localise::Fix>> {
        if sound.is_empty() {
            return Ok(None);
        }
        let mut all = fixes(sound, &self.mounting, Some(prior))?;
        Ok((all.len() == 1).then(|| all.swap_remove(0)))
    }
}

fn word(verdict: &PlaceVerdict) -> Word {
    match verdict {
        PlaceVerdict::InPlace { .. } => Word::InPlace,
        PlaceVerdict::Elsewhere { apparent, .. } => Word::Elsewhere(*apparent),
        PlaceVerdict::Unsure | PlaceVerdict::Undecided => Word::Open,
    }
}

/// Where the floor plan begins and how large it is: the rows below share its x.
const LEFT_PX: f64 = 110.0;
const SCALE: f64 = 78.0;
const ROWS_PX: f64 = 450.0;
const ROW_PX: f64 = 34.0;

/// The picture.
pub(super) fn svg() -> anyhow::Result<String> {
    let drive = Drive::new()?;
    page([1120.0, 730.0], |svg| {
        from_above(svg, &drive);
        evidence(svg, &drive);
        legend(
            svg,
            (LEFT_PX, 668.0),
            &[
                (Sign::Dot, LANDMARK, "seen in place"),
                (Sign::Dot, ESTIMATE, "seen elsewhere"),
                (Sign::Dot, FAINT, "seen, and no judgement: the pose rests on no other landmark"),
            ],
        );
        legend(
            svg,
            (620.0, 668.0),
            &[
                (Sign::Dot, MISSED, "should be in the image, and is not"),
                (Sign::Landmark, FAINT, "place by the map of what no longer hangs there"),
                (Sign::Landmark, ESTIMATE, "where the moved poster hangs; dots: where it appears"),
            ],
        );
        Ok(())
    })
}

fn plan() -> Plan {
    Plan::new((LEFT_PX, 60.0), [[0.0, -0.4], [12.4, 3.7]], SCALE)
}

fn from_above(svg: &mut String, drive: &Drive) {
    title(svg, (LEFT_PX, 26.0), "A robot drives along a wall and looks at it; C was moved, E was taken down");
    let plan = plan();
    let wall = [Point2::new(0.0, WALL_M), Point2::new(12.4, WALL_M)];
    plan.line(svg, wall, &format!(r#"stroke="{WALL}" stroke-width="2.5""#));
    for (i, place) in drive.mapped.iter().enumerate() {
        let is_there = i != MOVED && i != GONE;
        plan.landmark(svg, place, if is_there { LANDMARK } else { FAINT });
        plan.label(svg, &Point2::new(place.x_m, WALL_M), ("middle", [0.0, -12.0]), NAMES[i]);
    }
    if let Some(place) = &drive.real[MOVED] {
        plan.landmark(svg, place, ESTIMATE);
        plan.label(svg, &Point2::new(place.x_m, WALL_M), ("middle", [0.0, -12.0]), "C now");
    }
    let apparent = drive.words.iter().filter_map(|(_, _, word)| match word {
        Word::Elsewhere(at) => Some(Point2::from(at.position())),
        _ => None,
    });
    plan.dots(svg, apparent, (2.0, TRUTH));
    plan.line(
        svg,
        drive.path.iter().map(|p| Point2::from(p.position())),
        &format!(r#"stroke="{TRUTH}" stroke-width="1.5""#),
    );
    plan.robot(svg, &drive.path[0], TRUTH);
    // The last change of each landmark.
    for id in drive.changes.iter().map(|(_, c)| c.landmark).collect::<BTreeSet<_>>() {
        let Some((x_m, change)) = drive.changes.iter().rfind(|(_, c)| c.landmark == id) else { continue };
        let health = format!("{:?}", change.health).to_lowercase();
        view(svg, &plan, *x_m, &format!("{} {health}", NAMES[change.landmark.0 as usize]));
    }
    plan.scale_bar(svg, 1.0);
}

/// The robot where something changed, and what its camera covers.
fn view(svg: &mut String, plan: &Plan, x_m: f64, words: &str) {
    let wide_m = WALL_M * 0.5 * IMAGE_PX[0] / CAMERA.fx_px;
    let edge = |side: f64| Point2::new(x_m + side * wide_m, WALL_M);
    let at = Point2::new(x_m, 0.0);
    plan.line(svg, [edge(-1.0), at, edge(1.0)], &format!(r#"stroke="{FAINT}" stroke-dasharray="4 3""#));
    plan.robot(svg, &Pose2::new(x_m, 0.0, 0.0), TRUTH);
    plan.label(svg, &at, ("middle", [0.0, 22.0]), words);
}

/// A row for each landmark, a mark for each frame that says something of it.
fn evidence(svg: &mut String, drive: &Drive) {
    title(svg, (LEFT_PX, ROWS_PX - 18.0), "What each frame says of each landmark, where the robot was then");
    let plan = plan();
    for (i, name) in NAMES.iter().enumerate() {
        let v = ROWS_PX + 6.0 + ROW_PX * i as f64;
        text(svg, (LEFT_PX - 14.0, v + 4.0), "end", name);
        put(svg, &format!(r##"<path d="M{LEFT_PX} {v}h967" stroke="#eee"/>"##));
        for (x_m, landmark, word) in &drive.words {
            if *landmark != i {
                continue;
            }
            let (colour, radius) = match word {
                Word::InPlace => (LANDMARK, 3.0),
                Word::Elsewhere(_) => (ESTIMATE, 3.0),
                Word::Open => (FAINT, 2.0),
                Word::Missed => (MISSED, 3.0),
            };
            let (u, _) = plan.at(&Point2::new(*x_m, 0.0));
            put(svg, &format!(r#"<circle cx="{u:.1}" cy="{v:.1}" r="{radius}" fill="{colour}"/>"#));
        }
        let changes = drive.changes.iter().filter(|(_, c)| c.landmark.0 == i as u64);
        for (k, (x_m, change)) in changes.enumerate() {
            let (u, _) = plan.at(&Point2::new(*x_m, 0.0));
            put(svg, &format!(r#"<path d="M{u:.1} {:.1}v22" stroke="black" stroke-width="2"/>"#, v - 11.0));
            // A flag and the quarantine that follows it are near each other.
            let (anchor, aside) = if k == 0 { ("end", -5.0) } else { ("start", 5.0) };
            text(svg, (u + aside, v - 8.0), anchor, &told(change));
        }
    }
}

fn told(change: &HealthChange) -> String {
    let health = match change.health {
        LandmarkHealth::Sound => "sound",
        LandmarkHealth::Flagged => "flagged",
        LandmarkHealth::Quarantined => "quarantined",
    };
    match change.finding {
        Some(Finding::Moved { offset_m, sightings, .. }) => {
            format!("{health}: {sightings} times seen {offset_m:.2} m away")
        }
        Some(Finding::Missing { missed_frames }) => format!("{health}: missed {missed_frames} times"),
        None => health.to_owned(),
    }
}
