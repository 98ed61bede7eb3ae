//! Stored answers to frames, opened again.

use super::{map_client::MapClient, operation::operations};
use crate::ClientError;
use protos::api::{Page, StoredAnswer, StoredAnswerQuery, StoredAnswerSummary};

operations! {
    LIST: GET "/answers" => stored_answers,
    GET: GET "/answers/{answer}" => stored_answer,
    ICON: GET "/answers/{answer}/quads/{quad}/icon" => stored_quad_icon,
}

impl MapClient {
    /// A page of stored answers, newest first, with their number on all pages.
    pub async fn stored_answers(
        &self,
        query: &StoredAnswerQuery,
    ) -> Result<Page<StoredAnswerSummary>, ClientError> {
        self.send(self.ask_query(&LIST, &[], query)?).await
    }

    /// One stored answer: quads, candidates with their distances and thresholds, poses, paths of
    /// pictures.
    pub async fn stored_answer(&self, answer: i64) -> Result<StoredAnswer, ClientError> {
        self.send(self.ask(&GET, &[&answer])?).await
    }

    /// The icon of a quad of a stored answer, by its index: PNG.
    pub async fn stored_quad_icon(&self, answer: i64, quad: usize) -> Result<Vec<u8>, ClientError> {
        self.bytes(self.ask(&ICON, &[&answer, &quad])?).await
    }
}
