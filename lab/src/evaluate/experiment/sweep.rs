//! D/tau over one condition that is changed step by step while all others vary as on a robot, and
//! where it crosses
//! 1. Views in, a curve with intervals out; `curves` prints and plots it.

use super::{
    Common,
    lesson::{Class, noisy},
    mixed, of_each,
    view_outcome::{Outcome, ViewFigures, score_view},
};
use crate::evaluate::statistics::{Interval, bootstrap, quantile, wilson};
use serde::Serialize;
use sim::exhibit::{Conditions, Extent, exhibit};
use std::collections::BTreeMap;
use vision::{params::Params, random::Random};

/// Names of the ratios, in the order of [`ViewFigures::ratios`].
pub(crate) const RATIOS: [&str; 3] = ["H^r/tau", "C^r/tau", "decision"];
/// Most draws for one view.
const TRIES: u64 = 10;

/// A condition and the values it takes, the easiest first.
pub(crate) struct Axis {
    pub(crate) name: &'static str,
    pub(crate) values: Vec<f64>,
    /// Sets the condition; `random` draws what goes with it (side, position).
    pub(crate) set: fn(&mut Conditions, f64, &mut Random),
}

/// All views at one value.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Point {
    pub(crate) value: f64,
    pub(crate) views: usize,
    /// Median and 90 % quantile of D/tau, by distance; `None`: infinite.
    pub(crate) median: [Option<f64>; 3],
    pub(crate) ninety: [Option<f64>; 3],
    /// Share below 1, by distance.
    pub(crate) below: [f64; 3],
    /// Rightly recognised by the whole decision.
    pub(crate) right: f64,
    pub(crate) right_interval: Interval,
    /// Views by outcome.
    pub(crate) outcomes: BTreeMap<&'static str, usize>,
}

/// Value at which a curve crosses a level, with a 95 % interval over landmarks; at most the last
/// value.
#[derive(Debug, Clone, Copy, Serialize)]
pub(crate) struct Crossing {
    pub(crate) at: f64,
    pub(crate) interval: Option<Interval>,
    /// The curve does not cross up to the last value.
    pub(crate) beyond: bool,
}

/// A whole sweep.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Curve {
    pub(crate) name: &'static str,
    pub(crate) points: Vec<Point>,
    /// Where the median of D/tau crosses 1, by distance.
    pub(crate) crossings: [Crossing; 3],
    /// Where fewer than half of the views are rightly recognised, and fewer than 95 %.
    pub(crate) half: Crossing,
    pub(crate) most: Crossing,
    pub(crate) wrong: usize,
    pub(crate) views: usize,
}

/// Views of one landmark, by value.
type Views = Vec<Vec<ViewFigures>>;

/// Recognises every landmark in `views` views at every value.
pub(crate) fn sweep(
    class: &Class,
    axis: &Axis,
    base: &Conditions,
    views: u32,
    common: &Common,
    p: &Params,
) -> Curve {
    let landmarks: Vec<_> = class.active().collect();
    let by_landmark = of_each(&landmarks, axis.name, |_, (id, picture)| {
        let at = |value: usize| {
            let one = |view: u32| {
                let draw = |n: u64| mixed(&[common.seed, 2, id.0, value as u64, u64::from(view), n]);
                (0..TRIES).find_map(|n| {
                    let (noise, mut random) = (draw(2 * n), Random::new(draw(2 * n + 1)));
                    let mut conditions = Conditions::realistic(noise);
                    if base.size_px > 0.0 {
                        conditions.size_px = base.size_px;
                    }
                    (axis.set)(&mut conditions, axis.values[value], &mut random);
                    if n + 1 == TRIES {
                        conditions.aim_px = [0.0; 2];
                    }
                    let extent = if common.detector { Extent::Whole } else { Extent::Around };
                    let rendered = exhibit(&picture.texture, &class.wall, &conditions, extent, noise)?;
                    let corners = noisy(&rendered.corners, common.corner_noise_px, &mut random)?;
                    Some(score_view(class, *id, &rendered, (!common.detector).then_some(&corners), p))
                })
            };
            (0..views).filter_map(one).collect::<Vec<ViewFigures>>()
        };
        (0..axis.values.len()).map(at).collect::<Vec<_>>()
    });
    Curve::new(axis.name, &axis.values, &by_landmark)
}

