//! The figures of the demo's drives.

use super::{drive::Record, teaching::Taught};
use serde::Serialize;

/// Figures of one demo.
#[derive(Debug, Serialize)]
pub(super) struct Summary {
    landmarks: usize,
    landmarks_active: usize,
    views: usize,
    robots: usize,
    frames: usize,
    answers: usize,
    /// Quads of taught landmarks, wholly in view with each side at least 30 px.
    landmark_views: usize,
    recognitions: usize,
    pub(super) false_matches: usize,
    /// Quads that the pose named where the picture alone did not, and those of them that are not
    /// that landmark.
    guided: usize,
    pub(super) false_guided: usize,
    corrections: u64,
    /// Distance from the true position after each robot's first fix.
    position_error_m: Option<Spread>,
    /// The same moments, by odometry alone.
    odometry_error_m: Option<Spread>,
    /// Receipt to answer.
    latency_ms: Option<Spread>,
}

/// How a figure is spread.
#[derive(Debug, Clone, Copy, Serialize)]
pub(super) struct Spread {
    median: f64,
    p95: f64,
    max: f64,
}

impl Spread {
    /// `None` of nothing.
    pub(super) fn of(values: &[f64]) -> Option<Self> {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let at = |q: f64| sorted.get(((sorted.len() as f64 - 1.0) * q).round() as usize).copied();
        Some(Self { median: at(0.5)?, p95: at(0.95)?, max: *sorted.last()? })
    }
}

/// Adds up what the drives recorded.
pub(super) fn summarise(taught: &Taught, record: &Record) -> Summary {
    Summary {
        landmarks: taught.landmarks,
        landmarks_active: taught.active,
        views: taught.views,
        robots: record.robots,
        frames: record.frames,
        answers: record.answers,
        landmark_views: record.landmark_views,
        recognitions: record.recognitions,
        false_matches: record.false_matches,
        guided: record.guided,
        false_guided: record.false_guided,
        corrections: record.corrections,
        position_error_m: Spread::of(&record.position_errors_m),
        odometry_error_m: Spread::of(&record.odometry_errors_m),
        latency_ms: Spread::of(&record.latencies_ms),
    }
}

impl Summary {
    /// The figures for a person.
    pub(super) fn table(&self) -> String {
        let spread = |s: Option<Spread>, unit: &str, digits: usize| {
            s.map_or("none".to_owned(), |s| {
                format!(
                    "median {:.digits$} {unit}, 95 % {:.digits$} {unit}, worst {:.digits$} {unit}",
                    s.median, s.p95, s.max
                )
            })
        };
        [
            format!("frames            {} of {} robots, {} answered", self.frames, self.robots, self.answers),
            format!(
                "recognitions      {} of {} full views of taught landmarks",
                self.recognitions, self.landmark_views
            ),
            format!("false matches     {}", self.false_matches),
            format!("named by pose     {}, {} of them falsely", self.guided, self.false_guided),
            format!("corrections       {}", self.corrections),
            format!("position error    {}", spread(self.position_error_m, "m", 3)),
            format!("odometry alone    {}", spread(self.odometry_error_m, "m", 3)),
            format!("receipt to answer {}", spread(self.latency_ms, "ms", 1)),
        ]
        .join("\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_pose_named_is_told_apart_from_recognitions() {
        let mut record = Record::default();
        for (is_guided, is_true) in [(false, true), (false, true), (true, true), (true, true), (true, false)]
        {
            record.count(is_guided, is_true);
        }
        let summary = summarise(&Taught::default(), &record);
        let table = summary.table();
        assert!(
            table.contains("recognitions      2 of") && table.contains("false matches     0\n"),
            "{table}"
        );
        assert!(table.contains("named by pose     3, 1 of them falsely\n"), "{table}");
        let json = serde_json::to_value(&summary).unwrap();
        assert_eq!((&json["guided"], &json["false_guided"]), (&3.into(), &1.into()));
    }

    #[test]
    fn spread_of_a_hundred_numbers() {
        let values: Vec<f64> = (0..=100).rev().map(f64::from).collect();
        let spread = Spread::of(&values).unwrap();
        assert!((spread.median - 50.0).abs() < 1e-12 && (spread.p95 - 95.0).abs() < 1e-12);
        assert!((spread.max - 100.0).abs() < 1e-12);
        assert!(Spread::of(&[]).is_none());
    }
}
