//! From measurements to a survey: passages, tracks, candidates of what is the same, and wrong ones
//! among them.

use super::{
    building::{Building, NAMED},
    drive::{CORNER_PX, SimulatedDrive},
};
use map::joint::{CameraStated, DriveRecord, LineSeen, PlanLine, QuadView, Survey, Track, WallLine};
use nalgebra::{Matrix2, Vector2};
use std::collections::BTreeMap;
use vision::random::Random;

/// An object or section that was not in sight over this way is met in a new passage, metres.
const GAP_M: f64 = 10.0;
/// Views of a track that becomes a landmark: candidates are pairs of such tracks.
const TRACK_VIEWS: usize = 3;
/// Shift of a wrong view: standard deviation, px.
const WRONG_VIEW_PX: f64 = 60.0;

/// Whether the laser counts, what is known again in later passages, and what is wrong.
#[derive(Debug, Clone, Copy)]
pub(super) struct Setting {
    pub(super) laser: bool,
    /// Walls are known again.
    pub(super) scan_loops: bool,
    /// Objects with an appearance of their own are.
    pub(super) object_loops: bool,
    /// Shares of wrong candidates and of views that show another object.
    pub(super) wrong: [f64; 2],
    /// Objects whose size is known.
    pub(super) sized: usize,
    /// A floor plan with errors of direction (rad) and offset (m).
    pub(super) plan: Option<[f64; 2]>,
}

impl Setting {
    pub(super) const ALL: Self =
        Self { laser: true, scan_loops: true, object_loops: true, wrong: [0.0; 2], sized: 0, plan: None };
}

/// A survey with the truth about its numbers.
#[derive(Debug, Clone)]
pub(super) struct LabelledSurvey {
    pub(super) survey: Survey,
    /// Object of each track.
    pub(super) object_of: Vec<usize>,
    /// Section of each wall number.
    pub(super) section_of: Vec<usize>,
    /// Whether each candidate is wrong.
    pub(super) wrong: Vec<bool>,
}

/// Numbers the passages of an object or section.
#[derive(Default)]
struct Passages {
    last: BTreeMap<usize, (usize, f64, usize)>,
}

impl Passages {
    /// The passage in which `what` is met by a drive after a way.
    fn at(&mut self, what: usize, drive: usize, way_m: f64) -> usize {
        let now = match self.last.get(&what) {
            None => 0,
            Some((before, way, passage)) => passage + usize::from(*before != drive || way_m - way > GAP_M),
        };
        self.last.insert(what, (drive, way_m, now));
        now
    }
}

/// The survey of some drives; `camera` as the robot states it.
pub(super) fn labelled(
    building: &Building,
    drives: &[&SimulatedDrive],
    camera: CameraStated,
    setting: &Setting,
    random: &mut Random,
) -> LabelledSurvey {
    let sections = building.sections.len();
    let mut made = LabelledSurvey {
        survey: Survey {
            start: drives[0].truth[0],
            camera,
            drives: Vec::new(),
            same_wall: (0..sections).collect(),
            plan: plan(building, setting, random),
            candidates: Vec::new(),
        },
        object_of: Vec::new(),
        section_of: (0..sections).collect(),
        wrong: Vec::new(),
    };
    let (mut walls, mut objects) = (Passages::default(), Passages::default());
    let mut met = Vec::new();
    for (number, drive) in drives.iter().enumerate() {
        let mut record = DriveRecord { motions: drive.motions.clone(), ..DriveRecord::default() };
        if setting.laser {
            made.lines(drive, number, &mut walls, setting.scan_loops, &mut record);
        }
        met.extend(made.tracks(building, drive, number, &mut objects, setting, &mut record, random));
        made.survey.drives.push(record);
    }
    if setting.object_loops {
        made.candidates(&met, setting.wrong[0], random);
    }
    made
}

/// The sections as a floor plan shows them.
fn plan(building: &Building, setting: &Setting, random: &mut Random) -> Vec<PlanLine> {
    let Some([angle, offset]) = setting.plan else { return Vec::new() };
    let line = |(wall, section): (usize, &super::building::Section)| {
        let truth = section.line();
        let mut line = WallLine { facing_rad: truth.facing_rad + angle * random.normal(), ..truth };
        line.anchor += line.normal() * (offset * random.normal());
        PlanLine { wall, line }
    };
    building.sections.iter().enumerate().map(line).collect()
}

