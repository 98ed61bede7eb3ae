//! `waymark-lab plot`: a picture of every stage of the method, drawn from what the pipeline itself works out there. A
//! stage's file takes a rendered scene or landmark and gives a `Picture`; nothing is drawn by hand. The pictures of
//! docs/method are made with these commands, and a test draws them again (`lab/tests/lab/plot.rs`).

mod classifier;
mod map_fusion;
mod map_gaze;
mod map_guided;
mod map_health;
mod map_laser;
mod map_localisation;
mod map_placement;
mod map_plan;
mod map_relocalisation;
mod map_scene;
mod map_stages;
pub(crate) mod panels;
mod scene;

use scene::SceneArgs;
use server::cli::drawing::Picture;
use std::path::PathBuf;

/// Which stage to draw.
///
/// Without an option every command draws the picture of its page in docs/method: the same bytes on every machine.
#[derive(Debug, clap::Subcommand)]
pub(crate) enum Command {
    /// Which quads the classifier takes for objects, with their probabilities, and which of them suppression keeps.
    ///
    /// Page 24.4 and 24.5 of docs/method. For example:
    ///   waymark-lab plot classifier --out classifier.png
    ///   waymark-lab plot classifier --image corridor.jpg --out mine.png
    #[command(verbatim_doc_comment)]
    Classifier(SceneArgs),
    #[command(flatten)]
    Map(map_stages::Command),
}

/// Where a picture goes.
#[derive(Debug, clap::Args)]
pub(crate) struct Target {
    /// The picture: a PNG file, replaced if it is there.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

impl Target {
    /// Writes `picture` as a small file.
    pub(crate) fn write(&self, picture: &Picture) -> anyhow::Result<()> {
        picture.posterised(LEVELS).save_small(&self.out)
    }
}

/// Levels of each colour of a written picture: the noise of cameras would make most of a file.
const LEVELS: u8 = 24;

/// Draws one stage.
pub(crate) fn run(command: &Command) -> anyhow::Result<()> {
    match command {
        Command::Classifier(args) => args.target.write(&classifier::draw(args)?),
        Command::Map(command) => map_stages::run(command),
    }
}
