//! `waymark-lab evaluate viewpoint`, `scale`, `illumination` and `occlusion` (E5 to E8, the paper's
//! Figs. 12 and 13): recognition over one condition that is changed step by step.

use super::{
    Common, Setting, curves,
    lesson::Class,
    pictures,
    sweep::{Axis, sweep},
};
use sim::exhibit::{Conditions, Shadow};
use std::f64::consts::TAU;
use vision::params::Params;

/// Apparent sizes from four times the icon's 75 px down to less than half of it.
const SIZES_PX: [f64; 21] = [
    300.0, 240.0, 200.0, 160.0, 130.0, 110.0, 95.0, 85.0, 75.0, 68.0, 62.0, 57.0, 53.0, 50.0, 48.0, 45.0,
    42.0, 39.0, 36.0, 32.0, 28.0,
];
/// How far from the middle a shadow's edge may run, in sides of the landmark.
const SHADOW_OFFSET: f64 = 0.3;

/// Arguments of every condition.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Landmarks in the map; views are of all of them.
    #[arg(long, default_value_t = 25, value_parser = clap::value_parser!(u32).range(2..=1000))]
    landmarks: u32,
    /// Views of each landmark at each value.
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=1000))]
    views: u32,
    #[command(flatten)]
    common: Common,
}

/// Arguments of the view angle.
#[derive(Debug, clap::Args)]
pub(crate) struct ViewpointArgs {
    #[command(flatten)]
    args: Args,
    /// Side of the landmark (square root of its area) as it would appear from the front at the same
    /// distance. At 300 a poster of 5 : 7 at 80 degrees is 44 px wide.
    #[arg(long, value_name = "PX", default_value_t = 300, value_parser = clap::value_parser!(u32).range(20..=400))]
    size_px: u32,
}

pub(crate) fn viewpoint(args: &ViewpointArgs) -> anyhow::Result<()> {
    let angle = axis("view angle, degrees", steps(18, 5.0), |c, degrees, random| {
        c.yaw_rad = degrees.to_radians() * if random.unit() < 0.5 { -1.0 } else { 1.0 };
    });
    run("viewpoint", &args.args, f64::from(args.size_px), &[angle])
}

pub(crate) fn scale(args: &Args) -> anyhow::Result<()> {
    let size = axis("apparent side, px", SIZES_PX.to_vec(), |c, px, random| {
        c.size_px = px;
        // Nearly from the front, so that only the size varies much.
        c.yaw_rad = random.range(-0.3, 0.3);
    });
    run("scale", args, 0.0, &[size])
}

pub(crate) fn illumination(args: &Args) -> anyhow::Result<()> {
    let gain: Set = |c, gain, _| (c.sensor.exposure, c.sensor.offset) = (gain, 0.0);
    let losses = steps(10, 0.1).into_iter().chain([0.95]).collect();
    let axes = [
        axis("gain, darker", vec![1.0, 0.8, 0.6, 0.5, 0.4, 0.3, 0.2, 0.15, 0.1], gain),
        axis("gain, brighter", vec![1.0, 1.25, 1.5, 1.75, 2.0, 2.25, 2.5, 3.0], gain),
        axis("offset, grey levels", steps(8, 20.0), |c, offset, _| {
            (c.sensor.exposure, c.sensor.offset) = (1.0, offset);
        }),
        axis("light lost towards one side", losses, |c, loss, random| {
            (c.side_light, c.side_light_rad) = (loss, random.range(0.0, TAU));
        }),
        axis("light taken by a shadow across", steps(10, 0.1), |c, depth, random| {
            c.shadow = Some(Shadow {
                depth,
                direction_rad: random.range(0.0, TAU),
                offset: random.range(-SHADOW_OFFSET, SHADOW_OFFSET),
            });
        }),
    ];
    run("illumination", args, 0.0, &axes)
}

pub(crate) fn occlusion(args: &Args) -> anyhow::Result<()> {
    let cover = axis("hidden in the middle, %", steps(17, 5.0), |c, percent, _| c.cover = 0.01 * percent);
    run("occlusion", args, 0.0, &[cover])
}

type Set = fn(&mut Conditions, f64, &mut vision::random::Random);

fn axis(name: &'static str, values: Vec<f64>, set: Set) -> Axis {
    Axis { name, values, set }
}

/// `count` values from 0 on.
fn steps(count: u32, step: f64) -> Vec<f64> {
    (0..count).map(|i| step * f64::from(i)).collect()
}

/// Sweeps every axis. Where `size_px` is 0, each view draws its own size.
fn run(experiment: &'static str, args: &Args, size_px: f64, axes: &[Axis]) -> anyhow::Result<()> {
    let p = args.common.preset.params();
    let class = class(&args.common, args.landmarks, &p)?;
    let base = Conditions { size_px, ..Conditions::default() };
    let curves: Vec<_> =
        axes.iter().map(|axis| sweep(&class, axis, &base, args.views, &args.common, &p)).collect();
    let setting = Setting::new(experiment, &args.common, &class, &p);
    curves::show(&setting, &curves, args.common.json, args.common.plot.as_deref())
}

/// A map of `landmarks` landmarks, up to half of them photographs.
fn class(common: &Common, landmarks: u32, p: &Params) -> anyhow::Result<Class> {
    let photographs = pictures::photographs(&common.photographs, common.part)?;
    let pictures = pictures::mixed(&photographs, 0.5, landmarks as usize, |i| {
        pictures::generated(common.part, common.seed, i)
    });
    let class = Class::new(pictures, common.taught, common.seed, p)?.deciding_by(common.preset);
    anyhow::ensure!(!class.models.is_empty(), "no landmark passed its gates");
    Ok(class)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        args: Args,
    }

    #[test]
    fn a_small_run_repeats_and_frontal_views_are_better_than_oblique_ones() {
        let args = Line::parse_from(["x", "--set=tune", "--landmarks=4", "--views=2"]).args;
        let p = Params::default();
        let run = |seed: u64| {
            let common = Common { seed, ..args.common.clone() };
            let class = class(&common, args.landmarks, &p).unwrap();
            let angle = Axis {
                name: "angle",
                values: vec![0.0, 87.0],
                set: |c, degrees, _| c.yaw_rad = degrees.to_radians(),
            };
            let base = Conditions { size_px: 200.0, ..Conditions::default() };
            sweep(&class, &angle, &base, args.views, &common, &p)
        };
        let text = |seed| serde_json::to_string(&run(seed)).unwrap();
        assert_eq!(text(3), text(3));
        assert_ne!(text(3), text(4));
        let curve = run(3);
        assert!(curve.points[0].views >= 4 && curve.points[0].right > 0.7, "{:?}", curve.points[0]);
        assert!(curve.points[1].right < 0.3 && curve.half.at < 87.0, "{:?}", curve.points[1]);
        assert!(
            Line::try_parse_from(["x", "--views=0"]).is_err()
                && Line::try_parse_from(["x", "--corner-noise-px=-1"]).is_err()
        );
    }
}
