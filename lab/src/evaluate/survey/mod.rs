//! `waymark-lab evaluate survey`: what `waymark survey` makes of a simulated drive, against the
//! truth and against two steps (the laser map, then each object alone with the camera as stated).

mod drive;

use super::{
    experiment::{of_each, say},
    statistics::quantile,
};
use cli::survey::surveyed;
use drive::{Course, Driven, drive};
use engine::survey::{ObjectView, SurveyedBuilding, SurveyedObject};
use map::{
    place::LandmarkPlace,
    placement::{PlacementParams, PosedView, placement, view_on_wall},
    pose2::{Pose2, Pose2Covariance, laid_on},
};
use nalgebra::{Matrix3, Point2, Vector2, Vector3};
use serde::Serialize;
use sim::building::{Building, LandmarkTruth};
use vision::params::Params;

/// An object is a poster if its centre is so near, as a share of the longer side.
const NEAR_SHARE: f64 = 0.5;
/// How well neighbouring frames are known relative to each other in two steps.
const NEAR_SIGMA: [f64; 3] = [0.02, 0.02, 0.005];

/// `waymark-lab evaluate survey`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Buildings, each drawn from a seed of its own.
    #[arg(long, default_value_t = 6, value_parser = clap::value_parser!(u32).range(1..=1_000))]
    buildings: u32,
    /// Seed of the first building; the others follow.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Length of the corridor.
    #[arg(long, value_name = "M", default_value_t = 25.0)]
    length_m: f64,
    /// Posters in the corridor.
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=64))]
    posters: u32,
    /// Drives of one robot, all in one map.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=8))]
    drives: u32,
    /// Frames and scans a second.
    #[arg(long, default_value_t = 5.0)]
    rate_hz: f64,
    /// The camera points ahead; else a head turns it to posters.
    #[arg(long)]
    ahead: bool,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,
}

/// Errors in one building, or in all.
#[derive(Debug, Default)]
struct Figures {
    /// Posters that were to be seen, and those of them that became landmarks.
    shown: usize,
    placed: usize,
    /// Why each of the others did not.
    lost: Vec<String>,
    /// Landmarks that are no poster, door or window.
    strangers: usize,
    /// Distances on the floor in the frame of the first pose, and after a rigid alignment on the
    /// landmarks, m.
    joint_m: Vec<f64>,
    joint_aligned_m: Vec<f64>,
    two_steps_m: Vec<f64>,
    two_steps_aligned_m: Vec<f64>,
    /// Errors of the sides of the border that was taken, %.
    size_percent: Vec<f64>,
    two_steps_size_percent: Vec<f64>,
    /// Squared errors on the floor over their covariance, for each degree of freedom, in the frame
    /// of the whole drive.
    nees: Vec<f64>,
    /// The same along and across the corridor, each alone.
    nees_along: Vec<f64>,
    nees_across: Vec<f64>,
    /// Errors of the mounting's rotation as stated and as found, degrees.
    stated_deg: Vec<f64>,
    found_deg: Vec<f64>,
}

impl Figures {
    fn add(&mut self, other: Self) {
        self.shown += other.shown;
        self.placed += other.placed;
        self.lost.extend(other.lost);
        self.strangers += other.strangers;
        for (all, more) in [
            (&mut self.joint_m, other.joint_m),
            (&mut self.joint_aligned_m, other.joint_aligned_m),
            (&mut self.two_steps_m, other.two_steps_m),
            (&mut self.two_steps_aligned_m, other.two_steps_aligned_m),
            (&mut self.size_percent, other.size_percent),
            (&mut self.two_steps_size_percent, other.two_steps_size_percent),
            (&mut self.nees, other.nees),
            (&mut self.nees_along, other.nees_along),
            (&mut self.nees_across, other.nees_across),
            (&mut self.stated_deg, other.stated_deg),
            (&mut self.found_deg, other.found_deg),
        ] {
            all.extend(more);
        }
    }

    fn report(self) -> Report {
        let spread = |all: &[f64]| Spread {
            median: quantile(&mut all.to_vec(), 0.5),
            p95: quantile(&mut all.to_vec(), 0.95),
        };
        let mean = |all: &[f64]| all.iter().sum::<f64>() / all.len().max(1) as f64;
        Report {
            experiment: "survey",
            shown: self.shown,
            placed: self.placed,
            strangers: self.strangers,
            joint_m: spread(&self.joint_m),
            joint_aligned_m: spread(&self.joint_aligned_m),
            two_steps_m: spread(&self.two_steps_m),
            two_steps_aligned_m: spread(&self.two_steps_aligned_m),
            size_percent: spread(&self.size_percent),
            two_steps_size_percent: spread(&self.two_steps_size_percent),
            nees: mean(&self.nees),
            nees_along: mean(&self.nees_along),
            nees_across: mean(&self.nees_across),
            stated_deg: spread(&self.stated_deg),
            found_deg: spread(&self.found_deg),
            lost: self.lost,
        }
    }
}

