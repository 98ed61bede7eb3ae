//! `waymark-lab plot`: pictures of the stages of recognition, drawn from what `vision` itself works
//! out of a rendered landmark or of a picture of one's own. Those of docs/method are made so, and a
//! test draws them again (`lab/tests/lab/plot.rs`). Stages of the detector are drawn by
//! `waymark detect --draw`.

mod panels;
mod landmark;
mod icon;
mod harris;
mod buckets;
mod exemplars;
mod alignment;
mod mismatch;
mod patch;
mod matches;

use std::path::PathBuf;

/// What to draw, and of what.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The stage of recognition.
    stage: Stage,
    /// A picture of your own, PNG or JPEG, that hangs on the rendered wall in place of the poster.
    #[arg(long, value_name = "FILE")]
    image: Option<PathBuf>,
    /// Another seed takes another poster, another wall and other noise.
    #[arg(long, default_value_t = 11)]
    seed: u64,
    /// The picture, a PNG file, replaced if it is there.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

/// A stage of recognition.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Stage {
    /// A quad in the image, its icon, and the exemplar that it is compared with (page 4 of
    /// docs/method).
    Icon,
    /// Harris points of icon and exemplar, and the counterparts that the Hausdorff distance rests
    /// on (5, 6.2).
    Harris,
    /// Correlation of grey levels and of gradients by bucket: the landmark, a part covered, another
    /// picture (6.1, 6.3).
    Buckets,
    /// Training views in the plane of their two leading modes, and the exemplars that stand for
    /// them (7.2, 7.3).
    Exemplars,
    /// A quad that is a little off, before and after template alignment (6.3.2).
    Alignment,
    /// Where an aligned picture shows something else: a quarter replaced, and a part covered
    /// (25.7).
    Mismatch,
    /// The patch of a quad with its margin, its keypoints, and which of them are taught (25.1 to
    /// 25.3).
    Patch,
    /// Matches with the taught points, which of them agree, and what every other taught point says
    /// (25.5, 25.6).
    Matches,
}

/// Levels of each colour of a written picture: the noise of cameras would make most of a file.
const LEVELS: u8 = 24;

/// Draws one stage.
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let draw = match args.stage {
        Stage::Icon => icon::draw,
        Stage::Harris => harris::draw,
        Stage::Buckets => buckets::draw,
        Stage::Exemplars => exemplars::draw,
        Stage::Alignment => alignment::draw,
        Stage::Mismatch => mismatch::draw,
        Stage::Patch => patch::draw,
        Stage::Matches => matches::draw,
    };
    draw(&args.landmark()?)?.posterised(LEVELS).save_small(&args.out)
}
