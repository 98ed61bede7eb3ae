//! The tables: errors by case, and the figures that are required.

use super::figures::Figures;
use crate::evaluate::statistics::{median, quantile};
use serde::Serialize;

/// Of the largest normalised errors this share is left out: a single landmark with two solutions
/// would be the whole mean.
const NEES_TAIL: f64 = 0.01;

/// Median and 95 % of an error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct Spread {
    pub(super) median: f64,
    pub(super) p95: f64,
}

impl Spread {
    fn of(values: &[f64], scale: f64) -> Option<Self> {
        let mut all: Vec<f64> = values.iter().map(|v| scale * v.abs()).collect();
        Some(Self { median: median(&mut all)?, p95: quantile(&mut all, 0.95)? })
    }
}

/// A row of the table of errors.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Row {
    pub(super) case: &'static str,
    pub(super) what: &'static str,
    pub(super) landmarks: usize,
    pub(super) failed: usize,
    pub(super) landmark_mm: Option<Spread>,
    pub(super) aligned_mm: Option<Spread>,
    pub(super) scaled_mm: Option<Spread>,
    pub(super) size_percent: Option<Spread>,
    /// Mean of the signed errors of sides.
    pub(super) size_bias_percent: f64,
    pub(super) facing_deg: Option<Spread>,
    pub(super) wall_mm: Option<Spread>,
    pub(super) loop_mm: Option<Spread>,
    /// From the landmarks of all drives at once.
    pub(super) apart_mm: Option<Spread>,
    pub(super) mounting_deg: Option<Spread>,
    pub(super) mounting_mm: Option<Spread>,
    pub(super) focal_percent: Option<Spread>,
    /// Mean for each degree of freedom.
    pub(super) landmark_nees: Option<f64>,
    pub(super) wall_nees: Option<f64>,
    pub(super) camera_nees: Option<f64>,
    pub(super) wrong: usize,
    pub(super) wrong_kept: usize,
    pub(super) right: usize,
    pub(super) right_lost: usize,
}

impl Row {
    pub(super) fn of(case: &'static str, what: &'static str, f: &Figures) -> Self {
        let sides = f.size_percent.len().max(1) as f64;
        Self {
            case,
            what,
            landmarks: f.landmark_m.len(),
            failed: f.failed,
            landmark_mm: Spread::of(&f.landmark_m, 1e3),
            aligned_mm: Spread::of(&f.aligned_m, 1e3),
            scaled_mm: Spread::of(&f.scaled_m, 1e3),
            size_percent: Spread::of(&f.size_percent, 1.0),
            size_bias_percent: f.size_percent.iter().sum::<f64>() / sides,
            facing_deg: Spread::of(&f.facing_deg, 1.0),
            wall_mm: Spread::of(&f.wall_m, 1e3),
            loop_mm: Spread::of(&f.loop_m, 1e3),
            apart_mm: Spread::of(&f.apart_m, 1e3),
            mounting_deg: Spread::of(&f.mounting_deg, 1.0),
            mounting_mm: Spread::of(&f.mounting_m, 1e3),
            focal_percent: Spread::of(&f.focal_percent, 1.0),
            landmark_nees: trimmed_mean(&f.landmark_nees),
            wall_nees: trimmed_mean(&f.wall_nees),
            camera_nees: trimmed_mean(&f.camera_nees),
            wrong: f.wrong,
            wrong_kept: f.wrong_kept,
            right: f.right,
            right_lost: f.right_lost,
        }
    }

    fn line(&self) -> String {
        let spread =
            |s: Option<Spread>| s.map_or_else(|| "-".into(), |s| format!("{:.3}, {:.3}", s.median, s.p95));
        let whole =
            |s: Option<Spread>| s.map_or_else(|| "-".into(), |s| format!("{:.1}, {:.1}", s.median, s.p95));
        let mean = |m: Option<f64>| m.map_or_else(|| "-".into(), |m| format!("{m:.2}"));
        let mut line = format!(
            "  {:<4} {:<26} landmark {} mm; aligned {}; with scale {}; size {} %, mean {:+.2}; facing {} deg; wall {} mm; loop {} mm; mounting {} deg, {} mm; focal {} %; NEES {} {} {}",
            self.case,
            self.what,
            whole(self.landmark_mm),
            whole(self.aligned_mm),
            whole(self.scaled_mm),
            spread(self.size_percent),
            self.size_bias_percent,
            spread(self.facing_deg),
            whole(self.wall_mm),
            whole(self.loop_mm),
            spread(self.mounting_deg),
            whole(self.mounting_mm),
            spread(self.focal_percent),
            mean(self.landmark_nees),
            mean(self.wall_nees),
            mean(self.camera_nees),
        );
        if self.wrong + self.right > 0 {
            let (kept, wrong, lost, right) = (self.wrong_kept, self.wrong, self.right_lost, self.right);
            let more = format!("; wrong kept {kept} of {wrong}, right lost {lost} of {right}");
            line.push_str(&more);
        }
        if self.apart_mm.is_some() {
            let more = format!("; from both at once {} mm", whole(self.apart_mm));
            line.push_str(&more);
        }
        if self.failed > 0 {
            let more = format!("; {} not solved", self.failed);
            line.push_str(&more);
        }
        line
    }
}

