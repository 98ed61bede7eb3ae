//! `waymark-lab plot`: a picture of every stage of the method, drawn from what the pipeline itself works out there. A
//! stage's file takes a rendered scene or landmark and gives a `Picture`; nothing is drawn by hand. The pictures of
//! docs/method are made with these commands, and a test draws them again (`lab/tests/lab/plot.rs`).

pub(crate) mod panels;
mod scene;
mod landmark;
mod tiling;
mod borders;
mod classifier;
mod three_sided;
mod icon;
mod harris;
mod buckets;
mod exemplars;
mod alignment;
mod mismatch;
mod patch;
mod matches;
mod expected;
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

use cli::drawing::Picture;
use expected::ExpectedArgs;
use landmark::LandmarkArgs;
use scene::SceneArgs;
use std::path::PathBuf;

/// Which stage to draw.
///
/// Without an option every command draws the picture of its page in docs/method: the same bytes on every machine.
#[derive(Debug, clap::Subcommand)]
pub(crate) enum Command {
    /// Segments of a tiled floor, the same on the floor, and the accumulator of periods that finds the pattern.
    ///
    /// Page 1.5 of docs/method. Lines are thick where they are removed as tiling. For example:
    ///   waymark-lab plot tiling --out tiling.png
    ///   waymark-lab plot tiling --image hall.jpg --out hall.png
    #[command(verbatim_doc_comment)]
    Tiling(SceneArgs),
    /// The lines beside the sides of one quad, how much each looks like a border, and which the border model chooses.
    ///
    /// Page 24.3. Of the quads that are kept, the one whose corners the model moved furthest.
    Borders(SceneArgs),
    /// Which quads the classifier takes for objects, with their probabilities, and which of them suppression keeps.
    ///
    /// Pages 24.4 and 24.5. For example:
    ///   waymark-lab plot classifier --image corridor.jpg --out mine.png
    #[command(verbatim_doc_comment)]
    Classifier(SceneArgs),
    /// Segments that no quad explains, and the sets of three sides among them.
    ///
    /// Page 3.5. The side that was not seen is broken.
    ThreeSided(SceneArgs),
    /// A quad in the image, its icon, and the exemplar that it is compared with.
    ///
    /// Page 4. For example, with a picture of your own on the wall:
    ///   waymark-lab plot icon --image painting.jpg --out icon.png
    #[command(verbatim_doc_comment)]
    Icon(LandmarkArgs),
    /// Harris points of an icon and of an exemplar, and the counterparts that the Hausdorff distance rests on.
    ///
    /// Pages 5 and 6.2.
    Harris(LandmarkArgs),
    /// Correlation of grey levels and of gradients, bucket by bucket: the landmark, a part covered, another picture.
    ///
    /// Pages 6.1 and 6.3.3.
    Buckets(LandmarkArgs),
    /// Training views in the plane of their two leading modes, and the exemplars that stand for them.
    ///
    /// Pages 7.2 and 7.3.
    Exemplars(LandmarkArgs),
    /// A quad that is a little off, before and after template alignment, and the icons along its corners.
    ///
    /// Page 6.3.2.
    Alignment(LandmarkArgs),
    /// Where an aligned picture shows something else than the exemplar: a quarter replaced, and a part covered.
    ///
    /// Page 25.7.
    Mismatch(LandmarkArgs),
    /// The patch of a quad with its margin, its keypoints, and which of them are taught.
    ///
    /// Pages 25.1 to 25.3.
    Patch(LandmarkArgs),
    /// Matches with the taught points, those that agree on a homography, and what every other taught point says.
    ///
    /// Pages 25.5 and 25.6.
    Matches(LandmarkArgs),
    /// Where a known pose expects landmarks, and one that the image border cuts, found there by its points.
    ///
    /// Pages 26.1 and 26.2.
    Expected(ExpectedArgs),
    #[command(flatten)]
    Map(map_stages::Command),
}

/// Where a picture goes.
#[derive(Debug, clap::Args)]
pub(crate) struct Target {
    /// The picture, replaced if it is there: PNG of stages of `vision`, SVG of stages of `map`.
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
    let (picture, target) = match command {
        Command::Map(command) => return map_stages::run(command),
        Command::Tiling(args) => (tiling::draw(args)?, &args.target),
        Command::Borders(args) => (borders::draw(args)?, &args.target),
        Command::Classifier(args) => (classifier::draw(args)?, &args.target),
        Command::ThreeSided(args) => (three_sided::draw(args)?, &args.target),
        Command::Icon(args) => (icon::draw(args)?, &args.target),
        Command::Harris(args) => (harris::draw(args)?, &args.target),
        Command::Buckets(args) => (buckets::draw(args)?, &args.target),
        Command::Exemplars(args) => (exemplars::draw(args)?, &args.target),
        Command::Alignment(args) => (alignment::draw(args)?, &args.target),
        Command::Mismatch(args) => (mismatch::draw(args)?, &args.target),
        Command::Patch(args) => (patch::draw(args)?, &args.target),
        Command::Matches(args) => (matches::draw(args)?, &args.target),
        Command::Expected(args) => (expected::draw(args)?, &args.target),
    };
    target.write(&picture)
}
