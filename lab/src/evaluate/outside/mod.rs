//! `waymark-lab evaluate outside`: worlds that nobody here made. Teaches each landmark from its one
//! frontal picture, then recognises every picture as the server does a photograph, and compares
//! quads, names and poses with the truth.

mod world;
mod teach;
mod recognise;
mod bound;
mod poses;
mod score;
mod sizes;
mod report;
mod table;
mod draw;
mod listing;
mod peer;
mod strangers;
mod walk;

use anyhow::Context as _;
use cli::{
    parameters::{ParameterArgs, assign},
    screen,
};
use engine::snapshot::MapSnapshot;
use report::{Report, WalkFigures};
use score::PictureScore;
use std::{
    path::{Path, PathBuf},
    sync::Arc,
};
use teach::Teacher;
use vision::{detect::DetectParams, params::Params};
use world::{CameraSigmas, World};

/// `waymark-lab evaluate outside`.
#[derive(Debug, clap::Args)]
#[expect(clippy::struct_excessive_bools, reason = "each is a switch of the command")]
pub(crate) struct Args {
    /// Worlds: folders with a truth.json that has `teach`, and a world.json where poses are known.
    /// A folder without a truth.json stands for its sub-folders that have one, by name.
    #[arg(required = true)]
    folders: Vec<PathBuf>,
    /// One JSON object instead of tables.
    #[arg(long)]
    json: bool,
    /// Name every full view without a name, and why, every wrong name and every false quad.
    #[arg(long)]
    misses: bool,
    /// Name every camera pose with its error, the stated standard deviation, and what corners of
    /// 0.3 px can tell.
    #[arg(long)]
    poses: bool,
    /// Teach each world and show it the pictures of the next one: every name is wrong, but on a
    /// landmark that shows the same picture (lab/reviewed/same-pictures.json).
    #[arg(long)]
    strangers: bool,
    /// State no standard deviations of the cameras, so that the server takes usual ones (0.5 % of
    /// the focal length). Default: they are stated to be exact, as they are.
    #[arg(long)]
    usual_camera: bool,
    /// Send a robot from picture to picture of each world, too, and report its fused poses. Its
    /// odometry, camera and mounting have errors as large as they are taken to have.
    #[arg(long, conflicts_with = "strangers")]
    walk: bool,
    /// Draw the pictures with a full view without a name, a wrong name or a false quad into this
    /// folder.
    #[arg(long, value_name = "DIR")]
    draw: Option<PathBuf>,
    /// Put OpenCV's SIFT with RANSAC on the same pictures beside it, where Python has OpenCV.
    #[arg(long, conflicts_with = "strangers")]
    peer: bool,
    /// The Python that has OpenCV.
    #[arg(long, default_value = "python3", value_name = "PROGRAM")]
    python: PathBuf,
    /// Take the places of landmarks to be exact, as they are here, instead of measured with a tape
    /// (1 cm, half a degree): then several landmarks in one picture tell more.
    #[arg(long)]
    exact_places: bool,
    /// Set one parameter of the algorithm other than the detector's, after the lesson, such as
    /// `recognise.texture.search=true`. May be repeated.
    #[arg(long, value_name = "PATH=VALUE")]
    algorithm: Vec<String>,
    #[command(flatten)]
    parameters: ParameterArgs,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let sigmas = if args.usual_camera { CameraSigmas::Absent } else { CameraSigmas::Exact };
    let worlds = worlds(&args.folders, sigmas)?;
    anyhow::ensure!(!args.strangers || worlds.len() > 1, "--strangers needs two worlds or more");
    let detect = args.parameters.parameters()?;
    let teacher = Teacher::start(args.parameters.preset())?;
    let maps =
        worlds.iter().enumerate().map(|(i, world)| adjusted(args, &detect, &*teacher.teach(world, i)?));
    let maps: Vec<MapSnapshot> = maps.collect::<anyhow::Result<_>>()?;
    let (mut scores, mut unreadable) = (Vec::new(), 0);
    for (i, map) in maps.iter().enumerate() {
        let next = &worlds[(i + 1) % worlds.len()];
        let strangers = args.strangers.then(|| strangers::as_strangers(next, &worlds[i])).transpose()?;
        let shown = strangers.as_ref().unwrap_or(&worlds[i]);
        unreadable += of_world(shown, map, args.draw.as_deref(), &mut scores)?;
    }
    teacher.stop();
    if args.misses {
        scores.iter().for_each(listing::name_misses);
    }
    if args.poses {
        scores.iter().for_each(listing::name_pose);
    }
    let mut report = Report::new(worlds.len(), &scores, unreadable);
    report.sizes = (!args.strangers).then(|| sizes::sizes(&worlds, &scores)).flatten();
    if args.walk {
        report.walk = Some(walked(&worlds, &maps)?);
    }
    if args.peer {
        match peer::beside(&args.python, &worlds) {
            Ok(peer) => report.peer = Some(peer),
            Err(reason) => screen::complain(&format!("without OpenCV: {reason}")),
        }
    }
    screen::say(&if args.json { serde_json::to_string(&report)? } else { table::table(&report) });
    Ok(())
}