impl Curve {
    fn new(name: &'static str, values: &[f64], by_landmark: &[Views]) -> Self {
        let all: Vec<&Views> = by_landmark.iter().collect();
        let points: Vec<Point> = (0..values.len()).map(|i| point(values[i], &at(&all, i))).collect();
        let crossing = |of: &dyn Fn(&[&Views], usize) -> f64, level: f64| {
            let found = |landmarks: &[&Views]| {
                let heights: Vec<f64> = (0..values.len()).map(|i| of(landmarks, i)).collect();
                cross(values, &heights, level)
            };
            let last = values.last().copied().unwrap_or(f64::NAN);
            let here = found(&all);
            Crossing {
                at: here.unwrap_or(last),
                interval: bootstrap(by_landmark, |drawn| Some(found(drawn).unwrap_or(last))),
                beyond: here.is_none(),
            }
        };
        let median = |d: usize| move |l: &[&Views], i: usize| middle(&at(l, i), d, 0.5);
        let missed = |l: &[&Views], i: usize| 1.0 - right(&at(l, i));
        let crossings = [0, 1, 2].map(|d| crossing(&median(d), 1.0));
        let (half, most) = (crossing(&missed, 0.5), crossing(&missed, 0.05));
        let all_views = || by_landmark.iter().flatten().flatten();
        let wrong = all_views().filter(|l| l.outcome == Outcome::Wrong).count();
        let views = all_views().count();
        Self { name, points, crossings, half, most, wrong, views }
    }
}

fn at<'a>(landmarks: &[&'a Views], value: usize) -> Vec<&'a ViewFigures> {
    landmarks.iter().filter_map(|l| l.get(value)).flatten().collect()
}

fn middle(views: &[&ViewFigures], distance: usize, share: f64) -> f64 {
    let mut ratios: Vec<f64> = views.iter().map(|l| l.ratios[distance]).collect();
    quantile(&mut ratios, share).unwrap_or(f64::INFINITY)
}

fn right(views: &[&ViewFigures]) -> f64 {
    views.iter().filter(|l| l.outcome == Outcome::Right).count() as f64 / views.len().max(1) as f64
}

fn point(value: f64, views: &[&ViewFigures]) -> Point {
    let finite = |share: f64| [0, 1, 2].map(|d| Some(middle(views, d, share)).filter(|x| x.is_finite()));
    let below =
        |d: usize| views.iter().filter(|l| l.ratios[d] < 1.0).count() as f64 / views.len().max(1) as f64;
    let hits = views.iter().filter(|l| l.outcome == Outcome::Right).count();
    let mut outcomes = BTreeMap::new();
    for view in views {
        *outcomes.entry(view.outcome.name()).or_insert(0) += 1;
    }
    Point {
        value,
        views: views.len(),
        median: finite(0.5),
        ninety: finite(0.9),
        below: [0, 1, 2].map(below),
        right: right(views),
        right_interval: wilson(hits, views.len()),
        outcomes,
    }
}

/// Value at which `heights` first reach `level`, linear between two values, half way from an
/// infinite height; `None` if they never do.
pub(crate) fn cross(values: &[f64], heights: &[f64], level: f64) -> Option<f64> {
    let first = heights.iter().position(|h| *h >= level || h.is_nan())?;
    let Some(before) = first.checked_sub(1) else { return values.first().copied() };
    let (low, high) = (heights[before], heights[first]);
    let share = if high.is_finite() { (level - low) / (high - low) } else { 0.5 };
    Some(values[before] + share * (values[first] - values[before]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn views(ratio: f64, outcome: Outcome, count: usize) -> Vec<ViewFigures> {
        vec![ViewFigures { ratios: [ratio, 0.5 * ratio, ratio], outcome }; count]
    }

    #[test]
    fn crossings_by_hand() {
        let values = [0.0, 10.0, 20.0, 30.0];
        assert_eq!(cross(&values, &[0.2, 0.6, 1.4, 0.5], 1.0), Some(15.0));
        assert_eq!(cross(&values, &[0.2, 0.6, 0.7, 0.9], 1.0), None);
        assert_eq!(cross(&values, &[1.0, 0.6, 0.7, 0.9], 1.0), Some(0.0));
        assert_eq!(cross(&values, &[0.0, 0.5, f64::INFINITY, 0.9], 1.0), Some(15.0));
        assert_eq!(cross(&[240.0, 40.0], &[0.5, 1.5], 1.0), Some(140.0));
    }

    #[test]
    fn a_curve_sums_up_its_views() {
        let landmark = || vec![views(0.5, Outcome::Right, 4), views(1.5, Outcome::Similarity, 4)];
        let curve = Curve::new("x", &[0.0, 1.0], &[landmark(), landmark()]);
        assert!((curve.crossings[0].at - 0.5).abs() < 1e-12 && !curve.crossings[0].beyond);
        assert!(curve.crossings[1].beyond && (curve.crossings[1].at - 1.0).abs() < 1e-12);
        assert!((curve.half.at - 0.5).abs() < 1e-12 && (curve.most.at - 0.05).abs() < 1e-12);
        assert_eq!((curve.points[1].outcomes["similarity"], curve.wrong, curve.views), (8, 0, 16));
        assert_eq!(curve.points[0].right_interval, wilson(8, 8));
        let Interval(low, high) = curve.crossings[0].interval.unwrap();
        assert!((low - 0.5).abs() < 1e-12 && (high - 0.5).abs() < 1e-12, "two equal landmarks");
    }
}
