//! `waymark-lab evaluate placement`: landmarks placed on walls and ceilings from views of known
//! robot poses, compared with the truth (method 11): generated rooms with corners of known noise,
//! the rendered corridor with detected corners, and objects that hang on no wall.

mod rendered;
mod rooms;

use super::{
    experiment::say,
    statistics::{Interval, median, quantile, wilson},
};
use map::place::LandmarkPlace;
use nalgebra::Vector6;
use serde::Serialize;

/// `waymark-lab evaluate placement`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Generated rooms.
    #[arg(long, default_value_t = 250, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    rooms: u32,
    /// Views of each landmark that are fused.
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(2..=64))]
    views: u32,
    /// Rendered corridors with posters and lamps in which the detector finds the corners; 0 for
    /// none.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(0..=1_000))]
    corridors: u32,
    /// Seed of all that is drawn.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print one JSON object instead of tables.
    #[arg(long)]
    json: bool,
}

/// One place against the truth.
#[derive(Debug, Clone)]
struct Outcome {
    /// x, y, theta, z, width, height.
    error: Vector6<f64>,
    sigma: Vector6<f64>,
    nees: f64,
}

impl Outcome {
    fn of(made: &LandmarkPlace, truth: &LandmarkPlace) -> Self {
        let mut turn = made.theta_rad - truth.theta_rad;
        turn = turn.sin().atan2(turn.cos());
        let error = Vector6::new(
            made.x_m - truth.x_m,
            made.y_m - truth.y_m,
            turn,
            made.z_m - truth.z_m,
            made.size.width_m - truth.size.width_m,
            made.size.height_m - truth.size.height_m,
        );
        let nees = made.covariance.cholesky().map_or(f64::NAN, |c| error.dot(&c.solve(&error)));
        Self { error, sigma: made.covariance.diagonal().map(f64::sqrt), nees }
    }

    /// Every number within three standard deviations, or within a micrometre if it has none.
    fn is_within_three_sigma(&self) -> bool {
        (0..6).all(|k| self.error[k].abs() <= 3.0 * self.sigma[k] + 1e-6)
    }
}

/// Places of one kind against the truth.
#[derive(Debug, Clone, Serialize)]
struct Summary {
    what: String,
    placed: usize,
    /// Not placed, by reason.
    refused: usize,
    /// Error of the centre: median and 95 %, metres.
    median_m: f64,
    p95_m: f64,
    /// Error of width and height together: median, metres.
    size_median_m: f64,
    /// Of the single numbers (x, y, theta, z, width, height), within three standard deviations.
    within_3_sigma: f64,
    within_3_sigma_interval: Interval,
    /// Of the places, with all six within.
    all_within_3_sigma: f64,
    /// Mean squared Mahalanobis distance, 6 degrees of freedom; several views are inflated by 2.
    nees: f64,
}

impl Summary {
    fn of(what: impl Into<String>, outcomes: &[Outcome], refused: usize) -> Self {
        let mut metres: Vec<f64> =
            outcomes.iter().map(|o| o.error[0].hypot(o.error[1]).hypot(o.error[3])).collect();
        let mut sizes: Vec<f64> = outcomes.iter().map(|o| o.error[4].hypot(o.error[5])).collect();
        let n = outcomes.len();
        let within = |o: &Outcome| (0..6).filter(|&k| o.error[k].abs() <= 3.0 * o.sigma[k] + 1e-6).count();
        let inside: usize = outcomes.iter().map(within).sum();
        let whole = outcomes.iter().filter(|o| o.is_within_three_sigma()).count();
        Self {
            what: what.into(),
            placed: n,
            refused,
            median_m: median(&mut metres).unwrap_or(f64::NAN),
            p95_m: quantile(&mut metres, 0.95).unwrap_or(f64::NAN),
            size_median_m: median(&mut sizes).unwrap_or(f64::NAN),
            within_3_sigma: inside as f64 / (6 * n).max(1) as f64,
            within_3_sigma_interval: wilson(inside, 6 * n),
            all_within_3_sigma: whole as f64 / n.max(1) as f64,
            nees: outcomes.iter().map(|o| o.nees).sum::<f64>() / n.max(1) as f64,
        }
    }

    fn line(&self) -> String {
        format!(
            "  {:<34} {:>5} placed, {:>4} refused; centre median {:.3} m, 95 % {:.3}; size median {:.3} m; within 3 sigma {:.4} ({:.4}-{:.4}) of the numbers, {:.4} of the places; NEES {:.2} of 6",
            self.what,
            self.placed,
            self.refused,
            self.median_m,
            self.p95_m,
            self.size_median_m,
            self.within_3_sigma,
            self.within_3_sigma_interval.0,
            self.within_3_sigma_interval.1,
            self.all_within_3_sigma,
            self.nees
        )
    }
}

/// Objects that hang on no wall.
#[derive(Debug, Clone, Serialize)]
struct Strays {
    what: String,
    shown: usize,
    /// Refused by the residual; the others were placed on the wall behind.
    refused: usize,
    /// Of the refusals as "not on this wall": median residual, metres, and median roll, degrees.
    rms_m: f64,
    roll_deg: f64,
}

#[derive(Debug, Serialize)]
struct Report {
    seed: u64,
    summaries: Vec<Summary>,
    strays: Vec<Strays>,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let (mut summaries, strays) = rooms::evaluated(args.rooms as usize, args.views as usize, args.seed);
    if args.corridors > 0 {
        summaries.extend(rendered::evaluated(args.corridors as usize, args.views as usize, args.seed));
    }
    let report = Report { seed: args.seed, summaries, strays };
    say(args.json, &report, || {
        let mut lines = vec![format!("placement: seed {}", report.seed)];
        lines.extend(report.summaries.iter().map(Summary::line));
        lines.extend(report.strays.iter().map(|s| {
            format!(
                "  not on the wall: {:<27} {} of {} refused; residual {:.3} m, roll {:.1} deg (medians of the refusals)",
                s.what, s.refused, s.shown, s.rms_m, s.roll_deg
            )
        }));
        lines
    })
}