fn trimmed_mean(values: &[f64]) -> Option<f64> {
    let mut all = values.to_vec();
    all.sort_by(f64::total_cmp);
    all.truncate(all.len() - (NEES_TAIL * all.len() as f64) as usize);
    (!all.is_empty()).then(|| all.iter().sum::<f64>() / all.len() as f64)
}

/// A figure with what is required of it.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Required {
    pub(super) what: String,
    pub(super) measured: f64,
    /// Least and most.
    pub(super) range: [f64; 2],
    pub(super) met: bool,
}

/// The report.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    pub(super) buildings: u32,
    pub(super) seed: u64,
    pub(super) rows: Vec<Row>,
    pub(super) required: Vec<Required>,
}

impl Report {
    pub(super) fn of(buildings: u32, seed: u64, rows: Vec<Row>) -> Self {
        let required = required(&rows);
        Self { buildings, seed, rows, required }
    }

    pub(super) fn lines(&self) -> Vec<String> {
        let title =
            format!("joint: {} buildings from seed {}; errors are median, 95 %", self.buildings, self.seed);
        let rows = self.rows.iter().map(Row::line);
        let required = self.required.iter().map(|r| {
            let [least, most] = r.range;
            let range = if least > 0.0 { format!("{least} to {most}") } else { format!("at most {most}") };
            format!("  {:<52} {:>9.3}   {range}{}", r.what, r.measured, if r.met { "" } else { "   NOT MET" })
        });
        std::iter::once(title).chain(rows).chain(std::iter::once("required".into())).chain(required).collect()
    }
}

/// One requirement: a case, a figure of its row, and its range.
type Requirement = (&'static str, &'static str, fn(&Row) -> Option<f64>, [f64; 2]);

