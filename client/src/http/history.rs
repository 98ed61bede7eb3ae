//! Maps as versions: commits, differences, ways back.

use super::{map_client::MapClient, operation::operations};
use crate::ClientError;
use protos::api::{Commit, Difference, DifferenceQuery, Page, PageQuery, Rollback, RollbackOutcome};

operations! {
    LIST: GET "/maps/{map}/commits" => commits,
    GET: GET "/maps/{map}/commits/{commit}" => commit,
    DIFFERENCE: GET "/maps/{map}/difference" => difference,
    ROLL_BACK: POST "/maps/{map}/rollback" => roll_back,
    UNDO: POST "/maps/{map}/commits/{commit}/undo" => undo_commit,
}

impl MapClient {
    /// A page of the kept commits of a map, newest first.
    pub async fn commits(&self, map: &str, query: &PageQuery) -> Result<Page<Commit>, ClientError> {
        self.send(self.ask_query(&LIST, &[&map], query)?).await
    }

    /// One kept commit. Refused with `unknown_commit`.
    pub async fn commit(&self, map: &str, commit: u64) -> Result<Commit, ClientError> {
        self.send(self.ask(&GET, &[&map, &commit])?).await
    }

    /// What differs between a map at two kept commits, or at one and now, with one page of the
    /// landmarks that differ.
    pub async fn difference(&self, map: &str, query: &DifferenceQuery) -> Result<Difference, ClientError> {
        self.send(self.ask_query(&DIFFERENCE, &[&map], query)?).await
    }

    /// Makes a map what it was at a kept commit. Refused with `in_use` while a job works on it.
    pub async fn roll_back(&self, map: &str, to: u64) -> Result<RollbackOutcome, ClientError> {
        self.send(self.ask(&ROLL_BACK, &[&map])?.json(&Rollback { to })).await
    }

    /// Takes one commit back. Refused with `changed_since` if a later one has changed the same.
    pub async fn undo_commit(&self, map: &str, commit: u64) -> Result<RollbackOutcome, ClientError> {
        self.send(self.ask(&UNDO, &[&map, &commit])?).await
    }
}
