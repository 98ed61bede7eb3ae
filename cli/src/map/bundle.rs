//! `waymark map save` and `waymark map load`: a map as one file, out of a server and into one.

use super::super::{
    failure::{Class, Failure},
    names::name,
    screen::counted,
    session::{ServerArgs, Session},
};
use anyhow::Context as _;
use client::{MapClient, api::BundleQuery};
use serde_json::json;
use std::path::{Path, PathBuf};
use tokio::{fs, io::AsyncWriteExt as _};

/// `waymark map save`.
#[derive(Debug, clap::Args)]
pub(super) struct SaveArgs {
    /// The map.
    map: String,
    /// Where to, for example `office.zip`.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    server: ServerArgs,
}

/// `waymark map load`.
#[derive(Debug, clap::Args)]
pub(super) struct LoadArgs {
    /// A file of `waymark map save`.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Name of the new map; left out, the one that it had.
    #[arg(long, value_name = "MAP", value_parser = name)]
    name: Option<String>,
    /// Leave out the link to the map that it lies in; otherwise a map of that name must be there.
    #[arg(long)]
    no_map_link: bool,
    #[command(flatten)]
    server: ServerArgs,
}

/// Runs `waymark map save`.
pub(super) async fn save(args: &SaveArgs) -> anyhow::Result<()> {
    let session = args.server.session()?;
    let done = saved(&session, args).await;
    session.explained(done).await
}

async fn saved(session: &Session, args: &SaveArgs) -> anyhow::Result<()> {
    let (map, file) = (&args.map, &args.file);
    if file.exists() {
        let sentence = format!("{} exists already.", file.display());
        return Err(Failure::new(Class::Conflict, "exists", sentence).advise("Choose another name.").into());
    }
    let mut name = file.as_os_str().to_owned();
    name.push(".part");
    let part = PathBuf::from(name);
    let bytes = match fetch(session.maps(), map, &part).await {
        Ok(bytes) => bytes,
        Err(error) => {
            // What has come of it is of no use.
            drop(fs::remove_file(&part).await);
            return Err(error);
        }
    };
    fs::rename(&part, file).await.with_context(|| file.display().to_string())?;
    let text = format!("map {map} saved to {}, {bytes} bytes", file.display());
    session.show(&json!({ "map": map, "file": file, "bytes": bytes }), &text)
}

async fn fetch(maps: &MapClient, map: &str, part: &Path) -> anyhow::Result<u64> {
    let at = || part.display().to_string();
    let mut from = maps.save_map(map).await?;
    let (mut to, mut bytes) = (fs::File::create(part).await.with_context(at)?, 0);
    while let Some(next) = from.next().await? {
        to.write_all(&next).await.with_context(at)?;
        bytes += next.len() as u64;
    }
    to.sync_all().await.with_context(at)?;
    Ok(bytes)
}

/// Runs `waymark map load`.
pub(super) async fn load(args: &LoadArgs) -> anyhow::Result<()> {
    let session = args.server.session()?;
    let done = loaded(&session, args).await;
    session.explained(done).await
}

async fn loaded(session: &Session, args: &LoadArgs) -> anyhow::Result<()> {
    let file = args.file.display();
    let bundle = fs::read(&args.file).await.with_context(|| file.to_string())?;
    let query = BundleQuery { name: args.name.clone(), without_link: args.no_map_link };
    let map = session.maps().load_map(bundle, &query).await?;
    let landmarks = counted(map.landmarks, "landmark");
    session.show(&map, &format!("map {} loaded from {file}, with {landmarks}", map.name))
}