/// A robot goes through each world.
fn walked(worlds: &[World], maps: &[MapSnapshot]) -> anyhow::Result<WalkFigures> {
    let progress = screen::progress(worlds.len(), "walking");
    let mut stops = Vec::new();
    for (i, (world, map)) in worlds.iter().zip(maps).enumerate() {
        stops.extend(walk::walk(world, map, i as u64)?);
        progress.inc(1);
    }
    progress.finish_and_clear();
    Ok(WalkFigures::new(&stops))
}

/// All worlds that the folders stand for.
fn worlds(folders: &[PathBuf], sigmas: CameraSigmas) -> anyhow::Result<Vec<World>> {
    let mut paths = Vec::new();
    for folder in folders {
        if folder.join("truth.json").exists() {
            paths.push(folder.clone());
            continue;
        }
        let entries =
            std::fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))?;
        let mut within = entries.map(|entry| Ok(entry?.path())).collect::<std::io::Result<Vec<_>>>()?;
        within.retain(|path| path.join("truth.json").exists());
        anyhow::ensure!(!within.is_empty(), "{} holds no truth.json", folder.display());
        within.sort();
        paths.extend(within);
    }
    paths.iter().map(|path| read(path, sigmas)).collect()
}

fn read(path: &Path, sigmas: CameraSigmas) -> anyhow::Result<World> {
    let world = World::read(path, sigmas)?;
    anyhow::ensure!(!world.truth.teach.is_empty(), "{} has nothing to teach", path.display());
    Ok(world)
}

/// Variance of a coordinate of a place that is taken to be exact, m^2 and rad^2.
const EXACT: f64 = 1e-12;

/// The map, recognised with the parameters that are asked for.
fn adjusted(args: &Args, detect: &DetectParams, map: &MapSnapshot) -> anyhow::Result<MapSnapshot> {
    let mut all = serde_json::to_value(Params { detect: detect.clone(), ..Params::clone(&map.params) })?;
    args.algorithm.iter().try_for_each(|assignment| assign(&mut all, assignment))?;
    let params: Params = serde_json::from_value(all).context("--algorithm")?;
    let mut map = MapSnapshot { params: Arc::new(params), ..map.clone() };
    if args.exact_places {
        for place in map.landmarks.values_mut().filter_map(|landmark| landmark.place.as_mut()) {
            place.covariance = nalgebra::Matrix6::identity() * EXACT;
        }
    }
    Ok(map)
}

/// Scores all pictures of a world; the number of those that cannot be read.
fn of_world(
    world: &World,
    map: &MapSnapshot,
    drawn_into: Option<&Path>,
    scores: &mut Vec<PictureScore>,
) -> anyhow::Result<usize> {
    let mut unreadable = 0;
    let progress = screen::progress(world.truth.images.len(), "recognising");
    for image in world.truth.images.iter().filter(|image| !image.whole_image) {
        progress.inc(1);
        let recognised = match recognise::recognise(&image.path, world.cameras.get(&image.file), map) {
            Ok(recognised) => recognised,
            Err(error) => {
                unreadable += 1;
                screen::complain(&format!("{error:#}"));
                continue;
            }
        };
        let score = score::score(world, image, map, &recognised);
        if let Some(folder) = drawn_into {
            draw::draw(folder, &score, &recognised)?;
        }
        scores.push(score);
    }
    progress.finish_and_clear();
    Ok(unreadable)
}