impl LabelledSurvey {
    fn lines(
        &mut self,
        drive: &SimulatedDrive,
        number: usize,
        walls: &mut Passages,
        loops: bool,
        record: &mut DriveRecord,
    ) {
        let mut wall_of: BTreeMap<(usize, usize), usize> = BTreeMap::new();
        let mut in_order: Vec<_> = drive.lines.iter().collect();
        in_order.sort_by_key(|line| line.keyframe);
        for line in in_order {
            let passage = walls.at(line.section, number, drive.way_m[line.keyframe]);
            let wall = *wall_of.entry((line.section, passage)).or_insert_with(|| {
                let wall = self.section_of.len();
                self.section_of.push(line.section);
                self.survey.same_wall.push(if loops { line.section } else { wall });
                wall
            });
            let (keyframe, facing_rad, offset_m) = (line.keyframe, line.facing_rad, line.offset_m);
            record.lines.push(LineSeen { keyframe, wall, facing_rad, offset_m, covariance: line.covariance });
        }
    }

    /// Adds the tracks of a drive; gives object and passage of each that has enough views.
    #[expect(clippy::too_many_arguments, reason = "one caller; a struct would say no more")]
    fn tracks(
        &mut self,
        building: &Building,
        drive: &SimulatedDrive,
        number: usize,
        objects: &mut Passages,
        setting: &Setting,
        record: &mut DriveRecord,
        random: &mut Random,
    ) -> Vec<(usize, usize, usize)> {
        let mut tracks: BTreeMap<(usize, usize), Track> = BTreeMap::new();
        for quad in &drive.quads {
            let passage = objects.at(quad.object, number, drive.way_m[quad.keyframe]);
            let is_wrong = random.unit() < setting.wrong[1];
            let shift = Vector2::new(random.normal(), random.normal()) * WRONG_VIEW_PX;
            let corners_px = if is_wrong { quad.corners_px.map(|p| p + shift) } else { quad.corners_px };
            let covariance_px2 = [Matrix2::identity() * CORNER_PX.powi(2); 4];
            let mounting_from_camera = nalgebra::Isometry3::identity();
            let view = QuadView { keyframe: quad.keyframe, mounting_from_camera, corners_px, covariance_px2 };
            tracks.entry((quad.object, passage)).or_default().views.push(view);
        }
        let mut met = Vec::new();
        for ((object, passage), mut track) in tracks {
            let section = building.hangs_on[object];
            let first = track.views[0].keyframe;
            let of_section = record.lines.iter().filter(|l| self.section_of[l.wall] == section);
            let nearest = of_section.min_by_key(|l| l.keyframe.abs_diff(first)).map(|l| l.wall);
            track.wall = nearest.or(setting.plan.map(|_| section));
            track.size = (object < setting.sized).then(|| building.objects[object].size());
            if track.views.len() >= TRACK_VIEWS {
                met.push((object, passage, self.object_of.len()));
            }
            self.object_of.push(object);
            record.tracks.push(track);
        }
        met
    }

    /// Consecutive tracks of one object with an appearance of its own; some lead to another object.
    fn candidates(&mut self, met: &[(usize, usize, usize)], wrong: f64, random: &mut Random) {
        let mut met: Vec<_> = met.iter().filter(|(object, ..)| *object < NAMED).copied().collect();
        met.sort_unstable();
        let mut pairs: Vec<([usize; 2], usize)> = met
            .windows(2)
            .filter(|pair| pair[0].0 == pair[1].0)
            .map(|pair| ([pair[0].2, pair[1].2], pair[1].1))
            .collect();
        self.wrong = vec![false; pairs.len()];
        let mut order: Vec<usize> = (0..pairs.len()).collect();
        for i in (1..order.len()).rev() {
            order.swap(i, (random.unit() * (i + 1) as f64) as usize);
        }
        for &i in &order[..(wrong * pairs.len() as f64).ceil() as usize] {
            let (pair, passage) = &mut pairs[i];
            let others: Vec<usize> = met
                .iter()
                .filter(|(object, when, _)| *object != self.object_of[pair[0]] && when == passage)
                .map(|(.., track)| *track)
                .collect();
            if !others.is_empty() {
                pair[1] = others[(random.unit() * others.len() as f64) as usize];
                self.wrong[i] = true;
            }
        }
        self.survey.candidates = pairs.into_iter().map(|(pair, _)| pair).collect();
    }
}
