//! `waymark landmark learning`: weights and gates of one landmark.

use super::show;
use crate::{
    learning_settings::{self, LearningArgs},
    session::Session,
};
use client::api::LandmarkPatch;

/// `waymark landmark learning`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The landmark.
    landmark: String,
    #[command(flatten)]
    settings: LearningArgs,
}

pub(super) async fn run(session: &Session, map: &str, args: &Args) -> anyhow::Result<()> {
    let name = &args.landmark;
    let landmark = session.maps().landmark(map, name).await?;
    let Some(why) = &args.settings.why else {
        let own = landmark.learning.as_ref().map(learning_settings::text);
        let told = own.unwrap_or_else(|| "weights and gates as the map has them".to_owned());
        return session.show(&landmark, &format!("{name}: {told}"));
    };
    let learning = args.settings.over(landmark.learning, why);
    let patch = LandmarkPatch { learning: Some(learning), ..LandmarkPatch::default() };
    let maps = session.maps().with_reason(why).if_match(&landmark.revision);
    let landmark = maps.update_landmark(map, name, &patch).await?;
    session.show(&landmark, &show::text(&landmark))
}
