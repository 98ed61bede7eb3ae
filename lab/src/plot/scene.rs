//! The rendered scene that a stage of the detector is drawn on, or a picture of one's own.

use super::Target;
use anyhow::Context as _;
use cli::pictures;
use nalgebra::Vector3;
use sim::{
    building::Building,
    camera::Camera,
    render::Renderer,
    scenes::{Scenes, ScenesParams},
    sensor::SensorParams,
    views::{Views, ViewsParams},
};
use std::path::PathBuf;
use vision::{
    detect::{
        DetectParams,
        pyramid::{reduce, working_factor},
    },
    frame::GrayImage,
};

/// What a stage of the detector is drawn on.
#[derive(Debug, clap::Args)]
pub(crate) struct SceneArgs {
    /// A picture of your own, PNG or JPEG, in place of the rendered scene.
    #[arg(long, value_name = "FILE")]
    image: Option<PathBuf>,
    /// Another seed renders another scene.
    #[arg(long, conflicts_with = "image")]
    seed: Option<u64>,
    #[command(flatten)]
    pub(super) target: Target,
}

/// Which kind of scene is rendered.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Rendered {
    /// A corridor with posters, doors and a tiled floor.
    Corridor,
    /// The same, with the camera turned down.
    Floor,
    /// A room with framed pictures, posters, windows and signs.
    Room,
}

impl SceneArgs {
    /// The image at the detector's working scale: the named one, or the first of a set of rendered ones.
    pub(crate) fn image(&self, rendered: Rendered, default_seed: u64) -> anyhow::Result<GrayImage> {
        let seed = self.seed.unwrap_or(default_seed);
        let image = match (&self.image, rendered) {
            (Some(path), _) => pictures::read(path).with_context(|| path.display().to_string())?,
            (None, Rendered::Corridor) => {
                let params = ViewsParams { seed, views: 1, ..ViewsParams::default() };
                Views::new(&params).next().context("no view was rendered")?.image
            }
            (None, Rendered::Floor) => floor(seed),
            (None, Rendered::Room) => {
                let params = ScenesParams { seed, scenes: 1, ..ScenesParams::default() };
                Scenes::new(&params, vec![]).next().context("no scene was rendered")?.image
            }
        };
        let factor = working_factor(&image, DetectParams::default().quads.working_side_px);
        Ok(if factor > 1 { reduce(&image, factor) } else { image })
    }
}

/// Along the corridor from 1.2 m above the floor, the camera turned down.
fn floor(seed: u64) -> GrayImage {
    let camera = map::extrinsics::pan_tilt(0.3, -0.3, Vector3::new(0.0, 0.0, 1.2));
    let map_from_robot = map::pose2::Pose2::new(2.0, -0.3, 0.0).to_isometry3();
    let building = Building::corridor(seed);
    Renderer::new(Camera::vga())
        .render(&building, &(map_from_robot * camera), &SensorParams::default(), seed)
        .image
}
