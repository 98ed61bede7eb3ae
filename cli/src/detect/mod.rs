//! `waymark detect`: the quads of pictures, no server needed.

mod record;
mod draw;

use super::{parameters::ParameterArgs, pictures, screen, stopwatch::Stopwatch};
use anyhow::Context as _;
use record::Record;
use serde::Serialize;
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    process::ExitCode,
};
use vision::{
    detect::{DetectParams, Quad, detect},
    frame::Picture,
};

/// `waymark detect`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// PNG or JPEG files, or folders of them.
    #[arg(required_unless_present = "show_params")]
    images: Vec<PathBuf>,
    /// One JSON line per picture:
    /// `{"image","width","height","quads":[{"corners":[[x,y]*4],"kind","score"}],"timings_ms"}`.
    ///
    /// Corners are top-left, top-right, bottom-right, bottom-left in pixels; pixel (0, 0) is the
    /// centre of the top-left pixel.
    #[arg(long)]
    json: bool,
    /// Write pictures of every stage (edges, chains, segments, pairs or proposals, quads) and an
    /// overview here.
    #[arg(long, value_name = "DIR")]
    draw: Option<PathBuf>,
    /// Print all parameters as JSON, as a file for --params, and end if there are no images.
    #[arg(long)]
    show_params: bool,
    #[command(flatten)]
    parameters: ParameterArgs,
}

#[derive(Serialize)]
struct Line {
    image: String,
    width: usize,
    height: usize,
    quads: Vec<QuadLine>,
    timings_ms: BTreeMap<&'static str, f64>,
}

#[derive(Serialize)]
struct QuadLine {
    corners: [[f64; 2]; 4],
    kind: vision::detect::QuadKind,
    score: f64,
    side_support: [f64; 4],
    /// Inner borders of the same object, outermost first.
    alternates: Vec<[[f64; 2]; 4]>,
}

/// Exit status 1 when any picture could not be read; the others are still done.
pub(crate) fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let params = args.parameters.parameters()?;
    if args.show_params {
        screen::say(&serde_json::to_string_pretty(&params)?);
    }
    let mut drawings = args.draw.as_deref().map(Drawings::new).transpose()?;
    let mut status = ExitCode::SUCCESS;
    let images = files(&args.images)?;
    // Lines of results on a terminal show how far it is; a bar would only disturb them.
    for path in &images {
        let picture = match pictures::read_picture(path) {
            Ok(picture) => picture,
            Err(error) => {
                screen::complain(&format!("waymark: {}: {error}", path.display()));
                status = ExitCode::FAILURE;
                continue;
            }
        };
        let mut stopwatch = Stopwatch::start();
        let quads = detect(&picture, &params, &mut stopwatch);
        show(path, &picture, &quads, stopwatch, args.json)?;
        if let Some(drawings) = &mut drawings {
            drawings.add(path, &picture, &params)?;
        }
    }
    Ok(status)
}

/// Folders are replaced by the pictures in them, in the order of their names.
pub(crate) fn files(named: &[PathBuf]) -> anyhow::Result<Vec<PathBuf>> {
    let mut all = Vec::new();
    for path in named {
        if !path.is_dir() {
            all.push(path.clone());
            continue;
        }
        let entries = std::fs::read_dir(path).with_context(|| format!("cannot read {}", path.display()))?;
        let mut inside = entries.map(|e| e.map(|e| e.path())).collect::<Result<Vec<_>, _>>()?;
        inside.retain(|p| pictures::is_picture(p));
        inside.sort();
        // A folder without pictures stays in the list: reading it gives the error.
        if inside.is_empty() {
            inside.push(path.clone());
        }
        all.append(&mut inside);
    }
    Ok(all)
}

fn show(path: &Path, picture: &Picture, quads: &[Quad], watch: Stopwatch, json: bool) -> anyhow::Result<()> {
    let name = path.display().to_string();
    let (width, height) = (picture.width(), picture.height());
    if json {
        let quads = quads.iter().map(quad_line).collect();
        let line = Line { image: name, width, height, quads, timings_ms: watch.ms };
        screen::say(&serde_json::to_string(&line)?);
        return Ok(());
    }
    screen::say(&format!("{name}: {width}x{height}, {} quads, {:.1} ms", quads.len(), watch.total_ms()));
    for quad in quads {
        let corners = quad.corners_px.points().map(|c| format!("({:.1}, {:.1})", c.x, c.y)).join(" ");
        screen::say(&format!("  score {:.2}  {corners}  {:?}", quad.score, quad.kind));
    }
    Ok(())
}

/// A folder of drawings, where no two images share names.
struct Drawings<'a> {
    folder: &'a Path,
    stems: BTreeMap<String, usize>,
}

impl<'a> Drawings<'a> {
    fn new(folder: &'a Path) -> anyhow::Result<Self> {
        std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
        Ok(Self { folder, stems: BTreeMap::new() })
    }

    fn add(&mut self, path: &Path, picture: &Picture, params: &DetectParams) -> anyhow::Result<()> {
        let stem = path.file_stem().map_or("image".into(), |s| s.to_string_lossy().into_owned());
        let count = self.stems.entry(stem.clone()).or_default();
        *count += 1;
        let stem = if *count > 1 { format!("{stem}_{count}") } else { stem };
        draw::write(self.folder, &stem, &Record::of(picture, params))
    }
}

fn quad_line(quad: &Quad) -> QuadLine {
    QuadLine {
        corners: quad.corners_px.into(),
        kind: quad.kind,
        score: quad.score,
        side_support: quad.side_support,
        alternates: quad.alternates.iter().map(|c| (*c).into()).collect(),
    }
}
