//! `waymark-lab evaluate scale` (E5, the paper's Fig. 12 left): recognition over the apparent size of a landmark.

use super::{
    Common, Setting, curves,
    sweep::{Axis, sweep},
    viewpoint::class,
};
use sim::exhibit::Conditions;
use vision::params::Params;

/// Apparent sizes from four times the icon's 75 px down to less than half of it.
const SIZES_PX: [f64; 21] = [
    300.0, 240.0, 200.0, 160.0, 130.0, 110.0, 95.0, 85.0, 75.0, 68.0, 62.0, 57.0, 53.0, 50.0, 48.0, 45.0,
    42.0, 39.0, 36.0, 32.0, 28.0,
];

/// `waymark-lab evaluate scale`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Landmarks in the map; views are of all of them.
    #[arg(long, default_value_t = 25, value_parser = clap::value_parser!(u32).range(2..=1000))]
    landmarks: u32,
    /// Views of each landmark at each size.
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=1000))]
    views: u32,
    #[command(flatten)]
    common: Common,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let p = Params::default();
    let class = class(&args.common, args.landmarks, &p)?;
    let size = Axis {
        name: "apparent side, px",
        values: SIZES_PX.to_vec(),
        set: |c, px, random| {
            c.size_px = px;
            // Nearly from the front, so that only the size varies much.
            c.yaw_rad = random.range(-0.3, 0.3);
        },
    };
    let base = Conditions { size_px: 0.0, ..Conditions::default() };
    let curve = sweep(&class, &size, &base, args.views, &args.common, &p);
    let setting = Setting::new("scale", &args.common, &class, &p);
    curves::show(&setting, &[curve], args.common.json, args.common.plot.as_deref())
}