fn requirements() -> Vec<Requirement> {
    let most = |limit: f64| [0.0, limit];
    let band = [0.8, 1.25];
    vec![
        ("d", "landmark median, mm", |r| Some(r.landmark_mm?.median), most(60.0)),
        ("d", "landmark 95 %, mm", |r| Some(r.landmark_mm?.p95), most(190.0)),
        ("d", "aligned median, mm", |r| Some(r.aligned_mm?.median), most(45.0)),
        ("d", "aligned 95 %, mm", |r| Some(r.aligned_mm?.p95), most(110.0)),
        ("e", "landmark median, mm", |r| Some(r.landmark_mm?.median), most(25.0)),
        ("e", "landmark 95 %, mm", |r| Some(r.landmark_mm?.p95), most(90.0)),
        ("e", "aligned median, mm", |r| Some(r.aligned_mm?.median), most(20.0)),
        ("e", "aligned 95 %, mm", |r| Some(r.aligned_mm?.p95), most(55.0)),
        ("d", "size 95 %, %", |r| Some(r.size_percent?.p95), most(2.5)),
        ("e", "size 95 %, %", |r| Some(r.size_percent?.p95), most(1.7)),
        ("d", "facing 95 %, deg", |r| Some(r.facing_deg?.p95), most(0.7)),
        ("e", "facing 95 %, deg", |r| Some(r.facing_deg?.p95), most(0.5)),
        ("d", "wall median, mm", |r| Some(r.wall_mm?.median), most(5.0)),
        ("d", "wall 95 %, mm", |r| Some(r.wall_mm?.p95), most(140.0)),
        ("e", "wall median, mm", |r| Some(r.wall_mm?.median), most(5.0)),
        ("e", "wall 95 %, mm", |r| Some(r.wall_mm?.p95), most(60.0)),
        ("d", "loop 95 %, mm", |r| Some(r.loop_mm?.p95), most(10.0)),
        ("d2", "loop 95 %, mm", |r| Some(r.loop_mm?.p95), most(100.0)),
        ("d", "mounting 95 %, deg", |r| Some(r.mounting_deg?.p95), most(0.05)),
        ("d", "mounting 95 %, mm", |r| Some(r.mounting_mm?.p95), most(10.0)),
        ("e", "mounting 95 %, deg", |r| Some(r.mounting_deg?.p95), most(0.035)),
        ("e", "mounting 95 %, mm", |r| Some(r.mounting_mm?.p95), most(5.0)),
        ("d1", "mounting 95 %, deg", |r| Some(r.mounting_deg?.p95), most(0.25)),
        ("d", "focal length 95 %, %", |r| Some(r.focal_percent?.p95), most(0.4)),
        ("e", "focal length 95 %, %", |r| Some(r.focal_percent?.p95), most(0.2)),
        ("d", "NEES of landmarks", |r| r.landmark_nees, band),
        ("d", "NEES of walls", |r| r.wall_nees, band),
        ("d", "NEES of the camera", |r| r.camera_nees, band),
        ("e", "NEES of landmarks", |r| r.landmark_nees, band),
        ("e", "NEES of walls", |r| r.wall_nees, band),
        ("e", "NEES of the camera", |r| r.camera_nees, band),
        ("k2", "landmark 95 %, mm", |r| Some(r.landmark_mm?.p95), most(400.0)),
        ("c3", "aligned median, mm", |r| Some(r.aligned_mm?.median), most(110.0)),
        ("c3", "aligned 95 %, mm", |r| Some(r.aligned_mm?.p95), most(260.0)),
        ("c4", "landmark median, mm", |r| Some(r.landmark_mm?.median), most(80.0)),
        ("c4", "landmark 95 %, mm", |r| Some(r.landmark_mm?.p95), most(220.0)),
        ("f", "from both drives at once 95 %, mm", |r| Some(r.apart_mm?.p95), most(6.0)),
        ("f", "NEES of landmarks", |r| r.landmark_nees, band),
        ("w02", "wrong kept", wrong_kept, most(0.0)),
        ("w10", "wrong kept", wrong_kept, most(0.0)),
        ("w30", "wrong kept", wrong_kept, most(0.0)),
        ("v02", "wrong kept", wrong_kept, most(0.0)),
        ("v10", "wrong kept", wrong_kept, most(0.0)),
        ("v30", "wrong kept", wrong_kept, most(0.0)),
        ("w02", "right lost, %", right_lost, most(1.0)),
        ("w10", "right lost, %", right_lost, most(2.0)),
        ("w30", "right lost, %", right_lost, most(5.0)),
        ("v02", "right lost, %", right_lost, most(1.0)),
        ("v10", "right lost, %", right_lost, most(2.0)),
        ("v30", "right lost, %", right_lost, most(5.0)),
    ]
}

fn wrong_kept(row: &Row) -> Option<f64> {
    (row.wrong > 0).then_some(row.wrong_kept as f64)
}

fn right_lost(row: &Row) -> Option<f64> {
    (row.right > 0).then(|| 100.0 * row.right_lost as f64 / row.right as f64)
}

fn required(rows: &[Row]) -> Vec<Required> {
    let of = |case: &str| rows.iter().find(|row| row.case == case);
    let checked = |what: String, measured: f64, range: [f64; 2]| {
        let met = (range[0]..=range[1]).contains(&measured);
        Required { what, measured, range, met }
    };
    let mut all: Vec<Required> = requirements()
        .into_iter()
        .filter_map(|(case, what, figure, range)| {
            let row = of(case)?;
            Some(checked(format!("{}: {what}", row.what), figure(row)?, range))
        })
        .collect();
    // Shares of what two steps reach on the same drives.
    let ratio = |joint: &str, steps: &str, figure: fn(&Row) -> Option<Spread>, share: fn(Spread) -> f64| {
        Some(share(figure(of(joint)?)?) / share(figure(of(steps)?)?))
    };
    if let Some(share) = ratio("d", "a", |r| r.aligned_mm, |s| s.median) {
        all.push(checked("one drive: aligned median, of two steps".into(), share, [0.0, 0.7]));
    }
    if let Some(share) = ratio("k2", "k", |r| r.landmark_mm, |s| s.p95) {
        all.push(checked("bare corridor: landmark 95 %, of two steps".into(), share, [0.0, 0.5]));
    }
    all
}