/// Median and 95 % quantile; absent where nothing was measured.
#[derive(Debug, Serialize)]
struct Spread {
    median: Option<f64>,
    p95: Option<f64>,
}

impl Spread {
    fn in_words(&self, factor: f64, digits: usize, unit: &str) -> String {
        let word = |x: Option<f64>| x.map_or("-".to_owned(), |x| format!("{:.digits$}", factor * x));
        format!("{}, {} {unit}", word(self.median), word(self.p95))
    }
}

/// What is printed: [`Figures`] of all buildings, in the same units.
#[derive(Debug, Serialize)]
struct Report {
    experiment: &'static str,
    shown: usize,
    placed: usize,
    strangers: usize,
    joint_m: Spread,
    joint_aligned_m: Spread,
    two_steps_m: Spread,
    two_steps_aligned_m: Spread,
    size_percent: Spread,
    two_steps_size_percent: Spread,
    /// Mean; 1 expected.
    nees: f64,
    nees_along: f64,
    nees_across: f64,
    stated_deg: Spread,
    found_deg: Spread,
    lost: Vec<String>,
}

impl Report {
    fn lines(&self) -> Vec<String> {
        let mut lines = vec![
            format!(
                "{} of {} posters in full view became landmarks; {} landmarks are something else",
                self.placed, self.shown, self.strangers
            ),
            "median, 95 %".to_owned(),
            format!("  landmark, joint      {}", self.joint_m.in_words(1e3, 0, "mm")),
            format!("  landmark, two steps  {}", self.two_steps_m.in_words(1e3, 0, "mm")),
            format!("  aligned, joint       {}", self.joint_aligned_m.in_words(1e3, 0, "mm")),
            format!("  aligned, two steps   {}", self.two_steps_aligned_m.in_words(1e3, 0, "mm")),
            format!("  size, joint          {}", self.size_percent.in_words(1.0, 2, "%")),
            format!("  size, two steps      {}", self.two_steps_size_percent.in_words(1.0, 2, "%")),
            format!("  mounting, stated     {}", self.stated_deg.in_words(1.0, 2, "deg")),
            format!("  mounting, found      {}", self.found_deg.in_words(1.0, 2, "deg")),
            format!(
                "NEES of landmarks for each degree of freedom, in the frame of the whole drive: {:.2}; along the \
                 corridor {:.2}, across {:.2}",
                self.nees, self.nees_along, self.nees_across
            ),
        ];
        lines.extend(self.lost.iter().map(|lost| format!("  lost: {lost}")));
        lines
    }
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let seeds: Vec<u64> = (0..u64::from(args.buildings)).map(|i| args.seed + i).collect();
    let course = |seed: u64| Course {
        length_m: args.length_m,
        posters: args.posters as usize,
        rate_hz: args.rate_hz,
        ahead: args.ahead,
        drives: args.drives as usize,
        seed,
    };
    let drives = of_each(&seeds, "drives", |_, seed| drive(&course(*seed)));
    let mut all = Figures::default();
    for driven in drives {
        let driven = driven?;
        let building = surveyed(&driven.logs, None, &Params::default())?;
        all.add(figures(&driven, &building));
    }
    let report = all.report();
    say(args.json, &report, || report.lines())
}

fn figures(driven: &Driven, building: &SurveyedBuilding) -> Figures {
    let mut made = Figures { shown: driven.shown.len(), ..Figures::default() };
    let (mut joint, mut two) = (Vec::new(), Vec::new());
    let mut named = std::collections::BTreeSet::new();
    let points = |poses: &mut dyn Iterator<Item = &Pose2>| poses.map(|p| p.position().into()).collect();
    let (found, path): (Vec<Point2<f64>>, Vec<Point2<f64>>) =
        (points(&mut building.frames.iter().map(|f| &f.pose)), points(&mut driven.path.iter()));
    let by_drive = laid_on(&found, &path);
    let by_first = driven.path.first().copied().unwrap_or_default();
    for object in building.objects.iter().filter(|object| object.refused.is_none()) {
        let at_first = object.place.moved(&by_first);
        let Some(truth) = truth_at(&driven.building, &at_first) else {
            made.strangers += 1;
            continue;
        };
        if !driven.shown.contains(&truth.name) {
            continue;
        }
        named.insert(truth.name.clone());
        let at = floor(truth);
        let here = Vector2::new(at_first.x_m, at_first.y_m);
        made.joint_m.push((here - at).norm());
        let place = object.place.moved(&by_drive);
        let covariance = place.covariance.fixed_view::<2, 2>(0, 0).into_owned();
        let d = Vector2::new(place.x_m, place.y_m) - at;
        made.nees.extend(covariance.cholesky().map(|c| d.dot(&c.solve(&d)) / 2.0));
        made.nees_along.push(d.x * d.x / covariance[(0, 0)]);
        made.nees_across.push(d.y * d.y / covariance[(1, 1)]);
        made.size_percent.extend(size_errors(&object.place, &driven.borders(truth)));
        joint.push((here, at));
        if let Some(place) = two_steps(driven, building, object) {
            let place = place.moved(&by_first);
            let here = Vector2::new(place.x_m, place.y_m);
            made.two_steps_m.push((here - at).norm());
            made.two_steps_size_percent.extend(size_errors(&place, &driven.borders(truth)));
            two.push((here, at));
        }
    }
    made.placed = named.len();
    let lost = driven.shown.iter().filter(|name| !named.contains(*name));
    made.lost = lost.map(|name| format!("{name}: {}", why_lost(driven, building, name))).collect();
    (made.joint_aligned_m, made.two_steps_aligned_m) = (aligned(&joint), aligned(&two));
    let angle =
        |found: &nalgebra::Isometry3<f64>| found.rotation.angle_to(&driven.mounting.rotation).to_degrees();
    made.stated_deg.push(angle(&building.stated.robot_from_camera));
    made.found_deg.push(angle(&building.camera.0.robot_from_camera));
    made
}

