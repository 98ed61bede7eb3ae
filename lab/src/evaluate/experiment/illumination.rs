//! `waymark-lab evaluate illumination` (E7, the paper's Fig. 13 left): too dark, too bright, light from the side,
//! shadows.

use super::{
    Common, Setting, curves,
    sweep::{Axis, sweep},
    viewpoint::class,
};
use sim::exhibit::{Conditions, Shadow};
use std::f64::consts::TAU;
use vision::params::Params;

/// How far from the middle a shadow's edge may run, in sides of the landmark.
const SHADOW_OFFSET: f64 = 0.3;

/// `waymark-lab evaluate illumination`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Landmarks in the map; views are of all of them.
    #[arg(long, default_value_t = 25, value_parser = clap::value_parser!(u32).range(2..=1000))]
    landmarks: u32,
    /// Views of each landmark at each value of each condition.
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=1000))]
    views: u32,
    #[command(flatten)]
    common: Common,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let p = Params::default();
    let class = class(&args.common, args.landmarks, &p)?;
    let base = Conditions { size_px: 0.0, ..Conditions::default() };
    let curves: Vec<_> =
        axes().iter().map(|axis| sweep(&class, axis, &base, args.views, &args.common, &p)).collect();
    let setting = Setting::new("illumination", &args.common, &class, &p);
    curves::show(&setting, &curves, args.common.json, args.common.plot.as_deref())
}

fn axes() -> [Axis; 5] {
    [
        Axis {
            name: "gain, darker",
            values: vec![1.0, 0.8, 0.6, 0.5, 0.4, 0.3, 0.2, 0.15, 0.1],
            set: |c, gain, _| (c.sensor.exposure, c.sensor.offset) = (gain, 0.0),
        },
        Axis {
            name: "gain, brighter",
            values: vec![1.0, 1.25, 1.5, 1.75, 2.0, 2.25, 2.5, 3.0],
            set: |c, gain, _| (c.sensor.exposure, c.sensor.offset) = (gain, 0.0),
        },
        Axis {
            name: "offset, grey levels",
            values: (0..=7).map(|i| 20.0 * f64::from(i)).collect(),
            set: |c, offset, _| (c.sensor.exposure, c.sensor.offset) = (1.0, offset),
        },
        Axis {
            name: "light lost towards one side",
            values: (0..=9).map(|i| 0.1 * f64::from(i)).chain([0.95]).collect(),
            set: |c, loss, random| {
                (c.side_light, c.side_light_rad) = (loss, random.range(0.0, TAU));
            },
        },
        Axis {
            name: "light taken by a shadow across",
            values: (0..=9).map(|i| 0.1 * f64::from(i)).collect(),
            set: |c, depth, random| {
                c.shadow = Some(Shadow {
                    depth,
                    direction_rad: random.range(0.0, TAU),
                    offset: random.range(-SHADOW_OFFSET, SHADOW_OFFSET),
                });
            },
        },
    ]
}
