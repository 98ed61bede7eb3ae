//! `waymark map learning`: weights and gates of all landmarks of a map.

use crate::{
    learning_settings::{self, LearningArgs},
    session::{ServerArgs, Session},
};
use client::api::{Map, MapPatch};

/// `waymark map learning`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The map.
    map: String,
    #[command(flatten)]
    settings: LearningArgs,
    #[command(flatten)]
    server: ServerArgs,
}

pub(super) async fn run(args: &Args) -> anyhow::Result<()> {
    let session = args.server.session()?;
    let map = session.explained(shown_or_set(&session, args).await).await?;
    session.show(&map, &format!("{}: {}", map.name, text(&map)))
}

async fn shown_or_set(session: &Session, args: &Args) -> anyhow::Result<Map> {
    let map = session.maps().map(&args.map).await?;
    let Some(why) = &args.settings.why else { return Ok(map) };
    let learning = Some(args.settings.over(map.learning, why));
    let maps = session.maps().with_reason(why).if_match(&map.revision);
    Ok(maps.locate_map(&args.map, &MapPatch { learning, ..MapPatch::default() }).await?)
}

/// Weights and gates in words.
pub(super) fn text(map: &Map) -> String {
    let own = map.learning.as_ref().map(learning_settings::text);
    own.unwrap_or_else(|| "weights and gates as the server has them".to_owned())
}
