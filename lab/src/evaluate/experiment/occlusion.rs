//! `waymark-lab evaluate occlusion` (E8, the paper's Fig. 13 right): recognition over the share of a landmark that
//! is hidden in its middle.

use super::{
    Common, Setting, curves,
    sweep::{Axis, sweep},
    viewpoint::class,
};
use sim::exhibit::Conditions;
use vision::params::Params;

/// `waymark-lab evaluate occlusion`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Landmarks in the map; views are of all of them.
    #[arg(long, default_value_t = 25, value_parser = clap::value_parser!(u32).range(2..=1000))]
    landmarks: u32,
    /// Views of each landmark at each share.
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=1000))]
    views: u32,
    #[command(flatten)]
    common: Common,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let p = Params::default();
    let class = class(&args.common, args.landmarks, &p)?;
    let cover = Axis {
        name: "hidden in the middle, %",
        values: (0..=16).map(|i| 5.0 * f64::from(i)).collect(),
        set: |c, percent, _| c.cover = 0.01 * percent,
    };
    let base = Conditions { size_px: 0.0, ..Conditions::default() };
    let curve = sweep(&class, &cover, &base, args.views, &args.common, &p);
    let setting = Setting::new("occlusion", &args.common, &class, &p);
    curves::show(&setting, &[curve], args.common.json, args.common.plot.as_deref())
}
