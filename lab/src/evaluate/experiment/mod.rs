//! Common parts of the experiments on recognition (method 18, E2 to E8, E11, E14): arguments,
//! textures of three disjoint sets, a lesson, the outcome of a view. They run in this program,
//! without a server, from a seed.

pub(crate) mod pictures;
pub(crate) mod lesson;
pub(crate) mod view_outcome;
pub(crate) mod sweep;
pub(crate) mod curves;
pub(crate) mod conditions;
pub(crate) mod distractors;
mod gaussian;
pub(crate) mod distance_histograms;
pub(crate) mod discrimination;
pub(crate) mod look_alikes;
pub(crate) mod answers;
pub(crate) mod confidence;
pub(crate) mod robot_server;
pub(crate) mod way;

use cli::screen;
use engine::survey::Effort;
use lesson::Taught;
use pictures::Part;
use serde::Serialize;
use std::{
    num::NonZeroUsize,
    path::{Path, PathBuf},
};
use vision::params::{Params, preset::Preset};

/// Arguments of every experiment.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct Common {
    /// The set of textures: tune, calibrate or test, which are disjoint. Use test for reports only.
    #[arg(long = "set", default_value = "test", value_parser = pictures::part)]
    pub(crate) part: Part,
    /// A folder of pictures to use beside generated posters, or one with a truth.json of which the
    /// taught pictures are used. May be repeated.
    #[arg(long, value_name = "DIR")]
    pub(crate) photographs: Vec<PathBuf>,
    /// How landmarks are taught: `views`, each from 30 rendered views as a robot would gather them,
    /// or `photograph`, each from one view and 30 generated from it.
    #[arg(long, default_value = "views", value_parser = lesson::taught)]
    taught: Taught,
    /// Seed of views, noise and the choice of posters.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Standard deviation of the corners per coordinate, where the true ones are given.
    #[arg(long, value_name = "PX", default_value_t = 1.0, value_parser = noise)]
    corner_noise_px: f64,
    /// Let the detector find the quad in the whole image, instead of giving the true corners.
    #[arg(long)]
    pub(crate) detector: bool,
    /// The pipeline: the `default`, or that of the `paper`, where H^r decides.
    #[arg(long, value_name = "NAME", default_value = "default")]
    pub(crate) preset: Preset,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    pub(crate) json: bool,
    /// Write the curves or histograms as an SVG picture.
    #[arg(long, value_name = "FILE")]
    pub(crate) plot: Option<PathBuf>,
}

/// Largest corner noise.
const MAX_NOISE_PX: f64 = 20.0;

fn noise(text: &str) -> Result<f64, String> {
    let px: f64 = text.parse().map_err(|error| format!("{error}"))?;
    if (0.0..=MAX_NOISE_PX).contains(&px) { Ok(px) } else { Err(format!("not within 0 to {MAX_NOISE_PX}")) }
}

/// Set-up of an experiment, part of every report.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Setting {
    experiment: &'static str,
    set: &'static str,
    taught: &'static str,
    corners: String,
    seed: u64,
    preset: Preset,
    /// Landmarks in the map (N), and how many of them are photographs.
    landmarks: usize,
    photographs: usize,
    /// Taught, but failed a quality gate.
    candidates: Vec<String>,
    /// Mean bytes of a model as it is stored.
    bytes_per_model: usize,
    /// Of them what C^r needs, and what H^r would: icons, and points with descriptors (E14).
    icon_bytes_per_model: usize,
    point_bytes_per_model: usize,
    /// Hash of the parameters of the distances.
    params_hash: String,
}

impl Setting {
    fn new(experiment: &'static str, common: &Common, class: &lesson::Class, p: &Params) -> Self {
        let corners = if common.detector {
            "found by the detector".to_owned()
        } else {
            format!("true, noise {} px", common.corner_noise_px)
        };
        let [icon_bytes_per_model, point_bytes_per_model] = class.distance_bytes_per_model(p);
        Self {
            experiment,
            set: common.part.name(),
            taught: common.taught.name(),
            corners,
            seed: common.seed,
            preset: common.preset,
            landmarks: class.models.len(),
            photographs: class.active().filter(|(_, picture)| picture.photograph).count(),
            candidates: class.candidates.iter().map(|i| class.landmarks[*i].name.clone()).collect(),
            bytes_per_model: class.bytes_per_model(),
            icon_bytes_per_model,
            point_bytes_per_model,
            params_hash: format!("{:016x}", p.distance_hash()),
        }
    }

    /// Lines for people.
    fn lines(&self) -> Vec<String> {
        vec![
            format!(
                "{}: preset {}, set {}, seed {}, N = {} landmarks ({} photographs) taught from {}; corners {}",
                self.experiment,
                self.preset.word(),
                self.set,
                self.seed,
                self.landmarks,
                self.photographs,
                self.taught,
                self.corners
            ),
            format!(
                "  {} more were taught but failed a quality gate; {} bytes a model, {} for C^r, {} for H^r; parameters {}",
                self.candidates.len(),
                self.bytes_per_model,
                self.icon_bytes_per_model,
                self.point_bytes_per_model,
                self.params_hash
            ),
        ]
    }
}

/// Prints the report: a table, or JSON.
pub(crate) fn say(
    json: bool,
    report: &impl Serialize,
    table: impl FnOnce() -> Vec<String>,
) -> anyhow::Result<()> {
    screen::say(&if json { serde_json::to_string(report)? } else { table().join("\n") });
    Ok(())
}

/// Writes the plot if `path` is given.
pub(crate) fn write_plot(path: Option<&Path>, svg: impl FnOnce() -> String) -> anyhow::Result<()> {
    use anyhow::Context as _;
    let Some(path) = path else { return Ok(()) };
    std::fs::write(path, svg()).with_context(|| format!("cannot write {}", path.display()))
}

/// One seed from several numbers.
pub(crate) fn mixed(parts: &[u64]) -> u64 {
    parts.iter().fold(0x7761_796d_6172_6b00, |seed, part| {
        vision::random::Random::new(seed ^ part.wrapping_mul(0x9e37_79b9_7f4a_7c15)).next_u64()
    })
}

/// `work` on every item, over all processors, with a progress bar; results in the order of the
/// items.
pub(crate) fn of_each<T: Sync, R: Send>(
    items: &[T],
    what: &'static str,
    work: impl Fn(usize, &T) -> R + Sync,
) -> Vec<R> {
    let progress = screen::progress(items.len(), what);
    let threads = std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
    let told = |_: &'static str, _: usize, _: usize| progress.inc(1);
    let results = Effort { threads, told: &told }.of_each(items, what, work);
    progress.finish_and_clear();
    results
}