/// The truth that hangs where a place is, if any.
pub(super) fn truth_at<'a>(building: &'a Building, place: &LandmarkPlace) -> Option<&'a LandmarkTruth> {
    let here = Vector2::new(place.x_m, place.y_m);
    let off = |truth: &&LandmarkTruth| (here - floor(truth)).norm();
    let near = |truth: &&LandmarkTruth| {
        off(truth) < NEAR_SHARE * truth.width_m.max(truth.height_m)
            && (truth.map_from_landmark.translation.z - place.z_m).abs() < NEAR_SHARE * truth.height_m
    };
    building.landmarks().iter().filter(near).min_by(|a, b| off(a).total_cmp(&off(b)))
}

/// Why a poster is no landmark.
fn why_lost(driven: &Driven, building: &SurveyedBuilding, name: &str) -> String {
    let by_first = driven.path.first().copied().unwrap_or_default();
    let of_it = |object: &&SurveyedObject| {
        truth_at(&driven.building, &object.place.moved(&by_first)).is_some_and(|t| t.name == name)
    };
    let refused: Vec<&str> =
        building.objects.iter().filter(of_it).filter_map(|object| object.refused.as_deref()).collect();
    if refused.is_empty() { "no object was followed there".to_owned() } else { refused.join("; ") }
}

/// Centre of a landmark on the floor.
fn floor(truth: &LandmarkTruth) -> Vector2<f64> {
    truth.map_from_landmark.translation.vector.xy()
}

/// Errors of both sides, %, against the border that is nearest: a detector may take a poster's
/// frame or its picture.
fn size_errors(place: &LandmarkPlace, borders: &[[f64; 2]]) -> [f64; 2] {
    let off = |border: &[f64; 2]| {
        let ratios = [place.size.width_m / border[0], place.size.height_m / border[1]];
        ratios.map(|ratio| 100.0 * (ratio - 1.0).abs())
    };
    let all = borders.iter().map(off);
    all.min_by(|a, b| (a[0] + a[1]).total_cmp(&(b[0] + b[1]))).unwrap_or([100.0; 2])
}

/// The place of an object by the first drive's laser map and the camera as stated.
fn two_steps(driven: &Driven, building: &SurveyedBuilding, object: &SurveyedObject) -> Option<LandmarkPlace> {
    let sigmas = Vector3::from(NEAR_SIGMA);
    let covariance = Matrix3::from_diagonal(&sigmas.component_mul(&sigmas));
    let p = PlacementParams::default();
    let on_wall = |view: &ObjectView| {
        let frame = &driven.logs[0].drive.frames.get(view.frame)?.frame;
        let posed = PosedView {
            corners: &view.corners_px,
            covariance_px2: &view.covariance_px2,
            camera: frame.intrinsics.as_ref()?,
            map_from_robot: &Pose2Covariance { pose: building.laser_frames[view.frame], covariance },
            mounting: frame.mounting.as_ref()?,
        };
        view_on_wall(&posed, &building.laser_walls, &p).ok()
    };
    let views: Vec<_> = object.views.iter().filter_map(on_wall).collect();
    placement(&views, &building.laser_walls, &p).ok().map(|made| made.place)
}

/// Distances after the rigid motion that lays the found points best on the true ones.
fn aligned(pairs: &[(Vector2<f64>, Vector2<f64>)]) -> Vec<f64> {
    let (found, truth): (Vec<Point2<f64>>, Vec<Point2<f64>>) =
        pairs.iter().map(|(a, b)| (Point2::from(*a), Point2::from(*b))).unzip();
    let laid = laid_on(&found, &truth);
    found.iter().zip(&truth).map(|(a, b)| (laid.apply(a) - b).norm()).collect()
}
