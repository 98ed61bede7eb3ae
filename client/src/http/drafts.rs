//! Drafts of maps: begun, compared, published, discarded.

use super::{map_client::MapClient, operation::operations};
use crate::ClientError;
use protos::api::{Draft, DraftDifference, NewDraft, PageQuery, Replay, ReplayQuery, RollbackOutcome};

operations! {
    BEGIN: POST "/maps/{map}/drafts" => begin_draft,
    LIST: GET "/maps/{map}/drafts" => drafts,
    DISCARD: DELETE "/maps/{map}/drafts/{draft}" => discard_draft,
    DIFFERENCE: GET "/maps/{map}/drafts/{draft}/difference" => draft_difference,
    PUBLISH: POST "/maps/{map}/drafts/{draft}/publish" => publish_draft,
    REPLAY: POST "/maps/{map}/drafts/{draft}/replay" => replay_draft,
}

impl MapClient {
    /// Begins a draft: a map of its own, of this name, that no robot sees.
    pub async fn begin_draft(&self, map: &str, name: &str) -> Result<Draft, ClientError> {
        self.send(self.ask(&BEGIN, &[&map])?.json(&NewDraft { name: name.to_owned() })).await
    }

    /// The drafts of a map.
    pub async fn drafts(&self, map: &str) -> Result<Vec<Draft>, ClientError> {
        self.all(&LIST, &[&map]).await
    }

    /// Deletes a draft. The map stays as it is.
    pub async fn discard_draft(&self, map: &str, draft: &str) -> Result<(), ClientError> {
        self.done(self.ask(&DISCARD, &[&map, &draft])?).await
    }

    /// What publishing a draft would change, with one page of the landmarks that differ, and what
    /// is in the way.
    pub async fn draft_difference(
        &self,
        map: &str,
        draft: &str,
        query: &PageQuery,
    ) -> Result<DraftDifference, ClientError> {
        self.send(self.ask_query(&DIFFERENCE, &[&map, &draft], query)?).await
    }

    /// Publishes a draft by one commit of its map; the draft is gone then. Refused with `conflict`
    /// where both have changed the same.
    pub async fn publish_draft(&self, map: &str, draft: &str) -> Result<RollbackOutcome, ClientError> {
        self.send(self.ask(&PUBLISH, &[&map, &draft])?).await
    }

    /// Answers the last frames of the map's robots by map and draft, `frames` at most, and reports
    /// what differs.
    pub async fn replay_draft(
        &self,
        map: &str,
        draft: &str,
        frames: Option<usize>,
    ) -> Result<Replay, ClientError> {
        self.send(self.ask_query(&REPLAY, &[&map, &draft], &ReplayQuery { frames })?).await
    }
}
