//! A kidnapped robot among doors that look the same: the belief over its pose after each observation, and the
//! hypotheses that are left (method 19.1, 28).

use super::{
    map_plan::{ESTIMATE, LANDMARK, ODOMETRY, Plan, Sign, TRUTH, legend, page, title},
    map_scene::poster,
};
use crate::evaluate::chart::COLOURS;
use formats::svg::put;
use map::{
    place::{LandmarkPlace, PlaceSigmas},
    pose2::Pose2,
    relocalise::{GridBelief, GridBeliefParams, PoseHypothesis, PossibleLandmark, RelativeObservation},
};
use nalgebra::{Matrix3, Point2, Vector3};
use std::{
    f64::consts::{FRAC_PI_2, TAU},
    fmt::Write as _,
};
use vision::{pose::LandmarkSize, random::Random};

const LENGTH_M: f64 = 20.0;
const WIDTH_M: f64 = 2.4;
/// Doors that look the same: on the upper side, and on the lower.
const UPPER_M: [f64; 4] = [2.6, 6.0, 11.4, 16.8];
const LOWER_M: [f64; 2] = [4.2, 13.6];
/// The only poster: where it is seen, the robot knows where it is.
const POSTER_M: f64 = 18.6;
/// Standard deviations of an observation: metres and radians.
const SIGMAS: [f64; 3] = [0.06, 0.06, 0.05];
const SEED: u64 = 4;
/// Shades of the belief.
const SHADES: usize = 12;
/// Hypotheses below this share are not drawn.
const LEAST_MASS: f64 = 0.02;

/// The belief at one moment, as it is drawn.
struct Panel {
    words: &'static str,
    truth: Pose2,
    /// Belief of each cell over all headings, by column and row.
    cells: Vec<(Point2<f64>, f64)>,
    hypotheses: Vec<PoseHypothesis>,
    entropy_nats: f64,
}

struct Search {
    belief: GridBelief,
    truth: Pose2,
    doors: Vec<LandmarkPlace>,
    poster: LandmarkPlace,
    p: GridBeliefParams,
    random: Random,
    panels: Vec<Panel>,
}

fn door(x: f64, y: f64, theta: f64) -> anyhow::Result<LandmarkPlace> {
    let size = LandmarkSize { width_m: 0.9, height_m: 2.0 };
    Ok(LandmarkPlace::by_hand(Vector3::new(x, y, 1.0), theta, size, PlaceSigmas::default())?)
}

impl Search {
    fn new() -> anyhow::Result<Self> {
        let upper = UPPER_M.iter().map(|x| door(*x, WIDTH_M, -FRAC_PI_2));
        let doors =
            upper.chain(LOWER_M.iter().map(|x| door(*x, 0.0, FRAC_PI_2))).collect::<Result<_, _>>()?;
        let p = GridBeliefParams::default();
        let corners = [Point2::origin(), Point2::new(LENGTH_M, WIDTH_M)];
        Ok(Self {
            belief: GridBelief::new(corners, |_| 1.0, &p)?,
            truth: Pose2::new(17.2, 1.1, 0.0),
            doors,
            poster: poster(POSTER_M, WIDTH_M, -FRAC_PI_2)?,
            p,
            random: Random::new(SEED),
            panels: Vec::new(),
        })
    }

    /// Something at `place` is observed, which may be any of `members`.
    fn observe(&mut self, place: &LandmarkPlace, members: &[LandmarkPlace]) -> anyhow::Result<()> {
        let at = Pose2::new(place.x_m, place.y_m, place.theta_rad);
        let noise = Vector3::from(SIGMAS).map(|s| s * self.random.normal());
        let covariance = Matrix3::from_diagonal(&Vector3::from(SIGMAS.map(|s| s * s)));
        let glimpse =
            RelativeObservation { robot_from_landmark: self.truth.between(&at).plus(&noise), covariance };
        let probability = (1.0 - self.p.clutter) / members.len() as f64;
        let members: Vec<PossibleLandmark<'_>> =
            members.iter().map(|place| PossibleLandmark { place, visible: None, probability }).collect();
        Ok(self.belief.update(&glimpse, &members)?)
    }

    /// Observes one of the doors.
    fn observe_door(&mut self, index: usize) -> anyhow::Result<()> {
        let doors = self.doors.clone();
        self.observe(&doors[index], &doors)
    }

    fn drive(&mut self, metres: f64) -> anyhow::Result<()> {
        let steps = (metres / 0.3).round().max(1.0);
        for _ in 0..steps as usize {
            let motion = Pose2::new(metres / steps, 0.0, 0.0);
            self.truth = self.truth.compose(&motion);
            self.belief.predict(&motion)?;
        }
        Ok(())
    }

    fn keep(&mut self, words: &'static str) {
        let (columns, rows) = ((LENGTH_M / self.p.cell_m) as usize, (WIDTH_M / self.p.cell_m) as usize);
        let middle = |i: usize| (i as f64 + 0.5) * self.p.cell_m;
        let heading = |k: usize| TAU * k as f64 / self.p.headings as f64;
        let over_headings = |x: f64, y: f64| -> f64 {
            (0..self.p.headings).map(|k| self.belief.belief(&Pose2::new(x, y, heading(k)))).sum()
        };
        let cells = (0..columns * rows)
            .map(|i| (middle(i % columns), middle(i / columns)))
            .map(|(x, y)| (Point2::new(x, y), over_headings(x, y)))
            .collect();
        let mut hypotheses = self.belief.modes();
        hypotheses.retain(|h| h.mass >= LEAST_MASS);
        let entropy_nats = self.belief.entropy_nats();
        self.panels.push(Panel { words, truth: self.truth, cells, hypotheses, entropy_nats });
    }
}

