//! A teacher: make a map, upload one photograph per landmark, learn, and try it on other
//! photographs.
//!
//! ```text
//! waymark serve                                      # in another terminal
//! cargo run -p client --example 02_teach -- --map hall poster.jpg door.jpg --try wall.jpg
//! ```
//! The name of a landmark is the name of its file. With `--cropped` the whole image is the
//! landmark; otherwise the server searches the dominant quad and refuses the image if there are
//! several.
#![expect(clippy::print_stdout, reason = "an example shows its results")]

use anyhow::Context;
use clap::Parser;
use client::{
    ClientError, LandmarkRegion, MapClient, NewView,
    api::{Job, NewMap, Size},
};
use std::{
    path::{Path, PathBuf},
    time::Duration,
};

/// Teach photographs to a running Waymark server, then recognise others.
#[derive(Parser)]
struct Arguments {
    /// The server's HTTP address.
    #[arg(long, default_value = "http://127.0.0.1:8080")]
    server: String,
    /// Map to teach; created if it does not exist.
    #[arg(long, default_value = "hall")]
    map: String,
    /// The whole image is the landmark.
    #[arg(long)]
    cropped: bool,
    /// Width and height of every landmark in metres; without it there are no poses.
    #[arg(long, num_args = 2, value_names = ["WIDTH_M", "HEIGHT_M"])]
    size: Option<Vec<f64>>,
    /// Views to generate by warping each photograph.
    #[arg(long, default_value_t = 24)]
    generated: u32,
    /// Robot to assign to this map.
    #[arg(long)]
    robot: Option<String>,
    /// Photographs to recognise afterwards.
    #[arg(long = "try", num_args = 1..)]
    tries: Vec<PathBuf>,
    /// Photographs to teach, one landmark each.
    #[arg(required = true)]
    images: Vec<PathBuf>,
}

#[tokio::main]
async fn main() -> Result<(), anyhow::Error> {
    let arguments = Arguments::parse();
    let server = MapClient::new(&arguments.server)?;
    let map = arguments.map.as_str();
    match server.create_map(&NewMap::new(map)).await {
        Ok(_) => println!("map {map}: new"),
        // An existing map of that name is extended: say so.
        Err(ClientError::Refused { status: 409, .. }) => {
            let there = server.map(map).await?;
            println!("map {map}: exists with {} landmarks, adding to it", there.landmarks);
        }
        Err(error) => return Err(error.into()),
    }

    // 1. Landmarks and views.
    let size = arguments.size.as_ref().map(|s| Size { width_m: s[0], height_m: s[1] });
    let extent = if arguments.cropped { LandmarkRegion::WholeImage } else { LandmarkRegion::Detect };
    let mut names = Vec::new();
    for path in &arguments.images {
        let name = name_of(path)?;
        // The landmark is made with its first view: nothing is left behind if the view is refused.
        let new = NewView::new(read(path)?, extent).or_make_landmark(size);
        let view = server.upload_view_with(map, &name, new).await.context(path.display().to_string())?;
        println!("{name}: view with corners {:.0?}", view.corners);
        names.push(name);
    }

    // 2. One job learns all landmarks, so that each is a negative of the others.
    let job = server.learn(map, Some(&names), Some(arguments.generated)).await?;
    let report = |job: &Job| {
        println!("learning: {:3.0} % {}", 100.0 * job.progress, job.message);
    };
    server.wait_for_job(job, Duration::from_mins(30), report).await?;
    for name in &names {
        let landmark = server.landmark(map, name).await?;
        let why: Vec<String> = landmark.failed_gates.iter().map(ToString::to_string).collect();
        println!("{name}: {} {}", landmark.status, why.join(" "));
    }
    if let Some(robot) = &arguments.robot {
        server.put_robot(robot, map).await?;
        println!("robot {robot} now uses map {map}");
    }

    // 3. Other photographs. Uncertain quads get no name.
    for path in &arguments.tries {
        let answer = server.recognise(map, read(path)?, None).await.context(path.display().to_string())?;
        let names: Vec<_> =
            answer.quads.iter().map(|q| q.landmark.as_str()).filter(|n| !n.is_empty()).collect();
        println!("{}: {} quads, recognised {names:?}", path.display(), answer.quads.len());
    }
    Ok(())
}

fn read(path: &Path) -> Result<Vec<u8>, ClientError> {
    std::fs::read(path).map_err(|error| ClientError::File { path: path.display().to_string(), error })
}

/// The file's stem, in the letters of a name.
fn name_of(path: &Path) -> Result<String, anyhow::Error> {
    let stem = path.file_stem().context("a file without a name")?.to_string_lossy().to_lowercase();
    Ok(stem.chars().map(|c| if c.is_ascii_alphanumeric() || c == '_' { c } else { '-' }).take(64).collect())
}
