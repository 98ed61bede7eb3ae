//! The simulated building: sections of wall slightly out of line, objects on them, and the path of
//! a drive.

use map::{
    joint::{LandmarkState, WallLine},
    pose2::Pose2,
};
use nalgebra::{Point2, Rotation2, Vector2, Vector3, center};
use std::f64::consts::{FRAC_PI_2, TAU};
use vision::random::Random;

/// Objects, and those among them with an appearance of their own; the others are doors.
pub(super) const OBJECTS: usize = 26;
pub(super) const NAMED: usize = 20;
/// Between keyframes, metres.
const STEP_M: f64 = 0.5;
/// Longest section of wall, metres.
const SECTION_M: f64 = 7.0;
/// Sections are out of line: standard deviations, metres, and radians at their ends.
const BEND: [f64; 2] = [0.005, 0.002];
/// How objects hang: standard deviations, metres and radians.
pub(super) const HANGING: [f64; 2] = [0.01, 0.5 * std::f64::consts::PI / 180.0];
/// Objects of one building have at least this distance, metres.
const APART_M: f64 = 1.3;

/// Shape of the corridors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Shape {
    /// Two corridors of 30 m joined by two of 14 m, 2.4 m wide.
    Ring,
    /// One corridor whose ends are out of reach of the laser: 52 m out and back.
    Bare,
}

/// A section of wall; the free side is on the left from `a` to `b`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Section {
    pub(super) a: Point2<f64>,
    pub(super) b: Point2<f64>,
}

impl Section {
    pub(super) fn direction(&self) -> Vector2<f64> {
        (self.b - self.a).normalize()
    }

    /// Facing normal.
    pub(super) fn normal(&self) -> Vector2<f64> {
        let d = self.direction();
        Vector2::new(-d.y, d.x)
    }

    /// The true line, about the middle of the section.
    pub(super) fn line(&self) -> WallLine {
        let n = self.normal();
        WallLine { anchor: center(&self.a, &self.b), facing_rad: n.y.atan2(n.x), offset_m: 0.0 }
    }

    /// Whether the section lies between two points.
    fn hides(&self, p: &Point2<f64>, q: &Point2<f64>) -> bool {
        let (d, b, e) = (q - p, self.b - self.a, self.a - p);
        let across = d.perp(&b);
        if across.abs() < 1e-12 {
            return false;
        }
        let (t, u) = (e.perp(&b) / across, e.perp(&d) / across);
        t > 1e-3 && t < 1.0 - 1e-3 && (0.0..=1.0).contains(&u)
    }
}

/// A building.
#[derive(Debug, Clone)]
pub(super) struct Building {
    pub(super) shape: Shape,
    pub(super) sections: Vec<Section>,
    /// Objects, those of an appearance of their own first.
    pub(super) objects: Vec<LandmarkState>,
    /// Section that each object hangs on.
    pub(super) hangs_on: Vec<usize>,
}

impl Building {
    pub(super) fn drawn(shape: Shape, random: &mut Random) -> Self {
        let sections: Vec<Section> = lines(shape).iter().flat_map(|line| pieces(*line, random)).collect();
        let (mut objects, mut hangs_on) = (Vec::<LandmarkState>::new(), Vec::new());
        while objects.len() < OBJECTS {
            let on = (random.unit() * sections.len() as f64) as usize;
            let section = &sections[on];
            let (length, n) = ((section.b - section.a).norm(), section.normal());
            let along = random.range(0.7, length - 0.7);
            let at = section.a + section.direction() * along + n * (HANGING[0] * random.normal());
            let in_reach = shape == Shape::Ring || (3.0..54.0).contains(&at.x);
            if !in_reach || objects.iter().any(|o| (o.centre.xy() - at.coords).norm() < APART_M) {
                continue;
            }
            let (size, z) = if objects.len() < NAMED {
                ([random.range(0.4, 1.0), random.range(0.3, 1.2)], random.range(1.2, 1.8))
            } else {
                ([0.9, 2.05], 1.03)
            };
            let [theta, tilt_rad, roll_rad] = [(); 3].map(|()| HANGING[1] * random.normal());
            objects.push(LandmarkState {
                centre: Vector3::new(at.x, at.y, z),
                theta_rad: n.y.atan2(n.x) + theta,
                tilt_rad,
                roll_rad,
                log_size: Vector2::from(size.map(f64::ln)),
            });
            hangs_on.push(on);
        }
        Self { shape, sections, objects, hangs_on }
    }