/// The picture.
pub(super) fn svg() -> anyhow::Result<String> {
    let mut search = Search::new()?;
    let poster = search.poster;
    for _ in 0..2 {
        search.observe(&poster, &[poster])?;
        search.drive(0.3)?;
    }
    search.keep("1: It has seen the only poster, and knows where it is.");
    // Carried away by hand: odometry says nothing.
    search.truth = Pose2::new(5.0, 1.1, 0.0);
    search.observe_door(1)?;
    search.keep("2: Carried away; now it sees a door, which may be any of six, or something else.");
    search.drive(0.4)?;
    search.observe_door(1)?;
    search.keep("3: The door from 0.4 m farther on: the old place explains neither look.");
    search.drive(5.0)?;
    search.observe_door(2)?;
    search.keep("4: 5 m on there is a door again: only two places are left.");
    search.drive(5.4)?;
    search.observe_door(3)?;
    search.keep("5: A third door at the same distance: one place is left.");
    let height = 70.0 + PANEL_PX * search.panels.len() as f64;
    page([1100.0, height], |svg| {
        for (i, panel) in search.panels.iter().enumerate() {
            let plan = draw(svg, panel, &search, 24.0 + PANEL_PX * i as f64);
            if i + 1 == search.panels.len() {
                plan.scale_bar(svg, 1.0);
            }
        }
        let top = 40.0 + PANEL_PX * search.panels.len() as f64;
        legend(
            svg,
            (40.0, top),
            &[
                (Sign::Landmark, LANDMARK, "doors that look the same"),
                (Sign::Landmark, COLOURS[3], "a poster that nothing looks like"),
            ],
        );
        legend(
            svg,
            (340.0, top),
            &[
                (Sign::Robot, TRUTH, "where the robot really is"),
                (Sign::Robot, ESTIMATE, "hypothesis with its share of the belief"),
            ],
        );
        legend(svg, (700.0, top), &[(Sign::Dot, ODOMETRY, "belief over the position: the darker the more")]);
        Ok(())
    })
}

const PANEL_PX: f64 = 172.0;

fn draw(svg: &mut String, panel: &Panel, search: &Search, top: f64) -> Plan {
    let plan = Plan::new((40.0, top + 14.0), [[0.0, 0.0], [LENGTH_M, WIDTH_M]], 51.0);
    let count = panel.hypotheses.len();
    let several = if count == 1 { "hypothesis" } else { "hypotheses" };
    let words = format!("{}  ({count} {several}, entropy {:.1} nats)", panel.words, panel.entropy_nats);
    title(svg, (40.0, top), &words);
    shades(svg, &plan, panel, search.p.cell_m);
    let corners = [[0.0, 0.0], [LENGTH_M, 0.0], [LENGTH_M, WIDTH_M], [0.0, WIDTH_M]].map(Point2::from);
    plan.area(svg, corners, r##"fill="none" stroke="#777" stroke-width="2.5""##);
    for place in &search.doors {
        plan.landmark(svg, place, LANDMARK);
    }
    plan.landmark(svg, &search.poster, COLOURS[3]);
    for hypothesis in &panel.hypotheses {
        let pose = &hypothesis.pose;
        plan.pose_ellipse(svg, pose, ESTIMATE);
        plan.robot(svg, &pose.pose, ESTIMATE);
        let words = format!("{:.0} %", 100.0 * hypothesis.mass);
        // Of two that overlap, the one that faces back has its words above.
        let dv = if pose.pose.theta_rad.cos() < 0.0 { -22.0 } else { 34.0 };
        plan.label(svg, &pose.pose.position().into(), ("middle", [0.0, dv]), &words);
    }
    // Beside the hypothesis that has found it, not under it.
    let below = Point2::new(panel.truth.x_m, 0.25);
    plan.robot(svg, &Pose2::new(below.x, below.y, panel.truth.theta_rad), TRUTH);
    plan
}

/// The belief as squares: one path for each shade.
fn shades(svg: &mut String, plan: &Plan, panel: &Panel, cell_m: f64) {
    let most = panel.cells.iter().map(|(_, b)| *b).fold(0.0, f64::max);
    let (u0, _) = plan.at(&Point2::origin());
    let (u1, _) = plan.at(&Point2::new(cell_m, 0.0));
    let side = u1 - u0;
    for shade in 1..=SHADES {
        let mut path = String::new();
        for (at, belief) in &panel.cells {
            // The root shows what is small as well.
            if ((belief / most).sqrt() * SHADES as f64).round() as usize == shade {
                let (u, v) = plan.at(&Point2::new(at.x - 0.5 * cell_m, at.y + 0.5 * cell_m));
                // Writing to a String cannot fail.
                write!(path, "M{u:.1} {v:.1}h{side:.1}v{side:.1}h-{side:.1}z").ok();
            }
        }
        if !path.is_empty() {
            let opacity = shade as f64 / SHADES as f64;
            put(svg, &format!(r#"<path d="{path}" fill="{ODOMETRY}" fill-opacity="{opacity:.2}"/>"#));
        }
    }
}
