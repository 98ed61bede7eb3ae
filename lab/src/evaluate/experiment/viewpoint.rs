//! `waymark-lab evaluate viewpoint` (E6, the paper's Fig. 12 right): recognition over the view angle of a landmark.

use super::{
    Common, Setting, curves,
    lesson::Class,
    pictures,
    sweep::{Axis, sweep},
};
use sim::exhibit::Conditions;
use vision::params::Params;

/// `waymark-lab evaluate viewpoint`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Landmarks in the map; views are of all of them.
    #[arg(long, default_value_t = 25, value_parser = clap::value_parser!(u32).range(2..=1000))]
    landmarks: u32,
    /// Views of each landmark at each angle.
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=1000))]
    views: u32,
    /// Side of the landmark (square root of its area) as it would appear from the front at the same distance. At
    /// 300 a poster of 5 : 7 at 80 degrees is 44 px wide.
    #[arg(long, value_name = "PX", default_value_t = 300, value_parser = clap::value_parser!(u32).range(20..=400))]
    size_px: u32,
    #[command(flatten)]
    common: Common,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let p = Params::default();
    let class = class(&args.common, args.landmarks, &p)?;
    let angle = Axis {
        name: "view angle, degrees",
        values: (0..=17).map(|i| 5.0 * f64::from(i)).collect(),
        set: |c, degrees, random| {
            c.yaw_rad = degrees.to_radians() * if random.unit() < 0.5 { -1.0 } else { 1.0 };
        },
    };
    let base = Conditions { size_px: f64::from(args.size_px), ..Conditions::default() };
    let curve = sweep(&class, &angle, &base, args.views, &args.common, &p);
    let setting = Setting::new("viewpoint", &args.common, &class, &p);
    curves::show(&setting, &[curve], args.common.json, args.common.plot.as_deref())
}

/// A map of `landmarks` landmarks, up to half of them photographs.
pub(crate) fn class(common: &Common, landmarks: u32, p: &Params) -> anyhow::Result<Class> {
    let photographs = pictures::photographs(&common.photographs, common.part)?;
    let pictures = pictures::mixed(&photographs, 0.5, landmarks as usize, |i| {
        pictures::generated(common.part, common.seed, i)
    });
    let class = Class::new(pictures, common.taught, common.seed, p)?;
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
