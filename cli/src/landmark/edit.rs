//! `waymark landmark size`, `rename`, `health`, `delete`.

use super::{
    show::{self, size_text},
    teach::check_size,
};
use crate::{
    screen::counted,
    session::{Consent, Session},
};
use client::api::{LandmarkHealthBody, LandmarkPatch, Size};
use serde_json::json;

pub(super) async fn size(
    session: &Session,
    map: &str,
    name: &str,
    size: Size,
    consent: Consent,
) -> anyhow::Result<()> {
    check_size(size, consent)?;
    let before = session.maps().landmark(map, name).await?;
    let patch = LandmarkPatch { size: Some(Some(size)), ..LandmarkPatch::default() };
    let landmark = session.maps().if_match(&before.revision).update_landmark(map, name, &patch).await?;
    let sizes = (size_text(before.size), size_text(landmark.size));
    session.show(&landmark, &format!("{name}: size {} -> {}", sizes.0, sizes.1))
}

pub(super) async fn rename(session: &Session, map: &str, name: &str, new_name: &str) -> anyhow::Result<()> {
    let patch = LandmarkPatch { name: Some(new_name.to_owned()), ..LandmarkPatch::default() };
    let landmark = session.maps().update_landmark(map, name, &patch).await?;
    session.show(&landmark, &format!("{name} is {new_name} now"))
}

pub(super) async fn health(
    session: &Session,
    map: &str,
    name: &str,
    health: LandmarkHealthBody,
) -> anyhow::Result<()> {
    let patch = LandmarkPatch { health: Some(health), ..LandmarkPatch::default() };
    let landmark = session.maps().update_landmark(map, name, &patch).await?;
    session.show(&landmark, &show::text(&landmark))
}

pub(super) async fn delete(
    session: &Session,
    map: &str,
    names: &[String],
    consent: Consent,
) -> anyhow::Result<()> {
    let (mut views, mut revisions) = (0, Vec::new());
    for name in names {
        let landmark = session.maps().landmark(map, name).await?;
        views += landmark.views;
        revisions.push(landmark.revision);
    }
    let list = names.join(", ");
    consent.ask(&format!("Delete {list} with {}?", counted(views, "training view")))?;
    // What was counted above is deleted, and nothing that came while the question was open.
    for (name, revision) in names.iter().zip(&revisions) {
        session.maps().if_match(revision).delete_landmark(map, name).await?;
    }
    let told =
        format!("{list}: deleted. waymark history list has the change, waymark history undo takes it back.");
    session.show(&json!({ "deleted": names }), &told)
}