    /// Whether a wall lies between two points.
    pub(super) fn hidden(&self, p: &Point2<f64>, q: &Point2<f64>) -> bool {
        self.sections.iter().any(|section| section.hides(p, q))
    }

    /// True keyframes of a drive, with the way driven at each; `back`: the other way round.
    pub(super) fn path(
        &self,
        (start_m, length_m): (f64, f64),
        back: bool,
        random: &mut Random,
    ) -> (Vec<Pose2>, Vec<f64>) {
        let mut corners = self.centre_line(start_m + length_m);
        if back {
            corners.reverse();
        }
        let mut way = vec![0.0];
        for pair in corners.windows(2) {
            way.push(way[way.len() - 1] + (pair[1] - pair[0]).norm());
        }
        let at = |s: f64| {
            let i = way.partition_point(|w| *w <= s).clamp(1, way.len() - 1);
            let share = ((s - way[i - 1]) / (way[i] - way[i - 1])).clamp(0.0, 1.0);
            corners[i - 1] + (corners[i] - corners[i - 1]) * share
        };
        let (turning, swaying) = (random.range(0.0, 6.0), random.range(0.0, 6.0));
        let end = (start_m + length_m).min(way[way.len() - 1] - 0.1);
        let steps = ((end - start_m) / STEP_M).ceil() as usize;
        let mut poses = Vec::new();
        let mut driven = Vec::new();
        for step in 0..steps {
            let s = start_m + step as f64 * STEP_M;
            let d = (at(s + 0.05) - at(s - 0.05)).normalize();
            let side = 0.12 * (s / 1.3 + swaying).sin();
            let p = at(s) + Vector2::new(-d.y, d.x) * side;
            poses.push(Pose2::new(p.x, p.y, d.y.atan2(d.x) + 0.08 * (s / 1.1 + turning).sin()));
            driven.push(s - start_m);
        }
        (poses, driven)
    }

    /// The middle of the way, at least so long.
    fn centre_line(&self, length_m: f64) -> Vec<Point2<f64>> {
        let arc = |x: f64, y: f64, r: f64, first: f64, sweep: f64, n: usize| {
            let point = move |i| {
                let turn = Rotation2::new(first + sweep * i as f64 / (n - 1) as f64);
                Point2::new(x, y) + turn * Vector2::new(r, 0.0)
            };
            (0..n).map(point).collect::<Vec<_>>()
        };
        match self.shape {
            Shape::Ring => {
                let corners = [(27.9, 2.1, -1.0), (27.9, 11.9, 0.0), (2.1, 11.9, 1.0), (2.1, 2.1, 2.0)];
                let round =
                    corners.iter().flat_map(|&(x, y, k)| arc(x, y, 0.9, k * FRAC_PI_2, FRAC_PI_2, 30));
                let round: Vec<_> = round.collect();
                round.repeat((length_m / 70.0).ceil() as usize + 2)
            }
            Shape::Bare => {
                let mut line = vec![Point2::new(2.0, 0.8)];
                line.extend(arc(54.0, 1.2, 0.4, -FRAC_PI_2, TAU / 2.0, 20));
                line.push(Point2::new(2.0, 1.6));
                line
            }
        }
    }
}

fn lines(shape: Shape) -> Vec<Section> {
    let section = |[x0, y0, x1, y1]: [f64; 4]| Section { a: Point2::new(x0, y0), b: Point2::new(x1, y1) };
    match shape {
        Shape::Ring => {
            let outer = [[0., 0., 30., 0.], [30., 0., 30., 14.], [30., 14., 0., 14.], [0., 14., 0., 0.]];
            let (x0, y0, x1, y1) = (2.4, 2.4, 27.6, 11.6);
            let inner = [[x1, y0, x0, y0], [x1, y1, x1, y0], [x0, y1, x1, y1], [x0, y0, x0, y1]];
            outer.into_iter().chain(inner).map(section).collect()
        }
        Shape::Bare => [[-20., 0., 80., 0.], [80., 2.4, -20., 2.4]].map(section).to_vec(),
    }
}

fn pieces(line: Section, random: &mut Random) -> Vec<Section> {
    let length = (line.b - line.a).norm();
    let n = (length / SECTION_M).ceil();
    let piece = |i: usize| {
        let at = |k: usize| line.a + (line.b - line.a) * (k as f64 / n);
        let (off, turn) = (BEND[0] * random.normal(), BEND[1] * random.normal() * length / n / 2.0);
        let normal = line.normal();
        Section { a: at(i) + normal * (off - turn), b: at(i + 1) + normal * (off + turn) }
    };
    (0..n as usize).map(piece).collect()
}
